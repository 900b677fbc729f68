//! The rows of a CSV file, however long the file is.

use std::cell::Cell;
use std::io::{self, Read};
use std::rc::Rc;

/// Longest row, in bytes: two thousand columns of forty digits are a tenth of it.
const MOST_ROW: u64 = 1 << 20;

/// Reads a CSV table row by row. One row is in memory at a time; a row without end is refused, whatever quotes it holds.
pub(crate) struct Rows<R> {
    reader: csv::Reader<Bounded<R>>,
    /// Where the row begins that is being read, in bytes.
    row: Rc<Cell<u64>>,
    /// Bytes before the text whose lines are not counted yet.
    counted: u64,
    /// Line, from 1, that this text begins in.
    next: usize,
    /// `true` if a carriage return is before it, to which a line feed belongs.
    after_return: bool,
    /// Line, from 1, that the last row begins in.
    line: usize,
}

/// Gives no more bytes than the row that is being read may have. Lines end with feeds alone, and comments are empty lines.
struct Bounded<R> {
    from: R,
    given: u64,
    row: Rc<Cell<u64>>,
    /// Bytes read and not counted yet, behind those that are done; 0 in comments.
    text: Vec<u8>,
    done: usize,
    at: PlaceInText,
}

/// Place of a byte of a text.
#[derive(Debug, Clone, Copy, PartialEq)]
enum PlaceInText {
    Start,
    Line,
    Quotes,
    Comment,
}

impl PlaceInText {
    /// Returns the place of the byte behind this one.
    fn behind(self, byte: u8) -> Self {
        match (self, byte) {
            (Self::Quotes, b'"') => Self::Line,
            (Self::Quotes, _) => Self::Quotes,
            (_, b'\r' | b'\n') => Self::Start,
            (Self::Start, b'#') | (Self::Comment, _) => Self::Comment,
            (_, b'"') => Self::Quotes,
            _ => Self::Line,
        }
    }
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.given.saturating_sub(self.row.get()) > MOST_ROW {
            let text = format!("a row of more than {} MiB", MOST_ROW >> 20);
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, text));
        }
        let read = self.from.read(to)?;
        self.given += read as u64;
        self.text.drain(..self.done);
        self.done = 0;
        self.text.extend_from_slice(&to[..read]);
        let is_odd = |byte: &u8| matches!(byte, b'"' | b'#' | b'\r');
        let begins_odd = matches!(self.at, PlaceInText::Quotes | PlaceInText::Comment);
        if begins_odd || to[..read].iter().any(is_odd) {
            let end = self.text.len() - read;
            for (own, byte) in self.text[end..].iter_mut().zip(&mut to[..read]) {
                self.at = self.at.behind(*byte);
                match self.at {
                    PlaceInText::Comment => (*own, *byte) = (0, b'\n'),
                    PlaceInText::Start => *byte = b'\n',
                    _ => {}
                }
            }
        } else if let Some(last) = to[..read].last() {
            self.at = self.at.behind(*last);
        }
        Ok(read)
    }
}

impl<R: Read> Rows<R> {
    /// Reads a text with a header, columns separated by commas.
    pub fn new(from: R) -> Self {
        Self::separated(from, b',')
    }

    /// Reads a text with a header, columns separated by another byte.
    pub fn separated(from: R, separator: u8) -> Self {
        let row = Rc::new(Cell::new(0));
        let bounded = Bounded {
            from,
            given: 0,
            row: row.clone(),
            text: vec![],
            done: 0,
            at: PlaceInText::Start,
        };
        let reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .delimiter(separator)
            .from_reader(bounded);
        Self {
            reader,
            row,
            counted: 0,
            next: 1,
            after_return: false,
            line: 1,
        }
    }

    /// The names of the columns.
    pub fn header(&mut self) -> Result<csv::StringRecord, csv::Error> {
        let header = self.reader.headers().cloned();
        self.count();
        header
    }

    /// Reads the next row into `cells`; whether there was one.
    pub fn read(&mut self, cells: &mut csv::StringRecord) -> Result<bool, csv::Error> {
        self.reader.headers()?;
        self.count();
        self.row.set(self.reader.position().byte());
        let read = self.reader.read_record(cells);
        self.count();
        read
    }

    /// Line that the last row begins in, as an editor counts lines: from 1, the empty ones among them.
    pub fn line(&self) -> usize {
        self.line
    }

    /// Counts lines up to where the parser is. Its own number is that of the first empty line before a row.
    fn count(&mut self) {
        let until = self.reader.position().byte();
        let behind = self.reader.get_mut();
        let end = behind
            .text
            .len()
            .min(behind.done + (until - self.counted) as usize);
        let mut begin = None;
        for &byte in &behind.text[behind.done..end] {
            let is_feed = byte == b'\n';
            if byte == b'\r' || is_feed && !self.after_return {
                self.next += 1;
            } else if !is_feed && byte != 0 && begin.is_none() {
                begin = Some(self.next);
            }
            self.after_return = byte == b'\r';
        }
        self.line = begin.unwrap_or(self.line);
        behind.done = end;
        self.counted = until;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_end_are_refused_and_many_rows_are_not() {
        let many = "1,2\n".repeat(1 << 20);
        let mut rows = Rows::new(many.as_bytes());
        let (mut cells, mut count) = (csv::StringRecord::new(), 0);
        while rows.read(&mut cells).unwrap() {
            count += 1;
        }
        assert_eq!(count, (1 << 20) - 1, "one is the header");
        let endless: [&[u8]; 3] = [b"0", b"\n", b"1,"];
        for pattern in endless {
            let mut rows = Rows::new(Endless(pattern));
            let error = loop {
                if let Err(error) = rows.read(&mut cells) {
                    break error.to_string();
                }
            };
            assert!(error.contains("more than 1 MiB"), "{error}");
        }
    }

    /// The ends of lines of all systems, empty lines, cells of several lines, and no end at all.
    #[test]
    fn lines_are_those_of_an_editor() {
        for (text, expected) in [
            ("t\n1\n2\n", &[2, 3][..]),
            ("\n\nt\n\n1\n\n\n2", &[5, 8]),
            ("t\r\n1\r\n\r\n2\r\n", &[2, 4]),
            ("t\r1\r\r2", &[2, 4]),
            ("t\n\"1\n\n\"\n2\n\r\n3", &[2, 5, 7]),
            ("# a\nt\n# b\n1\n\n#\r\n# c\n2\n# d", &[4, 8]),
            ("#\r\nt\r\n1\r\n# #\r\n\"2\n#\"\n3", &[3, 5, 7]),
            ("# it's 5\"\rt\r1\r\r#\r2", &[3, 6]),
        ] {
            // However the bytes come.
            for size in [1, 2, 100] {
                let mut rows = Rows::new(std::io::BufReader::with_capacity(size, text.as_bytes()));
                let (mut cells, mut lines) = (csv::StringRecord::new(), vec![]);
                while rows.read(&mut cells).unwrap() {
                    lines.push(rows.line());
                }
                assert_eq!(lines, expected, "{text:?}");
            }
        }
    }

    /// The same bytes again and again.
    struct Endless(&'static [u8]);
    impl Read for Endless {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            let whole = to.len() / self.0.len() * self.0.len();
            for (byte, pattern) in to[..whole].iter_mut().zip(self.0.iter().cycle()) {
                *byte = *pattern;
            }
            Ok(whole)
        }
    }
}
