//! The posterior around a fit, to second order.

use super::sizes::SizePrior;
use crate::fit::axis::EvidencePrior;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::math::log_mean;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{LN_2, TAU};

/// Largest gain that is credited beyond where a fit ended, in nats.
pub(crate) const CREDIT: f64 = 1.5;

/// A normal approximation of the posterior over the entries that are free.
pub(crate) struct Laplace {
    pub log_evidence: f64,
    /// Entries that are free.
    pub free: Vec<usize>,
    /// Mean, in φ of the free entries.
    pub centre: DVector<f64>,
    /// Deviations of the priors of sizes: entry and deviation.
    pub sizes: Vec<(usize, f64)>,
}

/// The posterior around a fit.
pub(super) struct Expansion<'a> {
    pub(super) problem: &'a Problem,
    pub(super) fitted: &'a Fitted,
    /// Entries inside their bounds.
    pub(super) free: Vec<usize>,
    /// Entries that lie at a bound and want to leave it.
    pub(super) at_bound: Vec<usize>,
    pub(super) phi: DVector<f64>,
    /// Gradient of the likelihood alone.
    pub(super) gradient: DVector<f64>,
    /// Information of the likelihood alone.
    pub(super) information: DMatrix<f64>,
    pub(super) credit: f64,
}

impl<'a> Expansion<'a> {
    /// Expands the posterior around a fit.
    pub(super) fn new(problem: &'a Problem, fitted: &'a Fitted) -> Self {
        let c = &problem.coordinates;
        let phi = DVector::from_vec(c.of(&fitted.theta));
        let (mut gradient, mut information) = (fitted.gradient.clone(), fitted.information.clone());
        for (j, (centre, precision)) in problem.prior_terms().enumerate() {
            gradient[j] += precision * (phi[j] - centre);
            information[(j, j)] -= precision;
        }
        let (mut free, mut at_bound) = (vec![], vec![]);
        for j in 0..phi.len() {
            if problem.axes[j].held {
                continue;
            }
            let slack = 1e-9 * (c.upper()[j] - c.lower()[j]).abs().min(1.0);
            let out = phi[j] <= c.lower()[j] + slack && fitted.gradient[j] < 0.0
                || phi[j] >= c.upper()[j] - slack && fitted.gradient[j] > 0.0;
            if out { at_bound.push(j) } else { free.push(j) }
        }
        Self {
            problem,
            fitted,
            free,
            at_bound,
            phi,
            gradient,
            information,
            credit: CREDIT,
        }
    }

    /// Magnitudes among the free entries, with the sizes that count.
    pub(super) fn blocks(&self) -> Vec<SizePrior> {
        SizePrior::all(self.problem, &self.free, &self.information)
    }

    /// Laplace over all sizes: log Z, and the approximation at the most probable sizes.
    pub(super) fn laplace(&self, blocks: &[SizePrior]) -> Option<(f64, Laplace)> {
        let mut chosen: Vec<usize> = blocks.iter().map(|b| b.options.len() / 2).collect();
        let values = |chosen: &[usize], b: usize| -> Vec<f64> {
            let mut tried = chosen.to_vec();
            (0..blocks[b].options.len())
                .map(|i| {
                    tried[b] = i;
                    let found = self.at_sizes(blocks, &tried);
                    found.map_or(f64::NEG_INFINITY, |l| l.log_evidence)
                })
                .collect()
        };
        // log Z of each block's sizes, others at their best: sizes of different effects hardly know of each other.
        let mut rows: Vec<Vec<f64>> = vec![];
        for pass in 0..=2 {
            let before = chosen.clone();
            rows = (0..blocks.len())
                .map(|b| {
                    let row = values(&chosen, b);
                    if pass < 2 {
                        let best = (0..row.len()).max_by(|i, j| row[*i].total_cmp(&row[*j]));
                        chosen[b] = best.unwrap_or(chosen[b]);
                    }
                    row
                })
                .collect();
            if chosen == before {
                break;
            }
        }
        let best = self.at_sizes(blocks, &chosen)?;
        let mut log = best.log_evidence;
        for row in &rows {
            log += log_mean(row) - best.log_evidence;
        }
        log.is_finite().then_some((log, best))
    }

    /// Laplace with these sizes of the magnitudes.
    fn at_sizes(&self, blocks: &[SizePrior], chosen: &[usize]) -> Option<Laplace> {
        let d = self.free.len();
        let prior = self.problem.prior_terms().collect::<Vec<_>>();
        // Mean and precision of the prior, and log of its density at the centre.
        let mut means = DVector::zeros(d);
        let mut precisions = DVector::zeros(d);
        let mut log_density = 0.0;
        let mut sizes = Vec::new();
        for (a, &j) in self.free.iter().enumerate() {
            let (mean, precision) = match self.problem.axes[j].evidence {
                EvidencePrior::Normal => prior[j],
                EvidencePrior::Magnitude { .. } | EvidencePrior::Member => {
                    let deviation = (blocks.iter().zip(chosen))
                        .find_map(|(block, option)| block.deviation(*option, j))?;
                    sizes.push((j, deviation));
                    if self.problem.axes[j].is_one_sided() {
                        log_density += LN_2;
                    }
                    (0.0, deviation.powi(-2))
                }
                EvidencePrior::Uniform { low, high } => {
                    log_density -= (high - low).ln();
                    precisions[a] = 12.0 / (high - low).powi(2);
                    means[a] = f64::NAN;
                    continue;
                }
            };
            (means[a], precisions[a]) = (mean, precision);
            log_density += 0.5 * (precision / TAU).ln();
        }
        let information = self
            .information
            .select_rows(&self.free)
            .select_columns(&self.free);
        let precision = &information + DMatrix::from_diagonal(&precisions);
        let phi = self.phi.select_rows(&self.free);
        // A uniform prior does not pull.
        let pull = DVector::from_fn(d, |a, _| {
            if means[a].is_nan() {
                0.0
            } else {
                precisions[a] * (phi[a] - means[a])
            }
        });
        let likelihood = self.gradient.select_rows(&self.free);
        let factor = precision.cholesky()?;
        let step = factor.solve(&(&likelihood - pull));
        let centre = &phi + &step;
        let gain = likelihood.dot(&step) - 0.5 * (&information * &step).dot(&step);
        let normal: f64 = (0..d)
            .filter(|a| !means[*a].is_nan())
            .map(|a| -0.5 * precisions[a] * (centre[a] - means[a]).powi(2))
            .sum();
        let log_determinant: f64 = (0..d).map(|a| 2.0 * factor.l_dirty()[(a, a)].ln()).sum();
        let log_evidence = self.fitted.log_likelihood
            + gain.min(self.credit)
            + log_density
            + normal
            + 0.5 * d as f64 * TAU.ln()
            - 0.5 * log_determinant
            + self.beyond_bounds(&prior);
        Some(Laplace {
            log_evidence,
            free: self.free.clone(),
            centre,
            sizes,
        })
    }

    /// Share of entries at a bound: what falls off inside it. Shapes and sizes of effects pay nothing, being held there.
    pub(super) fn beyond_bounds(&self, prior: &[(f64, f64)]) -> f64 {
        (self.at_bound.iter())
            .filter(|&&j| self.problem.axes[j].evidence == EvidencePrior::Normal)
            .map(|&j| {
                let (mean, precision) = prior[j];
                let density =
                    0.5 * (precision / TAU).ln() - 0.5 * precision * (self.phi[j] - mean).powi(2);
                let curvature = (self.information[(j, j)] + precision).max(0.0);
                density - (self.fitted.gradient[j].abs() + (4.0 * curvature / TAU).sqrt()).ln()
            })
            .sum()
    }
}
