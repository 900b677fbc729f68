//! Section on the location of a gap: in the twin, in time, missing functions, at values, lags and frequencies.

use super::statement::{accepted_ids, accepted_places, places};
use super::words::{few, joined};
use super::{check, pictures};
use crate::diagnose::{Diagnosis, Maps, Verdict};
use crate::report::digits::{SHOWN, chance, short};
use crate::report::document::{Block, Section};
use crate::report::units::Units;
use crate::setting::unit_suffix;
use crate::study::Study;

pub(super) fn section(study: &Study, diagnosis: &Diagnosis) -> Section {
    let units = Units::of(study);
    let section = Section::new("where", "Where", vec![]);
    if diagnosis.verdict != Verdict::StructuralGap {
        let none = Block::paragraph("There is no structural gap to locate.");
        return Section {
            rest: vec![none],
            ..section
        };
    }
    let brief = place(&units, diagnosis).map(Block::Paragraph);
    let mut rest: Vec<Block> = (pictures::targets(diagnosis))
        .map(|svg| {
            let named = match places(diagnosis).as_slice() {
                [] => String::new(),
                [one] => format!(" Filled bar and bold name: {one}."),
                several => format!(" Filled bars and bold names: {}.", few(several)),
            };
            let caption = format!("Posterior probability of each place, given a gap.{named}");
            Block::picture(svg, caption)
        })
        .into_iter()
        .collect();
    rest.extend(check::disturbance(&units, diagnosis));
    rest.extend(time(diagnosis));
    if let Some(svg) = pictures::functions(study, diagnosis) {
        rest.extend([
            Block::Heading("Missing functions".into()),
            Block::paragraph(
                "Each unknown function is fitted together with parameters and noise levels. Above zero, the twin gives too little; below, too much.",
            ),
            Block::picture(
                svg,
                "Mean and band of ± 1 standard error over the range that the records show; values are in report.json. A function on top of \
                 the accepted effects shows what they do not explain: it should stay near zero.",
            ),
        ]);
    }
    let further = [
        (
            pictures::regions(study, diagnosis),
            "Shares of the best explanation's gain, by the filtered state or the input one step before, and by the predicted output; all \
             ranges of all variables add up to 100 %. Only ranges that stand out from white noise.",
        ),
        (
            pictures::channels(study, diagnosis),
            "Share of each output in the misfit that stands out from white noise.",
        ),
        (
            pictures::lags(diagnosis),
            "Shares of the squared correlations beyond chance. An output on its own past: missing memory, or noise that is not white; on \
             the past of an input: a missing path or delay.",
        ),
        (
            pictures::bands(diagnosis),
            "Shares of the innovations’ power beyond chance.",
        ),
    ];
    let further: Vec<Block> = (further.into_iter())
        .filter_map(|(svg, caption)| Some(Block::picture(svg?, caption)))
        .collect();
    if !further.is_empty() {
        rest.push(Block::folded(
            "By value, output, lag and frequency",
            further,
        ));
    }
    Section { rest, ..section }.brief(brief.into_iter().collect())
}

/// The place of the gap, in the twin, in time and by values; none where it is not known.
fn place(units: &Units, diagnosis: &Diagnosis) -> Option<String> {
    let location = &diagnosis.location;
    let target = location.target.as_ref()?;
    let of = |place: &str| {
        let words = units.in_words(place);
        let share = location.targets.iter().find(|t| t.target == place);
        match (share, words.strip_suffix(')')) {
            (None, _) => words,
            (Some(t), Some(open)) => format!("{open}, probability {})", chance(t.probability)),
            (Some(t), None) => format!("{words} (probability {})", chance(t.probability)),
        }
    };
    let together: Vec<String> = accepted_places(diagnosis)
        .into_iter()
        .map(|place| units.in_words(place))
        .collect();
    let places = match location.class.is_empty() {
        _ if together.len() > 1 => joined(&together, "and"),
        true => of(target),
        false => {
            let class: Vec<String> = location.class.iter().map(|place| of(place)).collect();
            joined(&class, "or") + ", this record cannot tell which"
        }
    };
    let mut line = format!("Where: {places}");
    if let Some(onset) = &location.onset {
        line.push_str(&format!(
            "; {} changes at {} s",
            onset.parameter,
            short(onset.time)
        ));
    }
    let maps = location.maps.notable();
    let when = (maps.windows.iter().take(SHOWN.windows))
        .map(|w| format!("{} to {} s", short(w.start), short(w.end)));
    let regions = maps.regions.iter().take(SHOWN.windows).map(|r| {
        let unit = unit_suffix(units.variable(&r.variable));
        format!(
            "{} in {} … {}{unit}",
            r.variable,
            short(r.low),
            short(r.high)
        )
    });
    for (what, list) in [
        ("clearest", when.collect::<Vec<_>>()),
        ("at", regions.collect()),
    ] {
        if !list.is_empty() {
            line.push_str(&format!("; {what} {}", list.join(", ")));
        }
    }
    Some(line + ".")
}

/// When, before and after the effect.
fn time(diagnosis: &Diagnosis) -> Vec<Block> {
    let location = &diagnosis.location;
    let Some(svg) = pictures::time(diagnosis) else {
        return vec![];
    };
    let mut lead = match &location.onset {
        Some(o) => format!(
            "A change of {} at {} s explains the record best. ",
            o.parameter,
            short(o.time)
        ),
        None => String::new(),
    };
    lead.push_str(&format!("{}.", standing(&location.maps)));
    if let Some(after) = &location.after {
        let added = match diagnosis.cause.accepted.as_slice() {
            [] => "the best explanation".into(),
            _ => accepted_ids(&diagnosis.cause),
        };
        lead.push_str(&format!(
            " With {added} added: {}.",
            standing(after).to_lowercase()
        ));
    }
    let caption = "Shares of the gap by window and output. Frame and bold text: the window stands out; no frame: like white noise.";
    vec![
        Block::Heading("In time".into()),
        Block::Paragraph(lead),
        Block::picture(svg, caption),
    ]
}

/// The number of windows that stand out.
fn standing(maps: &Maps) -> String {
    match (maps.notable().windows.len(), maps.windows.len()) {
        (0, _) => "No window stands out from white noise".into(),
        (some, all) => format!("{some} of {all} windows stand out from white noise"),
    }
}
