//! An estimate as text for the terminal.

use crate::estimator::{Estimate, INTERVAL_LEVEL};
use crate::report::digits::{self, Digits, probability, short, unit_suffix};
use crate::study::Study;
use crate::twin::{Parameter, Role};

/// Limits of columns and lines.
const COLUMNS: usize = 100;
const LINES: usize = 20;
/// Number of weak combinations shown.
const COMBINATIONS: usize = 2;

/// Returns the estimate in at most 20 lines of 100 columns: gate, parameters with errors, weak combinations, test after the
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
    below.push(effort(estimate));
    let left = LINES.saturating_sub(above.len() + below.len());
    let lines = [above, table(study, estimate, left), below].concat();
    lines.join("\n") + "\n"
}

/// Returns the answer of the gate and its consequence.
fn gate(study: &Study, estimate: &Estimate) -> String {
    let (name, test) = (study.name(), estimate.gate);
    let p = format!("{}, level {}", probability(test.p_value), test.alpha);
    match (test.out_of_distribution, estimate.refitted) {
        (true, _) => format!(
            "{name}: the record is inconsistent with the network's estimate ({p}); parameters refitted."
        ),
        (false, false) => format!(
            "{name}: the record is consistent with the network's estimate ({p}); estimate kept."
        ),
        (false, true) => format!(
            "{name}: the record is consistent with the network's estimate ({p}); parameters refitted as requested."
        ),
    }
}

/// Returns names, units and numbers of θ in aligned columns, in at most `lines` lines.
fn table(study: &Study, estimate: &Estimate, lines: usize) -> Vec<String> {
    let level = format!("{:.0} % interval", 100.0 * INTERVAL_LEVEL);
    let head = [
        "parameter",
        "unit",
        "initial",
        "final",
        "± std error",
        &level,
    ];
    let space = study.twin().parameters();
    // The twin's own parameters first.
    let (own, others): (Vec<_>, Vec<_>) =
        (space.iter().enumerate()).partition(|(_, p)| p.role == Role::Parameter);
    let all: Vec<_> = (own.into_iter().chain(others))
        .map(|(j, parameter)| row(estimate, j, parameter))
        .collect();
    let room = lines.saturating_sub(1).max(2);
    let shown = if all.len() > room {
        room - 1
    } else {
        all.len()
    };
    let mut cells = vec![head.map(str::to_owned)];
    cells.extend_from_slice(&all[..shown]);
    let mut widths: Vec<usize> = (0..head.len())
        .map(|c| cells.iter().map(|row| length(&row[c])).max().unwrap_or(0))
        .collect();
    let others: usize = widths[1..].iter().map(|w| w + 2).sum();
    widths[0] = widths[0].min(COLUMNS.saturating_sub(others).max(8));
    let mut written: Vec<String> = (cells.iter())
        .map(|row| {
            let aligned = row
                .iter()
                .zip(&widths)
                .enumerate()
                .map(|(c, (cell, &width))| match c {
                    0 | 1 => format!("{:<width$}", clipped(cell, width)),
                    _ => format!("{cell:>width$}"),
                });
            aligned.collect::<Vec<_>>().join("  ")
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

/// Returns one line of the table.
fn row(estimate: &Estimate, j: usize, parameter: &Parameter) -> [String; 6] {
    let name = match parameter.role {
        Role::Parameter | Role::Magnitude => parameter.name.clone(),
        Role::Start => format!("start of {}", parameter.target()),
        Role::Noise => format!("noise of {}", parameter.target()),
    };
    let (value, error) = (estimate.theta[j], estimate.std_error[j]);
    let digits = Digits::supported(value, error);
    let (low, high) = (
        digits.write(estimate.low[j]),
        digits.write(estimate.high[j]),
    );
    [
        name,
        clipped(&parameter.unit, 10),
        digits.write(estimate.initial[j]),
        digits.write(value),
        digits::error(error),
        format!("[{low}, {high}]"),
    ]
}

/// Returns the weak combinations after an empty line; nothing if there are none.
fn weak(estimate: &Estimate) -> Vec<String> {
    let Some(information) = &estimate.information else {
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
    if !estimate.refitted {
        return None;
    }
    Some(match estimate.after {
        None => "The calibrated twin cannot be tested: there are no more features than parameters."
            .into(),
        Some(test) if test.out_of_distribution => format!(
            "The calibrated twin does not explain the record ({}, false-alarm rate {} %): no parameters compensate for what it lacks. Standard errors hold only for a complete twin. Next: truetwin diagnose.",
            probability(test.p_value),
            100.0 * test.alpha,
        ),
        Some(test) => format!(
            "The calibrated twin is consistent with the record ({}).",
            probability(test.p_value)
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
    let mut text = match &estimate.tracking_initial {
        Some(before) if estimate.refitted => {
            format!("Free-run RMSE {} → {after}{unit}", short(before.rmse))
        }
        _ => format!("Free-run RMSE {after}{unit}"),
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
