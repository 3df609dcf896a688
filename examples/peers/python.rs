//! The peers' side: a Python environment of its own, and processes that speak in lines of JSON.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::Value;

/// A package with everything that its version depends on, to be installed at once.
pub(crate) struct Package {
    pub name: &'static str,
    pinned: &'static [&'static str],
}

pub(crate) const HEYOKA: Package =
    Package { name: "heyoka", pinned: &["heyoka==7.13.2", "numpy==2.4.6"] };
pub(crate) const JAX: Package =
    Package { name: "jax", pinned: &["jax==0.10.2", "jaxlib==0.10.2", "numpy==2.4.6"] };
pub(crate) const CASADI: Package =
    Package { name: "casadi", pinned: &["casadi==3.8.2", "numpy==2.4.6"] };
pub(crate) const PYSINDY: Package = Package {
    name: "pysindy",
    pinned: &["pysindy==2.1.0", "numpy==2.4.6", "scipy==1.17.1", "scikit-learn==1.9.1"],
};
/// The wheel of the ordinary registry does not load without the CUDA libraries it depends on,
/// which are never used here: 6 GB on the disk.
pub(crate) const TORCH: Package =
    Package { name: "torch", pinned: &["torch==2.15.0", "numpy==2.4.6"] };

/// A virtual environment.
pub(crate) struct Python {
    folder: PathBuf,
}

impl Python {
    /// The environment in a folder, made if it is not there; an error says why there is none.
    pub(crate) fn new(folder: &Path, interpreter: &str) -> Result<Python, String> {
        let environment = folder.join("venv");
        let python = Python { folder: folder.to_path_buf() };
        if !python.program().exists() {
            println!("making a Python environment in {} ...", environment.display());
            let done = Command::new(interpreter).args(["-m", "venv"]).arg(&environment).output();
            let done = done.map_err(|error| format!("no Python: `{interpreter}`: {error}"))?;
            if !done.status.success() {
                return Err(format!("no Python environment: {}", last_line(&done.stderr)));
            }
        }
        Ok(python)
    }

    fn program(&self) -> PathBuf {
        let (scripts, name) =
            if cfg!(windows) { ("Scripts", "python.exe") } else { ("bin", "python") };
        self.folder.join("venv").join(scripts).join(name)
    }

    /// Installs a package, if it is not there.
    pub(crate) fn install(&self, package: &Package) -> Result<(), String> {
        let mark = self.folder.join("venv").join(format!("{}.installed", package.name));
        let wanted = package.pinned.join("\n");
        if std::fs::read_to_string(&mark).is_ok_and(|found| found == wanted) {
            return Ok(());
        }
        println!("installing {} ...", package.pinned.join(", "));
        let done = Command::new(self.program())
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
            .args(["--only-binary", ":all:"])
            .args(package.pinned)
            .output()
            .map_err(|error| format!("pip does not start: {error}"))?;
        if !done.status.success() {
            return Err(format!("{} is not installed: {}", package.name, last_line(&done.stderr)));
        }
        std::fs::write(mark, wanted).map_err(|error| error.to_string())
    }

    /// Starts a script of this example, once its package is there; returns what it says first.
    pub(crate) fn start(
        &self,
        package: &Package,
        script: &str,
        arguments: &[String],
    ) -> Result<(Peer, Value), String> {
        self.install(package)?;
        let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/peers/python");
        let log = self.folder.join(format!("{script}.log"));
        let errors = File::create(&log).map_err(|error| format!("{}: {error}", log.display()))?;
        let mut child = Command::new(self.program())
            .arg(scripts.join(script))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(errors)
            .spawn()
            .map_err(|error| format!("{script} does not start: {error}"))?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(format!("{script} has no pipes"));
        };
        let mut peer = Peer { child, input, output: BufReader::new(output), log };
        let first = peer.read()?;
        Ok((peer, first))
    }
}

/// A script that is running; it ends when this is dropped.
pub(crate) struct Peer {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    log: PathBuf,
}

impl Peer {
    /// Sends a line and reads the answer.
    pub(crate) fn ask(&mut self, line: &str) -> Result<Value, String> {
        let sent = writeln!(self.input, "{line}").and_then(|()| self.input.flush());
        sent.map_err(|_| self.reason())?;
        self.read()
    }

    /// One more repeat: its seconds.
    pub(crate) fn seconds(&mut self) -> Result<f64, String> {
        Ok(number(&self.ask("")?, "seconds"))
    }

    fn read(&mut self) -> Result<Value, String> {
        let mut line = String::new();
        self.output.read_line(&mut line).map_err(|error| error.to_string())?;
        serde_json::from_str(&line).map_err(|_| self.reason())
    }

    fn reason(&self) -> String {
        let said = std::fs::read(&self.log).unwrap_or_default();
        format!("the script ended: {}", last_line(&said))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A number of an answer; NaN if it is not there.
pub(crate) fn number(answer: &Value, name: &str) -> f64 {
    answer[name].as_f64().unwrap_or(f64::NAN)
}

fn last_line(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let line = text.lines().rev().find(|line| !line.trim().is_empty());
    line.unwrap_or("nothing was said").trim().to_string()
}
