//! Laws over several points at once: one call, and what depends on the magnitudes alone is computed once.

use super::law::{ForcePoint, Instant};
use crate::twin::{
    Layout, Now, OutputChannel, ParameterChange, RateChange, SignalChange, StateLimit, StatePair,
};

/// Memories that a look at a signal copies without the heap.
const SHORT: usize = 8;

fn instant(now: &Now<'_>) -> Instant {
    Instant {
        t: now.t,
        dt: now.dt,
    }
}

impl<F> SignalChange for F
where
    F: Fn(&[f64], Instant, &mut [f64], f64) -> f64 + Send + Sync,
{
    fn pass(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &OutputChannel,
        (at, x): (Layout, &mut [f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let (memory, target) = (on.memory.clone(), on.target);
        for (x, y) in at.each_mut(x).zip(y.chunks_exact_mut(p)) {
            y[target] = self(m, instant(now), &mut x[memory.clone()], y[target]);
        }
    }

    fn peek(
        &self,
        m: &[f64],
        now: &Now<'_>,
        on: &OutputChannel,
        (at, x): (Layout, &[f64]),
        (p, y): (usize, &mut [f64]),
    ) {
        let (memory, target, now) = (on.memory.clone(), on.target, instant(now));
        let outputs = y.chunks_exact_mut(p);
        match memory.len() {
            0 => {
                for y in outputs {
                    y[target] = self(m, now, &mut [], y[target]);
                }
            }
            1 => {
                for (x, y) in at.each(x).zip(outputs) {
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
                for (x, y) in at.each(x).zip(outputs) {
                    copy.copy_from_slice(&x[memory.clone()]);
                    y[target] = self(m, now, copy, y[target]);
                }
            }
        }
    }
}

impl<F> RateChange for F
where
    F: Fn(&[f64], &ForcePoint<'_>) -> f64 + Send + Sync,
{
    fn push(&self, m: &[f64], now: &Now<'_>, on: StatePair, at: Layout, x: &[f64], dx: &mut [f64]) {
        for (states, rates) in at.each(x).zip(at.each_mut(dx)) {
            let point = ForcePoint {
                x: states[on.target],
                other: on.other.map_or(0.0, |j| states[j]),
                t: now.t,
                states,
                u: now.u,
                theta: now.theta,
            };
            rates[on.target] += self(m, &point);
        }
    }
}

impl<F> StateLimit for F
where
    F: Fn(&[f64], &mut f64, Option<&mut f64>) + Send + Sync,
{
    fn hold(&self, m: &[f64], on: StatePair, at: Layout, x: &mut [f64]) {
        let other = on.other.filter(|j| *j != on.target);
        for x in at.each_mut(x) {
            let mut value = x[on.target];
            self(m, &mut value, other.map(|j| &mut x[j]));
            x[on.target] = value;
        }
    }
}

impl<F> ParameterChange for F
where
    F: Fn(&[f64], f64, f64) -> f64 + Send + Sync,
{
    fn value(&self, m: &[f64], now: &Now<'_>, _: &[f64], value: f64) -> f64 {
        self(m, now.t, value)
    }
}
