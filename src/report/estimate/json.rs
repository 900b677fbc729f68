//! An estimate as JSON, `truetwin.estimate/1`.

use super::rows;
use crate::estimator::{Estimate, INTERVAL_LEVEL};
use crate::report::fit::posterior_json;
use crate::study::Study;
use serde_json::{Value, json};

/// The estimate as one JSON object, `truetwin.estimate/1`.
///
/// | key | holds |
/// |---|---|
/// | `names`, `theta`, `std_error`, `interval` | the twin's own parameters, in one order, in their units |
/// | `nuisance` | start states, noise levels and magnitudes of effects, estimated beside them |
/// | `gate`, `after` | the test at the network's estimate, and at the refitted one; `after` is null without a refit, its values are null where the refit left no degree of freedom. `p_error`: Monte-Carlo error of `p_value`; `simulations`: those that the record is ranked among; `at_floor`: none of them is as far, so that p is below `p_value` |
/// | `weak_directions` | unit vectors in θ over the prior's width that the prior knows better than the record |
/// | `free_run` | root mean square of record − noise-free run, in output units |
/// | `simulations`, `seconds` | what it took |
/// | `answer` | `record`: `theta.final` is the record's own; `prior`: the network's, which leans on the prior |
/// | `trusting_prior` | the network's estimate with its errors, for those who trust the prior |
/// | `heads` | parts of `theta.fine`: `alpha`, what the heads add to the quadratic layer (0 nothing, 1 all they say); shares of the cloud's variance that the layer, and both, explain; `layer`, its estimate alone; null where heads were not tuned on a layer |
/// | `noise` | levels that the record shows in place of those declared; simulations take them |
/// | `posterior` | of posterior draws: names, how many independent ones they are worth, modes; null where none were asked for |
/// | `warnings` | `code`, `what`, `remedy` |
/// | `parameters` | value, standard error, interval, prior, bounds; `prior_share`: variance over the prior's; `at_bound`: `low`, `high` or null |
///
/// Beyond these: `directions` (all, least known first; null where the features do not tell them), `refitted`, `redrawn`.
///
/// All keys are always there. Stages that were skipped are null, and so are numbers that are not finite.
pub fn estimate_json(study: &Study, estimate: &Estimate) -> Value {
    let own = |all: &[f64]| estimate.physical(all);
    let refit = estimate.refit();
    let after = refit.map(|refit| {
        let test = refit.after;
        json!({
            "p_value": test.map(|test| test.p_value),
            "consistent": test.map(|_| estimate.is_consistent()),
            "alpha": test.map(|test| test.alpha),
            "statistic": test.map(|test| test.statistic),
            "p_error": test.map(|test| test.p_error),
            "simulations": test.map(|test| test.simulations),
            "at_floor": test.map(|test| test.at_floor()),
        })
    });
    let mut gate = json!(estimate.gate);
    gate["at_floor"] = json!(estimate.gate.at_floor());
    let directions = estimate.information().map(|known| &known.directions);
    let weak: Vec<_> = (estimate.information().into_iter())
        .flat_map(|known| known.weak())
        .collect();
    let trusting = &estimate.initial;
    let seconds = estimate.seconds;
    json!({
        "schema": "truetwin.estimate/1",
        "twin": study.name(),
        "names": estimate.physical(&estimate.names),
        "gate": gate,
        "theta": {
            "initial": own(&estimate.initial.theta),
            "gauss_newton": refit.map(|refit| own(&refit.gauss_newton)),
            "fine": refit.map(|refit| own(&refit.fine)),
            "final": own(&estimate.theta),
        },
        "std_error": own(&estimate.std_error),
        "nuisance": estimate.nuisance(),
        "interval": {
            "level": INTERVAL_LEVEL,
            "low": own(&estimate.low),
            "high": own(&estimate.high),
        },
        "weak_directions": weak,
        "after": after,
        "free_run": {
            "rmse": estimate.tracking.as_ref().map(|run| run.rmse),
            "validation_rmse": estimate.validation.as_ref().map(|run| run.rmse),
            "initial_rmse": (refit.and_then(|refit| refit.tracking_initial.as_ref())).map(|run| run.rmse),
        },
        "simulations": estimate.simulations,
        "seconds": {
            "predict": seconds.predict,
            "gate": seconds.gate,
            "gauss_newton": refit.map(|refit| refit.seconds.gauss_newton),
            "cloud": refit.map(|refit| refit.seconds.cloud),
            "tune": refit.map(|refit| refit.seconds.tune),
            "total": seconds.total,
        },
        "answer": if estimate.leans_on_prior() { "prior" } else { "record" },
        "trusting_prior": {
            "theta": own(&trusting.theta),
            "std_error": own(&trusting.std_error),
            "interval": {
                "level": INTERVAL_LEVEL,
                "low": own(&trusting.low),
                "high": own(&trusting.high),
            },
        },
        "heads": refit.and_then(|refit| refit.contributions.as_ref()).map(|parts| json!({
            "alpha": own(&parts.alpha),
            "explained_layer": own(&parts.layer),
            "explained_both": own(&parts.both),
            "layer": own(&parts.theta),
        })),
        "noise": estimate.noise,
        "posterior": posterior_json(estimate.posterior.as_ref()),
        "warnings": estimate.warnings,
        "parameters": estimate.physical(&rows(study, estimate)),
        "directions": directions,
        "refitted": refit.is_some(),
        "redrawn": estimate.redrawn(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::Stages;
    use crate::report::fixture::{estimates, validator};

    fn checked(estimate: &Estimate) -> Value {
        let value = estimate_json(&estimates().study, estimate);
        // As a reader gets it.
        let read: Value = serde_json::from_str(&value.to_string()).unwrap();
        let complaints: Vec<String> = (validator("estimate").iter_errors(&read))
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(complaints.is_empty(), "{complaints:?}");
        read
    }

    /// The contract's keys in the order of the design, before any of our own.
    const KEYS: [&str; 13] = [
        "schema",
        "twin",
        "names",
        "gate",
        "theta",
        "std_error",
        "nuisance",
        "interval",
        "weak_directions",
        "after",
        "free_run",
        "simulations",
        "seconds",
    ];

    #[test]
    fn both_ways_through_the_gate_keep_to_the_contract() {
        let found = estimates();
        let kept = checked(&found.kept);
        assert!(kept["after"].is_null() && kept["theta"]["fine"].is_null());
        assert!(kept["interval"]["low"][0].is_number() && kept["seconds"]["cloud"].is_null());
        assert!(kept["free_run"]["validation_rmse"].is_null());
        let refined = checked(&found.refined);
        assert!(refined["after"]["consistent"].is_boolean());
        for test in ["gate", "after"] {
            let test = &refined[test];
            let (p, of) = (&test["p_value"], test["simulations"].as_f64().unwrap());
            let expected = p.as_f64().unwrap() * (of + 1.0) < 1.5;
            assert_eq!(test["at_floor"], expected, "{test}");
            assert!(test["p_error"].as_f64().unwrap() > 0.0, "{test}");
        }
        assert!(refined["seconds"]["tune"].is_number());
        assert!(refined["free_run"]["validation_rmse"].is_number());
        for value in [kept, refined] {
            let keys: Vec<_> = value.as_object().unwrap().keys().collect();
            assert_eq!(keys[..KEYS.len()], KEYS);
        }
    }

    #[test]
    fn the_start_is_a_nuisance_and_no_parameter() {
        let value = checked(&estimates().refined);
        assert_eq!(value["names"], json!(["nu"]));
        assert_eq!(value["theta"]["final"].as_array().unwrap().len(), 1);
        let nuisance = &value["nuisance"][0];
        assert_eq!(
            (&nuisance["name"], &nuisance["role"]),
            (&json!("x1"), &json!("start"))
        );
        assert_eq!(value["parameters"][0]["bounds"], json!([0.0, 7.0]));
    }

    #[test]
    fn what_cannot_be_told_is_null() {
        let mut estimate = estimates().refined.clone();
        estimate.refit_mut().after = None;
        estimate.std_error.fill(f64::NAN);
        estimate.tracking = None;
        let value = checked(&estimate);
        for key in ["p_value", "p_error", "simulations", "at_floor"] {
            assert_eq!(value["after"][key], Value::Null, "{key}");
        }
        assert_eq!(value["std_error"], json!([null]));
        assert_eq!(value["nuisance"][0]["std_error"], Value::Null);
        assert_eq!(value["free_run"]["rmse"], Value::Null);
        let mut estimate = estimates().kept.clone();
        estimate.stages = Stages::Kept(None);
        let value = checked(&estimate);
        assert_eq!(
            (&value["weak_directions"], &value["directions"]),
            (&json!([]), &Value::Null)
        );
    }
}
