//! Integrators that carry the equations from one sample to the next.

mod event;
mod eventful;
mod pair;
mod path;
mod rosenbrock;
mod schedule;
mod spline;
#[cfg(test)]
mod tests;
mod watch;

use crate::twin::Interval;
use eventful::EventMemory;
use path::{Beyond, LimitsOfWay, Path, Rates, Stretch, breaks, edge, limited};
use schedule::SubstepSchedule;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::ops::RangeInclusive;

pub use event::Event;
pub use schedule::StepsTaken;
pub(crate) use spline::Bends;
pub(crate) use watch::EventCalls;

/// Time, step, inputs and parameters at which equations are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Now<'a> {
    /// Time in seconds on the record's own clock: `t` of its rows.
    pub t: f64,
    /// Step Δt in seconds: to the next sample, or a substep where [`StateSpace::drift`](crate::twin::StateSpace::drift) is evaluated.
    pub dt: f64,
    /// Time at the end of the step, to the last digit that of the next sample: t + Δt may be rounded to the number beside it. For integrators:
    /// it stays where laws and noise see another time or step.
    pub(crate) end: f64,
    /// Time in seconds since the sample before, over which what a sensor remembers has moved; Δt at the first one.
    pub(crate) since: f64,
    /// Inputs at this time.
    pub u: &'a [f64],
    /// Parameters θ.
    pub theta: &'a [f64],
    /// Position between samples; `None` where inputs are held from one to the next.
    pub(crate) between: Option<Between<'a>>,
    /// Time of the first row: laws of effects count from there.
    pub(crate) first_time: f64,
    /// Time that the start belongs to, the first row's or one before it: delays count from there.
    pub(crate) begun: f64,
}

impl<'a> Now<'a> {
    /// Time `t`, step `dt`, inputs `u` held over the step, and parameters θ; the first row is at 0.
    pub fn new(t: f64, dt: f64, u: &'a [f64], theta: &'a [f64]) -> Self {
        Self {
            t,
            dt,
            end: t + dt,
            since: dt,
            u,
            theta,
            between: None,
            first_time: 0.0,
            begun: 0.0,
        }
    }

    /// Time in seconds over which a memory moves at this sample: an input acts over the step behind it, everything else is seen after the one
    /// before.
    #[inline]
    pub(crate) fn memory_step(&self, of_input: bool) -> f64 {
        if of_input { self.dt } else { self.since }
    }
}

/// A position between two samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Between<'a> {
    /// Inputs at the next sample.
    pub next: &'a [f64],
    /// Rule of each input between this sample and the next.
    pub holds: &'a [Hold],
    /// [`Bends`] of each input, here and at the next sample; empty where none is on a spline.
    pub bends: &'a [f64],
}

impl Between<'_> {
    /// Inputs at a share of the way to the next sample, in a step whose middle is at another.
    pub fn inputs_at(&self, at: f64, middle: f64, u: &[f64], to: &mut [f64]) {
        let rules = self.holds.iter().enumerate();
        for (((to, u), next), (j, hold)) in to.iter_mut().zip(u).zip(self.next).zip(rules) {
            let on_line = || u + hold.share(at, middle) * (next - u);
            *to = match hold {
                Hold::Zero => *u,
                Hold::Impulse => 0.0,
                Hold::Linear | Hold::Nearest => on_line(),
                Hold::Spline => {
                    let (left, bends) = (1.0 - at, &self.bends[2 * j..]);
                    on_line() + ((left.powi(3) - left) * bends[0] + (at.powi(3) - at) * bends[1])
                }
            };
        }
    }

    /// Adds to states what inputs add at this sample: the difference that they make to the rates, as an amount.
    pub fn jump(&self, now: &Now<'_>, x: &mut [f64], inputs: &mut [f64], drift: &mut Rates<'_>) {
        let is_dose = |(hold, u): (&Hold, &f64)| *hold == Hold::Impulse && *u != 0.0;
        if !self.holds.iter().zip(now.u).any(is_dose) {
            return;
        }
        let (mut with, mut without) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        drift(now, x, &mut with);
        inputs.copy_from_slice(now.u);
        remove_amounts(inputs, self.holds);
        let nothing = Now { u: inputs, ..*now };
        drift(&nothing, x, &mut without);
        for ((x, with), without) in x.iter_mut().zip(&with).zip(&without) {
            *x += with - without;
        }
    }
}

/// Sets inputs to zero that are amounts, which are added at a row alone.
pub(crate) fn remove_amounts(inputs: &mut [f64], holds: &[Hold]) {
    for (input, hold) in inputs.iter_mut().zip(holds) {
        if *hold == Hold::Impulse {
            *input = 0.0;
        }
    }
}

/// Inputs between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// Held at the value of the sample before.
    #[default]
    Zero,
    /// On the line from one sample to the next; the last is held.
    Linear,
    /// Held at the value of the nearest sample: what a smooth input does that was sampled, and not held. With an odd number of substeps, the
    /// middle one has the mean of both; the last is held.
    Nearest,
    /// On the natural cubic spline through all samples: a smooth input that was sampled several times a period. The last is held.
    Spline,
    /// An amount that is added at its row, a dose: the states jump by ∂f/∂u times it, and between samples the input is zero. In discrete
    /// time it is held: the next state is told the amount.
    Impulse,
}

impl Hold {
    /// All rules, each with its name in files.
    pub(crate) const NAMES: [(Self, &str); 5] = [
        (Self::Zero, "zero"),
        (Self::Linear, "linear"),
        (Self::Spline, "spline"),
        (Self::Nearest, "nearest"),
        (Self::Impulse, "impulse"),
    ];

    /// Name in files.
    pub(crate) fn name(self) -> &'static str {
        let mut all = Self::NAMES.iter();
        all.find(|(hold, _)| *hold == self)
            .map_or("", |(_, name)| *name)
    }

    /// Share of the next sample's input at a share of the way, in a step whose middle is at another.
    fn share(self, at: f64, middle: f64) -> f64 {
        match self {
            Self::Zero | Self::Impulse => 0.0,
            Self::Linear | Self::Spline => at,
            Self::Nearest => match middle.total_cmp(&0.5) {
                Ordering::Less => 0.0,
                Ordering::Equal => 0.5,
                Ordering::Greater => 1.0,
            },
        }
    }
}

/// Most substeps of a sample.
pub(crate) const MOST_SUBSTEPS: usize = 1000;

/// Tolerances that can be asked for: above what rounding leaves, below what is no tolerance.
pub(crate) const TOLERANCES: RangeInclusive<f64> = 1e-12..=0.1;
/// Largest error of an adaptive substep, as a share of a state's largest size so far. Stiff systems of the literature then come within a
/// millionth of their scale; at ten times as much Robertson's reactions go astray, a tenth costs half as many steps again.
const TOLERANCE: f64 = 1e-7;

/// Substeps of the integrator within a sample, and inputs there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Stepping {
    /// Steps of Δt/n within a sample, n ≥ 1; the least number of adaptive ones.
    pub substeps: usize,
    /// Inputs between samples, but for those that the [outline](crate::twin::Outline::hold) has another rule of.
    pub hold: Hold,
    /// Largest error of an adaptive substep, as a share of a state's largest size so far.
    pub tolerance: f64,
}

impl Default for Stepping {
    /// One step, inputs held; adaptive ones to 10⁻⁷.
    fn default() -> Self {
        Self {
            substeps: 1,
            hold: Hold::Zero,
            tolerance: TOLERANCE,
        }
    }
}

/// The rule that carries the state over one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Integrator {
    /// x ← x + Δt·f(t, x), first order; the rule of the paper's twins.
    #[default]
    Euler,
    /// The classical fourth-order Runge–Kutta step.
    #[serde(rename = "runge-kutta-4")]
    RungeKutta4,
    /// x ← f(t, x): the drift is the state at the next sample, and nothing is between samples. Forces of effects are rates still: they
    /// add Δt times themselves.
    Discrete,
    /// Substeps to a [tolerance](Stepping::tolerance), by the pair of orders 5 and 4 of Dormand and Prince; where that takes many, by the
    /// method of [`Stiff`](Self::Stiff). All points of a filter take the same, chosen so that each keeps the tolerance.
    Adaptive,
    /// Substeps to a tolerance by an L-stable method of order 4 (RODAS of Hairer and Wanner), for rates that differ by orders of magnitude.
    Stiff,
}

/// Buffers of one twin that outlive a step, so that the loop allocates nothing.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    stages: StepBuffers,
    integrator: Integrator,
    /// Substeps and lines of inputs; `None` where a sample is one step and inputs are held.
    refined: Option<Refined>,
    /// Substeps to a tolerance, beside `refined`.
    schedule: Option<SubstepSchedule>,
    events: EventMemory,
    /// Limits of every way, by state.
    limits: Vec<Interval>,
    has_events: bool,
    /// `true` where the way before had limits of its own.
    is_limited: bool,
    /// `true` while filters that go one after the other have told where rates jump.
    is_together: bool,
}

/// Takes the times at which rates jump on a way, `None` for rates that jump at no time of their own.
pub(crate) type TellJumps<'t> = dyn FnMut(&Now<'_>, Option<Vec<f64>>) + 't;

/// Buffers of a step.
#[derive(Debug, Clone)]
pub(super) struct StepBuffers {
    slopes: [Vec<f64>; 4],
    stage: Vec<f64>,
}

/// Rule by which a twin moves between samples.
#[derive(Debug, Clone)]
struct Refined {
    substeps: usize,
    /// Limits that are felt, by state.
    limits: Vec<(usize, Interval)>,
    /// Inputs at a stage.
    inputs: Vec<f64>,
    /// Points at a stage, within their limits, and how far they were beyond these.
    within: Vec<f64>,
    beyond: Vec<[Beyond; 2]>,
    /// Shares of the way at which rates jump; `None` for rates that jump at no time of their own.
    jumps: Option<Vec<f64>>,
}

impl Workspace {
    /// For equations whose inputs are held so, with these boxes of the states and these events.
    pub(super) fn of(
        holds: &[Hold],
        limits: &[Interval],
        (integrator, stepping): (Integrator, Stepping),
        events: &[Event],
    ) -> Self {
        let schedule = SubstepSchedule::of(integrator, stepping, limits.len());
        let is_refined = schedule.is_some()
            || !events.is_empty()
            || stepping.substeps > 1
            || integrator.is_between() && !felt(limits).is_empty()
            || integrator != Integrator::Discrete && holds.iter().any(|hold| *hold != Hold::Zero);
        Self {
            stages: StepBuffers::of(limits.len()),
            integrator,
            refined: is_refined
                .then(|| Refined::of(stepping.substeps.max(1), holds.len(), felt(limits))),
            schedule,
            events: EventMemory::default(),
            limits: limits.to_vec(),
            is_together: false,
            has_events: !events.is_empty(),
            is_limited: false,
        }
    }

    /// Returns what is wrong with a run that ended in events without end, or in too many steps.
    pub(crate) fn fault(&self) -> Option<&str> {
        let steps = self.schedule.as_ref().and_then(SubstepSchedule::fault);
        self.events.fault.as_deref().or(steps)
    }

    /// Returns whether a sample is one step of Euler's rule, inputs held.
    #[inline]
    pub(super) fn is_plain(&self) -> bool {
        self.refined.is_none() && self.integrator != Integrator::RungeKutta4
    }

    /// Returns whether steps are implicit ones.
    pub(super) fn is_implicit(&self) -> bool {
        self.schedule
            .as_ref()
            .is_some_and(SubstepSchedule::is_implicit)
    }

    /// Returns whether steps are as long as a tolerance allows.
    #[inline]
    pub(super) fn is_adaptive(&self) -> bool {
        self.schedule.is_some()
    }

    /// Returns the adaptive substeps so far; `None` for fixed ones.
    pub(crate) fn steps_taken(&self) -> Option<StepsTaken> {
        self.schedule.as_ref().map(SubstepSchedule::taken)
    }

    /// Hears where rates jump on the next way: `tell` is called with what takes the times of each filter that goes it. Steps to a tolerance end
    /// there, and all of a twin with events.
    pub(super) fn jump_at(&mut self, tell: impl FnOnce(&mut TellJumps<'_>)) {
        let is_between = self.integrator != Integrator::Discrete && !self.is_together;
        let is_heard = (self.schedule.is_some() || self.has_events) && is_between;
        let Some(refined) = self.refined.as_mut().filter(|_| is_heard) else {
            return;
        };
        refined.jumps = None;
        tell(&mut |now, times| {
            if let Some(times) = times {
                let shares = times.into_iter().map(|at| (at - now.t) / now.dt);
                refined.jumps.get_or_insert_default().extend(shares);
            }
        });
    }

    /// Carries filters one after the other, whose steps all end where the rates of any jump: they take the same ones.
    pub(super) fn together<R>(
        &mut self,
        tell: impl FnOnce(&mut TellJumps<'_>),
        carry: impl FnOnce(&mut Self) -> R,
    ) -> R {
        self.jump_at(tell);
        self.is_together = true;
        let carried = carry(self);
        self.is_together = false;
        carried
    }

    /// Hears the limits of states on the next way, beside those of every way.
    pub(super) fn limit_to(&mut self, told: impl FnOnce() -> Option<Vec<Interval>>) {
        if self.refined.is_none() && !self.integrator.is_between() {
            return;
        }
        let told = told();
        if told.is_none() && !self.is_limited {
            return;
        }
        self.is_limited = told.is_some();
        let mut limits = self.limits.clone();
        for (limit, told) in limits.iter_mut().zip(told.unwrap_or_default()) {
            *limit = limit.and(told);
        }
        let felt = felt(&limits);
        match &mut self.refined {
            Some(refined) => refined.limits = felt,
            // One step, and inputs that are held.
            None => self.refined = Some(Refined::of(1, 0, felt)),
        }
    }

    /// Buffers of a single step.
    #[inline]
    pub(super) fn stages(&mut self) -> &mut StepBuffers {
        &mut self.stages
    }

    /// Carries points of `n` states each over one sample, in the substeps of the twin.
    #[inline(always)]
    pub(super) fn carry(
        &mut self,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        match self.refined {
            None => self.integrator.step(now, x, &mut self.stages, drift),
            Some(_) => self.carry_refined(n, now, x, &mut drift),
        }
    }

    /// As [`carry`](Self::carry), not in one step of held inputs. One copy serves all equations: here a call costs little of a step.
    fn carry_refined(&mut self, n: usize, now: &Now<'_>, x: &mut [f64], drift: &mut Rates<'_>) {
        let Some(refined) = &mut self.refined else {
            return;
        };
        if let Some(between) = now.between {
            between.jump(now, x, &mut refined.inputs, drift);
        }
        limited(n, x, &refined.limits);
        match &mut self.schedule {
            Some(schedule) => {
                let jumps = refined.jumps.as_deref();
                let mut path = Path {
                    now,
                    inputs: &mut refined.inputs,
                    drift,
                    breaks: &breaks(now, jumps, []),
                    edge: edge(now, jumps),
                    limits: LimitsOfWay::of(
                        n,
                        &refined.limits,
                        (&mut refined.within, Some(&mut refined.beyond)),
                    ),
                };
                schedule.carry(&mut path, x);
            }
            None => {
                let rule = self.integrator;
                rule.substeps(n, now, x, (&mut self.stages, refined), drift);
            }
        }
    }

    /// A buffer for `states` states.
    pub(super) fn stage(&mut self, states: usize) -> &mut [f64] {
        grown(&mut self.stages.stage, states)
    }
}

impl Refined {
    /// For so many fixed steps and inputs, and these limits.
    fn of(substeps: usize, inputs: usize, limits: Vec<(usize, Interval)>) -> Self {
        Self {
            substeps,
            limits,
            inputs: vec![0.0; inputs],
            within: vec![],
            beyond: vec![],
            jumps: None,
        }
    }
}

impl StepBuffers {
    /// For `states` states.
    fn of(states: usize) -> Self {
        Self {
            slopes: std::array::from_fn(|_| vec![0.0; states]),
            stage: vec![0.0; states],
        }
    }
}

/// Boxes that are felt, by state.
pub(super) fn felt(limits: &[Interval]) -> Vec<(usize, Interval)> {
    let limits = limits.iter().copied().enumerate();
    limits
        .filter(|(_, limit)| *limit != Interval::EVERYTHING)
        .collect()
}

/// The first `length` numbers of a buffer, which grows where it is shorter.
#[inline]
fn grown(buffer: &mut Vec<f64>, length: usize) -> &mut [f64] {
    if buffer.len() < length {
        buffer.resize(length, 0.0);
    }
    &mut buffer[..length]
}

impl Integrator {
    /// Returns whether steps are as long as a tolerance allows.
    pub(super) fn is_adaptive(self) -> bool {
        matches!(self, Self::Adaptive | Self::Stiff)
    }

    /// Returns whether it takes rates where limits have not acted yet.
    fn is_between(self) -> bool {
        !matches!(self, Self::Euler | Self::Discrete)
    }

    /// One step in place, the input held: `x(t)` becomes `x(t + Δt)` under `drift(now, x, dx)`.
    #[inline]
    pub(super) fn step(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut StepBuffers,
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        self.step_in_stages(now, x, work, |_, now, x, dx| drift(now, x, dx));
    }

    /// Steps of Δt/m, inputs between this sample's and the next one's where there is one. States are put into their limits between substeps, as
    /// they would be between samples of a finer step.
    fn substeps(
        self,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        (work, refined): (&mut StepBuffers, &mut Refined),
        drift: &mut Rates<'_>,
    ) {
        let m = refined.substeps;
        let h = now.dt / m as f64;
        let mut limits = LimitsOfWay::of(n, &refined.limits, (&mut refined.within, None))
            .filter(|_| self.is_between());
        let mut drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| match &mut limits {
            Some(limits) => limits.rates(drift, now, x, dx),
            None => drift(now, x, dx),
        };
        for i in 0..m {
            if i > 0 {
                limited(n, x, &refined.limits);
            }
            let sub = Now {
                t: now.t + i as f64 * h,
                dt: h,
                end: match i + 1 == m {
                    true => now.end,
                    false => now.t + (i + 1) as f64 * h,
                },
                ..*now
            };
            let Some(between) = now.between else {
                self.step(&sub, x, work, &mut drift);
                continue;
            };
            let inputs = &mut refined.inputs;
            self.step_in_stages(&sub, x, work, |share, stage, x, dx| {
                let (at, middle) = (i as f64 + share, i as f64 + 0.5);
                between.inputs_at(at / m as f64, middle / m as f64, now.u, inputs);
                let stage = Now {
                    u: inputs,
                    ..*stage
                };
                drift(&stage, x, dx);
            });
        }
    }

    /// One step over a stretch of the way.
    fn step_over(
        self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &mut [f64],
        work: &mut StepBuffers,
    ) {
        let now = Now {
            t: path.time(of.from),
            dt: path.seconds(of),
            end: path.time(of.from + of.length),
            ..*path.now
        };
        self.step_in_stages(&now, x, work, |share, _, x, dx| {
            path.rates(of, share, x, dx)
        });
    }

    /// As [`step`](Self::step); `drift` is also told the share of the step that has passed at each stage.
    #[inline]
    fn step_in_stages(
        self,
        now: &Now<'_>,
        x: &mut [f64],
        work: &mut StepBuffers,
        mut drift: impl FnMut(f64, &Now<'_>, &[f64], &mut [f64]),
    ) {
        let dt = now.dt;
        match self {
            // The engine gives a discrete twin's way to the next sample as a rate. Steps to a tolerance have a schedule.
            Self::Euler | Self::Discrete | Self::Adaptive | Self::Stiff => {
                // Few numbers stay in registers where the drift is compiled into this.
                let mut few = [0.0; 4];
                let slope = match x.len() {
                    n @ ..=4 => &mut few[..n],
                    n => grown(&mut work.slopes[0], n),
                };
                drift(0.0, now, x, slope);
                for (x, d) in x.iter_mut().zip(slope) {
                    *x += dt * *d;
                }
            }
            Self::RungeKutta4 => {
                let [k1, k2, k3, k4] = work.slopes.each_mut().map(|k| grown(k, x.len()));
                let stage = grown(&mut work.stage, x.len());
                let half = Now {
                    t: now.t + 0.5 * dt,
                    ..*now
                };
                let end = Now { t: now.end, ..*now };
                drift(0.0, now, x, k1);
                shifted(x, 0.5 * dt, k1, stage);
                drift(0.5, &half, stage, k2);
                shifted(x, 0.5 * dt, k2, stage);
                drift(0.5, &half, stage, k3);
                shifted(x, dt, k3, stage);
                drift(1.0, &end, stage, k4);
                for (i, x) in x.iter_mut().enumerate() {
                    *x += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
                }
            }
        }
    }
}

/// `out = x + h·slope`.
fn shifted(x: &[f64], h: f64, slope: &[f64], out: &mut [f64]) {
    for ((out, x), s) in out.iter_mut().zip(x).zip(slope) {
        *out = x + h * s;
    }
}
