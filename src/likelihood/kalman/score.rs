//! The gradient of the log-likelihood.

use super::pass::{Innovation, Sink};
use super::{Coordinates, FilterError, Kalman};
use crate::math::Stencil;
use nalgebra::{DMatrix, DMatrixView, DVector};

/// Gradient of the log-likelihood in the [`Coordinates`] φ, by central differences (one-sided at a bound); d
/// parameters, N samples.
///
/// ```text
/// g_k = ∂ log p(y_k | y_0 … y_{k−1}) / ∂φ,   s = Σ g_k,   OPG = Σ g_k g_kᵀ
/// fisher = Σ ∂e_kᵀ S_k⁻¹ ∂e_k + ½·tr(S_k⁻¹ ∂S_k S_k⁻¹ ∂S_k)             e, S: innovations and their covariances
/// ```
///
/// Where the twin is right at θ, s has mean zero, and OPG and fisher both have the Fisher information as their mean.
/// Far from it the OPG is much too large, and steps by it too short: search with `fisher`. Takes 2·d + 1 passes over
/// the record.
///
/// Source: Alsing & Wandelt, "Generalized massive optimal data compression" (2018), for the score as a summary.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// log p(y | θ), in nats.
    pub log_likelihood: f64,
    /// s, in nats per unit of φ (d).
    pub gradient: DVector<f64>,
    /// OPG, the outer product of gradients (d × d).
    pub outer: DMatrix<f64>,
    /// Information expected from the innovations' derivatives (d × d).
    pub fisher: DMatrix<f64>,
    /// g_k (N × d).
    pub samples: DMatrix<f64>,
}

/// Steps of one-sided differences over those of central ones.
const FORWARD: f64 = 1e-2;

/// Log-density, innovation and covariance of each row.
struct Rows {
    width: usize,
    values: DVector<f64>,
}

impl Rows {
    fn new(kalman: &Kalman<'_>) -> Self {
        let p = kalman.record.outputs().ncols();
        let width = 1 + p + p * p;
        Self {
            width,
            values: DVector::zeros(kalman.record.samples() * width),
        }
    }
}

impl Sink for Rows {
    fn innovation(&mut self, k: usize, of: &Innovation<'_>) {
        let p = of.innovation.len();
        let row = &mut self.values.as_mut_slice()[k * self.width..(k + 1) * self.width];
        row[0] = of.log_density();
        row[1..=p].copy_from_slice(of.innovation);
        row[p + 1..].copy_from_slice(of.covariance);
    }
}

impl Score {
    /// At θ within the bounds, of a prepared record.
    ///
    /// # Errors
    ///
    /// As [`Kalman::log_likelihood`], also at the neighbours; [`FilterError::Difference`] for θ outside the bounds.
    pub fn at(kalman: &Kalman<'_>, theta: &[f64]) -> Result<Self, FilterError> {
        kalman.parameters.check_point(theta)?;
        let c = Coordinates::new(&kalman.parameters);
        let stencil = Stencil::new(&c.of(theta), c.steps(), c.lower(), c.upper())?;
        let jacobian = stencil.jacobian(|phi| rows(kalman, &c.theta(phi)).map(|(_, rows)| rows))?;
        let (log_likelihood, centre) = rows(kalman, theta)?;
        Self::assemble(kalman, log_likelihood, &centre, &jacobian)
    }

    /// As [`at`](Self::at), by one-sided differences with steps of a hundredth: d + 1 passes over the record instead of
    /// 2·d + 1, the gradient off by half a step times the information. For searches, and for features.
    ///
    /// # Errors
    ///
    /// As [`at`](Self::at).
    pub fn forward(
        kalman: &Kalman<'_>,
        theta: &[f64],
        coordinates: &Coordinates,
    ) -> Result<Self, FilterError> {
        let (log_likelihood, centre) = rows(kalman, theta)?;
        let phi = coordinates.of(theta);
        let mut jacobian = DMatrix::zeros(centre.len(), phi.len());
        for (j, mut column) in jacobian.column_iter_mut().enumerate() {
            let (moved, distance) = coordinates.beside(&phi, j, FORWARD);
            let (_, there) = rows(kalman, &coordinates.theta(&moved))?;
            column.zip_zip_apply(&there, &centre, |d, there, here| {
                *d = (there - here) / distance;
            });
        }
        Self::assemble(kalman, log_likelihood, &centre, &jacobian)
    }

    fn assemble(
        kalman: &Kalman<'_>,
        log_likelihood: f64,
        centre: &DVector<f64>,
        jacobian: &DMatrix<f64>,
    ) -> Result<Self, FilterError> {
        let (n, p) = (kalman.record.samples(), kalman.record.outputs().ncols());
        let (d, width) = (jacobian.ncols(), 1 + p + p * p);
        let samples = DMatrix::from_fn(n, d, |k, j| jacobian[(k * width, j)]);
        let fisher = if p == 1 {
            let scale = |k: usize| centre[k * width + 2];
            let shift =
                DMatrix::from_fn(n, d, |k, j| jacobian[(k * width + 1, j)] / scale(k).sqrt());
            let change = DMatrix::from_fn(n, d, |k, j| jacobian[(k * width + 2, j)] / scale(k));
            shift.tr_mul(&shift) + change.tr_mul(&change) * 0.5
        } else {
            let mut fisher = DMatrix::zeros(d, d);
            for k in 0..n {
                let (at, end) = (k * width + 1, (k + 1) * width);
                add_information(
                    &centre.as_slice()[at + p..end],
                    &jacobian.rows(at, p + p * p),
                    &mut fisher,
                )
                .ok_or_else(|| FilterError::NoSpread {
                    at: kalman.record.drive().time(k),
                })?;
            }
            fisher
        };
        Ok(Self {
            log_likelihood,
            gradient: samples.row_sum_tr(),
            outer: samples.tr_mul(&samples),
            fisher,
            samples,
        })
    }
}

/// One row's part of the expected information; `change` holds the derivatives of innovation and covariance.
fn add_information(
    covariance: &[f64],
    change: &DMatrixView<'_, f64>,
    fisher: &mut DMatrix<f64>,
) -> Option<()> {
    let p = change.nrows() - covariance.len();
    let inverse = (DMatrix::from_column_slice(p, p, covariance).cholesky())?.inverse();
    let parts: Vec<_> = (change.column_iter())
        .map(|of| {
            let shift = of.rows(0, p).into_owned();
            let spread = DMatrix::from_iterator(p, p, of.rows(p, p * p).iter().copied());
            (&inverse * &shift, shift, &inverse * spread)
        })
        .collect();
    for (i, (weighed, _, spread)) in parts.iter().enumerate() {
        for (j, (_, shift, other)) in parts.iter().enumerate() {
            fisher[(i, j)] += weighed.dot(shift) + 0.5 * spread.tr_dot(other);
        }
    }
    Some(())
}

fn rows(kalman: &Kalman<'_>, theta: &[f64]) -> Result<(f64, DVector<f64>), FilterError> {
    let mut rows = Rows::new(kalman);
    let log_likelihood = kalman.run(theta, &mut rows)?;
    Ok((log_likelihood, rows.values))
}
