//! One part of the model: its plans are written down, rewritten, and the shortest is kept.

use std::time::Duration;

use egg::{BackoffScheduler, CostFunction, Extractor, Id, Language, RecExpr, Runner};

use super::analysis::Folding;
use super::cost::ReadingCost;
use super::form::{FormStyle, FormWriter};
use super::lang::{FittedNumber, Math, Rational};
use super::normal::{Atom, Atoms, Monomial, Polynomial};
use super::numbers::{Numbers, Printed};
use super::quantity::Quantity;
use super::rules;
use super::springs::{self, Springs};
use super::{Info, SaturationEnd, SimplifyOptions};
use crate::expr::{Function, Names, Number};

/// Forms of at most this many nodes are rewritten with reordering of sums and products too.
const SMALL: usize = 24;
/// Larger forms than this are printed as they are: they are lists of terms, no structure.
const LARGE: usize = 6_000;

/// Every plan, simplest first: a tie is won by the first.
pub(super) const PLANS: &[FormStyle] = &[
    FormStyle { springs: false, waves: false },
    FormStyle { springs: true, waves: false },
    FormStyle { springs: false, waves: true },
    FormStyle { springs: true, waves: true },
];

/// What it is worth, in description length, that one number follows from others.
const RELATION: f64 = 12.0;

/// Writes a form according to a plan, and says what the relations that it shows are worth;
/// `None` where the plan finds nothing to do.
pub(super) fn write(
    plan: FormStyle,
    form: &Polynomial,
    atoms: &mut Atoms,
    numbers: &mut Numbers,
    names: &Names,
) -> Option<(RecExpr<Math>, f64)> {
    let merged;
    let form = if plan.waves {
        merged = merge_waves(form, atoms)?;
        &merged
    } else {
        form
    };
    let mut writer = FormWriter { atoms, numbers, names, expr: RecExpr::default() };
    let springs =
        if plan.springs { springs::write(&mut writer, form)? } else { Springs::default() };
    let Springs { mut addends, taken, without_wall } = springs;
    // Numbers of the same kind of term may be equal: (pattern of exponents, row).
    let mut kinds: Vec<(String, Vec<usize>)> = Vec::new();
    if plan.springs {
        kinds.push(("spring".into(), addends.iter().filter_map(|a| a.number).collect()));
    }
    for (monomial, quantity) in writer.atoms.ordered(form) {
        if taken.contains(monomial) {
            continue;
        }
        let addend = writer.term(monomial, quantity);
        let kind = pattern(writer.atoms, monomial);
        match kinds.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, rows)) => rows.extend(addend.number),
            None => kinds.push((kind, addend.number.into_iter().collect())),
        }
        addends.push(addend);
    }
    for (_, rows) in &kinds {
        writer.numbers.merge_equal(rows);
    }
    writer.sum(addends);
    Some((writer.expr, RELATION * without_wall as f64))
}

/// What terms must share for their coefficients to be comparable: the same kind of
/// variables with the same exponents.
fn pattern(atoms: &Atoms, monomial: &Monomial) -> String {
    let mut list: Vec<String> = monomial
        .iter()
        .map(|&(atom, exponent)| {
            let kind = match atoms.get(atom) {
                Atom::Symbol(crate::expr::Symbol::Coordinate(_)) => "q".to_string(),
                Atom::Symbol(crate::expr::Symbol::Momentum(_)) => "p".to_string(),
                Atom::Symbol(_) => "t".to_string(),
                Atom::Apply(function, _) => function.row().name.to_string(),
                Atom::Sum(_) | Atom::Power(..) => "+".to_string(),
            };
            format!("{kind}^{}", exponent.value())
        })
        .collect();
    list.sort();
    list.join(" ")
}

/// A sin x + B cos x becomes C cos(x - phi), C = hypot(A, B), phi = atan2(A, B).
fn merge_waves(form: &Polynomial, atoms: &mut Atoms) -> Option<Polynomial> {
    let (sin, cos) = (Function::SIN, Function::COS);
    let alone = |function: Function, atoms: &Atoms, monomial: &Monomial| match monomial[..] {
        [(atom, exponent)] if exponent == Number::new(1.0) => match atoms.get(atom) {
            Atom::Apply(f, argument) if *f == function => Some(argument.clone()),
            _ => None,
        },
        _ => None,
    };
    let mut out = form.clone();
    let mut changed = false;
    for (monomial, a) in &form.0 {
        let Some(argument) = alone(sin, atoms, monomial) else { continue };
        let partner =
            form.0.iter().find(|(other, _)| alone(cos, atoms, other).as_ref() == Some(&argument));
        let Some((other, b)) = partner else { continue };
        let size = a.value.hypot(b.value);
        if size == 0.0 {
            continue;
        }
        let amplitude = Quantity::combine(size, a, a.value / size, b, b.value / size);
        let square = size * size;
        let angle = a.value.atan2(b.value);
        let minus_phase = Quantity::combine(-angle, a, -b.value / square, b, a.value / square);
        let mut shifted = argument.clone();
        shifted.add_term(Vec::new(), &minus_phase);
        let wave = atoms.of(Atom::Apply(cos, shifted));
        out.0.remove(monomial);
        out.0.remove(other);
        out.add_term(vec![(wave, Number::new(1.0))], &amplitude);
        changed = true;
    }
    changed.then_some(out)
}

/// The form with its nice numbers as exact rationals.
pub(super) fn with_nice_numbers(expr: &RecExpr<Math>, numbers: &Numbers) -> RecExpr<Math> {
    let mut out = RecExpr::default();
    let mut image: Vec<Id> = Vec::with_capacity(expr.len());
    for (_, node) in expr.items() {
        let id = match node {
            Math::Fitted(FittedNumber(row)) => match numbers.rows[*row].printed {
                Printed::Itself => out.add(node.clone()),
                Printed::Same(other) => out.add(Math::Fitted(FittedNumber(other))),
                Printed::NiceNumber(nice) => {
                    let rational = out.add(Math::Rational(nice.rational()));
                    if nice.pi {
                        let pi = out.add(Math::Pi);
                        // As the rewrites have it: pi itself has no factor.
                        if nice.rational() == Rational::ONE {
                            pi
                        } else {
                            out.add(Math::Multiply([rational, pi]))
                        }
                    } else {
                        rational
                    }
                }
            },
            _ => {
                let node = node.clone().map_children(|child| image[usize::from(child)]);
                let zero = |id: &Id| out[*id] == Math::Rational(Rational::ZERO);
                // What snapped to zero takes its product with it.
                match &node {
                    Math::Add([a, b]) if zero(a) => *b,
                    Math::Add([a, b]) if zero(b) => *a,
                    Math::Multiply([a, _]) | Math::Negate([a]) if zero(a) => *a,
                    _ => out.add(node),
                }
            }
        };
        image.push(id);
    }
    // The root stands last, and what nothing refers to is dropped.
    match image.last() {
        Some(&root) => out[root].build_recexpr(|id| out[id].clone()),
        None => out,
    }
}

/// The shortest equal expression that the rewrites reach, and its cost.
pub(super) fn rewritten(
    expr: &RecExpr<Math>,
    options: &SimplifyOptions,
    info: &mut Info,
) -> (f64, RecExpr<Math>) {
    if expr.len() > LARGE {
        info.stop = info.stop.max(SaturationEnd::TooLarge);
        return (ReadingCost.cost_rec(expr), expr.clone());
    }
    let runner = Runner::<Math, Folding>::new(Folding)
        .with_expr(expr)
        .with_iter_limit(options.iterations)
        .with_node_limit(options.nodes)
        // Results must not depend on how busy the machine is.
        .with_time_limit(Duration::from_secs(1 << 30))
        .with_scheduler(BackoffScheduler::default())
        .run(rules::rewrites(expr.len() <= SMALL));
    info.iterations += runner.iterations.len();
    info.classes += runner.egraph.number_of_classes();
    let stop = match runner.stop_reason {
        Some(egg::StopReason::IterationLimit(_)) => SaturationEnd::Iterations,
        Some(egg::StopReason::NodeLimit(_)) => SaturationEnd::Nodes,
        _ => SaturationEnd::Saturated,
    };
    info.stop = info.stop.max(stop);
    Extractor::new(&runner.egraph, ReadingCost).find_best(runner.roots[0])
}
