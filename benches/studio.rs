//! How long a user of the studio waits, with 10,000 samples on one core: from the command to a
//! page that can be used, from there to the plots, and from the click that adds an effect until
//! the error has fallen on the page.
//!
//! The studio is a program of its own here, started for every measurement, and asked over HTTP as
//! the page asks it.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a benchmark that fails stops"
)]

#[path = "../tests/program/support/http.rs"]
#[allow(dead_code)]
mod http;

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use http::send;
use serde_json::{Value, json};

const TRUTH: &str = "coordinates x, y\nmomenta px, py\nT = (px^2 + py^2)/2\n\
                     V = x^2/2 + 0.7*y^2\nforce x += -0.04*px\n";
const SPEC: &str = "coordinates x, y\nmomenta px, py\ndata \"runs.csv\" { time t  run run }\n\
                    T = (px^2 + py^2)/2\nV = span{ poly(x, y; 4) }\n";
const EFFECT: &str = "viscous_drag(x)";

struct Studio {
    child: Child,
    port: u16,
    token: String,
    version: u64,
    parts: serde_json::Map<String, Value>,
}

impl Studio {
    fn start(spec: &Path) -> Studio {
        let mut child = Command::new(env!("CARGO_BIN_EXE_leverrier"))
            .arg("studio")
            .arg(spec)
            .arg("--no-open")
            .env("RAYON_NUM_THREADS", "1")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program");
        let out = BufReader::new(child.stdout.take().expect("its output"));
        let line = out.lines().map_while(Result::ok).find(|line| line.contains("http://"));
        let line = line.expect("an address");
        let rest = line.trim().strip_prefix("http://127.0.0.1:").expect("this machine");
        let (port, token) = rest.split_once("/#").expect("a token");
        let (port, token) = (port.parse().expect("a port"), token.to_string());
        Studio { child, port, token, version: 0, parts: serde_json::Map::new() }
    }

    fn ask(&self, method: &str, path: &str, body: &[u8]) -> http::Reply {
        let host = format!("127.0.0.1:{}", self.port);
        let origin = format!("http://{host}");
        let headers =
            [("host", host.as_str()), ("origin", &origin), ("x-leverrier-token", &self.token)];
        send(self.port, method, path, &headers, body).expect("an answer")
    }

    /// Reads news until something holds of the parts.
    fn until(&mut self, holds: impl Fn(&serde_json::Map<String, Value>) -> bool) {
        while !holds(&self.parts) {
            let news = self.ask("GET", &format!("/api/state?since={}", self.version), b"").json();
            self.version = news["version"].as_u64().expect("a version");
            for (name, part) in news["parts"].as_object().expect("parts") {
                self.parts.insert(name.clone(), part.clone());
            }
        }
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Whether a plot is there, and drawn anew.
fn drawn(parts: &serde_json::Map<String, Value>, name: &str) -> bool {
    let plots = parts.get("figures").and_then(Value::as_array);
    let plot = plots.and_then(|plots| plots.iter().find(|plot| plot["plot"] == name));
    plot.is_some_and(|plot| plot["figures"].as_array().is_some_and(|figures| !figures.is_empty()))
}

fn program(arguments: &[&str], folder: &Path) {
    let done = Command::new(env!("CARGO_BIN_EXE_leverrier"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program");
    assert!(done.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&done.stderr));
}

/// The times of one story: a page, its first plots, the effect with its errors, all plots.
fn story(folder: &Path) -> [Duration; 4] {
    fs::write(folder.join("fit.ham"), SPEC).expect("written");
    fs::copy(folder.join("kept.json"), folder.join("fit.model.json")).expect("copied");
    let _ = fs::remove_file(folder.join("fit.ledger.json"));
    let start = Instant::now();
    let mut studio = Studio::start(&folder.join("fit.ham"));
    for path in ["/", "/studio.css", "/studio.js", "/editor.js", "/figures.js"] {
        assert_eq!(studio.ask("GET", path, b"").status, 200);
    }
    studio.until(|parts| parts.contains_key("spec"));
    let page = start.elapsed();
    studio.until(|parts| drawn(parts, "force-map"));
    let plots = start.elapsed();
    studio.until(|parts| parts.get("missing").is_some_and(|m| m["state"] == "answered"));
    let start = Instant::now();
    let wish = json!({ "do": "add", "effect": EFFECT }).to_string();
    studio.parts.remove("figures");
    assert_eq!(studio.ask("POST", "/api/do", wish.as_bytes()).status, 202);
    studio.until(|parts| drawn(parts, "horizons") && drawn(parts, "ledger"));
    let fallen = start.elapsed();
    studio.until(|parts| drawn(parts, "portrait"));
    [page, plots, fallen, start.elapsed()]
}

fn waiting(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    fs::write(path.join("truth.ham"), TRUTH).expect("written");
    fs::write(path.join("fit.ham"), SPEC).expect("written");
    let ranges: Vec<String> = ["x", "y", "px", "py"].map(|v| format!("{v}=-1..1")).into();
    let mut arguments = vec!["simulate", "truth.ham", "--runs", "40"];
    for range in &ranges {
        arguments.extend(["--sample", range]);
    }
    let more = ["--dt=0.1", "--samples=250", "--noise=0.01", "--seed=1", "-o", "runs.csv"];
    arguments.extend(more);
    program(&arguments, path);
    program(&["fit", "fit.ham"], path);
    fs::copy(path.join("fit.model.json"), path.join("kept.json")).expect("copied");
    let mut group = criterion.benchmark_group("studio with 10,000 samples on one core");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    let names = [
        "from the command to a page",
        "from the command to all plots",
        "from the click to the fallen error",
        "from the click to all plots",
    ];
    for (at, name) in names.into_iter().enumerate() {
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|times| (0..times).map(|_| story(path)[at]).sum());
        });
    }
    group.finish();
}

criterion_group!(benches, waiting);
criterion_main!(benches);
