//! A twin in another setting: prior, bounds, limits, noise and start changed from outside.

mod level;

pub(crate) use level::{NoiseLevel, Per, StartLevel};

use super::fix::{Held, HeldBlackBox};
use crate::record::Quantity;
use crate::twin::{
    DigitalTwin, Interval, Modified, Modify, Now, Outline, Parameter, ParameterSpace, Role,
    StateSpace, Twin, TwinError, is_memory,
};
use std::collections::BTreeMap;
use std::sync::Arc;

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
    match base {
        Twin::Equations(base) => adapt_equations(base, adaptation, step),
        Twin::BlackBox(base) => adapt_black_box(base, adaptation),
    }
}

/// The twin begun at known states, each within its limits; `None` for a black box.
pub(crate) fn begun(twin: &Twin, states: &[f64], step: f64) -> Option<Twin> {
    let Twin::Equations(base) = twin else {
        return None;
    };
    let names = base.outline().states.into_iter().map(|state| state.name);
    let start = (names.zip(base.limits()).zip(states))
        .filter(|((name, _), _)| !is_memory(name))
        .map(|((name, limit), state)| {
            let mean = limit.clamp(*state);
            (name, StartLevel::Declared { mean, std: 0.0 })
        })
        .collect();
    let adaptation = Adaptation {
        start,
        ..Adaptation::default()
    };
    adapt(twin.clone(), &adaptation, step).ok()
}

fn adapt_black_box(base: Arc<dyn DigitalTwin>, adaptation: &Adaptation) -> Result<Twin, TwinError> {
    for (table, used) in [
        ("limits", !adaptation.limits.is_empty()),
        ("noise", !adaptation.noise.is_empty()),
        ("start", !adaptation.start.is_empty()),
    ] {
        if used {
            return Err(TwinError::BlackBox(table));
        }
    }
    let mut parameters = base.parameters();
    rebox(&mut parameters, adaptation)?;
    let held = Held::none(parameters.len());
    Ok(Twin::BlackBox(Arc::new(HeldBlackBox {
        base,
        parameters,
        held,
    })))
}

fn adapt_equations(
    base: Arc<dyn StateSpace>,
    adaptation: &Adaptation,
    step: f64,
) -> Result<Twin, TwinError> {
    let mut outline = base.outline();
    let own = outline.parameters.len();
    let names = |all: &[Quantity]| -> Vec<String> { all.iter().map(|q| q.name.clone()).collect() };
    let states = names(&outline.states);
    let noisy = [&states[..], &names(&outline.outputs)].concat();
    let mut limits = base.limits();
    for (index, _, limit) in indexed("limits", &adaptation.limits, &states)? {
        limits[index] = limit;
    }
    let noise = indexed("noise", &adaptation.noise, &noisy)?;
    let levels = declared_noise(base.as_ref(), &outline, step);
    for &(index, name, level) in &noise {
        level.check(name)?;
        if level == NoiseLevel::Estimate {
            let level = levels[index];
            let guess = (level > 0.0).then(|| Interval::unchecked(0.1 * level, 3.0 * level));
            let parameter = unknown(adaptation, Role::Noise, name, guess)?;
            if parameter.prior.low() < 0.0 || parameter.bounds.low() < 0.0 {
                let low = parameter.prior.low().min(parameter.bounds.low());
                return Err(TwinError::Value {
                    table: "prior",
                    name: parameter.name,
                    value: low,
                    remedy: "a noise level is a standard deviation: its prior and bounds begin at 0 or above",
                });
            }
            outline.parameters.push(parameter);
        }
    }
    let start = indexed("start", &adaptation.start, &states)?;
    for &(index, name, level) in &start {
        let limit = limits[index];
        level.check(name, limit)?;
        if level == StartLevel::Estimate {
            let guess = Some(limit).filter(|limit| limit.is_finite());
            let parameter = unknown(adaptation, Role::Start, name, guess)?;
            outline.parameters.push(parameter);
        }
    }
    rebox(&mut outline.parameters, adaptation)?;
    let place = |role: Role, name: &str| outline.parameters.position(&role.name(name));
    let noise = (noise.iter())
        .map(|&(index, name, level)| {
            let at_step = match level {
                NoiseLevel::Declared { std, per, .. } => Setting::Known(match per {
                    Per::Second if index < states.len() => std * step.sqrt(),
                    _ => std,
                }),
                NoiseLevel::Estimate => Setting::Parameter(place(Role::Noise, name)?),
            };
            Ok((index, at_step))
        })
        .collect::<Result<Vec<_>, TwinError>>()?;
    let start = (start.iter())
        .map(|&(index, name, level)| {
            Ok(match level {
                StartLevel::Declared { mean, std } => (index, Setting::Known(mean), std),
                StartLevel::Estimate => (index, Setting::Parameter(place(Role::Start, name)?), 0.0),
            })
        })
        .collect::<Result<Vec<_>, TwinError>>()?;
    Ok(Twin::Equations(Arc::new(Modified(Adapted {
        limits,
        noise,
        start,
        step,
        own,
        outline,
        base,
    }))))
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

/// Noise levels of states, then outputs, at the prior's centre.
fn declared_noise(twin: &dyn StateSpace, outline: &Outline, step: f64) -> Vec<f64> {
    let (mut process, mut measurement) = (
        vec![0.0; outline.states.len()],
        vec![0.0; outline.outputs.len()],
    );
    let centre = outline.parameters.centre();
    let u = vec![0.0; outline.inputs.len()];
    let now = Now::new(0.0, step, &u, &centre);
    twin.noise(&now, &mut process, &mut measurement);
    process.extend(measurement);
    process
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
        parameters[index].bounds = bounds;
    }
    parameters.check()
}

/// A start or noise level.
#[derive(Debug, Clone, Copy)]
enum Setting {
    Known(f64),
    /// Index in θ.
    Parameter(usize),
}

impl Setting {
    fn value(self, theta: &[f64]) -> f64 {
        match self {
            Self::Known(value) => value,
            Self::Parameter(index) => theta[index],
        }
    }
}

/// Equations in another setting.
struct Adapted {
    base: Arc<dyn StateSpace>,
    outline: Outline,
    limits: Vec<Interval>,
    /// Index among states, then outputs; a state's level is that of the increment in `step`.
    noise: Vec<(usize, Setting)>,
    /// Index, mean, standard deviation.
    start: Vec<(usize, Setting, f64)>,
    /// Step of the study, in seconds.
    step: f64,
    /// Length of the base twin's θ.
    own: usize,
}

impl Modify for Adapted {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&theta[..self.own])
    }
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn limits(&self) -> Vec<Interval> {
        self.limits.clone()
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.now(now, |now| self.base.start(now, x));
        for &(i, mean, _) in &self.start {
            x[i] = mean.value(now.theta);
        }
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.now(now, |now| self.base.start_deviation(now, std));
        for &(i, _, deviation) in &self.start {
            std[i] = deviation;
        }
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.now(now, |now| self.base.noise(now, process, measurement));
        for &(i, setting) in &self.noise {
            let value = setting.value(now.theta);
            match i.checked_sub(process.len()) {
                // Variances add up over time: another step is not another physics.
                None => process[i] = value * (now.dt / self.step).sqrt(),
                Some(j) => measurement[j] = value,
            }
        }
    }
}
