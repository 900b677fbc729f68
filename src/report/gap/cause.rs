//! Sections on causes: explanations by probability, with magnitudes; terms of the missing function.

use super::pictures;
use super::statement::{Names, accepted_ids, rivals};
use crate::diagnose::{Cause, Decision, Detection, Diagnosis, EffectFit, THRESHOLDS, Verdict};
use crate::report::digits::{Digits, SHOWN, chance, percent, probability, short};
use crate::report::document::Column::{Number, Text};
use crate::report::document::{Block, Section};
use crate::report::units::Units;
use crate::study::Study;

pub(super) fn section(units: &Units, diagnosis: &Diagnosis) -> Section {
    let cause = &diagnosis.cause;
    let mut brief = vec![Block::Paragraph(evidence(diagnosis))];
    let mut rest = vec![Block::Paragraph(decision(diagnosis))];
    let effects = cause.effects.iter();
    let rows: Vec<Vec<String>> = effects.map(|e| row(units, cause, e)).collect();
    if !rows.is_empty() {
        let head = [
            ("effect", Text),
            ("probability", Number),
            ("nats", Number),
            ("", Text),
            ("magnitudes", Text),
        ];
        brief.push(Block::table(
            "",
            &head,
            rows.iter().take(SHOWN.effects).cloned().collect(),
        ));
        if rows.len() > SHOWN.effects {
            let table = Block::table("", &head, rows);
            rest.push(Block::folded("All effects", vec![table]));
        }
    }
    brief.extend(remains(cause).map(Block::Paragraph));
    if let Some(svg) = pictures::explanations(diagnosis) {
        let caption = match cause.decision {
            Decision::Absorbed => {
                "Posterior probability of each effect, and its evidence over the twin with parameters inside the prior."
            }
            _ => {
                "Posterior probability that an effect is missing, alone or beside others; nats: its evidence alone, over the twin, or that \
                 of all effects that are accepted together. Filled bar and bold name: accepted. Last: what is missing, all in all; these \
                 four add up to 1."
            }
        };
        rest.push(Block::picture(svg, caption));
    }
    Section::new("which", "Which effect", rest).brief(brief)
}

/// The evidence behind the verdict, and the noise that the diagnosis used.
fn evidence(diagnosis: &Diagnosis) -> String {
    let calibrated = match calibration(&diagnosis.detection) {
        Some(p) => format!("; {p}"),
        None => String::new(),
    };
    let correlated = diagnosis.correlated_noise.join(" and ");
    let outliers = diagnosis.outliers.join(" and ");
    let proportional = match diagnosis.proportional_noise.join(" and ") {
        none if none.is_empty() => none,
        places => format!(" The noise grows with the signal at {places}."),
    };
    let noise = match (correlated.is_empty(), outliers.is_empty()) {
        (true, true) => String::new(),
        (true, false) => format!(" The noise has outliers at {outliers}."),
        (false, is_alone) => {
            let and = match is_alone {
                true => String::new(),
                false => format!(", and has outliers at {outliers}"),
            };
            format!(
                " The noise is correlated at {correlated}{and}: something weak and slow may pass for it."
            )
        }
    };
    format!(
        "Evidence for a gap: {} nats (called above 3); probability that nothing is missing: {}{calibrated}.{noise}{proportional}",
        short(diagnosis.detection.log_evidence),
        chance(diagnosis.cause.probabilities.nothing)
    )
}

/// The p-value by simulation; none where it was not asked for.
pub(super) fn calibration(d: &Detection) -> Option<String> {
    let p = d.p_value?;
    let p = match d.at_floor {
        true => format!("p < {}", Digits::significant(p, 2).write(p)),
        false => probability(p),
    };
    Some(format!("{p} ({} simulations)", d.simulations))
}

/// The decision in a sentence.
fn decision(diagnosis: &Diagnosis) -> String {
    let cause = &diagnosis.cause;
    let kinds = &cause.probabilities;
    match cause.decision {
        Decision::Named if cause.accepted.len() > 1 => format!(
            "{} effects are accepted together; no single one explains as much.",
            cause.accepted.len()
        ),
        Decision::Named => "One effect is accepted; no other one comes near it.".into(),
        Decision::Class => format!(
            "The best explanation is accepted; the record cannot separate it from {} within {} nats.",
            rivals(cause),
            THRESHOLDS.rivals
        ),
        Decision::Partial if Names::of(cause).is_complete() => format!(
            "{} explains most of the gap; something unknown remains.",
            accepted_ids(cause)
        ),
        Decision::Partial => {
            "Listed effects explain most of the gap, but not all of them are more probable than not; something unknown remains.".into()
        }
        Decision::NoneOfThese if kinds.unknown >= kinds.listed + kinds.partial => {
            "No listed effect is accepted: unknown functions explain the record better than each of them, or much beside it.".into()
        }
        Decision::NoneOfThese => "No listed effect is accepted: the evidence is too weak for a name.".into(),
        Decision::Absorbed => {
            "Parameters outside the prior explain the record; so do these effects with parameters inside the prior.".into()
        }
        Decision::NotNeeded if diagnosis.interrupted => "The search was interrupted.".into(),
        Decision::NotNeeded if diagnosis.verdict == Verdict::ParameterGap => {
            "No effect is needed: other parameters explain the record.".into()
        }
        Decision::NotNeeded => "No effect is called.".into(),
    }
}

fn row(units: &Units, cause: &Cause, effect: &EffectFit) -> Vec<String> {
    let key = effect.key();
    let standing = match (cause.accepted.contains(&key), cause.class.contains(&key)) {
        (true, _) => "accepted",
        (false, true) => "rival",
        (false, false) => "",
    };
    let names: Vec<&str> = std::iter::once(key.as_str())
        .chain(effect.also.iter().map(String::as_str))
        .collect();
    vec![
        names.join(" or "),
        chance(effect.probability),
        short(effect.log_evidence),
        standing.into(),
        units.magnitudes(effect),
    ]
}

/// Evidence that an unknown function adds to effects; none where that was not asked.
fn remains(cause: &Cause) -> Option<String> {
    let remains = cause.remains.as_ref()?;
    let effects = match cause.accepted.as_slice() {
        [] => "the best listed effect".into(),
        _ => accepted_ids(cause),
    };
    let said = match remains.log_evidence > 0.0 {
        true => format!(
            "What remains: beside {effects}, something unknown at {} adds {} nats ({} of all).",
            remains.place,
            short(remains.log_evidence),
            percent(remains.share)
        ),
        false => format!("What remains: beside {effects}, no unknown function adds evidence."),
    };
    // A class says so itself.
    let alike = match (cause.decision, rivals(cause)) {
        (Decision::Partial, names) if !names.is_empty() => {
            format!(" Within {} nats of these: {names}.", THRESHOLDS.rivals)
        }
        _ => String::new(),
    };
    Some(said + &alike)
}

/// Terms of the missing function: exploratory, no test. `None` where nothing was explored.
pub(super) fn discovery(study: &Study, diagnosis: &Diagnosis) -> Option<Section> {
    let d = diagnosis.discovery.as_ref()?;
    let terms: Vec<String> = (d.terms.iter().take(SHOWN.terms))
        .map(|t| {
            format!(
                "{} · {} ({})",
                short(t.coefficient),
                t.name,
                percent(t.inclusion)
            )
        })
        .collect();
    let terms = match terms.is_empty() {
        true => "no term".into(),
        false => terms.join(", "),
    };
    let brief = Block::Paragraph(format!(
        "Exploratory, missing function of {} at the {}: {terms}; {} of its variance explained.",
        d.variable,
        Units::of(study).place_name(&d.equation),
        percent(d.explained)
    ));
    let mut rest = vec![Block::paragraph(
        "Simple terms are fitted to the missing function: hints, not findings.",
    )];
    rest.extend(pictures::terms(study, diagnosis).map(|svg| {
        Block::picture(
            svg,
            "Share of draws of the function that include a term, and its factor. A term that is nearly always included, with an \
             interval away from zero, is worth trying as your own effect.",
        )
    }));
    let section = Section::new("discovery", "Candidates for the missing law", rest);
    Some(section.brief(vec![brief]))
}
