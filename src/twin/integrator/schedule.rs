//! Substeps to a tolerance: chosen at the centre of a filter's points, taken by all points, so that what is between two samples is one smooth
//! function for all of them, and for all θ of the passes that go side by side.

use super::pair::{self, ExplicitPair};
use super::path::{Path, Stretch};
use super::rosenbrock::{self, Rosenbrock};
use super::watch::{EventWatch, EventsOfWay, StepBy};
use super::{Integrator, MOST_SUBSTEPS, Stepping};
use crate::math::three_digits;
use crate::twin::Interval;
use serde::Serialize;

/// Share of the longest step that the tolerance allows: a step that fails costs as much as one that does not.
const SAFETY: f64 = 0.9;
/// Least and most that a step changes the next by: estimates of errors are rough.
const CHANGE: (f64, f64) = (0.2, 5.0);
/// Explicit steps of one sample from which the implicit method is tried, whose step costs some three of these with few states. Twice as many
/// find stiffness later; half tries it where rates are fast and not stiff.
const MANY: usize = 32;
/// Least factor in the number of steps by which the implicit method wins: what its steps cost more.
const WORTH: f64 = 4.0;

/// Shortest step, as a share of the way to the next sample: a hundred times what rounding leaves of times.
const SHORTEST: f64 = 1e-12;

/// Adaptive substeps between the samples of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct StepsTaken {
    /// Samples.
    pub samples: usize,
    /// Substeps of all of them.
    pub substeps: usize,
    /// Most substeps of one.
    pub most: usize,
    /// Samples with implicit steps.
    pub implicit: usize,
}

impl StepsTaken {
    /// Those of two runs.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            substeps: self.substeps + other.substeps,
            most: self.most.max(other.most),
            implicit: self.implicit + other.implicit,
        }
    }

    /// As a sentence has them: `adaptive steps, 3.4 a sample, at most 12`.
    pub(crate) fn text(self) -> String {
        let mean = three_digits(self.substeps as f64 / self.samples.max(1) as f64);
        let implicit = match self.implicit {
            0 => String::new(),
            many if many == self.samples => ", all implicit".into(),
            many => format!(", implicit for {many} of {} samples", self.samples),
        };
        format!(
            "adaptive steps, {mean} a sample, at most {}{implicit}",
            self.most
        )
    }
}

/// Errors of steps that fail: where rates jump, they fall in proportion to the length of the step.
#[derive(Debug, Default)]
struct Roughness {
    /// Length and error of the last step, if that failed.
    failed: Option<(f64, f64)>,
    /// Failures behind a failure, and how many of them have an error of such an order.
    repeated: usize,
    rough: usize,
}

impl Roughness {
    fn see(&mut self, length: f64, error: f64) {
        let failed = (error > 1.0).then_some((length, error));
        // Of lengths that are hardly apart, errors say nothing of an order.
        let before = self.failed.filter(|(longer, _)| *longer > 2.0 * length);
        if let (Some((longer, larger)), Some(_)) = (before, failed) {
            self.repeated += 1;
            let order = (larger / error).ln() / (longer / length).ln();
            self.rough += usize::from(order < 2.0);
        }
        self.failed = failed;
    }

    fn prevails(&self) -> bool {
        self.rough > 1 && 2 * self.rough > self.repeated
    }
}

/// The point by which steps are chosen, its limits, and its events if there are any.
#[derive(Clone, Copy)]
pub(super) struct Centre<'c> {
    pub x: &'c [f64],
    pub limits: &'c [(usize, Interval)],
    pub events: Option<(&'c EventsOfWay<'c>, &'c EventWatch)>,
}

/// Substeps of the way to the next sample.
#[derive(Debug, Clone)]
pub(super) struct SubstepSchedule {
    tolerance: f64,
    /// Least number of substeps.
    least: usize,
    is_implicit: bool,
    /// `true` where explicit steps may give way to implicit ones.
    may_change: bool,
    /// Time and length of the way that the schedule is of.
    of: Option<(f64, f64)>,
    stretches: Vec<Stretch>,
    /// Length of the next step, in seconds.
    next: f64,
    /// Largest size of each state so far.
    sizes: Vec<f64>,
    explicit: ExplicitPair,
    implicit: Rosenbrock,
    taken: StepsTaken,
}

impl SubstepSchedule {
    /// For `states` states; `None` for rules of fixed steps.
    pub fn of(rule: Integrator, stepping: Stepping, states: usize) -> Option<Self> {
        let is_implicit = match rule {
            Integrator::Adaptive => false,
            Integrator::Stiff => true,
            Integrator::Euler | Integrator::RungeKutta4 | Integrator::Discrete => return None,
        };
        Some(Self {
            tolerance: stepping.tolerance,
            least: stepping.substeps.max(1),
            is_implicit,
            may_change: !is_implicit,
            of: None,
            stretches: vec![],
            next: f64::INFINITY,
            sizes: vec![0.0; states],
            explicit: ExplicitPair::default(),
            implicit: Rosenbrock::default(),
            taken: StepsTaken::default(),
        })
    }

    /// Returns whether the steps are implicit.
    pub fn is_implicit(&self) -> bool {
        self.is_implicit
    }

    /// Substeps so far.
    pub fn taken(&self) -> StepsTaken {
        self.taken
    }

    /// Carries points, the first of which is the centre, to the next sample; states are put into their limits behind each step.
    pub fn carry(&mut self, path: &mut Path<'_, '_>, x: &mut [f64], limits: &[(usize, Interval)]) {
        let n = self.sizes.len();
        if n == 0 {
            return;
        }
        let way = (path.now.t, path.now.dt);
        if self.of != Some(way) {
            self.of = Some(way);
            let centre = Centre {
                x: &x[..n],
                limits,
                events: None,
            };
            self.choose(path, centre);
        }
        for i in 0..self.stretches.len() {
            self.step(path, self.stretches[i], x, None);
            limited(n, x, limits);
        }
    }

    /// Returns steps chosen anew, at whose ends the events of the centre are.
    pub fn chosen(&mut self, path: &mut Path<'_, '_>, centre: Centre<'_>) -> Vec<Stretch> {
        self.of = None;
        self.choose(path, centre);
        self.stretches.clone()
    }

    /// Carries points over a stretch; `error` is that of the first.
    pub fn step(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &mut [f64],
        error: Option<&mut [f64]>,
    ) {
        match self.is_implicit {
            true => self.implicit.step(path, of, (&self.sizes, x), error),
            false => self.explicit.step(path, of, x, error),
        }
    }

    /// Chooses the substeps of this way, and the method.
    fn choose(&mut self, path: &mut Path<'_, '_>, centre: Centre<'_>) {
        let limit = match self.may_change && !self.is_implicit {
            true => MANY,
            false => usize::MAX,
        };
        let sizes = self.sizes.clone();
        let choice = self.tried(path, centre, limit).or_else(|covered| {
            let explicit = MANY as f64 / covered.max(SHORTEST);
            let most = (explicit / WORTH).min(MOST_SUBSTEPS as f64) as usize;
            self.sizes.clone_from(&sizes);
            self.is_implicit = true;
            self.tried(path, centre, most).or_else(|_| {
                self.is_implicit = false;
                self.sizes.clone_from(&sizes);
                self.tried(path, centre, usize::MAX)
            })
        });
        // Without a limit a choice is always made.
        let Ok((stretches, next)) = choice else {
            return;
        };
        self.taken.samples += 1;
        self.taken.substeps += stretches.len();
        self.taken.most = self.taken.most.max(stretches.len());
        self.taken.implicit += usize::from(self.is_implicit);
        (self.stretches, self.next) = (stretches, next);
    }

    /// Steps over the whole way within the tolerance, and the length of the next; where they are more than `most`, the share of the way that
    /// so many cover.
    fn tried(
        &mut self,
        path: &mut Path<'_, '_>,
        centre: Centre<'_>,
        most: usize,
    ) -> Result<(Vec<Stretch>, f64), f64> {
        let (n, dt) = (centre.x.len(), path.now.dt);
        let mut events = centre.events.map(|(all, watch)| (all, watch.clone()));
        let order = match self.is_implicit {
            true => rosenbrock::ORDER,
            false => pair::ORDER,
        };
        let (mut stretches, mut next, mut state) = (vec![], self.next, centre.x.to_vec());
        let (mut trial, mut error) = (vec![0.0; n], vec![0.0; n]);
        let (mut from, mut steps, mut shortest) = (0.0, 0, SHORTEST);
        let mut roughness = Roughness::default();
        while from < 1.0 {
            // What jumps is not smooth at any step: when many were taken, the rest of the way is done in as many.
            if steps == MANY && roughness.prevails() {
                shortest = (1.0 - from) / MANY as f64;
            } else if steps >= most && shortest == SHORTEST {
                return Err(from);
            } else if steps == MOST_SUBSTEPS {
                shortest = shortest.max((1.0 - from) / MOST_SUBSTEPS as f64);
            }
            steps += 1;
            let end = path.next_break(from);
            let longest = (next / dt).min(1.0 / self.least as f64);
            let parts = ((end - from) / longest.max(shortest)).ceil().max(1.0);
            let of = Stretch {
                from,
                length: (end - from) / parts,
            };
            trial.copy_from_slice(&state);
            self.step(path, of, &mut trial, Some(&mut error));
            let size = self.error(&state, &trial, &error);
            let factor = match size.is_finite() {
                true => (SAFETY * size.powf(-1.0 / order)).clamp(CHANGE.0, CHANGE.1),
                false => CHANGE.0,
            };
            next = factor * of.length * dt;
            roughness.see(of.length, size);
            if size <= 1.0 || longest <= shortest {
                let mut reached = if parts == 1.0 { end } else { from + of.length };
                let mut of = of;
                if let Some((events, watch)) = &mut events {
                    let mut step = |path: &mut Path<'_, '_>, of: Stretch, x: &mut [f64]| {
                        self.step(path, of, x, None);
                    };
                    let way = (&mut *path, &mut step as &mut StepBy<'_>);
                    let done = watch.cut(events, way, of, (&state, &mut trial));
                    if done.length < of.length {
                        (of, reached) = (done, done.from + done.length);
                    }
                    watch.reach(events, path, reached, &mut trial);
                    if watch.fault().is_some() {
                        (of.length, reached) = (1.0 - of.from, 1.0);
                    }
                }
                limited(n, &mut trial, centre.limits);
                for (size, x) in self.sizes.iter_mut().zip(&trial) {
                    *size = if x.is_finite() {
                        size.max(x.abs())
                    } else {
                        *size
                    };
                }
                std::mem::swap(&mut state, &mut trial);
                stretches.push(of);
                from = reached;
            }
        }
        Ok((stretches, next))
    }

    /// Largest error of a step over the tolerance of its state.
    fn error(&self, from: &[f64], to: &[f64], error: &[f64]) -> f64 {
        let mut largest: f64 = 0.0;
        for (i, error) in error.iter().enumerate() {
            if *error == 0.0 {
                continue;
            }
            let size = self.sizes[i].max(from[i].abs()).max(to[i].abs());
            let share = error.abs() / (self.tolerance * size);
            if !share.is_finite() {
                return f64::INFINITY;
            }
            largest = largest.max(share);
        }
        largest
    }
}

/// Puts points into their limits.
pub(super) fn limited(n: usize, x: &mut [f64], limits: &[(usize, Interval)]) {
    for &(j, limit) in limits {
        for x in x.iter_mut().skip(j).step_by(n) {
            *x = limit.clamp(*x);
        }
    }
}
