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
//! Rates are those of the time that belongs to a share: what is held is at the end where the jump is at the end, as on a belt that turns round.
//!
//! Sources: Filippov, *Differential Equations with Discontinuous Righthand Sides* (1988), section 4; Acary and Brogliato, *Implicit Euler numerical
//! scheme and chattering-free implementation of sliding mode systems*, Systems & Control Letters 59 (2010) 284–293.

mod bracket;

use super::event_calls::StepBy;
use super::path::{Path, Stretch};
pub(super) use bracket::JumpsSeen;
use bracket::{Bracket, CLOSE, Few};

/// Share of a step that shows the slope of rates at its begin, and where they lead behind a jump. Half or twice of it show the same.
const NEAR: f64 = 1e-3;

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
        let first = self.rates(path, 0.0, self.begin);
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
        let looks = looks.map(|share| self.rates(path, share, &self.ahead(ways, share)));
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
        let [middle, last] =
            [0.5, 1.0].map(|share| self.rates(path, share, &self.ahead(ways, share)));
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
        let looks: Vec<_> = (passing.iter())
            .map(|b| (*b, (b.shares[1] + NEAR).min(1.0)))
            .collect();
        let onwards = self.rates_at(path, &looks, &onwards);
        let ends = self.rates(path, 1.0, &ends);
        let (mut means, mut jumps) = (vec![], vec![]);
        for bracket in &passing {
            let (at, entry) = (bracket.at, bracket.entry);
            let back = (onwards[at + entry] - bracket.rates[1][entry]) / -bracket.change(entry);
            match back > 0.5 {
                true => jumps.push(*bracket),
                false => {
                    let mean = |i: usize| (at + i, bracket.passed(i, bracket.end(i, ends[at + i])));
                    means.extend((0..self.n).filter(|&i| bracket.jumps(i)).map(mean));
                }
            }
        }
        let mut lines = self.lines(path, seen, &jumps);
        self.find(path, &mut lines);
        for (line, jump) in lines.iter().zip(jumps) {
            if let Some(rate) = line.outrun(jump) {
                means.push((line.at + line.entry, rate));
                continue;
            }
            // What jumps at the begin as well, but is held by another share, has its own bracket.
            let held = (0..self.n).filter(|&i| jump.jumps(i) && line.jumps(i));
            means.extend(held.map(|i| (line.at + i, line.way(line.share(), i))));
            seen.0[line.entry].share = line.share();
        }
        means
    }

    /// Points on which one is that a jump holds: between where the rates before it lead and those behind it. Sides are told by the rates at both
    /// ends, where all other states are as behind the step.
    fn lines(&self, path: &mut Path<'_, '_>, seen: &JumpsSeen, jumps: &[&Bracket]) -> Vec<Bracket> {
        if jumps.is_empty() {
            return vec![];
        }
        // At both ends and near them, where slopes show.
        let looks = [0.0, NEAR, 1.0 - NEAR, 1.0].map(|share| {
            let mut x = self.begin.to_vec();
            for jump in jumps {
                let of_point = &mut x[jump.at..jump.at + self.n];
                for (i, x) in of_point.iter_mut().enumerate() {
                    let [before, behind] = jump.sides(i);
                    *x += self.h * ((1.0 - share) * before + share * behind);
                }
            }
            self.rates(path, 1.0, &x)
        });
        let line = |jump: &&Bracket| {
            let straight = Few::from_elem(0.0, self.n);
            let sides = [0, 1].map(|end: usize| (0..self.n).map(|i| jump.sides(i)[end]).collect());
            let [before, behind] = sides;
            let ways = [before, behind, straight];
            let at = jump.at..jump.at + self.n;
            let looks = looks
                .each_ref()
                .map(|all| Few::from_slice(&all[at.clone()]));
            let off = (0..self.n).map(|i| {
                let [first, near, far, last] = looks.each_ref().map(|of_point| of_point[i]);
                let (one, other) = ((near - first) / NEAR, (last - far) / NEAR);
                last - first - if other.abs() < one.abs() { other } else { one }
            });
            let (off, [first, _, _, last]) = (off.collect(), looks.clone());
            let ends = [first, last];
            let mut line = Bracket::new((jump.at, jump.entry), ways, ends, off);
            line.time = Some(1.0);
            let seen = &seen.0[jump.entry];
            line.guess(seen.share);
            line.guess(seen.share_on(&line, self));
            line
        };
        jumps.iter().map(line).collect()
    }

    /// Rates of points at one share of the step's time.
    fn rates(&self, path: &mut Path<'_, '_>, time: f64, x: &[f64]) -> Vec<f64> {
        let mut rates = vec![0.0; x.len()];
        path.rates(self.of, time, x, &mut rates);
        rates
    }

    /// Rates of the points of brackets, each at its own share of the step's time: on the line between those at the first and the last of these times, where
    /// a point meets no jump between them.
    fn rates_at(&self, path: &mut Path<'_, '_>, looks: &[(&Bracket, f64)], x: &[f64]) -> Vec<f64> {
        let shares = || looks.iter().map(|(_, time)| *time);
        let (first, last) = (shares().fold(1.0, f64::min), shares().fold(0.0, f64::max));
        let mut rates = self.rates(path, first, x);
        if first == last {
            return rates;
        }
        let others = self.rates(path, last, x);
        for &(bracket, time) in looks {
            let of_point = bracket.at..bracket.at + self.n;
            let share = (time - first) / (last - first);
            let points = rates[of_point.clone()]
                .iter_mut()
                .zip(&others[of_point.clone()]);
            let mut is_smooth = true;
            for ((rate, other), off) in points.zip(&bracket.off) {
                let change = other - *rate;
                is_smooth &= change == 0.0 || change.abs() < 0.25 * off.abs();
                *rate += share * change;
            }
            if !is_smooth {
                let own = self.rates(path, time, x);
                rates[of_point.clone()].copy_from_slice(&own[of_point]);
            }
        }
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
            let open = brackets.iter().filter(|b| !b.is_found()).zip(&shares);
            let looks: Vec<_> = open
                .map(|(b, share)| (b, b.time.unwrap_or(*share)))
                .collect();
            let rates = self.rates_at(path, &looks, &x);
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
mod tests;
