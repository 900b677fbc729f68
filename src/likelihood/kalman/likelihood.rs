//! Log-likelihood of a record, row by row.

/// log 2π.
pub(super) const LOG_TWO_PI: f64 = 1.837_877_066_409_345_3;

/// −½·Σ (p·log 2π + log det S_k + e_kᵀS_k⁻¹e_k), with a logarithm only where a product would leave the numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct LogLikelihood {
    values: usize,
    squares: f64,
    logs: f64,
    product: f64,
}

impl LogLikelihood {
    /// Log-likelihood of no rows.
    pub const NONE: Self = Self {
        values: 0,
        squares: 0.0,
        logs: 0.0,
        product: 1.0,
    };

    /// Adds a value whose variance given all before is `pivot`, and its squared distance in these units.
    #[inline(always)]
    pub fn add(&mut self, pivot: f64, square: f64) {
        self.values += 1;
        self.squares += square;
        let product = self.product * pivot;
        if (1e-250..1e250).contains(&product) {
            self.product = product;
        } else {
            self.logs += self.product.ln() + pivot.ln();
            self.product = 1.0;
        }
    }

    /// Adds nats.
    #[inline(always)]
    pub fn shift(&mut self, nats: f64) {
        self.squares -= 2.0 * nats;
    }

    /// Returns whether it is a number so far.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        self.squares.is_finite()
    }

    /// The sum so far, in nats.
    pub fn total(&self) -> f64 {
        -0.5 * (self.values as f64 * LOG_TWO_PI + (self.logs + self.product.ln()) + self.squares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_give_the_sum_of_logarithms() {
        let (mut all, mut expected) = (LogLikelihood::NONE, 0.0);
        for k in 0..2000 {
            let pivot = 10f64.powi(k % 37 * 8 - 150) * 1.7;
            all.add(pivot, 0.5);
            expected -= 0.5 * (LOG_TWO_PI + pivot.ln() + 0.5);
        }
        assert!((all.total() - expected).abs() < 1e-9);
    }
}
