//! The loop that simulates equations, and the inputs that act on them.

use super::Composed;
use super::parts::Theta;
use crate::record::{Drive, Signal, on_line};
use crate::setting::{count, number};
use crate::twin::integrator::{Bends, Between, remove_amounts};
use crate::twin::{Hold, Interval, Noise, Now, Outline, SimulationError, Workspace};
use std::borrow::Cow;

/// Checks that θ has the twin's length.
pub(super) fn check_length(parameters: usize, theta: &[f64]) -> Result<(), SimulationError> {
    if theta.len() == parameters {
        return Ok(());
    }
    Err(SimulationError::fatal(format!(
        "{} parameter values given, the twin has {parameters}",
        theta.len()
    )))
}

/// Checks lengths once, before the loop relies on them.
pub(super) fn check_lengths(
    outline: &Outline,
    theta: &[f64],
    drive: &Drive,
) -> Result<(), SimulationError> {
    check_length(outline.parameters.len(), theta)?;
    let (given, inputs) = (drive.inputs().ncols(), outline.inputs.len());
    if given != inputs {
        return Err(SimulationError::fatal(format!(
            "the drive has {}, the twin has {inputs}",
            count(given, "input")
        )));
    }
    Ok(())
}

/// Most steps from the start to the first row: a pass over the record takes them, too. A thousand records of a thousand rows; with ten times
/// as many a fit takes hours, a tenth cuts off what a slow system still feels.
const MOST_BEFORE: f64 = 1e6;
/// Share of a step within which the start and the first row are the same.
const SAME: f64 = 1e-6;

/// Steps from the start to the first row of a drive, of Δt but for a shorter first one.
#[derive(Debug, Clone, Copy)]
struct LeadIn {
    begun: f64,
    steps: usize,
    /// Length of the first step.
    first: f64,
}

impl LeadIn {
    /// From a start at this time; an error where it is after the first row, or too long before it.
    fn of(drive: &Drive, begun: f64) -> Result<Self, String> {
        let (first_row, dt) = (drive.first_time(), drive.dt());
        let steps = ((first_row - begun) / dt - SAME).ceil();
        if first_row - begun < -SAME * dt {
            return Err(format!(
                "the start belongs to {} s, after the first row at {} s; give the time of that row or an earlier one",
                number(begun),
                number(first_row)
            ));
        }
        if steps.is_nan() || steps > MOST_BEFORE {
            return Err(format!(
                "the start belongs to {} s, {} steps before the first row at {} s; at most {MOST_BEFORE} are run: give a later time",
                number(begun),
                number(steps),
                number(first_row)
            ));
        }
        let steps = steps.max(0.0);
        Ok(Self {
            begun,
            steps: steps as usize,
            first: first_row - begun - (steps - 1.0) * dt,
        })
    }
}

/// A drive as the equations of a twin see it at θ.
pub(crate) struct Acting<'d> {
    drive: Cow<'d, Drive>,
    /// Rule of each input between samples; empty where all are held.
    holds: Vec<Hold>,
    bends: Bends,
    /// Inputs before the first row, which no amount is added at; empty where the start is that row.
    inputs_before: Vec<f64>,
    /// All of θ, held entries too.
    theta: Theta,
    before: LeadIn,
}

/// Seconds from the start of each step before the first row of a drive to that row; none where the start is that row.
pub(crate) fn seconds_before(twin: &Composed, drive: &Drive) -> Vec<f64> {
    let first_row = drive.first_time();
    let Some(Ok(before)) = twin.begins().map(|begun| LeadIn::of(drive, begun)) else {
        return vec![];
    };
    let left = (1..before.steps).rev().map(|left| left as f64 * drive.dt());
    let all = std::iter::once(first_row - before.begun).chain(left);
    all.take(before.steps).collect()
}

/// Checks that the start of a twin does not belong to a time after the first row of a drive.
pub(crate) fn check_start(twin: &Composed, drive: &Drive) -> Result<(), String> {
    (twin.begins()).map_or(Ok(()), |begun| LeadIn::of(drive, begun).map(drop))
}

impl<'d> Acting<'d> {
    /// The drive behind the actuators of `twin`.
    pub fn of(twin: &Composed, theta: &[f64], drive: &'d Drive) -> Result<Self, SimulationError> {
        let drive = match twin.actuated(theta, drive)? {
            Some(actuated) => Cow::Owned(actuated),
            None => Cow::Borrowed(drive),
        };
        let begun = twin.begins().unwrap_or(drive.first_time());
        let before = LeadIn::of(&drive, begun).map_err(SimulationError::fatal)?;
        let holds = between(twin.holds());
        let mut inputs_before = vec![];
        if before.steps > 0 {
            inputs_before.extend_from_slice(drive.input(0));
            remove_amounts(&mut inputs_before, &holds);
        }
        Ok(Self {
            before,
            inputs_before,
            bends: Bends::of(&drive, &holds),
            drive,
            holds,
            theta: twin.complete(theta),
        })
    }

    /// The drive as it is recorded.
    pub(super) fn plain(theta: &[f64], drive: &'d Drive, holds: Vec<Hold>) -> Self {
        let holds = between(holds);
        Self {
            bends: Bends::of(drive, &holds),
            drive: Cow::Borrowed(drive),
            holds,
            inputs_before: vec![],
            theta: Theta::from_slice(theta),
            before: LeadIn {
                begun: drive.first_time(),
                steps: 0,
                first: drive.dt(),
            },
        }
    }

    /// Number of steps from the start to the first row.
    pub fn steps_before(&self) -> usize {
        self.before.steps
    }

    /// The start: the first row, or an earlier time with its inputs.
    pub fn start(&self) -> Now<'_> {
        match self.before.steps {
            0 => self.at(0),
            _ => self.before(0),
        }
    }

    /// Step i from the start to the first row, whose inputs are held.
    pub fn before(&self, i: usize) -> Now<'_> {
        let (dt, before) = (self.drive.dt(), self.before);
        let mut now = self.at(0);
        let first_row = now.t;
        let time = |i: usize| match before.steps - i {
            0 => first_row,
            left if left == before.steps => before.begun,
            left => first_row - left as f64 * dt,
        };
        now.between = None;
        now.u = &self.inputs_before;
        now.dt = if i == 0 { before.first } else { dt };
        (now.t, now.end) = (time(i), time(i + 1));
        now.since = if i < 2 { before.first } else { dt };
        now
    }

    /// Returns whether row k + 1 is another reading of the state of row k, to which nothing moves.
    #[inline(always)]
    pub fn stands(&self, k: usize) -> bool {
        self.drive.is_repeated(k)
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.drive.samples()
    }

    /// Leaves out entries of θ from this one on.
    pub(super) fn first_entries(&mut self, entries: usize) {
        self.theta.truncate(entries);
    }

    /// Row k. The last input is held.
    #[inline]
    pub fn at(&self, k: usize) -> Now<'_> {
        let mut now = Now {
            first_time: self.drive.first_time(),
            begun: self.before.begun,
            ..Now::new(0.0, 0.0, &[], &self.theta)
        };
        self.go_to(k, &mut now);
        now
    }

    /// Moves on to row k. In place: eight of these a row are not worth a copy.
    #[inline(always)]
    pub fn go_to<'a>(&'a self, k: usize, now: &mut Now<'a>) {
        let drive = self.drive.as_ref();
        (now.t, now.dt, now.u) = (drive.own_time(k), drive.step(k), drive.input(k));
        now.end = drive.own_time(k + 1);
        if now.dt == 0.0 {
            // Nothing moves to a replicate; what is asked here is asked at a usual step.
            now.dt = drive.dt();
            now.end = now.t + now.dt;
        }
        now.since = match k {
            0 if self.before.steps == 1 => self.before.first,
            k => drive.since(k),
        };
        if !self.holds.is_empty() {
            let next = drive.input((k + 1).min(drive.samples() - 1));
            now.between = Some(Between {
                next,
                holds: &self.holds,
                bends: self.bends.behind(k),
            });
        }
    }
}

/// Rules of inputs, none where all are held.
fn between(holds: Vec<Hold>) -> Vec<Hold> {
    match holds.iter().all(|hold| *hold == Hold::Zero) {
        true => vec![],
        false => holds,
    }
}

/// Equations in a run, without what acts before it and on its finished outputs.
pub(super) trait RunningTwin {
    fn start(&self, now: &Now<'_>, x: &mut [f64]);
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]);
    fn begin(&self, now: &Now<'_>, x: &mut [f64]);
    fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]);
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]);
    fn readout(&self, now: &Now<'_>, y: &mut [f64]);
    fn step(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace);
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]);
}

impl RunningTwin for Composed {
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.start(now, x);
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.start_deviation(now, std);
    }
    fn begin(&self, now: &Now<'_>, x: &mut [f64]) {
        self.begin(now, x);
    }
    fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        self.noise(now, x, process, measurement);
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.observe(now, x, y);
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.readout(now, y);
    }
    fn step(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace) {
        self.step(now, x, work);
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.constrain(now, x);
    }
}

/// One run before its first sample.
pub(crate) struct RunSetup<'s> {
    pub outline: &'s Outline,
    /// Boxes that are felt, by state.
    pub limits: Vec<(usize, Interval)>,
    pub acting: Acting<'s>,
    pub dead_time: DeadTime,
    pub work: Workspace,
}

/// The simulation loop. Allocates its buffers once; nothing inside the loop.
pub(super) fn simulate(
    twin: &impl RunningTwin,
    setup: &mut RunSetup<'_>,
    noise: Noise,
) -> Result<Signal, SimulationError> {
    let RunSetup {
        outline,
        limits,
        acting,
        dead_time,
        work,
    } = setup;
    let (samples, n, p) = (
        acting.samples(),
        outline.states.len(),
        outline.outputs.len(),
    );
    let mut process: Vec<_> = (outline.states.iter())
        .map(|s| noise.source(&format!("process/{}", s.name)))
        .collect();
    let mut measurement: Vec<_> = (outline.outputs.iter())
        .map(|y| noise.source(&format!("measurement/{}", y.name)))
        .collect();
    let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
    let mut x = vec![0.0; n];
    let (mut outputs, mut before) = (vec![0.0; samples * p], vec![0.0; p]);
    // One step, and the noise of it.
    let mut carry = |now: &Now<'_>, q: &[f64], x: &mut [f64]| {
        twin.step(now, x, work);
        if !noise.is_off() {
            for ((x, q), w) in x.iter_mut().zip(q).zip(&mut process) {
                if *q != 0.0 {
                    *x += q * w.normal();
                }
            }
        }
        twin.constrain(now, x);
        for &(i, limit) in limits.iter() {
            x[i] = limit.clamp(x[i]);
        }
        match x.iter().all(|v| v.is_finite()) {
            true => Ok(()),
            false => Err(ended(work, now.end)),
        }
    };
    let first = acting.start();
    twin.start(&first, &mut x);
    if !noise.is_off() {
        draw_start(twin, &first, (outline, limits), noise, &mut x);
    }
    for i in 0..acting.steps_before() {
        let now = acting.before(i);
        if !noise.is_off() {
            q.fill(0.0);
            r.fill(0.0);
            twin.noise(&now, &x, &mut q, &mut r);
        }
        if dead_time.is_any() {
            twin.observe(&now, &x, &mut before);
            dead_time.hold_back(now.t, &mut before);
        }
        carry(&now, &q, &mut x)?;
    }
    for k in 0..samples {
        let now = acting.at(k);
        let y = &mut outputs[k * p..(k + 1) * p];
        twin.observe(&now, &x, y);
        dead_time.hold_back(now.t, y);
        if !noise.is_off() {
            q.fill(0.0);
            r.fill(0.0);
            twin.noise(&now, &x, &mut q, &mut r);
            for ((y, r), v) in y.iter_mut().zip(&r).zip(&mut measurement) {
                if *r != 0.0 {
                    *y += r * v.normal();
                }
            }
        }
        twin.readout(&now, y);
        if !y.iter().all(|v| v.is_finite()) {
            return Err(SimulationError::Diverged { at: now.t });
        }
        // What is behind the last row is nobody's.
        if k + 1 < samples && !acting.stands(k) {
            carry(&now, &q, &mut x)?;
        }
    }
    Signal::from_shape_vec((samples, p), outputs)
        .map_err(|error| SimulationError::Fatal(error.into()))
}

/// The error of a run that left the finite numbers.
fn ended(work: &Workspace, at: f64) -> SimulationError {
    match work.fault() {
        Some(fault) => SimulationError::Failed(fault.into()),
        None => SimulationError::Diverged { at },
    }
}

/// Holds outputs back by their dead times; before the start, the first values stand.
pub(crate) struct DeadTime {
    /// Dead time of each output; empty where none is late.
    late: Vec<Late>,
    /// Times and outputs so far, as observed.
    times: Vec<f64>,
    observed: Vec<f64>,
}

/// A dead time of an output.
#[derive(Debug, Clone, Copy)]
enum Late {
    /// Whole samples; its law has what is left.
    Samples(usize),
    /// All of it, on a line between samples: where steps vary.
    Seconds(f64),
}

impl DeadTime {
    /// No output is late.
    pub(super) const NONE: Self = Self {
        late: vec![],
        times: vec![],
        observed: vec![],
    };

    /// At all of θ, of which those are taken away that no law is to have besides.
    pub fn of(twin: &Composed, theta: &mut [f64], drive: &Drive) -> Self {
        let late = match drive.is_uniform() {
            true => {
                let samples = twin.dead_time(theta, drive.dt()).into_iter();
                samples.map(Late::Samples).collect()
            }
            false => {
                let seconds = twin.take_delays(theta).into_iter();
                seconds.map(Late::Seconds).collect()
            }
        };
        Self { late, ..Self::NONE }
    }

    /// Returns whether an output is late.
    fn is_any(&self) -> bool {
        !self.late.is_empty()
    }

    /// Replaces the outputs of the next sample, or of the next step before the first, at time `t`, by those that are shown at it.
    pub fn hold_back(&mut self, t: f64, y: &mut [f64]) {
        if !self.is_any() {
            return;
        }
        let (p, k) = (y.len(), self.times.len());
        self.times.push(t);
        self.observed.extend_from_slice(y);
        for (j, (y, late)) in y.iter_mut().zip(&self.late).enumerate() {
            let value = |i: usize| self.observed[i * p + j];
            *y = match *late {
                Late::Samples(late) => value(k.saturating_sub(late)),
                Late::Seconds(late) => on_line(&self.times, t - late, value),
            };
        }
    }
}

/// Moves the start by draws of its own deviations, within the limits.
fn draw_start(
    twin: &impl RunningTwin,
    now: &Now<'_>,
    (outline, limits): (&Outline, &[(usize, Interval)]),
    noise: Noise,
    x: &mut [f64],
) {
    let mut std = vec![0.0; x.len()];
    twin.start_deviation(now, &mut std);
    if std.iter().all(|std| *std == 0.0) {
        return;
    }
    let moved = (x.iter_mut().zip(&std)).zip(&outline.states);
    for ((x, std), state) in moved.filter(|((_, std), _)| **std != 0.0) {
        *x += std * noise.source(&format!("start/{}", state.name)).normal();
    }
    for &(i, limit) in limits.iter().filter(|(i, _)| std[*i] != 0.0) {
        x[i] = limit.clamp(x[i]);
    }
    twin.begin(now, x);
}

#[cfg(test)]
mod tests;
