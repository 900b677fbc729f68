//! Both sides of a fold: signals that a sensor's law shows as one.
//!
//! Where a law shows two signals as one reading, as a rectifier does, a filter that took the wrong one at a crossing follows it from there, and no
//! slope leads a fit to the other. Of all signals that the law shows as the record,
//!
//! ```text
//! s* = argmin Σ (s(k) − 2·s(k − 1) + s(k − 2))²     law(s(k)) = y(k)
//! ```
//!
//! is the likeliest to be a motion. A record of it is one of the twin without the law, whose fit is a start beside the law.

use crate::effect::{Effect, TargetKind, targets};
use crate::hypothesis::limits::SEARCH;
use crate::hypothesis::term::{Part, Term};
use crate::record::{Record, Signal};
use crate::twin::{Law, Now, Twin};

impl Term {
    /// Magnitudes at which a sensor's law folds these records most, and the records without the fold, once for each side on which they may
    /// begin.
    pub(super) fn unfolded(
        &self,
        twin: &Twin,
        records: &[Record],
    ) -> Option<(Vec<f64>, Vec<Vec<Record>>)> {
        let Part::Effect { effect, held } = &self.part else {
            return None;
        };
        let start = self.starts.iter().rev().find(|start| !start.scales)?;
        let output = (targets(TargetKind::Sensor, None, &twin.signals()).iter())
            .position(|target| target == effect.target())?;
        let mut free = start.m.iter();
        let m: Vec<f64> = (effect.magnitudes().iter())
            .map(|m| held.get(m.name).or_else(|| free.next()).copied())
            .collect::<Option<_>>()?;
        let all: Vec<Vec<Record>> = (records.iter())
            .map(|record| match record.has_output(output) {
                true => unfolded(effect, &m, record, output),
                // A record without the sensor has no fold.
                false => vec![record.clone(); SEARCH.fold_sides],
            })
            .collect();
        let sides = all.iter().map(Vec::len).min().filter(|sides| *sides > 0)?;
        let of_side = |side: usize| all.iter().map(|record| record[side].clone()).collect();
        Some((start.m.clone(), (0..sides).map(of_side).collect()))
    }
}

/// Signals of a record as they may have been before a sensor's law of these magnitudes, one for each side on which the first row may lie;
/// none where the law does not fold, or where no crossing makes the motion smoother.
fn unfolded(effect: &Effect, m: &[f64], record: &Record, output: usize) -> Vec<Record> {
    let Law::Sensor(law) = effect.law() else {
        return vec![];
    };
    if effect.kind().memory_values() > 0 {
        return vec![];
    }
    let dt = record.drive().dt();
    let law = |s: f64| law.value(m, &Now::new(0.0, dt, &[], &[]), s);
    let shown = record.outputs().column(output).to_vec();
    let present: Vec<usize> = (0..shown.len()).filter(|&k| shown[k].is_finite()).collect();
    let largest = present.iter().fold(0.0, |a: f64, &k| a.max(shown[k].abs()));
    let grid: Vec<(f64, f64)> = (0..SEARCH.fold_points)
        .map(|i| {
            SEARCH.fold_reach * largest * (2.0 * i as f64 / (SEARCH.fold_points - 1) as f64 - 1.0)
        })
        .map(|s| (s, law(s)))
        .collect();
    let sides: Vec<Vec<f64>> = present.iter().map(|&k| sources(&grid, shown[k])).collect();
    let Some(first) = sides.first() else {
        return vec![];
    };
    (0..first.len())
        .filter_map(|side| {
            let (path, turns) = smoothest(&sides, side)?;
            let mut outputs: Signal = record.outputs().clone();
            for (&k, s) in present.iter().zip(path) {
                outputs[[k, output]] = s;
            }
            turns.then(|| Record::new(record.drive().clone(), outputs).ok())?
        })
        .collect()
}

/// Signals that a law shows as `y`, smallest first; the one that it shows nearest to it where there is none.
fn sources(grid: &[(f64, f64)], y: f64) -> Vec<f64> {
    let mut all: Vec<f64> = (grid.windows(2))
        .filter_map(|pair| {
            let [(s, shown), (next, shown_next)] = [pair[0], pair[1]];
            let (before, after) = (shown - y, shown_next - y);
            // On a level that the law holds, the last signal stands for all.
            (before * after < 0.0 || before == 0.0 && after != 0.0)
                .then(|| s + (next - s) * before / (before - after))
        })
        .filter(|s| s.is_finite())
        .collect();
    all.truncate(SEARCH.fold_sides);
    if all.is_empty() {
        let distance = |(_, shown): &&(f64, f64)| (shown - y).abs();
        let nearest = grid
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        all.extend(nearest.map(|(s, _)| *s));
    }
    all
}

/// The smoothest path over one value of each row, the first one given, and whether it changes sides.
fn smoothest(rows: &[Vec<f64>], first: usize) -> Option<(Vec<f64>, bool)> {
    let [start, second, rest @ ..] = rows else {
        return None;
    };
    // Costs of the best paths that end on sides (a, b) of the last two rows, and where each came from.
    let mut costs: Vec<Vec<f64>> = vec![vec![f64::INFINITY; second.len()]; start.len()];
    costs[first] = (second.iter())
        .map(|s| (s - start[first]).powi(2))
        .collect();
    let mut from: Vec<Vec<Vec<usize>>> = vec![];
    let (mut before, mut last) = (start, second);
    for next in rest {
        let mut grown = vec![vec![f64::INFINITY; next.len()]; last.len()];
        let mut came = vec![vec![0; next.len()]; last.len()];
        for (a, s2) in before.iter().enumerate() {
            for (b, s1) in last.iter().enumerate() {
                for (c, s0) in next.iter().enumerate() {
                    let cost = costs[a][b] + (s0 - 2.0 * s1 + s2).powi(2);
                    if cost < grown[b][c] {
                        (grown[b][c], came[b][c]) = (cost, a);
                    }
                }
            }
        }
        from.push(came);
        costs = grown;
        (before, last) = (last, next);
    }
    let ends = (0..before.len()).flat_map(|b| (0..last.len()).map(move |c| (b, c)));
    let (mut b, mut c) = ends.min_by(|x, y| costs[x.0][x.1].total_cmp(&costs[y.0][y.1]))?;
    let mut sides = vec![c, b];
    for came in from.iter().rev() {
        let a = came[b][c];
        sides.push(a);
        (b, c) = (a, b);
    }
    sides.reverse();
    let turns = (sides.iter().zip(rows)).any(|(side, row)| row.len() > 1 && *side != sides[0]);
    let path = sides
        .iter()
        .zip(rows)
        .map(|(side, row)| row[*side])
        .collect();
    Some((path, turns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Catalogue;
    use crate::record::Drive;

    /// The magnitude of a damped swing is unfolded into the swing or its mirror image, half of it rectified or all.
    #[test]
    fn a_rectified_swing_is_unfolded() {
        let swing = |k: usize| (-0.01 * k as f64).exp() * (0.31 * k as f64 + 0.4).sin();
        let effect = Catalogue::default().effect("sensor-rectification", "sensor");
        let effect = effect.unwrap();
        for fraction in [0.9, 1.0] {
            let shown = Signal::from_shape_fn((120, 1), |(k, _)| {
                (1.0 - fraction) * swing(k) + fraction * swing(k).abs()
            });
            let record = Record::new(Drive::autonomous(0.1, 120).unwrap(), shown).unwrap();
            let found = unfolded(&effect, &[fraction], &record, 0);
            let distance = |record: &Record| {
                let errors = (0..120).map(|k| (record.outputs()[[k, 0]] - swing(k)).abs());
                errors.fold(0.0, f64::max)
            };
            assert!(
                found.iter().any(|record| distance(record) < 1e-6),
                "{fraction}"
            );
        }
        let unbent = Signal::from_shape_fn((120, 1), |(k, _)| 2.0 + swing(k));
        let record = Record::new(Drive::autonomous(0.1, 120).unwrap(), unbent).unwrap();
        assert!(unfolded(&effect, &[1.0], &record, 0).is_empty());
    }
}
