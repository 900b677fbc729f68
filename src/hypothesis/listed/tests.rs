//! Where listed effects are looked for.

use crate::diagnose::fixture::{biased_record, listed_terms, tanks};
use crate::fit::axis::EvidencePrior;

/// A dead zone or a play may swallow every command, a lag may be long, a delay short, and a limit of a rate just bite: a narrower search would hide the
/// law that is missing.
#[test]
fn widths_times_and_rates_are_looked_for_all_over_the_record() {
    let study = tanks(60);
    let records = [biased_record(&study, 0.0, 5)];
    let terms = listed_terms(&study, &records);
    let inputs = records[0].drive().inputs();
    let largest = inputs.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    for id in ["actuator-dead-zone", "actuator-backlash"] {
        let term = terms.iter().find(|term| term.id == id).unwrap();
        assert_eq!(term.axes[0].bounds.high(), 2.0 * largest, "{id}");
        let widest = term.starts.iter().map(|start| start.m[0]);
        assert!(widest.fold(0.0, f64::max) > 0.5 * largest, "{id}");
    }
    let lag = terms.iter().find(|term| term.id == "actuator-lag").unwrap();
    let longest = lag.starts.iter().map(|start| start.m[0]);
    let (step, duration) = (4.0, 4.0 * 60.0);
    assert!(longest.fold(0.0, f64::max) > duration / 16.0);
    let bounds = |id: &str| terms.iter().find(|term| term.id == id).unwrap().axes[0].bounds;
    assert!(bounds("actuator-delay").low() < 0.1 * step);
    let inputs: Vec<f64> = inputs.iter().copied().collect();
    let jumps = inputs.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let fastest = jumps.fold(0.0, f64::max) / step;
    assert!(bounds("actuator-rate-limit").high() >= fastest);
}

/// The twin's fit shows no way from nothing to a signal of which two thirds are rectified: larger parts are tried, too. A delay is
/// looked for as far as it may last.
#[test]
fn folds_and_delays_are_looked_for_up_to_their_ends() {
    let study = tanks(400);
    let terms = listed_terms(&study, &[biased_record(&study, 0.0, 5)]);
    let find = |id: &str| terms.iter().find(|term| term.id == id).unwrap();
    let fraction = find("sensor-rectification");
    let tried: Vec<(f64, bool)> = (fraction.starts.iter())
        .map(|start| (start.m[0], start.scales))
        .collect();
    assert_eq!(
        tried,
        [
            (0.3, false),
            (0.6, false),
            (0.9, false),
            (1.0, false),
            (0.0, true)
        ]
    );
    let delay = find("sensor-delay");
    assert_eq!(delay.axes[0].bounds.high(), 63.0 * 4.0);
}

/// A range may end on either side alone, or on both: the levels of both then let like shares of the signal pass.
#[test]
fn ranges_end_on_either_side_or_on_both() {
    let study = tanks(60);
    let terms = listed_terms(&study, &[biased_record(&study, 0.0, 5)]);
    for id in ["sensor-clipping", "actuator-saturation"] {
        let own: Vec<_> = terms.iter().filter(|term| term.id == id).collect();
        let mut ends: Vec<usize> = own.iter().map(|term| term.axes.len()).collect();
        ends.sort_unstable();
        assert_eq!(ends, [1, 1, 2], "{id}");
        let both = own.iter().find(|term| term.axes.len() == 2).unwrap();
        assert!(!both.starts.is_empty(), "{id}");
        assert!(
            both.starts.iter().all(|start| start.m[0] < start.m[1]),
            "{id}: {:?}",
            both.starts[0].m
        );
    }
}

/// Levels of tanks that are never empty have positive ends: their priors must be in the coordinate of the fit all the same.
#[test]
fn uniform_priors_are_in_the_coordinate_of_the_fit() {
    let study = tanks(60);
    let terms = listed_terms(&study, &[biased_record(&study, 5.0, 5)]);
    let mut levels = 0;
    for (term, axis) in terms
        .iter()
        .flat_map(|t| t.axes.iter().map(move |a| (t, a)))
    {
        if let EvidencePrior::Uniform { low, high } = axis.evidence {
            let centre = if axis.is_log {
                axis.centre.ln()
            } else {
                axis.centre
            };
            assert!((low..=high).contains(&centre), "{}: {axis:?}", term.key());
            levels += usize::from(!axis.is_log && low > 0.0);
        }
    }
    assert!(levels > 0);
}
