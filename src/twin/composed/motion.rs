//! Motion of composed equations, of as many points as are given.

use super::own::{are_together, joined};
use super::parts::Theta;
use super::{Composed, Entry, Law, TwinPart};
use crate::math::{LANES, Lanes};
use crate::twin::points::{
    LanePlaces, Layout, Points, advance_together, constrain_together, gather, lanes_one_by_one,
    observe_lanes, readout_lanes, scatter_moved,
};
use crate::twin::{EventCalls, Now, TellJumps, Workspace};
use smallvec::SmallVec;

impl Composed {
    /// Sets `dx` to the rates of the states `x`, of one point or of several side by side.
    pub fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.resolved(now, |now| self.rates(now, x, dx));
    }

    /// Constrains points after a step, before their boxes. Parameters that follow states are those of the first point, or, where a disturbance
    /// moves one, of each.
    pub fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.resolved(now, |now| self.bound(now, None, x));
    }

    /// Moves what changes at samples only: memories, before the motion starts.
    pub(crate) fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        self.resolved(now, |now| self.remember(now, None, x));
    }

    /// Points that are called together: all, or each where parameters follow states.
    #[inline]
    fn together(&self, numbers: usize) -> usize {
        match self.parts.acts.by_states {
            true => self.states(),
            false => numbers,
        }
        .max(1)
    }

    #[inline]
    fn layout(&self) -> Layout {
        Layout {
            states: self.parts.states,
            stride: self.states(),
        }
    }

    fn rates(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let together = self.together(x.len());
        for (x, dx) in x.chunks_exact(together).zip(dx.chunks_exact_mut(together)) {
            self.inside(now, Some(x), |own| self.rates_inside(now, own, x, dx));
        }
    }

    /// Rates at the twin's own time and θ.
    #[inline]
    fn rates_inside(&self, now: &Now<'_>, own: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let at = self.layout();
        if at.states < at.stride {
            for dx in dx.chunks_exact_mut(at.stride) {
                dx[at.states..].fill(0.0);
            }
        }
        self.own.drift_points(own, at, x, dx);
        if self.parts.acts.on_rates {
            self.push(now, own, x, dx);
        }
    }

    /// Adds forces and disturbances; `own` has the twin's own θ.
    fn push(&self, now: &Now<'_>, own: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let at = self.layout();
        for added in &self.parts.list {
            match &added.part {
                TwinPart::Law(part) => {
                    if let Law::Force(law) = &part.law {
                        let t = self.parts.law_time(now, added.delays);
                        let (seen, on) = (Now { t, ..*own }, part.place(&added.states));
                        law.push(part.m(now.theta), &seen, &on, (at, x), dx);
                    }
                }
                TwinPart::Late(_) => {
                    if let Some(share) = self.parts.moving_rates(now, added.delays) {
                        dx.iter_mut().for_each(|dx| *dx *= share);
                    }
                }
                TwinPart::Disturbance(part) => {
                    if let Entry::State(i) = part.entry {
                        let points = x.chunks_exact(at.stride);
                        for (x, dx) in points.zip(dx.chunks_exact_mut(at.stride)) {
                            dx[i] += x[added.states.start];
                        }
                    }
                }
                _ => {}
            }
        }
    }

    fn bound(&self, now: &Now<'_>, own: Option<&Now<'_>>, x: &mut [f64]) {
        let at = self.layout();
        if self.parts.acts.on_limits {
            for added in self.parts.list.iter().rev() {
                if let TwinPart::Law(part) = &added.part
                    && let Law::Limit(law) = &part.law
                {
                    law.hold(part.m(now.theta), &part.place(&added.states), at, x);
                }
            }
        }
        self.all_inside((now, own), x, |own, x| {
            self.own.constrain_points(own, at, x)
        });
    }

    fn remember(&self, now: &Now<'_>, own: Option<&Now<'_>>, x: &mut [f64]) {
        let at = self.layout();
        if self.parts.acts.in_memories {
            self.follow(now, x);
        }
        if self.parts.acts.in_sensors {
            self.remember_signals(now, x);
        }
        if self.parts.moves(now, 0) {
            self.all_inside((now, own), x, |own, x| self.own.update_points(own, at, x));
        }
        if !self.parts.acts.in_disturbances {
            return;
        }
        // Limits and motion of this step see the new value, as a held input does.
        for (added, part, state) in self.parts.disturbances() {
            if self.parts.moves(now, added.delays) {
                for x in x.chunks_exact_mut(at.stride) {
                    x[state] *= part.memory;
                }
            }
        }
    }

    /// Changes points at the twin's own time and θ, which may be known. Otherwise θ is as it is beside the first point, before the change: θ of
    /// each costs more than the change. Where a disturbance moves θ, each point has its own, as a filter learns the disturbance from what
    /// its points differ in.
    #[inline]
    fn all_inside(
        &self,
        (now, own): (&Now<'_>, Option<&Now<'_>>),
        x: &mut [f64],
        change: impl Fn(&Now<'_>, &mut [f64]),
    ) {
        let n = self.states().max(1);
        let together = match (own, self.parts.acts.by_states) {
            (Some(own), _) => return change(own, x),
            (None, false) => return self.inside(now, None, |own| change(own, x)),
            (None, true) if self.parts.acts.in_disturbances => n,
            (None, true) => x.len().max(1),
        };
        for x in x.chunks_mut(together) {
            let seen = Theta::from_slice(&x[..n.min(x.len())]);
            self.inside(now, Some(&seen), |own| change(own, x));
        }
    }

    /// Carries one state over a step, without noise and limits: memories, then motion.
    pub(crate) fn step(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace) {
        self.resolved(now, |now| {
            self.remember(now, None, x);
            self.carry(self.states(), (now, None), x, work);
        });
    }

    /// Carries points of `n` states each over a step, with the twin's events; its own time and θ at the begin may be known.
    #[inline(always)]
    fn carry(
        &self,
        n: usize,
        (now, own): (&Now<'_>, Option<&Now<'_>>),
        x: &mut [f64],
        work: &mut Workspace,
    ) {
        let centre = x.get(..n);
        work.jump_at(|tell| self.tell_jumps(now, centre, tell));
        work.limit_to(|| self.inside(now, centre, |own| self.own.limits_at(own)));
        // One step of Euler's rule has its rates there alone.
        let own = own.filter(|_| work.is_plain());
        let drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| match own {
            Some(own) => self.rates_inside(now, own, x, dx),
            None => self.rates(now, x, dx),
        };
        let calls = EventCalls {
            list: &self.parts.outline.events,
            states: self.parts.states,
            late: self.parts.late(now.theta, 0),
            inside: &|now, x, then| self.inside(now, Some(x), |own| then(own)),
        };
        work.carry_with_events(&calls, n, now, x, drift);
    }

    /// Carries the points of a filter over a step; returns whether a constraint acted on any that matters to the noise.
    pub(crate) fn advance(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool {
        self.resolved(now, |now| {
            if self.parts.acts.leave_motion() {
                let own = Now {
                    theta: &now.theta[..self.parts.parameters],
                    ..*now
                };
                return self.own.advance_points(&own, points, work);
            }
            if self.parts.acts.by_states {
                return self.advance_sized((now, None), points, work);
            }
            self.inside(now, None, |own| {
                self.advance_sized((now, Some(own)), points, work)
            })
        })
    }

    fn advance_sized(
        &self,
        at: (&Now<'_>, Option<&Now<'_>>),
        points: Points<'_>,
        work: &mut Workspace,
    ) -> bool {
        // Loops of known length, for the sizes of most twins.
        match points.shifts.len() {
            2 => self.advance_together(2, at, points, work),
            3 => self.advance_together(3, at, points, work),
            4 => self.advance_together(4, at, points, work),
            n => self.advance_together(n, at, points, work),
        }
    }

    #[inline(always)]
    fn advance_together(
        &self,
        n: usize,
        (now, own): (&Now<'_>, Option<&Now<'_>>),
        points: Points<'_>,
        work: &mut Workspace,
    ) -> bool {
        let carry = |x: &mut [f64], work: &mut Workspace| {
            self.remember(now, own, x);
            self.carry(n, (now, own), x, work);
        };
        advance_together(n, points, work, carry, |x| self.bound(now, own, x))
    }

    /// As [`advance`](Self::advance), of several filters, one a lane; `one` holds points and shifts of one of them.
    pub(crate) fn advance_lanes(
        &self,
        at: &LanePlaces<'_>,
        points: Points<'_, Lanes>,
        one: (&mut [f64], &mut [f64]),
        work: &mut Workspace,
    ) -> [bool; LANES] {
        if self.parts.acts.leave_motion() {
            return self.own.advance_lanes(at.own(), points, one, work);
        }
        let is_one_call =
            self.own.is_wide() && !self.parts.acts.by_states && are_together(at.whole());
        let tell = |tell: &mut TellJumps<'_>| {
            let all = at.whole().iter();
            all.for_each(|now| self.tell_jumps(now, None, tell));
        };
        work.together(tell, |work| {
            if is_one_call {
                return self.advance_joined(at.whole(), points, one, work);
            }
            let advance = |now: &Now<'_>, points: Points<'_>| self.advance(now, points, work);
            lanes_one_by_one(points.shifts.len(), at.whole(), points, one, advance)
        })
    }

    /// Calls `tell` with the times of a step at which rates jump: those of the equations, those of laws, and the end of a delay.
    fn tell_jumps(&self, now: &Now<'_>, x: Option<&[f64]>, tell: &mut TellJumps<'_>) {
        let late = self.parts.late(now.theta, 0);
        self.inside(now, x, |own| {
            // A clock that stands until the delay is over shows no other times.
            let own = Now {
                t: now.t - late,
                ..*own
            };
            let mut times = self.own.jumps(&own);
            if let Some(times) = times.as_mut().filter(|_| late > 0.0) {
                times.retain(|at| *at > now.begun);
                times.iter_mut().for_each(|at| *at += late);
            }
            tell(now, times);
        });
        for delay in 0..self.parts.delays() {
            tell(
                now,
                Some(vec![now.begun + self.parts.late(now.theta, delay)]),
            );
        }
        for added in &self.parts.list {
            if let TwinPart::Law(part) = &added.part
                && let Some(time) = part.time
            {
                let late = self.parts.late(now.theta, added.delays);
                let at = now.first_time + part.m(now.theta)[time] + late;
                tell(now, Some(vec![at]));
            }
        }
    }

    /// The same with one call of the equations for all filters, which take the steps of the first.
    fn advance_joined(
        &self,
        now: &[Now<'_>],
        points: Points<'_, Lanes>,
        (one, shift): (&mut [f64], &mut [f64]),
        work: &mut Workspace,
    ) -> [bool; LANES] {
        let Points {
            all,
            moving,
            limits,
            shifts,
        } = points;
        let n = shifts.len();
        let (each, shift) = (moving * n, &mut shift[..n]);
        let one = &mut one[..each + 2 * n * n];
        let mut joined = joined(limits, now.len(), &mut all[..each]);
        for (now, x) in now.iter().zip(joined.chunks_exact_mut(each)) {
            self.remember(now, None, x);
        }
        if work.is_adaptive() {
            let mut first = joined[..each].to_vec();
            self.carry(n, (&now[0], None), &mut first, work);
        }
        work.carry(n, &now[0], &mut joined, |stage, x, dx| {
            self.rates_joined((now, stage), each, x, dx);
        });
        let mut bent = [false; LANES];
        for (lane, (at, x)) in now.iter().zip(joined.chunks_exact(each)).enumerate() {
            one[..each].copy_from_slice(x);
            gather(shifts, lane, shift);
            let point = Points {
                all: &mut *one,
                moving,
                limits,
                shifts: &*shift,
            };
            bent[lane] = constrain_together(n, point, work, |x| self.bound(at, None, x));
            scatter_moved(each, one, (lane, now.len(), bent[lane]), all);
        }
        bent
    }

    /// Rates of the points of several filters at a stage of a step, `each` numbers of a filter; parameters follow no states.
    fn rates_joined(
        &self,
        (now, stage): (&[Now<'_>], &Now<'_>),
        each: usize,
        x: &[f64],
        dx: &mut [f64],
    ) {
        let with = |theta| Now { theta, ..*stage };
        let bent: Vec<Theta> = (now.iter())
            .filter_map(|now| self.bent(&with(now.theta), None))
            .collect();
        let own: SmallVec<[Now<'_>; LANES]> = (now.iter().enumerate())
            .map(|(lane, now)| self.own_now(&with(now.theta), bent.get(lane)))
            .collect();
        dx.fill(0.0);
        self.own.drift_joined(&own, self.layout(), each, x, dx);
        if self.parts.acts.on_rates {
            let points = x.chunks_exact(each).zip(dx.chunks_exact_mut(each));
            for ((now, own), (x, dx)) in now.iter().zip(&own).zip(points) {
                self.push(&with(now.theta), own, x, dx);
            }
        }
    }

    /// One output of the points, `n` states each, of several filters, one a lane; `buffer` holds those of one of them.
    pub(crate) fn observe_lanes(
        &self,
        at: &LanePlaces<'_>,
        n: usize,
        x: &[Lanes],
        y: &mut [Lanes],
        buffer: &mut [f64],
    ) {
        if self.parts.acts.leave_motion() && !self.parts.acts.on_outputs {
            return self.own.observe_lanes(at.own(), n, x, y, buffer);
        }
        let observe = |now: &Now<'_>, x: &[f64], y: &mut [f64]| self.observe(now, x, y);
        observe_lanes(n, at.whole(), x, y, buffer, observe);
    }

    /// Puts values of one output of several filters, one a lane, through the readout; returns the lanes that it changed.
    pub(crate) fn readout_lanes(&self, at: &LanePlaces<'_>, y: &mut [Lanes]) -> [bool; LANES] {
        if self.parts.leave_readings() {
            return self.own.readout_lanes(at.own(), y);
        }
        readout_lanes(at.whole(), y, |now, y| self.readout(now, y))
    }

    /// Number of parameters of the equations alone.
    pub(crate) fn own_parameters(&self) -> usize {
        self.parts.parameters
    }
}
