//! The answer in one sentence.

use crate::diagnose::{Cause, Decision, Diagnosis, Location, Verdict};

/// Characters of a headline: two lines of a page.
const LONGEST: usize = 140;
/// Names in one sentence.
const MOST_NAMES: usize = 3;
/// Probability below which no effect is named alone.
pub(super) const SAID: f64 = 0.5;

/// Returns the answer in one sentence, of at most [`LONGEST`] characters where names allow it.
pub fn headline(diagnosis: &Diagnosis) -> String {
    let cause = &diagnosis.cause;
    let lacks = || (cause.accepted.join(" and "), others(&cause.accepted));
    match (diagnosis.verdict, cause.decision) {
        (Verdict::NoGap, _) => {
            "No gap: the twin explains the record with parameters inside the prior.".into()
        }
        (Verdict::ParameterGap, Decision::Absorbed) => format!(
            "Parameter gap: parameters outside the prior explain the record; so would {} with parameters inside.",
            cause.class.first().cloned().unwrap_or_default()
        ),
        (Verdict::ParameterGap, _) => {
            "Parameter gap: the twin explains the record with parameters outside the prior.".into()
        }
        (_, Decision::Named) => {
            let (all, few) = lacks();
            short_enough([all, few].map(|names| format!("Structural gap: the twin lacks {names}.")))
        }
        (_, Decision::Class) => one_of(cause),
        (_, Decision::Partial) => {
            let (all, few) = lacks();
            let somewhere = "something remains".to_owned();
            let place = match &cause.remains {
                Some(remains) => format!("something remains at {}", remains.place),
                None => somewhere.clone(),
            };
            short_enough(
                [(&all, &place), (&all, &somewhere), (&few, &somewhere)].map(|(names, remains)| {
                    format!("Structural gap: the twin lacks {names}; {remains}.")
                }),
            )
        }
        _ => {
            let unlisted = "Structural gap outside the library: no listed effect explains it";
            match somewhere(&diagnosis.location) {
                None => format!("{unlisted}."),
                Some(places) => short_enough(
                    places.map(|place| format!("{unlisted}; the missing law acts on {place}.")),
                ),
            }
        }
    }
}

/// The first name, and how many more there are.
fn others(names: &[String]) -> String {
    match names {
        [] => "nothing".into(),
        [one] => one.clone(),
        [first, more @ ..] => format!("{first} and {} more", more.len()),
    }
}

/// A class of effects: each by name where they are few; one alone only if it is more likely than not.
fn one_of(cause: &Cause) -> String {
    const APART: &str = "this record cannot tell which";
    let rivals = rivals(cause);
    // A second effect has rivals of its own; the first stays.
    let (first, before) = match cause.accepted.split_last() {
        Some((last, before)) => (last.as_str(), before.join(" and ")),
        None => ("", String::new()),
    };
    let before = if before.is_empty() {
        before
    } else {
        format!("{before} and ")
    };
    let likely =
        (cause.effects.iter()).any(|effect| effect.key() == first && effect.probability >= SAID);
    let named = match rivals.len() < MOST_NAMES {
        true => Some(format!(
            "Structural gap: the twin lacks {before}{first} or {}; {APART}.",
            rivals.join(" or ")
        )),
        false => None,
    };
    let count = rivals.len() + 1;
    let lead = if likely {
        format!(", most likely {first}")
    } else {
        String::new()
    };
    let counted =
        format!("Structural gap: the twin lacks {before}one of {count} effects{lead}; {APART}.");
    let last = format!("Structural gap: the twin lacks one of {count} effects; {APART}.");
    short_enough(named.into_iter().chain([counted, last]))
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

/// The place of a gap, or the few that the records cannot tell apart, each by name; then in fewer words. None where it is not known.
pub(super) fn somewhere(location: &Location) -> Option<[String; 2]> {
    let target = location.target.as_ref()?;
    let Some((last, first)) = location.class.split_last() else {
        return Some([target.clone(), target.clone()]);
    };
    let is_likely = (location.targets.iter()).any(|t| t.target == *target && t.probability >= SAID);
    let lead = match is_likely {
        true => format!(", most likely {target}"),
        false => String::new(),
    };
    let counted = format!("one of {} places{lead}", location.class.len());
    let named = match location.class.len() <= MOST_NAMES {
        true => format!("{} or {last}", first.join(", ")),
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

/// At most three names, and how many more there are.
pub(super) fn few(names: &[&str]) -> String {
    match names.len() {
        n if n > MOST_NAMES => format!("{} and {} more", names[..2].join(", "), n - 2),
        _ => names.join(", "),
    }
}
