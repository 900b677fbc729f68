//! A diagnosis on the terminal.

use super::json::NEXT_INPUT;
use crate::diagnose::{
    Decision, Diagnosis, Discovery, EffectFit, NextInput, SHORTEST_SPLIT, Shrinkage, Verdict,
};
use crate::report::digits::{chance, error, percent, probability, short, unit_suffix};

/// Limit of lines.
const LINES: usize = 15;
/// Number of explanations shown.
const SHOWN: usize = 4;
/// Number of terms shown of a missing law.
const TERMS: usize = 3;

/// Returns the diagnosis in at most fifteen lines: verdict, test, parameters, location, explanations, extent, next record.
pub fn gap_text(diagnosis: &Diagnosis) -> String {
    let mut lines = vec![verdict_sentence(diagnosis)];
    let d = &diagnosis.detection;
    let mut test = format!(
        "Structural test of {}, refitted: {} (level {}).",
        diagnosis.twin,
        probability(d.p_value),
        d.alpha
    );
    if let Some(log_e) = d.log_e {
        test = test.trim_end_matches('.').to_owned();
        test.push_str(&format!(
            "; log E on the validation record {}.",
            short(log_e)
        ));
    }
    lines.push(test);
    let parameters: Vec<String> = (diagnosis.parameters.iter())
        .map(|p| {
            let known = if p.identified {
                ""
            } else {
                " (not identified)"
            };
            let unit = unit_suffix(&p.unit);
            format!(
                "{} = {} ± {}{unit}{known}",
                p.name,
                short(p.refitted),
                error(p.std_error)
            )
        })
        .collect();
    lines.push(parameters.join(", "));
    if let Some(target) = &diagnosis.location.target {
        let maps = diagnosis.location.maps.notable();
        let windows = maps.windows.iter().take(2);
        let when: Vec<String> = windows
            .map(|w| format!("{} to {} s", short(w.start), short(w.end)))
            .collect();
        let regions: Vec<String> = (maps.regions.iter().take(2))
            .map(|r| format!("{} in {} … {}", r.variable, short(r.low), short(r.high)))
            .collect();
        let mut line = format!("Where: {target}");
        if let Some(onset) = diagnosis.location.onset.as_ref().filter(|o| o.time > 0.0) {
            line.push_str(&format!("; from {} s on", short(onset.time)));
        }
        for (what, list) in [("clearest", when), ("at", regions)] {
            if !list.is_empty() {
                line.push_str(&format!("; {what} {}", list.join(", ")));
            }
        }
        lines.push(line + ".");
    }
    if !diagnosis.cause.effects.is_empty() {
        lines.push("  probability   gain   effect".into());
        for effect in diagnosis.cause.effects.iter().take(SHOWN) {
            lines.push(format!(
                "  {:>11} {:>6}   {}",
                chance(effect.probability),
                short(effect.log_score_gain),
                with_magnitudes(effect)
            ));
        }
    }
    if let Some(p) = diagnosis.cause.unexplained_p_value {
        lines.push(format!(
            "Residual test with the best explanation added: {}.",
            probability(p)
        ));
    }
    lines.extend(diagnosis.discovery.as_ref().map(explored));
    lines.push(match &diagnosis.shrinkage {
        Some(s) => closed_sentence(s),
        None => no_share(diagnosis),
    });
    lines.extend(diagnosis.cause.next_input.as_ref().map(measure_next));
    lines.push(format!(
        "{} explanations, {} s.",
        diagnosis.candidates,
        short(diagnosis.seconds)
    ));
    lines.truncate(LINES);
    lines.join("\n") + "\n"
}

/// Returns the answer in one sentence.
pub fn verdict_sentence(diagnosis: &Diagnosis) -> String {
    let listed = |keys: &[String]| keys.join(" and ");
    match (diagnosis.verdict, diagnosis.cause.decision) {
        (Verdict::NoGap, _) => {
            "No gap: the twin explains the record with parameters inside the prior.".into()
        }
        (Verdict::ParameterGap, Decision::Absorbed) => format!(
            "Parameter gap: parameters outside the prior explain the record; so would {} with parameters inside.",
            diagnosis.cause.class.first().cloned().unwrap_or_default()
        ),
        (Verdict::ParameterGap, _) => {
            "Parameter gap: the twin explains the record with parameters outside the prior.".into()
        }
        (_, Decision::Named) => {
            format!(
                "Structural gap: the twin lacks {}.",
                listed(&diagnosis.cause.accepted)
            )
        }
        (_, Decision::Class) => format!(
            "Structural gap: the twin lacks {}, or a rival that this record cannot separate from it ({}).",
            listed(&diagnosis.cause.accepted),
            diagnosis.cause.class[1..].join(", ")
        ),
        _ => match &diagnosis.location.target {
            Some(target) => format!(
                "Structural gap outside the library: no listed effect explains it; the missing law acts on {target}."
            ),
            None => "Structural gap outside the library: no listed effect explains it.".into(),
        },
    }
}

/// Returns errors on held-out data before and after, and the share of the gap closed.
pub(super) fn closed_sentence(s: &Shrinkage) -> String {
    let mut text = format!("{} on the {}: {}", s.metric, s.held_out, short(s.before));
    if let Some(after) = s.after {
        text.push_str(&format!(" → {}", short(after)));
    }
    if let Some(floor) = s.floor {
        text.push_str(&format!(", noise alone {}", short(floor)));
    }
    if let (Some(closed), Some(ends)) = (s.closed, s.interval) {
        let (closed, [low, high]) = (percent(closed), ends.map(percent));
        text.push_str(&format!("; {closed} of the gap closed ({low} to {high})"));
    }
    text + "."
}

/// Returns the reason for missing errors on held-out data.
pub(super) fn no_share(diagnosis: &Diagnosis) -> String {
    if diagnosis.validation_runs.is_none() && diagnosis.free_runs.times.len() < SHORTEST_SPLIT {
        return format!(
            "No share of the gap closed: the record is too short to hold data back. Give --validation, or a record of at least {SHORTEST_SPLIT} samples."
        );
    }
    "No share of the gap closed: the free run on the held-out data diverges.".into()
}

/// Returns the first terms of the missing law.
fn explored(discovery: &Discovery) -> String {
    let terms: Vec<String> = (discovery.terms.iter().take(TERMS))
        .map(|t| {
            format!(
                "{} · {} ({})",
                short(t.coefficient),
                t.name,
                percent(t.inclusion)
            )
        })
        .collect();
    let terms = if terms.is_empty() {
        "no term".into()
    } else {
        terms.join(", ")
    };
    format!(
        "Exploratory, missing term of {}: {terms}; {} of its variance explained.",
        discovery.equation,
        percent(discovery.explained)
    )
}

/// Returns the proposed record and its power to separate the rivals.
fn measure_next(next: &NextInput) -> String {
    let ([split, of], [again, of_again]) = (next.split, next.again);
    format!(
        "Measure next: {} ({NEXT_INPUT}); it separates the rivals in {split} of {of} simulations, the present inputs in {again} of {of_again}.",
        next.kind
    )
}

/// `id@target (name value, …)`.
fn with_magnitudes(effect: &EffectFit) -> String {
    let values: Vec<String> = (effect.magnitudes.iter())
        .filter(|(_, v)| v.is_finite())
        .map(|(name, v)| format!("{name} {}", short(*v)))
        .collect();
    format!("{} ({})", effect.key(), values.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{diagnoses, made};

    #[test]
    fn fifteen_lines_say_it_all() {
        for diagnosis in diagnoses() {
            let text = gap_text(diagnosis);
            assert!(text.lines().count() <= LINES, "{text}");
        }
        let named = gap_text(&diagnoses()[1]);
        assert!(
            named.starts_with("Structural gap: the twin lacks"),
            "{named}"
        );
        assert!(named.contains("Where: "), "{named}");
    }

    #[test]
    fn onset_exploration_and_what_to_measure_are_said() {
        let class = gap_text(&made::tanks_class());
        assert!(
            class.contains("Where: h1; from 612 s on; clearest"),
            "{class}"
        );
        let next = "separates the rivals in 18 of 20 simulations, the present inputs in 6 of 20";
        assert!(
            class.contains(next) && class.contains(NEXT_INPUT),
            "{class}"
        );
        let none = gap_text(&made::oscillator_none());
        let terms = "Exploratory, missing term of x2: −0.620 · |x1|·x2 (98 %), ";
        assert!(
            none.contains(terms) && none.contains("83 % of its variance explained"),
            "{none}"
        );
        let mut all = made::oscillator_none();
        all.cause.next_input = made::tanks_class().cause.next_input;
        for text in [class, none, gap_text(&all)] {
            assert!(text.lines().count() <= LINES, "{text}");
            assert!(text.ends_with("explanations, 5.20 s.\n"), "{text}");
        }
    }
}
