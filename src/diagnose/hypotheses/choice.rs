//! Parts of a plan: choices of magnitudes in use, their axes and units.

use crate::diagnose::thresholds::Thresholds;
use crate::effect::{Effect, Mark};
use crate::fit::axis::{Axis, EvidencePrior};
use crate::twin::Interval;

/// A choice of an effect's magnitudes to use.
pub(in crate::diagnose) struct Choice {
    /// Magnitudes that are off.
    pub off: Vec<usize>,
    /// Index of the register of a delay.
    pub register: Option<usize>,
}

/// A magnitude that an effect has to have: where it is looked for is the record's business, not the prior's.
pub(in crate::diagnose) fn axis(
    bounds: Interval,
    centre: f64,
    deviation: f64,
    width: f64,
    longest: f64,
) -> Axis {
    Axis {
        bounds,
        centre,
        deviation,
        width,
        longest,
        counts: false,
        held: false,
        begin: None,
        evidence: EvidencePrior::Normal,
    }
}

pub(in crate::diagnose) fn log_axis(low: f64, high: f64, centre: f64) -> Axis {
    axis(Interval::unchecked(low, high), centre, 3.0, 1.0, 0.7)
}

/// A magnitude whose bounds follow once it is known what can be seen of it.
pub(in crate::diagnose) fn unset_log_axis(centre: f64) -> Axis {
    log_axis(f64::NAN, f64::NAN, centre)
}

/// The ways to use an effect: as its mark says; one threshold, or all of them; delays by length.
///
/// Only filters pay for a long register.
pub(in crate::diagnose) fn choices(effect: &Effect, mark: &Mark, filtered: bool) -> Vec<Choice> {
    let magnitudes = effect.magnitudes();
    let (least, most) = effect.kind().memories();
    let thresholds: Vec<usize> = (0..magnitudes.len())
        .filter(|&i| magnitudes[i].is_threshold())
        .collect();
    let choice = |off, register| Choice { off, register };
    if let Mark::Present(m) = mark {
        let off = (0..m.len()).filter(|&i| m[i].is_infinite()).collect();
        return vec![choice(off, None)];
    }
    match thresholds.len() {
        0 | 1 if filtered && least < most => (0..Thresholds::REGISTERS.len())
            .map(|i| choice(vec![], Some(i)))
            .collect(),
        0 | 1 => vec![choice(vec![], None)],
        _ => {
            let others = |i: &usize| thresholds.iter().copied().filter(|j| j != i).collect();
            (thresholds.iter().map(others).chain([vec![]]))
                .map(|off| choice(off, None))
                .collect()
        }
    }
}

/// The size of one unit, of a signal or state of deviation `size`.
pub(in crate::diagnose) fn unit(name: &str, size: f64, dt: f64) -> f64 {
    let signal = match name {
        n if n.starts_with("signal") || n.starts_with("state") => size,
        _ => 1.0,
    };
    match name {
        "s" => dt,
        n if n.ends_with("/s") || n.ends_with("·s)") => signal / dt,
        _ => signal,
    }
}

/// Every combination of one value of each list.
pub(in crate::diagnose) fn product(lists: &[Vec<f64>]) -> Vec<Vec<f64>> {
    lists.iter().fold(vec![vec![]], |all, list| {
        all.iter()
            .flat_map(|head| {
                list.iter().map(move |v| {
                    let mut next = head.clone();
                    next.push(*v);
                    next
                })
            })
            .collect()
    })
}
