//! Measurement update of the state.

mod readings;
mod readout;

use super::gaussian::Columns;
use super::likelihood::LogLikelihood;
use super::moments::{Moment, add_outer, outer};
use super::number::{Asked, FilterNumber};
use super::size::{Buffer, Size};
use crate::math::{Condition, Number};
pub(super) use readings::Readings;
use readout::PROBES;

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
    /// y − ȳ and the variances of each output as they would be of a signal with noise alone.
    pub plain: [S::Vector<N>; 2],
    /// C⁻¹·(y − ȳ), with S = C·Cᵀ; not of lanes.
    pub standardised: S::Vector<N>,
    /// Squares of C's diagonal: variance of each output given those before it.
    pub pivots: S::Vector<N>,
    /// Nats by which the density of the row exceeds that of N(ȳ, S): outliers make it a mixture, rounding the mean over a cell, an end of
    /// the sensor's range that of a tail.
    pub excess: N,
    /// Likelihood of the rows so far.
    pub likelihood: LogLikelihood<N>,
    /// C, row-major, lower.
    factor: S::Matrix<N>,
    /// K (n × p).
    gain: S::Matrix<N>,
    /// X − K·Y.
    rest: S::Matrix<N>,
    /// Values of each output, behind the readout (7 × p).
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
    /// Jitter of readings at an end of the sensor's range, as standard deviations.
    pub jitter: &'w [N],
    /// Rounding and outliers in each lane; empty where no twin has any.
    pub readings: &'w [Readings],
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
            plain: [S::Vector::zeros(p), S::Vector::zeros(p)],
            standardised: S::Vector::zeros(p),
            pivots: S::Vector::zeros(p),
            excess: N::ZERO,
            likelihood: LogLikelihood::none(),
            factor: S::Matrix::zeros(p * p),
            gain: S::Matrix::zeros(n * p),
            rest: S::Matrix::zeros(n * n),
            read: vec![N::ZERO; PROBES * p],
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
        let bent = self.read_probes(row);
        let mut changed = bent.any();
        let ranges = match changed {
            true => self.apply_readout(row, bent, outputs),
            false => vec![],
        };
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
        for j in 0..p {
            self.plain[0].numbers_mut()[j] = self.innovation.numbers()[j];
            self.plain[1].numbers_mut()[j] = self.covariance.numbers()[j * p + j];
        }
        self.excess = N::ZERO;
        if !(row.readings.is_empty() && ranges.is_empty()) {
            self.apply_readings(row, &ranges, &is_missing);
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

#[cfg(test)]
mod tests;
