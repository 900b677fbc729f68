//! Section on causes: explanations by probability, with magnitudes.

use crate::diagnose::{Decision, Diagnosis, EffectFit, RIVALS, Verdict};
use crate::report::digits::{chance, short};
use crate::report::gap::headline::{naming, rivals};
use crate::report::gap::pictures;
use crate::report::gap::text::{evidence_sentence, remains_sentence};
use crate::report::gap::words::few;
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, figure, paragraph, table};
use crate::report::units::Units;

/// Order of the effects.
const ORDER: &str = "The accepted effects first, then the most probable. A probability counts an effect alone and beside others; nats are its \
                     evidence alone, over the twin, so that their order may differ. Effects accepted together have the nats of all of them.";

pub(super) fn section_of(units: &Units, diagnosis: &Diagnosis) -> Section {
    Section::new("which", "Which effect", body(units, diagnosis))
}

fn body(units: &Units, diagnosis: &Diagnosis) -> String {
    let which = &diagnosis.cause;
    let mut body = paragraph(&decision(diagnosis));
    body.push_str(&paragraph(&format!(
        "{} Nats are natural logarithms of odds: above 0, something is missing.",
        evidence_sentence(diagnosis)
    )));
    if let Some(svg) = pictures::explanations(diagnosis) {
        let caption = match which.decision {
            Decision::Absorbed => {
                "Posterior probability of each effect, and its evidence over the twin with parameters inside the prior."
            }
            _ => {
                "Posterior probability that an effect is missing, alone or beside others, and its evidence over the twin alone. Filled \
                 bar and bold name: accepted. Last: what is missing, all in all; these four add up to 1."
            }
        };
        body.push_str(&figure(&svg, caption));
        let rows: Vec<Vec<String>> = which
            .effects
            .iter()
            .map(|e| row(units, diagnosis, e))
            .collect();
        let head = [
            ("effect", Text),
            ("standing", Text),
            ("magnitudes", Text),
            ("probability", Number),
            ("nats", Number),
        ];
        body.push_str(&table(ORDER, &head, &rows));
    }
    if let Some(remains) = remains_sentence(which) {
        body.push_str(&paragraph(&remains));
    }
    body
}

/// Returns the decision in a sentence.
fn decision(diagnosis: &Diagnosis) -> String {
    let which = &diagnosis.cause;
    match which.decision {
        Decision::Named if which.accepted.len() > 1 => format!(
            "{} effects are accepted together; no single one explains as much.",
            which.accepted.len()
        ),
        Decision::Named => "One effect is accepted; no other one comes near it.".into(),
        Decision::Class => format!(
            "The best explanation is accepted; the record cannot separate it from {} within {RIVALS} nats.",
            few(&rivals(which))
        ),
        Decision::Partial if naming(which).is_complete => format!(
            "{} explains most of the gap; something unknown remains.",
            which.accepted.join(" and ")
        ),
        Decision::Partial => {
            "Listed effects explain most of the gap, but not all of them are more probable than not; something unknown remains.".into()
        }
        Decision::NoneOfThese => "No listed effect is accepted: with each of them, something unknown remains.".into(),
        Decision::Absorbed => {
            "Parameters outside the prior explain the record; so do these effects with parameters inside the prior.".into()
        }
        Decision::NotNeeded if diagnosis.verdict == Verdict::ParameterGap => {
            "No effect is needed: other parameters explain the record.".into()
        }
        Decision::NotNeeded => "No effect is needed.".into(),
    }
}

fn row(units: &Units, diagnosis: &Diagnosis, effect: &EffectFit) -> Vec<String> {
    let key = effect.key();
    let which = &diagnosis.cause;
    let standing = if which.accepted.contains(&key) {
        "accepted"
    } else if which.class.contains(&key) {
        "rival, same class"
    } else {
        ""
    };
    let names: Vec<&str> = std::iter::once(key.as_str())
        .chain(effect.also.iter().map(String::as_str))
        .collect();
    vec![
        names.join(" or "),
        standing.into(),
        units.magnitudes(effect),
        chance(effect.probability),
        short(effect.log_evidence),
    ]
}
