//! The way from one sample to the next: rates at any part of it, with the inputs there.

use super::{Hold, Now};

/// A stretch of the way, in shares of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub from: f64,
    pub length: f64,
}

/// Equations that set rates of points.
pub(crate) type Rates<'r> = dyn FnMut(&Now<'_>, &[f64], &mut [f64]) + 'r;

/// Rates of points between two samples.
pub(super) struct Path<'p, 'n> {
    /// The sample that it begins at.
    pub now: &'p Now<'n>,
    /// Inputs at a part of it.
    pub inputs: &'p mut [f64],
    pub drift: &'p mut Rates<'p>,
    /// Shares of the way that no step goes over, in order.
    pub breaks: &'p [f64],
}

impl Path<'_, '_> {
    /// Length of a stretch in seconds.
    pub fn seconds(&self, of: Stretch) -> f64 {
        of.length * self.now.dt
    }

    /// Time at a share of the way: nowhere on it behind its end, which several stretches may miss by a last digit.
    pub fn time(&self, share: f64) -> f64 {
        let time = self.now.t + share * self.now.dt;
        match share - 1.0 {
            left if left.abs() < 8.0 * f64::EPSILON => self.now.end,
            left if left < 0.0 => time.min(self.now.end),
            _ => time,
        }
    }

    /// Rates at a part of a stretch.
    pub fn rates(&mut self, of: Stretch, part: f64, x: &[f64], dx: &mut [f64]) {
        let at = of.from + part * of.length;
        let mut stage = Now {
            t: self.time(at),
            dt: of.length * self.now.dt,
            ..*self.now
        };
        if let Some(between) = self.now.between {
            let middle = of.from + 0.5 * of.length;
            between.inputs_at(at, middle, self.now.u, self.inputs);
            stage.u = self.inputs;
        }
        (self.drift)(&stage, x, dx);
    }

    /// Calls `with` the time and the inputs at a share of the way.
    pub fn at<R>(&mut self, share: f64, with: impl FnOnce(&Now<'_>) -> R) -> R {
        let mut now = Now {
            t: self.time(share),
            ..*self.now
        };
        if let Some(between) = self.now.between {
            between.inputs_at(share, share, self.now.u, self.inputs);
            now.u = self.inputs;
        }
        with(&now)
    }

    /// Returns stretches of equal length, but for the breaks.
    pub fn equal(&self, parts: usize) -> Vec<Stretch> {
        let mut all = vec![];
        for i in 0..parts {
            let (mut from, end) = (i as f64 / parts as f64, (i + 1) as f64 / parts as f64);
            while from < end {
                let to = self.next_break(from).min(end);
                let length = to - from;
                all.push(Stretch { from, length });
                from = to;
            }
        }
        all
    }

    /// Share of the way up to which a step from another may go.
    pub fn next_break(&self, from: f64) -> f64 {
        let mut breaks = self.breaks.iter().copied();
        breaks.find(|at| from < *at).unwrap_or(1.0)
    }
}

/// Shares of the way at which inputs jump.
pub(super) fn jumps(now: &Now<'_>) -> &'static [f64] {
    match now.between {
        Some(between) if between.holds.contains(&Hold::Nearest) => &[0.5],
        _ => &[],
    }
}
