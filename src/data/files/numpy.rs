//! NumPy: an array in a file (.npy), or several of them in an archive (.npz).

use std::io::{Cursor, Read};
use std::path::Path;

use npyz::{DType, NpyHeader, Order, TypeChar, TypeStr};

use super::super::guard::guarded;
use super::super::table::{Table, wrong};
use super::variables::{self, Variable};
use super::{INFLATED, cut_off, damaged, digest, most_inflated};
use crate::error::Result;

/// What an array begins with.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads an array: its columns, or the fields of a structured one.
///
/// # Errors
/// The file is cut off or damaged, or its numbers are no table.
pub(super) fn read(path: &Path, bytes: &[u8], part: Option<&str>) -> Result<Table> {
    if !bytes.starts_with(MAGIC) {
        return Err(wrong(
            path,
            None,
            None,
            "this is not an array of NumPy: it does not begin as one",
            "save it with `numpy.save` or `numpy.savez`, or as CSV",
        ));
    }
    let array = array(bytes).map_err(|broken| broken.told(path))?;
    variables::table(path, "NumPy", &array, part, digest(bytes))
}

/// Reads the arrays of an archive.
///
/// # Errors
/// As [`read`], and it is no archive.
pub(super) fn read_archive(path: &Path, bytes: &[u8], part: Option<&str>) -> Result<Table> {
    let open = || zip::ZipArchive::new(Cursor::new(bytes));
    let Some(Ok(mut archive)) = guarded(open) else {
        return Err(wrong(
            path,
            None,
            None,
            "this is not a whole archive of NumPy: its table of contents cannot be read",
            "copy it again, or save it again with `numpy.savez`",
        ));
    };
    let mut members = Vec::new();
    let mut left = most_inflated(bytes);
    for at in 0..archive.len() {
        let entry = guarded(|| -> zip::result::ZipResult<_> {
            let entry = archive.by_index(at)?;
            let name = entry.name()?.to_string();
            let mut bytes = Vec::new();
            entry.take(left + 1).read_to_end(&mut bytes)?;
            Ok((name, bytes))
        });
        let Some(Ok((name, bytes))) = entry else {
            return Err(damaged(path, "an array cannot be decompressed"));
        };
        left = match left.checked_sub(bytes.len() as u64) {
            Some(left) => left,
            None => return Err(damaged(path, INFLATED)),
        };
        if let Some(name) = name.strip_suffix(".npy") {
            members.push((name.to_string(), array(&bytes).map_err(|broken| broken.told(path))?));
        }
    }
    variables::table(path, "NumPy", &Variable::Group(members), part, digest(bytes))
}

enum Broken {
    CutOff,
    Damaged(&'static str),
}

impl Broken {
    fn told(self, path: &Path) -> crate::error::Error {
        match self {
            Broken::CutOff => cut_off(path),
            Broken::Damaged(what) => damaged(path, what),
        }
    }
}

fn array(bytes: &[u8]) -> std::result::Result<Variable, Broken> {
    let mut rest = bytes;
    let header = guarded(|| NpyHeader::from_reader(&mut rest));
    let Some(Ok(header)) = header else {
        return Err(Broken::Damaged("the description of an array cannot be read"));
    };
    // A header may have told a length that the file does not have.
    let rest = bytes.get(bytes.len() - rest.len()..).unwrap_or_default();
    let wide = || Broken::Damaged("an array has an impossible size");
    let shape: Option<Vec<usize>> =
        header.shape().iter().map(|length| usize::try_from(*length).ok()).collect();
    let shape = shape.ok_or_else(wide)?;
    let count = shape.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
    let count = count.ok_or_else(wide)?;
    let dtype = header.dtype();
    if dtype.uses_pickled_array() {
        return Ok(Variable::Unreadable("objects of Python"));
    }
    let width = guarded(|| dtype.num_bytes()).flatten().filter(|width| *width > 0);
    let width = width.ok_or_else(wide)?;
    let size = count.checked_mul(width).ok_or_else(wide)?;
    let rows = rest.get(..size).ok_or(Broken::CutOff)?;
    let fields = match dtype {
        DType::Record(fields) => fields,
        DType::Plain(kind) => {
            return Ok(plain(&kind, shape, rows, width, 0, width, header.order()));
        }
        DType::Array(..) => return Ok(Variable::Unreadable("arrays inside an array")),
    };
    let mut members = Vec::new();
    let mut start = 0;
    for field in fields {
        let size = guarded(|| field.dtype.num_bytes()).flatten().ok_or_else(wide)?;
        let mut shape = shape.clone();
        let mut kind = &field.dtype;
        while let DType::Array(length, inner) = kind {
            shape.push(usize::try_from(*length).map_err(|_| wide())?);
            kind = inner;
        }
        // Fields without a name are what is left between the others.
        let variable = match kind {
            DType::Plain(kind) => plain(kind, shape, rows, width, start, size, Order::C),
            _ => Variable::Unreadable("records inside records"),
        };
        if !field.name.is_empty() {
            members.push((field.name.clone(), variable));
        }
        start += size;
    }
    Ok(Variable::Group(members))
}

/// Numbers or texts that stand in every `stride` bytes from `start` to `start + size`.
fn plain(
    kind: &TypeStr,
    shape: Vec<usize>,
    rows: &[u8],
    stride: usize,
    start: usize,
    size: usize,
    order: Order,
) -> Variable {
    let Some(width) = kind.num_bytes().filter(|width| *width > 0) else {
        return Variable::Unreadable("cells without a size");
    };
    let cells = rows
        .chunks_exact(stride)
        .flat_map(|row| row.get(start..start + size).unwrap_or_default().chunks_exact(width));
    let big = matches!(kind.endianness(), npyz::Endianness::Big);
    macro_rules! number {
        ($number:ty) => {
            cells
                .map(|cell| match <[u8; size_of::<$number>()]>::try_from(cell) {
                    Ok(bytes) if big => <$number>::from_be_bytes(bytes) as f64,
                    Ok(bytes) => <$number>::from_le_bytes(bytes) as f64,
                    Err(_) => f64::NAN,
                })
                .collect()
        };
    }
    let values: Vec<f64> = match (kind.type_char(), width) {
        (TypeChar::Float, 8) => number!(f64),
        (TypeChar::Float, 4) => number!(f32),
        (TypeChar::Int, 1) => number!(i8),
        (TypeChar::Int, 2) => number!(i16),
        (TypeChar::Int, 4) => number!(i32),
        (TypeChar::Int, 8) => number!(i64),
        (TypeChar::Uint | TypeChar::Bool, 1) => number!(u8),
        (TypeChar::Uint, 2) => number!(u16),
        (TypeChar::Uint, 4) => number!(u32),
        (TypeChar::Uint, 8) => number!(u64),
        (TypeChar::ByteStr, _) => {
            let text =
                |cell: &[u8]| String::from_utf8_lossy(cell).trim_end_matches('\0').to_string();
            return Variable::Text(cells.map(text).collect());
        }
        (TypeChar::UnicodeStr, _) => {
            let text = |cell: &[u8]| -> String {
                let (codes, _) = cell.as_chunks::<4>();
                let code = |code: &[u8; 4]| match big {
                    true => u32::from_be_bytes(*code),
                    false => u32::from_le_bytes(*code),
                };
                let codes = codes.iter().map(code).take_while(|code| *code != 0);
                codes.map(|code| char::from_u32(code).unwrap_or('?')).collect()
            };
            return Variable::Text(cells.map(text).collect());
        }
        (TypeChar::Complex, _) => return Variable::Unreadable("complex numbers"),
        (TypeChar::DateTime | TypeChar::TimeDelta, _) => {
            return Variable::Unreadable("times of day");
        }
        _ => return Variable::Unreadable("numbers of half or of long precision"),
    };
    match order {
        Order::Fortran => Variable::of_columns(shape, values),
        Order::C => Variable::Numbers { shape, values },
    }
}
