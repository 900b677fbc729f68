use super::MathError;
use std::ops::RangeInclusive;

use statrs::distribution::{Beta, Binomial, ContinuousCDF, DiscreteCDF};

/// The exact interval for a probability after `count` successes in `of` trials.
///
/// ```text
/// low  = B⁻¹(α/2;     k,     n − k + 1),   0 for k = 0
/// high = B⁻¹(1 − α/2; k + 1, n − k),       1 for k = n,      α = 1 − level
/// ```
///
/// with B⁻¹ the quantile of the beta distribution. It covers the true probability with at least `level`, usually more.
/// Both ends lie in [0, 1]. No trials give [0, 1].
///
/// # Errors
///
/// [`MathError`]: more successes than trials, or `level` outside (0, 1).
///
/// # Example
///
/// ```
/// use truetwin::math::clopper_pearson;
///
/// let (low, high) = clopper_pearson(0, 10, 0.95)?;
/// assert_eq!(low, 0.0);
/// assert!((high - 0.3085).abs() < 1e-4);
/// # Ok::<(), truetwin::math::MathError>(())
/// ```
///
/// # Reference
///
/// Clopper & Pearson, "The use of confidence or fiducial limits illustrated in the case of the binomial",
/// *Biometrika* 26, 1934.
pub fn clopper_pearson(count: u64, of: u64, level: f64) -> Result<(f64, f64), MathError> {
    if count > of {
        return Err(MathError::Count { count, of });
    }
    let tail = tail(level)?;
    let (k, n) = (count as f64, of as f64);
    let quantile = |a: f64, b: f64, p: f64| {
        Beta::new(a, b)
            .map(|beta| beta.inverse_cdf(p))
            .map_err(|_| MathError::Count { count, of })
    };
    let low = match count {
        0 => 0.0,
        _ => quantile(k, n - k + 1.0, tail)?,
    };
    let high = match of - count {
        0 => 1.0,
        _ => quantile(k + 1.0, n - k, 1.0 - tail)?,
    };
    Ok((low, high))
}

/// The counts that `trials` with success probability `probability` give with at least `level`: each tail outside has
/// at most (1 − level)/2.
///
/// For tests of rates: a count outside is evidence that the rate is another.
///
/// # Errors
///
/// [`MathError`]: `probability` outside [0, 1] or `level` outside (0, 1).
///
/// # Example
///
/// ```
/// use truetwin::math::binomial_bounds;
///
/// let false_alarms = 17;
/// assert!(binomial_bounds(200, 0.10, 0.999)?.contains(&false_alarms));
/// # Ok::<(), truetwin::math::MathError>(())
/// ```
pub fn binomial_bounds(
    trials: u64,
    probability: f64,
    level: f64,
) -> Result<RangeInclusive<u64>, MathError> {
    let tail = tail(level)?;
    let binomial =
        Binomial::new(probability, trials).map_err(|_| MathError::Probability(probability))?;
    // The quantile is the smallest k with P(X ≤ k) ≥ p, hence P(X < low) < tail and P(X > high) ≤ tail.
    Ok(binomial.inverse_cdf(tail)..=binomial.inverse_cdf(1.0 - tail))
}

/// Half of what lies outside of `level`.
fn tail(level: f64) -> Result<f64, MathError> {
    if level > 0.0 && level < 1.0 {
        Ok((1.0 - level) / 2.0)
    } else {
        Err(MathError::Level(level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::Discrete;

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
    }

    #[test]
    fn edges() {
        assert_eq!(clopper_pearson(0, 0, 0.9).unwrap(), (0.0, 1.0));
        let (low, high) = clopper_pearson(8, 8, 0.9).unwrap();
        assert!((low - 0.05_f64.powf(0.125)).abs() < 1e-9 && high == 1.0);
    }

    /// The exact coverage, summed over all outcomes, is never below the level.
    #[test]
    fn covers_at_least_the_level() {
        let n = 25;
        for p in [0.01, 0.1, 0.37, 0.5, 0.95] {
            let binomial = Binomial::new(p, n).unwrap();
            let covered: f64 = (0..=n)
                .filter(|&k| {
                    let (low, high) = clopper_pearson(k, n, 0.9).unwrap();
                    (low..=high).contains(&p)
                })
                .map(|k| binomial.pmf(k))
                .sum();
            assert!(covered >= 0.9, "{p}: {covered}");
        }
    }

    #[test]
    fn bounds_leave_at_most_the_tails_outside() {
        for (n, p, level) in [(200, 0.1, 0.999), (54, 0.05, 0.95), (1000, 0.5, 0.9)] {
            let bounds = binomial_bounds(n, p, level).unwrap();
            let binomial = Binomial::new(p, n).unwrap();
            let mass = |ks: &mut dyn Iterator<Item = u64>| ks.map(|k| binomial.pmf(k)).sum::<f64>();
            let tail = (1.0 - level) / 2.0;
            assert!(mass(&mut (0..*bounds.start())) <= tail);
            assert!(
                mass(&mut (0..=*bounds.start())) >= tail,
                "not wider than needed"
            );
            assert!(mass(&mut (bounds.end() + 1..=n)) <= tail);
            assert!(
                mass(&mut (*bounds.end()..=n)) >= tail,
                "not wider than needed"
            );
        }
        assert_eq!(binomial_bounds(20, 0.0, 0.99).unwrap(), 0..=0);
        assert_eq!(binomial_bounds(20, 1.0, 0.99).unwrap(), 20..=20);
    }

    #[test]
    fn bad_input_is_named() {
        let error = clopper_pearson(3, 2, 0.9).unwrap_err();
        assert!(matches!(error, MathError::Count { count: 3, of: 2 }));
        assert!(matches!(
            clopper_pearson(1, 2, 1.0),
            Err(MathError::Level(1.0))
        ));
        let error = binomial_bounds(3, f64::NAN, 0.9).unwrap_err();
        assert!(error.to_string().contains("probability = NaN"));
    }
}
