//! A diagnosis on the terminal.

use super::headline::{accepted_ids, accepted_places, headline, rivals};
use super::json::NEXT_INPUT;
use super::share::{closed_sentence, no_share};
use super::step::step_setting;
use super::story::{effects, next};
use super::words::{few, joined};
use crate::diagnose::{
    Cause, Decision, Detection, Diagnosis, Discovery, EffectFit, NextInput, RIVALS,
};
use crate::report::digits::{Digits, chance, error, percent, probability, short, unit_suffix};
use crate::report::parameters::ParameterRow;
use crate::report::units::Units;
use crate::study::Study;
use crate::twin::Role;

/// Limit of lines.
const LINES: usize = 15;
/// Number of explanations shown.
const SHOWN: usize = 4;
/// Head of the explanations, with their order.
const HEAD: &str =
    "  probability   nats   effect (most probable first, alone or beside others; nats: alone)";
/// Number of terms shown of a missing function.
const TERMS: usize = 3;

/// Returns the diagnosis in at most fifteen lines: verdict, effects in words, evidence, parameters, location, explanations, what
/// remains, extent, next record, what to do.
pub fn gap_text(study: &Study, diagnosis: &Diagnosis) -> String {
    let units = Units::of(study);
    let told = effects(&units, diagnosis).join(" ");
    let mut lines = vec![headline(&units, diagnosis)];
    lines.extend((!told.is_empty()).then_some(told));
    lines.push(evidence_sentence(diagnosis));
    lines.extend(step_sentence(diagnosis));
    lines.extend(quick_sentence(diagnosis));
    lines.extend(warned(diagnosis));
    let parameters: Vec<String> = (diagnosis.parameters.iter())
        .map(|p| {
            let note = match ParameterRow::diagnosed(p).note(Role::Parameter) {
                "" => String::new(),
                note => format!(" ({note})"),
            };
            let unit = unit_suffix(&p.unit);
            format!(
                "{} = {} ± {}{unit}{note}",
                p.name,
                short(p.refitted),
                error(p.std_error)
            )
        })
        .collect();
    lines.push(parameters.join(", "));
    lines.extend(place(&units, diagnosis));
    if !diagnosis.cause.effects.is_empty() {
        lines.push(HEAD.into());
        for effect in diagnosis.cause.effects.iter().take(SHOWN) {
            lines.push(format!(
                "  {:>11} {:>6}   {}",
                chance(effect.probability),
                short(effect.log_evidence),
                with_magnitudes(&units, effect)
            ));
        }
    }
    lines.extend(remains_sentence(&diagnosis.cause));
    lines.extend(diagnosis.discovery.as_ref().map(explored));
    lines.push(match &diagnosis.shrinkage {
        Some(s) => closed_sentence(s),
        None => no_share(diagnosis),
    });
    lines.push(match &diagnosis.cause.next_input {
        Some(input) => measure_next(input),
        None => next(diagnosis),
    });
    lines.push(format!(
        "{} explanations, {} s.",
        diagnosis.candidates,
        short(diagnosis.seconds)
    ));
    lines.truncate(LINES);
    lines.join("\n") + "\n"
}

/// Returns, in one line, the warnings that are not told elsewhere: still channels when records are read, a coarse step beside the evidence.
fn warned(diagnosis: &Diagnosis) -> Option<String> {
    const TOLD: [&str; 3] = ["constant-input", "constant-output", "coarse-step"];
    let own = diagnosis
        .warnings
        .iter()
        .filter(|w| !TOLD.contains(&w.code));
    let all: Vec<String> = own.map(|w| format!("{} ({})", w.what, w.remedy)).collect();
    (!all.is_empty()).then(|| format!("Warning: {}.", all.join("; ")))
}

/// Returns the evidence behind the verdict.
pub(super) fn evidence_sentence(diagnosis: &Diagnosis) -> String {
    let calibrated = match calibration(&diagnosis.detection) {
        Some(p) => format!("; {p}"),
        None => String::new(),
    };
    let noise = match noise_sentence(diagnosis) {
        Some(told) => format!(" {told}"),
        None => String::new(),
    };
    format!(
        "Evidence for a gap: {} nats; probability that nothing is missing: {}{calibrated}.{noise}",
        short(diagnosis.detection.log_evidence),
        chance(diagnosis.cause.probabilities.nothing)
    )
}

/// Returns the kinds of noise that the diagnosis used beside the twin's own; none where its own is enough.
fn noise_sentence(diagnosis: &Diagnosis) -> Option<String> {
    let correlated = diagnosis.correlated_noise.join(" and ");
    let outliers = diagnosis.outliers.join(" and ");
    match (correlated.is_empty(), outliers.is_empty()) {
        (true, true) => None,
        (true, false) => Some(format!("The noise has outliers at {outliers}.")),
        (false, true) => Some(format!(
            "The noise is correlated at {correlated}: something weak and slow may pass for it."
        )),
        (false, false) => Some(format!(
            "The noise is correlated at {correlated}, and has outliers at {outliers}: something weak and slow may pass for it."
        )),
    }
}

/// Returns what a quick look or an interrupted one leaves out; none for a whole diagnosis.
pub(super) fn quick_sentence(diagnosis: &Diagnosis) -> Option<String> {
    let said = match (diagnosis.interrupted, diagnosis.quick) {
        (true, _) => {
            "Interrupted before the search ended. Pairs, other noise or a finer step may not have been tried."
        }
        (false, true) => {
            "A quick look: effects one at a time, each from few starts. Without --quick, pairs are searched, and names are surer."
        }
        (false, false) => return None,
    };
    Some(said.to_owned())
}

/// Returns the finer step that the diagnosis used; none where it used the twin's own.
pub(super) fn step_sentence(diagnosis: &Diagnosis) -> Option<String> {
    let setting = step_setting(diagnosis)?;
    Some(format!(
        "The twin's own step is too long for this record; the diagnosis used {setting}."
    ))
}

/// Returns the p-value by simulation; none where it was not asked for.
pub(super) fn calibration(d: &Detection) -> Option<String> {
    let p = d.p_value?;
    let p = match d.at_floor {
        true => format!("p < {}", Digits::significant(p, 2).write(p)),
        false => probability(p),
    };
    Some(format!("{p} ({} simulations)", d.simulations))
}

/// Returns the place of the gap, in the twin, in time and by values; none where it is not known.
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
    let together: Vec<String> = (accepted_places(diagnosis).into_iter())
        .map(|place| units.in_words(place))
        .collect();
    let places = match location.class.is_empty() {
        _ if together.len() > 1 => joined(&together, "and"),
        true => of(target),
        false => {
            let class: Vec<String> = location.class.iter().map(|place| of(place)).collect();
            joined(&class, "or")
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
    let when: Vec<String> = (maps.windows.iter().take(2))
        .map(|w| format!("{} to {} s", short(w.start), short(w.end)))
        .collect();
    let regions: Vec<String> = (maps.regions.iter().take(2))
        .map(|r| {
            let unit = unit_suffix(units.variable(&r.variable));
            format!(
                "{} in {} … {}{unit}",
                r.variable,
                short(r.low),
                short(r.high)
            )
        })
        .collect();
    for (what, list) in [("clearest", when), ("at", regions)] {
        if !list.is_empty() {
            line.push_str(&format!("; {what} {}", list.join(", ")));
        }
    }
    Some(line + ".")
}

/// Returns what an unknown function adds to effects; none where that was not asked.
pub(super) fn remains_sentence(cause: &Cause) -> Option<String> {
    let remains = cause.remains.as_ref()?;
    let effects = match cause.accepted.as_slice() {
        [] => "the best listed effect".into(),
        _ => accepted_ids(cause),
    };
    let said = if remains.log_evidence > 0.0 {
        format!(
            "What remains: beside {effects}, something unknown at {} adds {} nats ({} of all).",
            remains.place,
            short(remains.log_evidence),
            percent(remains.share)
        )
    } else {
        format!("What remains: beside {effects}, no unknown function adds evidence.")
    };
    // A class says so itself.
    let rivals = rivals(cause);
    let alike = match (cause.decision, rivals.is_empty()) {
        (Decision::Partial, false) => format!(" Within {RIVALS} nats of these: {}.", few(&rivals)),
        _ => String::new(),
    };
    Some(said + &alike)
}

/// Returns the first terms of the missing function.
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
        "Exploratory, missing function of {} at {}: {terms}; {} of its variance explained.",
        discovery.variable,
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

/// `id@target (name value unit, …), or …`.
fn with_magnitudes(units: &Units, effect: &EffectFit) -> String {
    let others: String = (effect.also.iter())
        .map(|key| format!(", or {key}"))
        .collect();
    format!("{} ({}){others}", effect.key(), units.magnitudes(effect))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Warning;
    use crate::report::fixture::{diagnoses, made, oscillator, tanks};

    fn gap_text(diagnosis: &Diagnosis) -> String {
        let study = match diagnosis.twin.as_str() {
            "tanks" => tanks(),
            _ => oscillator(),
        };
        super::gap_text(&study, diagnosis)
    }

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
    fn warnings_that_are_not_told_elsewhere_are_one_line() {
        let mut diagnosis = made::tanks_class();
        let warning = |code, what: &str| Warning {
            code,
            what: what.into(),
            remedy: "look there",
        };
        diagnosis.warnings = vec![
            warning("constant-input", "the input u never changes"),
            warning("at-bound", "k1 lies at its upper bound"),
            warning("repeated-record", "records 1 and 2 are the same"),
        ];
        let text = gap_text(&diagnosis);
        let line = "Warning: k1 lies at its upper bound (look there); records 1 and 2 are the same (look there).";
        assert!(text.lines().any(|l| l == line), "{text}");
        assert!(!text.contains("never changes"));
    }

    #[test]
    fn another_kind_of_noise_is_told() {
        let mut diagnosis = made::tanks_class();
        diagnosis.outliers = vec!["sensor".into()];
        let text = gap_text(&diagnosis);
        assert!(text.contains("The noise has outliers at sensor."), "{text}");
        diagnosis.correlated_noise = vec!["h1".into(), "h2".into()];
        let text = gap_text(&diagnosis);
        assert!(
            text.contains("is correlated at h1 and h2, and has outliers at sensor: something weak"),
            "{text}"
        );
    }

    #[test]
    fn evidence_change_exploration_and_what_to_measure_are_said() {
        let class = gap_text(&made::tanks_class());
        for text in [
            "the twin lacks a ceiling, a power law or quadratic drag at the upper tank (h1); this record cannot tell which.",
            "Evidence for a gap: 43.9 nats; probability that nothing is missing: < 0.01; p < 0.0099 (100 simulations).",
            "Where: the upper tank (h1, probability 0.93); k1 changes at 612 s; clearest",
            "h1 in 3.60 … 4.80 V",
            "nats   effect (most probable first",
            "         0.61   38.5   state-ceiling@h1 (level 4.80 V, spill 0.500)",
            "What remains: beside state-ceiling@h1, something unknown at h2 adds 1.20 nats (3 % of all).",
            "separates the rivals in 18 of 20 simulations, the present inputs in 6 of 20",
            NEXT_INPUT,
        ] {
            assert!(class.contains(text), "{text}: {class}");
        }
        let none = gap_text(&made::oscillator_none());
        let terms = "Exploratory, missing function of x1 at x2: −0.620 · x1 (98 %), ";
        assert!(
            none.contains(terms) && none.contains("83 % of its variance explained"),
            "{none}"
        );
        let partial = gap_text(&made::rig_pair());
        let lacks = "lacks a ceiling in a_state_with_a_name_that_is_long and quantization in sensor2; more remains at enthalpy.";
        assert!(partial.contains(lacks), "{partial}");
        let mut rivalled = made::rig_pair();
        rivalled.cause.class.push("sensor-lag@sensor2".into());
        let rivalled = gap_text(&rivalled);
        assert!(
            rivalled.contains("nats of these: sensor-lag@sensor2.")
                && !partial.contains("nats of these"),
            "{rivalled}"
        );
        let no_gap = gap_text(&made::oscillator_no_gap());
        let evidence = "Evidence for a gap: −2.30 nats; probability that nothing is missing: 0.91; p = 0.440 (100 simulations).";
        assert!(no_gap.contains(evidence), "{no_gap}");
        let mut all = made::rig_pair();
        all.discovery = made::oscillator_none().discovery;
        for text in [class, none, partial, gap_text(&all)] {
            assert!(text.lines().count() <= LINES, "{text}");
            assert!(text.ends_with("explanations, 5.20 s.\n"), "{text}");
        }
    }

    #[test]
    fn places_that_cannot_be_told_apart_are_all_told() {
        let mut diagnosis = made::oscillator_none();
        let all = ["x2", "x1", "sensor", "actuator"];
        for (count, headline, line) in [
            (0, "acts on x2.", "Where: x2 (probability 0.97)"),
            (
                3,
                "acts on x2, x1 or the sensor of y.",
                "Where: x2 (probability 0.97), x1 or the sensor of y",
            ),
            (
                4,
                "acts on one of 4 places, most likely x2.",
                "Where: x2 (probability 0.97), x1, the sensor of y and 1 more",
            ),
        ] {
            diagnosis.location.class = all[..count].iter().map(|p| (*p).to_owned()).collect();
            let text = gap_text(&diagnosis);
            assert!(text.contains(headline) && text.contains(line), "{text}");
        }
        let pair = gap_text(&made::rig_pair());
        assert!(
            pair.contains("Where: a_state_with_a_name_that_is_long and sensor2"),
            "{pair}"
        );
    }

    #[test]
    fn what_was_not_asked_is_not_said() {
        let mut diagnosis = made::tanks_class();
        diagnosis.detection.p_value = None;
        diagnosis.cause.remains = None;
        let text = gap_text(&diagnosis);
        assert!(
            !text.contains("simulations).") && !text.contains("What remains"),
            "{text}"
        );
    }
}
