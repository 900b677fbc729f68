//! A user's equations as the engine calls them: one call for all points of a step, compiled for each twin with its equations inline.

use super::simulation::{DeadTime, RunSetup, RunningTwin, check_lengths, simulate};
use super::{Acting, Composed};
use crate::math::{LANES, Lanes};
use crate::record::{Drive, Signal, Signals};
use crate::twin::integrator::felt;
use crate::twin::points::{
    Layout, Points, advance_one_by_one, advance_together, lanes_one_by_one, noise_lanes,
    observe_lanes, readout_lanes, readout_one_by_one,
};
use crate::twin::{
    DigitalTwin, Event, EventCalls, Integrator, Noise, Now, ParameterSpace, SimulationError,
    StateSpace, TellJumps, Workspace,
};
use std::sync::Arc;

/// Calls of the engine that every user's equations have and none defines.
///
/// It is implemented for all of them at once, so that its loops are compiled with the equations inline: a filter that holds a
/// `dyn Engine` pays one call for all its points.
pub(crate) trait Engine: StateSpace {
    /// Rates of points.
    fn drift_points(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]);

    /// Outputs of points, `p` each.
    fn observe_points(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]);

    /// Moves what changes at samples only.
    fn update_points(&self, now: &Now<'_>, at: Layout, x: &mut [f64]);

    /// Constrains points.
    fn constrain_points(&self, now: &Now<'_>, at: Layout, x: &mut [f64]);

    /// Puts outputs, `p` each, through the readout; returns whether it changed any.
    fn readout_points(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool;

    /// Carries the points of a filter over a step; returns whether a constraint acted on any that matters to the noise.
    fn advance_points(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool;

    /// As [`advance_points`](Self::advance_points) for several filters, one a lane; `one` holds points and shifts of one of them.
    fn advance_lanes(
        &self,
        now: &[Now<'_>],
        points: Points<'_, Lanes>,
        one: (&mut [f64], &mut [f64]),
        work: &mut Workspace,
    ) -> [bool; LANES];

    /// One output of the points, `n` states each, of several filters, one a lane; `buffer` holds those of one of them.
    fn observe_lanes(
        &self,
        now: &[Now<'_>],
        n: usize,
        x: &[Lanes],
        y: &mut [Lanes],
        buffer: &mut [f64],
    );

    /// Noise levels of the states `x`, four at most, and the output of several filters, one a lane.
    fn noise_lanes(
        &self,
        now: &[Now<'_>],
        x: &[Lanes],
        process: &mut [Lanes],
        measurement: &mut Lanes,
    );

    /// Values of one output of several filters, one a lane, through the readout; returns the lanes that it changed.
    fn readout_lanes(&self, now: &[Now<'_>], y: &mut [Lanes]) -> [bool; LANES];

    /// One run of the equations alone.
    fn run(&self, setup: RunSetup<'_>, noise: Noise) -> Result<Signal, SimulationError>;
}

impl<T: StateSpace> Engine for T {
    fn drift_points(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        for (x, dx) in at.each(x).zip(at.each_mut(dx)) {
            rates(self, now, x, dx);
        }
    }

    fn observe_points(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        for (i, y) in y.chunks_exact_mut(p).enumerate() {
            self.observe(now, &x[i * at.stride..][..at.states], y);
        }
    }

    fn update_points(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        for x in at.each_mut(x) {
            self.update(now, x);
        }
    }

    fn constrain_points(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        for x in at.each_mut(x) {
            self.constrain(now, x);
        }
    }

    fn readout_points(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool {
        match p {
            1 => readout_one_by_one(1, y, |y| self.readout(now, y)),
            p => readout_one_by_one(p, y, |y| self.readout(now, y)),
        }
    }

    fn advance_points(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool {
        if work.is_adaptive() {
            return advance_adaptively(self, now, points, work);
        }
        // Loops of known length, for the sizes of most twins.
        let advance = |x: &mut [f64]| step(self, &[], now, x, work);
        let constrain = |x: &mut [f64]| self.constrain(now, x);
        match points.shifts.len() {
            1 => advance_one_by_one(1, points, advance, constrain),
            2 => advance_one_by_one(2, points, advance, constrain),
            3 => advance_one_by_one(3, points, advance, constrain),
            4 => advance_one_by_one(4, points, advance, constrain),
            5 => advance_one_by_one(5, points, advance, constrain),
            n => advance_one_by_one(n, points, advance, constrain),
        }
    }

    fn advance_lanes(
        &self,
        now: &[Now<'_>],
        points: Points<'_, Lanes>,
        one: (&mut [f64], &mut [f64]),
        work: &mut Workspace,
    ) -> [bool; LANES] {
        let tell = |tell: &mut TellJumps<'_>| {
            now.iter().for_each(|now| tell(now, self.jumps(now)));
        };
        work.together(tell, |work| {
            let advance =
                |now: &Now<'_>, points: Points<'_>| self.advance_points(now, points, work);
            match points.shifts.len() {
                1 => lanes_one_by_one(1, now, points, one, advance),
                2 => lanes_one_by_one(2, now, points, one, advance),
                3 => lanes_one_by_one(3, now, points, one, advance),
                n => lanes_one_by_one(n, now, points, one, advance),
            }
        })
    }

    fn observe_lanes(
        &self,
        now: &[Now<'_>],
        n: usize,
        x: &[Lanes],
        y: &mut [Lanes],
        buffer: &mut [f64],
    ) {
        let observe = |now: &Now<'_>, x: &[f64], y: &mut [f64]| {
            self.observe_points(now, Layout::dense(n), 1, x, y);
        };
        match n {
            1 => observe_lanes(1, now, x, y, buffer, observe),
            2 => observe_lanes(2, now, x, y, buffer, observe),
            3 => observe_lanes(3, now, x, y, buffer, observe),
            n => observe_lanes(n, now, x, y, buffer, observe),
        }
    }

    fn noise_lanes(
        &self,
        now: &[Now<'_>],
        x: &[Lanes],
        process: &mut [Lanes],
        measurement: &mut Lanes,
    ) {
        let noise = |now: &Now<'_>, x: &[f64], q: &mut [f64], r: &mut [f64]| {
            self.noise(now, x, q, r);
        };
        let (n, levels) = (process.len(), (process, measurement));
        match n {
            1 => noise_lanes(1, now, x, levels, noise),
            2 => noise_lanes(2, now, x, levels, noise),
            3 => noise_lanes(3, now, x, levels, noise),
            n => noise_lanes(n, now, x, levels, noise),
        }
    }

    fn readout_lanes(&self, now: &[Now<'_>], y: &mut [Lanes]) -> [bool; LANES] {
        readout_lanes(now, y, |now, y| self.readout_points(now, 1, y))
    }

    fn run(&self, mut setup: RunSetup<'_>, noise: Noise) -> Result<Signal, SimulationError> {
        let events = setup.outline.events.as_slice();
        simulate(&Alone(self, events), &mut setup, noise)
    }
}

impl<T: StateSpace + 'static> DigitalTwin for T {
    fn parameters(&self) -> ParameterSpace {
        self.outline().parameters
    }

    fn signals(&self) -> Signals {
        self.outline().signals()
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        run_alone(self, theta, drive, noise)
    }

    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        run_alone(self, theta, drive, Noise::OFF)
    }

    fn equations(self: Arc<Self>) -> Option<Composed> {
        Some(Composed::new(self))
    }
}

/// One run of equations that nothing is added to.
fn run_alone<T: StateSpace>(
    twin: &T,
    theta: &[f64],
    drive: &Drive,
    noise: Noise,
) -> Result<Signal, SimulationError> {
    let outline = twin.outline();
    check_lengths(&outline, theta, drive)?;
    twin.check_parameters(theta, drive.dt())?;
    let (limits, stepping) = (twin.limits(), twin.stepping());
    let mut setup = RunSetup {
        outline: &outline,
        limits: felt(&limits),
        acting: Acting::plain(theta, drive, outline.holds(stepping.hold)),
        dead_time: DeadTime::NONE,
        work: Workspace::of(
            &outline.holds(stepping.hold),
            &limits,
            (twin.integrator(), stepping),
            &outline.events,
        ),
    };
    simulate(&Alone(twin, &outline.events), &mut setup, noise)
}

/// Carries points over a step in substeps to a tolerance, the same for all.
#[inline(never)]
fn advance_adaptively<T: StateSpace>(
    twin: &T,
    now: &Now<'_>,
    points: Points<'_>,
    work: &mut Workspace,
) -> bool {
    let n = points.shifts.len();
    let at = Layout::dense(n);
    let mut drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| twin.drift_points(now, at, x, dx);
    let carry = |x: &mut [f64], work: &mut Workspace| {
        twin.update_points(now, at, x);
        work.jump_at(|tell| tell(now, twin.jumps(now)));
        work.limit_to(|| twin.limits_at(now));
        work.carry_refined(n, now, x, &mut drift);
    };
    let constrain = |x: &mut [f64]| twin.constrain_points(now, at, x);
    advance_together(n, points, work, carry, constrain)
}

/// One step of one state without noise and limits: memories, then motion.
#[inline(always)]
fn step<T: StateSpace>(
    twin: &T,
    events: &[Event],
    now: &Now<'_>,
    x: &mut [f64],
    work: &mut Workspace,
) {
    twin.update(now, x);
    // One call of the drift, compiled inline, for what most twins do.
    if work.is_plain() {
        let drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| rates(twin, now, x, dx);
        return Integrator::Euler.step(now, x, work.stages(), drift);
    }
    carry(twin, events, now, x, work);
}

/// One step by any integrator, in substeps, with these events.
#[inline(never)]
fn carry<T: StateSpace>(
    twin: &T,
    events: &[Event],
    now: &Now<'_>,
    x: &mut [f64],
    work: &mut Workspace,
) {
    let drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| rates(twin, now, x, dx);
    let calls = EventCalls {
        list: events,
        late: 0.0,
        states: x.len(),
        inside: &|now, _, then| then(now),
    };
    work.jump_at(|tell| tell(now, twin.jumps(now)));
    work.limit_to(|| twin.limits_at(now));
    work.carry_with_events(&calls, x.len(), now, x, drift);
}

/// Rates of one state; of a twin in discrete time, those that lead to the next sample.
#[inline(always)]
fn rates<T: StateSpace>(twin: &T, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
    twin.drift(now, x, dx);
    if twin.integrator() == Integrator::Discrete {
        as_rates(now, x, dx);
    }
}

/// Turns the next state of a twin in discrete time into rates: forces of effects and memories of sensors have rates, too.
#[inline(always)]
pub(super) fn as_rates(now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
    for (dx, x) in dx.iter_mut().zip(x) {
        *dx = (*dx - x) / now.dt;
    }
}

/// A user's equations without any parts, in a run.
struct Alone<'t, T>(&'t T, &'t [Event]);

impl<T: StateSpace> RunningTwin for Alone<'_, T> {
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.start(now, x);
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.0.start_deviation(now, std);
    }
    fn begin(&self, _: &Now<'_>, _: &mut [f64]) {}
    fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        self.0.noise(now, x, process, measurement);
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.0.observe(now, x, y);
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.0.readout(now, y);
    }
    fn step(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace) {
        step(self.0, self.1, now, x, work);
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.constrain(now, x);
    }
}
