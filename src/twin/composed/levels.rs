//! Noise levels and starts that come from outside a twin.

use crate::twin::Now;

/// A start or noise level.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Setting {
    Known(f64),
    /// Entry of θ.
    Parameter(usize),
}

impl Setting {
    /// Returns its value.
    pub fn value(self, theta: &[f64]) -> f64 {
        match self {
            Self::Known(value) => value,
            Self::Parameter(entry) => theta[entry],
        }
    }
}

/// Origin of a noise level.
#[derive(Debug, Clone, Copy)]
pub(crate) enum LevelSource {
    /// The twin.
    Declared,
    /// An entry of θ; the twin's own level, in the parameter's unit, says how it depends on time and θ.
    Fitted { entry: usize, declared: f64 },
}

/// Noise levels of states and outputs that a record fits.
#[derive(Debug, Clone)]
pub(crate) struct FittedLevels {
    /// Step of the study, in seconds: declared levels of states are those of an increment in it.
    pub step: f64,
    pub process: Vec<LevelSource>,
    pub measurement: Vec<LevelSource>,
}

impl FittedLevels {
    /// Puts fitted levels in the place of declared ones, which are those of the study's step: variances add up over time.
    pub fn set(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        let (per_step, per_second) = ((now.dt / self.step).sqrt(), now.dt.sqrt());
        for (level, source) in process.iter_mut().zip(&self.process) {
            *level = match *source {
                LevelSource::Declared => *level * per_step,
                LevelSource::Fitted { entry, declared } if declared > 0.0 => {
                    *level * per_step * (now.theta[entry] / declared)
                }
                LevelSource::Fitted { entry, .. } => now.theta[entry] * per_second,
            };
        }
        for (level, source) in measurement.iter_mut().zip(&self.measurement) {
            match *source {
                LevelSource::Declared => {}
                LevelSource::Fitted { entry, declared } if declared > 0.0 => {
                    *level *= now.theta[entry] / declared;
                }
                LevelSource::Fitted { entry, .. } => *level = now.theta[entry],
            }
        }
    }
}
