//! `leverrier report`: one page that shows it all, and its plots as files.

use std::io::Read;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::json;

use super::console::Console;
use super::console::usage;
use super::progress::Progress;
use super::project::page;
use super::splitting::SplitArguments;
use super::workspace::Workspace;
use crate::data::write_atomically;
use crate::diagnose::diagnosis::Diagnosis;
use crate::error::{Error, Result};
use crate::report::document;
use crate::report::html::{self, Page, RenderedPage};
use crate::report::plots::{
    Background, IMAGES, PictureStyle, escaped_id, image, plot, printable, require_scale,
};

/// Write one page that shows the law, where it fails, what is missing, and how it was found.
///
/// The page needs no network and nothing beside it: it can be sent as it is, and printed. A name
/// that ends in .tex gets a LaTeX document instead, with its figures in a folder beside it.
#[derive(Args)]
#[command(after_help = "Examples:\n  \
    leverrier report pendulum.ham                     writes pendulum.report.html\n  \
    leverrier report pendulum.ham -o tuesday.html --held-out 0.5\n  \
    leverrier report pendulum.ham -o pendulum.tex     a document for LaTeX, and so for PDF\n  \
    leverrier report pendulum.ham --plots figures     every plot as an SVG file too\n  \
    leverrier report pendulum.ham --plots slides --as png --dark --scale 3")]
pub(super) struct Arguments {
    /// The spec.
    pub spec: PathBuf,
    /// The page, or a document for LaTeX where it ends in .tex; by default a page beside the spec
    /// (pendulum.ham -> pendulum.report.html).
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write every plot into this folder as well.
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// What the plots are written as; several with commas.
    #[arg(long = "as", value_name = "KIND", value_delimiter = ',', default_value = "svg",
        requires = "plots", value_parser = PossibleValuesParser::new(IMAGES.iter().map(|row| row.name)))]
    pub kinds: Vec<String>,
    /// Draw the plots on dark paper; SVG is light or dark as its reader prefers otherwise.
    #[arg(long, requires = "plots")]
    pub dark: bool,
    /// Pixels of a PNG for each pixel of a screen.
    #[arg(long, value_name = "N", default_value_t = 2.0, requires = "plots")]
    pub scale: f64,
    /// Do not ask what is missing, which takes the longest.
    #[arg(long)]
    pub no_diagnosis: bool,
    /// Overwrite a file that is not a page.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub splitting: SplitArguments,
}

/// Runs the command.
pub(super) fn run(arguments: &Arguments, console: &Console) -> Result<()> {
    let path =
        arguments.output.clone().unwrap_or_else(|| arguments.spec.with_extension("report.html"));
    require_page(&path, arguments.force)?;
    require_scale(arguments.scale)?;
    let workspace = Workspace::open(&arguments.spec, &arguments.splitting.asked()?, console)?;
    let progress = Progress::new();
    let (model, terms) = workspace.model(&progress)?;
    let seen = page::assess(&workspace, &model, &progress)?;
    let diagnosis = match arguments.no_diagnosis {
        true => None,
        false => page::diagnosis(&workspace, &model, &progress)?,
    };
    let model = (&model, terms);
    let (drawn, document) =
        page::with_page(&workspace, model, &seen, diagnosis.as_ref(), reproduce, |page| {
            let drawn = html::page(page);
            let folder = Document::beside(&path);
            let document = folder.map(|folder| Document::of(page, &drawn, folder));
            (drawn, document)
        })?;
    drop(progress);
    let bytes = match &document {
        Some(document) => document.write(&path, &drawn)?,
        None => {
            write_atomically(&path, drawn.html.as_bytes())?;
            drawn.html.len()
        }
    };
    let files = match &arguments.plots {
        Some(folder) => write_plots(folder, &drawn, arguments)?,
        None => Vec::new(),
    };
    let written = (path.as_path(), bytes);
    tell(console, arguments, written, &drawn, &files, &seen.comparison.findings, diagnosis.as_ref())
}

/// A report for LaTeX: its text, and the name of the folder of its figures.
struct Document {
    text: String,
    folder: String,
}

/// Pixels of a picture in print for each of a screen: about 400 to the inch.
const FOR_PRINT: f64 = 3.0;

impl Document {
    /// The folder of the figures of a document; none for a page.
    fn beside(path: &Path) -> Option<String> {
        let tex = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("tex"));
        // LaTeX takes no other letters for sure.
        let stem = tex.then(|| path.file_stem().unwrap_or_default().to_string_lossy());
        stem.map(|stem| escaped_id(&stem) + "-figures")
    }

    fn of(page: &Page, drawn: &RenderedPage, folder: String) -> Self {
        Document { text: document::latex(page, &drawn.figures, &folder), folder }
    }

    /// Writes the figures, then the text; how many bytes the text has.
    fn write(&self, path: &Path, drawn: &RenderedPage) -> Result<usize> {
        let kind = printable()?;
        let folder = path.with_file_name(&self.folder);
        std::fs::create_dir_all(&folder).map_err(|error| Error::file("create", &folder, error))?;
        let look = PictureStyle { paper: Some(Background::Light), scale: FOR_PRINT };
        for (name, figure) in document::files(drawn) {
            write_atomically(&folder.join(name), &(kind.draw)(figure, look)?)?;
        }
        write_atomically(path, self.text.as_bytes())?;
        Ok(self.text.len())
    }
}

/// Pages may be written anew; other files are not overwritten by accident.
fn require_page(path: &Path, force: bool) -> Result<()> {
    let Ok(mut file) = std::fs::File::open(path) else { return Ok(()) };
    let mut start = [0; 32];
    let ours = |start: &[u8]| {
        [b"<!DOCTYPE html", document::FIRST_LINE.as_bytes()]
            .iter()
            .any(|own| start.starts_with(own))
    };
    let page = file.read(&mut start).is_ok_and(|n| n == 0 || ours(&start));
    if page || force {
        return Ok(());
    }
    Err(usage(
        format!("{} exists and is not a page", path.display()),
        "give --force to overwrite it, or another name with -o",
    ))
}

/// Writes every figure as files of its own, and gives their names.
fn write_plots(folder: &Path, drawn: &RenderedPage, arguments: &Arguments) -> Result<Vec<String>> {
    std::fs::create_dir_all(folder).map_err(|error| Error::file("create", folder, error))?;
    let paper = arguments.dark.then_some(Background::Dark);
    let look = PictureStyle { paper, scale: arguments.scale };
    let mut files = Vec::new();
    for figure in drawn.figures.iter().flat_map(|(_, figures)| figures) {
        for row in arguments.kinds.iter().filter_map(|name| image(name)) {
            let name = format!("{}.{}", escaped_id(&figure.id), row.name);
            write_atomically(&folder.join(&name), &(row.draw)(figure, look)?)?;
            files.push(name);
        }
    }
    Ok(files)
}

fn tell(
    console: &Console,
    arguments: &Arguments,
    (path, bytes): (&Path, usize),
    drawn: &RenderedPage,
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
        bytes.div_ceil(1000)
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
        "bytes": bytes,
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

/// Commands that make the page again; files by their names alone.
pub(super) fn reproduce(workspace: &Workspace, diagnosed: bool) -> Vec<String> {
    let name = |path: &Path| -> String {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.contains([' ', '\'', '"', '(', ')', '&', ';']) {
            format!("'{}'", name.replace('\'', "'\\''"))
        } else {
            name.into_owned()
        }
    };
    let spec = name(workspace.spec.file());
    let splitting = &workspace.splitting;
    let data = splitting.data.as_ref().map_or(String::new(), |d| format!(" --data {}", name(d)));
    let more = if !diagnosed { " --no-diagnosis" } else { "" };
    vec![
        format!("leverrier fit {spec}{data}"),
        format!(
            "leverrier report {spec}{data} --held-out {} --seed {}{more}",
            splitting.held_out, splitting.seed
        ),
    ]
}
