//! Laws over several points at once: one call, and what depends on the magnitudes alone is computed once.

use super::law::{ForcePoint, Instant};
use crate::twin::Layout;
use std::ops::Range;
use std::sync::Arc;

/// A channel of the outputs of several points, and the memory of its effect in their states.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    /// Memory values in the state.
    pub memory: Range<usize>,
    /// Index of the channel.
    pub target: usize,
}

/// Memories that a look at a signal copies without the heap.
const SHORT: usize = 8;

/// A sensor's law over the points of a filter.
pub(super) trait SensorBatch: Send + Sync {
    /// Passes the channel of points, `p` outputs each, through the effect; advances its memory in the states.
    fn pass(
        &self,
        m: &[f64],
        now: Instant,
        on: &Channel,
        states: (Layout, &mut [f64]),
        outputs: (usize, &mut [f64]),
    );

    /// As [`pass`](Self::pass), the memories left as they are.
    fn peek(
        &self,
        m: &[f64],
        now: Instant,
        on: &Channel,
        states: (Layout, &[f64]),
        outputs: (usize, &mut [f64]),
    );

    /// As [`pass`](Self::pass) of a law without memory, also without states; returns whether any output changed.
    fn read(&self, m: &[f64], now: Instant, target: usize, outputs: (usize, &mut [f64])) -> bool;
}

impl<F> SensorBatch for F
where
    F: Fn(&[f64], Instant, &mut [f64], f64) -> f64 + Send + Sync,
{
    fn pass(
        &self,
        m: &[f64],
        now: Instant,
        on: &Channel,
        (at, x): (Layout, &mut [f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let (memory, target) = (on.memory.clone(), on.target);
        for (x, y) in at.each_mut(x).zip(y.chunks_exact_mut(p)) {
            y[target] = self(m, now, &mut x[memory.clone()], y[target]);
        }
    }

    fn peek(
        &self,
        m: &[f64],
        now: Instant,
        on: &Channel,
        (at, x): (Layout, &[f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let (memory, target) = (on.memory.clone(), on.target);
        let points = at.each(x).zip(y.chunks_exact_mut(p));
        match memory.len() {
            0 => {
                for (_, y) in points {
                    y[target] = self(m, now, &mut [], y[target]);
                }
            }
            1 => {
                for (x, y) in points {
                    y[target] = self(m, now, &mut [x[memory.start]], y[target]);
                }
            }
            length => {
                let (mut few, mut many) = ([0.0; SHORT], vec![]);
                let copy = match few.get_mut(..length) {
                    Some(copy) => copy,
                    None => {
                        many.resize(length, 0.0);
                        &mut many[..]
                    }
                };
                for (x, y) in points {
                    copy.copy_from_slice(&x[memory.clone()]);
                    y[target] = self(m, now, copy, y[target]);
                }
            }
        }
    }

    fn read(&self, m: &[f64], now: Instant, target: usize, (p, y): (usize, &mut [f64])) -> bool {
        let mut changed = false;
        for y in y.chunks_exact_mut(p) {
            let before = y[target];
            y[target] = self(m, now, &mut [], before);
            changed |= y[target].to_bits() != before.to_bits();
        }
        changed
    }
}

/// Form of a law over several points; none for laws that are asked once a sample.
#[derive(Clone)]
pub(super) enum Batch {
    None,
    Sensor(Arc<dyn SensorBatch>),
    Force(Arc<dyn ForceBatch>),
    Limit(Arc<dyn LimitBatch>),
}

/// Target and other state of a law on states.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// Index of the target.
    pub target: usize,
    /// Index of the other state.
    pub other: Option<usize>,
}

/// A force law over the points of a filter.
pub(super) trait ForceBatch: Send + Sync {
    /// Adds the force to the rates of points; `point` holds what is the same for all of them.
    fn push(
        &self,
        m: &[f64],
        on: Pair,
        point: &ForcePoint<'_>,
        at: Layout,
        x: &[f64],
        dx: &mut [f64],
    );
}

impl<F> ForceBatch for F
where
    F: Fn(&[f64], &ForcePoint<'_>) -> f64 + Send + Sync,
{
    fn push(
        &self,
        m: &[f64],
        on: Pair,
        point: &ForcePoint<'_>,
        at: Layout,
        x: &[f64],
        dx: &mut [f64],
    ) {
        for (states, rates) in at.each(x).zip(at.each_mut(dx)) {
            let point = ForcePoint {
                x: states[on.target],
                other: on.other.map_or(0.0, |j| states[j]),
                states,
                ..*point
            };
            rates[on.target] += self(m, &point);
        }
    }
}

/// A limit law over the points of a filter.
pub(super) trait LimitBatch: Send + Sync {
    /// Bends the target and the other state of points.
    fn hold(&self, m: &[f64], on: Pair, at: Layout, x: &mut [f64]);
}

impl<F> LimitBatch for F
where
    F: Fn(&[f64], &mut f64, Option<&mut f64>) + Send + Sync,
{
    fn hold(&self, m: &[f64], on: Pair, at: Layout, x: &mut [f64]) {
        let other = on.other.filter(|j| *j != on.target);
        for x in at.each_mut(x) {
            let mut value = x[on.target];
            self(m, &mut value, other.map(|j| &mut x[j]));
            x[on.target] = value;
        }
    }
}
