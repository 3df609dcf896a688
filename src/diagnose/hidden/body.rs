//! A body that nobody sees among bodies that attract each other: Le Verrier's question.
//!
//! The model without it is followed along its whole record; what a pull does to it is then linear
//! in the mass, so that thousands of orbits are tried in seconds (`orbit`), and only the best are
//! fitted with everything that the model has.

use super::orbit::{Circles, Left, Orbit};
use super::path::{Attracting, Known, near};
use super::weak_form::least_squares;
use super::{Start, TermName, Unseen};
use crate::diagnose::law_on_data::LawOnData;
use crate::expr::{Place, Symbol, System};

/// Starts of an unseen body, the best first; `None` where nothing attracts, or none is looked for.
pub(super) fn unseen(model: &LawOnData) -> Option<Unseen> {
    let system = model.system();
    let tuning = &model.tuning().hidden;
    if tuning.orbits == 0 || model.data.packed.samples() > tuning.samples {
        return None;
    }
    let bodies = Attracting::of(model)?;
    let settled = near(model);
    let circles = Circles {
        nearest: tuning.nearest,
        farthest: tuning.farthest,
        part: tuning.radii_apart,
        out_of_step: tuning.out_of_step,
        phases: tuning.phases,
        nodes: tuning.nodes_of_turn,
    };
    let mut noise = vec![1.0; model.law.noise().len()];
    let mut found = Vec::new();
    let (mut tests, mut before, mut rows, mut by_masses) = (0, 0.0, 0, 0.0);
    // What even the best body leaves of a column more than its noise, does not speak for one.
    for _ in 0..tuning.weighings {
        if model.monitor.stopped() {
            return None;
        }
        let known = Known::along(&settled, &bodies, &noise)?;
        let left =
            Left { path: &known.path, stretches: &known.stretches, residuals: &known.residuals };
        let all = left.circles(&circles);
        tests = all.len();
        (before, rows) = (left.target().norm_squared(), known.observables.len());
        by_masses = left.by_a_mass();
        found = apart(all, tuning.refined, tuning.orbits_apart);
        for orbit in &mut found {
            *orbit = left.refined(orbit, tuning.orbit_steps);
        }
        found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let Some(best) = found.first() else { break };
        let errors = root_mean_squares(&left.beside(best), &known.observables, noise.len());
        let moved = errors.iter().any(|more| *more > tuning.weighed_again);
        noise.iter_mut().zip(&errors).for_each(|(noise, more)| *noise *= more.max(1.0));
        if !moved {
            break;
        }
    }
    // Seven numbers are found: twice the logarithm of the rows is the price of each.
    let price = 7.0 * (rows.max(1) as f64).ln() + 2.0 * (tests.max(1) as f64).ln();
    let found = apart(found, tuning.orbits, tuning.orbits_apart);
    let label = format!("unseen_body({})", bodies.names.join(", "));
    let on = bodies.coordinates.iter().flatten().map(|&i| system.coordinates[i].name.clone());
    let on: Vec<String> = on.collect();
    let paid = found.iter().filter(|orbit| orbit.gain > price).enumerate();
    let start = |(rank, orbit): (usize, &Orbit)| Start {
        label: label.clone(),
        on: on.clone(),
        snippet: bodies.statements(system, &label, orbit),
        coefficients: Vec::<(TermName, f64)>::new(),
        gain: before / (before - orbit.gain).max(f64::MIN_POSITIVE),
        near: true,
        rank,
        tests,
    };
    let starts: Vec<Start> = paid.map(start).collect();
    let gain = found.first().map_or(0.0, |best| best.gain);
    let obvious = starts.first().is_some_and(|start| start.gain > tuning.obvious)
        && before - by_masses > tuning.obvious * (before - gain);
    Some(Unseen { starts, obvious })
}

/// The best orbits, of which no two begin near each other.
fn apart(orbits: Vec<Orbit>, most: usize, part: f64) -> Vec<Orbit> {
    let mut chosen: Vec<Orbit> = Vec::new();
    for orbit in orbits {
        if chosen.len() == most {
            break;
        }
        if chosen.iter().all(|other| orbit.is_apart(other, part)) {
            chosen.push(orbit);
        }
    }
    chosen
}

/// The root of the mean square of each observable's residuals; 1 where there are none.
fn root_mean_squares(
    left: &nalgebra::DVector<f64>,
    observables: &[usize],
    count: usize,
) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); count];
    for (x, &observable) in left.iter().zip(observables) {
        sums[observable].0 += x * x;
        sums[observable].1 += 1.0;
    }
    sums.iter().map(|(sum, n)| if *n > 0.0 { f64::sqrt(sum / n) } else { 1.0 }).collect()
}

impl Attracting {
    /// The bodies of a law whose energy is T = sum p^2 / (2 m) and V = -sum G m m' / r; `None`
    /// where it is not.
    fn of(model: &LawOnData) -> Option<Attracting> {
        let system = model.system();
        let bodies = system.bodies();
        // Whatever else moves, or moves them, is no sky.
        let forced = system.terms.iter().any(|term| matches!(term.place, Place::Force(_)))
            || system.forces.iter().any(|&force| !system.graph.is_zero(force));
        let others = forced || !system.hidden.is_empty() || !system.inputs.is_empty();
        let all = bodies.iter().map(|body| body.coordinates.len()).sum::<usize>();
        if bodies.len() < 2 || others || all != system.degrees() {
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
    fn statements(&self, system: &System, label: &str, orbit: &Orbit) -> String {
        let axes = ["x", "y", "z"];
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
        for (axis, (x, v)) in
            axes.iter().zip(orbit.place.iter().zip(&orbit.velocity)).take(dimension)
        {
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
            // Multiples alone would differ by the same from coordinate to coordinate.
            let k = (configuration * n + i + 1) as f64;
            scale * (2.0 * (k * k * 0.618_033_988_749_895).fract() - 1.0)
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
