//! Cells of one column, from what the file stores to numbers or text.

use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::ColumnDescriptor;

use super::super::cells::Cells;

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ColumnKind {
    /// Floating point numbers and signed integers as they stand.
    Number,
    /// Integers whose first bit is not a sign.
    Unsigned,
    /// Integers to be multiplied by this.
    Decimal(f64),
    /// Text, and true or false.
    Text,
    /// What no measurement is made of, in words.
    Other(&'static str),
}

impl ColumnKind {
    pub(super) fn of(column: &ColumnDescriptor) -> ColumnKind {
        if column.max_rep_level() > 0 {
            return ColumnKind::Other("lists");
        }
        let converted = column.converted_type();
        match column.logical_type_ref() {
            Some(LogicalType::Date) => return ColumnKind::Other("dates"),
            Some(LogicalType::Time(_)) => return ColumnKind::Other("times of the day"),
            Some(LogicalType::Timestamp(_)) => return ColumnKind::Other("timestamps"),
            Some(LogicalType::Float16) => return ColumnKind::Other("16-bit numbers"),
            Some(LogicalType::Uuid | LogicalType::Bson) => return ColumnKind::Other("binary data"),
            _ => {}
        }
        match converted {
            ConvertedType::DATE => return ColumnKind::Other("dates"),
            ConvertedType::TIME_MILLIS | ConvertedType::TIME_MICROS => {
                return ColumnKind::Other("times of the day");
            }
            ConvertedType::TIMESTAMP_MILLIS | ConvertedType::TIMESTAMP_MICROS => {
                return ColumnKind::Other("timestamps");
            }
            ConvertedType::INTERVAL => return ColumnKind::Other("intervals of the calendar"),
            _ => {}
        }
        let decimal = converted == ConvertedType::DECIMAL
            || matches!(column.logical_type_ref(), Some(LogicalType::Decimal(_)));
        let unsigned = matches!(
            converted,
            ConvertedType::UINT_8
                | ConvertedType::UINT_16
                | ConvertedType::UINT_32
                | ConvertedType::UINT_64
        ) || matches!(column.logical_type_ref(), Some(LogicalType::Integer(int)) if !int.is_signed);
        match column.physical_type() {
            Type::INT96 => ColumnKind::Other("timestamps"),
            _ if decimal => ColumnKind::Decimal(10f64.powi(column.type_scale())),
            Type::FLOAT | Type::DOUBLE => ColumnKind::Number,
            Type::INT32 | Type::INT64 if unsigned => ColumnKind::Unsigned,
            Type::INT32 | Type::INT64 => ColumnKind::Number,
            Type::BYTE_ARRAY | Type::BOOLEAN => ColumnKind::Text,
            Type::FIXED_LEN_BYTE_ARRAY => ColumnKind::Other("binary data"),
        }
    }
}

impl ColumnKind {
    /// What the cells are, where they are neither numbers nor text.
    pub(super) fn other(self) -> &'static str {
        match self {
            ColumnKind::Other(what) => what,
            _ => "nothing that was asked for",
        }
    }
}

/// The largest integer below which every integer is a floating point number.
const EXACT: i128 = 1 << 53;

/// Appends the next `count` cells of a column, or as many as are left; says how many.
pub(super) fn decode(
    reader: &mut ColumnReader,
    kind: ColumnKind,
    nullable: i16,
    count: usize,
    into: &mut Cells,
) -> Result<usize> {
    use ColumnReader as R;
    let integer = |x: i128| match kind {
        ColumnKind::Decimal(scale) => Value::Number(x as f64 / scale),
        _ if x.abs() <= EXACT => Value::Number(x as f64),
        _ => Value::Text(x.to_string()),
    };
    match (reader, kind) {
        (_, ColumnKind::Other(what)) => {
            into.push_unread(what, count);
            Ok(count)
        }
        (R::DoubleColumnReader(r), _) => plain(r, nullable, count, into, |x| *x),
        (R::FloatColumnReader(r), _) => plain(r, nullable, count, into, |x| f64::from(*x)),
        (R::Int32ColumnReader(r), ColumnKind::Unsigned) => {
            cells(r, nullable, count, into, |x| Ok(integer(i128::from(*x as u32))))
        }
        (R::Int32ColumnReader(r), _) => {
            cells(r, nullable, count, into, |x| Ok(integer(i128::from(*x))))
        }
        (R::Int64ColumnReader(r), ColumnKind::Unsigned) => {
            cells(r, nullable, count, into, |x| Ok(integer(i128::from(*x as u64))))
        }
        (R::Int64ColumnReader(r), _) => {
            cells(r, nullable, count, into, |x| Ok(integer(i128::from(*x))))
        }
        (R::ByteArrayColumnReader(r), ColumnKind::Decimal(_)) => {
            cells(r, nullable, count, into, |x: &ByteArray| Ok(integer(big_endian(x.data()))))
        }
        (R::FixedLenByteArrayColumnReader(r), _) => {
            cells(r, nullable, count, into, |x: &FixedLenByteArray| {
                Ok(integer(big_endian(x.data())))
            })
        }
        (R::ByteArrayColumnReader(r), _) => {
            cells(r, nullable, count, into, |x: &ByteArray| match std::str::from_utf8(x.data()) {
                Ok(text) => Ok(Value::Text(text.trim().to_string())),
                Err(_) => Err(ParquetError::General("a text is not UTF-8".to_string())),
            })
        }
        (R::BoolColumnReader(r), _) => {
            cells(r, nullable, count, into, |x| Ok(Value::Text(x.to_string())))
        }
        (R::Int96ColumnReader(_), _) => {
            into.push_unread("timestamps", count);
            Ok(count)
        }
    }
}

enum Value {
    Number(f64),
    Text(String),
}

/// Numbers: the way that nearly all data go.
fn plain<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    nullable: i16,
    count: usize,
    into: &mut Cells,
    number: impl Fn(&T::T) -> f64,
) -> Result<usize> {
    let (values, levels) = records(reader, nullable, count)?;
    if nullable == 0 {
        into.extend_numbers(values.iter().map(number));
        return Ok(values.len());
    }
    let mut next = values.iter();
    into.extend_numbers(levels.iter().map(|level| {
        let value = if *level == nullable { next.next() } else { None };
        value.map_or(f64::NAN, &number)
    }));
    Ok(levels.len())
}

/// Cells of which some may be text.
fn cells<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    nullable: i16,
    count: usize,
    into: &mut Cells,
    cell: impl Fn(&T::T) -> Result<Value>,
) -> Result<usize> {
    let (values, levels) = records(reader, nullable, count)?;
    let mut put = |value: Option<&T::T>| -> Result<()> {
        match value.map(&cell).transpose()? {
            Some(Value::Number(number)) => into.push_number(number),
            Some(Value::Text(text)) => into.push(&text),
            None => into.push_missing(),
        }
        Ok(())
    };
    if nullable == 0 {
        values.iter().try_for_each(|value| put(Some(value)))?;
        return Ok(values.len());
    }
    let mut next = values.iter();
    for level in &levels {
        put(if *level == nullable { next.next() } else { None })?;
    }
    Ok(levels.len())
}

/// Values that are not null, and for each cell how much of it is there.
fn records<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    nullable: i16,
    count: usize,
) -> Result<(Vec<T::T>, Vec<i16>)> {
    let (mut values, mut levels) = (Vec::new(), Vec::new());
    let mut done = 0;
    while done < count {
        let levels = (nullable > 0).then_some(&mut levels);
        let (records, _, _) = reader.read_records(count - done, levels, None, &mut values)?;
        if records == 0 {
            break;
        }
        done += records;
    }
    Ok((values, levels))
}

/// A signed integer of any length, its most significant byte first.
fn big_endian(bytes: &[u8]) -> i128 {
    let sign = if bytes.first().is_some_and(|b| b & 0x80 != 0) { -1 } else { 0 };
    bytes.iter().fold(sign, |all, byte| (all << 8) | i128::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_any_length_are_read() {
        assert_eq!(big_endian(&[0x01, 0x00]), 256);
        assert_eq!(big_endian(&[0xff, 0xfe]), -2);
        assert_eq!(big_endian(&[]), 0);
    }
}
