//! A law in the languages of others.

use std::path::Path;

use super::Law;
use super::model_file::ModelFile;
use super::origin::digest;
use crate::data::write_folder;
use crate::error::{Error, ErrorKind, Result};
use crate::export::{self, Export, Output, Pretty, Provenance};
use crate::simplify::{Simplified, Style};

impl Law {
    /// The equations as one would print them: simplified, with standard errors.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -2*cos(q)")?;
    /// assert!(spec.known_law()?.equations().contains("cos(q)"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn equations(&self) -> String {
        self.simplified().text(Style::default())
    }

    /// The equations as a LaTeX fragment for amsmath.
    ///
    /// # Errors
    /// A number of the law is not finite ([`ErrorKind::Export`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// assert!(spec.known_law()?.to_latex()?.contains(r"\cos"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_latex(&self) -> Result<String> {
        self.text("latex")
    }

    /// A LaTeX document that compiles: equations, coefficients and where they come from.
    ///
    /// # Errors
    /// As [`Law::to_latex`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// assert!(spec.known_law()?.to_latex_document()?.contains(r"\begin{document}"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_latex_document(&self) -> Result<String> {
        self.text("latex-document")
    }

    /// The equations as MathML.
    ///
    /// # Errors
    /// As [`Law::to_latex`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// assert!(spec.known_law()?.to_mathml()?.contains("<math"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_mathml(&self) -> Result<String> {
        self.text("mathml")
    }

    /// The law as a Python module for SymPy.
    ///
    /// # Errors
    /// As [`Law::to_latex`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// assert!(spec.known_law()?.to_python()?.contains("import"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_python(&self) -> Result<String> {
        self.text("python")
    }

    /// The law as JSON, its expressions as trees.
    ///
    /// # Errors
    /// As [`Law::to_latex`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// assert!(spec.known_law()?.to_json()?.starts_with('{'));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_json(&self) -> Result<String> {
        self.text("json")
    }

    /// Writes a standalone simulator in Rust, with its own tests and without dependencies, as a
    /// Cargo project; the folder is written whole or not at all, and must be empty or new.
    ///
    /// # Errors
    /// As [`Law::to_latex`]; and the folder is not empty ([`ErrorKind::AlreadyExists`]) or cannot
    /// be written ([`ErrorKind::File`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// let folder = std::env::temp_dir().join(format!("leverrier-to-rust-{}", std::process::id()));
    /// # let _ = std::fs::remove_dir_all(&folder);
    /// spec.known_law()?.to_rust(&folder)?;
    /// assert!(folder.join("Cargo.toml").exists());
    /// # std::fs::remove_dir_all(&folder).unwrap();
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_rust(&self, folder: impl AsRef<Path>) -> Result<()> {
        self.folder("rust", folder.as_ref())
    }

    /// Writes the law and its integrator in C99, with an example, as [`Law::to_rust`] does.
    ///
    /// # Errors
    /// As [`Law::to_rust`].
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = -cos(q)")?;
    /// let folder = std::env::temp_dir().join(format!("leverrier-to-c-{}", std::process::id()));
    /// # let _ = std::fs::remove_dir_all(&folder);
    /// spec.known_law()?.to_c(&folder)?;
    /// assert!(std::fs::read_dir(&folder).unwrap().count() > 1);
    /// # std::fs::remove_dir_all(&folder).unwrap();
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn to_c(&self, folder: impl AsRef<Path>) -> Result<()> {
        self.folder("c", folder.as_ref())
    }

    fn simplified(&self) -> Simplified {
        export::simplified(self.numbers(), self.ranges())
    }

    /// In one of the formats of [`EXPORTERS`](export::EXPORTERS).
    pub(crate) fn exported(&self, format: &str) -> Result<Output> {
        let row = export::exporter(format)?;
        let pretty = export::pretty(&self.simplified());
        (row.export)(&self.prepared_export(&pretty))
    }

    /// As the exporters take it, with what it was made from.
    pub(crate) fn prepared_export<'a>(&'a self, pretty: &'a Pretty) -> Export<'a> {
        let mut out = export::export(self.numbers(), pretty);
        let own = digest(self.spec().file(), self.spec().text().as_bytes());
        out.provenance = Provenance {
            version: env!("CARGO_PKG_VERSION").to_string(),
            spec: (own.name, own.sha256),
            data: None,
            seed: 0,
        };
        if let Some(ModelFile { model, origin }) = self.file() {
            out.provenance.data = Some((origin.data.name.clone(), origin.data.sha256.clone()));
            out.provenance.seed = model.evidence.seed;
            out.start = origin.start.clone();
        }
        out
    }

    fn text(&self, format: &str) -> Result<String> {
        match self.exported(format)? {
            Output::Text(text) => Ok(text),
            Output::Files(_) => Err(misplaced(format)),
        }
    }

    fn folder(&self, format: &str, folder: &Path) -> Result<()> {
        match self.exported(format)? {
            Output::Files(files) => write_folder(folder, &files, false),
            Output::Text(_) => Err(misplaced(format)),
        }
    }
}

fn misplaced(format: &str) -> Error {
    let message = format!("the format `{format}` is not what its row says");
    Error::new(ErrorKind::Internal, message, "report this")
}
