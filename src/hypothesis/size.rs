//! Sizes of effects: as large as the twin's own terms.

use crate::record::{Record, Signal};
use crate::twin::{Acting, Parameter, StateSpace, Twin};
use std::ops::RangeInclusive;

/// Change of a magnitude whose consequences are looked at, as a share of where fits start; where those are far off, of what the rates vary.
const SHARE: f64 = 1e-3;
/// Changes of rates and outputs, as shares of what they vary, that neither rounding nor a bent law spoils.
const SEEN: RangeInclusive<f64> = 1e-8..=0.1;
/// Factor to a change that is seen from one that is not, and how often it is looked for.
const FARTHER: f64 = 1e5;
const LOOKS: usize = 5;

/// The size of entry `j` of the θ of equations at which rates or outputs change as much as they vary themselves, along filtered states; none where
/// nothing changes.
pub(super) fn largest(
    twin: &Twin,
    theta: &[f64],
    (j, parameter): (usize, &Parameter),
    records: &[Record],
    states: &[Signal],
) -> Option<f64> {
    let twin = twin.equations()?;
    let prior = parameter.prior;
    let mut step = SHARE * prior.high().abs().max(prior.low().abs());
    for _ in 0..LOOKS {
        let mut moved = theta.to_vec();
        moved[j] = parameter.bounds.clamp(moved[j] + step);
        step = moved[j] - theta[j];
        if step == 0.0 {
            return None;
        }
        let change = change(twin, [theta, &moved], records, states);
        // Starts are for signals of size 1; those of others are lost in rounding, or bend the twin.
        match change {
            0.0 => step *= FARTHER,
            c if SEEN.contains(&c) => return Some(step.abs() / c),
            c if c.is_finite() => step *= SHARE / c,
            _ => step /= FARTHER,
        }
    }
    None
}

/// The largest change of a rate or an output from the first θ to the second along filtered states, as a share of what it varies itself
/// (root mean squares). Rates count from zero, outputs from their mean.
fn change(
    twin: &dyn StateSpace,
    [theta, moved]: [&[f64]; 2],
    records: &[Record],
    states: &[Signal],
) -> f64 {
    let outline = twin.outline();
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let (mut change, mut whole, mut total) = (vec![0.0; n + p], vec![0.0; n + p], vec![0.0; n + p]);
    let mut rows = 0.0;
    for (record, states) in records.iter().zip(states) {
        let acting = |theta| Acting::of(twin, theta, record.drive());
        let (Ok(here), Ok(there)) = (acting(theta), acting(moved)) else {
            return f64::NAN;
        };
        for k in 0..record.samples() {
            let x: Vec<f64> = states.row(k).to_vec();
            let at = |acting: &Acting<'_>, theta: &[f64]| -> Vec<f64> {
                let now = acting.at(k, theta);
                let mut values = vec![0.0; n + p];
                let (rates, outputs) = values.split_at_mut(n);
                twin.drift(&now, &x, rates);
                twin.observe(&now, &x, outputs);
                values
            };
            let (here, there) = (at(&here, theta), at(&there, moved));
            rows += 1.0;
            for i in 0..n + p {
                change[i] += (there[i] - here[i]).powi(2);
                whole[i] += here[i] * here[i];
                total[i] += here[i];
            }
        }
    }
    (0..n + p)
        .map(|i| {
            let mean = if i < n { 0.0 } else { total[i] / rows };
            let own = whole[i] / rows - mean * mean;
            if own > 0.0 {
                (change[i] / rows / own).sqrt()
            } else {
                0.0
            }
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment};
    use crate::record::Drive;
    use crate::twin::{Now, Outline};

    /// ẋ = g·(u − x), x in a unit of anybody's choice.
    struct Level(f64);

    impl StateSpace for Level {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("g", "1/s", 0.5, 2.0))
                .state("x", "m")
                .input("u", "m")
                .output("y", "m")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = now.theta[0] * (now.u[0] - x[0]);
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0] / self.0;
        }
    }

    /// The largest drag c·x² is as many times smaller as numbers are larger.
    #[test]
    fn the_largest_size_follows_the_unit() {
        let of_unit = |unit: f64| {
            let drag = Catalogue::default().effect("quadratic-drag", "x").unwrap();
            let twin = augment(Twin::new(Level(unit)), vec![drag]).unwrap();
            let rows = |phase: usize| {
                Signal::from_shape_fn((50, 1), |(k, _)| unit * (1 + (k + phase) % 7) as f64)
            };
            let drive = Drive::new(0.1, rows(0)).unwrap();
            let record = Record::new(drive, rows(3).mapv(|x| x / unit)).unwrap();
            let space = twin.parameters();
            let entry = (1, &space[1]);
            largest(&twin, &[1.0, 0.0], entry, &[record], &[rows(3)]).unwrap()
        };
        let one = of_unit(1.0);
        for unit in [1e-12, 1e-6, 1e3, 1e9] {
            let ratio = of_unit(unit) * unit / one;
            assert!((ratio - 1.0).abs() < 1e-3, "unit {unit:e}: {ratio}");
        }
    }
}
