//! A twin in another setting: prior, bounds, limits, noise and start changed from outside.

use super::fix::{Held, HeldBlackBox};
use crate::record::Quantity;
use crate::twin::{
    DigitalTwin, Interval, Modified, Modify, Now, Outline, Parameter, ParameterSpace, Role,
    StateSpace, Twin, TwinError,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A number that is either known or to be estimated; files write `0.1` or `"estimate"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "LevelText", into = "LevelText")]
#[non_exhaustive]
pub enum Level {
    /// Known.
    Known(f64),
    /// Unknown: it becomes a parameter.
    Estimate,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a number, or \"estimate\"")]
enum LevelText {
    Number(f64),
    Word(Word),
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    Estimate,
}

impl From<LevelText> for Level {
    fn from(text: LevelText) -> Self {
        match text {
            LevelText::Number(value) => Self::Known(value),
            LevelText::Word(Word::Estimate) => Self::Estimate,
        }
    }
}

impl From<Level> for LevelText {
    fn from(level: Level) -> Self {
        match level {
            Level::Known(value) => Self::Number(value),
            Level::Estimate => Self::Word(Word::Estimate),
        }
    }
}

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
    /// Noise by state (standard deviation of the increment a step) or output (standard deviation).
    pub noise: BTreeMap<String, Level>,
    /// Start by state.
    pub start: BTreeMap<String, Level>,
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
        match level {
            Level::Known(value) if !(value >= 0.0 && value.is_finite()) => {
                return Err(TwinError::Value {
                    table: "noise",
                    name: name.into(),
                    value,
                    remedy: "a standard deviation is 0 or more",
                });
            }
            Level::Known(_) => {}
            Level::Estimate => {
                let level = levels[index];
                let guess = (level > 0.0).then(|| Interval::unchecked(0.1 * level, 3.0 * level));
                let parameter = unknown(adaptation, Role::Noise, name, guess)?;
                outline.parameters.push(parameter);
            }
        }
    }
    let start = indexed("start", &adaptation.start, &states)?;
    for &(index, name, level) in &start {
        let limit = limits[index];
        match level {
            Level::Known(value) if !(limit.contains(value) && value.is_finite()) => {
                return Err(TwinError::Value {
                    table: "start",
                    name: name.into(),
                    value,
                    remedy: "a start lies within the state's limits",
                });
            }
            Level::Known(_) => {}
            Level::Estimate => {
                let guess = Some(limit).filter(|limit| limit.is_finite());
                let parameter = unknown(adaptation, Role::Start, name, guess)?;
                outline.parameters.push(parameter);
            }
        }
    }
    rebox(&mut outline.parameters, adaptation)?;
    let settings = |role: Role, all: &[(usize, &str, Level)]| -> Result<Vec<_>, TwinError> {
        let setting = |name, level| match level {
            Level::Known(value) => Ok(Setting::Known(value)),
            Level::Estimate => {
                (outline.parameters.position(&role.name(name))).map(Setting::Parameter)
            }
        };
        (all.iter())
            .map(|&(index, name, level)| Ok((index, setting(name, level)?)))
            .collect()
    };
    Ok(Twin::Equations(Arc::new(Modified(Adapted {
        limits,
        noise: settings(Role::Noise, &noise)?,
        start: settings(Role::Start, &start)?,
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
    let now = Now {
        t: 0.0,
        dt: step,
        u: &vec![0.0; outline.inputs.len()],
        theta: &centre,
    };
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
    /// Index among states, then outputs.
    noise: Vec<(usize, Setting)>,
    start: Vec<(usize, Setting)>,
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
        self.now(now, &[], |now| self.base.start(now, x));
        for &(i, setting) in &self.start {
            x[i] = setting.value(now.theta);
        }
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.now(now, &[], |now| self.base.noise(now, process, measurement));
        for &(i, setting) in &self.noise {
            let level = match i.checked_sub(process.len()) {
                None => &mut process[i],
                Some(j) => &mut measurement[j],
            };
            *level = setting.value(now.theta);
        }
    }
}
