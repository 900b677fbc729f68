//! Standard errors that hold over their own size.

use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::likelihood::kalman::{FilterError, recoverable};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Half the distance of a difference, in standard deviations. Over a whole one, a bent likelihood shows; over a tenth, a jump does.
const SHARE: f64 = 0.5;
/// Most times that differences are taken, and the change of a standard deviation that needs no more.
const ROUNDS: usize = 6;
const STEADY: f64 = 0.1;

/// Standard deviations of θ, first order.
///
/// A fit knows the information from short differences. Where a twin jumps in θ (dry friction, limits), these promise far more than a
/// record knows: a few rows change at once. So differences are taken over half a standard deviation to both sides,
///
/// ```text
/// F = DᵀD + P,   D_j = (r(φ + h_j) − r(φ − h_j))/2h_j,   h_j = ½·√(F⁻¹)_jj
/// ```
///
/// until h no longer changes; r: innovations and their squares, standardised; P: precision of the priors. A twin that is smooth keeps the
/// errors of its fit. A black box does, too: its differences are wide already.
pub(crate) fn steady_errors(
    problem: &Problem<'_>,
    fitted: &Fitted,
) -> Result<Vec<f64>, FilterError> {
    let of_fit = fitted.std_errors(problem);
    if problem.is_simulated() {
        return Ok(of_fit);
    }
    let slopes = problem.coordinates.slopes(&fitted.theta);
    let mut errors = of_fit.clone();
    for _ in 0..ROUNDS {
        let steps: Vec<f64> = (errors.iter().zip(&slopes).zip(&problem.axes))
            .map(|((error, slope), axis)| (SHARE * error / slope).min(axis.longest))
            .collect();
        let information = match steps.iter().all(|step| *step > 0.0) {
            true => recoverable(information_over(problem, fitted, &steps))?,
            false => None,
        };
        let Some(covariance) = information.and_then(DMatrix::try_inverse) else {
            return Ok(of_fit);
        };
        let new: Vec<f64> = (slopes.iter().enumerate())
            .map(|(j, slope)| slope * covariance[(j, j)].max(0.0).sqrt())
            .collect();
        let change = (new.iter().zip(&errors)).map(|(new, old)| (new / old).ln().abs());
        let steady = change.fold(0.0, f64::max) < STEADY;
        errors = new;
        if steady {
            break;
        }
    }
    Ok(errors)
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

    /// The spread of fits to forty records is that of the errors; errors of short differences are less than half as large on some.
    #[test]
    fn errors_of_a_twin_that_jumps_are_those_of_its_fits() {
        let twin = Twin::new(Slide);
        let inputs = Signal::from_shape_fn((300, 1), |(k, _)| {
            let t = k as f64;
            1.2 * (0.11 * t).sin() + 0.5 * (0.37 * t).cos()
        });
        let drive = Drive::new(0.1, inputs).unwrap();
        let (mut square, mut shortest) = (0.0, f64::INFINITY);
        const RECORDS: u64 = 40;
        for seed in 0..RECORDS {
            let outputs = twin.simulate(&[0.5], &drive, Noise::new(seed, "slide", 0));
            let records = [Record::new(drive.clone(), outputs.unwrap()).unwrap()];
            let problem = Problem::of_twin(&twin, &records);
            let fitted = climb(&problem, &[0.5], 40).unwrap().unwrap();
            let error = steady_errors(&problem, &fitted).unwrap()[0];
            square += ((fitted.theta[0] - 0.5) / error).powi(2) / RECORDS as f64;
            shortest = shortest.min(fitted.std_errors(&problem)[0] / error);
        }
        println!("{square} {shortest}");
        // χ² of forty, over forty: 0.4 to 2 in all but one of ten thousand.
        assert!((0.4..2.0).contains(&square), "{square}");
        assert!(shortest < 0.5, "{shortest}");
    }
}
