//! The extension module `leverrier._native`: the library's façade, thin, for the Python sources
//! beside it. Objects of Python come in, numbers and JSON go out; what reads well in Python is
//! written in Python.

mod data;
mod errors;
mod law;
mod spec;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<data::Data>()?;
    module.add_class::<law::Law>()?;
    module.add_class::<law::VectorField>()?;
    module.add_class::<spec::Spec>()
}
