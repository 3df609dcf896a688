//! Which files a name means: one, all that a pattern (`swing_*.csv`) matches, or those of a folder.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use super::files::parted;
use super::format::{Format, is_table};
use super::table::wrong;
use super::text::visible;
use crate::error::{Error, Result};

/// A file of measurements, and what its runs are called after where it is one of several.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedFile {
    /// Its path.
    pub path: PathBuf,
    /// Its name without folder and ending; with them as far as that tells it from the others.
    pub name: Option<String>,
}

/// The files that `path` means, in the order of their names, numbers in them by their size. In the
/// name of a file, not of a folder, `*` stands for any text and `?` for any character; where there
/// is a file of just that name, it is meant.
///
/// # Errors
/// A pattern matches no file, or a folder has no measurements in it, or cannot be read.
pub fn files_of(path: &Path) -> Result<Vec<NamedFile>> {
    let (whole, part) = parted(path);
    let name = whole.file_name().map(|name| name.to_string_lossy().into_owned());
    let found = if whole.is_dir() {
        of_folder(path, &whole)?
    } else if whole.exists() || !is_pattern(&whole.to_string_lossy()) {
        return Ok(vec![NamedFile { path: path.to_path_buf(), name: None }]);
    } else {
        matching(path, &whole, &name.unwrap_or_default())?
    };
    let part = part.map_or(String::new(), |part| format!("#{part}"));
    let paths = found.into_iter().map(|file| match part.as_str() {
        "" => file,
        part => PathBuf::from(format!("{}{part}", file.display())),
    });
    let mut files: Vec<NamedFile> =
        paths.map(|path| NamedFile { path, name: Some(String::new()) }).collect();
    name_apart(&mut files);
    Ok(files)
}

/// Whether a name stands for other names.
fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?'])
}

/// Names each of several files by as much of its path as tells it from the others.
pub fn name_apart(files: &mut [NamedFile]) {
    let names = |of: &dyn Fn(&Path) -> String| -> Vec<String> {
        files.iter().map(|file| of(&parted(&file.path).0)).collect()
    };
    let whole = |path: &Path| visible(&path.file_name().unwrap_or_default().to_string_lossy());
    let stems = names(&|path| stem(&whole(path)));
    let wholes = names(&whole);
    let paths = names(&|path| visible(&path.to_string_lossy()));
    let alone =
        |all: &[String], name: &String| all.iter().filter(|other| *other == name).count() == 1;
    let told = stems.iter().zip(&wholes).zip(&paths).map(|((stem, whole), path)| {
        let first = [stem, whole].into_iter().zip([&stems, &wholes]);
        first
            .into_iter()
            .find(|(name, all)| alone(all, name))
            .map_or(path, |(name, _)| name)
            .clone()
    });
    let told: Vec<String> = told.collect();
    for (file, name) in files.iter_mut().zip(told) {
        file.name = Some(name);
    }
}

/// A file's name without its endings: `swing_1` of `swing_1.csv.gz`.
pub fn stem(name: &str) -> String {
    let plain = name.strip_suffix(".gz").unwrap_or(name);
    match plain.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem.to_string(),
        _ => plain.to_string(),
    }
}

/// The files of a folder that `keeps` accepts, by their names; hidden ones are left out.
fn listed(path: &Path, folder: &Path, keeps: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(here).map_err(|error| Error::file("read", path, error))?;
    let mut found: Vec<(String, PathBuf)> = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|error| Error::file("read", path, error))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !name.starts_with('.') && keeps(&name) && !entry.path().is_dir() {
            found.push((name, folder.join(entry.file_name())));
        }
    }
    found.sort_by(|(a, _), (b, _)| by_numbers(a, b));
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

fn matching(path: &Path, whole: &Path, pattern: &str) -> Result<Vec<PathBuf>> {
    let folder = whole.parent().unwrap_or(Path::new(""));
    if is_pattern(&folder.to_string_lossy()) {
        let message = "a * or ? stands in the name of a folder, where it means nothing";
        let hint = "use them in the name of the file alone, as in `data \"swing_*.csv\"`";
        return Err(wrong(path, None, None, message, hint));
    }
    let found = match listed(path, folder, |name| matches(pattern, name)) {
        Ok(found) => found,
        Err(Error::File { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            Vec::new()
        }
        Err(error) => return Err(error),
    };
    if found.is_empty() {
        return Err(wrong(
            path,
            None,
            None,
            "no file has such a name",
            "* stands for any text and ? for one character; the spec's `data` line names files as \
             seen from the spec's folder",
        ));
    }
    Ok(found)
}

/// Parquet files where there are any, else all other tables that a name tells.
fn of_folder(path: &Path, folder: &Path) -> Result<Vec<PathBuf>> {
    let of = |name: &str| Format::of_name(Path::new(name));
    // Programs that write folders of Parquet leave marks beside them, such as `_SUCCESS`.
    let parquet =
        listed(path, folder, |name| !name.starts_with('_') && of(name) == Format::Parquet)?;
    if !parquet.is_empty() {
        return Ok(parquet);
    }
    let found = listed(path, folder, |name| !name.starts_with('_') && is_table(Path::new(name)))?;
    if found.is_empty() {
        return Err(wrong(
            path,
            None,
            None,
            "this is a folder, and no file in it ends as measurements do",
            "name its files by a pattern, as in `data \"folder/*.txt\"`",
        ));
    }
    Ok(found)
}

/// Whether a name is one of those that a pattern stands for.
fn matches(pattern: &str, name: &str) -> bool {
    let pattern: Vec<char> = pattern.chars().collect();
    let name: Vec<char> = name.chars().collect();
    // Where the last `*` stands, and how much of the name it has taken.
    let (mut at, mut of, mut star) = (0, 0, None);
    while of < name.len() {
        match pattern.get(at) {
            Some('*') => {
                star = Some((at, of));
                at += 1;
            }
            Some(c) if *c == '?' || name.get(of) == Some(c) => {
                at += 1;
                of += 1;
            }
            _ => match star {
                Some((place, taken)) => {
                    star = Some((place, taken + 1));
                    at = place + 1;
                    of = taken + 1;
                }
                None => return false,
            },
        }
    }
    pattern.get(at..).is_some_and(|rest| rest.iter().all(|c| *c == '*'))
}

/// `swing_2` comes before `swing_10`.
fn by_numbers(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (first, second) = (piece(left), piece(right));
        if first.is_empty() || second.is_empty() {
            // Numbers with and without zeros before them are one number, but two names.
            return first.len().cmp(&second.len()).then_with(|| a.cmp(b));
        }
        let number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
        let order = if number(first) && number(second) {
            let [first, second] = [first, second].map(|digits| digits.trim_start_matches('0'));
            first.len().cmp(&second.len()).then_with(|| first.cmp(second))
        } else {
            first.cmp(second)
        };
        if order != Ordering::Equal {
            return order;
        }
        left = left.get(first.len()..).unwrap_or_default();
        right = right.get(second.len()..).unwrap_or_default();
    }
}

/// The digits, or all but digits, that a text begins with.
fn piece(text: &str) -> &str {
    let is_digit = |c: char| c.is_ascii_digit();
    let first = text.starts_with(is_digit);
    let end = text.find(|c| is_digit(c) != first).unwrap_or(text.len());
    text.get(..end).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stand_for_names() {
        for (pattern, name, expected) in [
            ("*.csv", "a.csv", true),
            ("*.csv", "a.csv.gz", false),
            ("swing_?.csv", "swing_1.csv", true),
            ("swing_?.csv", "swing_10.csv", false),
            ("a*b*c", "aXbYbZc", true),
            ("a*b*c", "aXbYbZ", false),
            ("*", "", true),
            ("é*", "été", true),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn numbers_in_names_are_numbers() {
        let mut names = ["s10", "s2", "s1b", "s1", "r9", "s01", "s"];
        names.sort_by(|a, b| by_numbers(a, b));
        assert_eq!(names, ["r9", "s", "s01", "s1", "s1b", "s2", "s10"]);
    }

    #[test]
    fn files_are_named_by_what_tells_them_apart() {
        let file = |path: &str| NamedFile { path: PathBuf::from(path), name: None };
        let mut files =
            ["d/a.csv", "d/b.csv", "d/b.txt", "e/c.csv", "f/c.csv", "d/e.tar.gz"].map(file);
        name_apart(&mut files);
        let names: Vec<&str> = files.iter().filter_map(|file| file.name.as_deref()).collect();
        assert_eq!(names, ["a", "b.csv", "b.txt", "e/c.csv", "f/c.csv", "e"]);
    }
}
