//! The answer in words: headline, what follows from it, what to do next. All of it follows from verdict, decision and probabilities.

use super::share::share_with_interval;
use super::words::{effect, effects, few, joined};
use crate::diagnose::{Cause, Decision, Diagnosis, EffectFit, Location, THRESHOLDS, Verdict};
use crate::math::descending;
use crate::report::NEXT_INPUT;
use crate::report::digits::{SHOWN, chance, percent, short, with_unit};
use crate::report::units::Units;
use crate::twin::Integrator;

const APART: &str = "this record cannot tell which";

/// The effects of an answer by how sure they are.
pub(super) struct Names<'d> {
    /// More probable than not, whichever of the others there is.
    pub known: Vec<&'d EffectFit>,
    /// Rivals, one of which is there, or may be; most probable first.
    pub open: Vec<&'d EffectFit>,
    /// Probability of the rivals together.
    pub together: f64,
    /// True where an accepted effect is among the rivals: one of them is there.
    pub is_one_there: bool,
}

impl<'d> Names<'d> {
    pub fn of(cause: &'d Cause) -> Self {
        let is_in = |list: &[String], e: &EffectFit| list.contains(&e.key());
        let meant =
            (cause.effects.iter()).filter(|e| is_in(&cause.accepted, e) || is_in(&cause.class, e));
        let (sure, mut open): (Vec<_>, Vec<_>) =
            meant.partition(|e| e.probability >= THRESHOLDS.said);
        let most = open.iter().map(|e| e.probability).fold(0.0, f64::max);
        // Of two that are together more probable than one, one is no rival of the other.
        let (known, rivals): (Vec<_>, Vec<_>) = sure
            .into_iter()
            .partition(|e| open.is_empty() || e.probability + most > 1.0);
        open.extend(rivals);
        descending(&mut open, |a| a.probability);
        Self {
            together: open.iter().map(|e| e.probability).sum::<f64>().min(1.0),
            is_one_there: open.iter().any(|e| is_in(&cause.accepted, e)),
            known,
            open,
        }
    }

    /// Returns whether the answer is names alone.
    pub fn is_complete(&self) -> bool {
        let known = &self.known;
        !known.is_empty() && self.open.is_empty() && known.iter().all(|e| e.also.is_empty())
    }

    /// Keys of the known effects.
    pub fn keys(&self) -> Vec<String> {
        self.known.iter().map(|e| e.key()).collect()
    }
}

/// Keys of an effect, its other names too.
fn all_keys<'e>(effects: &[&'e EffectFit]) -> Vec<String> {
    let keys = |e: &&'e EffectFit| std::iter::once(e.key()).chain(e.also.iter().cloned());
    effects.iter().flat_map(keys).collect()
}

/// The answer in one sentence, of at most `SHOWN.headline` characters where names allow it.
pub(super) fn headline(units: &Units, diagnosis: &Diagnosis) -> String {
    let cause = &diagnosis.cause;
    let nothing = cause.probabilities.nothing;
    match (diagnosis.verdict, cause.decision) {
        (Verdict::NoGap, _) if diagnosis.interrupted => {
            "Not finished: nothing missing was found before the search was interrupted.".into()
        }
        (Verdict::ParameterGap, _) if diagnosis.interrupted => {
            "Not finished: parameters lie outside the prior; the search for missing effects was interrupted.".into()
        }
        (Verdict::NoGap, _) if nothing < SHOWN.clear => format!(
            "No clear gap: something may be missing (probability {}), too little to call.",
            chance(1.0 - nothing)
        ),
        (Verdict::NoGap, _) => {
            "No gap: the twin explains the record with parameters inside the prior.".into()
        }
        (Verdict::ParameterGap, Decision::Absorbed) => format!(
            "Parameter gap: parameters outside the prior explain the record; so would {} with parameters inside.",
            match cause.class.as_slice() {
                [only] => effect(units, only),
                several => format!("one of {} effects", several.len()),
            }
        ),
        (Verdict::ParameterGap, _) => {
            "Parameter gap: the twin explains the record with parameters outside the prior.".into()
        }
        (_, Decision::Named | Decision::Partial | Decision::Class) => lacking(units, diagnosis),
        _ => unnamed(units, diagnosis),
    }
}

fn gap(diagnosis: &Diagnosis) -> &'static str {
    match diagnosis.interrupted {
        true => "Structural gap (search not finished)",
        false => "Structural gap",
    }
}

/// A gap without a name.
fn unnamed(units: &Units, diagnosis: &Diagnosis) -> String {
    let kinds = &diagnosis.cause.probabilities;
    let gap = gap(diagnosis);
    let (what, at) = match kinds.unknown >= kinds.listed + kinds.partial {
        _ if diagnosis.disturbance().is_some() => (
            format!("{gap} that fitted noise hides: no listed effect explains it"),
            "a disturbance acts on",
        ),
        true => (
            format!("{gap} outside the library: no listed effect explains it"),
            "the missing law acts on",
        ),
        false => (
            format!("{gap}: something is missing, but the record is too weak to name it"),
            "most likely at",
        ),
    };
    let Some([named, counted]) = somewhere(units, &diagnosis.location) else {
        return format!("{what}.");
    };
    let lead = what.split(':').next().unwrap_or(gap);
    short_enough([
        format!("{what}; {at} {named}."),
        format!("{what}; {at} {counted}."),
        format!("{lead}, {at} {counted}."),
        format!(
            "{lead}, {at} {}.",
            diagnosis.location.target.as_deref().unwrap_or("")
        ),
    ])
}

/// A gap with names: those that are known, then rivals, then what remains.
fn lacking(units: &Units, diagnosis: &Diagnosis) -> String {
    let cause = &diagnosis.cause;
    let names = Names::of(cause);
    let is_partial = cause.decision == Decision::Partial;
    let is_alias = names.known.iter().any(|e| !e.also.is_empty());
    let count = all_keys(&names.open).len();
    // A list of effects, in words, by id, or by their number.
    let told = |list: &dyn Fn(&[&EffectFit], &str) -> String, lead: bool| {
        let last = if is_alias && names.known.len() == 1 {
            "or"
        } else {
            "and"
        };
        let known = list(&names.known, last);
        let open = match (count <= SHOWN.names, names.open.first()) {
            (false, Some(first)) if lead && first.probability >= THRESHOLDS.said => {
                format!(
                    "one of {count} effects, most likely {}",
                    list(&[*first], "or")
                )
            }
            (false, _) => format!("one of {count} effects"),
            (true, _) => list(&names.open, "or"),
        };
        match (names.known.is_empty(), names.open.is_empty()) {
            (false, true) if is_alias => format!("the twin lacks {known}; {APART}"),
            (_, true) => format!("the twin lacks {known}"),
            (false, false) if names.is_one_there => {
                format!("the twin lacks {known} and {open}; {APART}")
            }
            (false, false) => format!("the twin lacks {known}, and perhaps {open}"),
            (true, false) if is_partial => {
                let p = chance(names.together);
                format!("most of it is explained by {open} (together {p}); {APART}")
            }
            (true, false) => format!("the twin lacks {open}; {APART}"),
        }
    };
    let in_words = |all: &[&EffectFit], last: &str| {
        let keys = all_keys(all);
        let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
        effects(units, &keys, last)
    };
    let full = told(&in_words, true);
    let ids = told(&|all, last| joined(&all_keys(all), last), true);
    let counted = told(
        &|all, _| match all_keys(all).as_slice() {
            [one] => one.clone(),
            all => format!("{} effects", all.len()),
        },
        false,
    );
    // "Most of it" says already that more remains.
    let more = match names.known.is_empty() {
        true => "",
        false => "; more remains",
    };
    let remains = match (is_partial, &cause.remains) {
        (false, _) => [String::new(), String::new()],
        (true, None) => [more; 2].map(String::from),
        (true, Some(rest)) => [
            format!("; more remains at {}", units.in_words(&rest.place)),
            more.into(),
        ],
    };
    let gap = gap(diagnosis);
    short_enough(
        [(&full, 0), (&full, 1), (&ids, 0), (&ids, 1), (&counted, 1)]
            .map(|(told, i)| format!("{gap}: {told}{}.", remains[i])),
    )
}

/// Different places of the accepted effects.
pub(super) fn accepted_places(diagnosis: &Diagnosis) -> Vec<&str> {
    let mut places: Vec<&str> = vec![];
    for effect in &diagnosis.cause.effects {
        if diagnosis.cause.accepted.contains(&effect.key()) && !places.contains(&&*effect.target) {
            places.push(&effect.target);
        }
    }
    places
}

/// All places that the answer is about: those of the accepted effects, or the stated one and those that the records cannot tell from it.
pub(super) fn places(diagnosis: &Diagnosis) -> Vec<&str> {
    let location = &diagnosis.location;
    let mut all = accepted_places(diagnosis);
    for place in location.target.iter().chain(&location.class) {
        if !all.contains(&place.as_str()) {
            all.push(place);
        }
    }
    all
}

/// The place of a gap, or the few that the records cannot tell apart, each by name; then in fewer words. None where it is not known.
pub(super) fn somewhere(units: &Units, location: &Location) -> Option<[String; 2]> {
    let target = location.target.as_ref()?;
    let named = units.in_words(target);
    if location.class.is_empty() {
        return Some([named.clone(), named]);
    }
    let is_likely =
        (location.targets.iter()).any(|t| t.target == *target && t.probability >= THRESHOLDS.said);
    let lead = match is_likely {
        true => format!(", most likely {named}"),
        false => String::new(),
    };
    let counted = format!("one of {} places{lead}", location.class.len());
    let all: Vec<String> = (location.class.iter())
        .map(|place| units.in_words(place))
        .collect();
    let named = match all.len() <= SHOWN.names {
        true => joined(&all, "or"),
        false => counted.clone(),
    };
    Some([named, counted])
}

/// The first sentence that is short enough, or else the last.
fn short_enough(sentences: impl IntoIterator<Item = String>) -> String {
    let mut last = String::new();
    for sentence in sentences {
        last = sentence;
        if last.chars().count() <= SHOWN.headline {
            break;
        }
    }
    last
}

/// The accepted effects by id where each is more probable than not, or else without names.
pub(super) fn accepted_ids(cause: &Cause) -> String {
    let is_said =
        |e: &&EffectFit| e.probability >= THRESHOLDS.said && cause.accepted.contains(&e.key());
    match cause.effects.iter().filter(is_said).count() == cause.accepted.len() {
        true => cause.accepted.join(" and "),
        false => "the accepted effects".into(),
    }
}

/// Sentences behind the headline: how sure, how far, and the effects with their sizes as far as the first screen has room.
pub(super) fn details(units: &Units, diagnosis: &Diagnosis) -> Vec<String> {
    let cause = &diagnosis.cause;
    let names = Names::of(cause);
    let mut all: Vec<String> = how_sure(diagnosis, &names).into_iter().collect();
    all.extend(how_far(diagnosis));
    let told = [headline(units, diagnosis), next(diagnosis), all.join(" ")];
    let said: usize = told.iter().map(|text| words(text)).sum();
    let mut left = SHOWN.answer_words.saturating_sub(said);
    let accepted = (names.known.iter()).filter(|e| cause.accepted.contains(&e.key()));
    for text in accepted.filter_map(|e| sentence(units, e)) {
        if cause.decision != Decision::Class && words(&text) <= left {
            left -= words(&text);
            all.push(text);
        }
    }
    all
}

/// Number of words; signs such as % are none.
fn words(text: &str) -> usize {
    let is_word = |word: &&str| word.contains(char::is_alphanumeric);
    text.split_whitespace().filter(is_word).count()
}

/// The probability of the headline; none where it has it.
fn how_sure(diagnosis: &Diagnosis, names: &Names<'_>) -> Option<String> {
    let cause = &diagnosis.cause;
    let kinds = &cause.probabilities;
    let p = match (diagnosis.verdict, cause.decision) {
        (Verdict::NoGap | Verdict::ParameterGap, _) if diagnosis.interrupted => return None,
        (Verdict::NoGap, _) if kinds.nothing >= SHOWN.clear => kinds.nothing,
        (Verdict::StructuralGap, Decision::Named | Decision::Partial) if names.open.is_empty() => {
            names
                .known
                .iter()
                .map(|e| e.probability)
                .fold(1.0, f64::min)
        }
        (Verdict::StructuralGap, Decision::Class) if names.known.is_empty() => names.together,
        (Verdict::StructuralGap, Decision::NoneOfThese) => {
            let is_unknown = kinds.unknown >= kinds.listed + kinds.partial;
            if is_unknown {
                kinds.unknown
            } else {
                1.0 - kinds.nothing
            }
        }
        _ => return None,
    };
    Some(format!("Probability: {}.", chance(p)))
}

/// The share of the gap that closes.
fn how_far(diagnosis: &Diagnosis) -> Option<String> {
    let s = diagnosis.shrinkage.as_ref()?;
    if s.hidden_by_noise().is_some() {
        return Some("Noise hides how much of the gap closes.".to_owned());
    }
    let share = share_with_interval(s, " of the gap")?;
    Some(match s.horizon {
        Some(seconds) => format!("Predictions {} s ahead: {share} closes.", short(seconds)),
        None => format!("Predictions from the start on: {share} closes."),
    })
}

/// The sentence of an effect, filled in; of an effect without one, its name, its place and its magnitudes.
pub(super) fn sentence(units: &Units, fit: &EffectFit) -> Option<String> {
    let effect = units.effect(&fit.id, &fit.target)?;
    let Some(template) = effect.sentence() else {
        let named = super::words::effect(units, &fit.key());
        return Some(match units.magnitudes(fit).as_str() {
            "" => capitalised(&format!("{named} is missing.")),
            values => capitalised(&format!("{named} is missing: {values}.")),
        });
    };
    let other = effect.other().map(|other| units.in_words(other));
    let mut text = (template.replace("{place}", &units.in_words(&fit.target)))
        .replace("{other}", other.as_deref().unwrap_or("nothing"));
    for (name, value) in &fit.magnitudes {
        if value.is_infinite() {
            // The other end of a range is all that is told.
            text = text.replace(&format!("below {{{name}}} or "), "");
            text = text.replace(&format!(" or above {{{name}}}"), "");
        }
        let unit = units.of_magnitude(&fit.id, &fit.target, name);
        let written = match value.is_finite() {
            true => with_unit(*value, &unit.unwrap_or_default()),
            false => "any value".to_owned(),
        };
        text = text.replace(&format!("{{{name}}}"), &written);
        text = text.replace(&format!("{{%{name}}}"), &percent(*value));
    }
    // A sentence begins with a large letter, but a state keeps its name.
    Some(match text.starts_with("the ") {
        true => capitalised(&text),
        false => text,
    })
}

pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().collect());
    first + letters.as_str()
}

/// The finer step and the rule for inputs that the diagnosis used, as a user would set them, and what is wrong with the twin's own; none where
/// it used these.
pub(super) fn other_step(diagnosis: &Diagnosis) -> Option<[String; 2]> {
    let (mut settings, mut wrong) = (vec![], vec![]);
    if let (Some(integrator), Some(substeps)) = (diagnosis.integrator, diagnosis.substeps) {
        if integrator == Integrator::RungeKutta4 {
            settings.push("integrator runge-kutta-4".to_owned());
        }
        if substeps > 1 || settings.is_empty() {
            settings.push(format!("{substeps} substeps"));
        }
        wrong.push("the twin's own step is too long for this record");
    }
    if let Some(hold) = diagnosis.hold {
        settings.push(format!("hold \"{}\"", hold.name()));
        wrong.push("its inputs move otherwise between samples");
    }
    (!settings.is_empty()).then(|| [settings.join(" with "), wrong.join(", and ")])
}

/// Advice on what to do.
pub(super) fn next(diagnosis: &Diagnosis) -> String {
    let cause = &diagnosis.cause;
    let names = Names::of(cause);
    let add = |then: &str| {
        let names = names.keys().join(" and ");
        format!("add {names} to the study with the magnitudes found, {then}")
    };
    let advice = match (diagnosis.verdict, cause.decision) {
        _ if diagnosis.interrupted => "run the diagnosis again, to its end".into(),
        (Verdict::NoGap | Verdict::ParameterGap, _) if other_step(diagnosis).is_some() => {
            let [step, wrong] = other_step(diagnosis).unwrap_or_default();
            format!("give the study {step}; {wrong}")
        }
        (Verdict::NoGap, _) if cause.probabilities.nothing < SHOWN.clear => {
            "a longer record, or another one, decides".into()
        }
        (Verdict::NoGap, _) => "use the twin, within the range of this record".into(),
        (Verdict::ParameterGap, Decision::Absorbed) => {
            "a record with another input tells these parameters from the effect".into()
        }
        (Verdict::ParameterGap, _) => {
            "check these parameters; if they make sense, widen the prior to them".into()
        }
        (_, Decision::Named) if names.is_complete() => add("fit again"),
        (_, Decision::Partial) if names.is_complete() => add("diagnose again"),
        (_, Decision::Class) if cause.next_input.is_some() => {
            format!("measure {NEXT_INPUT} to tell them apart")
        }
        (_, Decision::Class | Decision::Named | Decision::Partial) => {
            "another record, with other inputs, may tell them apart".into()
        }
        _ if cause.probabilities.unknown < THRESHOLDS.said => {
            "a longer record, or several, may name it".into()
        }
        _ => "look at the system there, with the missing function in mind".into(),
    };
    format!("Next: {advice}.")
}

/// Rivals of the accepted effects, a few by name.
pub(super) fn rivals(cause: &Cause) -> String {
    let others = cause
        .class
        .iter()
        .filter(|key| !cause.accepted.contains(key));
    few(&others.collect::<Vec<_>>())
}
