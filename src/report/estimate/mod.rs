//! An estimate as JSON and as a document.

mod together;

pub(crate) use together::{together_document, together_json};

use super::digits::{SHOWN, probability, short};
use super::document::{Block, Document, Picture, Section};
use super::fit::draws;
use super::parameters::{ParameterRow, priors, values};
use super::record::overlay_svg;
use super::residuals::residual_blocks;
use crate::estimator::{Estimate, GateOutcome, INTERVAL_LEVEL};
use crate::math::three_digits;
use crate::record::Record;
use crate::report::fit::posterior_json;
use crate::setting::{number, unit_suffix};
use crate::study::Study;
use crate::twin::Role;
use serde_json::{Value, json};

/// One line of the table a parameter, in the order of θ.
fn rows(study: &Study, estimate: &Estimate) -> Vec<ParameterRow> {
    let space = study.twin().parameters();
    let row = |(j, parameter)| {
        let interval = [estimate.low[j], estimate.high[j]];
        let (value, error) = (estimate.theta[j], estimate.std_error[j]);
        let initial = estimate.initial.theta.get(j).copied();
        ParameterRow {
            leans: estimate.leans_on_prior(),
            ..ParameterRow::new(parameter, value, error, interval).stages(vec![initial])
        }
    };
    space.iter().enumerate().map(row).collect()
}

/// The estimate for people; without the record there is no picture of it.
pub(super) fn estimate_document(
    study: &Study,
    record: Option<&Record>,
    estimate: &Estimate,
) -> Document {
    let refit = estimate.refit();
    let before = refit.and_then(|refit| Some(&refit.tracking_initial.as_ref()?.outputs));
    let after = estimate.tracking.as_ref().map(|run| &run.outputs);
    let picture = record.map(|record| Picture {
        svg: overlay_svg(study, record, before, after),
        caption: "The twin runs from the inputs alone, without noise. Below: record − twin.".into(),
    });
    // The twin's own parameters first.
    let mut rows = rows(study, estimate);
    rows.sort_by_key(|row| row.role != Role::Parameter);
    let mut sections = vec![
        Section::new(
            "parameters",
            "Parameters",
            vec![priors(&["network's"], &rows)],
        )
        .brief(weak(estimate)),
        Section::new("gate", "Network's estimate and tests", vec![]).brief(tests(study, estimate)),
    ];
    sections.extend(estimate.posterior.as_ref().map(|p| draws(study, p)));
    if let (Some(record), Some(after)) = (record, after) {
        let left = (record.drive().inputs(), &(record.outputs() - after));
        let blocks = residual_blocks(study, "record − twin", false, &[left]);
        sections.push(Section::new("residuals", "Residuals", blocks));
    }
    Document {
        title: format!("{}: estimate", study.name()),
        answer: vec![
            Block::Headline(headline(estimate)),
            values("", INTERVAL_LEVEL, &rows),
            Block::Doubts(estimate.warnings.clone()),
            Block::paragraph(match estimate.is_consistent() {
                true => "Next: use the twin, within the range of this record.",
                false => "Next: diagnose what the twin lacks.",
            }),
        ],
        picture,
        sections,
        ..Document::default()
    }
}

/// Verdict on the calibrated twin.
fn headline(estimate: &Estimate) -> String {
    let refit = estimate.refit();
    let test = match refit {
        Some(refit) if !refit.is_refused => refit.after,
        _ => Some(estimate.gate),
    };
    match test {
        _ if estimate.is_no_better_than_constant() => {
            "The calibrated twin does not follow the record.".into()
        }
        None => {
            "Calibrated; no test is possible, as there are no more features than parameters.".into()
        }
        Some(test) if test.out_of_distribution => format!(
            "The calibrated twin does not explain the record ({}, false-alarm rate {} %).",
            p_value(&test),
            number(three_digits(100.0 * test.alpha)),
        ),
        Some(test) => format!(
            "The calibrated twin is consistent with the record ({}).",
            p_value(&test)
        ),
    }
}

/// The p-value of a test; one that no simulation reaches is an upper bound.
fn p_value(test: &GateOutcome) -> String {
    match test.at_floor() {
        true => format!(
            "p < {}, {} simulations",
            number(three_digits(test.p_value)),
            test.simulations
        ),
        false => probability(test.p_value),
    }
}

/// The weak combinations; nothing if there are none.
fn weak(estimate: &Estimate) -> Vec<Block> {
    let Some(information) = estimate.information() else {
        return vec![Block::paragraph(
            "The features do not determine which parameters the record identifies.",
        )];
    };
    let weak: Vec<_> = information.weak().collect();
    if weak.is_empty() {
        return vec![];
    }
    let mut items: Vec<String> = (weak.iter().take(SHOWN.combinations))
        .map(|direction| {
            let all = &direction.combination;
            let mut shown: String = all.chars().take(SHOWN.combination).collect();
            if shown.len() < all.len() {
                shown.push('…');
            }
            format!("{shown} ± {}", short(direction.std_error))
        })
        .collect();
    if weak.len() > SHOWN.combinations {
        items.push(format!("… and {} more", weak.len() - SHOWN.combinations));
    }
    let lead = format!(
        "The record does not identify {} of {} parameter combinations (± in prior widths); moves along them hardly change the record:",
        weak.len(),
        information.directions.len(),
    );
    vec![
        Block::Paragraph(lead),
        Block::List(items),
        Block::paragraph("Fix one of their parameters, or use another input."),
    ]
}

/// The tests before and after the refit, free-run errors, effort.
fn tests(study: &Study, estimate: &Estimate) -> Vec<Block> {
    let test = estimate.gate;
    let p = format!("{}, level {}", p_value(&test), test.alpha);
    let found = match test.out_of_distribution {
        true => "The record is inconsistent with",
        false if estimate.is_no_better_than_constant() => "The test does not reject",
        false => "The record is consistent with",
    };
    let refit = estimate.refit();
    let followed = match refit {
        None => "estimate kept, as the prior is trusted",
        Some(refit) if refit.is_refused => {
            "estimate kept: refitted parameters explain the record worse"
        }
        Some(_) => "parameters refitted: the answer is the record's own, whatever the prior",
    };
    let mut all = vec![Block::Paragraph(format!(
        "{found} the network's estimate ({p}); {followed}."
    ))];
    if !estimate.is_consistent() && refit.is_some_and(|refit| !refit.is_refused) {
        all.push(Block::paragraph(
            "No parameters compensate for what the twin lacks; standard errors hold only for a complete twin.",
        ));
    }
    let redrawn = match estimate.redrawn() {
        0 => String::new(),
        n => format!(" ({n} draws of the cloud repeated)"),
    };
    all.push(Block::Paragraph(format!(
        "{} {} simulations{redrawn}, {} s.",
        tracking(study, estimate),
        estimate.simulations,
        short(estimate.seconds.total)
    )));
    all
}

/// Free-run errors before and after, and on the validation record.
fn tracking(study: &Study, estimate: &Estimate) -> String {
    let outputs = study.twin().signals().outputs;
    // A common unit, or none: channels of several units share one number.
    let unit = match outputs.split_first() {
        Some((first, rest)) if rest.iter().all(|q| q.unit == first.unit) => {
            unit_suffix(&first.unit)
        }
        _ => String::new(),
    };
    let Some(after) = &estimate.tracking else {
        return "The free run at the estimate diverges.".into();
    };
    let before = estimate
        .refit()
        .and_then(|refit| refit.tracking_initial.as_ref());
    let before = before.map_or(String::new(), |run| format!("{} → ", short(run.rmse)));
    let validation = match &estimate.validation {
        Some(run) => format!("; validation record {}{unit}", short(run.rmse)),
        None => String::new(),
    };
    format!(
        "Free-run RMSE {before}{}{unit}{validation}.",
        short(after.rmse)
    )
}

/// The estimate as one JSON object, `truetwin.estimate/1`.
///
/// | key | holds |
/// |---|---|
/// | `names`, `theta`, `std_error`, `interval` | the twin's own parameters, in one order, in their units |
/// | `nuisance` | start states, noise levels and magnitudes of effects, estimated beside them, `low` and `high` of their intervals |
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
pub(super) fn estimate_json(study: &Study, estimate: &Estimate) -> Value {
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
    let beside = (0..estimate.names.len()).filter(|&j| estimate.roles[j] != Role::Parameter);
    let nuisance: Vec<Value> = (estimate.nuisance().into_iter().zip(beside))
        .map(|(own, j)| {
            let mut line = json!(own);
            line["low"] = json!(estimate.low[j]);
            line["high"] = json!(estimate.high[j]);
            line
        })
        .collect();
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
        "nuisance": nuisance,
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

    fn text(estimate: &Estimate) -> String {
        let document = estimate_document(&estimates().study, None, estimate);
        document
            .text()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    }

    #[test]
    fn both_answers_of_the_gate_are_reported() {
        let found = estimates();
        let kept = text(&found.kept);
        assert!(
            kept.contains("estimate kept") && !kept.contains("inconsistent"),
            "{kept}"
        );
        let refined = text(&found.refined);
        for expected in [
            "refitted",
            "start of x1",
            "90 % interval",
            " → ",
            "validation record",
        ] {
            assert!(refined.contains(expected), "{refined}");
        }
    }

    #[test]
    fn an_incomplete_twin_is_reported() {
        let mut estimate = estimates().refined.clone();
        let test = |p_value| GateOutcome {
            statistic: 9.0,
            p_value,
            p_error: 0.0,
            simulations: 199,
            alpha: 0.1,
            out_of_distribution: p_value <= 0.1,
        };
        for (after, expected) in [
            (
                Some(test(0.005)),
                "does not explain the record (p < 0.005, 199 simulations, false-alarm rate 10 %). ",
            ),
            (Some(test(0.5)), "is consistent with the record (p = 0.500)"),
            (None, "no test is possible"),
        ] {
            estimate.refit_mut().after = after;
            let text = text(&estimate);
            assert!(text.contains(expected), "{text}");
            let next = text.contains("Next: diagnose what the twin lacks.");
            assert_eq!(next, !estimate.is_consistent(), "{text}");
        }
    }

    /// The first screen has the values, the record and what is left of it; free runs need not be white.
    #[test]
    fn a_page_opens_with_the_values() {
        let found = estimates();
        let page = estimate_document(&found.study, Some(&found.record), &found.refined).html();
        let head = page.split("</header>").next().unwrap();
        assert!(head.contains("<th scope=\"row\">nu</th>") && head.contains("record − twin"));
        assert!(!page.contains("95 % of white noise") && !page.contains("NaN"));
        assert!(page.contains("white only without process noise"));
    }

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
