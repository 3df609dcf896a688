//! From a file's bytes to text: encodings, and what is not text at all.

use serde::Serialize;

/// How the text of a file is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// UTF-8, and so ASCII, with or without a byte order mark.
    Utf8,
    /// UTF-16, least significant byte first.
    Utf16LittleEndian,
    /// UTF-16, most significant byte first.
    Utf16BigEndian,
    /// ISO 8859-1: what older instruments write for a degree sign.
    Latin1,
}

impl Encoding {
    /// The name that people know it by.
    pub fn name(self) -> &'static str {
        match self {
            Encoding::Utf8 => "UTF-8",
            Encoding::Utf16LittleEndian | Encoding::Utf16BigEndian => "UTF-16",
            Encoding::Latin1 => "Latin-1",
        }
    }
}

/// Why bytes are not text: the line where it shows, and what is there.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NotText {
    pub line: u64,
    pub what: String,
}

/// Turns a file's bytes into text without its byte order mark.
pub(super) fn decode(bytes: &[u8]) -> Result<(String, Encoding), NotText> {
    let (text, encoding) = match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => decode_bytes(rest)?,
        [0xFF, 0xFE, rest @ ..] => (utf16(rest, u16::from_le_bytes)?, Encoding::Utf16LittleEndian),
        [0xFE, 0xFF, rest @ ..] => (utf16(rest, u16::from_be_bytes)?, Encoding::Utf16BigEndian),
        // Without a mark: the header's first characters are nearly always ASCII.
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => {
            (utf16(bytes, u16::from_le_bytes)?, Encoding::Utf16LittleEndian)
        }
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => {
            (utf16(bytes, u16::from_be_bytes)?, Encoding::Utf16BigEndian)
        }
        _ => decode_bytes(bytes)?,
    };
    // DOS programs end a text with this byte.
    let end = text.trim_end().trim_end_matches('\x1a').len();
    match text
        .get(..end)
        .unwrap_or(&text)
        .char_indices()
        .find(|(_, c)| c.is_ascii_control() && !matches!(c, '\t' | '\n' | '\r' | '\x0c'))
    {
        Some((at, control)) => Err(NotText {
            line: line_of(text.as_bytes().split_at(at).0),
            what: format!("a byte {:#04x}, which no text has", control as u32),
        }),
        None => Ok((text, encoding)),
    }
}

fn decode_bytes(bytes: &[u8]) -> Result<(String, Encoding), NotText> {
    let error = match std::str::from_utf8(bytes) {
        Ok(text) => return Ok((text.to_string(), Encoding::Utf8)),
        Err(error) => error,
    };
    // A degree sign or an umlaut here and there is Latin-1; a photograph is not.
    let high = bytes.iter().filter(|b| **b >= 0x80).count();
    if high * 10 > bytes.len() {
        return Err(NotText {
            line: line_of(bytes.split_at(error.valid_up_to()).0),
            what: "bytes that are neither UTF-8 nor Latin-1 text".to_string(),
        });
    }
    Ok((bytes.iter().map(|b| char::from(*b)).collect(), Encoding::Latin1))
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, NotText> {
    let (pairs, rest) = bytes.as_chunks();
    let whole = rest.is_empty();
    let units = pairs.iter().map(|pair| unit(*pair));
    let mut text = String::with_capacity(bytes.len() / 2);
    for decoded in char::decode_utf16(units) {
        match decoded {
            Ok(character) => text.push(character),
            Err(_) => return Err(broken_utf16(&text)),
        }
    }
    if whole { Ok(text) } else { Err(broken_utf16(&text)) }
}

fn broken_utf16(before: &str) -> NotText {
    NotText { line: line_of(before.as_bytes()), what: "broken UTF-16".to_string() }
}

fn line_of(before: &[u8]) -> u64 {
    1 + before.iter().filter(|b| **b == b'\n').count() as u64
}

/// Characters beyond the control characters that end lines, turn text around, or cannot be seen.
pub fn is_invisible(c: char) -> bool {
    matches!(
        c,
        '\u{ad}'
            | '\u{61c}'
            | '\u{180e}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}'
            | '\u{fffe}'
            | '\u{ffff}'
            | '\u{e0000}'..='\u{e007f}'
    )
}

/// The text on one line, and what cannot be seen in it as `\u{fffd}`.
pub fn visible(text: &str) -> String {
    let seen = |c: char| if c.is_control() || is_invisible(c) { '\u{fffd}' } else { c };
    text.chars().map(seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings_are_recognised() {
        let little: Vec<u8> = "t,θ\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = "t,x\n".encode_utf16().flat_map(u16::to_be_bytes).collect();
        let marked = |mark: &[u8], rest: &[u8]| [mark, rest].concat();
        let rows: Vec<(Vec<u8>, &str, Encoding)> = vec![
            (b"t,x\n".to_vec(), "t,x\n", Encoding::Utf8),
            (marked(&[0xEF, 0xBB, 0xBF], b"t,x\n"), "t,x\n", Encoding::Utf8),
            (marked(&[0xFF, 0xFE], &little), "t,θ\n", Encoding::Utf16LittleEndian),
            (marked(&[0xFE, 0xFF], &big), "t,x\n", Encoding::Utf16BigEndian),
            (big, "t,x\n", Encoding::Utf16BigEndian),
            (b"time,angle [\xb0]\n0,1\n".to_vec(), "time,angle [°]\n0,1\n", Encoding::Latin1),
        ];
        for (bytes, text, encoding) in rows {
            assert_eq!(decode(&bytes), Ok((text.to_string(), encoding)));
        }
    }

    #[test]
    fn what_is_not_text_is_refused_with_its_line() {
        assert_eq!(decode(b"t,x\n0,\x00\n").unwrap_err().line, 2);
        assert_eq!(decode(b"\x89PNG\r\n\x1a\n\x00\x00").unwrap_err().line, 2);
        let photograph: Vec<u8> = (128..=255).collect();
        assert_eq!(decode(&photograph).unwrap_err().line, 1);
        assert!(decode(&[0xFF, 0xFE, 0x41]).is_err());
    }
}
