//! Posterior draws of everything unknown, as a table.

use super::resampling::PosteriorSample;
use crate::fit::problem::{Problem, of_record};
use crate::likelihood::kalman::{FilterError, Gaussian};
use crate::parallel::try_each;
use crate::twin::{Noise, Role, is_memory};
use nalgebra::{DMatrix, DVector};
use ndarray::Array2;
use serde::Serialize;

/// Posterior draws of parameters, noise levels and starts, given the records: likelihood times weak priors, within the bounds.
///
/// Draws are equally likely; one with a large weight stands more than once.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Posterior {
    /// Names of the columns: `k1`, …, `noise.h1`, …, `start.h1`, …; starts of further records are `start.h1 (record 2)`.
    pub names: Vec<String>,
    /// One draw a row.
    pub values: Array2<f64>,
    /// Mode of the posterior that each draw belongs to, from 1; the first has the largest posterior density.
    pub modes: Vec<usize>,
    /// Number of independent draws that they are worth.
    pub effective: f64,
}

/// Share and mean of one mode.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Mode {
    /// Share of the draws.
    pub share: f64,
    /// Means of the columns over its draws.
    pub mean: Vec<f64>,
}

impl Posterior {
    /// Modes that draws belong to.
    pub(crate) fn summary(&self) -> Vec<Mode> {
        let all = self.modes.iter().copied().max().unwrap_or(0);
        (1..=all)
            .filter_map(|mode| {
                let rows: Vec<usize> = (0..self.modes.len())
                    .filter(|&i| self.modes[i] == mode)
                    .collect();
                let n = rows.len() as f64;
                let mean = |j| rows.iter().map(|&i| self.values[[i, j]]).sum::<f64>() / n;
                (!rows.is_empty()).then(|| Mode {
                    share: n / self.modes.len() as f64,
                    mean: (0..self.names.len()).map(mean).collect(),
                })
            })
            .collect()
    }
}

/// Names and values of the draws; the first states of equations are drawn given θ and the records.
pub(in crate::fit) fn table(
    problem: &Problem,
    draws: &PosteriorSample,
    noise: Noise,
) -> Result<Posterior, FilterError> {
    let space = problem.twin.parameters();
    let d = space.len();
    // Unknown starts of equations are integrated, and stand below; an end of a range that is off has no value.
    let is_off = |j: usize| {
        let bounds = space[j].bounds;
        let at = draws.thetas.first().map_or(0.0, |theta| theta[j]);
        space[j].role == Role::Magnitude && (at <= bounds.low() || at >= bounds.high())
    };
    let own: Vec<usize> = (0..problem.dimension())
        .filter(|&j| j >= d || space[j].role != Role::Start || !problem.axes[j].held)
        .filter(|&j| !problem.axes[j].held || (j < d && !is_off(j)))
        .collect();
    let mut names: Vec<String> = own.iter().map(|&j| problem.name(j)).collect();
    let states: Vec<usize> = match problem.is_simulated() {
        true => vec![],
        false => (problem.outline().states.iter().enumerate())
            .filter(|(_, state)| !is_memory(&state.name))
            .map(|(i, _)| i)
            .collect(),
    };
    for r in 0..problem.records.len() {
        for &i in &states {
            let start = Role::Start.name(&problem.outline().states[i].name);
            names.push(of_record(start, r));
        }
    }
    let rows = try_each(draws.thetas.iter().enumerate(), |(i, theta)| {
        let mut row: Vec<f64> = own.iter().map(|&j| theta[j]).collect();
        if !states.is_empty() {
            let noise = noise.sample(i as u64);
            for (r, first) in problem.first_states(theta)?.iter().enumerate() {
                let start = drawn(first, noise.child(&format!("record {r}")));
                row.extend(states.iter().map(|&i| start[i]));
            }
        }
        Ok::<_, FilterError>(row)
    })?;
    let shape = (rows.len(), names.len());
    Ok(Posterior {
        values: Array2::from_shape_fn(shape, |(i, j)| rows[i][j]),
        names,
        modes: draws.modes.iter().map(|mode| mode + 1).collect(),
        // Rows that are drawn from many proposals are worth themselves at most.
        effective: draws.effective.min(shape.0 as f64),
    })
}

/// A first state, given the record.
fn drawn(first: &Gaussian, noise: Noise) -> Vec<f64> {
    let n = first.mean.len();
    let mean = DVector::from_column_slice(&first.mean);
    let covariance = DMatrix::from_row_slice(n, n, &first.cov);
    let mut source = noise.source("start");
    let z = DVector::from_fn(mean.len(), |_, _| source.normal());
    // A state that is known has no variance: no root by Cholesky.
    let eigen = covariance.symmetric_eigen();
    let scaled = eigen
        .eigenvalues
        .map(|v| v.max(0.0).sqrt())
        .component_mul(&z);
    (mean + eigen.eigenvectors * scaled).as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_have_shares_and_means() {
        let posterior = Posterior {
            names: vec!["a".into()],
            values: Array2::from_shape_vec((4, 1), vec![1.0, 2.0, 9.0, 3.0]).unwrap(),
            modes: vec![1, 1, 3, 1],
            effective: 4.0,
        };
        let modes = posterior.summary();
        assert_eq!(
            (modes.len(), modes[0].share, modes[1].share),
            (2, 0.75, 0.25)
        );
        assert_eq!((modes[0].mean[0], modes[1].mean[0]), (2.0, 9.0));
    }
}
