//! Log-likelihood of a record, row by row.

use crate::math::{Condition, Number};

/// log 2π.
pub(super) const LOG_TWO_PI: f64 = 1.837_877_066_409_345_3;

/// −½·Σ (p·log 2π + log det S_k + e_kᵀS_k⁻¹e_k), with a logarithm only where a product would leave the numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct LogLikelihood<N> {
    values: usize,
    squares: N,
    logs: N,
    product: N,
}

impl<N: Number> LogLikelihood<N> {
    /// Log-likelihood of no rows.
    #[inline(always)]
    pub fn none() -> Self {
        Self {
            values: 0,
            squares: N::ZERO,
            logs: N::ZERO,
            product: N::all(1.0),
        }
    }

    /// Adds a value whose variance given all before is `pivot`, and its squared distance in these units.
    #[inline(always)]
    pub fn add(&mut self, pivot: N, square: N) {
        self.values += 1;
        self.squares += square;
        let product = self.product * pivot;
        let inside = N::all(1e-250).below(product) & product.below(N::all(1e250));
        if (!inside).any() {
            self.logs += inside.select(N::ZERO, self.product.ln() + pivot.ln());
        }
        self.product = inside.select(product, N::all(1.0));
    }

    /// Adds nats.
    #[inline(always)]
    pub fn shift(&mut self, nats: N) {
        self.squares = self.squares - nats * 2.0;
    }

    /// Returns whether it is a number so far.
    #[inline(always)]
    pub fn is_finite(&self) -> N::Condition {
        self.squares.abs().below(N::all(f64::INFINITY))
    }

    /// The sum so far, in nats.
    #[inline(always)]
    pub fn total(&self) -> N {
        let logs = self.logs + self.product.ln();
        (N::all(self.values as f64 * LOG_TWO_PI) + logs + self.squares) * -0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_give_the_sum_of_logarithms() {
        let (mut all, mut expected) = (LogLikelihood::<f64>::none(), 0.0);
        for k in 0..2000 {
            let pivot = 10f64.powi(k % 37 * 8 - 150) * 1.7;
            all.add(pivot, 0.5);
            expected -= 0.5 * (LOG_TWO_PI + pivot.ln() + 0.5);
        }
        assert!((all.total() - expected).abs() < 1e-9);
    }
}
