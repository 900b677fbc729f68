//! Substeps to a tolerance: chosen for the points of a filter together and taken by all of them, so that what is between two samples is one smooth
//! function for all of them, and for all θ of the passes that go side by side.

mod roughness;
mod taken;

use super::event_calls::{EventsOfWay, StepBy};
use super::jump::{JumpsSeen, step_with_jumps};
use super::pair::{self, ExplicitPair};
use super::path::{Path, Stretch};
use super::rosenbrock::{self, Rosenbrock};
use super::rule::{Integrator, MOST_SUBSTEPS, Stepping};
use super::watch::EventWatch;
use crate::setting::number;
use roughness::{Falls, JUMPS};
pub use taken::StepsTaken;

/// Share of the longest step that the tolerance allows: a step that fails costs as much as one that does not.
const SAFETY: f64 = 0.9;
/// Least and most that a step changes the next by: estimates of errors are rough.
const CHANGE: (f64, f64) = (0.2, 5.0);
/// Explicit steps of one sample, at the limit of their stability, from which the implicit method is tried, whose step costs some three of these with
/// few states. Twice as many find stiffness later; half tries it where few steps would do.
const MANY: usize = 32;
/// Steps of one sample of several points after which jumps of rates are no longer followed, as each point meets them at its own time. Half
/// gives up before a jump that all meet at one time is located, twice as many cost twice. Of a single run [`MANY`] times as many, as a jump is
/// located in some thirty.
const FEW: usize = 8;
/// Least factor in the number of steps by which the implicit method wins: what its steps cost more.
const WORTH: f64 = 4.0;

/// Shortest step, as a share of the way to the next sample: a hundred times what rounding leaves of times.
const SHORTEST: f64 = 1e-12;

/// Outcome of steps to a tolerance.
enum SampleSteps {
    /// They cover the whole way.
    Done,
    /// Rates jump again and again.
    Rough,
    /// More than allowed are needed; so many cover this share of the way.
    Many { covered: f64 },
}

/// All events of a way, and what the one point that is carried has had of them; `None` where steps heed the tolerance alone.
pub(super) type WayEvents<'c> = Option<(&'c EventsOfWay<'c>, EventWatch)>;

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
    /// Largest size of each state of the centre so far.
    sizes: Vec<f64>,
    /// Other points less the centre where the way begins; none where all are carried.
    beside: Vec<f64>,
    /// `true` where rates jump in this sample: steps are then of one length, and no high order is of use.
    is_even: bool,
    /// Where rates have jumped in such steps.
    jumps_seen: JumpsSeen,
    explicit: ExplicitPair,
    implicit: Rosenbrock,
    buffers: ScheduleBuffers,
    taken: StepsTaken,
    /// Steps beyond [`MOST_SUBSTEPS`] of a sample that the run may still take: a gap in a record has many, not every sample.
    spare: usize,
    /// A sentence about steps that the tolerance needs and that are not taken.
    fault: Option<String>,
}

/// Buffers of a sample's choice, kept so that none allocates.
#[derive(Debug, Clone, Default)]
struct ScheduleBuffers {
    /// Points and sizes before the first step.
    start: Vec<f64>,
    sizes: Vec<f64>,
    /// Points behind a step, and its errors.
    trial: Vec<f64>,
    errors: Vec<f64>,
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
            beside: vec![],
            is_even: false,
            jumps_seen: JumpsSeen::default(),
            explicit: ExplicitPair::default(),
            implicit: Rosenbrock::default(),
            buffers: ScheduleBuffers::default(),
            taken: StepsTaken::default(),
            // A hundredth of a second of equations that take 100 ns.
            spare: 100 * MOST_SUBSTEPS,
            fault: None,
        })
    }

    /// Returns whether the steps are implicit.
    pub fn is_implicit(&self) -> bool {
        self.is_implicit
    }

    /// Returns what is wrong with a run whose steps are too many.
    pub fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }

    /// Substeps so far.
    pub fn taken(&self) -> StepsTaken {
        self.taken
    }

    /// Carries points of one filter to the next sample; states are put into their limits behind each step. Points that follow over the same way
    /// take the steps of the first ones.
    pub fn carry(&mut self, path: &mut Path<'_, '_>, x: &mut [f64]) {
        if self.sizes.is_empty() {
            return;
        }
        let way = (path.now.t, path.now.dt);
        if self.of != Some(way) {
            self.of = Some(way);
            let is_followed = x.len() > self.sizes.len();
            self.beside.clear();
            return self.choose((path, is_followed), x, &None);
        }
        if self.stretches.is_empty() {
            // The first ones gave up.
            return x.fill(f64::NAN);
        }
        for i in 0..self.stretches.len() {
            self.step(path, self.stretches[i], x, None);
            path.limit(x);
        }
    }

    /// Returns steps chosen for the first of these points, at whose ends its events are; the others are seen where it is told what kind of step fails.
    pub fn chosen(
        &mut self,
        path: &mut Path<'_, '_>,
        x: &[f64],
        events: &WayEvents<'_>,
    ) -> Vec<Stretch> {
        let (centre, others) = x.split_at(self.sizes.len());
        let beside = others.iter().zip(centre.iter().cycle());
        self.beside.clear();
        self.beside.extend(beside.map(|(other, x)| other - x));
        self.of = None;
        self.choose((path, !others.is_empty()), &mut centre.to_vec(), events);
        self.stretches.clone()
    }

    /// Carries points over a stretch.
    pub fn step(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &mut [f64],
        errors: Option<&mut [f64]>,
    ) {
        let (sizes, n) = (&self.sizes, self.sizes.len());
        if !self.is_even {
            return match self.is_implicit {
                true => self.implicit.step(path, of, (sizes, x), errors),
                false => self.explicit.step(path, of, x, errors),
            };
        }
        let mut implicit = |path: &mut Path<'_, '_>, of: Stretch, x: &mut [f64]| {
            self.implicit.step(path, of, (sizes, x), None);
        };
        let implicit = (self.is_implicit).then_some(&mut implicit as &mut StepBy<'_>);
        step_with_jumps(path, of, (n, x, &mut self.jumps_seen), implicit);
    }

    /// Chooses the method and the substeps of this way, and takes them.
    fn choose(
        &mut self,
        (path, is_followed): (&mut Path<'_, '_>, bool),
        x: &mut [f64],
        events: &WayEvents<'_>,
    ) {
        let patience = if is_followed { FEW } else { FEW * MANY };
        let mut buffers = std::mem::take(&mut self.buffers);
        buffers.begin(x, &self.sizes);
        let was_rough = std::mem::take(&mut self.is_even);
        let begins_rough = was_rough && {
            let shortest = 1.0 / self.even(path, x) as f64;
            self.jumps(path, x, 0.0, [shortest, 1.0])
        };
        let most = match self.may_change && !self.is_implicit {
            true => MANY,
            false => usize::MAX,
        };
        let mut outcome = match begins_rough {
            true => SampleSteps::Rough,
            false => self.tried(path, x, events, (most, patience, &mut buffers)),
        };
        if let SampleSteps::Many { covered } = outcome {
            let explicit = MANY as f64 / covered.max(SHORTEST);
            let most = (explicit / WORTH).min(MOST_SUBSTEPS as f64) as usize;
            buffers.undo(x, &mut self.sizes);
            self.is_implicit = true;
            outcome = self.tried(path, x, events, (most, patience, &mut buffers));
            if !matches!(outcome, SampleSteps::Done) {
                self.is_implicit = false;
                buffers.undo(x, &mut self.sizes);
                outcome = self.tried(path, x, events, (usize::MAX, patience, &mut buffers));
            }
        }
        if matches!(outcome, SampleSteps::Rough) {
            buffers.undo(x, &mut self.sizes);
            self.take_even_steps(path, x, (events, &mut buffers.trial));
        }
        self.buffers = buffers;
        self.taken.samples += 1;
        self.taken.substeps += self.stretches.len();
        self.taken.most = self.taken.most.max(self.stretches.len());
        self.taken.implicit += usize::from(self.is_implicit);
    }

    /// Takes steps within the tolerance, for all points, over the whole way, unless rates jump or more than `most` are needed.
    fn tried(
        &mut self,
        path: &mut Path<'_, '_>,
        x: &mut [f64],
        events: &WayEvents<'_>,
        (most, patience, buffers): (usize, usize, &mut ScheduleBuffers),
    ) -> SampleSteps {
        let dt = path.now.dt;
        let mut events = events.clone();
        let order = match self.is_implicit {
            true => rosenbrock::ORDER,
            false => pair::ORDER,
        };
        let ScheduleBuffers { trial, errors, .. } = buffers;
        let (mut next, mut from, mut steps, mut shortest) = (self.next, 0.0, 0, SHORTEST);
        // Tries up to the last place at which several steps in a row were kept.
        let mut settled = 0;
        let mut falls = Falls::default();
        self.stretches.clear();
        while from < 1.0 {
            enter(path, &mut events, from, x);
            let tries = steps - settled;
            if tries >= patience && falls.repeat() {
                return SampleSteps::Rough;
            }
            let lengths = JUMPS.map(|factor| factor * next / dt);
            // Steps short enough to stay on a jump are all kept.
            let is_long = steps > 0 && steps % (4 * patience) == 0;
            let is_tried = tries > 0 && tries % patience == 0;
            if (is_tried || is_long) && self.jumps(path, x, from, lengths) {
                return SampleSteps::Rough;
            }
            // Explicit steps that are short for another reason than stiffness go on.
            if steps >= most && (self.is_implicit || falls.are_stiff()) {
                return SampleSteps::Many { covered: from };
            }
            if steps >= MOST_SUBSTEPS {
                if self.spare == 0 && shortest == SHORTEST {
                    shortest = (1.0 - from) / MOST_SUBSTEPS as f64;
                }
                self.spare = self.spare.saturating_sub(1);
            }
            steps += 1;
            let end = path.next_break(from);
            let longest = (next / dt).min(1.0 / self.least as f64);
            let parts = ((end - from) / longest.max(shortest)).ceil().max(1.0);
            let of = Stretch {
                from,
                length: (end - from) / parts,
            };
            trial.copy_from_slice(x);
            self.step(path, of, trial, Some(errors));
            path.limit_errors(of, trial, errors);
            let size = self.largest((x, trial), errors);
            falls.see(size <= 1.0, self.explicit.reach(), || {
                self.is_by_time(path, of, x)
            });
            // A single run goes on from jump to jump.
            if falls.kept_in_row == FEW && patience > FEW {
                (settled, falls.rows) = (steps, 0);
            }
            let factor = match size.is_finite() {
                true => (SAFETY * size.powf(-1.0 / order)).clamp(CHANGE.0, CHANGE.1),
                false => CHANGE.0,
            };
            // A step that a jump cuts short says little of the next.
            let is_cut = path.edge > 0.0 && parts == 1.0 && of.length < longest && size <= 1.0;
            let before = if is_cut { next } else { 0.0 };
            next = before.max(factor * of.length * dt);
            // A thousand steps with a thousandth of a state's size each are no way. At a jump of rates, a shortest step may have any error.
            let is_forced = shortest > SHORTEST && longest <= shortest;
            if is_forced && size.is_finite() && size > 1e-3 / self.tolerance {
                self.give_up(path, x);
                return SampleSteps::Done;
            }
            // No shorter step has numbers either.
            if size.is_infinite() && longest <= SHORTEST {
                self.stretches.clear();
                x.fill(f64::NAN);
                return SampleSteps::Done;
            }
            if size <= 1.0 || longest <= shortest {
                let reached = if parts == 1.0 { end } else { from + of.length };
                from = self.keep(path, &mut events, (of, reached), (x, trial));
            }
        }
        self.next = next;
        SampleSteps::Done
    }

    /// Ends the run of these points.
    fn give_up(&mut self, path: &Path<'_, '_>, x: &mut [f64]) {
        let [from, to] = [path.now.t, path.now.end].map(number);
        let other = match self.may_change {
            true => "the stiff integrator",
            false => "another integrator",
        };
        self.fault = Some(format!(
            "the tolerance needs too many steps between t = {from} s and {to} s; give rows between, or choose {other}"
        ));
        self.stretches.clear();
        x.fill(f64::NAN);
    }

    /// Keeps a step from `x` to `trial`, up to its first event, and moves `x`; returns the share of the way that is reached.
    fn keep(
        &mut self,
        path: &mut Path<'_, '_>,
        events: &mut WayEvents<'_>,
        (mut of, mut reached): (Stretch, f64),
        (x, trial): (&mut [f64], &mut [f64]),
    ) -> f64 {
        let n = self.sizes.len();
        if let Some((events, watch)) = events {
            let mut step = |path: &mut Path<'_, '_>, of: Stretch, x: &mut [f64]| {
                self.step(path, of, x, None);
            };
            let way = (&mut *path, &mut step as &mut StepBy<'_>);
            let done = watch.cut(events, way, of, (x, trial));
            if done.length < of.length {
                (of, reached) = (done, done.from + done.length);
            }
            watch.reach(events, path, reached, trial);
            if watch.fault().is_some() {
                (of.length, reached) = (1.0 - of.from, 1.0);
            }
        }
        x.copy_from_slice(trial);
        path.limit(x);
        self.see(&x[..n]);
        self.stretches.push(of);
        reached
    }

    /// Takes steps of one length: what jumps is smooth at none, and a length that follows no point moves no point's result in leaps.
    fn take_even_steps(
        &mut self,
        path: &mut Path<'_, '_>,
        x: &mut [f64],
        (events, trial): (&WayEvents<'_>, &mut [f64]),
    ) {
        // Where rates are fast besides, as many as the smooth samples before took.
        let smooth = (path.now.dt / self.next).ceil() as usize;
        let least = (self.even(path, x) * self.least).min(MOST_SUBSTEPS);
        let steps = smooth.clamp(least, MOST_SUBSTEPS + self.spare);
        self.spare -= steps.saturating_sub(MOST_SUBSTEPS);
        let longest = 1.0 / steps as f64;
        let (mut events, mut from) = (events.clone(), 0.0);
        self.is_even = true;
        self.stretches.clear();
        while from < 1.0 {
            enter(path, &mut events, from, x);
            let end = path.next_break(from);
            let parts = ((end - from) / longest - SHORTEST).ceil().max(1.0);
            let of = Stretch {
                from,
                length: (end - from) / parts,
            };
            trial.copy_from_slice(x);
            self.step(path, of, trial, None);
            let reached = if parts == 1.0 { end } else { from + of.length };
            from = self.keep(path, &mut events, (of, reached), (x, trial));
        }
    }

    /// Remembers the largest size of each state of the centre.
    fn see(&mut self, x: &[f64]) {
        for (size, x) in self.sizes.iter_mut().zip(x) {
            if x.is_finite() {
                *size = size.max(x.abs());
            }
        }
    }
}

/// Fires events of the one point that is carried where a stretch begins.
fn enter(path: &mut Path<'_, '_>, events: &mut WayEvents<'_>, from: f64, x: &mut [f64]) {
    if let Some((events, watch)) = events {
        watch.enter(events, path, from, x);
    }
}

impl ScheduleBuffers {
    /// Remembers points and sizes before the first step.
    fn begin(&mut self, x: &[f64], sizes: &[f64]) {
        for buffer in [&mut self.start, &mut self.trial, &mut self.errors] {
            buffer.clear();
            buffer.extend_from_slice(x);
        }
        self.sizes.clear();
        self.sizes.extend_from_slice(sizes);
    }

    /// Takes all steps back.
    fn undo(&self, x: &mut [f64], sizes: &mut [f64]) {
        x.copy_from_slice(&self.start);
        sizes.copy_from_slice(&self.sizes);
    }
}
