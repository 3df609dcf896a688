//! Data sets as Parquet.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result as Written};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type, TypePtr};

use super::super::write::{Layout, check_finite, headers};
use super::super::{Dataset, Run};
use crate::error::{Error, Result};

/// A data set as Parquet: one row per sample, doubles as they are, nulls where nothing was
/// measured. Runs are a column of integers where all of them are called by a number, else text.
///
/// # Errors
/// As [`to_csv`](super::super::to_csv).
pub fn to_parquet(path: &Path, data: &Dataset, layout: &Layout) -> Result<Vec<u8>> {
    let numbered = data.runs.iter().all(|run| number(run).is_some());
    let mut writer = ParquetWriter::new(path, Vec::new(), &data.observables, layout, numbered)?;
    writer.push(data)?;
    writer.finish()
}

/// Rows of one group, at most.
const GROUP: usize = 1 << 18;

/// Writes data sets of the same observables one after the other into one file.
pub struct ParquetWriter<W: Write + Send> {
    path: PathBuf,
    layout: Layout,
    observables: Vec<String>,
    numbered: bool,
    file: SerializedFileWriter<W>,
    rows: u64,
    runs: usize,
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins a file; `path` is what errors call it. With `numbered`, the names of all runs are
    /// integers.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn new(
        path: &Path,
        out: W,
        observables: &[String],
        layout: &Layout,
        numbered: bool,
    ) -> Result<Self> {
        let schema = schema(observables, layout, numbered).map_err(|e| unwritable(path, &e))?;
        let mut properties = WriterProperties::builder()
            .set_created_by(format!("leverrier {}", env!("CARGO_PKG_VERSION")))
            .set_compression(Compression::SNAPPY)
            .set_max_row_group_row_count(Some(GROUP));
        let columns = headers(observables, layout);
        let first = usize::from(layout.run.is_some());
        for (at, name) in columns.iter().enumerate() {
            let column = ColumnPath::from(vec![name.clone()]);
            // Times come again in every run; measurements hardly ever do.
            properties = properties.set_column_dictionary_enabled(column.clone(), at <= first);
            if at < first && numbered {
                properties = properties
                    .set_column_dictionary_enabled(column.clone(), false)
                    .set_column_encoding(column, Encoding::DELTA_BINARY_PACKED);
            }
        }
        let file = SerializedFileWriter::new(out, schema, Arc::new(properties.build()))
            .map_err(|error| unwritable(path, &error))?;
        Ok(ParquetWriter {
            path: path.to_path_buf(),
            layout: layout.clone(),
            observables: observables.to_vec(),
            numbered,
            file,
            rows: 0,
            runs: 0,
        })
    }

    /// Appends the runs of a data set.
    ///
    /// # Errors
    /// A time or value is infinite, a run is not called by an integer although that was
    /// promised, there is more than one run and no run column, or the disk is full.
    pub fn push(&mut self, data: &Dataset) -> Result<()> {
        self.runs += data.runs.len();
        super::super::write::check_runs(&self.layout, self.runs)?;
        let mut row = self.rows + 1;
        for run in &data.runs {
            check_finite(&self.path, run, row, &self.layout, &self.observables)?;
            row += run.times.len() as u64;
        }
        let mut rest = data.runs.as_slice();
        while !rest.is_empty() {
            let mut rows = 0;
            let full = rest.iter().position(|run| {
                rows += run.times.len();
                rows >= GROUP
            });
            let (runs, after) = rest.split_at(full.map_or(rest.len(), |last| last + 1));
            self.group(runs).map_err(|error| unwritable(&self.path, &error))?;
            self.rows += rows as u64;
            rest = after;
        }
        Ok(())
    }

    fn group(&mut self, runs: &[Run]) -> Written<()> {
        let mut group = self.file.next_row_group()?;
        if self.layout.run.is_some() {
            if self.numbered {
                let mut names = Vec::new();
                for run in runs {
                    let name = number(run).ok_or_else(|| {
                        ParquetError::General(format!("run `{}` is not a number", run.name))
                    })?;
                    names.resize(names.len() + run.times.len(), name);
                }
                column::<Int64Type>(&mut group, &names, None)?;
            } else {
                let mut names = Vec::new();
                for run in runs {
                    let name = ByteArray::from(run.name.as_str());
                    names.resize(names.len() + run.times.len(), name);
                }
                column::<ByteArrayType>(&mut group, &names, None)?;
            }
        }
        let times: Vec<f64> = runs.iter().flat_map(|run| run.clock_times()).collect();
        column::<DoubleType>(&mut group, &times, None)?;
        for at in 0..self.observables.len() {
            let cells = || {
                runs.iter().flat_map(|run| {
                    let values = run.values.get(at);
                    (0..run.times.len()).map(move |sample| {
                        values.and_then(|v| v.get(sample)).copied().unwrap_or(f64::NAN)
                    })
                })
            };
            let levels: Vec<i16> = cells().map(|x| i16::from(!x.is_nan())).collect();
            let values: Vec<f64> = cells().filter(|x| !x.is_nan()).collect();
            column::<DoubleType>(&mut group, &values, Some(&levels))?;
        }
        group.close().map(|_| ())
    }

    /// Writes the table of contents, and gives back what was written to.
    ///
    /// # Errors
    /// The disk is full.
    pub fn finish(self) -> Result<W> {
        let path = self.path;
        self.file.into_inner().map_err(|error| unwritable(&path, &error))
    }
}

fn column<T: parquet::data_type::DataType>(
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Written<()> {
    let Some(mut writer) = group.next_column()? else {
        return Err(ParquetError::General("one column too many".to_string()));
    };
    writer.typed::<T>().write_batch(values, levels, None)?;
    writer.close()
}

fn schema(observables: &[String], layout: &Layout, numbered: bool) -> Written<TypePtr> {
    let names = headers(observables, layout);
    let first = usize::from(layout.run.is_some());
    let mut fields = Vec::with_capacity(names.len());
    for (at, name) in names.iter().enumerate() {
        let field = match (at < first, numbered) {
            (true, true) => Type::primitive_type_builder(name, Physical::INT64),
            (true, false) => Type::primitive_type_builder(name, Physical::BYTE_ARRAY)
                .with_logical_type(Some(LogicalType::String)),
            _ => Type::primitive_type_builder(name, Physical::DOUBLE),
        };
        let repetition = if at <= first { Repetition::REQUIRED } else { Repetition::OPTIONAL };
        fields.push(Arc::new(field.with_repetition(repetition).build()?));
    }
    Ok(Arc::new(Type::group_type_builder("measurements").with_fields(fields).build()?))
}

/// The name of a run, where it is an integer written in the usual way.
fn number(run: &Run) -> Option<i64> {
    run.name.parse::<i64>().ok().filter(|number| number.to_string() == run.name)
}

fn unwritable(path: &Path, error: &ParquetError) -> Error {
    Error::file("write", path, std::io::Error::other(error.to_string()))
}
