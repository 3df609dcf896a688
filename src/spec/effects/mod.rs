//! The catalogue of physical effects that a model may lack: one row each.
//!
//! A row holds statements of the mini-language with placeholders. The statement
//! `effect viscous_drag(theta)` stands for them, with the placeholders filled in.

mod bodies;
mod conservative;
mod dissipative;
mod driven;
mod input;
mod memory;
mod motion;
mod scene;
mod sensor;

use super::nearest;
pub use scene::{Body, Instance, Misfit, Scene, instances};

/// What an effect does to the motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EffectKind {
    /// It takes energy away, or feeds it in.
    Dissipative,
    /// It is a part of the potential.
    Conservative,
    /// It changes how energy depends on momenta.
    Kinetic,
    /// It turns velocities and does no work, or comes from a turning frame.
    Gyroscopic,
    /// It depends on time itself.
    TimeDependent,
    /// It is in the instrument: it moves nothing.
    Sensor,
}

impl EffectKind {
    /// Every kind, in the order in which they are listed.
    pub const ALL: [EffectKind; 6] = [
        EffectKind::Dissipative,
        EffectKind::Conservative,
        EffectKind::Kinetic,
        EffectKind::Gyroscopic,
        EffectKind::TimeDependent,
        EffectKind::Sensor,
    ];

    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            EffectKind::Dissipative => "dissipative",
            EffectKind::Conservative => "conservative",
            EffectKind::Kinetic => "kinetic",
            EffectKind::Gyroscopic => "gyroscopic",
            EffectKind::TimeDependent => "time-dependent",
            EffectKind::Sensor => "sensor",
        }
    }
}

/// What an effect acts on: its arguments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActsOn {
    /// One coordinate, or several that share its coefficients and inner parameters.
    Coordinate,
    /// A coordinate, and the input that drives it.
    Driven,
    /// Two coordinates; which comes first makes no difference.
    Pair,
    /// Two coordinates; the first is not treated like the second.
    OrderedPair,
    /// One measured column.
    Observable,
    /// Two measured columns: what is wrong, and where it comes from.
    ObservablePair,
    /// One body: two or three coordinates that turn together when the axes are turned.
    Body,
    /// Two bodies with as many coordinates each; which comes first makes no difference.
    BodyPair,
}

impl ActsOn {
    /// How many arguments it takes, at least.
    pub fn count(self) -> usize {
        match self {
            ActsOn::Coordinate | ActsOn::Observable | ActsOn::Body => 1,
            ActsOn::Driven | ActsOn::Pair | ActsOn::OrderedPair => 2,
            ActsOn::ObservablePair | ActsOn::BodyPair => 2,
        }
    }

    /// Whether it takes whole bodies.
    pub fn is_of_bodies(self) -> bool {
        matches!(self, ActsOn::Body | ActsOn::BodyPair)
    }

    /// How many coordinates or observables a system must have for it.
    pub fn least(self) -> usize {
        match self {
            ActsOn::Driven => 1,
            _ if self.is_of_bodies() => 2 * self.count(),
            _ => self.count(),
        }
    }

    /// Whether the arguments are measured columns, not coordinates.
    pub fn observes(self) -> bool {
        matches!(self, ActsOn::Observable | ActsOn::ObservablePair)
    }

    /// In words, as what an effect takes.
    pub fn text(self) -> &'static str {
        match self {
            ActsOn::Coordinate => "one or more coordinates",
            ActsOn::Driven => "a coordinate and an input",
            ActsOn::Pair | ActsOn::OrderedPair => "two coordinates",
            ActsOn::Observable => "one observable",
            ActsOn::ObservablePair => "two observables",
            ActsOn::Body => "one body",
            ActsOn::BodyPair => "two bodies",
        }
    }
}

/// How an inner parameter is looked for, and what it measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanBy {
    /// An angular frequency: from one turn in a whole run to half the sampling rate.
    Frequency,
    /// A value of the coordinate, over the range of the data.
    Position,
    /// A value of the coordinate that it never reaches, beyond either end of the data.
    Beyond,
    /// A distance of the coordinate, over fractions of the range of the data.
    Length,
    /// The range of a force: a distance, from fractions of the range of the data to many times it.
    Range,
    /// A number of radians a unit of the coordinate.
    WaveNumber,
    /// An instant of time, over the runs.
    Instant,
    /// A stretch of time, from a sample to a run.
    Duration,
    /// A pure number, as a power.
    Exponent,
    /// A pure number, as the power of a distance in a potential.
    Power,
    /// A pure number, as the ratio of two things of a kind.
    Ratio,
    /// A size of the momentum, over fractions of the range of the data.
    Momentum,
    /// The inverse of a stretch of time.
    Rate,
    /// A size of the input, over fractions of the largest.
    Level,
    /// A stretch of time, from a part of a sample to some dozens.
    Delay,
}

impl ScanBy {
    /// Whether it is what something is divided by, or the like: positive, and never zero.
    pub fn is_scale(self) -> bool {
        match self {
            ScanBy::Length | ScanBy::Range | ScanBy::WaveNumber | ScanBy::Duration => true,
            ScanBy::Momentum | ScanBy::Level | ScanBy::Delay => true,
            ScanBy::Frequency | ScanBy::Position | ScanBy::Beyond | ScanBy::Instant => false,
            ScanBy::Exponent | ScanBy::Power | ScanBy::Ratio | ScanBy::Rate => false,
        }
    }

    /// Whether it is looked for where there are data, and nowhere else.
    pub fn is_seen_inside_only(self) -> bool {
        matches!(self, ScanBy::Position | ScanBy::Beyond | ScanBy::Instant | ScanBy::WaveNumber)
    }

    /// Whether an effect at an end of its range stands in for a simpler one.
    pub fn ends_in_another(self) -> bool {
        match self {
            ScanBy::Rate | ScanBy::Range | ScanBy::Exponent | ScanBy::Power => true,
            ScanBy::Momentum | ScanBy::Level | ScanBy::Delay | ScanBy::Frequency => true,
            ScanBy::WaveNumber | ScanBy::Position | ScanBy::Beyond => true,
            ScanBy::Length | ScanBy::Instant | ScanBy::Duration | ScanBy::Ratio => false,
        }
    }

    /// The unit as a text in which `{q}`, `{p}`, `{t}` and `{u}` stand for those of the coordinate,
    /// its momentum, time and the input; empty for a pure number.
    fn unit(self) -> &'static str {
        match self {
            ScanBy::Frequency | ScanBy::Rate => "1/{t}",
            ScanBy::Position | ScanBy::Beyond | ScanBy::Length | ScanBy::Range => "{q}",
            ScanBy::WaveNumber => "1/{q}",
            ScanBy::Instant | ScanBy::Duration | ScanBy::Delay => "{t}",
            ScanBy::Exponent | ScanBy::Power | ScanBy::Ratio => "",
            ScanBy::Momentum => "{p}",
            ScanBy::Level => "{u}",
        }
    }

    /// The unit in the units of the variables; `None` where one that it needs is not known.
    pub fn unit_text(
        self,
        coordinate: Option<&str>,
        momentum: Option<&str>,
        time: Option<&str>,
        input: Option<&str>,
    ) -> Option<String> {
        let mut text = self.unit().to_string();
        for (placeholder, unit) in
            [("{q}", coordinate), ("{p}", momentum), ("{t}", time), ("{u}", input)]
        {
            if text.contains(placeholder) {
                let unit = unit?;
                // A unit of several pieces is divided by as a whole.
                let whole = text.starts_with("1/") && !unit.chars().all(char::is_alphabetic);
                let unit = if whole { format!("({unit})") } else { unit.to_string() };
                text = text.replace(placeholder, &unit);
            }
        }
        (!text.is_empty()).then_some(text)
    }
}

/// An inner parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scan {
    /// As in `effect harmonic_drive(theta; frequency = 2)`, and between braces in the template.
    pub name: &'static str,
    /// How it is looked for.
    pub by: ScanBy,
    /// A plain value, for examples.
    pub example: f64,
}

/// A physical effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectRow {
    /// Its name in the mini-language.
    pub name: &'static str,
    /// Other names that it goes by.
    pub aliases: &'static [&'static str],
    /// What sort of physics it is.
    pub kind: EffectKind,
    /// What it takes as arguments.
    pub on: ActsOn,
    /// Statements with placeholders: {q} {p} the first argument's coordinate and momentum,
    /// {r} {s} those of the second, {o} {u} the observables, {t} time, {input} the second argument
    /// where that is an input and the first input elsewhere, {n}
    /// a name made of the effect and its arguments, and the inner parameters by their names. On
    /// bodies, {qq} is the sum of the squares of the first one's coordinates, {pp} that of its
    /// momenta, {qp} that of the products of both, {dd} the square of the distance to the second,
    /// and {one} a length of 1 in the coordinates' unit; a statement with {q} in it stands once for
    /// every coordinate, one without it stands once. Empty where no statement describes it; then
    /// `detector` says what finds it.
    pub template: &'static str,
    /// Its inner parameters, and how they are looked for.
    pub parameters: &'static [Scan],
    /// Its coordinates must be angles: pure numbers.
    pub angle: bool,
    /// Its coordinates must have one unit.
    pub one_unit: bool,
    /// All of the force goes through it: its coefficient is the gain of the input, where that is
    /// known.
    pub whole: bool,
    /// None of its coefficients is negative: the opposite is no such effect, and has another name.
    pub positive: bool,
    /// Why it needs two arguments, where it does.
    pub why_two: &'static str,
    /// The effect that it is a second one of, with other numbers: alone it goes by that name.
    pub second_of: Option<&'static str>,
    /// The simpler effect that it is where its two coefficients are equal.
    pub where_equal: Option<&'static str>,
    /// What finds it, when it is no term of a model.
    pub detector: Option<&'static str>,
    /// The physics in a sentence.
    pub physics: &'static str,
    /// What it looks like in data.
    pub telltale: &'static str,
    /// Where it is described.
    pub reference: &'static str,
}

/// What rows leave out.
const ROW: EffectRow = EffectRow {
    name: "",
    aliases: &[],
    kind: EffectKind::Conservative,
    on: ActsOn::Coordinate,
    template: "",
    parameters: &[],
    angle: false,
    one_unit: false,
    whole: false,
    positive: false,
    why_two: "",
    second_of: None,
    where_equal: None,
    detector: None,
    physics: "",
    telltale: "",
    reference: "",
};

/// The tables of rows, by kind. A new effect is one row in one of them.
static TABLES: [&[EffectRow]; 8] = [
    dissipative::ROWS,
    conservative::ROWS,
    motion::ROWS,
    bodies::ROWS,
    driven::ROWS,
    input::ROWS,
    sensor::ROWS,
    memory::ROWS,
];

/// Every effect of the catalogue.
pub fn catalogue() -> impl Iterator<Item = &'static EffectRow> {
    TABLES.iter().flat_map(|rows| rows.iter())
}

/// Looks an effect up by its name or another one that it goes by.
pub fn by_name(name: &str) -> Option<&'static EffectRow> {
    catalogue().find(|row| row.name == name || row.aliases.contains(&name))
}

impl EffectRow {
    /// The row of a second one beside this, where the catalogue has it.
    pub fn second(&self) -> Option<&'static EffectRow> {
        catalogue().find(|row| row.second_of == Some(self.name))
    }
}

/// The label of a second one of the effect with this label, where the catalogue has it.
pub fn label_of_second(label: &str) -> Option<String> {
    let (name, arguments) = label.split_once('(')?;
    Some(format!("{}({arguments}", by_name(name)?.second()?.name))
}

/// Names that a mistyped one may have meant, `more` names among them; a sentence.
pub fn hint_for(name: &str, more: &[&str]) -> String {
    let names = catalogue().flat_map(|row| row.aliases.iter().copied().chain([row.name]));
    match nearest(name, names.chain(more.iter().copied())) {
        Some(near) => format!("did you mean `{near}`?"),
        None => {
            // A word of the name may still be one of an effect's.
            let words: Vec<&str> = name.split('_').filter(|word| word.len() > 3).collect();
            let related: Vec<&str> = catalogue()
                .filter(|row| words.iter().any(|word| row.name.contains(word)))
                .map(|row| row.name)
                .collect();
            if related.is_empty() {
                "`leverrier effects` lists every effect".to_string()
            } else {
                format!("near to it are {}", related.join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_row_is_complete_and_has_a_name_of_its_own() {
        let mut names = HashSet::new();
        for row in catalogue() {
            for name in row.aliases.iter().copied().chain([row.name]) {
                assert!(names.insert(name), "{name} twice");
                assert!(super::super::may_name(name), "{name} is a word of the language");
            }
            for text in [row.physics, row.telltale, row.reference] {
                assert!(text.len() > 15, "{}: {text}", row.name);
            }
            assert_eq!(row.template.is_empty(), row.detector.is_some(), "{}", row.name);
            for scan in row.parameters {
                assert!(row.template.contains(&format!("{{{}}}", scan.name)), "{}", row.name);
            }
            let pairs = matches!(
                row.on,
                ActsOn::Pair | ActsOn::OrderedPair | ActsOn::Body | ActsOn::BodyPair
            );
            assert_eq!(pairs, !row.why_two.is_empty(), "{}", row.name);
            assert!(row.kind != EffectKind::Dissipative || row.positive, "{}", row.name);
        }
        assert!(catalogue().count() >= 80);
        assert!(EffectKind::ALL.iter().all(|&kind| catalogue().any(|row| row.kind == kind)));
    }

    #[test]
    fn pairs_are_taken_once_where_order_means_nothing() {
        let names = |letter: &str| (1..=3).map(|i| format!("{letter}[{i}]")).collect::<Vec<_>>();
        let scene = Scene {
            coordinates: names("q"),
            momenta: names("p"),
            observables: [names("q"), names("p")].concat(),
            time: "t".into(),
            ..Scene::default()
        };
        let count = |name: &str| {
            instances(&scene).iter().filter(|instance| instance.effect.name == name).count()
        };
        assert_eq!(count("viscous_drag"), 3);
        assert_eq!(count("coupling_spring"), 3);
        assert_eq!(count("magnetic_gradient"), 6);
        assert_eq!(count("sensor_offset"), 6);
        assert_eq!(count("sensor_cross_talk"), 30);
        let row = by_name("coupling_spring").map(|row| {
            let arguments = ["q[2]".to_string(), "q[1]".to_string()];
            (row.label(&arguments), row.term_name(&arguments))
        });
        let expected = ("coupling_spring(q[1], q[2])", "coupling_spring_q2_q1");
        assert_eq!(row, Some((expected.0.to_string(), expected.1.to_string())));
    }

    #[test]
    fn a_mistyped_name_finds_the_nearest() {
        assert_eq!(hint_for("viscous_darg", &[]), "did you mean `viscous_drag`?");
        assert_eq!(hint_for("my_wal", &["my_wall"]), "did you mean `my_wall`?");
        assert!(hint_for("drag_linear", &[]).contains("viscous_drag"));
        assert!(hint_for("zzz", &[]).contains("leverrier effects"));
    }
}
