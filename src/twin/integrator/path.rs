//! The way from one sample to the next: rates at any part of it, with the inputs there.

use super::limits::LimitsOfWay;
use super::{Now, Rates};
use smallvec::SmallVec;

/// Least share of the way by which rates stay off jumps: no tolerance shows it. A tenth would do.
const CLOSE: f64 = 1e-12;

/// A stretch of the way, in shares of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub from: f64,
    pub length: f64,
}

/// Rates of points between two samples.
pub(super) struct Path<'p, 'n> {
    /// The sample that it begins at.
    pub now: &'p Now<'n>,
    /// Inputs at a part of it.
    pub inputs: &'p mut [f64],
    pub drift: &'p mut Rates<'p>,
    /// Shares of the way that no step goes over, in order.
    pub breaks: &'p [f64],
    /// Share of the way by which rates stay off its breaks and ends: at the time of a jump itself they are those of one side.
    pub edge: f64,
    /// Limits of the states on the way; `None` where they act at the ends of steps alone.
    pub limits: Option<LimitsOfWay<'p>>,
    /// Rates of entries that have others than those of the equations; NaN for the others, and none where no entry has.
    pub held: Vec<f64>,
}

impl Path<'_, '_> {
    /// Length of a stretch in seconds.
    pub fn seconds(&self, of: Stretch) -> f64 {
        of.length * self.now.dt
    }

    /// Time at a share of the way: nowhere on it behind its end, which several stretches may miss by a last digit.
    pub fn time(&self, share: f64) -> f64 {
        let time = self.now.t + share * self.now.dt;
        match share - 1.0 {
            left if left.abs() < 8.0 * f64::EPSILON => self.now.end,
            left if left < 0.0 => time.min(self.now.end),
            _ => time,
        }
    }

    /// Rates at a part of a stretch.
    pub fn rates(&mut self, of: Stretch, part: f64, x: &[f64], dx: &mut [f64]) {
        let [after, before] = self.edges(of);
        let at = of.from + (part * of.length).clamp(after, of.length - before);
        let mut stage = Now {
            t: self.time(at),
            dt: of.length * self.now.dt,
            ..*self.now
        };
        if let Some(between) = self.now.between {
            let middle = of.from + 0.5 * of.length;
            between.inputs_at(at, middle, self.now.u, self.inputs);
            stage.u = self.inputs;
        }
        match &mut self.limits {
            Some(limits) => limits.rates(self.drift, &stage, x, dx),
            None => (self.drift)(&stage, x, dx),
        }
        for (dx, held) in dx.iter_mut().zip(&self.held) {
            if !held.is_nan() {
                *dx = *held;
            }
        }
    }

    /// Shares of the way by which rates stay off both ends of a stretch.
    pub fn edges(&self, of: Stretch) -> [f64; 2] {
        if self.edge == 0.0 {
            return [0.0; 2];
        }
        let ends = [of.from, of.from + of.length];
        ends.map(|end| {
            let mut breaks = [0.0, 1.0].iter().chain(self.breaks);
            match breaks.any(|at| (at - end).abs() < 8.0 * f64::EPSILON) {
                true => self.edge.min(0.25 * of.length),
                false => 0.0,
            }
        })
    }

    /// Returns the share of the way just behind one at which rates or conditions may jump.
    pub fn behind_jump(&self, at: f64) -> Option<f64> {
        let is_jump = self.edge > 0.0 && (at == 0.0 || self.breaks.contains(&at));
        is_jump.then_some(at + self.edge)
    }

    /// Puts points into the limits.
    pub fn limit(&self, x: &mut [f64]) {
        if let Some(limits) = &self.limits {
            limits.limit(x);
        }
    }

    /// Sets errors of points at the end of a step to those that are left within the limits.
    pub fn limit_errors(&self, of: Stretch, x: &[f64], errors: &mut [f64]) {
        if let Some(limits) = &self.limits {
            limits.errors(self.seconds(of), x, errors);
        }
    }

    /// Begins a step, of which no stage has been.
    pub fn begin_step(&mut self) {
        if let Some(limits) = &mut self.limits {
            limits.begin_step();
        }
    }

    /// Begins a step whose first stage has been, with its rates.
    pub fn begin_step_at(&mut self, x: &[f64], rates: &[f64]) {
        self.begin_step();
        if let Some(limits) = &mut self.limits {
            limits.see(x, rates);
        }
    }

    /// Sign of a change of state j by `step`, at `x` with this rate, that shows derivatives: to the side that the state moves to, but for one that
    /// would go over a limit.
    pub fn side(&self, j: usize, (x, step): (f64, f64), rate: f64) -> f64 {
        let sign = if rate < 0.0 { -1.0 } else { 1.0 };
        let limits = self.limits.as_ref();
        match limits.is_some_and(|limits| limits.are_passed(j, [x, x + sign * step])) {
            true => -sign,
            false => sign,
        }
    }

    /// Calls `with` the time and the inputs at a share of the way.
    pub fn at<R>(&mut self, share: f64, with: impl FnOnce(&Now<'_>) -> R) -> R {
        let mut now = Now {
            t: self.time(share),
            ..*self.now
        };
        if let Some(between) = self.now.between {
            between.inputs_at(share, share, self.now.u, self.inputs);
            now.u = self.inputs;
        }
        with(&now)
    }

    /// Returns stretches of equal length, but for the breaks.
    pub fn equal(&self, parts: usize) -> Vec<Stretch> {
        let mut all = vec![];
        for i in 0..parts {
            let (mut from, end) = (i as f64 / parts as f64, (i + 1) as f64 / parts as f64);
            while from < end {
                let to = self.next_break(from).min(end);
                let length = to - from;
                all.push(Stretch { from, length });
                from = to;
            }
        }
        all
    }

    /// Share of the way up to which a step from another may go.
    pub fn next_break(&self, from: f64) -> f64 {
        let mut breaks = self.breaks.iter().copied();
        breaks.find(|at| from < *at).unwrap_or(1.0)
    }
}

/// Shares of the way at which inputs jump, rates do and something else happens, in order.
pub(super) fn breaks(
    now: &Now<'_>,
    jumps: Option<&[f64]>,
    others: impl IntoIterator<Item = f64>,
) -> SmallVec<[f64; 4]> {
    let mut all: SmallVec<[f64; 4]> = others.into_iter().collect();
    if now.between.is_some_and(|between| between.jumps_half_way()) {
        all.push(0.5);
    }
    all.retain(|share| *share > 0.0 && *share < 1.0);
    // Between an end of the way and a jump beside it there is no room for rates.
    let edge = edge(now, jumps);
    let jumps = jumps.unwrap_or_default().iter().copied();
    all.extend(jumps.filter(|share| *share > edge && *share < 1.0 - edge));
    all.sort_unstable_by(f64::total_cmp);
    all.dedup_by(|a, b| *a - *b <= edge);
    all
}

/// Share of the way that rounding leaves of the time of a jump; 0 where rates do not jump at times. On clocks that tell a step in few digits it
/// is more than is taken, and errors of steps locate jumps.
pub(super) fn edge(now: &Now<'_>, jumps: Option<&[f64]>) -> f64 {
    match jumps {
        Some(_) => (CLOSE + 8.0 * f64::EPSILON * now.t.abs() / now.dt).min(CLOSE.sqrt()),
        None => 0.0,
    }
}
