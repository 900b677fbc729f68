//! Statistic of each cut: departure of its innovations from white noise N(0, 1).

use super::cut::{Bins, Cut, Past};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::likelihood::kalman::Filtered;
use crate::record::{Record, Signal};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Excess of a cut beyond chance.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::diagnose) struct Excess {
    /// A statistic that is about χ² where nothing is wrong.
    pub square: f64,
    /// Its mean there.
    pub expected: f64,
}

/// Returns for each cut, with standardised innovations v:
///
/// | cut | square of the statistic |
/// |---|---|
/// | window, region | n·mean² + n/2·(mean square − 1)² |
/// | output | the same, and Σ n·ρ_l² over twenty lags |
/// | lags | Σ n·ρ_l² with the past of the signal |
/// | band | m·(mean of m periodogram ordinates − 1)² |
pub(in crate::diagnose) fn excess(
    states: &[(Filtered, Signal)],
    records: &[Record],
    bins: &Bins,
) -> Vec<Excess> {
    let mut sums = vec![(0.0, 0.0, 0.0); bins.cuts.len()];
    bins.visit(states, records, |c, r, k, j| {
        let v = states[r].0.standardised[[k, j]];
        let (n, sum, square) = &mut sums[c];
        *n += 1.0;
        *sum += v;
        *square += v * v;
    });
    let series = Series::new(states, records);
    (bins.cuts.iter().zip(sums))
        .map(|(cut, sums)| match *cut {
            Cut::Channel { channel } => {
                let of_values = level(series.sums(channel));
                let lags = series.lags(channel, Past::Output(channel), 1, THRESHOLDS.lags);
                Excess {
                    square: of_values.square + lags.square,
                    expected: of_values.expected + lags.expected,
                }
            }
            Cut::Lag {
                channel,
                past,
                from,
                to,
            } => series.lags(channel, past, from, to),
            Cut::Band { channel, low, high } => series.band(channel, low, high),
            _ => level(sums),
        })
        .collect()
}

/// Statistic of a count, a sum and a sum of squares.
fn level((n, sum, square): (f64, f64, f64)) -> Excess {
    if n < THRESHOLDS.least_in_cut {
        return Excess::default();
    }
    Excess {
        square: sum * sum / n + 0.5 * n * (square / n - 1.0).powi(2),
        expected: 2.0,
    }
}

/// Innovations and inputs of all records as columns, and the innovations' periodograms.
struct Series {
    /// By record and output, as they are.
    innovations: Vec<Vec<Vec<f64>>>,
    /// By record and output, less their mean.
    centred: Vec<Vec<Vec<f64>>>,
    /// By record and input, less their mean.
    inputs: Vec<Vec<Vec<f64>>>,
    /// By record and output, at j/n cycles a sample, j = 1, 2, …; mean 1 for white noise of variance 1.
    powers: Vec<Vec<Vec<f64>>>,
}

impl Series {
    fn new(states: &[(Filtered, Signal)], records: &[Record]) -> Self {
        let columns = |signal: &Signal| -> Vec<Vec<f64>> {
            signal.columns().into_iter().map(|c| c.to_vec()).collect()
        };
        let all_centred =
            |columns: &[Vec<f64>]| columns.iter().map(|c| centred(c)).collect::<Vec<_>>();
        let innovations: Vec<_> = (states.iter())
            .map(|(f, _)| columns(&f.standardised))
            .collect();
        let centred: Vec<_> = innovations.iter().map(|c| all_centred(c)).collect();
        let mut planner = FftPlanner::new();
        Self {
            inputs: (records.iter())
                .map(|r| all_centred(&columns(r.drive().inputs())))
                .collect(),
            powers: (centred.iter())
                .map(|record| record.iter().map(|v| powers(v, &mut planner)).collect())
                .collect(),
            innovations,
            centred,
        }
    }

    fn sums(&self, channel: usize) -> (f64, f64, f64) {
        let values = self.innovations.iter().flat_map(|record| &record[channel]);
        values.fold((0.0, 0.0, 0.0), |(n, sum, square), v| {
            (n + 1.0, sum + v, square + v * v)
        })
    }

    fn lags(&self, channel: usize, past: Past, from: usize, to: usize) -> Excess {
        let mut all = Excess::default();
        for (r, record) in self.centred.iter().enumerate() {
            let v = &record[channel];
            let past = match past {
                Past::Output(j) => &record[j],
                Past::Input(i) => &self.inputs[r][i],
            };
            for lag in (from..=to).take_while(|lag| *lag + 1 < v.len()) {
                all.square += v.len() as f64 * correlation(v, past, lag).powi(2);
                all.expected += 1.0;
            }
        }
        all
    }

    fn band(&self, channel: usize, low: f64, high: f64) -> Excess {
        let (mut sum, mut m) = (0.0, 0.0);
        for (record, own) in self.powers.iter().zip(&self.innovations) {
            let n = own[channel].len() as f64;
            for (j, power) in record[channel].iter().enumerate() {
                let frequency = (j + 1) as f64 / n;
                if low < frequency && frequency <= high {
                    sum += power;
                    m += 1.0;
                }
            }
        }
        if m == 0.0 {
            return Excess::default();
        }
        Excess {
            square: m * (sum / m - 1.0).powi(2),
            expected: 1.0,
        }
    }
}

/// Less the mean.
fn centred(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|v| v - mean).collect()
}

/// Correlation of a(k) with b(k − lag), both centred.
fn correlation(a: &[f64], b: &[f64], lag: usize) -> f64 {
    if lag >= a.len() {
        return 0.0;
    }
    let dot: f64 = a[lag..].iter().zip(b).map(|(a, b)| a * b).sum();
    let norm = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
    let scale = (norm(a) * norm(b)).sqrt();
    if scale > 0.0 { dot / scale } else { 0.0 }
}

/// |DFT|²/n at j/n cycles a sample, j = 1 … n/2.
fn powers(v: &[f64], planner: &mut FftPlanner<f64>) -> Vec<f64> {
    let n = v.len();
    let mut line: Vec<Complex<f64>> = v.iter().map(|v| Complex::new(*v, 0.0)).collect();
    planner.plan_fft_forward(n).process(&mut line);
    (line[1..].iter().take(n / 2))
        .map(|z| z.norm_sqr() / n as f64)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut source = Noise::new(seed, "t", 0).source("v");
        (0..n).map(|_| source.normal()).collect()
    }

    /// A line at a quarter of a cycle shows in its band alone, and white noise has power 1 everywhere.
    #[test]
    fn a_line_stands_in_its_band() {
        let n = 4096;
        let white = noise(n, 3);
        let lined: Vec<f64> = (white.iter().enumerate())
            .map(|(k, v)| v + (std::f64::consts::TAU * 0.2 * k as f64).sin())
            .collect();
        let of = |v: &[f64]| Series {
            innovations: vec![vec![v.to_vec()]],
            centred: vec![vec![v.to_vec()]],
            inputs: vec![vec![]],
            powers: vec![vec![powers(v, &mut FftPlanner::new())]],
        };
        for (low, high) in [(0.0, 0.0625), (0.0625, 0.125), (0.25, 0.5)] {
            assert!(of(&white).band(0, low, high).square < 12.0);
            assert!(of(&lined).band(0, low, high).square < 12.0);
        }
        assert!(of(&lined).band(0, 0.125, 0.25).square > 200.0);
    }

    /// Over many series, the squared correlations of white noise have the mean that is subtracted.
    #[test]
    fn chance_has_its_mean() {
        let mean = (0..200)
            .map(|seed| {
                let v = centred(&noise(300, seed));
                (8..16)
                    .map(|lag| 300.0 * correlation(&v, &v, lag).powi(2))
                    .sum::<f64>()
            })
            .sum::<f64>()
            / 200.0;
        // 8 degrees of freedom: the mean of 200 has a standard deviation of 0.28; the missing pairs take off 4 %.
        assert!((mean - 8.0).abs() < 1.2, "{mean}");
    }
}
