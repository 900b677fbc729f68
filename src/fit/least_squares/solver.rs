use crate::math::MathError;
use argmin::core::{
    Error, IterState, Jacobian, KV, Operator, Problem, Solver, State, TerminationReason,
};
use nalgebra::{DMatrix, DVector};

use super::box_step::box_step;
use super::settings::{GRADIENT_TOLERANCE, MAX_HALVINGS};
use super::{Bounds, GaussNewton, ResidualProblem};

/// Armijo's constant: the part of the slope that a step must deliver.
const SUFFICIENT: f64 = 1e-4;

/// θ, gradient, Jacobian, no Hessian, residual.
pub(super) type GaussNewtonState =
    IterState<DVector<f64>, DVector<f64>, DMatrix<f64>, (), DVector<f64>, f64>;

/// A [`ResidualProblem`] as argmin sees it.
pub(super) struct Residuals<'a, P: ?Sized>(pub &'a P);

impl<P: ResidualProblem + ?Sized> Operator for Residuals<'_, P> {
    type Param = DVector<f64>;
    type Output = DVector<f64>;

    fn apply(&self, theta: &DVector<f64>) -> Result<DVector<f64>, Error> {
        let residual = self.0.residual(theta)?;
        if residual.iter().all(|r| r.is_finite()) {
            return Ok(residual);
        }
        Err(MathError::rejected("a residual is not finite").into())
    }
}

impl<P: ResidualProblem + ?Sized> Jacobian for Residuals<'_, P> {
    type Param = DVector<f64>;
    type Jacobian = DMatrix<f64>;

    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
        let jacobian = self.0.jacobian(theta)?;
        if jacobian.iter().all(|r| r.is_finite()) {
            return Ok(jacobian);
        }
        Err(MathError::rejected("an entry of the Jacobian is not finite").into())
    }
}

/// Damped Gauss–Newton in a box, as an argmin solver.
///
/// argmin's own `GaussNewtonLS` compares ‖r‖ in its line search with the slope of ½‖r‖²: where ‖r‖ is large the line search asks for more
/// than there is, no step is taken and the unchanged cost counts as convergence. It also inverts JᵀJ, and knows no bounds.
pub(super) struct DampedGaussNewton<'a> {
    pub bounds: &'a Bounds,
    pub scale: &'a DVector<f64>,
    pub settings: &'a GaussNewton,
}

impl DampedGaussNewton<'_> {
    /// Room on each side, and the Jacobian, in units of the scale.
    fn in_scale(
        &self,
        theta: &DVector<f64>,
        mut jacobian: DMatrix<f64>,
    ) -> (DVector<f64>, DVector<f64>, DMatrix<f64>) {
        for (mut column, scale) in jacobian.column_iter_mut().zip(self.scale.iter()) {
            column *= *scale;
        }
        let room = |bound: &DVector<f64>| (bound - theta).component_div(self.scale);
        (
            room(self.bounds.lower()),
            room(self.bounds.upper()),
            jacobian,
        )
    }

    /// The largest cosine between the residual and a column along which θ may move.
    fn optimality(
        residual: &DVector<f64>,
        jacobian: &DMatrix<f64>,
        low: &DVector<f64>,
        high: &DVector<f64>,
    ) -> f64 {
        let length = residual.norm();
        let cosine = |j: usize| {
            let column = jacobian.column(j);
            let slope = column.dot(residual);
            let held = low[j] >= 0.0 && slope > 0.0 || high[j] <= 0.0 && slope < 0.0;
            // A zero column or residual has a zero slope.
            if held || slope == 0.0 {
                0.0
            } else {
                slope.abs() / (column.norm() * length)
            }
        };
        (0..jacobian.ncols()).map(cosine).fold(0.0, f64::max)
    }
}

/// The end of a search at which a tolerance is met.
const CONVERGED: TerminationReason = TerminationReason::SolverConverged;

/// The end of a search that cannot go on.
fn stuck(reason: &str) -> TerminationReason {
    TerminationReason::SolverExit(reason.into())
}

/// A rejected point is no value rather than an error.
fn tolerate<T>(result: Result<T, Error>) -> Result<Option<T>, Error> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) => match error.downcast_ref() {
            Some(MathError::Rejected(_)) => Ok(None),
            _ => Err(error),
        },
    }
}

fn missing(what: &str) -> Error {
    MathError::fatal(format!("argmin lost its {what}")).into()
}

impl<O> Solver<O, GaussNewtonState> for DampedGaussNewton<'_>
where
    O: Operator<Param = DVector<f64>, Output = DVector<f64>>
        + Jacobian<Param = DVector<f64>, Jacobian = DMatrix<f64>>,
{
    fn name(&self) -> &str {
        "damped Gauss–Newton in a box"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: GaussNewtonState,
    ) -> Result<(GaussNewtonState, Option<KV>), Error> {
        let theta = state.take_param().ok_or_else(|| missing("start"))?;
        let residual = problem.apply(&theta)?;
        let cost = residual.norm_squared() / 2.0;
        Ok((state.param(theta).residuals(residual).cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        mut state: GaussNewtonState,
    ) -> Result<(GaussNewtonState, Option<KV>), Error> {
        let theta = state.take_param().ok_or_else(|| missing("parameter"))?;
        let residual = state.take_residuals().ok_or_else(|| missing("residual"))?;
        let cost = state.get_cost();
        let Some(jacobian) = tolerate(problem.jacobian(&theta))? else {
            let state = state.param(theta).residuals(residual).cost(cost);
            return Ok((
                state.terminate_with(stuck("no Jacobian at this point")),
                None,
            ));
        };
        let (low, high, jacobian) = self.in_scale(&theta, jacobian);
        let stay = |state: GaussNewtonState| {
            state
                .param(theta.clone())
                .residuals(residual.clone())
                .cost(cost)
        };

        if Self::optimality(&residual, &jacobian, &low, &high) <= GRADIENT_TOLERANCE {
            return Ok((stay(state).terminate_with(CONVERGED), None));
        }
        let cutoff = self.settings.relative_cutoff;
        let mut step =
            box_step(&residual, &jacobian, &low, &high, cutoff).map_err(MathError::fatal)?;
        let model = &jacobian * &step;
        let slope = residual.dot(&model);
        let predicted = -slope - model.norm_squared() / 2.0;
        if predicted <= self.settings.tolerance * cost {
            return Ok((stay(state).terminate_with(CONVERGED), None));
        }
        let full = step.amax();
        let shortened = self
            .settings
            .max_step
            .map_or(1.0, |most| (most / full).min(1.0));
        step *= shortened;

        let mut fraction = 1.0;
        for _ in 0..=MAX_HALVINGS {
            let moved = &theta + (&step * fraction).component_mul(self.scale);
            let moved = self.bounds.project(&moved);
            let found = tolerate(problem.apply(&moved))?;
            let merit = found
                .as_ref()
                .map_or(f64::INFINITY, |r| r.norm_squared() / 2.0);
            if let Some(found) = found
                && merit <= cost + SUFFICIENT * fraction * shortened * slope
            {
                let state = state.param(moved).residuals(found).cost(merit);
                // A step that was cut short says nothing about what is left to gain.
                let whole = fraction * shortened == 1.0;
                let gained = cost - merit > self.settings.tolerance * cost;
                let done = whole && (!gained || full <= self.settings.step_tolerance);
                return Ok((
                    match done {
                        true => state.terminate_with(CONVERGED),
                        false => state,
                    },
                    None,
                ));
            }
            fraction /= 2.0;
        }
        // Rounding or noise is reached, the Jacobian is wrong, or points were rejected.
        let reason = stuck("no fraction of the step lowers the cost");
        Ok((stay(state).terminate_with(reason), None))
    }
}
