//! Fit of a record by its likelihood: noise levels that it shows, and the region where it puts θ.

use super::outcome::EstimateOptions;
use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::fit::{Fit, FitSettings, FittedNoise};
use crate::likelihood::{likelihood_of, with_levels};
use crate::progress::Progress;
use crate::record::Record;
use crate::study::{Study, StudyError};
use crate::twin::{Noise, Twin};
use std::collections::BTreeMap;

/// Fit of a record, and the twin in the noise that it shows.
pub(super) struct RecordFit {
    /// Parameters and noise levels together.
    pub fit: Fit,
    /// Levels that are surely not the declared ones.
    pub levels: Vec<FittedNoise>,
    /// The twin in these, else in the declared ones.
    pub twin: Twin,
    /// The twin for the tests, with levels drawn from the fit. In the declared ones a right record is rejected as soon as its own differ by
    /// more than the test can see: 26 of 100 where they do by up to a third.
    pub drawn: Twin,
}

impl RecordFit {
    /// Fits parameters and noise levels to the record; `None` where no fit is found, and for a black box, whose noise is its own, unless
    /// draws are asked for.
    pub fn new(
        study: &Study,
        record: &Record,
        options: &EstimateOptions,
        progress: &Progress,
    ) -> Result<Option<Self>, EstimatorError> {
        if likelihood_of(study.twin()).is_simulated() && options.draws == 0 {
            return Ok(None);
        }
        let settings = FitSettings {
            seed: options.seed,
            draws: options.draws,
            ..FitSettings::default()
        };
        let fit = match study.fit_asking(false, std::slice::from_ref(record), &settings, progress) {
            Ok(fit) => fit,
            Err(error @ StudyError::Cancelled(_)) => return Err(error.into()),
            // The estimate stands on features, which may exist where the likelihood does not.
            Err(_) => return Ok(None),
        };
        let in_levels = |draws: &[BTreeMap<String, f64>]| match draws.iter().all(BTreeMap::is_empty)
        {
            true => Ok(study.twin().clone()),
            false => with_levels(study.twin(), record, &study.beliefs(), draws)
                .map_err(|error| EstimatorError::from(StudyError::Adaptation(error))),
        };
        let levels: Vec<FittedNoise> = fit
            .noise
            .iter()
            .filter(|level| is_declared_off(level))
            .cloned()
            .collect();
        let off = levels.iter().map(|level| (level.name.clone(), level.value));
        // A fitted level where none is declared may be no more than a floor, and hides what an exact twin would show.
        let is_declared = |level: &&FittedNoise| level.declared.is_some() && level.value > 0.0;
        let declared: Vec<&FittedNoise> = fit.noise.iter().filter(is_declared).collect();
        let drawn = (0..BUDGET.level_draws).map(|draw| {
            let mut source = Noise::new(options.seed, "levels", draw).source("normal");
            let levels = declared.iter().map(|level| {
                let factor = (source.normal() * level.std_error / level.value).exp();
                (level.name.clone(), level.value * factor)
            });
            levels.collect()
        });
        let drawn: Vec<_> = drawn.collect();
        Ok(Some(Self {
            twin: in_levels(&[off.collect()])?,
            drawn: in_levels(&drawn)?,
            levels,
            fit,
        }))
    }
}

/// Returns whether a level is surely another than the declared one.
fn is_declared_off(level: &FittedNoise) -> bool {
    level
        .declared
        .is_some_and(|declared| is_off(level.value / declared, level.std_error / level.value))
}

/// Returns whether a ratio of levels is surely none of 1; `error` is the relative one.
pub(super) fn is_off(ratio: f64, error: f64) -> bool {
    let distance = ratio.ln().abs();
    distance > BUDGET.level_factor.ln() && distance > BUDGET.level_off * error
}
