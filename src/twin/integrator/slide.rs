//! Steps in which states stay on a jump of rates that push them back from either side, as dry friction at rest does.
//!
//! ```text
//! x(α) = x₀ + h·((1 − α)·f_a + α·f_b)      f_a = f(x₀), f_b = f(x₀ + h·f_a): rates on this and on that side of the jump
//! ```
//!
//! The share α at which x(α) is at the jump is found by halves. What jumps there moves by that mean of both rates, all else takes the step beside it.
//! One jump is met after the other, so that two blocks come to rest each on its own. Where nothing jumps, the step stays as it is.
//!
//! Sources: Filippov, *Differential Equations with Discontinuous Righthand Sides* (1988), section 4; Acary and Brogliato, *Implicit Euler numerical
//! scheme and chattering-free implementation of sliding mode systems*, Systems & Control Letters 59 (2010) 284–293.

use super::event_calls::StepBy;
use super::path::{Path, Stretch};
use crate::math::descending;
use smallvec::SmallVec;

/// Width of a share that is found: states then are off the jump by a millionth of what one step of the rates moves them. Twice as much costs
/// one look less.
const CLOSE: f64 = 1e-6;
/// Looks for a share, at most: twenty find it by halves.
const LOOKS: usize = 24;

/// Shares between which a point is at a jump, with its rates on either side of it.
struct Bracket {
    /// Place of the point among all numbers.
    at: usize,
    /// Entry whose rate tells the sides.
    entry: usize,
    guess: f64,
    shares: [f64; 2],
    rates: [Vec<f64>; 2],
}

impl Bracket {
    /// By the entry of this rank, the largest jump first, of those whose rates change their sign from the begin of a step to its end; `None` where so
    /// many do not.
    fn of(at: usize, [first, last]: [&[f64]; 2], rank: usize) -> Option<Self> {
        let jump = |i: usize| last[i] - first[i];
        let is_turned = |i: &usize| first[*i] * last[*i] < 0.0;
        let mut turned: SmallVec<[usize; 4]> = (0..first.len()).filter(is_turned).collect();
        descending(&mut turned, |i| jump(*i).abs());
        let entry = *turned.get(rank)?;
        Some(Self {
            at,
            entry,
            // What rests stays where it is.
            guess: -first[entry] / jump(entry),
            shares: [0.0, 1.0],
            rates: [vec![], vec![]],
        })
    }

    /// Share to look at next.
    fn next(&self, look: usize) -> f64 {
        let [low, high] = self.shares;
        match look {
            0 => self.guess,
            1 if low == self.guess => (low + CLOSE).min(high),
            1 => (high - CLOSE).max(low),
            _ => 0.5 * (low + high),
        }
    }

    /// Learns the rates at a share, beside those at the begin and at the end of the step.
    fn see(&mut self, share: f64, rates: &[f64], [first, last]: [&[f64]; 2]) {
        let own = |rates: &[f64]| rates[self.entry];
        let is_behind = (own(rates) - own(first)) / (own(last) - own(first)) > 0.5;
        let side = usize::from(!is_behind);
        self.shares[side] = share;
        self.rates[side] = rates.to_vec();
    }

    fn is_found(&self) -> bool {
        self.shares[1] - self.shares[0] <= CLOSE
    }

    /// Entries that jump between both shares, with the means of their rates.
    fn held(&self, [first, last]: [&[f64]; 2]) -> Vec<(usize, f64)> {
        let share = 0.5 * (self.shares[0] + self.shares[1]);
        let [behind, before] = &self.rates;
        if behind.is_empty() || before.is_empty() || !self.is_found() {
            return vec![];
        }
        let jumps = |i: &usize| {
            let all = (last[*i] - first[*i]).abs();
            all > 0.0 && (behind[*i] - before[*i]).abs() >= 0.5 * all
        };
        let mean = |i: usize| (self.at + i, (1.0 - share) * first[i] + share * last[i]);
        (0..first.len()).filter(jumps).map(mean).collect()
    }
}

/// Carries points of `n` states each over a stretch by `step`, which what jumps back and forth takes part in by its mean.
pub(super) fn slide(
    path: &mut Path<'_, '_>,
    of: Stretch,
    (n, x): (usize, &mut [f64]),
    step: &mut StepBy<'_>,
) {
    let begin = x.to_vec();
    step(path, of, x);
    path.held.resize(x.len(), f64::NAN);
    for _ in 0..n {
        let held = held(path, of, n, &begin);
        if held.is_empty() {
            break;
        }
        for (i, rate) in held {
            path.held[i] = rate;
        }
        x.copy_from_slice(&begin);
        step(path, of, x);
    }
    path.held.clear();
}

/// Entries that a jump holds in a step from `begin`, with the rates that they then have.
fn held(path: &mut Path<'_, '_>, of: Stretch, n: usize, begin: &[f64]) -> Vec<(usize, f64)> {
    let (h, mut x) = (path.seconds(of), begin.to_vec());
    let mut rates = [vec![0.0; x.len()], vec![0.0; x.len()]];
    path.rates(of, 0.5, &x, &mut rates[0]);
    for (x, rate) in x.iter_mut().zip(&rates[0]) {
        *x += h * rate;
    }
    path.rates(of, 0.5, &x, &mut rates[1]);
    let of_point = |at: usize| [0, 1].map(|side: usize| &rates[side][at..at + n]);
    let (mut there, points) = (vec![0.0; x.len()], (0..begin.len()).step_by(n));
    let (mut held, mut points): (Vec<(usize, f64)>, Vec<usize>) = (vec![], points.collect());
    for rank in 0..n {
        let brackets = points
            .iter()
            .filter_map(|&at| Bracket::of(at, of_point(at), rank));
        let mut brackets: Vec<Bracket> = brackets.collect();
        let moved = |share: f64, at: usize| {
            let [first, last] = of_point(at);
            let pairs = first.iter().zip(last);
            let means = pairs.map(move |(first, last)| (1.0 - share) * first + share * last);
            begin[at..]
                .iter()
                .zip(means)
                .map(move |(x, mean)| x + h * mean)
        };
        for look in 0..LOOKS {
            if brackets.iter().all(Bracket::is_found) {
                break;
            }
            for bracket in &brackets {
                let all = x[bracket.at..]
                    .iter_mut()
                    .zip(moved(bracket.next(look), bracket.at));
                all.for_each(|(x, moved)| *x = moved);
            }
            path.rates(of, 0.5, &x, &mut there);
            for bracket in brackets.iter_mut().filter(|bracket| !bracket.is_found()) {
                let own = &there[bracket.at..bracket.at + n];
                bracket.see(bracket.next(look), own, of_point(bracket.at));
            }
        }
        points.clear();
        for bracket in &brackets {
            let own = bracket.held(of_point(bracket.at));
            // Another entry may tell the sides of a jump that this one only turns at.
            if own.is_empty() {
                points.push(bracket.at);
            }
            held.extend(own);
        }
    }
    held
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
