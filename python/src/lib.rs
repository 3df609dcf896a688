//! The extension module `leverrier._native`: the library's façade, thin, for the Python sources
//! beside it. Objects of Python come in, numbers and JSON go out; what reads well in Python is
//! written in Python.

mod data;
mod errors;
mod law;
mod parts;
mod spec;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(parts::survey_part, module)?)?;
    module.add_function(wrap_pyfunction!(parts::pass_part, module)?)?;
    module.add_function(wrap_pyfunction!(parts::merge_parts, module)?)?;
    module.add_function(wrap_pyfunction!(parts::fit_parts, module)?)?;
    module.add_class::<data::Data>()?;
    module.add_class::<law::Diagnosis>()?;
    module.add_class::<law::Law>()?;
    module.add_class::<law::VectorField>()?;
    module.add_class::<spec::Spec>()
}
