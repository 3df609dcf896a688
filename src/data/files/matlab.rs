//! MATLAB's files of version 5 (5 to 7.2): a list of tagged elements, most of them compressed.
//!
//! Source: MAT-File Format, The MathWorks. Files of version 7.3 are HDF5.

use std::io::Read;
use std::path::Path;

use super::super::table::{Table, wrong};
use super::variables::{self, Variable};
use super::{INFLATED, cut_off, damaged, digest, hdf5, most_inflated};
use crate::error::Result;

const HEADER: usize = 128;
/// Matrices inside matrices, at most.
const DEEPEST: usize = 32;
/// Elements of cells, structs and their fields in one file, at most.
const MOST_ELEMENTS: usize = 1 << 24;

/// Reads the variables of a file, or the one that is named.
///
/// # Errors
/// The file is of another version, is cut off or damaged, or holds no table.
pub(super) fn read(path: &Path, bytes: &[u8], part: Option<&str>) -> Result<Table> {
    if hdf5::is_hdf5(bytes) {
        return hdf5::read(path, bytes, part);
    }
    let endian = bytes.get(126..HEADER);
    let little = match endian {
        Some(b"IM") => true,
        Some(b"MI") => false,
        _ => {
            return Err(wrong(
                path,
                None,
                None,
                "this is not a MATLAB file of version 5, 7 or 7.3",
                "save it in MATLAB with `save('file.mat', '-v7')`, or as CSV",
            ));
        }
    };
    let mut reader = Reader { little, elements: 0, left: most_inflated(bytes) };
    let mut rest = bytes.get(HEADER..).unwrap_or_default();
    let mut members = Vec::new();
    while !rest.is_empty() {
        let read = reader.top(&mut rest).map_err(|broken| match broken {
            Broken::CutOff => cut_off(path),
            Broken::Damaged(what) => damaged(path, what),
        })?;
        members.extend(read.filter(|(name, _)| !name.is_empty()));
    }
    variables::table(path, "MATLAB", &Variable::Group(members), part, digest(bytes))
}

enum Broken {
    CutOff,
    Damaged(&'static str),
}

type Parsed<T> = std::result::Result<T, Broken>;

struct Reader {
    little: bool,
    /// Matrices read so far.
    elements: usize,
    /// Bytes that may yet be decompressed.
    left: u64,
}

/// A tagged element: its type and its bytes.
struct Element<'a> {
    kind: u32,
    bytes: &'a [u8],
}

impl Reader {
    fn word(&self, bytes: &[u8]) -> Option<u32> {
        let bytes: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
        Some(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    fn element<'a>(&self, rest: &mut &'a [u8]) -> Parsed<Element<'a>> {
        let tag = self.word(rest).ok_or(Broken::CutOff)?;
        if tag >> 16 != 0 {
            // A small element: its bytes stand in the tag.
            let (kind, length) = (tag & 0xffff, (tag >> 16) as usize);
            if length > 4 {
                return Err(Broken::Damaged("an element has an impossible length"));
            }
            let bytes = rest.get(4..4 + length).ok_or(Broken::CutOff)?;
            *rest = rest.get(8..).ok_or(Broken::CutOff)?;
            return Ok(Element { kind, bytes });
        }
        let length = rest.get(4..).and_then(|bytes| self.word(bytes)).ok_or(Broken::CutOff)?;
        let length = length as usize;
        let bytes = rest.get(8..8 + length).ok_or(Broken::CutOff)?;
        // Compressed elements are not padded; the last of a file need not be.
        let padded = if tag == COMPRESSED { length } else { length.next_multiple_of(8) };
        *rest = rest.get(8 + padded..).unwrap_or_default();
        Ok(Element { kind: tag, bytes })
    }

    /// The next variable of the file with its name, if it is one.
    fn top(&mut self, rest: &mut &[u8]) -> Parsed<Option<(String, Variable)>> {
        let element = self.element(rest)?;
        match element.kind {
            MATRIX => self.matrix(element.bytes, 0).map(Some),
            COMPRESSED => {
                let mut inflated = Vec::new();
                flate2::read::ZlibDecoder::new(element.bytes)
                    .take(self.left + 1)
                    .read_to_end(&mut inflated)
                    .map_err(|_| Broken::Damaged("a variable cannot be decompressed"))?;
                let left = self.left.checked_sub(inflated.len() as u64);
                self.left = left.ok_or(Broken::Damaged(INFLATED))?;
                let inner = self.element(&mut inflated.as_slice())?;
                match inner.kind {
                    MATRIX => self.matrix(inner.bytes, 0).map(Some),
                    _ => Ok(None),
                }
            }
            _ => Ok(None),
        }
    }

    fn matrix(&mut self, mut rest: &[u8], depth: usize) -> Parsed<(String, Variable)> {
        self.elements += 1;
        if depth > DEEPEST || self.elements > MOST_ELEMENTS {
            return Err(Broken::Damaged("its cells and structs stand too deep inside each other"));
        }
        if rest.is_empty() {
            let values = Vec::new();
            return Ok((String::new(), Variable::Numbers { shape: vec![0], values }));
        }
        let rest = &mut rest;
        let flags = self.element(rest)?;
        let flags = self.word(flags.bytes).ok_or(Broken::Damaged("a variable has no class"))?;
        let (class, complex) = (flags & 0xff, flags & 0x0800 != 0);
        if class == OPAQUE {
            return Ok((String::new(), Variable::Unreadable("an object")));
        }
        let shape = self.element(rest)?;
        let shape: Vec<usize> =
            self.numbers(&shape)?.iter().map(|length| length.max(0.0) as usize).collect();
        let name = String::from_utf8_lossy(self.element(rest)?.bytes).into_owned();
        let count = shape.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
        let count = count.ok_or(Broken::Damaged("a variable has an impossible size"))?;
        let variable = match class {
            CELL => {
                // A cell takes eight bytes or more.
                if count > rest.len() / 8 {
                    return Err(Broken::CutOff);
                }
                let parts = (0..count).map(|_| self.inner(rest, depth)).collect::<Parsed<_>>()?;
                Variable::List(parts)
            }
            STRUCT | OBJECT => {
                if class == OBJECT {
                    self.element(rest)?;
                }
                self.structs(rest, count, depth)?
            }
            CHAR => self.text(rest, &shape)?,
            SPARSE => Variable::Unreadable("a sparse matrix"),
            DOUBLE..=LAST_NUMERIC if complex => Variable::Unreadable("complex numbers"),
            DOUBLE..=LAST_NUMERIC => {
                let values = self.numbers(&self.element(rest)?)?;
                if values.len() != count {
                    return Err(Broken::Damaged("a variable has not as many numbers as it says"));
                }
                Variable::of_columns(shape, values)
            }
            _ => Variable::Unreadable("an object"),
        };
        Ok((name, variable))
    }

    fn inner(&mut self, rest: &mut &[u8], depth: usize) -> Parsed<Variable> {
        let element = self.element(rest)?;
        match element.kind {
            MATRIX => Ok(self.matrix(element.bytes, depth + 1)?.1),
            _ => Err(Broken::Damaged("a cell or a field is no variable")),
        }
    }

    /// One group, or a list of them where the struct is an array.
    fn structs(&mut self, rest: &mut &[u8], count: usize, depth: usize) -> Parsed<Variable> {
        let length = self.element(rest)?;
        let length = self.numbers(&length)?.first().map_or(0, |length| length.max(0.0) as usize);
        let names = self.element(rest)?.bytes;
        if length == 0 {
            return Ok(Variable::Group(Vec::new()));
        }
        let names: Vec<String> = names
            .chunks(length)
            .map(|name| {
                let end = name.iter().position(|byte| *byte == 0).unwrap_or(name.len());
                String::from_utf8_lossy(name.get(..end).unwrap_or_default()).into_owned()
            })
            .collect();
        if count.saturating_mul(names.len()) > rest.len() / 8 {
            return Err(Broken::CutOff);
        }
        let mut groups = Vec::with_capacity(if names.is_empty() { 0 } else { count });
        while groups.len() < groups.capacity().min(count) {
            let members = names.iter().map(|name| Ok((name.clone(), self.inner(rest, depth)?)));
            groups.push(Variable::Group(members.collect::<Parsed<_>>()?));
        }
        Ok(match groups.pop() {
            Some(only) if count == 1 => only,
            last => {
                groups.extend(last);
                Variable::List(groups)
            }
        })
    }

    /// Texts, one of each row of the array of characters.
    fn text(&self, rest: &mut &[u8], shape: &[usize]) -> Parsed<Variable> {
        let element = self.element(rest)?;
        let characters: Vec<char> = match element.kind {
            16 => String::from_utf8_lossy(element.bytes).chars().collect(),
            _ => {
                let codes = self.numbers(&element)?;
                codes.iter().map(|code| char::from_u32(*code as u32).unwrap_or('?')).collect()
            }
        };
        let rows = match shape.first() {
            Some(rows) if (1..=characters.len()).contains(rows) => *rows,
            _ => return Ok(Variable::Text(Vec::new())),
        };
        let line = |row: usize| {
            let line: String = characters.iter().skip(row).step_by(rows).collect();
            line.trim_end().to_string()
        };
        Ok(Variable::Text((0..rows).map(line).collect()))
    }

    /// The numbers of an element, whatever they are stored as.
    fn numbers(&self, element: &Element) -> Parsed<Vec<f64>> {
        macro_rules! read {
            ($number:ty) => {{
                const SIZE: usize = size_of::<$number>();
                let number = |bytes: &[u8; SIZE]| match self.little {
                    true => <$number>::from_le_bytes(*bytes) as f64,
                    false => <$number>::from_be_bytes(*bytes) as f64,
                };
                let (whole, rest) = element.bytes.as_chunks::<SIZE>();
                if !rest.is_empty() {
                    return Err(Broken::Damaged("a number is cut in half"));
                }
                whole.iter().map(number).collect()
            }};
        }
        Ok(match element.kind {
            1 => read!(i8),
            2 => read!(u8),
            3 => read!(i16),
            4 | 17 => read!(u16),
            5 => read!(i32),
            6 | 18 => read!(u32),
            7 => read!(f32),
            9 => read!(f64),
            12 => read!(i64),
            13 => read!(u64),
            _ => return Err(Broken::Damaged("numbers are of a kind that does not exist")),
        })
    }
}

/// Types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Classes of variables.
const CELL: u32 = 1;
const STRUCT: u32 = 2;
const OBJECT: u32 = 3;
const CHAR: u32 = 4;
const SPARSE: u32 = 5;
const DOUBLE: u32 = 6;
const LAST_NUMERIC: u32 = 15;
const OPAQUE: u32 = 17;
