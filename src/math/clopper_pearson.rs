use statrs::distribution::{Beta, ContinuousCDF};

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
    use super::*;
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
