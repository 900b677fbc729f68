//! Standardisation: zero mean and unit standard deviation, column by column.

use ndarray::{Array1, Array2, Axis};
use serde::{Deserialize, Serialize};

/// z = (x − mean)/scale for each column; a column that never changes has scale 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scaler {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub scale: Vec<f64>,
}

impl Scaler {
    /// From rows of samples.
    pub fn fit(samples: &Array2<f64>) -> Self {
        let columns = samples.ncols();
        let mean = samples
            .mean_axis(Axis(0))
            .unwrap_or_else(|| Array1::zeros(columns));
        let scale = samples.std_axis(Axis(0), 0.0);
        let largest = samples.map_axis(Axis(0), |c| c.iter().fold(0.0f64, |a, v| a.max(v.abs())));
        let scale = (scale.iter().zip(&largest))
            // Rounding of the mean must not be blown up to unit size.
            .map(|(&s, &size)| if s > 1e-12 * size { s } else { 1.0 })
            .collect();
        Self {
            mean: mean.to_vec(),
            scale,
        }
    }

    /// z.
    pub fn apply(&self, samples: &Array2<f64>) -> Array2<f64> {
        let mut z = samples.clone();
        for mut row in z.rows_mut() {
            for ((v, m), s) in row.iter_mut().zip(&self.mean).zip(&self.scale) {
                *v = (*v - m) / s;
            }
        }
        z
    }

    /// x from z.
    pub fn invert(&self, z: &Array2<f64>) -> Array2<f64> {
        let mut samples = z.clone();
        for mut row in samples.rows_mut() {
            for ((v, m), s) in row.iter_mut().zip(&self.mean).zip(&self.scale) {
                *v = *v * s + m;
            }
        }
        samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((z.std_axis(Axis(0), 0.0)[2] - 1.0).abs() < 1e-9);
        let back = scaler.invert(&z);
        assert!((&back - &samples).iter().all(|d| d.abs() < 1e-15));
    }
}
