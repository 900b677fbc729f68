//! The science: filters, effects, features, estimates, diagnoses, and records from real rigs.
//!
//! Names with `study` in them, or `#[ignore]`, are studies of minutes: run them by name and in release.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "helpers of tests; measured figures show with --nocapture"
)]

mod armax;
mod diagnose;
mod effects;
mod estimator;
mod filter;
mod gate_calibration;
mod limits;
mod numbers;
mod real_records;
