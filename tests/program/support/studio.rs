//! A studio of one's own: the program on a copy of a spec, and its parts as the page reads them.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::http::{Reply, send};

/// Longest time that anything may take on a busy machine.
pub(crate) const PATIENCE: Duration = Duration::from_secs(240);

pub(crate) struct Studio {
    child: Child,
    pub port: u16,
    pub token: String,
    pub address: String,
    /// What was read so far.
    version: u64,
    pub parts: BTreeMap<String, Value>,
}

impl Studio {
    pub(crate) fn open(spec: &Path) -> Studio {
        Studio::started(spec, &["--no-open"], &[])
    }

    /// Started with more arguments and variables of the environment.
    pub(crate) fn started(spec: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> Studio {
        let mut child = Command::new(env!("CARGO_BIN_EXE_leverrier"))
            .arg("studio")
            .arg(spec)
            .args(arguments)
            .envs(variables.iter().copied())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program");
        let out = BufReader::new(child.stdout.take().expect("its output"));
        let line = out.lines().map_while(Result::ok).find(|line| line.contains("http://"));
        let address = line.expect("an address").trim().to_string();
        let rest = address.strip_prefix("http://127.0.0.1:").expect("this machine");
        let (port, token) = rest.split_once("/#").expect("a token");
        let (port, token) = (port.parse().expect("a port"), token.to_string());
        let mut parts: BTreeMap<String, Value> =
            ["law", "failure", "job", "message"].map(|name| (name.into(), Value::Null)).into();
        parts.insert("busy".to_string(), json!(false));
        Studio { child, port, token, address, version: 0, parts }
    }

    pub(crate) fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Ends it at once, as a power failure would.
    pub(crate) fn kill(&mut self) {
        self.child.kill().expect("it ran");
        self.child.wait().expect("it ended");
    }

    pub(crate) fn get(&self, path: &str) -> Reply {
        let host = self.host();
        let headers = [("host", host.as_str()), ("x-leverrier-token", &self.token)];
        send(self.port, "GET", path, &headers, b"").expect("an answer")
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> Reply {
        let host = self.host();
        let origin = format!("http://{host}");
        let headers = [
            ("host", host.as_str()),
            ("origin", origin.as_str()),
            ("x-leverrier-token", &self.token),
        ];
        send(self.port, "POST", path, &headers, body.to_string().as_bytes()).expect("an answer")
    }

    /// Reads news until something holds of the parts.
    pub(crate) fn until(&mut self, what: &str, holds: impl Fn(&BTreeMap<String, Value>) -> bool) {
        let start = Instant::now();
        while !holds(&self.parts) {
            let last = self.parts.get("message");
            assert!(start.elapsed() < PATIENCE, "waited for: {what}; last message: {last:?}");
            let news = self.get(&format!("/api/state?since={}", self.version)).json();
            self.version = news["version"].as_u64().expect("a version");
            for (name, part) in news["parts"].as_object().expect("parts") {
                self.parts.insert(name.clone(), part.clone());
            }
        }
    }

    /// Wishes for something and waits until it is done; returns the message about it.
    pub(crate) fn wish(&mut self, what: Value) -> Value {
        let before = self.number();
        let reply = self.post("/api/do", &what);
        assert_eq!(reply.status, 202, "{what}: {}", reply.text());
        self.until(&what.to_string(), |parts| number(parts) > before && parts["busy"] == false);
        self.parts["message"].clone()
    }

    pub(crate) fn number(&self) -> u64 {
        number(&self.parts)
    }

    /// Waits for the answer to what is missing.
    pub(crate) fn answered(&mut self) -> Value {
        self.until("what is missing", |parts| {
            let state = |name: &str| parts.get(name).map(|part| part["state"].clone());
            state("missing") == Some(json!("answered"))
        });
        self.parts["missing"].clone()
    }
}

fn number(parts: &BTreeMap<String, Value>) -> u64 {
    parts.get("message").and_then(|message| message["number"].as_u64()).unwrap_or(0)
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A folder with the demo of a hidden effect, and its spec.
pub(crate) fn demo() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/damped-pendulum");
    for name in ["fit.ham", "swings.csv"] {
        fs::copy(from.join(name), folder.path().join(name)).expect("a copy");
    }
    let spec = folder.path().join("fit.ham");
    (folder, spec)
}
