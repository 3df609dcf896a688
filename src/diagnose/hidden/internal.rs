//! Effects of the catalogue with internal states: their laws followed along the measured motion.

use super::weak_form::{Column, MeasuredMotion, WeakForm};
use super::{Start, TermName};
use crate::diagnose::candidates::Reach;
use crate::diagnose::law_on_data::LawOnData;
use crate::error::Result;
use crate::eval::{Backend, Evaluator, Inputs, compile};
use crate::expr::{Compiled, Expr, Symbol, System, build, instances};
use crate::fit::masses::pushes;
use crate::spec::edit;
use crate::spec::effects::{Instance, ScanBy};

/// The best starts of every effect that has internal states, on everything that it may act on.
pub(super) fn starts(spec: &Compiled, model: &LawOnData) -> Result<Vec<Start>> {
    let Some(motion) = MeasuredMotion::of(model) else { return Ok(Vec::new()) };
    let tuning = model.tuning();
    let reach = Reach::of(&spec.system, &model.data.dataset, &tuning.candidates);
    let all = instances(&spec.system);
    let moving = all.iter().filter(|instance| {
        let row = instance.effect;
        row.has_states() && !row.on.observes() && instance.arguments.len() == 1
    });
    let n = spec.system.degrees();
    let samples = model.data.packed.samples();
    if n > tuning.hidden.coordinates || samples > tuning.hidden.samples {
        return Ok(Vec::new());
    }
    let of = |coordinate: usize| -> Vec<WeakForm> {
        let forms = motion.lengths().iter();
        forms
            .filter_map(|&length| motion.weak_form(coordinate, length, tuning.hidden.terms))
            .collect()
    };
    let forms: Vec<Vec<WeakForm>> = (0..n).map(of).collect();
    let mut starts = Vec::new();
    for instance in moving {
        let scans: Vec<ScanBy> = instance.effect.parameters.iter().map(|scan| scan.by).collect();
        let on = instance.arguments.first().map_or("", String::as_str);
        let grid = reach.grid(&scans, on);
        starts.extend(starts_of(spec, model, (&motion, &forms), instance, &grid));
    }
    Ok(starts)
}

/// By what factor the weak form of the force that is left is smaller with a changed model than with
/// another, at most, over all coordinates.
pub(super) fn gain(model: &LawOnData, changed: &LawOnData) -> f64 {
    let terms = model.tuning().hidden.terms;
    let (Some(motion), Some(other)) = (MeasuredMotion::of(model), MeasuredMotion::of(changed))
    else {
        return 0.0;
    };
    let left = |motion: &MeasuredMotion, i: usize, length: usize| {
        Some(motion.weak_form(i, length, terms)?.solve(&[])?.0)
    };
    let both = (0..model.system().degrees())
        .flat_map(|i| motion.lengths().iter().map(move |&length| (i, length)));
    let gains = both.filter_map(|(i, length)| {
        let gain = left(&motion, i, length)? / left(&other, i, length)?;
        gain.is_finite().then_some(gain)
    });
    gains.fold(0.0, f64::max)
}

/// An effect in the spec, its laws and what it does to the force on a coordinate.
struct Carried {
    system: System,
    label: String,
    /// Positions of its terms.
    terms: Vec<usize>,
    /// Coordinates of the wider system that are its states.
    states: Vec<usize>,
    symbols: Vec<Symbol>,
    /// The rates of its states, then what its terms do to the force.
    evaluator: Box<dyn Evaluator>,
    uniform: Vec<f64>,
    /// Inner parameters before its own.
    standing: usize,
}

/// What the weak form says of a point of a grid.
struct Point {
    gain: f64,
    /// Place of the weak form that says so.
    form: usize,
    /// Inner parameters.
    values: Vec<f64>,
    coefficients: Vec<f64>,
    /// Whether a part of these coefficients could be built: its mass, its stiffness are above zero.
    can_be: bool,
}

impl Point {
    /// Whether some inner parameter differs from another point's by more than a part of it.
    fn is_apart(&self, other: &Point, part: f64) -> bool {
        let mut pairs = self.values.iter().zip(&other.values);
        pairs.any(|(a, b)| (a - b).abs() > part * a.abs().max(b.abs()))
    }
}

/// Starts of one effect, the best first, at points of its grid that are apart.
fn starts_of(
    spec: &Compiled,
    model: &LawOnData,
    (motion, forms): (&MeasuredMotion, &[Vec<WeakForm>]),
    instance: &Instance,
    grid: &[Vec<f64>],
) -> Vec<Start> {
    let mut coordinates = spec.system.coordinates.iter();
    let Some(coordinate) = coordinates.position(|q| q.name == instance.arguments[0]) else {
        return Vec::new();
    };
    let Some(carried) = Carried::of(spec, model, instance, coordinate) else { return Vec::new() };
    let tuning = &model.tuning().hidden;
    let Some(forms) = forms.get(coordinate) else { return Vec::new() };
    let without: Vec<f64> =
        forms.iter().map(|form| form.solve(&[]).map_or(f64::NAN, |(left, _)| left)).collect();
    let mut points = Vec::new();
    for chunk in grid.chunks(tuning.lanes) {
        let pushes = carried.along(motion, chunk);
        for (lane, values) in chunk.iter().enumerate() {
            for (at, (form, without)) in forms.iter().zip(&without).enumerate() {
                let Some((left, coefficients)) = form.solve(&pushes.columns(form, lane)) else {
                    continue;
                };
                let own = coefficients.iter().skip(form.names.len()).take(carried.terms.len());
                let can_be = own.into_iter().all(|coefficient| *coefficient > 0.0);
                let gain = without / left.max(f64::MIN_POSITIVE);
                if gain.is_finite() {
                    points.push(Point {
                        gain,
                        form: at,
                        values: values.clone(),
                        coefficients,
                        can_be,
                    });
                }
            }
        }
    }
    // Where the data leave the numbers open, those of a part that could be built are better ones to
    // start from.
    let best = points.iter().map(|point| point.gain).fold(0.0, f64::max);
    let first = |point: &Point| point.can_be && point.gain > best * tuning.nearly;
    points.sort_by(|a, b| first(b).cmp(&first(a)).then(b.gain.total_cmp(&a.gain)));
    let mut chosen: Vec<Point> = Vec::new();
    for point in points {
        if chosen.iter().all(|other| point.is_apart(other, tuning.points_apart)) {
            chosen.push(point);
        }
        if chosen.len() == tuning.points {
            break;
        }
    }
    let tests = grid.len() * forms.len();
    let start = |(rank, point): (usize, &Point)| {
        let mut coefficients = coefficients(&spec.system, coordinate, &forms[point.form], point);
        let own = carried.terms.iter().zip(&point.coefficients[forms[point.form].names.len()..]);
        coefficients.extend(
            own.map(|(&k, value)| (TermName::Own(carried.system.terms[k].label.clone()), *value)),
        );
        Start {
            label: carried.label.clone(),
            on: instance.arguments.clone(),
            snippet: instance.statement_with(&point.values),
            coefficients,
            gain: point.gain,
            near: false,
            rank,
            tests,
        }
    };
    chosen.iter().enumerate().map(start).collect()
}

/// Coefficients of the terms that stand, by a point of a grid.
fn coefficients(
    system: &System,
    coordinate: usize,
    form: &WeakForm,
    point: &Point,
) -> Vec<(TermName, f64)> {
    let mass = system.terms.iter().position(|term| {
        let mut graph = system.graph.clone();
        let p = graph.symbol(Symbol::Momentum(coordinate));
        let square = graph.power(p, 2.0);
        term.place == crate::expr::Place::Kinetic && term.expr == square
    });
    let standing = form.names.iter().zip(&point.coefficients).filter_map(|(name, &value)| {
        match (name, mass) {
            (Column::Term(k), _) => Some((TermName::Standing(*k), value)),
            (Column::Mass, Some(k)) if value > 0.0 => Some((TermName::Standing(k), 0.5 / value)),
            _ => None,
        }
    });
    standing.collect()
}

impl Carried {
    fn of(
        spec: &Compiled,
        model: &LawOnData,
        instance: &Instance,
        coordinate: usize,
    ) -> Option<Carried> {
        let text = edit::insert(&spec.text, &instance.statement);
        let with = build(&spec.system.name, &text).ok()?;
        let label = instance.label();
        let mut system = System::clone(&with.system);
        let law = model.law.on(&with.system);
        let own = |term: &crate::expr::Term| term.effect.as_ref() == Some(&label);
        let terms: Vec<usize> =
            (0..system.terms.len()).filter(|&k| own(&system.terms[k])).collect();
        let standing = spec.system.degrees();
        let rates = system.rates(law.support()).ok()?;
        let rates: Vec<(usize, Expr)> =
            rates.into_iter().filter(|(state, _)| *state >= standing).collect();
        let mut outputs: Vec<Expr> = rates.iter().map(|(_, rate)| *rate).collect();
        for &k in &terms {
            let term = system.terms[k].clone();
            outputs.push(pushes(&mut system.graph, &term, coordinate));
        }
        let symbols: Vec<Symbol> = system.graph.symbols(&outputs);
        let first = spec.system.parameters.len();
        let is_uniform = |symbol: &Symbol| match symbol {
            Symbol::Coefficient(_) => true,
            Symbol::Parameter(j) => *j < first,
            _ => false,
        };
        let (fixed, varying): (Vec<Symbol>, Vec<Symbol>) =
            symbols.into_iter().partition(is_uniform);
        let each = law.coefficient_of_each_term();
        let value = |symbol: &Symbol| match symbol {
            Symbol::Coefficient(k) => each[*k],
            Symbol::Parameter(j) => law.parameters()[*j],
            _ => f64::NAN,
        };
        let uniform = fixed.iter().map(value).collect();
        let inputs = Inputs { varying: varying.clone(), uniform: fixed };
        let evaluator = compile(&system.graph, &inputs, &outputs, Backend::default());
        let states = rates.into_iter().map(|(state, _)| state).collect();
        Some(Carried {
            system,
            label,
            terms,
            states,
            symbols: varying,
            evaluator,
            uniform,
            standing: first,
        })
    }

    /// What the terms do to the force along the measured motion, for some points of the grid. Where
    /// there are two states or more they may ring: their own motion is followed too.
    fn along(&self, motion: &MeasuredMotion, points: &[Vec<f64>]) -> Pushes {
        let (lanes, states) = (points.len(), self.states.len());
        let variants = if states > 1 && motion.packed.runs() <= MOST_RUNS { states + 1 } else { 1 };
        let all = lanes * variants;
        let mut pushes = Pushes { lanes, variants, terms: self.terms.len(), runs: Vec::new() };
        for run in 0..motion.packed.runs() {
            let times = motion.packed.times_of(run);
            let count = times.len();
            let rows: Vec<Option<Vec<f64>>> = self
                .symbols
                .iter()
                .map(|&symbol| match symbol {
                    Symbol::Coordinate(i) if self.states.contains(&i) => None,
                    Symbol::Parameter(_) => None,
                    symbol => Some(filled(motion.values(symbol, run, 0..count))),
                })
                .collect();
            let mut z = vec![0.0; states * all];
            for variant in 1..variants {
                let row = (variant - 1) * all + variant * lanes;
                z[row..row + lanes].fill(1.0);
            }
            let mut out = vec![0.0; self.evaluator.outputs() * all];
            let mut next = out.clone();
            let mut values = vec![vec![0.0; count]; self.terms.len() * all];
            let mut place = Vec::new();
            let mut evaluate = |z: &[f64], at: usize, out: &mut [f64]| {
                place.clear();
                for (symbol, row) in self.symbols.iter().zip(&rows) {
                    match (symbol, row) {
                        (_, Some(row)) => place.extend(std::iter::repeat_n(row[at], all)),
                        (Symbol::Parameter(j), _) => place
                            .extend((0..all).map(|lane| points[lane % lanes][j - self.standing])),
                        (Symbol::Coordinate(i), _) => {
                            let state = self.states.iter().position(|s| s == i).unwrap_or(0);
                            place.extend_from_slice(&z[state * all..(state + 1) * all]);
                        }
                        _ => place.extend(std::iter::repeat_n(f64::NAN, all)),
                    }
                }
                self.evaluator.evaluate(&place, &self.uniform, all, out, &mut Vec::new());
            };
            for at in 0..count {
                evaluate(&z, at, &mut out);
                for (values, push) in values.iter_mut().zip(&out[states * all..]) {
                    values[at] = *push;
                }
                if at + 1 == count {
                    break;
                }
                // The method of Heun: as accurate as the measurements are dense.
                let h = times[at + 1] - times[at];
                let rates = &out[..states * all];
                let ahead: Vec<f64> = z.iter().zip(rates).map(|(z, f)| z + h * f).collect();
                evaluate(&ahead, at + 1, &mut next);
                for ((z, f), g) in z.iter_mut().zip(&out).zip(&next) {
                    *z += 0.5 * h * (f + g);
                }
            }
            pushes.runs.push(values);
        }
        pushes
    }
}

/// Runs up to which the free motion of states has columns of its own in each.
const MOST_RUNS: usize = 8;

/// What terms do to a force along all runs.
struct Pushes {
    lanes: usize,
    variants: usize,
    terms: usize,
    /// `[run][term, variant, lane][sample]`
    runs: Vec<Vec<Vec<f64>>>,
}

impl Pushes {
    /// Columns of the weak form for one point of the grid: one for each term, then the free motion
    /// of the states in each run.
    fn columns(&self, form: &WeakForm, lane: usize) -> Vec<Vec<f64>> {
        let all = self.lanes * self.variants;
        let of = |term: usize, variant: usize, only: Option<usize>| {
            let column = term * all + variant * self.lanes + lane;
            let integrals = form.integrals(|run| {
                let wanted = only.is_none_or(|only| only == run);
                wanted.then(|| self.runs[run][column].as_slice())
            });
            integrals.into_iter().map(|x| -x).collect::<Vec<f64>>()
        };
        let mut columns: Vec<Vec<f64>> = (0..self.terms).map(|term| of(term, 0, None)).collect();
        for run in 0..self.runs.len() {
            for variant in 1..self.variants {
                for term in 0..self.terms {
                    let (with, without) = (of(term, variant, Some(run)), of(term, 0, Some(run)));
                    columns.push(with.iter().zip(&without).map(|(a, b)| a - b).collect());
                }
            }
        }
        columns
    }
}

/// The last value that was measured where one is missing.
fn filled(mut values: Vec<f64>) -> Vec<f64> {
    let mut last = values.iter().copied().find(|x| x.is_finite()).unwrap_or(0.0);
    for value in &mut values {
        if value.is_finite() {
            last = *value;
        } else {
            *value = last;
        }
    }
    values
}
