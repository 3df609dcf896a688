//! Effects where they act: arguments, labels, and the statements that effects stand for.

use std::collections::HashSet;

use super::{ActsOn, EffectKind, EffectRow, ScanBy, catalogue};

/// Coordinates that turn together when the axes are turned: a point in a plane or in space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Body {
    /// As it was declared, `body star = (x, y)`; `None` where its coordinates tell it.
    pub name: Option<String>,
    /// Names of its coordinates, two or three.
    pub coordinates: Vec<String>,
}

impl Body {
    /// As an argument among others: `star`, or `(x, y)`.
    pub fn text(&self) -> String {
        match &self.name {
            Some(name) => name.clone(),
            None => format!("({})", self.coordinates.join(", ")),
        }
    }

    /// As the only argument: `star`, or its coordinates.
    fn alone(&self) -> Vec<String> {
        match &self.name {
            Some(name) => vec![name.clone()],
            None => self.coordinates.clone(),
        }
    }
}

/// The names that an effect meets in a spec.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// As many as coordinates.
    pub momenta: Vec<String>,
    /// Whether energies are functions of velocities. Momenta are then no velocities times masses,
    /// and what takes energy away goes by velocities.
    pub velocities: bool,
    /// Coordinates, then what is measured with them.
    pub observables: Vec<String>,
    /// Name of time.
    pub time: String,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// Bodies that are declared, or seen.
    pub bodies: Vec<Body>,
    /// Coordinates that an effect with one coefficient may act on together, each list in the
    /// order of the coordinates; two or more of one unit.
    pub groups: Vec<Vec<String>>,
}

/// Why arguments do not fit an effect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Misfit {
    /// Too few or too many of them.
    Count,
    /// One of them stands there twice.
    Twice(String),
    /// It stands where a body should.
    NoBody(String),
    /// It stands where an input should, or an input where a coordinate should.
    NoInput(String),
}

impl Scene {
    /// The arguments of an effect as its label has them. Each of `given` is a name, or the names
    /// of the coordinates of a body.
    ///
    /// # Errors
    /// The arguments do not fit.
    pub fn arguments(&self, on: ActsOn, given: &[Vec<String>]) -> Result<Vec<String>, Misfit> {
        let names: Vec<String> = given.iter().flatten().cloned().collect();
        let mut seen = HashSet::new();
        if let Some(name) = names.iter().find(|name| !seen.insert(*name)) {
            return Err(Misfit::Twice(name.clone()));
        }
        let place = |name: &String| self.coordinates.iter().position(|known| known == name);
        match on {
            ActsOn::Coordinate if !names.is_empty() => {
                let mut names = names;
                names.sort_by_key(place);
                Ok(names)
            }
            ActsOn::Body => {
                let mut names = names;
                if !(2..=3).contains(&names.len()) || (given.len() > 1 && given.len() < names.len())
                {
                    return Err(match names.as_slice() {
                        [one] => Misfit::NoBody(one.clone()),
                        _ => Misfit::Count,
                    });
                }
                names.sort_by_key(place);
                Ok(self.body_of(&names).alone())
            }
            ActsOn::BodyPair => {
                let mut given = given.to_vec();
                let lone = given.iter().find(|names| !(2..=3).contains(&names.len())).cloned();
                if let Some([one]) = lone.as_deref() {
                    return Err(Misfit::NoBody(one.clone()));
                }
                given.sort_by_key(|names| names.first().and_then(place));
                match given.as_slice() {
                    [first, second] if first.len() == second.len() && lone.is_none() => {
                        Ok(vec![self.body_of(first).text(), self.body_of(second).text()])
                    }
                    _ => Err(Misfit::Count),
                }
            }
            ActsOn::Driven => match names.as_slice() {
                [first, second] if self.drives(first, second) => Ok(names),
                [_, second] if self.coordinates.contains(second) => {
                    Err(Misfit::NoInput(second.clone()))
                }
                [first, _] => Err(Misfit::NoInput(first.clone())),
                _ => Err(Misfit::Count),
            },
            _ if names.len() == on.count() => Ok(names),
            _ => Err(Misfit::Count),
        }
    }

    fn drives(&self, coordinate: &String, input: &String) -> bool {
        self.coordinates.contains(coordinate) && self.inputs.contains(input)
    }

    /// The declared body that has these coordinates, or one without a name.
    fn body_of(&self, names: &[String]) -> Body {
        let same = |body: &&Body| {
            body.coordinates.len() == names.len()
                && body.coordinates.iter().all(|own| names.contains(own))
        };
        let none = Body { name: None, coordinates: names.to_vec() };
        self.bodies.iter().filter(|body| body.name.is_some()).find(same).cloned().unwrap_or(none)
    }

    /// The coordinates of a declared body.
    pub fn body(&self, name: &str) -> Option<&Body> {
        self.bodies.iter().find(|body| body.name.as_deref() == Some(name))
    }

    /// What an argument stands for: the coordinates of a body, or the name itself.
    pub fn members(&self, argument: &str) -> Vec<String> {
        if let Some(body) = self.body(argument) {
            return body.coordinates.clone();
        }
        let inside = argument.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let names = inside.unwrap_or(argument).split(',');
        names.map(|name| name.trim().to_string()).collect()
    }

    fn momentum(&self, coordinate: &str) -> Option<&String> {
        self.momenta.get(self.coordinates.iter().position(|name| name == coordinate)?)
    }
}

/// An effect on its arguments.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Its row of the catalogue.
    pub effect: &'static EffectRow,
    /// Names of coordinates, observables or bodies, as its label has them.
    pub arguments: Vec<String>,
    /// The statement that adds it, inner parameters at their example values.
    pub statement: String,
}

impl Instance {
    /// An effect on these arguments.
    pub fn of(effect: &'static EffectRow, arguments: Vec<String>) -> Instance {
        let statement = effect.statement(&arguments, &[]);
        Instance { effect, arguments, statement }
    }

    /// `viscous_drag(theta)`.
    pub fn label(&self) -> String {
        self.effect.label(&self.arguments)
    }

    /// The statement that adds it, with these inner parameters in the order of the row.
    pub fn statement_with(&self, values: &[f64]) -> String {
        self.effect.statement(&self.arguments, values)
    }
}

impl EffectRow {
    /// `viscous_drag(theta)`; arguments in the order of the text, sorted where order means nothing.
    pub fn label(&self, arguments: &[String]) -> String {
        let mut arguments = arguments.to_vec();
        if self.on == ActsOn::Pair {
            arguments.sort();
        }
        format!("{}({})", self.name, arguments.join(", "))
    }

    /// What terms of it are called: `viscous_drag_theta`, `coupling_spring_q1_q2`.
    pub fn term_name(&self, arguments: &[String]) -> String {
        let mut out = self.name.to_string();
        for argument in arguments {
            out.push('_');
            let letters = argument.chars().filter_map(|c| match c {
                '-' => Some('m'),
                // Between the coordinates of a body.
                ',' => Some('_'),
                c => (c.is_alphanumeric() || c == '_').then_some(c),
            });
            out.extend(letters);
        }
        out
    }

    /// What an inner parameter is called in the model: `frequency_harmonic_drive_theta`.
    pub fn parameter_name(&self, parameter: &str, arguments: &[String]) -> String {
        format!("{parameter}_{}", self.term_name(arguments))
    }

    /// `effect harmonic_drive(theta; frequency = 2.5)`; values that are missing are examples.
    pub fn statement(&self, arguments: &[String], values: &[f64]) -> String {
        let settings: Vec<String> = (self.parameters.iter().enumerate())
            .map(|(i, scan)| {
                let value = values.get(i).copied().filter(|value| value.is_finite());
                format!("{} = {}", scan.name, value.unwrap_or(scan.example))
            })
            .collect();
        let gap = if settings.is_empty() { "" } else { "; " };
        format!("effect {}({}{gap}{})", self.name, arguments.join(", "), settings.join(", "))
    }

    /// Whether it brings internal states, which move and are not measured.
    pub fn has_states(&self) -> bool {
        self.template.starts_with("state ")
    }

    /// What a length of 1 is called in its terms, where they need one.
    pub fn unit_name(&self, arguments: &[String]) -> Option<String> {
        let needed = self.template.contains("{one}");
        needed.then(|| format!("one_{}", self.term_name(arguments)))
    }

    /// The template filled in for arguments of a scene; `None` where one is none of its names.
    pub fn filled(&self, scene: &Scene, arguments: &[String]) -> Option<String> {
        let mut text = self.template.replace("{n}", &self.term_name(arguments));
        for scan in self.parameters {
            let name = self.parameter_name(scan.name, arguments);
            text = text.replace(&format!("{{{}}}", scan.name), &name);
        }
        if let Some(name) = self.unit_name(arguments) {
            text = text.replace("{one}", &name);
        }
        text = text.replace("{t}", &scene.time);
        let input = match (self.on, arguments) {
            (ActsOn::Driven, [_, input]) => Some(input),
            _ => scene.inputs.first(),
        };
        if let Some(input) = input {
            text = text.replace("{input}", input);
        }
        if self.on.observes() {
            for (placeholder, argument) in ["{o}", "{u}"].iter().zip(arguments) {
                text = text.replace(placeholder, argument);
            }
            return Some(text);
        }
        let (first, second) = match (self.on, arguments) {
            (ActsOn::Coordinate, all) => (all.to_vec(), Vec::new()),
            (ActsOn::Driven, [first, _]) => (vec![first.clone()], Vec::new()),
            (ActsOn::Body, [body]) => (scene.members(body), Vec::new()),
            (ActsOn::Body, all) => (all.to_vec(), Vec::new()),
            (_, [first, second]) => (scene.members(first), scene.members(second)),
            _ => return None,
        };
        // A scale among the inner parameters is one of momenta.
        let by_velocity = scene.velocities
            && self.kind == EffectKind::Dissipative
            && self.parameters.iter().all(|scan| scan.by != ScanBy::Momentum);
        let momenta = |names: &[String]| -> Option<Vec<String>> {
            let of = |name: &String| match by_velocity {
                true => Some(format!("rate({name})")),
                false => scene.momentum(name).cloned(),
            };
            names.iter().map(of).collect()
        };
        let (p, s) = (momenta(&first)?, momenta(&second)?);
        let squares = |names: &[String]| -> String {
            let squares: Vec<String> = names.iter().map(|name| format!("{name}^2")).collect();
            format!("({})", squares.join(" + "))
        };
        let apart = first.iter().zip(&second).map(|(q, r)| format!("({r} - {q})^2"));
        let apart = format!("({})", apart.collect::<Vec<_>>().join(" + "));
        text = text.replace("{qq}", &squares(&first)).replace("{pp}", &squares(&p));
        text = text.replace("{dd}", &apart);
        let along: Vec<String> = first.iter().zip(&p).map(|(q, p)| format!("{q}*{p}")).collect();
        text = text.replace("{qp}", &format!("({})", along.join(" + ")));
        let mut statements = Vec::new();
        for statement in text.split(';') {
            let each = statement.contains("{q}") || statement.contains("{p}");
            for i in 0..if each { first.len() } else { 1 } {
                let mut one = statement.trim().to_string();
                for (placeholder, list) in
                    [("{q}", &first), ("{p}", &p), ("{r}", &second), ("{s}", &s)]
                {
                    if let Some(name) = list.get(i) {
                        one = one.replace(placeholder, name);
                    }
                }
                statements.push(one);
            }
        }
        Some(statements.join("; "))
    }

    /// Why it cannot act in a scene, whatever its arguments; `None` where it can.
    pub fn cannot(&self, scene: &Scene) -> Option<String> {
        if let Some(detector) = self.detector {
            return Some(format!("it is no term of a model; {detector}"));
        }
        if self.template.contains("{input}") && scene.inputs.is_empty() {
            return Some("it follows an input, and the system has none".to_string());
        }
        let there = if self.on.observes() { &scene.observables } else { &scene.coordinates };
        let (has, needs) = (there.len(), self.on.least());
        if has >= needs {
            return None;
        }
        let what = if self.on.observes() { "observable" } else { "coordinate" };
        let because = if self.why_two.is_empty() { "" } else { ": " };
        Some(format!(
            "it needs {} {what}s, and the system has {}{because}{}",
            if needs == 2 { "two" } else { "four" },
            match has {
                0 => "none".to_string(),
                n => format!("only {n}"),
            },
            self.why_two
        ))
    }

    /// Every choice of arguments in a scene.
    fn choices(&self, scene: &Scene) -> Vec<Vec<String>> {
        let one = |name: &String| vec![name.clone()];
        let names = if self.on.observes() { &scene.observables } else { &scene.coordinates };
        let pairs = |ordered: bool| {
            let mut out = Vec::new();
            for (i, first) in names.iter().enumerate() {
                for (j, second) in names.iter().enumerate() {
                    if i < j || (i > j && ordered) {
                        out.push(vec![first.clone(), second.clone()]);
                    }
                }
            }
            out
        };
        match self.on {
            ActsOn::Coordinate if self.has_states() => names.iter().map(one).collect(),
            ActsOn::Coordinate => names.iter().map(one).chain(scene.groups.clone()).collect(),
            ActsOn::Observable => names.iter().map(one).collect(),
            ActsOn::Driven => {
                let by = |name: &String| {
                    let pair = |input: &String| vec![name.clone(), input.clone()];
                    scene.inputs.iter().map(pair).collect::<Vec<_>>()
                };
                names.iter().flat_map(by).collect()
            }
            ActsOn::Pair => pairs(false),
            ActsOn::OrderedPair | ActsOn::ObservablePair => pairs(true),
            ActsOn::Body => scene.bodies.iter().map(Body::alone).collect(),
            ActsOn::BodyPair => {
                let mut out = Vec::new();
                for (i, first) in scene.bodies.iter().enumerate() {
                    for second in scene.bodies.iter().skip(i + 1) {
                        if first.coordinates.len() == second.coordinates.len() {
                            out.push(vec![first.text(), second.text()]);
                        }
                    }
                }
                out
            }
        }
    }
}

/// Every effect with a template, on every choice of arguments that a scene allows.
pub fn instances(scene: &Scene) -> Vec<Instance> {
    let rows = catalogue().filter(|row| row.cannot(scene).is_none());
    rows.flat_map(|effect| {
        let choices = effect.choices(scene).into_iter();
        choices.map(move |arguments| Instance::of(effect, arguments))
    })
    .collect()
}
