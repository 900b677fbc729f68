//! Section on next steps.

use super::NEXT_INPUT;
use super::pictures;
use super::statement::{Names, next, rivals, somewhere};
use super::words::few;
use crate::diagnose::{Decision, Diagnosis, EffectFit, NextInput, Verdict};
use crate::math::six_digits;
use crate::report::digits::short;
use crate::report::document::{Block, Section};
use crate::report::units::Units;
use crate::study::Study;

pub(super) fn section(study: &Study, units: &Units, diagnosis: &Diagnosis) -> Section {
    let mut rest = vec![Block::List(steps(units, diagnosis))];
    let names = Names::of(&diagnosis.cause);
    let tables: Vec<String> = names
        .known
        .iter()
        .filter_map(|e| study_table(units, e))
        .collect();
    if !tables.is_empty() && diagnosis.verdict == Verdict::StructuralGap {
        rest.push(Block::paragraph(
            "For the study, with the magnitudes found:",
        ));
        rest.push(Block::Code(tables.join("\n")));
    }
    if let Some(next) = &diagnosis.cause.next_input {
        rest.extend(measure(study, diagnosis, next));
    }
    Section::new("next", "What to do next", rest)
}

/// The proposal of a record that separates the rivals.
fn measure(study: &Study, diagnosis: &Diagnosis, next: &NextInput) -> Vec<Block> {
    let drive = &next.drive;
    let ([split, of], [again, of_again]) = (next.split, next.again);
    vec![
        Block::Heading("Measure this next".into()),
        Block::Paragraph(format!(
            "{NEXT_INPUT}, beside this page, holds {}: {} samples every {} s, {} s in all. It separates {}. In simulations, present record \
             and proposed record together separate the rivals in {split} of {of} cases; the present inputs measured again do so in {again} \
             of {of_again}. Then diagnose both records together.",
            next.kind,
            drive.samples(),
            short(drive.dt()),
            short(drive.time(drive.samples())),
            few(&next.rivals)
        )),
        match pictures::next_input(study, diagnosis) {
            Some(svg) => Block::picture(svg, "The input, held over each step."),
            None => Block::paragraph("The twin has no input: the file holds only the time column."),
        },
    ]
}

/// The next step of the answer, then what it takes.
fn steps(units: &Units, diagnosis: &Diagnosis) -> Vec<String> {
    let cause = &diagnosis.cause;
    let advice = next(diagnosis);
    let mut steps = vec![advice.strip_prefix("Next: ").unwrap_or(&advice).to_owned()];
    match cause.decision {
        Decision::Class => steps.push(format!(
            "Separate the rivals ({}) with a wider or faster input; docs/choosing-effects.md explains how to tell neighbours apart.",
            rivals(cause)
        )),
        Decision::Partial => {
            let remains = cause.remains.as_ref().map(|r| units.in_words(&r.place));
            steps.extend(unlisted(diagnosis, remains.as_deref()));
        }
        Decision::NoneOfThese => {
            let places = somewhere(units, &diagnosis.location).map(|[named, _]| named);
            steps.extend(unlisted(diagnosis, places.as_deref()));
        }
        Decision::Named | Decision::Absorbed | Decision::NotNeeded => {}
    }
    let vague = diagnosis.parameters.iter().filter(|p| !p.identified);
    let vague: Vec<&str> = vague.map(|p| p.name.as_str()).collect();
    if !vague.is_empty() {
        steps.push(format!(
            "This record does not identify {}: fix the parameters that are known otherwise, or measure with a richer input.",
            few(&vague)
        ));
    }
    if diagnosis.validation_runs.is_none() && diagnosis.verdict == Verdict::StructuralGap {
        steps.push("Measure a second record with another input, for validation.".into());
    }
    steps
}

/// Hints for an unlisted law at a place: the maps that it leaves, and the exploration.
fn unlisted(diagnosis: &Diagnosis, place: Option<&str>) -> Vec<String> {
    let location = &diagnosis.location;
    let left = location
        .after
        .as_ref()
        .filter(|_| diagnosis.cause.decision == Decision::Partial);
    let maps = left.unwrap_or(&location.maps).notable();
    let mut look = format!("Look at {}", place.unwrap_or("the twin"));
    if let Some(r) = maps.regions.first() {
        let range = format!("{} is {} … {}", r.variable, short(r.low), short(r.high));
        look.push_str(&format!(", especially where {range}"));
    }
    if let Some(w) = maps.windows.first() {
        look.push_str(&format!(
            ", and at {} to {} s",
            short(w.start),
            short(w.end)
        ));
    }
    let terms: Vec<&str> = (diagnosis.discovery.iter().flat_map(|d| &d.terms))
        .filter(|term| term.inclusion > 0.5)
        .map(|term| term.name.as_str())
        .collect();
    if !terms.is_empty() {
        look.push_str(&format!("; the exploration points to {}", few(&terms)));
    }
    vec![
        look + ".",
        "Write the suspected law as your own effect (examples/own_effect.rs) and diagnose again."
            .into(),
    ]
}

/// An effect with its keys and magnitudes, as study files have it.
fn study_table(units: &Units, fit: &EffectFit) -> Option<String> {
    let entry = units.effect(&fit.id, &fit.target)?.entry();
    let other = |key: &str, state: Option<String>| {
        state.map_or(String::new(), |state| format!("{key} = \"{state}\"\n"))
    };
    let other = other("from", entry.from) + &other("to", entry.to);
    // One that is off is infinite; what is left out would be estimated.
    let told = fit.magnitudes.iter().filter(|(_, value)| !value.is_nan());
    let values: Vec<String> = told
        .map(|(name, value)| format!("{name} = {:?}", six_digits(*value)))
        .collect();
    Some(format!(
        "[[effect]]\nid = \"{}\"\ntarget = \"{}\"\n{other}magnitudes = {{ {} }}\n",
        fit.id,
        fit.target,
        values.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::tanks;
    use crate::report::gap::statement::sentence;
    use crate::study::StudyFile;
    use std::path::Path;

    /// A range that ends above alone.
    fn clipping() -> EffectFit {
        EffectFit {
            id: "sensor-clipping".into(),
            target: "sensor".into(),
            probability: 1.0,
            magnitudes: vec![("low".into(), f64::NEG_INFINITY), ("high".into(), 0.9014)],
            log_evidence: 9.0,
            also: vec![],
        }
    }

    #[test]
    fn a_range_that_ends_on_one_side_is_told_by_that_end() {
        let told = sentence(&Units::of(&tanks(60)), &clipping()).unwrap();
        assert!(told.contains("sees nothing above 0.901"), "{told}");
    }

    /// A side that is off stays so: a magnitude that is left out would be estimated.
    #[test]
    fn a_table_has_the_magnitudes_that_are_off() {
        let study = tanks(60);
        let table = study_table(&Units::of(&study), &clipping()).unwrap();
        assert!(table.contains("{ low = -inf, high = 0.9014 }"), "{table}");
        let file = StudyFile::parse(&format!("twin = \"tanks\"\n{table}"), Path::new("s.toml"));
        let added = study.configure(&file.unwrap()).unwrap();
        let [own, all] = [&study, &added].map(|study| study.twin().parameters().len());
        assert_eq!(all, own, "nothing is left to estimate");
    }
}
