//! Effects on a parameter θ over time t.

use super::super::kind::EffectKind;
use super::super::magnitude::{Magnitude, Shape};

pub(super) fn rows() -> Vec<EffectKind> {
    vec![
        // Wear, fouling, warming up.
        EffectKind::parameter("parameter-drift", "θ·(1 + rate·t)", |m, t, value| {
            value * (1.0 + m[0] * t)
        })
        .with_sentence("{place} drifts by a share of {rate}.")
        .magnitude(
            Magnitude::signed("rate", "1/s", &[-0.01, -0.001, 0.001, 0.01]).shape(Shape::Rate),
        ),
        // A fault or a switch, that instant included; −1 is all gone.
        EffectKind::parameter(
            "parameter-step",
            "θ·(1 + size) from that time on",
            |m, t, value| {
                if t >= m[1] {
                    value * (1.0 + m[0])
                } else {
                    value
                }
            },
        )
        .with_sentence("{place} changes by {%size} at {time}.")
        .magnitude(
            Magnitude::signed("size", "1", &[-0.3, -0.1, 0.1, 0.3])
                .within(-1.0, f64::INFINITY)
                .shape(Shape::Share),
        )
        .magnitude(
            Magnitude::positive("time", "s", &[30.0, 100.0, 200.0, 300.0]).shape(Shape::Time),
        ),
    ]
}
