//! Text of a record file: encoding, separator, decimal sign.

use crate::storage::untrusted::quoted;
use encoding_rs_io::DecodeReaderBytesBuilder;
use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, Cursor, Read};

/// Longest beginning that is looked at to find the header, in bytes: two thousand names of thirty letters.
const MOST_START: u64 = 1 << 16;

/// Separators of columns with their names, the usual one first.
const SEPARATORS: [(u8, &str); 3] = [(b',', "commas"), (b';', "semicolons"), (b'\t', "tabs")];

/// Text of a record file, ready for the reader of rows.
pub(super) struct Text<'a> {
    /// UTF-8 without a byte-order mark.
    pub text: Box<dyn Read + 'a>,
    /// Separator of the columns.
    pub separator: u8,
}

impl<'a> Text<'a> {
    /// Finds out encoding and separator of a file. UTF-16 is known by its byte-order mark.
    pub fn open(file: impl Read + 'a) -> io::Result<Result<Self, String>> {
        let decoder = DecodeReaderBytesBuilder::new()
            .bom_sniffing(true)
            .utf8_passthru(true)
            .strip_bom(true)
            .build(file);
        let mut reader = BufReader::new(decoder);
        let mut start = Vec::new();
        let mut line = 0..0;
        while header(&start[line.clone()]).is_empty() {
            let before = start.len();
            let left = MOST_START.saturating_sub(before as u64);
            if reader.by_ref().take(left).read_until(b'\n', &mut start)? == 0 {
                break;
            }
            line = before..start.len();
        }
        if start.contains(&0) {
            let remedy = "save it as UTF-8 text, or as UTF-16 with a byte-order mark";
            return Ok(Err(format!("the file is UTF-16 or binary; {remedy}")));
        }
        Ok(Ok(Self {
            separator: separator(header(&start[line])),
            text: Box::new(Cursor::new(start).chain(reader)),
        }))
    }

    /// Text with commas that the program has made itself.
    pub fn own(text: impl Read + 'a) -> Self {
        Self {
            text: Box::new(text),
            separator: b',',
        }
    }
}

/// A text as a cell of a file with commas.
pub(super) fn cell(text: &str) -> Cow<'_, str> {
    match text.starts_with('#') || text.contains([',', ';', '\t', '"', '\r', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")).into(),
        false => text.into(),
    }
}

/// Returns the first line that is neither empty nor a comment; none if there is none yet.
fn header(text: &[u8]) -> &[u8] {
    let mut lines = text.split(|byte| matches!(byte, b'\r' | b'\n'));
    let is_none = |line: &&[u8]| line.trim_ascii().is_empty() || line[0] == b'#';
    lines.find(|line| !is_none(line)).unwrap_or_default()
}

/// Returns the most frequent separator of a header, outside quotes.
fn separator(header: &[u8]) -> u8 {
    let mut counts = SEPARATORS.map(|(byte, _)| (byte, 0));
    let mut is_quoted = false;
    for byte in header {
        is_quoted ^= *byte == b'"';
        if let Some((_, count)) = counts.iter_mut().find(|(b, _)| b == byte)
            && !is_quoted
        {
            *count += 1;
        }
    }
    // The last of equals: a comma may stand within a name.
    counts
        .iter()
        .max_by_key(|(_, n)| *n)
        .map_or(b',', |c| if c.1 > 0 { c.0 } else { b',' })
}

/// Returns the name of a separator, in the plural.
pub(super) fn separator_name(separator: u8) -> &'static str {
    let known = SEPARATORS.iter().find(|(byte, _)| *byte == separator);
    known.map_or("commas", |(_, name)| name)
}

/// Decimal sign of a file: the first cell that has one sets it.
#[derive(Debug, Default)]
pub(super) struct Decimals {
    /// A comma or a point, and the row that it was met in.
    sign: Option<(u8, usize)>,
}

impl Decimals {
    /// Parses a number of a file whose columns are not separated by commas, so that a comma may be the decimal sign.
    ///
    /// # Errors
    ///
    /// Signs of both kinds in one file: a comma may then separate thousands.
    pub fn parse(&mut self, cell: &str, row: usize) -> Result<Option<f64>, String> {
        let count = |sign: char| cell.matches(sign).count();
        let sign = match (count(','), count('.')) {
            (0, 0) => return Ok(cell.parse().ok()),
            (1, 0) => b',',
            (0, 1) => b'.',
            _ => return Ok(None),
        };
        let Ok(value) = cell.replace(',', ".").parse::<f64>() else {
            return Ok(None);
        };
        let (first, first_row) = *self.sign.get_or_insert((sign, row));
        if first != sign {
            let name = |sign: u8| if sign == b',' { "comma" } else { "point" };
            return Err(format!(
                "\"{}\" has a decimal {}, row {first_row} a decimal {}; write the same sign in all rows, and no separators of thousands",
                quoted(cell),
                name(sign),
                name(first)
            ));
        }
        Ok(Some(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> (String, u8) {
        let mut text = Text::open(bytes).unwrap().unwrap();
        let mut all = String::new();
        text.text.read_to_string(&mut all).unwrap();
        (all, text.separator)
    }

    #[test]
    fn marks_and_encodings_are_read() {
        let text = "t;u;y\n0;1;2 µ𝛼\n";
        let units: Vec<u16> = text.encode_utf16().collect();
        let little: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
        let big: Vec<u8> = units.iter().flat_map(|u| u.to_be_bytes()).collect();
        for bytes in [
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            [&b"\xff\xfe"[..], &little].concat(),
            [&b"\xfe\xff"[..], &big].concat(),
        ] {
            assert_eq!(decoded(&bytes), (text.to_owned(), b';'));
        }
        let without_mark = Text::open(&little[..]).unwrap().err().unwrap();
        assert!(without_mark.contains("UTF-16"), "{without_mark}");
        // A pair of units across two blocks, and a file that ends within a unit.
        let long = "a".repeat(4094) + &"𝛼".repeat(5000);
        let units = long.encode_utf16().flat_map(u16::to_le_bytes);
        let bytes: Vec<u8> = b"\xff\xfe".iter().copied().chain(units).collect();
        assert_eq!(decoded(&bytes).0, long);
        assert_eq!(
            decoded(&bytes[..bytes.len() - 1]).0.matches('𝛼').count(),
            4999
        );
    }

    #[test]
    fn separators_are_those_outside_quotes() {
        for (header, expected) in [
            ("t,u,y\n", b','),
            ("\n\nt;u;y\n0,5;1;2\n", b';'),
            ("t\tu, mean\ty\n", b'\t'),
            ("\"t;s\",\"u;V\",y\n", b','),
            ("t\n", b','),
            ("", b','),
            ("t,a;y\n", b';'),
            ("# a, b, c\n\nt;y\n", b';'),
            ("\rt;u;y\r0,5;1,5;2,5\r1,0;1,0;2,0\r", b';'),
            ("# a,b\rt;u;y\r0,5;1,5;2,5\r", b';'),
        ] {
            assert_eq!(decoded(header.as_bytes()).1, expected, "{header}");
        }
    }

    #[test]
    fn decimal_signs_do_not_mix() {
        let mut decimals = Decimals::default();
        assert_eq!(decimals.parse("3", 2), Ok(Some(3.0)));
        assert_eq!(decimals.parse("1,5e3", 2), Ok(Some(1500.0)));
        assert_eq!(decimals.parse("1.234,5", 3), Ok(None));
        assert_eq!(decimals.parse("a,b", 3), Ok(None));
        let error = decimals.parse("1.5", 4).unwrap_err();
        assert!(error.contains("row 2 a decimal comma"), "{error}");
    }
}
