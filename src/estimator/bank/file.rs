//! Rows of parameters and features in files: NumPy's `.npz` and CSV.
//!
//! | form | holds | opened by |
//! |---|---|---|
//! | `.npz` | arrays `theta` (M × d) and `features` (M × n), f64, not compressed | `numpy.load` |
//! | `.csv` | a column for each parameter, by name, then `x1` … `xn` | anything |
//!
//! Both keep every bit. The same draws give the same bytes: an archive carries no time.

use super::draws::Draws;
use super::npy::{self, Npz, archive};
use crate::estimator::error::EstimatorError;
use crate::storage::files::write_new;
use crate::storage::untrusted::{MOST_NUMBERS, Rows, excerpt};
use ndarray::Array2;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

/// Remedy for a file from elsewhere.
const GIVE: &str = "give theta (rows × parameters) and features (rows × features), one simulation a row, all finite";

enum Form {
    Npz,
    Csv,
}

fn other_form(path: &Path) -> EstimatorError {
    let problem =
        "banks are written and read as .npz or .csv, features also as .npy; choose such a name";
    EstimatorError::file(path, problem)
}

fn form(path: &Path) -> Result<Form, EstimatorError> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("npz") => Ok(Form::Npz),
        Some("csv") => Ok(Form::Csv),
        _ => Err(other_form(path)),
    }
}

/// Writes a new file of features alone, one record a row: `.npy`, `.npz` (array `features`) or `.csv` (`x1` … `xn`).
pub(crate) fn write_features(path: &Path, features: &Array2<f64>) -> Result<(), EstimatorError> {
    let bytes = match path.extension().and_then(|e| e.to_str()) {
        Some("npy") => {
            let mut bytes = Vec::new();
            npy::write(features, &mut bytes).map(|()| bytes)
        }
        Some("npz") => archive(&[("features", features)]),
        Some("csv") => csv_text(&features_alone(features), &[]),
        _ => return Err(other_form(path)),
    };
    bytes
        .and_then(|bytes| write_new(path, &bytes))
        .map_err(|error| EstimatorError::io(path, error))
}

/// The CSV text of [`write_features`].
pub(crate) fn features_csv_text(features: &Array2<f64>) -> io::Result<String> {
    let bytes = csv_text(&features_alone(features), &[])?;
    String::from_utf8(bytes).map_err(io::Error::other)
}

fn features_alone(features: &Array2<f64>) -> Draws {
    Draws {
        theta: Array2::zeros((features.nrows(), 0)),
        features: features.clone(),
        redrawn: 0,
    }
}

/// Returns whether a path has the name of a file of rows.
pub(crate) fn is_named(path: &Path) -> bool {
    form(path).is_ok()
}

/// Writes a new file in the form that its name ends with; `names` are the parameters'.
pub fn write(path: &Path, draws: &Draws, names: &[&str]) -> Result<(), EstimatorError> {
    let bytes = match form(path)? {
        Form::Npz => npz(draws),
        Form::Csv => csv_text(draws, names),
    };
    bytes
        .and_then(|bytes| write_new(path, &bytes))
        .map_err(|error| EstimatorError::io(path, error))
}

/// Writes a new `.npz` archive of these matrices.
pub(crate) fn write_matrices(
    path: &Path,
    matrices: &[(&str, &Array2<f64>)],
) -> Result<(), EstimatorError> {
    archive(matrices)
        .and_then(|bytes| write_new(path, &bytes))
        .map_err(|error| EstimatorError::io(path, error))
}

/// Reads a file in the form that its name ends with, of a twin with these parameters.
pub fn read(path: &Path, names: &[&str]) -> Result<Draws, EstimatorError> {
    let form = form(path)?;
    let file = File::open(path).map_err(|error| EstimatorError::io(path, error))?;
    let wrong = |reason: String| EstimatorError::no_bank(path, &reason, GIVE);
    let draws = match form {
        Form::Npz => from_npz(io::BufReader::new(file)).map_err(wrong)?,
        Form::Csv => from_csv(file, names).map_err(wrong)?,
    };
    check(&draws, names.len()).map_err(wrong)?;
    Ok(draws)
}

/// Checks whether the rows are whole, finite, and of so many parameters.
pub(crate) fn check(draws: &Draws, parameters: usize) -> Result<(), String> {
    let (theta, features) = (&draws.theta, &draws.features);
    if theta.ncols() != parameters {
        return Err(format!(
            "{} parameters, the twin has {parameters}",
            theta.ncols()
        ));
    }
    if theta.nrows() != features.nrows() {
        return Err(format!(
            "{} rows of theta, {} of features",
            theta.nrows(),
            features.nrows()
        ));
    }
    for (what, matrix) in [("theta", theta), ("features", features)] {
        if let Some(((row, column), value)) = matrix.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(format!("{what}, row {row}, column {column}: {value}"));
        }
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

fn csv_text(draws: &Draws, names: &[&str]) -> io::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    let features = (1..=draws.features.ncols()).map(|j| format!("x{j}"));
    csv.write_record(names.iter().map(|name| (*name).to_owned()).chain(features))?;
    for (theta, features) in draws.theta.rows().into_iter().zip(draws.features.rows()) {
        csv.write_record(theta.iter().chain(features).map(f64::to_string))?;
    }
    csv.into_inner().map_err(|error| error.into_error())
}

fn from_csv(file: impl Read, names: &[&str]) -> Result<Draws, String> {
    let mut csv = Rows::new(file);
    let header = csv.header().map_err(|error| error.to_string())?;
    let d = names.len();
    let n = header.len().saturating_sub(d);
    let features = (1..=n).map(|j| format!("x{j}"));
    if n == 0
        || !header
            .iter()
            .eq(names.iter().map(|name| (*name).to_owned()).chain(features))
    {
        return Err(format!("the header is not {},x1,x2,…", names.join(",")));
    }
    let (mut theta, mut rest, mut rows) = (Vec::new(), Vec::new(), 0);
    let mut cells = csv::StringRecord::new();
    while csv.read(&mut cells).map_err(|error| error.to_string())? {
        if (rows + 1) * (d + n) > MOST_NUMBERS {
            return Err(format!(
                "more than {MOST_NUMBERS} numbers; keep such a bank in shards"
            ));
        }
        for (column, cell) in cells.iter().enumerate() {
            let value: f64 = (cell.parse()).map_err(|_| {
                format!(
                    "row {rows}, column {column}: \"{}\" is no number",
                    excerpt(cell)
                )
            })?;
            match column < d {
                true => theta.push(value),
                false => rest.push(value),
            }
        }
        rows += 1;
    }
    let matrix = |width, values| Array2::from_shape_vec((rows, width), values);
    Ok(Draws {
        theta: matrix(d, theta).map_err(|error| error.to_string())?,
        features: matrix(n, rest).map_err(|error| error.to_string())?,
        redrawn: 0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    fn draws() -> Draws {
        Draws {
            theta: array![[0.1 + 0.2, 1e-300], [f64::MAX, -0.0]],
            features: array![[1.0 / 3.0], [std::f64::consts::PI]],
            redrawn: 0,
        }
    }

    const NAMES: [&str; 2] = ["a", "b"];

    #[test]
    fn every_bit_comes_back_from_both_forms() {
        let place = tempfile::tempdir().unwrap();
        for name in ["bank.npz", "bank.csv"] {
            let path = place.path().join(name);
            write(&path, &draws(), &NAMES).unwrap();
            assert_eq!(read(&path, &NAMES).unwrap(), draws(), "{name}");
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
        let draws = read(&path, &NAMES).unwrap();
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
            let error = read(&path, &NAMES).unwrap_err().to_string();
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
        assert!(refused("wide.npz", &npz(&wide).unwrap()).contains("1 parameters"));
        let short = Draws {
            features: array![[1.0]],
            ..draws()
        };
        assert!(refused("short.npz", &npz(&short).unwrap()).contains("1 of features"));
        let nan = Draws {
            features: array![[1.0], [f64::NAN]],
            ..draws()
        };
        assert!(refused("nan.npz", &npz(&nan).unwrap()).contains("row 1, column 0: NaN"));
        assert!(refused("header.csv", b"a,c,x1\n1,2,3\n").contains("a,b,x1"));
        assert!(refused("cell.csv", b"a,b,x1\n1,2,z\n").contains("\"z\" is no number"));
        assert!(refused("ragged.csv", b"a,b,x1\n1,2\n").contains("2 fields"));
    }
}
