//! A sparse law for a missing function: exploratory.
//!
//! The posterior of the function at points of its variable is a normal distribution. Each draw from it is regressed on all subsets of at
//! most two of a few terms; the subset of least BIC, weighted by the posterior's own precision, is what the draw speaks for. How
//! often a term is among them is its inclusion.

use super::functions::Curve;
use crate::diagnose::outcome::{Discovery, Term};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::math::{descending, quantile, solve_truncated};
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};

/// Draws of the function.
const DRAWS: usize = 200;

/// Name and function of a term.
type Candidate = (String, fn(f64) -> f64);

/// Terms of a law in one variable.
fn terms(x: &str) -> [Candidate; 7] {
    [
        ("1".to_owned(), |_| 1.0),
        (x.to_owned(), |x| x),
        (format!("{x}²"), |x| x * x),
        (format!("{x}³"), |x| x * x * x),
        (format!("|{x}|·{x}"), |x| x.abs() * x),
        (
            format!("sign {x}"),
            |x| if x == 0.0 { 0.0 } else { x.signum() },
        ),
        (format!("√|{x}|"), |x| x.abs().sqrt()),
    ]
}

/// Subsets of one or two terms.
fn subsets(count: usize) -> Vec<Vec<usize>> {
    let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| vec![a, b]));
    (0..count).map(|a| vec![a]).chain(pairs).collect()
}

/// The sparse law of a function; `None` where its values have no precision.
pub(in crate::diagnose) fn discover(
    (place, variable): (&str, &str),
    curve: &Curve,
    noise: Noise,
) -> Option<Discovery> {
    let n = curve.values.len();
    let largest = curve.covariance.diagonal().max();
    let spread = &curve.covariance + DMatrix::identity(n, n) * (1e-6 * largest).max(1e-300);
    let root = spread.cholesky()?.l();
    let all = terms(variable);
    let columns = DMatrix::from_fn(n, all.len(), |i, k| (all[k].1)(curve.values[i]));
    let whitened = root.solve_lower_triangular(&columns)?;
    let mut source = noise.source("law");
    let mut included: Vec<Vec<f64>> = vec![vec![]; all.len()];
    for _ in 0..DRAWS {
        let z = DVector::from_fn(n, |_, _| source.normal());
        let draw = root.solve_lower_triangular(&(&curve.mean + &root * z))?;
        let best = (subsets(all.len()).into_iter())
            .filter_map(|subset| {
                let columns = whitened.select_columns(&subset);
                let inner = columns.tr_mul(&columns).cholesky()?;
                let factors = inner.solve(&columns.tr_mul(&draw));
                let misfit = (&draw - columns * &factors).norm_squared();
                let price = subset.len() as f64 * (n as f64).ln();
                Some((misfit + price, subset, factors))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, subset, factors) = best?;
        for (a, k) in subset.into_iter().enumerate() {
            included[k].push(factors[a]);
        }
    }
    let mut found: Vec<(usize, Term)> = (included.iter().enumerate())
        .map(|(k, factors)| {
            let at = |p: f64| quantile(factors, p).unwrap_or(0.0);
            let term = Term {
                name: all[k].0.clone(),
                coefficient: at(0.5),
                interval: [at(0.05), at(0.95)],
                inclusion: factors.len() as f64 / DRAWS as f64,
            };
            (k, term)
        })
        .filter(|(_, term)| term.inclusion >= THRESHOLDS.rare_term)
        .collect();
    descending(&mut found, |a| a.1.inclusion);
    // What the two most frequent ones explain of the function itself.
    let subset: Vec<usize> = found.iter().take(2).map(|(k, _)| *k).collect();
    let chosen = columns.select_columns(&subset);
    let factors = solve_truncated(&chosen, &curve.mean, 1e-12).ok()?;
    let rest = &curve.mean - chosen * factors;
    let mean = curve.mean.mean();
    let whole = curve.mean.map(|v| v - mean).norm_squared().max(1e-300);
    Some(Discovery {
        equation: place.to_owned(),
        variable: variable.to_owned(),
        terms: found.into_iter().map(|(_, term)| term).collect(),
        explained: (1.0 - rest.norm_squared() / whole).clamp(0.0, 1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic law is found among the terms, with its factor.
    #[test]
    fn a_cubic_law_is_found() {
        let values: Vec<f64> = (0..33).map(|i| -2.0 + f64::from(i) / 8.0).collect();
        let mean = DVector::from_iterator(33, values.iter().map(|x| -0.3 * x * x * x));
        let covariance = DMatrix::from_fn(33, 33, |i, j| {
            0.01 * (-0.5 * ((values[i] - values[j]) / 0.5).powi(2)).exp()
        });
        let curve = Curve {
            values,
            mean,
            covariance,
        };
        let found = discover(("x2", "x1"), &curve, Noise::new(1, "t", 0)).unwrap();
        assert_eq!(found.terms[0].name, "x1³", "{found:?}");
        assert!((found.terms[0].coefficient + 0.3).abs() < 0.05 && found.explained > 0.99);
    }
}
