//! Steps in which points meet jumps of rates: those that pass one, as a pendulum's dry friction where it turns round, and those that one holds, as
//! dry friction at rest.
//!
//! ```text
//! x(s) = x₀ + s·h·f_a                              is at the jump at s; f_a: rates on this side, f_b: rates behind it
//! x(α) = x₀ + h·((1 − α)·f_a + α·f_b)              α = 1 − s where the point goes on from there; where f_b leads back, α is such that x(α) is at the jump
//! ```
//!
//! What jumps moves by that mean of both rates, all else takes the step beside it: the end of a step is a continuous function of its begin, whatever
//! jumps between. Sides are told from the rates alone, shares are found by halves, or at once where a jump is met again where it was before. One
//! jump is met after the other, so that two blocks come to rest each on its own. Where nothing jumps, the step stays as it is.
//!
//! Sources: Filippov, *Differential Equations with Discontinuous Righthand Sides* (1988), section 4; Acary and Brogliato, *Implicit Euler numerical
//! scheme and chattering-free implementation of sliding mode systems*, Systems & Control Letters 59 (2010) 284–293.

use super::event_calls::StepBy;
use super::path::{Path, Stretch};
use smallvec::SmallVec;

/// Width of a share that is found by halves, in 27 looks: derivatives by θ are differences of ways that are some 1e-6 of a step apart.
const CLOSE: f64 = 1e-8;
/// Distance of a rate in the middle from the mean of both ends, as a share of their difference, from which a jump is looked for. That of a jump
/// is a half; twice as much would miss one beside a slope that changes the rate by as much, half of it looks where rates are merely curved.
const BENT: f64 = 0.1;

/// The last place at which the rate of each state jumped: where the next point will meet it.
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
        let [first, last] = [0.0, 1.0].map(|share| bracket.state(self.by, share, step));
        (self.at[self.by] - first) / (last - first)
    }

    /// Learns where it jumped now, unless that was known.
    fn see(&mut self, bracket: &Bracket, step: &Step<'_>) {
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

/// Search for the place of a jump among the points x₀ + h·((1 − σ)·r₀ + σ·r₁).
struct Bracket {
    /// Place of the point among all numbers.
    at: usize,
    /// Entry whose rate tells the sides.
    entry: usize,
    /// r₀ and r₁.
    ways: [Few; 2],
    /// Rates at both ends.
    ends: [Few; 2],
    /// Shares σ between which the jump is, and rates there.
    shares: [f64; 2],
    rates: [Few; 2],
    /// Shares to be looked at first.
    first: Few,
}

impl Bracket {
    fn new((at, entry): (usize, usize), ways: [Few; 2], ends: [&[f64]; 2]) -> Self {
        let ends = ends.map(Few::from_slice);
        Self {
            at,
            entry,
            ways,
            rates: ends.clone(),
            ends,
            shares: [0.0, 1.0],
            first: Few::new(),
        }
    }

    /// Looks at both sides of a share before others.
    fn guess(&mut self, share: f64) {
        self.first
            .extend([share - 2.0 * CLOSE, share + 2.0 * CLOSE]);
    }

    /// The middle of what is left.
    fn share(&self) -> f64 {
        0.5 * (self.shares[0] + self.shares[1])
    }

    /// Share to look at next.
    fn next(&mut self) -> f64 {
        let [low, high] = self.shares;
        while let Some(share) = self.first.pop() {
            if low < share && share < high {
                return share;
            }
        }
        self.share()
    }

    /// Learns the rates at a share.
    fn see(&mut self, share: f64, rates: &[f64]) {
        let ends = [0, 1].map(|end: usize| self.ends[end][self.entry]);
        let side = usize::from(is_last(rates[self.entry], ends));
        self.shares[side] = share;
        self.rates[side].copy_from_slice(rates);
    }

    fn is_found(&self) -> bool {
        self.shares[1] - self.shares[0] <= 5.0 * CLOSE
    }

    /// Returns whether a rate jumps there: it changes by half of what it does from end to end, or more.
    fn jumps(&self, i: usize) -> bool {
        let change = |of: &[Few; 2]| (of[1][i] - of[0][i]).abs();
        self.is_found()
            && change(&self.rates) > 0.0
            && change(&self.rates) >= 0.5 * change(&self.ends)
    }

    /// Mean rate on the way to the jump and on from it, to where rates are these.
    fn passed(&self, i: usize, end: &[f64]) -> f64 {
        let [before, behind] = &self.rates;
        let share = self.share();
        0.5 * (share * (self.ends[0][i] + before[i]) + (1.0 - share) * (behind[i] + end[i]))
    }

    /// A rate of the way to a share.
    fn way(&self, share: f64, i: usize) -> f64 {
        (1.0 - share) * self.ways[0][i] + share * self.ways[1][i]
    }

    /// A state of the point at a share.
    fn state(&self, i: usize, share: f64, step: &Step<'_>) -> f64 {
        step.begin[self.at + i] + step.h * self.way(share, i)
    }
}

/// Returns whether a rate is nearer to that of the last side.
fn is_last(rate: f64, [first, last]: [f64; 2]) -> bool {
    (rate - first) / (last - first) > 0.5
}

/// Carries points of `n` states each over a stretch by `step`, in which what jumps takes part by its mean.
pub(super) fn step_with_jumps(
    path: &mut Path<'_, '_>,
    of: Stretch,
    (n, x, seen): (usize, &mut [f64], &mut JumpsSeen),
    step: &mut StepBy<'_>,
) {
    seen.begin(n);
    let begin = x.to_vec();
    let whole = Step {
        n,
        begin: &begin,
        h: path.seconds(of),
        of,
    };
    path.held.resize(x.len(), f64::NAN);
    let mut looked = vec![false; x.len()];
    for _ in 0..n {
        let passing = whole.passing(path, seen, &mut looked);
        if passing.is_empty() {
            break;
        }
        for (i, mean) in whole.means(path, seen, &passing) {
            path.held[i] = mean;
        }
    }
    step(path, of, x);
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

impl Step<'_> {
    /// Where the rates of points are bent on their ways, searched for a jump: of each point one entry that was not looked at before.
    fn passing(
        &self,
        path: &mut Path<'_, '_>,
        seen: &JumpsSeen,
        looked: &mut [bool],
    ) -> Vec<Bracket> {
        let n = self.n;
        let first = self.rates(path, self.begin);
        let [middle, last] = [0.5, 1.0].map(|share: f64| {
            let ways = self.begin.iter().zip(&first);
            let x: Vec<f64> = ways.map(|(x, rate)| x + share * self.h * rate).collect();
            self.rates(path, &x)
        });
        let mut passing = vec![];
        for at in (0..self.begin.len()).step_by(n) {
            let [first, middle, last] = [&first, &middle, &last].map(|all| &all[at..at + n]);
            let Some(entry) = bent([first, middle, last], &looked[at..at + n]) else {
                continue;
            };
            looked[at + entry] = true;
            let ways = [Few::from_elem(0.0, n), Few::from_slice(first)];
            let mut bracket = Bracket::new((at, entry), ways, [first, last]);
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
        let mut ends = self.begin.to_vec();
        for bracket in &passing {
            seen.0[bracket.entry].see(bracket, self);
            for i in 0..self.n {
                ends[bracket.at + i] += self.h * bracket.passed(i, &bracket.rates[1]);
            }
        }
        let ends = self.rates(path, &ends);
        let (mut means, mut leading_back) = (vec![], vec![]);
        for bracket in passing {
            let (at, entry) = (bracket.at, bracket.entry);
            let [before, behind] = &bracket.rates;
            if is_last(ends[at + entry], [behind[entry], before[entry]]) {
                let ways = [bracket.ends[0].clone(), behind.clone()];
                let mut bracket = Bracket::new((at, entry), ways, [behind, before]);
                bracket.guess(seen.0[entry].share);
                bracket.guess(seen.0[entry].share_on(&bracket, self));
                leading_back.push(bracket);
                continue;
            }
            let mean = |i: usize| (at + i, bracket.passed(i, &ends[at..]));
            means.extend((0..self.n).filter(|&i| bracket.jumps(i)).map(mean));
        }
        self.find(path, &mut leading_back);
        for bracket in leading_back.iter().filter(|b| b.jumps(b.entry)) {
            seen.0[bracket.entry].share = bracket.share();
            let mean = |i: usize| (bracket.at + i, bracket.way(bracket.share(), i));
            means.extend((0..self.n).filter(|&i| bracket.jumps(i)).map(mean));
        }
        means
    }

    fn rates(&self, path: &mut Path<'_, '_>, x: &[f64]) -> Vec<f64> {
        let mut rates = vec![0.0; x.len()];
        path.rates(self.of, 0.5, x, &mut rates);
        rates
    }

    /// Narrows brackets down, each call of the equations for all of them.
    fn find(&self, path: &mut Path<'_, '_>, brackets: &mut [Bracket]) {
        let mut x = self.begin.to_vec();
        // Ends: each look halves what is left, but for those at guesses.
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

/// The entry, of those not looked at, whose rate in the middle is farthest off the mean of both ends, by its own size; `None` where none is as far
/// as where one jumps.
fn bent([first, middle, last]: [&[f64]; 3], looked: &[bool]) -> Option<usize> {
    let off = |i: usize| (middle[i] - 0.5 * (first[i] + last[i])).abs();
    let size = |i: usize| first[i].abs().max(middle[i].abs()).max(last[i].abs());
    (0..first.len())
        .filter(|&i| !looked[i] && off(i) > BENT * (last[i] - first[i]).abs() + CLOSE * size(i))
        .max_by(|&i, &j| (off(i) / size(i)).total_cmp(&(off(j) / size(j))))
}

#[cfg(test)]
mod tests {
    use crate::twin::Interval;
    use crate::twin::integrator::{Integrator, Now, Stepping, Workspace};

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
