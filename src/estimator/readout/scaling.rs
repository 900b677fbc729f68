//! Scaling of features and parameters to unit size.

use crate::math::{MathError, Whitening, to_array};
use ndarray::{Array1, Array2, ArrayView1, aview1};

/// z = (x − mean)/scale for each column; a column that never changes has scale 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaler {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub scale: Vec<f64>,
}

impl Scaler {
    /// From rows of samples.
    pub fn fit(samples: &Array2<f64>) -> Self {
        let size = |column: ArrayView1<'_, f64>| column.fold(0.0, |a: f64, v| a.max(v.abs()));
        let deviation = |column: ArrayView1<'_, f64>| match column.std(0.0) {
            // Rounding of the mean must not be blown up to unit size.
            deviation if deviation > 1e-12 * size(column) => deviation,
            _ => 1.0,
        };
        Self {
            mean: samples
                .columns()
                .into_iter()
                .map(|c| c.mean().unwrap_or(0.0))
                .collect(),
            scale: samples.columns().into_iter().map(deviation).collect(),
        }
    }

    /// z.
    pub fn apply(&self, samples: &Array2<f64>) -> Array2<f64> {
        (samples - &aview1(&self.mean)) / aview1(&self.scale)
    }

    /// x from z.
    pub fn invert(&self, z: &Array2<f64>) -> Array2<f64> {
        z * &aview1(&self.scale) + aview1(&self.mean)
    }
}

/// Network inputs z = clip((x − mean)·W, ±limit), as many as features.
///
/// Two forms: each feature by itself ([`each`](Self::each)), or along the principal axes of the correlation matrix
/// ([`principal`](Self::principal)). Features such as AR coefficients are 0.99 correlated and the information sits in their differences,
/// which principal axes show at unit size; axes along which nothing varies are zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Standardiser {
    /// Means of the features (n).
    pub mean: Vec<f64>,
    /// W (n × n).
    pub matrix: Array2<f64>,
    /// Largest |z|; infinite for none.
    pub limit: f64,
}

impl Standardiser {
    /// Zero mean and unit deviation feature by feature; no limit.
    pub fn each(samples: &Array2<f64>) -> Self {
        let Scaler { mean, scale } = Scaler::fit(samples);
        let diagonal: Array1<f64> = scale.iter().map(|s| 1.0 / s).collect();
        Self {
            mean,
            matrix: Array2::from_diag(&diagonal),
            limit: f64::INFINITY,
        }
    }

    /// Zero mean and unit covariance, largest |z| `limit`.
    pub fn principal(samples: &Array2<f64>, limit: f64) -> Result<Self, MathError> {
        let whitening = Whitening::calibrated(samples)?;
        let (mean, axes) = (whitening.mean(), whitening.matrix());
        let n = mean.len();
        Ok(Self {
            mean: mean.as_slice().to_vec(),
            matrix: to_array(&axes.transpose().resize_horizontally(n, 0.0)),
            limit,
        })
    }

    /// z of features (rows: samples).
    pub fn apply(&self, features: &Array2<f64>) -> Array2<f64> {
        let mut z = (features - &aview1(&self.mean)).dot(&self.matrix);
        z.mapv_inplace(|v| v.clamp(-self.limit, self.limit));
        z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    #[test]
    fn there_and_back_with_a_constant_column() {
        let samples = Array2::from_shape_fn((9, 3), |(i, j)| match j {
            0 => i as f64,
            1 => 0.1,
            _ => 1e-9 * (i as f64).sin(),
        });
        let scaler = Scaler::fit(&samples);
        let z = scaler.apply(&samples);
        assert!(z.column(1).iter().all(|v| v.abs() < 1e-12));
        assert!((z.column(2).std(0.0) - 1.0).abs() < 1e-9);
        let back = scaler.invert(&z);
        assert!((&back - &samples).iter().all(|d| d.abs() < 1e-15));
    }

    /// Two features that differ by a thousandth of their size, a third in another unit, a fourth constant.
    fn samples() -> Array2<f64> {
        let mut all = Array2::zeros((400, 4));
        let mut source = Noise::new(1, "standardiser", 0).source("x");
        for mut row in all.rows_mut() {
            let common = source.normal();
            row[0] = common;
            row[1] = common + 1e-3 * source.normal();
            row[2] = 1e-6 * source.normal();
            row[3] = 5.0;
        }
        all
    }

    #[test]
    fn principal_inputs_are_uncorrelated_and_show_small_differences() {
        let samples = samples();
        let z = (Standardiser::principal(&samples, f64::INFINITY).unwrap()).apply(&samples);
        let covariance = z.t().dot(&z) / 399.0;
        for (at, value) in covariance.indexed_iter() {
            let expected = if at.0 == at.1 && at.0 < 3 { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-6, "{at:?}: {value}");
        }
    }

    #[test]
    fn inputs_far_outside_are_limited() {
        let samples = samples();
        let far = Array2::from_elem((1, 4), 1e9);
        let z = (Standardiser::principal(&samples, 6.0).unwrap()).apply(&far);
        assert!(z.iter().all(|v| v.abs() <= 6.0) && z.iter().any(|v| v.abs() == 6.0));
    }

    #[test]
    fn each_is_the_scaler() {
        let samples = samples();
        let difference =
            Standardiser::each(&samples).apply(&samples) - Scaler::fit(&samples).apply(&samples);
        assert!(difference.iter().all(|d| d.abs() < 1e-12));
    }
}
