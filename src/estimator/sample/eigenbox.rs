//! Uniform draws in the box spanned by principal axes.

use super::sampler::Sampler;
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};

/// Half-width of the box, in standard deviations of a cloud of spread 1.
const BOX_REACH: f64 = 1.8;

/// θ = centre + A·u, u uniform in [−reach, reach]^d, where the columns of A are principal axes one standard deviation
/// long. A training set that is flat over the region teaches an estimator that is the same everywhere in it.
#[derive(Debug, Clone)]
pub struct EigenBox {
    centre: DVector<f64>,
    axes: DMatrix<f64>,
    reach: f64,
}

impl EigenBox {
    /// `axes` (d × d, parameter units) and `reach` in standard deviations.
    pub fn new(centre: DVector<f64>, axes: DMatrix<f64>, reach: f64) -> Self {
        Self {
            centre,
            axes,
            reach,
        }
    }

    /// The box of a cloud of this spread around `centre`.
    pub fn of_spread(centre: &[f64], axes: &DMatrix<f64>, spread: f64) -> Self {
        let centre = DVector::from_column_slice(centre);
        Self::new(centre, axes.clone(), BOX_REACH * spread)
    }
}

impl Sampler for EigenBox {
    fn draw(&self, _index: u64, noise: Noise) -> DVector<f64> {
        let mut source = noise.source("box");
        let u = DVector::from_fn(self.centre.len(), |_, _| {
            self.reach * (2.0 * source.uniform() - 1.0)
        });
        &self.centre + &self.axes * u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A uniform variable on [−r, r] has variance r²/3; axes carry it over.
    #[test]
    fn covariance_follows_the_axes() {
        let axes = DMatrix::from_row_slice(2, 2, &[2.0, -0.5, 1.0, 1.0]);
        let sampler = EigenBox::new(DVector::zeros(2), axes.clone(), 3.0);
        let n = 6000;
        let mut covariance = DMatrix::zeros(2, 2);
        for i in 0..n {
            let theta = sampler.draw(i, Noise::new(1, "test", i));
            covariance += &theta * theta.transpose() / n as f64;
        }
        let exact = &axes * axes.transpose() * 3.0;
        assert!((covariance - &exact).amax() < 0.05 * exact.amax());
    }
}
