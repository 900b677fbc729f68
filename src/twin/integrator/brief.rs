//! Conditions that turn and turn back within one stretch, which its ends do not show.

use super::path::{Path, Stretch};
use super::watch::{EventsOfWay, StepBy};

/// Looks at a hump, at most: three find most tops to rounding, and each of a hump with a corner halves what is left of it.
const LOOKS: usize = 30;
/// Share of the way over which a margin shows its slope: far above rounding, far below the motion.
const PROBE: f64 = 1e-6;

/// A margin along a stretch, as the cubic through its values and slopes at two shares.
#[derive(Debug, Clone, Copy)]
struct Hump {
    shares: [f64; 2],
    margins: [f64; 2],
    slopes: [f64; 2],
}

impl Hump {
    /// Returns the share of the top of a margin that rises at the first end and falls at the other, if that may be above zero: it may be higher
    /// than the cubic's by as much as that is above the ends. Of half a wave it is by a quarter.
    fn top(&self) -> Option<f64> {
        let width = self.shares[1] - self.shares[0];
        let [rising, falling] = self.slopes.map(|slope| slope * width);
        if !(rising > 0.0 && falling < 0.0) {
            return None;
        }
        // m₀ + r·s + b·s² + c·s³, with its derivatives r and f at 0 and 1.
        let change = self.margins[1] - self.margins[0];
        let (b, c) = (
            3.0 * change - 2.0 * rising - falling,
            rising + falling - 2.0 * change,
        );
        let s = rising / (-b + (b * b - 3.0 * c * rising).max(0.0).sqrt());
        let height = self.margins[0] + s * (rising + s * (b + s * c));
        let above = height - self.margins[0].max(self.margins[1]);
        (s > 0.0 && s < 1.0 && height + above > 0.0).then_some(self.shares[0] + s * width)
    }

    /// Returns a share at which the margin is above zero, which it is at neither end; `look` gives margin and slope at a share.
    fn above_zero(mut self, mut look: impl FnMut(f64) -> (f64, f64)) -> Option<f64> {
        for _ in 0..LOOKS {
            let share = self.top()?;
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

/// Returns the least share of a stretch from `from` to `to` at which a condition is not what it is at both ends. `signs` are 1 for one that is false
/// there, -1 for a true one and 0 for another; `margins` are those at the ends.
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
    let slopes = [0, 1].map(|end| slopes(events, path, (of, end as f64), points[end]));
    let mut soonest = None;
    let mut x = points[0].to_vec();
    for (i, sign) in signs.iter().enumerate() {
        let hump = Hump {
            shares: [0.0, 1.0],
            margins: margins.map(|margins| sign * margins[i]),
            slopes: [sign * slopes[0][i], sign * slopes[1][i]],
        };
        let share = hump.above_zero(|share| {
            let length = share * of.length;
            x.copy_from_slice(points[0]);
            step(path, Stretch { length, ..of }, &mut x);
            let margins = path.at(of.from + length, |now| events.calls.margins(now, &x));
            let slope = self::slopes(events, path, (of, share), &x)[i];
            (sign * margins[i], sign * slope)
        });
        soonest = [soonest, share].into_iter().flatten().reduce(f64::min);
    }
    soonest
}

/// Slopes of all margins at a share of a stretch, per stretch, seen from its inside.
fn slopes(
    events: &EventsOfWay<'_>,
    path: &mut Path<'_, '_>,
    (of, share): (Stretch, f64),
    x: &[f64],
) -> Vec<f64> {
    let (here, length) = (of.from + share * of.length, PROBE.min(0.25 * of.length));
    let (part, away) = match share > 0.5 {
        true => (1.0, -length),
        false => (0.0, length),
    };
    let probe = Stretch {
        from: here + away.min(0.0),
        length,
    };
    let mut moved = vec![0.0; x.len()];
    path.rates(probe, part, x, &mut moved);
    let seconds = path.seconds(probe).copysign(away);
    for (moved, x) in moved.iter_mut().zip(x) {
        *moved = x + seconds * *moved;
    }
    let margins = path.at(here, |now| events.calls.margins(now, x));
    let others = path.at(here + away, |now| events.calls.margins(now, &moved));
    let pairs = margins.iter().zip(&others);
    pairs
        .map(|(here, there)| (there - here) / away * of.length)
        .collect()
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
        assert!(of_sine(1.0 + 1e-9).is_none() && looks.get() <= 8);
        assert!(of_sine(3.0).is_none() && looks.get() == 0);
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
                substeps: if self.integrator.is_adaptive() { 1 } else { 16 },
                ..Stepping::default()
            }
        }
    }

    #[test]
    fn a_brief_event_is_met() {
        let w = 2.0 * std::f64::consts::PI;
        for integrator in [
            Integrator::Adaptive,
            Integrator::Stiff,
            Integrator::RungeKutta4,
        ] {
            // Above it, or below it, for 0.014 or 0.0045 s in each period.
            for level in [0.999, 0.9999, -0.999, -0.9999] {
                let twin = Counter { integrator, level };
                // In steps of one length an oscillation loses height.
                let longest = if integrator.is_adaptive() { 0.5 } else { 0.15 };
                for row in [0.1, 0.13, longest] {
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
