use std::f64::consts::PI;
use std::sync::OnceLock;

use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::neldermead::NelderMead;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::{Bounds, EvaluationError, OptimiseError};

/// Settings of a minimiser for a scalar without derivatives, for one to about five parameters in a finite box.
///
/// argmin's Nelder–Mead on a variable z that may go anywhere,
///
/// ```text
/// θ = lower + (upper − lower)·(1 + sin z)/2
/// ```
///
/// so that no point leaves the box and a minimum on its face is smooth in z. The simplex may collapse, or straddle a
/// minimum with equal values: the search is begun again from the best point, with a smaller simplex facing the
/// other way, until that gains nothing. Where there are residuals, [`GaussNewton`](super::GaussNewton) is better.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `max_iterations` | 400 | ≥ 1 | of each search; an iteration costs one or two evaluations, rarely d + 2 |
/// | `tolerance` | 1e-10 | > 0 | scatter of the values over the simplex at which to stop, and the gain that another search must bring, in units of the objective |
/// | `spread` | 0.15 | (0, 1] | edge of the first simplex, as a share of the box |
/// | `restarts` | 4 | ≥ 0 | further searches at most |
///
/// # Example
///
/// ```
/// use nalgebra::{DVector, dvector};
/// use truetwin::optimise::{Bounds, Simplex};
///
/// let bounds = Bounds::new(dvector![0.0, 0.0], dvector![2.0, 1.0])?;
/// let objective = |p: &DVector<f64>| Ok((p[0] - 1.5).powi(2) + (p[1] - 3.0).abs());
/// let found = Simplex::default().minimise(objective, &dvector![0.5, 0.5], &bounds)?;
/// assert!((found.theta - dvector![1.5, 1.0]).norm() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Reference
///
/// Nelder & Mead, "A simplex method for function minimization", *The Computer Journal* 7, 1965; the variable is MINUIT's
/// (James & Roos, *Computer Physics Communications* 10, 1975).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Simplex {
    /// Iterations of each search.
    pub max_iterations: u64,
    /// Scatter of the values at which to stop.
    pub tolerance: f64,
    /// Edge of the first simplex, as a share of the box.
    pub spread: f64,
    /// Further searches at most.
    pub restarts: u32,
}

impl Default for Simplex {
    fn default() -> Self {
        Self {
            max_iterations: 400,
            tolerance: 1e-10,
            spread: 0.15,
            restarts: 4,
        }
    }
}

/// Where a [`Simplex`] ended.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalarMinimum {
    /// θ, inside the bounds.
    pub theta: DVector<f64>,
    /// The objective there.
    pub value: f64,
    /// Calls of the objective.
    pub evaluations: u64,
}

impl Simplex {
    /// Minimises `objective` from `start`, which is brought into `bounds` first. A point that is rejected, or whose value
    /// is NaN, counts as infinitely bad. Never worse than the start.
    ///
    /// # Errors
    ///
    /// [`OptimiseError`]: input that does not fit, infinite bounds, no finite value found, a fatal evaluation.
    pub fn minimise(
        &self,
        objective: impl Fn(&DVector<f64>) -> Result<f64, EvaluationError>,
        start: &DVector<f64>,
        bounds: &Bounds,
    ) -> Result<ScalarMinimum, OptimiseError> {
        let dimension = bounds.dimension();
        OptimiseError::check_length("start", start.len(), dimension)?;
        bounds.check_finite()?;
        let setting = OptimiseError::check_setting;
        setting("bounds", 0.0, dimension > 0, "there must be a parameter")?;
        setting(
            "tolerance",
            self.tolerance,
            self.tolerance > 0.0,
            "it must be positive",
        )?;
        let valid = self.spread > 0.0 && self.spread <= 1.0;
        setting(
            "spread",
            self.spread,
            valid,
            "it must lie in (0, 1], such as 0.15",
        )?;
        for &value in start {
            setting("start", value, value.is_finite(), "it must be finite")?;
        }

        let boxed = Boxed {
            objective,
            bounds,
            fatal: OnceLock::new(),
        };
        let mut z = boxed.angles(&bounds.project(start));
        let mut value = f64::INFINITY;
        let mut evaluations = 0;
        let mut edge = PI * self.spread;
        for _ in 0..=self.restarts {
            let result = Executor::new(&boxed, self.solver(&z, edge)?)
                .configure(|state| state.max_iters(self.max_iterations))
                .ctrlc(false)
                .run()
                .map_err(OptimiseError::from_argmin)?;
            evaluations += result
                .problem
                .counts
                .get("cost_count")
                .copied()
                .unwrap_or(0);
            if boxed.fatal.get().is_some() {
                break;
            }
            let gain = value - result.state.get_best_cost();
            if let Some(best) = result.state.get_best_param()
                && gain > 0.0
            {
                value = result.state.get_best_cost();
                z.clone_from(best);
            }
            // NaN, infinity minus infinity, is no gain: nothing was found.
            if gain.is_nan() || gain <= self.tolerance {
                break;
            }
            edge *= -0.5;
        }
        let theta = boxed.theta(&z);
        if let Some(cause) = boxed.fatal.into_inner() {
            return Err(OptimiseError::Fatal(cause));
        }
        if value == f64::INFINITY {
            return Err(OptimiseError::Start("no finite value near it".into()));
        }
        Ok(ScalarMinimum {
            theta,
            value,
            evaluations,
        })
    }

    /// A corner at `z` and edges along the axes, towards the middle of the box first.
    fn solver(
        &self,
        z: &DVector<f64>,
        edge: f64,
    ) -> Result<NelderMead<DVector<f64>, f64>, OptimiseError> {
        let mut corners = vec![z.clone()];
        for j in 0..z.len() {
            let mut corner = z.clone();
            corner[j] += if z[j] < 0.0 { edge } else { -edge };
            corners.push(corner);
        }
        NelderMead::new(corners)
            .with_sd_tolerance(self.tolerance)
            .map_err(OptimiseError::from_argmin)
    }
}

/// The objective as argmin sees it: of z, and without errors, because argmin's Nelder–Mead panics on one at its start.
struct Boxed<'a, F> {
    objective: F,
    bounds: &'a Bounds,
    fatal: OnceLock<Box<dyn std::error::Error + Send + Sync>>,
}

impl<F> Boxed<'_, F> {
    fn theta(&self, z: &DVector<f64>) -> DVector<f64> {
        let share = z.map(|z| (1.0 + z.sin()) / 2.0);
        let theta = self.bounds.lower() + self.bounds.width().component_mul(&share);
        self.bounds.project(&theta)
    }

    fn angles(&self, theta: &DVector<f64>) -> DVector<f64> {
        let bounds = self.bounds;
        theta.zip_zip_map(bounds.lower(), bounds.upper(), |value, low, high| {
            if low < high {
                (2.0 * (value - low) / (high - low) - 1.0)
                    .clamp(-1.0, 1.0)
                    .asin()
            } else {
                0.0
            }
        })
    }
}

impl<F: Fn(&DVector<f64>) -> Result<f64, EvaluationError>> CostFunction for &Boxed<'_, F> {
    type Param = DVector<f64>;
    type Output = f64;

    fn cost(&self, z: &DVector<f64>) -> Result<f64, Error> {
        if self.fatal.get().is_some() {
            return Ok(f64::INFINITY);
        }
        Ok(match (self.objective)(&self.theta(z)) {
            Ok(value) if !value.is_nan() => value,
            Ok(_) | Err(EvaluationError::Rejected(_)) => f64::INFINITY,
            Err(EvaluationError::Fatal(cause)) => {
                // Only the first is kept; after it nothing is evaluated.
                let _ = self.fatal.set(cause);
                f64::INFINITY
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dvector;
    use std::cell::Cell;

    fn unit(dimension: usize) -> Bounds {
        Bounds::new(DVector::zeros(dimension), DVector::repeat(dimension, 1.0)).unwrap()
    }

    #[test]
    fn a_curved_valley_is_followed() {
        let bounds = Bounds::new(dvector![-2.0, -2.0], dvector![2.0, 2.0]).unwrap();
        let rosenbrock =
            |p: &DVector<f64>| Ok(100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2));
        let found = Simplex::default()
            .minimise(rosenbrock, &dvector![-1.2, 1.0], &bounds)
            .unwrap();
        assert!((found.theta - dvector![1.0, 1.0]).amax() < 1e-3);
        assert!(found.evaluations < 800, "{}", found.evaluations);
    }

    /// Also from a start on a face, where θ hardly depends on z, and with a first simplex that straddles the minimum.
    #[test]
    fn one_parameter_inside_and_on_a_face() {
        for (target, expected) in [(0.3, 0.3), (-1.0, 0.0), (1.0, 1.0), (0.5, 0.5)] {
            for start in [0.0, 0.25, 0.5, 1.0] {
                let distance = |p: &DVector<f64>| Ok((p[0] - target).powi(2));
                let found = Simplex::default()
                    .minimise(distance, &dvector![start], &unit(1))
                    .unwrap();
                let error = (found.theta[0] - expected).abs();
                assert!(error < 1e-4, "to {target} from {start}: {}", found.theta[0]);
            }
        }
    }

    #[test]
    fn rejected_points_are_avoided_and_fatal_ones_end_the_search() {
        let ring = |p: &DVector<f64>| {
            if p[0] + p[1] > 1.0 {
                return Err(EvaluationError::rejected("diverged"));
            }
            Ok((p[0] - 0.2).powi(2) + (p[1] - 0.4).powi(2))
        };
        let found = Simplex::default()
            .minimise(ring, &dvector![0.9, 0.05], &unit(2))
            .unwrap();
        assert!((found.theta - dvector![0.2, 0.4]).amax() < 1e-4);

        let calls = Cell::new(0);
        let fatal = |_: &DVector<f64>| {
            calls.set(calls.get() + 1);
            Err(EvaluationError::fatal("cancelled"))
        };
        let error = Simplex::default()
            .minimise(fatal, &dvector![0.5], &unit(1))
            .unwrap_err();
        assert_eq!(error.to_string(), "cancelled");
        assert_eq!(calls.get(), 1, "nothing is evaluated after it");

        let nowhere = |_: &DVector<f64>| Ok(f64::NAN);
        let error = Simplex::default()
            .minimise(nowhere, &dvector![0.5], &unit(1))
            .unwrap_err();
        assert!(error.to_string().contains("no finite value"));
    }

    #[test]
    fn bad_input_is_named() {
        let zero = |_: &DVector<f64>| Ok(0.0);
        let error = Simplex::default()
            .minimise(zero, &dvector![0.5], &Bounds::unbounded(1))
            .unwrap_err();
        assert!(matches!(error, OptimiseError::Unbounded { index: 0 }));
        let wide = Simplex {
            spread: 2.0,
            ..Simplex::default()
        };
        let error = wide.minimise(zero, &dvector![0.5], &unit(1)).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("spread = 2; it must lie in (0, 1]")
        );
    }
}
