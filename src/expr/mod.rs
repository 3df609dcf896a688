//! Expressions: one hash-consed graph, its derivatives, and the system that a spec describes.

mod angles;
mod bodies;
mod columns;
mod couplings;
mod derivative;
mod effects;
mod functions;
mod graph;
mod holonomic;
mod identity;
mod independence;
mod inverse;
// What users write is lowered without an index that their text could miss.
#[deny(clippy::indexing_slicing, clippy::string_slice)]
mod lower;
mod print;
mod space;
mod system;
pub mod unit;
mod unseen;

pub use columns::{ColumnScale, DataColumns, ObservedColumn, candidates, groupings};
pub(crate) use couplings::touching;
pub use effects::instances;
pub use functions::{
    Domain, FUNCTIONS, FUNCTIONS_OF_TWO, Function, FunctionOfTwo, FunctionRow, Kernel, Latex,
    MachineInstruction, SignRule, Target, UnitRule,
};
pub use graph::{Delay, Expr, Graph, Node, Number, Symbol, raise};
pub use identity::{ParameterId, TermId};
pub use independence::{Dependence, MOST_EXAMINED, dependences};
pub use lower::{Compiled, DeclaredCandidate, Extension, KnownNumber, MOST_TERMS, Scope, build};
pub use print::Names;
pub(crate) use print::Precedence;
pub use space::{
    FunctionSpace, SpaceInput, SpaceKnown, SpaceMeasure, SpaceParameter, SpaceTerm, SpaceVariable,
};
pub(crate) use system::without_others;
pub use system::{
    Bounds, Constraint, Hidden, InputVariable, Measure, Observed, Parameter, Per, Place, System,
    Term, Variable,
};
pub use unit::Unit;
pub(crate) use unseen::unseen;
