use crate::math::{MathError, nearest};
use nalgebra::DVector;

/// A box: lower ≤ θ ≤ upper for each parameter, each side finite or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    lower: DVector<f64>,
    upper: DVector<f64>,
}

impl Bounds {
    /// From `lower` ≤ `upper`, of length d, in the parameters' units.
    pub fn new(lower: DVector<f64>, upper: DVector<f64>) -> Result<Self, MathError> {
        if !(lower.iter().zip(&upper)).all(|(low, high)| low <= high) {
            return Err(MathError::fatal("a lower bound is above its upper bound"));
        }
        Ok(Self { lower, upper })
    }

    /// No bounds on `dimension` parameters.
    #[cfg(test)]
    pub fn unbounded(dimension: usize) -> Self {
        Self {
            lower: DVector::repeat(dimension, f64::NEG_INFINITY),
            upper: DVector::repeat(dimension, f64::INFINITY),
        }
    }

    /// d.
    pub fn dimension(&self) -> usize {
        self.lower.len()
    }

    /// The lower bounds.
    pub fn lower(&self) -> &DVector<f64> {
        &self.lower
    }

    /// The upper bounds.
    pub fn upper(&self) -> &DVector<f64> {
        &self.upper
    }

    /// The point of the box nearest to `theta`, of length d. NaN stays NaN.
    pub fn project(&self, theta: &DVector<f64>) -> DVector<f64> {
        theta.zip_zip_map(&self.lower, &self.upper, |value, low, high| {
            nearest(value, low, high)
        })
    }
}
