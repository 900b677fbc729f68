//! An estimate as a person reads it on the terminal.

use crate::estimator::{Estimate, INTERVAL_LEVEL};
use crate::report::digits::{self, Digits, probability, short, unit_suffix};
use crate::study::Study;
use crate::twin::{Parameter, Role};

/// Columns and lines that an estimate takes at most.
const COLUMNS: usize = 100;
const LINES: usize = 20;
/// Weak combinations that are written out.
const COMBINATIONS: usize = 2;

/// The estimate in at most 20 lines of 100 columns, without colour codes: what the gate said, the parameters with
/// their errors, what the record tells little about, whether the calibrated twin explains the record, how well it
/// follows it.
///
/// Values have the digits that their standard errors support. Where there are more parameters than lines, the last
/// line of the table says so.
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

/// What the gate said, and what followed from it.
fn gate(study: &Study, estimate: &Estimate) -> String {
    let (name, test) = (study.name(), estimate.gate);
    let p = format!("{}, level {}", probability(test.p_value), test.alpha);
    match (test.out_of_distribution, estimate.refitted) {
        (true, _) => format!(
            "{name}: at the network's first estimate the twin does not make such a record ({p}); the estimate was refined on it."
        ),
        (false, false) => format!(
            "{name}: the record is what the twin makes at the network's estimate ({p}); it was kept."
        ),
        (false, true) => format!(
            "{name}: the record is what the twin makes at the network's first estimate ({p}); it was refined all the same, as asked."
        ),
    }
}

/// Names, units and numbers of all of θ in aligned columns, in at most `lines` lines.
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
        (space.iter().enumerate()).partition(|(_, p)| p.role == Role::Physical);
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

/// One line of the table.
fn row(estimate: &Estimate, j: usize, parameter: &Parameter) -> [String; 6] {
    let name = match parameter.role {
        Role::Physical | Role::Effect => parameter.name.clone(),
        Role::Start => parameter.name.replacen("start.", "start of ", 1),
        Role::Noise => parameter.name.replacen("noise.", "noise of ", 1),
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

/// The weak combinations in words, after an empty line; nothing where all is well.
fn weak(estimate: &Estimate) -> Vec<String> {
    let Some(information) = &estimate.information else {
        return [
            vec![String::new()],
            paragraph("The features do not tell which parameters the record determines."),
        ]
        .concat();
    };
    let weak: Vec<_> = information.weak().collect();
    if weak.is_empty() {
        return vec![];
    }
    let mut lines = vec![String::new()];
    lines.extend(paragraph(&format!(
        "The record tells less than the prior about {} of {} combinations (± in prior widths):",
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
        "Moving along such a combination hardly changes the record: fix a parameter in it, or excite the system in another way.",
    ));
    lines
}

/// Whether the calibrated twin explains the record; `None` where nothing was refitted.
fn after(estimate: &Estimate) -> Option<String> {
    if !estimate.refitted {
        return None;
    }
    Some(match estimate.after {
        None => "Whether the calibrated twin explains the record cannot be tested: the features have no more numbers than θ.".into(),
        Some(test) if test.out_of_distribution => format!(
            "The calibrated twin does not explain the record ({}; a complete twin fails this test in {} % of records): it seems to lack something that no parameter makes up for. The standard errors hold only if nothing is missing.",
            probability(test.p_value),
            100.0 * test.alpha,
        ),
        Some(test) => format!(
            "The calibrated twin is consistent with the record ({}).",
            probability(test.p_value)
        ),
    })
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
        return "The free run at the estimate diverges: the twin cannot be run without noise there.".into();
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

/// Simulations and seconds.
fn effort(estimate: &Estimate) -> String {
    let redrawn = match estimate.redrawn() {
        0 => String::new(),
        n => format!(" ({n} of the cloud drawn anew)"),
    };
    format!(
        "{} simulations{redrawn}, {} s.",
        estimate.simulations,
        short(estimate.seconds.total)
    )
}

/// Text in lines of at most [`COLUMNS`] columns.
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

/// Text of at most `width` columns, its end replaced by an ellipsis.
fn clipped(text: &str, width: usize) -> String {
    if length(text) <= width {
        return text.into();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    kept + "…"
}

#[cfg(test)]
mod tests;
