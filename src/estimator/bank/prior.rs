//! Simulations from the prior of a study.

use super::{Draw, Draws, FeatureSimulator};
use crate::estimator::error::EstimatorError;
use crate::feature::FeatureRecipe;
use crate::progress::Stage;
use crate::study::{DriveSource, Study};
use crate::twin::{Noise, ParameterSpace};
use std::borrow::Cow;
use std::ops::Range;

/// Draws from a study's prior: θ uniform in the prior, each with noise and, where the study draws inputs, an input of its own.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section III.
pub struct Prior {
    simulator: FeatureSimulator,
    space: ParameterSpace,
    drives: DriveSource,
}

debug_by_name!(Prior);

impl Prior {
    /// Creates the prior of a study, seen through features.
    pub fn new(study: &Study, features: &dyn FeatureRecipe) -> Result<Self, EstimatorError> {
        study.check_estimated()?;
        Ok(Self {
            simulator: FeatureSimulator::new(study.twin().clone(), features)?,
            space: study.twin().parameters(),
            drives: study.drives()?,
        })
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.simulator.dim()
    }

    /// Rows `rows` of what `purpose` names: row i depends on (seed, purpose, i) alone.
    pub fn rows(
        &self,
        rows: Range<u64>,
        seed: u64,
        purpose: &str,
        stage: &Stage,
    ) -> Result<Draws, EstimatorError> {
        self.simulator.draws(
            rows,
            |i| Noise::new(seed, purpose, i),
            |_, _, noise| {
                let drive = (self.drives.draw(noise)).map_err(|error| {
                    EstimatorError::Bank(format!("the input cannot be made: {error}"))
                })?;
                Ok(Some(Draw {
                    theta: self.space.draw_prior(noise),
                    drive: Cow::Owned(drive),
                }))
            },
            stage,
        )
    }
}
