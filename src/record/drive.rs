//! The time grid and the inputs of one experiment.

use ndarray::Array2;

/// Samples by channels: row k belongs to time k·Δt. A system without inputs has zero columns and N rows.
pub type Signal = Array2<f64>;

/// What drives a twin: step, length and inputs, each input held over a step.
///
/// ```
/// use truetwin::record::Drive;
/// let free = Drive::autonomous(0.05, 300)?;
/// assert_eq!((free.samples(), free.inputs().ncols()), (300, 0));
/// # Ok::<(), truetwin::record::DriveError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    dt: f64,
    inputs: Signal,
}

/// Why there is no such drive.
///
/// ```
/// use truetwin::record::{Drive, DriveError};
///
/// let error: DriveError = Drive::autonomous(-0.1, 20).unwrap_err();
/// assert!(error.to_string().contains("-0.1"), "{error}");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// A step that is no positive number.
    #[error("step = {0} s; the step must be a positive number of seconds")]
    Step(f64),
    /// No sample at all.
    #[error("no samples; at least one is needed")]
    Empty,
    /// An input that is NaN or infinite.
    #[error("input {channel}, sample {sample} is {value}; inputs must be finite")]
    NotFinite {
        /// Channel, from 1.
        channel: usize,
        /// Sample, from 0.
        sample: usize,
        /// The value.
        value: f64,
    },
}

impl Drive {
    /// Step Δt in seconds, and inputs (N × channels).
    pub fn new(dt: f64, inputs: Signal) -> Result<Self, DriveError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(DriveError::Step(dt));
        }
        if inputs.nrows() == 0 {
            return Err(DriveError::Empty);
        }
        if let Some(((sample, channel), &value)) =
            inputs.indexed_iter().find(|(_, v)| !v.is_finite())
        {
            return Err(DriveError::NotFinite {
                channel: channel + 1,
                sample,
                value,
            });
        }
        // Rows are read as slices in the simulation loop.
        let inputs = match inputs.is_standard_layout() {
            true => inputs,
            false => inputs.as_standard_layout().into_owned(),
        };
        Ok(Self { dt, inputs })
    }

    /// Without inputs, N = `samples`.
    pub fn autonomous(dt: f64, samples: usize) -> Result<Self, DriveError> {
        Self::new(dt, Signal::zeros((samples, 0)))
    }

    /// Step Δt in seconds.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of samples N.
    pub fn samples(&self) -> usize {
        self.inputs.nrows()
    }

    /// Inputs, N × channels, in row-major order.
    pub fn inputs(&self) -> &Signal {
        &self.inputs
    }

    /// Time of sample k, in seconds from the first.
    pub fn time(&self, k: usize) -> f64 {
        k as f64 * self.dt
    }

    /// The inputs at sample k.
    pub fn input(&self, k: usize) -> &[f64] {
        let m = self.inputs.ncols();
        // Row-major by construction.
        self.inputs
            .as_slice()
            .map_or(&[], |all| &all[k * m..(k + 1) * m])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_slices_whatever_the_layout_was() {
        let inputs = Signal::from_shape_fn((3, 2), |(k, j)| (10 * k + j) as f64);
        let columns_first = inputs.t().as_standard_layout().into_owned().reversed_axes();
        let drive = Drive::new(0.1, columns_first).unwrap();
        assert_eq!(drive.input(2), [20.0, 21.0]);
    }

    #[test]
    fn bad_drives_are_refused() {
        assert_eq!(Drive::autonomous(0.0, 3), Err(DriveError::Step(0.0)));
        assert_eq!(Drive::autonomous(0.1, 0), Err(DriveError::Empty));
        let mut inputs = Signal::zeros((3, 1));
        inputs[[1, 0]] = f64::NAN;
        let error = Drive::new(0.1, inputs).unwrap_err().to_string();
        assert!(error.starts_with("input 1, sample 1"), "{error}");
    }
}
