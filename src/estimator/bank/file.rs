//! Rows of parameters and features in files: NumPy's `.npz` and CSV.
//!
//! | form | holds | opened by |
//! |---|---|---|
//! | `.npz` | arrays `theta` (M × d) and `features` (M × n), f64, not compressed | `numpy.load` |
//! | `.csv` | a column for each parameter, by name, then `x1` … `xn` | anything |
//!
//! Both keep every bit. The same draws give the same bytes: an archive carries no time.

use super::Draws;
pub(crate) use super::npy::archive;
use super::npy::{self, Npz};
use crate::estimator::error::EstimatorError;
use crate::setting::{count, number};
use crate::storage::files::write_new;
use crate::storage::reading::{Reading, note_whole, open};
use crate::storage::untrusted::{MOST_NUMBERS, Rows, excerpt};
use crate::twin::ParameterSpace;
use ndarray::Array2;
use std::io::{self, Read, Seek};
use std::path::Path;

/// Remedy for a file from elsewhere.
const GIVE: &str = "give theta (rows × parameters, within their bounds) and features (rows × features), one simulation a row, all finite";

fn extension(path: &Path) -> &str {
    (path.extension().and_then(|e| e.to_str())).unwrap_or_default()
}

fn other_form(path: &Path) -> EstimatorError {
    let problem =
        "banks are written and read as .npz or .csv, features also as .npy; choose such a name";
    EstimatorError::file(path, problem)
}

/// Returns whether a path has the name of a file of rows.
pub(crate) fn is_named(path: &Path) -> bool {
    matches!(extension(path), "npz" | "csv")
}

/// Writes a new file of features alone, one record a row: `.npy`, `.npz` (array `features`) or `.csv` (`x1` … `xn`).
pub(crate) fn write_features(path: &Path, features: &Array2<f64>) -> Result<(), EstimatorError> {
    let bytes = match extension(path) {
        "npy" => npy::bytes(features),
        "npz" => archive(&[("features", features)]),
        "csv" => features_csv_text(features).map(String::into_bytes),
        _ => return Err(other_form(path)),
    };
    write_bytes(path, bytes)
}

/// The CSV text of [`write_features`].
pub(crate) fn features_csv_text(features: &Array2<f64>) -> io::Result<String> {
    let bytes = csv_text(&Array2::zeros((features.nrows(), 0)), features, &[])?;
    String::from_utf8(bytes).map_err(io::Error::other)
}

/// Writes a new file in the form that its name ends with; `names` are the parameters'.
pub fn write(path: &Path, draws: &Draws, names: &[&str]) -> Result<(), EstimatorError> {
    let bytes = match extension(path) {
        "npz" => npz(draws),
        "csv" => csv_text(&draws.theta, &draws.features, names),
        _ => return Err(other_form(path)),
    };
    write_bytes(path, bytes)
}

fn write_bytes(path: &Path, bytes: io::Result<Vec<u8>>) -> Result<(), EstimatorError> {
    bytes
        .and_then(|bytes| write_new(path, &bytes))
        .map_err(|error| EstimatorError::io(path, error))
}

/// Reads a file in the form that its name ends with, of a twin with these parameters.
pub fn read(path: &Path, space: &ParameterSpace) -> Result<Draws, EstimatorError> {
    if !is_named(path) {
        return Err(other_form(path));
    }
    let unread = |error| EstimatorError::io(path, error);
    let draws = match extension(path) {
        "npz" => {
            let file = open(path).map_err(unread)?;
            let draws = from_npz(io::BufReader::new(&file));
            note_whole(path, &file).map_err(unread)?;
            draws.and_then(|draws| {
                check(&draws, space.len())?;
                check_points(&draws.theta, space)?;
                Ok(draws)
            })
        }
        _ => from_csv(Reading::open(path).map_err(unread)?, space),
    };
    draws.map_err(|reason| EstimatorError::no_bank(path, &reason, GIVE))
}

/// Checks whether the rows are whole, finite, and of so many parameters.
pub(crate) fn check(draws: &Draws, parameters: usize) -> Result<(), String> {
    let (theta, features) = (&draws.theta, &draws.features);
    if theta.ncols() != parameters {
        let given = count(theta.ncols(), "parameter");
        return Err(format!("{given}, the twin has {parameters}"));
    }
    if theta.nrows() != features.nrows() {
        let (rows, of) = (count(theta.nrows(), "row"), features.nrows());
        return Err(format!("{rows} of theta, {of} of features"));
    }
    for (what, matrix) in [("theta", theta), ("features", features)] {
        if let Some(((row, column), value)) = matrix.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(format!(
                "{what}, row {}, column {}: {value}",
                row + 1,
                column + 1
            ));
        }
    }
    Ok(())
}

/// Checks that the parameters of every row lie within their bounds.
fn check_points(theta: &Array2<f64>, space: &ParameterSpace) -> Result<(), String> {
    for (row, theta) in theta.rows().into_iter().enumerate() {
        (space.check_point(&theta.to_vec()))
            .map_err(|error| format!("theta, row {}: {error}", row + 1))?;
    }
    Ok(())
}

/// The bytes of an `.npz` archive.
pub(crate) fn npz(draws: &Draws) -> io::Result<Vec<u8>> {
    archive(&[("theta", &draws.theta), ("features", &draws.features)])
}

/// Rows of an `.npz` archive, of 64 or 32 bits.
pub(crate) fn from_npz(archive: impl Read + Seek) -> Result<Draws, String> {
    let mut archive = Npz::new(archive)?;
    Ok(Draws {
        theta: archive.matrix("theta")?,
        features: archive.matrix("features")?,
        redrawn: 0,
    })
}

/// Names of the columns of a CSV file of n features.
fn header(names: &[&str], n: usize) -> Vec<String> {
    let features = (1..=n).map(|j| format!("x{j}"));
    (names.iter().map(|name| (*name).to_owned()))
        .chain(features)
        .collect()
}

fn csv_text(theta: &Array2<f64>, features: &Array2<f64>, names: &[&str]) -> io::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(header(names, features.ncols()))?;
    for (theta, features) in theta.rows().into_iter().zip(features.rows()) {
        csv.write_record(theta.iter().chain(features).map(f64::to_string))?;
    }
    csv.into_inner().map_err(|error| error.into_error())
}

/// A reader that knows whether its bytes end with a line.
struct WithEnd<R> {
    from: R,
    last: u8,
}

impl<R: Read> Read for WithEnd<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let read = self.from.read(to)?;
        if let Some(last) = to[..read].last() {
            self.last = *last;
        }
        Ok(read)
    }
}

/// Rows of a CSV file. A last line without an end may be cut within a number, which nothing else would tell.
fn from_csv(from: impl Read, space: &ParameterSpace) -> Result<Draws, String> {
    let mut file = WithEnd { from, last: b'\n' };
    let draws = rows_of_csv(&mut file, space)?;
    match file.last {
        b'\n' | b'\r' => Ok(draws),
        _ => Err(format!(
            "row {}, the last one, has no end of line and may be cut; make the file again, or end the row if it is whole",
            draws.theta.nrows() + 1
        )),
    }
}

/// Says what is wrong with the row at a line.
fn told(error: &csv::Error, line: usize) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths {
            len, expected_len, ..
        } => {
            let cells = count(*len as usize, "cell");
            format!("row {line}: {cells}, the header has {expected_len}")
        }
        _ => error.to_string(),
    }
}

fn rows_of_csv(file: impl Read, space: &ParameterSpace) -> Result<Draws, String> {
    let mut csv = Rows::new(file);
    let found = csv.header().map_err(|error| error.to_string())?;
    let (names, d) = (&space.names(), space.len());
    let n = found.len().saturating_sub(d);
    if n == 0 || !found.iter().eq(header(names, n).iter()) {
        return Err(format!("the header is not {},x1,x2,…", names.join(",")));
    }
    let (mut values, mut rows) = ([Vec::new(), Vec::new()], 0);
    let mut cells = csv::StringRecord::new();
    loop {
        match csv.read(&mut cells) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => return Err(told(&error, csv.line())),
        }
        // As an editor counts them.
        let line = csv.line();
        if (rows + 1) * (d + n) > MOST_NUMBERS {
            return Err(format!(
                "more than {} numbers; keep such a bank in shards",
                number(MOST_NUMBERS as f64)
            ));
        }
        for (column, cell) in cells.iter().enumerate() {
            let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
            values[usize::from(column >= d)].push(value.ok_or_else(|| {
                let cell = excerpt(cell);
                format!("row {line}, column {}: \"{cell}\" is no number", column + 1)
            })?);
        }
        (space.check_point(&values[0][rows * d..]))
            .map_err(|error| format!("row {line}: {error}"))?;
        rows += 1;
    }
    let [theta, features] = values;
    let matrix = |width, values| {
        Array2::from_shape_vec((rows, width), values).map_err(|error| error.to_string())
    };
    Ok(Draws {
        theta: matrix(d, theta)?,
        features: matrix(n, features)?,
        redrawn: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Parameter;
    use ndarray::array;
    use std::fs::File;

    fn draws() -> Draws {
        Draws {
            theta: array![[0.1 + 0.2, 1e-300], [f64::MAX, -0.0]],
            features: array![[1.0 / 3.0], [std::f64::consts::PI]],
            redrawn: 0,
        }
    }

    const NAMES: [&str; 2] = ["a", "b"];

    fn space() -> ParameterSpace {
        let wide = |name| Parameter::new(name, "1", f64::MIN, f64::MAX);
        ParameterSpace::new(NAMES.map(wide))
    }

    #[test]
    fn every_bit_comes_back_from_both_forms() {
        let place = tempfile::tempdir().unwrap();
        for name in ["bank.npz", "bank.csv"] {
            let path = place.path().join(name);
            write(&path, &draws(), &NAMES).unwrap();
            assert_eq!(read(&path, &space()).unwrap(), draws(), "{name}");
            let taken = write(&path, &draws(), &NAMES).unwrap_err();
            assert!(taken.to_string().contains("choose another"), "{taken}");
        }
        let path = place.path().join("bank.txt");
        let error = write(&path, &draws(), &NAMES).unwrap_err().to_string();
        assert!(error.contains(".npz or .csv"), "{error}");
    }

    /// As NumPy writes them: compressed, of 32 bits, without an ending.
    #[test]
    fn archives_of_others_are_read() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("bank.npz");
        let numbers: Vec<u8> = [0.5f32, 1.0, 2.0, 3.0].map(f32::to_le_bytes).concat();
        let header = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 2), }\n";
        let npy = [
            b"\x93NUMPY\x01\x00",
            &(header.len() as u16).to_le_bytes()[..],
            header.as_bytes(),
            &numbers,
        ]
        .concat();
        let mut archive = zip::ZipWriter::new(File::create(&path).unwrap());
        let deflated = zip::CompressionMethod::Deflated;
        for name in ["theta.npy", "features"] {
            let options = zip::write::SimpleFileOptions::default().compression_method(deflated);
            archive.start_file(name, options).unwrap();
            io::Write::write_all(&mut archive, &npy).unwrap();
        }
        archive.finish().unwrap();
        let draws = read(&path, &space()).unwrap();
        assert_eq!(draws.theta, array![[0.5, 2.0], [1.0, 3.0]]);
        assert_eq!(draws.features, draws.theta);
    }

    #[test]
    fn features_alone_are_written_in_three_forms() {
        let place = tempfile::tempdir().unwrap();
        let x = array![[0.1, 2.0], [-1e-9, 3.5]];
        let at = |name: &str| {
            let path = place.path().join(name);
            write_features(&path, &x).unwrap();
            path
        };
        let npy = std::fs::read(at("x.npy")).unwrap();
        let npy = super::npy::read(&mut &npy[..], npy.len() as u64).unwrap();
        let npz =
            Npz::new(File::open(at("x.npz")).unwrap()).and_then(|mut npz| npz.matrix("features"));
        assert_eq!((npy, npz), (x.clone(), Ok(x.clone())));
        let csv = std::fs::read_to_string(at("x.csv")).unwrap();
        assert_eq!(csv, "x1,x2\n0.1,2\n-0.000000001,3.5\n");
        assert!(write_features(&place.path().join("x.txt"), &x).is_err());
    }

    /// Checksums of shards rest on it: nothing but the numbers is in an archive.
    #[test]
    fn an_archive_is_a_function_of_its_rows() {
        let bytes = npz(&draws()).unwrap();
        assert_eq!(bytes, npz(&draws()).unwrap());
        // Zip's date of 1 January 1980, wherever a date stands.
        let header = bytes.windows(4).position(|w| w == b"PK\x03\x04").unwrap();
        assert_eq!(bytes[header + 10..header + 14], [0, 0, 0x21, 0]);
    }

    #[test]
    fn what_is_no_bank_is_said_with_the_remedy() {
        let place = tempfile::tempdir().unwrap();
        let refused = |name: &str, bytes: &[u8]| {
            let path = place.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let error = read(&path, &space()).unwrap_err().to_string();
            assert!(
                error.contains(name) && error.contains("give theta"),
                "{error}"
            );
            error
        };
        let whole = npz(&draws()).unwrap();
        refused("cut.npz", &whole[..whole.len() - 40]);
        refused("text.npz", b"a,b,x1");
        let wide = Draws {
            theta: array![[1.0]],
            features: array![[1.0]],
            redrawn: 0,
        };
        assert!(refused("wide.npz", &npz(&wide).unwrap()).contains("1 parameter,"));
        let short = Draws {
            features: array![[1.0]],
            ..draws()
        };
        assert!(refused("short.npz", &npz(&short).unwrap()).contains("1 of features"));
        let nan = Draws {
            features: array![[1.0], [f64::NAN]],
            ..draws()
        };
        assert!(refused("nan.npz", &npz(&nan).unwrap()).contains("row 2, column 1: NaN"));
        assert!(refused("header.csv", b"a,c,x1\n1,2,3\n").contains("a,b,x1"));
        assert!(refused("cell.csv", b"a,b,x1\n1,2,z\n").contains("\"z\" is no number"));
        assert!(
            refused("ragged.csv", b"a,b,x1\n1,2\n").contains("row 2: 2 cells, the header has 3")
        );
        let cut = refused("cut.csv", b"a,b,x1\n1,2,0.125\n1,2,0.1");
        assert!(cut.contains("row 3, the last one"), "{cut}");
    }
}
