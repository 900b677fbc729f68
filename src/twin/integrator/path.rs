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
}

impl Path<'_, '_> {
    /// Length of a stretch in seconds.
    pub fn seconds(&self, of: Stretch) -> f64 {
        of.length * self.now.dt
    }

    /// Rates at a part of a stretch.
    pub fn rates(&mut self, of: Stretch, part: f64, x: &[f64], dx: &mut [f64]) {
        let at = of.from + part * of.length;
        let mut stage = Now {
            t: self.now.t + at * self.now.dt,
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

    /// Share of the way at which an input jumps: no step goes over it.
    pub fn jump(&self) -> Option<f64> {
        let between = self.now.between?;
        between.holds.contains(&Hold::Nearest).then_some(0.5)
    }
}
