//! Sizes of states: how far they move in runs, or as a filter follows them; and declared noise levels along the runs.

use super::level::{DeclaredLevels, MEASURED, Measured};
use crate::likelihood::kalman::{FilterError, FilterSettings, Kalman, recoverable};
use crate::math::{deviation, median};
use crate::record::Record;
use crate::twin::{Acting, Composed, Now};

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
    let mut distances = vec![Vec::new(); n];
    for record in records {
        let mut start: Vec<f64> = vec![];
        visit_run(base, record, theta, |_, x| {
            if start.is_empty() {
                start = x.to_vec();
                return;
            }
            for (all, (x, start)) in distances.iter_mut().zip(x.iter().zip(&start)) {
                all.push((x - start).abs());
            }
        });
    }
    (distances.into_iter())
        .map(|mut d| {
            d.sort_unstable_by(f64::total_cmp);
            let median = d.get(d.len() / 2).copied().unwrap_or(0.0);
            if median > 0.0 { median } else { fallback }
        })
        .collect()
}

/// Rows from one that tells a size to the next.
fn stride(record: &Record) -> usize {
    record.samples().div_ceil(MEASURED.sized_rows)
}

/// Shows states of the twin's run under a record's inputs, the start first, until it diverges.
fn visit_run(
    base: &Composed,
    record: &Record,
    theta: &[f64],
    mut visit: impl FnMut(&Now<'_>, &[f64]),
) {
    let drive = record.drive();
    let Ok(acting) = Acting::of(base, theta, drive) else {
        return;
    };
    let (limits, mut work) = (base.limits(), base.workspace());
    let mut x = vec![0.0; base.outline().states.len()];
    base.run_to_first_row(&acting, &mut work, &mut x);
    visit(&acting.at(0), &x);
    let stride = stride(record);
    for k in (0..drive.samples()).filter(|&k| !acting.stands(k)) {
        let now = acting.at(k);
        base.step(&now, &mut x, &mut work);
        base.constrain(&now, &mut x);
        for (x, limit) in x.iter_mut().zip(limits) {
            *x = limit.clamp(*x);
        }
        if !x.iter().all(|v| v.abs() < 1e12) {
            return;
        }
        if k.is_multiple_of(stride) {
            visit(&now, &x);
        }
    }
}

/// Returns the medians of the declared levels above zero along runs under the records' inputs: the level itself where it depends on
/// neither state nor time. A state's level is that of an increment in `step`.
pub(super) fn declared_levels(
    base: &Composed,
    records: &[Record],
    theta: &[f64],
    step: f64,
) -> DeclaredLevels {
    let outline = base.outline();
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let mut levels = vec![Vec::new(); n + p];
    let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
    for record in records {
        visit_run(base, record, theta, |now, x| {
            q.fill(0.0);
            r.fill(0.0);
            base.noise(&Now { dt: step, ..*now }, x, &mut q, &mut r);
            for (all, level) in levels.iter_mut().zip(q.iter().chain(&r)) {
                if *level > 0.0 {
                    all.push(*level);
                }
            }
        });
    }
    let mut process: Vec<f64> = (levels.iter())
        .map(|all| median(all).unwrap_or(0.0))
        .collect();
    let measurement = process.split_off(n);
    DeclaredLevels {
        process,
        measurement,
    }
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
    let theta = loud.begun_loud(theta);
    let settings = FilterSettings::default();
    let mut means: Vec<Vec<f64>> = vec![Vec::new(); twin.outline().states.len()];
    for record in records {
        let kalman = Kalman::new(twin, record, &settings)?;
        let Some(followed) = recoverable(kalman.filtered_means(&theta, stride(record)))? else {
            return Ok(None);
        };
        for (all, followed) in means.iter_mut().zip(followed) {
            all.extend(followed);
        }
    }
    Ok(Some(means.iter().map(|m| deviation(m)).collect()))
}
