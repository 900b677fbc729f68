//! Events of a way, as they are called: margins of conditions, times and changes, with the twin's own time and parameters.

use super::Now;
use super::event::Event;
use super::limits::limited;
use super::path::{Path, Stretch};
use super::rule::Integrator;
use crate::math::ascending;
use crate::twin::Interval;

/// Share of the way over which a condition is watched for its direction: far above rounding, far below the motion.
pub(super) const PROBE: f64 = 1e-6;
/// Share of what a state is beyond a limit that its conditions see: as much as shows that it is there, and less than is between two thresholds.
const BEYOND: f64 = 1e-6;
/// Share of the way within which a time is that of a row.
pub(super) const SAME: f64 = 1e-9;

/// A rule that carries points over a stretch.
pub(super) type StepBy<'s> = dyn FnMut(&mut Path<'_, '_>, Stretch, &mut [f64]) + 's;

/// Call with time and parameters as a twin's own equations see them beside states.
type InsideOf<'e> = dyn Fn(&Now<'_>, &[f64], &mut dyn FnMut(&Now<'_>)) + 'e;

/// Events of a twin, as they are called.
pub(crate) struct EventCalls<'e> {
    pub list: &'e [Event],
    /// Number of the twin's own states, the first of a point.
    pub states: usize,
    pub inside: &'e InsideOf<'e>,
    /// Seconds by which its clock is late.
    pub late: f64,
}

impl EventCalls<'_> {
    /// Margins of all conditions at a point.
    pub fn margins(&self, now: &Now<'_>, x: &[f64]) -> Vec<f64> {
        let mut margins = Vec::with_capacity(self.list.len());
        (self.inside)(now, x, &mut |own| {
            let all = self.list.iter();
            margins.extend(all.map(|event| event.margin(own, &x[..self.states])));
        });
        margins
    }

    fn change(&self, event: usize, now: &Now<'_>, x: &mut [f64]) {
        let seen = x.to_vec();
        (self.inside)(now, &seen, &mut |own| {
            self.list[event].change(own, &mut x[..self.states]);
        });
    }

    /// Returns the shares of the way at which there are events, each with the event, in order; in discrete time they are at its ends.
    ///
    /// # Errors
    ///
    /// The event whose condition or time is not a number at this point of numbers.
    pub fn times(
        &self,
        now: &Now<'_>,
        x: &[f64],
        rule: Integrator,
    ) -> Result<Vec<(f64, usize)>, &Event> {
        let (mut all, mut undefined) = (vec![], None);
        (self.inside)(now, x, &mut |own| {
            // A clock that stands until a delay is over shows no time twice.
            let t = now.t - self.late;
            for (i, event) in self.list.iter().enumerate() {
                let mut times = event.times(own);
                times.retain(|at| self.late == 0.0 || *at >= now.begun);
                let margin = event.margin(own, &x[..self.states]);
                if margin.is_nan() || times.iter().any(|at| at.is_nan()) {
                    undefined.get_or_insert(event);
                }
                for at in times {
                    let share = (at - t) / now.dt;
                    // A clock of days has a share of a step in its last digits.
                    let same = SAME.max(4.0 * f64::EPSILON * own.t.abs() / now.dt);
                    match share {
                        _ if share.abs() <= same => all.push((0.0, i)),
                        _ if share > 0.0 && share < 1.0 - same => match rule {
                            Integrator::Discrete => all.push((1.0, i)),
                            _ => all.push((share, i)),
                        },
                        _ => {}
                    }
                }
            }
        });
        ascending(&mut all, |a| a.0);
        match undefined.filter(|_| x.iter().all(|x| x.is_finite())) {
            Some(event) => Err(event),
            None => Ok(all),
        }
    }
}

/// Events of one way.
pub(super) struct EventsOfWay<'w> {
    pub calls: &'w EventCalls<'w>,
    /// Shares of the way with events at given times.
    pub times: &'w [(f64, usize)],
    /// `true` where nothing is between samples.
    pub is_discrete: bool,
    /// Limits that changes end in, by state.
    pub limits: &'w [(usize, Interval)],
}

impl EventsOfWay<'_> {
    /// Puts a point into its limits.
    pub fn limit(&self, x: &mut [f64]) {
        limited(x.len(), x, self.limits);
    }

    /// Margins of all conditions at a point, of which what is beyond its limits is just beyond them: there the motion has it for events.
    pub fn margins(&self, now: &Now<'_>, x: &[f64]) -> Vec<f64> {
        let is_beyond = |(j, limit): &(usize, Interval)| limit.clamp(x[*j]) != x[*j];
        if !self.limits.iter().any(is_beyond) {
            return self.calls.margins(now, x);
        }
        let mut seen = x.to_vec();
        for &(j, limit) in self.limits {
            let held = limit.clamp(x[j]);
            seen[j] = held + BEYOND * (x[j] - held);
        }
        self.calls.margins(now, &seen)
    }

    /// Changes a point by an event, from within its limits; returns the margins behind it, by which what the event leaves stays beyond them.
    pub fn change(&self, event: usize, now: &Now<'_>, x: &mut [f64]) -> Vec<f64> {
        let free = x.to_vec();
        self.limit(x);
        let held = x.to_vec();
        self.calls.change(event, now, x);
        let mut seen = x.to_vec();
        for ((seen, held), free) in seen.iter_mut().zip(held).zip(free) {
            if *seen == held {
                *seen = free;
            }
        }
        self.margins(now, &seen)
    }
}

/// Change of a margin by the motion, a share of the way ahead.
pub(super) fn growth(
    events: &EventsOfWay<'_>,
    path: &mut Path<'_, '_>,
    (share, event): (f64, usize),
    x: &[f64],
) -> f64 {
    let moved = moved(path, (share, PROBE), x);
    let here = path.at(share, |now| events.margins(now, x)[event]);
    let there = path.at(share + PROBE, |now| events.margins(now, &moved)[event]);
    there - here
}

/// Returns a point a share of the way before or behind its own.
pub(super) fn moved(path: &mut Path<'_, '_>, (share, by): (f64, f64), x: &[f64]) -> Vec<f64> {
    let (part, of) = (
        if by < 0.0 { 1.0 } else { 0.0 },
        Stretch {
            from: share + by.min(0.0),
            length: by.abs(),
        },
    );
    let mut moved = vec![0.0; x.len()];
    path.rates(of, part, x, &mut moved);
    let seconds = path.seconds(of).copysign(by);
    for (moved, x) in moved.iter_mut().zip(x) {
        *moved = x + seconds * *moved;
    }
    moved
}
