//! A fit as JSON and as text.

use super::digits::{self, Digits, short, unit_suffix};
use super::table::table;
use crate::fit::{Fit, FittedNoise, FittedValue, Side};
use crate::study::Study;
use serde_json::{Value, json};

/// The fit as one JSON object, `truetwin.fit/1`.
///
/// | key | holds |
/// |---|---|
/// | `parameters` | name, unit, value, standard error, interval; `at_bound` is `low`, `high` or null |
/// | `noise` | fitted levels: states in units per √s, outputs in their own; `declared` is null where nothing was declared |
/// | `starts` | states at the first sample of each record, given all of it |
/// | `level` | level of the intervals |
/// | `log_likelihood`, `evidence` | in nats; `evidence.std_error` is null where Laplace's approximation stands alone |
/// | `convergence` | `converged`; `distance` to the top in standard deviations; `agreeing` of `searches` |
/// | `errors` | of each output: root mean square of one-step and free-run errors, deviation of the record |
/// | `warnings` | `code`, `what`, `remedy` |
/// | `samples`, `seconds` | size of the records, time that it took |
pub(super) fn fit_json(study: &Study, fit: &Fit) -> Value {
    let mut value = json!({ "schema": "truetwin.fit/1", "twin": study.name() });
    if let (Some(all), Ok(Value::Object(own))) = (value.as_object_mut(), serde_json::to_value(fit))
    {
        all.extend(own);
    }
    value
}

/// The fit as text: parameters, noise, starts, errors, warnings.
pub(super) fn fit_text(study: &Study, fit: &Fit) -> String {
    let level = format!("{:.0} % interval", 100.0 * fit.level);
    let mut parameters = vec![row([
        "parameter",
        "unit",
        "value",
        "± std error",
        &level,
        "",
    ])];
    parameters.extend(fit.parameters.iter().map(parameter));
    let mut noise = vec![row([
        "noise of",
        "unit",
        "level",
        "± std error",
        "declared",
        "",
    ])];
    noise.extend(fit.noise.iter().map(noise_level));
    let mut text = format!("{}: fitted to {} samples.\n\n", study.name(), fit.samples);
    text += &table(&parameters);
    if !fit.noise.is_empty() {
        text += "\n";
        text += &table(&noise);
    }
    if !fit.starts.is_empty() {
        let several = fit.starts.iter().any(|start| start.record > 1);
        let mut starts = vec![row(["start of", "unit", "value", "± std error", "", ""])];
        starts.extend(fit.starts.iter().map(|start| {
            let name = match several {
                true => format!("{} (record {})", start.name, start.record),
                false => start.name.clone(),
            };
            let digits = Digits::supported(start.value, start.std_error);
            let error = digits::error(start.std_error);
            row([
                &name,
                &start.unit,
                &digits.write(start.value),
                &error,
                "",
                "",
            ])
        }));
        text += "\n";
        text += &table(&starts);
    }
    text += "\n";
    for error in &fit.errors {
        let free = error.free_run.map_or("diverges".into(), |rmse| {
            format!("{}{}", short(rmse), unit_suffix(&error.unit))
        });
        text += &format!(
            "{}: one-step error {}, free run {free}; the record varies by {}{}.\n",
            error.name,
            short(error.one_step),
            short(error.deviation),
            unit_suffix(&error.unit),
        );
    }
    let c = fit.convergence;
    text += &match c.converged {
        true => format!(
            "Converged: {} of {} searches agree.",
            c.agreeing, c.searches
        ),
        false => "Not converged.".to_owned(),
    };
    if let Some(evidence) = &fit.evidence {
        let error = evidence
            .std_error
            .map_or(String::new(), |e| format!(" ± {}", short(e)));
        text += &format!(" Log evidence {:.2}{error} nats.", evidence.log_evidence);
    }
    text += &format!(" {} s.\n", short(fit.seconds));
    for warning in &fit.warnings {
        text += &format!("warning: {}; {}\n", warning.what, warning.remedy);
    }
    text
}

fn row(cells: [&str; 6]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

fn parameter(p: &FittedValue) -> Vec<String> {
    let digits = Digits::supported(p.value, p.std_error);
    let interval = format!("[{}, {}]", digits.write(p.low), digits.write(p.high));
    let bound = match p.at_bound {
        Some(Side::Low) => "at its lower bound",
        Some(Side::High) => "at its upper bound",
        None => "",
    };
    let error = digits::error(p.std_error);
    row([
        &p.name,
        &p.unit,
        &digits.write(p.value),
        &error,
        &interval,
        bound,
    ])
}

fn noise_level(level: &FittedNoise) -> Vec<String> {
    let digits = Digits::supported(level.value, level.std_error);
    let declared = level.declared.map_or(String::new(), short);
    let error = digits::error(level.std_error);
    row([
        &level.name,
        &level.unit,
        &digits.write(level.value),
        &error,
        &declared,
        "",
    ])
}
