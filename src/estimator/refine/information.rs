//! Information of a record on θ: standard errors, and directions in words.

use crate::estimator::error::EstimatorError;
use crate::math::descending;
use crate::twin::{PRIOR_DEVIATION, ParameterSpace, Role, combination, oriented};
use nalgebra::{DMatrix, SymmetricEigen};
use serde::Serialize;

/// Fisher information of the features, regularised: G = JᵀJ/(1 + 1/K) + λ·diag(1/width²).
///
/// J (rank × d) is whitened; K seeds were averaged, which adds 1/K to the variance of the difference between mean and record. All is in
/// units of the prior's widths: parameters of any size are inverted alike, and nothing depends on their units.
///
/// Source: Lakshminarayanan, Guerrero & Rojas, section IV-B.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct FeatureInformation {
    /// G, d × d, of θ over the prior's widths.
    pub matrix: DMatrix<f64>,
    /// G⁻¹, of θ over the prior's widths.
    pub covariance: DMatrix<f64>,
    /// √diag(G⁻¹), in parameter units.
    pub std_error: Vec<f64>,
    /// Eigen-directions over the twin's physical parameters, least known first.
    pub directions: Vec<Direction>,
}

/// A combination of parameters and how well it is known.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Direction {
    /// Unit vector in (θ over the prior's width), physical parameters only.
    pub direction: Vec<f64>,
    /// Standard deviation along it, in prior widths.
    pub std_error: f64,
    /// In words: `0.58·k1 − 0.58·k2 + 0.57·k4`.
    pub combination: String,
    /// `true` if the prior knows it better than the record does: worse than 1/√12 of its width.
    pub weak: bool,
}

impl FeatureInformation {
    /// From the whitened Jacobian by θ over the prior's widths (rank × d), λ and K.
    pub fn new(
        jacobian: &DMatrix<f64>,
        space: &ParameterSpace,
        ridge: f64,
        seeds: usize,
    ) -> Result<Self, EstimatorError> {
        let mut matrix = jacobian.tr_mul(jacobian) / (1.0 + 1.0 / seeds as f64);
        for j in 0..space.len() {
            matrix[(j, j)] += ridge;
        }
        let covariance = matrix.clone().cholesky().map(|factor| factor.inverse());
        let Some(covariance) = covariance.filter(|c| c.iter().all(|v| v.is_finite())) else {
            if matrix.iter().any(|v| !v.is_finite()) {
                return Err(EstimatorError::Undetermined(
                    "the features at the estimate change too fast with the parameters to compute with; shrink the prior, or choose other features".into(),
                ));
            }
            let flat = SymmetricEigen::new(matrix);
            let weakest = flat.eigenvalues.imin();
            let direction = flat.eigenvectors.column(weakest);
            let words = combination(&space.names(), direction.as_slice());
            return Err(EstimatorError::Undetermined(format!(
                "the features hold no information on {words} at the estimate; fix this parameter, or choose other features"
            )));
        };
        let widths = space.widths();
        let errors = covariance.diagonal();
        Ok(Self {
            std_error: (errors.iter().zip(widths))
                .map(|(v, w)| v.sqrt() * w)
                .collect(),
            directions: directions(&covariance, space),
            matrix,
            covariance,
        })
    }

    /// Weakly identified directions, least known first.
    pub fn weak(&self) -> impl Iterator<Item = &Direction> {
        self.directions.iter().filter(|d| d.weak)
    }
}

/// Eigen-directions of the covariance (prior widths) of the physical parameters; nuisances are marginalised out.
fn directions(covariance: &DMatrix<f64>, space: &ParameterSpace) -> Vec<Direction> {
    let physical: Vec<usize> = (0..space.len())
        .filter(|&j| space[j].role == Role::Parameter)
        .collect();
    if physical.is_empty() {
        return Vec::new();
    }
    let names: Vec<&str> = physical.iter().map(|&j| space[j].name.as_str()).collect();
    let marginal = covariance.select_rows(&physical).select_columns(&physical);
    let eigen = SymmetricEigen::new(marginal);
    let mut directions: Vec<Direction> = (0..physical.len())
        .map(|i| {
            let direction = oriented(eigen.eigenvectors.column(i).clone_owned().as_slice());
            let std_error = eigen.eigenvalues[i].max(0.0).sqrt();
            Direction {
                combination: combination(&names, &direction),
                direction,
                std_error,
                weak: std_error > PRIOR_DEVIATION,
            }
        })
        .collect();
    descending(&mut directions, |a| a.std_error);
    directions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Parameter;

    fn space(scale: f64) -> ParameterSpace {
        ParameterSpace::new([
            Parameter::new("a", "", 0.0, scale),
            Parameter::new("b", "", 0.0, 2.0),
            Parameter::new("start.x", "", 0.0, 1.0).with_role(Role::Start),
        ])
    }

    /// Only a + b (in widths) is seen, and the start.
    fn jacobian() -> DMatrix<f64> {
        DMatrix::from_row_slice(2, 3, &[9.0, 9.0, 0.0, 0.0, 0.0, 5.0])
    }

    #[test]
    fn the_unseen_direction_is_weak_and_named() {
        let found = FeatureInformation::new(&jacobian(), &space(1.0), 0.01, 1).unwrap();
        let weak: Vec<_> = found.weak().collect();
        assert_eq!(weak.len(), 1);
        assert_eq!(weak[0].combination, "0.71·a − 0.71·b");
        assert!((weak[0].std_error - 10.0).abs() < 1e-9, "1/√λ");
        // G = 25/2 + 0.01 for the start, K = 1.
        assert!((found.std_error[2] - (12.51f64).powf(-0.5)).abs() < 1e-12);
        assert!((&found.matrix * &found.covariance - DMatrix::identity(3, 3)).amax() < 1e-9);
    }

    /// The unit of a parameter changes its standard error by that unit, and no direction.
    #[test]
    fn units_do_not_matter() {
        let (one, tiny) = (1.0, 1e-200);
        let a = FeatureInformation::new(&jacobian(), &space(one), 0.01, 3).unwrap();
        let b = FeatureInformation::new(&jacobian(), &space(tiny), 0.01, 3).unwrap();
        assert!((a.std_error[0] * tiny / b.std_error[0] - 1.0).abs() < 1e-9);
        assert!((a.directions[0].std_error - b.directions[0].std_error).abs() < 1e-9);
    }

    /// A study may fix all physical parameters and estimate starts alone.
    #[test]
    fn starts_alone_have_no_directions() {
        let start = Parameter::new("start.x", "", 0.0, 1.0).with_role(Role::Start);
        let space = ParameterSpace::new([start]);
        let information =
            FeatureInformation::new(&DMatrix::from_element(1, 1, 5.0), &space, 0.01, 1);
        let information = information.unwrap();
        assert_eq!(information.directions, []);
        assert!((information.std_error[0] - (12.51f64).powf(-0.5)).abs() < 1e-12);
    }

    #[test]
    fn no_information_is_an_error_that_names_the_direction() {
        let error = FeatureInformation::new(&jacobian(), &space(1.0), 0.0, 1).unwrap_err();
        assert!(error.to_string().contains("0.71·a − 0.71·b"), "{error}");
    }
}
