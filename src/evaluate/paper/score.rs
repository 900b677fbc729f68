//! Errors and coverage over many runs.

use super::{BenchmarkRun, MonteCarlo, Published, Scenario, ScoredMethod};
use crate::estimator::Contributions;
use crate::evaluate::Count;
use crate::math::median;
use crate::study::Study;
use crate::twin::ParameterSpace;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Errors and coverage of the runs of a study.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Scores {
    /// In the order of [`ScoredMethod::all`].
    pub methods: Vec<MethodScore>,
    /// Coverage of the truth by the refitted estimate's interval, by parameter.
    pub coverage: Vec<Coverage>,
    /// Errors and coverage at each point of [`Scenario::Grid`]; empty otherwise.
    pub points: Vec<PointScore>,
    /// Contributions of layer and heads to TS-fine, where there is a layer.
    pub(crate) heads: Option<HeadScore>,
    /// Runs without an estimate.
    pub failed: usize,
}

/// Mean contributions to the tuned estimates, by parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct HeadScore {
    /// Weight of the heads beside the quadratic layer, from 0 to 1.
    pub alpha: Vec<f64>,
    /// Share of the cloud's variance that the layer alone explains.
    pub explained_layer: Vec<f64>,
    /// The same of layer and heads.
    pub explained_both: Vec<f64>,
    /// Mean squared error of the layer alone.
    pub mse_layer: f64,
}

/// Errors and coverage of the refitted estimate at one θ.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PointScore {
    /// True parameters.
    pub theta: Vec<f64>,
    /// True if they lie in the prior.
    pub in_prior: bool,
    /// Root mean squared error of each parameter; NaN where a run failed.
    pub rmse: Vec<f64>,
    /// By parameter.
    pub coverage: Vec<Coverage>,
}

/// Error of one method.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct MethodScore {
    /// Method.
    #[serde(flatten, serialize_with = "named")]
    pub method: ScoredMethod,
    /// Mean over runs and parameters of the squared error; NaN where the method cannot be used or failed on a run.
    pub mse: f64,
    /// Standard error of `mse`, from its scatter over runs; NaN for a single run.
    pub mse_std_error: f64,
    /// Median over runs of the squared error averaged over parameters; a run that failed counts as infinitely wrong.
    pub median: f64,
    /// Mean wall-clock time of an answer, milliseconds; NaN without any.
    #[serde(rename = "ms")]
    pub milliseconds: f64,
    /// Runs without an answer.
    pub failed: usize,
    /// Mean squared error of what a record determines, by name; as `mse` otherwise.
    #[serde(serialize_with = "as_map")]
    pub invariants: Vec<(&'static str, f64)>,
    /// As `mse`, without the part along what a record does not determine; `None` where there is no such part.
    pub mse_without_scale: Option<f64>,
    /// Published figures for this twin, scenario and method.
    #[serde(rename = "paper")]
    pub published: Option<Published>,
}

/// Runs with an estimate, and those whose interval held the true value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Coverage {
    /// Parameter.
    pub name: String,
    #[serde(flatten)]
    pub(crate) held: Count,
    /// Share of the runs; NaN without estimates.
    pub share: f64,
}

/// Writes a method's name and its start.
fn named<S: Serializer>(method: &ScoredMethod, serializer: S) -> Result<S::Ok, S::Error> {
    let mut object = serializer.serialize_struct("Method", 2)?;
    object.serialize_field("method", &method.to_string())?;
    let start = method.initialisation().map(|start| start.to_string());
    object.serialize_field("initialisation", &start)?;
    object.end()
}

/// Writes names and values as one object.
fn as_map<S: Serializer>(pairs: &[(&str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().copied())
}

/// Scores the runs of `plan`.
pub fn score(study: &Study, plan: &MonteCarlo, runs: &[BenchmarkRun]) -> Scores {
    let space = study.twin().parameters();
    let across = (plan.benchmark.symmetry).and_then(|symmetry| symmetry.bind(&space));
    let invariants: Vec<_> = (plan.benchmark.invariants.iter())
        .filter_map(|invariant| Some((invariant.name, invariant.bind(&space)?)))
        .collect();
    let methods = (ScoredMethod::all().into_iter().enumerate())
        .map(|(m, method)| {
            let errors = |of: &dyn Fn(&[f64], &[f64]) -> f64| -> Vec<f64> {
                (runs.iter())
                    .map(|run| match &run.answers[m].theta {
                        Some(theta) => of(theta, &run.truth),
                        None => f64::NAN,
                    })
                    .collect()
            };
            let squares = errors(&|theta, truth| {
                let squares = theta.iter().zip(truth).map(|(a, b)| square(a - b));
                squares.sum::<f64>() / truth.len() as f64
            });
            let ranked: Vec<f64> = (squares.iter())
                .map(|e| if e.is_nan() { f64::INFINITY } else { *e })
                .collect();
            let times: Vec<f64> = (runs.iter().map(|run| &run.answers[m]))
                .filter(|answer| answer.theta.is_some())
                .map(|answer| answer.ms)
                .collect();
            MethodScore {
                method,
                mse: mean(&squares),
                mse_std_error: std_error(&squares),
                median: median(&ranked).unwrap_or(f64::NAN),
                milliseconds: mean(&times),
                failed: squares.iter().filter(|e| e.is_nan()).count(),
                invariants: (invariants.iter())
                    .map(|(name, of)| {
                        let squares = errors(&|theta, truth| square(of(theta) - of(truth)));
                        (*name, mean(&squares))
                    })
                    .collect(),
                mse_without_scale: (across.as_ref())
                    .map(|across| mean(&errors(&|theta, truth| across(theta, truth)))),
                published: (plan.benchmark.published.iter())
                    .find(|(of, _)| *of == method && plan.scenario == Scenario::First)
                    .map(|(_, published)| *published),
            }
        })
        .collect();
    let coverage = (space.names().into_iter().enumerate())
        .map(|(j, name)| covered(name, j, runs))
        .collect();
    let points = match plan.scenario {
        Scenario::Grid => points(&space, runs),
        _ => vec![],
    };
    Scores {
        methods,
        coverage,
        points,
        heads: heads(runs),
        failed: runs.iter().filter(|run| run.failure.is_some()).count(),
    }
}

/// Means over the runs that have a layer.
fn heads(runs: &[BenchmarkRun]) -> Option<HeadScore> {
    let all: Vec<(&Contributions, &BenchmarkRun)> = (runs.iter())
        .filter_map(|run| Some((run.contributions.as_ref()?, run)))
        .collect();
    let (first, _) = all.first()?;
    let means = |of: fn(&Contributions) -> &[f64]| -> Vec<f64> {
        (0..first.alpha.len())
            .map(|j| mean(&all.iter().map(|(c, _)| of(c)[j]).collect::<Vec<_>>()))
            .collect()
    };
    let squares = all.iter().map(|(c, run)| {
        let squares = c.theta.iter().zip(&run.truth).map(|(a, b)| square(a - b));
        squares.sum::<f64>() / run.truth.len() as f64
    });
    Some(HeadScore {
        alpha: means(|c| &c.alpha),
        explained_layer: means(|c| &c.layer),
        explained_both: means(|c| &c.both),
        mse_layer: mean(&squares.collect::<Vec<_>>()),
    })
}

/// Scores of the runs at each true θ, in the order of their first runs.
fn points(space: &ParameterSpace, runs: &[BenchmarkRun]) -> Vec<PointScore> {
    let mut truths: Vec<&Vec<f64>> = vec![];
    for run in runs {
        if !truths.contains(&&run.truth) {
            truths.push(&run.truth);
        }
    }
    (truths.into_iter())
        .map(|theta| {
            let own: Vec<&BenchmarkRun> = runs.iter().filter(|run| run.truth == *theta).collect();
            let fine = |run: &BenchmarkRun| {
                let answer = run
                    .answers
                    .iter()
                    .find(|a| a.method == ScoredMethod::TsFine);
                answer.and_then(|answer| answer.theta.clone())
            };
            let rmse = |j: usize| {
                let squares = (own.iter())
                    .map(|run| fine(run).map_or(f64::NAN, |found| square(found[j] - theta[j])));
                mean(&squares.collect::<Vec<_>>()).sqrt()
            };
            let names = space.names().into_iter().enumerate();
            PointScore {
                in_prior: (space.iter().zip(theta)).all(|(p, value)| p.prior.contains(*value)),
                rmse: (0..theta.len()).map(rmse).collect(),
                coverage: names
                    .map(|(j, name)| covered(name, j, own.iter().copied()))
                    .collect(),
                theta: theta.clone(),
            }
        })
        .collect()
}

/// Coverage of parameter number `j`.
fn covered<'r>(name: &str, j: usize, runs: impl IntoIterator<Item = &'r BenchmarkRun>) -> Coverage {
    let case = |run: &BenchmarkRun| {
        let interval = run.interval.get(j).copied();
        let holds = |[low, high]: [f64; 2]| (low..=high).contains(&run.truth[j]);
        Count::case(interval.is_some(), interval.flatten().is_some_and(holds))
    };
    let held: Count = runs.into_iter().map(case).sum();
    Coverage {
        name: name.into(),
        held,
        share: held.share().unwrap_or(f64::NAN),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The square of an error; NaN where a number cannot hold it.
fn square(error: f64) -> f64 {
    match error * error {
        square if square.is_normal() || error == 0.0 => square,
        _ => f64::NAN,
    }
}

/// Standard deviation over √n; NaN for fewer than two values.
fn std_error(values: &[f64]) -> f64 {
    let (n, mean) = (values.len() as f64, mean(values));
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    match values.len() {
        0 | 1 => f64::NAN,
        _ => (squares / (n - 1.0) / n).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::run::MethodAnswer;
    use crate::evaluate::paper::{Benchmark, reference_studies};

    const TRUTH: [f64; 4] = [1.2, 1.2, 0.9, 1.0];

    /// A run in which every method answers θ, with this interval for each parameter.
    fn run(number: usize, theta: Option<[f64; 4]>, interval: [f64; 2]) -> BenchmarkRun {
        let answer = |method| MethodAnswer {
            method,
            theta: theta.map(Vec::from),
            ms: 2.0 + number as f64,
        };
        BenchmarkRun {
            run: number,
            truth: TRUTH.into(),
            interval: theta.map_or(vec![], |_| vec![Some(interval); 4]),
            answers: ScoredMethod::all().into_iter().map(answer).collect(),
            failure: theta.is_none().then(|| "no start".to_owned()),
            contributions: None,
        }
    }

    #[test]
    fn parts_are_means_over_the_runs_that_have_them() {
        let part = |alpha: f64, off: f64| Contributions {
            alpha: vec![alpha; 4],
            layer: vec![0.5; 4],
            both: vec![0.75; 4],
            theta: TRUTH.map(|v| v + off).into(),
        };
        let mut runs = [0, 1, 2].map(|number| run(number, Some(TRUTH), [0.0, 1.0]));
        runs[0].contributions = Some(part(0.2, 0.1));
        runs[1].contributions = Some(part(0.6, 0.3));
        let heads = heads(&runs).unwrap();
        assert!((heads.alpha[3] - 0.4).abs() < 1e-12 && (heads.mse_layer - 0.05).abs() < 1e-12);
        assert_eq!(super::heads(&runs[2..]), None);
    }

    fn scored(scenario: Scenario, runs: &[BenchmarkRun]) -> Scores {
        let study = &reference_studies().unwrap()[1];
        let plan = MonteCarlo {
            benchmark: Benchmark::of(study),
            scenario,
            runs: runs.len(),
            seed: 1,
        };
        score(study, &plan, runs)
    }

    /// Errors of 0.2 and 0.4 in k3 alone: squares over four parameters 0.01 and 0.04.
    #[test]
    fn errors_times_and_coverage_are_those_of_the_runs() {
        let at = |k3: f64| Some([1.2, 1.2, k3, 1.0]);
        let scores = scored(
            Scenario::First,
            &[run(0, at(1.1), [0.8, 1.1]), run(1, at(0.5), [0.95, 2.0])],
        );
        let row = &scores.methods[0];
        assert!((row.mse - 0.025).abs() < 1e-12 && (row.median - 0.025).abs() < 1e-12);
        assert!((row.mse_std_error - 0.015).abs() < 1e-12);
        assert_eq!((row.milliseconds, row.failed), (2.5, 0));
        assert_eq!(row.published.unwrap().mse, 0.1189);
        let (names, values): (Vec<_>, Vec<_>) = row.invariants.iter().copied().unzip();
        assert_eq!(names, ["k1·k2", "k3", "k4·k2²"]);
        assert!(values[0] == 0.0 && (values[1] - 0.1).abs() < 1e-12 && values[2] == 0.0);
        assert!((row.mse_without_scale.unwrap() - 0.025).abs() < 1e-12);
        let held: Vec<u64> = scores.coverage.iter().map(|c| c.held.count).collect();
        assert_eq!(
            held,
            [1, 1, 1, 2],
            "1.2, 1.2, 0.9, 1.0 in [0.8, 1.1], [0.95, 2.0]"
        );
        assert_eq!(
            (
                scores.coverage[3].held.of,
                scores.coverage[3].held.interval().1
            ),
            (2, 1.0)
        );
    }

    /// e = (k1/2, −k2/2, 0, k4)/100 at the truth.
    #[test]
    fn an_error_along_the_scale_is_none_without_it() {
        let along = Some([1.206, 1.194, 0.9, 1.01]);
        let scores = scored(Scenario::Second, &[run(0, along, [0.0, 2.0])]);
        let row = &scores.methods[2];
        assert!(row.mse > 1e-5 && row.mse_without_scale.unwrap() < 1e-20);
        assert!(row.mse_std_error.is_nan(), "one run has no scatter");
        assert_eq!(row.published, None, "the table is of the first scenario");
    }

    #[test]
    fn a_failure_spoils_the_mean_and_not_the_median() {
        let good = || Some([1.2, 1.2, 1.1, 1.0]);
        let ends = [0.0, 2.0];
        let runs = [
            run(0, good(), ends),
            run(1, None, ends),
            run(2, good(), ends),
        ];
        let scores = scored(Scenario::Uniform, &runs);
        let row = &scores.methods[3];
        assert!(row.mse.is_nan() && (row.median - 0.01).abs() < 1e-12);
        assert_eq!((row.failed, scores.failed, row.milliseconds), (1, 1, 3.0));
        assert_eq!(scores.coverage[0].held, Count { count: 2, of: 2 });
    }
}
