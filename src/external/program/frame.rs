//! Blocks of points on the pipes of a program: a line of JSON, then numbers as little-endian f64.

use super::asking::Reply;
use super::inside::ServedMethod;
use super::protocol::{check_id, error_text};
use crate::setting::{count, number};
use crate::storage::untrusted::{Keyed, message};
use crate::twin::Now;
use serde::Deserialize;

/// Longest line before the numbers of an answer, in bytes: the text of an error is cut by none that is honest.
pub(super) const LONGEST_LINE: usize = 1 << 16;

/// Points as a table: a row for the time, each input, each parameter, each state; a column for each point.
pub(super) struct PointTable {
    points: usize,
    numbers: Vec<f64>,
    /// Inputs, parameters and states.
    sizes: [usize; 3],
}

impl PointTable {
    pub fn new(points: usize, now: &Now<'_>, states: usize) -> Self {
        let sizes = [now.u.len(), now.theta.len(), states];
        let rows = 1 + sizes.iter().sum::<usize>();
        Self {
            points,
            numbers: vec![0.0; rows * points],
            sizes,
        }
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.points
    }

    fn set(&mut self, row: usize, point: usize, value: f64) {
        self.numbers[row * self.points + point] = value;
    }

    /// Sets all of a point; `state` returns one of its states.
    pub fn put(&mut self, point: usize, now: &Now<'_>, state: impl Fn(usize) -> f64) {
        let [inputs, parameters, states] = self.sizes;
        self.set(0, point, now.t);
        for (i, &u) in now.u.iter().enumerate() {
            self.set(1 + i, point, u);
        }
        for (i, &value) in now.theta.iter().enumerate() {
            self.set(1 + inputs + i, point, value);
        }
        for i in 0..states {
            self.set(1 + inputs + parameters + i, point, state(i));
        }
    }

    /// Returns the time, inputs, parameters and states of a point.
    pub fn point(&self, point: usize) -> [Vec<f64>; 4] {
        let all = self.numbers.iter().skip(point).step_by(self.points.max(1));
        let mut all = all.copied();
        let [inputs, parameters, states] = self.sizes;
        [1, inputs, parameters, states].map(|count| all.by_ref().take(count).collect())
    }

    /// Numbers of a point.
    fn rows(&self) -> usize {
        1 + self.sizes.iter().sum::<usize>()
    }
}

/// Returns the request for what `method` computes at the points of tables of one twin, one table beside the other.
pub(super) fn request(id: u64, method: ServedMethod, tables: &[&PointTable]) -> Vec<u8> {
    let name = method.name();
    let points: usize = tables.iter().map(|table| table.points).sum();
    let rows = tables.first().map_or(0, |table| table.rows());
    let bytes = rows * points * size_of::<f64>();
    let line =
        format!("{{\"request\":\"{name}\",\"id\":{id},\"points\":{points},\"bytes\":{bytes}}}\n");
    let mut request = Vec::with_capacity(line.len() + bytes);
    request.extend_from_slice(line.as_bytes());
    for row in 0..rows {
        for table in tables {
            for number in &table.numbers[row * table.points..(row + 1) * table.points] {
                request.extend_from_slice(&number.to_le_bytes());
            }
        }
    }
    request
}

/// Returns the numbers of each table from the rows of an answer to [`request`].
pub(super) fn parted(numbers: &[f64], tables: &[&PointTable]) -> Vec<Vec<f64>> {
    let points: usize = tables.iter().map(|table| table.points).sum();
    let mut first = 0;
    (tables.iter())
        .map(|table| {
            let own = first..first + table.points;
            first = own.end;
            let rows = numbers.chunks_exact(points.max(1));
            rows.flat_map(|row| row[own.clone()].iter().copied())
                .collect()
        })
        .collect()
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with id and bytes, or error"
)]
struct FrameLine {
    id: u64,
    bytes: Option<usize>,
    error: Option<String>,
}

/// Reads the line of an answer of `rows` numbers for each of so many points; the error says what to answer instead.
pub(super) fn reply(
    line: &str,
    id: u64,
    (rows, points): (usize, usize),
) -> Result<Reply<()>, String> {
    let Keyed::<FrameLine>(told) = serde_json::from_str(line).map_err(|error| {
        let error = message(&error.to_string());
        format!("{error}; write answers alone to standard output, and all else to standard error")
    })?;
    check_id(told.id, id)?;
    let expected = rows * points * size_of::<f64>();
    match (told.bytes, told.error) {
        (Some(bytes), None) if bytes == expected => Ok(Reply::Good((), bytes)),
        (Some(bytes), None) => Err(format!(
            "bytes = {}, {} of {} are {expected}; give all of them",
            number(bytes as f64),
            count(rows, "row"),
            count(points, "number")
        )),
        (None, Some(text)) => error_text(&text).map(Reply::Error),
        _ => Err("exactly one of bytes and error is needed; leave the other out".into()),
    }
}

/// Reads numbers.
pub(super) fn numbers(bytes: &[u8]) -> Vec<f64> {
    let (chunks, _) = bytes.as_chunks();
    chunks
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_row_for_each_quantity_and_loses_no_bit() {
        let mut table = PointTable::new(2, &Now::new(0.0, 0.1, &[0.0], &[0.0, 0.0]), 2);
        for (point, t) in [0.5, 1.0 / 3.0].into_iter().enumerate() {
            let (u, theta) = ([7.0 + t], [t, -0.0]);
            let now = Now::new(t, 0.1, &u, &theta);
            table.put(point, &now, |state| 10.0 * point as f64 + state as f64);
        }
        let request = request(4, ServedMethod::Drift, &[&table]);
        let end = request.iter().position(|b| *b == b'\n').unwrap() + 1;
        let line = std::str::from_utf8(&request[..end]).unwrap();
        let expected = "{\"request\":\"drift\",\"id\":4,\"points\":2,\"bytes\":96}\n";
        assert_eq!(line, expected);
        let third = 1.0 / 3.0;
        let rows = [
            [0.5, third],
            [7.5, 7.0 + third],
            [0.5, third],
            [-0.0, -0.0],
            [0.0, 10.0],
            [1.0, 11.0],
        ];
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&numbers(&request[end..])), bits(rows.as_flattened()));
        assert_eq!(table.point(1)[3], [10.0, 11.0]);
    }

    #[test]
    fn tables_side_by_side_are_parted_again() {
        let of = |values: &[f64]| {
            let now = Now::new(0.0, 0.1, &[], &[]);
            let mut table = PointTable::new(values.len(), &now, 1);
            for (point, value) in values.iter().enumerate() {
                table.put(point, &now, |_| *value);
            }
            table
        };
        let (one, two) = (of(&[1.0, 2.0]), of(&[3.0]));
        let request = request(1, ServedMethod::Drift, &[&one, &two]);
        let end = request.iter().position(|b| *b == b'\n').unwrap() + 1;
        let sent = numbers(&request[end..]);
        assert_eq!(sent, [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
        let parted = parted(&sent, &[&one, &two]);
        assert_eq!(parted, [vec![0.0, 0.0, 1.0, 2.0], vec![0.0, 3.0]]);
    }

    #[test]
    fn odd_lines_are_refused_with_what_is_expected() {
        assert!(matches!(
            reply(r#"{"id": 4, "bytes": 80}"#, 4, (2, 5)),
            Ok(Reply::Good((), 80))
        ));
        let error = reply(r#"{"id": 4, "error": "no\nlicence"}"#, 4, (2, 5));
        assert!(matches!(error, Ok(Reply::Error(text)) if text == "no licence"));
        for (line, part) in [
            (r#"{"id": 4, "bytes": 72}"#, "2 rows of 5 numbers are 80;"),
            (r#"{"id": 3, "bytes": 80}"#, "id 3, the request has 4"),
            (r#"{"id": 4}"#, "exactly one of"),
            (r#"{"id": 4, "bytse": 80}"#, "unknown key `bytse`"),
            ("array([1.0])", "standard error"),
            ("[4, 80, null]", "expected an object with id and bytes"),
        ] {
            let problem = reply(line, 4, (2, 5)).err().unwrap();
            assert!(problem.contains(part), "{problem}");
        }
    }
}
