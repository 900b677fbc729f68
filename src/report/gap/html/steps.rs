//! Section on next steps.

use crate::diagnose::{Cause, Decision, Diagnosis, EffectFit, NextInput, Verdict};
use crate::math::six_digits;
use crate::report::digits::short;
use crate::report::gap::headline::{Naming, naming, somewhere};
use crate::report::gap::json::NEXT_INPUT;
use crate::report::gap::pictures;
use crate::report::gap::words::few;
use crate::report::page::{Section, figure, list, paragraph, preformatted, subheading};
use crate::report::units::Units;
use crate::study::Study;

pub(super) fn section_of(study: &Study, units: &Units, diagnosis: &Diagnosis) -> Section {
    let mut body = list(&steps(units, diagnosis));
    let accepted = &diagnosis.cause.accepted;
    if !accepted.is_empty() {
        let tables: Vec<String> = (diagnosis.cause.effects.iter())
            .filter(|e| accepted.contains(&e.key()))
            .filter_map(|e| study_table(units, e))
            .collect();
        body.push_str(&paragraph(
            "For the study file (magnitudes that are removed are estimated):",
        ));
        body.push_str(&preformatted(&tables.join("\n")));
    }
    if let Some(next) = &diagnosis.cause.next_input {
        body.push_str(&measure(study, diagnosis, next));
    }
    Section::new("next", "What to do next", body)
}

/// Returns the proposal of a record that separates the rivals.
fn measure(study: &Study, diagnosis: &Diagnosis, next: &NextInput) -> String {
    let drive = &next.drive;
    let mut body = subheading("Measure this next");
    body.push_str(&paragraph(&format!(
        "{NEXT_INPUT}, beside this page, holds {}: {} samples every {} s, {} s in all. It separates {}.",
        next.kind,
        drive.samples(),
        short(drive.dt()),
        short(drive.time(drive.samples())),
        few(&next.rivals)
    )));
    let ([split, of], [again, of_again]) = (next.split, next.again);
    body.push_str(&paragraph(&format!(
        "In simulations, present record and proposed record together separate the rivals in {split} of {of} cases; the present \
         inputs measured again do so in {again} of {of_again}."
    )));
    match pictures::next_input(study, diagnosis) {
        Some(svg) => {
            body.push_str(&figure(&svg, "The input, held over each step."));
        }
        None => body.push_str(&paragraph(
            "The twin has no input: the file holds only the time column.",
        )),
    }
    let call = format!(
        "truetwin diagnose RECORD.csv NEXT.csv --twin {}",
        diagnosis.twin
    );
    body.push_str(&paragraph("Then diagnose both records together:"));
    body.push_str(&preformatted(&call));
    body
}

fn steps(units: &Units, diagnosis: &Diagnosis) -> Vec<String> {
    let which = &diagnosis.cause;
    let mut steps = Vec::new();
    match (diagnosis.verdict, which.decision) {
        (Verdict::NoGap, _) => steps.push("Use the twin with the refitted parameters.".into()),
        (Verdict::ParameterGap, Decision::Absorbed) => steps.push(format!(
            "Take the refitted parameters, or measure with another input to separate them from {}.",
            few(&which.class)
        )),
        (Verdict::ParameterGap, _) => steps.push(
            "Check the refitted parameters. If they make sense, widen the prior in the study and pretrain again.".into(),
        ),
        (_, Decision::Named) => steps.push(add(which)),
        (_, Decision::Class) if which.next_input.is_some() => steps.push(format!(
            "Separate the rivals ({}): measure the record below.",
            few(&which.class)
        )),
        (_, Decision::Class) => steps.push(format!(
            "Separate the rivals ({}): give another record, with a wider or faster input; docs/choosing-effects.md \
             explains how to separate neighbours.",
            few(&which.class)
        )),
        (_, Decision::Partial) => {
            steps.push(add(which));
            let remains = which.remains.as_ref().map(|r| units.in_words(&r.place));
            steps.extend(unlisted(diagnosis, remains.as_deref()));
        }
        _ => {
            let places = somewhere(units, &diagnosis.location).map(|[named, _]| named);
            steps.extend(unlisted(diagnosis, places.as_deref()));
        }
    }
    let vague: Vec<&str> = (diagnosis.parameters.iter())
        .filter(|p| !p.identified)
        .map(|p| p.name.as_str())
        .collect();
    if !vague.is_empty() {
        steps.push(format!(
            "This record does not identify {}: fix the parameters that are known otherwise, or measure with a richer input.",
            few(&vague)
        ));
    }
    if diagnosis.validation_runs.is_none() && diagnosis.verdict == Verdict::StructuralGap {
        steps
            .push("Measure a second record with another input and give it as --validation.".into());
    }
    steps
}

/// Returns the advice to add effects, by name if they are more probable than not.
fn add(which: &Cause) -> String {
    let Naming {
        sure,
        one_of,
        is_complete,
        ..
    } = naming(which);
    match (is_complete, one_of.is_empty()) {
        (true, _) => format!("Add {} to the twin.", sure.join(" and ")),
        (false, false) => format!(
            "Try {} in the study, and keep the one that predicts another record best; or measure with another input to separate them.",
            few(&one_of)
        ),
        (false, true) => "Measure with another input: this record names no single effect.".into(),
    }
}

/// Returns hints for an unlisted law at a place: the maps that it leaves, and the exploration.
fn unlisted(diagnosis: &Diagnosis, place: Option<&str>) -> Vec<String> {
    let location = &diagnosis.location;
    let left = match diagnosis.cause.decision {
        Decision::Partial => location.after.as_ref(),
        _ => None,
    };
    let maps = left.unwrap_or(&location.maps).notable();
    let mut look = match place {
        Some(target) => format!("Look at {target}"),
        None => "Look at the twin".into(),
    };
    if let Some(r) = maps.regions.first() {
        look.push_str(&format!(
            ", especially where {} is {} … {}",
            r.variable,
            short(r.low),
            short(r.high)
        ));
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

/// `[[effect]]` with its keys.
fn study_table(units: &Units, fit: &EffectFit) -> Option<String> {
    let effect = units.effect(&fit.id, &fit.target)?;
    let entry = effect.entry();
    let other = |key: &str, state: Option<String>| {
        state.map_or(String::new(), |state| format!("{key} = \"{state}\"\n"))
    };
    let other = other("from", entry.from) + &other("to", entry.to);
    let finite = fit.magnitudes.iter().filter(|(_, value)| value.is_finite());
    let values: Vec<String> = finite
        .map(|(name, value)| format!("{name} = {:?}", six_digits(*value)))
        .collect();
    Some(format!(
        "[[effect]]\nid = \"{}\"\ntarget = \"{}\"\n{other}magnitudes = {{ {} }}\n",
        fit.id,
        fit.target,
        values.join(", ")
    ))
}
