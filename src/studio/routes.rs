//! What may be asked, one row each. No path of a file is ever taken from a request.

use std::sync::Arc;
use std::time::Duration;

use hyper::body::Bytes;
use hyper::{Method, StatusCode};
use serde::Deserialize;
use serde_json::{Value, json};

use super::jobs::Wish;
use super::{Studio, archive, files, name, wire};
use crate::error::{Error, Result};
use crate::export::{EXPORTERS, Output};
use crate::expr;
use crate::project::Project;
use crate::project::page::with_page;
use crate::project::written::output;
use crate::report::html;
use crate::report::plots::{SCRIPT, live_sheet};

/// Longest time that a page waits for news before it asks again.
const NEWS: Duration = Duration::from_secs(20);

/// What is sent back.
pub struct Answer {
    pub status: StatusCode,
    pub kind: &'static str,
    pub body: Bytes,
    /// Name of a file that the browser saves it as.
    pub save_as: Option<String>,
}

impl Answer {
    fn new(kind: &'static str, body: impl Into<Bytes>) -> Self {
        Answer { status: StatusCode::OK, kind, body: body.into(), save_as: None }
    }

    fn json(object: &Value) -> Self {
        Answer::new("application/json", object.to_string())
    }

    /// A refusal, with a sentence that says why.
    pub fn refused(status: StatusCode, why: &str) -> Self {
        Answer { status, ..Answer::json(&json!({ "message": why, "hint": null })) }
    }

    fn failed(error: &Error) -> Self {
        let object = json!(wire::failure(error));
        Answer { status: StatusCode::UNPROCESSABLE_ENTITY, ..Answer::json(&object) }
    }
}

/// How a route answers.
enum Reply {
    /// With a text that is always the same.
    Text(&'static str, fn() -> String),
    /// At once.
    Now(fn(&Studio, &str, &[u8]) -> Result<Answer>),
    /// After work, on a thread of its own.
    Work(fn(&Studio, &str, &[u8]) -> Result<Answer>),
    /// When there is news.
    News,
}

/// A row of what may be asked.
pub struct Route {
    method: Method,
    path: &'static str,
    /// Whether it tells nothing of the user's work, and needs no token.
    pub open: bool,
    reply: Reply,
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";

const fn open(path: &'static str, kind: &'static str, text: fn() -> String) -> Route {
    Route { method: Method::GET, path, open: true, reply: Reply::Text(kind, text) }
}

const fn closed(method: Method, path: &'static str, reply: Reply) -> Route {
    Route { method, path, open: false, reply }
}

static ROUTES: &[Route] = &[
    open("/", HTML, || include_str!("assets/page.html").to_string()),
    open("/studio.css", CSS, || include_str!("assets/studio.css").to_string() + &live_sheet()),
    open("/studio.js", JS, || include_str!("assets/studio.js").to_string()),
    open("/editor.js", JS, || include_str!("assets/editor.js").to_string()),
    open("/figures.js", JS, || SCRIPT.to_string()),
    closed(Method::GET, "/api/state", Reply::News),
    closed(Method::POST, "/api/check", Reply::Work(check)),
    closed(Method::POST, "/api/do", Reply::Now(ask)),
    closed(Method::POST, "/api/cancel", Reply::Now(cancel)),
    closed(Method::GET, "/api/export", Reply::Work(export)),
    closed(Method::GET, "/api/report", Reply::Work(report)),
];

/// The route of a request.
pub fn find(method: &Method, path: &str) -> Option<&'static Route> {
    ROUTES.iter().find(|route| route.method == *method && route.path == path)
}

impl Route {
    /// Answers a request that the guard let pass.
    pub async fn answer(&self, studio: &Arc<Studio>, query: String, body: Bytes) -> Answer {
        let answered = match self.reply {
            Reply::Text(kind, text) => Ok(Answer::new(kind, text())),
            Reply::Now(reply) => reply(studio, &query, &body),
            Reply::News => Ok(news(studio, &query).await),
            Reply::Work(reply) => {
                let studio = Arc::clone(studio);
                let work = move || reply(&studio, &query, &body);
                match tokio::task::spawn_blocking(work).await {
                    Ok(answered) => answered,
                    Err(_) => Err(Error::fit("this failed in the program itself", "report it")),
                }
            }
        };
        answered.unwrap_or_else(|error| Answer::failed(&error))
    }
}

/// A value of a query such as `since=3&to=c`; no value needs to be escaped.
fn value<'a>(query: &'a str, name: &str) -> Option<&'a str> {
    query.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))
}

async fn news(studio: &Studio, query: &str) -> Answer {
    let seen = value(query, "since").and_then(|text| text.parse().ok()).unwrap_or(0);
    // Nothing new in time is an answer too.
    let _ = tokio::time::timeout(NEWS, studio.board.after(seen)).await;
    Answer::new("application/json", studio.board.since(seen))
}

#[derive(Deserialize)]
struct Text {
    text: String,
}

fn read<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T> {
    serde_json::from_slice(body).map_err(|error| {
        Error::usage(
            format!("this is not what the studio understands ({error})"),
            "reload the page",
        )
    })
}

fn check(studio: &Studio, _: &str, body: &[u8]) -> Result<Answer> {
    let Text { text } = read(body)?;
    too_long(&text)?;
    let diagnostics = match expr::build(&name(&studio.path), &text) {
        Ok(compiled) => compiled.warnings,
        Err(Error::Spec { diagnostics, .. }) => diagnostics,
        Err(other) => return Err(other),
    };
    Ok(Answer::json(&json!({ "diagnostics": wire::diagnostics(&diagnostics, &text) })))
}

fn too_long(text: &str) -> Result<()> {
    if text.len() <= files::LARGEST {
        return Ok(());
    }
    Err(Error::usage("that is too large for a spec", "1 MB is the most that the studio takes"))
}

fn ask(studio: &Studio, _: &str, body: &[u8]) -> Result<Answer> {
    let wish: Wish = read(body)?;
    if let Wish::Save { text, .. } = &wish {
        too_long(text)?;
    }
    if studio.jobs.ask(wish) {
        return Ok(Answer { status: StatusCode::ACCEPTED, ..Answer::json(&json!({})) });
    }
    Ok(Answer::refused(
        StatusCode::CONFLICT,
        "the studio does one thing at a time: wait for it, or cancel it",
    ))
}

fn cancel(studio: &Studio, _: &str, _: &[u8]) -> Result<Answer> {
    studio.jobs.cancel();
    Ok(Answer::json(&json!({})))
}

fn export(studio: &Studio, query: &str, _: &[u8]) -> Result<Answer> {
    let to = value(query, "to").unwrap_or("");
    let project = Project::open(&studio.path)?;
    let law = project.law(None)?;
    let stem = studio.path.file_stem().map_or("model".into(), |stem| stem.to_string_lossy());
    // A header takes no other letters.
    let stem: String = stem
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' })
        .collect();
    let (answer, save_as) = match output(&project, &law, to)? {
        Output::Text(text) => {
            (Answer::new("text/plain; charset=utf-8", text), format!("{stem}.{}", ending(to)))
        }
        Output::Files(files) => {
            let folder = format!("{stem}-{to}");
            let packed = archive::zip(&folder, &files)?;
            (Answer::new("application/zip", packed), format!("{folder}.zip"))
        }
    };
    Ok(Answer { save_as: Some(save_as), ..answer })
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

fn report(studio: &Studio, _: &str, _: &[u8]) -> Result<Answer> {
    let held = studio.held().ok_or_else(|| {
        Error::usage("there is nothing to report yet", "wait until the plots are drawn")
    })?;
    let seen = held.seen()?;
    let drawn = with_page(
        &held.bench,
        (&held.training, held.terms),
        seen,
        held.diagnosis.as_deref(),
        html::page,
    )?;
    let stem = studio.path.file_stem().map_or("model".into(), |stem| stem.to_string_lossy());
    let save_as = stem.is_ascii().then(|| format!("{stem}.report.html"));
    let save_as = Some(save_as.unwrap_or_else(|| "report.html".to_string()));
    Ok(Answer { save_as, ..Answer::new(HTML, drawn.html) })
}

/// Names of the formats that the page offers.
pub fn formats() -> Vec<&'static str> {
    EXPORTERS.iter().map(|row| row.name).collect()
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
