//! What a measurement says about the state.

use super::gaussian::Gaussian;
use super::moments::{Seen, mirror, outer};
use crate::twin::{Now, StateSpace};

/// Nodes and weights of the Gauss–Hermite rule with five points, for a standard normal.
const NODES: [(f64, f64); 5] = [
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (1.355_626_179_974_265_8, 0.222_075_922_005_612_65),
    (-1.355_626_179_974_265_8, 0.222_075_922_005_612_65),
    (0.0, 8.0 / 15.0),
];

/// log 2π.
const LOG_TWO_PI: f64 = 1.837_877_066_409_345_3;

/// Innovation, gain and likelihood of one row; p outputs, n states.
///
/// ```text
/// S = Σ Y Yᵀ + R,   K = Σ X Yᵀ S⁻¹
/// m ← m + K·(y − ȳ)
/// P ← Σ (X − K·Y)(X − K·Y)ᵀ + K·R·Kᵀ
/// ```
///
/// The last form (Joseph's) is non-negative whatever the rounding, also where R is far below P.
pub(super) struct Update {
    /// Variance of the measurement noise and of what the readout hides, by output.
    noise: Vec<f64>,
    /// y − ȳ.
    pub innovation: Vec<f64>,
    /// S (p × p).
    pub covariance: Vec<f64>,
    /// C⁻¹·(y − ȳ), with S = C·Cᵀ.
    pub standardised: Vec<f64>,
    /// C, row-major, lower.
    factor: Vec<f64>,
    /// K (n × p).
    gain: Vec<f64>,
    /// Standard deviation of each output, and what its readout makes of the nodes.
    sd: Vec<f64>,
    read: [Vec<f64>; 5],
}

/// One row of a record, and how well it could be measured.
pub(super) struct Measured<'w> {
    /// The outputs.
    pub y: &'w [f64],
    /// ȳ, predicted without the readout.
    pub predicted: &'w [f64],
    /// Standard deviations of the measurement noise.
    pub noise: &'w [f64],
    /// Least variances.
    pub floor: &'w [f64],
}

impl Update {
    pub fn new(n: usize, p: usize) -> Self {
        Self {
            noise: vec![0.0; p],
            innovation: vec![0.0; p],
            covariance: vec![0.0; p * p],
            standardised: vec![0.0; p],
            factor: vec![0.0; p * p],
            gain: vec![0.0; n * p],
            sd: vec![0.0; p],
            read: std::array::from_fn(|_| vec![0.0; p]),
        }
    }

    /// Puts a row into the state and returns its log-density given the past; `None` where S has no inverse.
    #[inline(always)]
    pub fn apply(
        &mut self,
        (n, p): (usize, usize),
        (twin, now): (&dyn StateSpace, &Now<'_>),
        row: &Measured<'_>,
        seen: Seen<'_>,
        state: &mut Gaussian,
    ) -> Option<f64> {
        for j in 0..p {
            self.noise[j] = (row.noise[j] * row.noise[j]).max(row.floor[j]);
            self.innovation[j] = row.y[j] - row.predicted[j];
        }
        self.spread(p, seen.outputs);
        if self.readout(p, twin, now, row, seen.outputs) {
            self.spread(p, seen.outputs);
        }
        let log_determinant = self.factor(p)?;
        let mut square = 0.0;
        for i in 0..p {
            let row = &self.factor[i * p..=i * p + i];
            let mut rest = self.innovation[i];
            for (c, e) in row.iter().zip(&self.standardised[..i]) {
                rest -= c * e;
            }
            self.standardised[i] = rest / row[i];
            square += self.standardised[i] * self.standardised[i];
        }
        self.correct((n, p), seen, state);
        Some(-0.5 * (p as f64 * LOG_TWO_PI + log_determinant + square))
    }

    /// S.
    #[inline(always)]
    fn spread(&mut self, p: usize, outputs: &[f64]) {
        outer(outputs, p, &mut self.covariance);
        for j in 0..p {
            self.covariance[j * p + j] += self.noise[j];
        }
    }

    /// A sensor that bends its signal after the noise (saturation, quantisation) is replaced by the line that is best
    /// for N(ȳ, S); what the line misses joins the noise. The noise itself is never taken off: a saturated sensor
    /// says little, but not with certainty. Returns whether anything was bent.
    #[inline(always)]
    fn readout(
        &mut self,
        p: usize,
        twin: &dyn StateSpace,
        now: &Now<'_>,
        row: &Measured<'_>,
        outputs: &mut [f64],
    ) -> bool {
        let sd = &mut self.sd[..p];
        for (j, sd) in sd.iter_mut().enumerate() {
            *sd = self.covariance[j * p + j].sqrt();
        }
        let mut bent = false;
        // The outermost first: where they are not bent, nothing between them is.
        for (at, (read, (node, _))) in self.read.iter_mut().zip(NODES).enumerate() {
            if at == 2 && !bent {
                return false;
            }
            let at_node = |j: usize| row.predicted[j] + node * sd[j];
            let read = &mut read[..p];
            for (j, read) in read.iter_mut().enumerate() {
                *read = at_node(j);
            }
            twin.readout(now, read);
            bent |= (read.iter().enumerate()).any(|(j, read)| *read != at_node(j));
        }
        self.bend(row, outputs);
        true
    }

    #[cold]
    fn bend(&mut self, row: &Measured<'_>, outputs: &mut [f64]) {
        let p = row.y.len();
        for j in 0..p {
            let values = || self.read.iter().map(|read| read[j]).zip(NODES);
            let mean: f64 = values().map(|(v, (_, weight))| weight * v).sum();
            let slope: f64 = values().map(|(v, (node, weight))| weight * node * v).sum();
            let variance: f64 = values()
                .map(|(v, (_, weight))| weight * (v - mean).powi(2))
                .sum();
            let missed = (variance - slope * slope).max(0.0);
            let slope = slope / self.sd[j];
            self.noise[j] += missed;
            self.innovation[j] = row.y[j] - mean;
            for output in outputs.iter_mut().skip(j).step_by(p) {
                *output *= slope;
            }
        }
    }

    /// C, and log det S.
    #[inline(always)]
    fn factor(&mut self, p: usize) -> Option<f64> {
        let mut log_determinant = 0.0;
        for i in 0..p {
            for j in 0..=i {
                let mut entry = self.covariance[i * p + j];
                for k in 0..j {
                    entry -= self.factor[i * p + k] * self.factor[j * p + k];
                }
                if i == j {
                    if entry.is_nan() || entry <= 0.0 {
                        return None;
                    }
                    log_determinant += entry.ln();
                    self.factor[i * p + i] = entry.sqrt();
                } else {
                    self.factor[i * p + j] = entry / self.factor[j * p + j];
                }
            }
        }
        Some(log_determinant)
    }

    /// K, then mean and covariance.
    #[inline(always)]
    fn correct(&mut self, (n, p): (usize, usize), seen: Seen<'_>, state: &mut Gaussian) {
        let (gain, factor) = (&mut self.gain[..n * p], &self.factor[..p * p]);
        let (mean, cov) = (&mut state.mean[..n], &mut state.cov[..n * n]);
        let (noise, standardised) = (&self.noise[..p], &self.standardised[..p]);
        let Seen { states, outputs } = seen;
        gain.fill(0.0);
        for (x, y) in states.chunks_exact(n).zip(outputs.chunks_exact(p)) {
            for i in 0..n {
                for j in 0..p {
                    gain[i * p + j] += x[i] * y[j];
                }
            }
        }
        for (gain, mean) in gain.chunks_exact_mut(p).zip(mean) {
            for i in 0..p {
                for k in 0..i {
                    gain[i] -= factor[i * p + k] * gain[k];
                }
                gain[i] /= factor[i * p + i];
                *mean += gain[i] * standardised[i];
            }
            for i in (0..p).rev() {
                for k in i + 1..p {
                    gain[i] -= factor[k * p + i] * gain[k];
                }
                gain[i] /= factor[i * p + i];
            }
        }
        // What the gain does to the deviations takes their place; they are not needed again.
        for (x, y) in (states.chunks_exact_mut(n)).zip(outputs.chunks_exact(p)) {
            for i in 0..n {
                for j in 0..p {
                    x[i] -= gain[i * p + j] * y[j];
                }
            }
        }
        outer(states, n, cov);
        for i in 0..n {
            for j in 0..=i {
                for k in 0..p {
                    cov[i * n + j] += gain[i * p + k] * noise[k] * gain[j * p + k];
                }
            }
        }
        mirror(n, cov);
    }
}
