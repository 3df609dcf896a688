//! The model in the language of others, as text and as folders.

use super::{Project, ProjectLaw};
use crate::error::Result;
use crate::export::{self, Export, Output, Pretty};
use crate::facade::exports::export_of;

/// A law in one of the formats of [`EXPORTERS`](export::EXPORTERS).
pub fn output(project: &Project, law: &ProjectLaw, name: &str) -> Result<Output> {
    let row = export::exporter(name)?;
    let pretty = export::pretty(&export::simplified(&law.law, law.ranges()));
    (row.export)(&prepared_export(project, law, &pretty))
}

/// A law as the exporters take it.
pub fn prepared_export<'a>(
    project: &'a Project,
    law: &'a ProjectLaw,
    pretty: &'a Pretty,
) -> Export<'a> {
    export_of(&law.law, pretty, (&project.path, &project.text), law.file.as_ref())
}
