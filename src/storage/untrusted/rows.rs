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
}

/// Gives no more bytes than the row that is being read may have.
struct Bounded<R> {
    from: R,
    given: u64,
    row: Rc<Cell<u64>>,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.given.saturating_sub(self.row.get()) > MOST_ROW {
            let text = format!("a row of more than {} MiB", MOST_ROW >> 20);
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, text));
        }
        let read = self.from.read(to)?;
        self.given += read as u64;
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
        };
        let reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .delimiter(separator)
            .from_reader(bounded);
        Self { reader, row }
    }

    /// The names of the columns.
    pub fn header(&mut self) -> Result<csv::StringRecord, csv::Error> {
        self.reader.headers().cloned()
    }

    /// Reads the next row into `cells`; whether there was one.
    pub fn read(&mut self, cells: &mut csv::StringRecord) -> Result<bool, csv::Error> {
        self.row.set(self.reader.position().byte());
        self.reader.read_record(cells)
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
