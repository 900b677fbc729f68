//! An estimate as JSON and as a document.

mod json;
mod together;

pub(super) use json::estimate_json;
pub(crate) use together::{together_document, together_json};

use super::digits::{probability, short, unit_suffix};
use super::document::{Block, Document, Picture, Section};
use super::fit::draws;
use super::parameters::{ParameterRow, priors, values};
use super::record::overlay_svg;
use super::residuals::{Left, residual_blocks};
use crate::estimator::{Estimate, GateOutcome, INTERVAL_LEVEL};
use crate::math::three_digits;
use crate::record::Record;
use crate::setting::number;
use crate::study::Study;
use crate::twin::Role;

/// Weak combinations that are shown.
const COMBINATIONS: usize = 2;
/// Characters of a combination.
const LONGEST: usize = 90;

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
        let outputs = &(record.outputs() - after);
        let inputs = record.drive().inputs();
        let blocks = residual_blocks(study, "record − twin", false, &[Left { inputs, outputs }]);
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
    let mut items: Vec<String> = (weak.iter().take(COMBINATIONS))
        .map(|direction| {
            let all = &direction.combination;
            let mut shown: String = all.chars().take(LONGEST).collect();
            if shown.len() < all.len() {
                shown.push('…');
            }
            format!("{shown} ± {}", short(direction.std_error))
        })
        .collect();
    if weak.len() > COMBINATIONS {
        items.push(format!("… and {} more", weak.len() - COMBINATIONS));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::estimates;

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
}
