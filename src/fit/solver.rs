//! The solver of all fits: damped Gauss–Newton, which for a likelihood is Fisher scoring, in a box.
//!
//! ```text
//! (F + λ·diag F)·δ = −g,   x ← x + δ,   λ smaller after a step that helps, larger after one that does not
//! ```
//!
//! g and F are the gradient and the Gauss–Newton Hessian of the cost: Jᵀr and JᵀJ of residuals, minus the score and the information of a
//! likelihood. Entries at a bound that want to leave it are held for the step. A trial point without a value only rejects the step.
//!
//! argmin runs the iterations and counts the evaluations. Its own `GaussNewtonLS` compares ‖r‖ with the slope of ½‖r‖² in its line search,
//! so that a large residual counts as convergence at the start; it knows no bounds, and inverts JᵀJ.
//!
//! Source: Nocedal & Wright, *Numerical Optimization*, second edition, sections 10.3 and 16.7.

use crate::fit::budget::BUDGET;
use crate::math::{MathError, nearest};
use argmin::core::{
    Executor, IterState, KV, Problem, Solver as ArgminSolver, State, TerminationReason,
    TerminationStatus,
};
use nalgebra::{DMatrix, DVector};

/// A cost and its derivatives: the operator that [`Solver`] asks.
pub(super) trait Objective {
    /// By-product of a cost that its derivatives at the same point need.
    type Trial;
    /// Error of an evaluation.
    type Error: std::error::Error + From<MathError> + Send + Sync + 'static;

    /// Tells whether an error rules out one point alone; others end the search.
    fn is_rejection(error: &Self::Error) -> bool;
    /// Cost at a point.
    fn cost(&self, x: &DVector<f64>) -> Result<(f64, Self::Trial), Self::Error>;
    /// Cost and derivatives at a point, with what its cost has left.
    fn model(
        &self,
        x: &DVector<f64>,
        trial: Option<Self::Trial>,
    ) -> Result<LocalModel, Self::Error>;
}

/// Quadratic model of a cost at a point.
#[derive(Debug, Clone)]
pub(super) struct LocalModel {
    pub cost: f64,
    pub gradient: DVector<f64>,
    /// Gauss–Newton Hessian.
    pub information: DMatrix<f64>,
}

/// End of a search.
#[derive(Debug, Clone)]
pub(super) struct Optimum {
    pub x: DVector<f64>,
    pub cost: f64,
    /// LocalModel at `x`, where the solver is asked for it.
    pub model: Option<LocalModel>,
    /// `true` where a tolerance is met.
    pub converged: bool,
}

/// Settings of a search, and its damping.
#[derive(Debug, Clone)]
pub(super) struct Solver<'a> {
    /// Bounds, each side finite or not.
    pub lower: &'a [f64],
    pub upper: &'a [f64],
    /// Longest step of each entry.
    pub longest: Vec<f64>,
    /// Entries that stay.
    pub held: Vec<bool>,
    /// Iterations at most, and trial points of each: damping grows from one to the next, until one lowers the cost.
    pub iterations: u64,
    pub trials: usize,
    /// Damping of the first step, and the least one.
    pub damping: f64,
    pub least_damping: f64,
    /// Gain at which the search ends: absolute, and relative to the cost.
    pub gain: f64,
    pub relative_gain: f64,
    /// Largest entry of a step at which the search ends.
    pub least_step: f64,
    /// Cost that another search has reached: this one ends where it would stay above, if each iteration left took off what a step promises.
    pub least_cost: f64,
    /// `true` where the model at the end is wanted.
    pub models_end: bool,
}

/// x, gradient, no Jacobian, Hessian, no residual.
type SearchState = IterState<DVector<f64>, DVector<f64>, (), DMatrix<f64>, (), f64>;

impl Solver<'_> {
    /// Minimises from `start`, which is brought into the bounds.
    pub fn minimise<O: Objective>(
        self,
        objective: &O,
        start: &DVector<f64>,
    ) -> Result<Optimum, O::Error> {
        let (start, iterations) = (self.clamp(start), self.iterations);
        let mut state = Executor::new(objective, self)
            .configure(|state: SearchState| {
                state.param(start).max_iters(iterations).counting(false)
            })
            .ctrlc(false)
            .run()
            .map_err(evaluation_error::<O::Error>)?
            .state;
        let converged = TerminationStatus::Terminated(TerminationReason::SolverConverged);
        let cost = state.get_cost();
        let model = state.take_gradient().zip(state.take_hessian());
        Ok(Optimum {
            cost,
            converged: *state.get_termination_status() == converged,
            model: model.map(|(gradient, information)| LocalModel {
                cost,
                gradient,
                information,
            }),
            x: state.take_param().ok_or_else(lost)?,
        })
    }

    /// Nearest point within the bounds.
    fn clamp(&self, x: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(x.len(), |j, _| nearest(x[j], self.lower[j], self.upper[j]))
    }

    /// The damped step, entries held at their bounds left out; `None` where none is free, or their matrix is singular.
    fn step(&self, x: &DVector<f64>, gradient: &DVector<f64>, f: &DMatrix<f64>) -> DampedStep {
        let free: Vec<usize> = (0..x.len())
            .filter(|&j| {
                let out_below = x[j] <= self.lower[j] && gradient[j] > 0.0;
                let out_above = x[j] >= self.upper[j] && gradient[j] < 0.0;
                !(out_below || out_above || self.held[j])
            })
            .collect();
        let n = free.len();
        if n == 0 {
            return DampedStep::Nowhere;
        }
        // An entry's curvature is at least what its longest step needs: far from the top the information is often too small, and one
        // entry's long step must not shorten those of the others.
        let matrix = DMatrix::from_fn(n, n, |a, b| {
            let value = f[(free[a], free[b])];
            if a == b {
                let least = gradient[free[a]].abs() / self.longest[free[a]];
                value.max(least) * (1.0 + self.damping) + f64::MIN_POSITIVE
            } else {
                value
            }
        });
        let Some(factor) = matrix.cholesky() else {
            return DampedStep::Singular;
        };
        let part = factor.solve(&DVector::from_fn(n, |a, _| -gradient[free[a]]));
        let mut step = DVector::zeros(x.len());
        let mut shrink: f64 = 1.0;
        for (a, &j) in free.iter().enumerate() {
            step[j] = part[a];
            shrink = shrink.min(BUDGET.longer_steps * self.longest[j] / part[a].abs().max(1e-300));
        }
        match step.iter().all(|v| v.is_finite()) {
            true => DampedStep::To(step * shrink),
            false => DampedStep::Singular,
        }
    }

    /// More damping; `false` where it is of no use.
    fn damps_more(&mut self) -> bool {
        self.damping = (8.0 * self.damping).max(BUDGET.rejected_damping);
        self.damping < BUDGET.most_damping
    }

    /// The first of the trial points that lowers the cost.
    fn trial<O: Objective>(
        &mut self,
        problem: &mut Problem<&O>,
        state: &SearchState,
    ) -> Result<Trial<O>, argmin::core::Error> {
        let cost = state.get_cost();
        let (x, gradient, information) = (state.get_param())
            .zip(state.get_gradient())
            .zip(state.get_hessian())
            .map(|((x, gradient), information)| (x, gradient, information))
            .ok_or_else(lost)?;
        let enough = self.gain + self.relative_gain * cost;
        let left = (state.get_max_iters() - state.get_iter()) as f64;
        for _ in 0..self.trials {
            match self.step(x, gradient, information) {
                DampedStep::Nowhere => return Ok(Trial::Ends(CONVERGED)),
                DampedStep::Singular => {}
                DampedStep::To(step) => {
                    let next = self.clamp(&(x + &step));
                    let moved = (&next - x).amax();
                    let promise = -gradient.dot(&step);
                    if moved < self.least_step || promise < BUDGET.least_promise * enough {
                        return Ok(Trial::Ends(CONVERGED));
                    }
                    if cost - left * promise > self.least_cost {
                        let reason = "another search is out of reach";
                        return Ok(Trial::Ends(TerminationReason::SolverExit(reason.into())));
                    }
                    // The cost alone tells whether to go there; the derivatives follow if so.
                    let there =
                        problem.problem("costs", |o| Ok(tolerated::<O, _>(o.cost(&next))?))?;
                    if let Some((there, trial)) = there.filter(|(there, _)| *there < cost) {
                        return Ok(Trial::Lower(next, there, trial));
                    }
                }
            }
            if !self.damps_more() {
                let reason = TerminationReason::SolverExit("no step lowers the cost".into());
                return Ok(Trial::Ends(reason));
            }
        }
        Ok(Trial::Higher)
    }
}

enum DampedStep {
    To(DVector<f64>),
    /// No entry is free.
    Nowhere,
    /// The damped matrix has no root.
    Singular,
}

/// Outcome of the trial points of an iteration.
enum Trial<O: Objective> {
    /// The point, its cost, and what its evaluation leaves.
    Lower(DVector<f64>, f64, O::Trial),
    Higher,
    Ends(TerminationReason),
}

const CONVERGED: TerminationReason = TerminationReason::SolverConverged;

impl<O: Objective> ArgminSolver<&O, SearchState> for Solver<'_> {
    fn name(&self) -> &str {
        "damped Gauss–Newton in a box"
    }

    fn init(
        &mut self,
        problem: &mut Problem<&O>,
        mut state: SearchState,
    ) -> Result<(SearchState, Option<KV>), argmin::core::Error> {
        let x = state.take_param().ok_or_else(lost)?;
        let model = problem.problem("models", |o| Ok(o.model(&x, None)?))?;
        Ok((put(state, x, Some(model)), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<&O>,
        state: SearchState,
    ) -> Result<(SearchState, Option<KV>), argmin::core::Error> {
        let cost = state.get_cost();
        let enough = self.gain + self.relative_gain * cost;
        let (next, there, trial) = match self.trial(problem, &state)? {
            Trial::Lower(next, there, trial) => (next, there, trial),
            Trial::Higher => return Ok((state, None)),
            Trial::Ends(reason) => return Ok((state.terminate_with(reason), None)),
        };
        self.damping = (0.1 * self.damping).max(self.least_damping);
        let arrived = cost - there < enough;
        let ends = arrived || state.get_iter() + 1 >= state.get_max_iters();
        let ended = |state: SearchState| match arrived {
            true => state.terminate_with(CONVERGED),
            false => state,
        };
        if ends && !self.models_end {
            return Ok((ended(put(state, next, None).cost(there)), None));
        }
        let model = problem.problem("models", |o| {
            Ok(tolerated::<O, _>(o.model(&next, Some(trial)))?)
        })?;
        let Some(model) = model else {
            let reason = TerminationReason::SolverExit("no derivatives at the next point".into());
            return Ok((state.terminate_with(reason), None));
        };
        Ok((ended(put(state, next, Some(model))), None))
    }
}

/// The state at another point.
fn put(mut state: SearchState, x: DVector<f64>, model: Option<LocalModel>) -> SearchState {
    (state.grad, state.hessian) = (None, None);
    let state = state.param(x);
    match model {
        Some(model) => state
            .cost(model.cost)
            .gradient(model.gradient)
            .hessian(model.information),
        None => state,
    }
}

/// A rejected point has no value, and is no error.
fn tolerated<O: Objective, T>(result: Result<T, O::Error>) -> Result<Option<T>, O::Error> {
    match result {
        Err(error) if O::is_rejection(&error) => Ok(None),
        other => other.map(Some),
    }
}

fn lost() -> MathError {
    MathError::fatal("argmin lost the state of a search")
}

/// The error of an evaluation, given back by argmin.
pub(super) fn evaluation_error<E>(error: argmin::core::Error) -> E
where
    E: std::error::Error + From<MathError> + Send + Sync + 'static,
{
    (error.downcast::<E>()).unwrap_or_else(|other| MathError::Fatal(other.into()).into())
}
