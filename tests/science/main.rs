//! The science: filters, effects, features, estimates, diagnoses.
//!
//! Names with `study` in them, or `#[ignore]`, are studies of minutes: run them by name and in release.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "helpers of tests; measured figures show with --nocapture"
)]

mod agreement;
mod armax;
mod diagnose;
mod effects;
mod estimator;
mod events;
mod filter;
mod fit;
mod golden;
mod misspecification;
mod noise;
mod numbers;
mod records;
mod searches;
mod steps;
mod suitability;

/// Counts that `trials` of this probability give with at least `level`; each tail outside has at most (1 − level)/2.
fn binomial_bounds(trials: u64, probability: f64, level: f64) -> std::ops::RangeInclusive<u64> {
    use statrs::distribution::{Binomial, DiscreteCDF};
    let binomial = Binomial::new(probability, trials).unwrap();
    let tail = (1.0 - level) / 2.0;
    binomial.inverse_cdf(tail)..=binomial.inverse_cdf(1.0 - tail)
}
