//! A twin seen through its features.

use crate::estimator::error::EstimatorError;
use crate::feature::{Centred, FeatureError, FeatureMap, FeatureRecipe};
use crate::record::{Drive, Record};
use crate::twin::{Noise, Twin};
use nalgebra::DVector;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A twin seen through its features; counts every simulation, also those that the features make.
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

    /// The simulator with its features centred on a record, and where the record puts θ; `None` for features that do not
    /// centre themselves. Calls are counted together.
    pub fn centred(
        &self,
        record: &Record,
        initial: &[f64],
        noise: Noise,
    ) -> Result<Option<(Self, Centred)>, FeatureError> {
        record.check_complete()?;
        let found = self.map.centred(record, initial, noise)?;
        Ok(found.map(|centred| {
            let simulator = Self {
                twin: self.twin.clone(),
                calls: self.calls.clone(),
                map: centred.map.clone(),
            };
            (simulator, centred)
        }))
    }

    /// Features of one simulation.
    pub fn features(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Vec<f64>, EstimatorError> {
        let outputs = match self.twin.simulate(theta, drive, noise) {
            Ok(outputs) => outputs,
            Err(error) if error.costs_one_run() => {
                return Err(EstimatorError::Rejected(error.to_string()));
            }
            Err(error) => return Err(EstimatorError::Simulation(error)),
        };
        let rejected = |text: String| Err(EstimatorError::Rejected(text));
        match self.map.extract(drive, &outputs) {
            Ok(features) if features.iter().all(|v| v.is_finite()) => Ok(features),
            Ok(_) => rejected("features are not finite".into()),
            Err(
                error @ (FeatureError::Constant { .. }
                | FeatureError::Regression(_)
                | FeatureError::Information),
            ) => rejected(error.to_string()),
            Err(FeatureError::Reference(error)) if error.costs_one_run() => {
                rejected(error.to_string())
            }
            Err(FeatureError::Filter(error)) if error.is_recoverable() => {
                rejected(error.to_string())
            }
            Err(error) => Err(EstimatorError::Feature(error)),
        }
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
        let runs: Vec<Vec<f64>> = (0..seeds as u64)
            .into_par_iter()
            .map(|sample| self.features(theta, drive, noise(sample)))
            .collect::<Result<_, _>>()?;
        // Summed in order: the same bits for any number of threads.
        let mut mean = DVector::zeros(self.dim());
        for run in runs {
            mean += DVector::from_vec(run);
        }
        Ok(mean / seeds as f64)
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
