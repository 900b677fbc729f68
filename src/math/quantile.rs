use super::MathError;

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

#[cfg(test)]
mod tests {
    use super::*;
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
