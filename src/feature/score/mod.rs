//! The gradient of a Kalman filter's likelihood as features.

mod posterior;

use super::{Centred, FeatureError, FeatureMap, FeatureRecipe};
use crate::likelihood::kalman::{
    Coordinates, FilterError, FilterSettings, Kalman, Score as Gradient,
};
use crate::record::{Drive, Record, Signal};
use crate::twin::{Noise, ParameterSpace, StateSpace, Twin};
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
/// step can be trusted. θ_ref is the prior's centre for training; around one record the features centre themselves on the
/// filter's posterior. Approximations of the filter cost information, not consistency: what x means for θ is
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
            return Err(FeatureError::Setting {
                kind: "score",
                problem:
                    "a black-box twin shows no equations to filter with; take ar, arx or armax"
                        .into(),
            });
        };
        let space = twin.parameters();
        Ok(Arc::new(Bound {
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
struct Bound {
    equations: Arc<dyn StateSpace>,
    space: ParameterSpace,
    coordinates: Coordinates,
    filter: FilterSettings,
    reference: Vec<f64>,
}

impl Bound {
    /// Runs `with` on the filter of a record.
    fn filtered<R>(
        &self,
        record: &Record,
        with: impl FnOnce(&Kalman<'_>) -> Result<R, FilterError>,
    ) -> Result<R, FilterError> {
        with(&Kalman::new(self.equations.as_ref(), record, &self.filter)?)
    }
}

impl FeatureMap for Bound {
    fn dim(&self) -> usize {
        2 * self.space.len() + 1
    }

    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        let (samples, needed) = (outputs.nrows(), 2 * self.dim() + 4);
        if samples < needed {
            return Err(FeatureError::TooShort { samples, needed });
        }
        super::check_varies(outputs)?;
        let record = Record::new(drive.clone(), outputs.clone())
            .map_err(|error| FeatureError::Filter(error.into()))?;
        let score = self.filtered(&record, |kalman| {
            Gradient::forward(kalman, &self.reference, &self.coordinates)
        })?;
        let d = self.space.len();
        let information = &score.fisher + DMatrix::identity(d, d) * 4.0;
        let step = (information.cholesky())
            .map(|factor| factor.solve(&score.gradient))
            .ok_or(FeatureError::Information)?;
        let spread = score.fisher.diagonal().map(|v| 0.5 * v.ln_1p());
        let fit = score.log_likelihood / (record.samples() as f64).sqrt();
        Ok(step.iter().chain(&spread).copied().chain([fit]).collect())
    }

    fn centred(
        &self,
        record: &Record,
        initial: &[f64],
        noise: Noise,
    ) -> Result<Option<Centred>, FeatureError> {
        let found = self.filtered(record, |kalman| {
            posterior::localise(kalman, &self.space, &self.coordinates, initial, noise)
        })?;
        Ok(found.map(|found| Centred {
            map: Arc::new(Self {
                reference: found.theta.clone(),
                ..self.clone()
            }),
            theta: found.theta,
            axes: found.axes,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feature::testing::Tank;

    fn bound() -> (Twin, Arc<dyn FeatureMap>) {
        let twin = Twin::new(Tank(1));
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

    /// The posterior is centred on the truth within its own spread: 40 records, standardised errors of unit size.
    #[test]
    fn the_posterior_is_calibrated() {
        let (twin, map) = bound();
        let records = 40u64;
        let squares: f64 = (0..records)
            .map(|seed| {
                let record = simulated(&twin, 0.8, seed);
                let noise = Noise::new(seed, "posterior", 0);
                let found = map.centred(&record, &[0.3], noise).unwrap().unwrap();
                ((found.theta[0] - 0.8) / found.axes[(0, 0)]).powi(2)
            })
            .sum();
        // χ² with 40 degrees of freedom: 40 ± 4·√80.
        assert!((10.0..80.0).contains(&squares), "{squares}");
    }
}
