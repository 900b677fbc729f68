//! A twin seen through its features.

use crate::estimator::error::EstimatorError;
use crate::feature::{FeatureError, FeatureMap, FeatureRecipe};
use crate::record::{Drive, Record, Signal};
use crate::twin::{Noise, Twin};
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A twin seen through its features; counts every simulation, also those that the features make.
#[derive(Clone)]
pub struct FeatureSimulator {
    twin: Twin,
    calls: Arc<AtomicUsize>,
    map: Arc<dyn FeatureMap>,
}

debug_by_name!(FeatureSimulator);

impl FeatureSimulator {
    /// Couples a twin with features, which are bound to it here.
    pub fn new(twin: impl Into<Twin>, features: &dyn FeatureRecipe) -> Result<Self, FeatureError> {
        let calls = Arc::new(AtomicUsize::new(0));
        let twin = counted(&twin.into(), &calls);
        Ok(Self {
            map: features.bind(&twin)?,
            twin,
            calls,
        })
    }

    /// The simulator with another twin over the same θ and signals. Its features stay those of the first twin, unless they are given
    /// to be bound anew. Calls are counted together.
    pub(in crate::estimator) fn of(
        &self,
        twin: &Twin,
        features: Option<&dyn FeatureRecipe>,
    ) -> Result<Self, FeatureError> {
        let twin = counted(twin, &self.calls);
        Ok(Self {
            map: features.map_or_else(|| Ok(self.map.clone()), |features| features.bind(&twin))?,
            twin,
            calls: self.calls.clone(),
        })
    }

    /// The twin.
    pub fn twin(&self) -> &Twin {
        &self.twin
    }

    /// Number of features.
    pub fn dim(&self) -> usize {
        self.map.dim()
    }

    /// Simulator calls so far.
    pub fn calls(&self) -> usize {
        self.calls.load(Ordering::Relaxed)
    }

    /// Features of a record.
    pub fn observe(&self, record: &Record) -> Result<DVector<f64>, FeatureError> {
        record.check_complete()?;
        let features = self.map.extract(record.drive(), record.outputs())?;
        Ok(DVector::from_vec(features))
    }

    /// The simulator with its features about θ; `None` for features that have no reference. Calls are counted together.
    pub fn about(&self, theta: &[f64]) -> Option<Self> {
        Some(Self {
            twin: self.twin.clone(),
            calls: self.calls.clone(),
            map: self.map.about(theta)?,
        })
    }

    /// Number of simulations whose features are best found at once.
    pub fn at_once(&self) -> usize {
        self.map.at_once().max(1)
    }

    /// Features of simulations, each of which may be rejected.
    pub fn features(
        &self,
        all: &[(&[f64], &Drive, Noise)],
    ) -> Vec<Result<Vec<f64>, EstimatorError>> {
        let outputs: Vec<Result<Signal, EstimatorError>> = (all.iter())
            .map(|&(theta, drive, noise)| {
                (self.twin.simulate(theta, drive, noise)).map_err(|error| {
                    match error.costs_one_run() {
                        true => EstimatorError::Rejected(error.to_string()),
                        false => EstimatorError::Simulation(error),
                    }
                })
            })
            .collect();
        let simulated: Vec<(&Drive, &Signal)> = (all.iter().zip(&outputs))
            .filter_map(|((_, drive, _), outputs)| Some((*drive, outputs.as_ref().ok()?)))
            .collect();
        let mut features = self.map.extract_all(&simulated).into_iter();
        (outputs.into_iter())
            .map(|outputs| {
                outputs?;
                let missing = || EstimatorError::Rejected("the features are missing".into());
                features
                    .next()
                    .ok_or_else(missing)?
                    .map_err(refused)
                    .and_then(finite)
            })
            .collect()
    }

    /// Mean features over noise samples 0 … `seeds` − 1 of `noise`: the same draws at every θ (common random
    /// numbers), so that differences between parameters are not drowned by noise.
    pub fn mean_features(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: impl Fn(u64) -> Noise + Sync,
        seeds: usize,
    ) -> Result<DVector<f64>, EstimatorError> {
        let samples: Vec<u64> = (0..seeds as u64).collect();
        let runs: Vec<Vec<f64>> = (samples.par_chunks(self.at_once()))
            .flat_map_iter(|samples| {
                let all: Vec<_> = (samples.iter())
                    .map(|&sample| (theta, drive, noise(sample)))
                    .collect();
                self.features(&all)
            })
            .collect::<Result<_, _>>()?;
        // Summed in order: the same bits for any number of threads.
        let mut mean = DVector::zeros(self.dim());
        for run in runs {
            mean += DVector::from_vec(run);
        }
        Ok(mean / seeds as f64)
    }
}

/// Features that are not there for reasons of one simulation reject it.
fn refused(error: FeatureError) -> EstimatorError {
    let is_of_one = match &error {
        FeatureError::Constant { .. } | FeatureError::Regression(_) | FeatureError::Information => {
            true
        }
        FeatureError::Reference(error) => error.costs_one_run(),
        FeatureError::Filter(error) => error.is_recoverable(),
        _ => false,
    };
    match is_of_one {
        true => EstimatorError::Rejected(error.to_string()),
        false => EstimatorError::Feature(error),
    }
}

fn finite(features: Vec<f64>) -> Result<Vec<f64>, EstimatorError> {
    match features.iter().all(|v| v.is_finite()) {
        true => Ok(features),
        false => Err(EstimatorError::Rejected("features are not finite".into())),
    }
}

/// The twin with its runs counted.
fn counted(twin: &Twin, calls: &Arc<AtomicUsize>) -> Twin {
    let counter = calls.clone();
    twin.watched(move || {
        counter.fetch_add(1, Ordering::Relaxed);
        Ok(())
    })
}
