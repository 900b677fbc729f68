//! Empirical distributions, sizes of a sample, and binomial intervals.

use super::MathError;
use statrs::distribution::{Beta, ContinuousCDF};

/// Standard deviation of a sample of values of any size, over its number.
pub(crate) fn deviation(values: &[f64]) -> f64 {
    let (n, unit) = (values.len().max(1) as f64, unit(largest(values)));
    let mean = values.iter().map(|v| v / unit).sum::<f64>() / n;
    let squares = values.iter().map(|v| (v / unit - mean).powi(2));
    (squares.sum::<f64>() / n).sqrt() * unit
}

/// The power of two at or below a size: squares of values divided by it neither overflow nor vanish, and no bit of them is lost. 1 for
/// sizes that are 0, subnormal or not finite.
pub(crate) fn unit(size: f64) -> f64 {
    match size.is_normal() {
        true => f64::from_bits(size.to_bits() & f64::INFINITY.to_bits()),
        false => 1.0,
    }
}

/// √Σv², of values of any size.
pub(crate) fn norm(values: &[f64]) -> f64 {
    let unit = unit(largest(values));
    let square: f64 = values.iter().map(|v| (v / unit).powi(2)).sum();
    square.sqrt() * unit
}

/// Largest absolute value; 0 of none.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a: f64, v| a.max(v.abs()))
}

/// Least and largest value.
pub(crate) fn ends(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(*v), high.max(*v))
        })
}

/// Difference of values, as a share of their size, below which they are one.
pub(crate) const CONSTANT: f64 = 1e-9;

/// Returns whether all finite values are the same; false where there is none.
pub(crate) fn is_constant(values: &[f64]) -> bool {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let (low, high) = ends(&finite);
    !finite.is_empty() && high - low <= CONSTANT * low.abs().max(high.abs())
}

/// Pearson's correlation; 0 where one of the two does not vary.
pub(crate) fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len().max(1) as f64;
    let (a, b) = (pairs.iter()).fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        (xx, yy) = (xx + (x - a).powi(2), yy + (y - b).powi(2));
        xy += (x - a) * (y - b);
    }
    if xx * yy > 0.0 {
        xy / (xx * yy).sqrt()
    } else {
        0.0
    }
}

/// The empirical quantile of `values` at `probability`, linear between order statistics.
///
/// With the values sorted, x₁ ≤ … ≤ x_n, and h = (n − 1)·p + 1,
///
/// ```text
/// q(p) = x_⌊h⌋ + (h − ⌊h⌋)·(x_⌊h⌋₊₁ − x_⌊h⌋)
/// ```
///
/// which is type 7 of Hyndman & Fan (1996), the default of NumPy and R. Infinite values are allowed; no values, or NaN
/// among them, are [`MathError::NoOrder`].
pub fn quantile(values: &[f64], probability: f64) -> Result<f64, MathError> {
    let last = (values.len().checked_sub(1)).ok_or(MathError::NoOrder)?;
    if values.iter().any(|v| v.is_nan()) {
        return Err(MathError::NoOrder);
    }
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let place = last as f64 * probability;
    let below = place.floor() as usize;
    let fraction = place - place.floor();
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    // Between equal infinities the difference would be NaN.
    Ok(if fraction == 0.0 || low == high {
        low
    } else {
        low + fraction * (high - low)
    })
}

/// The empirical median: [`quantile`] at ½.
pub fn median(values: &[f64]) -> Result<f64, MathError> {
    quantile(values, 0.5)
}

/// Returns the log of the mean of exponentials.
pub fn log_mean(logs: &[f64]) -> f64 {
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return top;
    }
    let sum: f64 = logs.iter().map(|l| (l - top).exp()).sum();
    top + (sum / logs.len() as f64).ln()
}

/// Returns the p-value of `observed` among `null`, large being extreme; exact in finite samples.
///
/// ```text
/// p = (1 + #{k : s_k ≥ s}) / (B + 1)
/// ```
///
/// When `observed` and the B values of `null` are exchangeable, P(p ≤ α) ≤ α for every α, with equality at multiples of
/// 1/(B + 1) when ties have probability zero. The smallest possible p is 1/(B + 1), so a test at α needs B ≥ 1/α − 1.
/// The values must not have been used to build the statistic (its mean or covariance), or they are not exchangeable.
///
/// NaN counts as the most extreme value on both sides: a replicate that failed never makes the record look worse.
///
/// Source: Davison & Hinkley, *Bootstrap Methods and their Application* (1997), section 4.2.
pub fn rank_p_value(null: &[f64], observed: f64) -> f64 {
    let as_extreme = |s: &&f64| s.is_nan() || **s >= observed;
    (1 + null.iter().filter(as_extreme).count()) as f64 / (null.len() + 1) as f64
}

/// The value to six significant digits: a step of 0.09999999999999999 s is one of 0.1 s to people.
pub(crate) fn six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// The value to three significant digits, for messages.
pub(crate) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// The exact interval for a probability after `count` successes in `of` trials; no trials give [0, 1]. `None` for more successes than
/// trials.
///
/// ```text
/// low  = B⁻¹(α/2;     k,     n − k + 1),   0 for k = 0
/// high = B⁻¹(1 − α/2; k + 1, n − k),       1 for k = n,      α = 1 − level
/// ```
///
/// with B⁻¹ the quantile of the beta distribution. It covers the true probability with at least `level`, usually more.
///
/// Source: Clopper & Pearson, "The use of confidence or fiducial limits illustrated in the case of the binomial" (1934).
pub fn clopper_pearson(count: u64, of: u64, level: f64) -> Option<(f64, f64)> {
    let failures = of.checked_sub(count)?;
    let (k, n) = (count as f64, of as f64);
    let quantile = |a: f64, b: f64, p: f64| {
        let beta = Beta::new(a, b).ok()?;
        Some(beta.inverse_cdf(p))
    };
    let tail = (1.0 - level) / 2.0;
    let low = match count {
        0 => 0.0,
        _ => quantile(k, n - k + 1.0, tail)?,
    };
    let high = match failures {
        0 => 1.0,
        _ => quantile(k + 1.0, n - k, 1.0 - tail)?,
    };
    Some((low, high))
}

/// The counts that `trials` with success probability `probability` give with at least `level`: each tail outside has
/// at most (1 − level)/2. A count outside is evidence that the rate is another.
#[cfg(test)]
pub fn binomial_bounds(
    trials: u64,
    probability: f64,
    level: f64,
) -> Option<std::ops::RangeInclusive<u64>> {
    use statrs::distribution::{Binomial, DiscreteCDF};

    let tail = (1.0 - level) / 2.0;
    let binomial = Binomial::new(probability, trials).ok()?;
    // The quantile is the smallest k with P(X ≤ k) ≥ p, hence P(X < low) < tail and P(X > high) ≤ tail.
    Some(binomial.inverse_cdf(tail)..=binomial.inverse_cdf(1.0 - tail))
}

#[cfg(test)]
mod tests {
    mod quantiles {
        use super::super::*;
        use crate::math::binomial_bounds;
        use rand::{Rng, SeedableRng};
        use rand_chacha::ChaCha8Rng;

        /// Values of `numpy.quantile([7, 1, 3, 10, 4.5], p)`.
        #[test]
        fn agrees_with_numpy() {
            let values = [7.0, 1.0, 3.0, 10.0, 4.5];
            for (p, expected) in [
                (0.0, 1.0),
                (0.1, 1.8),
                (0.37, 3.72),
                (0.9, 8.8),
                (1.0, 10.0),
            ] {
                assert!(
                    (quantile(&values, p).unwrap() - expected).abs() < 1e-12,
                    "{p}"
                );
            }
            assert_eq!(median(&values).unwrap(), 4.5);
        }

        #[test]
        fn infinities_are_values_and_nan_is_none() {
            let values = [f64::INFINITY, 1.0, f64::INFINITY, 2.0];
            assert_eq!(quantile(&values, 0.9).unwrap(), f64::INFINITY);
            assert!(median(&[]).is_err() && median(&[1.0, f64::NAN]).is_err());
        }

        /// Under exchangeability, p ≤ 0.1 happens in exactly a tenth of all cases with B = 19.
        #[test]
        fn a_p_value_is_exact_under_exchangeability() {
            let mut rng = ChaCha8Rng::seed_from_u64(11);
            let trials = 4000;
            let alarms = (0..trials)
                .filter(|_| {
                    let null: [f64; 19] = rng.r#gen();
                    rank_p_value(&null, rng.r#gen()) <= 0.1
                })
                .count() as u64;
            assert!(
                binomial_bounds(trials, 0.1, 0.9999)
                    .unwrap()
                    .contains(&alarms)
            );
        }

        #[test]
        fn failures_never_make_the_record_look_worse() {
            assert_eq!(rank_p_value(&[f64::NAN, f64::INFINITY, 0.0], 5.0), 0.75);
            assert_eq!(rank_p_value(&[1.0, 2.0, 3.0], f64::NAN), 0.25);
            assert_eq!(rank_p_value(&[], 5.0), 1.0, "no evidence without a null");
        }
    }

    mod intervals {
        use super::super::*;
        use statrs::distribution::{Binomial, DiscreteCDF};

        /// The ends solve P(X ≥ k) = α/2 and P(X ≤ k) = α/2.
        #[test]
        fn ends_solve_their_equations() {
            for (k, n) in [(1, 10), (5, 10), (3, 120), (119, 120), (400, 2000)] {
                let (low, high) = clopper_pearson(k, n, 0.95).unwrap();
                let upper = 1.0 - Binomial::new(low, n).unwrap().cdf(k - 1);
                let lower = Binomial::new(high, n).unwrap().cdf(k);
                assert!((upper - 0.025).abs() < 1e-9, "{k} of {n}: {upper}");
                assert!((lower - 0.025).abs() < 1e-9, "{k} of {n}: {lower}");
            }
            assert_eq!(clopper_pearson(0, 0, 0.9), Some((0.0, 1.0)));
            let (low, high) = clopper_pearson(8, 8, 0.9).unwrap();
            assert!((low - 0.05_f64.powf(0.125)).abs() < 1e-9 && high == 1.0);
        }
    }

    mod samples {
        use super::super::*;

        #[test]
        fn known_correlations() {
            assert_eq!(correlation(&[(1.0, 2.0), (2.0, 4.0), (3.0, 6.0)]), 1.0);
            assert_eq!(correlation(&[(1.0, 2.0), (1.0, 4.0)]), 0.0);
        }
    }

    mod sizes {
        use super::super::*;

        /// Sizes whose squares overflow or vanish are as good as any.
        #[test]
        fn a_norm_has_the_unit_of_its_values() {
            for size in [1.0, 1e-160, 1e-300, 1e160, 1e300] {
                let norm = norm(&[3.0 * size, -4.0 * size]);
                assert!((norm / (5.0 * size) - 1.0).abs() < 1e-12, "{size:e}");
            }
            assert_eq!((norm(&[]), norm(&[0.0])), (0.0, 0.0));
            assert_eq!((unit(5.0), unit(0.3), unit(0.0)), (4.0, 0.25, 1.0));
        }
    }

    mod digits {
        use super::super::*;

        #[test]
        fn last_bits_go_and_nothing_else() {
            assert_eq!(six_digits(0.1 - 1e-17), 0.1);
            assert_eq!(six_digits(-1.234_567_89e9), -1.234_57e9);
            assert_eq!(six_digits(0.0016384), 0.0016384);
            assert_eq!(six_digits(f64::INFINITY), f64::INFINITY);
            assert!(six_digits(f64::NAN).is_nan());
        }
    }
}
