//! A diagnosis as JSON, `truetwin.gap/1`.

use crate::diagnose::{Diagnosis, EffectFit, Shrinkage};
use serde_json::{Map, Value, json};

/// The diagnosis as one JSON object, `truetwin.gap/1`.
///
/// | key | holds |
/// |---|---|
/// | `verdict`, `detection` | which kind of gap, and the structural test after the refit |
/// | `parameters`, `nuisance` | θ beside accepted effects; what else was estimated |
/// | `where` | the broken law, windows of time, ranges of states and inputs |
/// | `which` | effects best first, what was accepted, rivals |
/// | `shrinkage` | free-run errors on held-out data |
///
/// Beyond the contract: `detection.rank_p_value` and `.log_e`, `which.catch_all`, `parameters[].prior`,
/// `windows[].record`, `shrinkage.controls`, `candidates`, `not_tested`, `seconds`.
///
/// All keys are always there; what was skipped is null, and so are numbers that are not finite.
pub fn gap_json(found: &Diagnosis) -> Value {
    let parameters: Vec<Value> = (found.parameters.iter())
        .map(|p| {
            json!({
                "name": p.name, "unit": p.unit, "initial": p.initial, "refitted": p.refitted,
                "std_error": p.std_error, "identified": p.identified, "prior": p.prior,
            })
        })
        .collect();
    let nuisance: Vec<Value> = (found.nuisance.iter())
        .map(|n| json!({ "name": n.name, "role": n.role, "value": n.value, "std_error": n.std_error }))
        .collect();
    let place = &found.place;
    let targets: Vec<Value> = (place.targets.iter())
        .map(|t| json!({ "target": t.target, "p_value": t.p_value, "share": t.share }))
        .collect();
    let windows: Vec<Value> = (place.windows.iter())
        .map(|w| {
            json!({
                "start": w.start, "end": w.end, "channel": w.channel, "p_value": w.p_value,
                "share": w.share, "record": w.record,
            })
        })
        .collect();
    let regions: Vec<Value> = (place.regions.iter())
        .map(|r| {
            json!({
                "variable": r.variable, "low": r.low, "high": r.high, "p_value": r.p_value,
                "share": r.share,
            })
        })
        .collect();
    let which = &found.which;
    json!({
        "schema": "truetwin.gap/1",
        "twin": found.twin,
        "verdict": found.verdict.id(),
        "detection": {
            "p_value": found.detection.p_value,
            "alpha": found.detection.alpha,
            "statistic": found.detection.statistic,
            "rank_p_value": found.detection.rank_p_value,
            "log_e": found.detection.log_e,
        },
        "parameters": parameters,
        "nuisance": nuisance,
        "where": {
            "target": place.target, "targets": targets, "windows": windows, "regions": regions,
        },
        "which": {
            "decision": which.decision.id(),
            "effects": which.effects.iter().map(effect).collect::<Vec<_>>(),
            "accepted": which.accepted,
            "class": which.class,
            "unexplained_p_value": which.unexplained_p_value,
            "next_input": null,
            "catch_all": which.catch_all,
        },
        "shrinkage": found.shrinkage.as_ref().map(shrinkage),
        "candidates": found.candidates,
        "not_tested": found.not_tested,
        "seconds": found.seconds,
    })
}

fn effect(effect: &EffectFit) -> Value {
    let magnitudes: Map<String, Value> = (effect.magnitudes.iter())
        .map(|(name, value)| (name.clone(), json!(value)))
        .collect();
    json!({
        "id": effect.id, "target": effect.target, "probability": effect.probability,
        "magnitudes": magnitudes, "log_score_gain": effect.log_score_gain,
        "p_value": effect.p_value,
    })
}

fn shrinkage(s: &Shrinkage) -> Value {
    json!({
        "metric": s.metric, "before": s.before, "after": s.after, "floor": s.floor,
        "closed": s.closed, "interval": s.interval, "held_out": s.held_out,
        "controls": { "unfitted": s.unfitted, "theta_only": s.before, "placebo": s.placebo },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{diagnoses, validator};

    #[test]
    fn every_verdict_keeps_to_the_contract() {
        for found in diagnoses() {
            let read: Value = serde_json::from_str(&gap_json(found).to_string()).unwrap();
            let complaints: Vec<String> = (validator("gap").iter_errors(&read))
                .map(|error| format!("{}: {error}", error.instance_path))
                .collect();
            assert!(complaints.is_empty(), "{complaints:?}");
            for list in ["targets", "windows"] {
                let shares = read["where"][list].as_array().unwrap().iter();
                let sum: f64 = shares.map(|s| s["share"].as_f64().unwrap()).sum();
                assert!(sum <= 1.0 + 1e-9, "{list}: {sum}");
            }
        }
    }

    #[test]
    fn what_is_infinite_is_null() {
        let mut found = diagnoses()[1].clone();
        found.which.effects[0].magnitudes = vec![("level".into(), f64::INFINITY)];
        let value = gap_json(&found);
        assert!(value["which"]["effects"][0]["magnitudes"]["level"].is_null());
    }
}
