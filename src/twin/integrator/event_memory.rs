//! Events of a twin up to the last sample, which those of the next go on from.

use super::Now;
use super::event_calls::EventsOfWay;
use super::path::Path;
use super::watch::EventWatch;
use crate::setting::number;

/// Share of a step within which two times are one.
const SAME_TIME: f64 = 1e-6;

/// Events up to the last sample.
#[derive(Debug, Clone, Default)]
pub(super) struct EventMemory {
    /// Time of that sample, and the conditions that were true there at the centre.
    before: Option<(f64, Vec<bool>)>,
    /// A sentence about events without end, or without a number.
    pub fault: Option<String>,
}

impl EventMemory {
    /// Conditions of points at the start of a way: what turned true since the end of the way before fires, then doses and events at this
    /// time.
    pub fn begin<'x>(
        &self,
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        points: impl Iterator<Item = &'x mut [f64]>,
    ) -> Vec<EventWatch> {
        let now = path.now;
        let before = self.before.as_ref().and_then(|(t, truths)| {
            ((t - now.t).abs() <= SAME_TIME * now.dt).then_some(&truths[..])
        });
        let begin = |x: &mut [f64]| {
            let mut watch = EventWatch::begin(events, path, before, x);
            if let Some(between) = now.between {
                between.jump(now, x, path.inputs, path.drift);
                watch.jumped(events, path, 0.0, x);
            }
            watch.reach(events, path, 0.0, x);
            watch
        };
        points.map(begin).collect()
    }

    /// Keeps the conditions of the centre at the end of a way.
    pub fn end(&mut self, events: &EventsOfWay<'_>, way: &Now<'_>, watches: &[EventWatch]) {
        self.before = Some((way.end, watches[0].truths()));
        if let Some((event, fired)) = watches.iter().find_map(EventWatch::fault) {
            let event = &events.calls.list[event];
            let (fault, remedy) = match event.is_timed() {
                true => (
                    "is too frequent",
                    "give it fewer times, or take shorter steps",
                ),
                false => (
                    "has no end",
                    "give it a condition or a change that ends, such as a least speed",
                ),
            };
            self.fault = Some(format!(
                "{} {fault}: {fired} events in the {} s after t = {} s; {remedy}",
                event.name(),
                number(way.dt),
                number(way.t)
            ));
        }
    }
}
