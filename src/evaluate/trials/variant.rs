//! Signs and shapes of the listed laws that a truth is compared with.

/// Forces that oppose their state: the library gives them no other sign.
const ONE_SIDED: [&str; 3] = ["coulomb-friction", "linear-loss", "quadratic-drag"];
/// Laws that the library offers with either sign. Each is proportional to its size while that is small.
const SIGNED: [&str; 11] = [
    "sensor-bias",
    "sensor-gain",
    "sensor-drift",
    "actuator-gain",
    "actuator-bias",
    "constant-forcing",
    "cross-coupling",
    "cubic-stiffness",
    "power-law",
    "parameter-drift",
    "parameter-step",
];
/// Other laws that are proportional to their size.
const PROPORTIONAL: [&str; 2] = ["periodic-disturbance", "sensor-rectification"];
/// Exponents of power laws. 1 and 2 are linear loss and quadratic drag; a quarter is nearly friction.
const EXPONENTS: [f64; 7] = [0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// Sign and shape of a listed law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Variant {
    pub sign: f64,
    /// Exponent of a power law.
    pub exponent: f64,
    /// Share of the range of every other shape.
    pub shape: f64,
}

impl Variant {
    /// Returns the shapes of a law, each of positive sign.
    pub fn of(id: &str) -> Vec<Self> {
        let default = Self {
            sign: 1.0,
            exponent: 1.0,
            shape: 0.5,
        };
        match id {
            "power-law" => (EXPONENTS.into_iter())
                .map(|exponent| Self {
                    exponent,
                    ..default
                })
                .collect(),
            // The lower end of the range, and the upper one.
            "sensor-saturation" | "actuator-saturation" => {
                [0.0, 0.5].map(|shape| Self { shape, ..default }).to_vec()
            }
            _ => vec![default],
        }
    }
}

/// Returns true for a force that always opposes its state.
pub(super) fn is_one_sided(id: &str) -> bool {
    ONE_SIDED.contains(&id)
}

/// Returns true for a law of either sign.
pub(super) fn is_signed(id: &str) -> bool {
    SIGNED.contains(&id)
}

/// Returns true for a law whose change is proportional to its size while that is small.
pub(super) fn is_proportional(id: &str) -> bool {
    is_signed(id) || is_one_sided(id) || PROPORTIONAL.contains(&id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Catalogue;

    /// The signs are those of the library.
    #[test]
    fn signs_are_those_that_the_library_allows() {
        let catalogue = Catalogue::default();
        let kind = |id: &str| {
            let mut kinds = catalogue.kinds().iter();
            kinds.find(|kind| kind.id() == id).unwrap()
        };
        for id in SIGNED {
            assert!(kind(id).magnitudes()[0].limits.low() < 0.0, "{id}");
        }
        for id in ONE_SIDED {
            assert_eq!(kind(id).magnitudes()[0].limits.low(), 0.0, "{id}");
        }
        assert_eq!(Variant::of("power-law").len(), 7);
        assert_eq!(Variant::of("sensor-bias").len(), 1);
    }
}
