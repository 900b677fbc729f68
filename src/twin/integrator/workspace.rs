//! State of a twin's way from one sample to the next: its rule, its substeps, its limits and jumps.

use super::event::Event;
use super::event_memory::EventMemory;
use super::limits::{Beyond, LimitsOfWay, felt, limited};
use super::path::{Path, breaks, edge};
use super::rule::{Integrator, StepBuffers, Stepping};
use super::schedule::{StepsTaken, SubstepSchedule};
use super::{Hold, Now, Rates};
use crate::twin::Interval;

/// Buffers of one twin that outlive a step, so that the loop allocates nothing.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    pub(super) stages: StepBuffers,
    pub(super) integrator: Integrator,
    /// Substeps and lines of inputs; `None` where a sample is one step and inputs are held.
    pub(super) refined: Option<Refined>,
    /// Substeps to a tolerance, beside `refined`.
    pub(super) schedule: Option<SubstepSchedule>,
    pub(super) events: EventMemory,
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

/// Rule by which a twin moves between samples.
#[derive(Debug, Clone)]
pub(super) struct Refined {
    pub substeps: usize,
    /// Limits that are felt, by state.
    pub limits: Vec<(usize, Interval)>,
    /// Inputs at a stage.
    pub inputs: Vec<f64>,
    /// Points at a stage, within their limits, and how far they were beyond these.
    pub within: Vec<f64>,
    pub beyond: Vec<[Beyond; 2]>,
    /// Shares of the way at which rates jump; `None` for rates that jump at no time of their own.
    pub jumps: Option<Vec<f64>>,
}

impl Workspace {
    /// For equations whose inputs are held so, with these boxes of the states and these events.
    pub(in crate::twin) fn of(
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
    pub(in crate::twin) fn is_plain(&self) -> bool {
        self.refined.is_none() && self.integrator != Integrator::RungeKutta4
    }

    /// Returns whether steps are implicit ones.
    pub(in crate::twin) fn is_implicit(&self) -> bool {
        self.schedule
            .as_ref()
            .is_some_and(SubstepSchedule::is_implicit)
    }

    /// Returns whether steps are as long as a tolerance allows.
    #[inline]
    pub(in crate::twin) fn is_adaptive(&self) -> bool {
        self.schedule.is_some()
    }

    /// Returns the adaptive substeps so far; `None` for fixed ones.
    pub(crate) fn steps_taken(&self) -> Option<StepsTaken> {
        self.schedule.as_ref().map(SubstepSchedule::taken)
    }

    /// Hears where rates jump on the next way: `tell` is called with what takes the times of each filter that goes it. Steps to a tolerance end
    /// there, and all of a twin with events.
    pub(in crate::twin) fn jump_at(&mut self, tell: impl FnOnce(&mut TellJumps<'_>)) {
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
    pub(in crate::twin) fn together<R>(
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
    pub(in crate::twin) fn limit_to(&mut self, told: impl FnOnce() -> Option<Vec<Interval>>) {
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
    pub(in crate::twin) fn stages(&mut self) -> &mut StepBuffers {
        &mut self.stages
    }

    /// Carries points of `n` states each over one sample, in the substeps of the twin.
    #[inline(always)]
    pub(in crate::twin) fn carry(
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
    pub(in crate::twin) fn carry_refined(
        &mut self,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        drift: &mut Rates<'_>,
    ) {
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
                    held: vec![],
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
                let by = (self.integrator, &mut self.stages);
                refined.substeps(by, (n, x), now, drift);
            }
        }
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

    /// Steps of Δt/m, inputs between this sample's and the next one's where there is one. States are put into their limits between substeps, as
    /// they would be between samples of a finer step.
    fn substeps(
        &mut self,
        (rule, stages): (Integrator, &mut StepBuffers),
        (n, x): (usize, &mut [f64]),
        now: &Now<'_>,
        drift: &mut Rates<'_>,
    ) {
        let m = self.substeps;
        let h = now.dt / m as f64;
        let mut limits = LimitsOfWay::of(n, &self.limits, (&mut self.within, None))
            .filter(|_| rule.is_between());
        let mut drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| match &mut limits {
            Some(limits) => limits.rates(drift, now, x, dx),
            None => drift(now, x, dx),
        };
        let is_split = m % 2 == 1 && now.between.is_some_and(|between| between.jumps_half_way());
        // In halves of steps; no step goes over a jump of inputs.
        let mut from = 0;
        while from < 2 * m {
            let is_half = is_split && (from + 1 == m || from == m);
            let to = from + if is_half { 1 } else { 2 };
            let [begin, end] = [from, to].map(|halves| 0.5 * halves as f64);
            if from > 0 {
                limited(n, x, &self.limits);
            }
            from = to;
            let sub = Now {
                t: now.t + begin * h,
                dt: (end - begin) * h,
                end: match to == 2 * m {
                    true => now.end,
                    false => now.t + end * h,
                },
                ..*now
            };
            let Some(between) = now.between else {
                rule.step(&sub, x, stages, &mut drift);
                continue;
            };
            let inputs = &mut self.inputs;
            rule.step_in_stages(&sub, x, stages, |share, stage, x, dx| {
                let (at, middle) = (begin + share * (end - begin), 0.5 * (begin + end));
                between.inputs_at(at / m as f64, middle / m as f64, now.u, inputs);
                let stage = Now {
                    u: inputs,
                    ..*stage
                };
                drift(&stage, x, dx);
            });
        }
    }
}
