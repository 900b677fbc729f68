//! Each effect of the library in a sentence for people.
//!
//! `{place}` stands for where it acts, `{other}` for the other state, `{name}` for the magnitude of that name with its unit, `{%name}`
//! for a magnitude in percent.

/// Sentence of each effect by its id.
const SENTENCES: [(&str, &str); 30] = [
    ("sensor-bias", "{place} shows the true value plus {offset}."),
    (
        "sensor-gain",
        "{place} shows the true value changed by {%error}.",
    ),
    ("sensor-drift", "{place} drifts by {rate}."),
    (
        "sensor-lag",
        "{place} follows the true value with a lag of {tau}.",
    ),
    ("sensor-delay", "{place} shows the true value {delay} late."),
    (
        "sensor-rectification",
        "{place} shows {%fraction} of the size of the signal, whatever its sign.",
    ),
    ("sensor-noise", "{place} has noise of {std} beside its own."),
    (
        "sensor-saturation",
        "{place} shows nothing below {low} or above {high}.",
    ),
    ("sensor-quantization", "{place} shows steps of {step}."),
    (
        "sensor-outliers",
        "{place} is off by about {scale} in {%probability} of the samples.",
    ),
    (
        "actuator-gain",
        "{place} acts with its command changed by {%error}.",
    ),
    (
        "actuator-bias",
        "{place} acts with its command plus {offset}.",
    ),
    (
        "actuator-dead-zone",
        "{place} does not act within a dead zone of {width}.",
    ),
    ("actuator-backlash", "{place} has a play of {width}."),
    (
        "actuator-saturation",
        "{place} does not act below {low} or above {high}.",
    ),
    ("actuator-rate-limit", "{place} changes by {rate} at most."),
    (
        "actuator-lag",
        "{place} follows its command with a lag of {tau}.",
    ),
    ("actuator-delay", "{place} acts {delay} after its command."),
    ("constant-forcing", "A constant {force} acts on {place}."),
    (
        "coulomb-friction",
        "Dry friction of {force} acts against {place}.",
    ),
    (
        "linear-loss",
        "{place} is lost at a further rate of {rate}.",
    ),
    (
        "cross-coupling",
        "{other} acts on {place} with a factor of {rate}.",
    ),
    (
        "quadratic-drag",
        "A drag that grows with the square of {place} acts on it: {coefficient}.",
    ),
    (
        "cubic-stiffness",
        "A force that grows with the cube of {other} acts on {place}: {coefficient}.",
    ),
    (
        "power-law",
        "A loss of {coefficient} times {place} to the power {exponent} acts on it.",
    ),
    (
        "periodic-disturbance",
        "An oscillation of {frequency} and {amplitude} acts on {place}.",
    ),
    (
        "state-ceiling",
        "{place} stops rising at {level}; {%spill} of what spills reaches {other}.",
    ),
    (
        "process-noise",
        "{place} is moved by noise of {std} a step.",
    ),
    ("parameter-drift", "{place} drifts by a share of {rate}."),
    ("parameter-step", "{place} changes by {%size} at {time}."),
];

/// The sentence of an effect.
pub(super) fn sentence(id: &str) -> Option<&'static str> {
    let found = SENTENCES.iter().find(|(known, _)| *known == id);
    found.map(|(_, sentence)| *sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every effect has a sentence, and every word in braces is a magnitude of it or a place.
    #[test]
    fn every_effect_has_its_sentence() {
        let rows = super::super::rows();
        assert_eq!(rows.len(), SENTENCES.len());
        for kind in rows {
            let sentence = kind.sentence().unwrap_or_else(|| panic!("{}", kind.id()));
            for part in sentence.split('{').skip(1) {
                let name = part.split('}').next().unwrap().trim_start_matches('%');
                let known = kind.magnitudes().iter().any(|m| m.name == name);
                let is_other = name == "other" && kind.other_state().is_some();
                assert!(
                    known || is_other || name == "place",
                    "{}: {name}",
                    kind.id()
                );
            }
        }
    }
}
