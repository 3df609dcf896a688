//! What the studio does with a spec: the commands' own functions, with news for the page.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::files::{self, AllowedFolder, FileStamps};
use super::jobs::JobRequest;
use super::{Studio, wire};
use crate::data::write_atomically;
use crate::diagnose::diagnosis::Diagnosis;
use crate::diagnose::sufficiency;
use crate::diagnostic::Diagnostic;
use crate::error::{Error, ErrorKind, Result};
use crate::fit::{Model, Monitor, Options, StopReason};
use crate::project::fitting::{origin, write_model};
use crate::project::ledger::{HeldOutErrors, Ledger};
use crate::project::lock::Lock;
use crate::project::measurements::Measurements;
use crate::project::memory;
use crate::project::page::{self, Assessment};
use crate::project::revise::{self, RevisionOutcome};
use crate::project::undo::undo;
use crate::project::workspace::{SplitOptions, Workspace};
use crate::project::{Listener, ModelFile, Spec};

/// News of progress are no more frequent than this.
const FREQUENT: Duration = Duration::from_millis(60);

/// A learned model with what is known of it. It is never changed, only replaced.
#[derive(Clone)]
pub(super) struct LearnedState {
    pub workspace: Arc<Workspace>,
    /// The model of the training part.
    pub training: Arc<Model>,
    /// Where its terms come from.
    pub terms: &'static str,
    assessment: Option<Arc<Assessment>>,
    pub diagnosis: Option<Arc<Diagnosis>>,
}

impl LearnedState {
    /// # Errors
    /// It was not held against the measurements yet.
    pub(super) fn assessment(&self) -> Result<&Assessment> {
        self.assessment.as_deref().ok_or_else(|| {
            Error::new(
                ErrorKind::NotReady,
                "the plots are not drawn yet",
                "wait until the studio has drawn them",
            )
        })
    }
}

/// Does the work, one thing after the other.
pub(super) struct Engine {
    pub studio: Arc<Studio>,
    allowed: AllowedFolder,
    stamps: FileStamps,
    /// Whether the user gave up the question what is missing.
    pub diagnosis_cancelled: bool,
}

/// Warnings about the data stand in the report on them; those about a text in its editor.
struct NoMessages;

impl Listener for NoMessages {
    fn diagnostics(&self, _: &str, _: &str, _: &[Diagnostic]) {}

    fn warning(&self, _: &str) {}
}

/// Tells the page how far a computation has come.
pub(super) struct ProgressReporter<'a> {
    studio: &'a Studio,
    what: &'a str,
    background: bool,
    told: Mutex<Option<Instant>>,
}

impl<'a> ProgressReporter<'a> {
    pub(super) fn new(studio: &'a Studio, what: &'a str, background: bool) -> Self {
        let progress = ProgressReporter { studio, what, background, told: Mutex::new(None) };
        progress.stage("", 0.0);
        progress
    }
}

impl Monitor for ProgressReporter<'_> {
    fn stage(&self, stage: &str, fraction: f64) {
        let mut told = self.told.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if told.is_some_and(|at| at.elapsed() < FREQUENT) {
            return;
        }
        *told = Some(Instant::now());
        let (what, background) = (self.what, self.background);
        let job = wire::Job { what, stage, fraction: fraction.clamp(0.0, 1.0), background };
        self.studio.board.post("job", &job);
    }

    fn stopped(&self) -> bool {
        self.studio.jobs.stopped(self.background)
    }
}

impl Drop for ProgressReporter<'_> {
    fn drop(&mut self) {
        self.studio.board.post("job", &());
    }
}

impl Engine {
    pub(super) fn new(studio: Arc<Studio>) -> Result<Self> {
        let allowed = AllowedFolder::new(&studio.path);
        let engine =
            Engine { studio, allowed, stamps: FileStamps::default(), diagnosis_cancelled: false };
        // The text is there before the page asks for it.
        engine.post_files()?;
        Ok(engine)
    }

    /// Puts up the spec and the ledger as they lie in the folder.
    fn post_files(&self) -> Result<String> {
        let path = &self.studio.path;
        let text = files::read_spec(path)?;
        self.studio.board.post("spec", &wire::spec(&super::name(path), &text));
        self.studio.board.post("ledger", &wire::ledger(&Ledger::open(path)?, &text));
        Ok(text)
    }

    fn stamp(&mut self) {
        let path = &self.studio.path;
        self.stamps = FileStamps::of(path, &self.data_files());
    }

    /// Whether somebody else wrote the files since.
    pub(super) fn changed(&self) -> bool {
        self.stamps != FileStamps::of(&self.studio.path, &self.data_files())
    }

    fn data_files(&self) -> Vec<PathBuf> {
        let files = self.studio.held().and_then(|held| held.workspace.spec.data_files(None).ok());
        files.unwrap_or_default()
    }

    /// The spec with its data, if these may be read.
    fn workspace(&self) -> Result<Workspace> {
        let path = &self.studio.path;
        self.allowed.check(&Spec::open(path)?)?;
        Workspace::open(path, &SplitOptions::default(), &NoMessages)
    }

    /// Reads all files anew; learns the spec where it has no model.
    pub(super) fn open(&mut self, background: bool) -> Result<()> {
        self.post_files()?;
        let opened = self.opened(background);
        self.stamp();
        let (workspace, training, terms) = match opened {
            Ok(opened) => opened,
            // Whoever asks for something else meanwhile will have it read again.
            Err(error) => {
                if !self.studio.jobs.is_waiting() {
                    self.nothing(&error);
                }
                return Err(error);
            }
        };
        self.hold(workspace, training, terms);
        self.stamp();
        Ok(())
    }

    fn opened(&self, background: bool) -> Result<(Workspace, Model, &'static str)> {
        let studio = Arc::clone(&self.studio);
        let mut workspace = self.workspace()?;
        let progress = ProgressReporter::new(&studio, "Fitting the spec", background);
        if workspace.spec.law(None).is_err() {
            let _lock = self.lock(&progress)?;
            // Another command may have changed the spec, or learned it, while this one waited.
            if self.unchanged(&workspace.spec).is_err() {
                workspace = self.workspace()?;
            }
            if workspace.spec.law(None).is_err() {
                self.learned(&workspace, &progress)?;
            }
        }
        let (training, terms) = workspace.model(&progress)?;
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        Ok((workspace, training, terms))
    }

    /// Puts a model up for the page to see, and for what follows.
    fn hold(&mut self, workspace: Workspace, training: Model, terms: &'static str) {
        let (workspace, training) = (Arc::new(workspace), Arc::new(training));
        self.diagnosis_cancelled = false;
        let held = LearnedState { workspace, training, terms, assessment: None, diagnosis: None };
        self.studio.board.post("missing", &wire::undiagnosed("pending"));
        self.studio.hold(Some(Arc::new(held)));
    }

    /// There is no model: the page shows why.
    fn nothing(&self, error: &Error) {
        self.studio.hold(None);
        let board = &self.studio.board;
        board.post("law", &());
        board.post("figures", &Vec::<()>::new());
        board.post("missing", &wire::undiagnosed("none"));
        board.post("failure", &wire::failure(error));
    }

    /// Keeps commands off the spec while the studio writes.
    fn lock(&self, monitor: &dyn Monitor) -> Result<Lock> {
        Lock::take(&self.studio.path, monitor, |_| {})
    }

    /// Searches terms and numbers on all measurements and writes the model, as `fit` does.
    fn learned(&self, workspace: &Workspace, progress: &ProgressReporter) -> Result<()> {
        let spec = &workspace.spec;
        let parameter_starts = spec.compiled().starts.clone();
        let memory = memory::usual();
        let options = Options { parameter_starts, memory: Some(memory), ..Options::default() };
        let measured = Measurements::read(spec, None, memory, &options, progress, |_| {})?;
        let model = measured.learn(spec.system(), &options, None, progress)?;
        if progress.stopped() || model.stop.reason == StopReason::Interrupted {
            return Err(Error::Interrupted);
        }
        self.unchanged(spec)?;
        let file = ModelFile { model, origin: origin(spec, measured.dataset(), measured.report()) };
        write_model(&spec.model_path(), &file)
    }

    /// Nothing is written over what somebody else wrote meanwhile.
    fn unchanged(&self, spec: &Spec) -> Result<()> {
        if files::read_spec(&self.studio.path)? == spec.text() {
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::ChangedMeanwhile,
            "the spec was changed by another program meanwhile, so nothing was written",
            "look at the text as it is now, then do it again",
        ))
    }

    /// Does what the user asks for; returns a sentence about it.
    pub(super) fn carry_out(&mut self, request: &JobRequest) -> Result<String> {
        match request {
            JobRequest::Diagnose => {
                self.diagnosis_cancelled = false;
                Ok(String::new())
            }
            JobRequest::Learn => {
                let studio = Arc::clone(&self.studio);
                let progress = ProgressReporter::new(&studio, "Fitting the spec", false);
                let lock = self.lock(&progress)?;
                self.learned(&self.workspace()?, &progress)?;
                drop((lock, progress));
                self.open(false)?;
                Ok(format!("Learned; the model is in {}.", self.model_name()))
            }
            JobRequest::Save { text, base, learn } => self.save(text, base, *learn),
            JobRequest::Add { effect } => self.revised(effect, true),
            JobRequest::Remove { effect } => self.revised(effect, false),
            JobRequest::Undo { force } => {
                let studio = Arc::clone(&self.studio);
                let lock = self.lock(&ProgressReporter::new(&studio, "Undoing", false))?;
                let undone = undo(&self.studio.path, *force)?;
                drop(lock);
                self.open(false)?;
                let kept = match undone.edits_kept {
                    true => " What was edited by hand is in the ledger.",
                    false => "",
                };
                Ok(format!("Undone: {}.{kept}", undone.action))
            }
        }
    }

    fn model_name(&self) -> String {
        super::name(&self.studio.path.with_extension("model.json"))
    }

    fn save(&mut self, text: &str, base: &str, learn: bool) -> Result<String> {
        let studio = Arc::clone(&self.studio);
        let path = studio.path.clone();
        let lock = self.lock(&ProgressReporter::new(&studio, "Saving", false))?;
        let old = files::read_spec(&path)?;
        if files::hash(&old) != base {
            self.post_files()?;
            return Err(Error::new(
                ErrorKind::ChangedMeanwhile,
                "the file was changed by another program since it was read here",
                "compare: Reload shows what is in the file, Save keeps what stands here",
            ));
        }
        write_atomically(&path, text.as_bytes())?;
        drop(lock);
        let name = super::name(&path);
        self.open(false)?;
        if learn && old == text {
            return self.carry_out(&JobRequest::Learn);
        }
        Ok(format!("{name} is written{}.", if learn { " and learned" } else { "" }))
    }

    fn revised(&mut self, effect: &str, adds: bool) -> Result<String> {
        let studio = Arc::clone(&self.studio);
        let what = format!("{} {effect}", if adds { "Adding" } else { "Removing" });
        let (held, progress, _lock) = loop {
            if self.changed() || self.studio.held().is_none() {
                self.open(false)?;
            }
            let held = self.studio.held().ok_or_else(|| {
                Error::new(
                    ErrorKind::NotReady,
                    "the spec has no model yet",
                    "mend the spec, then learn it",
                )
            })?;
            let progress = ProgressReporter::new(&studio, &what, false);
            let lock = self.lock(&progress)?;
            // What another command wrote while this one waited is read before it is added to.
            if !self.changed() {
                break (held, progress, lock);
            }
        };
        let (workspace, known) = (&held.workspace, Some(&*held.training));
        let revision = match adds {
            true => revise::add(workspace, known, effect, &progress)?,
            false => revise::remove(workspace, known, effect, &progress)?,
        };
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        self.unchanged(&workspace.spec)?;
        revision.keep(workspace)?;
        drop(progress);
        self.post_files()?;
        let RevisionOutcome { action, training, is, supported, why, .. } = revision;
        let (workspace, terms) = (self.workspace()?, "terms and numbers from the training part");
        self.show_judged(&workspace, (&training, terms), &is)?;
        self.hold(workspace, training, terms);
        self.stamp();
        let doubt = match supported {
            Some(false) => " The data do not support it.",
            _ => "",
        };
        Ok(format!("Done: {action}. {}.{doubt}", wire::capital(&why)))
    }

    /// Holds the model against the measurements and draws it. False if that is done already.
    pub(super) fn compare(&mut self) -> Result<bool> {
        let Some(held) = self.studio.held().filter(|held| held.assessment.is_none()) else {
            return Ok(false);
        };
        let studio = Arc::clone(&self.studio);
        let progress = ProgressReporter::new(&studio, "Comparing with the data", true);
        let seen = page::assess(&held.workspace, &held.training, &progress)?;
        let held = LearnedState { assessment: Some(Arc::new(seen)), ..(*held).clone() };
        self.show(held)?;
        Ok(true)
    }

    /// Puts up what takes no time to draw; the rest of the plots stay as they are meanwhile.
    fn show_judged(
        &self,
        workspace: &Workspace,
        model: (&Model, &str),
        judged: &HeldOutErrors,
    ) -> Result<()> {
        if judged.horizons.is_empty() {
            return Ok(());
        }
        let seen = page::judged_before(workspace, judged);
        let (law, figures) =
            page::with_page(workspace, model, &seen, None, self.studio.reproduce, |page| {
                (wire::law(page), wire::first_figures(&page.material))
            })?;
        let board = &self.studio.board;
        board.post("law", &law);
        board.post("figures", &figures);
        Ok(())
    }

    /// Puts up all that is drawn.
    fn show(&self, held: LearnedState) -> Result<()> {
        let seen = held.assessment()?;
        let model = (&*held.training, held.terms);
        let (law, figures) = page::with_page(
            &held.workspace,
            model,
            seen,
            held.diagnosis.as_deref(),
            self.studio.reproduce,
            |page| (wire::law(page), wire::figures(&page.material)),
        )?;
        let board = &self.studio.board;
        board.post("failure", &());
        board.post("law", &law);
        board.post("figures", &figures);
        board.post("effects", &crate::facade::effect::effects_of(held.workspace.spec.text()));
        self.studio.hold(Some(Arc::new(held)));
        Ok(())
    }

    /// Asks what is missing. False if that is answered already.
    pub(super) fn diagnose(&mut self) -> Result<bool> {
        let asked =
            |held: &Arc<LearnedState>| held.diagnosis.is_none() && held.assessment.is_some();
        let Some(held) = self.studio.held().filter(asked) else { return Ok(false) };
        let studio = Arc::clone(&self.studio);
        if self.diagnosis_cancelled {
            return Ok(false);
        }
        studio.board.post("missing", &wire::undiagnosed("running"));
        let progress = ProgressReporter::new(&studio, "Diagnosing", true);
        let workspace = &held.workspace;
        let lacking = sufficiency::lacking(
            workspace.spec.system(),
            &workspace.split.training,
            workspace.held_out(),
            &crate::diagnose::Options::default(),
        );
        let diagnosis = match lacking {
            Some(why) => Diagnosis::too_little(why),
            None => match page::diagnosis(workspace, &held.training, &progress)? {
                Some(diagnosis) => diagnosis,
                None => Diagnosis::too_little("there are no held-out runs".to_string()),
            },
        };
        if progress.stopped() {
            // An answer that was cut short is none.
            self.diagnosis_cancelled = !studio.jobs.is_waiting();
            let state = if self.diagnosis_cancelled { "stopped" } else { "pending" };
            studio.board.post("missing", &wire::undiagnosed(state));
            return Ok(true);
        }
        let answer = wire::missing(&diagnosis);
        self.show(LearnedState { diagnosis: Some(Arc::new(diagnosis)), ..(*held).clone() })?;
        studio.board.post("missing", &answer);
        Ok(true)
    }
}
