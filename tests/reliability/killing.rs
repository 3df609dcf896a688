//! Commands that are killed at any moment, on full disks, in folders that cannot be written, on
//! files that change or go while they are read: what was there before is still there and whole.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use serde_json::Value;

/// The program: that which cargo built for these tests, or that beside the example's folder.
pub(crate) fn program() -> PathBuf {
    if let Some(path) = option_env!("CARGO_BIN_EXE_leverrier") {
        return PathBuf::from(path);
    }
    let own = std::env::current_exe().expect("the path of this program");
    let folder = own.ancestors().nth(2).expect("it lies in the folder of the examples");
    let path = folder.join("leverrier");
    assert!(path.exists(), "build the program first: there is no {}", path.display());
    path
}

/// A command that writes.
pub(crate) struct Writing {
    /// Its name.
    pub name: &'static str,
    /// All that stands behind it.
    pub arguments: &'static str,
    /// What it makes beside the spec's own files.
    pub makes: &'static str,
}

/// Every command that writes. A new one is a row here.
pub(crate) const WRITING: &[Writing] = &[
    Writing { name: "new", arguments: "swings.csv -o new.ham --force", makes: "new.ham" },
    Writing { name: "fit", arguments: "s.ham", makes: "" },
    Writing { name: "add", arguments: "s.ham viscous_drag", makes: "" },
    Writing { name: "remove", arguments: "s.ham constant_force", makes: "" },
    Writing { name: "undo", arguments: "s.ham", makes: "" },
    Writing { name: "discover", arguments: "s.ham", makes: "" },
    Writing {
        name: "simulate",
        arguments: "truth.ham --start 1,0 --duration 20 --dt 0.01 -o made.csv --force",
        makes: "made.csv",
    },
    Writing { name: "export", arguments: "s.ham rust -o project --force", makes: "project" },
    Writing { name: "report", arguments: "s.ham --no-diagnosis -o page.html", makes: "page.html" },
];

impl Writing {
    fn command(&self, folder: &Path) -> Command {
        let mut command = Command::new(program());
        command.arg(self.name).args(self.arguments.split_whitespace()).current_dir(folder);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        command
    }
}

pub(crate) fn ran(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(program());
    command.args(line.split_whitespace()).current_dir(folder).stdin(Stdio::null());
    command.output().expect("the program runs")
}

fn said(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text + &String::from_utf8_lossy(&output.stderr)
}

/// It went well.
pub(crate) fn good(folder: &Path, line: &str) -> String {
    let output = ran(folder, line);
    let said = said(&output);
    assert!(output.status.success(), "{line}: {said}");
    said
}

/// It went well, or ended with a sentence and the code for that.
pub(crate) fn done_or_refused(output: &Output, what: &str) -> bool {
    let said = said(output);
    assert!(!said.contains("panicked"), "{what}: {said}");
    let code = output.status.code();
    assert!(code == Some(0) || code == Some(1) && said.len() > 20, "{what}: {code:?} {said}");
    code == Some(0)
}

/// A folder with a spec that was learned and added to, and its measurements.
pub(crate) fn prepared(folder: &Path) {
    let truth = "coordinates q\nmomenta p\ntime t\nT = p^2/2\nV = -1.3*cos(q)\n\
                 force q += -0.05*p + 0.08\n";
    let spec = "# notes\ncoordinates q\nmomenta p\ntime t\ndata \"swings.csv\" { time t  run run }\n\
                T = p^2/2\nV = span{ cos(q) }\n";
    fs::write(folder.join("truth.ham"), truth).expect("written");
    fs::write(folder.join("s.ham"), spec).expect("written");
    let make = "simulate truth.ham --sample q=-1.8..1.8 --sample p=-1..1 --dt=0.1 --noise=1% \
                --seed=5 -o swings.csv --runs 6 --samples=40";
    good(folder, make);
    good(folder, "fit s.ham");
    good(folder, "add s.ham constant_force");
}

/// The files of a folder and of those in it, by their names.
type Files = BTreeMap<String, Vec<u8>>;

fn files(folder: &Path) -> Files {
    let mut found = Files::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below it").to_string_lossy();
                found.insert(name.into_owned(), fs::read(&path).expect("a file"));
            }
        }
    }
    found
}

fn written(folder: &Path, files: &Files) {
    for (name, bytes) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, bytes).expect("written");
    }
}

/// Names that only a command at work has in a folder.
fn temporary(name: &str) -> bool {
    name.starts_with(".leverrier-") || name == "s.lock"
}

/// One command with what it starts from and comes to.
pub(crate) struct Experiment {
    pub writing: &'static Writing,
    before: Files,
    after: Files,
    duration: Duration,
}

impl Experiment {
    /// Carries the command out once in peace.
    pub(crate) fn new(writing: &'static Writing, start: &Files) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), start);
        let begun = Instant::now();
        let output = writing.command(folder.path()).output().expect("the program runs");
        let duration = begun.elapsed();
        assert!(output.status.success(), "{}: {}", writing.name, said(&output));
        let after = files(folder.path());
        assert!(after.keys().all(|name| !temporary(name)), "{:?}", after.keys());
        Experiment { writing, before: start.clone(), after, duration }
    }

    /// Kills it at a moment that the seed says: any, or one at which something is written.
    pub(crate) fn killed(&self, seed: u64) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path();
        written(path, &self.before);
        let mut random = Pcg64::seed_from_u64(seed);
        let changed = || fs::metadata(path).and_then(|about| about.modified()).ok();
        let mut child = self.writing.command(path).spawn().expect("the program starts");
        let begun = Instant::now();
        if random.random_range(0..2) == 0 {
            let moment = self.duration.mul_f64(random.random_range(0.0..1.1));
            while begun.elapsed() < moment && !ended(&mut child) {
                std::thread::sleep(Duration::from_micros(50));
            }
        } else {
            let (mut writes, mut last) = (random.random_range(1..8), changed());
            while writes > 0 && !ended(&mut child) {
                let now = changed();
                writes -= usize::from(now != last);
                last = now;
            }
        }
        let _ = child.kill();
        let _ = child.wait();
        self.is_whole(path, seed);
    }

    /// Nothing of what was there before is lost, and the next commands work.
    fn is_whole(&self, folder: &Path, seed: u64) {
        let place = format!("{} {seed}", self.writing.name);
        for (name, bytes) in files(folder) {
            let known = [&self.before, &self.after].map(|files| files.get(&name));
            let same = known.iter().flatten().any(|known| **known == bytes);
            // Files of JSON say when they were written.
            let reads = name.ends_with(".json") && serde_json::from_slice::<Value>(&bytes).is_ok();
            let page = name == "page.html" && bytes.ends_with(b"</html>\n");
            assert!(same || reads || page || temporary(&name.replace('/', "")), "{place}: {name}");
        }
        for name in self.before.keys() {
            let removed = name == "s.model.json" && ["undo", "remove"].contains(&self.writing.name);
            assert!(folder.join(name).exists() || removed, "{place}: {name} is gone");
        }
        let history = good(folder, "history s.ham");
        assert!(history.contains("constant_force") && history.contains("start"), "{history}");
        good(folder, "check s.ham");
        good(folder, "fit s.ham");
        let left: Vec<String> = files(folder).into_keys().filter(|name| temporary(name)).collect();
        assert!(left.is_empty(), "{place}: the next command leaves {left:?}");
        if !self.writing.makes.is_empty() && folder.join(self.writing.makes).is_dir() {
            let all = files(&folder.join(self.writing.makes));
            let whole = self.after.keys().filter(|name| name.starts_with(self.writing.makes));
            assert_eq!(all.len(), whole.count(), "{place}: half a folder");
        }
    }
}

fn ended(child: &mut Child) -> bool {
    child.try_wait().is_ok_and(|status| status.is_some())
}

/// Every writing command, ready to be killed.
pub(crate) fn experiments() -> Vec<Experiment> {
    let folder = tempfile::tempdir().expect("a folder");
    prepared(folder.path());
    let start = files(folder.path());
    WRITING.iter().map(|writing| Experiment::new(writing, &start)).collect()
}

/// A small disk of its own, where this user may have one.
pub(crate) struct Disk {
    folder: tempfile::TempDir,
}

impl Disk {
    /// `None`, with a word about it, where the system does not allow it.
    pub(crate) fn new(kilobytes: u32) -> Option<Disk> {
        let folder = tempfile::tempdir().expect("a folder");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={kilobytes}k"), "tmpfs"])
            .arg(folder.path())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success());
        if !mounted {
            println!("skipped: this user may not mount a small disk");
        }
        mounted.then_some(Disk { folder })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    fn read_only(&self, on: bool) {
        let how = if on { "remount,ro" } else { "remount,rw" };
        let status = Command::new("mount").args(["-o", how]).arg(self.path()).status();
        assert!(status.is_ok_and(|status| status.success()), "{how}");
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.path()).status();
    }
}

/// No file that was there is gone, cut off or another.
fn unharmed(folder: &Path, before: &Files, what: &str) {
    for (name, bytes) in before {
        let now = fs::read(folder.join(name)).unwrap_or_else(|_| panic!("{what}: {name} is gone"));
        let reads = name.ends_with(".json") && serde_json::from_slice::<Value>(&now).is_ok();
        assert!(now == *bytes || reads, "{what}: {name} is another");
    }
    let names = files(folder).into_keys();
    let left: Vec<String> = names.filter(|name| temporary(name)).collect();
    assert!(left.is_empty(), "{what} leaves {left:?}");
}

/// Every writing command on a disk with nearly no room; how many were refused.
pub(crate) fn on_a_full_disk(rooms: &[usize]) -> Option<usize> {
    let disk = Disk::new(512)?;
    let folder = disk.path();
    prepared(folder);
    let before = files(folder);
    let mut refused = 0;
    for writing in WRITING {
        for room in rooms {
            let filler = folder.join("filler");
            fill(&filler, *room);
            let output = writing.command(folder).output().expect("the program runs");
            let what = format!("{} with {room} bytes of room", writing.name);
            if !done_or_refused(&output, &what) {
                refused += 1;
                fs::remove_file(&filler).expect("removed");
                unharmed(folder, &before, &what);
            }
            good_again(folder, &before);
        }
    }
    Some(refused)
}

/// Writes a file until the disk has no more than so many bytes of room.
fn fill(path: &Path, room: usize) {
    use std::io::Write as _;
    let mut file = fs::File::create(path).expect("made");
    while file.write_all(&[b'x'; 1024]).is_ok() {}
    let size = file.metadata().expect("a file").len();
    file.set_len(size.saturating_sub(room as u64)).expect("cut");
}

/// With room again: the commands that look work; then all is as before.
fn good_again(folder: &Path, before: &Files) {
    let _ = fs::remove_file(folder.join("filler"));
    good(folder, "history s.ham");
    good(folder, "check s.ham");
    for name in files(folder).into_keys().filter(|name| !before.contains_key(name)) {
        fs::remove_file(folder.join(name)).expect("removed");
    }
    let _ = fs::remove_dir_all(folder.join("project"));
    written(folder, before);
}

/// Every writing command where no file may become larger than some kilobytes, which every user can
/// ask of a Unix system; how many were refused.
pub(crate) fn where_files_stay_small() -> Option<usize> {
    if !cfg!(unix) {
        return None;
    }
    let mut refused = 0;
    let start = tempfile::tempdir().expect("a folder");
    prepared(start.path());
    let before = files(start.path());
    for writing in WRITING {
        let folder = tempfile::tempdir().expect("a folder");
        written(folder.path(), &before);
        let output = Command::new("sh")
            .args(["-c", "ulimit -f 1; trap '' XFSZ; exec \"$@\"", "sh"])
            .arg(program())
            .arg(writing.name)
            .args(writing.arguments.split_whitespace())
            .current_dir(folder.path())
            .output()
            .expect("a shell");
        if !done_or_refused(&output, writing.name) {
            refused += 1;
            unharmed(folder.path(), &before, writing.name);
        }
        good(folder.path(), "history s.ham");
        good(folder.path(), "check s.ham");
    }
    Some(refused)
}

/// Every writing command in a folder that can only be read; those that look work there.
pub(crate) fn in_a_read_only_folder() -> Option<()> {
    let disk = Disk::new(2048)?;
    let folder = disk.path();
    prepared(folder);
    let before = files(folder);
    disk.read_only(true);
    for writing in WRITING {
        let output = writing.command(folder).output().expect("the program runs");
        assert!(!done_or_refused(&output, writing.name), "{} wrote nothing", writing.name);
        assert!(said(&output).contains("read-only") || said(&output).contains("Read-only"));
        assert_eq!(files(folder), before, "{}", writing.name);
    }
    for line in ["history s.ham", "check s.ham", "compare s.ham", "export s.ham latex"] {
        good(folder, line);
    }
    disk.read_only(false);
    good(folder, "fit s.ham");
    Some(())
}

/// Commands that read measurements while something is done to them; how many went well.
pub(crate) fn while_a_file_changes(
    line: &str,
    times: usize,
    change: impl Fn(&Path, &[u8], usize) + Sync,
) -> usize {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    prepared(path);
    let data = path.join("swings.csv");
    let whole = fs::read(&data).expect("measurements");
    let over = std::sync::atomic::AtomicBool::new(false);
    let mut well = 0;
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut turn = 0;
            while !over.load(std::sync::atomic::Ordering::Relaxed) {
                change(&data, &whole, turn);
                turn += 1;
            }
        });
        let outputs: Vec<Output> = (0..times).map(|_| ran(path, line)).collect();
        // Before anything is asked of them: who waits for the other thread must not wait for ever.
        over.store(true, std::sync::atomic::Ordering::Relaxed);
        well = outputs.iter().filter(|output| done_or_refused(output, line)).count();
    });
    fs::write(&data, whole).expect("written");
    good(path, "fit s.ham");
    good(path, "history s.ham");
    well
}
