//! Limits of states between two samples: rates are those within them, and errors of steps those that are left.

use super::{Now, Rates};
use crate::twin::Interval;

/// Limits that hold anywhere on a way: what follows a state beyond one sees it there. The state itself goes on until the step's end, so that an
/// event at the limit is met, and is then put into it.
pub(super) struct LimitsOfWay<'p> {
    /// Number of states of a point.
    states: usize,
    /// Limits that are felt, by state.
    felt: &'p [(usize, Interval)],
    /// Buffers: points within their limits, and stages beyond each end so far, where steps have errors.
    within: &'p mut Vec<f64>,
    beyond: Option<&'p mut Vec<[Beyond; 2]>>,
}

/// Stages of a step beside an end of a limit.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Beyond {
    /// Largest distance of a stage beyond it.
    far: f64,
    /// Rate on where the step began, if at the limit, and at its last stage.
    first: f64,
    last: f64,
}

impl Beyond {
    fn see(&mut self, is_first: bool, far: f64, rate: f64) {
        self.far = self.far.max(far);
        self.last = rate;
        if is_first && far >= 0.0 {
            self.first = rate;
        }
    }

    /// Returns by how much the state is off when a step of `h` seconds ends so far beyond: it went on where it should have been held, and came back
    /// from there, not from the limit. Between stages, rates lie on a line.
    fn late(&self, end: f64, h: f64) -> f64 {
        let (on, back) = (self.first, -self.last);
        let turned = match on > 0.0 && back > 0.0 {
            true => 0.5 * h * on.min(back) * (on.min(back) / (on + back)),
            false => 0.0,
        };
        turned.max(self.far - end.max(0.0))
    }
}

impl<'p> LimitsOfWay<'p> {
    /// Those of points of so many states; `None` where no limit is felt.
    pub fn of(
        states: usize,
        felt: &'p [(usize, Interval)],
        (within, beyond): (&'p mut Vec<f64>, Option<&'p mut Vec<[Beyond; 2]>>),
    ) -> Option<Self> {
        let limits = Self {
            states,
            felt,
            within,
            beyond,
        };
        (!felt.is_empty()).then_some(limits)
    }

    /// Calls equations with points within their limits.
    pub fn rates(&mut self, drift: &mut Rates<'_>, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.within.clear();
        self.within.extend_from_slice(x);
        limited(self.states, self.within, self.felt);
        drift(now, self.within, dx);
        self.see(x, dx);
    }

    /// Puts points into the limits.
    pub fn limit(&self, x: &mut [f64]) {
        limited(self.states, x, self.felt);
    }

    /// Returns whether a way of state j leaves its limits, inside which it begins.
    pub fn are_passed(&self, j: usize, [from, to]: [f64; 2]) -> bool {
        let mut own = self.felt.iter().filter(|(of, _)| *of == j);
        own.any(|(_, limit)| from < limit.high() && from > limit.low() && limit.clamp(to) != to)
    }

    /// Begins a step, of which no stage has been.
    pub fn begin_step(&mut self) {
        if let Some(beyond) = &mut self.beyond {
            beyond.clear();
        }
    }

    /// Sees a stage with its rates.
    pub fn see(&mut self, x: &[f64], dx: &[f64]) {
        let Some(beyond) = &mut self.beyond else {
            return;
        };
        let (points, is_first) = (x.len() / self.states, beyond.is_empty());
        beyond.resize(points * self.felt.len(), Default::default());
        for (&(j, limit), beyond) in self.felt.iter().zip(beyond.chunks_exact_mut(points)) {
            let of = x.iter().zip(dx).skip(j).step_by(self.states);
            for ((x, dx), [below, above]) in of.zip(beyond) {
                below.see(is_first, limit.low() - x, -dx);
                above.see(is_first, x - limit.high(), *dx);
            }
        }
    }

    /// Sets errors of points at `x` to those that are left within the limits: what is beyond one for both orders has none. A state that was beyond
    /// one and turned back left it late by as much.
    pub fn errors(&self, h: f64, x: &[f64], errors: &mut [f64]) {
        let Some(beyond) = &self.beyond else {
            return;
        };
        let points = x.len() / self.states;
        for (&(j, limit), beyond) in self.felt.iter().zip(beyond.chunks_exact(points)) {
            let of = x.iter().zip(&mut *errors).skip(j).step_by(self.states);
            for ((x, error), [below, above]) in of.zip(beyond) {
                let other = *x - *error;
                let late = below.late(limit.low() - x, h);
                let late = late.max(above.late(x - limit.high(), h));
                *error = (limit.clamp(*x) - limit.clamp(other)).abs() + late;
            }
        }
    }
}

/// Puts points of so many states into their limits.
pub(super) fn limited(states: usize, x: &mut [f64], limits: &[(usize, Interval)]) {
    for &(j, limit) in limits {
        for x in x.iter_mut().skip(j).step_by(states) {
            *x = limit.clamp(*x);
        }
    }
}

/// Boxes that are felt, by state.
pub(in crate::twin) fn felt(limits: &[Interval]) -> Vec<(usize, Interval)> {
    let limits = limits.iter().copied().enumerate();
    limits
        .filter(|(_, limit)| *limit != Interval::EVERYTHING)
        .collect()
}
