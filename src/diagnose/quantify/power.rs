//! Power: the smallest magnitude of each listed effect that the structural test would see in 80 of
//! 100 records like this one.
//!
//! Let d⊥ be the change of the innovations by an effect of magnitude m that θ cannot imitate (`reference.rs`). The scan's root √(2·gain)
//! is about |N(‖d⊥(m)‖, 1)|. The simulations of the test say from which root c on an effect alone makes it alarm, and so
//!
//! ```text
//! ‖d⊥(m₈₀)‖ = c + 0.84
//! ```
//!
//! is solved for the magnitude, shapes (frequencies, times, exponents) where they show best. To first order, and of the scan
//! alone: tails that only the omnibus statistics see are not counted.

use crate::diagnose::hypotheses::dictionary::Point;
use crate::diagnose::hypotheses::variant::Variant;
use crate::diagnose::outcome::Visible;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::NullDistribution;
use crate::diagnose::thresholds::Thresholds;
use crate::effect::Magnitude;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::{FilterError, recoverable};
use rayon::prelude::*;

/// Steps of a search, and how near is enough.
const STEPS: usize = 10;
const NEAR: f64 = 0.03;

/// Returns the smallest visible magnitude of each listed candidate.
pub(in crate::diagnose) fn power(
    model: &FittedTwin<'_>,
    null: &NullDistribution,
    level: f64,
) -> Result<Vec<Visible>, FilterError> {
    let Some(reference) = Reference::new(&model.problem, &model.fitted.theta)? else {
        return Ok(vec![]);
    };
    let dictionary = &model.dictionary;
    let needed = null.roots_needed(level);
    (0..dictionary.candidates.len())
        .into_par_iter()
        .filter(|&c| dictionary.candidates[c].is_listed())
        .map(|c| {
            let need = needed[c] + Thresholds::POWER_QUANTILE;
            let points = dictionary.points.iter();
            let mut best: Option<Least> = None;
            for point in points.filter(|p| dictionary.variants[p.variant].candidate == c) {
                let variant = &dictionary.variants[point.variant];
                // A second threshold would show whatever the first one does.
                if variant.free[1..].iter().any(Magnitude::is_threshold) {
                    continue;
                }
                let root = |first: f64| root(model, &reference, variant, point, first);
                if let Some(visible) = least(variant, point, need, root)?
                    && best.as_ref().is_none_or(|b| visible.distance < b.distance)
                {
                    best = Some(visible);
                }
            }
            let candidate = &dictionary.candidates[c];
            Ok(Visible {
                id: candidate.id.clone(),
                target: candidate.target.clone(),
                magnitude: match &best {
                    Some(best) => best.name.to_owned(),
                    None => candidate
                        .magnitudes()
                        .first()
                        .map_or("", |m| m.name)
                        .to_owned(),
                },
                value: best.map(|best| best.value),
            })
        })
        .collect()
}

/// A magnitude that is just seen.
struct Least {
    name: &'static str,
    value: f64,
    /// Distance from no effect, as a share of the way to the point.
    distance: f64,
}

/// ‖d⊥‖ of a variant with this first magnitude; `None` where the filter does not work.
fn root(
    model: &FittedTwin<'_>,
    reference: &Reference,
    variant: &Variant,
    point: &Point,
    first: f64,
) -> Result<Option<f64>, FilterError> {
    let m: Vec<f64> = [first]
        .into_iter()
        .chain(point.m[1..].iter().copied())
        .collect();
    let (problem, full) = variant.at(&model.problem, &model.fitted.theta, &m);
    let there = recoverable(problem.filtered(&full))?;
    Ok(there.map(|there| reference.own(&reference.direction(&there)).sqrt()))
}

/// The first magnitude nearest to nothing whose root is what is needed.
fn least(
    variant: &Variant,
    point: &Point,
    need: f64,
    root: impl Fn(f64) -> Result<Option<f64>, FilterError>,
) -> Result<Option<Least>, FilterError> {
    let (magnitude, axis) = (&variant.free[0], &variant.axes[0]);
    // Where there is no effect: at the off value, or beyond all values of the signal.
    let nothing = match magnitude.off {
        Some(off) if off.is_finite() => off,
        Some(off) if off > 0.0 => axis.bounds.high(),
        Some(_) => axis.bounds.low(),
        None => return Ok(None),
    };
    let whole = point.m[0] - nothing;
    if whole == 0.0 {
        return Ok(None);
    }
    let (mut low, mut high) = (0.0, None);
    let mut share: f64 = 1.0;
    let within = |share: f64| {
        let value = nothing + share * whole;
        let reach = magnitude.limits.contains(value) && axis.bounds.contains(value);
        reach && share <= Thresholds::VISIBLE_REACH
    };
    for _ in 0..STEPS {
        let Some(root) = root(nothing + share * whole)? else {
            // Too much to be filtered.
            high = Some(share);
            share = 0.5 * (low + share);
            continue;
        };
        if (root / need - 1.0).abs() < NEAR {
            return Ok(Some(Least {
                name: magnitude.name,
                value: nothing + share * whole,
                distance: share.abs(),
            }));
        }
        if root < need {
            low = share;
        } else {
            high = Some(share);
        }
        // As if the root were proportional, within what is known.
        let guess = share * (need / root.max(1e-3 * need)).clamp(0.05, 8.0);
        share = match high {
            Some(high) if low < guess && guess < high => guess,
            Some(high) => 0.5 * (low + high),
            None => guess.max(1.5 * low),
        };
        if !within(share) {
            return Ok(None);
        }
    }
    Ok(high.map(|share| Least {
        name: magnitude.name,
        value: nothing + share * whole,
        distance: share.abs(),
    }))
}
