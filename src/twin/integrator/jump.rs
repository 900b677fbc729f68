//! Steps in which points meet jumps of rates: those that pass one, as dry friction where a motion turns round, and those that one holds, as dry
//! friction at rest.
//!
//! ```text
//! x(s) = x₀ + h·(s·f_a + s²·g/2)              is at the jump at s; f_a: rates on this side, g: their change along the step, f_b: rates behind the jump
//! x(α) = x₀ + h·((1 − α)·f_a + α·f_b)         α = 1 − s where the point goes on from there; where f_b leads back at once, x(α) is at the jump
//! ```
//!
//! States whose rates jump move by that mean of both, all others by their own and its slope. The end of a step is then a continuous function of its begin, to
//! second order: a likelihood is smooth in what moves the points. Sides are told from the rates alone: how far they are off the line that they leave
//! the begin on. Shares are found by halves, or at once where a jump is met again where it was before. A rate jumps once in a step; jumps of several
//! rates are met one after the other, so that two blocks come to rest each on its own. Where an implicit rule is given, it takes the step.
//!
//! All rates of a step are those in its middle.
//!
//! Sources: Filippov, *Differential Equations with Discontinuous Righthand Sides* (1988), section 4; Acary and Brogliato, *Implicit Euler numerical
//! scheme and chattering-free implementation of sliding mode systems*, Systems & Control Letters 59 (2010) 284–293.

use super::event_calls::StepBy;
use super::path::{Path, Stretch};
use smallvec::SmallVec;

/// Share to which looks by halves go on, 25 of them: derivatives by θ are differences of ways that are some 1e-6 of a step apart.
const CLOSE: f64 = 1e-8;
/// Share of a step that shows the slope of rates at its begin, and where they lead behind a jump. Half or twice of it show the same.
const NEAR: f64 = 1e-3;

/// The last place at which the rate of each state jumped: where the next point is thought to meet it.
#[derive(Debug, Clone, Default)]
pub(super) struct JumpsSeen(Vec<JumpSeen>);

#[derive(Debug, Clone)]
struct JumpSeen {
    at: Vec<f64>,
    /// The state whose value tells the place best.
    by: usize,
    /// α of the last step that was held there.
    share: f64,
}

impl JumpsSeen {
    /// Before anything is seen, rates may jump where their own state changes its sign.
    fn begin(&mut self, n: usize) {
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
    fn share_on(&self, bracket: &Bracket, step: &Step<'_>) -> f64 {
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
    fn learn(&mut self, bracket: &Bracket, step: &Step<'_>) {
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
type Few = SmallVec<[f64; 4]>;

/// Search for the place of a jump among the points x₀ + h·((1 − σ)·r₀ + σ·r₁ + σ²·g/2).
struct Bracket {
    /// Place of the point among all numbers.
    at: usize,
    /// Entry whose rate tells the sides.
    entry: usize,
    /// r₀, r₁ and g.
    ways: [Few; 3],
    /// Rates at both ends.
    ends: [Few; 2],
    /// Distances of the rates at the end from the line that they leave the begin on.
    off: Few,
    /// Shares σ between which the jump is, and rates there.
    shares: [f64; 2],
    rates: [Few; 2],
    /// Shares to be looked at before others.
    guesses: Few,
}

impl Bracket {
    fn new((at, entry): (usize, usize), ways: [Few; 3], ends: [Few; 2], off: Few) -> Self {
        Self {
            at,
            entry,
            ways,
            rates: ends.clone(),
            ends,
            off,
            shares: [0.0, 1.0],
            guesses: Few::new(),
        }
    }

    /// Looks at both sides of a share before others.
    fn guess(&mut self, share: f64) {
        let beside = 2.0 * CLOSE;
        self.guesses.extend([share - beside, share + beside]);
    }

    /// The middle of what is left.
    fn share(&self) -> f64 {
        0.5 * (self.shares[0] + self.shares[1])
    }

    /// Share to look at next.
    fn next(&mut self) -> f64 {
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
    fn see(&mut self, share: f64, rates: &[f64]) {
        let [first, last] = [0, 1].map(|end: usize| self.ends[end][self.entry]);
        let off = self.off[self.entry];
        let line = first + share * (last - first - off);
        let side = usize::from((rates[self.entry] - line).abs() > 0.25 * off.abs());
        self.shares[side] = share;
        self.rates[side].copy_from_slice(rates);
    }

    fn is_found(&self) -> bool {
        self.shares[1] - self.shares[0] <= 5.0 * CLOSE
    }

    /// Change of a rate at the jump.
    fn change(&self, i: usize) -> f64 {
        self.rates[1][i] - self.rates[0][i]
    }

    /// Returns whether a rate jumps there: by a quarter of what it is off at the end or more, and by more than a slope changes it there.
    fn jumps(&self, i: usize) -> bool {
        let all = (self.ends[1][i] - self.ends[0][i]).abs();
        let least = (0.25 * self.off[i].abs()).max(NEAR * all);
        self.is_found() && self.change(i).abs() > least
    }

    /// Mean rate on the way to the jump and on from it, to where rates are these.
    fn passed(&self, i: usize, end: f64) -> f64 {
        let (before, behind) = (self.rates[0][i], self.rates[1][i]);
        let share = self.share();
        0.5 * (share * (self.ends[0][i] + before) + (1.0 - share) * (behind + end))
    }

    /// The rate at the end of the step, of that found there: another jump on the way is not in it.
    fn end(&self, i: usize, end: f64) -> f64 {
        let slope = self.ends[1][i] - self.ends[0][i] - self.off[i];
        let expected = self.rates[1][i] + (1.0 - self.share()) * slope;
        match (end - expected).abs() < 0.5 * self.change(i).abs() {
            true => end,
            false => expected,
        }
    }

    /// A rate of the way to a share.
    fn way(&self, share: f64, i: usize) -> f64 {
        let [first, last, bend] = self.ways.each_ref().map(|way| way[i]);
        (1.0 - share) * first + share * (last + 0.5 * share * bend)
    }

    /// A state of the point at a share.
    fn state(&self, i: usize, share: f64, step: &Step<'_>) -> f64 {
        step.begin[self.at + i] + step.h * self.way(share, i)
    }
}

/// Carries points of `n` states each over a stretch, by their rates and the slopes of these or by an implicit rule; what jumps takes part by its mean.
pub(super) fn step_with_jumps(
    path: &mut Path<'_, '_>,
    of: Stretch,
    (n, x, seen): (usize, &mut [f64], &mut JumpsSeen),
    mut implicit: Option<&mut StepBy<'_>>,
) {
    seen.begin(n);
    let begin = x.to_vec();
    let step = Step {
        n,
        begin: &begin,
        h: path.seconds(of),
        of,
    };
    path.held.resize(x.len(), f64::NAN);
    let mut looked = vec![false; x.len()];
    let mut ways = step.ways(path, implicit.as_deref_mut());
    for _ in 0..n {
        let passing = step.passing(path, &ways, seen, &mut looked);
        if passing.is_empty() {
            break;
        }
        for (i, mean) in step.means(path, seen, &passing) {
            path.held[i] = mean;
        }
        ways = step.ways(path, implicit.as_deref_mut());
    }
    match implicit {
        Some(implicit) => implicit(path, of, x),
        None => x.copy_from_slice(&step.ahead(&ways, 1.0)),
    }
    path.held.clear();
}

/// One step of points of `n` states each.
struct Step<'s> {
    n: usize,
    begin: &'s [f64],
    /// Seconds.
    h: f64,
    of: Stretch,
}

/// Ways of points through a step: x(s) = x₀ + h·(s·way + s²·bends/2).
struct Ways {
    /// Rates at the begin, and their slopes along the step.
    first: Vec<f64>,
    slopes: Vec<f64>,
    way: Vec<f64>,
    bends: Vec<f64>,
}

impl Step<'_> {
    /// Where points are at a share of the step.
    fn ahead(&self, ways: &Ways, share: f64) -> Vec<f64> {
        let ways = self.begin.iter().zip(&ways.way).zip(&ways.bends);
        let ahead = |((x, way), bend)| x + share * self.h * (way + 0.5 * share * bend);
        ways.map(ahead).collect()
    }

    /// Ways by the rates and their slopes. Those of an implicit rule are straight, and lead to where it does what is stiff: rates at the begin lead far off.
    fn ways(&self, path: &mut Path<'_, '_>, implicit: Option<&mut StepBy<'_>>) -> Ways {
        let first = self.rates(path, self.begin);
        let mut ways = Ways {
            way: first.clone(),
            slopes: vec![],
            bends: vec![0.0; first.len()],
            first,
        };
        ways.slopes = self.slopes(path, &ways);
        let Some(implicit) = implicit else {
            ways.bends.clone_from(&ways.slopes);
            return ways;
        };
        let is_stiff = |i: &usize| ways.slopes[*i].abs() > ways.first[*i].abs();
        let stiff: Vec<usize> = (0..self.begin.len()).filter(is_stiff).collect();
        if !stiff.is_empty() {
            let mut end = self.begin.to_vec();
            implicit(path, self.of, &mut end);
            for i in stiff {
                ways.way[i] = (end[i] - self.begin[i]) / self.h;
            }
            ways.slopes = self.slopes(path, &ways);
        }
        ways
    }

    /// Slopes of the rates along straight ways.
    fn slopes(&self, path: &mut Path<'_, '_>, ways: &Ways) -> Vec<f64> {
        let looks = [NEAR, 2.0 * NEAR, 0.5, 1.0];
        let looks = looks.map(|share| self.rates(path, &self.ahead(ways, share)));
        let of = |(i, first): (usize, &f64)| slope(*first, looks.each_ref().map(|all| all[i]));
        ways.first.iter().enumerate().map(of).collect()
    }

    /// Where rates leave their line on the ways of points, searched for a jump: of each point one entry that was not looked at before.
    fn passing(
        &self,
        path: &mut Path<'_, '_>,
        ways: &Ways,
        seen: &JumpsSeen,
        looked: &mut [bool],
    ) -> Vec<Bracket> {
        let n = self.n;
        let [middle, last] = [0.5, 1.0].map(|share| self.rates(path, &self.ahead(ways, share)));
        let mut passing = vec![];
        for at in (0..self.begin.len()).step_by(n) {
            let of_point = |all: &[f64]| Few::from_slice(&all[at..at + n]);
            let rates = [&ways.first, &middle, &last].map(|all| of_point(all));
            let off = |share: f64, of: &Few| -> Few {
                let line = (at..at + n).map(|i| ways.first[i] + share * ways.slopes[i]);
                of.iter()
                    .zip(line)
                    .map(|(rate, line)| rate - line)
                    .collect()
            };
            let (middle, last) = (off(0.5, &rates[1]), off(1.0, &rates[2]));
            let Some(entry) = bent(&rates, [&middle, &last], &looked[at..at + n]) else {
                continue;
            };
            looked[at + entry] = true;
            let [first, _, end] = rates;
            let ways = [
                Few::from_elem(0.0, n),
                of_point(&ways.way),
                of_point(&ways.bends),
            ];
            let mut bracket = Bracket::new((at, entry), ways, [first, end], last);
            bracket.guess(seen.0[entry].share_on(&bracket, self));
            passing.push(bracket);
        }
        self.find(path, &mut passing);
        passing
    }

    /// Entries that jump, with the means of their rates.
    fn means(
        &self,
        path: &mut Path<'_, '_>,
        seen: &mut JumpsSeen,
        passing: &[Bracket],
    ) -> Vec<(usize, f64)> {
        let passing: Vec<&Bracket> = passing.iter().filter(|b| b.jumps(b.entry)).collect();
        if passing.is_empty() {
            return vec![];
        }
        let (mut onwards, mut ends) = (self.begin.to_vec(), self.begin.to_vec());
        for bracket in &passing {
            seen.0[bracket.entry].learn(bracket, self);
            for i in 0..self.n {
                let behind = bracket.rates[1][i];
                let at = bracket.state(i, bracket.shares[1], self);
                onwards[bracket.at + i] = at + NEAR * self.h * behind;
                ends[bracket.at + i] += self.h * bracket.passed(i, behind);
            }
        }
        let [onwards, ends] = [onwards, ends].map(|x| self.rates(path, &x));
        let (mut means, mut lines) = (vec![], vec![]);
        for bracket in &passing {
            let (at, entry) = (bracket.at, bracket.entry);
            let back = (onwards[at + entry] - bracket.rates[1][entry]) / -bracket.change(entry);
            match back > 0.5 {
                true => lines.push((*bracket, self.line(bracket, &seen.0[entry]))),
                false => {
                    let mean = |i: usize| (at + i, bracket.passed(i, bracket.end(i, ends[at + i])));
                    means.extend((0..self.n).filter(|&i| bracket.jumps(i)).map(mean));
                }
            }
        }
        let (jumps, mut lines): (Vec<&Bracket>, Vec<Bracket>) = lines.into_iter().unzip();
        self.tell_sides(path, &mut lines);
        self.find(path, &mut lines);
        for (line, jump) in lines.iter().zip(jumps) {
            // What jumps at the begin as well, but is held by another share, has its own bracket.
            let held = (0..self.n).filter(|&i| jump.jumps(i) && line.jumps(i));
            means.extend(held.map(|i| (line.at + i, line.way(line.share(), i))));
            seen.0[line.entry].share = line.share();
        }
        means
    }

    /// Points on which one is that a jump holds: between where the rates before it lead and those behind it.
    fn line(&self, jump: &Bracket, seen: &JumpSeen) -> Bracket {
        let [before, behind] = &jump.rates;
        let straight = Few::from_elem(0.0, self.n);
        let ways = [jump.ends[0].clone(), behind.clone(), straight];
        let ends = [behind.clone(), before.clone()];
        let off = (0..self.n).map(|i| -jump.change(i)).collect();
        let mut line = Bracket::new((jump.at, jump.entry), ways, ends, off);
        line.guess(seen.share);
        line.guess(seen.share_on(&line, self));
        line
    }

    /// Sides of lines are told by the rates at their ends, where all other states are as behind the step.
    fn tell_sides(&self, path: &mut Path<'_, '_>, lines: &mut [Bracket]) {
        if lines.is_empty() {
            return;
        }
        let [first, last] = [0.0, 1.0].map(|share| {
            let mut x = self.begin.to_vec();
            for line in &*lines {
                (0..self.n).for_each(|i| x[line.at + i] = line.state(i, share, self));
            }
            self.rates(path, &x)
        });
        for line in lines {
            let at = line.at..line.at + self.n;
            let ends = [&first, &last].map(|all| Few::from_slice(&all[at.clone()]));
            line.off = ends[1].iter().zip(&ends[0]).map(|(b, a)| b - a).collect();
            line.rates.clone_from(&ends);
            line.ends = ends;
        }
    }

    fn rates(&self, path: &mut Path<'_, '_>, x: &[f64]) -> Vec<f64> {
        let mut rates = vec![0.0; x.len()];
        path.rates(self.of, 0.5, x, &mut rates);
        rates
    }

    /// Narrows brackets down, each call of the equations for all of them.
    fn find(&self, path: &mut Path<'_, '_>, brackets: &mut [Bracket]) {
        let mut x = self.begin.to_vec();
        // Ends: looks beside guesses are few, and each other one halves what is left.
        loop {
            let mut shares = vec![];
            for bracket in brackets.iter_mut().filter(|b| !b.is_found()) {
                let share = bracket.next();
                for i in 0..self.n {
                    x[bracket.at + i] = bracket.state(i, share, self);
                }
                shares.push(share);
            }
            if shares.is_empty() {
                break;
            }
            let rates = self.rates(path, &x);
            let open = brackets.iter_mut().filter(|b| !b.is_found());
            for (bracket, share) in open.zip(shares) {
                bracket.see(share, &rates[bracket.at..bracket.at + self.n]);
            }
        }
    }
}

/// Slope of a rate along a straight way, from its values at the begin, at two places near it, in the middle and at the end: the smaller of the changes near
/// the begin, as a jump may be in the other, and no more than twice what the halves change.
fn slope(first: f64, [near, next, half, end]: [f64; 4]) -> f64 {
    let (one, other) = (near - first, next - near);
    let least = if other.abs() < one.abs() { other } else { one };
    let most = 2.0 * (half - first).abs().max((end - half).abs());
    // Rates that are no numbers bound nothing, and end the run.
    (least / NEAR).max(-most).min(most)
}

/// The entry, of those not looked at, whose rate is farthest off its line, by its own size, in another way than a curve is, a quarter as far in the middle as
/// at the end: where one jumps, the middle is as far off as the end, or not at all.
fn bent(
    [first, half, end]: &[Few; 3],
    [middle, last]: [&Few; 2],
    looked: &[bool],
) -> Option<usize> {
    let size = |i: usize| first[i].abs().max(half[i].abs()).max(end[i].abs());
    (0..first.len())
        .filter(|&i| {
            let least = 0.2 * last[i].abs() + CLOSE * size(i);
            !looked[i] && (middle[i] - 0.25 * last[i]).abs() > least
        })
        .max_by(|&i, &j| (last[i].abs() / size(i)).total_cmp(&(last[j].abs() / size(j))))
}

#[cfg(test)]
mod tests {
    use super::{JumpsSeen, Path, Stretch, step_with_jumps};
    use crate::twin::integrator::{Integrator, Now, Stepping, Workspace};
    use crate::twin::{Interval, Noise};

    /// Points carried over so many rows of 1 s.
    fn carried<const N: usize>(
        rule: Integrator,
        points: &[[f64; N]],
        rows: usize,
        rates: impl Fn(f64, &[f64], &mut [f64]),
    ) -> Vec<f64> {
        let mut work = Workspace::of(
            &[],
            &[Interval::EVERYTHING; N],
            (rule, Stepping::default()),
            &[],
        );
        let mut x = points.concat();
        for k in 0..rows {
            let now = Now::new(k as f64, 1.0, &[], &[]);
            work.carry(N, &now, &mut x, |now, x, dx| {
                for (x, dx) in x.chunks_exact(N).zip(dx.chunks_exact_mut(N)) {
                    rates(now.t, x, dx);
                }
            });
        }
        x
    }

    /// One step of a point.
    fn stepped<const N: usize>(
        h: f64,
        begin: [f64; N],
        mut rates: impl FnMut(f64, &[f64], &mut [f64]),
    ) -> [f64; N] {
        let now = Now::new(0.0, h, &[], &[]);
        let mut path = Path {
            now: &now,
            inputs: &mut [],
            drift: &mut |now, x, dx| rates(now.t, x, dx),
            breaks: &[],
            edge: 0.0,
            limits: None,
            held: vec![],
        };
        let mut x = begin;
        let of = Stretch {
            from: 0.0,
            length: 1.0,
        };
        let mut seen = JumpsSeen::default();
        step_with_jumps(&mut path, of, (N, &mut x, &mut seen), None);
        x
    }

    /// Where a step of 0.125 s ends is continuous in where it begins, and off by less than four squares of it: a sled that friction stops or lets through,
    /// a spring that is met, and friction beside a damping that changes the rate by more.
    #[test]
    fn a_step_past_a_jump_is_continuous_in_its_begin() {
        type Rates = fn(f64, &[f64], &mut [f64]);
        let systems: [(&str, [f64; 2], [f64; 2], Rates); 4] = [
            ("sled at rest", [0.0, -0.2], [0.0, 0.2], |_, x, dx| {
                (dx[0], dx[1]) = (x[1], 0.2 - 0.7 * sign(x[1]));
            }),
            ("sled", [0.0, -0.4], [0.0, 0.4], |_, x, dx| {
                (dx[0], dx[1]) = (x[1], 2.0 - 0.6 * sign(x[1]));
            }),
            ("spring", [0.9, 1.0], [1.1, 1.0], |_, x, dx| {
                let spring = if x[0] > 1.0 { 4.0 } else { 0.0 };
                (dx[0], dx[1]) = (x[1], -1.0 - spring);
            }),
            ("damped", [0.0, -0.2], [0.0, 0.2], |_, x, dx| {
                (dx[0], dx[1]) = (x[1], 0.9 - x[1] - 0.1 * sign(x[1]));
            }),
        ];
        let h = 0.125;
        for (name, from, to, rates) in systems {
            let mut last: Option<[f64; 2]> = None;
            for k in 0..=4000 {
                let share = f64::from(k) / 4000.0;
                let begin = [0, 1].map(|i: usize| from[i] + share * (to[i] - from[i]));
                let end = stepped(h, begin, rates);
                let (mut exact, short) = (begin, h / 2000.0);
                for _ in 0..if k % 40 == 0 { 2000 } else { 0 } {
                    let mut dx = [0.0; 2];
                    rates(0.0, &exact, &mut dx);
                    (0..2).for_each(|i| exact[i] += short * dx[i]);
                }
                for i in 0..2 {
                    let off = (end[i] - exact[i]).abs();
                    assert!(
                        k % 40 > 0 || off < 4.0 * h * h,
                        "{name} {begin:?}: {end:?} {exact:?}"
                    );
                    let leap = last.map_or(0.0, |last| (end[i] - last[i]).abs());
                    assert!(leap < 2e-3, "{name} {begin:?}: {i} leaps by {leap}");
                }
                last = Some(end);
            }
        }
    }

    /// Rubbing blocks, friction beside damping and a relay between two levels, from 3000 starts each: no step goes farther than the rates on it allow.
    #[test]
    fn no_step_goes_farther_than_its_rates() {
        type Rates = fn(f64, &[f64], &mut [f64]);
        let systems: [(&str, Rates); 4] = [
            ("blocks", |_, x, dx| {
                let between = 0.4 * sign(x[0] - x[1]);
                dx[0] = 0.3 - 0.5 * sign(x[0]) - between;
                dx[1] = between - 0.5 * sign(x[1]);
            }),
            ("two levels", |_, x, dx| {
                dx[0] = 2.0 - 0.6 * sign(x[0]) - 0.6 * sign(x[0] - 5e-5);
                dx[1] = 2.0 - 0.6 * sign(x[1]) - 0.6 * sign(x[1] - 2.5e-4);
            }),
            ("pushed", |_, x, dx| {
                (dx[0], dx[1]) = (x[1] - 0.6 * sign(x[0]), 2.0);
            }),
            ("damped", |_, x, dx| {
                (dx[0], dx[1]) = (0.3 - 4.0 * x[0] - 0.3 * sign(x[0]), 5.0 * (0.3 - x[1]));
            }),
        ];
        let mut source = Noise::new(7, "starts", 0).source("x");
        for (name, rates) in systems {
            for k in 0..3000 {
                // All the way, and next to where rates jump.
                let size = [0.5, 0.02, 3e-4][k % 3];
                let begin = [0; 2].map(|_| size * (2.0 * source.uniform() - 1.0));
                let end = stepped(0.125, begin, rates);
                let most = 0.125 * 5.0;
                for (from, to) in begin.iter().zip(end) {
                    assert!((to - from).abs() < most, "{name} {begin:?}: {end:?}");
                }
            }
        }
    }

    fn sign(x: f64) -> f64 {
        if x == 0.0 { 0.0 } else { x.signum() }
    }

    /// A sled comes to rest at 2 s, after 1 m, and stays until it is pushed harder than friction holds, at 20 s.
    #[test]
    fn friction_holds_at_rest() {
        let sled = |t: f64, x: &[f64], dx: &mut [f64]| {
            let push = 0.2 + f64::max(0.0, 0.1 * (t - 15.0));
            (dx[0], dx[1]) = (x[1], push - 0.7 * sign(x[1]));
        };
        for rule in [Integrator::Adaptive, Integrator::Stiff] {
            let x = carried(rule, &[[0.0, 1.0]], 20, sled);
            let off = [x[0] - 1.0, x[1]];
            assert!(off.iter().all(|off| off.abs() < 1e-4), "{rule:?}: {off:?}");
        }
        let x = carried(Integrator::Adaptive, &[[0.0, 1.0]], 24, sled);
        let off = [x[0] - 1.0 - 6.4 / 6.0, x[1] - 0.8];
        assert!(off.iter().all(|off| off.abs() < 1e-4), "{off:?}");
    }

    /// Points of a filter pass dry friction each at its own time: all end where the exact ways do, and by differences as small as those of a search the
    /// slopes are exact.
    #[test]
    fn points_pass_friction_smoothly() {
        let sled = |_: f64, x: &[f64], dx: &mut [f64]| {
            (dx[0], dx[1]) = (x[1], 2.0 - 0.6 * sign(x[1]));
        };
        let exact = |v: f64| 1.4 * (1.0 + v / 2.6);
        let starts = [-0.9, -0.6, -0.31, -0.3, -0.1];
        for rule in [Integrator::Adaptive, Integrator::Stiff] {
            for shift in 0..100 {
                let points = |by: f64| starts.map(|v| [0.0, v + 0.003 * f64::from(shift) - by]);
                let [here, there] = [0.0, 1e-6].map(|by: f64| carried(rule, &points(by), 1, sled));
                let begin = points(0.0);
                for (i, [_, v]) in begin.iter().enumerate().filter(|(_, [_, v])| *v < 0.0) {
                    let (here, there) = (here[2 * i + 1], there[2 * i + 1]);
                    assert!((here - exact(*v)).abs() < 1e-6, "{rule:?} from {v}: {here}");
                    let slope = (here - there) / 1e-6;
                    assert!(
                        (slope - 1.4 / 2.6).abs() < 0.01,
                        "{rule:?} from {v}: slope {slope}"
                    );
                }
            }
        }
    }

    /// A state that friction holds stays while another one changes its push by more than friction within a step, and steps are short enough for a damping
    /// that is faster than the rows.
    #[test]
    fn what_is_held_stays_beside_faster_states() {
        for change in [1.1, 2.0, -6.0] {
            let [x, _] = stepped(0.125, [0.0, 0.2], |_, x, dx| {
                (dx[0], dx[1]) = (x[1] - 0.6 * sign(x[0]), change);
            });
            assert!(x.abs() < 1e-6, "{change}: {x}");
        }
        for decay in [10.0, 20.0, 30.0] {
            let end = carried(
                Integrator::Adaptive,
                &[[0.3, 0.2], [0.31, 0.2]],
                3,
                |_, x, dx| {
                    (dx[0], dx[1]) = (x[1] - 0.6 * sign(x[0]), decay * (0.3 - x[1]));
                },
            );
            let off = [end[0], end[1] - 0.3, end[2], end[3] - 0.3];
            assert!(off.iter().all(|off| off.abs() < 1e-3), "{decay}: {off:?}");
        }
    }

    /// Two blocks that rub on each other, and one of them on the ground: they come together and are then carried on by one force.
    #[test]
    fn blocks_that_stick_move_together() {
        let blocks = |_: f64, x: &[f64], dx: &mut [f64]| {
            let between = sign(x[0] - x[1]);
            (dx[0], dx[1]) = (0.5 - between, between);
        };
        let together = carried(Integrator::Adaptive, &[[0.0, 2.0]], 12, blocks);
        // 1.5 and -1 m/s² until 0.8 s, at 1.2 m/s; 0.25 m/s² for both from there.
        let expected = 1.2 + 0.25 * 11.2;
        let off = [together[0] - expected, together[1] - expected];
        assert!(off.iter().all(|off| off.abs() < 1e-3), "{off:?}");
        // Each held by the ground, too.
        let held = |_: f64, x: &[f64], dx: &mut [f64]| {
            (dx[0], dx[1]) = (
                0.3 - 0.5 * sign(x[0]),
                0.2 * (0.3_f64).sin() - 0.4 * sign(x[1]),
            );
        };
        let still = carried(Integrator::Adaptive, &[[0.5, -0.3]], 12, held);
        assert!(still.iter().all(|v| v.abs() < 1e-6), "{still:?}");
    }
}
