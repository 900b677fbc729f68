//! The pretrained estimator.

use crate::estimator::bank::FeatureSimulator;
use crate::estimator::error::EstimatorError;
use crate::estimator::project::PresetName;
use crate::estimator::project::Project;
use crate::estimator::readout::{Calibration, Readout};
use crate::estimator::settings::Settings;
use crate::feature::{FeatureError, FeatureRecipe};
use crate::math::one_row;
use crate::network::{Architecture, Network, NetworkError};
use crate::record::Record;
use crate::study::Study;
use nalgebra::DVector;
use ndarray::Array2;
use std::sync::Arc;

/// A network that maps features to parameters, with everything needed to refine it on a record.
///
/// It is never modified: tuning on a record makes new heads.
#[derive(Clone)]
pub struct Estimator {
    pub(super) project: Project,
    pub(super) preset: PresetName,
    pub(super) settings: Settings,
    pub(super) recipe: Arc<dyn FeatureRecipe>,
    pub(super) architecture: Arc<dyn Architecture>,
    pub(crate) readout: Readout,
    pub(super) calibration: Calibration,
    pub(super) seed: u64,
}

impl std::fmt::Debug for Estimator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Estimator")
            .field("study", self.study())
            .field("preset", &self.preset)
            .field("recipe", &self.recipe)
            .field("architecture", &self.architecture.id())
            .field("seed", &self.seed)
            .finish_non_exhaustive()
    }
}

impl Estimator {
    /// The study it was trained for.
    pub fn study(&self) -> &Study {
        self.project.study()
    }

    /// The preset it was trained with.
    pub fn preset(&self) -> PresetName {
        self.preset
    }

    /// Every number it was trained with, and will refine with unless told otherwise.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The seed of bank and training.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The trained network.
    pub(crate) fn network(&self) -> &Arc<dyn Network> {
        &self.readout.network
    }

    /// Twin and features, with a call counter of its own.
    pub(crate) fn simulator(&self) -> Result<FeatureSimulator, FeatureError> {
        FeatureSimulator::new(self.study().twin().clone(), self.recipe.as_ref())
    }

    /// Checks that a record has the channels of the study, no missing output, and the study's step. Another step is taken where
    /// asked for, by features that are found anew for each: those about a reference.
    pub(crate) fn check_record(
        &self,
        record: &Record,
        step_of_record: bool,
    ) -> Result<(), EstimatorError> {
        let centre = self.study().twin().parameters().centre();
        if step_of_record && self.simulator()?.about(&centre).is_some() {
            return Ok(self.study().check_complete(record)?);
        }
        Ok(self.study().check_record(record)?)
    }

    /// Features of a record.
    pub fn observe(&self, record: &Record) -> Result<DVector<f64>, FeatureError> {
        self.simulator()?.observe(record)
    }

    /// Predictions (rows: samples, columns: parameters) from features, clipped to the physical bounds.
    pub fn predict(&self, features: &Array2<f64>) -> Result<Array2<f64>, NetworkError> {
        let mut theta = self.readout.predict(features)?;
        let bounds = self.study().twin().parameters().bounds();
        for (mut column, bounds) in theta.columns_mut().into_iter().zip(bounds) {
            column.mapv_inplace(|value| bounds.clamp(value));
        }
        Ok(theta)
    }

    /// θ_init from a record's features.
    pub fn predict_one(&self, features: &DVector<f64>) -> Result<Vec<f64>, NetworkError> {
        Ok(self.predict(&one_row(features.as_slice()))?.row(0).to_vec())
    }
}
