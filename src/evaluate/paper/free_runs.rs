//! Noise-free runs of the twin at the methods' answers.

use super::{BenchmarkRun, MonteCarlo, ScoredMethod};
use crate::evaluate::EvaluateError;
use crate::record::{Record, Signal};
use crate::study::Study;

/// One run's record, and noise-free runs of the twin at the truth and at every answer.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct AnswerRuns {
    /// The record, simulated again.
    pub record: Record,
    /// N × channels.
    pub truth: Option<Signal>,
    /// In the order of [`ScoredMethod::all`]; `None` without an answer, or where the twin diverges there.
    pub answers: Vec<(ScoredMethod, Option<Signal>)>,
}

impl AnswerRuns {
    /// Simulates the twin at the truth and the answers of a run of `plan`.
    pub fn of(study: &Study, plan: &MonteCarlo, run: &BenchmarkRun) -> Result<Self, EvaluateError> {
        let draws = plan.draws(study)?;
        let record = draws.simulated(plan.seed, run.run)?.record;
        // A free run may diverge where noisy runs do not.
        let at = |theta: &[f64]| study.twin().free_run(theta, record.drive()).ok();
        let answers = (run.answers.iter())
            .map(|answer| (answer.method, answer.theta.as_deref().and_then(at)))
            .collect();
        Ok(Self {
            truth: at(&run.truth),
            answers,
            record,
        })
    }
}

/// The mean over runs of the noise-free trajectories, as in the paper's figures.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct MeanRuns {
    /// In seconds.
    pub times: Vec<f64>,
    /// At the truth, N × channels; `None` where the twin diverges there.
    pub truth: Option<Signal>,
    /// At the answers, in the order of [`ScoredMethod::all`]; `None` without any run to draw.
    pub answers: Vec<(ScoredMethod, Option<Signal>)>,
    /// Number of runs.
    pub runs: usize,
}

impl MeanRuns {
    /// Averages over runs of `plan`; `None` without runs, or where their true parameters differ so that a mean shows nothing.
    pub fn of(
        study: &Study,
        plan: &MonteCarlo,
        runs: &[BenchmarkRun],
    ) -> Result<Option<Self>, EvaluateError> {
        if !plan.scenario.is_point() || runs.is_empty() {
            return Ok(None);
        }
        let mut truth = None;
        let mut answers: Vec<Sum> = vec![None; ScoredMethod::all().len()];
        let mut times = Vec::new();
        for run in runs {
            let one = AnswerRuns::of(study, plan, run)?;
            if times.is_empty() {
                times = one.record.drive().times();
            }
            add(&mut truth, one.truth);
            for (sum, (_, signal)) in answers.iter_mut().zip(one.answers) {
                add(sum, signal);
            }
        }
        Ok(Some(Self {
            times,
            truth: mean(truth),
            answers: (ScoredMethod::all().into_iter())
                .zip(answers.into_iter().map(mean))
                .collect(),
            runs: runs.len(),
        }))
    }
}

/// Sum and number of signals so far.
type Sum = Option<(Signal, f64)>;

fn add(sum: &mut Sum, signal: Option<Signal>) {
    match (sum, signal) {
        (_, None) => {}
        (sum @ None, Some(signal)) => *sum = Some((signal, 1.0)),
        (Some((sum, count)), Some(signal)) => {
            *sum += &signal;
            *count += 1.0;
        }
    }
}

fn mean(sum: Sum) -> Option<Signal> {
    sum.map(|(sum, count)| sum / count)
}
