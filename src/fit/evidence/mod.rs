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
//! Laplace is exact for a normal posterior. Draws correct the rest: Z = mean of likelihood·prior/proposal, first over the draws of the
//! posterior, whose likelihoods are known.
//!
//! Sources: MacKay, *Information Theory, Inference, and Learning Algorithms* (2003), chapters 27 to 29; Kass & Raftery, "Bayes factors",
//! *JASA* 90 (1995).

mod draws;
mod expansion;
mod linear;
mod sizes;
#[cfg(test)]
mod tests;

pub(crate) use expansion::{CREDIT, Laplace};
pub(crate) use linear::linear_evidence;

use super::climb::Fitted;
use super::posterior::PosteriorSample;
use super::problem::Problem;
use crate::fit::budget::BUDGET;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;
use expansion::Expansion;

/// Evidence, in nats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Evidence {
    /// log Z.
    pub log_evidence: f64,
    /// log Z by Laplace alone.
    pub laplace: f64,
    /// Standard error of the correction by draws; none where Laplace stands alone.
    pub error: Option<f64>,
    /// Draws that the correction rests on, as many as independent ones.
    pub effective: f64,
}

impl Evidence {
    /// Nats over another, both as draws correct them or both by Laplace alone.
    pub fn over(&self, other: &Self) -> f64 {
        match self.error.and(other.error) {
            Some(_) => self.log_evidence - other.log_evidence,
            None => self.laplace - other.laplace,
        }
    }
}

/// Evidence by Laplace alone: averaged over all sizes, and the approximation at the most probable ones. `credit` bounds what an
/// unfinished fit is credited with.
pub(crate) fn laplace(problem: &Problem, fitted: &Fitted, credit: f64) -> Option<(f64, Laplace)> {
    let mut expansion = Expansion::new(problem, fitted);
    expansion.credit = credit;
    let blocks = expansion.blocks();
    expansion.laplace(&blocks)
}

/// Evidence of a twin around the fit that maximises it.
///
/// Draws of the posterior correct what Laplace leaves, and more of their proposals where these are too few; without any, and for simulated
/// likelihoods, Laplace stands alone.
pub(super) fn evidence(
    problem: &Problem,
    fitted: &Fitted,
    sample: &PosteriorSample,
    noise: Noise,
) -> Result<Option<Evidence>, FilterError> {
    let expansion = Expansion::new(problem, fitted);
    let blocks = expansion.blocks();
    let Some((laplace, _)) = expansion.laplace(&blocks) else {
        return Ok(None);
    };
    let alone = Evidence {
        log_evidence: laplace,
        laplace,
        error: None,
        effective: 0.0,
    };
    if problem.is_simulated() {
        return Ok(Some(alone));
    }
    let Some((log, error, effective)) = expansion.by_draws(sample, &blocks, noise)? else {
        return Ok(Some(alone));
    };
    Ok(Some(if effective >= BUDGET.effective_draws {
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
