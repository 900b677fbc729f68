//! The time grid and the inputs of one experiment.

use crate::record::RecordError;
use ndarray::Array2;

/// Samples by channels: row k belongs to time k·Δt. A system without inputs has zero columns and N rows.
pub type Signal = Array2<f64>;

/// Step, length and inputs of one experiment, each input held over a step.
///
/// ```
/// use truetwin::record::Drive;
/// let free = Drive::autonomous(0.05, 300)?;
/// assert_eq!((free.samples(), free.inputs().ncols()), (300, 0));
/// # Ok::<(), truetwin::record::RecordError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    dt: f64,
    inputs: Signal,
}

impl Drive {
    /// A drive of step Δt = `dt` seconds with `inputs` (N × channels).
    pub fn new(dt: f64, inputs: Signal) -> Result<Self, RecordError> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(RecordError::Step(dt));
        }
        if inputs.nrows() == 0 {
            return Err(RecordError::Empty);
        }
        if let Some(((sample, channel), &value)) =
            inputs.indexed_iter().find(|(_, v)| !v.is_finite())
        {
            return Err(RecordError::NotFinite {
                kind: "input",
                channel: channel + 1,
                sample,
                value,
            });
        }
        // Rows are read as slices in the simulation loop.
        let inputs = if inputs.is_standard_layout() {
            inputs
        } else {
            inputs.as_standard_layout().into_owned()
        };
        Ok(Self { dt, inputs })
    }

    /// A drive without inputs, N = `samples`.
    pub fn autonomous(dt: f64, samples: usize) -> Result<Self, RecordError> {
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
        let error = |dt, samples| Drive::autonomous(dt, samples).unwrap_err();
        assert!(matches!(error(0.0, 3), RecordError::Step(0.0)));
        assert!(matches!(error(0.1, 0), RecordError::Empty));
        let mut inputs = Signal::zeros((3, 1));
        inputs[[1, 0]] = f64::NAN;
        let error = Drive::new(0.1, inputs).unwrap_err().to_string();
        assert!(error.starts_with("input 1, sample 1"), "{error}");
    }
}
