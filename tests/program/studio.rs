//! The studio over HTTP: whom it refuses, the whole story, its files in turn with the command
//! line's, its end in the middle of a fit, and many clients at once.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::support::http::send;
use crate::support::program;
use crate::support::studio::{PATIENCE, Studio, demo};
use serde_json::{Value, json};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).expect("it is there")
}

#[test]
fn strangers_are_refused() {
    let (folder, spec) = demo();
    let studio = Studio::open(&spec);
    let (host, port) = (studio.host(), studio.port);
    let local = format!("localhost:{port}");
    let own = format!("http://{host}");
    let token = ("x-leverrier-token", studio.token.as_str());
    let get = |path: &str, headers: &[(&str, &str)]| {
        send(port, "GET", path, headers, b"").expect("an answer")
    };
    let learn = br#"{"do":"learn"}"#;
    let post = |headers: &[(&str, &str)]| {
        send(port, "POST", "/api/do", headers, learn).expect("an answer").status
    };
    let here = ("host", host.as_str());
    // The empty page tells nothing and loads nothing from elsewhere.
    let page = get("/", &[here]);
    assert_eq!(page.status, 200);
    assert!(!page.text().contains("pendulum") && !page.text().contains(&studio.token));
    assert!(!page.text().contains("http://") && !page.text().contains("https://"));
    let policy = page.header("content-security-policy").expect("a policy");
    assert!(policy.contains("default-src 'none'") && !policy.contains("unsafe"), "{policy}");
    assert_eq!(page.header("x-content-type-options"), Some("nosniff"));
    assert_eq!(page.header("cache-control"), Some("no-store"));
    assert_eq!(get("/", &[("host", &local)]).status, 200);
    // The host.
    for stranger in ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "[::1]"] {
        assert_eq!(get("/", &[("host", stranger)]).status, 403, "{stranger}");
        assert_eq!(get("/api/state", &[("host", stranger), token]).status, 403, "{stranger}");
    }
    // The token.
    for path in ["/api/state", "/api/export?to=latex", "/api/report", "/api/plots?as=svg"] {
        assert_eq!(get(path, &[here]).status, 401, "{path}");
        assert_eq!(get(path, &[here, ("x-leverrier-token", "0000")]).status, 401, "{path}");
    }
    // The origin.
    assert_eq!(post(&[here, token]), 403);
    assert_eq!(post(&[here, token, ("origin", "http://evil.example")]), 403);
    assert_eq!(post(&[here, token, ("origin", "null")]), 403);
    assert_eq!(post(&[here, ("origin", &own)]), 401);
    assert_eq!(get("/api/state", &[here, token, ("origin", "http://evil.example")]).status, 403);
    // No path is a file's.
    for path in ["/../fit.ham", "/fit.ham", "/%2e%2e/fit.ham", "/..%2ffit.ham", "//etc/passwd"] {
        let reply = get(path, &[here, token]);
        assert_eq!(reply.status, 404, "{path}");
        assert!(!reply.text().contains("coordinates"));
    }
    let reply = studio.get("/api/export?to=../../etc/passwd");
    assert_eq!(reply.status, 422, "{}", reply.text());
    // Too large: as announced, and as sent.
    let huge = json!({ "text": "x".repeat(7 << 20) });
    assert_eq!(studio.post("/api/check", &huge).status, 413);
    let large = json!({ "text": "#".repeat((1 << 20) + 1) });
    assert_eq!(studio.post("/api/check", &large).status, 422);
    for broken in [json!({ "do": "format_disk" }), json!([1]), json!({ "do": "add" })] {
        assert_eq!(studio.post("/api/do", &broken).status, 422, "{broken}");
    }
    // Nobody but this machine.
    let socket = format!("{:04X}", port);
    let table = fs::read_to_string("/proc/net/tcp").unwrap_or_default();
    for line in table.lines().filter(|line| line.contains(&format!(":{socket} 00000000:0000 0A"))) {
        assert!(line.contains(&format!("0100007F:{socket}")), "{line}");
    }
    drop(folder);
}

#[test]
fn noise_on_the_wire_does_no_harm() {
    let (_folder, spec) = demo();
    let studio = Studio::open(&spec);
    let long = format!("GET /{} HTTP/1.1\r\n\r\n", "a".repeat(100_000));
    for bytes in [&b"\0\xff\xfe\r\n\r\n"[..], b"GET", b"POST /api/do HTTP/1.1\r\n", long.as_bytes()]
    {
        let mut stream = TcpStream::connect(("127.0.0.1", studio.port)).expect("a connection");
        let _ = stream.write_all(bytes);
    }
    // More connections than it takes: it turns some away, and answers again afterwards.
    let crowd: Vec<TcpStream> =
        (0..300).filter_map(|_| TcpStream::connect(("127.0.0.1", studio.port)).ok()).collect();
    drop(crowd);
    let (start, host) = (Instant::now(), studio.host());
    let answers = || send(studio.port, "GET", "/", &[("host", &host)], b"");
    while !answers().is_ok_and(|reply| reply.status == 200) {
        assert!(start.elapsed() < PATIENCE, "it does not answer any more");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn the_whole_story() {
    let (folder, spec) = demo();
    let path = folder.path();
    let before = read(path, "fit.ham");
    let mut studio = Studio::open(&spec);
    // The failure is seen, and named.
    let missing = studio.answered();
    assert_eq!(missing["verdict"], "missing");
    assert_eq!(missing["leaders"][0]["effect"], "viscous_drag(q)");
    let error = number(&studio.parts["law"]["error"]);
    assert!(error > 3.0 && studio.parts["law"]["held_out"] == true, "{error}");
    let plots = studio.parts["figures"].as_array().expect("plots").clone();
    let shown = |name: &str| {
        let plot = plots.iter().find(|plot| plot["plot"] == name);
        plot.and_then(|plot| plot["figures"].as_array()).map_or(0, Vec::len)
    };
    for name in ["horizons", "forces", "predictions", "portrait", "energy", "ranking"] {
        assert!(shown(name) > 0, "no {name}");
    }
    // The effect is added: the error falls to the noise floor.
    let message = studio.wish(json!({ "do": "add", "effect": "viscous_drag(q)" }));
    assert_eq!(message["failed"], false, "{message}");
    assert!(read(path, "fit.ham").contains("effect viscous_drag(q)"));
    assert_eq!(studio.parts["ledger"]["undo"], "add viscous_drag(q)");
    assert_eq!(studio.answered()["verdict"], "nothing_missing");
    let error = number(&studio.parts["law"]["error"]);
    assert!((0.8..1.2).contains(&error), "{error}");
    assert_eq!(studio.parts["effects"], json!(["viscous_drag(q)"]));
    // The same files as the command line's.
    let listed = program::json(path, &["history", "fit.ham"], "leverrier.history/2");
    assert_eq!(listed["revisions"][1]["action"], "add viscous_drag(q)");
    // Everything can be taken away.
    for format in studio.parts["spec"]["formats"].as_array().expect("formats") {
        let format = format.as_str().expect("a name");
        let reply = studio.get(&format!("/api/export?to={format}"));
        assert_eq!(reply.status, 200, "{format}: {}", reply.text());
        let saved = reply.header("content-disposition").expect("a name").to_string();
        if saved.contains(".zip") {
            assert!(reply.body.starts_with(b"PK"), "{format}");
        } else {
            let out = program::good(path, &["export", "fit.ham", format]).out;
            assert_eq!(reply.text().trim(), out.trim(), "{format}");
        }
    }
    for (kind, media, start) in
        [("svg", "image/svg+xml", &b"<svg"[..]), ("png", "image/png", b"\x89PNG")]
    {
        let all = studio.get(&format!("/api/plots?as={kind}"));
        assert!(all.status == 200 && all.body.starts_with(b"PK"), "{kind}: {}", all.status);
        let one = studio.get(&format!("/api/plots?as={kind}&plot=energy&at=0&paper=dark"));
        assert_eq!(one.header("content-type"), Some(media));
        assert!(one.body.starts_with(start), "{kind}");
        let saved = one.header("content-disposition").unwrap_or("");
        assert!(saved.contains(&format!("\"fit-energy.{kind}\"")), "{saved}");
    }
    for wrong in ["", "as=gif", "as=png&plot=../../etc/passwd", "as=png&plot=energy&at=99"] {
        assert_eq!(studio.get(&format!("/api/plots?{wrong}")).status, 422, "{wrong}");
    }
    let report = studio.get("/api/report");
    assert!(report.status == 200 && report.text().contains("viscous_drag"));
    // And undone.
    let message = studio.wish(json!({ "do": "undo", "force": false }));
    assert_eq!(message["failed"], false, "{message}");
    assert_eq!(read(path, "fit.ham"), before);
    assert_eq!(studio.answered()["verdict"], "missing");
    let nothing = studio.wish(json!({ "do": "undo", "force": false }));
    assert_eq!(nothing["failed"], true, "{nothing}");
}

#[test]
fn what_is_wrong_is_said_and_nothing_is_lost() {
    let (folder, spec) = demo();
    let path = folder.path();
    let text = read(path, "fit.ham");
    let mut studio = Studio::open(&spec);
    let wrong = text.replace("cos(q)", "cos(x) + §");
    let found = studio.post("/api/check", &json!({ "text": wrong })).json();
    let first = &found["diagnostics"][0];
    assert_eq!(first["severity"], "error", "{found}");
    assert_eq!(first["line"], 8, "{found}");
    assert!(first["start"].as_u64() < first["end"].as_u64());
    assert_eq!(
        studio.post("/api/check", &json!({ "text": text })).json()["diagnostics"],
        json!([])
    );
    studio.until("a model", |parts| !parts["law"].is_null());
    // A spec with errors is kept as a text, and there is no model of it.
    let hash = studio.parts["spec"]["hash"].clone();
    let save = |text: &str, base: &Value| json!({ "do": "save", "text": text, "base": base, "learn": false });
    let message = studio.wish(save(&wrong, &hash));
    assert_eq!(message["failed"], true, "{message}");
    assert_eq!(read(path, "fit.ham"), wrong);
    assert!(studio.parts["law"].is_null() && !studio.parts["failure"].is_null());
    let message = studio.wish(json!({ "do": "add", "effect": "viscous_drag(q)" }));
    assert_eq!(message["failed"], true);
    assert_eq!(studio.get("/api/export?to=latex").status, 422);
    // What another program wrote meanwhile is not overwritten, but read.
    let message = studio.wish(save(&text, &hash));
    assert_eq!(message["failed"], true, "{message}");
    assert_eq!(read(path, "fit.ham"), wrong);
    fs::write(&spec, &text).expect("written");
    studio.until("the new text", |parts| parts["spec"]["text"] == text.as_str());
    studio.until("its model", |parts| !parts["law"].is_null() && parts["failure"].is_null());
    // Data outside the folder are not read, whatever the text says.
    let outside = text.replace("swings.csv", "/etc/passwd");
    let hash = studio.parts["spec"]["hash"].clone();
    let message = studio.wish(save(&outside, &hash));
    assert!(message["text"].to_string().contains("outside"), "{message}");
    for effect in ["no_such_effect", "viscous_drag(zz)", ""] {
        assert_eq!(studio.wish(json!({ "do": "add", "effect": effect }))["failed"], true);
    }
}

#[test]
fn one_thing_at_a_time_and_it_can_be_given_up() {
    let (folder, spec) = demo();
    let path = folder.path();
    let before = read(path, "fit.ham");
    // A large function space, so that there is time to give up.
    let slow = before.replace("cos(q)", "cos(q), poly(q; 9), trig(q; 5)");
    let mut studio = Studio::open(&spec);
    studio.until("a model", |parts| !parts["law"].is_null());
    let hash = studio.parts["spec"]["hash"].clone();
    let number = studio.number();
    let save = json!({ "do": "save", "text": slow, "base": hash, "learn": true });
    assert_eq!(studio.post("/api/do", &save).status, 202);
    assert_eq!(studio.post("/api/do", &json!({ "do": "learn" })).status, 409);
    studio.until("the fit", |parts| parts["job"]["what"] == "Fitting the spec");
    let model = fs::read(path.join("fit.model.json")).expect("a model");
    assert_eq!(studio.post("/api/cancel", &json!({})).status, 200);
    studio.until("its end", |parts| {
        parts["message"]["number"].as_u64() > Some(number) && parts["busy"] == false
    });
    let text = studio.parts["message"]["text"].to_string();
    assert!(text.contains("Cancelled"), "{text}");
    assert_eq!(fs::read(path.join("fit.model.json")).expect("a model"), model);
    assert_eq!(read(path, "fit.ham"), slow);
    // Killed in the middle of a fit: every file is whole, and the next studio goes on.
    fs::write(&spec, &before).expect("written");
    studio.answered();
    assert_eq!(
        studio.post("/api/do", &json!({ "do": "add", "effect": "viscous_drag" })).status,
        202
    );
    std::thread::sleep(Duration::from_millis(20));
    studio.kill();
    let after = read(path, "fit.ham");
    assert!(after == before || after.contains("viscous_drag(q)"));
    for name in program::listing(path).iter().filter(|name| name.ends_with(".json")) {
        serde_json::from_str::<Value>(&read(path, name)).expect("a whole file");
    }
    let mut next = Studio::open(&spec);
    next.answered();
}

/// Resident memory of a process in kB.
fn memory(pid: u32) -> f64 {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|text| text.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(0.0)
}

/// Fifty clients ask for everything, again and again, while fits run. For a minute where
/// `LEVERRIER_MINUTE` is set, else for some seconds.
#[test]
fn many_clients_are_served_while_it_works() {
    let (_folder, spec) = demo();
    let mut studio = Studio::open(&spec);
    studio.answered();
    let long = std::env::var_os("LEVERRIER_MINUTE").is_some();
    let time = Duration::from_secs(if long { 60 } else { 6 });
    let (end, served) = (AtomicBool::new(false), AtomicUsize::new(0));
    let (port, host, token) = (studio.port, studio.host(), studio.token.clone());
    let mut sizes = Vec::new();
    let worst = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..50)
            .map(|client| {
                let (end, served, host, token) = (&end, &served, &host, &token);
                scope.spawn(move || {
                    let mut worst = Duration::ZERO;
                    let headers = [("host", host.as_str()), ("x-leverrier-token", token.as_str())];
                    while !end.load(Ordering::Relaxed) {
                        let start = Instant::now();
                        // Some ask for all there is, as a page that was just opened.
                        let path = if client % 5 == 0 { "/api/state?since=0" } else { "/" };
                        let reply = send(port, "GET", path, &headers, b"").expect("an answer");
                        assert_eq!(reply.status, 200);
                        worst = worst.max(start.elapsed());
                        served.fetch_add(1, Ordering::Relaxed);
                        std::thread::sleep(Duration::from_millis(250));
                    }
                    worst
                })
            })
            .collect();
        let start = Instant::now();
        // On a busy machine for longer: until there is enough to judge by.
        let enough = |fits: usize| fits >= 6 && served.load(Ordering::Relaxed) >= 200;
        while start.elapsed() < time || !enough(sizes.len()) && start.elapsed() < PATIENCE {
            let message = studio.wish(json!({ "do": "learn" }));
            assert_eq!(message["failed"], false, "{message}");
            studio.answered();
            sizes.push(memory(studio.pid()));
        }
        end.store(true, Ordering::Relaxed);
        clients.into_iter().map(|client| client.join().expect("served")).max()
    });
    let (worst, served) = (worst.expect("clients"), served.into_inner());
    println!("{served} answers, the slowest after {worst:?}; memory in kB: {sizes:?}");
    assert!(served >= 200, "only {served} answers");
    // The first fits fill the allocator's pools; what comes later must not pile up.
    let (first, last) = (sizes[sizes.len() / 2], sizes[sizes.len() - 1]);
    if first > 0.0 {
        assert!(last < 1.3 * first + 20_000.0, "memory grew: {sizes:?}");
    }
    let mut left = String::new();
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("a connection");
    let request = format!("GET / HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("sent");
    stream.read_to_string(&mut left).expect("an answer");
    assert!(left.starts_with("HTTP/1.1 200"));
}

/// A browser that writes down how it was started and what it was given.
#[cfg(unix)]
#[test]
fn the_secret_is_not_in_the_arguments_of_the_browser() {
    use std::os::unix::fs::PermissionsExt;
    let (folder, spec) = demo();
    let bin = folder.path().join("bin");
    fs::create_dir(&bin).expect("a folder");
    let notes = folder.path().join("notes");
    let fake = format!(
        "#!/bin/sh\nstat -c %a \"$1\" > {0}.part\necho \"$@\" >> {0}.part\ncat \"$1\" >> {0}.part\n\
         mv {0}.part {0}\n",
        notes.display()
    );
    let browser = bin.join("xdg-open");
    fs::write(&browser, fake).expect("written");
    fs::set_permissions(&browser, fs::Permissions::from_mode(0o755)).expect("executable");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", bin.display());
    let studio = Studio::started(&spec, &[], &[("PATH", &path), ("DISPLAY", ":99")]);
    let start = Instant::now();
    while !notes.exists() {
        assert!(start.elapsed() < PATIENCE, "no browser was started");
        std::thread::sleep(Duration::from_millis(20));
    }
    let told = fs::read_to_string(&notes).expect("notes");
    let mut lines = told.lines();
    assert_eq!(lines.next(), Some("600"), "others can read it");
    let arguments = lines.next().expect("arguments");
    assert!(!arguments.contains(&studio.token), "{arguments}");
    assert!(told.contains(&format!("url={}", studio.address)), "{told}");
}
