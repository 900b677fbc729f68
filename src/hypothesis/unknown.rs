//! Unknown functions and disturbances at every place of a twin: they stand for whatever is not in the library.

use super::basis::Of;
use super::entry::Entry;
use super::functions::{
    PASTS, Variable, entered, of_past, of_signal, of_state, spread, visited, wave,
};
use super::limits::TERM;
use super::listed::Library;
use super::magnitude::uniform_axis;
use super::remembered::remembered;
use super::responses::responses;
use super::scales::Scales;
use super::term::{Nature, Part, Start, Term};
use crate::effect::{TargetKind, targets};
use crate::fit::axis::Axis;
use crate::record::Record;
use crate::twin::{Parameter, Role, is_memory};

/// Time constants of disturbances between three steps and a sixth of the record.
const TIMES: usize = 3;
/// Sizes of a disturbance, as shares of its largest.
const SIZES: [f64; 5] = [0.01, 0.03, 0.1, 0.3, 1.0];

/// Unknown functions at every place of a twin; `seen` are states of models whose range the functions must cover.
pub(crate) fn unknown(library: &Library<'_>, seen: &[Scales]) -> Vec<Term> {
    let scales = library.scales;
    let outline = &scales.outline;
    let mut terms = vec![];
    let range = |kind: TargetKind, i: usize| {
        let all = std::iter::once(scales).chain(seen);
        visited(all.map(|scales| scales.columns(kind, i)))
    };
    let variable = |kind: TargetKind, of: Of, i: usize, name: &str| {
        let (low, high) = range(kind, i)?;
        Some(Variable {
            name: name.to_owned(),
            of,
            low,
            high,
        })
    };
    let has_equations = scales.has_equations();
    let own: Vec<usize> = (0..outline.states.len())
        .filter(|&i| has_equations && !is_memory(&outline.states[i].name))
        .collect();
    let of_states: Vec<(usize, Variable)> = (own.iter())
        .filter_map(|&i| {
            Some((
                i,
                variable(TargetKind::State, Of::State(i), i, &outline.states[i].name)?,
            ))
        })
        .collect();
    let of_inputs: Vec<Variable> = (0..outline.inputs.len())
        .filter_map(|i| {
            variable(
                TargetKind::Actuator,
                Of::Input(i),
                i,
                &outline.inputs[i].name,
            )
        })
        .collect();
    let instants = |record: &Record| record.drive().times();
    let time = visited(scales.records.iter().map(instants)).map(|(low, high)| Variable {
        name: "t".to_owned(),
        of: Of::Time,
        low,
        high,
    });
    let times: [f64; TIMES] = spread(3.0 * scales.dt(), scales.duration() / 6.0);
    let frequency = |target: &str| {
        let parameter = Parameter::new(target, "Hz", 0.1, 1.0).within(0.0, f64::INFINITY);
        library.frequency(&parameter)
    };
    for &i in own.iter().filter(|&&i| !scales.defined[i]) {
        let (target, largest) = (&outline.states[i].name, scales.rates[i]);
        if largest <= 0.0 {
            continue;
        }
        for (_, one) in &of_states {
            terms.push(of_state(target, std::slice::from_ref(one), largest));
        }
        for one in of_inputs.iter().chain(&time) {
            terms.push(of_state(target, std::slice::from_ref(one), largest));
        }
        for (a, (first, one)) in of_states.iter().enumerate() {
            for (second, two) in &of_states[a + 1..] {
                if own.len() <= TERM.most_states || *first == i || *second == i {
                    terms.push(of_state(target, &[one.clone(), two.clone()], largest));
                }
            }
            for input in of_inputs.iter().filter(|_| *first == i) {
                terms.push(of_state(target, &[one.clone(), input.clone()], largest));
            }
        }
        terms.extend(disturbances(
            target,
            Entry::State(i),
            largest,
            scales.dt(),
            times,
        ));
    }
    let past: [f64; PASTS] = spread(1.5 * scales.dt(), scales.duration() / 8.0);
    let signals = library.twin.signals();
    for (kind, is_sensor) in [(TargetKind::Sensor, true), (TargetKind::Actuator, false)] {
        for (j, target) in targets(kind, None, &signals).into_iter().enumerate() {
            let name = if is_sensor {
                &outline.outputs[j].name
            } else {
                &outline.inputs[j].name
            };
            let Some(seen) = variable(kind, Of::Signal, j, name) else {
                continue;
            };
            let size = scales.size(kind, j);
            let both = std::iter::once(&seen).chain(&time);
            terms.extend(both.map(|one| of_signal(&target, is_sensor, one, size)));
            terms.push(of_past(&target, is_sensor, name, past));
            if is_sensor {
                let states = of_states.iter().map(|(_, state)| state);
                let others = states.chain(&of_inputs);
                terms.extend(others.map(|other| entered(&target, Entry::Sensor(j), other, size)));
            }
            if is_sensor || !has_equations {
                let entry = if is_sensor {
                    Entry::Sensor(j)
                } else {
                    Entry::Actuator(j)
                };
                terms.extend(disturbances(&target, entry, size, scales.dt(), times));
            }
            terms.extend(periodic(kind.name(), &target, size, frequency(&target)));
        }
    }
    for (i, parameter) in outline.parameters.iter().enumerate() {
        if parameter.role == Role::Parameter {
            let target = &parameter.name;
            let states = of_states.iter().map(|(_, state)| state);
            let all = states.chain(&of_inputs).chain(&time);
            terms.extend(all.map(|one| entered(target, Entry::Parameter(i), one, 1.0)));
            if !has_equations {
                continue;
            }
            terms.extend(disturbances(
                target,
                Entry::Parameter(i),
                1.0,
                scales.dt(),
                times,
            ));
            terms.extend(periodic("parameter", target, 1.0, frequency(target)));
        }
    }
    terms.extend(remembered(library, seen));
    terms.extend(responses(library));
    terms
}

fn periodic(
    kind: &str,
    target: &str,
    largest: f64,
    (grid, axis): (Vec<f64>, Axis),
) -> Option<Term> {
    let mut term = wave(kind, target, largest, axis);
    term.starts = grid
        .into_iter()
        .map(|f| Start::at(vec![0.0, 0.0, f]))
        .collect();
    (!term.starts.is_empty()).then_some(term)
}

pub(super) fn disturbances(
    target: &str,
    entry: Entry,
    largest: f64,
    dt: f64,
    times: impl IntoIterator<Item = f64>,
) -> Vec<Term> {
    let (low, high) = (0.003 * largest, 2.0 * largest);
    let parameter = Parameter::new("disturbance", "", low, high);
    let axis = Axis {
        counts: false,
        deviation: 3.0,
        longest: 0.7,
        ..uniform_axis(&parameter, true)
    };
    (times.into_iter())
        .map(|time| {
            let memory = (-dt / time).exp();
            let part = Part::Disturbance { entry, memory };
            Term {
                axes: vec![axis.clone()],
                starts: SIZES.map(|s| Start::at(vec![s * largest])).to_vec(),
                ..Term::new("f(t)", target, Nature::Time, part)
            }
        })
        .collect()
}
