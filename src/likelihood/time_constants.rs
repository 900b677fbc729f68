//! Time constants of equations along a motion.

use crate::math::{MathError, Stencil, median};
use crate::record::{Drive, Signal};
use crate::twin::{Acting, Twin, is_memory};
use nalgebra::{DMatrix, DVector, Schur};

/// Points of the motion that are looked at: their median does not need more.
const POINTS: usize = 40;
/// Step of differences as a share of a state's largest size: the cube root of rounding.
const DIFFERENCE: f64 = 6e-6;
/// Rates below this share of the fastest are an integrator's, which has no time constant.
const INTEGRATOR: f64 = 1e-6;

/// Fastest and slowest time constant in seconds, 1/|λ| over the eigenvalues λ of ∂f/∂x, each the median along the `states` of
/// a motion under `drive`. `None` for a black box, and where no state moves.
pub(crate) fn time_constants(
    twin: &Twin,
    theta: &[f64],
    drive: &Drive,
    states: &Signal,
) -> Option<(f64, f64)> {
    let equations = twin.equations()?;
    let outline = equations.outline();
    let own: Vec<usize> = (0..outline.states.len())
        .filter(|&i| !is_memory(&outline.states[i].name))
        .collect();
    let sizes: Vec<f64> = (states.columns().into_iter())
        .map(|column| column.iter().fold(0.0, |a: f64, x| a.max(x.abs())))
        .map(|size| DIFFERENCE * if size > 0.0 { size } else { 1.0 })
        .collect();
    let endless = vec![f64::INFINITY; sizes.len()];
    let beginless = vec![f64::NEG_INFINITY; sizes.len()];
    let acting = Acting::of(equations, theta, drive).ok()?;
    let (mut fastest, mut slowest) = (vec![], vec![]);
    for k in (0..states.nrows()).step_by(states.nrows().div_ceil(POINTS).max(1)) {
        let now = acting.at(k);
        let stencil = Stencil::new(&states.row(k).to_vec(), &sizes, &beginless, &endless).ok()?;
        let drift = |x: &[f64]| {
            let mut drift = DVector::zeros(x.len());
            equations.drift(&now, x, drift.as_mut_slice());
            Ok::<_, MathError>(drift)
        };
        let jacobian = stencil.jacobian(drift).ok()?;
        let jacobian = DMatrix::from_fn(own.len(), own.len(), |i, j| jacobian[(own[i], own[j])]);
        if !jacobian.iter().all(|v| v.is_finite()) {
            continue;
        }
        // More iterations than any matrix of this size needs.
        let Some(schur) = Schur::try_new(jacobian, f64::EPSILON, 1000) else {
            continue;
        };
        let rates = schur.complex_eigenvalues().map(|value| value.norm());
        let largest = rates.iter().copied().fold(0.0, f64::max);
        let moving = rates.iter().filter(|rate| **rate > INTEGRATOR * largest);
        let smallest = moving.copied().fold(f64::INFINITY, f64::min);
        if largest > 0.0 {
            fastest.push(1.0 / largest);
            slowest.push(1.0 / smallest);
        }
    }
    median(&fastest).ok().zip(median(&slowest).ok())
}
