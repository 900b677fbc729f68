//! Numbers that a computation takes: one, or those of several computations side by side.

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// A number of each of several computations. These never branch apart: where one needs a case, all compute it, and a [`Condition`]
/// selects. (The traits of num-traits ask for an order and for whole parts, which lanes do not have.)
pub(crate) trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    const ZERO: Self;
    /// Computations side by side.
    const LANES: usize;
    /// Cases of each computation.
    type Condition: Condition<Self>;

    /// A number for each lane.
    fn of_lanes(value: impl Fn(usize) -> f64) -> Self;
    fn lane(&self, lane: usize) -> f64;
    fn lane_mut(&mut self, lane: usize) -> &mut f64;
    fn below(self, other: Self) -> Self::Condition;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    fn ln(self) -> Self;
    fn exp(self) -> Self;
    /// The larger one; `other` where this is NaN.
    fn max(self, other: Self) -> Self;
    /// The smaller one; `other` where this is NaN.
    fn min(self, other: Self) -> Self;

    /// The same number in each lane.
    #[inline(always)]
    fn all(value: f64) -> Self {
        Self::of_lanes(|_| value)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Self::all(1.0) / self
    }
}

/// A truth value in each lane.
pub(crate) trait Condition<N>:
    Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    fn any(self) -> bool;
    /// `yes` where it holds.
    fn select(self, yes: N, no: N) -> N;
}

macro_rules! own_methods {
    ($($name:ident),+) => {
        $(#[inline(always)]
        fn $name(self) -> Self {
            Self::$name(self)
        })+
    };
}

impl Number for f64 {
    const ZERO: Self = 0.0;
    const LANES: usize = 1;
    type Condition = bool;

    #[inline(always)]
    fn of_lanes(value: impl Fn(usize) -> f64) -> Self {
        value(0)
    }
    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn lane_mut(&mut self, _: usize) -> &mut f64 {
        self
    }
    #[inline(always)]
    fn below(self, other: Self) -> bool {
        self < other
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    own_methods!(sqrt, abs, ln, exp);
}

impl Condition<f64> for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
    #[inline(always)]
    fn select(self, yes: f64, no: f64) -> f64 {
        if self { yes } else { no }
    }
}
