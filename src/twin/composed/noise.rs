//! Noise levels and starts: of composed equations, from outside a twin, from a record.

use super::{Composed, Disturbance, FittedLevels, Law, LevelSource, LevelValue, TwinPart};
use crate::math::{Condition, Lanes, Number};
use crate::twin::Now;
use crate::twin::points::noise_lanes;
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
            let in_proportion = |output: usize, share: LevelValue, measurement: &mut [f64]| {
                let share = share.value(now.theta);
                if share != 0.0 {
                    let mut y: SmallVec<[f64; 4]> = SmallVec::from_elem(0.0, measurement.len());
                    self.observe(now, x, &mut y);
                    measurement[output] += share * y[output].abs();
                }
            };
            let now = std::slice::from_ref(now);
            self.join_levels(now, (process, measurement), in_proportion);
        });
    }

    /// Noise levels of the states `x`, four at most, and the output of several filters, one a lane.
    pub(crate) fn noise_lanes(
        &self,
        now: &[Now<'_>],
        x: &[Lanes],
        process: &mut [Lanes],
        measurement: &mut Lanes,
    ) {
        let parts = &self.parts;
        if parts.acts.on_parameters || parts.acts.in_proportion || parts.is_late() {
            let noise = |now: &Now<'_>, x: &[f64], q: &mut [f64], r: &mut [f64]| {
                self.noise(now, x, q, r);
            };
            return noise_lanes(process.len(), now, x, (process, measurement), noise);
        }
        let (own, added) = process.split_at_mut(parts.states);
        added.fill(Lanes::ZERO);
        self.lanes_in_step(now, parts.noise_step, |now| {
            let x = &x[..parts.states];
            self.own.noise_lanes(now, x, own, measurement);
        });
        let levels = (process, std::slice::from_mut(measurement));
        self.join_levels(now, levels, |_, _, _| {});
    }

    /// Changes the twin's own levels of states and outputs as parts say, one `now` a lane; `in_proportion` adds a share of an output.
    fn join_levels<N: Number>(
        &self,
        now: &[Now<'_>],
        (process, measurement): (&mut [N], &mut [N]),
        in_proportion: impl Fn(usize, LevelValue, &mut [N]),
    ) {
        let parts = &self.parts;
        if !(parts.acts.on_noise || parts.acts.in_levels) {
            return;
        }
        let of = |value: &dyn Fn(&Now<'_>) -> f64| {
            N::of_lanes(|lane| value(now.get(lane).unwrap_or(&now[0])))
        };
        for added in &parts.list {
            let dt = || of(&|now| added.step.unwrap_or(now.dt));
            match &added.part {
                TwinPart::Law(part) => match &part.law {
                    Law::ProcessNoise(law) => {
                        join(&mut process[part.target], of(&|now| law(part.m(now.theta))));
                    }
                    Law::MeasurementNoise(law) => {
                        join(
                            &mut measurement[part.target],
                            of(&|now| law(part.m(now.theta))),
                        );
                    }
                    _ => {}
                },
                TwinPart::Level {
                    is_process,
                    target,
                    level,
                    step,
                } => {
                    let value = of(&|now| level.value(now.theta));
                    match is_process {
                        // Variances add up over time: another step is not another physics.
                        true => process[*target] = of_step(value, dt(), *step),
                        false => measurement[*target] = value,
                    }
                }
                TwinPart::Levels(levels) => {
                    let theta = |entry: usize| of(&|now| now.theta[entry]);
                    levels.set(dt(), theta, process, measurement);
                }
                TwinPart::Share { output, share } => in_proportion(*output, *share, measurement),
                TwinPart::Late(_) => {
                    let share = of(&|now| parts.moving(now, added.delays).map_or(1.0, f64::sqrt));
                    process.iter_mut().for_each(|q| *q = *q * share);
                }
                TwinPart::Disturbance(part) => {
                    let share = Disturbance::share(part.memory);
                    process[added.states.start] = of(&|now| share * now.theta[part.sigma]);
                }
                TwinPart::Unit(factor) => measurement.iter_mut().for_each(|r| *r = *r * *factor),
                _ => {}
            }
        }
    }
}

/// Returns the level of an increment in `dt` seconds that is `level` in `step`.
fn of_step<N: Number>(level: N, dt: N, step: f64) -> N {
    let step = N::all(step);
    // Roots of eight numbers a row cost a tenth of a filter.
    match (dt.below(step) | step.below(dt)).any() {
        true => level * (dt / step).sqrt(),
        false => level,
    }
}

/// Joins a standard deviation to a level.
fn join<N: Number>(level: &mut N, added: N) {
    let both = |(level, added): (f64, f64)| match added {
        // hypot is not exact for a zero side; off must be.
        0.0 => level,
        _ => level.hypot(added),
    };
    *level = N::of_lanes(|lane| both((level.lane(lane), added.lane(lane))));
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
        for (level, source) in process.iter_mut().zip(&self.process) {
            *level = match *source {
                LevelSource::Declared => of_step(*level, dt, self.step),
                LevelSource::Fitted { entry, declared } if declared > 0.0 => {
                    of_step(*level, dt, self.step) * (theta(entry) / N::all(declared))
                }
                LevelSource::Fitted { entry, .. } => theta(entry) * dt.sqrt(),
                LevelSource::Follows { entry, share } => theta(entry) * share * dt.sqrt(),
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
