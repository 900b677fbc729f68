//! A twin as measured records show it: noise levels that are fitted with θ, a start that is not quite known.
//!
//! Noise of a real rig is never known. A level that is held fixed makes everything that the twin lacks look like a gap of a fixed
//! size, or hides it; a level that is fitted lets the record say how well the twin predicts.
//!
//! ```text
//! state i   increment in Δt:  N(0, σ_i²·Δt)       σ_i in units of the state per √s
//! output j  error of a row:   N(0, r_j²)
//! ln σ ~ N(ln σ_0, s²)                             σ_0 declared: s = ln factor;  nothing declared: from the record, s = 2
//! x(0) ~ N(start, d²)                              d declared, or the size of the state's own motion
//! ```

use super::ensemble;
use super::kalman::{FilterError, FilterSettings, Kalman, recoverable};
use crate::effect::stops;
use crate::math::deviation;
use crate::record::Record;
use crate::twin::{
    Between, Interval, Modified, Modify, Now, Outline, Parameter, Role, StateSpace, Twin,
    Workspace, is_memory,
};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Standard deviation of the logarithm of a level that nothing is declared of: within a factor of 50 at two of them. Half of it ties
/// rigs to this file's guesses of size; twice costs a nat a level, for all explanations alike.
const UNDECLARED: f64 = 2.0;
/// Guess of an undeclared process noise: over the record, a random walk of this share of the state's own motion.
const WANDER: f64 = 0.1;
/// Guess of an undeclared measurement noise, as a share of the output's deviation.
const SHARE: f64 = 0.03;
/// Loud noise, from which fits begin: a step of this share of the state's own motion. Predictions then hardly reach beyond a row,
/// and the likelihood has no narrow valleys.
const LOUD: f64 = 0.1;
/// Range of a fitted level, as powers of e around its guess: rounding at one end, nonsense at the other.
const RANGE: f64 = 12.0;

/// Least measurement noise of outputs that stop at an end of their range, as a share of their motion: where the twin stops there, too,
/// noise that vanishes would make those samples infinitely likely.
const STOPPED: f64 = 1e-3;

/// A study's word on noise levels and starts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Beliefs {
    /// Step of the study, in seconds: declared levels of states are those of an increment in it.
    pub step: f64,
    /// States and outputs whose noise is known.
    pub known: BTreeSet<String>,
    /// Factors that one standard deviation of a declared level is; e where none is given.
    pub factors: BTreeMap<String, f64>,
    /// States whose start is declared.
    pub starts: BTreeSet<String>,
}

/// A fitted noise level.
#[derive(Debug, Clone)]
pub(crate) struct Level {
    pub parameter: Parameter,
    /// `true` for a state's.
    pub is_process: bool,
    /// Level that is declared, in the parameter's unit.
    pub declared: Option<f64>,
    /// Median before the record is seen.
    pub median: f64,
    /// Standard deviation of its logarithm.
    pub deviation: f64,
    /// Where fits begin.
    pub loud: f64,
}

/// A twin with noise levels in θ, behind its own parameters.
#[derive(Clone)]
pub(crate) struct Measured {
    pub twin: Twin,
    pub levels: Vec<Level>,
}

/// The twin as these records show it. A black box has noise of its own, or is given that of a sensor.
pub(crate) fn measured(
    twin: &Twin,
    records: &[Record],
    beliefs: &Beliefs,
) -> Result<Measured, FilterError> {
    match twin {
        Twin::Equations(base) => measured_equations(base, records, beliefs),
        Twin::BlackBox(_) => Ok(Measured {
            twin: ensemble::measured(twin, records)?.0,
            levels: vec![],
        }),
    }
}

fn measured_equations(
    base: &Arc<dyn StateSpace>,
    records: &[Record],
    beliefs: &Beliefs,
) -> Result<Measured, FilterError> {
    let outline = base.outline();
    let theta = outline.parameters.centre();
    let size_of = |column: &dyn Fn(&Record) -> Vec<f64>| -> f64 {
        records.iter().map(|r| size(&column(r))).fold(0.0, f64::max)
    };
    let outputs: Vec<f64> = (0..outline.outputs.len())
        .map(|j| size_of(&|r| r.outputs().column(j).to_vec()))
        .collect();
    let fallback = outputs.iter().copied().fold(0.0, f64::max);
    let mut sizes = free_motion(base.as_ref(), records, &theta, fallback);
    // States that follow the record tell their size better than a run that may drift away from it.
    let loud = build(base, &outline, records, beliefs, &theta, &sizes, &outputs);
    if let Some(followed) = followed_motion(&loud, records, &theta)? {
        for (size, followed) in sizes.iter_mut().zip(followed) {
            if followed > 0.0 && followed.is_finite() {
                *size = followed;
            }
        }
    }
    Ok(build(
        base, &outline, records, beliefs, &theta, &sizes, &outputs,
    ))
}

fn build(
    base: &Arc<dyn StateSpace>,
    outline: &Outline,
    records: &[Record],
    beliefs: &Beliefs,
    theta: &[f64],
    sizes: &[f64],
    outputs: &[f64],
) -> Measured {
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let mut noisy = MeasuredEquations {
        base: base.clone(),
        outline: outline.clone(),
        own: outline.parameters.len(),
        step: beliefs.step,
        process: vec![Source::Declared; n],
        measurement: vec![Source::Declared; p],
        starts: vec![None; n],
    };
    let now = Now::new(0.0, beliefs.step, records[0].drive().input(0), theta);
    let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
    base.noise(&now, &mut q, &mut r);
    let step = records[0].drive().dt();
    let longest = records.iter().map(Record::samples).max().unwrap_or(1) as f64 * step;
    let mut levels = Vec::new();
    let mut add = |name: &str, unit: String, floor: f64, declared: f64, guess: f64, loud: f64| {
        let is_process = floor == 0.0;
        let role_name = Role::Noise.name(name);
        if beliefs.known.contains(name) || outline.parameters.position(&role_name).is_ok() {
            return None;
        }
        let (median, deviation) = if declared > 0.0 {
            (declared, beliefs.factors.get(name).map_or(1.0, |f| f.ln()))
        } else {
            (guess, UNDECLARED)
        };
        let reach = RANGE.exp();
        let bounds = Interval::unchecked((median / reach).max(floor), median * reach);
        let parameter = Parameter {
            name: role_name,
            unit,
            prior: Interval::unchecked(median / deviation.exp(), median * deviation.exp()),
            bounds,
            role: Role::Noise,
        };
        levels.push(Level {
            parameter,
            is_process,
            declared: (declared > 0.0).then_some(declared),
            median,
            deviation,
            loud: bounds.clamp(loud.max(median)),
        });
        Some(outline.parameters.len() + levels.len() - 1)
    };
    for (i, state) in outline.states.iter().enumerate() {
        if is_memory(&state.name) {
            continue;
        }
        let unit = if state.unit.is_empty() {
            "1/√s".to_owned()
        } else {
            format!("{}/√s", state.unit)
        };
        let declared = q[i] / beliefs.step.sqrt();
        let guess = WANDER * sizes[i] / longest.sqrt();
        let loud = LOUD * sizes[i] / step.sqrt();
        if let Some(parameter) = add(&state.name, unit, 0.0, declared, guess, loud) {
            noisy.process[i] = Source::Fitted {
                parameter,
                declared,
            };
        }
        if !beliefs.starts.contains(&state.name) {
            noisy.starts[i] = Some(sizes[i]);
        }
    }
    for (j, output) in outline.outputs.iter().enumerate() {
        let (guess, loud) = (SHARE * outputs[j], LOUD * outputs[j]);
        let unit = output.unit.clone();
        let stops = records
            .iter()
            .any(|r| stops(&r.outputs().column(j).to_vec()));
        let floor = if stops {
            STOPPED * outputs[j]
        } else {
            f64::MIN_POSITIVE
        };
        if let Some(parameter) = add(&output.name, unit, floor, r[j], guess, loud) {
            noisy.measurement[j] = Source::Fitted {
                parameter,
                declared: r[j],
            };
        }
    }
    for level in &levels {
        noisy.outline.parameters.push(level.parameter.clone());
    }
    Measured {
        twin: Twin::Equations(Arc::new(Modified(noisy))),
        levels,
    }
}

/// Deviation, or what is left of it where nothing moves.
fn size(values: &[f64]) -> f64 {
    let present: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let largest = present.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    let size = deviation(&present).max(1e-3 * largest);
    if size > 0.0 { size } else { 1.0 }
}

/// Median distance of each state from its start, in runs under the records' inputs; `fallback` where a state does not move or the
/// run diverges.
fn free_motion(
    base: &dyn StateSpace,
    records: &[Record],
    theta: &[f64],
    fallback: f64,
) -> Vec<f64> {
    let n = base.outline().states.len();
    let limits = base.limits();
    let mut distances = vec![Vec::new(); n];
    let mut work = Workspace::new(base);
    for record in records {
        let drive = record.drive();
        let between = Between::rows(base, drive);
        let mut now = Now::new(0.0, drive.dt(), drive.input(0), theta);
        let (mut x, mut start) = (vec![0.0; n], vec![0.0; n]);
        base.start(&now, &mut x);
        start.copy_from_slice(&x);
        for k in 0..drive.samples() {
            (now.t, now.dt, now.u) = (drive.time(k), drive.step(k), drive.input(k));
            now.between = between.get(k);
            base.advance(&now, &mut x, &mut work);
            base.constrain(&now, &mut x);
            for (x, limit) in x.iter_mut().zip(&limits) {
                *x = limit.clamp(*x);
            }
            if !x.iter().all(|v| v.abs() < 1e12) {
                break;
            }
            for (i, x) in x.iter().enumerate() {
                distances[i].push((x - start[i]).abs());
            }
        }
    }
    (distances.into_iter())
        .map(|mut d| {
            d.sort_by(f64::total_cmp);
            let median = d.get(d.len() / 2).copied().unwrap_or(0.0);
            if median > 0.0 { median } else { fallback }
        })
        .collect()
}

/// Deviation of each state as a filter with loud noise follows it; `None` where it cannot.
fn followed_motion(
    loud: &Measured,
    records: &[Record],
    theta: &[f64],
) -> Result<Option<Vec<f64>>, FilterError> {
    let Some(twin) = loud.twin.equations() else {
        return Ok(None);
    };
    let theta: Vec<f64> = (theta.iter().copied())
        .chain(loud.levels.iter().map(|level| level.loud))
        .collect();
    let settings = FilterSettings {
        keep_states: true,
        ..FilterSettings::default()
    };
    let mut means: Vec<Vec<f64>> = vec![Vec::new(); twin.outline().states.len()];
    for record in records {
        let filtered = Kalman::new(twin, record, &settings)?.filter(&theta);
        let Some(states) = recoverable(filtered)?.and_then(|f| f.states) else {
            return Ok(None);
        };
        for (all, column) in means.iter_mut().zip(states.means.columns()) {
            all.extend(column.iter());
        }
    }
    Ok(Some(means.iter().map(|m| deviation(m)).collect()))
}

/// Where a noise level comes from.
#[derive(Debug, Clone, Copy)]
enum Source {
    /// The twin.
    Declared,
    /// An entry of θ; the twin's own level, in the parameter's unit, says how it depends on time and θ.
    Fitted { parameter: usize, declared: f64 },
}

/// Equations with fitted noise levels and an uncertain start.
struct MeasuredEquations {
    base: Arc<dyn StateSpace>,
    outline: Outline,
    /// Length of the base twin's θ.
    own: usize,
    step: f64,
    process: Vec<Source>,
    measurement: Vec<Source>,
    /// Deviation of each start that is not declared.
    starts: Vec<Option<f64>>,
}

impl Modify for MeasuredEquations {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&theta[..self.own])
    }
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.now(now, |now| self.base.start_deviation(now, std));
        for (std, own) in std.iter_mut().zip(&self.starts) {
            if let Some(own) = own
                && *std == 0.0
            {
                *std = *own;
            }
        }
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        // Variances add up over time: the twin's own levels are those of the study's step.
        let at_step = Now {
            dt: self.step,
            theta: &now.theta[..self.own],
            ..*now
        };
        self.base.noise(&at_step, process, measurement);
        let (per_step, per_second) = ((now.dt / self.step).sqrt(), now.dt.sqrt());
        for (level, source) in process.iter_mut().zip(&self.process) {
            *level = match *source {
                Source::Declared => *level * per_step,
                Source::Fitted {
                    parameter,
                    declared,
                } if declared > 0.0 => *level * per_step * (now.theta[parameter] / declared),
                Source::Fitted { parameter, .. } => now.theta[parameter] * per_second,
            };
        }
        for (level, source) in measurement.iter_mut().zip(&self.measurement) {
            match *source {
                Source::Declared => {}
                Source::Fitted {
                    parameter,
                    declared,
                } if declared > 0.0 => {
                    *level *= now.theta[parameter] / declared;
                }
                Source::Fitted { parameter, .. } => *level = now.theta[parameter],
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::{DigitalTwin, Noise};
    use crate::twins::{CascadedTanks, VanDerPol};

    fn record(twin: &dyn DigitalTwin, theta: &[f64], drive: Drive) -> Record {
        let outputs = twin
            .simulate(theta, &drive, Noise::new(1, "measured", 0))
            .unwrap();
        Record::new(drive, outputs).unwrap()
    }

    fn tanks() -> (Arc<dyn StateSpace>, Record) {
        let inputs = Signal::from_shape_fn((200, 1), |(k, _)| [2.6, 0.4, 2.0, 1.2][k / 30 % 4]);
        let drive = Drive::new(0.5, inputs).unwrap();
        let record = record(&CascadedTanks, &[0.6, 0.5, 0.55, 1.0], drive);
        (Arc::new(CascadedTanks), record)
    }

    fn medians(measured: &Measured) -> impl Iterator<Item = f64> {
        measured.levels.iter().map(|level| level.median)
    }

    fn beliefs(step: f64) -> Beliefs {
        Beliefs {
            step,
            ..Beliefs::default()
        }
    }

    /// Declared levels are medians, in units per √s; at them the filter sees the twin's own noise.
    #[test]
    fn declared_levels_are_the_twins_own() {
        let (twin, record) = tanks();
        let measured =
            measured_equations(&twin, std::slice::from_ref(&record), &beliefs(0.5)).unwrap();
        let names: Vec<&str> = (measured.levels.iter())
            .map(|l| l.parameter.name.as_str())
            .collect();
        assert_eq!(names, ["noise.h1", "noise.h2", "noise.y"]);
        assert!((measured.levels[0].median - 0.1 / 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(measured.levels[2].median, 0.15);
        let theta: Vec<f64> = [0.6, 0.5, 0.55, 1.0]
            .into_iter()
            .chain(medians(&measured))
            .collect();
        let (mut q, mut r) = ([0.0; 2], [0.0; 1]);
        for (dt, level) in [(0.5, 0.1), (2.0, 0.2)] {
            let now = Now::new(0.0, dt, &[1.0], &theta);
            measured
                .twin
                .equations()
                .unwrap()
                .noise(&now, &mut q, &mut r);
            assert!((q[0] - level).abs() < 1e-12 && (r[0] - 0.15).abs() < 1e-12);
        }
    }

    /// Levels that nothing is declared of are guessed from the record; known levels and declared starts stay.
    #[test]
    fn undeclared_levels_come_from_the_record() {
        let record = record(&VanDerPol, &[1.5], Drive::autonomous(0.05, 300).unwrap());
        let twin: Arc<dyn StateSpace> = Arc::new(VanDerPol);
        let held = Beliefs {
            known: ["x2".to_owned()].into(),
            starts: ["x1".to_owned()].into(),
            ..beliefs(0.05)
        };
        let measured = measured_equations(&twin, std::slice::from_ref(&record), &held).unwrap();
        let names: Vec<&str> = (measured.levels.iter())
            .map(|l| l.parameter.name.as_str())
            .collect();
        assert_eq!(names, ["noise.x1", "noise.y"]);
        let y = deviation(&record.outputs().column(0).to_vec());
        assert!((measured.levels[1].median - SHARE * y).abs() < 1e-12);
        let theta: Vec<f64> = [1.5].into_iter().chain(medians(&measured)).collect();
        let now = Now::new(0.0, 0.05, &[], &theta);
        let mut std = [0.0; 2];
        measured
            .twin
            .equations()
            .unwrap()
            .start_deviation(&now, &mut std);
        assert!(std[0] == 0.0 && std[1] > 0.5, "{std:?}");
    }

    /// A start that is wide forgets what the twin said: the likelihood of a record that began elsewhere is finite and near that of the
    /// right start.
    #[test]
    fn a_wide_start_is_integrated() {
        let (twin, _) = tanks();
        let inputs = Signal::from_elem((200, 1), 1.5);
        let drive = Drive::new(0.5, inputs).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let begun = Signal::from_shape_fn((200, 1), |(k, _)| if k < 5 { 6.0 } else { 4.5 });
        let record = Record::new(drive, begun).unwrap();
        let wide = measured_equations(&twin, std::slice::from_ref(&record), &beliefs(0.5)).unwrap();
        let held = Beliefs {
            starts: ["h1".to_owned(), "h2".to_owned()].into(),
            ..beliefs(0.5)
        };
        let known = measured_equations(&twin, std::slice::from_ref(&record), &held).unwrap();
        let settings = FilterSettings::default();
        let log_likelihood = |m: &Measured| {
            let theta: Vec<f64> = theta.iter().copied().chain(medians(m)).collect();
            let kalman = Kalman::new(m.twin.equations().unwrap(), &record, &settings).unwrap();
            kalman.log_likelihood(&theta).unwrap()
        };
        assert!(log_likelihood(&wide) > log_likelihood(&known) + 100.0);
    }
}
