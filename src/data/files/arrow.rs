//! Arrow and Feather: columns in batches of rows, as a file or as a stream.

use std::path::Path;

use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type,
    UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrowPrimitiveType, BooleanArray, DictionaryArray, LargeStringArray, PrimitiveArray,
    RecordBatch, StringArray, StringViewArray,
};
use arrow_buffer::Buffer;
use arrow_ipc::reader::StreamDecoder;
use arrow_schema::DataType;

use super::super::cells::Cells;
use super::super::guard::guarded;
use super::super::table::{Reading, StoredReading, Table, column_of, wrong};
use super::{cut_off, damaged, digest};
use crate::error::Result;

/// What files begin and end with.
pub(super) const MAGIC: &[u8] = b"ARROW1";
/// What files of the first version of Feather begin with.
const FEATHER_1: &[u8] = b"FEA1";
/// What every message of a stream begins with.
const CONTINUES: [u8; 4] = [0xff; 4];

/// Reads all rows of a file or a stream.
///
/// # Errors
/// The file is of another kind, is cut off or damaged, or is compressed with zstd.
pub(super) fn read(path: &Path, bytes: &[u8], part: Option<&str>) -> Result<Table> {
    let stop = |message: &str, hint: &str| Err(wrong(path, None, None, message, hint));
    if part.is_some() {
        return stop("there are no names of tables in this file", "leave out what stands behind #");
    }
    if bytes.starts_with(FEATHER_1) {
        return stop(
            "this is a file of the first version of Feather",
            "write it again with `pyarrow.feather.write_feather`, whose second version is Arrow",
        );
    }
    let stream = match bytes.strip_prefix(MAGIC) {
        Some(_) if bytes.len() < 20 || !bytes.ends_with(MAGIC) => return Err(cut_off(path)),
        // The messages of a file are a stream, too, from its eighth byte on.
        Some(_) => bytes.get(8..).unwrap_or_default(),
        None if bytes.starts_with(&CONTINUES) => bytes,
        None => {
            return stop(
                "this is not an Arrow file: it does not begin with ARROW1",
                "write it as Feather or Arrow, or as CSV",
            );
        }
    };
    let end = match guarded(|| lengths(stream)) {
        Some(Ok(end)) => end,
        Some(Err(Wrong::Zstd)) => {
            return stop(
                "it is compressed with zstd, which this program was built without",
                "write it with `compression=\"lz4\"` or `\"uncompressed\"`",
            );
        }
        Some(Err(Wrong::CutOff)) => return Err(cut_off(path)),
        _ => return Err(damaged(path, "a message cannot be read")),
    };
    // Behind the messages of a file stands its table of contents.
    let stream = stream.get(..end).unwrap_or_default();
    let batches = match guarded(|| batches(stream)) {
        Some(Ok(batches)) => batches,
        Some(Err(_)) => return Err(damaged(path, "a batch of rows cannot be decoded")),
        None => return Err(damaged(path, "its parts contradict each other")),
    };
    // Rows take room, even where no column has any.
    let most = bytes.len().saturating_mul(8 * 255);
    let rows = batches.iter().fold(0, |rows: usize, batch| rows.saturating_add(batch.num_rows()));
    if rows > most {
        return Err(damaged(path, "it says more rows than it can hold"));
    }
    let Some(first) = batches.first().filter(|_| rows > 0) else {
        return stop("there are no rows", "add the measurements, one row per sample");
    };
    let mut columns = Vec::new();
    for (at, field) in first.schema().fields().iter().enumerate() {
        let mut cells = Cells::default();
        for batch in &batches {
            let done = guarded(|| append(&mut cells, batch.column(at).as_ref()));
            if done.is_none() || batch.num_columns() != first.num_columns() {
                return Err(damaged(path, "a column contradicts itself"));
            }
        }
        let column = column_of(field.name(), cells);
        if columns.iter().any(|other: &super::super::Column| other.header == column.header) {
            let message = format!("two columns are called `{}`", column.header);
            return stop(&message, "give every column a name of its own");
        }
        columns.push(column);
    }
    Ok(Table {
        path: path.to_path_buf(),
        columns,
        lines: (1..=rows as u64).collect(),
        reading: Reading::Stored(StoredReading { format: "Arrow", part: None, runs: None }),
        sha256: digest(bytes),
    })
}

enum Wrong {
    Zstd,
    CutOff,
    Damaged,
}

/// That the buffers of every message are no longer than a decoder can make them: it makes room
/// for what they say before it looks. Gives the bytes of all messages.
fn lengths(stream: &[u8]) -> std::result::Result<usize, Wrong> {
    let mut rest = stream;
    let whole = |number: i64| usize::try_from(number).map_err(|_| Wrong::Damaged);
    while let Some(bytes) = rest.strip_prefix(&CONTINUES) {
        let (size, message) = bytes.split_first_chunk::<4>().ok_or(Wrong::CutOff)?;
        let size = whole(i64::from(i32::from_le_bytes(*size)))?;
        if size == 0 {
            return Ok(stream.len() - message.len());
        }
        let (message, body) = message.split_at_checked(size).ok_or(Wrong::CutOff)?;
        let message = arrow_ipc::root_as_message(message).map_err(|_| Wrong::Damaged)?;
        let (body, after) =
            body.split_at_checked(whole(message.bodyLength())?).ok_or(Wrong::CutOff)?;
        let batch = match message.header_as_dictionary_batch() {
            Some(dictionary) => dictionary.data(),
            None => message.header_as_record_batch(),
        };
        if let Some(batch) = batch
            && let Some(compression) = batch.compression()
        {
            if compression.codec() == arrow_ipc::CompressionType::ZSTD {
                return Err(Wrong::Zstd);
            }
            for buffer in batch.buffers().into_iter().flatten() {
                let (start, length) = (whole(buffer.offset())?, whole(buffer.length())?);
                let bytes = body.get(start..).and_then(|rest| rest.get(..length));
                let bytes = bytes.ok_or(Wrong::Damaged)?;
                let Some((said, rest)) = bytes.split_first_chunk::<8>() else { continue };
                // LZ4 makes at most 255 bytes of one; -1 marks a buffer that is not compressed.
                let said = i64::from_le_bytes(*said);
                if said > 0 && whole(said)? / 255 > rest.len() {
                    return Err(Wrong::Damaged);
                }
            }
        }
        rest = after;
    }
    Ok(stream.len() - rest.len())
}

fn batches(stream: &[u8]) -> std::result::Result<Vec<RecordBatch>, arrow_schema::ArrowError> {
    let mut decoder = StreamDecoder::new();
    let mut rest = Buffer::from(stream);
    let mut batches = Vec::new();
    while let Some(batch) = decoder.decode(&mut rest)? {
        batches.push(batch);
    }
    decoder.finish()?;
    Ok(batches)
}

/// Appends the cells of a batch; nulls are missing.
fn append(cells: &mut Cells, array: &dyn Array) {
    fn numbers<T: ArrowPrimitiveType>(
        cells: &mut Cells,
        array: &dyn Array,
        of: fn(T::Native) -> f64,
    ) {
        match array.as_any().downcast_ref::<PrimitiveArray<T>>() {
            Some(array) => {
                cells.extend_numbers(array.iter().map(|number| number.map_or(f64::NAN, of)));
            }
            None => cells.push_unread("numbers of another kind", array.len()),
        }
    }
    fn text<'a>(cells: &mut Cells, lines: impl Iterator<Item = Option<&'a str>>) {
        lines.for_each(|line| cells.push(line.unwrap_or_default()));
    }
    let any = array.as_any();
    match array.data_type() {
        DataType::Float64 => numbers::<Float64Type>(cells, array, |x| x),
        DataType::Float32 => numbers::<Float32Type>(cells, array, f64::from),
        DataType::Int8 => numbers::<Int8Type>(cells, array, f64::from),
        DataType::Int16 => numbers::<Int16Type>(cells, array, f64::from),
        DataType::Int32 => numbers::<Int32Type>(cells, array, f64::from),
        DataType::Int64 => numbers::<Int64Type>(cells, array, |x| x as f64),
        DataType::UInt8 => numbers::<UInt8Type>(cells, array, f64::from),
        DataType::UInt16 => numbers::<UInt16Type>(cells, array, f64::from),
        DataType::UInt32 => numbers::<UInt32Type>(cells, array, f64::from),
        DataType::UInt64 => numbers::<UInt64Type>(cells, array, |x| x as f64),
        DataType::Timestamp(..) | DataType::Date32 | DataType::Date64 => {
            cells.push_unread("dates", array.len());
        }
        DataType::Time32(_) | DataType::Time64(_) => cells.push_unread("times of day", array.len()),
        DataType::Duration(_) => cells.push_unread("durations of time", array.len()),
        _ => {
            if let Some(lines) = any.downcast_ref::<StringArray>() {
                text(cells, lines.iter());
            } else if let Some(lines) = any.downcast_ref::<LargeStringArray>() {
                text(cells, lines.iter());
            } else if let Some(lines) = any.downcast_ref::<StringViewArray>() {
                text(cells, lines.iter());
            } else if let Some(truths) = any.downcast_ref::<BooleanArray>() {
                let number =
                    |truth: Option<bool>| truth.map_or(f64::NAN, |t| f64::from(u8::from(t)));
                cells.extend_numbers(truths.iter().map(number));
            } else if let Some(names) = any.downcast_ref::<DictionaryArray<Int32Type>>() {
                categories(cells, names);
            } else if let Some(names) = any.downcast_ref::<DictionaryArray<Int8Type>>() {
                categories(cells, names);
            } else {
                cells.push_unread("lists or objects", array.len());
            }
        }
    }
}

/// Texts that are numbered, as categories are kept.
fn categories<K: arrow_array::types::ArrowDictionaryKeyType>(
    cells: &mut Cells,
    names: &DictionaryArray<K>,
) {
    let mut values = Cells::default();
    append(&mut values, names.values().as_ref());
    if let Some(what) = values.unread() {
        return cells.push_unread(what, names.len());
    }
    for key in names.keys_iter() {
        match key {
            Some(key) => cells.push(&values.get(key)),
            None => cells.push(""),
        }
    }
}
