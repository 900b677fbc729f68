//! Reasons to doubt an estimate.

use super::outcome::{DIVERGES, Estimate, NO_BETTER};
use crate::estimator::gate::GateOutcome;
use crate::fit::{Fit, NOT_CONVERGED, Warning};
use crate::math::{deviation, three_digits};
use crate::record::{Record, Signal};
use crate::setting::number;
use crate::twin::conformance::{Severity, check_step};
use crate::twin::{PRIOR_DEVIATION, Role, Twin};

/// Share of a prior's information in an answer from which on the answer leans on it: the prior then moves the answer by this share of
/// the truth's distance from its centre.
const LEANING: f64 = 0.1;

/// Lists what makes an estimate doubtful; `fit` is the likelihood's own, where there is one.
pub(super) fn warnings(
    twin: &Twin,
    record: &Record,
    estimate: &Estimate,
    fit: Option<&Fit>,
) -> Vec<Warning> {
    let mut all = Vec::new();
    let mut warn = |code, what, remedy| all.push(Warning { code, what, remedy });
    let signals = twin.signals();
    for (input, values) in (signals.inputs.iter()).zip(record.drive().inputs().columns()) {
        if values.iter().all(|v| *v == values[0]) {
            warn(
                "constant-input",
                format!("the input {} never moves", input.name),
                "what shows only when it moves cannot be known from this record; take one in which it moves",
            );
        }
    }
    if let Some(run) = &estimate.tracking {
        for (j, output) in signals.outputs.iter().enumerate() {
            if no_better_than_constant(record, &run.outputs, j) {
                warn(
                    NO_BETTER,
                    format!(
                        "the free run of {} is no better than a constant",
                        output.name
                    ),
                    "look for what the twin lacks: truetwin diagnose",
                );
            }
        }
    } else {
        warn(
            DIVERGES,
            "the free run at the estimate diverges".to_owned(),
            "narrow [bounds], or look for what the twin lacks: truetwin diagnose",
        );
    }
    for level in &estimate.noise {
        let declared = three_digits(level.declared.unwrap_or(0.0));
        warn(
            "noise-not-declared",
            format!(
                "the record shows a noise of {} of {} {}, {} is declared; simulations take what it shows",
                level.name,
                number(three_digits(level.value)),
                level.unit,
                number(declared),
            ),
            "declare that level in [noise]; if it is louder than it can be, look for what the twin lacks: truetwin diagnose",
        );
    }
    if estimate.refit().is_some_and(|refit| refit.is_refused) {
        warn(
            "refinement-worse",
            "refined parameters explain the record worse than the network's, which are kept"
                .to_owned(),
            "widen [prior] and train again, or look for what the twin lacks: truetwin diagnose",
        );
    }
    let space = twin.parameters();
    for (j, parameter) in space.iter().enumerate() {
        let side = match parameter.bound_at(estimate.theta[j], estimate.std_error[j]) {
            Some("low") => "lower",
            Some(_) => "upper",
            None => continue,
        };
        warn(
            "at-bound",
            format!("{} lies at its {side} bound", parameter.name),
            "widen [bounds] if other values are possible; its error means little here",
        );
    }
    if let Some(information) = estimate
        .information()
        .filter(|_| estimate.refit().is_none())
    {
        let leaning: Vec<&str> = (space.iter().zip(&information.std_error))
            .filter(|(p, error)| {
                let prior = PRIOR_DEVIATION * p.prior.width();
                p.role == Role::Parameter
                    && error.powi(2) > LEANING * (error.powi(2) + prior.powi(2))
            })
            .map(|(p, _)| p.name.as_str())
            .collect();
        if !leaning.is_empty() {
            warn(
                "leans-on-prior",
                format!("{} lean on the prior", leaning.join(", ")),
                "leave [prior] trust out, or take --always-refine, for what the record says alone",
            );
        }
    }
    let tests = [
        ("the test", Some(estimate.gate)),
        ("the test after the refit", estimate.after()),
    ];
    for (name, test) in tests {
        let Some(test) = test.filter(GateOutcome::is_unsure) else {
            continue;
        };
        warn(
            "gate-near-level",
            format!(
                "the p-value of {name}, {} ± {}, is near its level {}",
                number(three_digits(test.p_value)),
                number(three_digits(test.p_error)),
                number(test.alpha),
            ),
            "take neither answer of the test as sure",
        );
    }
    let step = check_step(twin, &estimate.theta, record.drive());
    if let Some(finding) = step.filter(|f| f.severity == Severity::Warning) {
        warn(
            "step-matters",
            format!("the step is {}", finding.message),
            "train again with such a study",
        );
    }
    let of_fit = fit.into_iter().flat_map(|fit| &fit.warnings);
    all.extend(of_fit.filter(|w| w.code == NOT_CONVERGED).cloned());
    all
}

/// Returns whether record − run is as large as the record's own variation.
fn no_better_than_constant(record: &Record, run: &Signal, output: usize) -> bool {
    let pairs: Vec<(f64, f64)> = (record.outputs().column(output).iter().copied())
        .zip(run.column(output).iter().copied())
        .filter(|(y, _)| y.is_finite())
        .collect();
    let values: Vec<f64> = pairs.iter().map(|(y, _)| *y).collect();
    let squares: f64 = pairs.iter().map(|(y, f)| (y - f).powi(2)).sum();
    (squares / values.len().max(1) as f64).sqrt() >= deviation(&values)
}
