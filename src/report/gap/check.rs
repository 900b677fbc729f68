//! Predictive check of an all-clear in words, and the disturbance that noise had swallowed.

use super::pictures;
use crate::diagnose::{Diagnosis, HiddenDisturbance, Predicted, PredictiveCheck};
use crate::report::digits::{SHOWN, chance, percent, short, with_unit};
use crate::report::document::Block;
use crate::report::document::Column::{Number, Text};
use crate::report::units::Units;

/// The outcome of the check in one sentence; none where there was none.
pub(super) fn outcome(diagnosis: &Diagnosis) -> Option<String> {
    let check = diagnosis.check.as_ref()?;
    let p = chance(check.p_value);
    let loud = check.noise_share.filter(|_| check.is_loud());
    Some(match (check.is_passed(), check.clearest()) {
        (true, _) if loud.is_some() => format!(
            "Predictive check: noise that was not declared makes {} of the output's variance.",
            percent(loud.unwrap_or_default())
        ),
        (true, _) => format!(
            "Predictive check: the record looks like {} that the fitted twin simulates (p = {p}).",
            check.simulations
        ),
        (false, Some(row)) => format!(
            "Predictive check: the record does not look like {} that the fitted twin simulates (p = {p}): {}.",
            check.simulations,
            departure(row)
        ),
        (false, None) => format!("Predictive check: p = {p}."),
    })
}

fn departure(row: &Predicted) -> String {
    let [low, high] = row.expected.map(short);
    format!(
        "{} {}, expected {low} to {high}",
        row.statistic,
        short(row.measured)
    )
}

/// The disturbance of a record that the check refused: words, then a picture.
pub(super) fn disturbance(units: &Units, diagnosis: &Diagnosis) -> Vec<Block> {
    let Some(disturbance) = diagnosis.disturbance() else {
        return vec![];
    };
    let mut blocks = vec![
        Block::Heading("Disturbance".into()),
        Block::Paragraph(words(units, disturbance)),
    ];
    if let Some(svg) = pictures::disturbance(diagnosis) {
        let caption = "What pushes the state, from the whole record; marked: larger than the fitted noise ever gets in simulated records.";
        blocks.push(Block::picture(svg, caption));
    }
    blocks
}

fn words(units: &Units, disturbance: &HiddenDisturbance) -> String {
    let place = units.in_words(&disturbance.place);
    let mut text = format!("The noise that the fit gives {place} hides a disturbance");
    text += &format!(
        " of {} (root mean square; {} if the noise were as declared).",
        with_unit(disturbance.size, &disturbance.unit),
        short(disturbance.expected)
    );
    if let Some(scale) = disturbance.time_scale {
        text += &format!(" It is clearest over {} s", short(scale));
        let named = disturbance.bursts.iter().take(SHOWN.bursts);
        let named: Vec<String> = named
            .map(|burst| format!("{} to {} s", short(burst.start), short(burst.end)))
            .collect();
        match disturbance.bursts.len() {
            0 => {}
            count if count <= SHOWN.bursts => text += &format!(": {}", named.join(", ")),
            count => text += &format!(": {count} times, first {}", named.join(", ")),
        }
        text += ".";
    }
    text
}

/// All statistics of the check.
pub(super) fn table(check: &PredictiveCheck) -> Block {
    let head = [
        ("statistic", Text),
        ("record", Number),
        ("90 % of simulated records", Text),
        ("deviations", Number),
    ];
    let row = |row: &Predicted| {
        let [low, high] = row.expected.map(short);
        vec![
            row.statistic.clone(),
            short(row.measured),
            format!("{low} to {high}"),
            short(row.deviations),
        ]
    };
    let caption = "Spread, whiteness, tails and bursts are of standardised one-step residuals; errors are over the output's deviation.";
    let table = Block::table(caption, &head, check.rows.iter().map(row).collect());
    Block::folded("Predictive check, by statistic", vec![table])
}
