//! Numbers that a computation takes: one, or those of eight computations side by side.

#![allow(clippy::needless_range_loop)] // loops of known length become vectors

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// The point of `[low, high]` nearest to `value`; NaN stays NaN. Ends that data have put out of order give the higher one, where
/// `f64::clamp` panics.
#[inline]
pub(crate) fn nearest(value: f64, low: f64, high: f64) -> f64 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// A number of each of several computations. These never branch apart: where one needs a case, all compute it, and a [`Condition`]
/// selects. (The traits of num-traits ask for an order and for whole parts, which lanes do not have.)
pub(crate) trait Number:
    Send
    + Copy
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

/// Number of computations side by side.
pub const LANES: usize = 8;

/// One number of each computation. Operators act on each lane apart; nothing passes from one lane to another.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

/// All bits set in the lanes where a condition holds. Bits, not truth values: these stay in the processor's vectors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mask([u64; LANES]);

macro_rules! operator {
    ($Trait:ident $name:ident $sign:tt) => {
        impl $Trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.zip(other, |a, b| a $sign b)
            }
        }
    };
}
operator!(Add add +);
operator!(Sub sub -);
operator!(Mul mul *);
operator!(Div div /);

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self.map(|a| a * other)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Lanes {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self::of_lanes(|i| f(self.0[i]))
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self::of_lanes(|i| f(self.0[i], other.0[i]))
    }
}

impl Number for Lanes {
    const ZERO: Self = Self([0.0; LANES]);
    const LANES: usize = LANES;
    type Condition = Mask;

    #[inline(always)]
    fn of_lanes(value: impl Fn(usize) -> f64) -> Self {
        let mut to = [0.0; LANES];
        for i in 0..LANES {
            to[i] = value(i);
        }
        Self(to)
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0[lane]
    }
    #[inline(always)]
    fn lane_mut(&mut self, lane: usize) -> &mut f64 {
        &mut self.0[lane]
    }
    #[inline(always)]
    fn below(self, other: Self) -> Mask {
        Mask::of(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    /// One lane after the other.
    fn ln(self) -> Self {
        self.map(f64::ln)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        self.map(exp)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
}

impl Mask {
    /// Lanes in which this holds.
    #[inline(always)]
    pub(crate) fn of(holds: impl Fn(usize) -> bool) -> Self {
        let mut mask = [0; LANES];
        for i in 0..LANES {
            mask[i] = if holds(i) { u64::MAX } else { 0 };
        }
        Self(mask)
    }
}

impl Condition<Lanes> for Mask {
    #[inline(always)]
    fn any(self) -> bool {
        let mut any = 0;
        for bits in self.0 {
            any |= bits;
        }
        any != 0
    }

    #[inline(always)]
    fn select(self, yes: Lanes, no: Lanes) -> Lanes {
        Lanes::of_lanes(|i| {
            let (yes, no) = (yes.0[i].to_bits(), no.0[i].to_bits());
            f64::from_bits((self.0[i] & yes) | (!self.0[i] & no))
        })
    }
}

impl BitAnd for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] &= other.0[i];
        }
        self
    }
}

impl BitOr for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] |= other.0[i];
        }
        self
    }
}

impl Not for Mask {
    type Output = Self;
    #[inline(always)]
    fn not(mut self) -> Self {
        for i in 0..LANES {
            self.0[i] = !self.0[i];
        }
        self
    }
}

/// exp without branches: 2^k times a polynomial on half a logarithm of two about zero; relative error 3e-16. Below −708 and above 709
/// as there.
#[inline(always)]
fn exp(x: f64) -> f64 {
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// Added to a number, it leaves its nearest whole number in the last bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// 1/k!
    const SERIES: [f64; 14] = {
        let mut c = [1.0; 14];
        let mut k = 1;
        while k < 14 {
            c[k] = c[k - 1] / k as f64;
            k += 1;
        }
        c
    };
    let x = if x < -708.0 { -708.0 } else { x };
    let x = if x > 709.0 { 709.0 } else { x };
    let rounded = x * std::f64::consts::LOG2_E + ROUND;
    let k = rounded - ROUND;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let c = &SERIES;
    let (r2, r4, r8) = (r * r, (r * r) * (r * r), (r * r * r * r) * (r * r * r * r));
    let four = |i: usize| (c[i] + c[i + 1] * r) + (c[i + 2] + c[i + 3] * r) * r2;
    let p = (four(0) + four(4) * r4) + (four(8) + (c[12] + c[13] * r) * r4) * r8;
    p * f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_is_the_exponential() {
        for k in -7080..7090 {
            let x = f64::from(k) * 0.1 + 0.013;
            let error = (exp(x) / x.exp() - 1.0).abs();
            assert!(error < 1e-15, "{x}: {error}");
        }
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(f64::NEG_INFINITY) < 1e-300 && exp(f64::NAN).is_nan());
    }
}
