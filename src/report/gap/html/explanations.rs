//! Section on causes: explanations by probability, with magnitudes.

use crate::diagnose::{Decision, Diagnosis, EffectFit, RIVALS, Verdict};
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
            "Best first. p: the effect's own scan, corrected for all candidates.",
            &head,
            &rows,
        ));
    }
    if let Some(p) = which.unexplained_p_value {
        body.push_str(&paragraph(&format!(
            "Residual test with the best explanation added: {}.",
            probability(p)
        )));
    }
    body
}

/// Returns the decision in a sentence.
fn decision(diagnosis: &Diagnosis) -> String {
    let which = &diagnosis.cause;
    match which.decision {
        Decision::Named if which.accepted.len() > 1 => format!(
            "{} effects are accepted together. Each probability compares an effect with all that were tried in its place; each \
             gain is what the effect adds to those above it.",
            which.accepted.len()
        ),
        Decision::Named => "One effect is accepted; no other one comes near it.".into(),
        Decision::Class => format!(
            "The best explanation is accepted; this record cannot separate {} effects within {RIVALS} nats of it.",
            which.class.len()
        ),
        Decision::NoneOfThese => match &which.catch_all {
            Some(place) => format!("No listed effect is accepted: a disturbance of {place} explains the record better."),
            None => "No listed effect is accepted: with each of them, the residual test still fails.".into(),
        },
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
    vec![
        key,
        standing.into(),
        units.magnitudes(effect),
        chance(effect.probability),
        short(effect.log_score_gain),
        effect.p_value.map_or("–".into(), bare),
    ]
}
