//! The output's deviation from a reference run, in block means.

use super::{FeatureError, FeatureMap, FeatureRecipe, check_long, check_varies};
use crate::record::{Drive, Signal};
use crate::twin::Twin;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, PoisonError};

/// Block means of y − ŷ, where ŷ is the free run at the centre of the prior on the same input:
///
/// ```text
/// x_b = mean over block b of (y(t) − ŷ(t; θ_c)),   b = 1 … blocks, output after output
/// ```
///
/// Subtracting the reference takes the input's share out, so that one network serves records with any input.
/// Where the study's noise is that of the measurement alone, Gauss–Newton on these features is a least-squares fit
/// of the free run: it *tracks*, also when no parameters make the twin right, and it sees unknown starts.
/// File: `{ kind = "deviation", blocks = 64 }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// Number of blocks ≥ 1; their lengths differ by at most one sample.
    pub blocks: usize,
}

#[typetag::serde(name = "deviation")]
impl FeatureRecipe for Deviation {
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        if self.blocks == 0 {
            let problem = "blocks = 0; at least 1 is needed";
            return Err(FeatureError::setting("deviation", problem));
        }
        Ok(Arc::new(DeviationMap {
            blocks: self.blocks,
            outputs: twin.signals().outputs.len(),
            centre: twin.parameters().centre(),
            twin: twin.clone(),
            last: Mutex::new(None),
        }))
    }
}

struct DeviationMap {
    blocks: usize,
    outputs: usize,
    centre: Vec<f64>,
    twin: Twin,
    /// The reference run of the last drive: around one record the drive never changes.
    last: Mutex<Option<(Drive, Arc<Signal>)>>,
}

impl DeviationMap {
    /// ŷ under `drive`.
    fn reference(&self, drive: &Drive) -> Result<Arc<Signal>, FeatureError> {
        // A thread that panicked in here has left nothing half-done.
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, run)) = last().as_ref().filter(|(known, _)| known == drive) {
            return Ok(run.clone());
        }
        let run = Arc::new(self.twin.free_run(&self.centre, drive)?);
        *last() = Some((drive.clone(), run.clone()));
        Ok(run)
    }
}

impl FeatureMap for DeviationMap {
    fn dim(&self) -> usize {
        self.blocks * self.outputs
    }

    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        let samples = drive.samples();
        check_long(samples, self.blocks)?;
        check_varies(outputs)?;
        let deviation = outputs - self.reference(drive)?.as_ref();
        let edge = |b: usize| b * samples / self.blocks;
        let mut features = Vec::with_capacity(self.dim());
        for column in deviation.columns() {
            features.extend((0..self.blocks).map(|b| {
                let block = column.slice(ndarray::s![edge(b)..edge(b + 1)]);
                block.sum() / block.len() as f64
            }));
        }
        Ok(features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::testing::tank;
    use crate::twin::Noise;

    #[test]
    fn a_constant_offset_is_every_feature() {
        let twin = Twin::new(tank(1));
        let drive = Drive::new(0.5, Signal::from_elem((50, 1), 1.0)).unwrap();
        let map = Deviation { blocks: 7 }.bind(&twin).unwrap();
        let centre = twin.parameters().centre();
        let y = twin.simulate(&centre, &drive, Noise::OFF).unwrap() + 0.25;
        let features = map.extract(&drive, &y).unwrap();
        assert!(features.len() == 7 && features.iter().all(|x| (x - 0.25).abs() < 1e-12));
    }
}
