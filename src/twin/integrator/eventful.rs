//! The way to the next sample of a twin with events.

use super::event_calls::{EventCalls, EventsOfWay};
use super::limits::{LimitsOfWay, limited};
use super::path::{Path, Stretch, breaks, edge};
use super::rule::Integrator;
use super::workspace::Workspace;
use super::{Now, Rates};
use crate::setting::number;

impl Workspace {
    /// Carries points of `n` states each over one sample, with the events of the twin if it has any.
    #[inline(always)]
    pub(in crate::twin) fn carry_with_events(
        &mut self,
        calls: &EventCalls<'_>,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        mut drift: impl FnMut(&Now<'_>, &[f64], &mut [f64]),
    ) {
        match calls.list.is_empty() {
            true => self.carry(n, now, x, drift),
            false => self.carry_to_events(calls, n, now, x, &mut drift),
        }
    }

    /// As [`carry`](Self::carry), of a twin with events: each point has them at its own places.
    fn carry_to_events(
        &mut self,
        calls: &EventCalls<'_>,
        n: usize,
        now: &Now<'_>,
        x: &mut [f64],
        drift: &mut Rates<'_>,
    ) {
        let (rule, stages) = (self.integrator, &mut self.stages);
        let Some(refined) = self.refined.as_mut().filter(|_| n > 0) else {
            return;
        };
        let is_discrete = rule == Integrator::Discrete;
        // In discrete time an amount is told with the step.
        let way = Now {
            between: now.between.filter(|_| !is_discrete),
            ..*now
        };
        let times = match calls.times(&way, &x[..n], rule) {
            Ok(times) => times,
            Err(event) => {
                let (name, at) = (event.name(), number(way.t));
                let remedy = "give it one there, or leave these parameters out of the prior";
                self.events.fault = Some(format!("{name} has no number at t = {at} s; {remedy}"));
                return x.fill(f64::NAN);
            }
        };
        let events = EventsOfWay {
            calls,
            times: &times,
            is_discrete,
            limits: &refined.limits,
        };
        limited(n, x, &refined.limits);
        let beyond = Some(&mut refined.beyond).filter(|_| self.schedule.is_some());
        let jumps = refined.jumps.as_deref();
        let breaks = breaks(&way, jumps, times.iter().map(|(share, _)| *share));
        let mut path = Path {
            now: &way,
            inputs: &mut refined.inputs,
            drift,
            held: vec![],
            breaks: &breaks,
            edge: edge(&way, jumps),
            limits: LimitsOfWay::of(n, &refined.limits, (&mut refined.within, beyond))
                .filter(|_| rule.is_between()),
        };
        let mut watches = self.events.begin(&events, &mut path, x.chunks_exact_mut(n));
        let of_centre = Some((&events, watches[0].clone()));
        let stretches = match &mut self.schedule {
            Some(schedule) => schedule.chosen(&mut path, x, &of_centre),
            None => path.equal(refined.substeps),
        };
        if stretches.is_empty() {
            return x.fill(f64::NAN);
        }
        let mut step =
            |path: &mut Path<'_, '_>, of: Stretch, x: &mut [f64]| match &mut self.schedule {
                Some(schedule) => schedule.step(path, of, x, None),
                None => rule.step_over(path, of, x, stages),
            };
        let mut before = vec![0.0; x.len()];
        for of in stretches {
            for (watch, x) in watches.iter_mut().zip(x.chunks_exact_mut(n)) {
                watch.enter(&events, &mut path, of.from, x);
            }
            before.copy_from_slice(x);
            step(&mut path, of, x);
            let points = before.chunks_exact(n).zip(x.chunks_exact_mut(n));
            for (watch, (from, to)) in watches.iter_mut().zip(points) {
                watch.settle(&events, (&mut path, &mut step), of, (from, to));
            }
            limited(n, x, &refined.limits);
        }
        self.events.end(&events, &way, &watches);
        if self.events.fault.is_some() {
            x.fill(f64::NAN);
        }
    }
}
