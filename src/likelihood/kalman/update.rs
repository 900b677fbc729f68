//! Measurement update of the state.

use super::gaussian::Columns;
use super::likelihood::LogLikelihood;
use super::moments::{Moment, add_outer, outer};
use super::normal::cell::Cell;
use super::number::{Asked, FilterNumber};
use super::size::{Buffer, Size};
use crate::math::{Condition, Number};
use crate::twin::{Composed, Outliers};

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
pub(super) struct Update<S: Size, N: Number> {
    size: S,
    /// Variance of the measurement noise and of what the readout hides, by output.
    noise: S::Vector<N>,
    /// Σ Z Zᵀ + R (p × p).
    beside: S::Matrix<N>,
    /// y − ȳ.
    pub innovation: S::Vector<N>,
    /// S (p × p).
    pub covariance: S::Matrix<N>,
    /// C⁻¹·(y − ȳ), with S = C·Cᵀ; not of lanes.
    pub standardised: S::Vector<N>,
    /// Squares of C's diagonal: variance of each output given those before it.
    pub pivots: S::Vector<N>,
    /// Nats by which the density of the row exceeds that of N(ȳ, S): outliers make it a mixture, rounding the mean over a cell.
    pub excess: N,
    /// Likelihood of the rows so far.
    pub likelihood: LogLikelihood<N>,
    /// C, row-major, lower.
    factor: S::Matrix<N>,
    /// K (n × p).
    gain: S::Matrix<N>,
    /// X − K·Y.
    rest: S::Matrix<N>,
    /// Readout of the nodes of each output (5 × p).
    read: Vec<N>,
}

/// One row of the records, and how well it could be measured.
pub(super) struct MeasuredRow<'w, 'n, N> {
    /// The twin where the filters are.
    pub at: Asked<'w, 'n>,
    /// The outputs.
    pub y: &'w [N],
    /// ȳ, predicted without the readout.
    pub predicted: &'w [N],
    /// Standard deviations of the measurement noise.
    pub noise: &'w [N],
    /// Least variances.
    pub floor: &'w [N],
    /// Rounding and outliers in each lane; empty where no twin has any.
    pub readings: &'w [Readings],
}

/// Rounding and outliers of a sensor.
#[derive(Default)]
pub(super) struct Readings {
    /// Steps by output; empty for none.
    rounding: Vec<f64>,
    /// By output; empty for none.
    outliers: Vec<Outliers>,
}

impl Readings {
    /// Those of a twin at θ; `None` where it has neither.
    pub fn of(twin: &Composed, theta: &[f64]) -> Option<Self> {
        let (rounding, outliers) = (twin.rounding(theta), twin.outliers(theta));
        let any = !(rounding.is_empty() && outliers.is_empty());
        any.then_some(Self { rounding, outliers })
    }

    /// Tells whether output j is rounded.
    pub fn rounds(&self, j: usize) -> bool {
        self.rounding.get(j).is_some_and(|step| *step > 0.0)
    }
}

impl<S: Size, N: FilterNumber> Update<S, N> {
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
            excess: N::ZERO,
            likelihood: LogLikelihood::none(),
            factor: S::Matrix::zeros(p * p),
            gain: S::Matrix::zeros(n * p),
            rest: S::Matrix::zeros(n * n),
            read: vec![N::ZERO; NODES.len() * p],
        }
    }

    /// Puts a row into the state and its density into the likelihood; the lanes in which S has an inverse and is finite.
    #[inline(always)]
    pub fn apply(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        root: Columns<'_, N>,
        outputs: &mut [N],
        state: Moment<'_, N>,
    ) -> N::Condition {
        self.update(row, root, outputs, state, |_| false)
    }

    /// As [`apply`](Self::apply), for a row with missing outputs. To the others they are outputs of unit noise that follow no
    /// state and were measured as predicted; in the likelihood they have no part.
    #[cold]
    pub fn apply_present(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        root: Columns<'_, N>,
        outputs: &mut [N],
        state: Moment<'_, N>,
    ) -> N::Condition {
        let is_missing: Vec<bool> = row.y.iter().map(|y| y.lane(0).is_nan()).collect();
        // A sensor's readout may look at all outputs.
        let filled: Vec<N> = (row.y.iter().zip(row.predicted))
            .zip(&is_missing)
            .map(|((y, predicted), missing)| if *missing { *predicted } else { *y })
            .collect();
        let filled = MeasuredRow { y: &filled, ..*row };
        self.update(&filled, root, outputs, state, |j| is_missing[j])
    }

    #[inline(always)]
    fn update(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        root: Columns<'_, N>,
        outputs: &mut [N],
        state: Moment<'_, N>,
        is_missing: impl Fn(usize) -> bool,
    ) -> N::Condition {
        let p = self.size.outputs();
        let (noise, innovation) = (self.noise.numbers_mut(), self.innovation.numbers_mut());
        for j in 0..p {
            noise[j] = (row.noise[j] * row.noise[j]).max(row.floor[j]);
            innovation[j] = row.y[j] - row.predicted[j];
        }
        self.spread(outputs);
        let bent = self.read_nodes(row);
        let mut changed = bent.any();
        if changed {
            self.linearise_readout(row, bent, outputs);
        }
        for j in (0..p).filter(|&j| is_missing(j)) {
            changed = true;
            self.noise.numbers_mut()[j] = N::all(1.0);
            self.innovation.numbers_mut()[j] = N::ZERO;
            outputs
                .iter_mut()
                .skip(j)
                .step_by(p)
                .for_each(|y| *y = N::ZERO);
        }
        if changed {
            self.spread(outputs);
        }
        if !row.readings.is_empty() {
            self.apply_readings(row.readings, &is_missing);
            self.likelihood.shift(self.excess);
        }
        let good = self.standardise(&is_missing);
        // A row without any output leaves the state to the bit.
        if !(0..p).all(is_missing) {
            self.correct(root, outputs, state);
        }
        good
    }

    /// C⁻¹·(y − ȳ), and the density of the outputs that are there; the lanes in which C is finite and has an inverse.
    #[inline(always)]
    fn standardise(&mut self, is_missing: impl Fn(usize) -> bool) -> N::Condition {
        let p = self.size.outputs();
        let (covariance, factor) = (self.covariance.numbers(), self.factor.numbers_mut());
        let (innovation, pivots) = (self.innovation.numbers(), self.pivots.numbers_mut());
        let standardised = self.standardised.numbers_mut();
        let mut good = N::ZERO.below(N::all(1.0));
        for i in 0..p {
            for j in 0..=i {
                let mut entry = covariance[i * p + j];
                for k in 0..j {
                    entry = entry - factor[i * p + k] * factor[j * p + k];
                }
                if i == j {
                    // Not so where it is NaN.
                    let positive = N::ZERO.below(entry) & entry.below(N::all(f64::INFINITY));
                    good = good & positive;
                    pivots[i] = entry;
                    if N::LANES == 1 || p > 1 {
                        factor[i * p + i] = entry.sqrt();
                    }
                } else {
                    factor[i * p + j] = entry / factor[j * p + j];
                }
            }
            let mut rest = innovation[i];
            for k in 0..i {
                rest = rest - factor[i * p + k] * standardised[k];
            }
            if N::LANES == 1 || p > 1 {
                standardised[i] = rest / factor[i * p + i];
            }
            if !is_missing(i) {
                self.likelihood.add(pivots[i], rest * rest / pivots[i]);
            }
        }
        good
    }

    /// S.
    #[inline(always)]
    fn spread(&mut self, outputs: &[N]) {
        let p = self.size.outputs();
        let (beside, covariance) = (self.beside.numbers_mut(), self.covariance.numbers_mut());
        beside[..p * p].fill(N::ZERO);
        for (j, noise) in self.noise.numbers()[..p].iter().enumerate() {
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
    /// says little, but not with certainty. Returns the lanes in which anything is bent.
    #[inline(always)]
    fn read_nodes(&mut self, row: &MeasuredRow<'_, '_, N>) -> N::Condition {
        let p = self.size.outputs();
        let covariance = self.covariance.numbers();
        let (outermost, inner) = self.read.split_at_mut(2 * p);
        let place = |read: &mut [N], (node, _): (f64, f64)| {
            for (j, read) in read.iter_mut().enumerate() {
                *read = row.predicted[j] + covariance[j * p + j].sqrt() * node;
            }
        };
        for (read, node) in outermost.chunks_exact_mut(p).zip(NODES) {
            place(read, node);
        }
        // Where the outermost are not bent, nothing between them is.
        let bent = N::readout(row.at, outermost);
        if bent.any() {
            for (read, node) in inner.chunks_exact_mut(p).zip(&NODES[2..]) {
                place(read, *node);
            }
            N::readout(row.at, inner);
        }
        bent
    }

    #[cold]
    fn linearise_readout(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        bent: N::Condition,
        outputs: &mut [N],
    ) {
        let p = self.size.outputs();
        let covariance = self.covariance.numbers();
        let bent = bent.select(N::all(1.0), N::ZERO);
        let (twin, now) = row.at;
        let lanes = now.whole().iter().enumerate();
        for (lane, now) in lanes.filter(|(lane, _)| bent.lane(*lane) != 0.0) {
            let mut again: Vec<f64> = row.y.iter().map(|y| y.lane(lane)).collect();
            twin.readout(now, &mut again);
            for j in 0..p {
                let nodes: [f64; NODES.len()] =
                    std::array::from_fn(|i| self.read[i * p + j].lane(lane));
                let y = row.y[j].lane(lane);
                let noise = self.noise.numbers_mut()[j].lane_mut(lane);
                let innovation = self.innovation.numbers_mut()[j].lane_mut(lane);
                let miss = y - nodes[0];
                let near = |a: f64, b: f64| (a - b) * (a - b) <= *noise;
                if nodes.iter().all(|v| *v == nodes[0]) && !near(y, nodes[0]) && near(again[j], y) {
                    // A step wider than what was expected, and another one was read: the signal is beside an edge. What the
                    // sensor cannot read is not excused so.
                    *innovation = miss;
                    *noise += miss * miss;
                    continue;
                }
                let values = || nodes.iter().zip(NODES);
                let mean: f64 = values().map(|(v, (_, weight))| weight * v).sum();
                let slope: f64 = values().map(|(v, (node, weight))| weight * node * v).sum();
                let variance: f64 = values()
                    .map(|(v, (_, weight))| weight * (v - mean).powi(2))
                    .sum();
                *innovation = y - mean;
                *noise += (variance - slope * slope).max(0.0);
                let slope = slope / covariance[j * p + j].lane(lane).sqrt();
                for output in outputs.iter_mut().skip(j).step_by(p) {
                    *output.lane_mut(lane) *= slope;
                }
            }
        }
    }

    /// Takes outputs that are there for rounded ones, and for outliers.
    #[cold]
    fn apply_readings(&mut self, readings: &[Readings], is_missing: impl Fn(usize) -> bool) {
        self.excess = N::ZERO;
        let p = self.size.outputs();
        for (lane, readings) in readings.iter().enumerate() {
            for j in (0..p).filter(|&j| !is_missing(j)) {
                if readings.rounds(j) {
                    self.apply_rounding(lane, j, readings.rounding[j]);
                }
                if let Some(outlier) = readings.outliers.get(j).filter(|o| o.probability > 0.0) {
                    self.apply_outliers(lane, j, *outlier);
                }
            }
        }
    }

    /// Takes an output for rounded: its density is the mean of N(ȳ, S) over a cell, and the signal is known to lie in it. Innovation and noise
    /// are changed such that the state moves as the signal does:
    ///
    /// ```text
    /// z | cell ~ (μ, v) for z ~ N(0, 1),   S ← S/(1 − v),   y − ȳ ← √S·μ/(1 − v)
    /// ```
    ///
    /// Exact in density, mean and variance for one output; for several, each is taken for itself.
    fn apply_rounding(&mut self, lane: usize, j: usize, step: f64) {
        let innovation = self.innovation.numbers_mut()[j].lane_mut(lane);
        let s = self.covariance.numbers()[j * self.size.outputs() + j].lane(lane);
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
        let excess = cell.log_density - 0.5 * s.ln() - log;
        self.set_variance(lane, j, seen, excess);
    }

    /// Takes an output for a possible outlier: its density is a mixture, and so is what it says about the state. The noise is
    /// widened such that the gain is the mixture's:
    ///
    /// ```text
    /// w = P(outlier | e),   1/S ← (1 − w)/S + w/(S + scale²)
    /// ```
    ///
    /// Exact in density and mean for one output; for several, each is taken for itself.
    fn apply_outliers(&mut self, lane: usize, j: usize, outlier: Outliers) {
        let s = self.covariance.numbers()[j * self.size.outputs() + j].lane(lane);
        let wide = s + outlier.scale * outlier.scale;
        let square = self.innovation.numbers()[j].lane(lane).powi(2);
        let log = |variance: f64| -0.5 * (variance.ln() + square / variance);
        let probability = outlier.probability.min(1.0);
        let plain = (1.0 - probability).ln() + log(s);
        let struck = probability.ln() + log(wide);
        let density = plain.max(struck) + (-(plain - struck).abs()).exp().ln_1p();
        let w = (struck - density).exp();
        let seen = ((1.0 - w) / s + w / wide).recip();
        self.set_variance(lane, j, seen, density - log(seen));
    }

    /// Sets the variance of output j, and adds what its density then lacks.
    fn set_variance(&mut self, lane: usize, j: usize, variance: f64, excess: f64) {
        let at = j * self.size.outputs() + j;
        let covariance = self.covariance.numbers_mut()[at].lane_mut(lane);
        *self.beside.numbers_mut()[at].lane_mut(lane) += variance - *covariance;
        *covariance = variance;
        *self.excess.lane_mut(lane) += excess;
    }

    /// K, then mean and covariance.
    #[inline(always)]
    fn correct(&mut self, root: Columns<'_, N>, outputs: &[N], (mean, cov): Moment<'_, N>) {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (gain, factor) = (
            &mut self.gain.numbers_mut()[..n * p],
            &self.factor.numbers()[..p * p],
        );
        let (beside, pivots) = (&self.beside.numbers()[..p * p], self.pivots.numbers());
        let (innovation, standardised) = (self.innovation.numbers(), self.standardised.numbers());
        let slopes = || outputs.chunks_exact(p).step_by(2);
        gain.fill(N::ZERO);
        for (x, y) in root.each(n).zip(slopes()) {
            for i in 0..n {
                for j in 0..p {
                    gain[i * p + j] += x[i] * y[j];
                }
            }
        }
        let per_variance = pivots[0].recip();
        for (gain, mean) in gain.chunks_exact_mut(p).zip(mean) {
            if p == 1 {
                gain[0] = gain[0] * per_variance;
                *mean += gain[0] * innovation[0];
                continue;
            }
            for i in 0..p {
                for k in 0..i {
                    gain[i] = gain[i] - factor[i * p + k] * gain[k];
                }
                gain[i] = gain[i] / factor[i * p + i];
                *mean += gain[i] * standardised[i];
            }
            for i in (0..p).rev() {
                for k in i + 1..p {
                    gain[i] = gain[i] - factor[k * p + i] * gain[k];
                }
                gain[i] = gain[i] / factor[i * p + i];
            }
        }
        let rest = &mut self.rest.numbers_mut()[..root.rank * n];
        for ((rest, x), y) in (rest.chunks_exact_mut(n).zip(root.each(n))).zip(slopes()) {
            for i in 0..n {
                rest[i] = x[i];
                for j in 0..p {
                    rest[i] = rest[i] - gain[i * p + j] * y[j];
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
