//! The out-of-distribution test: are these features what the twin makes at this θ?
//!
//! Both forms whiten with the mean μ and covariance S of simulations at θ and take s = ‖S^{-1/2}(x − μ)‖².
//! They differ in what s is compared with, and so in their error:
//!
//! | form | null distribution | rejects a right θ, nominal 10 % |
//! |---|---|---|
//! | [`GateForm::Calibrated`] | simulations that had no part in μ and S | 10 %, whatever n |
//! | [`GateForm::Paper`] | the same K = 150 simulations | 13 % at n = 5, 100 % at n = 128 |
//!
//! Source: Lakshminarayanan, Guerrero & Rojas, section IV-A.

use crate::estimator::bank::{Draws, FeatureSimulator};
use crate::estimator::budget::BUDGET;
use crate::estimator::error::EstimatorError;
use crate::estimator::settings::{GateForm, GateSettings};
use crate::math::{Whitening, median, quantile, rank_p_value, thin_svd, to_vector};
use crate::progress::{Progress, Stage};
use crate::record::Drive;
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayView1};
use serde::Serialize;
use std::borrow::Cow;

/// The test's answer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct GateOutcome {
    /// (1 + number of simulations at least as far) / (B + 1).
    pub p_value: f64,
    /// Monte-Carlo standard error of `p_value`, √(p(1 − p)/(B + 1)).
    pub p_error: f64,
    /// Number of simulations B that the record is ranked among.
    pub simulations: usize,
    /// Nominal rate.
    pub alpha: f64,
    /// `true` if the record is not what the twin makes at this θ.
    pub out_of_distribution: bool,
    /// s of the record.
    pub statistic: f64,
}

impl GateOutcome {
    /// Returns whether no simulation is as far as the record: p is below `p_value`.
    pub(crate) fn at_floor(&self) -> bool {
        self.p_value * (self.simulations as f64 + 1.0) < 1.5
    }

    /// Returns whether other random numbers could well turn the answer.
    pub(super) fn is_unsure(&self) -> bool {
        (self.p_value - self.alpha).abs() < BUDGET.unsure * self.p_error
    }
}

/// Simulator and settings of the test.
#[derive(Clone, Copy)]
pub struct GateTest<'a> {
    /// Twin and features.
    pub simulator: &'a FeatureSimulator,
    /// The record's input.
    pub drive: &'a Drive,
    /// Settings.
    pub settings: &'a GateSettings,
    /// Randomness; divided into what μ and S need, and the null.
    pub noise: Noise,
    /// Progress sink.
    pub progress: &'a Progress,
}

impl GateTest<'_> {
    /// Simulates the null at `theta`.
    pub fn at(&self, theta: &[f64]) -> Result<Gate, EstimatorError> {
        let (whitening, ranked) = self.simulate(theta)?;
        Ok(Gate {
            null: whitening.squared_distances(&ranked),
            whitening,
            settings: self.settings.clone(),
        })
    }

    /// The test at a θ that was itself read off the record. The record's true θ lies some error e away, and its features with it. So
    /// the record is ranked among simulations at θ + e_k, each of which is read off in the same way and compared with the mean at its
    /// own estimate, to first order:
    ///
    /// ```text
    /// s_k = ‖S^{-1/2}(x_k − μ − ∂f̄/∂θ·(θ̂(x_k) − θ))‖²,   x_k simulated at θ + e_k
    /// ```
    ///
    /// The errors e_k are those of fresh simulations at `near`: parameters of the prior that the reader takes for about θ. They have the
    /// record's own input and noise, so that what the reader gets wrong on records of the twin itself rejects no record. `jacobians`
    /// are ∂f/∂θ at θ (n × d) of several seeds; their median in whitened features is taken, since far from their reference features have
    /// heavy tails, and one such run would spoil a mean. `estimate` maps features (rows) to θ̂.
    ///
    /// # Errors
    ///
    /// As [`at`](Self::at), and those of `estimate`.
    pub fn at_estimate(
        &self,
        theta: &[f64],
        near: &[Vec<f64>],
        jacobians: &[DMatrix<f64>],
        estimate: impl Fn(&Array2<f64>) -> Result<Array2<f64>, EstimatorError>,
    ) -> Result<Gate, EstimatorError> {
        let size = self.settings.whitening_simulations(self.simulator.dim());
        let null = self.settings.null;
        let stage = self.progress.stage("gate", size + 2 * null);
        let features = self.repeat(theta, size, "whitening", &stage)?;
        let whitening = whiten(self.settings, &features)?;
        let read = self.draws(null, near, "errors", &stage)?;
        let errors = &read.theta - &estimate(&read.features)?;
        let space = self.simulator.twin().parameters();
        let around: Vec<Vec<f64>> = (errors.rows().into_iter())
            .map(|error| {
                let moved: Vec<f64> = theta.iter().zip(error).map(|(t, e)| t + e).collect();
                space.clamp_to_prior(&moved)
            })
            .collect();
        let ranked = self.draws(null, &around, "null", &stage)?.features;
        let estimates = estimate(&ranked)?;
        let jacobian = whitened_median(&whitening, jacobians);
        let distance = |(row, estimate): (ArrayView1<'_, f64>, ArrayView1<'_, f64>)| {
            let moved = DVector::from_fn(theta.len(), |j, _| estimate[j] - theta[j]);
            (whitening.residual(&to_vector(&row)) - &jacobian * moved).norm_squared()
        };
        Ok(Gate {
            null: (ranked.rows().into_iter().zip(estimates.rows()))
                .map(distance)
                .collect(),
            whitening,
            settings: self.settings.clone(),
        })
    }

    /// The test again after θ was refitted to the record with features x: columns of the Jacobian of f̄ by θ over the prior's widths (n × d),
    /// which the refit has used up, are projected out of the record's whitened residual and of the null's alike
    /// (Sargan–Hansen, n − d degrees of freedom). `None` where no degree of freedom is left.
    ///
    /// The Jacobian may be that of a point nearby: only its column space matters.
    pub fn after_refit(
        &self,
        theta: &[f64],
        jacobian: &DMatrix<f64>,
        features: &DVector<f64>,
    ) -> Result<Option<GateOutcome>, EstimatorError> {
        // Calibrated whatever the form of the first test was: it is a check, not a part of the paper's method.
        let settings = GateSettings {
            form: GateForm::Calibrated,
            ..self.settings.clone()
        };
        let calibrated = GateTest {
            settings: &settings,
            ..*self
        };
        let (whitening, ranked) = calibrated.simulate(theta)?;
        let used = column_space(&whitening.apply_columns(jacobian));
        if whitening.rank() <= used.ncols() {
            return Ok(None);
        }
        let rest = |x: &DVector<f64>| {
            let residual = whitening.residual(x);
            (residual.norm_squared() - used.tr_mul(&residual).norm_squared()).max(0.0)
        };
        let null: Vec<f64> = (ranked.rows().into_iter())
            .map(|row| rest(&to_vector(&row)))
            .collect();
        Ok(Some(decide(&settings, &null, rest(features))))
    }

    /// Simulates what [`at`](Self::at) needs: μ and S, and features to rank a record among; in the paper's form those of μ and S.
    fn simulate(&self, theta: &[f64]) -> Result<(Whitening, Array2<f64>), EstimatorError> {
        let size = self.settings.whitening_simulations(self.simulator.dim());
        let fresh = match self.settings.form {
            GateForm::Calibrated => self.settings.null,
            GateForm::Paper => 0,
        };
        let stage = self.progress.stage("gate", size + fresh);
        let features = self.repeat(theta, size, "whitening", &stage)?;
        let whitening = whiten(self.settings, &features)?;
        let ranked = match fresh {
            0 => features,
            _ => self.repeat(theta, fresh, "null", &stage)?,
        };
        Ok((whitening, ranked))
    }

    /// `size` simulations at one θ.
    pub fn repeat(
        &self,
        theta: &[f64],
        size: usize,
        purpose: &'static str,
        stage: &Stage,
    ) -> Result<Array2<f64>, EstimatorError> {
        let noise = self.noise.child(purpose);
        (self.simulator).repeat(theta, self.drive, size, |i| noise.sample(i), stage)
    }

    /// `size` simulations at these θ in turn; one that fails is made again at the next.
    fn draws(
        &self,
        size: usize,
        thetas: &[Vec<f64>],
        purpose: &'static str,
        stage: &Stage,
    ) -> Result<Draws, EstimatorError> {
        let noise = self.noise.child(purpose);
        let draw = |i: u64, attempt: usize, _| {
            let theta = thetas.get((i as usize + attempt) % thetas.len().max(1));
            Ok(theta.map(|theta| (theta.clone(), Cow::Borrowed(self.drive))))
        };
        (self.simulator).draws(0..size as u64, |i| noise.sample(i), draw, stage)
    }
}

/// The null at one θ.
#[derive(Debug, Clone)]
pub struct Gate {
    /// μ and S^{-1/2} at θ.
    whitening: Whitening,
    /// Squared whitened distances that a record is ranked among.
    null: Vec<f64>,
    settings: GateSettings,
}

impl Gate {
    /// Tests features x.
    pub fn test(&self, features: &DVector<f64>) -> GateOutcome {
        let statistic = self.whitening.squared_distance(features);
        decide(&self.settings, &self.null, statistic)
    }
}

/// Ranks the statistic of a record among those of the null.
fn decide(settings: &GateSettings, null: &[f64], statistic: f64) -> GateOutcome {
    let (p_value, alpha) = (rank_p_value(null, statistic), settings.alpha);
    GateOutcome {
        statistic,
        p_value,
        p_error: (p_value * (1.0 - p_value) / (null.len() as f64 + 1.0)).sqrt(),
        simulations: null.len(),
        alpha,
        out_of_distribution: match settings.form {
            GateForm::Calibrated => p_value <= alpha,
            // The paper rejects above the empirical quantile of the K values themselves.
            GateForm::Paper => quantile(null, 1.0 - alpha).is_ok_and(|most| statistic > most),
        },
    }
}

/// μ and S^{-1/2} from simulated features, in the form of the test.
pub fn whiten(
    settings: &GateSettings,
    features: &Array2<f64>,
) -> Result<Whitening, EstimatorError> {
    match settings.form {
        GateForm::Calibrated => Whitening::calibrated(features),
        GateForm::Paper => Whitening::regularised(features, settings.epsilon),
    }
    .map_err(EstimatorError::Whitening)
}

/// Medians, entry by entry, of whitened Jacobians.
fn whitened_median(whitening: &Whitening, jacobians: &[DMatrix<f64>]) -> DMatrix<f64> {
    let whitened: Vec<DMatrix<f64>> = (jacobians.iter())
        .map(|jacobian| whitening.apply_columns(jacobian))
        .collect();
    let parameters = whitened.first().map_or(0, DMatrix::ncols);
    DMatrix::from_fn(whitening.rank(), parameters, |i, j| {
        let entries: Vec<f64> = whitened.iter().map(|jacobian| jacobian[(i, j)]).collect();
        median(&entries).unwrap_or(0.0)
    })
}

/// Orthonormal basis of the columns of `matrix`.
fn column_space(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let Some(svd) = thin_svd(matrix) else {
        return DMatrix::zeros(matrix.nrows(), 0);
    };
    let largest = svd.values.iter().copied().fold(0.0, f64::max);
    let kept: Vec<usize> = (0..svd.values.len())
        .filter(|&i| svd.values[i] > 1e-9 * largest)
        .collect();
    svd.left.select_columns(&kept)
}

#[cfg(test)]
mod tests;
