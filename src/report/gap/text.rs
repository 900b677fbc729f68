//! A diagnosis on the terminal.

use super::json::NEXT_INPUT;
use crate::diagnose::{
    Decision, Diagnosis, Discovery, EffectFit, NextInput, SHORTEST_SPLIT, Shrinkage, Verdict,
};
use crate::report::digits::{chance, error, percent, probability, short, unit_suffix};

/// Most lines of the text.
const LINES: usize = 15;
/// Explanations that are shown.
const SHOWN: usize = 4;
/// Terms of a missing law that are shown.
const TERMS: usize = 3;

/// The diagnosis in at most fifteen lines: the verdict, what it rests on, where, which, how far.
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
            "What the best explanation leaves: {}.",
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

/// The answer in one sentence.
pub fn verdict_sentence(diagnosis: &Diagnosis) -> String {
    let listed = |keys: &[String]| keys.join(" and ");
    match (diagnosis.verdict, diagnosis.cause.decision) {
        (Verdict::NoGap, _) => "No gap: the twin explains the record within its prior.".into(),
        (Verdict::ParameterGap, Decision::Absorbed) => format!(
            "Parameter gap: parameters outside the prior explain the record; so would {} with parameters inside.",
            diagnosis.cause.class.first().cloned().unwrap_or_default()
        ),
        (Verdict::ParameterGap, _) => {
            "Parameter gap: the twin explains the record with parameters outside its prior.".into()
        }
        (_, Decision::Named) => {
            format!(
                "Structural gap: the twin lacks {}.",
                listed(&diagnosis.cause.accepted)
            )
        }
        (_, Decision::Class) => format!(
            "Structural gap: the twin lacks {}, or a rival that these data cannot tell apart ({}).",
            listed(&diagnosis.cause.accepted),
            diagnosis.cause.class[1..].join(", ")
        ),
        _ => match &diagnosis.location.target {
            Some(target) => format!(
                "Structural gap that no listed effect explains; what is missing acts on {target}."
            ),
            None => "Structural gap that no listed effect explains.".into(),
        },
    }
}

/// Errors on held-out data before and after, and the share of the gap that closed.
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

/// Why there are no errors on held-out data.
pub(super) fn no_share(diagnosis: &Diagnosis) -> String {
    if diagnosis.validation_runs.is_none() && diagnosis.free_runs.times.len() < SHORTEST_SPLIT {
        return format!(
            "Too short to hold anything back: no share. Give --validation, or a record of at least {SHORTEST_SPLIT} samples."
        );
    }
    "The twin does not run through the held-out data: no share.".into()
}

/// The first terms of the missing law.
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
        "Exploratory, what {} lacks: {terms}; {} of its variance.",
        discovery.equation,
        percent(discovery.explained)
    )
}

/// What to measure, and what it splits.
fn measure_next(next: &NextInput) -> String {
    let ([split, of], [again, of_again]) = (next.split, next.again);
    format!(
        "Measure next: {} ({NEXT_INPUT}); {split} of {of} simulated pairs told apart, the same inputs again {again} of {of_again}.",
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
        let next = "18 of 20 simulated pairs told apart, the same inputs again 6 of 20";
        assert!(
            class.contains(next) && class.contains(NEXT_INPUT),
            "{class}"
        );
        let none = gap_text(&made::oscillator_none());
        let terms = "Exploratory, what x2 lacks: −0.620 · |x1|·x2 (98 %), ";
        assert!(
            none.contains(terms) && none.contains("83 % of its variance"),
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
