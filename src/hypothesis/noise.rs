//! Kinds of noise that are no gap: with outliers, or coloured.

use super::entry::Entry;
use super::listed::Library;
use super::term::{Nature, Term};
use super::unknown::disturbances;
use crate::effect::{Effect, TargetKind, targets};
use crate::likelihood::kalman::FilterError;
use crate::twin::is_memory;

/// Steps over which coloured noise forgets itself: correlations of 0.37 and 0.85 from a sample to the next. What lasts longer is a
/// disturbance that a twin may lack.
const COLOURS: [f64; 2] = [1.0, 6.0];
/// Word for coloured noise.
const COLOURED: &str = "coloured-noise";

/// Kinds of noise that the records may have at the places whose level is fitted, beside independent normal noise.
pub(crate) fn kinds(
    outliers: &[Effect],
    library: &Library<'_>,
    fitted_noise: &[String],
) -> Result<Vec<Term>, FilterError> {
    let scales = library.scales;
    let is_fitted = |target: &str| fitted_noise.iter().any(|place| place == target);
    let mut terms = vec![];
    for effect in outliers.iter().filter(|effect| is_fitted(effect.target())) {
        terms.extend(library.terms(effect)?);
    }
    let dt = scales.dt();
    let mut coloured = |target: &str, entry: Entry, largest: f64| {
        if is_fitted(target) && largest > 0.0 {
            let times = COLOURS.map(|steps| steps * dt);
            terms.extend(disturbances(target, entry, largest, dt, times));
        }
    };
    // A black box shows no rates: its noise is that of its sensors.
    for (i, (state, rate)) in (scales.outline.states.iter().zip(&scales.rates)).enumerate() {
        if !is_memory(&state.name) {
            coloured(&state.name, Entry::State(i), *rate);
        }
    }
    let sensors = targets(TargetKind::Sensor, None, &library.twin.signals());
    for (j, target) in sensors.iter().enumerate() {
        coloured(target, Entry::Sensor(j), scales.size(TargetKind::Sensor, j));
    }
    for term in &mut terms {
        if term.nature == Nature::Time {
            term.id = COLOURED.into();
        }
        term.nature = Nature::Noise;
    }
    Ok(terms)
}
