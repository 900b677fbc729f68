//! The estimate of an ARMAX model of one output.

use crate::feature::regression::regress;
use crate::math::{Lagged, LaggedSignals, LeastSquares, MathError, Regressors, one_column};
use nalgebra::DMatrix;

/// Refinements after the two regressions: where noise prevails these start far off, and three are too few.
const PASSES: usize = 6;
/// Ridge of a refinement, relative to the unit diagonal: what the data do not tell apart (zeros of A and of C that nearly
/// cancel) stays near the value that the regressions gave it.
const RIDGE: f64 = 1e-4;
/// Halvings of a refinement that would not make the residuals smaller, after which it is left out.
const HALVINGS: usize = 4;
/// Largest modulus of a zero of C: residuals forget their start within some hundred samples.
const LARGEST_ZERO: f64 = 0.98;
/// Innovations below this share of the output, as standard deviations, are rounding.
const ROUNDING: f64 = 1e-9;

/// Orders of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Orders {
    /// Lags of the output.
    pub p: usize,
    /// Lags of each input.
    pub q: usize,
    /// Lags of the noise.
    pub r: usize,
    /// Inputs that enter; none where q = 0.
    pub inputs: usize,
}

impl Orders {
    /// p + q·inputs + r.
    pub fn coefficients(self) -> usize {
        self.p + self.q * self.inputs + self.r
    }

    /// Shortest record: two equations for each unknown of either regression.
    pub fn needed(self) -> usize {
        let long = self.shortest_long();
        (long + 2 * long * (1 + self.inputs)).max(long + self.r + 2 * self.coefficients())
    }

    fn shortest_long(self) -> usize {
        self.p.max(self.q) + self.r
    }

    /// Lags of the long regression; depends on nothing but the length, so that no decision jumps with the data.
    fn long(self, samples: usize) -> usize {
        (self.shortest_long() + samples.isqrt())
            .min(samples / (3 + 2 * self.inputs))
            .min(samples - self.r - 2 * self.coefficients())
    }

    /// First sample that the model explains.
    fn start(self) -> usize {
        self.p.max(self.q)
    }
}

/// An ARMAX model: a₁ … a_p, b₁₁ … , c₁ … c_r, and the standard deviation of its innovations.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ArmaxModel {
    pub coefficients: Vec<f64>,
    pub innovation: f64,
}

/// Estimates the model of `y` with `inputs`, of [`Orders::needed`] samples at least.
pub(super) fn estimate(
    y: &[f64],
    inputs: &[Vec<f64>],
    orders: Orders,
) -> Result<ArmaxModel, MathError> {
    let series = ArmaxSeries::new(y, inputs, orders);
    let mut theta = series.by_regressions()?;
    let mut residuals = series.residuals(&theta);
    for _ in 0..PASSES {
        let step = series.newton_step(&theta, &residuals)?;
        for halving in 0..=HALVINGS {
            let share = 0.5f64.powi(halving as i32);
            let mut next: Vec<f64> = (theta.iter().zip(&step))
                .map(|(theta, step)| theta + share * step)
                .collect();
            make_invertible(&mut next[orders.coefficients() - orders.r..]);
            let after = series.residuals(&next);
            if sum_of_squares(&after) <= sum_of_squares(&residuals) {
                (theta, residuals) = (next, after);
                break;
            }
        }
    }
    let rows = (y.len() - orders.start()) as f64;
    let floor = ROUNDING * (sum_of_squares(y) / y.len() as f64).sqrt();
    Ok(ArmaxModel {
        coefficients: theta,
        innovation: (sum_of_squares(&residuals) / rows).sqrt().max(floor),
    })
}

/// Signals that a model is fitted to.
struct ArmaxSeries<'a> {
    y: &'a [f64],
    inputs: &'a [Vec<f64>],
    orders: Orders,
    /// Lags of outputs and inputs, as they enter the model.
    past: LaggedSignals,
}

impl<'a> ArmaxSeries<'a> {
    fn new(y: &'a [f64], inputs: &'a [Vec<f64>], orders: Orders) -> Self {
        let past = LaggedSignals::new(lagged(y, orders.p, inputs, orders.q), orders.start());
        Self {
            y,
            inputs,
            orders,
            past,
        }
    }

    /// A long ARX model; then its residuals stand for the innovations in the regression of the ARMAX model.
    fn by_regressions(&self) -> Result<Vec<f64>, MathError> {
        let Orders { p, q, r, .. } = self.orders;
        let long = self.orders.long(self.y.len());
        let fit = regress(lagged(self.y, long, self.inputs, long), long)?;
        let mut innovations = vec![0.0; long];
        innovations.extend(fit.residual.iter());
        let mut signals = lagged(self.y, p, self.inputs, q);
        signals.push(Lagged::new(innovations, r));
        let fit = regress(signals, long + r)?;
        let mut theta = fit.coefficients.as_slice().to_vec();
        make_invertible(&mut theta[self.orders.coefficients() - r..]);
        Ok(theta)
    }

    /// The innovations that the model leaves, zero before its start.
    fn residuals(&self, theta: &[f64]) -> Vec<f64> {
        let (start, r) = (self.orders.start(), self.orders.r);
        let (ab, c) = theta.split_at(theta.len() - r);
        let mut residuals = vec![0.0; self.y.len()];
        let (_, rest) = residuals.split_at_mut(start);
        self.past.times(ab, rest);
        for t in start..self.y.len() {
            let noise = c.iter().zip(residuals[..t].iter().rev());
            let noise: f64 = noise.map(|(c, e)| c * e).sum();
            residuals[t] = self.y[t] - residuals[t] - noise;
        }
        residuals
    }

    /// Regression of the residuals on their gradient: regressors filtered by 1/C.
    fn newton_step(&self, theta: &[f64], residuals: &[f64]) -> Result<Vec<f64>, MathError> {
        let Orders { p, q, r, .. } = self.orders;
        let (c, n) = (&theta[theta.len() - r..], theta.len());
        let start = self.orders.start();
        let rows = self.y.len() - start;
        let inputs = self.inputs.iter().map(|u| (u.as_slice(), q));
        let signals = [(self.y, p)].into_iter().chain(inputs);
        let lagged: Vec<(&[f64], usize)> = (signals.chain([(residuals, r)]))
            .flat_map(|(x, lags)| (1..=lags).map(move |lag| (x, lag)))
            .collect();
        // A column a sample, so that all regressors pass the filter together.
        let mut psi = DMatrix::zeros(n, rows);
        for t in 0..rows {
            let (past, rest) = psi.as_mut_slice().split_at_mut(t * n);
            let here = &mut rest[..n];
            for (here, (x, lag)) in here.iter_mut().zip(&lagged) {
                *here = (start + t).checked_sub(*lag).map_or(0.0, |k| x[k]);
            }
            for (c, past) in c.iter().zip(past.rchunks_exact(n)) {
                for (here, past) in here.iter_mut().zip(past) {
                    *here -= c * past;
                }
            }
        }
        let (gram, psi) = (&psi * psi.transpose(), psi.transpose());
        let target = one_column(&residuals[start..]);
        let fit = LeastSquares::with_ridge(&psi, &gram, RIDGE)?.solve(&target)?;
        Ok(fit.coefficients.as_slice().to_vec())
    }
}

/// The output with p lags, each input with q.
fn lagged(y: &[f64], p: usize, inputs: &[Vec<f64>], q: usize) -> Vec<Lagged> {
    let inputs = inputs.iter().map(|u| Lagged::new(u.clone(), q));
    [Lagged::new(y.to_vec(), p)]
        .into_iter()
        .chain(inputs)
        .collect()
}

fn sum_of_squares(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum()
}

/// Draws the zeros of 1 + Σ cᵢ z⁻ⁱ towards the origin, all by one factor, until none is larger than [`LARGEST_ZERO`]:
/// continuous in c, and C is left alone where it is invertible already.
fn make_invertible(c: &mut [f64]) {
    let scaled = |s: f64| -> Vec<f64> { scale_zeros(c, s) };
    let within = |s: f64| is_invertible(scaled(s / LARGEST_ZERO));
    if within(1.0) {
        return;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if within(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    let found = scaled(low);
    c.copy_from_slice(&found);
}

/// Coefficients of the polynomial whose zeros are s times as large.
fn scale_zeros(c: &[f64], s: f64) -> Vec<f64> {
    (c.iter().zip(1..)).map(|(c, i)| c * s.powi(i)).collect()
}

/// Returns whether all zeros of 1 + Σ cᵢ z⁻ⁱ lie inside the unit circle: the Schur–Cohn test by stepping down.
fn is_invertible(mut c: Vec<f64>) -> bool {
    while let Some(k) = c.pop() {
        if k.is_nan() || k.abs() >= 1.0 {
            return false;
        }
        let n = c.len();
        c = (0..n)
            .map(|i| (c[i] - k * c[n - 1 - i]) / (1.0 - k * k))
            .collect();
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    const A: [f64; 2] = [1.5, -0.7];
    const B: [f64; 2] = [1.0, 0.5];
    const C: [f64; 2] = [0.6, 0.3];

    /// An ARMAX(2, 2, 2) record: output and input.
    fn record(samples: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let noise = Noise::new(seed, "armax", 0);
        let (mut input, mut innovation) = (noise.source("u"), noise.source("e"));
        let mut draw = |n: usize| -> Vec<f64> { (0..n).map(|_| input.normal()).collect() };
        let u = draw(samples);
        let e: Vec<f64> = (0..samples).map(|_| 0.5 * innovation.normal()).collect();
        let mut y = vec![0.0; samples];
        for t in 2..samples {
            let sum = |l: [f64; 2], x: &[f64]| l[0] * x[t - 1] + l[1] * x[t - 2];
            y[t] = sum(A, &y) + sum(B, &u) + e[t] + sum(C, &e);
        }
        (y, u)
    }

    fn orders(r: usize) -> Orders {
        let (p, q, inputs) = (2, 2, 1);
        Orders { p, q, r, inputs }
    }

    /// Mean over records within four of its standard errors of the truth, up to the bias of order 1/N; that of ARX of
    /// the same orders is not.
    #[test]
    fn coefficients_are_those_of_the_process_and_arx_is_biased() {
        let (records, truth) = (60u32, [A, B, C].concat());
        let found: Vec<_> = (0..records)
            .map(|seed| {
                let (y, u) = record(1000, seed.into());
                let model = estimate(&y, std::slice::from_ref(&u), orders(2)).unwrap();
                let arx = regress(lagged(&y, 2, &[u], 2), 2).unwrap().coefficients;
                (model, arx)
            })
            .collect();
        let n = f64::from(records);
        for (i, truth) in truth.into_iter().enumerate() {
            let of = |model: &ArmaxModel| model.coefficients[i] - truth;
            let mean = found.iter().map(|(m, _)| of(m)).sum::<f64>() / n;
            let variance = found
                .iter()
                .map(|(m, _)| (of(m) - mean).powi(2))
                .sum::<f64>()
                / n;
            let error = (variance / n).sqrt();
            assert!(mean.abs() < 4.0 * error + 3e-3, "{i}: {mean} of {error}");
            if i < 4 {
                let bias = found.iter().map(|(_, arx)| arx[i] - truth).sum::<f64>() / n;
                // u(t − 1) is independent of all other regressors: b₁ has no bias.
                assert!(
                    i == 2 || bias.abs() > 10.0 * error,
                    "{i}: {bias} of {error}"
                );
            }
        }
        let innovation = found.iter().map(|(m, _)| m.innovation).sum::<f64>() / n;
        assert!((innovation / 0.5 - 1.0).abs() < 0.01, "{innovation}");
    }

    /// A refined estimate varies less than that of the two regressions.
    #[test]
    fn refinement_pays() {
        let (mut before, mut after) = (0.0, 0.0);
        for seed in 0..60 {
            let (y, u) = record(300, seed);
            let inputs = [u];
            let series = ArmaxSeries::new(&y, &inputs, orders(2));
            let error = |c: &[f64]| (c[4] - C[0]).powi(2) + (c[5] - C[1]).powi(2);
            before += error(&series.by_regressions().unwrap());
            after += error(&estimate(&y, &inputs, orders(2)).unwrap().coefficients);
        }
        assert!(after < 0.8 * before, "{after} after {before}");
    }

    #[test]
    fn zeros_are_drawn_inside_and_no_further() {
        assert!(is_invertible(vec![0.9]) && !is_invertible(vec![-1.0]));
        // Zeros 0.5 and 2.
        assert!(!is_invertible(vec![-2.5, 1.0]) && !is_invertible(vec![f64::NAN]));
        let mut c = [-2.5, 1.0];
        make_invertible(&mut c);
        let value = |z: f64| z * z + c[0] * z + c[1];
        assert!(value(LARGEST_ZERO).abs() < 1e-9 && value(0.25 * LARGEST_ZERO).abs() < 1e-9);
        let mut inside = [-0.9, 0.2];
        make_invertible(&mut inside);
        assert_eq!(inside, [-0.9, 0.2]);
    }
}
