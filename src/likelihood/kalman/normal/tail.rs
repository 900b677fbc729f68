//! The tail of the normal distribution.

use crate::math::{Condition, Number};
use std::f64::consts::FRAC_1_SQRT_2;

/// 1/√(2π).
const DENSITY: f64 = 0.398_942_280_401_432_7;

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

/// Φ(−z) and φ(z): tail probability of a standard normal number beyond `z`, to rounding for z up to 7, further out to an absolute 1e-14;
/// and its density there.
///
/// Share and density have the exponential in common, and erfcx(x) = exp(x²)·erfc(x) is so smooth that one
/// polynomial does for all x. Source of the form: Shepherd & Laframboise, *Mathematics of Computation* 36 (1981).
#[inline(always)]
pub(super) fn tail<N: Number>(z: N) -> (N, N) {
    let scale = (z * z * -0.5).exp();
    let x = (z.abs() * FRAC_1_SQRT_2).min(N::all(5.0));
    let s = N::all(2.2) - N::all(9.6) / (x + N::all(3.0));
    let half = scale * 0.5 * polynomial(s) / (x * 2.0 + N::all(1.0));
    let share = z.below(N::ZERO).select(N::all(1.0) - half, half);
    (share, scale * DENSITY)
}

/// By Estrin's scheme, whose products do not wait for each other.
#[inline(always)]
fn polynomial<N: Number>(s: N) -> N {
    let c = &SCALED;
    let (s2, s4) = (s * s, (s * s) * (s * s));
    let s8 = s4 * s4;
    let two = |i: usize| N::all(c[i]) + s * c[i + 1];
    let four = |i: usize| two(i) + two(i + 2) * s2;
    let low = four(0) + four(4) * s4;
    let high = four(8) + four(12) * s4;
    low + high * s8 + two(16) * (s8 * s8)
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
            let (share, density) = tail(z);
            let error = (share - expected).abs();
            assert!(error < 4e-15 * expected, "{z}: {error}");
            let expected = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
            assert!((density - expected).abs() <= 1e-15 * expected);
        }
        assert!(tail(50.0).0 < 1e-14 && tail(-50.0).0 == 1.0);
        assert_eq!(tail(f64::NEG_INFINITY).0, 1.0);
        assert!(tail(f64::NAN).0.is_nan());
    }
}
