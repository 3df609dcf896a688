//! Whether a story would be believed: by the errors of its numbers, by what its names say, and by
//! how freely it bends.

use std::collections::{HashMap, HashSet};

use super::clearness::Clearness;
use super::refit::has_negative;
use super::story::{Member, Story};
use crate::expr::{Expr, Place, Symbol, System, Term};
use crate::fit::column::Column;
use crate::spec::effects::by_name;

/// How far a member of a story would be believed by itself.
pub(super) struct Belief {
    /// Its coefficients, or by how much a known number is off, with their columns among those of
    /// the law.
    pub(super) coefficients: Vec<(f64, Column)>,
    /// Standard errors that the least clear of them is away from zero; 0 for one without a name, or
    /// with a number that contradicts it.
    pub(super) clearness: f64,
    /// Whether equal coefficients make it a simpler effect.
    pub(super) is_simpler_where_equal: bool,
}

/// Members of a story that bend the force along one coordinate by one and the same variable.
#[derive(Default)]
struct Curve {
    /// Those with numbers inside.
    bent: usize,
    /// Terms of those without a name.
    unnamed: usize,
    /// Coefficients and inner numbers of all of them.
    numbers: usize,
}

impl Story<'_> {
    /// Whether several members with numbers inside bend one force by one and the same coordinate or
    /// momentum, in so many numbers that any smooth curve would look like them; or several terms
    /// without a name do, whose forms were looked for.
    pub(super) fn is_patchwork(&self) -> bool {
        let most = self.model.tuning().verdict.curve;
        let curves = self.curves();
        curves.iter().any(|curve| curve.unnamed > 1 || curve.bent > 1 && curve.numbers > most)
    }

    /// Whether two members with numbers inside bend one force by one and the same coordinate or
    /// momentum, a known number that is off among them: where something is left all the same, they
    /// are pieces of a curve that has another name or none.
    pub(super) fn bends_a_curve_twice(&self) -> bool {
        let off = self.members.iter().filter(|member| member.effect.number.is_some()).count();
        self.curves().iter().any(|curve| curve.bent > 0 && curve.bent + off > 1)
    }

    /// What members do to each force by one coordinate or momentum.
    fn curves(&self) -> Vec<Curve> {
        let system = &self.scope.compiled().system;
        let mut curves: HashMap<(usize, Symbol), Curve> = HashMap::new();
        for member in &self.members {
            let terms = member.terms.iter().filter_map(|&id| system.term(id));
            let places: Option<HashSet<(usize, Symbol)>> = terms
                .flat_map(Term::parts)
                .map(|(place, expr)| curve_of(system, place, expr))
                .collect();
            let Some(places) = places.filter(|places| places.len() == 1) else { continue };
            for place in places {
                let curve = curves.entry(place).or_default();
                curve.bent += usize::from(!member.parameters.is_empty());
                curve.unnamed += if member.named { 0 } else { member.terms.len() };
                curve.numbers += member.effect.coefficient.len();
            }
        }
        curves.into_values().collect()
    }

    /// Whether a coefficient of a member contradicts its name: a drag that feeds energy is none.
    pub(super) fn contradicts_a_name(&self) -> bool {
        let law = &self.model.law;
        self.members.iter().any(|one| one.positive && has_negative(law, &one.terms))
    }

    /// Whether every coefficient of every member is clearly not zero.
    pub(super) fn stands(&self) -> bool {
        let clear = self.model.tuning().verdict.standard_errors;
        self.members.iter().all(|member| self.clearness(member) >= clear)
    }

    /// Whether an inner number of a member is at an end of its range, where it stands in for a
    /// simpler one.
    pub(super) fn stands_in_for_a_simpler_one(&self) -> bool {
        let part = self.model.tuning().ranking.at_bound;
        self.members.iter().any(|member| {
            let values = member.parameters.iter().map(|&id| self.model.law.parameter(id));
            let mut both = values.zip(&member.ranges);
            both.any(|(value, range)| value.is_some_and(|value| range.is_at_its_end(value, part)))
        })
    }

    /// Numbers of all members.
    pub(super) fn unknowns(&self) -> usize {
        self.members.iter().map(|member| member.effect.coefficient.len()).sum()
    }

    /// Standard errors that the least clear coefficient of a member is away from zero.
    pub(super) fn clearness(&self, member: &Member) -> f64 {
        let system = &self.scope.compiled().system;
        Clearness::of(&member.effect, &member.terms, system).standard_errors()
    }

    /// Whether what a member does is infinite somewhere between two samples: where a coordinate or
    /// a momentum passes zero.
    pub(super) fn is_infinite_on_its_way(&self) -> bool {
        let system = &self.scope.compiled().system;
        let mut graph = system.graph.clone();
        let mut actions: Vec<Expr> = Vec::new();
        let terms = self.members.iter().flat_map(|member| &member.terms);
        for (place, expr) in terms.filter_map(|&id| system.term(id)).flat_map(Term::parts) {
            match place.is_energy() {
                true => actions.extend(graph.gradient(expr, &system.state())),
                false => actions.push(expr),
            }
        }
        let parameters: HashMap<usize, f64> = system
            .parameter_ids()
            .into_iter()
            .filter_map(|id| Some((id.position(), self.model.law.parameter(id)?)))
            .collect();
        let packed = &self.model.data.packed;
        let state = system.state();
        let passes = |run: usize, row: usize| {
            let values = packed.values_of(row, run);
            values.windows(2).position(|pair| pair[0] * pair[1] < 0.0)
        };
        let infinite = |run: usize, row: usize| {
            let Some(sample) = passes(run, row) else { return false };
            let at = |symbol: Symbol| match state.iter().position(|&own| own == symbol) {
                Some(own) if own == row => 0.0,
                Some(own) => packed.values_of(own, run)[sample],
                None => match symbol {
                    Symbol::Parameter(j) => parameters.get(&j).copied().unwrap_or(1.0),
                    _ => 1.0,
                },
            };
            actions.iter().any(|&action| graph.value(action, &at).is_infinite())
        };
        let rows = 0..state.len();
        (0..packed.runs()).any(|run| rows.clone().any(|row| infinite(run, row)))
    }

    /// How far each member would be believed by itself.
    pub(super) fn beliefs(&self) -> Vec<Belief> {
        let law = &self.model.law;
        let all = self.members.iter().zip(self.columns());
        let of = |(member, columns): (&Member, Vec<Column>)| {
            let terms = member.terms.iter().filter_map(|&id| law.coefficient(id));
            let change = member.effect.number.as_ref().zip(member.parameters.first());
            let change = change.and_then(|(one, &id)| Some(law.parameter(id)? - one.was));
            let opposite = member.positive && has_negative(law, &member.terms);
            let row = member.effect.effect.split('(').next().and_then(by_name);
            Belief {
                is_simpler_where_equal: row.is_some_and(|row| row.where_equal.is_some()),
                coefficients: terms.chain(change).zip(columns).collect(),
                clearness: if member.named && !opposite { self.clearness(member) } else { 0.0 },
            }
        };
        all.map(of).collect()
    }
}

/// Whether a story may be told: it explains the data over whole runs, with nothing to spare and by
/// effects that are what their names say.
pub(super) fn holds(story: &Story) -> bool {
    story.explains
        && story.stands()
        && !story.is_patchwork()
        && !story.contradicts_a_name()
        && !story.is_infinite_on_its_way()
}

/// The coordinate that something acts along and the coordinate or momentum that it goes by, where
/// that is one alone.
fn curve_of(system: &System, place: Place, expr: Expr) -> Option<(usize, Symbol)> {
    let mut symbols = system.graph.symbols(&[expr]).into_iter().collect::<Vec<_>>();
    symbols.retain(|symbol| !matches!(symbol, Symbol::Parameter(_) | Symbol::Coefficient(_)));
    let [symbol @ (Symbol::Coordinate(i) | Symbol::Momentum(i))] = symbols[..] else {
        return None;
    };
    match place {
        Place::Kinetic | Place::Potential | Place::Hamiltonian => Some((i, symbol)),
        Place::Force(along) => Some((along, symbol)),
        Place::Rate(_) | Place::Sensor(_) => None,
    }
}
