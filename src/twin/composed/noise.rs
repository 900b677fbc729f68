//! Noise levels and starts: of composed equations, from outside a twin, from a record.

use super::{Composed, Disturbance, FittedLevels, Law, LevelSource, TwinPart};
use crate::math::Number;
use crate::twin::Now;
use smallvec::SmallVec;

impl Composed {
    /// Sets the standard deviations of the increment of each state in a step, and of each output, at the states `x`; both come zeroed.
    pub fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        let parts = &self.parts;
        self.resolved(now, |now| {
            let dt = parts.noise_step.unwrap_or(now.dt);
            self.inside(&Now { dt, ..*now }, Some(x), |own| {
                let own_states = &mut process[..parts.states];
                (self.own).noise(own, &x[..parts.states], own_states, measurement);
            });
            if !(parts.acts.on_noise || parts.acts.in_levels) {
                return;
            }
            for added in &parts.list {
                let dt = added.step.unwrap_or(now.dt);
                let now = &Now { dt, ..*now };
                match &added.part {
                    TwinPart::Law(part) => {
                        let m = part.m(now.theta);
                        match &part.law {
                            Law::ProcessNoise(law) => join(&mut process[part.target], law(m)),
                            Law::MeasurementNoise(law) => {
                                join(&mut measurement[part.target], law(m));
                            }
                            _ => {}
                        }
                    }
                    TwinPart::Level {
                        is_process,
                        target,
                        level,
                        step,
                    } => {
                        let value = level.value(now.theta);
                        match is_process {
                            // Variances add up over time: another step is not another physics.
                            true => process[*target] = value * (dt / step).sqrt(),
                            false => measurement[*target] = value,
                        }
                    }
                    TwinPart::Levels(levels) => {
                        levels.set(now.dt, |entry| now.theta[entry], process, measurement);
                    }
                    TwinPart::Share { output, share } => {
                        let share = share.value(now.theta);
                        if share != 0.0 {
                            let mut y: SmallVec<[f64; 4]> =
                                SmallVec::from_elem(0.0, measurement.len());
                            self.observe(now, x, &mut y);
                            measurement[*output] += share * y[*output].abs();
                        }
                    }
                    TwinPart::Late(_) => {
                        if let Some(share) = parts.moving(now, added.delays) {
                            process.iter_mut().for_each(|q| *q *= share.sqrt());
                        }
                    }
                    TwinPart::Disturbance(part) => {
                        let share = Disturbance::share(part.memory);
                        process[added.states.start] = share * now.theta[part.sigma];
                    }
                    TwinPart::Unit(factor) => measurement.iter_mut().for_each(|r| *r *= factor),
                    _ => {}
                }
            }
        });
    }
}

/// Joins a standard deviation to a level.
fn join(level: &mut f64, added: f64) {
    // hypot is not exact for a zero side; off must be.
    if added != 0.0 {
        *level = level.hypot(added);
    }
}

impl FittedLevels {
    /// Puts fitted levels in the place of declared ones, which are those of the study's step: variances add up over time. `theta` gives an entry.
    pub fn set<N: Number>(
        &self,
        dt: N,
        theta: impl Fn(usize) -> N,
        process: &mut [N],
        measurement: &mut [N],
    ) {
        let (per_step, per_second) = ((dt / N::all(self.step)).sqrt(), dt.sqrt());
        for (level, source) in process.iter_mut().zip(&self.process) {
            *level = match *source {
                LevelSource::Declared => *level * per_step,
                LevelSource::Fitted { entry, declared } if declared > 0.0 => {
                    *level * per_step * (theta(entry) / N::all(declared))
                }
                LevelSource::Fitted { entry, .. } => theta(entry) * per_second,
                LevelSource::Follows { entry, share } => theta(entry) * share * per_second,
            };
        }
        for (level, source) in measurement.iter_mut().zip(&self.measurement) {
            *level = match *source {
                LevelSource::Declared => *level,
                LevelSource::Fitted { entry, declared } if declared > 0.0 => {
                    *level * (theta(entry) / N::all(declared))
                }
                LevelSource::Fitted { entry, .. } => theta(entry),
                LevelSource::Follows { entry, share } => theta(entry) * share,
            };
        }
    }
}
