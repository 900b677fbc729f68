//! A twin in another setting: prior, bounds, limits, noise and start changed from outside.

use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    DigitalTwin, Interval, Modified, Modify, Noise, Now, Outline, Parameter, ParameterSpace, Role,
    SimulationError, StateSpace, Twin, TwinError,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A number that is either known or to be estimated; files write `0.1` or `"estimate"`.
///
/// ```
/// use truetwin::study::StudyFile;
/// use truetwin::twin::Level;
///
/// let file = StudyFile::parse("twin = 'tanks'\n[noise]\nh1 = 0.1\ny = 'estimate'", "S.toml".as_ref())?;
/// assert_eq!(file.noise["h1"], Level::Known(0.1));
/// assert_eq!(file.noise["y"], Level::Estimate);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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

/// What is changed in a twin; each map goes by the names of parameters, states and outputs.
///
/// An unknown start or noise level lengthens θ by a parameter `start.<state>` or `noise.<state or output>`. Its
/// prior is `prior["start.h1"]`, or else the state's limits; for noise, a tenth to three times the twin's own level.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::twin::{Adaptation, Level, TwinError, adapt};
/// use truetwin::twins::CascadedTanks;
///
/// let mut adaptation = Adaptation::default();
/// adaptation.start.insert("h1".into(), Level::Estimate);
/// let twin = adapt(Arc::new(CascadedTanks), &adaptation, 4.0)?;
/// assert_eq!(twin.parameters().names(), ["k1", "k2", "k3", "k4", "start.h1"]);
///
/// adaptation.start.insert("h3".into(), Level::Known(0.0));
/// let refused = adapt(Arc::new(CascadedTanks), &adaptation, 4.0).err().ok_or("h3 is no state")?;
/// assert!(matches!(refused, TwinError::UnknownIn { .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Adaptation {
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

/// The twin in another setting; θ is the twin's, then unknown noise levels, then unknown starts. `step` is the Δt, in
/// seconds, at which the twin's own noise levels are taken.
///
/// ```
/// use std::sync::Arc;
/// use truetwin::twin::{Adaptation, DigitalTwin, Interval, adapt};
/// use truetwin::twins::VanDerPol;
///
/// let mut adaptation = Adaptation::default();
/// adaptation.prior.insert("nu".into(), Interval::new(1.0, 2.0)?);
/// let twin = adapt(Arc::new(VanDerPol), &adaptation, 0.05)?;
/// assert_eq!(twin.parameters().centre(), [1.5]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn adapt(base: impl Into<Twin>, adaptation: &Adaptation, step: f64) -> Result<Twin, TwinError> {
    let base = base.into();
    if *adaptation == Adaptation::default() {
        return Ok(base);
    }
    let equations = match base {
        Twin::Equations(equations) => equations,
        Twin::BlackBox(base) => return adapt_black_box(base, adaptation),
    };
    let mut outline = equations.outline();
    let n = outline.parameters.len();
    let position = |table, name: &str, known: &[String]| {
        (known.iter().position(|k| k == name)).ok_or_else(|| TwinError::UnknownIn {
            table,
            name: name.into(),
            known: known.join(", "),
        })
    };
    let states: Vec<String> = outline.states.iter().map(|s| s.name.clone()).collect();
    let outputs = outline.outputs.iter().map(|y| y.name.clone());
    let noisy: Vec<String> = states.iter().cloned().chain(outputs).collect();
    let mut limits = equations.limits();
    for (name, &limit) in &adaptation.limits {
        limits[position("limits", name, &states)?] = limit;
    }
    let declared = declared_noise(equations.as_ref(), &outline, step);
    let mut added: Vec<Parameter> = Vec::new();
    let mut noise = Vec::new();
    for (name, &level) in &adaptation.noise {
        let index = position("noise", name, &noisy)?;
        let what = match level {
            Level::Known(value) if value >= 0.0 && value.is_finite() => Setting::Known(value),
            Level::Known(value) => {
                return Err(TwinError::Value {
                    table: "noise",
                    name: name.clone(),
                    value,
                    remedy: "a standard deviation is 0 or more",
                });
            }
            Level::Estimate => {
                let twin = declared[index];
                let guess = (twin > 0.0).then(|| Interval::unchecked(0.1 * twin, 3.0 * twin));
                added.push(unknown(
                    adaptation,
                    &format!("noise.{name}"),
                    guess,
                    Role::Noise,
                )?);
                Setting::Parameter(n + added.len() - 1)
            }
        };
        noise.push((index, what));
    }
    let mut start = Vec::new();
    for (name, &level) in &adaptation.start {
        let index = position("start", name, &states)?;
        let what = match level {
            Level::Known(value) if limits[index].contains(value) && value.is_finite() => {
                Setting::Known(value)
            }
            Level::Known(value) => {
                return Err(TwinError::Value {
                    table: "start",
                    name: name.clone(),
                    value,
                    remedy: "a start lies within the state's limits",
                });
            }
            Level::Estimate => {
                let guess = Some(limits[index]).filter(|limit| limit.is_finite());
                added.push(unknown(
                    adaptation,
                    &format!("start.{name}"),
                    guess,
                    Role::Start,
                )?);
                Setting::Parameter(n + added.len() - 1)
            }
        };
        start.push((index, what));
    }
    outline.parameters = ParameterSpace::new(outline.parameters.iter().cloned().chain(added));
    rebox(&mut outline.parameters, adaptation)?;
    Ok(Twin::Equations(Arc::new(Modified(Adapted {
        outline,
        limits,
        noise,
        start,
        own: n,
        base: equations,
    }))))
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
    Ok(Twin::BlackBox(Arc::new(AdaptedBlackBox {
        base,
        parameters,
    })))
}

/// Noise levels of states, then outputs, at the prior's centre.
fn declared_noise(twin: &dyn StateSpace, outline: &Outline, step: f64) -> Vec<f64> {
    let (mut q, mut r) = (
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
    twin.noise(&now, &mut q, &mut r);
    q.extend(r);
    q
}

/// A parameter for an unknown start or noise level.
fn unknown(
    adaptation: &Adaptation,
    name: &str,
    guess: Option<Interval>,
    role: Role,
) -> Result<Parameter, TwinError> {
    let given = adaptation.prior.get(name).copied();
    let prior = given
        .or(guess)
        .ok_or_else(|| TwinError::NoPrior(name.into()))?;
    let mut parameter = Parameter::new(name, "", prior.low(), prior.high()).with_role(role);
    if let Some(guess) = guess {
        let (low, high) = (guess.low().min(prior.low()), guess.high().max(prior.high()));
        parameter = parameter.within(low, high);
    }
    Ok(parameter)
}

/// Sets prior boxes and bounds.
fn rebox(parameters: &mut ParameterSpace, adaptation: &Adaptation) -> Result<(), TwinError> {
    for (table, boxes) in [("prior", &adaptation.prior), ("bounds", &adaptation.bounds)] {
        for (name, &interval) in boxes {
            let known = parameters.names().join(", ");
            let parameter = parameters
                .iter_mut()
                .find(|p| p.name == *name)
                .ok_or_else(|| TwinError::UnknownIn {
                    table,
                    name: name.clone(),
                    known,
                })?;
            match table {
                "prior" => parameter.prior = interval,
                _ => parameter.bounds = interval,
            }
        }
    }
    parameters.check()
}

/// Where a start or noise level comes from.
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

/// A black box with another prior or other bounds.
struct AdaptedBlackBox {
    base: Arc<dyn DigitalTwin>,
    parameters: ParameterSpace,
}

impl DigitalTwin for AdaptedBlackBox {
    fn parameters(&self) -> ParameterSpace {
        self.parameters.clone()
    }
    fn signals(&self) -> Signals {
        self.base.signals()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.base.simulate(theta, drive, noise)
    }
}
