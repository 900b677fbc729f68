//! Scores over many records as tables for people.

use crate::estimator::INTERVAL_LEVEL;
use crate::estimator::PresetName;
use crate::evaluate::paper::{COVERAGE_LEVEL, MonteCarlo, Scenario, Scores};
use crate::report::digits::short;
use crate::report::table::table;
use crate::study::Study;

/// The paper's table with ours beside it; then, where there is such, the errors of what a record determines; then how
/// often the intervals held the truth.
pub fn reproduce_text(
    study: &Study,
    plan: &MonteCarlo,
    preset: PresetName,
    scores: &Scores,
) -> String {
    let theta = match plan.scenario {
        Scenario::InDistribution => "0 (θ from the prior)",
        Scenario::First => "1 (the paper's OOD 1)",
        Scenario::Second => "2 (the paper's OOD 2)",
        Scenario::Uniform => "uniform (θ from the bounds)",
        Scenario::Grid => "grid (fixed θ in and out of the prior)",
    };
    let (name, runs, seed) = (study.name(), plan.runs, plan.seed);
    let title = format!("{name}, scenario {theta}, {runs} runs, preset {preset}, seed {seed}");
    let mut parts = vec![
        format!("{title}\n\n{}", errors(scores)),
        invariants(scores),
        coverage(scores),
        points(study, scores),
        heads(study, scores),
        failures(plan, scores),
    ];
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
}

/// Mean squared errors and times.
fn errors(scores: &Scores) -> String {
    let paper = scores.methods.iter().any(|s| s.published.is_some());
    let mut head = vec!["method", "MSE", "± std. error", "median", "ms"];
    if paper {
        head.extend(["paper: MSE", "ms"]);
    }
    let mut rows = vec![head.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    for s in &scores.methods {
        let mut row = vec![
            s.method.label(),
            figure(s.mse),
            figure(s.mse_std_error),
            figure(s.median),
            time(s.milliseconds),
        ];
        if paper {
            let published = s.published.map(|p| [figure(p.mse), time(p.milliseconds)]);
            row.extend(published.unwrap_or_default());
        }
        rows.push(row);
    }
    table(&rows)
}

/// Mean squared errors of what a record determines.
fn invariants(scores: &Scores) -> String {
    let Some(first) = scores.methods.first() else {
        return String::new();
    };
    let scale = first.mse_without_scale.is_some();
    if first.invariants.is_empty() && !scale {
        return String::new();
    }
    let names = first.invariants.iter().map(|(name, _)| (*name).to_owned());
    let mut rows = vec![
        std::iter::once("method".to_owned())
            .chain(names)
            .chain(scale.then(|| "θ without scale".to_owned()))
            .collect::<Vec<_>>(),
    ];
    for s in &scores.methods {
        let values = s.invariants.iter().map(|(_, mse)| *mse);
        let row = values.chain(s.mse_without_scale).map(figure);
        rows.push(std::iter::once(s.method.label()).chain(row).collect());
    }
    format!("MSE of what the output determines\n\n{}", table(&rows))
}

/// Returns the parts of TS-fine; nothing without a layer.
fn heads(study: &Study, scores: &Scores) -> String {
    let Some(heads) = &scores.heads else {
        return String::new();
    };
    let head = [
        "TS-fine",
        "layer explains",
        "layer and heads",
        "α of the heads",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let space = study.twin().parameters();
    for (j, name) in space.names().into_iter().enumerate() {
        let shares = [
            heads.explained_layer[j],
            heads.explained_both[j],
            heads.alpha[j],
        ];
        let shares = shares.map(|share| format!("{share:.3}"));
        rows.push([vec![name.to_owned()], shares.to_vec()].concat());
    }
    format!(
        "Parts of TS-fine, on simulations that neither saw; MSE of the quadratic layer alone: {}\n\n{}",
        figure(heads.mse_layer),
        table(&rows)
    )
}

/// Returns coverage and error at each point of a grid; nothing without one.
fn points(study: &Study, scores: &Scores) -> String {
    if scores.points.is_empty() {
        return String::new();
    }
    let space = study.twin().parameters();
    let mut head = vec!["θ".to_owned(), "prior".to_owned()];
    for name in space.names() {
        head.extend([format!("{name} held"), "rms error".to_owned()]);
    }
    let mut rows = vec![head];
    for point in &scores.points {
        let theta: Vec<String> = point.theta.iter().map(|v| short(*v)).collect();
        let side = if point.in_prior { "inside" } else { "outside" };
        let mut row = vec![theta.join(", "), side.to_owned()];
        for (covered, rmse) in point.coverage.iter().zip(&point.rmse) {
            row.extend([
                format!("{} of {}", covered.covered, covered.of),
                short(*rmse),
            ]);
        }
        rows.push(row);
    }
    format!(
        "Intervals that held the truth and errors of the tuned heads, by true θ\n\n{}",
        table(&rows)
    )
}

/// Returns the coverage of the intervals.
fn coverage(scores: &Scores) -> String {
    let rows: Vec<Vec<String>> = (scores.coverage.iter())
        .filter(|c| c.of > 0)
        .map(|c| {
            vec![
                c.name.clone(),
                format!("{} of {}", c.covered, c.of),
                format!("{:.0} %", 100.0 * c.share),
                format!(
                    "[{:.0}, {:.0}] %",
                    100.0 * c.interval[0],
                    100.0 * c.interval[1]
                ),
            ]
        })
        .collect();
    if rows.is_empty() {
        String::new()
    } else {
        format!(
            "Runs whose {:.0} % interval of the refitted estimate held the truth, and what that rate may be ({:.0} %)\n\n{}",
            100.0 * INTERVAL_LEVEL,
            100.0 * COVERAGE_LEVEL,
            table(&rows)
        )
    }
}

/// Returns the methods without an answer.
fn failures(plan: &MonteCarlo, scores: &Scores) -> String {
    (scores.methods.iter().filter(|s| s.failed > 0))
        .map(|s| {
            let label = s.method.label();
            format!("{label}: no answer on {} of {} runs\n", s.failed, plan.runs)
        })
        .collect()
}

/// A squared error: three significant digits.
fn figure(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.2e}")
    } else {
        "–".into()
    }
}

fn time(milliseconds: f64) -> String {
    match milliseconds {
        ms if !ms.is_finite() => "–".into(),
        ms if ms >= 1000.0 => format!("{ms:.0}"),
        ms => short(ms),
    }
}
