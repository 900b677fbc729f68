use crate::math::MathError;
use std::sync::atomic::{AtomicU64, Ordering};

use argmin::core::{Error, Executor, Jacobian, Operator, State};
use argmin::solver::gaussnewton::GaussNewtonLS;
use argmin::solver::linesearch::{BacktrackingLineSearch, condition::ArmijoCondition};
use nalgebra::{dmatrix, dvector};

use super::*;

/// Residuals and Jacobian as closures.
struct Closures<R, J>(usize, R, J);

impl<R, J> ResidualProblem for Closures<R, J>
where
    R: Fn(&DVector<f64>) -> Result<DVector<f64>, MathError>,
    J: Fn(&DVector<f64>) -> Result<DMatrix<f64>, MathError>,
{
    fn dimension(&self) -> usize {
        self.0
    }
    fn residual(&self, theta: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        self.1(theta)
    }
    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        self.2(theta)
    }
}

/// A problem as argmin's own solvers take it.
struct Theirs<'a, P>(&'a P);

impl<P: ResidualProblem> Operator for Theirs<'_, P> {
    type Param = DVector<f64>;
    type Output = DVector<f64>;
    fn apply(&self, theta: &DVector<f64>) -> Result<DVector<f64>, Error> {
        Ok(self.0.residual(theta)?)
    }
}

impl<P: ResidualProblem> Jacobian for Theirs<'_, P> {
    type Param = DVector<f64>;
    type Jacobian = DMatrix<f64>;
    fn jacobian(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
        Ok(self.0.jacobian(theta)?)
    }
}

fn rosenbrock() -> impl ResidualProblem {
    Closures(
        2,
        |x: &DVector<f64>| Ok(dvector![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]),
        |x: &DVector<f64>| Ok(dmatrix![-20.0 * x[0], 10.0; -1.0, 0.0]),
    )
}

fn unit(dimension: usize) -> DVector<f64> {
    DVector::repeat(dimension, 1.0)
}

/// The effort is a result too.
#[test]
fn rosenbrock_takes_few_evaluations() {
    let (residuals, jacobians) = (AtomicU64::new(0), AtomicU64::new(0));
    let (valley, free) = (rosenbrock(), Bounds::unbounded(2));
    let counted = Closures(
        2,
        |x: &DVector<f64>| {
            residuals.fetch_add(1, Ordering::Relaxed);
            valley.residual(x)
        },
        |x: &DVector<f64>| {
            jacobians.fetch_add(1, Ordering::Relaxed);
            valley.jacobian(x)
        },
    );
    let minimum = GaussNewton::default()
        .minimise(&counted, &dvector![-1.2, 1.0], &free, &unit(2))
        .unwrap();
    assert!((&minimum.theta - unit(2)).amax() < 1e-7);
    assert!(minimum.converged && minimum.cost < 1e-14);
    assert_eq!((residuals.into_inner(), jacobians.into_inner()), (49, 26));
}

/// On x₀ ≤ ½ Rosenbrock's minimum is (½, ¼), where 1 − x₀ = ½ remains.
#[test]
fn an_active_bound_is_kept() {
    let bounds = Bounds::new(dvector![-2.0, -2.0], dvector![0.5, 2.0]).unwrap();
    for start in [dvector![-1.2, 1.0], dvector![0.5, -2.0], dvector![9.0, 9.0]] {
        let minimum = GaussNewton::default()
            .minimise(&rosenbrock(), &start, &bounds, &unit(2))
            .unwrap();
        assert_eq!(minimum.theta[0], 0.5, "exactly on the face");
        assert!((minimum.theta[1] - 0.25).abs() < 1e-7);
        assert!((minimum.cost - 0.125).abs() < 1e-12 && minimum.converged);
    }
}

/// A bound that is active at the start is left when the solution is inside.
#[test]
fn a_bound_is_left_again() {
    let bounds = Bounds::new(dvector![-1.5, -0.5], dvector![1.5, 3.0]).unwrap();
    let minimum = GaussNewton::default()
        .minimise(&rosenbrock(), &dvector![-1.5, -0.5], &bounds, &unit(2))
        .unwrap();
    assert!((minimum.theta - unit(2)).amax() < 1e-9);
}

/// A weak direction stays where it is, also while a bound holds the strong one.
#[test]
fn a_weak_direction_stays_weak_on_a_face() {
    let weak = Closures(
        2,
        |x: &DVector<f64>| Ok(dvector![x[0] - 1.0, 1e-9 * (x[1] - 1e9)]),
        |_: &DVector<f64>| Ok(dmatrix![1.0, 0.0; 0.0, 1e-9]),
    );
    let bounds = Bounds::new(dvector![-1.0, -1.0], dvector![0.5, 1.0]).unwrap();
    let settings = GaussNewton {
        relative_cutoff: 1e-6,
        ..GaussNewton::default()
    };
    let minimum = settings
        .minimise(&weak, &dvector![0.0, 0.0], &bounds, &unit(2))
        .unwrap();
    assert_eq!(minimum.theta, dvector![0.5, 0.0]);
}

/// Only k₀·k₁ is seen: the search ends on the curve k₀·k₁ = 6, near where it began, whatever the parameters' units.
#[test]
fn an_unidentified_direction_does_not_move() {
    let product = |unit: f64| {
        Closures(
            2,
            move |x: &DVector<f64>| {
                Ok(dvector![
                    x[0] * x[1] / unit - 6.0,
                    2.0 * (x[0] * x[1] / unit - 6.0)
                ])
            },
            move |x: &DVector<f64>| {
                Ok(dmatrix![x[1] / unit, x[0] / unit; 2.0 * x[1] / unit, 2.0 * x[0] / unit])
            },
        )
    };
    let free = Bounds::unbounded(2);
    let plain = GaussNewton::default()
        .minimise(&product(1.0), &dvector![2.0, 2.0], &free, &unit(2))
        .unwrap();
    assert!((&plain.theta - dvector![6.0_f64.sqrt(), 6.0_f64.sqrt()]).amax() < 1e-6);
    let milli = GaussNewton::default()
        .minimise(
            &product(1e3),
            &dvector![2.0, 2e3],
            &free,
            &dvector![1.0, 1e3],
        )
        .unwrap();
    assert!((milli.theta[1] / 1e3 - plain.theta[1]).abs() < 1e-9);
}

/// √x − 2 has no value below zero, where the first Gauss–Newton step from 100 would go.
#[test]
fn rejected_points_shorten_the_step() {
    let rejected = AtomicU64::new(0);
    let root = Closures(
        1,
        |x: &DVector<f64>| {
            if x[0] < 0.0 {
                rejected.fetch_add(1, Ordering::Relaxed);
                return Err(MathError::rejected("diverged"));
            }
            Ok(dvector![x[0].sqrt() - 2.0])
        },
        |x: &DVector<f64>| Ok(dmatrix![0.5 / x[0].sqrt()]),
    );
    let minimum = GaussNewton::default()
        .minimise(&root, &dvector![100.0], &Bounds::unbounded(1), &unit(1))
        .unwrap();
    assert!((minimum.theta[0] - 4.0).abs() < 1e-9);
    assert!(rejected.load(Ordering::Relaxed) > 0);

    let error = GaussNewton::default()
        .minimise(&root, &dvector![-1.0], &Bounds::unbounded(1), &unit(1))
        .unwrap_err();
    assert!(matches!(error, MathError::Start(_)));
    assert!(error.to_string().contains("diverged; start elsewhere"));
}

/// Non-finite residuals are rejected like those that say so; a Jacobian that fails ends the search where it is.
#[test]
fn a_search_that_cannot_go_on_keeps_what_it_has() {
    let broken = Closures(
        1,
        |x: &DVector<f64>| Ok(dvector![if x[0] == 1.0 { 1.0 } else { f64::NAN }]),
        |_: &DVector<f64>| Ok(dmatrix![1.0]),
    );
    let minimum = GaussNewton::default()
        .minimise(&broken, &dvector![1.0], &Bounds::unbounded(1), &unit(1))
        .unwrap();
    assert_eq!((minimum.converged, minimum.theta[0]), (false, 1.0));

    let flat = Closures(
        1,
        |x: &DVector<f64>| Ok(x.clone()),
        |_: &DVector<f64>| Err(MathError::rejected("diverged beside θ")),
    );
    let minimum = GaussNewton::default()
        .minimise(&flat, &dvector![3.0], &Bounds::unbounded(1), &unit(1))
        .unwrap();
    assert_eq!((minimum.converged, minimum.cost), (false, 4.5));
}

#[test]
fn a_fatal_evaluation_ends_the_search() {
    let fatal = Closures(
        1,
        |x: &DVector<f64>| match x[0] {
            1.0 => Ok(x.clone()),
            _ => Err(MathError::fatal("cancelled")),
        },
        |_: &DVector<f64>| Ok(dmatrix![1.0]),
    );
    let error = GaussNewton::default()
        .minimise(&fatal, &dvector![1.0], &Bounds::unbounded(1), &unit(1))
        .unwrap_err();
    assert!(matches!(error, MathError::Fatal(_)));
    assert_eq!(error.to_string(), "cancelled");
}

#[test]
fn a_step_is_no_longer_than_allowed() {
    let settings = GaussNewton {
        max_step: Some(0.5),
        max_iterations: 3,
        ..GaussNewton::default()
    };
    let line = Closures(
        1,
        |x: &DVector<f64>| Ok(x.clone()),
        |_: &DVector<f64>| Ok(dmatrix![1.0]),
    );
    let minimum = settings
        .minimise(
            &line,
            &dvector![100.0],
            &Bounds::unbounded(1),
            &dvector![10.0],
        )
        .unwrap();
    assert!((minimum.theta[0] - 85.0).abs() < 1e-6 && !minimum.converged);
}

/// Why there is a solver of our own: with ‖r‖ above 1e4 (Armijo's 1e-4 ‖r‖² exceeds ‖r‖), argmin's takes no step and calls it convergence.
#[test]
fn argmin_stops_where_it_starts_and_ours_arrives() {
    let large = Closures(
        2,
        |x: &DVector<f64>| Ok(dvector![1e5 * (x[0] - 1.0), 1e5 * (x[1] - 2.0) * x[0], 5e4]),
        |x: &DVector<f64>| Ok(dmatrix![1e5, 0.0; 1e5 * (x[1] - 2.0), 1e5 * x[0]; 0.0, 0.0]),
    );
    let start = dvector![2.0, 3.0];
    let line_search = BacktrackingLineSearch::new(ArmijoCondition::new(1e-4).unwrap());
    let theirs = Executor::new(Theirs(&large), GaussNewtonLS::new(line_search))
        .configure(|state| state.param(start.clone()).max_iters(100))
        .run()
        .unwrap();
    let stayed = theirs.state.get_best_param().unwrap();
    assert!(
        (stayed - &start).amax() < 1e-2,
        "argmin has been mended: {stayed}"
    );
    assert!(
        theirs
            .state
            .get_termination_status()
            .to_string()
            .contains("Solver converged")
    );

    let ours = GaussNewton::default()
        .minimise(&large, &start, &Bounds::unbounded(2), &unit(2))
        .unwrap();
    assert!((ours.theta - dvector![1.0, 2.0]).amax() < 1e-6);
    assert!((ours.cost - 1.25e9).abs() < 1.0 && ours.converged);
}
