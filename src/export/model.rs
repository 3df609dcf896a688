//! The model as equations of motion, and names that generated code can use.

use std::collections::{HashMap, HashSet};

use super::{Export, IntegratorKind};
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{Delay, Expr, Function, Graph, Node, Parameter, Symbol, System};
use crate::fit::distribution::Distribution;
use crate::simplify::significant;

/// Equations of motion in a graph of their own. Coefficients and parameters are symbols,
/// so that expressions are the same as those that were fitted.
pub(super) struct Model {
    pub graph: Graph,
    pub energy: Expr,
    /// dH/dp_i.
    pub velocities: Vec<Expr>,
    /// F_i - dH/dq_i.
    pub accelerations: Vec<Expr>,
    /// F_i alone.
    pub forces: Vec<Expr>,
    /// Explicit change of H plus the power of the forces: what the energy changes by.
    pub power: Expr,
    /// Row by row the derivatives of velocities and accelerations by q_1 .. q_n, p_1 .. p_n.
    pub jacobian: Vec<Expr>,
    /// Values of the coefficients that occur, then of the parameters.
    pub constants: Vec<Constant>,
    /// The energy is a constant of the motion.
    pub conservative: bool,
    /// The inputs and rates of inputs that the functions name, sorted.
    pub inputs: Vec<Symbol>,
    /// Every derivative exists everywhere: no jump or kink such as in abs.
    pub smooth: bool,
}

/// A learned number.
pub(super) struct Constant {
    pub symbol: Symbol,
    pub name: String,
    pub value: f64,
    pub standard_error: f64,
    /// The term that it belongs to, or that it is a parameter.
    pub meaning: String,
    pub unit: Option<String>,
}

impl Model {
    /// Derives the equations of motion; an error when the integrator cannot take them.
    pub(super) fn new(export: &Export) -> Result<Model> {
        let law = export.law;
        let mut system = System::clone(law.system());
        let wrong = |message: &str| {
            Error::new(ErrorKind::Model, message, "fit the model again before exporting it")
        };
        let numbers = law.coefficients().iter().chain(law.parameters());
        let step = export.step();
        if !numbers.chain([&step]).all(|x| x.is_finite()) || step <= 0.0 {
            return Err(wrong("the model has a number or a step that is not finite"));
        }
        let energy = system.energy(law.support())?;
        let forces = system.force(law.support())?;
        let rates = system.rates(law.support())?;
        let state = system.state();
        let n = system.degrees();
        let constants = constants(export);
        let graph = &mut system.graph;
        let gradient = graph.gradient(energy, &state);
        let mut velocities = gradient[n..].to_vec();
        let mut accelerations = Vec::with_capacity(n);
        let mut change = vec![(1.0, graph.derivative(energy, Symbol::Time))];
        for symbol in graph.symbols(&[energy]) {
            if let Some(rate) = symbol.input_rate() {
                let slope = graph.derivative(energy, symbol);
                let rate = graph.symbol(rate);
                change.push((1.0, graph.multiply(slope, rate)));
            }
        }
        for &(i, rate) in &rates {
            velocities[i] = rate;
            change.push((1.0, graph.multiply(gradient[i], rate)));
        }
        for (i, &force) in forces.iter().enumerate() {
            if rates.iter().any(|&(state, _)| state == i) {
                accelerations.push(graph.number(0.0));
                continue;
            }
            accelerations.push(graph.subtract(force, gradient[i]));
            change.push((1.0, graph.multiply(force, velocities[i])));
        }
        let power = graph.linear(0.0, &change);
        let field: Vec<Expr> = velocities.iter().chain(&accelerations).copied().collect();
        let columns: Vec<Vec<Expr>> =
            state.iter().map(|&symbol| graph.derivatives(&field, symbol)).collect();
        let jacobian: Vec<Expr> =
            (0..2 * n).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        let separable = (0..n).all(|i| {
            let q = Symbol::Coordinate(i);
            let p = Symbol::Momentum(i);
            velocities.iter().all(|&v| !graph.depends_on(v, q))
                && accelerations.iter().all(|&a| !graph.depends_on(a, p))
        });
        if matches!(export.integrator.kind, IntegratorKind::Splitting { .. }) && !separable {
            return Err(Error::new(
                ErrorKind::Export,
                format!(
                    "`{}` cannot integrate this model: dq/dt depends on q, or dp/dt on p",
                    export.integrator.name
                ),
                "fit it with an implicit method",
            ));
        }
        if let IntegratorKind::Implicit(tableau) | IntegratorKind::Explicit(tableau) =
            &export.integrator.kind
        {
            let stages = tableau.weights.len();
            if tableau.nodes.len() != stages || tableau.matrix.len() != stages * stages {
                return Err(wrong("the integrator's tableau is not square"));
            }
        }
        let mut roots = field.clone();
        roots.extend([energy, power]);
        let infinite = |part: Expr| graph.as_number(part).is_some_and(|x| !x.is_finite());
        if graph.topological(&roots).into_iter().any(infinite) {
            return Err(Error::new(
                ErrorKind::Export,
                "the equations of motion hold a number that is not finite",
                "look for a division by zero in the spec",
            ));
        }
        let conservative = graph.is_zero(power);
        let mut acting = forces.clone();
        acting.push(energy);
        acting.extend(rates.iter().map(|&(_, rate)| rate));
        let smooth = !graph
            .topological(&acting)
            .into_iter()
            .any(|part| matches!(graph.node(part), Node::Apply(f, _) if !f.row().is_smooth()));
        let mut named = roots.clone();
        named.extend(jacobian.iter().chain(&forces).copied());
        let mut inputs = graph.symbols(&named);
        inputs.retain(|symbol| symbol.is_driving());
        Ok(Model {
            inputs,
            energy,
            velocities,
            accelerations,
            forces,
            power,
            jacobian,
            constants,
            conservative,
            smooth,
            graph: system.graph,
        })
    }

    /// dq/dt, then dp/dt.
    pub(super) fn field(&self) -> Vec<Expr> {
        self.velocities.iter().chain(&self.accelerations).copied().collect()
    }

    /// Functions of the table that any of the expressions calls.
    pub(super) fn functions(&self) -> Vec<Function> {
        let mut roots = vec![self.energy, self.power];
        roots.extend(&self.forces);
        roots.extend(&self.jacobian);
        roots.extend(self.field());
        let mut functions: Vec<Function> = self
            .graph
            .topological(&roots)
            .into_iter()
            .filter_map(|part| match self.graph.node(part) {
                Node::Apply(function, _) => Some(*function),
                _ => None,
            })
            .collect();
        functions.sort_unstable();
        functions.dedup();
        functions
    }
}

fn constants(export: &Export) -> Vec<Constant> {
    let (law, names) = (export.law, export.system().names());
    let errors = law.standard_errors();
    let (of_coefficients, of_parameters) = errors.split_at(law.support().len());
    let mut out = Vec::new();
    for ((id, term, value), &standard_error) in law.terms().zip(of_coefficients) {
        let symbol = Symbol::Coefficient(id.position());
        let mut meaning = term.label.clone();
        if term.parts().all(|(place, _)| place.is_sensor()) {
            meaning += ", a part of the instrument: it moves nothing and is not simulated";
        }
        out.push(Constant {
            symbol,
            name: names.of(symbol),
            value,
            standard_error,
            meaning,
            unit: term.unit_text.clone(),
        });
    }
    let parameters = export.system().parameters.iter().zip(law.parameters());
    for (i, ((parameter, &value), &standard_error)) in parameters.zip(of_parameters).enumerate() {
        out.push(Constant {
            symbol: Symbol::Parameter(i),
            name: parameter.name.clone(),
            value,
            standard_error,
            meaning: meaning(parameter, law.distributions()),
            unit: parameter.unit_text.clone(),
        });
    }
    out
}

/// What an inner parameter is. One that runs have for themselves has the mean of its values.
fn meaning(parameter: &Parameter, distributions: &[Distribution]) -> String {
    let Some(per) = &parameter.per else { return "parameter".to_string() };
    let spread = distributions.iter().find(|found| found.name == parameter.name);
    let spread = spread.map_or(String::new(), |found| {
        format!(" (which spread by {})", significant(found.spread, 3))
    });
    let word = per.word();
    format!(
        "parameter, the mean of the values of each {word}{spread}: put that of one {word} here to follow it"
    )
}

/// Names of symbols in generated code: letters, digits and underscores, each only once.
pub(super) struct Identifiers {
    names: HashMap<Symbol, String>,
    taken: HashSet<String>,
}

impl Identifiers {
    /// `reserved` are the words that the language and the generated code use themselves.
    /// Constants get capital letters when `capitals`, and variables small ones.
    pub(super) fn new<'a>(
        export: &Export,
        model: &Model,
        reserved: impl Iterator<Item = &'a str>,
        capitals: bool,
    ) -> Identifiers {
        let mut identifiers =
            Identifiers { names: HashMap::new(), taken: reserved.map(str::to_string).collect() };
        let names = export.system().names();
        let state = export.system().state().into_iter().chain([Symbol::Time]);
        for symbol in state.chain(model.inputs.iter().copied()) {
            let mut name = match symbol {
                Symbol::Delayed(input, order, _) => {
                    format!("{}_delayed", identifier(&names.of(Symbol::Input(input, order))))
                }
                _ => identifier(&names.of(symbol)),
            };
            if capitals {
                name = name.to_ascii_lowercase();
            }
            identifiers.insert(symbol, name);
        }
        for constant in &model.constants {
            let mut name = identifier(&constant.name);
            if capitals {
                name = name.to_ascii_uppercase();
            }
            identifiers.insert(constant.symbol, name);
        }
        identifiers
    }

    fn insert(&mut self, symbol: Symbol, name: String) {
        let unique = self.unique(&name);
        self.names.insert(symbol, unique);
    }

    /// The name itself, or with a number behind it when it is taken.
    fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_string();
        let mut count = 1;
        while !self.taken.insert(unique.clone()) {
            count += 1;
            unique = format!("{name}_{count}");
        }
        unique
    }

    pub(super) fn of(&self, symbol: Symbol) -> &str {
        self.names.get(&symbol).map_or("undefined", String::as_str)
    }

    /// A delay in generated code.
    pub(super) fn delay(&self, by: Delay) -> String {
        match by {
            Delay::Number(number) => format!("{:?}", number.value()),
            Delay::Parameter(j) => self.of(Symbol::Parameter(j)).to_string(),
        }
    }

    /// A letter for numbered locals, such that no name begins with it and goes on in digits.
    pub(super) fn local_prefix(&self) -> &'static str {
        let free = |prefix: &&str| {
            !self.taken.iter().any(|name| {
                name.strip_prefix(*prefix)
                    .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
            })
        };
        ["x", "s", "w", "part"].into_iter().find(free).unwrap_or("local_value_")
    }
}

/// Small letters with accents, and without.
const ACCENTED: &str = "àáâãäåçèéêëìíîïñòóôõöøùúûüýÿ";
const BARE: &str = "aaaaaaceeeeiiiinoooooouuuuyy";

/// `q[1]` is q1, `k[1,2]` is k1_2, θ is theta.
pub(super) fn identifier(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        match c {
            c if c.is_ascii_alphanumeric() || c == '_' => out.push(c),
            ',' => out.push('_'),
            '[' | ']' | ' ' => {}
            c if ACCENTED.contains(c) => {
                let at = ACCENTED.chars().position(|accented| accented == c);
                out.extend(at.and_then(|at| BARE.chars().nth(at)));
            }
            c => {
                let tex = super::letters::name(&c.to_string());
                out.extend(tex.replace("mathrm", "").chars().filter(char::is_ascii_alphanumeric));
            }
        }
    }
    if !out.starts_with(|c: char| c.is_ascii_alphabetic()) {
        out.insert(0, 'x');
    }
    out
}
