//! Outputs predicted from the rows before.

use super::pass::{Innovation, Sink};
use super::{FilterError, Kalman};
use crate::record::Signal;

struct Predictions(Signal);

impl Sink for Predictions {
    fn innovation(&mut self, k: usize, of: &Innovation<'_>) {
        for (to, value) in self.0.row_mut(k).iter_mut().zip(of.predicted) {
            *to = *value;
        }
    }
}

impl Kalman<'_> {
    /// Each output as predicted from the rows before it, N × p. Over rows that are missing, the prediction reaches as far ahead as they
    /// last.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Kalman::log_likelihood).
    pub(crate) fn predictions(&self, theta: &[f64]) -> Result<Signal, FilterError> {
        let shape = self.record.outputs().dim();
        let mut predictions = Predictions(Signal::zeros(shape));
        self.run(theta, &mut predictions)?;
        Ok(predictions.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::kalman::FilterSettings;
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Noise};
    use crate::twins::CascadedTanks;

    #[test]
    fn predictions_are_outputs_less_innovations_and_reach_over_gaps() {
        let drive = Drive::new(0.5, Signal::from_elem((200, 1), 1.5)).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let noise = Noise::new(1, "ahead", 0);
        let outputs = CascadedTanks.simulate(&theta, &drive, noise).unwrap();
        let settings = FilterSettings::default();
        let predicted = |outputs: &Signal| {
            let record = Record::new(drive.clone(), outputs.clone()).unwrap();
            let kalman = Kalman::new(&CascadedTanks, &record, &settings).unwrap();
            (
                kalman.predictions(&theta).unwrap(),
                kalman.filter(&theta).unwrap(),
            )
        };
        let (all, filtered) = predicted(&outputs);
        assert!(
            (&(&all + &filtered.innovations) - &outputs)
                .iter()
                .all(|d| d.abs() < 1e-12)
        );
        let mut gappy = outputs.clone();
        gappy.slice_mut(ndarray::s![100..120, ..]).fill(f64::NAN);
        let (ahead, _) = predicted(&gappy);
        assert!(ahead.iter().all(|v| v.is_finite()));
        assert_eq!(
            ahead[[100, 0]],
            all[[100, 0]],
            "row 100 is one step ahead in both"
        );
        assert_ne!(ahead[[119, 0]], all[[119, 0]]);
    }
}
