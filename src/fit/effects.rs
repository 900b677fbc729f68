//! Where searches for the magnitudes of effects begin.
//!
//! At the fit of the twin without effects, each effect is tried over a grid of its shapes: the change of innovations that a small
//! size makes is a direction, and the gain along it, θ free to answer, says how large the effect wants to be.

use super::axis::{EvidencePrior, SMALL};
use super::magnitude::{LONGEST, duration};
use super::problem::Problem;
use super::reference::Reference;
use crate::effect::{Effect, Magnitude};
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::ends;
use crate::record::Record;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// Frequencies in 1/T: half a cycle apart, since a gain falls off within one; up to a fifth of the sampling rate.
const FREQUENCIES_PER_CYCLE: f64 = 2.0;
const HIGHEST: f64 = 0.2;
/// Most frequencies that are tried; a longer record has them closer together and more of them, each of more samples.
const MOST: usize = 2000;
/// Starts of an effect.
const KEPT: usize = 3;
/// Factor from one lag or delay to the next.
const FACTOR: f64 = 3.0;
/// Times of a change, as shares of the record.
const TIMES: usize = 9;

/// Starts beside `theta`, the fit without effects, which is one of them: each effect where it promises most, and the last one where it
/// promises nearly as much.
pub(crate) fn begin(
    problem: &Problem<'_>,
    theta: &[f64],
    effects: &[Effect],
) -> Result<Vec<Vec<f64>>, FilterError> {
    let Some(reference) = recoverable(Reference::new(problem, theta))?.flatten() else {
        return Ok(vec![theta.to_vec()]);
    };
    let space = problem.twin.parameters();
    let mut best = vec![theta.to_vec()];
    for effect in effects {
        let entries: Vec<Option<usize>> = (effect.magnitudes().iter())
            .map(|m| space.position(&effect.key().magnitude(m.name)).ok())
            .collect();
        let Some(size) =
            (entries.iter().flatten().copied()).find(|&j| largest(problem, j).is_some())
        else {
            continue;
        };
        let step = SMALL * largest(problem, size).unwrap_or(1.0);
        let grid = grid(problem, effect, &entries);
        let tried: Vec<Option<(f64, Vec<f64>)>> = (grid.par_iter())
            .map(|shapes| {
                let mut there = theta.to_vec();
                for &(j, value) in shapes {
                    there[j] = problem.axes[j].bounds.clamp(value);
                }
                there[size] = problem.axes[size].bounds.clamp(step);
                let Some(filtered) = recoverable(problem.filtered(&there))? else {
                    return Ok(None);
                };
                let bounds = problem.axes[size].bounds;
                let range = (bounds.low() / step, bounds.high() / step);
                let gain = reference.gain(&reference.direction(&filtered), range);
                there[size] = bounds.clamp(gain.alpha * step);
                Ok((gain.nats > 0.0).then_some((gain.nats, there)))
            })
            .collect::<Result<_, FilterError>>()?;
        let mut tried: Vec<(f64, Vec<f64>)> = tried.into_iter().flatten().collect();
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        tried.truncate(KEPT);
        let before = best[0].clone();
        best = (tried.into_iter())
            .map(|(_, there)| {
                let mut start = before.clone();
                for j in entries.iter().copied().flatten() {
                    start[j] = there[j];
                }
                start
            })
            .collect();
        if best.is_empty() {
            best.push(before);
        }
    }
    best.push(theta.to_vec());
    Ok(best)
}

fn largest(problem: &Problem<'_>, j: usize) -> Option<f64> {
    match problem.axes[j].evidence {
        EvidencePrior::Magnitude { largest } => Some(largest),
        _ => None,
    }
}

/// Every combination of an effect's free shapes, as entries of θ.
fn grid(
    problem: &Problem<'_>,
    effect: &Effect,
    entries: &[Option<usize>],
) -> Vec<Vec<(usize, f64)>> {
    (effect.magnitudes().iter().zip(entries))
        .filter_map(|(m, entry)| Some((m, (*entry)?)))
        .filter(|(_, j)| largest(problem, *j).is_none())
        .fold(vec![vec![]], |all, (m, j)| {
            let values = values(m, problem.records);
            (all.iter())
                .flat_map(|begun| {
                    values
                        .iter()
                        .map(move |v| [&begun[..], &[(j, *v)]].concat())
                })
                .collect()
        })
}

/// Values of a shape that are tried on these records.
pub(super) fn values(m: &Magnitude, records: &[Record]) -> Vec<f64> {
    let duration = duration(records);
    let dt = records[0].drive().dt();
    match m.unit {
        "Hz" => {
            let count = (HIGHEST / dt * duration * FREQUENCIES_PER_CYCLE) as usize;
            (2..=count.clamp(2, MOST))
                .map(|i| i as f64 / (FREQUENCIES_PER_CYCLE * duration))
                .collect()
        }
        "rad" => vec![0.0, FRAC_PI_2],
        "s" if m.off.is_none() => (1..=TIMES)
            .map(|i| duration * i as f64 / (TIMES + 1) as f64)
            .collect(),
        "s" => std::iter::successors(Some(dt), |v| Some(FACTOR * v))
            .take_while(|v| *v <= LONGEST * duration)
            .collect(),
        _ => {
            let (low, high) = ends(m.starts);
            match m.limits.is_finite() {
                true => vec![low, 0.5 * (low + high), high],
                false => m.starts.to_vec(),
            }
        }
    }
}
