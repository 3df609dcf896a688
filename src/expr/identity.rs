//! Which term and which inner parameter: positions that belong to a system.
//!
//! A bare position means another term in another system, and nothing says so. An identifier
//! carries a mark beside its position, made of the system's variables and of what stands there; a
//! system takes an identifier where the mark is that of its own. So it holds in copies of its
//! system, and in every system that appends terms or parameters; where others were put before it
//! or taken away, it is refused, and [`System::term_of`] says where the term is now.

use super::system::{Parameter, Place, System, Term};
use crate::error::{Error, ErrorKind, Result};

/// A term of a system's function space, as it is named by that system and by its extensions.
///
/// They are ordered as the terms are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TermId {
    position: u32,
    mark: u32,
}

/// An inner parameter of a system, as it is named by that system and by its extensions.
///
/// They are ordered as the parameters are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ParameterId {
    position: u32,
    mark: u32,
}

impl TermId {
    /// The term's place in [`System::terms`]: its coefficient is the symbol of this number, and
    /// its column the one of this number in the design matrix of the whole function space.
    pub fn position(self) -> usize {
        self.position as usize
    }
}

impl ParameterId {
    /// The parameter's place in [`System::parameters`]: its symbol is the one of this number.
    pub fn position(self) -> usize {
        self.position as usize
    }
}

/// A hash that is the same on every machine and in every run (FNV-1a: Fowler, Noll and Vo).
#[derive(Debug, Clone, Copy)]
pub(super) struct Mark(u32);

impl Mark {
    const OFFSET: u32 = 0x811c_9dc5;
    const PRIME: u32 = 0x0100_0193;

    /// That of a system: its name and its variables.
    pub(super) fn of(system: &System) -> Mark {
        let variables = system.coordinates.iter().chain(&system.momenta).chain(&system.velocities);
        let names = variables.map(|variable| variable.name.as_str());
        names.fold(Mark(Mark::OFFSET).with(&system.name), Mark::with)
    }

    fn byte(self, byte: u8) -> Mark {
        Mark((self.0 ^ u32::from(byte)).wrapping_mul(Mark::PRIME))
    }

    fn with(self, text: &str) -> Mark {
        text.bytes().fold(self, Mark::byte).byte(0)
    }

    fn place(self, place: Place) -> Mark {
        let (kind, row) = match place {
            Place::Kinetic => (0, 0),
            Place::Potential => (1, 0),
            Place::Hamiltonian => (2, 0),
            Place::Force(row) => (3, row),
            Place::Sensor(row) => (4, row),
            Place::Rate(row) => (5, row),
        };
        (row as u32).to_le_bytes().into_iter().fold(self.byte(kind), Mark::byte)
    }

    /// The identifier of a term at a position of the system, or of one that extends it.
    pub(super) fn term(self, position: usize, term: &Term) -> TermId {
        TermId { position: position as u32, mark: self.place(term.place).with(&term.label).0 }
    }

    /// The same of an inner parameter.
    pub(super) fn parameter(self, position: usize, parameter: &Parameter) -> ParameterId {
        ParameterId { position: position as u32, mark: self.byte(b'p').with(&parameter.name).0 }
    }
}

impl System {
    /// The identifiers of all terms, in their order.
    pub fn term_ids(&self) -> Vec<TermId> {
        self.terms_with_ids().map(|(id, _)| id).collect()
    }

    /// All terms with their identifiers, in their order.
    pub fn terms_with_ids(&self) -> impl Iterator<Item = (TermId, &Term)> {
        let mark = Mark::of(self);
        self.terms.iter().enumerate().map(move |(k, term)| (mark.term(k, term), term))
    }

    /// Terms that a condition holds for, in their order.
    pub fn terms_where(&self, condition: impl Fn(&Term) -> bool) -> Vec<TermId> {
        self.terms_with_ids().filter(|(_, term)| condition(term)).map(|(id, _)| id).collect()
    }

    /// A term; `None` for an identifier of another system.
    pub fn term(&self, id: TermId) -> Option<&Term> {
        let term = self.terms.get(id.position())?;
        (Mark::of(self).term(id.position(), term) == id).then_some(term)
    }

    /// The identifiers of all inner parameters, in their order.
    pub fn parameter_ids(&self) -> Vec<ParameterId> {
        let mark = Mark::of(self);
        let parameters = self.parameters.iter().enumerate();
        parameters.map(|(j, parameter)| mark.parameter(j, parameter)).collect()
    }

    /// An inner parameter; `None` for an identifier of another system.
    pub fn parameter(&self, id: ParameterId) -> Option<&Parameter> {
        let parameter = self.parameters.get(id.position())?;
        (Mark::of(self).parameter(id.position(), parameter) == id).then_some(parameter)
    }

    /// Positions of some terms, in their order.
    ///
    /// # Errors
    ///
    /// One of them belongs to another system.
    pub fn positions(&self, ids: &[TermId]) -> Result<Vec<usize>> {
        let mark = Mark::of(self);
        let own = |id: &TermId| {
            let term = self.terms.get(id.position());
            term.is_some_and(|term| mark.term(id.position(), term) == *id)
        };
        if !ids.iter().all(own) {
            return Err(Error::new(
                ErrorKind::InvalidArgument,
                format!("a term of another system is looked for in `{}`", self.name),
                "look it up there by its place and label",
            ));
        }
        Ok(ids.iter().map(|id| id.position()).collect())
    }

    /// The term of a place with a label in the mini-language, if there is one.
    pub fn find_term(&self, place: Place, label: &str) -> Option<TermId> {
        let same = |term: &Term| term.place == place && term.label == label;
        let position = self.terms.iter().position(same)?;
        Some(Mark::of(self).term(position, &self.terms[position]))
    }

    /// The inner parameter of a name, if there is one.
    pub fn find_parameter(&self, name: &str) -> Option<ParameterId> {
        let position = self.parameters.iter().position(|parameter| parameter.name == name)?;
        Some(Mark::of(self).parameter(position, &self.parameters[position]))
    }

    /// What a term of another system is here: the term with its place and label. `None` where
    /// there is none, or where the identifier is not one of `other`.
    pub fn term_of(&self, other: &System, id: TermId) -> Option<TermId> {
        if self.term(id).is_some() && other.term(id).is_some() {
            return Some(id);
        }
        let term = other.term(id)?;
        self.find_term(term.place, &term.label)
    }

    /// What an inner parameter of another system is here: the one with its name.
    pub fn parameter_of(&self, other: &System, id: ParameterId) -> Option<ParameterId> {
        self.find_parameter(&other.parameter(id)?.name)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::expr::build;

    fn system(text: &str) -> Arc<System> {
        let text = format!("coordinates q\nmomenta p\nT = 1/2*p^2\n{text}\n");
        build("spec", &text).unwrap_or_else(|error| panic!("{error}")).system
    }

    #[test]
    fn identifiers_hold_where_terms_are_appended() {
        let base = system("V = span{ q^2, q^4 }");
        let longer = system("V = span{ q^2, q^4 }\nparam a = 1\nforce q = span{ sin(a*q) }");
        for (id, term) in base.terms_with_ids() {
            // The same term; where its expression lies in the other graph is its own matter.
            assert_eq!(
                longer.term(id).map(|t| (t.place, &t.label)),
                Some((term.place, &term.label))
            );
            assert_eq!(longer.term_of(&base, id), Some(id));
        }
        let last = longer.term_ids()[2];
        assert!(base.term(last).is_none());
        assert!(base.term_of(&longer, last).is_none());
        assert!(base.positions(&longer.term_ids()).is_err());
        assert!(base.parameter(longer.parameter_ids()[0]).is_none());
    }

    #[test]
    fn identifiers_of_other_terms_are_refused() {
        let base = system("V = span{ q^2, q^4 }");
        let other = system("V = span{ q^4, q^2 }");
        for (id, term) in base.terms_with_ids() {
            assert!(other.term(id).is_none());
            let there = other.term_of(&base, id).expect("it has the term elsewhere");
            assert_eq!(other.term(there).expect("its own").label, term.label);
        }
        let force = system("force q = span{ q^2, q^4 }");
        assert!(base.term_ids().into_iter().all(|id| force.term(id).is_none()));
        assert!(base.term_ids().into_iter().all(|id| force.term_of(&base, id).is_none()));
    }
}
