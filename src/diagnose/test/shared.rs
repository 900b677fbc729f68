//! Many records of one fitted twin, looked at with the same ensembles.
//!
//! An ensemble belongs to a θ and a drive, not to a record. Those at θ̂, beside it and at the points of the dictionary are made
//! once and predict the measured record and all simulated ones. Each is refitted by one Gauss–Newton step: with D the
//! directions of θ and P the weak prior's precision,
//!
//! ```text
//! δ = (DᵀD + P)⁻¹(Dᵀr + ∂log π),   e ← e + Σ_j δ_j·Δe_j,   S ← S + Σ_j δ_j·ΔS_j
//! ```
//!
//! Gains have θ projected out, which is the same step. A diagnosis of K simulated records then costs K runs, not K fits.

use crate::diagnose::residuals::local::local;
use crate::diagnose::residuals::omnibus::omnibus;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::statistics::Statistics;
use crate::fit::problem::Problem;
use crate::fit::reference::{Gain, Reference, weak};
use crate::likelihood::ensemble::{Predictor, standardised};
use crate::likelihood::kalman::{FilterError, Filtered, recoverable};
use crate::record::{Record, Signal};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A variance keeps this share of itself when θ moves.
const KEPT: f64 = 0.25;

/// Ensembles of all records at the places that a statistics needs.
pub(in crate::diagnose) struct Shared {
    here: Vec<Predictor>,
    /// A step beside θ̂ along each axis.
    beside: Vec<(Vec<Predictor>, f64)>,
    /// At each point of the dictionary that can be simulated.
    points: Vec<Option<Vec<Predictor>>>,
}

impl Shared {
    /// Simulates all ensembles of a fitted twin; `None` where it cannot be simulated around θ̂.
    pub fn new(model: &FittedTwin<'_>) -> Result<Option<Self>, FilterError> {
        let (problem, theta) = (&model.problem, &model.fitted.theta);
        let Some(here) = recoverable(problem.predictors(theta))? else {
            return Ok(None);
        };
        let beside: Vec<Option<(Vec<Predictor>, f64)>> =
            (problem.neighbours(theta).into_par_iter())
                .map(|(moved, distance)| {
                    let there = recoverable(problem.predictors(&moved))?;
                    Ok(there.map(|there| (there, distance)))
                })
                .collect::<Result<_, FilterError>>()?;
        let Some(beside) = beside.into_iter().collect() else {
            return Ok(None);
        };
        let points = (model.dictionary.points.par_iter())
            .map(|point| {
                let (of, full) = model.dictionary.at(problem, theta, point);
                recoverable(of.predictors(&full))
            })
            .collect::<Result<_, FilterError>>()?;
        Ok(Some(Self {
            here,
            beside,
            points,
        }))
    }

    /// Returns the statistics of records under the drives of the fitted twin.
    pub fn statistics(&self, model: &FittedTwin<'_>, records: &[Record]) -> Option<Statistics> {
        let through = |predictors: &[Predictor]| -> Vec<Filtered> {
            let pairs = predictors.iter().zip(records);
            pairs
                .map(|(p, record)| p.filter(record.outputs()))
                .collect()
        };
        let beside: Vec<(Vec<Filtered>, f64)> = (self.beside.iter())
            .map(|(p, distance)| (through(p), *distance))
            .collect();
        let problem = &model.problem;
        let reference = Reference::with(through(&self.here), &beside, &weak(problem))?;
        let points: Vec<Gain> = (self.points.iter().zip(&model.dictionary.points))
            .map(|(predictors, point)| {
                predictors.as_ref().map_or(Gain::default(), |predictors| {
                    reference.gain(&reference.direction(&through(predictors)), point.range)
                })
            })
            .collect();
        let step = reference.step(&pull(problem, &model.fitted.theta));
        let states: Vec<(Filtered, Signal)> = (0..records.len())
            .map(|r| {
                let moved = moved(&reference.filtered[r], &beside, r, &step);
                let predicted = moved.held_predictions(records[r].outputs());
                (moved, predicted)
            })
            .collect();
        let gains = model.dictionary.best(&points);
        Some(Statistics {
            gains: gains.iter().map(|g| (2.0 * g).sqrt()).collect(),
            omnibus: omnibus(&states, records, model.bins.states),
            local: local(&states, records, &model.bins),
            points,
        })
    }
}

/// Gradient of the weak prior's log-density.
fn pull(problem: &Problem<'_>, theta: &[f64]) -> DVector<f64> {
    let phi = problem.coordinates.of(theta);
    let terms = problem.prior_terms().zip(phi);
    DVector::from_vec(
        terms
            .map(|((c, precision), phi)| precision * (c - phi))
            .collect(),
    )
}

/// Innovations a step away, to first order.
fn moved(
    here: &Filtered,
    beside: &[(Vec<Filtered>, f64)],
    r: usize,
    step: &DVector<f64>,
) -> Filtered {
    let mut moved = here.clone();
    for ((there, distance), delta) in beside.iter().zip(step.iter()) {
        let share = delta / distance;
        moved.innovations += &((&there[r].innovations - &here.innovations) * share);
        moved.covariances += &((&there[r].covariances - &here.covariances) * share);
    }
    let (samples, p) = moved.innovations.dim();
    for k in 0..samples {
        let s = DMatrix::from_fn(p, p, |i, j| {
            let moved = moved.covariances[[k, i, j]];
            if i == j {
                moved.max(KEPT * here.covariances[[k, i, i]])
            } else {
                moved
            }
        });
        let e = DVector::from_fn(p, |j, _| moved.innovations[[k, j]]);
        let (v, _) = standardised(&s, &e);
        (0..p).for_each(|j| moved.standardised[[k, j]] = v[j]);
    }
    moved
}
