//! Noise that the record shows, where it is not what the twin declares.

use super::outcome::EstimateOptions;
use crate::estimator::error::EstimatorError;
use crate::fit::{Fit, FitSettings, FittedNoise};
use crate::likelihood::{likelihood_of, with_levels};
use crate::progress::Progress;
use crate::record::Record;
use crate::study::{Study, StudyError};
use crate::twin::Twin;
use std::collections::BTreeMap;

/// Standard errors of ln σ that a fitted level lies off the declared one before it takes its place: by chance in 3 of 1000. At two of
/// them every twentieth level of a right twin would; at six a sensor twice as loud as declared goes unseen in 50 samples.
const OFF: f64 = 3.0;
/// Least factor between the two: less changes no interval by more than a fifth, however sure it is.
const FACTOR: f64 = 1.2;

/// A fit of the record, and the twin in the noise that it shows.
pub(super) struct Shown {
    /// Parameters and noise levels together.
    pub fit: Fit,
    /// The twin in this noise.
    pub twin: Twin,
    /// Levels that are not the declared ones; with none the twin is the study's.
    pub levels: Vec<FittedNoise>,
}

/// Fits parameters and noise levels to the record; `None` where no fit is found, and for a black box, whose noise is its own, unless
/// draws are asked for.
pub(super) fn shown(
    study: &Study,
    record: &Record,
    options: &EstimateOptions,
    progress: &Progress,
) -> Result<Option<Shown>, EstimatorError> {
    if likelihood_of(study.twin()).is_simulated() && options.draws == 0 {
        return Ok(None);
    }
    let settings = FitSettings {
        seed: options.seed,
        draws: options.draws,
        ..FitSettings::default()
    };
    let fit = match study.fit(std::slice::from_ref(record), &settings, progress) {
        Ok(fit) => fit,
        Err(error @ StudyError::Cancelled(_)) => return Err(error.into()),
        // The estimate stands on features, which may exist where the likelihood does not.
        Err(_) => return Ok(None),
    };
    let levels: Vec<FittedNoise> = fit.noise.iter().filter(|l| is_off(l)).cloned().collect();
    let values: BTreeMap<String, f64> = (levels.iter())
        .map(|level| (level.name.clone(), level.value))
        .collect();
    let twin = match levels.is_empty() {
        true => study.twin().clone(),
        false => with_levels(study.twin(), record, &study.beliefs(), &values)
            .map_err(StudyError::Adaptation)?,
    };
    Ok(Some(Shown { fit, twin, levels }))
}

/// Returns whether a level is surely another than the declared one.
fn is_off(level: &FittedNoise) -> bool {
    level.declared.is_some_and(|declared| {
        let distance = (level.value / declared).ln().abs();
        distance > FACTOR.ln() && distance > OFF * level.std_error / level.value
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{RecordPlan, StudyFile};
    use crate::twin::{DigitalTwin, Noise};
    use crate::twins::CascadedTanks;

    /// Tanks that declare this measurement noise in place of 0.15.
    fn tanks(declared: f64) -> Study {
        let plan = RecordPlan::levels(0.5, 300, 0.5, 3.0, 30);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        let text = format!("twin = 'tanks'\n[noise]\ny = {declared}\n");
        let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
        study.configure(&file).unwrap()
    }

    fn levels_off(declared: f64, seed: u64) -> Vec<String> {
        let study = tanks(declared);
        let noise = Noise::new(seed, "record", 0);
        let drive = study.drives().unwrap().draw(noise).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let outputs = CascadedTanks.simulate(&theta, &drive, noise).unwrap();
        let record = Record::new(drive, outputs).unwrap();
        let shown = shown(
            &study,
            &record,
            &EstimateOptions::default(),
            &Progress::silent(),
        )
        .unwrap();
        let levels = shown.unwrap().levels;
        levels.into_iter().map(|level| level.name).collect()
    }

    /// A noise three times too small or too large is seen in every record; the right one is left alone.
    #[test]
    fn a_wrong_declaration_is_seen() {
        let seeds = 0..6;
        for declared in [0.05, 0.45] {
            for seed in seeds.clone() {
                let off = levels_off(declared, seed);
                assert!(off.contains(&"y".to_owned()), "{declared}, {seed}: {off:?}");
            }
        }
        let wrong = seeds.filter(|seed| !levels_off(0.15, *seed).is_empty());
        assert!(wrong.count() <= 1);
    }
}
