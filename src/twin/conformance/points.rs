//! Points that equations compute at once, beside each alone.

use super::Finding;
use crate::math::three_digits;
use crate::record::Drive;
use crate::twin::{Now, Twin};

/// Compares the rates of points around the start with those of each point alone; a finding only where they differ.
pub(crate) fn check_points(twin: &Twin, drive: &Drive) -> Option<Finding> {
    let twin = twin.equations()?;
    let outline = twin.own_outline();
    let theta = outline.parameters.centre();
    let now = Now::new(drive.time(0), drive.step(0), drive.input(0), &theta);
    let n = outline.states.len();
    let mut start = vec![0.0; n];
    twin.own_start(&now, &mut start);
    let beside = |point: usize| {
        let share = 0.01 * point as f64;
        start
            .iter()
            .enumerate()
            .map(move |(i, x)| x + share * (1.0 + x.abs()) * (i + 1) as f64)
    };
    // A table of two points of two states might be read along either side.
    let x: Vec<f64> = (0..n + 1).flat_map(beside).collect();
    let rates = |x: &[f64]| {
        let mut dx = vec![0.0; x.len()];
        twin.own_rates(&now, x, &mut dx);
        dx
    };
    let together = rates(&x);
    let alone: Vec<f64> = x.chunks_exact(n).flat_map(rates).collect();
    let largest = together
        .iter()
        .chain(&alone)
        .fold(0.0, |a: f64, v| a.max(v.abs()));
    // Sums in another order differ by a millionth of the largest rate, a table that is read along its other side by all of it. What is not
    // finite beside the start may be no rate at all.
    let differs = |(one, other): (&f64, &f64)| (one - other).abs() > 1e-6 * largest;
    let at = together.iter().zip(&alone).position(differs)?;
    Some(Finding::failure(
        "points",
        format!(
            "several points at once: the rate of {} at point {} is {}, alone it is {}; a block holds one row for each state, and in it a number for each point",
            outline.states[at % n].name,
            at / n + 1,
            three_digits(together[at]),
            three_digits(alone[at])
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;
    use crate::twin::{Blocks, Composed, Outline, Parameter, StateSpace};
    use std::sync::Arc;

    /// Decay of two states; a block of points may be answered along its other side.
    struct Decay {
        is_turned: bool,
    }

    impl StateSpace for Decay {
        fn outline(&self) -> Outline {
            let outline = Outline::new().parameter(Parameter::new("k", "1/s", 0.5, 1.5));
            outline.state("a", "m").state("b", "m").output("y", "m")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            Blocks::drift(self, now, 2, x, dx);
        }
        fn start(&self, _: &Now<'_>, x: &mut [f64]) {
            x.copy_from_slice(&[1.0, 3.0]);
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
    }

    impl Blocks for Decay {
        fn drift(&self, now: &Now<'_>, stride: usize, x: &[f64], dx: &mut [f64]) {
            let points = x.len() / stride;
            for (i, dx) in dx.iter_mut().enumerate() {
                let turned = (i % points) * stride + i / points;
                *dx = -now.theta[0] * x[if self.is_turned { turned } else { i }];
            }
        }
        fn observe(&self, _: &Now<'_>, stride: usize, x: &[f64], y: &mut [f64]) {
            for (x, y) in x.chunks_exact(stride).zip(y) {
                *y = x[0];
            }
        }
        fn step_lanes(&self, _: &[Now<'_>], _: &mut [Lanes]) {}
        fn observe_lanes(&self, _: &[Now<'_>], _: &[Lanes], _: &mut [Lanes]) {}
    }

    #[test]
    fn blocks_that_are_turned_are_found() {
        let drive = Drive::autonomous(0.1, 10).unwrap();
        let found = |is_turned| {
            check_points(
                &Twin::Equations(Composed::in_blocks(Arc::new(Decay { is_turned }))),
                &drive,
            )
        };
        assert!(found(false).is_none());
        let finding = found(true).unwrap();
        assert!(
            finding.message.contains("rate of b at point 1"),
            "{}",
            finding.message
        );
    }
}
