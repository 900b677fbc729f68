//! Numbers of an effect's law.

use crate::twin::Interval;

/// One number of an effect's law.
#[derive(Debug, Clone, PartialEq)]
pub struct Magnitude {
    /// Name, as in effect files.
    pub name: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// The value that switches the effect off; none for a *shape*, which has no effect of its own.
    pub off: Option<f64>,
    /// Values that a fit starts from, per unit of the signal or rate that the effect bends.
    pub starts: &'static [f64],
    /// Values that make sense: sign and size.
    pub limits: Interval,
}

impl Magnitude {
    /// Returns whether the magnitude is a level beyond which something happens: off at infinity.
    pub fn is_threshold(&self) -> bool {
        self.off.is_some_and(f64::is_infinite)
    }

    /// Creates a magnitude that is off at 0, of either sign.
    pub const fn signed(name: &'static str, unit: &'static str, starts: &'static [f64]) -> Self {
        Self {
            name,
            unit,
            off: Some(0.0),
            starts,
            limits: Interval::EVERYTHING,
        }
    }

    /// Creates a magnitude that is off at 0 and never negative.
    pub const fn positive(name: &'static str, unit: &'static str, starts: &'static [f64]) -> Self {
        Self {
            limits: Interval::unchecked(0.0, f64::INFINITY),
            ..Self::signed(name, unit, starts)
        }
    }

    /// Sets another off value.
    pub const fn off(mut self, off: f64) -> Self {
        self.off = Some(off);
        self
    }

    /// Makes it a shape: no value of it alone switches the effect off.
    pub const fn shape(mut self) -> Self {
        self.off = None;
        self
    }

    /// Sets the limits `[low, high]`.
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.limits = Interval::unchecked(low, high);
        self
    }
}
