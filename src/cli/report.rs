//! `leverrier report`: one page that shows it all, and its plots as files.

use std::io::Read;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::bench::{Bench, Splitting};
use super::console::Console;
use super::export::the_export;
use super::fit::origin;
use super::ledger::{Ledger, date};
use super::progress::Progress;
use super::project::{Law, ModelFile};
use crate::data::write_atomically;
use crate::diagnose::compare;
use crate::diagnose::context::Context;
use crate::diagnose::missing::{self, Diagnosis};
use crate::diagnose::view::view;
use crate::error::{Error, Result};
use crate::export::formulas;
use crate::fit::{Model, Monitor};
use crate::report::html::{Drawn, Entry, Page, page};
use crate::report::plots::{For, Material, Stage, draw, plot};
use crate::report::present;

/// Write one page that shows the law, where it fails, what is missing, and how it was found.
///
/// The page needs no network and nothing beside it: it can be sent as it is, and printed.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier report pendulum.ham                     writes pendulum.report.html\n  \
    leverrier report pendulum.ham -o tuesday.html --unseen 0.5\n  \
    leverrier report pendulum.ham --plots figures     every plot as an SVG file too")]
pub struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// The page; by default beside the spec (pendulum.ham -> pendulum.report.html).
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write every plot into this folder as well, as SVG.
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Do not ask what is missing, which takes the longest.
    #[arg(long)]
    pub no_diagnosis: bool,
    /// Overwrite a file that is not a page.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub splitting: Splitting,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let path =
        arguments.output.clone().unwrap_or_else(|| arguments.spec.with_extension("report.html"));
    require_page(&path, arguments.force)?;
    let bench = Bench::open(&arguments.spec, &arguments.splitting, console)?;
    let progress = Progress::new();
    let (model, terms) = bench.model(&progress)?;
    progress.stage("where it fails", 0.2);
    let training = Context::new(bench.project.system(), &model, &bench.split.training)?;
    let unseen = bench.unseen().map(|data| training.with_data(data));
    let comparison = compare::compare(&training, unseen.as_ref())?;
    progress.stage("what there is to see", 0.3);
    let view = view(&training, unseen.as_ref())?;
    let diagnosis =
        if arguments.no_diagnosis { None } else { diagnosis(&bench, &model, &progress)? };
    let ledger = Ledger::open(&arguments.spec)?;
    let history = stages(&ledger);
    let law = law(&bench, &model)?;
    let own = law.file.as_ref().map_or(&model, |file| &file.model);
    let material = Material {
        view: &view,
        comparison: &comparison,
        model: own,
        diagnosis: diagnosis.as_ref(),
        history: &history,
    };
    let fitted = law.fitted(bench.project.system());
    let simplified = present::of_law(&fitted, law.ranges());
    let pretty = present::pretty(&simplified);
    // A law that cannot be typeset is printed as text.
    let formulas = the_export(&bench.project, &law, &pretty)
        .and_then(|law| formulas(&law))
        .unwrap_or_default();
    let facts = facts(&bench, &law, arguments);
    let commands = commands(arguments);
    let entries = entries(&ledger);
    let drawn = page(&Page {
        title: &bench.project.system().name,
        material,
        model: Some(own),
        simplified: &simplified,
        formulas: &formulas,
        notes: &pretty.notes,
        data: &bench.about,
        split: &bench.split.how,
        terms_from: terms,
        spec: &bench.project.text,
        history: &entries,
        facts: &facts,
        commands: &commands,
    });
    drop(progress);
    write_atomically(&path, drawn.html.as_bytes())?;
    let files = match &arguments.plots {
        Some(folder) => write_plots(folder, &drawn)?,
        None => Vec::new(),
    };
    tell(console, arguments, &path, &drawn, &files, &comparison.findings, diagnosis.as_ref())
}

/// Pages may be written anew; other files are not overwritten by chance.
fn require_page(path: &Path, force: bool) -> Result<()> {
    let Ok(mut file) = std::fs::File::open(path) else { return Ok(()) };
    let mut start = [0; 15];
    let page = file.read(&mut start).is_ok_and(|n| n == 0 || start.starts_with(b"<!DOCTYPE html"));
    if page || force {
        return Ok(());
    }
    Err(Error::usage(
        format!("{} exists and is not a page", path.display()),
        "give --force to overwrite it, or another name with -o",
    ))
}

fn diagnosis(bench: &Bench, model: &Model, progress: &Progress) -> Result<Option<Diagnosis>> {
    let Some(unseen) = bench.unseen() else { return Ok(None) };
    let project = &bench.project;
    missing::diagnose(
        &project.name(),
        &project.text,
        &project.compiled,
        model,
        &bench.split.training,
        unseen,
        progress,
    )
    .map(Some)
}

/// The law of the model file where it belongs to the spec, else that of the training part.
fn law(bench: &Bench, model: &Model) -> Result<Law> {
    if let Ok(law) = bench.project.law(None)
        && law.file.is_some()
    {
        return Ok(law);
    }
    let origin = origin(&bench.project, &bench.dataset, &bench.about);
    let file = ModelFile { model: model.clone(), origin };
    bench.project.law_of(file).ok_or_else(|| {
        Error::fit("the model belongs to another spec", "fit the spec again, then report it")
    })
}

/// States of the spec as the ledger's plot takes them.
fn stages(ledger: &Ledger) -> Vec<Stage> {
    let mut out: Vec<Stage> = Vec::new();
    for revision in &ledger.revisions {
        let unseen = |judged: &Option<super::ledger::Judged>| judged.as_ref()?.unseen_error;
        // What was there before the first step was judged with it.
        if let Some(before) = out.last_mut()
            && before.error.is_none()
        {
            before.error = unseen(&revision.before);
        }
        out.push(Stage {
            action: revision.action.clone(),
            error: unseen(&revision.after),
            undone: revision.undone,
        });
    }
    out
}

fn entries(ledger: &Ledger) -> Vec<Entry> {
    let unseen = |judged: &Option<super::ledger::Judged>| judged.as_ref()?.unseen_error;
    let revisions = ledger.revisions.iter();
    revisions
        .map(|revision| Entry {
            date: date(revision.time),
            action: revision.action.clone(),
            before: unseen(&revision.before),
            after: unseen(&revision.after),
            undone: revision.undone,
        })
        .collect()
}

/// What it takes to make the page again.
fn facts(bench: &Bench, law: &Law, arguments: &Arguments) -> Vec<(String, String)> {
    let mut out = vec![("program".to_string(), format!("leverrier {}", env!("CARGO_PKG_VERSION")))];
    let mut fact = |name: &str, value: String| out.push((name.to_string(), value));
    let Some(file) = &law.file else { return out };
    let (model, origin) = (&file.model, &file.origin);
    let own = super::project::digest(&bench.project.path, bench.project.text.as_bytes());
    fact("spec", format!("{} SHA-256 {}", own.name, own.sha256));
    if let Some(source) = &bench.about.source {
        let name = source.file.file_name().unwrap_or_default().to_string_lossy();
        fact("data", format!("{name} SHA-256 {}", source.sha256));
    }
    if bench.about.source.as_ref().is_some_and(|source| source.sha256 != origin.data.sha256) {
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
    let splitting = &arguments.splitting;
    fact("split", format!("unseen {}, seed {}", splitting.unseen, splitting.seed));
    out
}

/// Commands that make the page again; files by their names alone.
fn commands(arguments: &Arguments) -> Vec<String> {
    let name = |path: &Path| -> String {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.contains([' ', '\'', '"', '(', ')', '&', ';']) {
            format!("'{}'", name.replace('\'', "'\\''"))
        } else {
            name.into_owned()
        }
    };
    let spec = name(&arguments.spec);
    let splitting = &arguments.splitting;
    let data = splitting.data.as_ref().map_or(String::new(), |d| format!(" --data {}", name(d)));
    let more = if arguments.no_diagnosis { " --no-diagnosis" } else { "" };
    vec![
        format!("leverrier fit {spec}{data}"),
        format!(
            "leverrier report {spec}{data} --unseen {} --seed {}{more}",
            splitting.unseen, splitting.seed
        ),
    ]
}

/// Writes every figure as an SVG file of its own, and gives their names.
fn write_plots(folder: &Path, drawn: &Drawn) -> Result<Vec<String>> {
    std::fs::create_dir_all(folder).map_err(|error| Error::file("create", folder, error))?;
    let mut files = Vec::new();
    for figure in drawn.figures.iter().flat_map(|(_, figures)| figures) {
        let name = format!("{}.svg", figure.id);
        write_atomically(&folder.join(&name), draw(figure, For::File).as_bytes())?;
        files.push(name);
    }
    Ok(files)
}

fn tell(
    console: &Console,
    arguments: &Arguments,
    path: &Path,
    drawn: &Drawn,
    files: &[String],
    findings: &[String],
    diagnosis: Option<&Diagnosis>,
) -> Result<()> {
    let figures: Vec<_> = drawn
        .figures
        .iter()
        .flat_map(|(plot, figures)| figures.iter().map(move |figure| (plot, figure)))
        .collect();
    let mut text = format!(
        "Report with {} figures written to {} ({} kB).",
        figures.len(),
        path.display(),
        drawn.html.len().div_ceil(1000)
    );
    if let Some(folder) = &arguments.plots {
        text += &format!("\n{} plots written to {}.", files.len(), folder.display());
    }
    let absent: Vec<_> = drawn
        .figures
        .iter()
        .filter(|(_, figures)| figures.is_empty())
        .map(|(name, _)| json!({ "plot": name, "why": plot(name).map(|row| row.absent) }))
        .collect();
    let object = json!({
        "format": "leverrier.report/1",
        "path": path.display().to_string(),
        "bytes": drawn.html.len(),
        "figures": figures.iter().map(|(plot, figure)| json!({
            "plot": plot,
            "id": figure.id,
            "title": figure.title,
            "caption": figure.caption,
        })).collect::<Vec<_>>(),
        "absent": absent,
        "plots": arguments.plots.as_ref().map(|folder| folder.display().to_string()),
        "files": files,
        "findings": findings,
        "verdict": diagnosis.map(|diagnosis| diagnosis.verdict),
    });
    console.result(&text, &object)
}
