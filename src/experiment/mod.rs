//! Studies over many records, and the paper's settings of the reference twins.

mod monte_carlo;
mod paper;

pub use monte_carlo::{Method, MethodScore, MonteCarlo, MonteCarloError, score};
pub use paper::{Scenario, reference_studies, scenario};
