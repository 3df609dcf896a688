//! HDF5, and MATLAB's files of version 7.3, which are HDF5 with marks of what a variable was.

use std::path::Path;

use hdf5_pure::{AttrValue, DType, Dataset, File, Group, Object};

use super::super::guard::guarded;
use super::super::table::{Table, wrong};
use super::variables::{self, Variable};
use super::{damaged, digest, most_inflated};
use crate::error::Result;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// What MATLAB's files of version 7.3 begin with.
pub(super) const MATLAB: &[u8] = b"MATLAB 7.3 MAT-file";
/// Groups inside groups, at most.
const DEEPEST: usize = 24;
/// Data sets and groups that are read, at most.
const MOST_OBJECTS: usize = 1 << 20;

/// Whether a file has the mark of HDF5, at its beginning or behind what another program put there.
pub(super) fn is_hdf5(bytes: &[u8]) -> bool {
    let starts = std::iter::once(0).chain((9..24).map(|power| 1_usize << power));
    starts
        .take_while(|at| *at < bytes.len())
        .any(|at| bytes.get(at..).is_some_and(|rest| rest.starts_with(SIGNATURE)))
}

/// Reads the data sets of a file, or of the group that is named.
///
/// # Errors
/// The file is not HDF5, is cut off or damaged, or holds no table.
pub(super) fn read(path: &Path, bytes: &[u8], part: Option<&str>) -> Result<Table> {
    if !is_hdf5(bytes) {
        return Err(wrong(
            path,
            None,
            None,
            "this is not an HDF5 file: it has not its mark",
            "copy it again, or export the measurements as CSV",
        ));
    }
    let matlab = bytes.starts_with(MATLAB);
    let read = guarded(|| {
        let file = File::from_bytes(bytes.to_vec())?;
        let mut walk = Walk { matlab, left: most_inflated(bytes), objects: 0 };
        walk.group(&file.root(), 0)
    });
    let root = match read {
        Some(Ok(root)) => root,
        Some(Err(error)) => {
            let what = error.to_string();
            let what: String = what.chars().filter(|c| !c.is_control()).take(200).collect();
            return Err(damaged(path, &what));
        }
        None => return Err(damaged(path, "its parts contradict each other")),
    };
    variables::table(path, if matlab { "MATLAB" } else { "HDF5" }, &root, part, digest(bytes))
}

type Read<T> = std::result::Result<T, hdf5_pure::Error>;

struct Walk {
    matlab: bool,
    /// Bytes that may yet be read, decompressed.
    left: u64,
    objects: usize,
}

impl Walk {
    /// Whether another object is to be read; a file may lead in circles.
    fn may(&mut self, depth: usize) -> bool {
        self.objects += 1;
        depth <= DEEPEST && self.objects <= MOST_OBJECTS
    }

    fn group(&mut self, group: &Group, depth: usize) -> Read<Variable> {
        if !self.may(depth) {
            return Ok(Variable::Unreadable("groups too deep inside each other"));
        }
        let mut members = Vec::new();
        for name in group.datasets()? {
            let dataset = group.dataset(&name)?;
            let unit = match dataset.attrs() {
                Ok(attributes) => ["units", "unit", "Units", "Unit"]
                    .iter()
                    .find_map(|key| attributes.get(*key).and_then(text)),
                Err(_) => None,
            };
            let variable = self.dataset(&dataset, depth)?;
            let header = match unit {
                Some(unit) if !self.matlab && !unit.is_empty() => format!("{name} [{unit}]"),
                _ => name,
            };
            members.push((header, variable));
        }
        for name in group.groups()? {
            // What MATLAB keeps for itself.
            if !(self.matlab && name.starts_with('#')) {
                members.push((name.clone(), self.group(&group.group(&name)?, depth + 1)?));
            }
        }
        Ok(Variable::Group(members))
    }

    fn dataset(&mut self, dataset: &Dataset, depth: usize) -> Read<Variable> {
        if !self.may(depth) {
            return Ok(Variable::Unreadable("groups too deep inside each other"));
        }
        let shape: Vec<u64> = dataset.shape()?;
        let count = shape.iter().try_fold(1_u64, |product, length| product.checked_mul(*length));
        let left = |count: u64| self.left.checked_sub(count.checked_mul(8)?);
        let Some((count, left)) = count.and_then(|count| Some((count, left(count)?))) else {
            return Ok(Variable::Unreadable("more numbers than the file can hold"));
        };
        self.left = left;
        let class = match self.matlab {
            true => dataset.attrs()?.get("MATLAB_class").and_then(text).unwrap_or_default(),
            false => String::new(),
        };
        if self.matlab && dataset.attrs()?.contains_key("MATLAB_empty") {
            return Ok(Variable::Numbers { shape: vec![0], values: Vec::new() });
        }
        let shape: Vec<usize> =
            shape.iter().map(|length| usize::try_from(*length).unwrap_or(usize::MAX)).collect();
        match dataset.dtype()? {
            DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64 => {
                let values = dataset.read_f64()?;
                if values.len() as u64 != count {
                    return Ok(Variable::Unreadable("fewer numbers than it says"));
                }
                Ok(match class.as_str() {
                    "char" => Variable::Text(lines(&shape, &values)),
                    // MATLAB's first axis runs fastest, and HDF5 names axes the other way round.
                    _ if self.matlab => {
                        Variable::of_columns(shape.into_iter().rev().collect(), values)
                    }
                    _ => Variable::Numbers { shape, values },
                })
            }
            DType::String | DType::VariableLengthString => {
                Ok(Variable::Text(dataset.read_string()?))
            }
            DType::ObjectReference => {
                let mut parts = Vec::new();
                for object in dataset.dereference()? {
                    parts.push(match object {
                        Object::Group(group) => self.group(&group, depth + 1)?,
                        Object::Dataset(inner) => self.dataset(&inner, depth + 1)?,
                        _ => Variable::Unreadable("an object"),
                    });
                }
                Ok(Variable::List(parts))
            }
            DType::Compound(fields) => self.records(dataset, &fields, &shape),
            DType::Enum(_) => Ok(Variable::Unreadable("names of a list")),
            DType::Array(..) => Ok(Variable::Unreadable("arrays inside an array")),
            _ => Ok(Variable::Unreadable("cells of a kind of their own")),
        }
    }

    /// A table of records, as pandas and PyTables write it: its numbers, field by field.
    fn records(
        &self,
        dataset: &Dataset,
        fields: &[(String, DType)],
        shape: &[usize],
    ) -> Read<Variable> {
        let datatype = dataset.datatype()?;
        let hdf5_pure::Datatype::Compound { members, .. } = &datatype else {
            return Ok(Variable::Unreadable("records"));
        };
        let width = usize::try_from(dataset.element_size()?).unwrap_or(0);
        let raw = dataset.read_raw()?;
        if width == 0 {
            return Ok(Variable::Unreadable("records"));
        }
        let mut out = Vec::new();
        for ((name, kind), member) in fields.iter().zip(members) {
            let start = usize::try_from(member.byte_offset).unwrap_or(usize::MAX);
            let little = is_little(&member.datatype);
            macro_rules! field {
                ($number:ty) => {
                    raw.chunks_exact(width)
                        .map(|record| {
                            let bytes = record.get(start..).unwrap_or_default();
                            match bytes.first_chunk::<{ size_of::<$number>() }>() {
                                Some(bytes) if little => <$number>::from_le_bytes(*bytes) as f64,
                                Some(bytes) => <$number>::from_be_bytes(*bytes) as f64,
                                None => f64::NAN,
                            }
                        })
                        .collect()
                };
            }
            let values: Vec<f64> = match kind {
                DType::F32 => field!(f32),
                DType::F64 => field!(f64),
                DType::I8 => field!(i8),
                DType::I16 => field!(i16),
                DType::I32 => field!(i32),
                DType::I64 => field!(i64),
                DType::U8 => field!(u8),
                DType::U16 => field!(u16),
                DType::U32 => field!(u32),
                DType::U64 => field!(u64),
                _ => {
                    out.push((name.clone(), Variable::Unreadable("records inside records")));
                    continue;
                }
            };
            out.push((name.clone(), Variable::Numbers { shape: shape.to_vec(), values }));
        }
        Ok(Variable::Group(out))
    }
}

/// Whether the bytes of a number begin with the lowest.
fn is_little(datatype: &hdf5_pure::Datatype) -> bool {
    use hdf5_pure::{Datatype, DatatypeByteOrder};
    match datatype {
        Datatype::FixedPoint { byte_order, .. } | Datatype::FloatingPoint { byte_order, .. } => {
            *byte_order == DatatypeByteOrder::LittleEndian
        }
        _ => true,
    }
}

/// The text of an attribute.
fn text(value: &AttrValue) -> Option<String> {
    match value {
        AttrValue::String(text)
        | AttrValue::AsciiString(text)
        | AttrValue::VarLenString(text)
        | AttrValue::VarLenAsciiString(text) => Some(text.trim().to_string()),
        _ => None,
    }
}

/// Characters of MATLAB, `[column][row]`, as lines.
fn lines(shape: &[usize], codes: &[f64]) -> Vec<String> {
    let rows = shape.last().copied().unwrap_or(0);
    if rows == 0 {
        return Vec::new();
    }
    let line = |row: usize| {
        let codes = codes.iter().skip(row).step_by(rows);
        let line: String = codes.map(|code| char::from_u32(*code as u32).unwrap_or('?')).collect();
        line.trim_end().to_string()
    };
    (0..rows.min(codes.len())).map(line).collect()
}
