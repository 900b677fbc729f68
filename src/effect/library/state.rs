//! Effects on states: forces on the rate of x, a ceiling and a floor, noise.

use super::super::kind::{EffectKind, OtherState};
use super::super::magnitude::{Magnitude, Shape};
use super::shared::{Deflection, sign};
use std::f64::consts::TAU;

pub(super) fn rows() -> Vec<EffectKind> {
    let mut rows = [pushes(), forces()].concat();
    rows.extend([
        // After each step, the excess over the level is cut. A twin of one state names itself: the excess is lost.
        EffectKind::limit(
            "state-ceiling",
            "the excess over level is cut; spill × excess is added to `to`",
            |m, x, to| {
                if *x > m[0] {
                    if let Some(to) = to {
                        *to += m[1] * (*x - m[0]);
                    }
                    *x = m[0];
                }
            },
        )
        .with_sentence("{place} stops rising at {level}; {%spill} of what spills reaches {other}.")
        .magnitude(Magnitude::signed("level", "state", &[0.5, 1.0, 2.0, 4.0]).off(f64::INFINITY))
        .magnitude(
            Magnitude::positive("spill", "1", &[0.0, 0.5, 1.0])
                .within(0.0, 1.0)
                .shape(Shape::Share)
                .never_off(),
        )
        .other(OtherState::To),
        // After each step, a deficit is made up: a weir, a bottom, a stop.
        EffectKind::limit(
            "state-floor",
            "what is below level is set to level",
            |m, x, _| {
                if *x < m[0] {
                    *x = m[0];
                }
            },
        )
        .with_sentence("{place} stops falling at {level}.")
        .magnitude(
            Magnitude::signed("level", "state", &[-1.0, 0.1, 0.5, 1.0]).off(f64::NEG_INFINITY),
        ),
        // White noise: an increment N(0, std²) a step.
        EffectKind::process_noise(
            "process-noise",
            "q² + std² for the variance q² of the twin's own increment a step",
            |m| m[0],
        )
        .with_sentence("{place} is moved by noise of {std} a step.")
        .magnitude(Magnitude::positive("std", "state", &[0.01, 0.05, 0.2])),
    ]);
    rows
}

/// Forces of a constant size.
fn pushes() -> Vec<EffectKind> {
    vec![
        // A constant push or leak.
        EffectKind::force("constant-forcing", "ẋ + force", |m, _| m[0])
            .with_sentence("A constant {force} acts on {place}.")
            .magnitude(Magnitude::signed(
                "force",
                "state/s",
                &[-0.3, -0.1, 0.1, 0.3],
            )),
        // A loss of constant size against the sign of the state, with sign 0 = 0.
        EffectKind::force("coulomb-friction", "ẋ − force·sign x", |m, at| {
            -m[0] * sign(at.x)
        })
        .with_sentence("Dry friction of {force} acts against {place}.")
        .magnitude(Magnitude::positive("force", "state/s", &[0.03, 0.1, 0.3])),
        // Dry friction that is larger at rest: Coulomb's at speed, and an excess that falls off with the square of the speed. Source:
        // Armstrong-Hélouvry, Dupont & Canudas de Wit, "A survey of models … of machines with friction", *Automatica* 30 (1994).
        EffectKind::force(
            "stribeck-friction",
            "ẋ − force·(1 + excess·exp(−(x/velocity)²))·sign x",
            |m, at| {
                if at.x == 0.0 {
                    return 0.0;
                }
                let rest = (-(at.x / m[2]).powi(2)).exp();
                -m[0] * (1.0 + m[1] * rest) * sign(at.x)
            },
        )
        .with_sentence(
            "Dry friction of {force} acts against {place}; at rest it is larger by {%excess}, which falls off within {velocity}.",
        )
        .magnitude(Magnitude::positive("force", "state/s", &[0.03, 0.1, 0.3]))
        .magnitude(
            // Static friction is hardly more than twice Coulomb's.
            Magnitude::positive("excess", "1", &[0.2, 0.5, 1.0])
                .within(0.0, 1.0)
                .shape(Shape::Share)
                .never_off(),
        )
        .magnitude(
            Magnitude::positive("velocity", "state", &[0.1, 0.3, 1.0])
                .shape(Shape::Level)
                .never_off(),
        ),
        // Presliding, magnetic and material hysteresis: a force that turns round within a width of where the motion does.
        EffectKind::force(
            "state-hysteresis",
            "ẋ − force·z, ż = (v̇ − ½·abs(v̇)·z − ½·v̇·abs(z))/width, v = x_from",
            |m, at| -m[0] * at.memory[0],
        )
        .with_sentence("A force of up to {force} acts on {place}, with a hysteresis of {width} in {other}.")
        .magnitude(Magnitude::positive("force", "state/s", &[0.03, 0.1, 0.3]))
        .magnitude(
            Magnitude::positive("width", "from", &[0.1, 0.3, 1.0])
                .within(1e-12, f64::INFINITY)
                .shape(Shape::Level)
                .never_off(),
        )
        .other(OtherState::RateOfOrItself)
        .memory(2)
        .follows(Deflection),
    ]
}

/// Forces that grow with a state, and waves.
fn forces() -> Vec<EffectKind> {
    vec![
        // Leakage, cooling, viscous friction.
        EffectKind::force("linear-loss", "ẋ − rate·x", |m, at| -m[0] * at.x)
            .with_sentence("{place} is lost at a further rate of {rate}.")
            .magnitude(Magnitude::positive("rate", "1/s", &[0.03, 0.1, 0.3])),
        // Another state acts on this one.
        EffectKind::force("cross-coupling", "ẋ + rate·x_from", |m, at| {
            m[0] * at.other
        })
        .with_sentence("{other} acts on {place} with a factor of {rate}.")
        .magnitude(Magnitude::signed(
            "rate",
            "state/(from·s)",
            &[-0.3, -0.1, 0.1, 0.3],
        ))
        .other(OtherState::From),
        // Turbulent drag.
        EffectKind::force("quadratic-drag", "ẋ − c·abs(x)·x", |m, at| {
            -m[0] * at.x.abs() * at.x
        })
        .with_sentence("A drag that grows with the square of {place} acts on it: {coefficient}.")
        .magnitude(Magnitude::positive(
            "coefficient",
            "1/(state·s)",
            &[0.03, 0.1, 0.3],
        )),
        // A Duffing spring; below 0 it softens.
        EffectKind::force("cubic-stiffness", "ẋ − c·x_from³", |m, at| {
            -m[0] * at.other.powi(3)
        })
        .with_sentence(
            "A force that grows with the cube of {other} acts on {place}: {coefficient}.",
        )
        .magnitude(Magnitude::signed(
            "coefficient",
            "state/(from³·s)",
            &[-0.1, 0.1, 0.3],
        ))
        .other(OtherState::RateOf),
        // An outflow or friction law, with sign 0 = 0; below 0 it corrects a law that takes too much.
        EffectKind::force("power-law", "ẋ − c·abs(x)^e·sign x", |m, at| {
            -m[0] * at.x.abs().powf(m[1]) * sign(at.x)
        })
        .with_sentence("A loss of {coefficient} times {place} to the power {exponent} acts on it.")
        .magnitude(Magnitude::signed(
            "coefficient",
            "state^(1−e)/s",
            &[-0.1, 0.03, 0.1, 0.3],
        ))
        .magnitude(
            // Below a quarter, over a decade of x a factor of 1.8, the law is Coulomb friction.
            Magnitude::positive("exponent", "1", &[0.5, 1.5, 2.5])
                .within(0.25, 4.0)
                .shape(Shape::Exponent),
        ),
        // Vibration, mains hum, tides.
        EffectKind::force(
            "periodic-disturbance",
            "ẋ + amplitude·sin(2π·f·t + phase)",
            |m, at| m[0] * (TAU * m[1] * at.t + m[2]).sin(),
        )
        .with_sentence("An oscillation of {frequency} and {amplitude} acts on {place}.")
        .magnitude(Magnitude::positive("amplitude", "state/s", &[0.1, 0.3]))
        .magnitude(
            // A period of eleven days stands for "above 0".
            Magnitude::positive("frequency", "Hz", &[0.003, 0.01, 0.03, 0.1])
                .within(1e-6, f64::INFINITY)
                .shape(Shape::Frequency),
        )
        .magnitude(
            Magnitude::signed("phase", "rad", &[0.0, 2.0, 4.0])
                .within(-TAU, TAU)
                .shape(Shape::Phase),
        ),
    ]
}
