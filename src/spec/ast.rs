//! The syntax tree of a spec. Every node knows the place that it was read from.
//!
//! Nodes and their fields are named after the productions of `grammar/leverrier.ebnf`.
#![allow(missing_docs, reason = "the grammar says what each part of a production is")]

use crate::data::Interpolation;
use crate::diagnostic::Span;

/// A place in the text. All sites are equal: trees compare by what they say.
#[derive(Debug, Clone, Copy, Default)]
pub struct Site(pub Span);

impl PartialEq for Site {
    fn eq(&self, _: &Site) -> bool {
        true
    }
}

/// A whole spec: its statements in the order of the text.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SyntaxTree {
    pub statements: Vec<Statement>,
    /// First words of statements that could not be read.
    pub lost: Vec<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    pub kind: StatementKind,
    pub site: Site,
    /// The effect that it was made from, `viscous_drag(theta)`; none in what was read.
    pub effect: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum StatementKind {
    /// `system "bench pendulum"`
    System(Word),
    /// `coordinates q[1..5] [m], theta [rad]`
    Variables { role: Role, list: Vec<Declaration> },
    /// `time t [s]`
    Time { name: Word, unit: Option<UnitText> },
    /// `input u [N] { linear }`
    Input { name: Word, unit: Option<UnitText>, between: Between },
    /// `hidden z [m] = 0.1 with p_z = 2`: a coordinate that nobody measures.
    Hidden(HiddenStart, Option<HiddenStart>),
    /// `state w [N] = 0 { w' = a*rate(x) - b*w }`: an internal state of first order.
    State { of: HiddenStart, rate: Expression },
    /// `data "file.csv" { time t [s]  run trial }`
    Data { file: Word, items: Vec<DataItem> },
    /// `constant g = 9.81 [m/s^2]`, or `let x = l*sin(a)`, which may be any expression.
    Constant { name: Word, value: Expression, by_let: bool },
    /// `param a = 0, 1 in -2..2`, `param k per run = 4 in 0..`
    Parameter { name: Word, per: Option<Word>, starts: Vec<Expression>, bounds: Option<Limits> },
    /// `T = ...`, `V += ...`
    Energy { part: EnergyPart, adds: bool, value: Expression },
    /// `force q[i] += ... for i in 1..5`
    Force {
        coordinate: Expression,
        adds: bool,
        value: Expression,
        comprehension: Option<Comprehension>,
    },
    /// `sensor theta += ... for i in 1..5`
    Sensor { observable: Expression, value: Expression, comprehension: Option<Comprehension> },
    /// `measure r [m] = sqrt(x^2 + y^2)`: what a column shows.
    Measure { name: Word, unit: Option<UnitText>, value: Expression, wrapped: bool },
    /// `body star = (x, y)`
    Body { name: Word, coordinates: Vec<Expression> },
    /// `effect harmonic_drive(theta; frequency = 2)`
    Effect { name: Word, arguments: Vec<Argument>, settings: Vec<Setting> },
    /// `candidates { wall: V += span{ q^4 } }`
    Candidates(Vec<Candidate>),
    /// `constrain -1 <= k <= 5`: operands with a relation between each and the next.
    Constrain { first: Operand, rest: Vec<(Relation, Operand)> },
}

/// `z [m] = 0.1`: what nobody measures, and what its value at the start of a run is looked for
/// from.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenStart {
    pub name: Word,
    pub unit: Option<UnitText>,
    pub start: Option<Expression>,
    pub site: Site,
}

/// What an input does between its samples; its word as it was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Between {
    pub interpolation: Interpolation,
    pub word: Word,
}

/// What an effect acts on.
#[derive(Debug, Clone, PartialEq)]
pub enum Argument {
    /// A coordinate, an observable or the name of a body.
    Variable(Expression),
    /// `(x, y)`, a body by its coordinates.
    Body(Vec<Expression>, Site),
}

impl Argument {
    /// Its variables.
    pub fn variables(&self) -> &[Expression] {
        match self {
            Argument::Variable(one) => std::slice::from_ref(one),
            Argument::Body(list, _) => list,
        }
    }

    /// Where it stands.
    pub fn span(&self) -> Span {
        match self {
            Argument::Variable(one) => one.site.0,
            Argument::Body(_, site) => site.0,
        }
    }
}

/// `frequency = 2.5 [1/s]`
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    pub name: Word,
    pub value: Expression,
    pub site: Site,
}

/// An effect of the user's own: statements that belong to the model once it is added.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    pub name: Word,
    pub statements: Vec<Statement>,
    pub site: Site,
}

/// A name, or the inside of a quoted text.
#[derive(Debug, Clone, PartialEq)]
pub struct Word {
    pub text: String,
    pub site: Site,
}

/// What stands between the brackets of a unit.
pub type UnitText = Word;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Coordinates,
    Momenta,
    Velocities,
}

impl Role {
    pub fn keyword(self) -> &'static str {
        match self {
            Role::Coordinates => "coordinates",
            Role::Momenta => "momenta",
            Role::Velocities => "velocities",
        }
    }
}

/// `q[1..5] [m]`: one variable or an indexed family of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Declaration {
    pub name: Word,
    pub range: Option<Range>,
    pub unit: Option<UnitText>,
    pub site: Site,
}

/// `1..n`, both ends included.
#[derive(Debug, Clone, PartialEq)]
pub struct Range {
    pub first: Box<Expression>,
    pub last: Box<Expression>,
    pub site: Site,
}

/// `-1..1`; a missing side is not bounded.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    pub lower: Option<Expression>,
    pub upper: Option<Expression>,
    pub site: Site,
}

#[derive(Debug, Clone, PartialEq)]
pub struct DataItem {
    pub kind: DataItemKind,
    pub site: Site,
}

#[derive(Debug, Clone, PartialEq)]
pub enum DataItemKind {
    /// `time t [s]`
    Time { column: Word, unit: Option<UnitText> },
    /// `every 10 [ms]`: no column holds the time, and samples follow each other so.
    Every(Expression),
    /// `run trial`
    Run(Word),
    /// `pairs`: every two rows are one transition.
    Pairs,
    /// `theta = angle [deg] error angle_err [deg]`
    Column {
        variable: Expression,
        column: Word,
        unit: Option<UnitText>,
        error: Option<ErrorColumn>,
    },
    /// `omega not measured`: no column holds it.
    NotMeasured(Expression),
}

/// The column that holds the standard error of each value of another; in its unit without one.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorColumn {
    pub column: Word,
    pub unit: Option<UnitText>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum EnergyPart {
    Kinetic,
    Potential,
    Hamiltonian,
    /// Of coordinates and velocities.
    Lagrangian,
}

impl EnergyPart {
    pub fn letter(self) -> &'static str {
        match self {
            EnergyPart::Kinetic => "T",
            EnergyPart::Potential => "V",
            EnergyPart::Hamiltonian => "H",
            EnergyPart::Lagrangian => "L",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub enum Operand {
    Value(Expression),
    /// `terms of T`
    Terms(Target, Site),
}

/// Whose terms a constraint speaks of.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    Energy(EnergyPart),
    Force(Expression),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
}

impl Relation {
    pub const ALL: [Relation; 6] = [
        Relation::Less,
        Relation::LessOrEqual,
        Relation::Greater,
        Relation::GreaterOrEqual,
        Relation::Equal,
        Relation::Unequal,
    ];

    pub fn sign(self) -> &'static str {
        match self {
            Relation::Less => "<",
            Relation::LessOrEqual => "<=",
            Relation::Greater => ">",
            Relation::GreaterOrEqual => ">=",
            Relation::Equal => "==",
            Relation::Unequal => "!=",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    pub kind: ExpressionKind,
    pub site: Site,
}

impl Expression {
    /// What it is directly made of, indices and the order of a family left aside.
    pub fn parts(&self) -> Vec<&Expression> {
        match &self.kind {
            ExpressionKind::Number(_)
            | ExpressionKind::Name(_)
            | ExpressionKind::Index { .. }
            | ExpressionKind::Slice { .. } => Vec::new(),
            ExpressionKind::Quantity(inner, _) | ExpressionKind::Negate(inner) => vec![&**inner],
            ExpressionKind::Sum(parts) | ExpressionKind::Product(parts) => {
                parts.iter().map(|(_, part)| part).collect()
            }
            ExpressionKind::Power(base, exponent) => vec![&**base, &**exponent],
            ExpressionKind::Call { arguments, .. } => arguments.iter().collect(),
            ExpressionKind::SumOver { body, .. } => vec![&**body],
            ExpressionKind::Span(items) => items.iter().map(|item| &item.body).collect(),
        }
    }

    /// Whether a variable, family or function of these names stands in it.
    pub fn mentions(&self, names: &[&str]) -> bool {
        let named = match &self.kind {
            ExpressionKind::Name(name)
            | ExpressionKind::Index { name, .. }
            | ExpressionKind::Slice { name, .. }
            | ExpressionKind::Call { name, .. } => names.contains(&name.as_str()),
            _ => false,
        };
        named || self.parts().into_iter().any(|part| part.mentions(names))
    }
}

/// Sums and products are flat, so that a long one is not a deep one.
#[derive(Debug, Clone, PartialEq)]
pub enum ExpressionKind {
    Number(f64),
    Name(String),
    /// `q[i+1]`
    Index {
        name: String,
        index: Box<Expression>,
    },
    /// `q[1..3]`, an argument of a family.
    Slice {
        name: String,
        range: Range,
    },
    /// `9.81 [m/s^2]`
    Quantity(Box<Expression>, UnitText),
    Negate(Box<Expression>),
    /// Terms with true where one is subtracted; the first never is.
    Sum(Vec<(bool, Expression)>),
    /// Factors with true where one divides; the first never does.
    Product(Vec<(bool, Expression)>),
    Power(Box<Expression>, Box<Expression>),
    /// `sin(x)`, or with what follows a semicolon `poly(q; 3)`.
    Call {
        name: String,
        arguments: Vec<Expression>,
        order: Option<Box<Expression>>,
    },
    /// `sum(q[i]^2 for i in 1..5)`
    SumOver {
        body: Box<Expression>,
        comprehension: Comprehension,
    },
    /// `span{ ... }`
    Span(Vec<Item>),
}

/// One item of a function space: `k: q[i]^2 for i in 1..5 alike`.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    pub name: Option<Word>,
    pub body: Expression,
    pub comprehension: Option<Comprehension>,
    /// Whether all that the comprehension makes has one coefficient.
    pub alike: bool,
    pub site: Site,
}

/// `for i in 1..4, j in 1..5 where i < j`
#[derive(Debug, Clone, PartialEq)]
pub struct Comprehension {
    pub bindings: Vec<Binding>,
    pub conditions: Vec<Comparison>,
    pub site: Site,
}

/// `i in 1..4`
#[derive(Debug, Clone, PartialEq)]
pub struct Binding {
    pub name: Word,
    pub range: Range,
}

/// `i < j`
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    pub left: Expression,
    pub relation: Relation,
    pub right: Expression,
}
