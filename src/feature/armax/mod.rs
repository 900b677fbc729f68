//! Coefficients of ARMAX models, and their estimate.

use super::regression::regress;
use super::{FeatureError, FeatureMap, FeatureRecipe, check_long, check_varies};
use crate::math::{Lagged, LaggedSignals, LeastSquares, MathError, Regressors};
use crate::record::{Drive, Signal};
use crate::twin::Twin;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

numbers! {
    /// Refinements of a fit, and what they may do.
    const ARMAX: ArmaxLimits = {
        /// Refinements after the two regressions: where noise prevails these start far off, and three are too few.
        passes: usize = 6,
        /// Ridge of a refinement, relative to the unit diagonal: what the data do not tell apart (zeros of A and of C that nearly
        /// cancel) stays near the value that the regressions gave it.
        ridge: f64 = 1e-4,
        /// Halvings of a refinement that would not make the residuals smaller, after which it is left out.
        halvings: usize = 4,
        /// Largest modulus of a zero of C: residuals forget their start within some hundred samples.
        largest_zero: f64 = 0.98,
        /// Innovations below this share of the output, as standard deviations, are rounding.
        rounding: f64 = 1e-9,
    }
}

/// ARMAX(p, q, r): a model of each output with coloured noise,
///
/// ```text
/// y(t) = Σᵢ aᵢ·y(t − i) + Σⱼ Σᵢ bⱼᵢ·uⱼ(t − i) + e(t) + Σᵢ cᵢ·e(t − i);
/// features a₁ … a_p, b₁₁ … b₁_q, b₂₁ …, c₁ … c_r, log std e,   output after output
/// ```
///
/// For twins whose noise is coloured: sensor noise on top of a noisy state is enough, and AR or ARX coefficients then need
/// many lags to say what few say here. p, r ≥ 1; with q = 0, as for twins without inputs, the model is ARMA(p, r).
/// a and c have no unit, b those of y/u, log std e that of log y: it is the only feature here that sees how strong the
/// noise is. No decision depends on the data, so features are smooth in them, but for zeros of A and C that
/// nearly cancel; choose orders as low as the system's.
///
/// Estimated by Hannan and Rissanen's regressions (a long ARX model, whose residuals are then regressors) and six
/// Gauss–Newton refinements on regressors filtered by 1/C, in the manner of Kavalieris; zeros of C are held within 0.98.
/// A record of 300 to 400 samples takes 0.1 to 0.3 ms, many times as long as ARX of these orders.
///
/// File: `{ kind = "armax", outputs = 2, inputs = 2, noise = 2 }`.
///
/// Source: Hannan & Rissanen, "Recursive estimation of mixed autoregressive-moving average order", *Biometrika* 69, 1982;
/// Hannan & Kavalieris, "A method for autoregressive-moving average estimation", *Biometrika* 71, 1984; Ljung, *System
/// Identification*, 2nd ed., chapter 10.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Armax {
    /// p ≥ 1: lags of each output.
    pub outputs: usize,
    /// q ≥ 0: lags of each input; none unless given.
    #[serde(default)]
    pub inputs: usize,
    /// r ≥ 1: lags of the noise.
    pub noise: usize,
}

#[typetag::serde(name = "armax")]
impl FeatureRecipe for Armax {
    fn bind(&self, twin: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        let refuse = |problem| Err(FeatureError::setting("armax", problem));
        let Self {
            outputs: p,
            inputs: q,
            noise: r,
        } = *self;
        if p == 0 || r == 0 {
            return refuse(format!(
                "outputs = {p}, noise = {r}; both orders are at least 1, without noise take kind = \"arx\" or \"ar\""
            ));
        }
        let signals = twin.signals();
        if q > 0 && signals.inputs.is_empty() {
            return refuse(format!(
                "inputs = {q}, but the twin has no input; take inputs = 0"
            ));
        }
        let inputs = if q > 0 { signals.inputs.len() } else { 0 };
        Ok(Arc::new(ArmaxMap {
            orders: Orders { p, q, r, inputs },
            outputs: signals.outputs.len(),
        }))
    }
}

struct ArmaxMap {
    orders: Orders,
    outputs: usize,
}

impl FeatureMap for ArmaxMap {
    fn dim(&self) -> usize {
        self.outputs * (self.orders.coefficients() + 1)
    }

    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        check_long(outputs.nrows(), self.orders.needed())?;
        check_varies(outputs)?;
        let inputs: Vec<Vec<f64>> = (drive.inputs().columns().into_iter())
            .take(self.orders.inputs)
            .map(|u| u.to_vec())
            .collect();
        let mut features = Vec::with_capacity(self.dim());
        for y in outputs.columns() {
            let ArmaxModel {
                coefficients,
                innovation,
            } = estimate(&y.to_vec(), &inputs, self.orders)?;
            features.extend(coefficients);
            features.push(innovation.ln());
        }
        Ok(features)
    }
}

/// Orders of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Orders {
    /// Lags of the output.
    p: usize,
    /// Lags of each input.
    q: usize,
    /// Lags of the noise.
    r: usize,
    /// Inputs that enter; none where q = 0.
    inputs: usize,
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
struct ArmaxModel {
    coefficients: Vec<f64>,
    innovation: f64,
}

/// Estimates the model of `y` with `inputs`, of [`Orders::needed`] samples at least.
fn estimate(y: &[f64], inputs: &[Vec<f64>], orders: Orders) -> Result<ArmaxModel, MathError> {
    let series = ArmaxSeries::new(y, inputs, orders);
    let mut theta = series.by_regressions()?;
    let mut residuals = series.residuals(&theta);
    for _ in 0..ARMAX.passes {
        let step = series.newton_step(&theta, &residuals)?;
        for halving in 0..=ARMAX.halvings {
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
    let floor = ARMAX.rounding * (sum_of_squares(y) / y.len() as f64).sqrt();
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
        innovations.extend(fit.residual);
        let mut signals = lagged(self.y, p, self.inputs, q);
        signals.push(Lagged::new(innovations, r));
        let mut theta = regress(signals, long + r)?.coefficients;
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
        let fit = LeastSquares::with_ridge(&psi, &gram, ARMAX.ridge)?.solve(&residuals[start..])?;
        Ok(fit.coefficients)
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

/// Draws the zeros of 1 + Σ cᵢ z⁻ⁱ towards the origin, all by one factor, until none is larger than
/// `ARMAX.largest_zero`: continuous in c, and C is left alone where it is invertible already.
fn make_invertible(c: &mut [f64]) {
    let scaled = |s: f64| -> Vec<f64> { scale_zeros(c, s) };
    let within = |s: f64| is_invertible(scaled(s / ARMAX.largest_zero));
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
mod tests;
