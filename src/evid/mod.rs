//! New.
#![allow(dead_code)]
mod error;
mod explain;
mod hypotheses;
mod model;
mod outcome;
mod thresholds;
#[cfg(test)]
mod dev;
