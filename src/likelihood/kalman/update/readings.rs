//! Readings that are more than a signal with noise: at an end of the sensor's range, rounded, or outliers.

use super::{MeasuredRow, Update};
use crate::likelihood::kalman::normal::Known;
use crate::likelihood::kalman::number::FilterNumber;
use crate::likelihood::kalman::size::{Buffer, Size};
use crate::twin::{Composed, Interval, Outliers};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Rounding and outliers of a sensor.
#[derive(Default)]
pub(in crate::likelihood::kalman) struct Readings {
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
        self.step(j).is_some()
    }

    fn step(&self, j: usize) -> Option<f64> {
        self.rounding.get(j).copied().filter(|step| *step > 0.0)
    }

    fn outlier(&self, j: usize) -> Option<Outliers> {
        (self.outliers.get(j).copied()).filter(|outlier| outlier.probability > 0.0)
    }
}

/// An output, in one lane, whose sensor shows a range.
pub(super) struct Ranged {
    pub lane: usize,
    pub output: usize,
    pub ends: Interval,
}

/// Share of a variance that a reading takes off at least. Half or twice of it moves no state by a thousandth of its deviation.
const LEAST_TOLD: f64 = 1e-6;

/// A reading as one of a signal with noise that has its density, and moves the state as it does.
///
/// Exact in density and mean for one output, and in variance where no outlier is possible.
#[derive(Clone, Copy)]
struct Seen {
    innovation: f64,
    variance: f64,
    /// Without −½·log 2π.
    log_density: f64,
}

impl Seen {
    fn plain(innovation: f64, variance: f64) -> Self {
        Self {
            innovation,
            variance,
            log_density: normal(innovation, variance),
        }
    }

    /// Seen of N(ȳ, `s`), of which a reading tells this in standard deviations from ȳ:
    ///
    /// ```text
    /// z | reading ~ (μ, v) for z ~ N(0, 1),   S ← S/(1 − v),   y − ȳ ← √S·μ/(1 − v)
    /// ```
    fn of_known(s: f64, known: Known) -> Self {
        // Where z is either the reading or far beyond the end, it may vary more than before, which no reading of one normal number tells: its
        // mean is kept then, and e²/S is at most 1 + μ². No tail and no cell is held so.
        let square = known.mean * known.mean;
        let told = (1.0 - known.variance).max(square / (1.0 + square));
        let told = told.max(LEAST_TOLD);
        Self {
            innovation: s.sqrt() * known.mean / told,
            variance: s / told,
            log_density: known.log_density - 0.5 * s.ln(),
        }
    }

    /// The mixture with an outlier:
    ///
    /// ```text
    /// w = P(outlier | reading),   1/S ← (1 − w)/S + w/(S + scale²),   e/S ← (1 − w)·e/S + w·e/(S + scale²)
    /// ```
    fn or(self, outlier: Outliers, innovation: f64, s: f64) -> Self {
        let probability = outlier.probability.min(1.0);
        let wide = s + outlier.scale * outlier.scale;
        let plain = (1.0 - probability).ln() + self.log_density;
        let struck = probability.ln() + normal(innovation, wide);
        let log_density = plain.max(struck) + (-(plain - struck).abs()).exp().ln_1p();
        let w = (struck - log_density).exp();
        let variance = ((1.0 - w) / self.variance + w / wide).recip();
        let (usual, off) = (self.innovation / self.variance, innovation / wide);
        Self {
            innovation: variance * ((1.0 - w) * usual + w * off),
            variance,
            log_density,
        }
    }
}

/// log N(e; 0, s) + ½·log 2π.
fn normal(e: f64, s: f64) -> f64 {
    -0.5 * (s.ln() + e * e / s)
}

impl<S: Size, N: FilterNumber> Update<S, N> {
    /// Takes outputs that are there for rounded ones, for those of a range, and for outliers: each for itself, given the plain ones of the row and
    /// those before it.
    #[cold]
    pub(super) fn apply_readings(
        &mut self,
        row: &MeasuredRow<'_, '_, N>,
        ranges: &[Ranged],
        is_missing: impl Fn(usize) -> bool,
    ) {
        let p = self.size.outputs();
        for lane in 0..row.at.1.whole().len() {
            let readings = row.readings.get(lane);
            let special = |j: usize| {
                let ends = (ranges.iter()).find(|r| (r.lane, r.output) == (lane, j));
                let special = Special {
                    step: readings.and_then(|readings| readings.step(j)),
                    ends: ends.map_or(Interval::EVERYTHING, |ranged| ranged.ends),
                    outlier: readings.and_then(|readings| readings.outlier(j)),
                };
                special.is_any().then_some(special)
            };
            let there = || (0..p).filter(|&j| !is_missing(j));
            let mut known: Vec<usize> = there().filter(|&j| special(j).is_none()).collect();
            for (j, special) in there().filter_map(|j| Some((j, special(j)?))) {
                let e = self.innovation.numbers()[j].lane(lane);
                // What is no number stays none, and ends the pass.
                if !e.is_finite() {
                    continue;
                }
                let (shift, s) = self.given(lane, j, &known);
                let [predicted, noise, jitter] =
                    [row.predicted[j], self.noise.numbers()[j], row.jitter[j]]
                        .map(|of| of.lane(lane));
                let ends =
                    [special.ends.low(), special.ends.high()].map(|end| end - predicted - shift);
                let seen = special.seen(e - shift, s, (ends[0], ends[1]), [jitter, noise.sqrt()]);
                let at = j * p + j;
                let wider = seen.variance - s;
                *self.beside.numbers_mut()[at].lane_mut(lane) += wider;
                *self.covariance.numbers_mut()[at].lane_mut(lane) += wider;
                *self.innovation.numbers_mut()[j].lane_mut(lane) = seen.innovation + shift;
                *self.excess.lane_mut(lane) +=
                    seen.log_density - normal(seen.innovation, seen.variance);
                known.push(j);
            }
        }
    }

    /// Mean and variance of an innovation given others; as without them where these do not vary.
    fn given(&self, lane: usize, j: usize, others: &[usize]) -> (f64, f64) {
        let p = self.size.outputs();
        let n = others.len();
        if n == 0 {
            return (0.0, self.covariance.numbers()[j * p + j].lane(lane));
        }
        let covariance = |i: usize, j: usize| self.covariance.numbers()[i * p + j].lane(lane);
        let among = DMatrix::from_fn(n, n, |a, b| covariance(others[a], others[b]));
        let with = DVector::from_fn(n, |a, _| covariance(others[a], j));
        let weights = among.cholesky().map(|root| root.solve(&with));
        let weights = weights.unwrap_or_else(|| DVector::zeros(n));
        let variance = covariance(j, j) - with.dot(&weights);
        if variance.is_nan() || variance <= 0.0 {
            return (0.0, covariance(j, j));
        }
        let innovation = |i: &usize| self.innovation.numbers()[*i].lane(lane);
        let mean = others
            .iter()
            .zip(&weights)
            .map(|(i, weight)| weight * innovation(i));
        (mean.sum(), variance)
    }
}

/// Rounding, range and outliers that make a reading more than a signal with noise.
struct Special {
    step: Option<f64>,
    ends: Interval,
    outlier: Option<Outliers>,
}

impl Special {
    fn has_end(&self) -> bool {
        self.ends.low().is_finite() || self.ends.high().is_finite()
    }

    fn is_any(&self) -> bool {
        self.step.is_some() || self.outlier.is_some() || self.has_end()
    }

    /// A reading `e` beyond the mean of N(0, s), with the ends of its range there, its jitter at these and its noise.
    fn seen(&self, e: f64, s: f64, ends: (f64, f64), [jitter, noise]: [f64; 2]) -> Seen {
        let deviation = s.sqrt();
        let usual = match self.step {
            Some(step) => Seen::of_known(s, rounded(e, ends, step, deviation)),
            None if self.has_end() => {
                let [e, low, high, jitter, noise] =
                    [e, ends.0, ends.1, jitter, noise].map(|v| v / deviation);
                Seen::of_known(s, Known::in_range(e, (low, high), jitter, noise))
            }
            None => Seen::plain(e, s),
        };
        self.outlier
            .map_or(usual, |outlier| usual.or(outlier, e, s))
    }
}

/// A value that is rounded to `step`, all relative to ȳ: its density is the mean of N(ȳ, S) over its cell, which at an end of
/// the range goes on for ever.
fn rounded(e: f64, (low, high): (f64, f64), step: f64, deviation: f64) -> Known {
    let [from, to] = [e - 0.5 * step, e + 0.5 * step];
    let from = if from <= low { f64::NEG_INFINITY } else { from };
    let to = if to > high { f64::INFINITY } else { to };
    let known = Known::between(from / deviation, to / deviation);
    Known {
        log_density: known.log_density + 0.5 * TAU.ln() - (step / deviation).ln(),
        ..known
    }
}
