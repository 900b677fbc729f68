//! Scores over many records as JSON, `truetwin.reproduce/1`, and as tables for people.

use crate::estimator::{INTERVAL_LEVEL, PresetName};
use crate::evaluate::LEVEL;
use crate::evaluate::paper::{Coverage, MethodScore, MonteCarlo, Scenario, Scores};
use crate::report::digits::short;
use crate::report::document::{Block, Column, Document};
use crate::setting::count;
use crate::study::Study;
use serde_json::{Value, json};

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
    let runs = count(runs, "run");
    let title = format!("{name}, scenario {theta}, {runs}, preset {preset}, seed {seed}");
    let names = study.twin().parameters();
    let names = names.names();
    let failures = (scores.methods.iter().filter(|s| s.failed > 0))
        .map(|s| format!("{}: no answer on {} of {runs}", s.method.label(), s.failed));
    let tables = [
        Some(errors(&title, scores)),
        invariants(scores),
        coverage(scores),
        points(&names, scores),
        heads(&names, scores),
    ];
    Document {
        answer: (tables.into_iter().flatten())
            .chain(failures.map(Block::Paragraph))
            .collect(),
        ..Document::default()
    }
    .text()
}

/// A table of one line a method.
fn by_method(
    caption: impl Into<String>,
    columns: &[&str],
    scores: &Scores,
    cells: impl Fn(&MethodScore) -> Vec<String>,
) -> Block {
    let row = |score: &MethodScore| [vec![score.method.label()], cells(score)].concat();
    rows(caption, "method", columns, scores.methods.iter().map(row))
}

/// A table whose lines begin with a name and go on with numbers.
fn rows(
    caption: impl Into<String>,
    name: &str,
    columns: &[&str],
    rows: impl Iterator<Item = Vec<String>>,
) -> Block {
    let numbers = columns.iter().map(|column| (*column, Column::Number));
    let head: Vec<_> = [(name, Column::Text)].into_iter().chain(numbers).collect();
    Block::table(caption, &head, rows.collect())
}

/// Mean squared errors and times.
fn errors(title: &str, scores: &Scores) -> Block {
    let mut columns = vec!["MSE", "± std. error", "median", "ms"];
    if scores.methods.iter().any(|s| s.published.is_some()) {
        columns.extend(["paper: MSE", "ms"]);
    }
    by_method(title, &columns, scores, |s| {
        let own = [s.mse, s.mse_std_error, s.median].map(figure);
        let published = s.published.map(|p| [figure(p.mse), time(p.milliseconds)]);
        let published = published.into_iter().flatten();
        own.into_iter()
            .chain([time(s.milliseconds)])
            .chain(published)
            .collect()
    })
}

/// Mean squared errors of what a record determines; none where that is all of θ.
fn invariants(scores: &Scores) -> Option<Block> {
    let first = scores.methods.first()?;
    let mut columns: Vec<&str> = first.invariants.iter().map(|(name, _)| *name).collect();
    columns.extend(first.mse_without_scale.map(|_| "θ without scale"));
    let caption = "MSE of what the output determines";
    (!columns.is_empty()).then(|| {
        by_method(caption, &columns, scores, |s| {
            let values = s.invariants.iter().map(|(_, mse)| *mse);
            values.chain(s.mse_without_scale).map(figure).collect()
        })
    })
}

/// Coverage of the intervals; none without estimates.
fn coverage(scores: &Scores) -> Option<Block> {
    let known = || scores.coverage.iter().filter(|c| c.held.of > 0);
    let caption = format!(
        "Runs whose {:.0} % interval of the refitted estimate held the truth, and what that rate may be ({:.0} %)",
        100.0 * INTERVAL_LEVEL,
        100.0 * LEVEL
    );
    let row = |c: &Coverage| {
        let (low, high) = c.held.interval();
        let share = format!("{:.0} %", 100.0 * c.share);
        vec![
            c.name.clone(),
            held(c),
            share,
            format!("[{:.0}, {:.0}] %", 100.0 * low, 100.0 * high),
        ]
    };
    let columns = ["held", "share", "rate"];
    known().next()?;
    Some(rows(caption, "parameter", &columns, known().map(row)))
}

/// Coverage and error at each point of a grid; none without one.
fn points(names: &[&str], scores: &Scores) -> Option<Block> {
    scores.points.first()?;
    let held_of: Vec<String> = names.iter().map(|name| format!("{name} held")).collect();
    let columns = held_of.iter().flat_map(|held| [held.as_str(), "rms error"]);
    let columns: Vec<&str> = ["prior"].into_iter().chain(columns).collect();
    let lines = scores.points.iter().map(|point| {
        let theta: Vec<String> = point.theta.iter().map(|v| short(*v)).collect();
        let side = if point.in_prior { "inside" } else { "outside" };
        let each = point.coverage.iter().zip(&point.rmse);
        let each = each.flat_map(|(covered, rmse)| [held(covered), short(*rmse)]);
        [theta.join(", "), side.to_owned()]
            .into_iter()
            .chain(each)
            .collect()
    });
    let caption = "Intervals that held the truth and errors of the tuned heads, by true θ";
    Some(rows(caption, "θ", &columns, lines))
}

/// Contributions to TS-fine; none without a layer.
fn heads(names: &[&str], scores: &Scores) -> Option<Block> {
    let heads = scores.heads.as_ref()?;
    let caption = format!(
        "Parts of TS-fine, on simulations that neither saw; MSE of the quadratic layer alone: {}",
        figure(heads.mse_layer)
    );
    let lines = names.iter().enumerate().map(|(j, name)| {
        let shares = [&heads.explained_layer, &heads.explained_both, &heads.alpha];
        let shares = shares.map(|share| format!("{:.3}", share[j]));
        [vec![(*name).to_owned()], shares.to_vec()].concat()
    });
    let columns = ["layer explains", "layer and heads", "α of the heads"];
    Some(rows(caption, "TS-fine", &columns, lines))
}

fn held(coverage: &Coverage) -> String {
    format!("{} of {}", coverage.held.count, coverage.held.of)
}

/// A squared error: three significant digits.
fn figure(value: f64) -> String {
    match value.is_finite() {
        true => format!("{value:.2e}"),
        false => "–".into(),
    }
}

fn time(milliseconds: f64) -> String {
    match milliseconds {
        ms if !ms.is_finite() => "–".into(),
        ms if ms >= 1000.0 => format!("{ms:.0}"),
        ms => short(ms),
    }
}

/// The scores as one JSON object, `truetwin.reproduce/1`.
///
/// | key | holds |
/// |---|---|
/// | `methods` | a row a method and start: `mse`, `median` of the squared error over runs, `ms` |
/// | `scenario` | 0, 1, 2 as on the command line; 3 for θ from the bounds; 4 for the grid |
/// | `heads` | TS-fine's parts: α of the heads, shares of the cloud's variance that the quadratic layer and both explain, MSE of the layer alone; null without a layer |
/// | `points` | of a grid: θ, whether it lies in the prior, errors and coverage by parameter |
///
/// Beyond the contract: `theta_from` (`prior`, `point`, `bounds`), `seed`, `failed` (runs without an answer),
/// `mse_std_error`, `invariants` and `mse_without_scale` (what a record determines, of twins that it does not determine
/// whole), `paper` (the published figures of this twin, scenario and method), `coverage` of the intervals.
///
/// All keys are always there; numbers that are not finite are null.
pub fn reproduce_json(
    study: &Study,
    plan: &MonteCarlo,
    preset: PresetName,
    scores: &Scores,
) -> Value {
    json!({
        "schema": "truetwin.reproduce/1",
        "twin": study.name(),
        "scenario": plan.scenario.number(),
        "theta_from": match plan.scenario {
            Scenario::InDistribution => "prior",
            Scenario::First | Scenario::Second => "point",
            Scenario::Uniform => "bounds",
            Scenario::Grid => "grid",
        },
        "runs": plan.runs,
        "seed": plan.seed,
        "preset": preset,
        "failed": scores.failed,
        "methods": scores.methods,
        "points": scores.points,
        "heads": scores.heads,
        "coverage": {
            "level": INTERVAL_LEVEL, "interval_level": LEVEL, "parameters": scores.coverage,
        },
    })
}
