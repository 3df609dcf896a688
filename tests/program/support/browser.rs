//! A headless Chromium, driven over WebDriver, where one is installed.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::http::send;
use super::studio::PATIENCE;

pub(crate) struct Browser {
    driver: Child,
    port: u16,
    session: String,
    dark: bool,
    _profile: TempDir,
}

/// What WebDriver calls a key.
pub(crate) const TAB: &str = "\u{E004}";
pub(crate) const ENTER: &str = "\u{E007}";
pub(crate) const ALT: &str = "\u{E00A}";
pub(crate) const CONTROL: &str = "\u{E009}";

impl Browser {
    /// A browser of a size in pixels; `None`, which it says, where there is none.
    pub(crate) fn open(width: u32, height: u32, dark: bool) -> Option<Browser> {
        let Some((driver, port)) = (0..5).find_map(|_| started()) else {
            println!("no chromedriver: the studio is not tested in a browser");
            return None;
        };
        let profile = tempfile::tempdir().expect("a temporary folder");
        let mut browser =
            Browser { driver, port, session: String::new(), dark: false, _profile: profile };
        let profile = browser._profile.path().display().to_string();
        let arguments = json!([
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            "--hide-scrollbars",
            "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
            format!("--window-size={width},{height}"),
            format!("--user-data-dir={profile}"),
        ]);
        let wanted = json!({ "capabilities": { "alwaysMatch": {
            "goog:chromeOptions": { "args": arguments },
            "goog:loggingPrefs": { "browser": "ALL" },
        } } });
        let answer = browser.call("POST", "/session", &wanted);
        let Some(session) = answer["sessionId"].as_str() else {
            println!("no Chromium ({answer}): the studio is not tested in a browser");
            return None;
        };
        browser.session = format!("/session/{session}");
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        browser.tool("Emulation.setDeviceMetricsOverride", &size);
        browser.dark = dark;
        browser.light_up(dark);
        Some(browser)
    }

    fn light_up(&self, dark: bool) {
        let scheme = if dark { "dark" } else { "light" };
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.tool("Emulation.setEmulatedMedia", &media);
    }

    fn call(&self, method: &str, path: &str, body: &Value) -> Value {
        let text = if method == "GET" { String::new() } else { body.to_string() };
        let headers = [("host", "127.0.0.1"), ("content-type", "application/json")];
        let reply = send(self.port, method, path, &headers, text.as_bytes()).expect("an answer");
        reply.json()["value"].clone()
    }

    fn own(&self, path: &str, body: &Value) -> Value {
        self.call("POST", &format!("{}{path}", self.session), body)
    }

    fn tool(&self, name: &str, parameters: &Value) -> Value {
        self.own("/goog/cdp/execute", &json!({ "cmd": name, "params": parameters }))
    }

    pub(crate) fn go(&self, address: &str) {
        self.own("/url", &json!({ "url": address }));
    }

    /// The value of a script.
    pub(crate) fn run(&self, script: &str) -> Value {
        let value = self.own("/execute/sync", &json!({ "script": script, "args": [] }));
        assert!(value["error"].is_null(), "{script}: {value}");
        value
    }

    /// The value of an expression.
    pub(crate) fn value(&self, expression: &str) -> Value {
        self.run(&format!("return ({expression})"))
    }

    /// Waits until an expression is true.
    pub(crate) fn until(&self, expression: &str) {
        let start = Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            let told = self.value("document.getElementById('message').innerText");
            assert!(start.elapsed() < PATIENCE, "waited for {expression}; told: {told}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Clicks as a hand does: where the element is, if nothing lies over it.
    pub(crate) fn click(&self, selector: &str) {
        let by = json!({ "using": "css selector", "value": selector });
        let found = self.own("/element", &by);
        let id = found.as_object().and_then(|object| object.values().next()).cloned();
        let id = id.and_then(|id| id.as_str().map(String::from)).expect(selector);
        // From under what sticks to the top of the window.
        self.run(&format!(
            "document.querySelector(\"{selector}\").scrollIntoView({{ block: 'center' }})"
        ));
        let done = self.own(&format!("/element/{id}/click"), &json!({}));
        assert!(done.is_null(), "{selector}: {done}");
    }

    /// Presses keys together, and lets them go.
    pub(crate) fn press(&self, keys: &[&str]) {
        let down = keys.iter().map(|key| json!({ "type": "keyDown", "value": key }));
        let up = keys.iter().rev().map(|key| json!({ "type": "keyUp", "value": key }));
        let actions: Vec<Value> = down.chain(up).collect();
        let done = self.own(
            "/actions",
            &json!({ "actions": [{ "type": "key", "id": "keys", "actions": actions }] }),
        );
        assert!(done.is_null(), "{done}");
    }

    /// Types a text, key by key.
    pub(crate) fn write(&self, text: &str) {
        for key in text.chars() {
            self.press(&[&key.to_string()]);
        }
    }

    /// Drags with the mouse from one place of the window to another.
    pub(crate) fn drag(&self, from: (f64, f64), to: (f64, f64)) {
        let at = |(x, y): (f64, f64), duration: u64| json!({ "type": "pointerMove", "duration": duration, "x": x.round(), "y": y.round() });
        let actions = json!([
            at(from, 0), { "type": "pointerDown", "button": 0 }, at(to, 150),
            { "type": "pointerUp", "button": 0 },
        ]);
        let mouse = json!({ "type": "pointer", "id": "mouse", "parameters": { "pointerType": "mouse" },
            "actions": actions });
        let done = self.own("/actions", &json!({ "actions": [mouse] }));
        assert!(done.is_null(), "{done}");
    }

    /// Errors that the browser complained of, such as what the policy forbids.
    pub(crate) fn complaints(&self) -> Vec<String> {
        let log = self.own("/se/log", &json!({ "type": "browser" }));
        let rows = log.as_array().cloned().unwrap_or_default();
        let bad = rows.iter().filter(|row| row["level"] == "SEVERE");
        bad.map(|row| row["message"].to_string()).collect()
    }

    /// Pictures of the window by day and by night, into the folder that `LEVERRIER_SHOTS` names.
    pub(crate) fn shot(&self, name: &str) {
        let Some(folder) = std::env::var_os("LEVERRIER_SHOTS") else { return };
        std::fs::create_dir_all(&folder).expect("a folder");
        for (dark, scheme) in [(false, "light"), (true, "dark")] {
            self.light_up(dark);
            let picture = self.tool("Page.captureScreenshot", &json!({ "format": "png" }));
            let text = picture["data"].as_str().expect("a picture");
            let path = std::path::Path::new(&folder).join(format!("{name}-{scheme}.png"));
            std::fs::write(path, decoded(text)).expect("written");
        }
        self.light_up(self.dark);
    }
}

/// A driver that answers, and its port; `None` where there is no driver, or where another program
/// took the port that was free a moment ago.
fn started() -> Option<(Child, u16)> {
    let port = std::net::TcpListener::bind(("127.0.0.1", 0)).ok()?.local_addr().ok()?.port();
    let mut driver = Command::new("chromedriver")
        .arg(format!("--port={port}"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let start = Instant::now();
    let ready = || {
        let reply = send(port, "GET", "/status", &[("host", "127.0.0.1")], b"").ok()?;
        // Whoever else may listen there is no driver.
        serde_json::from_slice::<Value>(&reply.body).ok()?["value"]["ready"].as_bool()
    };
    while ready() != Some(true) {
        if driver.try_wait().ok()?.is_some() {
            return None;
        }
        if start.elapsed() > PATIENCE {
            let _ = driver.kill();
            panic!("chromedriver does not answer");
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Some((driver, port))
}

/// Bytes of a text in base 64.
fn decoded(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (mut out, mut held, mut bits) = (Vec::new(), 0u32, 0);
    for value in text.bytes().filter_map(|b| LETTERS.iter().position(|l| *l == b)) {
        held = held << 6 | value as u32;
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            out.push((held >> bits) as u8);
        }
    }
    out
}

impl Drop for Browser {
    fn drop(&mut self) {
        if !self.session.is_empty() {
            let headers = [("host", "127.0.0.1")];
            let _ = send(self.port, "DELETE", &self.session, &headers, b"");
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
