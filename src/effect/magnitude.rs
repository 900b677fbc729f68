//! Numbers of an effect's law.

use crate::twin::Interval;

/// Meaning of a magnitude: it decides the magnitude's prior and where searches begin. Units are for people alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Shape {
    /// Amount of a law, off at 0.
    Size,
    /// Amount each second: of a drift, or, off at infinity, the fastest that a signal may move.
    Rate,
    /// Moment in the record.
    Time,
    /// Seconds by which a signal is late.
    Delay,
    /// Seconds in which a lag answers.
    TimeConstant,
    /// Cycles a second.
    Frequency,
    /// Angle.
    Phase,
    /// Value of a signal or state at which something happens, or, off at 0, a width in it.
    Level,
    /// Part of a whole.
    Share,
    /// Exponent or another number without a natural zero.
    Exponent,
}

/// One number of an effect's law.
#[derive(Debug, Clone, PartialEq)]
pub struct Magnitude {
    /// Name, as in effect files.
    pub name: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// Meaning.
    pub shape: Shape,
    /// The value that switches the effect off; none for a number that has no effect of its own.
    pub off: Option<f64>,
    /// Values that a fit starts from, per unit of the signal or rate that the effect bends.
    pub starts: &'static [f64],
    /// Values that make sense: sign and size.
    pub limits: Interval,
}

impl Magnitude {
    /// Creates a size that is off at 0, of either sign.
    pub const fn signed(name: &'static str, unit: &'static str, starts: &'static [f64]) -> Self {
        Self {
            name,
            unit,
            shape: Shape::Size,
            off: Some(0.0),
            starts,
            limits: Interval::EVERYTHING,
        }
    }

    /// Creates a size that is off at 0 and never negative.
    pub const fn positive(name: &'static str, unit: &'static str, starts: &'static [f64]) -> Self {
        Self {
            limits: Interval::unchecked(0.0, f64::INFINITY),
            ..Self::signed(name, unit, starts)
        }
    }

    /// Sets the meaning. Times, frequencies, phases and exponents have no effect of their own: no value of them switches a law off.
    pub const fn shape(mut self, shape: Shape) -> Self {
        self.shape = shape;
        match shape {
            Shape::Time | Shape::Frequency | Shape::Phase | Shape::Exponent => self.never_off(),
            _ => self,
        }
    }

    /// Sets another off value. A size that is off at infinity is a level beyond which something happens.
    pub const fn off(mut self, off: f64) -> Self {
        self.off = Some(off);
        if off.is_infinite() && matches!(self.shape, Shape::Size) {
            self.shape = Shape::Level;
        }
        self
    }

    /// Says that no value of it alone switches the effect off.
    pub const fn never_off(mut self) -> Self {
        self.off = None;
        self
    }

    /// Sets the limits `[low, high]`.
    pub const fn within(mut self, low: f64, high: f64) -> Self {
        self.limits = Interval::unchecked(low, high);
        self
    }

    /// Returns whether the magnitude is a level or a rate beyond which something happens: off at infinity.
    pub fn is_threshold(&self) -> bool {
        self.off.is_some_and(f64::is_infinite)
    }
}
