//! Listed effects as hypotheses: sizes and shapes of their magnitudes in the units of the record.

use super::scales::Scales;
use super::term::{Nature, Part, Start, Term, with_terms};
use crate::effect::{Effect, Law, Magnitude, Mark, Shape, TargetKind, on_levels, targets};
use crate::fit::axis::{Axis, EvidencePrior};
use crate::fit::magnitude::{LONGEST, largest, level_axis, levels, size_axis, uniform_axis};
use crate::likelihood::kalman::FilterError;
use crate::math::ends;
use crate::twin::{Interval, Parameter, Twin};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Shares of its range at which a size with two ends is tried, besides next to nothing. A part of a signal that is rectified, the only such
/// size of the library, folds the output at a half.
const LARGE: [f64; 4] = [0.3, 0.6, 0.9, 1.0];

/// Times of a change that are tried, evenly over the record.
pub(super) const TIMES: usize = 9;
/// Nats for a mark that outputs bear, such as repeated values of a quantiser.
const MARK_PRESENT: f64 = 12.0;

/// Twin and record that effects are looked for in.
pub(crate) struct Library<'a> {
    pub twin: &'a Twin,
    /// The fitted θ of the first record.
    pub theta: &'a [f64],
    pub scales: &'a Scales,
    /// Frequencies that the residuals show most, in Hz.
    pub frequencies: &'a [f64],
}

impl Library<'_> {
    /// Hypotheses of one effect: one for each way to use its magnitudes.
    pub fn terms(&self, effect: &Effect) -> Result<Vec<Term>, FilterError> {
        let known = targets(
            effect.law().target(),
            Some(&self.scales.outline),
            &self.twin.signals(),
        );
        let target = known.iter().position(|k| k == effect.target()).unwrap_or(0);
        let kind = effect.law().target();
        let values = self.scales.columns(kind, target);
        if values.is_empty() && kind != TargetKind::Parameter {
            return Ok(vec![]);
        }
        if kind == TargetKind::State && self.scales.defined.get(target) == Some(&true) {
            // A rate that the twin defines as another state is no law that could be wrong.
            return Ok(vec![]);
        }
        let mark = match effect.law() {
            Law::Sensor(_) | Law::Rounding(_) => effect.kind().marks(&values),
            _ => Mark::Unmarked,
        };
        if mark == Mark::Absent {
            // The record refutes it: no value repeats, at an end or anywhere.
            return Ok(vec![]);
        }
        let mut terms = vec![];
        for off in Self::ways(effect, &mark) {
            if let Some(term) = self.term(effect, &values, &mark, &off)? {
                terms.push(term);
            }
        }
        Ok(terms)
    }

    /// Magnitudes that are off in each way to use an effect: of several thresholds, one is used at a time.
    fn ways(effect: &Effect, mark: &Mark) -> Vec<Vec<usize>> {
        let magnitudes = effect.magnitudes();
        if let Mark::Present(m) = mark {
            return vec![(0..m.len()).filter(|&i| m[i].is_infinite()).collect()];
        }
        let thresholds: Vec<usize> = (0..magnitudes.len())
            .filter(|&i| magnitudes[i].is_threshold())
            .collect();
        match thresholds.len() {
            0 | 1 => vec![vec![]],
            _ => (thresholds.iter())
                .map(|i| thresholds.iter().copied().filter(|j| j != i).collect())
                .collect(),
        }
    }

    fn term(
        &self,
        effect: &Effect,
        values: &[f64],
        mark: &Mark,
        off: &[usize],
    ) -> Result<Option<Term>, FilterError> {
        let magnitudes = effect.magnitudes();
        let held: BTreeMap<String, f64> = (off.iter())
            .map(|&i| {
                (
                    magnitudes[i].name.to_owned(),
                    magnitudes[i].off.unwrap_or(0.0),
                )
            })
            .collect();
        let free: Vec<&Magnitude> = (magnitudes.iter())
            .filter(|m| !held.contains_key(m.name))
            .collect();
        if free.is_empty() {
            return Ok(None);
        }
        let rounds = matches!(effect.law(), Law::Rounding(_));
        let mut term = Term {
            id: effect.id().into(),
            target: effect.target().into(),
            nature: Nature::Listed,
            part: Part::Effect {
                effect: effect.clone(),
                held,
            },
            axes: vec![],
            family: None,
            starts: vec![],
            variables: vec![],
            mark: match mark {
                Mark::Unmarked | Mark::Absent => 0.0,
                // Values on few levels repeat at an end without a limit there.
                Mark::Present(_) if !rounds && on_levels(values) => 0.0,
                Mark::Present(_) => MARK_PRESENT,
            },
            also: vec![],
        };
        let twin = with_terms(self.twin, std::iter::once(&term))?;
        let space = twin.parameters();
        let names = term.names();
        let mut grids: Vec<Vec<f64>> = vec![];
        let mut scales = false;
        for (i, (m, name)) in free.iter().zip(&names).enumerate() {
            let j = space.position(name)?;
            let (grid, axis) = self.magnitude(m, effect, values, (&twin, j, &space[j]));
            if matches!(axis.evidence, EvidencePrior::Magnitude { .. }) && i == 0 {
                scales = true;
            }
            grids.push(grid);
            term.axes.push(axis);
        }
        if let Mark::Present(m) = mark {
            // What the outputs show is not to be fitted.
            let shown = m.iter().enumerate().filter(|(i, _)| !off.contains(i));
            grids = shown.map(|(_, v)| vec![*v]).collect();
            term.axes.iter_mut().for_each(|axis| axis.held = true);
            scales = false;
        }
        let starts = |grids: &[Vec<f64>], scales| {
            let all = product(grids).into_iter();
            all.map(move |m| Start { m, scales })
        };
        let small = starts(&grids, scales);
        let limits = free[0].limits;
        if scales && limits.is_finite() {
            // A size between two ends is as likely large, where the twin folds: from nothing, no slope leads there.
            grids[0] = LARGE.map(|s| limits.low() + s * limits.width()).to_vec();
            term.starts.extend(starts(&grids, false));
        }
        term.starts.extend(small);
        Ok((term.axes.iter().all(|a| a.bounds.low() <= a.bounds.high())).then_some(term))
    }

    /// Values of one magnitude to try, and its axis.
    fn magnitude(
        &self,
        m: &Magnitude,
        effect: &Effect,
        values: &[f64],
        (twin, j, parameter): (&Twin, usize, &Parameter),
    ) -> (Vec<f64>, Axis) {
        let (dt, duration) = (self.scales.dt(), self.scales.duration());
        let law = effect.law();
        let (low, high) = if values.is_empty() {
            (0.0, 1.0)
        } else {
            ends(values)
        };
        let span = (high - low).max(1e-9);
        let size = {
            let s = crate::math::deviation(values).max(1e-3 * low.abs().max(high.abs()));
            if s > 0.0 { s } else { 1.0 }
        };
        let logarithmic = |low: f64, high: f64, grid: Vec<f64>| {
            let parameter = within(parameter, low, high);
            let axis = Axis {
                counts: false,
                longest: 0.7,
                deviation: 3.0,
                ..uniform_axis(&parameter, (low, high), true)
            };
            (grid.into_iter().map(|v| v.clamp(low, high)).collect(), axis)
        };
        let linear = |low: f64, high: f64, grid: Vec<f64>| {
            let parameter = within(parameter, low, high);
            let axis = Axis {
                counts: false,
                ..uniform_axis(&parameter, (low, high), false)
            };
            (grid.into_iter().map(|v| v.clamp(low, high)).collect(), axis)
        };
        if matches!(law, Law::Outliers(_)) {
            return match m.shape {
                Shape::Share => logarithmic(0.003, 0.3, vec![0.03, 0.08]),
                _ => logarithmic(0.05 * size, 10.0 * size, vec![0.5 * size, 2.0 * size]),
            };
        }
        if law.is_noise() {
            return logarithmic(
                1e-4 * size,
                2.0 * size,
                vec![3e-3 * size, 0.02 * size, 0.1 * size],
            );
        }
        if m.is_threshold() && m.shape == Shape::Rate {
            let grid = [0.05, 0.2].map(|v| v * size / dt).to_vec();
            return logarithmic(2.0 * size / duration, 2.0 * size / dt, grid);
        }
        if m.is_threshold() {
            let upper = m.off.is_some_and(|off| off > 0.0);
            let parameter = within(parameter, low, low + span);
            let axis = Axis {
                counts: false,
                ..level_axis(&parameter, (low, low + span))
            };
            return (levels(values, upper), axis);
        }
        match (m.shape, m.off) {
            (Shape::Delay | Shape::TimeConstant, Some(_)) => {
                let mut longest = (LONGEST * duration).max(0.6 * dt);
                if let Some(most) = effect.kind().longest_dead_time(dt) {
                    longest = longest.min(most);
                }
                let octaves = std::iter::successors(Some(0.5 * dt), |tau| Some(2.0 * tau));
                let octaves = octaves.take_while(|tau| *tau < longest);
                let grid = octaves.chain([longest]).collect();
                logarithmic(0.3 * dt, longest, grid)
            }
            (Shape::Time, _) => {
                let times = (1..=TIMES).map(|i| duration * i as f64 / (TIMES + 1) as f64);
                let (grid, axis) = linear(0.0, duration, times.collect());
                (
                    grid,
                    Axis {
                        held: false,
                        ..axis
                    },
                )
            }
            (Shape::Frequency, _) => self.frequency(parameter),
            (Shape::Phase, _) => {
                let grid = vec![-FRAC_PI_2, 0.0, FRAC_PI_2, 2.0 * FRAC_PI_2];
                let (grid, axis) = linear(m.limits.low(), m.limits.high(), grid);
                // Each angle counts once, however often the limits hold it.
                let evidence = EvidencePrior::Uniform { low: -PI, high: PI };
                (grid, Axis { evidence, ..axis })
            }
            (Shape::Level, Some(_)) => {
                // Beyond, a dead zone or a play of that width lets nothing pass.
                let widest = (2.0 * low.abs().max(high.abs())).max(span);
                let grid = [0.2, 0.6, 1.5, 3.0].map(|share| share * size);
                linear(0.0, widest, grid.to_vec())
            }
            (_, Some(_)) => {
                let found = twin.outline().and_then(|outline| {
                    let mut theta = self.theta.to_vec();
                    theta.resize(twin.parameters().len(), 0.0);
                    for (k, value) in theta.iter_mut().enumerate().skip(self.theta.len()) {
                        // Shapes somewhere in their range, sizes off.
                        let p = &twin.parameters()[k];
                        *value = if k == j { 0.0 } else { p.prior.centre() };
                    }
                    let states = self.padded(outline.states.len());
                    largest(twin, &theta, (j, parameter), &self.scales.records, &states)
                });
                let found = found.unwrap_or_else(|| {
                    // Laws on parameters are relative.
                    let is_share = m.shape == Shape::Share || values.is_empty();
                    let whole = if is_share { 0.5 } else { size };
                    match m.shape {
                        Shape::Rate => 2.0 * whole / duration,
                        _ => whole,
                    }
                });
                let axis = Axis {
                    counts: false,
                    ..size_axis(parameter, found)
                };
                (vec![0.0], axis)
            }
            _ => {
                let (first, last) = ends(m.starts);
                let (low, high) = match m.limits.is_finite() {
                    true => (m.limits.low(), m.limits.high()),
                    false => (
                        m.limits.low().max(first - 3.0 * (last - first)),
                        m.limits.high().min(last + 3.0 * (last - first)),
                    ),
                };
                let grid = match m.limits.is_finite() {
                    true => [0.1, 0.3, 0.6].map(|s| low + s * (high - low)).to_vec(),
                    false => m.starts.to_vec(),
                };
                linear(low, high, grid)
            }
        }
    }

    /// States of the twin, and zeros for memories that an effect adds.
    fn padded(&self, count: usize) -> Vec<crate::record::Signal> {
        (self.scales.states.iter())
            .map(|states| {
                crate::record::Signal::from_shape_fn((states.nrows(), count), |(k, i)| {
                    if i < states.ncols() {
                        states[[k, i]]
                    } else {
                        0.0
                    }
                })
            })
            .collect()
    }

    /// Frequencies to try, and their axis: uniform up to half the sampling rate.
    pub fn frequency(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let (low, high) = (0.7 / self.scales.duration(), 0.5 / self.scales.dt());
        let parameter = within(parameter, low, high);
        let axis = Axis {
            counts: false,
            // A search must stay at its peak of the spectrum.
            longest: 0.02,
            deviation: 10.0,
            ..uniform_axis(&parameter, (low, high), true)
        };
        (self.frequencies.to_vec(), axis)
    }
}

/// A magnitude whose bounds are what the record can show, not the user's.
fn within(parameter: &Parameter, low: f64, high: f64) -> Parameter {
    let mut parameter = parameter.clone();
    parameter.bounds = Interval::unchecked(low, high);
    parameter
}

/// Every combination of one value of each list.
fn product(lists: &[Vec<f64>]) -> Vec<Vec<f64>> {
    lists.iter().fold(vec![vec![]], |all, list| {
        (all.iter())
            .flat_map(|head| list.iter().map(move |v| [&head[..], &[*v]].concat()))
            .collect()
    })
}

#[cfg(test)]
mod tests;
