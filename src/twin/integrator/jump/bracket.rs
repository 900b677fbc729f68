//! The search for the place of a jump on the way of a point.

use super::{NEAR, Step};
use smallvec::SmallVec;

/// Share to which looks by halves go on, 25 of them: derivatives by θ are differences of ways that are some 1e-6 of a step apart.
pub(super) const CLOSE: f64 = 1e-8;

/// The last place at which the rate of each state jumped: where the next point is thought to meet it.
#[derive(Debug, Clone, Default)]
pub(in crate::twin::integrator) struct JumpsSeen(pub(super) Vec<JumpSeen>);

#[derive(Debug, Clone)]
pub(super) struct JumpSeen {
    at: Vec<f64>,
    /// The state whose value tells the place best.
    by: usize,
    /// α of the last step that was held there.
    pub share: f64,
}

impl JumpsSeen {
    /// Before anything is seen, rates may jump where their own state changes its sign.
    pub fn begin(&mut self, n: usize) {
        if self.0.len() != n {
            let own = |by| JumpSeen {
                at: vec![0.0; n],
                by,
                share: 0.5,
            };
            self.0 = (0..n).map(own).collect();
        }
    }
}

impl JumpSeen {
    /// Share at which the points of a bracket are where the rate jumped.
    pub fn share_on(&self, bracket: &Bracket, step: &Step<'_>) -> f64 {
        let i = self.by;
        let [first, last, bend] = bracket.ways.each_ref().map(|way| way[i]);
        // σ·(r₁ − r₀) + σ²·g/2 = way
        let (slope, way) = (
            last - first,
            (self.at[i] - bracket.state(i, 0.0, step)) / step.h,
        );
        let root = (slope * slope + 2.0 * bend * way).sqrt();
        2.0 * way / (slope + root.copysign(slope))
    }

    /// Learns where it jumped now, unless that was known.
    pub fn learn(&mut self, bracket: &Bracket, step: &Step<'_>) {
        if (bracket.share() - self.share_on(bracket, step)).abs() <= 2.0 * CLOSE {
            return;
        }
        let at: Vec<f64> = (0..step.n)
            .map(|i| bracket.state(i, bracket.share(), step))
            .collect();
        let off = |i: &usize| ((at[*i] - self.at[*i]) / bracket.ways[1][*i]).abs();
        let moving = (0..step.n).filter(|&i| bracket.ways[1][i] != 0.0);
        self.by = moving
            .min_by(|i, j| off(i).total_cmp(&off(j)))
            .unwrap_or(self.by);
        self.at = at;
    }
}

/// Numbers of one point.
pub(super) type Few = SmallVec<[f64; 4]>;

/// Search for the place of a jump among the points x₀ + h·((1 − σ)·r₀ + σ·r₁ + σ²·g/2).
pub(super) struct Bracket {
    /// Place of the point among all numbers.
    pub at: usize,
    /// Entry whose rate tells the sides.
    pub entry: usize,
    /// r₀, r₁ and g.
    pub ways: [Few; 3],
    /// Rates at both ends.
    pub ends: [Few; 2],
    /// Distances of the rates at the end from the line that they leave the begin on.
    pub off: Few,
    /// Shares σ between which the jump is, and rates there.
    pub shares: [f64; 2],
    pub rates: [Few; 2],
    /// Share of the step's time at which all its points are; the share σ itself if `None`.
    pub time: Option<f64>,
    /// Shares to be looked at before others.
    guesses: Few,
}

impl Bracket {
    pub fn new((at, entry): (usize, usize), ways: [Few; 3], ends: [Few; 2], off: Few) -> Self {
        Self {
            at,
            entry,
            ways,
            rates: ends.clone(),
            ends,
            off,
            shares: [0.0, 1.0],
            time: None,
            guesses: Few::new(),
        }
    }

    /// Looks at both sides of a share before others.
    pub fn guess(&mut self, share: f64) {
        let beside = 2.0 * CLOSE;
        self.guesses.extend([share - beside, share + beside]);
    }

    /// The middle of what is left.
    pub fn share(&self) -> f64 {
        0.5 * (self.shares[0] + self.shares[1])
    }

    /// Share to look at next.
    pub fn next(&mut self) -> f64 {
        let [low, high] = self.shares;
        while let Some(share) = self.guesses.pop() {
            if low < share && share < high {
                return share;
            }
        }
        self.share()
    }

    /// Learns the rates at a share: before the jump they are on the line, behind it as far off as at the end, to either side. At a quarter of that the
    /// first of two like jumps is behind.
    pub fn see(&mut self, share: f64, rates: &[f64]) {
        let [first, last] = [0, 1].map(|end: usize| self.ends[end][self.entry]);
        let off = self.off[self.entry];
        let line = first + share * (last - first - off);
        let side = usize::from((rates[self.entry] - line).abs() > 0.25 * off.abs());
        self.shares[side] = share;
        self.rates[side].copy_from_slice(rates);
    }

    pub fn is_found(&self) -> bool {
        self.shares[1] - self.shares[0] <= 5.0 * CLOSE
    }

    /// Change of a rate at the jump.
    pub fn change(&self, i: usize) -> f64 {
        self.rates[1][i] - self.rates[0][i]
    }

    /// Returns whether a rate jumps there: by a quarter of what it is off at the end or more, and by more than a slope changes it there.
    pub fn jumps(&self, i: usize) -> bool {
        let all = (self.ends[1][i] - self.ends[0][i]).abs();
        let least = (0.25 * self.off[i].abs()).max(NEAR * all);
        self.is_found() && self.change(i).abs() > least
    }

    /// Ways of a state over the whole step on either side of the jump: before it the straight one, or the bent one where that goes farther.
    pub fn sides(&self, i: usize) -> [f64; 2] {
        let of = |i: usize| {
            let [straight, behind] = [self.ends[0][i], self.rates[1][i]];
            (straight, self.ways[1][i] + 0.5 * self.ways[2][i], behind)
        };
        let (straight, bent, behind) = of(self.entry);
        let is_bent = (bent - behind).abs() > (straight - behind).abs();
        let (straight, bent, behind) = of(i);
        [if is_bent { bent } else { straight }, behind]
    }

    /// The rate of a point that a jump would hold, but for its moving on faster than the rates on either side: all the line is on one side of it then.
    pub fn outrun(&self, jump: &Bracket) -> Option<f64> {
        let (i, change) = (self.entry, jump.change(self.entry).abs());
        if !jump.jumps(i) || self.jumps(i) || self.off[i].abs() >= 0.25 * change {
            return None;
        }
        let end = self.ends[1][i];
        let [one, other] = [jump.ends[0][i], jump.rates[1][i]];
        let is_one = (one - end).abs() < (other - end).abs();
        Some(0.5 * (end + if is_one { one } else { other }))
    }

    /// Mean rate on the way to the jump and on from it, to where rates are these.
    pub fn passed(&self, i: usize, end: f64) -> f64 {
        let (before, behind) = (self.rates[0][i], self.rates[1][i]);
        let share = self.share();
        0.5 * (share * (self.ends[0][i] + before) + (1.0 - share) * (behind + end))
    }

    /// The rate at the end of the step, of that found there: another jump on the way is not in it.
    pub fn end(&self, i: usize, end: f64) -> f64 {
        let slope = self.ends[1][i] - self.ends[0][i] - self.off[i];
        let expected = self.rates[1][i] + (1.0 - self.share()) * slope;
        match (end - expected).abs() < 0.5 * self.change(i).abs() {
            true => end,
            false => expected,
        }
    }

    /// A rate of the way to a share.
    pub fn way(&self, share: f64, i: usize) -> f64 {
        let [first, last, bend] = self.ways.each_ref().map(|way| way[i]);
        (1.0 - share) * first + share * (last + 0.5 * share * bend)
    }

    /// A state of the point at a share.
    pub fn state(&self, i: usize, share: f64, step: &Step<'_>) -> f64 {
        step.begin[self.at + i] + step.h * self.way(share, i)
    }
}
