//! Sparse regression of the smoothed missing term. Exploratory, not a test.
//!
//! ```text
//! d(t) ≈ c₀ + Σ_j c_j·f_j(x(t), u(t), t)        f: powers, products, x·|x|, time
//! ```
//!
//! by weighted least squares (weights: the smoother's precisions), terms added while the Bayesian information criterion of
//! as many samples as are independent falls. Blocks of time are resampled, and the choice made again: how often a term is
//! in, and how its factor varies, says what to make of it.
//!
//! Sources: Brunton, Proctor & Kutz, "Discovering governing equations from data" (2016); Fasel, Kutz, Brunton & Brunton,
//! "Ensemble-SINDy" (2022); Ebers, Steele & Kutz, "Discrepancy modeling framework" (2024).

use crate::diagnose::locate::missing_term::{MissingTerm, Smoothed};
use crate::diagnose::outcome::{Discovery, Term};
use crate::diagnose::thresholds::Thresholds;
use crate::math::quantile;
use crate::record::{Record, Signal};
use crate::twin::Noise;
use nalgebra::{DMatrix, DVector};

/// One function of state, input and time.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Function {
    Power(usize, u32),
    Signed(usize),
    Product(usize, usize),
    Time,
}

impl Function {
    fn name(self, variables: &[String]) -> String {
        match self {
            Self::Power(v, 1) => variables[v].clone(),
            Self::Power(v, 2) => format!("{}²", variables[v]),
            Self::Power(v, _) => format!("{}³", variables[v]),
            Self::Signed(v) => format!("|{0}|·{0}", variables[v]),
            Self::Product(v, w) => format!("{}·{}", variables[v], variables[w]),
            Self::Time => "t".into(),
        }
    }

    fn value(self, columns: &Signal, k: usize, t: f64) -> f64 {
        match self {
            Self::Power(v, n) => columns[[k, v]].powi(n as i32),
            Self::Signed(v) => columns[[k, v]].abs() * columns[[k, v]],
            Self::Product(v, w) => columns[[k, v]] * columns[[k, w]],
            Self::Time => t,
        }
    }
}

/// All functions of so many variables; of one that is never negative, |x|·x is x².
fn functions(variables: usize, negative: &[bool]) -> Vec<Function> {
    let mut all = vec![];
    for (v, negative) in negative.iter().enumerate().take(variables) {
        all.extend((1..=3).map(|n| Function::Power(v, n)));
        if *negative {
            all.push(Function::Signed(v));
        }
        all.extend((v + 1..variables).map(|w| Function::Product(v, w)));
    }
    all.push(Function::Time);
    all
}

/// Sums of products of weighted columns (1, functions, d) over some samples.
#[derive(Clone)]
struct Sums {
    gram: DMatrix<f64>,
    samples: f64,
}

impl Sums {
    fn zero(width: usize) -> Self {
        Self {
            gram: DMatrix::zeros(width, width),
            samples: 0.0,
        }
    }

    fn add(&mut self, other: &Self) {
        self.gram += &other.gram;
        self.samples += other.samples;
    }

    /// Factors of these columns, and the residual sum of squares.
    fn solve(&self, columns: &[usize]) -> Option<(DVector<f64>, f64)> {
        let last = self.gram.ncols() - 1;
        let n = columns.len();
        let a = DMatrix::from_fn(n, n, |i, j| {
            // As good as nothing, against columns that are one another's multiple.
            let ridge = if i == j { 1.0 + 1e-9 } else { 1.0 };
            self.gram[(columns[i], columns[j])] * ridge
        });
        let b = DVector::from_fn(n, |i, _| self.gram[(columns[i], last)]);
        let factors = a.cholesky()?.solve(&b);
        let rest = self.gram[(last, last)] - factors.dot(&b);
        Some((factors, rest.max(0.0)))
    }

    /// Columns added one by one while the criterion of `independent` samples falls; the constant is always there.
    fn select(&self, independent: f64) -> Vec<usize> {
        let last = self.gram.ncols() - 1;
        let mut chosen = vec![0];
        let Some((_, mut rest)) = self.solve(&chosen) else {
            return chosen;
        };
        while chosen.len() <= Thresholds::MOST_TERMS {
            let best = (1..last)
                .filter(|c| !chosen.contains(c))
                .filter_map(|c| {
                    let columns: Vec<usize> = chosen.iter().copied().chain([c]).collect();
                    Some((self.solve(&columns)?.1, c))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match best {
                Some((less, c))
                    if independent * (rest / less.max(1e-300)).ln() > independent.ln() =>
                {
                    chosen.push(c);
                    rest = less;
                }
                _ => break,
            }
        }
        chosen
    }
}

/// Regresses the term; `None` where nothing is left to explain.
pub(in crate::diagnose) fn discover(
    term: &MissingTerm,
    records: &[Record],
    noise: Noise,
) -> Option<Discovery> {
    let variables = term.variables.len();
    let negative: Vec<bool> = (0..variables)
        .map(|v| (term.records.iter()).any(|r| r.columns.column(v).iter().any(|x| *x < 0.0)))
        .collect();
    let functions = functions(variables, &negative);
    // Columns of about size one.
    let scales: Vec<f64> = (functions.iter())
        .map(|f| {
            let (mut sum, mut n) = (0.0, 0.0);
            for (smoothed, record) in term.records.iter().zip(records) {
                for k in 0..smoothed.mean.len() {
                    sum += f
                        .value(&smoothed.columns, k, record.drive().time(k))
                        .powi(2);
                    n += 1.0;
                }
            }
            (sum / n).sqrt().max(1e-300)
        })
        .collect();
    let samples: usize = term.records.iter().map(|r| r.mean.len()).sum();
    let row = |smoothed: &Smoothed, record: &Record, k: usize| -> Vec<f64> {
        let t = record.drive().time(k);
        let values = functions.iter().zip(&scales);
        [1.0]
            .into_iter()
            .chain(values.map(|(f, scale)| f.value(&smoothed.columns, k, t) / scale))
            .chain([smoothed.mean[k]])
            .collect()
    };
    let typical = typical_variance(term);
    let block = samples.div_ceil(Thresholds::DISCOVERY_BLOCKS).max(1);
    let mut blocks: Vec<Sums> = vec![];
    for (smoothed, record) in term.records.iter().zip(records) {
        for from in (0..smoothed.mean.len()).step_by(block) {
            let mut sums = Sums::zero(functions.len() + 2);
            for k in from..(from + block).min(smoothed.mean.len()) {
                let weight = typical / (smoothed.variance[k] + 1e-3 * typical);
                let column = DVector::from_vec(row(smoothed, record, k));
                sums.gram.ger(weight, &column, &column, 1.0);
                sums.samples += 1.0;
            }
            blocks.push(sums);
        }
    }
    let mut whole = Sums::zero(functions.len() + 2);
    blocks.iter().for_each(|b| whole.add(b));
    let (_, spread) = whole.solve(&[0])?;
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let residual = |columns: &[usize]| -> Option<Vec<Vec<f64>>> {
        let (factors, _) = whole.solve(columns)?;
        let of = |smoothed: &Smoothed, record: &Record, k: usize| {
            let row = row(smoothed, record, k);
            let fitted: f64 = columns
                .iter()
                .zip(factors.iter())
                .map(|(c, f)| f * row[*c])
                .sum();
            smoothed.mean[k] - fitted
        };
        Some(
            (term.records.iter().zip(records))
                .map(|(s, record)| (0..s.mean.len()).map(|k| of(s, record, k)).collect())
                .collect(),
        )
    };
    // What no function explains says how many samples are independent.
    let all: Vec<usize> = (0..=functions.len()).collect();
    let time = correlation_time(&residual(&all)?);
    let independent = (samples as f64 / time).max(4.0);
    let chosen = whole.select(independent);
    let (factors, rest) = whole.solve(&chosen)?;

    let mut counts = vec![0.0; functions.len()];
    let mut drawn: Vec<Vec<f64>> = vec![vec![]; functions.len()];
    let mut source = noise.source("blocks");
    for _ in 0..Thresholds::DISCOVERY_RESAMPLES {
        let mut sums = Sums::zero(functions.len() + 2);
        for _ in 0..blocks.len() {
            let b = ((source.uniform() * blocks.len() as f64) as usize).min(blocks.len() - 1);
            sums.add(&blocks[b]);
        }
        let chosen = sums.select(independent);
        let Some((factors, _)) = sums.solve(&chosen) else {
            continue;
        };
        for (c, factor) in chosen.iter().zip(factors.iter()).skip(1) {
            counts[c - 1] += 1.0;
            drawn[c - 1].push(factor / scales[c - 1]);
        }
    }
    let tail = 0.5 * (1.0 - Thresholds::INTERVAL_LEVEL);
    let mut terms: Vec<Term> = (functions.iter().enumerate())
        .filter_map(|(j, function)| {
            let inclusion = counts[j] / Thresholds::DISCOVERY_RESAMPLES as f64;
            let own = chosen.iter().position(|c| *c == j + 1);
            if inclusion < Thresholds::RARE && own.is_none() {
                return None;
            }
            let middle = quantile(&drawn[j], 0.5).unwrap_or(f64::NAN);
            let coefficient = own.map_or(middle, |at| factors[at] / scales[j]);
            let end = |p: f64| quantile(&drawn[j], p).unwrap_or(coefficient);
            Some(Term {
                name: function.name(&term.variables),
                coefficient,
                interval: [end(tail), end(1.0 - tail)],
                inclusion,
            })
        })
        .collect();
    terms.sort_by(|a, b| b.inclusion.total_cmp(&a.inclusion));
    let (first, record) = (term.records.first()?, records.first()?);
    let left = residual(&chosen)?;
    Some(Discovery {
        equation: term.equation.clone(),
        terms,
        explained: (1.0 - rest / spread).max(0.0),
        times: (0..first.mean.len())
            .map(|k| record.drive().time(k))
            .collect(),
        missing: first.mean.clone(),
        std_error: first.variance.iter().map(|v| v.sqrt()).collect(),
        fitted: (first.mean.iter().zip(&left[0]))
            .map(|(d, r)| d - r)
            .collect(),
    })
}

fn typical_variance(term: &MissingTerm) -> f64 {
    let all: Vec<f64> = (term.records.iter())
        .flat_map(|r| r.variance.iter().copied())
        .collect();
    quantile(&all, 0.5).unwrap_or(1.0).max(1e-300)
}

/// 1 + 2·Σ ρ_l up to the first correlation that is nearly none, in samples.
fn correlation_time(series: &[Vec<f64>]) -> f64 {
    let longest = series.iter().map(Vec::len).max().unwrap_or(1);
    let square: f64 = series.iter().flatten().map(|v| v * v).sum();
    let mut time = 1.0;
    for lag in 1..longest / 2 {
        let product: f64 = (series.iter())
            .flat_map(|s| s[lag.min(s.len())..].iter().zip(s))
            .map(|(a, b)| a * b)
            .sum();
        let rho = product / square.max(1e-300);
        if rho < Thresholds::UNCORRELATED {
            break;
        }
        time += 2.0 * rho;
    }
    time
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;

    /// With d = 0.3·x² and correlated noise, x² is in nearly every resampled record, and hardly anything else.
    #[test]
    fn a_square_is_found() {
        let n = 800;
        let mut right = 0;
        for seed in 0..10 {
            let mut source = Noise::new(seed, "discover", 0).source("x");
            let (mut x, mut e) = (0.0, 0.0);
            let mut columns = Signal::zeros((n, 2));
            let mut mean = vec![];
            for k in 0..n {
                x = 0.97 * x + 0.25 * source.normal();
                e = 0.9 * e + 0.05 * source.normal();
                columns[[k, 0]] = x;
                columns[[k, 1]] = source.normal();
                mean.push(0.3 * x * x + e);
            }
            let term = MissingTerm {
                equation: "x".into(),
                records: vec![Smoothed {
                    mean,
                    variance: vec![0.01; n],
                    columns,
                }],
                variables: vec!["x".into(), "u".into()],
            };
            let drive = Drive::autonomous(0.1, n).unwrap();
            let record = Record::new(drive, Signal::zeros((n, 1))).unwrap();
            let discovery = discover(&term, &[record], Noise::new(seed, "t", 0)).unwrap();
            let top = &discovery.terms[0];
            assert_eq!(top.name, "x²", "seed {seed}: {:?}", discovery.terms);
            assert!(top.inclusion > 0.9 && discovery.explained > 0.5);
            assert!(top.interval[0] < top.coefficient && top.coefficient < top.interval[1]);
            right += usize::from(top.interval[0] < 0.3 && 0.3 < top.interval[1]);
        }
        assert!(right >= 6, "{right} intervals of 10");
    }

    #[test]
    fn nothing_is_found_in_noise() {
        let n = 600;
        let mut often = 0;
        for seed in 0..20 {
            let mut source = Noise::new(seed, "none", 0).source("x");
            let mut e = 0.0;
            let columns = Signal::from_shape_fn((n, 2), |_| source.normal());
            let mut mean = vec![];
            for _ in 0..n {
                e = 0.9 * e + source.normal();
                mean.push(e);
            }
            let term = MissingTerm {
                equation: "x".into(),
                records: vec![Smoothed {
                    mean,
                    variance: vec![1.0; n],
                    columns,
                }],
                variables: vec!["x".into(), "u".into()],
            };
            let drive = Drive::autonomous(0.1, n).unwrap();
            let record = Record::new(drive, Signal::zeros((n, 1))).unwrap();
            let discovery = discover(&term, &[record], Noise::new(seed, "t", 0)).unwrap();
            often += usize::from(discovery.terms.iter().any(|t| t.inclusion > 0.8));
        }
        assert!(often <= 3, "{often} of 20");
    }
}
