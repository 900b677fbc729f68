//! A measured experiment.

use super::channels::{column_names, columns, names_in_brackets};
use super::drive::{check_sizes, check_values, signal};
use crate::math::six_digits;
use crate::record::{Drive, Quantity, RecordError, Signal, Signals, step_of};
use crate::setting::count;
use ndarray::{ArrayView2, s};
use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

/// Inputs and outputs measured on one time grid. An output that is NaN is missing: it was not measured.
///
/// ```
/// use truetwin::record::{Drive, Record, Signal};
/// let drive = Drive::new(0.5, Signal::ones((3, 1)))?;
/// let record = Record::new(drive, Signal::zeros((3, 1)))?;
/// assert_eq!(record.outputs().nrows(), 3);
/// assert!(record.is_complete());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Record {
    drive: Drive,
    /// Shared by copies.
    outputs: Arc<Signal>,
    /// Least variances of the outputs, once they were asked for: see [`cells`](Self::cells).
    cells: OnceLock<Vec<f64>>,
}

impl Record {
    /// A record of inputs under `drive` and outputs (N × channels), NaN where one is missing. Two rows need a value. A channel may have none
    /// where other records of the same system have it.
    pub fn new(drive: Drive, outputs: Signal) -> Result<Self, RecordError> {
        if outputs.nrows() != drive.samples() {
            return Err(RecordError::Lengths(format!(
                "{} of inputs and {} of outputs",
                count(drive.samples(), "row"),
                count(outputs.nrows(), "row")
            )));
        }
        if outputs.ncols() == 0 {
            return Err(RecordError::NoOutput);
        }
        check_values(&outputs, "output", f64::is_infinite)?;
        if outputs.iter().any(|v| v.is_nan()) {
            let measured = |v: &f64| !v.is_nan();
            let mut rows = outputs.rows().into_iter();
            let full = rows.by_ref().filter(|row| row.iter().any(measured)).take(2);
            let full = full.count();
            if full < 2 {
                return Err(RecordError::TooFewValues(full));
            }
        }
        let outputs = match outputs.is_standard_layout() {
            true => outputs,
            false => outputs.as_standard_layout().into_owned(),
        };
        Ok(Self {
            drive,
            outputs: Arc::new(outputs),
            cells: OnceLock::new(),
        })
    }

    /// A record of one step `dt` in seconds from arrays, samples by channels; they are copied.
    ///
    /// ```
    /// use ndarray::array;
    /// use truetwin::record::Record;
    ///
    /// let (u, y) = (array![[1.0], [2.0], [2.0]], array![[0.0, 4.1], [0.5, 4.0], [0.9, f64::NAN]]);
    /// let record = Record::from_views(0.1, u.view(), y.view())?;
    /// assert_eq!(record, Record::from_slices(0.1, &[[1.0, 2.0, 2.0]], &[[0.0, 0.5, 0.9], [4.1, 4.0, f64::NAN]])?);
    /// # Ok::<(), truetwin::record::RecordError>(())
    /// ```
    pub fn from_views(
        dt: f64,
        inputs: ArrayView2<'_, f64>,
        outputs: ArrayView2<'_, f64>,
    ) -> Result<Self, RecordError> {
        Self::new(Drive::new(dt, inputs.to_owned())?, outputs.to_owned())
    }

    /// A record of one step `dt` in seconds from one slice a channel. Of a system without inputs: [`Drive::autonomous`].
    pub fn from_slices(
        dt: f64,
        inputs: &[impl AsRef<[f64]>],
        outputs: &[impl AsRef<[f64]>],
    ) -> Result<Self, RecordError> {
        Self::new(Drive::from_slices(dt, inputs)?, signal(outputs)?)
    }

    /// As [`new`](Self::new), of simulated outputs, none of which may be missing.
    pub(crate) fn complete(drive: Drive, outputs: Signal) -> Result<Self, RecordError> {
        check_values(&outputs, "output", |v| !v.is_finite())?;
        Self::new(drive, outputs)
    }

    /// Time grid and inputs.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Outputs, N × channels.
    pub fn outputs(&self) -> &Signal {
        &self.outputs
    }

    /// Outputs row by row.
    pub(crate) fn values(&self) -> &[f64] {
        // Rows lie one behind the other, by `new`.
        self.outputs.as_slice().unwrap_or_default()
    }

    /// Least variance of each output with which no density is above one per cell of what the values are rounded to: q²/2π, 0 where they are
    /// not rounded.
    pub(crate) fn cells(&self) -> &[f64] {
        self.cells.get_or_init(|| {
            let columns = self.outputs.columns().into_iter();
            columns
                .map(|y| step_of(&y.to_vec()).map_or(0.0, |q| q * q / TAU))
                .collect()
        })
    }

    /// Number of samples N.
    pub fn samples(&self) -> usize {
        self.drive.samples()
    }

    /// Returns `true` if no output is missing.
    pub fn is_complete(&self) -> bool {
        self.missing() == 0
    }

    /// Number of missing outputs, over all rows and channels.
    pub fn missing(&self) -> usize {
        self.outputs.iter().filter(|v| v.is_nan()).count()
    }

    /// Returns whether output j has a value.
    pub(crate) fn has_output(&self, j: usize) -> bool {
        self.outputs.column(j).iter().any(|v| !v.is_nan())
    }

    /// Checks that each of these outputs has a value in one of the records at least.
    pub(crate) fn check_outputs(records: &[Self], outputs: &[Quantity]) -> Result<(), RecordError> {
        let is_missing = |j: &usize| !records.iter().any(|record| record.has_output(*j));
        match (0..outputs.len()).find(is_missing) {
            None => Ok(()),
            Some(j) => Err(RecordError::NoValue(outputs[j].name.clone())),
        }
    }

    /// Number of rows with an output that is not missing.
    pub(crate) fn measured_rows(&self) -> usize {
        let rows = self.outputs.rows().into_iter();
        rows.filter(|row| row.iter().any(|v| !v.is_nan())).count()
    }

    /// Checks that no output is missing and all steps are the same, as features need it.
    ///
    /// # Errors
    ///
    /// [`RecordError::Incomplete`], which names the first place; [`RecordError::Uneven`], which names the oddest step.
    pub fn check_complete(&self) -> Result<(), RecordError> {
        self.check_complete_at(six_digits(self.drive.dt()))
    }

    /// As [`check_complete`](Self::check_complete), for features that need this step.
    pub(crate) fn check_complete_at(&self, expected: f64) -> Result<(), RecordError> {
        let mut cells = self.outputs.indexed_iter();
        if let Some(((k, j), _)) = cells.find(|(_, v)| v.is_nan()) {
            let rows = self.drive.rows();
            let usual = || column_names("y", self.outputs.ncols()).swap_remove(j);
            return Err(RecordError::Incomplete {
                row: rows.line(k),
                column: rows.column(1 + self.drive.inputs().ncols() + j, usual),
            });
        }
        (self.drive.oddest_step(expected)).map_or(Ok(()), |k| {
            Err(RecordError::Uneven {
                row: self.drive.rows().line(k + 1),
                column: self.drive.rows().column(0, || "t".into()),
                given: six_digits(self.drive.step(k)),
                expected,
            })
        })
    }

    /// The first samples; `None` where an output of the record has no value in them.
    pub(crate) fn first_part(&self, samples: usize) -> Option<Self> {
        let drive = self.drive.first(samples);
        let outputs = self.outputs.slice(s![..samples, ..]).to_owned();
        let part = Self::new(drive, outputs).ok()?;
        let mut all = 0..self.outputs.ncols();
        all.all(|j| part.has_output(j) == self.has_output(j))
            .then_some(part)
    }

    /// The same cells of other outputs emptied, as many rows and channels.
    pub(crate) fn with_gaps_in(&self, mut outputs: Signal) -> Signal {
        if outputs.dim() == self.outputs.dim() {
            for (to, own) in outputs.iter_mut().zip(self.outputs.iter()) {
                if own.is_nan() {
                    *to = f64::NAN;
                }
            }
        }
        outputs
    }

    /// Checks that a twin with these channels can be compared with the record, and that its numbers can be computed with: the largest value
    /// of a channel lies between 1e-100 and 1e100, or is 0.
    pub fn check_channels(&self, signals: &Signals) -> Result<(), RecordError> {
        let (inputs, outputs) = (signals.inputs.len(), signals.outputs.len());
        let own = (self.drive.inputs().ncols(), self.outputs.ncols());
        let (kind, letter, given, expected) = match own {
            (given, _) if given != inputs => ("input", "u", given, inputs),
            (_, given) if given != outputs => ("output", "y", given, outputs),
            _ => {
                check_sizes(self.drive.inputs(), "input", &signals.inputs)?;
                return check_sizes(&self.outputs, "output", &signals.outputs);
            }
        };
        let columns = columns(inputs, outputs).join(",");
        Err(RecordError::Channels {
            kind,
            given,
            expected,
            names: names_in_brackets(letter, expected),
            twin: format!("the twin takes the columns {columns}"),
        })
    }
}

/// Missing outputs are equal.
impl PartialEq for Record {
    fn eq(&self, other: &Self) -> bool {
        self.drive == other.drive
            && self.outputs.dim() == other.outputs.dim()
            && (self.outputs.iter().zip(other.outputs.iter()))
                .all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_named() {
        let drive = Drive::autonomous(0.1, 3).unwrap();
        assert!(matches!(
            Record::new(drive.clone(), Signal::zeros((2, 1))),
            Err(RecordError::Lengths { .. })
        ));
        let mut outputs = Signal::zeros((3, 2));
        outputs[[2, 1]] = f64::INFINITY;
        let error = Record::new(drive.clone(), outputs).unwrap_err().to_string();
        assert_eq!(error, "output 2, sample 2 is inf; outputs must be finite");
        let record = Record::new(drive, Signal::zeros((3, 1))).unwrap();
        let error = record.check_channels(&Signals::default()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("0 inputs, the twin has 1 (u)"), "{text}");
        let named = error.of_twin("tanks").to_string();
        let expected = "tanks takes the columns t,u,y: choose the twin";
        assert!(named.contains(expected), "{named}");
    }
    #[test]
    fn outputs_may_be_missing() {
        let nan = f64::NAN;
        let record = |outputs: [f64; 6]| {
            let outputs = Signal::from_shape_vec((3, 2), outputs.to_vec()).unwrap();
            Record::new(Drive::autonomous(0.1, 3).unwrap(), outputs)
        };
        let some = record([1.0, nan, nan, nan, 3.0, 4.0]).unwrap();
        assert!(!some.is_complete());
        assert_eq!(some.missing(), 3);
        assert_eq!(some, some.clone());
        assert_ne!(some, record([1.0, 2.0, nan, nan, 3.0, 4.0]).unwrap());
        let emptied = some.with_gaps_in(Signal::ones((3, 2)));
        assert_eq!(
            Record::new(some.drive().clone(), emptied)
                .unwrap()
                .missing(),
            3
        );
        let refused = some.check_complete().unwrap_err().to_string();
        assert!(
            refused.starts_with("row 2, column y2 is missing;"),
            "{refused}"
        );
        let times = [0.0, 0.1, 0.2, 0.5];
        let uneven = Drive::with_times(&times, Signal::zeros((4, 0))).unwrap();
        let uneven = Record::new(uneven, Signal::zeros((4, 1))).unwrap();
        let refused = uneven.check_complete().unwrap_err().to_string();
        let expected = "row 5, column t: a step of 0.3 s in place of 0.1 s;";
        assert!(refused.starts_with(expected), "{refused}");
        let message = |outputs| record(outputs).unwrap_err().to_string();
        let one = record([1.0, nan, 2.0, nan, 3.0, nan]).unwrap();
        assert!(one.has_output(0) && !one.has_output(1));
        let outputs = ["level", "flow"].map(|name| Quantity::new(name, ""));
        let both = [one.clone(), some.clone()];
        assert!(Record::check_outputs(&both, &outputs).is_ok());
        let refused = Record::check_outputs(&both[..1], &outputs).unwrap_err();
        let refused = refused.to_string();
        assert!(
            refused.starts_with("output flow has no value in any"),
            "{refused}"
        );
        assert!(one.first_part(2).is_some() && some.first_part(2).is_none());
        let few = message([1.0, 2.0, nan, nan, nan, nan]);
        assert!(few.starts_with("1 row with a measured output;"), "{few}");
    }
}
