//! A model with all that there is to show of it: what the report and the studio draw.

use super::fitting::origin;
use super::ledger::{HeldOutErrors, Ledger, date};
use super::workspace::Workspace;
use super::{Law, ModelFile, digest};
use crate::diagnose::Options;
use crate::diagnose::comparison::view::{Quantity, View, view};
use crate::diagnose::comparison::{Compared, Comparison, Horizon};
use crate::diagnose::diagnosis::{self, Diagnosis};
use crate::error::{Error, ErrorKind, Result};
use crate::export::formulas;
use crate::expr::{Observed, Variable};
use crate::fit::segments::typical_step;
use crate::fit::{Model, Monitor};
use crate::report::html::{HistoryEntry, Page};
use crate::report::plots::{HistoryPoint, PlotData};
use crate::report::present;

/// Gives the commands that make a page again, with or without a diagnosis.
pub(crate) type Reproduce = fn(&Workspace, bool) -> Vec<String>;

/// A model compared with its measurements.
pub(crate) struct Assessment {
    pub view: View,
    pub comparison: Comparison,
}

/// Where a model of the training part fails.
pub(crate) fn assess(
    workspace: &Workspace,
    model: &Model,
    monitor: &dyn Monitor,
) -> Result<Assessment> {
    monitor.stage("comparing with the data", 0.2);
    let (law, options) = (workspace.spec.learned(model)?, Options::default());
    let (training, held_out) = (&workspace.split.training, workspace.held_out());
    let compared = Compared::new(law, training, held_out, &options, None)?;
    monitor.stage("computing the figures", 0.3);
    let view = view(&compared.training, compared.held_out.as_ref())?;
    Ok(Assessment { view, comparison: compared.comparison })
}

/// What is known of a model that was just judged, before it is held against the measurements
/// again: its errors on the held-out runs.
pub(crate) fn judged_before(workspace: &Workspace, judged: &HeldOutErrors) -> Assessment {
    let system = workspace.spec.system();
    let step = typical_step(&workspace.split.training);
    let horizons = judged.horizons.iter().map(|&(samples, error)| Horizon {
        samples,
        duration: step * samples.saturating_sub(1) as f64,
        training: f64::NAN,
        held_out: Some(error),
        baseline: f64::NAN,
        diverged: 0,
    });
    let comparison = Comparison {
        horizons: horizons.collect(),
        noise_floor: judged
            .noise
            .iter()
            .map(|(name, noise)| (name.clone(), Some(*noise)))
            .collect(),
        maps: Vec::new(),
        energy: Vec::new(),
        findings: Vec::new(),
    };
    let quantity = |variable: &Variable| Quantity {
        name: variable.name.clone(),
        unit: variable.unit_text.clone(),
    };
    let second = match system.observed {
        Observed::Momenta => &system.momenta,
        Observed::Velocities => &system.velocities,
    };
    let pair =
        |second: &[Variable]| system.coordinates.iter().chain(second).map(quantity).collect();
    let view = View {
        system: system.name.clone(),
        state: pair(&system.momenta),
        observables: pair(second),
        time: quantity(&system.time),
        noise: judged.noise.iter().map(|(_, noise)| *noise).collect(),
        predictions: Vec::new(),
        momenta_measured: system.observed == Observed::Momenta,
        energies: Vec::new(),
        portraits: Vec::new(),
        planes: Vec::new(),
    };
    Assessment { view, comparison }
}

/// What is missing from a model of the training part; none without held-out runs.
pub(crate) fn diagnosis(
    workspace: &Workspace,
    model: &Model,
    monitor: &dyn Monitor,
) -> Result<Option<Diagnosis>> {
    let Some(held_out) = workspace.held_out() else { return Ok(None) };
    let (spec, training) = (&workspace.spec, &workspace.split.training);
    let (law, options) = (spec.learned(model)?, Options::default());
    diagnosis::diagnose(spec.compiled(), &law, training, held_out, &options, monitor).map(Some)
}

/// Hands everything that a report tells to `tell`.
///
/// `terms` says where the terms of the `model` come from, `reproduce` with which commands the
/// page is made again.
pub(crate) fn with_page<T>(
    workspace: &Workspace,
    (model, terms): (&Model, &str),
    seen: &Assessment,
    diagnosis: Option<&Diagnosis>,
    reproduce: Reproduce,
    tell: impl FnOnce(&Page) -> T,
) -> Result<T> {
    let ledger = Ledger::open(workspace.spec.file())?;
    let history = stages(&ledger);
    let law = law(workspace, model)?;
    let own = law.file().map_or(model, |file| &file.model);
    let simplified = present::simplified(law.numbers(), law.ranges());
    let pretty = present::pretty(&simplified);
    // A law that cannot be typeset is printed as text.
    let formulas = formulas(&law.prepared_export(&pretty)).unwrap_or_default();
    let material = PlotData {
        view: &seen.view,
        comparison: &seen.comparison,
        model: own,
        diagnosis,
        history: &history,
    };
    Ok(tell(&Page {
        title: &workspace.spec.system().name,
        material,
        model: Some(own),
        simplified: &simplified,
        formulas: &formulas,
        notes: &pretty.notes,
        data: &workspace.about,
        split: &workspace.split.how,
        terms_from: terms,
        spec: workspace.spec.text(),
        history: &entries(&ledger),
        facts: &facts(workspace, &law),
        commands: &reproduce(workspace, diagnosis.is_some()),
    }))
}

/// The law of the model file where it belongs to the spec, else that of the training part.
fn law(workspace: &Workspace, model: &Model) -> Result<Law> {
    if let Ok(law) = workspace.spec.law(None)
        && law.file().is_some()
    {
        return Ok(law);
    }
    let origin = origin(&workspace.spec, &workspace.dataset, &workspace.about);
    let file = ModelFile { model: model.clone(), origin };
    workspace.spec.law_of(file).ok_or_else(|| {
        Error::new(
            ErrorKind::Model,
            "the model belongs to another spec",
            "fit the spec again, then report it",
        )
    })
}

/// States of the spec as the ledger's plot takes them.
fn stages(ledger: &Ledger) -> Vec<HistoryPoint> {
    let mut out: Vec<HistoryPoint> = Vec::new();
    for revision in &ledger.revisions {
        let held_out = |judged: &Option<HeldOutErrors>| judged.as_ref()?.held_out_error;
        // What was there before the first step was judged with it.
        if let Some(before) = out.last_mut()
            && before.error.is_none()
        {
            before.error = held_out(&revision.before);
        }
        out.push(HistoryPoint {
            action: revision.action.clone(),
            error: held_out(&revision.after),
            undone: revision.undone,
        });
    }
    out
}

fn entries(ledger: &Ledger) -> Vec<HistoryEntry> {
    let held_out = |judged: &Option<HeldOutErrors>| judged.as_ref()?.held_out_error;
    let revisions = ledger.revisions.iter();
    revisions
        .map(|revision| HistoryEntry {
            date: date(revision.time),
            action: revision.action.clone(),
            before: held_out(&revision.before),
            after: held_out(&revision.after),
            undone: revision.undone,
        })
        .collect()
}

/// What it takes to make the page again.
fn facts(workspace: &Workspace, law: &Law) -> Vec<(String, String)> {
    let mut out = vec![("program".to_string(), format!("leverrier {}", env!("CARGO_PKG_VERSION")))];
    let mut fact = |name: &str, value: String| out.push((name.to_string(), value));
    let Some(file) = law.file() else { return out };
    let (model, origin) = (&file.model, &file.origin);
    let own = digest(workspace.spec.file(), workspace.spec.text().as_bytes());
    fact("spec", format!("{} SHA-256 {}", own.name, own.sha256));
    if let Some(source) = &workspace.about.source {
        let name = source.file.file_name().unwrap_or_default().to_string_lossy();
        fact("data", format!("{name} SHA-256 {}", source.sha256));
    }
    if workspace.about.source.as_ref().is_some_and(|source| source.sha256 != origin.data.sha256) {
        fact("learned from", format!("{} SHA-256 {}", origin.data.name, origin.data.sha256));
    }
    fact("seed of the fit", model.evidence.seed.to_string());
    fact("loss", model.evidence.loss.clone());
    fact(
        "integrator",
        format!(
            "{}, steps of at most {}",
            model.integrator.method,
            crate::simplify::significant(model.integrator.longest_step, 6)
        ),
    );
    fact("meaning of the spec", model.fingerprint.clone());
    let splitting = &workspace.splitting;
    fact("split", format!("held out {}, seed {}", splitting.held_out, splitting.seed));
    out
}
