//! Where: places in the twin, ranges of states and inputs, windows of further records.

use super::page::{figure, list, paragraph, section};
use crate::diagnose::{Diagnosis, Verdict};
use crate::report::digits::{percent, probability, short};
use crate::report::gap_figures::{gap_regions_svg, gap_targets_svg};
use crate::study::Study;

pub(super) fn section_of(study: &Study, found: &Diagnosis) -> String {
    section("where", "Where", &body(study, found))
}

fn body(study: &Study, found: &Diagnosis) -> String {
    if found.verdict != Verdict::StructuralGap {
        return paragraph("There is no structural gap to locate.");
    }
    let mut body = match &found.place.target {
        Some(target) => paragraph(&format!("What is missing acts on {target}.")),
        None => String::new(),
    };
    let filled = format!("Filled bars and bold names: p < {}.", found.detection.alpha);
    if let Some(svg) = gap_targets_svg(found) {
        body.push_str(&figure(
            &svg,
            &format!("How probable it is that what explains the gap stands there. {filled}"),
        ));
    }
    if let Some(svg) = gap_regions_svg(study, found) {
        body.push_str(&figure(
            &svg,
            &format!(
                "Shares of what the best explanation gains, by the filtered state or the input a step before; all ranges of all \
                 variables add up to 100 %. Ranges that do not stand out (p > 0.1) are left out. {filled}"
            ),
        ));
    }
    let further: Vec<String> = (found.place.maps.notable().windows.iter())
        .filter(|w| w.record > 0)
        .map(|w| {
            let (start, end) = (short(w.start), short(w.end));
            let (share, p) = (percent(w.share), probability(w.p_value));
            format!(
                "Record {}, {}: {start} to {end} s, {share}, {p}",
                w.record + 1,
                w.channel
            )
        })
        .collect();
    if !further.is_empty() {
        body.push_str(&paragraph("Windows of further records that stand out:"));
        body.push_str(&list(&further));
    }
    body
}
