//! Names of effects and lists of names, in words.

use crate::effect::EffectKey;
use crate::report::digits::SHOWN;
use crate::report::units::Units;

/// Kinds of target that an id may begin with: the place says them again.
const KINDS: [&str; 4] = ["sensor-", "actuator-", "state-", "parameter-"];
/// Last words of nouns that take no article.
const UNCOUNTED: [&str; 12] = [
    "backlash",
    "clipping",
    "hysteresis",
    "drag",
    "friction",
    "noise",
    "outliers",
    "quantization",
    "rectification",
    "saturation",
    "stiffness",
    "forcing",
];

/// Returns `a ceiling at the upper tank (h1)` of `state-ceiling@h1`.
pub(super) fn effect(units: &Units, key: &str) -> String {
    effects(units, &[key], "and")
}

/// Returns effects in words, joined by `and` or `or`; their place once if it is the same.
pub(super) fn effects(units: &Units, keys: &[&str], last: &str) -> String {
    let keys: Vec<EffectKey> = (keys.iter())
        .map(|key| key.parse().unwrap_or_else(|_| EffectKey::new(key, "")))
        .collect();
    let place = |target: &str| match target {
        "" => String::new(),
        target if units.is_parameter(target) => format!(" in {}", units.in_words(target)),
        target => format!(" at {}", units.in_words(target)),
    };
    match keys.split_first() {
        Some((first, rest)) if rest.iter().all(|key| key.target == first.target) => {
            let nouns: Vec<String> = keys.iter().map(|key| noun(&key.id)).collect();
            joined(&nouns, last) + &place(&first.target)
        }
        _ => {
            let all: Vec<String> = (keys.iter())
                .map(|key| noun(&key.id) + &place(&key.target))
                .collect();
            joined(&all, last)
        }
    }
}

/// Returns `a dead zone` of `actuator-dead-zone`.
fn noun(id: &str) -> String {
    let bare = KINDS.iter().find_map(|kind| id.strip_prefix(kind));
    let words = bare.unwrap_or(id).replace('-', " ");
    let words = match words.as_str() {
        "gain" => "gain error".to_owned(),
        other => other.replace("coulomb", "Coulomb"),
    };
    let is_uncounted = UNCOUNTED.iter().any(|noun| words.ends_with(noun));
    match words.chars().next() {
        _ if is_uncounted => words,
        Some('a' | 'e' | 'i' | 'o' | 'u') => format!("an {words}"),
        _ => format!("a {words}"),
    }
}

/// Returns `A, B or C`; of more than three names three, and the number of the others.
pub(super) fn joined<S: AsRef<str>>(names: &[S], last: &str) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        Some((_, [])) | None => names.concat(),
        Some((end, before)) if names.len() <= SHOWN.names => {
            format!("{} {last} {end}", before.join(", "))
        }
        Some(_) => few(&names),
    }
}

/// Returns `A, B, C`; of more than three names three, and the number of the others.
pub(super) fn few<S: AsRef<str>>(names: &[S]) -> String {
    let shown: Vec<&str> = names.iter().take(SHOWN.names).map(AsRef::as_ref).collect();
    let shown = shown.join(", ");
    match names.len() {
        n if n > SHOWN.names => format!("{shown} and {} more", n - SHOWN.names),
        _ => shown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{oscillator, tanks};

    #[test]
    fn effects_are_told_in_words() {
        let (tanks, oscillator) = (Units::of(&tanks()), Units::of(&oscillator()));
        for (units, keys, expected) in [
            (
                &tanks,
                &["state-ceiling@h1"][..],
                "a ceiling at the upper tank (h1)",
            ),
            (
                &tanks,
                &["state-ceiling@h1", "power-law@h1", "quadratic-drag@h1"],
                "a ceiling, a power law or quadratic drag at the upper tank (h1)",
            ),
            (
                &tanks,
                &["sensor-lag@sensor", "parameter-step@k1"],
                "a lag at the sensor of the lower level (y) or a step in k1",
            ),
            (
                &oscillator,
                &["sensor-gain@sensor"],
                "a gain error at the sensor of y",
            ),
            (
                &oscillator,
                &["coulomb-friction@x2"],
                "Coulomb friction at x2",
            ),
            (&oscillator, &["own-law@x2"], "an own law at x2"),
        ] {
            assert_eq!(effects(units, keys, "or"), expected);
        }
    }

    #[test]
    fn at_most_three_names_stand_in_a_sentence() {
        assert_eq!(few(&["A", "B", "C"]), "A, B, C");
        assert_eq!(few(&["A", "B", "C", "D", "E"]), "A, B, C and 2 more");
        assert_eq!(joined(&["A"], "or"), "A");
        assert_eq!(joined(&["A", "B", "C"], "and"), "A, B and C");
        assert_eq!(joined(&["A", "B", "C", "D"], "or"), "A, B, C and 1 more");
    }
}
