//! Conditions that turn and turn back within one stretch, which its ends do not show.

use super::event_calls::{EventsOfWay, PROBE, StepBy, moved};
use super::path::{Path, Stretch};

/// Looks at a hump, at most: four find most tops to rounding.
const LOOKS: usize = 30;

/// A margin along a stretch, with its values and slopes at two shares.
#[derive(Debug, Clone, Copy)]
struct Hump {
    shares: [f64; 2],
    margins: [f64; 2],
    slopes: [f64; 2],
}

impl Hump {
    /// Returns the share to look at next; `None` where the top is not above zero. The tangents at the ends meet at the top of a hump with a corner, as
    /// two comparisons joined make one, and above that of a round one, which the cubic finds sooner.
    fn next(&self, number: usize) -> Option<f64> {
        let width = self.shares[1] - self.shares[0];
        let [first, last] = self.slopes.map(|slope| slope * width);
        let change = self.margins[1] - self.margins[0];
        let round = self.round([first, last], change);
        let meeting = (change - last) / (first - last);
        let s = match first > 0.0 && last < 0.0 {
            true if self.margins[0] + first * meeting <= 0.0 => return None,
            true if number % 2 == 1 => meeting,
            true => round.map_or(meeting, |(s, _)| s),
            // What falls first, or rises last, has no corner that this would show.
            false => round.filter(|(_, highest)| *highest > 0.0)?.0,
        };
        (s > 0.0 && s < 1.0).then_some(self.shares[0] + s * width)
    }

    /// Place and height of the top of the cubic above both ends. The margin may be higher by as much as that is above them: of half a wave it is by a
    /// quarter.
    fn round(&self, [first, last]: [f64; 2], change: f64) -> Option<(f64, f64)> {
        // m₀ + d₀·s + b·s² + c·s³, with its slopes d₀ and d₁ at 0 and 1.
        let (b, c) = (
            3.0 * change - 2.0 * first - last,
            first + last - 2.0 * change,
        );
        let root = (b * b - 3.0 * c * first).sqrt();
        let s = match b > 0.0 {
            true => (-b - root) / (3.0 * c),
            false => first / (root - b),
        };
        let height = self.margins[0] + s * (first + s * (b + s * c));
        let above = height - self.margins[0].max(self.margins[1]);
        (s > 0.0 && s < 1.0 && above > 0.0).then_some((s, height + above))
    }

    /// Returns a share at which the margin is above zero, which it is at neither end; `look` gives margin and slope at a share.
    fn above_zero(mut self, mut look: impl FnMut(f64) -> (f64, f64)) -> Option<f64> {
        for number in 0..LOOKS {
            let share = self.next(number)?;
            let (margin, slope) = look(share);
            if margin > 0.0 {
                return Some(share);
            }
            let side = usize::from(slope <= 0.0);
            (self.shares[side], self.margins[side], self.slopes[side]) = (share, margin, slope);
        }
        None
    }
}

/// Returns a share of a stretch from `from` to `to` at which a condition is not what it is at both ends: the least of those found, one for each
/// condition; what turns before it alone is met on the way there. `signs` are 1 for a condition that is false at the ends, -1 for a true one and 0 for
/// another; `margins` are those at the ends.
pub(super) fn turned_within(
    events: &EventsOfWay<'_>,
    (path, step): (&mut Path<'_, '_>, &mut StepBy<'_>),
    of: Stretch,
    points: [&[f64]; 2],
    (signs, margins): (&[f64], [&[f64]; 2]),
) -> Option<f64> {
    if signs.iter().all(|sign| *sign == 0.0) {
        return None;
    }
    let first = slopes_at(events, path, (of, 0.0), (points[0], margins[0]));
    let falls = |(sign, slope): (&f64, &f64)| *sign == 0.0 || sign * slope < 0.0;
    if signs.iter().zip(&first).all(falls) {
        return None;
    }
    let last = slopes_at(events, path, (of, 1.0), (points[1], margins[1]));
    let mut soonest = None;
    let mut x = points[0].to_vec();
    for (i, sign) in signs.iter().enumerate() {
        let hump = Hump {
            shares: [0.0, 1.0],
            margins: margins.map(|margins| sign * margins[i]),
            slopes: [sign * first[i], sign * last[i]],
        };
        let share = hump.above_zero(|share| {
            let length = share * of.length;
            x.copy_from_slice(points[0]);
            step(path, Stretch { length, ..of }, &mut x);
            let margins = path.at(of.from + length, |now| events.margins(now, &x));
            let slopes = slopes_at(events, path, (of, share), (&x, &margins));
            (sign * margins[i], sign * slopes[i])
        });
        soonest = [soonest, share].into_iter().flatten().reduce(f64::min);
    }
    soonest
}

/// Slopes of all margins at a share of a stretch, per stretch, seen from its inside.
fn slopes_at(
    events: &EventsOfWay<'_>,
    path: &mut Path<'_, '_>,
    (of, share): (Stretch, f64),
    (x, margins): (&[f64], &[f64]),
) -> Vec<f64> {
    let (here, length) = (of.from + share * of.length, PROBE.min(0.25 * of.length));
    let by = if share > 0.5 { -length } else { length };
    let moved = moved(path, (here, by), x);
    let others = path.at(here + by, |now| events.margins(now, &moved));
    let pairs = margins.iter().zip(&others);
    let slope = |(here, there): (&f64, &f64)| (there - here) / by * of.length;
    pairs.map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use crate::twin::{Event, Integrator, Stepping};

    #[test]
    fn the_top_of_a_hump_is_found() {
        let looks = std::cell::Cell::new(0);
        let of_sine = |level: f64| {
            let look = |share: f64| {
                looks.set(looks.get() + 1);
                let (sin, cos) = (std::f64::consts::PI * share).sin_cos();
                (sin - level, std::f64::consts::PI * cos)
            };
            let ends = [0.0, 0.9].map(look);
            looks.set(0);
            let hump = Hump {
                shares: [0.0, 0.9],
                margins: ends.map(|end| end.0),
                slopes: ends.map(|end| end.1),
            };
            hump.above_zero(look)
        };
        for level in [0.7, 0.99, 0.999_999, 1.0 - 1e-12] {
            let share = of_sine(level).unwrap();
            assert!((std::f64::consts::PI * share).sin() > level, "{level}");
            assert!(looks.get() <= 8, "{level}: {} looks", looks.get());
        }
        assert!(of_sine(1.0 + 1e-9).is_none() && looks.get() <= 12);
        assert!(of_sine(3.0).is_none() && looks.get() == 0);
    }

    /// A window that a ramp passes, with its corner; one of no width is not met.
    #[test]
    fn a_corner_is_found() {
        for (half, is_met) in [(0.1, true), (1e-6, true), (0.0, false)] {
            let look = |share: f64| {
                let off = share - 0.317;
                (half - off.abs(), -off.signum())
            };
            let ends = [0.0, 1.0].map(look);
            let hump = Hump {
                shares: [0.0, 1.0],
                margins: ends.map(|end| end.0),
                slopes: ends.map(|end| end.1),
            };
            assert_eq!(hump.above_zero(look).is_some(), is_met, "{half}");
        }
    }

    /// An oscillation of 1 Hz that counts how often it comes above a level, or back above one that it is below briefly.
    struct Counter {
        integrator: Integrator,
        level: f64,
    }

    impl StateSpace for Counter {
        fn outline(&self) -> Outline {
            let level = self.level;
            Outline::new()
                .parameter(Parameter::new("w", "rad/s", 1.0, 10.0))
                .state("q", "m")
                .state("p", "m")
                .state("count", "-")
                .output("y", "-")
                .event(Event::when(
                    "above",
                    move |_, x| x[0] - level,
                    |_, x| x[2] += 1.0,
                ))
        }
        fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
            (dx[0], dx[1], dx[2]) = (now.theta[0] * x[1], -now.theta[0] * x[0], 0.0);
        }
        fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
            y[0] = x[2];
        }
        fn start(&self, _: &Now, x: &mut [f64]) {
            (x[0], x[1]) = (0.0, 1.0);
        }
        fn integrator(&self) -> Integrator {
            self.integrator
        }
        fn stepping(&self) -> Stepping {
            Stepping {
                substeps: if self.integrator.is_adaptive() { 1 } else { 4 },
                ..Stepping::default()
            }
        }
    }

    #[test]
    fn a_brief_event_is_met() {
        let w = 2.0 * std::f64::consts::PI;
        let all = [
            (Integrator::Adaptive, &[0.1, 0.13, 0.5][..]),
            (Integrator::Stiff, &[0.1, 0.13, 0.5]),
            // In longer steps of one length an oscillation loses height.
            (Integrator::RungeKutta4, &[0.1]),
        ];
        for (integrator, steps) in all {
            // Above it, or below it, for 0.014 or 0.0045 s in each period.
            for level in [0.999, 0.9999, -0.999, -0.9999] {
                let twin = Counter { integrator, level };
                for &row in steps {
                    let rows = (10.0 / row) as usize;
                    let drive = Drive::autonomous(row, rows).unwrap();
                    let y = twin.simulate(&[w], &drive, Noise::OFF).unwrap();
                    // The first row is at 0.
                    let seconds = (rows - 1) as f64 * row;
                    let first = (level.asin() / w).rem_euclid(1.0);
                    let expected = (seconds - first).floor() + 1.0;
                    let last = y[[rows - 1, 0]];
                    assert_eq!(last, expected, "{integrator:?}, {level}, rows of {row} s");
                }
            }
        }
    }
}
