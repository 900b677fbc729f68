//! Density of innovations with heavy tails: outliers make them so, and a Gaussian density would take them for noise.
//!
//! ```text
//! κ = mean(v⁴)/mean(v²)² − 3 over all runs, rows and outputs          1/ν = (κ − ½)/(4κ + 6), 0 below κ = ½
//! log p(v) = log Γ((ν+1)/2) − log Γ(ν/2) − ½·log(π(ν−2)) − ½(ν+1)·log(1 + v²/(ν−2))
//! ```
//!
//! A Student's density of unit variance has excess kurtosis 6/(ν − 4). The ½ keeps what is normal up to chance normal.

use super::row::RowPrediction;
use super::runs::Ensemble;
use nalgebra::DVector;
use statrs::function::gamma::ln_gamma;
use std::f64::consts::{PI, TAU};

/// Excess kurtosis up to which innovations are normal.
const NORMAL: f64 = 0.5;
/// Fewest degrees of freedom.
const HEAVIEST: f64 = 2.5;

/// The density of one standardised innovation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Tail {
    Normal,
    /// Degrees of freedom, and the logarithm of the density at 0.
    Student(f64, f64),
}

impl Tail {
    /// Estimates the tail from the runs' own residuals, in rows of more than the least variance.
    pub fn of(ensemble: &Ensemble, rows: &[RowPrediction], least: &[f64]) -> Self {
        let p = ensemble.outputs();
        let (mut squares, mut fourths, mut count) = (0.0, 0.0, 0.0);
        let mut residual = vec![0.0; ensemble.runs];
        for (k, row) in rows.iter().enumerate() {
            for j in (0..p).filter(|&j| row.covariance[(j, j)] > least[j]) {
                residual.copy_from_slice(ensemble.of(k, j));
                for (i, &(before, channel)) in row.past.iter().enumerate() {
                    let weight = row.weights[(j, i)];
                    let past = ensemble.of(before, channel);
                    (residual.iter_mut().zip(past)).for_each(|(r, e)| *r -= weight * e);
                }
                let scale = row.covariance[(j, j)].recip();
                for r in &residual {
                    let square = r * r * scale;
                    squares += square;
                    fourths += square * square;
                }
                count += residual.len() as f64;
            }
        }
        if squares <= 0.0 {
            return Self::Normal;
        }
        Self::new(count * fourths / (squares * squares) - 3.0)
    }

    /// Returns the tail with an excess kurtosis.
    fn new(kurtosis: f64) -> Self {
        if kurtosis.is_nan() || kurtosis <= NORMAL {
            return Self::Normal;
        }
        let freedom = ((4.0 * kurtosis + 6.0) / (kurtosis - NORMAL)).max(HEAVIEST);
        let centre = ln_gamma(0.5 * (freedom + 1.0))
            - ln_gamma(0.5 * freedom)
            - 0.5 * (PI * (freedom - 2.0)).ln();
        Self::Student(freedom, centre)
    }

    /// Log-density of uncorrelated innovations of unit variance.
    pub fn log_density(self, v: &DVector<f64>) -> f64 {
        match self {
            Self::Normal => -0.5 * (v.norm_squared() + v.len() as f64 * TAU.ln()),
            Self::Student(freedom, centre) => (v.iter())
                .map(|v| centre - 0.5 * (freedom + 1.0) * (v * v / (freedom - 2.0)).ln_1p())
                .sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Densities add up to one and have unit variance, at any tail.
    #[test]
    fn a_density_is_one() {
        for kurtosis in [0.0, 0.6, 2.0, 30.0] {
            let tail = Tail::new(kurtosis);
            let (mut sum, mut square) = (0.0, 0.0);
            let step = 0.01;
            for i in -20_000..20_000 {
                let v = (f64::from(i) + 0.5) * step;
                let p = tail.log_density(&DVector::from_element(1, v)).exp() * step;
                (sum, square) = (sum + p, square + p * v * v);
            }
            assert!((sum - 1.0).abs() < 1e-4, "{kurtosis}: {sum}");
            assert!((square - 1.0).abs() < 1e-2, "{kurtosis}: {square}");
        }
        assert_eq!(Tail::new(0.3), Tail::Normal);
    }
}
