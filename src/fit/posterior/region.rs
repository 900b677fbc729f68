//! Where the records put θ.

use super::resampling::Draws;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::math::principal_axes;
use crate::twin::Role;
use nalgebra::{DMatrix, DVector};

/// Draws for each parameter that a covariance needs.
const DRAWS_EACH: usize = 10;

/// Mean and principal axes of the posterior of the twin's own parameters, about its best top.
#[derive(Debug, Clone)]
pub(crate) struct Region {
    /// Mean.
    pub theta: Vec<f64>,
    /// Columns: principal axes of the covariance, one standard deviation long, in the units of θ.
    pub axes: DMatrix<f64>,
}

impl Region {
    /// Region of the first `own` entries of θ of the first record, from the draws about the best top; to first order, where these are few.
    /// A first state that the likelihood integrates is what `start` says of it: mean and deviation. `None` where nothing is estimated, or
    /// the covariance is not finite.
    pub fn new(
        problem: &Problem<'_>,
        fitted: &Fitted,
        draws: &Draws,
        start: impl Fn(&str) -> Option<(f64, f64)>,
        own: usize,
    ) -> Option<Self> {
        if own == 0 {
            return None;
        }
        let about: Vec<DVector<f64>> = (draws.thetas.iter().zip(&draws.modes))
            .filter(|(_, mode)| **mode == 0)
            .map(|(theta, _)| DVector::from_column_slice(&theta[..own]))
            .collect();
        let (mut mean, mut covariance) = match about.len() >= DRAWS_EACH * own {
            true => moments(&about),
            false => first_order(problem, fitted, own),
        };
        let space = problem.twin.parameters();
        for (j, p) in space.iter().take(own).enumerate() {
            if p.role != Role::Start || !problem.axes[j].held {
                continue;
            }
            if let Some((value, deviation)) = start(p.target()) {
                mean[j] = p.bounds.clamp(value);
                covariance[(j, j)] = deviation.powi(2);
            }
        }
        if covariance.iter().any(|v| !v.is_finite()) {
            return None;
        }
        Some(Self {
            theta: mean.as_slice().to_vec(),
            axes: principal_axes(covariance),
        })
    }
}

fn moments(draws: &[DVector<f64>]) -> (DVector<f64>, DMatrix<f64>) {
    let (n, d) = (draws.len() as f64, draws[0].len());
    let mean = draws.iter().sum::<DVector<f64>>() / n;
    let mut covariance = DMatrix::zeros(d, d);
    for draw in draws {
        let off = draw - &mean;
        covariance += &off * off.transpose() / n;
    }
    (mean, covariance)
}

fn first_order(problem: &Problem<'_>, fitted: &Fitted, own: usize) -> (DVector<f64>, DMatrix<f64>) {
    let slopes = DVector::from_vec(problem.coordinates.slopes(&fitted.theta));
    let slopes = DMatrix::from_diagonal(&slopes);
    let covariance = match fitted.information.clone().try_inverse() {
        Some(inverse) => &slopes * inverse * &slopes,
        None => DMatrix::zeros(slopes.nrows(), slopes.nrows()),
    };
    (
        DVector::from_column_slice(&fitted.theta[..own]),
        covariance.view((0, 0), (own, own)).into_owned(),
    )
}

#[cfg(test)]
mod tests {
    use crate::fit::{FitSettings, Subject, run};
    use crate::likelihood::Beliefs;
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Noise, Twin};
    use crate::twins::VanDerPol;

    /// Standardised errors of the mean have unit size: 40 records, χ² with 40 degrees of freedom within 40 ± 4·√80.
    #[test]
    fn the_region_is_calibrated() {
        let beliefs = Beliefs {
            step: 0.05,
            ..Beliefs::default()
        };
        let subject = Subject {
            twin: &Twin::new(VanDerPol),
            effects: &[],
            beliefs: &beliefs,
        };
        let drive = Drive::autonomous(0.05, 100).unwrap();
        let squares: f64 = (0..40)
            .map(|seed| {
                let noise = Noise::new(seed, "region", 0);
                let outputs = VanDerPol.simulate(&[1.5], &drive, noise).unwrap();
                let record = Record::new(drive.clone(), outputs).unwrap();
                let fit = run(&subject, &[record], &FitSettings::default());
                let region = fit.unwrap().unwrap().region.unwrap();
                ((region.theta[0] - 1.5) / region.axes[(0, 0)]).powi(2)
            })
            .sum();
        assert!((10.0..80.0).contains(&squares), "{squares}");
    }
}
