//! PointsFeed as a tape takes and gives them.

use crate::math::{LANES, Lanes};
use crate::twin::Now;

/// A source of what a tape computes: numbers in groups of `G`.
pub(in crate::equations) trait TapeFeed<const G: usize> {
    /// Number of groups of points.
    fn groups(&self) -> usize;
    fn parameter(&self, index: usize) -> [f64; G];
    fn input(&self, index: usize) -> [f64; G];
    fn time(&self) -> [f64; G];
    fn state(&self, state: usize, group: usize) -> [f64; G];
    /// Takes an output of a group.
    fn give(&mut self, output: usize, group: usize, values: [f64; G]);
}

/// PointsFeed of one moment, one after the other.
pub(in crate::equations) struct PointsFeed<'p, 'n> {
    pub now: &'p Now<'n>,
    pub x: &'p [f64],
    /// Numbers from one point to the next.
    pub stride: usize,
    pub count: usize,
    pub outputs: &'p mut [f64],
    /// Outputs from one point to the next.
    pub output_stride: usize,
}

impl<const G: usize> TapeFeed<G> for PointsFeed<'_, '_> {
    #[inline(always)]
    fn groups(&self) -> usize {
        self.count.div_ceil(G)
    }
    #[inline(always)]
    fn parameter(&self, index: usize) -> [f64; G] {
        [self.now.theta[index]; G]
    }
    #[inline(always)]
    fn input(&self, index: usize) -> [f64; G] {
        [self.now.u[index]; G]
    }
    #[inline(always)]
    fn time(&self) -> [f64; G] {
        [self.now.t; G]
    }
    #[inline(always)]
    fn state(&self, state: usize, group: usize) -> [f64; G] {
        // The last group is filled up with the last point.
        let mut values = [0.0; G];
        for (i, value) in values.iter_mut().enumerate() {
            let point = (group * G + i).min(self.count - 1);
            *value = self.x[point * self.stride + state];
        }
        values
    }
    #[inline(always)]
    fn give(&mut self, output: usize, group: usize, values: [f64; G]) {
        let points = group * G..self.count.min(group * G + G);
        for (point, value) in points.zip(values) {
            self.outputs[point * self.output_stride + output] = value;
        }
    }
}

/// PointsFeed of several moments, one a lane. Lanes that are not used are those of the first.
pub(in crate::equations) struct LanesFeed<'p, 'n, L, T> {
    pub now: &'p [Now<'n>],
    pub points: usize,
    /// Number of states.
    pub states: usize,
    /// Returns a state of a point, by its index among all.
    pub load: L,
    /// Takes an output of a point.
    pub take: T,
}

impl<L, T> LanesFeed<'_, '_, L, T> {
    #[inline(always)]
    fn lanes(&self, of: impl Fn(&Now<'_>) -> f64) -> [f64; LANES] {
        let mut values = [of(&self.now[0]); LANES];
        for (value, now) in values.iter_mut().zip(self.now) {
            *value = of(now);
        }
        values
    }
}

impl<L, T> TapeFeed<LANES> for LanesFeed<'_, '_, L, T>
where
    L: Fn(usize) -> Lanes,
    T: FnMut(usize, usize, Lanes),
{
    #[inline(always)]
    fn groups(&self) -> usize {
        self.points
    }
    #[inline(always)]
    fn parameter(&self, index: usize) -> [f64; LANES] {
        self.lanes(|now| now.theta[index])
    }
    #[inline(always)]
    fn input(&self, index: usize) -> [f64; LANES] {
        self.lanes(|now| now.u[index])
    }
    #[inline(always)]
    fn time(&self) -> [f64; LANES] {
        self.lanes(|now| now.t)
    }
    #[inline(always)]
    fn state(&self, state: usize, group: usize) -> [f64; LANES] {
        (self.load)(group * self.states + state).0
    }
    #[inline(always)]
    fn give(&mut self, output: usize, group: usize, values: [f64; LANES]) {
        (self.take)(group, output, Lanes(values));
    }
}
