//! Scores over many records as JSON, `truetwin.reproduce/1`.

use crate::estimator::INTERVAL_LEVEL;
use crate::estimator::PresetName;
use crate::evaluate::LEVEL;
use crate::evaluate::paper::{MonteCarlo, Scenario, Scores};
use crate::study::Study;
use serde_json::{Value, json};

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
