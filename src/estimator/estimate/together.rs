//! Several records of one system: one estimate of what they share.

use super::{Estimate, EstimateOptions};
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::readout::PointEstimate;
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::{ParameterSpace, Role};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Estimates of several records, and what they say together.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Together {
    /// The estimate of each record.
    pub records: Vec<Estimate>,
    /// Names of what the records share: all of θ but unknown starts.
    pub names: Vec<String>,
    /// Their values.
    pub theta: Vec<f64>,
    /// Standard errors.
    pub std_error: Vec<f64>,
    /// Ends of the 90 % interval, within the bounds.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// Q = Σ (θ_r − θ)ᵀ·P_r·(θ_r − θ): χ² if all records are of one θ.
    pub disagreement: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Probability of as much disagreement by chance.
    pub p_value: f64,
}

impl Estimator {
    /// Estimates each record as [`estimate`](Self::estimate) does, and weighs the answers by their precisions P_r:
    /// θ = (Σ P_r)⁻¹·Σ P_r·θ_r. Records may have different lengths, inputs and starts.
    ///
    /// # Errors
    ///
    /// As [`estimate`](Self::estimate), in [`EstimatorError::Record`] with the number of the record.
    pub fn estimate_together(
        &self,
        records: &[Record],
        options: &EstimateOptions,
        progress: &Progress,
    ) -> Result<Together, EstimatorError> {
        let mut all = vec![];
        for (r, record) in records.iter().enumerate() {
            // Simulations that two records share would correlate their errors.
            let options = EstimateOptions {
                seed: options.seed.wrapping_add(r as u64),
                ..options.clone()
            };
            let estimate = self.estimate_with(record, &options, progress);
            all.push(estimate.map_err(|error| EstimatorError::Record {
                number: r + 1,
                error: Box::new(error),
            })?);
        }
        let space = self.study().twin().parameters();
        Ok(together(all, &space))
    }
}

/// Shared entries of θ.
fn shared(space: &ParameterSpace) -> Vec<usize> {
    let all = space.iter().enumerate();
    all.filter(|(_, p)| p.role != Role::Start)
        .map(|(j, _)| j)
        .collect()
}

/// Inverse covariance of the shared entries over their widths: correlations are Gauss–Newton's, standard errors those of the answer.
fn precision(estimate: &Estimate, shared: &[usize], widths: &DVector<f64>) -> DMatrix<f64> {
    let n = shared.len();
    let error = |a: usize| estimate.std_error[shared[a]] / widths[a];
    let correlation = |a: usize, b: usize| match estimate.information() {
        Some(known) => {
            let at = |i: usize, j: usize| known.covariance[(shared[i], shared[j])];
            at(a, b) / (at(a, a) * at(b, b)).sqrt()
        }
        None => f64::from(u8::from(a == b)),
    };
    let covariance = DMatrix::from_fn(n, n, |a, b| correlation(a, b) * error(a) * error(b));
    let alone = || DMatrix::from_diagonal(&DVector::from_fn(n, |a, _| error(a).powi(-2)));
    covariance
        .cholesky()
        .map_or_else(alone, |root| root.inverse())
}

fn together(records: Vec<Estimate>, space: &ParameterSpace) -> Together {
    let shared = shared(space);
    let n = shared.len();
    let own = ParameterSpace::new(shared.iter().map(|&j| space[j].clone()));
    // Over the widths of the prior, whatever the units are.
    let widths = DVector::from_vec(own.widths());
    let value =
        |estimate: &Estimate| DVector::from_fn(n, |a, _| estimate.theta[shared[a]] / widths[a]);
    let weighed: Vec<_> = (records.iter())
        .map(|estimate| (value(estimate), precision(estimate, &shared, &widths)))
        .collect();
    let total = (weighed.iter()).fold(DMatrix::zeros(n, n), |sum, (_, p)| sum + p);
    let right = (weighed.iter()).fold(DVector::zeros(n), |sum, (theta, p)| sum + p * theta);
    let covariance = (total.cholesky()).map_or_else(
        || DMatrix::from_element(n, n, f64::NAN),
        |root| root.inverse(),
    );
    let theta = &covariance * right;
    let disagreement = (weighed.iter())
        .map(|(own, p)| {
            let off = own - &theta;
            off.dot(&(p * &off))
        })
        .sum::<f64>();
    let degrees = records.len().saturating_sub(1) * n;
    let p_value = match ChiSquared::new(degrees as f64) {
        Ok(chi) if disagreement.is_finite() => chi.sf(disagreement),
        _ => 1.0,
    };
    let errors = covariance.map_diagonal(f64::sqrt).component_mul(&widths);
    let theta = theta.component_mul(&widths);
    let std_error = errors.as_slice().to_vec();
    let answer = PointEstimate::normal(theta.as_slice().to_vec(), std_error, &own);
    Together {
        names: own.names().into_iter().map(str::to_owned).collect(),
        theta: own.clamp(&answer.theta),
        low: answer.low,
        high: answer.high,
        std_error: answer.std_error,
        disagreement,
        degrees,
        p_value,
        records,
    }
}
