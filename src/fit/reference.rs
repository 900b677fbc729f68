//! Gain of an explanation to second order, with θ free to answer.
//!
//! With innovations e and their covariances S = C·Cᵀ at θ̂, stack for each row
//!
//! ```text
//! r = [C⁻¹e ; (v² − 1)/√2]                 v = C⁻¹e
//! d = [−C⁻¹Δe ; diag(C⁻¹ΔS C⁻ᵀ)/√2]         Δ: what the effect, or a step in θ, changes
//! ```
//!
//! r·d is then the score and d·d the Fisher information of Gaussian innovations. With the directions D of θ projected out,
//! gain = ½·(r·d⊥)²/(d⊥·d⊥), in nats. Δ is a secant to a point of a dictionary, so thresholds have one too.

use crate::fit::budget::BUDGET;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::{FilterError, Filtered, recoverable};
use crate::math::nearest;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Innovations at θ̂, ready to be compared with.
pub(crate) struct Reference {
    pub filtered: Vec<Filtered>,
    /// Inverse roots of the covariances, row-major lower, one after the other.
    roots: Vec<f64>,
    channels: usize,
    r: DVector<f64>,
    /// Directions of θ.
    directions: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Dᵀr, solved.
    answer: DVector<f64>,
}

/// Gain at one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Gain {
    /// Nats.
    pub nats: f64,
    /// Best multiple of the secant.
    pub alpha: f64,
}

impl Reference {
    /// Filters at θ, which is as free as the weak priors leave it; `None` where the filter does not work there.
    pub fn new(problem: &Problem, theta: &[f64]) -> Result<Option<Self>, FilterError> {
        Self::knowing(problem, theta, &weak(problem))
    }

    /// Filters at θ, about which the information `known` (in φ) exists already.
    pub fn knowing(
        problem: &Problem,
        theta: &[f64],
        known: &DMatrix<f64>,
    ) -> Result<Option<Self>, FilterError> {
        let Some(filtered) = recoverable(problem.filtered(theta))? else {
            return Ok(None);
        };
        let mut reference = Self::bare(filtered);
        let neighbours = problem.neighbours(theta);
        let d = neighbours.len();
        let mut directions = DMatrix::zeros(reference.r.len(), d);
        for (j, (moved, distance)) in neighbours.into_iter().enumerate() {
            // What is held answers nothing.
            if problem.axes[j].held {
                continue;
            }
            let Some(there) = recoverable(problem.filtered(&moved))? else {
                return Ok(None);
            };
            directions.set_column(j, &(reference.direction(&there) / distance));
        }
        let mut gram = directions.tr_mul(&directions);
        for j in 0..d {
            gram[(j, j)] *= 1.0 + 1e-12;
        }
        gram += known;
        let Some(factor) = gram.cholesky() else {
            return Ok(None);
        };
        reference.answer = factor.solve(&directions.tr_mul(&reference.r));
        (reference.factor, reference.directions) = (factor, directions);
        Ok(Some(reference))
    }

    /// Innovations alone, to take directions from; θ is not projected out.
    pub fn bare(filtered: Vec<Filtered>) -> Self {
        let channels = filtered.first().map_or(1, |f| f.innovations.ncols());
        let roots = (filtered.iter())
            .flat_map(|f| (0..f.innovations.nrows()).flat_map(|k| inverse_root(f, k)))
            .collect();
        let residual: Vec<f64> = (filtered.iter())
            .flat_map(|f| f.standardised.iter())
            .flat_map(|v| [*v, (v * v - 1.0) * std::f64::consts::FRAC_1_SQRT_2])
            .collect();
        let r = DVector::from_vec(residual);
        Self {
            filtered,
            roots,
            channels,
            directions: DMatrix::zeros(r.len(), 0),
            r,
            factor: DMatrix::identity(0, 0)
                .cholesky()
                .expect("the identity is positive definite"),
            answer: DVector::zeros(0),
        }
    }

    /// r: standardised innovations and their squares.
    pub fn residual(&self) -> &DVector<f64> {
        &self.r
    }

    /// Number of outputs.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Entry (i, j ≤ i) of the inverse root C⁻¹ of a row.
    pub fn inverse_root(&self, row: usize, i: usize, j: usize) -> f64 {
        let p = self.channels;
        self.roots[(row * p + i) * p + j]
    }

    /// Directions of θ and r, without the rows of variances.
    pub fn of_means(&self) -> (DMatrix<f64>, DVector<f64>) {
        let (rows, d) = self.directions.shape();
        let directions = DMatrix::from_fn(rows / 2, d, |k, j| self.directions[(2 * k, j)]);
        (directions, DVector::from_fn(rows / 2, |k, _| self.r[2 * k]))
    }

    /// Step of θ that its own directions ask for, in φ.
    pub fn step(&self) -> &DVector<f64> {
        &self.answer
    }

    /// Steps of θ that answer directions whose products with its own are given.
    pub fn solved(&self, products: &DMatrix<f64>) -> DMatrix<f64> {
        self.factor.solve(products)
    }

    /// Answer of θ to so many multiples of a direction: a step in φ.
    pub fn answer(&self, direction: &DVector<f64>, alpha: f64) -> DVector<f64> {
        &self.answer - self.factor.solve(&self.directions.tr_mul(direction)) * alpha
    }

    /// Direction of an entry of θ.
    pub fn column(&self, j: usize) -> nalgebra::DVectorView<'_, f64> {
        self.directions.column(j)
    }

    /// d from the innovations elsewhere.
    pub fn direction(&self, there: &[Filtered]) -> DVector<f64> {
        let p = self.channels;
        let mut direction = DVector::zeros(self.r.len());
        let mut row = 0;
        for (here, there) in self.filtered.iter().zip(there) {
            for k in 0..here.innovations.nrows() {
                let root = &self.roots[row * p * p..(row + 1) * p * p];
                for i in 0..p {
                    let mut shift = 0.0;
                    let mut spread = 0.0;
                    for a in 0..=i {
                        let c = root[i * p + a];
                        shift += c * (there.innovations[[k, a]] - here.innovations[[k, a]]);
                        for b in 0..=i {
                            let change = there.covariances[[k, a, b]] - here.covariances[[k, a, b]];
                            spread += c * root[i * p + b] * change;
                        }
                    }
                    let at = 2 * (row * p + i);
                    direction[at] = -shift;
                    direction[at + 1] = spread * std::f64::consts::FRAC_1_SQRT_2;
                }
                row += 1;
            }
        }
        direction
    }

    /// d⊥·d⊥: what θ cannot imitate of a direction; 0 where it imitates it all.
    pub fn own(&self, direction: &DVector<f64>) -> f64 {
        let square = direction.norm_squared();
        let with_theta = self.directions.tr_mul(direction);
        let own = square - with_theta.dot(&self.factor.solve(&with_theta));
        if own > BUDGET.collinear * square && own.is_finite() {
            own
        } else {
            0.0
        }
    }

    /// The gain along a direction whose multiple must lie in `low..=high`.
    pub fn gain(&self, direction: &DVector<f64>, (low, high): (f64, f64)) -> Gain {
        let own = self.own(direction);
        if own == 0.0 {
            return Gain::default();
        }
        let with_theta = self.directions.tr_mul(direction);
        let score = self.r.dot(direction) - with_theta.dot(&self.answer);
        let alpha = nearest(score / own, low, high);
        Gain {
            nats: (alpha * score - 0.5 * alpha * alpha * own).max(0.0),
            alpha,
        }
    }
}

/// Information of the weak priors about θ, in φ.
pub(crate) fn weak(problem: &Problem) -> DMatrix<f64> {
    let precisions = problem.prior_terms().map(|(_, precision)| precision);
    DMatrix::from_diagonal(&DVector::from_iterator(problem.dimension(), precisions))
}

/// C⁻¹ of row k, from S = C·Cᵀ: row-major, lower.
fn inverse_root(f: &Filtered, k: usize) -> Vec<f64> {
    let p = f.innovations.ncols();
    if p == 1 {
        return vec![f.covariances[[k, 0, 0]].sqrt().recip()];
    }
    let s = DMatrix::from_fn(p, p, |i, j| f.covariances[[k, i, j]]);
    let inverse = s
        .cholesky()
        .and_then(|c| c.l().try_inverse())
        .unwrap_or_else(|| DMatrix::identity(p, p));
    inverse.transpose().as_slice().to_vec()
}
