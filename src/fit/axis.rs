//! Axis of one entry of θ in a fit.

use crate::likelihood::Level;
use crate::twin::{Interval, Parameter};

/// Standard deviation of the weak log-prior of a positive parameter.
const LOG_DEVIATION: f64 = 0.6;
/// Size at which a direction is taken, as a share of the largest one.
pub(crate) const SMALL: f64 = 0.01;
/// Longest step of a fit in a logarithm; otherwise, as a share of the width.
const LONGEST: f64 = 0.5;
/// The same for the logarithm of a noise level, which has a way to go from loud noise.
const LONGEST_NOISE: f64 = 1.5;

/// Axis of one entry of θ in a fit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    /// Range.
    pub bounds: Interval,
    /// True where φ is the logarithm: that of a positive parameter.
    pub is_log: bool,
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
    /// Start of every search, whatever the point that it is given says.
    pub begin: Option<f64>,
    /// Stands for the normal prior in evidence.
    pub evidence: EvidencePrior,
}

/// Prior of an entry of θ, as evidence counts it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum EvidencePrior {
    /// Normal in φ, as in the fit.
    Normal,
    /// Size of an effect, off at 0: normal of a deviation that is itself unknown, between what is just visible and this, where the
    /// effect is as large as the twin's own terms.
    Magnitude { largest: f64 },
    /// Uniform in φ over this range: the shape of an effect.
    Uniform { low: f64, high: f64 },
    /// As the family says that the entry belongs to.
    Member,
}

/// Coefficients of an unknown function: normal, of variance τ²·w for one of several lists of weights w that add up to 1, so that τ is
/// the deviation of the function itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Family {
    /// Entries of θ.
    pub entries: Vec<usize>,
    /// Lists of weights, one for each scale of length.
    pub weights: Vec<Vec<f64>>,
    /// Largest τ: where the function is as large as the twin's own terms.
    pub largest: f64,
}

impl Axis {
    /// Returns the axis of a parameter of the twin itself, an unknown start or noise level.
    pub fn of(p: &Parameter) -> Self {
        let (prior, bounds) = (p.prior, p.bounds);
        let centre = prior.centre();
        if bounds.low() > 0.0 {
            let span = (prior.high() / prior.low()).ln() / 12f64.sqrt();
            Self {
                bounds,
                is_log: true,
                centre,
                deviation: LOG_DEVIATION.max(span),
                width: 1.0,
                longest: LONGEST,
                counts: true,
                held: false,
                begin: None,
                evidence: EvidencePrior::Normal,
            }
        } else {
            Self {
                bounds,
                is_log: false,
                centre,
                deviation: prior.width(),
                width: prior.width(),
                longest: LONGEST * prior.width(),
                counts: true,
                held: false,
                begin: None,
                evidence: EvidencePrior::Normal,
            }
        }
    }

    /// Returns the axis of a fitted noise level: log-normal around its median. Searches begin where the noise is loud.
    pub fn of_level(level: &Level) -> Self {
        Self {
            bounds: level.parameter.bounds,
            is_log: level.parameter.bounds.low() > 0.0,
            centre: level.median,
            deviation: level.deviation,
            width: 1.0,
            longest: LONGEST_NOISE,
            counts: true,
            held: false,
            begin: Some(level.loud),
            evidence: EvidencePrior::Normal,
        }
    }

    /// A size at which its direction is taken: a hundredth of the largest, on the side that the bounds allow; `None` for other entries.
    pub fn small_size(&self) -> Option<f64> {
        let EvidencePrior::Magnitude { largest } = self.evidence else {
            return None;
        };
        let step = SMALL * largest;
        Some(if self.bounds.contains(step) {
            step
        } else {
            -step
        })
    }

    /// The largest size on the same side, within the bounds.
    pub fn largest_size(&self) -> Option<f64> {
        Some(self.bounds.clamp(self.small_size()? / SMALL))
    }

    /// Returns whether a size can only be added: half of a normal prior lies within the bounds.
    pub fn is_one_sided(&self) -> bool {
        matches!(self.evidence, EvidencePrior::Magnitude { .. }) && self.bounds.low() >= 0.0
    }

    /// The period of an angle: its bounds hold each value more than once, and evidence counts it once.
    pub fn period(&self) -> Option<f64> {
        match self.evidence {
            EvidencePrior::Uniform { low, high } if !self.is_log => {
                Some(high - low).filter(|turn| self.bounds.width() > 1.5 * turn)
            }
            _ => None,
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// Bounds of two turns hold each angle twice, those of one hold it once; another shape has no turns.
    #[test]
    fn angles_have_a_period() {
        let axis = |reach: f64, evidence| Axis {
            evidence,
            ..Axis::of(&Parameter::new("phase", "rad", -reach, reach))
        };
        let once = EvidencePrior::Uniform { low: -PI, high: PI };
        assert_eq!(axis(TAU, once).period(), Some(TAU));
        assert_eq!(axis(PI, once).period(), None);
        assert_eq!(axis(TAU, EvidencePrior::Normal).period(), None);
    }
}
