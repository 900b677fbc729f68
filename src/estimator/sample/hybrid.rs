//! The paper's mixture of two samplers.

use super::ellipsoid::Ellipsoid;
use super::sampler::Sampler;
use super::sensitivity::Sensitivity;
use crate::twin::Noise;
use nalgebra::DVector;

/// Alternates: even draws from the confidence ellipsoid, odd ones along sensitivities, so that directions with little
/// information are explored without depending on an ill-conditioned factor.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section IV-B, hybrid sampling.
#[derive(Debug, Clone)]
pub struct Hybrid {
    ellipsoid: Ellipsoid,
    sensitivity: Sensitivity,
}

impl Hybrid {
    /// Half of each.
    pub fn new(ellipsoid: Ellipsoid, sensitivity: Sensitivity) -> Self {
        Self {
            ellipsoid,
            sensitivity,
        }
    }
}

impl Sampler for Hybrid {
    fn draw(&self, index: u64, noise: Noise) -> DVector<f64> {
        if index.is_multiple_of(2) {
            self.ellipsoid.draw(index, noise)
        } else {
            self.sensitivity.draw(index, noise)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn halves_come_from_each() {
        let centre = DVector::from_vec(vec![1.0, 2.0]);
        let ellipsoid = Ellipsoid::new(centre.clone(), DMatrix::identity(2, 2)).unwrap();
        let hybrid = Hybrid::new(
            ellipsoid,
            Sensitivity::new(centre, &[1.0; 2], 1.0, &[1.0; 2]),
        );
        for i in 0..100 {
            let theta = hybrid.draw(i, Noise::new(1, "test", i));
            let on_axis = theta[0] == 1.0 || theta[1] == 2.0;
            assert_eq!(on_axis, i % 2 == 1);
        }
    }
}
