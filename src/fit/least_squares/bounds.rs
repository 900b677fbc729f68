use crate::math::MathError;
use nalgebra::DVector;

/// A box: lower ≤ θ ≤ upper for each parameter, each side finite or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    lower: DVector<f64>,
    upper: DVector<f64>,
}

impl Bounds {
    /// From `lower` and `upper`, of length d, in the parameters' units.
    ///
    /// # Errors
    ///
    /// [`MathError`]: lengths that disagree, NaN, or a lower bound above its upper bound.
    pub fn new(lower: DVector<f64>, upper: DVector<f64>) -> Result<Self, MathError> {
        if lower.len() != upper.len() {
            return Err(MathError::BoundCounts {
                lower: lower.len(),
                upper: upper.len(),
            });
        }
        // An interval must hold a number: not [NaN, …], not [∞, ∞].
        let holds_none = |(low, high): (&f64, &f64)| {
            low.is_nan() || high.is_nan() || low > high || (low == high && low.is_infinite())
        };
        if let Some(index) = lower.iter().zip(upper.iter()).position(holds_none) {
            return Err(MathError::EmptyInterval {
                index,
                lower: lower[index],
                upper: upper[index],
            });
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

    /// upper − lower, infinite where a side is open.
    pub fn width(&self) -> DVector<f64> {
        &self.upper - &self.lower
    }

    /// The point of the box nearest to `theta`, of length d. NaN stays NaN.
    pub fn project(&self, theta: &DVector<f64>) -> DVector<f64> {
        theta.zip_zip_map(&self.lower, &self.upper, |value, low, high| {
            value.clamp(low, high)
        })
    }

    /// Returns whether `theta`, of length d, is in the box.
    #[cfg(test)]
    pub fn contains(&self, theta: &DVector<f64>) -> bool {
        (0..self.dimension()).all(|j| (self.lower[j]..=self.upper[j]).contains(&theta[j]))
    }

    /// Fails at the first side that is open.
    pub(super) fn check_finite(&self) -> Result<(), MathError> {
        match self.width().iter().position(|w| !w.is_finite()) {
            Some(index) => Err(MathError::Unbounded { index }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dvector;

    #[test]
    fn the_example() -> Result<(), Box<dyn std::error::Error>> {
        use crate::fit::least_squares::Bounds;
        use nalgebra::dvector;

        let bounds = Bounds::new(dvector![0.0, f64::NEG_INFINITY], dvector![1.0, 5.0])?;
        assert_eq!(bounds.project(&dvector![2.0, -7.0]), dvector![1.0, -7.0]);
        Ok(())
    }

    #[test]
    fn the_nearest_point_is_in_the_box() {
        let bounds = Bounds::new(dvector![0.0, 1.0], dvector![1.0, 1.0]).unwrap();
        let outside = dvector![-3.0, 7.0];
        assert!(!bounds.contains(&outside) && bounds.contains(&bounds.project(&outside)));
        assert_eq!(bounds.width(), dvector![1.0, 0.0]);
        assert!(Bounds::unbounded(2).contains(&outside));
    }

    #[test]
    fn bad_input_is_named() {
        let error = Bounds::new(dvector![0.0, 2.0], dvector![1.0, 1.0]).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("parameter 1 has the bounds [2, 1]")
        );
        let error = Bounds::new(dvector![f64::NAN], dvector![1.0]).unwrap_err();
        assert!(matches!(error, MathError::EmptyInterval { index: 0, .. }));
        let error = Bounds::new(dvector![0.0], dvector![]).unwrap_err();
        assert!(matches!(
            error,
            MathError::BoundCounts { lower: 1, upper: 0 }
        ));
    }
}
