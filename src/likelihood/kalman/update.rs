//! Measurement update of the state.

use super::gaussian::Columns;
use super::likelihood::LogLikelihood;
use super::moments::{add_outer, outer};
use super::normal::cell::Cell;
use super::size::{Numbers, Size};
use crate::twin::{Now, Outliers, StateSpace};

/// Nodes and weights of the Gauss–Hermite rule with five points, for a standard normal.
const NODES: [(f64, f64); 5] = [
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (1.355_626_179_974_265_8, 0.222_075_922_005_612_65),
    (-1.355_626_179_974_265_8, 0.222_075_922_005_612_65),
    (0.0, 8.0 / 15.0),
];

/// Innovation, gain and likelihood of one row; p outputs, n states.
///
/// ```text
/// S = Σ Y Yᵀ + Σ Z Zᵀ + R,   K = Σ X Yᵀ S⁻¹               X, Y: slopes of states and outputs, Z: bends of outputs
/// m ← m + K·(y − ȳ)
/// P ← Σ (X − K·Y)(X − K·Y)ᵀ + K·(Σ Z Zᵀ + R)·Kᵀ
/// ```
///
/// The last form (Joseph's) is non-negative whatever the rounding, also where R is far below P.
pub(super) struct Update<S: Size> {
    size: S,
    /// Variance of the measurement noise and of what the readout hides, by output.
    noise: S::Vector,
    /// Σ Z Zᵀ + R (p × p).
    beside: S::Matrix,
    /// y − ȳ.
    pub innovation: S::Vector,
    /// S (p × p).
    pub covariance: S::Matrix,
    /// C⁻¹·(y − ȳ), with S = C·Cᵀ.
    pub standardised: S::Vector,
    /// Squares of C's diagonal: variance of each output given those before it.
    pub pivots: S::Vector,
    /// Nats by which the density of the row exceeds that of N(ȳ, S): outliers make it a mixture, rounding the mean over a cell.
    pub excess: f64,
    /// C, row-major, lower.
    factor: S::Matrix,
    /// K (n × p).
    gain: S::Matrix,
    /// X − K·Y.
    rest: S::Matrix,
    /// Readout of the nodes of each output (5 × p), and of the row itself.
    read: S::Points,
    again: S::Vector,
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
    /// Steps by output; empty for none.
    pub rounding: &'w [f64],
    /// By output; empty for none.
    pub outliers: &'w [Outliers],
}

impl<S: Size> Update<S> {
    pub fn new(size: S) -> Self {
        let (n, p) = (size.states(), size.outputs());
        Self {
            size,
            noise: S::Vector::zeros(p),
            beside: S::Matrix::zeros(p * p),
            innovation: S::Vector::zeros(p),
            covariance: S::Matrix::zeros(p * p),
            standardised: S::Vector::zeros(p),
            pivots: S::Vector::zeros(p),
            excess: 0.0,
            factor: S::Matrix::zeros(p * p),
            gain: S::Matrix::zeros(n * p),
            rest: S::Matrix::zeros(n * n),
            read: S::Points::zeros(NODES.len() * p),
            again: S::Vector::zeros(p),
        }
    }

    /// Puts a row into the state and its density into `likelihood`; `None` where S has no inverse or is not finite.
    #[inline(always)]
    pub fn apply(
        &mut self,
        (twin, now): (&dyn StateSpace, &Now<'_>),
        row: &Measured<'_>,
        root: Columns<'_>,
        outputs: &mut [f64],
        (mean, cov): (&mut [f64], &mut [f64]),
        likelihood: &mut LogLikelihood,
    ) -> Option<()> {
        let p = self.size.outputs();
        let (noise, innovation) = (self.noise.as_mut(), self.innovation.as_mut());
        for j in 0..p {
            noise[j] = (row.noise[j] * row.noise[j]).max(row.floor[j]);
            innovation[j] = row.y[j] - row.predicted[j];
        }
        self.spread(outputs);
        if self.reads(twin, now, row) {
            self.bend((twin, now), row, outputs);
            self.spread(outputs);
        }
        if !(row.rounding.is_empty() && row.outliers.is_empty()) {
            self.finished(row.rounding, row.outliers, |_| true);
            likelihood.shift(self.excess);
        }
        self.standardise(likelihood, |_| true)?;
        self.correct(root, outputs, (mean, cov));
        Some(())
    }

    /// As [`apply`](Self::apply), for a row with missing outputs. To the others they are outputs of unit noise that follow no
    /// state and were measured as predicted; in the likelihood they have no part.
    #[cold]
    pub fn apply_present(
        &mut self,
        (twin, now): (&dyn StateSpace, &Now<'_>),
        row: &Measured<'_>,
        root: Columns<'_>,
        outputs: &mut [f64],
        (mean, cov): (&mut [f64], &mut [f64]),
        likelihood: &mut LogLikelihood,
    ) -> Option<()> {
        let p = self.size.outputs();
        let missing = |j: usize| row.y[j].is_nan();
        // A sensor's readout may look at all outputs.
        let filled: Vec<f64> = (row.y.iter().zip(row.predicted))
            .map(|(y, predicted)| if y.is_nan() { *predicted } else { *y })
            .collect();
        let filled = Measured { y: &filled, ..*row };
        for j in 0..p {
            self.noise.as_mut()[j] = (row.noise[j] * row.noise[j]).max(row.floor[j]);
            self.innovation.as_mut()[j] = filled.y[j] - row.predicted[j];
        }
        self.spread(outputs);
        if self.reads(twin, now, &filled) {
            self.bend((twin, now), &filled, outputs);
        }
        for j in (0..p).filter(|&j| missing(j)) {
            (self.noise.as_mut()[j], self.innovation.as_mut()[j]) = (1.0, 0.0);
            outputs.iter_mut().skip(j).step_by(p).for_each(|y| *y = 0.0);
        }
        self.spread(outputs);
        self.finished(row.rounding, row.outliers, |j| !missing(j));
        likelihood.shift(self.excess);
        self.standardise(likelihood, |j| !missing(j))?;
        // A row without any output leaves the state to the bit.
        if !(0..p).all(missing) {
            self.correct(root, outputs, (mean, cov));
        }
        Some(())
    }

    /// C⁻¹·(y − ȳ), and the density of the outputs that `counts` picks.
    #[inline(always)]
    fn standardise(
        &mut self,
        likelihood: &mut LogLikelihood,
        counts: impl Fn(usize) -> bool,
    ) -> Option<()> {
        self.factor()?;
        let p = self.size.outputs();
        let (factor, pivots) = (self.factor.as_ref(), self.pivots.as_ref());
        let (innovation, standardised) = (self.innovation.as_ref(), self.standardised.as_mut());
        for i in 0..p {
            let mut rest = innovation[i];
            for (c, e) in factor[i * p..i * p + i].iter().zip(&standardised[..i]) {
                rest -= c * e;
            }
            standardised[i] = rest / factor[i * p + i];
            if counts(i) {
                likelihood.add(pivots[i], rest * rest / pivots[i]);
            }
        }
        Some(())
    }

    /// S.
    #[inline(always)]
    fn spread(&mut self, outputs: &[f64]) {
        let p = self.size.outputs();
        let (beside, covariance) = (self.beside.as_mut(), self.covariance.as_mut());
        beside[..p * p].fill(0.0);
        for (j, noise) in self.noise.as_ref()[..p].iter().enumerate() {
            beside[j * p + j] = *noise;
        }
        for bend in outputs.chunks_exact(p).skip(1).step_by(2) {
            add_outer(bend, p, beside);
        }
        covariance[..p * p].copy_from_slice(&beside[..p * p]);
        for slope in outputs.chunks_exact(p).step_by(2) {
            add_outer(slope, p, covariance);
        }
    }

    /// A sensor that bends its signal after the noise (saturation) is replaced by the line that is best
    /// for N(ȳ, S); what the line misses joins the noise. The noise itself is never taken off: a saturated sensor
    /// says little, but not with certainty. Returns whether anything is bent.
    #[inline(always)]
    fn reads(&mut self, twin: &dyn StateSpace, now: &Now<'_>, row: &Measured<'_>) -> bool {
        let p = self.size.outputs();
        let covariance = self.covariance.as_ref();
        let read = &mut self.read.as_mut()[..NODES.len() * p];
        let (outermost, inner) = read.split_at_mut(2 * p);
        let place = |read: &mut [f64], (node, _): (f64, f64)| {
            for (j, read) in read.iter_mut().enumerate() {
                *read = row.predicted[j] + node * covariance[j * p + j].sqrt();
            }
        };
        for (read, node) in outermost.chunks_exact_mut(p).zip(NODES) {
            place(read, node);
        }
        // Where the outermost are not bent, nothing between them is.
        if !twin.readout_each(now, p, outermost) {
            return false;
        }
        for (read, node) in inner.chunks_exact_mut(p).zip(&NODES[2..]) {
            place(read, *node);
        }
        twin.readout_each(now, p, inner);
        true
    }

    #[cold]
    fn bend(
        &mut self,
        (twin, now): (&dyn StateSpace, &Now<'_>),
        row: &Measured<'_>,
        outputs: &mut [f64],
    ) {
        let p = self.size.outputs();
        let again = &mut self.again.as_mut()[..p];
        again.copy_from_slice(row.y);
        twin.readout(now, again);
        let again = &*again;
        let (read, covariance) = (self.read.as_ref(), self.covariance.as_ref());
        let (noise, innovation) = (self.noise.as_mut(), self.innovation.as_mut());
        for j in 0..p {
            let nodes = || read[j..].iter().step_by(p).take(NODES.len());
            let miss = row.y[j] - read[j];
            let near = |a: f64, b: f64| (a - b) * (a - b) <= noise[j];
            if nodes().all(|v| *v == read[j])
                && !near(row.y[j], read[j])
                && near(again[j], row.y[j])
            {
                // A step wider than what was expected, and another one was read: the signal is beside an edge. What the
                // sensor cannot read is not excused so.
                innovation[j] = miss;
                noise[j] += miss * miss;
                continue;
            }
            let values = || nodes().zip(NODES);
            let mean: f64 = values().map(|(v, (_, weight))| weight * v).sum();
            let slope: f64 = values().map(|(v, (node, weight))| weight * node * v).sum();
            let variance: f64 = values()
                .map(|(v, (_, weight))| weight * (v - mean).powi(2))
                .sum();
            innovation[j] = row.y[j] - mean;
            noise[j] += (variance - slope * slope).max(0.0);
            let slope = slope / covariance[j * p + j].sqrt();
            for output in outputs.iter_mut().skip(j).step_by(p) {
                *output *= slope;
            }
        }
    }

    /// Takes outputs that count for rounded ones, and for outliers. Off, no bit changes.
    #[cold]
    fn finished(
        &mut self,
        rounding: &[f64],
        outliers: &[Outliers],
        counts: impl Fn(usize) -> bool,
    ) {
        self.excess = 0.0;
        for (j, step) in rounding.iter().enumerate() {
            if *step > 0.0 && counts(j) {
                self.round(j, *step);
            }
        }
        for (j, outlier) in outliers.iter().enumerate() {
            if outlier.probability > 0.0 && counts(j) {
                self.strike(j, *outlier);
            }
        }
    }

    /// Where an output is rounded, its density is the mean of N(ȳ, S) over a cell, and the signal is known to lie in it. Innovation and noise
    /// are changed such that the state moves as the signal does:
    ///
    /// ```text
    /// z | cell ~ (μ, v) for z ~ N(0, 1),   S ← S/(1 − v),   y − ȳ ← √S·μ/(1 − v)
    /// ```
    ///
    /// Exact in density, mean and variance for one output; for several, each is taken for itself.
    fn round(&mut self, j: usize, step: f64) {
        let p = self.size.outputs();
        let (beside, covariance) = (self.beside.as_mut(), self.covariance.as_mut());
        let innovation = &mut self.innovation.as_mut()[j];
        let s = covariance[j * p + j];
        // What is no number stays none, and ends the pass.
        if !innovation.is_finite() {
            return;
        }
        let cell = Cell::new(*innovation / s.sqrt(), step / s.sqrt());
        // A cell that holds everything says nothing.
        let known = (1.0 - cell.variance).max(1e-9);
        let seen = s / known;
        *innovation = s.sqrt() * cell.mean / known;
        let log = -0.5 * (seen.ln() + *innovation * *innovation / seen);
        self.excess += cell.log_density - 0.5 * s.ln() - log;
        beside[j * p + j] += seen - s;
        covariance[j * p + j] = seen;
    }

    /// Where an output may be an outlier, its density is a mixture, and so is what it says about the state. The noise is
    /// widened such that the gain is the mixture's:
    ///
    /// ```text
    /// w = P(outlier | e),   1/S ← (1 − w)/S + w/(S + scale²)
    /// ```
    ///
    /// Exact in density and mean for one output; for several, each is taken for itself.
    fn strike(&mut self, j: usize, outlier: Outliers) {
        let p = self.size.outputs();
        let (beside, covariance) = (self.beside.as_mut(), self.covariance.as_mut());
        let s = covariance[j * p + j];
        let wide = s + outlier.scale * outlier.scale;
        let square = self.innovation.as_ref()[j].powi(2);
        let log = |variance: f64| -0.5 * (variance.ln() + square / variance);
        let probability = outlier.probability.min(1.0);
        let plain = (1.0 - probability).ln() + log(s);
        let struck = probability.ln() + log(wide);
        let density = plain.max(struck) + (-(plain - struck).abs()).exp().ln_1p();
        let w = (struck - density).exp();
        let seen = ((1.0 - w) / s + w / wide).recip();
        self.excess += density - log(seen);
        beside[j * p + j] += seen - s;
        covariance[j * p + j] = seen;
    }

    /// C.
    #[inline(always)]
    fn factor(&mut self) -> Option<()> {
        let p = self.size.outputs();
        let (covariance, factor) = (self.covariance.as_ref(), self.factor.as_mut());
        let pivots = self.pivots.as_mut();
        for i in 0..p {
            for j in 0..=i {
                let mut entry = covariance[i * p + j];
                for k in 0..j {
                    entry -= factor[i * p + k] * factor[j * p + k];
                }
                if i == j {
                    // Also where it is NaN.
                    if !(entry > 0.0 && entry < f64::INFINITY) {
                        return None;
                    }
                    pivots[i] = entry;
                    factor[i * p + i] = entry.sqrt();
                } else {
                    factor[i * p + j] = entry / factor[j * p + j];
                }
            }
        }
        Some(())
    }

    /// K, then mean and covariance.
    #[inline(always)]
    fn correct(
        &mut self,
        root: Columns<'_>,
        outputs: &[f64],
        (mean, cov): (&mut [f64], &mut [f64]),
    ) {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (gain, factor) = (
            &mut self.gain.as_mut()[..n * p],
            &self.factor.as_ref()[..p * p],
        );
        let (beside, pivots) = (&self.beside.as_ref()[..p * p], self.pivots.as_ref());
        let (innovation, standardised) = (self.innovation.as_ref(), self.standardised.as_ref());
        let slopes = || outputs.chunks_exact(p).step_by(2);
        gain.fill(0.0);
        for (x, y) in root.each(n).zip(slopes()) {
            for i in 0..n {
                for j in 0..p {
                    gain[i * p + j] += x[i] * y[j];
                }
            }
        }
        for (gain, mean) in gain.chunks_exact_mut(p).zip(mean) {
            if p == 1 {
                gain[0] /= pivots[0];
                *mean += gain[0] * innovation[0];
                continue;
            }
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
        let rest = &mut self.rest.as_mut()[..root.rank * n];
        for ((rest, x), y) in (rest.chunks_exact_mut(n).zip(root.each(n))).zip(slopes()) {
            for i in 0..n {
                rest[i] = x[i];
                for j in 0..p {
                    rest[i] -= gain[i * p + j] * y[j];
                }
            }
        }
        outer(rest, n, cov);
        for i in 0..n {
            for j in 0..=i {
                let mut entry = cov[i * n + j];
                for k in 0..p {
                    for l in 0..p {
                        entry += gain[i * p + k] * beside[k * p + l] * gain[j * p + l];
                    }
                }
                (cov[i * n + j], cov[j * n + i]) = (entry, entry);
            }
        }
    }
}
