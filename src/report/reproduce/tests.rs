//! JSON, tables and figures of one small study.

use super::{coverage_svg, first_run_svg, mean_runs_svg, reproduce_json, reproduce_text};
use crate::estimator::{PresetName, PretrainOptions, pretrain};
use crate::evaluate::paper::{
    AnswerRuns, Benchmark, BenchmarkRun, MeanRuns, MonteCarlo, Scenario, ScoredMethod, Scores,
    reference_projects, score,
};
use crate::progress::Progress;
use crate::report::fixture::validator;
use crate::study::Study;
use std::sync::OnceLock;

struct Made {
    study: Study,
    plan: MonteCarlo,
    runs: Vec<BenchmarkRun>,
    scores: Scores,
}

/// Two records of the oscillator, made once.
fn made() -> &'static Made {
    static MADE: OnceLock<Made> = OnceLock::new();
    MADE.get_or_init(|| {
        let project = reference_projects().unwrap().remove(0);
        let study = project.study().clone();
        let options = PretrainOptions {
            preset: PresetName::Paper,
            bank_size: Some(200),
            epochs: Some(2),
            seed: 1,
        };
        let (estimator, _) = pretrain(&project, &options, &Progress::silent()).unwrap();
        let plan = MonteCarlo {
            benchmark: Benchmark::of(&study),
            scenario: Scenario::First,
            runs: 2,
            seed: 1,
        };
        let runs = plan.run_in(&estimator, None, &Progress::silent()).unwrap();
        let scores = score(&study, &plan, &runs);
        Made {
            study,
            plan,
            runs,
            scores,
        }
    })
}

/// The same runs, in which a method never answers.
fn without(silent: ScoredMethod) -> (Vec<BenchmarkRun>, Scores) {
    let mut runs = made().runs.clone();
    for answer in runs.iter_mut().flat_map(|run| &mut run.answers) {
        if answer.method == silent {
            answer.theta = None;
        }
    }
    let scores = score(&made().study, &made().plan, &runs);
    (runs, scores)
}

#[test]
fn the_json_is_the_contracts_in_every_scenario() {
    let Made { study, plan, .. } = made();
    let (_, silent) = without(ScoredMethod::Final);
    for scenario in [
        Scenario::InDistribution,
        Scenario::First,
        Scenario::Second,
        Scenario::Uniform,
        Scenario::Grid,
    ] {
        let plan = MonteCarlo {
            scenario,
            ..plan.clone()
        };
        for scores in [&made().scores, &silent] {
            let value = reproduce_json(study, &plan, PresetName::Paper, scores);
            assert!(validator("reproduce").is_valid(&value), "{value:#}");
        }
    }
    let value = reproduce_json(study, plan, PresetName::Paper, &silent);
    assert!(value["methods"][3]["mse"].is_null() && value["methods"][3]["failed"] == 2);
    assert!(value["methods"][2]["mse"].as_f64().unwrap() < 0.1);
    assert_eq!(value["methods"][2]["paper"]["mse"], 0.0005501);
    assert!(value["methods"][2]["mse_without_scale"].is_null());
    assert_eq!(value["coverage"]["parameters"][0]["of"], 2);
}

#[test]
fn the_table_has_every_row_beside_the_papers() {
    let Made { study, plan, .. } = made();
    let (_, silent) = without(ScoredMethod::TsFine);
    let text = reproduce_text(study, plan, PresetName::Paper, &silent);
    for expected in ["paper: MSE", "1.47e1", "13088"] {
        assert!(text.contains(expected), "{expected} is not in:\n{text}");
    }
    for method in ScoredMethod::all() {
        let rows = text.lines().filter(|l| l.starts_with(&method.label()));
        assert_eq!(
            rows.count(),
            1 + usize::from(method == ScoredMethod::TsFine),
            "{text}"
        );
    }
    assert!(text.contains("TS-fine: no answer on 2 of 2 runs"), "{text}");
    assert!(
        text.contains("90 % interval") && text.contains("nu"),
        "{text}"
    );
    assert!(
        !text.contains("determines"),
        "the oscillator has no invariants"
    );
}

#[test]
fn the_figures_show_every_family_and_leave_out_who_is_silent() {
    let Made { study, plan, .. } = made();
    let (runs, _) = without(ScoredMethod::TsPre);
    let means = MeanRuns::of(study, plan, &runs).unwrap().unwrap();
    let svg = mean_runs_svg(study, &means).unwrap();
    for expected in [
        "mean of 2",
        "Two-Stage: y",
        "PEM: y",
        "dual-EKF: y",
        ">TS-fine<",
    ] {
        assert!(svg.contains(expected), "{expected}");
    }
    assert!(!svg.contains(">TS-pre<"));
    let first = AnswerRuns::of(study, plan, &runs[0]).unwrap();
    let svg = first_run_svg(study, &first);
    assert!(svg.contains(">measured<") && svg.contains(">dual-EKF<") && !svg.contains(">TS-pre<"));
    let uniform = MonteCarlo {
        scenario: Scenario::Uniform,
        ..plan.clone()
    };
    let means = MeanRuns::of(study, &uniform, &runs).unwrap();
    assert!(
        means.is_none(),
        "a mean over different truths shows nothing"
    );
}

/// One panel of coverage and one of errors a parameter, one dot a point; nothing without a grid.
#[test]
fn a_grid_is_a_map() {
    let Made {
        study, plan, runs, ..
    } = made();
    assert!(coverage_svg(study, &made().scores.points).is_none());
    let plan = MonteCarlo {
        scenario: Scenario::Grid,
        ..plan.clone()
    };
    let mut runs = runs.clone();
    runs[1].truth = vec![1.0];
    let points = score(study, &plan, &runs).points;
    let svg = coverage_svg(study, &points).unwrap();
    for part in [
        "nu: share held",
        "nu: rms error",
        "true nu",
        ">prior<",
        ">nominal<",
        "at 2 fixed points with 1 records",
    ] {
        assert!(svg.contains(part), "{part} is not in {svg}");
    }
    // One in the legend.
    assert_eq!(svg.matches("<circle").count(), 2 + 2 + 1);
    assert!(!svg.contains("NaN"));
}

/// The record of a run is made again as it was: the true twin runs through it.
#[test]
fn the_first_record_is_the_one_that_was_estimated() {
    let Made {
        study, plan, runs, ..
    } = made();
    let first = AnswerRuns::of(study, plan, &runs[0]).unwrap();
    let apart = (first.record.outputs() - first.truth.as_ref().unwrap()).mapv(|d| d * d);
    assert!(apart.mean().unwrap().sqrt() < 0.3, "{:?}", apart.mean());
}
