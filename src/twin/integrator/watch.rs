//! Events on the way from one sample to the next: where conditions of one point become true, and what happens there.
//!
//! A condition that is false where a stretch begins and true at its end is located on it by repeating the step to a part of the stretch: the
//! place then is as smooth a function of states and parameters as the step is. The rest of the stretch is done from there.

use super::brief::turned_within;
use super::event_calls::{EventsOfWay, PROBE, SAME, StepBy, growth};
use super::path::{Path, Stretch};

/// Events of a point between two samples, at most. A ball that comes to rest has infinitely many; twice as many find no more of anything
/// that is measured, half cuts off what rattles.
const MOST: usize = 200;
/// Events of each condition at one place, at most: a change that leaves its condition where it was has no end. Half would do.
const MOST_AT_ONCE: usize = 10;
/// Share of a stretch to which the place of an event is found: rounding leaves no less. A hundred times as much shows in differences of
/// likelihoods.
const CLOSE: f64 = 1e-14;
/// Trials of a place: a margin that jumps halves the stretch with every third.
const TRIES: usize = 150;

/// A condition along the way of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WatchState {
    False,
    True,
    /// True, and not by motion, but by noise or a measurement, or just behind its event by rounding: it fires where the motion leads further in.
    Pending,
}

/// Conditions along the way of one point.
#[derive(Debug, Clone)]
pub(super) struct EventWatch {
    conditions: Vec<WatchState>,
    /// Events at given times that have been.
    passed: usize,
    fired: usize,
    /// Those of `fired` at the place of the last one.
    at_once: usize,
    /// The last event, and its share of the way.
    last: (usize, f64),
}

impl EventWatch {
    /// From the start of a way, where what noise turned true since the end of the way before may fire; `before` has the conditions there.
    pub fn begin(
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        before: Option<&[bool]>,
        x: &mut [f64],
    ) -> Self {
        let margins = path.at(0.0, |now| events.margins(now, x));
        let mut conditions = vec![];
        for (i, margin) in margins.iter().enumerate() {
            conditions.push(match before {
                Some(before) if before[i] && is_held(events, path, (0.0, i), x) => WatchState::True,
                _ if !is_true(*margin) => WatchState::False,
                Some(before) if !before[i] => WatchState::Pending,
                _ => WatchState::True,
            });
        }
        let mut watch = Self {
            conditions,
            passed: 0,
            fired: 0,
            at_once: 0,
            last: (0, 0.0),
        };
        if watch.conditions.contains(&WatchState::Pending) {
            watch.jumped(events, path, 0.0, x);
        }
        watch
    }

    /// Returns which conditions are true, or were.
    pub fn truths(&self) -> Vec<bool> {
        let all = self.conditions.iter();
        all.map(|condition| *condition == WatchState::True)
            .collect()
    }

    /// Returns the event that has no end, and the number of events until then.
    pub fn fault(&self) -> Option<(usize, usize)> {
        let most = MOST_AT_ONCE * self.conditions.len();
        let is_endless = self.fired > MOST || self.at_once > most;
        is_endless.then_some((self.last.0, self.fired))
    }

    /// Fires what a jump of the states turned true.
    pub fn jumped(
        &mut self,
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        share: f64,
        x: &mut [f64],
    ) {
        let margins = path.at(share, |now| events.margins(now, x));
        let first = self.turned(events, path, (share, &margins), x);
        for (i, margin) in margins.iter().enumerate() {
            if !is_true(*margin) && !is_held(events, path, (share, i), x) {
                self.conditions[i] = WatchState::False;
            }
        }
        events.limit(x);
        if !first.is_empty() {
            self.fire(events, path, (share, first), x);
        }
    }

    /// Fires events at given times up to a share of the way.
    pub fn reach(
        &mut self,
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        share: f64,
        x: &mut [f64],
    ) {
        while let Some(&(at, event)) = events.times.get(self.passed) {
            if at > share + SAME.max(path.edge) {
                break;
            }
            self.passed += 1;
            self.fire(events, path, (share, vec![event]), x);
        }
    }

    /// Returns conditions that were false and now are true, and pending ones that the motion leads further into.
    fn turned(
        &self,
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        (share, margins): (f64, &[f64]),
        x: &[f64],
    ) -> Vec<usize> {
        let has_turned = |i: &usize| match self.conditions[*i] {
            _ if !is_true(margins[*i]) => false,
            WatchState::False => true,
            WatchState::True => false,
            WatchState::Pending => grows(events, path, (share, *i), x),
        };
        (0..margins.len()).filter(has_turned).collect()
    }

    /// Returns 1 for conditions that are false at both ends of a stretch with these margins, -1 for true ones, 0 for others.
    fn unchanged(&self, [begin, end]: [&[f64]; 2]) -> Vec<f64> {
        let all = self.conditions.iter().enumerate();
        all.map(
            |(i, condition)| match (condition, is_true(begin[i]), is_true(end[i])) {
                (WatchState::False, false, false) => 1.0,
                (WatchState::True, true, true) => -1.0,
                _ => 0.0,
            },
        )
        .collect()
    }

    fn keep_false(&mut self, margins: &[f64]) {
        for (condition, margin) in self.conditions.iter_mut().zip(margins) {
            if !is_true(*margin) {
                *condition = WatchState::False;
            }
        }
    }

    /// Changes the states by these events, then by those that the change turns true.
    fn fire(
        &mut self,
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        (share, mut waiting): (f64, Vec<usize>),
        x: &mut [f64],
    ) {
        let mut fired = vec![false; self.conditions.len()];
        let mut next = 0;
        let mut margins = path.at(share, |now| events.margins(now, x));
        while next < waiting.len() && self.fault().is_none() {
            let event = waiting[next];
            next += 1;
            fired[event] = true;
            self.fired += 1;
            self.at_once = match (share - self.last.1).abs() <= CLOSE {
                true => self.at_once + 1,
                false => 1,
            };
            self.last = (event, share);
            let after = path.at(share, |now| events.change(event, now, x));
            events.limit(x);
            for (i, (before, after)) in margins.iter().zip(&after).enumerate() {
                if i != event && !is_true(*before) && is_true(*after) {
                    waiting.push(i);
                }
            }
            margins = after;
        }
        for (i, fired) in fired.into_iter().enumerate() {
            if !is_true(margins[i]) {
                self.conditions[i] = WatchState::False;
            } else if fired {
                // A margin that the motion leaves within rounding of times is that of the event itself.
                let leaves = -SAME / PROBE * growth(events, path, (share, i), x);
                self.conditions[i] = match margins[i] < leaves {
                    true => WatchState::Pending,
                    false => WatchState::True,
                };
            }
        }
    }

    /// Fires what a jump of a condition turned true where a stretch begins.
    pub fn enter(
        &mut self,
        events: &EventsOfWay<'_>,
        path: &mut Path<'_, '_>,
        from: f64,
        x: &mut [f64],
    ) {
        if let Some(inside) = path.behind_jump(from) {
            self.jumped(events, path, inside, x);
        }
    }

    /// Cuts a stretch from `from` to `to` at its first event, where `to` then is, changed; or within a dip of a condition that is true at both ends.
    /// Returns what is left of the stretch.
    pub fn cut(
        &mut self,
        events: &EventsOfWay<'_>,
        (path, step): (&mut Path<'_, '_>, &mut StepBy<'_>),
        mut of: Stretch,
        (from, to): (&[f64], &mut [f64]),
    ) -> Stretch {
        let begin = path.at(of.from, |now| events.margins(now, from));
        let mut end = of.from + of.length;
        let mut margins = path.at(end, |now| events.margins(now, to));
        let ends = [&begin[..], &margins];
        let (way, signs) = ((&mut *path, &mut *step), self.unchanged(ends));
        if let Some(share) = turned_within(events, way, of, [from, to], (&signs, ends)) {
            of.length *= share;
            to.copy_from_slice(from);
            step(path, of, to);
            end = of.from + of.length;
            margins = path.at(end, |now| events.margins(now, to));
        }
        let mut waiting = self.turned(events, path, (end, &margins), to);
        let (mut before, mut first, mut at_first) = (of, 1.0, vec![]);
        // An event is located only if it is true where the first one so far is.
        while let Some(event) = take_soonest(&mut waiting, &begin, &margins) {
            let is_pending = self.conditions[event] == WatchState::Pending;
            let found = (event, first, margins[event], is_pending);
            let share = located(events, (path, step), (of, from), found);
            if first - share <= CLOSE {
                at_first.push(event);
                continue;
            }
            (first, at_first) = (share, vec![event]);
            before.length = first * of.length;
            to.copy_from_slice(from);
            step(path, before, to);
            let share = before.from + before.length;
            margins = path.at(share, |now| events.margins(now, to));
            waiting = self.turned(events, path, (share, &margins), to);
            waiting.retain(|other| *other != event);
        }
        if at_first.is_empty() {
            self.keep_false(&margins);
            events.limit(to);
            return of;
        }
        at_first.sort_unstable();
        self.fire(events, path, (before.from + before.length, at_first), to);
        before
    }

    /// Carries a point from `from` through a stretch, of which `to` is the end without events.
    pub fn settle(
        &mut self,
        events: &EventsOfWay<'_>,
        (path, step): (&mut Path<'_, '_>, &mut StepBy<'_>),
        of: Stretch,
        (from, to): (&[f64], &mut [f64]),
    ) {
        let end = of.from + of.length;
        if events.is_discrete {
            self.jumped(events, path, end, to);
            return self.reach(events, path, end, to);
        }
        let (mut rest, mut start) = (of, vec![]);
        loop {
            let from = if start.is_empty() { from } else { &start[..] };
            let done = self.cut(events, (path, step), rest, (from, to));
            let left = rest.length - done.length;
            if left <= CLOSE || self.fault().is_some() {
                break;
            }
            rest = Stretch {
                from: done.from + done.length,
                length: left,
            };
            start = to.to_vec();
            step(path, rest, to);
        }
        self.reach(events, path, end, to);
    }
}

/// Returns whether the motion leads into a condition, at a limit that holds the state out of it.
fn is_held(events: &EventsOfWay<'_>, path: &mut Path<'_, '_>, at: (f64, usize), x: &[f64]) -> bool {
    let mut ends = events.limits.iter();
    ends.any(|&(j, limit)| x[j] == limit.low() || x[j] == limit.high())
        && grows(events, path, at, x)
}

/// Returns whether the motion leads further into a condition, or does not change it.
fn grows(events: &EventsOfWay<'_>, path: &mut Path<'_, '_>, at: (f64, usize), x: &[f64]) -> bool {
    growth(events, path, at, x) >= 0.0
}

/// Takes out the event whose condition, on a line from its margin at the beginning to that at the end, becomes true first.
fn take_soonest(waiting: &mut Vec<usize>, begin: &[f64], end: &[f64]) -> Option<usize> {
    let share = |event: usize| {
        let begin = begin[event].min(0.0);
        begin / (begin - end[event])
    };
    let all = waiting.iter().enumerate();
    let (soonest, _) = all.min_by(|a, b| share(*a.1).total_cmp(&share(*b.1)))?;
    Some(waiting.remove(soonest))
}

/// Returns the share of a stretch at which a condition becomes true, on the side where it is, a pending one also where it begins to grow; it is
/// true, with `margin`, at the share `end`. Secants by the rule of Illinois, every third step a half.
fn located(
    events: &EventsOfWay<'_>,
    (path, step): (&mut Path<'_, '_>, &mut StepBy<'_>),
    (of, from): (Stretch, &[f64]),
    (event, end, margin, is_pending): (usize, f64, f64, bool),
) -> f64 {
    let margin_at = |path: &mut Path<'_, '_>, share: f64, x: &[f64]| {
        let margin = path.at(share, |now| events.margins(now, x)[event]);
        let leaves = is_pending && margin > 0.0 && !grows(events, path, (share, event), x);
        if leaves { -margin } else { margin }
    };
    let (mut low, mut high) = (0.0, end);
    let mut ends = [margin_at(path, of.from, from).min(0.0), margin];
    let mut x = from.to_vec();
    let mut last_is_true = None;
    for k in 0..TRIES {
        if high - low <= CLOSE {
            break;
        }
        let secant = low + (high - low) * ends[0] / (ends[0] - ends[1]);
        let share = match secant > low && secant < high && k % 3 < 2 {
            true => secant,
            false => 0.5 * (low + high),
        };
        if share <= low || share >= high {
            break;
        }
        let length = share * of.length;
        x.copy_from_slice(from);
        step(path, Stretch { length, ..of }, &mut x);
        let there = margin_at(path, of.from + length, &x);
        let is_true = there > 0.0;
        let again = last_is_true == Some(is_true);
        match is_true {
            true => (high, ends[1]) = (share, there),
            false => (low, ends[0]) = (share, there),
        }
        if again {
            ends[usize::from(!is_true)] *= 0.5;
        }
        last_is_true = Some(is_true);
    }
    high
}

/// Returns whether a condition of this margin is true; one that is no number is false.
fn is_true(margin: f64) -> bool {
    margin > 0.0
}
