//! Expected errors of parameters, from the likelihood's information.

use super::limits::LIMITS;
use crate::fit::climb::climb;
use crate::fit::problem::Problem;
use crate::likelihood::measured;
use crate::record::Record;
use crate::study::Study;
use crate::twin::conformance::Finding;
use crate::twin::{PRIOR_DEVIATION, Role};
use serde::Serialize;

/// Expected error of a parameter.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Knowable {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Expected standard error, in that unit.
    pub std_error: f64,
    /// Standard error over the width of the prior.
    pub share: f64,
    /// The same of a record as the study plans it.
    pub planned_share: Option<f64>,
}

/// Compares the expected errors with the prior, at its centre.
pub(super) fn check(
    study: &Study,
    record: &Record,
    planned: Option<&Record>,
) -> (Finding, Vec<Knowable>) {
    let mut parameters = match errors(study, record) {
        Ok(parameters) => parameters,
        Err(problem) => {
            let message = format!("expected errors are not known: {problem}");
            return (Finding::warning("parameters", message), vec![]);
        }
    };
    let usual = planned.and_then(|planned| errors(study, planned).ok());
    for (parameter, usual) in parameters.iter_mut().zip(usual.iter().flatten()) {
        parameter.planned_share = Some(usual.share);
    }
    let unknown = |p: &&Knowable| p.share.is_nan() || p.share >= PRIOR_DEVIATION;
    let is_blamed = |p: &Knowable| {
        p.planned_share
            .is_none_or(|usual| p.share.is_nan() || p.share > LIMITS.worse * usual)
    };
    let listed = |chosen: &dyn Fn(&&Knowable) -> bool| -> Vec<String> {
        (parameters.iter().filter(|p| chosen(p)))
            .map(|p| format!("{} {:.2}", p.name, p.share))
            .collect()
    };
    let blamed = listed(&|p| unknown(p) && is_blamed(p));
    if !blamed.is_empty() {
        let message = format!(
            "this record cannot tell {} (expected error in widths of the prior; {PRIOR_DEVIATION:.2} says no more than the prior); take a longer record or another input, or fix them",
            blamed.join(", ")
        );
        return (Finding::warning("parameters", message), parameters);
    }
    let all = listed(&|_| true).join(", ");
    let plain = listed(&unknown).join(", ");
    let message = match (all.as_str(), plain.as_str()) {
        ("", _) => "none to estimate".to_owned(),
        (all, "") => format!("expected errors in widths of the prior: {all}"),
        (all, plain) => format!(
            "expected errors in widths of the prior: {all}; {plain}: no more than the prior says, as in some planned records"
        ),
    };
    (Finding::pass("parameters", message), parameters)
}

/// Expected errors at the centre of the prior, noise levels and starts unknown as in a fit.
fn errors(study: &Study, record: &Record) -> Result<Vec<Knowable>, String> {
    let records = std::slice::from_ref(record);
    let measured = measured(study.twin(), records, &study.beliefs()).map_err(|e| e.to_string())?;
    let problem = Problem::of_measured(&measured, records);
    // Without a step, a climb tells the information at its start.
    let here = climb(&problem, &problem.centre(), 0).map_err(|e| e.to_string())?;
    let here = here.ok_or("the twin cannot be filtered at the centre of its prior")?;
    let errors = here.std_errors(&problem);
    let space = study.twin().parameters();
    Ok((space.iter().zip(errors))
        .filter(|(p, _)| matches!(p.role, Role::Parameter | Role::Magnitude))
        .map(|(p, std_error)| Knowable {
            name: p.name.clone(),
            unit: p.unit.clone(),
            std_error,
            share: std_error / p.prior.width(),
            planned_share: None,
        })
        .collect())
}
