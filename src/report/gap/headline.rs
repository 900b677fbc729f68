//! The answer in one sentence.

use super::words::{effect, effects, few, joined};
use crate::diagnose::{Cause, Decision, Diagnosis, Location, Verdict};
use crate::report::digits::chance;
use crate::report::units::Units;

/// Characters of a headline: two lines of a page.
const LONGEST: usize = 140;
/// Names in one sentence.
const MOST_NAMES: usize = 3;
/// Probability below which no effect is named alone.
pub(super) const SAID: f64 = 0.5;
/// Probability of several effects together from which no more of them are told.
const TOGETHER: f64 = 0.8;
const APART: &str = "this record cannot tell which";

/// Returns the answer in one sentence, of at most [`LONGEST`] characters where names allow it.
pub(super) fn headline(units: &Units, diagnosis: &Diagnosis) -> String {
    let cause = &diagnosis.cause;
    match (diagnosis.verdict, cause.decision) {
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
        (_, Decision::Named | Decision::Partial) => accepted(units, cause),
        (_, Decision::Class) => one_of(units, cause),
        _ => {
            let unlisted = "Structural gap outside the library: no listed effect explains it";
            match somewhere(units, &diagnosis.location) {
                None => format!("{unlisted}."),
                Some(places) => short_enough(
                    places.map(|place| format!("{unlisted}; the missing law acts on {place}.")),
                ),
            }
        }
    }
}

/// Accepted effects, divided by probability.
pub(super) struct Naming<'c> {
    /// Those that are more probable than not.
    pub sure: Vec<&'c str>,
    /// Keys of effects one of which stands for the others; empty where that is not more probable than not.
    pub one_of: Vec<String>,
    /// Their probability together.
    pub together: f64,
    /// True where every accepted effect is sure.
    pub is_complete: bool,
}

/// Divides the accepted effects: no name is told whose probability is below a half.
pub(super) fn naming(cause: &Cause) -> Naming<'_> {
    let probability = |key: &str| {
        let fit = cause.effects.iter().find(|fit| fit.key() == key);
        fit.map_or(0.0, |fit| fit.probability)
    };
    let keys = cause.accepted.iter().map(String::as_str);
    let sure: Vec<&str> = keys.filter(|key| probability(key) >= SAID).collect();
    let open = cause.accepted.len() - sure.len();
    let mut all: Vec<(String, f64)> = (cause.effects.iter())
        .map(|fit| (fit.key(), fit.probability))
        .filter(|(key, _)| !sure.contains(&key.as_str()))
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (mut one_of, mut together) = (vec![], 0.0);
    for (key, p) in all.into_iter().take(MOST_NAMES) {
        if together < TOGETHER {
            one_of.push(key);
            together += p;
        }
    }
    if open != 1 || together < SAID || one_of.len() < 2 {
        one_of.clear();
    }
    Naming {
        sure,
        one_of,
        together: together.min(1.0),
        is_complete: open == 0,
    }
}

/// Effects that are accepted, as far as they can be named.
fn accepted(units: &Units, cause: &Cause) -> String {
    let is_partial = cause.decision == Decision::Partial;
    let remains = match (is_partial, &cause.remains) {
        (false, _) => [String::new(), String::new()],
        (true, None) => ["; more remains"; 2].map(String::from),
        // The share of evidence that remains is told below: beside that of the error, it reads as what is left of it.
        (true, Some(rest)) => [
            format!("; more remains at {}", units.in_words(&rest.place)),
            "; more remains".into(),
        ],
    };
    let Naming {
        sure,
        one_of,
        together,
        is_complete,
    } = naming(cause);
    let them: Vec<&str> = one_of.iter().map(String::as_str).collect();
    let explained = match (is_partial, sure.is_empty()) {
        (_, false) => "the rest",
        (true, true) => "most of it",
        (false, true) => "it",
    };
    let known = |names: String| match names.as_str() {
        "" => String::new(),
        names => format!("the twin lacks {names}; "),
    };
    let told = |names: String, others: String| match (is_complete, one_of.is_empty()) {
        (true, _) => format!("the twin lacks {names}"),
        (false, false) => format!(
            "{}{explained} is explained by one of {others} (together {})",
            known(names),
            chance(together)
        ),
        (false, true) => format!(
            "{}listed effects explain {explained}, but none can be named",
            known(names)
        ),
    };
    let full = || told(effects(units, &sure, "and"), effects(units, &them, "and"));
    let ids = || told(sure.join(" and "), few(&them));
    let counted = told(
        match sure.as_slice() {
            [first, _, ..] => format!("{} and {} more", effect(units, first), sure.len() - 1),
            _ => sure.join(" and "),
        },
        format!("{} effects", them.len()),
    );
    let [place, somewhere] = remains;
    short_enough(
        [
            (full(), &place),
            (full(), &somewhere),
            (ids(), &place),
            (ids(), &somewhere),
            (counted, &somewhere),
        ]
        .map(|(told, remains)| format!("Structural gap: {told}{remains}.")),
    )
}

/// A class of effects: each by name where they are few; one alone only if it is more likely than not.
fn one_of(units: &Units, cause: &Cause) -> String {
    let Naming { mut sure, .. } = naming(cause);
    // A second effect has rivals of its own; the first stays, if it is sure.
    let last = cause.accepted.last().map_or("", String::as_str);
    let likely = sure.iter().position(|key| *key == last);
    let is_likely = likely.map(|at| sure.remove(at)).is_some();
    let mut class: Vec<&str> = vec![];
    for key in cause.accepted.iter().chain(&cause.class) {
        if !sure.contains(&key.as_str()) && !class.contains(&key.as_str()) {
            class.push(key);
        }
    }
    let before = match sure.is_empty() {
        true => String::new(),
        false => effects(units, &sure, "and") + " and ",
    };
    let count = class.len();
    let lead = match is_likely {
        true => format!(", most likely {}", effect(units, last)),
        false => String::new(),
    };
    let named = [effects(units, &class, "or"), class.join(" or ")]
        .into_iter()
        .filter(|_| count <= MOST_NAMES)
        .map(|names| format!("Structural gap: the twin lacks {before}{names}; {APART}."));
    let counted = [
        format!("{before}one of {count} effects{lead}"),
        format!("one of {count} effects"),
    ]
    .map(|what| format!("Structural gap: the twin lacks {what}; {APART}."));
    short_enough(named.chain(counted))
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
    let is_likely = (location.targets.iter()).any(|t| t.target == *target && t.probability >= SAID);
    let lead = match is_likely {
        true => format!(", most likely {named}"),
        false => String::new(),
    };
    let counted = format!("one of {} places{lead}", location.class.len());
    let all: Vec<String> = (location.class.iter())
        .map(|place| units.in_words(place))
        .collect();
    let named = match all.len() <= MOST_NAMES {
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
        if last.chars().count() <= LONGEST {
            break;
        }
    }
    last
}

/// Returns the members of the class that are not accepted.
pub(super) fn rivals(cause: &Cause) -> Vec<&str> {
    let others = cause
        .class
        .iter()
        .filter(|key| !cause.accepted.contains(key));
    others.map(String::as_str).collect()
}

/// The accepted effects by id where each is more probable than not, or else without names.
pub(super) fn accepted_ids(cause: &Cause) -> String {
    match naming(cause) {
        Naming {
            sure,
            is_complete: true,
            ..
        } => sure.join(" and "),
        _ => "the accepted effects".into(),
    }
}

#[cfg(test)]
mod tests;
