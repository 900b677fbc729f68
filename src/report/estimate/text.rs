//! An estimate as text for the terminal.

use super::rows;
use crate::estimator::{Estimate, GateOutcome, INTERVAL_LEVEL};
use crate::math::three_digits;
use crate::report::digits::{Digits, probability, short, unit_suffix};
use crate::report::fit::posterior_text;
use crate::report::parameters::{Line, ParameterRow, parameter_rows};
use crate::setting::number;
use crate::study::Study;
use crate::twin::{Parameter, Role};

/// Limits of columns and lines.
const COLUMNS: usize = 100;
const LINES: usize = 24;
/// Columns of the table before the bounds: name, unit, first estimate, final one, standard error, interval, prior.
const BEFORE_BOUNDS: usize = 7;
const BEFORE_PRIOR: usize = 6;
/// Least room for a name.
const LEAST_NAME: usize = 8;
/// Number of warnings shown.
const WARNINGS: usize = 3;
/// Number of weak combinations shown.
const COMBINATIONS: usize = 2;

/// Returns the estimate in at most 24 lines of 100 columns: gate, parameters with errors, weak combinations, test after the
/// refit, free-run errors.
///
/// Values have the digits that their standard errors support.
pub fn estimate_text(study: &Study, estimate: &Estimate) -> String {
    let mut above = paragraph(&gate(study, estimate));
    above.push(String::new());
    let mut below = weak(estimate);
    below.push(String::new());
    if let Some(verdict) = after(estimate) {
        below.extend(paragraph(&verdict));
    }
    below.extend(paragraph(&tracking(study, estimate)));
    below.extend(estimate.posterior.as_ref().map(posterior_text));
    below.push(effort(estimate));
    below.extend(warnings(estimate));
    let left = LINES.saturating_sub(above.len() + below.len());
    let lines = [above, table(study, estimate, left), below].concat();
    lines.join("\n") + "\n"
}

/// Returns the answer of the gate and its consequence.
fn gate(study: &Study, estimate: &Estimate) -> String {
    let (name, test) = (study.name(), estimate.gate);
    let p = format!("{}, level {}", p_value(&test), test.alpha);
    let found = match test.out_of_distribution {
        true => "the record is inconsistent with",
        false if estimate.is_no_better_than_constant() => "the test does not reject",
        false => "the record is consistent with",
    };
    let answer = match estimate.refit().map(|refit| refit.is_refused) {
        None => "estimate kept, as the prior is trusted",
        Some(true) => "estimate kept: refitted parameters explain the record worse",
        Some(false) => "parameters refitted: the answer is the record's own, whatever the prior",
    };
    format!("{name}: {found} the network's estimate ({p}); {answer}.")
}

/// Returns the p-value of a test; one that no simulation reaches is an upper bound.
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

/// Returns names, units and numbers of θ in aligned columns, in at most `lines` lines.
fn table(study: &Study, estimate: &Estimate, lines: usize) -> Vec<String> {
    let space = study.twin().parameters();
    // The twin's own parameters first.
    let (own, others): (Vec<_>, Vec<_>) =
        (space.iter().enumerate()).partition(|(_, p)| p.role == Role::Parameter);
    let table = rows(study, estimate);
    let all: Vec<Line> = (own.into_iter().chain(others))
        .map(|(j, parameter)| line(estimate.initial.theta[j], &table[j], parameter))
        .collect();
    let room = lines.saturating_sub(1).max(2);
    let shown = if all.len() > room {
        room - 1
    } else {
        all.len()
    };
    let level = format!("{:.0} % interval", 100.0 * INTERVAL_LEVEL);
    let mut cells = parameter_rows(["final", &level], &["initial"], &all[..shown]);
    let mut widths = widths_of(&cells);
    let others = |widths: &[usize]| -> usize { widths[1..].iter().map(|w| w + 2).sum() };
    // Long numbers: bounds, then prior and remark are left to the JSON.
    for kept in [BEFORE_BOUNDS, BEFORE_PRIOR] {
        if others(&widths) + LEAST_NAME > COLUMNS {
            for row in &mut cells {
                let remark = row.pop().filter(|_| kept == BEFORE_BOUNDS);
                row.truncate(kept);
                row.extend(remark);
            }
            widths = widths_of(&cells);
        }
    }
    let others = others(&widths);
    widths[0] = widths[0].min(COLUMNS.saturating_sub(others).max(LEAST_NAME));
    let is_text: Vec<bool> = (cells[0].iter())
        .map(|head| ["parameter", "unit", ""].contains(&head.as_str()))
        .collect();
    let mut written: Vec<String> = (cells.iter())
        .map(|row| {
            let columns = row.iter().zip(&widths).zip(&is_text);
            let aligned = columns.map(|((cell, &width), is_text)| match is_text {
                true => format!("{:<width$}", clipped(cell, width)),
                false => format!("{cell:>width$}"),
            });
            aligned.collect::<Vec<_>>().join("  ").trim_end().to_owned()
        })
        .collect();
    if shown < all.len() {
        written.push(format!(
            "… and {} more; --json has them all",
            all.len() - shown
        ));
    }
    written
}

fn widths_of(cells: &[Vec<String>]) -> Vec<usize> {
    let columns = cells.first().map_or(0, Vec::len);
    let width = |c: usize| cells.iter().map(|row| length(&row[c])).max().unwrap_or(0);
    (0..columns).map(width).collect()
}

/// Returns one line of the table.
fn line(initial: f64, row: &ParameterRow, parameter: &Parameter) -> Line {
    let name = match parameter.role {
        Role::Parameter | Role::Magnitude => parameter.name.clone(),
        Role::Start => format!("start of {}", parameter.target()),
        Role::Noise => format!("noise of {}", parameter.target()),
    };
    let digits = Digits::supported(row.value, row.std_error);
    let mut row = row.clone();
    row.unit = clipped(&row.unit, 10);
    (name, parameter.role, row, vec![digits.write(initial)])
}

/// Returns the weak combinations after an empty line; nothing if there are none.
fn weak(estimate: &Estimate) -> Vec<String> {
    let Some(information) = estimate.information() else {
        return [
            vec![String::new()],
            paragraph("The features do not determine which parameters the record identifies."),
        ]
        .concat();
    };
    let weak: Vec<_> = information.weak().collect();
    if weak.is_empty() {
        return vec![];
    }
    let mut lines = vec![String::new()];
    lines.extend(paragraph(&format!(
        "The record does not identify {} of {} parameter combinations (± in prior widths):",
        weak.len(),
        information.directions.len(),
    )));
    for direction in weak.iter().take(COMBINATIONS) {
        let error = short(direction.std_error);
        lines.push(format!(
            "  {}  ± {error}",
            clipped(&direction.combination, COLUMNS - 16)
        ));
    }
    if weak.len() > COMBINATIONS {
        lines.push(format!("  … and {} more", weak.len() - COMBINATIONS));
    }
    lines.extend(paragraph(
        "Moves along such a combination hardly change the record: fix one of its parameters, or use another input.",
    ));
    lines
}

/// Returns the test of the calibrated twin; `None` without a refit.
fn after(estimate: &Estimate) -> Option<String> {
    let refit = estimate.refit().filter(|refit| !refit.is_refused)?;
    Some(match refit.after {
        Some(test) if !test.out_of_distribution && estimate.is_no_better_than_constant() => {
            format!(
                "The test after the refit does not reject ({}), but the free run shows nothing of the record.",
                p_value(&test)
            )
        }
        None => "The calibrated twin cannot be tested: there are no more features than parameters."
            .into(),
        Some(test) if test.out_of_distribution => format!(
            "The calibrated twin does not explain the record ({}, false-alarm rate {} %): no parameters compensate for what it lacks. Standard errors hold only for a complete twin. Next: truetwin diagnose.",
            p_value(&test),
            100.0 * test.alpha,
        ),
        Some(test) => format!(
            "The calibrated twin is consistent with the record ({}).",
            p_value(&test)
        ),
    })
}

/// Returns free-run errors before and after, and on the validation record.
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
    let after = short(after.rmse);
    let before = (estimate.refit()).and_then(|refit| refit.tracking_initial.as_ref());
    let mut text = match before {
        Some(before) => {
            format!("Free-run RMSE {} → {after}{unit}", short(before.rmse))
        }
        None => format!("Free-run RMSE {after}{unit}"),
    };
    if let Some(validation) = &estimate.validation {
        text.push_str(&format!(
            "; validation record {}{unit}",
            short(validation.rmse)
        ));
    }
    text + "."
}

/// Returns simulations and seconds.
fn effort(estimate: &Estimate) -> String {
    let redrawn = match estimate.redrawn() {
        0 => String::new(),
        n => format!(" ({n} draws of the cloud repeated)"),
    };
    format!(
        "{} simulations{redrawn}, {} s.",
        estimate.simulations,
        short(estimate.seconds.total)
    )
}

/// Returns the first warnings.
fn warnings(estimate: &Estimate) -> Vec<String> {
    let mut lines: Vec<String> = (estimate.warnings.iter().take(WARNINGS))
        .flat_map(|w| paragraph(&format!("warning: {}; {}", w.what, w.remedy)))
        .collect();
    let more = estimate.warnings.len().saturating_sub(WARNINGS);
    if more > 0 {
        lines.push(format!("… and {more} more warnings; --json has them all"));
    }
    lines
}

/// Breaks text into lines of at most [`COLUMNS`] columns.
fn paragraph(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = vec![];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if length(line) + 1 + length(word) <= COLUMNS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(clipped(word, COLUMNS)),
        }
    }
    lines
}

fn length(text: &str) -> usize {
    text.chars().count()
}

/// Cuts text to `width` columns, with an ellipsis.
fn clipped(text: &str, width: usize) -> String {
    if length(text) <= width {
        return text.into();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    kept + "…"
}

#[cfg(test)]
mod tests;
