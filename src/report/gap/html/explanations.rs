//! Which effect: explanations by probability, with magnitudes.

use crate::diagnose::{Decision, Diagnosis, EffectFit, Verdict};
use crate::report::digits::bare;
use crate::report::digits::{chance, probability, short};
use crate::report::gap::pictures;
use crate::report::page::Column::{Number, Text};
use crate::report::page::{Section, figure, paragraph, table};
use crate::report::units::Units;

pub(super) fn section_of(units: &Units, diagnosis: &Diagnosis) -> Section {
    Section::new("which", "Which effect", body(units, diagnosis))
}

fn body(units: &Units, diagnosis: &Diagnosis) -> String {
    let which = &diagnosis.cause;
    let mut body = paragraph(&decision(diagnosis));
    if let Some(svg) = pictures::explanations(diagnosis) {
        let caption = match which.decision {
            Decision::Absorbed => {
                "Probability among these effects, and gain in log density over the twin with parameters inside the prior."
            }
            _ => {
                "Probability among all listed effects and unlisted disturbances, and gain in log density over the twin alone. \
                 Filled bar and bold name: accepted."
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
            ("gain in nats", Number),
            ("p", Number),
        ];
        body.push_str(&table(
            "Best first. p is that of the effect's own scan, corrected for all candidates.",
            &head,
            &rows,
        ));
    }
    if let Some(p) = which.unexplained_p_value {
        body.push_str(&paragraph(&format!(
            "The structural test of the twin with the best explanation added: {}.",
            probability(p)
        )));
    }
    body
}

/// What was decided, in a sentence.
fn decision(diagnosis: &Diagnosis) -> String {
    let which = &diagnosis.cause;
    match which.decision {
        Decision::Named if which.accepted.len() > 1 => {
            "A pair of effects is accepted. Probabilities are of each alone; the gain of the second is what it adds to the first."
                .into()
        }
        Decision::Named => "One effect is accepted, and no other comes near it.".into(),
        Decision::Class => format!(
            "The best guess is accepted; {} effects are within six nats of it, and these data cannot tell them apart.",
            which.class.len()
        ),
        Decision::NoneOfThese => match &which.catch_all {
            Some(place) => format!("No listed effect is accepted: a disturbance of {place} explains more."),
            None => "No listed effect is accepted: each leaves something visible.".into(),
        },
        Decision::Absorbed => {
            "Parameters outside the prior explain the record; so do these effects with parameters inside it.".into()
        }
        Decision::NotNeeded if diagnosis.verdict == Verdict::ParameterGap => {
            "None is needed: other parameters explain the record.".into()
        }
        Decision::NotNeeded => "None is needed.".into(),
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
    vec![
        key,
        standing.into(),
        units.magnitudes(effect),
        chance(effect.probability),
        short(effect.log_score_gain),
        effect.p_value.map_or("–".into(), bare),
    ]
}
