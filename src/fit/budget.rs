//! Budget of a fit: its cost, and the tolerances at which it ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Iterations of each search: loud noise has a way to go.
pub(crate) const ITERATIONS: usize = 80;

/// Budget of a fit.
#[derive(Debug)]
pub(super) struct FitBudget {
    /// Nats to the best within which a search is carried on.
    pub near: f64,
    /// Gain in nats at which it then ends.
    pub polished_gain: f64,
    /// Random points whose likelihood is looked at with loud noise: its wide valleys are met by few.
    pub loud_points: u64,
    /// The same with quiet noise, for each free entry.
    pub quiet_points: u64,
    /// Entries that such points are taken for, at most.
    pub quiet_entries: usize,
    /// Points of either that become starts.
    pub screened_starts: usize,
    /// Deviations of the prior between two starts that lie apart: nearer ones are mostly of one valley.
    pub starts_apart: f64,
    /// Nats within which two searches have found the same top.
    pub same_top: f64,
    /// Times that other starts are tried while only one search ends at the best top.
    pub more_starts: u64,
    /// Simplex searches one after another where a climb ends at a kink, at most; their steps for each entry, and the standard deviation of the
    /// simplex's values in nats at which one ends.
    pub kink_rounds: usize,
    pub simplex_steps: u64,
    pub simplex_end: f64,
    /// Distance from the top that counts as arrived, in standard deviations: what is left to gain is its square's half, 0.02 nats.
    pub arrived: f64,
    /// The same where three searches, or most of them, end at one top: dry friction and thresholds make kinks, and at a kink no gradient vanishes.
    pub agreed: f64,
    /// Searches from points of the prior in a round.
    pub restarts: u64,
    /// Rounds of them at most.
    pub restart_rounds: u64,
    /// Gain in nats by which a restart shows that the searches had not arrived.
    pub restart_gain: f64,
    /// Nats by which a fit with effects may end below one without, since the priors of the effects count, too.
    pub below_without: f64,
    /// Searches from posterior draws that are better than the best fit, at most.
    pub restarts_from_draws: usize,
    /// Shares of the records that a black box is fitted to before the whole of them.
    pub grown_shares: [f64; 2],
    /// Best fits that go on to the next share.
    pub grown_kept: usize,
    /// Random points whose likelihood is looked at over the first share.
    pub grown_points: u64,
    /// Points of these that become starts.
    pub grown_starts: usize,
    /// Trial points of a search of a black box, at most.
    pub grown_iterations: usize,
    /// Samples that are filtered in a round of posterior draws.
    pub round_samples: usize,
    /// Draws that makes at least.
    pub least_draws: usize,
    /// Draws that makes at most.
    pub most_draws: usize,
    /// Draws of the last round for each that is asked for: weights are uneven, and fewer would repeat draws.
    pub draws_each: usize,
    /// Rounds of adaptation where draws are asked for; without, one.
    pub adaptations: usize,
    /// Share of the first proposals' covariance in those that follow their draws.
    pub kept_covariance: f64,
    /// Nats below the best top within which another counts: a mode with a thousandth of the mass is none.
    pub counting_top: f64,
    /// Standard deviations between two tops of their own.
    pub tops_apart: f64,
    /// Gain in nats at which a draw is better than the fit.
    pub better_draw: f64,
    /// Draws that count, for each entry of φ: weights are flattened until so many do, so that a proposal follows more than a few draws.
    pub counting_draws: f64,
    /// Different posterior draws that intervals need: three of them lie beyond an end at 0.9.
    pub interval_draws: usize,
    /// Draws for each parameter that a covariance needs.
    pub region_draws: usize,
    /// Samples that are filtered in a round of draws for the evidence.
    pub evidence_samples: usize,
    /// Draws that makes at least.
    pub least_evidence_draws: usize,
    /// Draws that makes at most.
    pub most_evidence_draws: usize,
    /// Monte-Carlo error of the evidence in nats that is small enough.
    pub evidence_error: f64,
    /// Rounds for which more draws are taken, at most.
    pub evidence_rounds: usize,
    /// Effective draws below which these say less of the evidence than Laplace.
    pub effective_draws: f64,
}

/// The budget of every fit; benches of records with known tops stand behind it.
pub(super) const BUDGET: FitBudget = FitBudget {
    near: 3.0,
    polished_gain: 1e-4,
    loud_points: 48,
    quiet_points: 64,
    quiet_entries: 8,
    screened_starts: 3,
    starts_apart: 1.0,
    same_top: 0.1,
    more_starts: 3,
    kink_rounds: 4,
    simplex_steps: 40,
    simplex_end: 0.02,
    arrived: 0.2,
    agreed: 1.0,
    restarts: 3,
    restart_rounds: 3,
    restart_gain: 0.5,
    below_without: 0.5,
    restarts_from_draws: 6,
    grown_shares: [0.25, 0.5],
    grown_kept: 2,
    grown_points: 32,
    grown_starts: 4,
    grown_iterations: 25,
    round_samples: 200_000,
    least_draws: 100,
    most_draws: 500,
    draws_each: 4,
    adaptations: 3,
    kept_covariance: 0.05,
    counting_top: 7.0,
    tops_apart: 3.0,
    better_draw: 0.1,
    counting_draws: 4.0,
    interval_draws: 60,
    region_draws: 10,
    evidence_samples: 400_000,
    least_evidence_draws: 200,
    most_evidence_draws: 1000,
    evidence_error: 0.03,
    evidence_rounds: 4,
    effective_draws: 30.0,
};

/// Passes over a record, of a filter or of an ensemble of simulations, with or without derivatives. Clones share the count.
#[derive(Clone, Default)]
pub(crate) struct Passes(Arc<AtomicU64>);

impl Passes {
    pub fn count(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    pub fn so_far(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}
