//! A diagnosis as JSON, `truetwin.gap/1`.

use crate::diagnose::{
    Diagnosis, Discovery, EffectFit, Location, Maps, NextInput, Shrinkage, Visible,
};
use serde_json::{Map, Value, json};

/// File of the record to measure next, beside the report.
pub const NEXT_INPUT: &str = "next-input.csv";

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
/// Beyond the contract: `detection.rank_p_value` and `.log_e`, `which.catch_all`, `parameters[].prior`, of `where` all but
/// target, targets, windows and regions, `windows[].record`, `shrinkage.controls`, `discovery`, `power`, `candidates`,
/// `not_tested`, `seconds`.
///
/// All keys are always there; what was skipped is null, and so are numbers that are not finite.
pub fn gap_json(diagnosis: &Diagnosis) -> Value {
    let parameters: Vec<Value> = (diagnosis.parameters.iter())
        .map(|p| {
            json!({
                "name": p.name, "unit": p.unit, "initial": p.initial, "refitted": p.refitted,
                "std_error": p.std_error, "identified": p.identified, "prior": p.prior,
            })
        })
        .collect();
    let nuisance: Vec<Value> = (diagnosis.nuisance.iter())
        .map(|n| json!({ "name": n.name, "role": n.role, "value": n.value, "std_error": n.std_error }))
        .collect();
    let place = &diagnosis.location;
    let targets: Vec<Value> = (place.targets.iter())
        .map(|t| json!({ "target": t.target, "p_value": t.p_value, "share": t.share }))
        .collect();
    let which = &diagnosis.cause;
    json!({
        "schema": "truetwin.gap/1",
        "twin": diagnosis.twin,
        "verdict": diagnosis.verdict.id(),
        "detection": {
            "p_value": diagnosis.detection.p_value,
            "alpha": diagnosis.detection.alpha,
            "statistic": diagnosis.detection.statistic,
            "rank_p_value": diagnosis.detection.rank_p_value,
            "log_e": diagnosis.detection.log_e,
        },
        "parameters": parameters,
        "nuisance": nuisance,
        "where": place_json(place, targets),
        "which": {
            "decision": which.decision.id(),
            "effects": which.effects.iter().map(effect).collect::<Vec<_>>(),
            "accepted": which.accepted,
            "class": which.class,
            "unexplained_p_value": which.unexplained_p_value,
            "next_input": which.next_input.as_ref().map(next_input),
            "catch_all": which.catch_all,
        },
        "shrinkage": diagnosis.shrinkage.as_ref().map(shrinkage),
        "discovery": diagnosis.discovery.as_ref().map(discovery),
        "power": diagnosis.power.iter().map(visible).collect::<Vec<_>>(),
        "candidates": diagnosis.candidates,
        "not_tested": diagnosis.not_tested,
        "seconds": diagnosis.seconds,
    })
}

/// The contract's `where`: targets, and the notable cells of all maps beside them.
fn place_json(place: &Location, targets: Vec<Value>) -> Value {
    let equations: Vec<Value> = (place.equations.iter())
        .map(|e| {
            let term: Vec<Value> = (e.term.iter())
                .map(|t| {
                    json!({
                        "variable": t.variable, "low": t.low, "high": t.high, "mean": t.mean,
                        "std_error": t.std_error,
                    })
                })
                .collect();
            json!({ "equation": e.equation, "p_value": e.p_value, "share": e.share, "term": term })
        })
        .collect();
    let onset = place.onset.as_ref().map(|o| {
        json!({ "record": o.record, "time": o.time, "channel": o.channel, "p_value": o.p_value })
    });
    let mut all = maps(&place.maps);
    all.insert("onset".into(), json!(onset));
    all.insert("target".into(), json!(place.target));
    all.insert("targets".into(), json!(targets));
    all.insert("equations".into(), json!(equations));
    all.insert("after".into(), json!(place.after.as_ref().map(maps)));
    Value::Object(all)
}

/// What stands out.
fn maps(maps: &Maps) -> Map<String, Value> {
    let notable = maps.notable();
    let windows: Vec<Value> = (notable.windows.iter())
        .map(|w| {
            json!({
                "start": w.start, "end": w.end, "channel": w.channel, "p_value": w.p_value,
                "share": w.share, "record": w.record,
            })
        })
        .collect();
    let regions: Vec<Value> = (notable.regions.iter())
        .map(|r| {
            json!({
                "variable": r.variable, "low": r.low, "high": r.high, "p_value": r.p_value,
                "share": r.share,
            })
        })
        .collect();
    let channels: Vec<Value> = (notable.channels.iter())
        .map(|c| json!({ "channel": c.channel, "p_value": c.p_value, "share": c.share }))
        .collect();
    let lags: Vec<Value> = (notable.lags.iter())
        .map(|l| {
            json!({
                "channel": l.channel, "signal": l.signal, "from": l.from, "to": l.to,
                "p_value": l.p_value, "share": l.share,
            })
        })
        .collect();
    let bands: Vec<Value> = (notable.bands.iter())
        .map(|b| {
            json!({
                "channel": b.channel, "low": b.low, "high": b.high, "p_value": b.p_value,
                "share": b.share,
            })
        })
        .collect();
    let lists = [
        ("windows", json!(windows)),
        ("regions", json!(regions)),
        ("channels", json!(channels)),
        ("lags", json!(lags)),
        ("bands", json!(bands)),
    ];
    lists
        .map(|(name, list)| (name.to_owned(), list))
        .into_iter()
        .collect()
}

/// The record to measure next; its inputs stand in `next-input.csv` beside the report.
fn next_input(next: &NextInput) -> Value {
    let count = |[count, of]: [u64; 2]| json!({ "count": count, "of": of });
    json!({
        "file": NEXT_INPUT, "kind": next.kind, "rivals": next.rivals,
        "samples": next.drive.samples(), "step": next.drive.dt(),
        "split": count(next.split), "again": count(next.again),
    })
}

fn discovery(diagnosis: &Discovery) -> Value {
    let terms: Vec<Value> = (diagnosis.terms.iter())
        .map(|t| {
            json!({
                "name": t.name, "coefficient": t.coefficient, "interval": t.interval,
                "inclusion": t.inclusion,
            })
        })
        .collect();
    json!({
        "exploratory": true, "equation": diagnosis.equation, "terms": terms,
        "explained": diagnosis.explained,
    })
}

fn visible(visible: &Visible) -> Value {
    json!({
        "id": visible.id, "target": visible.target, "magnitude": visible.magnitude,
        "value": visible.value,
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
    use crate::report::fixture::{diagnoses, made, validator};

    #[test]
    fn every_verdict_keeps_to_the_contract() {
        let by_hand = [made::tanks_class(), made::oscillator_none()];
        for diagnosis in diagnoses().iter().chain(&by_hand) {
            let read: Value = serde_json::from_str(&gap_json(diagnosis).to_string()).unwrap();
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
        let mut diagnosis = diagnoses()[1].clone();
        diagnosis.cause.effects[0].magnitudes = vec![("level".into(), f64::INFINITY)];
        let value = gap_json(&diagnosis);
        assert!(value["which"]["effects"][0]["magnitudes"]["level"].is_null());
    }
}
