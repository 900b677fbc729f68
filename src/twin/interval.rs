//! A closed interval of real numbers.

use crate::math::nearest;
use crate::setting::number;
use crate::twin::TwinError;
use serde::{Deserialize, Serialize};

/// `[low, high]`, in the unit of what it bounds; an end may be infinite. Files write it as `[low, high]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f64; 2]", into = "[f64; 2]")]
pub struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    /// The interval without bounds.
    pub const EVERYTHING: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// `[low, high]` with `low < high`, neither NaN.
    pub fn new(low: f64, high: f64) -> Result<Self, TwinError> {
        if low < high {
            Ok(Self { low, high })
        } else {
            Err(TwinError::Interval { low, high })
        }
    }

    /// An interval written in code; it is checked with the rest of the twin.
    pub(crate) const fn unchecked(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// Checks that the ends are in order and not NaN.
    pub(crate) fn check(self) -> Result<Self, TwinError> {
        Self::new(self.low, self.high)
    }

    /// The part of it in another; all of it where they have none in common.
    pub(crate) fn and(self, other: Self) -> Self {
        Self::new(self.low.max(other.low), self.high.min(other.high)).unwrap_or(self)
    }

    /// Lower end.
    pub fn low(self) -> f64 {
        self.low
    }

    /// Upper end.
    pub fn high(self) -> f64 {
        self.high
    }

    /// `high − low`.
    pub fn width(self) -> f64 {
        self.high - self.low
    }

    /// Midpoint.
    pub fn centre(self) -> f64 {
        self.low + 0.5 * self.width()
    }

    /// Tells whether both ends and the width are finite.
    pub fn is_finite(self) -> bool {
        self.width().is_finite()
    }

    /// Tells whether `value` lies inside, ends included.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The nearest point inside.
    #[inline]
    pub fn clamp(self, value: f64) -> f64 {
        nearest(value, self.low, self.high)
    }
}

impl TryFrom<[f64; 2]> for Interval {
    type Error = TwinError;
    fn try_from([low, high]: [f64; 2]) -> Result<Self, TwinError> {
        Self::new(low, high)
    }
}

impl From<Interval> for [f64; 2] {
    fn from(interval: Interval) -> Self {
        [interval.low, interval.high]
    }
}

impl std::fmt::Display for Interval {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "[{}, {}]", number(self.low), number(self.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_and_reversed_ends_are_refused() {
        assert!(Interval::new(f64::NAN, 1.0).is_err());
        let error = Interval::new(2.0, 1.0).unwrap_err().to_string();
        assert!(error.contains("[2, 1]") && error.contains("low must be below high"));
    }

    #[test]
    fn half_open_intervals_clamp_on_one_side() {
        let ceiling = Interval::new(f64::NEG_INFINITY, 10.0).unwrap();
        assert_eq!((ceiling.clamp(-5.0), ceiling.clamp(11.0)), (-5.0, 10.0));
        assert!(!ceiling.is_finite());
    }
}
