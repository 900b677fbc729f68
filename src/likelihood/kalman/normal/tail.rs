//! The tail of the normal distribution.

use std::f64::consts::FRAC_1_SQRT_2;

/// Tail probability of a standard normal number, and its density there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::likelihood::kalman) struct Tail {
    /// Φ(−z).
    pub share: f64,
    /// φ(z).
    pub density: f64,
}

/// 1/√(2π).
pub(in crate::likelihood::kalman) const DENSITY: f64 = 0.398_942_280_401_432_7;

/// (1 + 2·x)·erfcx(x) on [0, 5] by powers of s = 2.2 − 9.6/(x + 3), by Chebyshev interpolation; relative error 5e-17.
const SCALED: [f64; 18] = [
    1.287_407_632_173_560_4,
    -0.007_658_332_791_010_506,
    -0.131_774_807_134_842_9,
    0.105_099_911_446_787_1,
    -0.045_611_426_075_598_59,
    0.011_642_877_751_898_144,
    -0.001_212_285_776_289_119_4,
    -0.000_212_993_573_947_039,
    6.940_843_718_599_813e-5,
    4.232_948_770_481_829e-6,
    -3.153_972_756_273_954_2e-6,
    -2.052_332_452_068_751_6e-7,
    1.458_994_907_347_727e-7,
    1.845_732_265_322_300_6e-8,
    -6.193_736_918_094_027e-9,
    -1.563_854_017_721_84e-9,
    1.748_642_651_261_236_1e-10,
    8.915_587_253_124_454e-11,
];

impl Tail {
    /// Infinitely far out.
    pub const NONE: Self = Self {
        share: 0.0,
        density: 0.0,
    };

    /// Beyond `z`, to rounding for z up to 7; further out to an absolute 1e-14.
    ///
    /// Share and density have the exponential in common, and erfcx(x) = exp(x²)·erfc(x) is so smooth that one
    /// polynomial does for all x. Source of the form: Shepherd & Laframboise, *Mathematics of Computation* 36 (1981).
    pub fn beyond(z: f64) -> Self {
        let scale = (-0.5 * z * z).exp();
        let x = (z.abs() * FRAC_1_SQRT_2).min(5.0);
        let half = 0.5 * scale * polynomial(2.2 - 9.6 / (x + 3.0)) / (1.0 + 2.0 * x);
        Self {
            share: if z < 0.0 { 1.0 - half } else { half },
            density: DENSITY * scale,
        }
    }
}

/// By Estrin's scheme, whose products do not wait for each other.
#[inline(always)]
pub(in crate::likelihood::kalman) fn polynomial(s: f64) -> f64 {
    let c = &SCALED;
    let (s2, s4, s8) = (s * s, (s * s) * (s * s), (s * s * s * s) * (s * s * s * s));
    let four = |i: usize| (c[i] + c[i + 1] * s) + (c[i + 2] + c[i + 3] * s) * s2;
    let low = four(0) + four(4) * s4;
    let high = four(8) + four(12) * s4;
    low + high * s8 + (c[16] + c[17] * s) * (s8 * s8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from fifty digits; `statrs`'s erfc is off by 1e-11 here and there.
    #[test]
    fn shares_are_those_of_the_error_function() {
        for (z, expected) in [
            (-7.5, 0.9999999999999681),
            (-3.66, 0.9998738923758616),
            (-2.0, 0.9772498680518208),
            (-0.5, 0.6914624612740131),
            (0.0, 0.5),
            (0.1, 0.460172162722971),
            (0.5, 0.3085375387259869),
            (1.0, 0.15865525393145705),
            (1.5, 0.06680720126885807),
            (2.0, 0.02275013194817921),
            (2.5, 0.006209665325776135),
            (3.0, 0.0013498980316300946),
            (3.66, 0.00012610762413848675),
            (4.0, 3.1671241833119924e-05),
            (5.0, 2.866515718791939e-07),
            (6.0, 9.86587645037698e-10),
            (7.0, 1.279812543885835e-12),
        ] {
            let found = Tail::beyond(z);
            let error = (found.share - expected).abs();
            assert!(error < 4e-15 * expected, "{z}: {error}");
            let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
            assert!((found.density - density).abs() <= 1e-15 * density);
        }
        assert!(Tail::beyond(50.0).share < 1e-14 && Tail::beyond(-50.0).share == 1.0);
        assert_eq!(Tail::beyond(f64::NEG_INFINITY).share, 1.0);
        assert!(Tail::beyond(f64::NAN).share.is_nan());
    }
}
