//! Listed effects as hypotheses: their magnitudes in the units of the record.

use super::magnitude::{Ranges, frequency};
use super::scales::{Scales, largest};
use super::term::{Nature, Part, Start, Term, with_terms};
use crate::effect::{Effect, Magnitude, OutputMark, TargetKind, on_levels, targets};
use crate::fit::axis::{Axis, EvidencePrior};
use crate::hypothesis::limits::TERM;
use crate::likelihood::kalman::FilterError;
use crate::record::Signal;
use crate::twin::{Interval, Law, Parameter, Twin};
use std::collections::BTreeMap;

/// Shares of its range at which a size with two ends is tried, besides next to nothing. A part of a signal that is rectified, the only such
/// size of the library, folds the output at a half.
const LARGE: [f64; 4] = [0.3, 0.6, 0.9, 1.0];

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
    /// Hypotheses of an effect that the twin lacks: one for each way to use its magnitudes.
    pub fn terms(&self, effect: &Effect) -> Result<Vec<Term>, FilterError> {
        let kind = effect.law().target();
        let (target, values) = self.bent(effect);
        if values.is_empty() && kind != TargetKind::Parameter {
            return Ok(vec![]);
        }
        if kind == TargetKind::State && self.scales.defined.get(target) == Some(&true) {
            // A rate that the twin defines as another state is no law that could be wrong.
            return Ok(vec![]);
        }
        let mark = mark(effect, &values);
        if mark == OutputMark::Absent {
            // The record refutes it: no value repeats, at an end or anywhere.
            return Ok(vec![]);
        }
        let mut terms = vec![];
        for off in ways(effect, &mark) {
            let held = (off.iter())
                .map(|&i| &effect.magnitudes()[i])
                .map(|m| (m.name.to_owned(), m.off.unwrap_or(0.0)));
            let term = bare(effect, held.collect());
            let twin = with_terms(self.twin, std::iter::once(&term))?;
            terms.extend(self.ranged(term, (target, &values), (&twin, false))?);
        }
        if let OutputMark::Present(shown) = mark {
            terms
                .iter_mut()
                .for_each(|term| marked(term, &shown, &values, self.scales.has_equations()));
        }
        Ok(terms)
    }

    /// The hypothesis of an effect that the twin has, all of whose free magnitudes are used together; `None` where none is free. Those that readings show
    /// are held there, as in [`terms`](Self::terms), and ends of a range that readings would show and do not where they are off.
    pub fn own(&self, effect: &Effect) -> Result<Option<Term>, FilterError> {
        let space = self.twin.parameters();
        let entry = |m: &Magnitude| space.position(&effect.key().magnitude(m.name)).ok();
        let held = (effect.magnitudes().iter())
            .filter(|m| entry(m).is_none())
            .map(|m| {
                (
                    m.name.to_owned(),
                    effect.given(m.name).or(m.off).unwrap_or(0.0),
                )
            });
        let mut term = bare(effect, held.collect());
        term.entries = Some(effect.magnitudes().iter().filter_map(entry).collect());
        let (target, values) = self.bent(effect);
        let Some(mut term) = self.ranged(term, (target, &values), (self.twin, true))? else {
            return Ok(None);
        };
        let shown = match mark(effect, &values) {
            OutputMark::Present(shown) => Some(shown),
            OutputMark::Absent => (effect.magnitudes().iter())
                .map(|m| m.off.filter(|off| off.is_infinite()))
                .collect(),
            OutputMark::Unmarked => None,
        };
        if let Some(shown) = shown {
            let shown = shown_free(&term, &shown);
            let entries = term.entries.iter().flatten();
            let m = (entries.zip(&shown)).map(|(&j, value)| space[j].bounds.clamp(*value));
            let m: Vec<f64> = m.collect();
            for (axis, &value) in term.axes.iter_mut().zip(&m) {
                axis.bounds = Interval::unchecked(value, value);
                (axis.centre, axis.held) = (value, true);
            }
            term.starts = vec![Start::at(m)];
        }
        Ok(Some(term))
    }

    /// Position of what an effect bends among its kind, and its values; none of a parameter.
    fn bent(&self, effect: &Effect) -> (usize, Vec<f64>) {
        let kind = effect.law().target();
        let known = targets(kind, Some(&self.scales.outline), &self.twin.signals());
        let target = known.iter().position(|k| k == effect.target()).unwrap_or(0);
        (target, self.scales.columns(kind, target))
    }

    /// Values of the other state of a law between two; none of other laws.
    fn others(&self, effect: &Effect) -> Vec<f64> {
        let states = &self.scales.outline.states;
        let other = effect
            .other()
            .and_then(|name| states.iter().position(|q| q.name == name));
        other.map_or_else(Vec::new, |i| self.scales.columns(TargetKind::State, i))
    }

    /// The term with axes and starts of its free magnitudes; `None` where none is free, or where one has no range. `twin` has the effect.
    fn ranged(
        &self,
        mut term: Term,
        (target, values): (usize, &[f64]),
        (twin, is_own): (&Twin, bool),
    ) -> Result<Option<Term>, FilterError> {
        let Part::Effect { effect, .. } = &term.part else {
            return Ok(None);
        };
        let effect = effect.clone();
        let free: Vec<Magnitude> = term.free().into_iter().cloned().collect();
        let Some(first) = free.first() else {
            return Ok(None);
        };
        let frequencies = self.with_slow_ones();
        let others = self.others(&effect);
        let before = self.scales.before(effect.law().target(), target);
        let ranges = Ranges {
            effect: &effect,
            values,
            before: &before,
            others: &others,
            dt: self.scales.dt(),
            duration: self.scales.duration(),
            frequencies: &frequencies,
            is_dear: !self.scales.has_equations(),
        };
        let space = twin.parameters();
        let entries: Vec<usize> = (term.names().iter())
            .map(|name| space.position(name))
            .collect::<Result<_, _>>()?;
        let mut grids: Vec<Vec<f64>> = vec![];
        for (m, &j) in free.iter().zip(&entries) {
            let deflected = f64::from(effect.kind().remembers().is_some());
            let largest = || self.largest(twin, &entries, (j, &space[j]), deflected);
            let (mut grid, axis) = ranges.of(m, &space[j], largest);
            if is_own && m.is_threshold() && free.len() > 1 {
                // One of several thresholds may be enough.
                grid.push(axis.bounds.clamp(m.off.unwrap_or(f64::INFINITY)));
            }
            grids.push(grid);
            term.axes.push(axis);
        }
        let scales = matches!(term.axes[0].evidence, EvidencePrior::Magnitude { .. });
        let thresholds: Vec<usize> = (0..free.len())
            .filter(|&i| free[i].is_threshold())
            .collect();
        let small = match thresholds.len() > 1 && !is_own {
            true => at_like_levels(&grids, &thresholds),
            false => starts(&grids, scales),
        };
        if scales && first.limits.is_finite() {
            // A size between two ends is as likely large, where the twin folds: from nothing, no slope leads there.
            let (low, width) = (first.limits.low(), first.limits.width());
            grids[0] = LARGE
                .map(|s| term.axes[0].bounds.clamp(low + s * width))
                .to_vec();
            term.starts.extend(starts(&grids, false));
        }
        term.starts.extend(small);
        Ok((term.axes.iter().all(|a| a.bounds.low() <= a.bounds.high())).then_some(term))
    }

    /// The frequencies and slow ones: θ answers a slow wave, so that residuals hardly show it.
    fn with_slow_ones(&self) -> Vec<f64> {
        let cycle = TERM.frequencies_per_cycle * self.scales.duration();
        let slow = (2..=TERM.slow).map(|i| i as f64 / cycle);
        let mut all: Vec<f64> = slow.chain(self.frequencies.iter().copied()).collect();
        all.sort_unstable_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// The size of entry `j` at which the effect is as large as the twin's own terms; all `entries` of the effect are off or in the middle of
    /// their range, and memories at `memory`.
    fn largest(
        &self,
        twin: &Twin,
        entries: &[usize],
        (j, parameter): (usize, &Parameter),
        memory: f64,
    ) -> Option<f64> {
        let outline = twin.outline()?;
        let space = twin.parameters();
        let mut theta = self.theta.to_vec();
        theta.resize(space.len(), 0.0);
        for &k in entries {
            theta[k] = if k == j { 0.0 } else { space[k].prior.centre() };
        }
        let states = self.padded(outline.states.len(), memory);
        largest(twin, &theta, (j, parameter), &self.scales.records, &states)
    }

    /// States of the twin, and this value for memories that an effect adds.
    fn padded(&self, count: usize, memory: f64) -> Vec<Signal> {
        (self.scales.states.iter())
            .map(|states| {
                Signal::from_shape_fn((states.nrows(), count), |(k, i)| {
                    if i < states.ncols() {
                        states[[k, i]]
                    } else {
                        memory
                    }
                })
            })
            .collect()
    }

    /// Frequencies to try, and their axis.
    pub fn frequency(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let times = (self.scales.dt(), self.scales.duration());
        frequency(parameter, times, self.frequencies)
    }
}

/// Mark of an effect on the values that it bends.
fn mark(effect: &Effect, values: &[f64]) -> OutputMark {
    match effect.law() {
        Law::Sensor(_) | Law::Rounding(_) => effect.kind().marks(values),
        _ => OutputMark::Unmarked,
    }
}

/// Magnitudes that are off in each way to use an effect: of several thresholds, each is used alone, and all together.
fn ways(effect: &Effect, mark: &OutputMark) -> Vec<Vec<usize>> {
    let magnitudes = effect.magnitudes();
    if let OutputMark::Present(m) = mark {
        return vec![(0..m.len()).filter(|&i| m[i].is_infinite()).collect()];
    }
    let thresholds: Vec<usize> = (0..magnitudes.len())
        .filter(|&i| magnitudes[i].is_threshold())
        .collect();
    match thresholds.len() {
        0 | 1 => vec![vec![]],
        _ => (thresholds.iter())
            .map(|i| thresholds.iter().copied().filter(|j| j != i).collect())
            .chain([vec![]])
            .collect(),
    }
}

/// The term of an effect, some of its magnitudes held, without axes and starts.
fn bare(effect: &Effect, held: BTreeMap<String, f64>) -> Term {
    let part = Part::Effect {
        effect: effect.clone(),
        held,
    };
    Term::new(effect.id(), effect.target(), Nature::Listed, part)
}

/// Values that outputs show of a term's free magnitudes, of those of its effect.
fn shown_free(term: &Term, shown: &[f64]) -> Vec<f64> {
    let Part::Effect { effect, held } = &term.part else {
        return vec![];
    };
    let all = effect.magnitudes().iter().zip(shown);
    let free = all.filter(|(m, _)| !held.contains_key(m.name));
    free.map(|(_, value)| *value).collect()
}

/// Holds magnitudes where the outputs show them: they are not to be fitted.
fn marked(term: &mut Term, shown: &[f64], values: &[f64], is_filtered: bool) {
    term.starts = vec![Start::at(shown_free(term, shown))];
    let rounds = matches!(&term.part, Part::Effect { effect, .. } if matches!(effect.law(), Law::Rounding(_)));
    // Filters count readings at an end themselves. Values on few levels repeat at an end without a limit there.
    let counts = rounds || !(is_filtered || on_levels(values));
    term.mark = if counts { TERM.mark_present } else { 0.0 };
    term.axes.iter_mut().for_each(|axis| axis.held = true);
}

/// Starts of an effect with several thresholds, the lowest first: these let like shares of the signal pass, where anything passes.
fn at_like_levels(grids: &[Vec<f64>], thresholds: &[usize]) -> Vec<Start> {
    let levels = thresholds.iter().map(|&i| grids[i].len()).min();
    let at = |level: usize| -> Vec<Start> {
        let mut grids = grids.to_vec();
        for &i in thresholds {
            grids[i] = vec![grids[i][level]];
        }
        starts(&grids, false)
    };
    let mut all: Vec<Start> = (0..levels.unwrap_or(0)).flat_map(at).collect();
    all.retain(|start| thresholds.is_sorted_by(|&i, &j| start.m[i] < start.m[j]));
    all
}

/// Starts at every combination of one value of each list.
fn starts(lists: &[Vec<f64>], scales: bool) -> Vec<Start> {
    let all = lists.iter().fold(vec![vec![]], |all: Vec<Vec<f64>>, list| {
        (all.iter())
            .flat_map(|head| list.iter().map(move |v| [&head[..], &[*v]].concat()))
            .collect()
    });
    all.into_iter().map(|m| Start { m, scales }).collect()
}

#[cfg(test)]
mod tests;
