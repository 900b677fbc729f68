//! Standard errors that hold over their own size.

use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::{FilterError, recoverable};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Half the distance of a difference, in standard deviations of an entry with the others held. Over a whole one, a bent likelihood shows;
/// over a tenth, a jump does.
const SHARE: f64 = 0.5;
/// Times that short differences promise more information of an entry than wide ones where it jumps. Bends make no more than two.
const JUMPS: f64 = 10.0;
/// Most times that differences are taken, and the change of a distance that needs no more.
const ROUNDS: usize = 6;
const STEADY: f64 = 0.1;

/// Standard deviations of θ, first order.
///
/// A fit knows the information from short differences. Where a twin jumps in θ (dry friction, limits), these may promise far more than a
/// record knows: a few rows change at once. Differences are then taken over half a standard deviation to both sides, that of an entry with
/// the others held,
///
/// ```text
/// F = DᵀD + P,   D_j = (r(φ + h_j) − r(φ − h_j))/2h_j,   h_j = ½/√F_jj
/// ```
///
/// until h no longer changes; r: innovations and their squares, standardised; P: precision of the priors. A twin that does not jump keeps
/// the errors of its fit. A black box does, too: its differences are wide already.
pub(crate) fn steady_errors(
    problem: &Problem<'_>,
    fitted: &Fitted,
) -> Result<Vec<f64>, FilterError> {
    let of_fit = fitted.std_errors(problem);
    if problem.is_simulated() {
        return Ok(of_fit);
    }
    let mut information = fitted.information.clone();
    for round in 0..ROUNDS {
        let steps: Vec<f64> = (problem.axes.iter().enumerate())
            .map(|(j, axis)| (SHARE / information[(j, j)].sqrt()).min(axis.longest))
            .collect();
        let wide = match steps.iter().all(|step| *step > 0.0) {
            true => recoverable(information_over(problem, fitted, &steps))?,
            false => None,
        };
        let Some(wide) = wide else {
            return Ok(of_fit);
        };
        let ratios = || (0..wide.nrows()).map(|j| information[(j, j)] / wide[(j, j)]);
        if round == 0 && ratios().all(|ratio| ratio < JUMPS) {
            return Ok(of_fit);
        }
        let change = ratios().fold(0.0, |largest: f64, ratio| largest.max(ratio.ln().abs()));
        information = wide;
        if 0.5 * change < STEADY {
            break;
        }
    }
    let steady = Fitted {
        information,
        ..fitted.clone()
    };
    Ok(steady.std_errors(problem))
}

/// Information in φ from differences over these steps.
fn information_over(
    problem: &Problem<'_>,
    fitted: &Fitted,
    steps: &[f64],
) -> Result<DMatrix<f64>, FilterError> {
    let c = &problem.coordinates;
    let phi = c.of(&fitted.theta);
    let here = Reference::bare(problem.filtered(&fitted.theta)?);
    let columns: Vec<DVector<f64>> = (steps.par_iter().enumerate())
        .map(|(j, step)| {
            let side = |sign: f64| {
                let mut moved = phi.clone();
                moved[j] = (phi[j] + sign * step).clamp(c.lower()[j], c.upper()[j]);
                let there = problem.filtered(&c.theta(&moved))?;
                Ok::<_, FilterError>((moved[j], here.direction(&there)))
            };
            let ((above, up), (below, down)) = (side(1.0)?, side(-1.0)?);
            Ok((up - down) / (above - below).max(f64::MIN_POSITIVE))
        })
        .collect::<Result<_, FilterError>>()?;
    let directions = DMatrix::from_columns(&columns);
    let mut information = directions.tr_mul(&directions);
    for (j, (_, precision)) in problem.prior_terms().enumerate() {
        information[(j, j)] += precision;
    }
    Ok(information)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::climb::climb;
    use crate::record::{Drive, Record, Signal};
    use crate::twin::{Noise, Now, Outline, Parameter, StateSpace, Twin};

    /// v̇ = u − c·sign(v), measured: innovations jump wherever a point of the filter changes sides.
    struct Slide;
    impl StateSpace for Slide {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("c", "m/s²", 0.2, 1.0))
                .state("v", "m/s")
                .input("u", "m/s²")
                .output("y", "m/s")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = now.u[0] - now.theta[0] * x[0].signum();
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
        fn noise(&self, _: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
            (process[0], measurement[0]) = (0.01, 0.02);
        }
    }

    /// Errors of a smooth fit stay; those of an information that is far too large come back to their size.
    #[test]
    fn what_a_jump_promises_is_not_believed() {
        let twin = Twin::new(Slide);
        let inputs = Signal::from_shape_fn((300, 1), |(k, _)| {
            let t = k as f64;
            1.2 * (0.11 * t).sin() + 0.5 * (0.37 * t).cos()
        });
        let drive = Drive::new(0.1, inputs).unwrap();
        let outputs = twin.simulate(&[0.5], &drive, Noise::new(1, "slide", 0));
        let records = [Record::new(drive, outputs.unwrap()).unwrap()];
        let problem = Problem::of_twin(&twin, &records);
        let fitted = climb(&problem, &[0.5], 40).unwrap().unwrap();
        let own = fitted.std_errors(&problem);
        assert_eq!(steady_errors(&problem, &fitted).unwrap(), own);
        for too_much in [100.0, 1e4, 1e8] {
            let promised = Fitted {
                information: &fitted.information * too_much,
                ..fitted.clone()
            };
            let error = steady_errors(&problem, &promised).unwrap()[0];
            let ratio = error / own[0];
            assert!((0.5..2.0).contains(&ratio), "{too_much}: {ratio}");
        }
    }
}
