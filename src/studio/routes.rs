//! What may be asked, one row each. No path of a file is ever taken from a request.

use std::sync::Arc;
use std::time::Duration;

use hyper::body::Bytes;
use hyper::{Method, StatusCode};
use serde::Deserialize;
use serde_json::{Value, json};

use super::jobs::JobRequest;
use super::{Studio, archive, files, name, wire};
use crate::error::{Error, ErrorKind, Result};
use crate::export::Output;
use crate::expr;
use crate::project::Spec;
use crate::project::page::with_page;
use crate::report::html;
use crate::report::plots::{
    Background, Figure, IMAGES, Image, PictureStyle, SCRIPT, escaped_id, image, live_sheet,
};

/// Longest time that a page waits for news before it asks again.
const NEWS: Duration = Duration::from_secs(20);

/// What is sent back.
pub(super) struct Reply {
    pub status: StatusCode,
    pub kind: &'static str,
    pub body: Bytes,
    /// Name of a file that the browser saves it as.
    pub save_as: Option<String>,
}

impl Reply {
    fn new(kind: &'static str, body: impl Into<Bytes>) -> Self {
        Reply { status: StatusCode::OK, kind, body: body.into(), save_as: None }
    }

    fn json(object: &Value) -> Self {
        Reply::new("application/json", object.to_string())
    }

    /// A refusal, with a sentence that says why.
    pub(super) fn refused(status: StatusCode, why: &str) -> Self {
        Reply { status, ..Reply::json(&json!({ "message": why, "hint": null })) }
    }

    fn failed(error: &Error) -> Self {
        let object = json!(wire::failure(error));
        Reply { status: StatusCode::UNPROCESSABLE_ENTITY, ..Reply::json(&object) }
    }
}

/// How a route answers.
enum Handler {
    /// With a text that is always the same.
    Text(&'static str, fn() -> String),
    /// At once.
    Now(fn(&Studio, &str, &[u8]) -> Result<Reply>),
    /// After work, on a thread of its own.
    Work(fn(&Studio, &str, &[u8]) -> Result<Reply>),
    /// When there is news.
    News,
}

/// A row of what may be asked.
pub(super) struct Route {
    method: Method,
    path: &'static str,
    /// Whether it tells nothing of the user's work, and needs no token.
    pub open: bool,
    reply: Handler,
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";

const fn open(path: &'static str, kind: &'static str, text: fn() -> String) -> Route {
    Route { method: Method::GET, path, open: true, reply: Handler::Text(kind, text) }
}

const fn closed(method: Method, path: &'static str, reply: Handler) -> Route {
    Route { method, path, open: false, reply }
}

static ROUTES: &[Route] = &[
    open("/", HTML, || include_str!("assets/page.html").to_string()),
    open("/studio.css", CSS, || include_str!("assets/studio.css").to_string() + &live_sheet()),
    open("/studio.js", JS, || include_str!("assets/studio.js").to_string()),
    open("/editor.js", JS, || include_str!("assets/editor.js").to_string()),
    open("/figures.js", JS, || SCRIPT.to_string()),
    closed(Method::GET, "/api/state", Handler::News),
    closed(Method::POST, "/api/check", Handler::Work(check)),
    closed(Method::POST, "/api/do", Handler::Now(ask)),
    closed(Method::POST, "/api/cancel", Handler::Now(cancel)),
    closed(Method::GET, "/api/export", Handler::Work(export)),
    closed(Method::GET, "/api/report", Handler::Work(report)),
    closed(Method::GET, "/api/plots", Handler::Work(plots)),
];

/// The route of a request.
pub(super) fn find(method: &Method, path: &str) -> Option<&'static Route> {
    ROUTES.iter().find(|route| route.method == *method && route.path == path)
}

impl Route {
    /// Answers a request that the guard let pass.
    pub(super) async fn answer(&self, studio: &Arc<Studio>, query: String, body: Bytes) -> Reply {
        let answered = match self.reply {
            Handler::Text(kind, text) => Ok(Reply::new(kind, text())),
            Handler::Now(reply) => reply(studio, &query, &body),
            Handler::News => Ok(news(studio, &query).await),
            Handler::Work(reply) => {
                let studio = Arc::clone(studio);
                let work = move || reply(&studio, &query, &body);
                match tokio::task::spawn_blocking(work).await {
                    Ok(answered) => answered,
                    Err(_) => Err(Error::new(
                        ErrorKind::Internal,
                        "this failed in the program itself",
                        "report it",
                    )),
                }
            }
        };
        answered.unwrap_or_else(|error| Reply::failed(&error))
    }
}

/// A value of a query such as `since=3&to=c`; no value needs to be escaped.
fn value<'a>(query: &'a str, name: &str) -> Option<&'a str> {
    query.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))
}

async fn news(studio: &Studio, query: &str) -> Reply {
    let seen = value(query, "since").and_then(|text| text.parse().ok()).unwrap_or(0);
    // Nothing new in time is an answer too.
    let _ = tokio::time::timeout(NEWS, studio.board.after(seen)).await;
    Reply::new("application/json", studio.board.since(seen))
}

#[derive(Deserialize)]
struct CheckRequest {
    text: String,
}

fn read<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T> {
    serde_json::from_slice(body).map_err(|error| {
        Error::new(
            ErrorKind::InvalidArgument,
            format!("this is not what the studio understands ({error})"),
            "reload the page",
        )
    })
}

fn check(studio: &Studio, _: &str, body: &[u8]) -> Result<Reply> {
    let CheckRequest { text } = read(body)?;
    too_long(&text)?;
    let diagnostics = match expr::build(&name(&studio.path), &text) {
        Ok(compiled) => compiled.warnings,
        Err(Error::Spec { diagnostics, .. }) => diagnostics,
        Err(other) => return Err(other),
    };
    Ok(Reply::json(&json!({ "diagnostics": wire::diagnostics(&diagnostics, &text) })))
}

fn too_long(text: &str) -> Result<()> {
    if text.len() <= files::LARGEST {
        return Ok(());
    }
    Err(Error::new(
        ErrorKind::InvalidArgument,
        "that is too large for a spec",
        "1 MB is the most that the studio takes",
    ))
}

fn ask(studio: &Studio, _: &str, body: &[u8]) -> Result<Reply> {
    let request: JobRequest = read(body)?;
    if let JobRequest::Save { text, .. } = &request {
        too_long(text)?;
    }
    if studio.jobs.ask(request) {
        return Ok(Reply { status: StatusCode::ACCEPTED, ..Reply::json(&json!({})) });
    }
    Ok(Reply::refused(
        StatusCode::CONFLICT,
        "the studio does one thing at a time: wait for it, or cancel it",
    ))
}

fn cancel(studio: &Studio, _: &str, _: &[u8]) -> Result<Reply> {
    studio.jobs.cancel();
    Ok(Reply::json(&json!({})))
}

fn export(studio: &Studio, query: &str, _: &[u8]) -> Result<Reply> {
    let to = value(query, "to").unwrap_or("");
    let spec = Spec::open(&studio.path)?;
    let law = spec.law(None)?;
    let stem = stem(studio);
    let (answer, save_as) = match law.exported(to)? {
        Output::Text(text) => {
            (Reply::new("text/plain; charset=utf-8", text), format!("{stem}.{}", ending(to)))
        }
        Output::Files(files) => {
            let folder = format!("{stem}-{to}");
            let packed = archive::zip(&folder, &files)?;
            (Reply::new("application/zip", packed), format!("{folder}.zip"))
        }
    };
    Ok(Reply { save_as: Some(save_as), ..answer })
}

/// What files of a format usually end in.
fn ending(format: &str) -> &str {
    match format {
        "latex" | "latex-document" => "tex",
        "python" => "py",
        "mathml" => "html",
        "json" => "export.json",
        other => other,
    }
}

/// What is made of the plots that are held; `what` one wants of them.
fn drawn<T>(studio: &Studio, what: &str, tell: impl FnOnce(&html::Page) -> T) -> Result<T> {
    let held = studio.held().ok_or_else(|| {
        let nothing = format!("there is nothing to {what} yet");
        Error::new(ErrorKind::NotReady, nothing, "wait until the plots are drawn")
    })?;
    let model = (&*held.training, held.terms);
    with_page(
        &held.workspace,
        model,
        held.assessment()?,
        held.diagnosis.as_deref(),
        studio.reproduce,
        tell,
    )
}

fn report(studio: &Studio, _: &str, _: &[u8]) -> Result<Reply> {
    let drawn = drawn(studio, "report", html::page)?;
    let save_as = Some(format!("{}.report.html", stem(studio)));
    Ok(Reply { save_as, ..Reply::new(HTML, drawn.html) })
}

/// The plots as pictures: one of them (`plot=forces&at=0`), or all of them packed.
fn plots(studio: &Studio, query: &str, _: &[u8]) -> Result<Reply> {
    let kind = value(query, "as").and_then(image).ok_or_else(|| {
        let known: Vec<&str> = IMAGES.iter().map(|row| row.name).collect();
        Error::new(
            ErrorKind::UnknownName,
            "there is no such kind of picture",
            format!("one of {}", known.join(", ")),
        )
    })?;
    let paper = value(query, "paper").map(|name| match name {
        "dark" => Background::Dark,
        _ => Background::Light,
    });
    let look = PictureStyle { paper, ..PictureStyle::default() };
    let drawn = drawn(studio, "draw", |page| html::figures(&page.material))?;
    let file = |figure: &Figure, kind: &Image| escaped_id(&figure.id) + "." + kind.name;
    let Some(name) = value(query, "plot") else {
        let figures = drawn.iter().flat_map(|(_, figures)| figures);
        let files: Result<Vec<_>> =
            figures.map(|figure| Ok((file(figure, kind), (kind.draw)(figure, look)?))).collect();
        let folder = format!("{}-plots", stem(studio));
        let packed = archive::zip(&folder, &files?)?;
        let save_as = Some(format!("{folder}-{}.zip", kind.name));
        return Ok(Reply { save_as, ..Reply::new("application/zip", packed) });
    };
    let at: usize = value(query, "at").and_then(|at| at.parse().ok()).unwrap_or(0);
    let own = drawn.iter().find(|(plot, _)| *plot == name);
    let figure = own.and_then(|(_, figures)| figures.get(at)).ok_or_else(|| {
        Error::new(
            ErrorKind::UnknownName,
            "there is no such plot any more",
            "look which plots the page shows now",
        )
    })?;
    let bytes = (kind.draw)(figure, look)?;
    let save_as = Some(format!("{}-{}", stem(studio), file(figure, kind)));
    Ok(Reply { save_as, ..Reply::new(kind.media, bytes) })
}

/// The name of the spec's file without its end, in letters that a header takes.
fn stem(studio: &Studio) -> String {
    studio.path.file_stem().map_or("model".into(), |stem| escaped_id(&stem.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_listed_paths_are_there() {
        for path in ["/../Cargo.toml", "/assets/page.html", "//", "/%2e%2e/x", "/studio.css/.."] {
            assert!(find(&Method::GET, path).is_none(), "{path}");
        }
        assert!(find(&Method::GET, "/").is_some_and(|route| route.open));
        assert!(find(&Method::GET, "/api/do").is_none());
        assert!(ROUTES.iter().all(|route| route.open != route.path.starts_with("/api/")));
    }

    #[test]
    fn values_are_found_in_queries() {
        assert_eq!(value("since=3&to=c", "to"), Some("c"));
        assert_eq!(value("tower=3", "to"), None);
    }
}
