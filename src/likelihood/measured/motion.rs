//! Sizes of states: how far they move in runs, or as a filter follows them.

use super::level::Measured;
use crate::likelihood::kalman::{FilterError, FilterSettings, Kalman, recoverable};
use crate::math::deviation;
use crate::record::Record;
use crate::twin::{Acting, Composed};

/// Deviation, or what is left of it where nothing moves.
pub(super) fn size(values: &[f64]) -> f64 {
    let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let largest = present.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    let size = deviation(&present).max(1e-3 * largest);
    if size > 0.0 { size } else { 1.0 }
}

/// Median distance of each state from its start, in runs under the records' inputs; `fallback` where a state does not move or the
/// run diverges.
pub(super) fn free_motion(
    base: &Composed,
    records: &[Record],
    theta: &[f64],
    fallback: f64,
) -> Vec<f64> {
    let n = base.outline().states.len();
    let limits = base.limits();
    let mut distances = vec![Vec::new(); n];
    let mut work = base.workspace();
    for record in records {
        let drive = record.drive();
        let Ok(acting) = Acting::of(base, theta, drive) else {
            continue;
        };
        let (mut x, mut start) = (vec![0.0; n], vec![0.0; n]);
        base.start(&acting.at(0), &mut x);
        start.copy_from_slice(&x);
        for k in 0..drive.samples() {
            let now = acting.at(k);
            base.step(&now, &mut x, &mut work);
            base.constrain(&now, &mut x);
            for (x, limit) in x.iter_mut().zip(limits) {
                *x = limit.clamp(*x);
            }
            if !x.iter().all(|v| v.abs() < 1e12) {
                break;
            }
            for (i, x) in x.iter().enumerate() {
                distances[i].push((x - start[i]).abs());
            }
        }
    }
    (distances.into_iter())
        .map(|mut d| {
            d.sort_by(f64::total_cmp);
            let median = d.get(d.len() / 2).copied().unwrap_or(0.0);
            if median > 0.0 { median } else { fallback }
        })
        .collect()
}

/// Deviation of each state as a filter with loud noise follows it; `None` where it cannot.
pub(super) fn followed_motion(
    loud: &Measured,
    records: &[Record],
    theta: &[f64],
) -> Result<Option<Vec<f64>>, FilterError> {
    let Some(twin) = loud.twin.equations() else {
        return Ok(None);
    };
    let theta: Vec<f64> = (theta.iter().copied())
        .chain(loud.levels.iter().map(|level| level.loud))
        .collect();
    let settings = FilterSettings {
        keep_states: true,
        ..FilterSettings::default()
    };
    let mut means: Vec<Vec<f64>> = vec![Vec::new(); twin.outline().states.len()];
    for record in records {
        let filtered = Kalman::new(twin, record, &settings)?.filter(&theta);
        let Some(states) = recoverable(filtered)?.and_then(|f| f.states) else {
            return Ok(None);
        };
        for (all, column) in means.iter_mut().zip(states.means.columns()) {
            all.extend(column.iter());
        }
    }
    Ok(Some(means.iter().map(|m| deviation(m)).collect()))
}
