//! A file of measurements as a source: rows become chunks of runs while they are read.

use std::path::{Path, PathBuf};

use super::MeasuredInput;
use super::blocks::Blocks;
use super::cells::entry;
use super::clock::{Clock, Since, is_far};
use super::counted::{self, Counter};
use super::mapping::{
    InputMap, Mapping, converted, missing_column, observable_column, time_column, without_column,
};
use super::report::FileReport;
use super::several;
use super::source::{Chunk, Pass, Piece, RunName, Source};
use super::table::{Column, Reading, Table};
use crate::error::Result;

/// Bytes of a chunk.
const CHUNK: usize = 8 << 20;
/// Samples of a chunk, at least.
const LEAST: usize = 1024;

/// The first rows of a file, about `rows` of them, for a look at its columns.
///
/// # Errors
/// As `read`, as far as the first rows show it.
pub fn head(path: &Path, rows: usize) -> Result<Table> {
    let mut blocks = Blocks::open(path)?;
    match blocks.next(rows)? {
        Some(table) => Ok(table),
        None => super::read(path),
    }
}

/// About how many bytes it takes to read a file whole and fit it.
///
/// # Errors
/// As [`head`].
pub fn memory_needed(path: &Path) -> Result<u64> {
    let mut blocks = Blocks::open(path)?;
    let (rows, columns, text) = blocks.extent()?;
    let size = blocks.text_bytes();
    // The table; its columns converted; the runs, of which there may be one for every two rows;
    // initial states, the best ones and those that are tried.
    let table = 8 * (columns + 1) + if text { 8 * columns } else { 0 };
    let row = table + 8 * columns + 8 * (columns + 1) + 24 * (columns + 3) + 12 * (columns + 5);
    // What the allocator wastes on many small runs, as measured.
    let row = row * 7 / 4;
    Ok(rows.saturating_mul(row).saturating_add(2 * size))
}

/// Files that are read anew in every pass, one after the other.
///
/// Rows of a run must stand together, in the order of time: nothing is sorted. Whatever else
/// [`dataset`](super::dataset) says about rows holds here too.
pub struct FileSource {
    path: PathBuf,
    files: Vec<OneFile>,
    observables: Vec<String>,
    inputs: Vec<MeasuredInput>,
    /// Headers of the observables.
    headers: Vec<Option<String>>,
    /// What is worth knowing about the choice of columns, in sentences.
    notes: Vec<String>,
    reading: Reading,
    samples: usize,
}

/// A file among several, and which of its columns hold what.
#[derive(Debug, Clone)]
pub struct FilePart {
    /// Its path.
    pub path: PathBuf,
    /// Its columns.
    pub mapping: Mapping,
    /// Whether every two rows are one run.
    pub pairs: bool,
}

/// A file as it is read in a pass.
struct OneFile {
    part: FilePart,
    /// Headers of the columns that are read.
    wanted: Vec<String>,
}

/// What the head of a file tells.
struct Opened {
    file: OneFile,
    headers: Vec<Option<String>>,
    notes: Vec<String>,
    reading: Reading,
}

impl FileSource {
    /// The columns of a file that a spec asks for; with `pairs`, every two rows are one run.
    ///
    /// # Errors
    /// The file cannot be read, or a column is missing.
    pub fn new(path: &Path, mapping: &Mapping, pairs: bool) -> Result<FileSource> {
        let part = FilePart { path: path.to_path_buf(), mapping: mapping.clone(), pairs };
        FileSource::of_parts(path, vec![part])
    }

    /// Several files, which `path` stands for.
    ///
    /// # Errors
    /// As [`FileSource::new`], and there is no file.
    pub fn of_parts(path: &Path, parts: Vec<FilePart>) -> Result<FileSource> {
        let Some(first) = parts.first().map(|part| part.mapping.clone()) else {
            let hint = "name a file that exists";
            return Err(super::table::wrong(path, None, None, "this is no file", hint));
        };
        let opened: Vec<Opened> = parts.into_iter().map(Opened::of).collect::<Result<_>>()?;
        let inputs: Vec<MeasuredInput> = first.inputs.iter().map(InputMap::measured).collect();
        let columns = first.observables.len() + MeasuredInput::places(&inputs).1 + 1;
        let mut headers = vec![None; first.observables.len()];
        let mut notes: Vec<String> = Vec::new();
        let mut files = Vec::with_capacity(opened.len());
        let mut reading = None;
        for one in opened {
            for (header, own) in headers.iter_mut().zip(one.headers) {
                *header = header.take().or(own);
            }
            notes.extend(
                one.notes.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>(),
            );
            reading.get_or_insert(one.reading);
            files.push(one.file);
        }
        Ok(FileSource {
            path: path.to_path_buf(),
            files,
            observables: first.observables.iter().map(|o| o.name.clone()).collect(),
            inputs,
            headers,
            notes,
            reading: reading.unwrap_or(Reading::Memory),
            samples: (CHUNK / (8 * columns)).max(LEAST),
        })
    }

    /// The same with chunks of about so many samples.
    pub fn with_chunks(mut self, samples: usize) -> FileSource {
        self.samples = samples.max(4);
        self
    }

    /// Headers of the columns that the observables are read from.
    pub fn headers(&self) -> &[Option<String>] {
        &self.headers
    }

    /// What is worth knowing about the choice of columns, in sentences.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The file, or what stands for all of them.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The report on the files, which have so many rows in all.
    ///
    /// # Errors
    /// One of them cannot be read any more.
    pub(super) fn report(&self, rows: usize) -> Result<Option<FileReport>> {
        let of = |(at, file): (usize, &OneFile)| {
            let path = &file.part.path;
            Ok(FileReport {
                file: path.clone(),
                sha256: super::format::hash_file(path)?,
                rows: if at == 0 { rows } else { 0 },
                files: 1,
                reading: self.reading.clone(),
            })
        };
        let mut reports: Vec<FileReport> =
            self.files.iter().enumerate().map(of).collect::<Result<_>>()?;
        let named = self.files.first().is_some_and(|file| file.part.mapping.file.is_some());
        Ok(if named { several::of_all(&self.path, &reports) } else { reports.pop() })
    }
}

impl Opened {
    fn of(mut part: FilePart) -> Result<Opened> {
        let mut head = head(&part.path, 1)?;
        let mapping = &mut part.mapping;
        counted::count_times(&mut head, mapping, part.pairs)?;
        let mut wanted = vec![time_column(&head, mapping)?.0.header.clone()];
        if let Some(run) = &mapping.run {
            match head.find(run)? {
                Some(column) => wanted.push(column.header.clone()),
                None => return Err(missing_column(&head, run, "the run")),
            }
        }
        let mut headers = Vec::new();
        for observable in &mapping.observables {
            headers.push(observable_column(&head, observable)?.map(|c| c.header.clone()));
        }
        wanted.extend(headers.iter().flatten().cloned());
        for input in &mapping.inputs {
            whole_run_needed(&head, input)?;
            wanted.extend(observable_column(&head, &input.column)?.map(|c| c.header.clone()));
        }
        let notes = [without_column(&head, mapping)?, counted::note(&head, mapping)?];
        let notes = notes.into_iter().flatten().collect();
        Ok(Opened { file: OneFile { part, wanted }, headers, notes, reading: head.reading })
    }
}

impl OneFile {
    fn blocks(&self) -> Result<Blocks> {
        let mut blocks = Blocks::open(&self.part.path)?;
        blocks.only(&self.wanted);
        Ok(blocks)
    }

    /// Of times that no column holds.
    fn counter(&self) -> Option<Counter> {
        Counter::of(&self.part.mapping, self.part.pairs, true)
    }
}

impl Source for FileSource {
    fn observables(&self) -> &[String] {
        &self.observables
    }

    fn inputs(&self) -> &[MeasuredInput] {
        &self.inputs
    }

    fn pass(&self) -> Result<Box<dyn Pass + '_>> {
        let Some((file, rest)) = self.files.split_first() else {
            return Err(super::table::wrong(&self.path, None, None, "this is no file", "name one"));
        };
        Ok(Box::new(FilePass {
            source: self,
            file,
            rest,
            blocks: file.blocks()?,
            counter: file.counter(),
            chunk: self.empty(),
            runs: 0,
            rows: 0,
            open: None,
            since: None,
            last: f64::NAN,
            ended: false,
        }))
    }
}

/// That an input can be followed when its run is read part by part.
fn whole_run_needed(head: &Table, input: &InputMap) -> Result<()> {
    if input.between.columns() == 1 {
        return Ok(());
    }
    Err(head.error(
        None,
        input.column.columns.first().map(String::as_str),
        format!(
            "the input `{}` is `{}` between its samples, which takes whole runs in memory, and \
             these data are larger than the memory allowed",
            input.column.name, input.between
        ),
        "say `linear` or `hold` in the spec, or allow more memory",
    ))
}

impl FileSource {
    fn empty(&self) -> Chunk {
        let columns = self.observables.len() + MeasuredInput::places(&self.inputs).1;
        Chunk { values: vec![Vec::new(); columns], ..Chunk::default() }
    }
}

struct FilePass<'a> {
    source: &'a FileSource,
    /// The file that is being read, and those that come after it.
    file: &'a OneFile,
    rest: &'a [OneFile],
    blocks: Blocks,
    /// Of times that no column holds.
    counter: Option<Counter>,
    /// What was read; its last piece may go on.
    chunk: Chunk,
    runs: u64,
    /// Rows that were read of this file.
    rows: u64,
    /// The open run as its file names it; none where the next row begins one.
    open: Option<RunName>,
    /// Times of the open run since its start, should that be far from zero.
    since: Option<Since>,
    /// The time of the last sample on the clock of the file.
    last: f64,
    ended: bool,
}

impl Pass for FilePass<'_> {
    fn next(&mut self) -> Result<Option<Chunk>> {
        let most = self.source.samples;
        while !self.ended && self.chunk.times.len() < most {
            match self.blocks.next(most - self.chunk.times.len())? {
                Some(mut table) => {
                    if let Some(counter) = &mut self.counter {
                        counter.add(&mut table, self.file.part.mapping.run.as_deref())?;
                    }
                    self.take(&table)?;
                }
                None => self.end_of_file()?,
            }
        }
        let rest = if self.ended { self.source.empty() } else { self.part() };
        let chunk = std::mem::replace(&mut self.chunk, rest);
        Ok((!chunk.times.is_empty()).then_some(chunk))
    }

    fn fraction(&self) -> f64 {
        let files = self.source.files.len().max(1) as f64;
        let read = files - 1.0 - self.rest.len() as f64;
        (read + self.blocks.fraction()) / files
    }
}

impl<'a> FilePass<'a> {
    /// Goes on with the next file, if there is one.
    fn end_of_file(&mut self) -> Result<()> {
        if self.file.part.pairs && self.rows % 2 == 1 {
            let mut error = super::table::wrong(
                &self.file.part.path,
                None,
                None,
                format!("there are {} rows, but pairs need an even number", self.rows),
                "the last row has no partner: add it, or remove the row",
            );
            if let crate::error::Error::Data(data) = &mut error {
                data.line = None;
            }
            return Err(error);
        }
        match self.rest.split_first() {
            Some((file, rest)) => {
                (self.file, self.rest) = (file, rest);
                (self.blocks, self.counter) = (file.blocks()?, file.counter());
                (self.rows, self.open) = (0, None);
            }
            None => {
                self.ended = true;
                if let Some(last) = self.chunk.pieces.last_mut() {
                    last.ends = true;
                }
            }
        }
        Ok(())
    }

    /// Takes what may go on off the end of the chunk: the whole last run if it is short, else
    /// its last sample, with which the next row may have to be merged.
    fn part(&mut self) -> Chunk {
        let mut rest = self.source.empty();
        let Some(last) = self.chunk.pieces.last_mut() else { return rest };
        let short = last.begins && 2 * last.samples.len() < self.source.samples;
        let start = if short { last.samples.start } else { last.samples.end - 1 };
        let mut going_on = last.clone();
        if short {
            self.chunk.pieces.pop();
        } else {
            last.samples.end = start;
            going_on.begins = false;
        }
        rest.times = self.chunk.times.split_off(start);
        for (rest, values) in rest.values.iter_mut().zip(&mut self.chunk.values) {
            *rest = values.split_off(start);
        }
        going_on.samples = 0..rest.times.len();
        rest.pieces.push(going_on);
        rest
    }

    fn take(&mut self, table: &Table) -> Result<()> {
        let file: &'a OneFile = self.file;
        let (mapping, pairs) = (&file.part.mapping, file.part.pairs);
        let (column, scale, offset) = time_column(table, mapping)?;
        let header = column.header.as_str();
        let times = converted(table, column, scale, offset)?;
        let mut values = Vec::with_capacity(mapping.observables.len());
        for observable in &mapping.observables {
            values.push(match observable_column(table, observable)? {
                Some(column) => converted(table, column, observable.scale, observable.offset)?,
                None => vec![f64::NAN; table.rows()],
            });
        }
        for input in &mapping.inputs {
            let map = &input.column;
            let Some(column) = observable_column(table, map)? else { continue };
            let driving = converted(table, column, map.scale, map.offset)?;
            if let Some(row) = driving.iter().position(|x| x.is_nan()) {
                let line = table.lines.get(row).copied();
                let message = format!("the input `{}` has no value here", map.name);
                let hint = "give it in every row, or remove the rows where it was not recorded";
                return Err(table.error(line, Some(&column.header), message, hint));
            }
            values.push(driving);
        }
        let run = match &mapping.run {
            Some(name) if !pairs => table.find(name)?,
            _ => None,
        };
        if let Some((column, what)) = run.and_then(|c| c.cells.unread().map(|what| (c, what))) {
            return Err(table.names_no_run(column, what));
        }
        for row in 0..table.rows() {
            self.rows += 1;
            let line = table.lines.get(row).copied().unwrap_or(0);
            if values.iter().all(|column| entry(column, row).is_nan()) {
                continue;
            }
            let time = entry(&times, row);
            if time.is_nan() {
                let message = "this sample has no time";
                return Err(table.error(
                    Some(line),
                    Some(header),
                    message,
                    "give its time, or remove the row",
                ));
            }
            let pair = self.rows.div_ceil(2);
            let same = match (&self.open, run) {
                (None, _) => false,
                (Some(RunName::Pair(number)), _) => *number == pair,
                (Some(_), None) => true,
                (Some(RunName::Number(name)), Some(column)) => match column.cells.as_numbers() {
                    Some(numbers) => numbers.get(row) == Some(name),
                    None => false,
                },
                (Some(RunName::Text(name)), Some(column)) => column.cells.get(row) == *name,
            };
            if !same {
                let name = match run {
                    None if pairs => RunName::Pair(pair),
                    None => RunName::Number(1.0),
                    Some(column) => {
                        match column.cells.as_numbers().map(|numbers| entry(numbers, row)) {
                            Some(number) if !number.is_nan() => RunName::Number(number),
                            _ => RunName::Text(column.cells.get(row).into_owned()),
                        }
                    }
                };
                if let (RunName::Text(text), Some(column)) = (&name, run)
                    && text.is_empty()
                {
                    let message = "this sample belongs to no run";
                    let hint = "give the name of its run";
                    return Err(table.error(Some(line), Some(&column.header), message, hint));
                }
                let within = run.is_some() || pairs;
                let shown = match (&mapping.file, within) {
                    (None, _) => name.clone(),
                    (_, true) => RunName::Text(mapping.run_name(Some(&name.to_string()))),
                    (_, false) => RunName::Text(mapping.run_name(None)),
                };
                self.open = Some(name);
                self.begin(shown, line);
                self.since = Some(Since::new(table, column, row, time, scale));
            } else if !self.chunk.times.is_empty() {
                let before = self.last;
                if time < before {
                    return Err(self.backwards(table, line, header, before, time));
                }
                if time == before {
                    self.merge(table, line, header, time, &values, row)?;
                    continue;
                }
            }
            self.push_time(table, column, row, time);
            for (all, column) in self.chunk.values.iter_mut().zip(&values) {
                all.push(entry(column, row));
            }
            if let Some(piece) = self.chunk.pieces.last_mut() {
                piece.samples.end += 1;
            }
        }
        Ok(())
    }

    /// The time of the next sample of the open run. Its second sample tells whether the run is far
    /// from zero.
    fn push_time(&mut self, table: &Table, column: &Column, row: usize, time: f64) {
        let before = std::mem::replace(&mut self.last, time);
        let (Some(piece), Some(since)) = (self.chunk.pieces.last_mut(), &self.since) else {
            return self.chunk.times.push(time);
        };
        let second = piece.begins && piece.samples.len() == 1;
        if second && is_far(before, time) {
            piece.clock = since.clock(column);
            if let Some(first) = self.chunk.times.last_mut() {
                *first = since.first;
            }
        }
        let far = piece.clock != Clock::default();
        self.chunk.times.push(if far { since.of(table, column, row, time) } else { time });
    }

    fn begin(&mut self, name: RunName, line: u64) {
        if let Some(last) = self.chunk.pieces.last_mut() {
            last.ends = true;
        }
        let here = self.chunk.times.len();
        let run = self.runs;
        self.runs += 1;
        let samples = here..here;
        self.chunk.pieces.push(Piece {
            run,
            name,
            samples,
            line,
            begins: true,
            ends: false,
            clock: Clock::default(),
        });
    }

    fn backwards(
        &self,
        table: &Table,
        line: u64,
        header: &str,
        before: f64,
        time: f64,
    ) -> crate::error::Error {
        let part = &self.file.part;
        let hint = if part.mapping.run.is_none() && !part.pairs {
            "a file that is read part by part is not sorted: sort its rows by time, or name the \
             column that names the recording (`run` in the spec's `data` line)"
        } else {
            "a file that is read part by part is not sorted: keep the rows of a run together, by \
             rising time, or allow the memory that it takes to sort them"
        };
        let message = format!("time goes back from {before} to {time} within a run");
        table.error(Some(line), Some(header), message, hint)
    }

    /// Two rows at one time are one sample if they do not contradict each other.
    fn merge(
        &mut self,
        table: &Table,
        line: u64,
        header: &str,
        time: f64,
        values: &[Vec<f64>],
        row: usize,
    ) -> Result<()> {
        for (all, column) in self.chunk.values.iter_mut().zip(values) {
            let (Some(kept), new) = (all.last_mut(), entry(column, row)) else { continue };
            if kept.is_nan() {
                *kept = new;
            } else if !new.is_nan() && new != *kept {
                return Err(table.error(
                    Some(line),
                    Some(header),
                    format!("this and the sample before it are different, but both at time {time}"),
                    "remove one, give the time with more digits, or name the run column",
                ));
            }
        }
        Ok(())
    }
}
