//! A twin's own equations under all parts: called point after point, or for all points at once where they offer that.

use super::engine::{Engine, as_rates};
use crate::math::{LANES, Lanes};
use crate::twin::points::{Layout, Points, gather, lanes_one_by_one, scatter};
use crate::twin::{
    Blocks, Integrator, Interval, Now, SimulationError, StateSpace, TellJumps, Workspace,
};
use smallvec::SmallVec;
use std::ops::Deref;
use std::sync::Arc;

/// The equations, and how many points of them are computed; what is not defined here is done point after point.
#[derive(Clone)]
pub(super) struct OwnEquations {
    engine: Arc<dyn Engine>,
    /// The same equations for many points in one call.
    blocks: Option<Arc<dyn Blocks>>,
    /// Number of passes that should be under way at once: more than one where a call waits for an exchange that passes share.
    pub beside: usize,
}

impl Deref for OwnEquations {
    type Target = dyn Engine;

    fn deref(&self) -> &Self::Target {
        &*self.engine
    }
}

impl OwnEquations {
    pub fn one_by_one<T: StateSpace + 'static>(own: Arc<T>) -> Self {
        Self {
            engine: own,
            blocks: None,
            beside: 1,
        }
    }

    pub fn in_blocks<T: StateSpace + Blocks + 'static>(own: Arc<T>) -> Self {
        Self {
            engine: own.clone(),
            blocks: Some(own),
            beside: 1,
        }
    }

    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.engine, &other.engine)
    }

    /// Returns whether the points of several filters go in one call of the rates, whatever the parameters of each.
    pub fn joins_lanes(&self) -> bool {
        (self.blocks.as_ref()).is_some_and(|blocks| blocks.is_joined())
    }

    /// Returns whether rates of several filters cost little more than those of one.
    pub fn is_wide(&self) -> bool {
        (self.blocks.as_ref()).is_some_and(|blocks| blocks.is_wide())
    }

    /// Rates of the points of several filters, `each` numbers of a filter; only where the equations are [wide](Self::is_wide).
    pub fn drift_joined(
        &self,
        now: &[Now<'_>],
        at: Layout,
        each: usize,
        x: &[f64],
        dx: &mut [f64],
    ) {
        if let Some(blocks) = &self.blocks {
            blocks.drift_joined(now, at, each, x, dx);
        }
    }

    /// Returns why the last run at this θ failed, if the equations know.
    pub fn fault(&self, theta: &[f64]) -> Option<SimulationError> {
        self.blocks.as_ref()?.fault(theta)
    }

    pub fn drift_points(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        let Some(blocks) = &self.blocks else {
            return self.engine.drift_points(now, at, x, dx);
        };
        blocks.drift(now, at.stride, x, dx);
        if self.engine.integrator() == Integrator::Discrete {
            for (x, dx) in at.each(x).zip(at.each_mut(dx)) {
                as_rates(now, x, dx);
            }
        }
    }

    pub fn observe_points(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        match &self.blocks {
            Some(blocks) => blocks.observe(now, at.stride, x, y),
            None => self.engine.observe_points(now, at, p, x, y),
        }
    }

    pub fn advance_points(
        &self,
        now: &Now<'_>,
        mut points: Points<'_>,
        work: &mut Workspace,
    ) -> bool {
        if self.blocks.is_none() {
            return self.engine.advance_points(now, points, work);
        }
        let n = points.shifts.len();
        points.limit(n);
        let moving = &mut points.all[..points.moving * n];
        work.jump_at(|tell| tell(now, self.jumps(now)));
        work.carry(n, now, moving, |now, x, dx| {
            self.drift_points(now, Layout::dense(n), x, dx);
        });
        false
    }

    pub fn advance_lanes(
        &self,
        now: &[Now<'_>],
        points: Points<'_, Lanes>,
        one: (&mut [f64], &mut [f64]),
        work: &mut Workspace,
    ) -> [bool; LANES] {
        let Some(blocks) = &self.blocks else {
            return self.engine.advance_lanes(now, points, one, work);
        };
        let n = points.shifts.len();
        if !work.is_plain() {
            let (is_wide, is_joined) = (blocks.is_wide(), blocks.is_joined());
            let is_one_call = (is_wide || is_joined && !work.is_implicit()) && are_together(now);
            let tell = |tell: &mut TellJumps<'_>| {
                now.iter().for_each(|now| tell(now, self.jumps(now)));
            };
            return work.together(tell, |work| {
                if is_one_call {
                    self.advance_joined(&**blocks, now, points, work);
                    return [false; LANES];
                }
                let advance =
                    |now: &Now<'_>, points: Points<'_>| self.advance_points(now, points, work);
                lanes_one_by_one(n, now, points, one, advance)
            });
        }
        let x = &mut points.all[..points.moving * n];
        limit_lanes(points.limits, x);
        blocks.step_lanes(now, x);
        [false; LANES]
    }

    /// Carries the points of several filters as those of one, which all take the same substeps: those of the first where a call is [wide].
    ///
    /// [wide]: Blocks::is_wide
    fn advance_joined(
        &self,
        blocks: &dyn Blocks,
        now: &[Now<'_>],
        points: Points<'_, Lanes>,
        work: &mut Workspace,
    ) {
        let n = points.shifts.len();
        let moving = &mut points.all[..points.moving * n];
        let (each, mut all) = (moving.len(), joined(points.limits, now.len(), moving));
        if blocks.is_wide() && work.is_adaptive() {
            let mut first = all[..each].to_vec();
            work.carry(n, &now[0], &mut first, |now, x, dx| {
                self.drift_points(now, Layout::dense(n), x, dx);
            });
        }
        work.carry(n, &now[0], &mut all, |stage, x, dx| {
            let each_now: SmallVec<[Now<'_>; LANES]> = (now.iter())
                .map(|now| Now {
                    theta: now.theta,
                    ..*stage
                })
                .collect();
            blocks.drift_joined(&each_now, Layout::dense(n), each, x, dx);
        });
        for (lane, all) in all.chunks_exact(each).enumerate() {
            scatter(all, (lane, now.len()), moving);
        }
    }

    pub fn observe_lanes(
        &self,
        now: &[Now<'_>],
        n: usize,
        x: &[Lanes],
        y: &mut [Lanes],
        buffer: &mut [f64],
    ) {
        let Some(blocks) = &self.blocks else {
            return self.engine.observe_lanes(now, n, x, y, buffer);
        };
        let points = 1 + 2 * n;
        blocks.observe_lanes(now, &x[..points * n], &mut y[..points]);
    }
}

/// Returns whether filters differ in their parameters alone.
pub(super) fn are_together(now: &[Now<'_>]) -> bool {
    let first = &now[0];
    let times = |now: &Now<'_>| [now.t, now.dt, now.end, now.since, now.first_time, now.begun];
    now.iter().all(|now| {
        let is_between = match (now.between, first.between) {
            (Some(own), Some(other)) => {
                (own.next, own.holds, own.bends) == (other.next, other.holds, other.bends)
            }
            (own, other) => own.is_none() && other.is_none(),
        };
        times(now) == times(first) && now.u == first.u && is_between
    })
}

/// Points of so many filters in their limits, filter after filter.
pub(super) fn joined(limits: &[Interval], filters: usize, moving: &mut [Lanes]) -> Vec<f64> {
    limit_lanes(limits, moving);
    let mut all = vec![0.0; moving.len() * filters];
    for (lane, all) in all.chunks_exact_mut(moving.len()).enumerate() {
        gather(moving, lane, all);
    }
    all
}

/// Puts points of several filters into their limits.
fn limit_lanes(limits: &[Interval], x: &mut [Lanes]) {
    let limits_felt = (limits.iter().enumerate()).filter(|(_, l)| **l != Interval::EVERYTHING);
    for (i, limit) in limits_felt {
        for x in x.iter_mut().skip(i).step_by(limits.len()) {
            x.0.iter_mut().for_each(|x| *x = limit.clamp(*x));
        }
    }
}
