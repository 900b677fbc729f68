//! Missing term of an equation: the smoothed disturbance there, and its means in ranges of states and inputs.

use crate::diagnose::context::Context;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::explain::attribute::{Explanation, explanations, probabilities};
use crate::diagnose::hypotheses::candidate::{Kind, candidates};
use crate::diagnose::hypotheses::entry::Entry;
use crate::diagnose::outcome::{Equation, TermRange};
use crate::diagnose::residuals::cut::edges;
use crate::diagnose::test::fitted_twin::FittedTwin;
use crate::diagnose::test::null::Test;
use crate::diagnose::thresholds::Thresholds;
use crate::likelihood::kalman::{FilterError, FilterSettings, Kalman, recoverable};
use crate::progress::Stage;
use crate::record::{Record, Signal};
use crate::twin::StateSpace;

/// A disturbance in one equation, given the whole of each record.
pub(in crate::diagnose) struct MissingTerm {
    /// The state whose rate, or the output whose value, the equation gives.
    pub equation: String,
    pub records: Vec<Smoothed>,
    /// Names of the own states and the inputs.
    pub variables: Vec<String>,
}

/// One record of it.
pub(in crate::diagnose) struct Smoothed {
    pub mean: Vec<f64>,
    pub variance: Vec<f64>,
    /// Own states given the whole record, then inputs: what acts together with the term (N × variables).
    pub columns: Signal,
}

/// The best disturbance of each equation, most probable first, with its probability among these.
pub(in crate::diagnose) fn disturbances<'e>(
    model: &FittedTwin<'_>,
    explanations: &'e [Explanation],
) -> Vec<(&'e Explanation, f64)> {
    let mut best: Vec<Explanation> = vec![];
    let mut entries: Vec<Entry> = vec![];
    let mut which: Vec<&Explanation> = vec![];
    for e in explanations {
        // Best first.
        let Kind::CatchAll(entry, _) = &model.candidate(e).kind else {
            continue;
        };
        if matches!(entry, Entry::Parameter(_)) || entries.contains(entry) {
            continue;
        }
        entries.push(*entry);
        best.push(e.clone());
        which.push(e);
    }
    which.into_iter().zip(probabilities(&best)).collect()
}

/// Smooths the disturbance of an explanation; `None` where its filter does not work.
pub(in crate::diagnose) fn missing_term(
    model: &FittedTwin<'_>,
    explanation: &Explanation,
) -> Result<Option<MissingTerm>, FilterError> {
    let problem = model.explained(explanation);
    let twin = problem.twin.clone();
    let Some(equations) = twin.equations() else {
        return Ok(None);
    };
    let own = model.bins.states;
    let mut records = vec![];
    for (r, record) in problem.records.iter().enumerate() {
        let theta = problem.of_record(r, &explanation.fitted.theta);
        let Some(smoothed) = smooth(equations, record, &theta, own)? else {
            return Ok(None);
        };
        records.push(smoothed);
    }
    let inputs = problem.records[0].drive().inputs().ncols();
    let candidate = model.candidate(explanation);
    let equation = match &candidate.kind {
        Kind::CatchAll(Entry::Sensor(j), _) => twin.signals().outputs[*j].name.clone(),
        _ => candidate.target.clone(),
    };
    Ok(Some(MissingTerm {
        equation,
        records,
        variables: model.bins.variables[..own + inputs].to_vec(),
    }))
}

fn smooth(
    equations: &dyn StateSpace,
    record: &Record,
    theta: &[f64],
    own: usize,
) -> Result<Option<Smoothed>, FilterError> {
    let settings = FilterSettings::default();
    let kalman = Kalman::new(equations, record, &settings)?;
    let Some(smoothed) = recoverable(kalman.smooth(theta))? else {
        return Ok(None);
    };
    let (means, covariances) = (&smoothed.states.means, &smoothed.states.covariances);
    // The disturbance is the last state.
    let d = means.ncols() - 1;
    let inputs = record.drive().inputs();
    Ok(Some(Smoothed {
        mean: means.column(d).to_vec(),
        variance: (0..means.nrows())
            .map(|k| covariances[[k, d, d]].max(0.0))
            .collect(),
        columns: Signal::from_shape_fn((means.nrows(), own + inputs.ncols()), |(k, v)| {
            if v < own {
                means[[k, v]]
            } else {
                inputs[[k, v - own]]
            }
        }),
    }))
}

/// Disturbances of a twin that has none among its candidates, as its free run is to follow the record: fitted apart, for the
/// map alone.
pub(in crate::diagnose) fn apart<'a>(
    context: &Context<'a>,
    model: &FittedTwin<'a>,
    stage: &Stage,
) -> Result<Option<(FittedTwin<'a>, Vec<Explanation>)>, DiagnoseError> {
    let all = candidates(context.study, &[])?;
    let disturbances = all
        .into_iter()
        .filter(|c| matches!(c.kind, Kind::CatchAll(entry, memory) if is_long(entry, memory)))
        .collect();
    let (problem, fitted) = (model.problem.clone(), model.fitted.clone());
    let Some(model) = FittedTwin::new(context.twin, problem, fitted, &[], disturbances)? else {
        return Ok(None);
    };
    let Some(statistics) = model.own_statistics()? else {
        return Ok(None);
    };
    let explanations = explanations(&model, &statistics, None, None, stage)?;
    Ok(Some((model, explanations)))
}

/// A disturbance of an equation that wanders freely.
fn is_long(entry: Entry, memory: f64) -> bool {
    memory == 1.0 && !matches!(entry, Entry::Parameter(_))
}

/// `where.equations`: each with the disturbance's probability, and what it does by ranges. Without a test of the disturbances, p is
/// that of the likelihood ratio, χ² with two degrees, times the number of equations.
pub(in crate::diagnose) fn equations(
    model: &FittedTwin<'_>,
    explanations: &[Explanation],
    test: Option<&Test>,
) -> Result<Vec<Equation>, FilterError> {
    let entries = disturbances(model, explanations);
    let count = entries.len() as f64;
    let mut all = vec![];
    for (explanation, share) in entries {
        let Some(term) = missing_term(model, explanation)? else {
            continue;
        };
        let candidates = &model.dictionary.candidates;
        let target = &candidates[explanation.candidate].target;
        let p_value = match test {
            Some(test) => (candidates.iter().zip(&test.candidates))
                .filter(|(c, _)| !c.is_listed() && c.target == *target)
                .map(|(_, p)| *p)
                .fold(1.0, f64::min),
            // exp(−x/2) is the survival function of χ² with two degrees.
            None => (count * (-explanation.gain.max(0.0)).exp()).min(1.0),
        };
        all.push(Equation {
            equation: term.equation.clone(),
            p_value,
            share,
            term: term.ranges(),
        });
    }
    Ok(all)
}

impl MissingTerm {
    /// Its mean where each variable is in each of a few ranges.
    fn ranges(&self) -> Vec<TermRange> {
        let mut all = vec![];
        for (v, variable) in self.variables.iter().enumerate() {
            let values: Vec<f64> = (self.records.iter())
                .flat_map(|r| r.columns.column(v).to_vec())
                .collect();
            all.extend(edges(&values).windows(2).filter_map(|e| {
                let (mean, std_error) = self.mean_within(v, e[0], e[1])?;
                Some(TermRange {
                    variable: variable.clone(),
                    low: e[0],
                    high: e[1],
                    mean,
                    std_error,
                })
            }));
        }
        all
    }

    /// Mean and its standard deviation: of blocks of time, as neighbours depend on each other, and of the smoother.
    fn mean_within(&self, variable: usize, low: f64, high: f64) -> Option<(f64, f64)> {
        let (mut n, mut sum, mut variance) = (0.0, 0.0, 0.0);
        let mut blocks: Vec<(f64, f64)> = vec![];
        for record in &self.records {
            let length = record.mean.len().div_ceil(Thresholds::TERM_BLOCKS).max(1);
            for (b, block) in record.mean.chunks(length).enumerate() {
                let (mut count, mut total) = (0.0, 0.0);
                for (i, d) in block.iter().enumerate() {
                    let k = b * length + i;
                    if (low..=high).contains(&record.columns[[k, variable]]) {
                        count += 1.0;
                        total += d;
                        variance += record.variance[k];
                    }
                }
                n += count;
                sum += total;
                blocks.push((count, total));
            }
        }
        if n == 0.0 {
            return None;
        }
        let mean = sum / n;
        let visited = blocks.iter().filter(|(count, _)| *count > 0.0).count() as f64;
        let spread: f64 = blocks.iter().map(|(c, t)| (t - c * mean).powi(2)).sum();
        // The smoother's error of a block is about one draw.
        let of_smoother = variance / n / visited;
        Some((mean, (spread / (n * n) + of_smoother).sqrt()))
    }
}
