//! Expressions: one hash-consed graph, its derivatives, and the system that a spec describes.

mod derivative;
mod functions;
mod graph;
mod print;
mod system;
mod unit;

pub use functions::{Domain, FUNCTIONS, Function, FunctionRow};
pub use graph::{Expr, Graph, Node, Number, Symbol, raise};
pub use print::Names;
pub use system::{Bounds, Observed, Parameter, Place, System, Term, Variable};
pub use unit::Unit;
