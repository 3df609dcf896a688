//! A body that nobody sees among bodies that attract each other: Le Verrier's question.
//!
//! Its orbit is a circle about the common centre, in the plane of what is known, for a start: for
//! every radius and place on it the force on all known bodies is linear in the mass.

use super::weak_form::{Column, MeasuredMotion, WeakForm, least_squares};
use super::{Start, TermName};
use crate::diagnose::law_on_data::LawOnData;
use crate::diagnose::tuning::Hidden;
use crate::expr::{Symbol, System};

/// Bodies that attract each other as their masses and one over the square of the distance.
struct Attracting {
    names: Vec<String>,
    /// Places of their coordinates.
    coordinates: Vec<Vec<usize>>,
    masses: Vec<f64>,
    /// The constant of gravitation.
    gravity: f64,
}

/// An orbit, and the mass of what is on it.
struct Orbit {
    radius: f64,
    phase: f64,
    direction: f64,
    mass: f64,
    gain: f64,
}

/// Starts of an unseen body, the best first.
pub(super) fn starts(model: &LawOnData) -> Vec<Start> {
    find(model).unwrap_or_default()
}

fn find(model: &LawOnData) -> Option<Vec<Start>> {
    let system = model.system();
    let most = model.tuning().hidden.orbits;
    if most == 0 || model.data.packed.samples() > model.tuning().hidden.samples {
        return None;
    }
    let bodies = Attracting::of(model)?;
    let motion = MeasuredMotion::of(model)?;
    let tuning = &model.tuning().hidden;
    let frame = Frame::of(&bodies, &motion)?;
    let mut found: Vec<Orbit> = Vec::new();
    let mut tests = 0;
    for &length in motion.lengths() {
        let forms: Option<Vec<Vec<WeakForm>>> = bodies
            .coordinates
            .iter()
            .map(|body| body.iter().map(|&i| motion.weak_form(i, length, tuning.terms)).collect())
            .collect();
        let Some(forms) = forms else { continue };
        let Some(left) = Left::of(&forms) else { continue };
        for orbit in frame.orbits(tuning) {
            tests += 1;
            found.extend(left.with(&bodies, &motion, &frame, orbit, &forms));
        }
    }
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut apart: Vec<Orbit> = Vec::new();
    for orbit in found {
        let near = |other: &Orbit| {
            let turn = (orbit.phase - other.phase).rem_euclid(std::f64::consts::TAU);
            let turn = turn.min(std::f64::consts::TAU - turn);
            (orbit.radius / other.radius).ln().abs() < tuning.orbits_apart
                && turn < tuning.phases_apart
                && orbit.direction == other.direction
        };
        if apart.len() < most && !apart.iter().any(near) {
            apart.push(orbit);
        }
    }
    let label = format!("unseen_body({})", bodies.names.join(", "));
    let start = |orbit: &Orbit| Start {
        label: label.clone(),
        on: bodies
            .coordinates
            .iter()
            .flatten()
            .map(|&i| system.coordinates[i].name.clone())
            .collect(),
        snippet: bodies.statements(system, &label, orbit, &frame),
        coefficients: Vec::<(TermName, f64)>::new(),
        gain: orbit.gain,
        rank: 0,
        tests,
    };
    Some(apart.iter().map(start).collect())
}

impl Attracting {
    /// The bodies of a law whose energy is T = sum p^2 / (2 m) and V = -sum G m m' / r; `None`
    /// where it is not.
    fn of(model: &LawOnData) -> Option<Attracting> {
        let system = model.system();
        let bodies = system.bodies();
        if bodies.len() < 2 {
            return None;
        }
        let place = |name: &String| system.coordinates.iter().position(|q| q.name == *name);
        let coordinates: Option<Vec<Vec<usize>>> =
            bodies.iter().map(|body| body.coordinates.iter().map(place).collect()).collect();
        let coordinates = coordinates?;
        let same = |body: &Vec<usize>| body.len() == coordinates[0].len();
        if !coordinates.iter().all(same) {
            return None;
        }
        let all = model.law.masses()?;
        let masses: Vec<f64> = coordinates.iter().map(|body| all[body[0]]).collect();
        let equal = |(body, mass): (&Vec<usize>, &f64)| {
            body.iter().all(|&i| (all[i] / mass - 1.0).abs() < SAME)
        };
        if !coordinates.iter().zip(&masses).all(equal) {
            return None;
        }
        let gravity = gravity(model, &coordinates, &masses)?;
        let names = bodies.iter().map(crate::spec::effects::Body::text).collect();
        Some(Attracting { names, coordinates, masses, gravity })
    }

    /// The statements of an unseen body on an orbit.
    fn statements(&self, system: &System, label: &str, orbit: &Orbit, frame: &Frame) -> String {
        let axes = ["x", "y", "z"];
        let (place, speed) = frame.at(self, orbit, 0);
        let taken = |name: &str| {
            let variables = system.coordinates.iter().chain(&system.momenta);
            variables.chain(&system.velocities).any(|v| v.name.starts_with(name))
                || system.parameters.iter().any(|p| p.name.starts_with(name))
        };
        let mut name = "unseen".to_string();
        while taken(&name) || taken(&format!("p_{name}")) {
            name.push('_');
        }
        let mass = format!("{name}_mass");
        let dimension = self.coordinates[0].len();
        let (factor, most) = (1e3, self.masses.iter().copied().fold(0.0, f64::max));
        let mut out = vec![
            format!("# {label}: a mass on an orbit of its own"),
            format!(
                "param {mass} = {} in {}..{}",
                orbit.mass,
                orbit.mass / factor,
                (orbit.mass * factor).min(most.max(2.0 * orbit.mass))
            ),
        ];
        for (axis, (x, v)) in axes.iter().zip(place.iter().zip(&speed)).take(dimension) {
            out.push(format!(
                "hidden {name}_{axis} = {x} with p_{name}_{axis} = {}",
                orbit.mass * v
            ));
        }
        let squares: Vec<String> =
            axes.iter().take(dimension).map(|axis| format!("p_{name}_{axis}^2")).collect();
        out.push(format!("T += ({})/(2*{mass})", squares.join(" + ")));
        let pulls: Vec<String> = self
            .coordinates
            .iter()
            .zip(&self.masses)
            .map(|(body, of)| {
                let apart: Vec<String> = axes
                    .iter()
                    .zip(body)
                    .map(|(axis, &i)| format!("({name}_{axis} - {})^2", system.coordinates[i].name))
                    .collect();
                format!("{}/sqrt({})", self.gravity * of, apart.join(" + "))
            })
            .collect();
        out.push(format!("V += -{mass}*({})", pulls.join(" + ")));
        out.join("\n")
    }
}

/// How nearly masses, and constants of gravitation, must be equal.
const SAME: f64 = 1e-6;

/// The constant of gravitation of a potential that is a sum of -G m m' / r; `None` where it is
/// something else.
fn gravity(model: &LawOnData, coordinates: &[Vec<usize>], masses: &[f64]) -> Option<f64> {
    let mut system = System::clone(model.system());
    let energy = system.energy(model.law.support()).ok()?;
    let each = model.law.coefficient_of_each_term();
    let n = system.degrees();
    let mut pairs = Vec::new();
    for i in 0..coordinates.len() {
        pairs.extend((i + 1..coordinates.len()).map(|j| (i, j)));
    }
    let count = pairs.len() + 6;
    let mut columns = vec![Vec::new(); pairs.len() + 1];
    let mut target = Vec::new();
    // The largest distance in the data: units do not matter.
    let scale = {
        let packed = &model.data.packed;
        let sizes = coordinates.iter().flatten().map(|&i| packed.column(i).iter());
        sizes.flatten().copied().filter(|x| x.is_finite()).fold(0.0_f64, |m, x| m.max(x.abs()))
    };
    for configuration in 0..count {
        let spread = |i: usize| {
            let k = (configuration * n + i + 1) as f64;
            scale * (2.0 * (k * 0.618_033_988_749_895).fract() - 1.0)
        };
        let of = |symbol| match symbol {
            Symbol::Coordinate(i) => spread(i),
            Symbol::Coefficient(k) => each.get(k).copied().unwrap_or(0.0),
            Symbol::Parameter(j) => model.law.parameters().get(j).copied().unwrap_or(0.0),
            _ => 0.0,
        };
        target.push(system.graph.value(energy, &of));
        for (column, &(i, j)) in columns.iter_mut().zip(&pairs) {
            let axes = coordinates[i].iter().zip(&coordinates[j]);
            let square: f64 = axes.map(|(&a, &b)| (spread(a) - spread(b)).powi(2)).sum();
            column.push(-masses[i] * masses[j] / square.sqrt());
        }
        columns[pairs.len()].push(1.0);
    }
    let size = target.iter().map(|x| x * x).sum::<f64>() / target.len() as f64;
    let (left, found) = least_squares(&columns.iter().collect::<Vec<_>>(), &target)?;
    let first = *found.first()?;
    // A light pair is known by fewer digits of the whole energy.
    let heavy = pairs.iter().zip(&found).filter(|((i, j), _)| {
        let most = masses.iter().copied().fold(0.0, f64::max);
        masses[*i].max(masses[*j]) == most
    });
    let mut heavy = heavy.map(|(_, g)| *g);
    let fits = left <= 1e-16 * size && first > 0.0;
    (fits && heavy.all(|g| (g / first - 1.0).abs() < 1e-3)).then_some(first)
}

/// The common centre of what is known along the first run, and the plane in which it turns.
struct Frame {
    /// `[run][sample][axis]`
    centre: Vec<Vec<[f64; 3]>>,
    /// Clock of every sample.
    times: Vec<Vec<f64>>,
    first: f64,
    across: [[f64; 3]; 2],
    /// Nearest and farthest known body from the centre.
    distances: (f64, f64),
    pull: f64,
    speed: [f64; 3],
}

impl Frame {
    fn of(bodies: &Attracting, motion: &MeasuredMotion) -> Option<Frame> {
        let total: f64 = bodies.masses.iter().sum();
        let packed = motion.packed;
        let mut centre = Vec::new();
        let mut times = Vec::new();
        let mut turning = [0.0; 3];
        let mut distances = (f64::INFINITY, 0.0_f64);
        for run in 0..packed.runs() {
            let count = packed.times_of(run).len();
            times.push(motion.values(Symbol::Time, run, 0..count));
            let rows: Vec<Vec<Vec<f64>>> = bodies
                .coordinates
                .iter()
                .map(|body| {
                    let values = |&i: &usize| motion.values(Symbol::Coordinate(i), run, 0..count);
                    body.iter().map(values).collect()
                })
                .collect();
            let at = |sample: usize| -> [f64; 3] {
                std::array::from_fn(|axis| {
                    let parts = rows.iter().zip(&bodies.masses).map(|(row, mass)| {
                        mass * row.get(axis).map_or(0.0, |values| values[sample])
                    });
                    parts.sum::<f64>() / total
                })
            };
            let along: Vec<[f64; 3]> = (0..count).map(at).collect();
            for sample in 1..count {
                for (row, mass) in rows.iter().zip(&bodies.masses) {
                    let place = |s: usize| -> [f64; 3] {
                        std::array::from_fn(|a| {
                            row.get(a).map_or(0.0, |values| values[s]) - along[s][a]
                        })
                    };
                    let (before, after) = (place(sample - 1), place(sample));
                    let turn = cross(before, after);
                    for (sum, x) in turning.iter_mut().zip(turn) {
                        *sum += if x.is_finite() { mass * x } else { 0.0 };
                    }
                    let far = norm(after);
                    if far.is_finite() && far > 0.0 {
                        distances = (distances.0.min(far), distances.1.max(far));
                    }
                }
            }
            centre.push(along);
        }
        let normal = unit(turning)?;
        let other = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let first_axis = unit(cross(normal, other))?;
        let across = [first_axis, cross(normal, first_axis)];
        let along = centre.first()?;
        let clock = times.first()?;
        let last = along.len().checked_sub(1).filter(|last| *last > 0)?;
        let span = clock[last] - clock[0];
        let speed = std::array::from_fn(|a| (along[last][a] - along[0][a]) / span);
        let first = times.iter().filter_map(|t| t.first()).copied().fold(f64::INFINITY, f64::min);
        let pull = bodies.gravity * total;
        // The heaviest is near the centre: it bounds no orbit from within.
        distances.0 = distances.0.max(0.02 * distances.1);
        Some(Frame { centre, times, first, across, distances, pull, speed })
    }

    /// Radii, places and directions to try.
    fn orbits(&self, tuning: &Hidden) -> Vec<Orbit> {
        let (near, far) = (0.5 * self.distances.0, tuning.farthest * self.distances.1);
        let mut all = Vec::new();
        for r in 0..tuning.radii {
            let part = r as f64 / (tuning.radii - 1) as f64;
            let radius = near * (far / near).powf(part);
            for k in 0..tuning.phases {
                let phase = std::f64::consts::TAU * k as f64 / tuning.phases as f64;
                for direction in [1.0, -1.0] {
                    all.push(Orbit { radius, phase, direction, mass: 0.0, gain: 0.0 });
                }
            }
        }
        all
    }

    fn around(&self, orbit: &Orbit, time: f64) -> ([f64; 3], [f64; 3]) {
        let rate = orbit.direction * (self.pull / orbit.radius.powi(3)).sqrt();
        let angle = orbit.phase + rate * (time - self.first);
        let (sine, cosine) = angle.sin_cos();
        let [e, f] = self.across;
        let place = std::array::from_fn(|a| orbit.radius * (cosine * e[a] + sine * f[a]));
        let speed = std::array::from_fn(|a| orbit.radius * rate * (cosine * f[a] - sine * e[a]));
        (place, speed)
    }

    /// Where a body on an orbit is at the start of a run, and its velocity.
    fn at(&self, _: &Attracting, orbit: &Orbit, run: usize) -> ([f64; 3], [f64; 3]) {
        let (place, speed) = self.around(orbit, self.times[run][0]);
        let centre = self.centre[run][0];
        (
            std::array::from_fn(|a| centre[a] + place[a]),
            std::array::from_fn(|a| self.speed[a] + speed[a]),
        )
    }
}

/// What is left of the force in weak form, `[body][axis]`.
struct Left {
    targets: Vec<Vec<Vec<f64>>>,
    squares: Vec<Vec<f64>>,
}

impl Left {
    fn of(forms: &[Vec<WeakForm>]) -> Option<Left> {
        let mut targets = Vec::new();
        for body in forms {
            let of = |form: &WeakForm| -> Option<Vec<f64>> {
                let (_, values) = form.solve(&[])?;
                let mut left = form.target.clone();
                let fixed = form.names.iter().zip(&form.columns).zip(&values);
                for ((_, column), value) in fixed.filter(|((name, _), _)| **name != Column::Mass) {
                    left.iter_mut().zip(column).for_each(|(x, c)| *x -= value * c);
                }
                Some(left)
            };
            targets.push(body.iter().map(of).collect::<Option<Vec<_>>>()?);
        }
        let mean = |x: &Vec<f64>| x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64;
        let squares = targets.iter().map(|body| body.iter().map(mean).collect()).collect();
        Some(Left { targets, squares })
    }

    /// The orbit with its mass and what it explains; `None` for a mass below zero.
    fn with(
        &self,
        bodies: &Attracting,
        motion: &MeasuredMotion,
        frame: &Frame,
        orbit: Orbit,
        forms: &[Vec<WeakForm>],
    ) -> Option<Orbit> {
        // The pull on every body along all runs, `[body][axis][run][sample]`.
        let dimension = bodies.coordinates[0].len();
        let mut pulls: Vec<Vec<Vec<Vec<f64>>>> =
            vec![vec![Vec::new(); dimension]; bodies.masses.len()];
        for (run, times) in frame.times.iter().enumerate() {
            for (body, own) in bodies.coordinates.iter().enumerate() {
                let rows: Vec<Vec<f64>> = own
                    .iter()
                    .map(|&i| motion.values(Symbol::Coordinate(i), run, 0..times.len()))
                    .collect();
                let mut out = vec![vec![0.0; times.len()]; dimension];
                for (sample, &time) in times.iter().enumerate() {
                    let (around, _) = frame.around(&orbit, time);
                    let centre = frame.centre[run][sample];
                    let apart: [f64; 3] = std::array::from_fn(|a| {
                        rows.get(a).map_or(0.0, |row| centre[a] + around[a] - row[sample])
                    });
                    let size = bodies.gravity * bodies.masses[body] / norm(apart).powi(3);
                    for (axis, out) in out.iter_mut().enumerate() {
                        out[sample] = size * apart[axis];
                    }
                }
                for (axis, out) in out.into_iter().enumerate() {
                    pulls[body][axis].push(out);
                }
            }
        }
        let columns: Vec<Vec<Vec<f64>>> = forms
            .iter()
            .zip(&pulls)
            .map(|(forms, pulls)| {
                let both = forms.iter().zip(pulls);
                both.map(|(form, runs)| {
                    let all = form.integrals(|run| runs.get(run).map(Vec::as_slice));
                    all.into_iter().map(|x| -x).collect()
                })
                .collect()
            })
            .collect();
        // Each coordinate weighs as what is left of it: found together with the mass.
        let mut weights = self.squares.clone();
        let mut mass = 0.0;
        let mut gain = 0.0;
        for _ in 0..3 {
            let (mut product, mut square) = (0.0, 0.0);
            for ((targets, columns), weights) in self.targets.iter().zip(&columns).zip(&weights) {
                for ((target, column), weight) in targets.iter().zip(columns).zip(weights) {
                    for (t, c) in target.iter().zip(column) {
                        product += t * c / weight;
                        square += c * c / weight;
                    }
                }
            }
            mass = product / square;
            if !(mass.is_finite() && mass > 0.0) {
                return None;
            }
            gain = 0.0;
            let all = self.targets.iter().zip(&columns).zip(&mut weights).zip(&self.squares);
            for (((targets, columns), weights), squares) in all {
                let each = targets.iter().zip(columns).zip(weights).zip(squares);
                for (((target, column), weight), before) in each {
                    let left = target.iter().zip(column).map(|(t, c)| (t - mass * c).powi(2));
                    *weight = (left.sum::<f64>() / target.len() as f64).max(1e-12 * before);
                    gain += (before / *weight).ln();
                }
            }
        }
        Some(Orbit { mass, gain: gain.min(600.0).exp(), ..orbit })
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let size = norm(a);
    (size > 0.0 && size.is_finite()).then(|| a.map(|x| x / size))
}
