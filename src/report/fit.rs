//! A fit as JSON and as text.

use super::chart::Pairs;
use super::digits::{self, Digits, short, unit_suffix};
use super::parameters::{Line, ParameterRow, parameter_rows};
use super::table::table;
use crate::fit::{Fit, FittedNoise, FittedValue, Posterior, Side};
use crate::study::Study;
use crate::twin::{Parameter, ParameterSpace};
use serde_json::{Value, json};

/// The fit as one JSON object, `truetwin.fit/1`.
///
/// | key | holds |
/// |---|---|
/// | `parameters` | name, unit, value, standard error, interval, prior, bounds; `prior_share`: variance over the prior's; `at_bound`: `low`, `high` or null |
/// | `noise` | fitted levels: states in units per √s, outputs in their own; `declared` is null where nothing was declared; `at_bound` as of parameters |
/// | `starts` | states at the first sample of each record, given all of it |
/// | `level` | level of the intervals |
/// | `log_likelihood`, `evidence` | in nats; `evidence.std_error` is null where Laplace's approximation stands alone |
/// | `convergence` | `converged`; `distance` to the top in standard deviations; `agreeing` of `searches` |
/// | `errors` | of each output: root mean square of one-step and free-run errors, deviation of the record |
/// | `warnings` | `code`, `what`, `remedy` |
/// | `posterior` | of posterior draws: names, how many independent ones they are worth, share and mean of each mode; null where none were asked for |
/// | `samples`, `seconds` | size of the records, time that it took |
pub(super) fn fit_json(study: &Study, fit: &Fit) -> Value {
    let mut value = json!({ "schema": "truetwin.fit/1", "twin": study.name() });
    if let (Some(all), Ok(Value::Object(own))) = (value.as_object_mut(), serde_json::to_value(fit))
    {
        all.extend(own);
        let space = study.twin().parameters();
        let described = fit.parameters.iter().map(|p| described(p, &space).1);
        all["parameters"] = (described.zip(&fit.parameters))
            .map(|(line, p)| {
                let mut line = json!(line);
                line["low"] = json!(p.low);
                line["high"] = json!(p.high);
                line
            })
            .collect();
        all.insert("posterior".into(), posterior_json(fit.posterior.as_ref()));
    }
    value
}

/// Posterior draws in short: their table is in files of its own.
pub(super) fn posterior_json(posterior: Option<&Posterior>) -> Value {
    posterior.map_or(Value::Null, |posterior| {
        json!({
            "names": posterior.names,
            "draws": posterior.values.nrows(),
            "effective": posterior.effective,
            "modes": posterior.summary(),
        })
    })
}

/// Quantities that a pair plot has room for.
const PAIRED: usize = 6;

/// A picture of posterior draws: histograms of the twin's parameters, or of whatever else was fitted, and each against each.
pub fn posterior_svg(study: &Study, posterior: &Posterior) -> String {
    let space = study.twin().parameters();
    let unit = |name: &str| (space.iter().find(|p| p.name == name)).map(|p| unit_suffix(&p.unit));
    let own = |j: &usize| unit(&posterior.names[*j]).is_some();
    let all = 0..posterior.names.len();
    let (own, others): (Vec<usize>, Vec<usize>) = all.partition(own);
    let columns = own.into_iter().chain(others).take(PAIRED);
    let modes = posterior.modes.iter().copied().max().unwrap_or(1);
    Pairs {
        title: format!(
            "{}: {} posterior draws",
            study.name(),
            posterior.values.nrows()
        ),
        description: format!(
            "Histograms of posterior draws and each parameter against each; {modes} {}",
            if modes == 1 {
                "mode"
            } else {
                "modes, each in its colour"
            }
        ),
        columns: columns
            .map(|j| {
                let name = &posterior.names[j];
                let name = format!("{name}{}", unit(name).unwrap_or_default());
                (name, posterior.values.column(j).to_vec())
            })
            .collect(),
        groups: posterior.modes.iter().map(|mode| mode - 1).collect(),
    }
    .svg()
}

/// One line on posterior draws.
pub(super) fn posterior_text(posterior: &Posterior) -> String {
    let modes = posterior.summary();
    let several = match modes.len() {
        0 | 1 => String::new(),
        n => {
            let shares: Vec<String> = modes.iter().map(|m| digits::percent(m.share)).collect();
            format!(" {n} modes hold {}.", shares.join(", "))
        }
    };
    format!(
        "{} posterior draws, worth {:.0} independent ones.{several}",
        posterior.values.nrows(),
        posterior.effective
    )
}

/// The fit as text: parameters, noise, starts, errors, warnings.
pub(super) fn fit_text(study: &Study, fit: &Fit) -> String {
    let level = format!("{:.0} % interval", 100.0 * fit.level);
    let space = study.twin().parameters();
    let lines: Vec<Line> = (fit.parameters.iter())
        .map(|p| {
            let (own, line) = described(p, &space);
            (p.name.clone(), own.role, line, vec![])
        })
        .collect();
    let parameters = parameter_rows(["value", &level], &[], &lines);
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
    text += &match fit.parameters.is_empty() {
        true => "All parameters are fixed: noise alone is fitted.\n".to_owned(),
        false => table(&parameters),
    };
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
    if let Some(posterior) = &fit.posterior {
        text += &posterior_text(posterior);
        text += "\n";
    }
    for warning in &fit.warnings {
        text += &format!("warning: {}; {}\n", warning.what, warning.remedy);
    }
    text
}

fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

/// The parameter of a fitted value, and its line in the table.
pub(super) fn described(p: &FittedValue, space: &ParameterSpace) -> (Parameter, ParameterRow) {
    let own = (space.iter().find(|own| own.name == p.name).cloned())
        .unwrap_or_else(|| Parameter::new(&p.name, &p.unit, p.low, p.high));
    let mut line = ParameterRow::new(&own, p.value, p.std_error, [p.low, p.high]);
    line.at_bound = p.at_bound.map(|side| match side {
        Side::Low => "low",
        Side::High => "high",
    });
    (own, line)
}

fn noise_level(level: &FittedNoise) -> Vec<String> {
    let digits = Digits::supported(level.value, level.std_error);
    let declared = level.declared.map_or(String::new(), short);
    let error = digits::error(level.std_error);
    let note = level.at_bound.map_or("", |_| "at its bound");
    row([
        &level.name,
        &level.unit,
        &digits.write(level.value),
        &error,
        &declared,
        note,
    ])
}
