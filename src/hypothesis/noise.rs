//! Kinds of noise that are no gap: with outliers, coloured, or growing with the signal.

use super::entry::Entry;
use super::listed::Library;
use super::magnitude::size_axis;
use super::term::{Nature, Part, Start, Term};
use super::unknown::disturbances;
use crate::effect::{Effect, TargetKind, targets};
use crate::fit::axis::Axis;
use crate::likelihood::LARGEST_SHARE;
use crate::likelihood::kalman::FilterError;
use crate::twin::{Parameter, is_memory};

/// Steps over which coloured noise forgets itself: correlations of 0.14, 0.51, 0.78 and 0.90 from a sample to the next. Noise between two
/// of them is within a factor of 1.6 of one: with 1 and 6 steps alone, a correlation of 0.7 was called a gap more often. What lasts longer
/// is a disturbance that a twin may lack; with twice the longest, what drifts for a fifteenth of 300 rows would pass for noise.
const COLOURS: [f64; 4] = [0.5, 1.5, 4.0, 10.0];
/// Word for coloured noise.
const COLOURED: &str = "coloured-noise";
/// Word for noise that grows with the signal.
const PROPORTIONAL: &str = "proportional-noise";

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
    if scales.has_equations() {
        terms.extend(proportional(&sensors, fitted_noise));
    }
    for term in &mut terms {
        if term.nature == Nature::Time {
            term.id = COLOURED.into();
        }
        term.nature = Nature::Noise;
    }
    Ok(terms)
}

/// Noise of each of these sensors whose level is fitted that grows with its signal.
pub(crate) fn proportional<'t>(
    sensors: &'t [String],
    fitted_noise: &'t [String],
) -> impl Iterator<Item = Term> + 't {
    let share = Parameter::new("share", "1", 0.0, 0.1).within(0.0, LARGEST_SHARE);
    let axis = Axis {
        counts: false,
        ..size_axis(&share, LARGEST_SHARE)
    };
    let fitted = (sensors.iter().enumerate()).filter(|(_, target)| fitted_noise.contains(target));
    fitted.map(move |(output, target)| Term {
        axes: vec![axis.clone()],
        // One pass with a little of it tells what it promises.
        starts: vec![Start {
            m: vec![0.0],
            scales: true,
        }],
        ..Term::new(PROPORTIONAL, target, Nature::Noise, Part::Share { output })
    })
}
