//! Evidence of a twin: the likelihood of the records averaged over the prior.
//!
//! ```text
//! log Z(τ) = ll(φ*) + gain(δ) + Σ log prior(φ* + δ; τ) + d/2·log 2π − ½·log|F + P|       Laplace
//! δ = (F + P)⁻¹(g − P(φ* − μ)),   gain(δ) = min(gᵀδ − ½δᵀFδ, 1.5)
//! log Z = log mean_τ Z(τ)
//! ```
//!
//! g, F: gradient and information of the likelihood in φ; μ, P: means and precisions of the prior. The size of an effect has a
//! normal prior whose deviation τ is unknown: six values from what is just visible to what is as large as the twin's own terms.
//! An unfinished fit is credited with 1.5 nats of what its quadratic promises, no more.
//!
//! Laplace is exact for a normal posterior. Draws around it correct the rest: Z = mean of likelihood·prior/proposal.
//!
//! Sources: MacKay, *Information Theory, Inference, and Learning Algorithms* (2003), chapters 27 to 29; Kass & Raftery, "Bayes factors",
//! *JASA* 90 (1995).

use super::axis::EvidencePrior;
use super::climb::Fitted;
use super::problem::Problem;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::{LN_2, TAU};

/// Values of τ.
const SIZES: usize = 6;
/// Largest gain that is credited beyond where a fit ended, in nats.
pub(crate) const CREDIT: f64 = 1.5;
/// Samples that are filtered for the correction, and draws that makes at least and at most.
const SAMPLES: usize = 400_000;
const LEAST_DRAWS: usize = 200;
const MOST_DRAWS: usize = 1000;
/// Degrees of freedom of the proposal: heavier tails than the posterior's.
const FREEDOM: usize = 5;
/// Effective draws below which the correction says less than Laplace.
const LEAST_EFFECTIVE: f64 = 30.0;

/// Evidence, in nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Evidence {
    /// log Z.
    pub log_evidence: f64,
    /// log Z by Laplace alone.
    pub laplace: f64,
    /// Standard error of the correction by draws; none where Laplace stands alone.
    pub error: Option<f64>,
    /// Draws that the correction rests on, as many as independent ones.
    pub effective: f64,
}

/// A normal approximation of the posterior over the entries that are free.
pub(crate) struct Laplace {
    pub log_evidence: f64,
    /// Entries that are free.
    pub free: Vec<usize>,
    /// Mean and precision, in φ of the free entries.
    pub centre: DVector<f64>,
    pub precision: DMatrix<f64>,
    /// Deviations of the priors of sizes: entry and deviation.
    pub sizes: Vec<(usize, f64)>,
}

/// Evidence by Laplace alone: averaged over all sizes, and the approximation at the most probable ones. `credit` bounds what an
/// unfinished fit is credited with.
pub(crate) fn laplace(
    problem: &Problem<'_>,
    fitted: &Fitted,
    credit: f64,
) -> Option<(f64, Laplace)> {
    let mut expansion = Expansion::new(problem, fitted);
    expansion.credit = credit;
    let blocks = expansion.blocks();
    expansion.laplace(&blocks)
}

/// The posterior around a fit.
struct Expansion<'a> {
    problem: &'a Problem<'a>,
    fitted: &'a Fitted,
    /// Entries inside their bounds.
    free: Vec<usize>,
    /// Entries that lie at a bound and want to leave it.
    at_bound: Vec<usize>,
    phi: DVector<f64>,
    /// Gradient of the likelihood alone.
    gradient: DVector<f64>,
    information: DMatrix<f64>,
    credit: f64,
}

/// Evidence of a twin around the fit that maximises it.
///
/// With `noise`, draws correct what Laplace leaves; without, and for simulated likelihoods, Laplace stands alone.
pub(crate) fn evidence(
    problem: &Problem<'_>,
    fitted: &Fitted,
    noise: Option<Noise>,
) -> Result<Option<Evidence>, FilterError> {
    let expansion = Expansion::new(problem, fitted);
    let blocks = expansion.blocks();
    let Some((laplace, best)) = expansion.laplace(&blocks) else {
        return Ok(None);
    };
    let alone = Evidence {
        log_evidence: laplace,
        laplace,
        error: None,
        effective: 0.0,
    };
    let (Some(noise), false) = (noise, problem.is_simulated()) else {
        return Ok(Some(alone));
    };
    let Some((log, error, effective)) = expansion.by_draws(&best, &blocks, noise)? else {
        return Ok(Some(alone));
    };
    Ok(Some(if effective >= LEAST_EFFECTIVE {
        Evidence {
            log_evidence: log,
            laplace,
            error: Some(error),
            effective,
        }
    } else {
        Evidence { effective, ..alone }
    }))
}

/// Magnitudes that share one prior, and the deviations that it may give each of them.
struct Block {
    entries: Vec<usize>,
    options: Vec<Vec<f64>>,
}

impl Block {
    fn deviation(&self, option: usize, entry: usize) -> Option<f64> {
        let at = self.entries.iter().position(|j| *j == entry)?;
        Some(self.options[option][at])
    }
}

impl<'a> Expansion<'a> {
    fn new(problem: &'a Problem<'a>, fitted: &'a Fitted) -> Self {
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
    fn blocks(&self) -> Vec<Block> {
        let alone =
            (self.free.iter()).filter_map(|&entry| match self.problem.axes[entry].evidence {
                EvidencePrior::Magnitude { largest } => {
                    Some((vec![entry], vec![vec![1.0]], largest))
                }
                _ => None,
            });
        let families = self.problem.families.iter().filter_map(|family| {
            let free: Vec<usize> = (0..family.entries.len())
                .filter(|&a| self.free.contains(&family.entries[a]))
                .collect();
            let weights = (family.weights.iter())
                .map(|weights| free.iter().map(|&a| weights[a]).collect())
                .collect();
            let entries = free.iter().map(|&a| family.entries[a]).collect();
            (!free.is_empty()).then_some((entries, weights, family.largest))
        });
        alone
            .chain(families)
            .map(
                |(entries, weights, largest): (Vec<usize>, Vec<Vec<f64>>, f64)| {
                    let own = self.own_information(&entries);
                    let options = (weights.iter())
                        .flat_map(|weights| {
                            let roots: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
                            let scaled = DMatrix::from_fn(entries.len(), entries.len(), |a, b| {
                                roots[a] * own[(a, b)] * roots[b]
                            });
                            let most = scaled.symmetric_eigenvalues().max().max(1e-300);
                            let visible = 1.0 / most.sqrt();
                            let largest = largest.max(2.0 * visible);
                            let ratio = (largest / visible).ln() / (SIZES - 1) as f64;
                            (0..SIZES).map(move |i| {
                                let size = visible * (ratio * i as f64).exp();
                                roots.iter().map(|root| size * root).collect()
                            })
                        })
                        .collect();
                    Block { entries, options }
                },
            )
            .collect()
    }

    /// Information about some entries that no other can imitate.
    fn own_information(&self, entries: &[usize]) -> DMatrix<f64> {
        let others: Vec<usize> = (self.free.iter().copied())
            .filter(|j| !entries.contains(j))
            .collect();
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |a, b| {
                self.information[(rows[a], columns[b])]
            })
        };
        let total = part(entries, entries);
        let precisions: Vec<f64> = self.problem.prior_terms().map(|(_, p)| p).collect();
        let mut matrix = part(&others, &others);
        for (a, &j) in others.iter().enumerate() {
            matrix[(a, a)] += precisions[j].max(1e-12);
        }
        let cross = part(&others, entries);
        let mut own = match matrix.cholesky() {
            Some(factor) => &total - cross.tr_mul(&factor.solve(&cross)),
            None => total.clone(),
        };
        for a in 0..entries.len() {
            own[(a, a)] = own[(a, a)].max(1e-12 * total[(a, a)]).max(1e-300);
        }
        own
    }

    /// Laplace over all sizes: log Z, and the approximation at the most probable sizes.
    fn laplace(&self, blocks: &[Block]) -> Option<(f64, Laplace)> {
        let mut chosen: Vec<usize> = blocks.iter().map(|b| b.options.len() / 2).collect();
        let at = |chosen: &[usize]| self.at_sizes(blocks, chosen);
        // Others at their best: sizes of different effects hardly know of each other.
        for _ in 0..2 {
            for b in 0..blocks.len() {
                let value = |i: usize| {
                    let mut tried = chosen.clone();
                    tried[b] = i;
                    at(&tried).map_or(f64::NEG_INFINITY, |l| l.log_evidence)
                };
                let best =
                    (0..blocks[b].options.len()).max_by(|a, b| value(*a).total_cmp(&value(*b)));
                chosen[b] = best.unwrap_or(chosen[b]);
            }
        }
        let best = at(&chosen)?;
        let mut log = best.log_evidence;
        for b in 0..blocks.len() {
            let all: Vec<f64> = (0..blocks[b].options.len())
                .map(|i| {
                    let mut tried = chosen.clone();
                    tried[b] = i;
                    at(&tried).map_or(f64::NEG_INFINITY, |l| l.log_evidence)
                })
                .collect();
            log += log_mean(&all) - best.log_evidence;
        }
        log.is_finite().then_some((log, best))
    }

    /// Laplace with these sizes of the magnitudes.
    fn at_sizes(&self, blocks: &[Block], chosen: &[usize]) -> Option<Laplace> {
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
        let information =
            DMatrix::from_fn(d, d, |a, b| self.information[(self.free[a], self.free[b])]);
        let precision = &information + DMatrix::from_diagonal(&precisions);
        let phi = DVector::from_fn(d, |a, _| self.phi[self.free[a]]);
        // A uniform prior does not pull.
        let pull = DVector::from_fn(d, |a, _| {
            if means[a].is_nan() {
                0.0
            } else {
                precisions[a] * (phi[a] - means[a])
            }
        });
        let likelihood = DVector::from_fn(d, |a, _| self.gradient[self.free[a]]);
        let factor = precision.clone().cholesky()?;
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
            precision,
            sizes,
        })
    }

    /// Share of entries at a bound: what falls off inside it. Shapes and sizes of effects pay nothing, being held there.
    fn beyond_bounds(&self, prior: &[(f64, f64)]) -> f64 {
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

    /// log of the prior density of the free entries.
    fn log_prior(&self, phi: &DVector<f64>, blocks: &[Block]) -> f64 {
        let prior: Vec<(f64, f64)> = self.problem.prior_terms().collect();
        let normal = |v: f64, mean: f64, precision: f64| {
            0.5 * (precision / TAU).ln() - 0.5 * precision * (v - mean).powi(2)
        };
        let of_entries: f64 = (self.free.iter().enumerate())
            .map(|(a, &j)| match self.problem.axes[j].evidence {
                EvidencePrior::Normal => normal(phi[a], prior[j].0, prior[j].1),
                EvidencePrior::Magnitude { .. } | EvidencePrior::Member => 0.0,
                EvidencePrior::Uniform { low, high } if (low..=high).contains(&phi[a]) => {
                    -(high - low).ln()
                }
                EvidencePrior::Uniform { .. } => f64::NEG_INFINITY,
            })
            .sum();
        let value = |entry: usize| self.free.iter().position(|j| *j == entry).map(|a| phi[a]);
        let of_blocks: f64 = (blocks.iter())
            .map(|block| {
                let each: Vec<f64> = (block.options.iter())
                    .map(|deviations| {
                        (block.entries.iter().zip(deviations))
                            .filter_map(|(j, d)| {
                                let half = if self.problem.axes[*j].is_one_sided() {
                                    LN_2
                                } else {
                                    0.0
                                };
                                Some(normal(value(*j)?, 0.0, d.powi(-2)) + half)
                            })
                            .sum()
                    })
                    .collect();
                log_mean(&each)
            })
            .sum();
        of_entries + of_blocks
    }

    /// log Z from draws around a Laplace approximation, its standard error, and the effective number of draws.
    fn by_draws(
        &self,
        around: &Laplace,
        blocks: &[Block],
        noise: Noise,
    ) -> Result<Option<(f64, f64, f64)>, FilterError> {
        let d = self.free.len();
        let Some(factor) = around.precision.clone().cholesky() else {
            return Ok(None);
        };
        let root = factor.l().transpose();
        let log_root: f64 = (0..d).map(|a| root[(a, a)].ln()).sum();
        let count = (SAMPLES / self.problem.samples()).clamp(LEAST_DRAWS, MOST_DRAWS) / 2;
        let c = &self.problem.coordinates;
        // Pairs on both sides of the centre: what is odd in the posterior cancels.
        let pairs: Vec<[f64; 2]> = (0..count as u64)
            .into_par_iter()
            .map(|i| {
                let mut source = noise.sample(i).source("evidence");
                let z = DVector::from_fn(d, |_, _| source.normal());
                let square: f64 = (0..FREEDOM).map(|_| source.normal().powi(2)).sum();
                let stretch = (FREEDOM as f64 / square).sqrt();
                let Some(step) = root.solve_upper_triangular(&(z * stretch)) else {
                    return Ok([f64::NEG_INFINITY; 2]);
                };
                let length = (&root * &step).norm_squared();
                let log_proposal = log_student(d, length) + log_root;
                let mut weights = [f64::NEG_INFINITY; 2];
                for (weight, sign) in weights.iter_mut().zip([1.0, -1.0]) {
                    let free = &around.centre + sign * &step;
                    let mut phi = self.phi.clone();
                    for (a, &j) in self.free.iter().enumerate() {
                        phi[j] = free[a];
                    }
                    let inside = (phi.iter().zip(c.lower().iter().zip(c.upper())))
                        .all(|(v, (low, high))| (low..=high).contains(&v));
                    let log_prior = self.log_prior(&free, blocks);
                    if !inside || log_prior == f64::NEG_INFINITY {
                        continue;
                    }
                    let theta = c.theta(phi.as_slice());
                    if let Some(value) = recoverable(self.problem.log_likelihood(&theta))? {
                        *weight = value + log_prior - log_proposal;
                    }
                }
                Ok(weights)
            })
            .collect::<Result<_, FilterError>>()?;
        let logs: Vec<f64> = pairs.iter().flatten().copied().collect();
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !top.is_finite() {
            return Ok(None);
        }
        let weights: Vec<f64> = logs.iter().map(|l| (l - top).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let effective = sum * sum / weights.iter().map(|w| w * w).sum::<f64>();
        // Pairs are not independent within themselves.
        let means: Vec<f64> = weights
            .chunks_exact(2)
            .map(|p| 0.5 * (p[0] + p[1]))
            .collect();
        let mean = sum / weights.len() as f64;
        let n = means.len() as f64;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let error = (variance / n).sqrt() / mean;
        let bounds = self.beyond_bounds(&self.problem.prior_terms().collect::<Vec<_>>());
        Ok(Some((top + mean.ln() + bounds, error, effective)))
    }
}

/// log density of a standard Student with [`FREEDOM`] degrees at squared length `square`.
fn log_student(d: usize, square: f64) -> f64 {
    let (nu, d) = (FREEDOM as f64, d as f64);
    let gamma = statrs::function::gamma::ln_gamma;
    gamma(0.5 * (nu + d))
        - gamma(0.5 * nu)
        - 0.5 * d * (nu * TAU / 2.0).ln()
        - 0.5 * (nu + d) * (square / nu).ln_1p()
}

/// log of the mean of exponentials.
pub(crate) fn log_mean(logs: &[f64]) -> f64 {
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return top;
    }
    let sum: f64 = logs.iter().map(|l| (l - top).exp()).sum();
    top + (sum / logs.len() as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::axis::Axis;
    use crate::fit::climb::climb;
    use crate::record::{Drive, Record, Signal};
    use crate::twin::{Now, Outline, Parameter, StateSpace, Twin};

    /// y = a + b·u, a and b unknown, unit noise: everything is normal, and Z is known in closed form.
    struct Line;
    impl StateSpace for Line {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("a", "", -3.0, 3.0).within(-50.0, 50.0))
                .parameter(Parameter::new("b", "", -3.0, 3.0).within(-50.0, 50.0))
                .state("x", "")
                .input("u", "")
                .output("y", "")
        }
        fn drift(&self, _: &Now<'_>, _: &[f64], dx: &mut [f64]) {
            dx[0] = 0.0;
        }
        fn observe(&self, now: &Now<'_>, _: &[f64], y: &mut [f64]) {
            y[0] = now.theta[0] + now.theta[1] * now.u[0];
        }
        fn noise(&self, _: &Now<'_>, _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = 1.0;
        }
    }

    fn record(n: usize) -> Record {
        let u = Signal::from_shape_fn((n, 1), |(k, _)| (k as f64 * 0.7).sin());
        let y = Signal::from_shape_fn((n, 1), |(k, _)| {
            0.4 + 1.3 * u[[k, 0]] + (k as f64 * 12.9).sin() * 1.2
        });
        Record::new(Drive::new(1.0, u).unwrap(), y).unwrap()
    }

    /// log N(y; 0, I + X·P⁻¹·Xᵀ) with prior variances `v`.
    fn exact(record: &Record, v: [f64; 2]) -> f64 {
        let n = record.samples();
        let x = DMatrix::from_fn(n, 2, |k, j| {
            if j == 0 {
                1.0
            } else {
                record.drive().input(k)[0]
            }
        });
        let y = DVector::from_iterator(n, record.outputs().column(0).iter().copied());
        let covariance = DMatrix::identity(n, n)
            + &x * DMatrix::from_diagonal(&DVector::from_row_slice(&v)) * x.transpose();
        let factor = covariance.cholesky().unwrap();
        let log_determinant: f64 = (0..n).map(|i| 2.0 * factor.l()[(i, i)].ln()).sum();
        -0.5 * (n as f64 * TAU.ln() + log_determinant + y.dot(&factor.solve(&y)))
    }

    fn problem(records: &[Record], size: Option<f64>) -> Problem<'_> {
        let twin = Twin::new(Line);
        let space = twin.parameters();
        let mut axes: Vec<Axis> = space.iter().map(Axis::of).collect();
        if let Some(largest) = size {
            axes[1].evidence = EvidencePrior::Magnitude { largest };
            (axes[1].centre, axes[1].deviation) = (0.0, 2.0 * largest);
        }
        Problem::new(twin, axes, records)
    }

    #[test]
    fn a_normal_posterior_has_the_exact_evidence() {
        let records = [record(60)];
        let problem = problem(&records, None);
        let fitted = climb(&problem, &[0.0, 0.0], 40).unwrap().unwrap();
        let deviation = problem.axes[0].deviation;
        let truth = exact(&records[0], [deviation * deviation; 2]);
        let found = evidence(&problem, &fitted, Some(Noise::new(1, "t", 0)))
            .unwrap()
            .unwrap();
        assert!((found.laplace - truth).abs() < 1e-3, "{found:?} {truth}");
        let error = found.error.unwrap();
        assert!(
            (found.log_evidence - truth).abs() < 5.0 * error + 1e-3,
            "{found:?} {truth}"
        );
        assert!(error < 0.05 && found.effective > 300.0, "{found:?}");
    }

    /// The seed moves the evidence by less than a tenth of a nat.
    #[test]
    fn the_seed_hardly_matters() {
        let records = [record(60)];
        let problem = problem(&records, Some(3.0));
        let fitted = climb(&problem, &[0.0, 0.5], 40).unwrap().unwrap();
        let values: Vec<f64> = (0..10)
            .map(|seed| {
                let noise = Some(Noise::new(seed, "t", 0));
                evidence(&problem, &fitted, noise)
                    .unwrap()
                    .unwrap()
                    .log_evidence
            })
            .collect();
        let (low, high) = crate::math::ends(&values);
        assert!(high - low < 0.1, "{values:?}");
    }

    /// The size of an effect is averaged over: the mean of exact evidences at the six sizes.
    #[test]
    fn sizes_are_averaged_over() {
        let records = [record(60)];
        let problem = problem(&records, Some(3.0));
        let fitted = climb(&problem, &[0.0, 0.5], 40).unwrap().unwrap();
        let expansion = Expansion::new(&problem, &fitted);
        let blocks = expansion.blocks();
        let deviation = problem.axes[0].deviation;
        let each: Vec<f64> = (blocks[0].options.iter())
            .map(|size| exact(&records[0], [deviation.powi(2), size[0] * size[0]]))
            .collect();
        let found = evidence(&problem, &fitted, None).unwrap().unwrap();
        assert!(
            (found.laplace - log_mean(&each)).abs() < 0.02,
            "{found:?} {each:?}"
        );
        // A coefficient of 1.3 with unit noise is worth a lot of evidence.
        let fixed = exact(&records[0], [deviation.powi(2), 1e-12]);
        assert!(found.laplace - fixed > 10.0);
    }

    /// A posterior cut off by a bound keeps what lies inside.
    #[test]
    fn an_entry_at_its_bound_is_integrated_on_one_side() {
        let records = [record(60)];
        let mut problem = problem(&records, None);
        let mut axes = problem.axes.clone();
        axes[1].bounds = crate::twin::Interval::new(-3.0, 0.5).unwrap();
        problem = Problem::new(problem.twin.clone(), axes, &records);
        let fitted = climb(&problem, &[0.0, 0.0], 40).unwrap().unwrap();
        assert_eq!(fitted.theta[1], 0.5);
        let found = evidence(&problem, &fitted, None).unwrap().unwrap();
        // By quadrature over b, a in closed form.
        let deviation = problem.axes[0].deviation;
        let logs: Vec<f64> = (0..4000)
            .map(|i| {
                let b = 0.5 - (i as f64 + 0.5) * 1e-3;
                let rest = Record::new(
                    records[0].drive().clone(),
                    Signal::from_shape_fn((60, 1), |(k, _)| {
                        records[0].outputs()[[k, 0]] - b * records[0].drive().input(k)[0]
                    }),
                );
                let density = -0.5 * (b / problem.axes[1].deviation).powi(2)
                    - 0.5 * (TAU * problem.axes[1].deviation.powi(2)).ln();
                exact(&rest.unwrap(), [deviation * deviation, 1e-14]) + density
            })
            .collect();
        let truth = log_mean(&logs) + 4f64.ln();
        assert!((found.laplace - truth).abs() < 0.2, "{found:?} {truth}");
    }
}
