//! Unknown functions: rivals that stand for whatever the library does not list.
//!
//! ```text
//! δ(z) = Σ β_k·φ_k(z),   φ_k(z) = √2·sin(kπ·(z − a)/(b − a)),   β ~ N(0, τ²·Λ),   Λ_k ∝ exp(−½(kπℓ/L)²),  ΣΛ = 1
//! ```
//!
//! a, b: the range that the variable is seen in, a fifth wider at both ends; τ: the deviation of δ in the unit of what it is added to; ℓ:
//! length in ranges; L: b − a in ranges. With two variables, products of the φ.
//!
//! Source: Solin & Särkkä, "Hilbert space methods for reduced-rank Gaussian process regression", *Statistics and Computing* 30 (2020).

use super::basis::{Of, TERMS, pairs, sum_of_one, sum_of_two};
use super::entry::{Entered, Entry};
use super::term::{Nature, Part, Start, Term};
use super::trace::{Trace, Trail};
use crate::effect::{Effect, EffectKind, Magnitude, Shape, lag};
use crate::fit::axis::{Axis, EvidencePrior};
use crate::hypothesis::limits::TERM;
use crate::math::quantile;
use crate::twin::{Interval, Now, Parameter};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Lengths in ranges of the variable.
const LENGTHS: [f64; 3] = [0.15, 0.3, 0.7];
const LENGTHS_OF_TWO: [f64; 2] = [0.3, 0.7];
/// Time constants that a signal's past is seen through, in seconds, from a few steps to a part of the record.
pub(super) const PASTS: usize = 4;

/// Names of coefficients: effects name their magnitudes before any record is seen.
static NAMES: [&str; 21] = [
    "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9", "b10", "b11", "b12", "b13", "b14", "b15",
    "b16", "b17", "b18", "b19", "b20", "b21",
];

/// A variable of a function and the range that it is seen in.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Variable {
    pub name: String,
    pub of: Of,
    pub low: f64,
    pub high: f64,
}

impl Variable {
    fn ends(&self) -> (f64, f64) {
        let span = (self.high - self.low)
            .max(1e-12 * self.high.abs())
            .max(f64::MIN_POSITIVE);
        (
            self.low - TERM.margin * span,
            self.high + TERM.margin * span,
        )
    }
}

/// Range that lists of values cover, but for a hundredth of each; `None` where nothing moves.
pub(super) fn visited(all: impl Iterator<Item = Vec<f64>>) -> Option<(f64, f64)> {
    let at = |values: &[f64], p| quantile(values, p).unwrap_or(f64::NAN);
    let ends = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), values| {
        (low.min(at(&values, 0.005)), high.max(at(&values, 0.995)))
    });
    (ends.0 < ends.1).then_some(ends)
}

/// Values from low to high, evenly in their logarithm.
pub(super) fn spread<const N: usize>(low: f64, high: f64) -> [f64; N] {
    let high = high.max(2.0 * low);
    std::array::from_fn(|i| low * (high / low).powf(i as f64 / (N - 1) as f64))
}

/// Weights of the coefficients for each length.
fn weights(variables: usize) -> Vec<Vec<f64>> {
    let whole = 1.0 + 2.0 * TERM.margin;
    let one = |squares: &dyn Fn(f64) -> Vec<f64>, length: f64| -> Vec<f64> {
        let raw: Vec<f64> = squares(PI / whole)
            .iter()
            .map(|w| (-0.5 * w * length * length).exp())
            .collect();
        let least = 1e-5 * raw.iter().copied().fold(0.0, f64::max);
        let raw: Vec<f64> = raw.into_iter().map(|w| w.max(least)).collect();
        let sum: f64 = raw.iter().sum();
        raw.into_iter().map(|w| w / sum).collect()
    };
    match variables {
        1 => LENGTHS
            .map(|length| {
                one(
                    &|unit| (1..=TERMS).map(|k| (k as f64 * unit).powi(2)).collect(),
                    length,
                )
            })
            .to_vec(),
        _ => LENGTHS_OF_TWO
            .map(|length| {
                let squares = |unit: f64| {
                    pairs()
                        .map(|(i, j)| ((i * i + j * j) as f64) * unit * unit)
                        .collect()
                };
                one(&squares, length)
            })
            .to_vec(),
    }
}

fn with_coefficients(mut kind: EffectKind, count: usize) -> EffectKind {
    for name in NAMES.iter().take(count) {
        kind = kind.magnitude(Magnitude::signed(name, "", &[1.0]));
    }
    kind
}

/// A term of an unknown kind from its effect.
fn term(
    kind: EffectKind,
    target: &str,
    nature: Nature,
    weights: Vec<Vec<f64>>,
    largest: f64,
    variables: Vec<(String, f64, f64)>,
) -> Term {
    let effect = Effect::unlisted(kind, target);
    let axes = (effect.magnitudes().iter())
        .map(|_| coefficient(largest))
        .collect();
    let (id, starts) = (effect.id().to_owned(), vec![0.0; effect.magnitudes().len()]);
    let held = BTreeMap::new();
    Term {
        axes,
        family: Some((weights, largest)),
        starts: vec![Start::at(starts)],
        variables,
        ..Term::new(&id, target, nature, Part::Effect { effect, held })
    }
}

/// Axis of a coefficient.
fn coefficient(largest: f64) -> Axis {
    let mut parameter = Parameter::new("", "", -largest, largest);
    parameter.bounds = Interval::unchecked(-1e3 * largest, 1e3 * largest);
    Axis {
        centre: 0.0,
        deviation: largest,
        width: 0.1 * largest,
        longest: largest,
        counts: false,
        evidence: EvidencePrior::Member,
        ..Axis::of(&parameter)
    }
}

/// An unknown term f(variables) of the rate of a state.
pub(super) fn of_state(target: &str, variables: &[Variable], largest: f64) -> Term {
    let names: Vec<&str> = variables.iter().map(|v| v.name.as_str()).collect();
    let id = format!("f({})", names.join(","));
    let ends: Vec<(f64, f64)> = variables.iter().map(Variable::ends).collect();
    let of: Vec<Of> = variables.iter().map(|v| v.of).collect();
    let value = |of: Of, at: &crate::effect::ForcePoint<'_>| of.value(at.t, at.states, at.u, at.x);
    let kind = match (of.as_slice(), ends.as_slice()) {
        (&[of], &[ends]) => with_coefficients(
            EffectKind::force(&id, "ẋ + f", move |m, at| {
                sum_of_one(m, value(of, at), ends)
            }),
            TERMS,
        ),
        (&[a, b], &[first, second]) => with_coefficients(
            EffectKind::force(&id, "ẋ + f", move |m, at| {
                sum_of_two(m, [value(a, at), value(b, at)], [first, second])
            }),
            NAMES.len(),
        ),
        _ => unreachable!("functions have one or two variables"),
    };
    let seen = variables
        .iter()
        .zip(ends)
        .map(|(v, (a, b))| (v.name.clone(), a, b));
    term(
        kind,
        target,
        Nature::Function,
        weights(variables.len()),
        largest,
        seen.collect(),
    )
}

/// Kind of a law that a signal passes, of so many coefficients.
fn passing(
    id: &str,
    is_sensor: bool,
    [sensor, actuator]: [&'static str; 2],
    count: usize,
    law: impl Fn(&[f64], &Now<'_>, &mut [f64], f64) -> f64 + Send + Sync + 'static,
) -> EffectKind {
    let kind = match is_sensor {
        true => EffectKind::sensor(id, sensor, law),
        false => EffectKind::actuator(id, actuator, law),
    };
    with_coefficients(kind, count)
}

/// An unknown distortion of a signal, a function of itself or of time.
pub(super) fn of_signal(target: &str, is_sensor: bool, variable: &Variable, largest: f64) -> Term {
    let id = format!("f({})", variable.name);
    let ends = variable.ends();
    let of = variable.of;
    let law = move |m: &[f64], now: &Now<'_>, _: &mut [f64], s: f64| {
        s + sum_of_one(m, of.value(now.t, &[], &[], s), ends)
    };
    let seen = vec![(variable.name.clone(), ends.0, ends.1)];
    term(
        passing(&id, is_sensor, ["s + f(z)", "u + f(z)"], TERMS, law),
        target,
        Nature::Function,
        weights(1),
        largest,
        seen,
    )
}

/// An unknown function of a state, an input or time that is added to an output, or to the logarithm of a parameter.
pub(super) fn entered(target: &str, entry: Entry, variable: &Variable, largest: f64) -> Term {
    let ends = variable.ends();
    let function = Entered {
        entry,
        of: variable.of,
        ends,
        trace: None,
    };
    Term {
        nature: match entry {
            Entry::Sensor(_) => Nature::Reading,
            _ => Nature::Function,
        },
        variables: vec![(variable.name.clone(), ends.0, ends.1)],
        ..of_part(target, &variable.name, function, largest)
    }
}

/// An unknown function of what a state, an input or an output leaves behind, added to a rate, an output or the logarithm of a parameter;
/// `variable` is the trace.
pub(super) fn of_trail(
    target: &str,
    entry: Entry,
    variable: &Variable,
    largest: f64,
    trace: Trace,
) -> Term {
    let function = Entered {
        entry,
        of: variable.of,
        ends: variable.ends(),
        trace: Some(trace),
    };
    Term {
        trail: Some(Trail::new(entry, variable.of, trace, variable.ends())),
        ..of_part(target, &variable.name, function, largest)
    }
}

/// An unknown function that is a part of the twin, of a variable of this name.
fn of_part(target: &str, name: &str, function: Entered, largest: f64) -> Term {
    let id = format!("f({name})");
    Term {
        axes: vec![coefficient(largest); TERMS],
        family: Some((weights(1), largest)),
        starts: vec![Start::at(vec![0.0; TERMS])],
        ..Term::new(&id, target, Nature::Past, Part::Function(function))
    }
}

/// An unknown answer of a signal to its past: s + Σ β_k·(s seen through a first-order lag of τ_k − s).
pub(super) fn of_past(target: &str, is_sensor: bool, name: &str, times: [f64; PASTS]) -> Term {
    let id = format!("past({name})");
    let law = move |m: &[f64], now: &Now<'_>, memory: &mut [f64], s: f64| {
        let (mut sum, dt) = (s, now.memory_step(!is_sensor));
        for ((m, z), tau) in m.iter().zip(memory).zip(times) {
            sum += m * (lag(tau, dt, z, s) - s);
        }
        sum
    };
    let formulas = ["s + Σ b·(lagged s − s)", "u + Σ b·(lagged u − u)"];
    term(
        passing(&id, is_sensor, formulas, PASTS, law).memory(PASTS),
        target,
        Nature::Past,
        vec![vec![1.0 / PASTS as f64; PASTS]],
        2.0,
        vec![],
    )
}

/// An unknown function of what a signal leaves behind: s + f(z); `variable` is z, `trail` the same inside the twin.
pub(super) fn of_trace(
    target: &str,
    variable: &Variable,
    largest: f64,
    trace: Trace,
    entry: Entry,
) -> Term {
    let id = format!("f({})", variable.name);
    let ends = variable.ends();
    let (is_sensor, of) = match entry {
        Entry::Sensor(j) => (true, Of::Output(j)),
        Entry::Actuator(i) | Entry::State(i) | Entry::Parameter(i) => (false, Of::Input(i)),
    };
    let law = move |m: &[f64], now: &Now<'_>, memory: &mut [f64], s: f64| {
        memory[0] = trace.step(memory[0], s, now.memory_step(!is_sensor));
        s + sum_of_one(m, memory[0], ends)
    };
    let formulas = ["s + f(trace of s)", "u + f(trace of u)"];
    Term {
        trail: Some(Trail::new(entry, of, trace, ends)),
        ..term(
            passing(&id, is_sensor, formulas, TERMS, law).memory(1),
            target,
            Nature::Past,
            weights(1),
            largest,
            vec![],
        )
    }
}

/// A wave of unknown size, phase and frequency: on a signal, a rate or, relative, a parameter.
pub(super) fn wave(kind: &str, target: &str, largest: f64, frequency: Axis) -> Term {
    let effect = waving(kind, "periodic", |m| m[2])
        .magnitude(Magnitude::positive("frequency", "Hz", &[0.1]).shape(Shape::Frequency));
    let weights = vec![vec![0.5; 2]];
    let mut term = term(effect, target, Nature::Periodic, weights, largest, vec![]);
    term.axes[2] = frequency;
    term
}

/// A wave of unknown size and phase at a frequency in Hz of a signal, or at one of its harmonics.
pub(super) fn locked_wave(
    kind: &str,
    target: &str,
    signal: &str,
    largest: f64,
    frequency: f64,
) -> Term {
    let effect = waving(kind, &format!("response({signal})"), move |_| frequency);
    let weights = vec![vec![0.5; 2]];
    term(effect, target, Nature::Past, weights, largest, vec![])
}

/// Kind of a wave of two coefficients.
fn waving(
    kind: &str,
    id: &str,
    frequency: impl Fn(&[f64]) -> f64 + Send + Sync + 'static,
) -> EffectKind {
    let wave = move |m: &[f64], t: f64| {
        let (sin, cos) = (2.0 * PI * frequency(m) * t).sin_cos();
        m[0] * sin + m[1] * cos
    };
    let effect = match kind {
        "sensor" => EffectKind::sensor(id, "s + wave", move |m, now, _, s| s + wave(m, now.t)),
        "actuator" => EffectKind::actuator(id, "u + wave", move |m, now, _, u| u + wave(m, now.t)),
        "state" => EffectKind::force(id, "ẋ + wave", move |m, at| wave(m, at.t)),
        _ => EffectKind::parameter(id, "θ·(1 + wave)", move |m, t, value| {
            value * (1.0 + wave(m, t)).max(0.0)
        }),
    };
    with_coefficients(effect, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_add_up_to_one_and_long_lengths_are_smooth() {
        for (variables, count) in [(1, TERMS), (2, NAMES.len())] {
            for list in weights(variables) {
                assert_eq!(list.len(), count);
                assert!((list.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
        let lists = weights(1);
        assert!(lists[0][4] > 3.0 * lists[2][4]);
    }
}
