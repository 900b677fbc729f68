//! Statistics of records at one θ, which measured and simulated records are compared by.

use crate::diagnose::quantify::free_run::{Runner, variances};
use crate::diagnose::quantify::horizon::{HeldOutRows, Predictor, Reach, reaches};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::recoverable;
use crate::record::Record;
use crate::study::StudyError;

/// Discrepancy of records at θ; v are standardised innovations of one output, n of them.
///
/// | statistic | value |
/// |---|---|
/// | spread | ln mean v² |
/// | whiteness | ln Σ n·ρ_l² of v over twenty lags |
/// | tails | ln (mean v⁴ / (mean v²)²) |
/// | bursts | ln Σ n·ρ_l² of v² over twenty lags |
/// | error | ln mean square of predictions so far ahead, over the variance of the output |
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Discrepancy {
    Spread(String),
    /// It counts where the fit claims that all noise is white: of correlated noise a fit knows a few correlations alone.
    Whiteness(String),
    Tails(String),
    Bursts(String),
    /// It counts where no input reacts: a simulated record has the inputs of the measured one, without a controller that answers it, and may
    /// go where the loop does not let the system go.
    Error(Reach, f64),
}

/// Values of all statistics; NaN where one has no meaning.
pub(super) type Look = Vec<f64>;

impl Discrepancy {
    /// All that are looked at.
    pub fn all(problem: &Problem) -> Vec<Self> {
        let outputs = problem.outline().outputs.into_iter();
        let mut all: Vec<Self> = outputs
            .flat_map(|output| {
                let name = output.name;
                [
                    Self::Spread(name.clone()),
                    Self::Whiteness(name.clone()),
                    Self::Tails(name.clone()),
                    Self::Bursts(name),
                ]
            })
            .collect();
        let record = &problem.records[0];
        // One sample ahead is what innovations are.
        let further = reaches(problem, HeldOutRows { record, from: 0 })
            .into_iter()
            .skip(1);
        all.extend(further.map(|reach| Self::Error(reach, record.drive().dt())));
        all
    }

    /// Departure from simulated records that counts, from the distance to their mean in standard deviations: what is less correlated than
    /// noise is no gap, and neither are tails. Independent noise may have any; what comes in bursts or moves predictions shows elsewhere.
    pub fn departure(&self, deviations: f64, is_white: bool, is_open_loop: bool) -> f64 {
        match self {
            Self::Tails(_) => 0.0,
            Self::Whiteness(_) if !is_white => 0.0,
            Self::Error(..) if !is_open_loop => 0.0,
            Self::Spread(_) | Self::Error(..) => deviations.abs(),
            Self::Whiteness(_) | Self::Bursts(_) => deviations.max(0.0),
        }
    }

    /// Returns whether it is the error of windows, and no free run's.
    pub fn is_window(&self) -> bool {
        matches!(self, Self::Error(Reach::Samples(_), _))
    }

    /// Name in reports.
    pub fn id(&self) -> String {
        match self {
            Self::Spread(output) => format!("spread of {output}"),
            Self::Whiteness(output) => format!("whiteness of {output}"),
            Self::Tails(output) => format!("tails of {output}"),
            Self::Bursts(output) => format!("bursts of {output}"),
            Self::Error(Reach::FreeRun, _) => "error of the free run".into(),
            Self::Error(Reach::Samples(h), dt) => {
                format!("error {} s ahead", crate::math::six_digits(*h as f64 * dt))
            }
        }
    }

    /// The value as it is reported: errors as root mean squares, all else as it is in the table above without its logarithm.
    pub fn shown(&self, value: f64) -> f64 {
        match self {
            Self::Error(..) | Self::Spread(_) => (0.5 * value).exp(),
            _ => value.exp(),
        }
    }
}

/// A runner beside each record, begun as the record shows; `None` where that cannot be told.
pub(super) fn runners(
    problem: &Problem,
    records: &[Record],
    theta: &[f64],
) -> Result<Vec<Option<Runner>>, StudyError> {
    (records.iter().enumerate())
        .map(|(r, record)| {
            let alone = problem.on(std::slice::from_ref(record));
            Runner::new(&alone, &alone.full(&problem.of_record(r, theta)))
        })
        .collect()
}

/// The statistics of records like the problem's at its full θ; `None` where the filter or a run fails.
pub(super) fn look(
    problem: &Problem,
    records: &[Record],
    theta: &[f64],
    statistics: &[Discrepancy],
) -> Result<Option<Look>, StudyError> {
    let Some(filtered) = recoverable(problem.on(records).filtered(theta))? else {
        return Ok(None);
    };
    let mut predictors = vec![];
    for (r, runner) in runners(problem, records, theta)?.into_iter().enumerate() {
        let Some(runner) = runner else {
            return Ok(None);
        };
        predictors.push(Predictor {
            problem: problem.clone(),
            theta: problem.of_record(r, theta),
            runner,
        });
    }
    let series = |output: &str| -> Vec<Vec<f64>> {
        let outline = problem.outline();
        let j = outline
            .outputs
            .iter()
            .position(|o| o.name == output)
            .unwrap_or(0);
        (filtered.iter().zip(records))
            .map(|(filtered, record)| {
                let v = filtered.standardised.column(j);
                let y = record.outputs().column(j);
                v.iter()
                    .zip(y)
                    .map(|(v, y)| if y.is_nan() { f64::NAN } else { *v })
                    .collect()
            })
            .collect()
    };
    let value = |statistic: &Discrepancy| -> Result<f64, StudyError> {
        Ok(match statistic {
            Discrepancy::Spread(output) => mean_power(&series(output), 2).ln(),
            Discrepancy::Whiteness(output) => correlation(&series(output)).ln(),
            Discrepancy::Tails(output) => {
                let series = series(output);
                (mean_power(&series, 4) / mean_power(&series, 2).powi(2)).ln()
            }
            Discrepancy::Bursts(output) => correlation(&squared(&series(output))).ln(),
            Discrepancy::Error(reach, _) => {
                let (mut sum, mut count) = (0.0, 0);
                for ((predictor, record), own) in
                    predictors.iter().zip(records).zip(problem.records.iter())
                {
                    let rows = HeldOutRows { record, from: 0 };
                    // In units of the measured record, as a simulated one may hardly move.
                    let scale = variances(own.outputs());
                    let errors = predictor.errors(rows, *reach, &scale)?.unwrap_or_default();
                    sum += errors.iter().sum::<f64>();
                    count += errors.len();
                }
                (sum / count as f64).ln()
            }
        })
    };
    let values: Look = statistics.iter().map(value).collect::<Result<_, _>>()?;
    Ok(Some(values))
}

/// Mean of a power over all records, without missing values.
pub(super) fn mean_power(series: &[Vec<f64>], power: i32) -> f64 {
    let there = series.iter().flatten().filter(|v| !v.is_nan());
    let (sum, count) = there.fold((0.0, 0.0), |(s, n), v| (s + v.powi(power), n + 1.0));
    sum / count
}

/// The squares about their mean.
pub(super) fn squared(series: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mean = mean_power(series, 2);
    let square = |v: &f64| v * v - mean;
    series
        .iter()
        .map(|all| all.iter().map(square).collect())
        .collect()
}

/// Σ n·ρ_l² over the lags, n the number of pairs.
pub(super) fn correlation(series: &[Vec<f64>]) -> f64 {
    let power = mean_power(series, 2);
    (1..=THRESHOLDS.lags)
        .map(|lag| {
            let pairs = (series.iter()).flat_map(|all| all.iter().zip(all.iter().skip(lag)));
            let there = pairs
                .map(|(a, b)| a * b)
                .filter(|product| !product.is_nan());
            let (sum, count) = there.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
            if count == 0.0 {
                0.0
            } else {
                sum * sum / (count * power * power)
            }
        })
        .sum()
}
