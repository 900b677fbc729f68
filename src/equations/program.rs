//! Computes the expressions of a text: its equations, point after point and in blocks.

use super::jumps::Jumps;
use super::tape::{LanesFeed, OperationTape, PointsFeed};
use crate::math::{LANES, Lanes};
use crate::twin::{Blocks, Integrator, Interval, Layout, Now, Outline, StateSpace, Stepping};
use smallvec::SmallVec;
use std::cell::Cell;

/// Equations of a text, ready to be computed.
#[derive(Debug)]
pub(crate) struct Program {
    pub(super) outline: Outline,
    pub(super) limits: Vec<Interval>,
    pub(super) integrator: Integrator,
    pub(super) stepping: Stepping,
    pub(super) tapes: Tapes,
}

/// Operations of each method.
#[derive(Debug)]
pub(super) struct Tapes {
    pub drift: OperationTape,
    /// Times at which the drift jumps, or a condition of an event does.
    pub jumps: Option<Jumps>,
    pub observe: OperationTape,
    /// Levels of states, then of outputs.
    pub noise: OperationTape,
    /// `true` for levels per √s.
    pub per_second: Vec<bool>,
    /// States whose start is given.
    pub given: Vec<usize>,
    pub start: OperationTape,
    pub deviation: OperationTape,
    /// Both ends of the limits of each state, where parameters set one.
    pub ends: Option<OperationTape>,
}

/// Numbers of a group of points, those of the narrowest vectors. Twice as many gain nothing below [`MANY_POINTS`], and functions such as sin
/// are computed for what fills a group up, too.
const FEW: usize = 2;
/// Numbers of a group of many points, those of the widest vectors.
const MANY: usize = LANES;
/// Points from which on wide groups are no slower than narrow ones.
const MANY_POINTS: usize = 40;

impl OperationTape {
    /// Computes the outputs of one point.
    pub fn point(&self, now: &Now<'_>, x: &[f64], outputs: &mut [f64]) {
        self.run::<1>(&mut PointsFeed {
            now,
            x,
            stride: x.len(),
            count: 1,
            output_stride: outputs.len(),
            outputs,
        });
    }

    /// Computes the outputs of points, `stride` numbers each, to where `output_stride` numbers are of each.
    fn points(
        &self,
        now: &Now<'_>,
        (stride, x): (usize, &[f64]),
        (output_stride, outputs): (usize, &mut [f64]),
    ) {
        let count = x.len() / stride;
        let mut points = PointsFeed {
            now,
            x,
            stride,
            count,
            output_stride,
            outputs,
        };
        match count {
            0 => {}
            1 => self.run::<1>(&mut points),
            _ if count < MANY_POINTS => self.run::<FEW>(&mut points),
            _ => self.run::<MANY>(&mut points),
        }
    }
}

impl Program {
    /// Both ends of the limits of each state; empty where no parameter sets one.
    fn ends(&self, now: &Now<'_>) -> Vec<f64> {
        let Some(tape) = &self.tapes.ends else {
            return vec![];
        };
        let mut ends = vec![0.0; 2 * self.limits.len()];
        tape.point(now, &[], &mut ends);
        ends
    }
}

/// Returns the limits between two ends. Ends in the wrong order hold nothing: θ that crosses them is for the prior to exclude.
fn held([low, high]: [f64; 2]) -> Option<Interval> {
    Interval::new(low, high).ok()
}

impl StateSpace for Program {
    fn outline(&self) -> Outline {
        self.outline.clone()
    }

    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.tapes.drift.point(now, x, dx);
    }

    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.tapes.observe.point(now, x, y);
    }

    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        // States without a start are left alone: theirs is unknown.
        let mut starts = SmallVec::<[f64; 16]>::from_elem(0.0, self.limits.len());
        self.tapes.start.point(now, &[], &mut starts);
        for &state in &self.tapes.given {
            x[state] = starts[state];
        }
    }

    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.tapes.deviation.point(now, &[], std);
    }

    fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        let n = process.len();
        match &self.tapes.noise.fixed {
            Some(levels) => {
                process.copy_from_slice(&levels[..n]);
                measurement.copy_from_slice(&levels[n..]);
            }
            None => {
                let all = n + measurement.len();
                let mut levels = SmallVec::<[f64; 16]>::from_elem(0.0, all);
                self.tapes.noise.point(now, x, &mut levels);
                process.copy_from_slice(&levels[..n]);
                measurement.copy_from_slice(&levels[n..]);
            }
        }
        let root = now.dt.sqrt();
        for (level, is_per_second) in process.iter_mut().zip(&self.tapes.per_second) {
            if *is_per_second {
                *level *= root;
            }
        }
    }

    fn limits(&self) -> Vec<Interval> {
        self.limits.clone()
    }

    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        for (x, ends) in x.iter_mut().zip(self.ends(now).as_chunks::<2>().0) {
            match held(*ends) {
                Some(limit) => *x = limit.clamp(*x),
                None if ends[0].is_nan() || ends[1].is_nan() => *x = f64::NAN,
                None => {}
            }
        }
    }

    fn limits_at(&self, now: &Now<'_>) -> Option<Vec<Interval>> {
        let ends = self.ends(now);
        let limits = ends.as_chunks::<2>().0.iter();
        let limits = limits.map(|ends| held(*ends).unwrap_or(Interval::EVERYTHING));
        self.tapes.ends.is_some().then(|| limits.collect())
    }

    fn jumps(&self, now: &Now<'_>) -> Option<Vec<f64>> {
        self.tapes.jumps.as_ref()?.times(now)
    }

    fn integrator(&self) -> Integrator {
        self.integrator
    }

    fn stepping(&self) -> Stepping {
        self.stepping
    }
}

impl Blocks for Program {
    fn drift(&self, now: &Now<'_>, stride: usize, x: &[f64], dx: &mut [f64]) {
        self.tapes.drift.points(now, (stride, x), (stride, dx));
    }

    fn observe(&self, now: &Now<'_>, stride: usize, x: &[f64], y: &mut [f64]) {
        let outputs = self.outline.outputs.len();
        match &self.tapes.observe.plain {
            Some(states) => {
                for (x, y) in x.chunks_exact(stride).zip(y.chunks_exact_mut(outputs)) {
                    for (y, state) in y.iter_mut().zip(states) {
                        *y = x[*state];
                    }
                }
            }
            None => self.tapes.observe.points(now, (stride, x), (outputs, y)),
        }
    }

    fn step_lanes(&self, now: &[Now<'_>], x: &mut [Lanes]) {
        let states = self.limits.len();
        let points = x.len() / states;
        let steps: [f64; LANES] = std::array::from_fn(|lane| now.get(lane).unwrap_or(&now[0]).dt);
        let x = Cell::from_mut(x).as_slice_of_cells();
        let is_discrete = self.integrator == Integrator::Discrete;
        let mut feed = LanesFeed {
            now,
            points,
            states,
            load: |index: usize| x[index].get(),
            take: |point: usize, state: usize, values: Lanes| {
                let cell = &x[point * states + state];
                let before = cell.get();
                cell.set(Lanes(std::array::from_fn(|lane| {
                    let (x, dt) = (before.0[lane], steps[lane]);
                    match is_discrete {
                        true => x + dt * ((values.0[lane] - x) / dt),
                        false => x + dt * values.0[lane],
                    }
                })));
            },
        };
        self.tapes.drift.run(&mut feed);
    }

    fn drift_joined(&self, now: &[Now<'_>], at: Layout, each: usize, x: &[f64], dx: &mut [f64]) {
        let dx = Cell::from_mut(dx).as_slice_of_cells();
        let last = now.len() - 1;
        let mut feed = LanesFeed {
            now,
            points: each / at.stride,
            states: at.stride,
            load: |index: usize| {
                Lanes(std::array::from_fn(|lane| x[lane.min(last) * each + index]))
            },
            take: |point: usize, state: usize, values: Lanes| {
                let rates = dx.iter().skip(point * at.stride + state).step_by(each);
                for (rate, value) in rates.zip(values.0) {
                    rate.set(value);
                }
            },
        };
        self.tapes.drift.run(&mut feed);
    }

    fn is_wide(&self) -> bool {
        self.integrator != Integrator::Discrete
    }

    fn observe_lanes(&self, now: &[Now<'_>], x: &[Lanes], y: &mut [Lanes]) {
        let states = self.limits.len();
        if let Some(plain) = &self.tapes.observe.plain {
            for (x, y) in x.chunks_exact(states).zip(y) {
                *y = x[plain[0]];
            }
            return;
        }
        let mut feed = LanesFeed {
            now,
            points: x.len() / states,
            states,
            load: |index: usize| x[index],
            take: |point: usize, _: usize, values: Lanes| y[point] = values,
        };
        self.tapes.observe.run(&mut feed);
    }
}
