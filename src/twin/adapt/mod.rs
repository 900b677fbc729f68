//! A twin in another setting: prior, bounds, limits, noise and start changed from outside, parameters held.

mod level;

pub(crate) use level::{DeclaredNoise, KNOWN_WITH_FACTOR, NoiseLevel, Per, StartLevel};

use super::composed::LevelValue;
use crate::record::Quantity;
use crate::twin::{
    Composed, Interval, Now, Outline, Parameter, ParameterSpace, Role, Twin, TwinError, TwinPart,
    is_memory,
};
use std::collections::BTreeMap;

/// A new setting of a twin; each map goes by the names of parameters, states and outputs.
///
/// An unknown start or noise level lengthens θ by a parameter `start.<state>` or `noise.<state or output>`. Its
/// prior is `prior["start.h1"]`, or else the state's limits; for noise, a tenth to three times the twin's own level.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Adaptation {
    /// Prior box by parameter.
    pub prior: BTreeMap<String, Interval>,
    /// Physical bounds by parameter.
    pub bounds: BTreeMap<String, Interval>,
    /// Limits by state, in place of the twin's own.
    pub limits: BTreeMap<String, Interval>,
    /// Noise by state or output.
    pub noise: BTreeMap<String, NoiseLevel>,
    /// Start by state.
    pub start: BTreeMap<String, StartLevel>,
}

/// Puts a twin into another setting; θ is the twin's, then unknown noise levels, then unknown starts. `step` is the Δt, in
/// seconds, at which the twin's own noise levels are taken.
pub(crate) fn adapt(base: Twin, adaptation: &Adaptation, step: f64) -> Result<Twin, TwinError> {
    if *adaptation == Adaptation::default() {
        return Ok(base);
    }
    let twin = match &base {
        Twin::Equations(equations) => adapt_equations(&base, equations, adaptation, step)?,
        Twin::BlackBox(_) => {
            check_black_box(adaptation)?;
            base
        }
    };
    twin.with_space(|space| rebox(space, adaptation))
}

/// The twin begun at known states, each within its limits; a black box as it is.
pub(crate) fn begun(twin: &Twin, states: &[f64], step: f64) -> Result<Twin, TwinError> {
    let Twin::Equations(base) = twin else {
        return Ok(twin.clone());
    };
    let names = base.outline().states.into_iter().map(|state| state.name);
    let start = (names.zip(base.limits()).zip(states))
        .filter(|((name, _), _)| !is_memory(name))
        .map(|((name, limit), state)| (name, StartLevel::known(limit.clamp(*state))))
        .collect();
    let adaptation = Adaptation {
        start,
        ..Adaptation::default()
    };
    // They are those of the first row, wherever the twin's own start belongs.
    let begun = adapt(twin.clone(), &adaptation, step)?;
    Ok(begun.with([], vec![TwinPart::Begins(None)]))
}

fn check_black_box(adaptation: &Adaptation) -> Result<(), TwinError> {
    for (table, used) in [
        ("limits", !adaptation.limits.is_empty()),
        ("noise", !adaptation.noise.is_empty()),
        ("start", !adaptation.start.is_empty()),
    ] {
        if used {
            return Err(TwinError::BlackBox(table));
        }
    }
    Ok(())
}

fn adapt_equations(
    twin: &Twin,
    base: &Composed,
    adaptation: &Adaptation,
    step: f64,
) -> Result<Twin, TwinError> {
    let outline = base.outline();
    let names = |all: &[Quantity]| -> Vec<String> { all.iter().map(|q| q.name.clone()).collect() };
    let states = names(&outline.states);
    let noisy = [&states[..], &names(&outline.outputs)].concat();
    let mut limits = base.limits().to_vec();
    let (mut added, mut parts) = (vec![], vec![]);
    for (state, _, limit) in indexed("limits", &adaptation.limits, &states)? {
        limits[state] = limit;
        parts.push(TwinPart::Box { state, limit });
    }
    let noise = indexed("noise", &adaptation.noise, &noisy)?;
    let levels = declared_noise(base, &outline, step);
    for &(index, name, level) in &noise {
        let is_process = index < states.len();
        level.check(name, is_process)?;
        let setting = match level {
            NoiseLevel::Declared(DeclaredNoise { std, per, .. }) => LevelValue::Known(match per {
                Per::Second if is_process => std * step.sqrt(),
                _ => std,
            }),
            NoiseLevel::Estimate => {
                let level = levels[index];
                let guess = (level > 0.0).then(|| Interval::unchecked(0.1 * level, 3.0 * level));
                added.push(unknown_level(adaptation, name, guess)?);
                LevelValue::Parameter(twin.entries() + added.len() - 1)
            }
        };
        parts.push(TwinPart::Level {
            is_process,
            target: if is_process {
                index
            } else {
                index - states.len()
            },
            level: setting,
            step,
        });
        if let NoiseLevel::Declared(DeclaredNoise { share, .. }) = level
            && share > 0.0
        {
            parts.push(TwinPart::Share {
                output: index - states.len(),
                share: LevelValue::Known(share),
            });
        }
    }
    let mut begins: Option<f64> = None;
    for (state, name, level) in indexed("start", &adaptation.start, &states)? {
        let limit = limits[state];
        level.check(name, limit)?;
        let (mean, std) = match level {
            StartLevel::Declared { mean, std, at } => {
                if let (Some(at), Some(other)) = (at, begins.or(at)) {
                    if at != other {
                        let name = name.into();
                        return Err(TwinError::Begins { name, at, other });
                    }
                    begins = Some(at);
                }
                (LevelValue::Known(mean), std)
            }
            StartLevel::Estimate => {
                let guess = Some(limit).filter(|limit| limit.is_finite());
                added.push(unknown(adaptation, Role::Start, name, guess)?);
                (LevelValue::Parameter(twin.entries() + added.len() - 1), 0.0)
            }
        };
        parts.push(TwinPart::Start { state, mean, std });
    }
    if begins.is_some() {
        parts.push(TwinPart::Begins(begins));
    }
    Ok(twin.with(added, parts))
}

/// Entries of a table, each with the index of its name among those that the twin knows.
fn indexed<'a, T: Copy>(
    table: &'static str,
    entries: &'a BTreeMap<String, T>,
    known: &[String],
) -> Result<Vec<(usize, &'a str, T)>, TwinError> {
    let index = |name: &str| {
        (known.iter().position(|k| k == name)).ok_or_else(|| TwinError::UnknownIn {
            table,
            name: name.into(),
            known: known.join(", "),
        })
    };
    (entries.iter())
        .map(|(name, &value)| Ok((index(name)?, name.as_str(), value)))
        .collect()
}

/// Noise levels of states, then outputs, at the prior's centre and the start.
fn declared_noise(twin: &Composed, outline: &Outline, step: f64) -> Vec<f64> {
    let (mut process, mut measurement) = (
        vec![0.0; outline.states.len()],
        vec![0.0; outline.outputs.len()],
    );
    let centre = outline.parameters.centre();
    let u = vec![0.0; outline.inputs.len()];
    let now = Now::new(0.0, step, &u, &centre);
    let mut start = vec![0.0; outline.states.len()];
    twin.start(&now, &mut start);
    twin.noise(&now, &start, &mut process, &mut measurement);
    process.extend(measurement);
    process
}

/// A parameter for an unknown noise level of `target`.
fn unknown_level(
    adaptation: &Adaptation,
    target: &str,
    guess: Option<Interval>,
) -> Result<Parameter, TwinError> {
    let parameter = unknown(adaptation, Role::Noise, target, guess)?;
    let low = parameter.prior.low().min(parameter.bounds.low());
    if low < 0.0 {
        return Err(TwinError::Value {
            table: "prior",
            name: parameter.name,
            value: low,
            remedy: "a noise level is a standard deviation: its prior and bounds begin at 0 or above",
        });
    }
    Ok(parameter)
}

/// A parameter for an unknown start or noise level of `target`.
fn unknown(
    adaptation: &Adaptation,
    role: Role,
    target: &str,
    guess: Option<Interval>,
) -> Result<Parameter, TwinError> {
    let name = role.name(target);
    let prior = (adaptation.prior.get(&name).copied().or(guess))
        .ok_or_else(|| TwinError::NoPrior(name.clone()))?;
    let mut parameter = Parameter::new(&name, "", prior.low(), prior.high()).with_role(role);
    if let Some(guess) = guess {
        let (low, high) = (guess.low().min(prior.low()), guess.high().max(prior.high()));
        parameter = parameter.within(low, high);
    }
    Ok(parameter)
}

/// Sets prior boxes and bounds.
fn rebox(parameters: &mut ParameterSpace, adaptation: &Adaptation) -> Result<(), TwinError> {
    let names: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();
    for (index, _, prior) in indexed("prior", &adaptation.prior, &names)? {
        parameters[index].prior = prior;
    }
    for (index, _, bounds) in indexed("bounds", &adaptation.bounds, &names)? {
        let own = parameters[index].bounds;
        let beyond = [bounds.low(), bounds.high()].into_iter();
        let mut beyond = beyond.filter(|end| !own.contains(*end));
        if parameters[index].role == Role::Magnitude
            && let Some(value) = beyond.next()
        {
            return Err(TwinError::Value {
                table: "bounds",
                name: names[index].clone(),
                value,
                remedy: "the law's own limits of a magnitude hold; choose bounds inside them",
            });
        }
        parameters[index].bounds = bounds;
    }
    // A study may hold all parameters.
    match parameters.is_empty() {
        true => Ok(()),
        false => parameters.check(),
    }
}

/// Holds the named parameters of a twin; θ is shorter by them.
///
/// Refuses unknown names. All parameters may be held. Values are not checked: a magnitude may be held at infinity.
pub(crate) fn fix(
    base: impl Into<Twin>,
    values: &BTreeMap<String, f64>,
) -> Result<Twin, TwinError> {
    let base = base.into();
    if values.is_empty() {
        return Ok(base);
    }
    let all = base.parameters();
    for name in values.keys() {
        all.position(name)?;
    }
    let free = all.iter().filter(|p| !values.contains_key(&p.name));
    let free = ParameterSpace::new(free.cloned());
    if !free.is_empty() {
        free.check()?;
    }
    Ok(base.holding(values, free))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;
    use crate::twin::Noise;
    use crate::twin::fixture::AtOnce;

    #[test]
    fn held_parameters_leave_theta() {
        let sum = || AtOnce::<2>(|theta, _| theta[0] + 10.0 * theta[1]);
        let values = |pairs: &[(&str, f64)]| pairs.iter().map(|&(n, v)| (n.into(), v)).collect();
        let twin = fix(Twin::new(sum()), &values(&[("a", 3.0)])).unwrap();
        assert_eq!(twin.parameters().names(), ["b"]);
        let drive = Drive::autonomous(1.0, 1).unwrap();
        assert_eq!(
            twin.simulate(&[2.0], &drive, Noise::OFF).unwrap()[[0, 0]],
            23.0
        );
        let whole = fix(Twin::new(sum()), &values(&[("a", 1.0), ("b", 2.0)])).unwrap();
        assert!(whole.parameters().is_empty());
        let run = whole.simulate(&[], &drive, Noise::OFF).unwrap();
        assert_eq!(run[[0, 0]], 21.0);
        assert!(fix(Twin::new(sum()), &values(&[("c", 1.0)])).is_err());
    }
}
