//! The pictures of a diagnosis.

mod answers;
mod courses;
mod places;

pub(super) use answers::{explanations, extent, horizons, terms};
pub(super) use courses::{disturbance, functions, next_input, runs, time};
pub(super) use places::{bands, channels, lags, regions, targets};

use crate::diagnose::Diagnosis;
use crate::study::Study;

/// Returns the pictures of a diagnosis as SVG, each with its name; what has nothing to show is left out.
///
/// Names: `record`, `validation`, `time`, `disturbance`, `functions`, `targets`, `regions`, `channels`, `lags`, `bands`, `which`,
/// `extent`, `horizons`, `terms`, `next-input`.
pub(crate) fn gap_pictures(study: &Study, diagnosis: &Diagnosis) -> Vec<(&'static str, String)> {
    let all = [
        ("record", runs(study, diagnosis, false)),
        ("validation", runs(study, diagnosis, true)),
        ("time", time(diagnosis)),
        ("disturbance", disturbance(diagnosis)),
        ("functions", functions(study, diagnosis)),
        ("targets", targets(diagnosis)),
        ("regions", regions(study, diagnosis)),
        ("channels", channels(study, diagnosis)),
        ("lags", lags(diagnosis)),
        ("bands", bands(diagnosis)),
        ("which", explanations(diagnosis)),
        ("extent", extent(diagnosis)),
        ("horizons", horizons(diagnosis)),
        ("terms", terms(study, diagnosis)),
        ("next-input", next_input(study, diagnosis)),
    ];
    (all.into_iter())
        .filter_map(|(name, svg)| Some((name, svg?)))
        .collect()
}
