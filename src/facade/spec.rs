//! A spec: what is known of a system, and what is to be learned.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::effect::NamedEffect;
use super::measured::Named;
use super::{Data, Law, measured};
use crate::data::files_of;
use crate::diagnostic::Diagnostic;
use crate::error::{Error, ErrorKind, Result};
use crate::expr::{self, Compiled, System};
use crate::fit::{self, Monitor, Options, Silent};
use crate::spec::edit;

/// What is known of a system and what is to be learned, in the language of `.ham` files.
///
/// A copy is cheap: all copies share one compiled text.
///
/// ```
/// use leverrier::Spec;
///
/// let spec = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ poly(q; 4), cos(q) }")?;
/// assert_eq!(spec.coordinates(), ["q"]);
/// assert_eq!(spec.terms().len(), 5);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Clone)]
pub struct Spec(Arc<Inner>);

struct Inner {
    name: String,
    /// The file, where it was read from one.
    path: Option<PathBuf>,
    text: String,
    compiled: Compiled,
}

impl Spec {
    /// Reads and compiles the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read ([`ErrorKind::File`]), or everything that is wrong with its text
    /// ([`ErrorKind::Spec`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert_eq!(spec.system_name(), "pendulum on a bench");
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Result<Spec> {
        let path = path.as_ref();
        let text = measured::spec_text(path)?;
        Spec::compile(path.display().to_string(), Some(path.to_path_buf()), text)
    }

    /// Compiles a text.
    ///
    /// # Errors
    /// Everything that is wrong with it, in the order of the text ([`ErrorKind::Spec`]).
    ///
    /// ```
    /// use leverrier::{ErrorKind, Spec};
    ///
    /// let wrong = Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = sin(q, 1) + foo");
    /// let error = wrong.unwrap_err();
    /// assert_eq!(error.kind(), ErrorKind::Spec);
    /// assert_eq!(error.diagnostics().len(), 2);
    /// assert_eq!(error.diagnostics()[0].place("coordinates q; momenta p\nT = p^2/2\nV = sin(q, 1)").0, 3);
    /// ```
    pub fn parse(text: &str) -> Result<Spec> {
        Spec::compile("spec".to_string(), None, text.to_string())
    }

    fn compile(name: String, path: Option<PathBuf>, text: String) -> Result<Spec> {
        let compiled = expr::build(&name, &text)?;
        Ok(Spec(Arc::new(Inner { name, path, text, compiled })))
    }

    /// The text that it was compiled from.
    ///
    /// ```
    /// let text = "coordinates q; momenta p\nT = p^2/2\nV = q^2";
    /// assert_eq!(leverrier::Spec::parse(text)?.text(), text);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// What the text calls the system.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("system \"bench\"\ncoordinates q; momenta p\nT = p^2/2")?;
    /// assert_eq!(spec.system_name(), "bench");
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn system_name(&self) -> &str {
        &self.system().name
    }

    /// Names of the coordinates, in the order of the state.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates x, y; momenta px, py\nT = px^2 + py^2")?;
    /// assert_eq!(spec.coordinates(), ["x", "y"]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn coordinates(&self) -> Vec<&str> {
        self.system().coordinates.iter().map(|variable| variable.name.as_str()).collect()
    }

    /// Names of the measured inputs that drive it.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2")?;
    /// assert!(spec.inputs().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn inputs(&self) -> Vec<String> {
        self.system().measured_inputs().into_iter().map(|input| input.name).collect()
    }

    /// What columns of measurements may hold, in order: coordinates, then momenta or velocities.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; velocities v\nT = p_q^2/2\nV = q^2")?;
    /// assert_eq!(spec.observables(), ["q", "v"]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn observables(&self) -> Vec<String> {
        self.system().observables()
    }

    /// Names of the momenta, in the order of the state.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates x, y; momenta px, py\nT = px^2 + py^2")?;
    /// assert_eq!(spec.momenta(), ["px", "py"]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn momenta(&self) -> Vec<&str> {
        self.system().momenta.iter().map(|variable| variable.name.as_str()).collect()
    }

    /// The function space: each term whose coefficient is to be learned, in the language of the
    /// spec and without its coefficient.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2, cos(q) }")?;
    /// assert_eq!(spec.terms(), ["q^2", "cos(q)"]);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn terms(&self) -> Vec<&str> {
        self.system().terms.iter().map(|term| term.label.as_str()).collect()
    }

    /// Warnings and notes about the text, in its order; errors never get so far.
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// assert!(spec.warnings().is_empty());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn warnings(&self) -> &[Diagnostic] {
        &self.0.compiled.warnings
    }

    /// The measurements that its `data` block names, read whole into memory. The file is looked
    /// for beside the spec's own.
    ///
    /// # Errors
    /// There is no such block ([`ErrorKind::DataNotNamed`]), the file cannot be read, or it does
    /// not hold the columns that the spec asks for ([`ErrorKind::Data`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// assert_eq!(spec.data()?.runs(), 8);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn data(&self) -> Result<Data> {
        Data::of_names(self, &self.named(None)?)
    }

    /// Learns which terms the law has, and their coefficients: [`Spec::fit_with`] with
    /// [`Options::default`].
    ///
    /// # Errors
    /// As [`Spec::fit_with`].
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let law = spec.fit(&spec.data()?)?;
    /// assert!((law.coefficient("cos(q)").unwrap() + 1.0).abs() < 0.01);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn fit(&self, data: &Data) -> Result<Law> {
        self.fit_with(data, &Options::default())
    }

    /// Learns which terms the law has, and their coefficients, with options.
    ///
    /// Works on the threads of the rayon pool that it is called from; the result does not depend
    /// on their number.
    ///
    /// # Errors
    /// The measurements do not suffice ([`ErrorKind::InsufficientData`]), cannot tell the scale
    /// of H ([`ErrorKind::NotIdentifiable`]), belong to another spec
    /// ([`ErrorKind::InvalidArgument`]), or the function space takes more memory than is allowed
    /// ([`ErrorKind::MemoryLimit`]).
    ///
    /// ```
    /// use leverrier::{Options, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let options = Options { seed: 7, ..Options::default() };
    /// let law = spec.fit_with(&spec.data()?, &options)?;
    /// assert_eq!(law.terms().len(), 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn fit_with(&self, data: &Data, options: &Options) -> Result<Law> {
        self.fit_monitored(data, options, &Silent)
    }

    /// The same, telling a monitor how far it has come, and asking it whether to stop.
    ///
    /// # Errors
    /// As [`Spec::fit_with`]; and it was stopped before there was anything to keep
    /// ([`ErrorKind::Interrupted`]).
    ///
    /// ```
    /// use std::sync::atomic::AtomicBool;
    ///
    /// use leverrier::{Flag, Options, Spec};
    ///
    /// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let stop = AtomicBool::new(false); // another thread may raise it
    /// let law = spec.fit_monitored(&spec.data()?, &Options::default(), &Flag(&stop))?;
    /// assert_eq!(law.terms().len(), 1);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn fit_monitored(
        &self,
        data: &Data,
        options: &Options,
        monitor: &dyn Monitor,
    ) -> Result<Law> {
        data.require(self)?;
        let options = self.with_starts(options);
        let model = fit::fit(&self.0.compiled.system, data.dataset(), &options, monitor)?;
        Law::learned(self, model, data)
    }

    /// The law of a spec in which no term is to be learned: it stands in the text.
    ///
    /// # Errors
    /// There are terms to learn ([`ErrorKind::NotApplicable`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2")?;
    /// let swing = spec.known_law()?.predict(&[1.0, 0.0], &[0.0, std::f64::consts::PI])?;
    /// assert!((swing.states()[1][0] + 1.0).abs() < 1e-12);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn known_law(&self) -> Result<Law> {
        Law::known(self)
    }

    /// The spec with an effect of the catalogue (or one of its own `candidates`) put into its
    /// text, to be fitted again: `viscous_drag(q)`, or a bare name where there is one place for
    /// it.
    ///
    /// # Errors
    /// There is no such effect ([`ErrorKind::UnknownName`]), it does not apply here
    /// ([`ErrorKind::NotApplicable`]), or is in the text already ([`ErrorKind::NothingToDo`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let damped = spec.with("viscous_drag(q)")?;
    /// assert!(damped.text().contains("effect viscous_drag(q)"));
    /// assert_eq!(damped.terms().len(), 2);
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn with(&self, effect: &str) -> Result<Spec> {
        let named = NamedEffect::new(effect, self.text(), self.system())?;
        if named.place(self.text()).is_some() {
            return Err(Error::new(
                ErrorKind::NothingToDo,
                format!("{} has `{}` already", self.0.name, named.label),
                "fit it as it is, or take the effect out first",
            ));
        }
        self.edited(edit::insert(self.text(), &named.statement))
    }

    /// The spec without an effect, or without a term that has a name.
    ///
    /// # Errors
    /// It has neither ([`ErrorKind::UnknownName`]).
    ///
    /// ```
    /// let spec = leverrier::Spec::parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")?;
    /// let damped = spec.with("viscous_drag(q)")?;
    /// assert_eq!(damped.without("viscous_drag(q)")?.terms(), spec.terms());
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn without(&self, effect: &str) -> Result<Spec> {
        let text = self.text();
        let statement = NamedEffect::new(effect, text, self.system())
            .ok()
            .and_then(|named| named.place(text))
            .map(|statement| edit::remove(text, statement.site.0));
        match statement.or_else(|| edit::remove_term(text, effect)) {
            Some(shorter) => self.edited(shorter),
            None => Err(Error::new(
                ErrorKind::UnknownName,
                format!("{} has neither an effect nor a named term `{effect}`", self.0.name),
                "name one of its `effect` statements, or a term such as `stiffness: q^2`",
            )),
        }
    }

    /// Options with the starts of inner parameters that the text lists, where they have none.
    pub(super) fn with_starts(&self, options: &Options) -> Options {
        let mut options = options.clone();
        if options.parameter_starts.is_empty() {
            options.parameter_starts.clone_from(&self.0.compiled.starts);
        }
        options
    }

    /// The same place on disk with another text.
    pub(crate) fn edited(&self, text: String) -> Result<Spec> {
        Spec::compile(self.0.name.clone(), self.0.path.clone(), text)
    }

    pub(crate) fn compiled(&self) -> &Compiled {
        &self.0.compiled
    }

    pub(crate) fn system(&self) -> &Arc<System> {
        &self.0.compiled.system
    }

    pub(crate) fn name(&self) -> &str {
        &self.0.name
    }

    /// Its file; its name, where it was parsed from a text.
    pub(crate) fn file(&self) -> &Path {
        self.0.path.as_deref().unwrap_or(Path::new(&self.0.name))
    }

    /// Where the measurements are, and in which columns: in what is asked for, or in all that the
    /// spec names.
    pub(crate) fn named(&self, asked: Option<&Path>) -> Result<Vec<Named<'_>>> {
        let said = &self.0.compiled.data;
        if let Some(path) = asked {
            return Ok(vec![Named { path: path.to_path_buf(), columns: said.first() }]);
        }
        if said.is_empty() {
            return Err(Error::new(
                ErrorKind::DataNotNamed,
                format!("{} does not name its data", self.0.name),
                "write `data \"file.csv\" { time t }` in it, or give a file",
            ));
        }
        let folder = self.0.path.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        let paths = said.iter().map(|columns| (folder.join(&columns.file), columns));
        Ok(paths.map(|(path, columns)| Named { path, columns: Some(columns) }).collect())
    }

    /// The files of measurements: those asked for, or those that it names.
    ///
    /// # Errors
    /// It names none, or there is none of such a name.
    pub(crate) fn data_files(&self, asked: Option<&Path>) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for name in self.named(asked)? {
            files.extend(files_of(&name.path)?.into_iter().map(|file| file.path));
        }
        Ok(files)
    }
}

impl fmt::Debug for Spec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Spec").field("name", &self.0.name).field("text", &self.0.text).finish()
    }
}
