//! Region of θ that the records leave.

use super::resampling::PosteriorSample;
use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::math::{norm, principal_axes, solve_truncated};
use crate::twin::Role;
use nalgebra::{DMatrix, DVector};

/// Mean and principal axes of the posterior of the twin's own parameters.
#[derive(Debug, Clone)]
pub(crate) struct PosteriorRegion {
    /// Mean.
    pub theta: Vec<f64>,
    /// Columns: one standard deviation long, in the units of θ; principal axes of the covariance of θ over the prior's widths, so that the
    /// units change no direction.
    pub axes: DMatrix<f64>,
    /// Widths of the prior.
    widths: DVector<f64>,
}

impl PosteriorRegion {
    /// Region of the first `own` entries of θ of the first record, from the draws; to first order about the best top, where these are few.
    /// A first state that the likelihood integrates is what `start` says of it: mean and deviation. `None` where nothing is estimated, or
    /// the covariance is not finite.
    pub fn new(
        problem: &Problem,
        fitted: &Fitted,
        draws: &PosteriorSample,
        start: impl Fn(&str) -> Option<(f64, f64)>,
        own: usize,
    ) -> Option<Self> {
        if own == 0 {
            return None;
        }
        let least = BUDGET.least_share * draws.modes.len() as f64;
        let counts =
            |mode: usize| draws.modes.iter().filter(|m| **m == mode).count() as f64 >= least;
        let space = problem.twin.parameters();
        let widths = DVector::from_column_slice(&space.widths()[..own]);
        let over_widths =
            |theta: &[f64]| DVector::from_column_slice(&theta[..own]).component_div(&widths);
        let about: Vec<DVector<f64>> = (draws.thetas.iter().zip(&draws.modes))
            .filter(|(_, mode)| counts(**mode))
            .map(|(theta, _)| over_widths(theta))
            .collect();
        let (mut mean, mut covariance) = match about.len() >= BUDGET.region_draws * own {
            true => moments(&about),
            false => (
                over_widths(&fitted.theta),
                first_order(problem, fitted, &widths),
            ),
        };
        for (j, p) in space.iter().take(own).enumerate() {
            if !problem.axes[j].held {
                continue;
            }
            if p.role == Role::Magnitude {
                let shown = fitted.theta[j];
                let is_off = shown <= p.bounds.low() || shown >= p.bounds.high();
                // What is off without end is so as far as the prior goes: features see no farther.
                mean[j] = if is_off { p.prior.clamp(shown) } else { shown } / widths[j];
                covariance.row_mut(j).fill(0.0);
                covariance.column_mut(j).fill(0.0);
            }
            if p.role == Role::Start
                && let Some((value, deviation)) = start(p.target())
            {
                mean[j] = p.bounds.clamp(value) / widths[j];
                covariance[(j, j)] = (deviation / widths[j]).powi(2);
            }
        }
        if covariance.iter().any(|v| !v.is_finite()) {
            return None;
        }
        Some(Self {
            theta: mean.component_mul(&widths).as_slice().to_vec(),
            axes: DMatrix::from_diagonal(&widths) * principal_axes(covariance),
            widths,
        })
    }

    /// Standard deviation of each entry.
    pub fn std_errors(&self) -> Vec<f64> {
        let rows = self.axes.row_iter();
        rows.map(|row| norm(row.transpose().as_slice())).collect()
    }

    /// Squared distance of θ from the mean, in standard deviations: χ² of as many degrees of freedom as there are entries, for a draw.
    pub fn squared_distance(&self, theta: &[f64]) -> f64 {
        let widths = &self.widths;
        let away = DVector::from_fn(theta.len(), |j, _| (theta[j] - self.theta[j]) / widths[j]);
        let (n, d) = self.axes.shape();
        let axes = DMatrix::from_fn(n, d, |i, j| self.axes[(i, j)] / widths[i]);
        solve_truncated(&axes, &away, BUDGET.least_axis)
            .map_or(f64::INFINITY, |own| own.norm_squared())
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

/// The covariance of the first entries over their widths, to first order.
fn first_order(problem: &Problem, fitted: &Fitted, widths: &DVector<f64>) -> DMatrix<f64> {
    let own = widths.len();
    let slopes = DVector::from_column_slice(&problem.coordinates.slopes(&fitted.theta)[..own]);
    let slopes = DMatrix::from_diagonal(&slopes.component_div(widths));
    match fitted.information.clone().try_inverse() {
        Some(inverse) => &slopes * inverse.view((0, 0), (own, own)) * &slopes,
        None => DMatrix::zeros(own, own),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::climb::climb;
    use crate::fit::{FitSettings, FitStages, Passes, ProfilesOf, Searched, run};
    use crate::likelihood::{Beliefs, measured};
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Noise, Twin};
    use crate::twins::VanDerPol;

    /// A top that holds most of the draws is the region, whichever is best; one of a thirtieth is left out.
    #[test]
    fn the_region_is_where_the_draws_are() {
        let twin = Twin::new(VanDerPol);
        let drive = Drive::autonomous(0.05, 100).unwrap();
        let outputs = twin.simulate(&[1.5], &drive, Noise::new(1, "region", 0));
        let records = [Record::new(drive, outputs.unwrap()).unwrap()];
        let problem = Problem::of_twin(&twin, records.clone());
        let fitted = climb(&problem, &[1.5], 10).unwrap().unwrap();
        let near = (0..58).map(|i| (1.0 + 0.01 * f64::from(i % 2), 1));
        let (values, modes): (Vec<f64>, _) = near.chain([(4.0, 0); 2]).unzip();
        let draws = PosteriorSample {
            thetas: values.into_iter().map(|nu| vec![nu]).collect(),
            modes,
            ..PosteriorSample::default()
        };
        let region = PosteriorRegion::new(&problem, &fitted, &draws, |_| None, 1).unwrap();
        assert!((region.theta[0] - 1.005).abs() < 1e-9);
        assert!((region.std_errors()[0] - 0.005).abs() < 1e-9);
        assert!((region.squared_distance(&[1.015]) - 4.0).abs() < 1e-6);
    }

    /// Standardised errors of the mean have unit size: 15 records, χ² with 15 degrees of freedom, which is outside once in a thousand times.
    /// Errors of half their size fail in 17 of 20.
    #[test]
    fn the_region_is_calibrated() {
        let beliefs = Beliefs {
            step: 0.05,
            ..Beliefs::default()
        };
        let twin = Twin::new(VanDerPol);
        let drive = Drive::autonomous(0.05, 100).unwrap();
        let squares: f64 = (0..15)
            .map(|seed| {
                let noise = Noise::new(seed, "region", 0);
                let outputs = VanDerPol.simulate(&[1.5], &drive, noise).unwrap();
                let records = [Record::new(drive.clone(), outputs).unwrap()];
                let measured = measured(&twin, &records, &beliefs).unwrap();
                let problem = Problem::of_measured(&measured, records);
                let searched = Searched::alone(problem, noise).unwrap();
                let settings = FitSettings::default();
                let stages = &mut FitStages::new(&Passes::default(), false);
                let fit = run(&measured, searched, (&settings, ProfilesOf::None), stages);
                let region = fit.unwrap().unwrap().region.unwrap();
                ((region.theta[0] - 1.5) / region.axes[(0, 0)]).powi(2)
            })
            .sum();
        assert!((3.5..37.7).contains(&squares), "{squares}");
    }
}
