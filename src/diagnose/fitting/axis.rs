//! Axis of one entry of θ in a fit.

use crate::twin::{Interval, Parameter, Role};

/// Standard deviation of the weak log-prior of a positive parameter.
const LOG_DEVIATION: f64 = 0.6;
/// A positive parameter stays within this factor of the prior's centre, and within the prior.
const FACTOR: f64 = 4.0;
/// Longest step of a fit in a logarithm; otherwise, as a share of the width.
const LONGEST: f64 = 0.5;

/// Axis of one entry of θ in a fit.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnose) struct Axis {
    /// Range; a logarithm is taken where the lower end is positive.
    pub bounds: Interval,
    /// Centre of the weak prior, in θ.
    pub centre: f64,
    /// Standard deviation of the weak prior in φ; infinite for none.
    pub deviation: f64,
    /// Scale of differences, in θ; of no meaning for a logarithm.
    pub width: f64,
    /// Longest step of a fit in φ.
    pub longest: f64,
    /// True where the prior counts in comparisons: that of the twin's own parameters does.
    pub counts: bool,
    /// True where a fit leaves it at its start.
    pub held: bool,
}

impl Axis {
    /// Returns the axis of a parameter of the twin itself, an unknown start or noise level.
    pub fn of(p: &Parameter) -> Self {
        let (prior, bounds) = (p.prior, p.bounds);
        let centre = prior.centre();
        if bounds.low() > 0.0 {
            let span = (prior.high() / prior.low()).ln() / 12f64.sqrt();
            let within = match p.role {
                Role::Parameter => Interval::unchecked(
                    bounds.low().max((centre / FACTOR).min(prior.low())),
                    bounds.high().min((FACTOR * centre).max(prior.high())),
                ),
                _ => bounds,
            };
            Self {
                bounds: within,
                centre,
                deviation: LOG_DEVIATION.max(span),
                width: 1.0,
                longest: LONGEST,
                counts: true,
                held: false,
            }
        } else {
            Self {
                bounds,
                centre,
                deviation: prior.width(),
                width: prior.width(),
                longest: LONGEST * prior.width(),
                counts: true,
                held: false,
            }
        }
    }

    /// The same axis, held in the prior box of its parameter.
    pub fn inside(mut self, prior: Interval) -> Self {
        let low = self.bounds.low().max(prior.low());
        let high = self.bounds.high().min(prior.high());
        if low < high {
            self.bounds = Interval::unchecked(low, high);
        }
        self
    }
}
