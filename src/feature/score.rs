//! The gradient of a Kalman filter's likelihood as features.

use super::{FeatureError, FeatureMap, FeatureRecipe, check_long, check_varies};
use crate::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Score as Gradient};
use crate::math::LANES;
use crate::record::{Drive, Record, Signal};
use crate::twin::{Composed, ParameterSpace, Twin};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Fisher-score features of a twin with equations: with the gradient s and the Fisher information F of a Kalman
/// filter's log-likelihood at a reference θ_ref, in the filter's coordinates φ,
///
/// ```text
/// x = ( (F + 4·I)⁻¹ s,  ½ log(1 + diag F),  log p/√N ),   2·d + 1 numbers
/// ```
///
/// The first part is a Newton step from θ_ref, which keeps nearly all information on θ near θ_ref; the rest tells how far the
/// step can be trusted. θ_ref is the prior's centre for training; for one record, an estimate takes them about the mean of its
/// fit's posterior. Approximations of the filter cost information, not consistency: what x means for θ is
/// learnt from simulations. File: `{ kind = "score" }`.
///
/// Source: Alsing & Wandelt, "Generalized massive optimal data compression", MNRAS 476 (2018).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Score {
    /// Settings of the filter.
    pub filter: FilterSettings,
}

#[typetag::serde(name = "score")]
impl FeatureRecipe for Score {
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        let Twin::Equations(equations) = twin else {
            let problem =
                "a black-box twin shows no equations to filter with; take ar, arx or armax";
            return Err(FeatureError::setting("score", problem));
        };
        let space = twin.parameters();
        Ok(Arc::new(ScoreMap {
            reference: space.centre(),
            coordinates: Coordinates::new(&space),
            filter: self.filter.clone(),
            equations: equations.clone(),
            space,
        }))
    }
}

/// Score features at one reference.
#[derive(Clone)]
struct ScoreMap {
    equations: Composed,
    space: ParameterSpace,
    coordinates: Coordinates,
    filter: FilterSettings,
    reference: Vec<f64>,
}

impl ScoreMap {
    fn record(&self, drive: &Drive, outputs: &Signal) -> Result<Record, FeatureError> {
        check_long(outputs.nrows(), 2 * self.dim() + 4)?;
        check_varies(outputs)?;
        Record::new(drive.clone(), outputs.clone())
            .map_err(|error| FeatureError::Filter(error.into()))
    }

    fn features(&self, record: &Record, score: &Gradient) -> Result<Vec<f64>, FeatureError> {
        let d = self.space.len();
        let information = &score.fisher + DMatrix::identity(d, d) * 4.0;
        let step = (information.cholesky())
            .map(|factor| factor.solve(&score.gradient))
            .ok_or(FeatureError::Information)?;
        let spread = score.fisher.diagonal().map(|v| 0.5 * v.ln_1p());
        let fit = score.log_likelihood / (record.samples() as f64).sqrt();
        Ok(step.iter().chain(&spread).copied().chain([fit]).collect())
    }
}

impl FeatureMap for ScoreMap {
    fn dim(&self) -> usize {
        2 * self.space.len() + 1
    }

    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        let record = self.record(drive, outputs)?;
        let kalman = Kalman::new(&self.equations, &record, &self.filter)?;
        let score = Gradient::forward(&kalman, &self.reference, &self.coordinates)?;
        self.features(&record, &score)
    }

    fn extract_all(&self, all: &[(&Drive, &Signal)]) -> Vec<Result<Vec<f64>, FeatureError>> {
        let records: Vec<_> = (all.iter())
            .map(|(drive, outputs)| self.record(drive, outputs))
            .collect();
        let kalmans: Result<Vec<Kalman<'_>>, _> = (records.iter().flatten())
            .map(|record| Kalman::new(&self.equations, record, &self.filter))
            .collect();
        let Ok(kalmans) = kalmans else {
            let each = |(drive, outputs): &(&Drive, &Signal)| self.extract(drive, outputs);
            return all.iter().map(each).collect();
        };
        let scores = Gradient::forward_all(&kalmans, &self.reference, &self.coordinates);
        drop(kalmans);
        let mut scores = scores.into_iter();
        (records.into_iter())
            .map(|record| {
                let record = record?;
                let score = scores.next().ok_or(FeatureError::Information)??;
                self.features(&record, &score)
            })
            .collect()
    }

    fn at_once(&self) -> usize {
        LANES
    }

    fn about(&self, theta: &[f64]) -> Option<Arc<dyn FeatureMap>> {
        Some(Arc::new(Self {
            reference: theta.to_vec(),
            ..self.clone()
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::testing::tank;
    use crate::twin::Noise;

    fn bound() -> (Twin, Arc<dyn FeatureMap>) {
        let twin = Twin::new(tank(1));
        let map = Score::default().bind(&twin).unwrap();
        (twin, map)
    }

    fn simulated(twin: &Twin, k: f64, seed: u64) -> Record {
        let drive = Drive::new(0.1, Signal::from_elem((200, 1), 1.0)).unwrap();
        let outputs = twin
            .simulate(&[k], &drive, Noise::new(seed, "t", 0))
            .unwrap();
        Record::new(drive, outputs).unwrap()
    }

    /// The Newton step points to the truth, from either side.
    #[test]
    fn the_first_feature_is_a_step_towards_the_truth() {
        let (twin, map) = bound();
        for (k, sign) in [(0.45, -1.0), (0.65, 1.0)] {
            let record = simulated(&twin, k, 1);
            let x = map.extract(record.drive(), record.outputs()).unwrap();
            assert_eq!(x.len(), 3);
            assert!(x[0] * sign > 0.0, "{k}: {x:?}");
        }
    }
}
