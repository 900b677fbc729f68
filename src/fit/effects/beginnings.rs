//! Where searches for the magnitudes of effects begin.
//!
//! Effects are added one by one to the fit of the twin without them, the most promising first. Each is tried over a grid of its
//! thresholds, lags and shapes: the change of innovations that it makes is a direction, and the gain along it, θ free to answer, says how
//! much it promises. The best of the grid are fitted for a while, and the best of these are starts.

use super::magnitude::{Kind, duration};
use crate::effect::{Effect, Magnitude, Shape};
use crate::fit::axis::{EvidencePrior, SMALL};
use crate::fit::climb::{Fitted, climb, settling};
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::fit::starts::sort;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::ends;
use crate::record::Record;
use crate::twin::Role;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// Frequencies in 1/T: half a cycle apart, since a gain falls off within one; up to a fifth of the sampling rate.
const FREQUENCIES_PER_CYCLE: f64 = 2.0;
const HIGHEST: f64 = 0.2;
/// Most frequencies that are tried; a longer record has them closer together and more of them, each of more samples.
const MOST: usize = 2000;
/// Points of the grid that are fitted, and fits that become starts.
const KEPT: usize = 3;
/// Times of a change, as shares of the record.
const TIMES: usize = 9;
/// Iterations of a fit that compares starts.
const SHORT: usize = 20;
/// Largest share of a threshold's or a lag's change that is credited: its direction is no straight line.
const WHOLE: f64 = 1.5;
/// Gain in nats that is worth another round over the thresholds of one effect.
const WORTH: f64 = 1.0;

/// A point of the grid, and what it promises in nats.
type Promise = (f64, Vec<f64>);

/// Fits of a problem from all starts, best first.
pub(super) type Fits<'a> = dyn Fn(&Problem, &[Vec<f64>]) -> Result<Vec<Fitted>, FilterError> + 'a;

/// The effects of a study beside a fit of the twin.
pub(super) struct Search<'a> {
    pub problem: &'a Problem,
    pub effects: &'a [Effect],
    pub kinds: &'a BTreeMap<String, Kind>,
    /// Fits from these starts and all others, best first.
    pub fit: &'a Fits<'a>,
}

/// An effect and its free magnitudes.
struct Added<'a> {
    effect: &'a Effect,
    /// Entries of θ, none for a magnitude that is given.
    entries: Vec<Option<usize>>,
}

impl Added<'_> {
    fn holds(&self, j: usize) -> bool {
        self.entries.contains(&Some(j))
    }
}

impl<'a> Search<'a> {
    /// Starts beside `theta`, the fit with all effects off, which is one of them: no fit from these ends below it.
    pub fn starts(&self, theta: &[f64]) -> Result<Vec<Vec<f64>>, FilterError> {
        let space = self.problem.twin.parameters();
        let added = self.effects.iter().map(|effect| Added {
            effect,
            entries: (effect.magnitudes().iter())
                .map(|m| space.position(&effect.key().magnitude(m.name)).ok())
                .collect(),
        });
        let mut alone: Vec<(Added<'a>, Vec<Fitted>)> = added
            .filter(|added| added.entries.iter().any(Option::is_some))
            .map(|added| {
                let fits = self.tried(&self.opened(std::slice::from_ref(&added)), theta, &added)?;
                Ok((added, fits))
            })
            .collect::<Result<_, FilterError>>()?;
        let promise = |fits: &[Fitted]| fits.first().map_or(f64::NEG_INFINITY, |f| f.objective);
        alone.sort_by(|a, b| promise(&b.1).total_cmp(&promise(&a.1)));
        let mut best = theta.to_vec();
        let mut starts: Vec<Vec<f64>> = vec![];
        let mut open: Vec<Added<'a>> = vec![];
        let count = alone.len();
        for (n, (added, fits)) in alone.into_iter().enumerate() {
            open.push(added);
            let problem = self.opened(&open);
            let fits = match n {
                0 => fits,
                _ => self.tried(&problem, &best, &open[n])?,
            };
            starts = fits.into_iter().map(|fit| fit.theta).collect();
            if n > 0 {
                starts.push(best.clone());
            }
            // As thorough as if these effects were all: with one effect more no fit is worse.
            if n + 1 < count
                && let Some(fit) = (self.fit)(&problem, &starts)?.into_iter().next()
            {
                best = fit.theta;
            }
        }
        starts.push(theta.to_vec());
        Ok(starts)
    }

    /// The problem with the magnitudes of all other effects held.
    fn opened(&self, open: &[Added<'_>]) -> Problem {
        let is_open = |j: usize| open.iter().any(|added| added.holds(j));
        let is_magnitude = self.magnitudes();
        (self.problem).holding(|j| is_magnitude[j] && !is_open(j))
    }

    /// True for each entry of θ that is a magnitude of an effect.
    fn magnitudes(&self) -> Vec<bool> {
        let space = self.problem.twin.parameters();
        space.iter().map(|p| p.role == Role::Magnitude).collect()
    }

    /// Short fits with an effect, best first, beside a fit without it.
    fn tried(
        &self,
        problem: &Problem,
        theta: &[f64],
        added: &Added<'_>,
    ) -> Result<Vec<Fitted>, FilterError> {
        let mut fits: Vec<Fitted> = climb(problem, theta, SHORT)?.into_iter().collect();
        let mut from = theta.to_vec();
        let is_shape = |j: usize| added.holds(j) && largest(problem, j).is_none();
        let settled = settling(problem, &is_shape, SHORT);
        let (centre, is_magnitude) = (problem.centre(), self.magnitudes());
        // A second threshold is off until the first one is found.
        for _ in 0..self.switches(added).count().max(1) {
            let without = problem.holding(|j| added.holds(j));
            let Some(reference) = recoverable(Reference::new(&without, &from))?.flatten() else {
                break;
            };
            let promises = self.promises(problem, &reference, &from, added)?;
            let mut starts: Vec<Vec<f64>> = promises.into_iter().map(|(_, there)| there).collect();
            // Where the effect is large, quiet noise has narrow valleys, and θ without the effect lies in another one.
            let afresh = |there: &Vec<f64>| {
                let is_kept = |j: usize| problem.axes[j].held || is_magnitude[j];
                let value = |j: usize| if is_kept(j) { there[j] } else { centre[j] };
                (0..there.len()).map(value).collect::<Vec<f64>>()
            };
            let fresh = starts.iter().take(KEPT).map(afresh);
            let loud = starts.first().cloned().into_iter().chain(fresh);
            let loud: Vec<_> = loud.map(|there| problem.begin(&there)).collect();
            starts.extend(loud);
            let found: Vec<Option<Fitted>> = (starts.into_par_iter())
                .map(|start| climb(problem, &settled(start)?, SHORT))
                .collect::<Result<_, _>>()?;
            let before = fits.first().map_or(f64::NEG_INFINITY, |fit| fit.objective);
            fits.extend(found.into_iter().flatten());
            sort(&mut fits);
            fits.truncate(KEPT);
            match fits.first() {
                Some(best) if best.objective > before + WORTH => from.clone_from(&best.theta),
                _ => break,
            }
        }
        Ok(fits)
    }

    /// Thresholds, lags and delays of an effect: entry and values to try.
    fn switches<'b>(&'b self, added: &'b Added<'_>) -> impl Iterator<Item = (usize, &'b [f64])> {
        let kind = |m: &Magnitude| self.kinds.get(&added.effect.key().magnitude(m.name));
        (added.effect.magnitudes().iter().zip(&added.entries))
            .filter_map(move |(m, entry)| Some((kind(m)?, (*entry)?)))
            .filter_map(|(kind, j)| match kind {
                Kind::Switch { grid, .. } => Some((j, &grid[..])),
                _ => None,
            })
    }

    /// The points of an effect's grid that promise most, best first.
    fn promises(
        &self,
        problem: &Problem,
        reference: &Reference,
        theta: &[f64],
        added: &Added<'_>,
    ) -> Result<Vec<Promise>, FilterError> {
        let switches: Vec<(usize, &[f64])> = self.switches(added).collect();
        let size = added.entries.iter().flatten().copied();
        let size = size.filter_map(|j| Some((j, largest(problem, j)?))).next();
        let is_shape = |j: usize| {
            largest(problem, j).is_none() && switches.iter().all(|(switch, _)| *switch != j)
        };
        let shapes = shapes(problem, added, is_shape);
        let at = |shapes: &[(usize, f64)]| {
            let mut there = theta.to_vec();
            for &(j, value) in shapes {
                there[j] = problem.axes[j].bounds.clamp(value);
            }
            there
        };
        let mut tried: Vec<Promise> = vec![];
        if let Some((j, largest)) = size {
            let step = SMALL * largest;
            let of_size = (shapes.par_iter()).map(|shapes| {
                let mut there = at(shapes);
                let bounds = problem.axes[j].bounds;
                there[j] = bounds.clamp(step);
                let Some(filtered) = recoverable(problem.filtered(&there))? else {
                    return Ok(None);
                };
                let range = (bounds.low() / step, bounds.high() / step);
                let gain = reference.gain(&reference.direction(&filtered), range);
                there[j] = bounds.clamp(gain.alpha * step);
                Ok((gain.nats > 0.0).then_some((gain.nats, there)))
            });
            let of_size: Vec<Option<Promise>> = of_size.collect::<Result<_, FilterError>>()?;
            tried.extend(best_of_times(
                added,
                of_size.into_iter().flatten().collect(),
            ));
        }
        let here: f64 = reference.filtered.iter().map(|f| f.log_likelihood).sum();
        for (j, values) in switches {
            let points: Vec<Vec<f64>> = (shapes.iter())
                .flat_map(|shapes| {
                    values
                        .iter()
                        .map(|v| at(&[&shapes[..], &[(j, *v)]].concat()))
                })
                .collect();
            let of_switch = points.into_par_iter().map(|there| {
                let Some(filtered) = recoverable(problem.filtered(&there))? else {
                    return Ok(None);
                };
                let value: f64 = filtered.iter().map(|f| f.log_likelihood).sum();
                let gain = reference.gain(&reference.direction(&filtered), (0.0, WHOLE));
                Ok(Some((gain.nats.max(value - here), there)))
            });
            let of_switch: Vec<Option<Promise>> = of_switch.collect::<Result<_, FilterError>>()?;
            let mut of_switch: Vec<Promise> = of_switch.into_iter().flatten().collect();
            of_switch.sort_by(|a, b| b.0.total_cmp(&a.0));
            of_switch.truncate(KEPT);
            tried.extend(of_switch);
        }
        tried.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(tried)
    }
}

/// The best points; of an effect that begins at some time, the best of each time: the times that promise most lie together, and the
/// change may be at another.
fn best_of_times(added: &Added<'_>, mut points: Vec<Promise>) -> Vec<Promise> {
    points.sort_by(|a, b| b.0.total_cmp(&a.0));
    let time = (added.effect.magnitudes().iter().zip(&added.entries))
        .find_map(|(m, entry)| (*entry).filter(|_| m.shape == Shape::Time));
    let Some(time) = time else {
        points.truncate(KEPT);
        return points;
    };
    let mut kept: Vec<Promise> = vec![];
    for point in points {
        if kept.iter().all(|other| other.1[time] != point.1[time]) {
            kept.push(point);
        }
    }
    kept
}

fn largest(problem: &Problem, j: usize) -> Option<f64> {
    match problem.axes[j].evidence {
        EvidencePrior::Magnitude { largest } => Some(largest),
        _ => None,
    }
}

/// Every combination of an effect's free shapes, as entries of θ.
fn shapes(
    problem: &Problem,
    added: &Added<'_>,
    is_shape: impl Fn(usize) -> bool,
) -> Vec<Vec<(usize, f64)>> {
    (added.effect.magnitudes().iter().zip(&added.entries))
        .filter_map(|(m, entry)| Some((m, (*entry)?)))
        .filter(|(_, j)| is_shape(*j))
        .fold(vec![vec![]], |all, (m, j)| {
            let values = values(m, &problem.records);
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
fn values(m: &Magnitude, records: &[Record]) -> Vec<f64> {
    let duration = duration(records);
    let dt = records[0].drive().dt();
    match m.shape {
        Shape::Frequency => {
            let count = (HIGHEST / dt * duration * FREQUENCIES_PER_CYCLE) as usize;
            (2..=count.clamp(2, MOST))
                .map(|i| i as f64 / (FREQUENCIES_PER_CYCLE * duration))
                .collect()
        }
        Shape::Phase => vec![0.0, FRAC_PI_2],
        Shape::Time => (1..=TIMES)
            .map(|i| duration * i as f64 / (TIMES + 1) as f64)
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
