//! Equations with noise levels in θ.

use crate::twin::{Modify, Now, Outline, StateSpace};
use std::sync::Arc;

/// Where a noise level comes from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source {
    /// The twin.
    Declared,
    /// An entry of θ; the twin's own level, in the parameter's unit, says how it depends on time and θ.
    Fitted { parameter: usize, declared: f64 },
}

/// Equations with fitted noise levels and an uncertain start.
pub(super) struct MeasuredEquations {
    pub base: Arc<dyn StateSpace>,
    pub outline: Outline,
    /// Length of the base twin's θ.
    pub own: usize,
    pub step: f64,
    pub process: Vec<Source>,
    pub measurement: Vec<Source>,
    /// Deviation of each start that is not declared.
    pub starts: Vec<Option<f64>>,
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
