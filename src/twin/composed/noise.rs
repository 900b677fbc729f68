//! Noise levels and starts: of composed equations, from outside a twin, from a record.

use super::{Composed, Disturbance, FittedLevels, Law, LevelSource, LevelValue, TwinPart};
use crate::math::{Condition, Lanes, Number};
use crate::twin::Now;
use crate::twin::points::{LanePlaces, noise_lanes};
use smallvec::SmallVec;

/// Numbers by which parts set noise levels at θ of each lane, in the order of the parts: the same in all rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LevelFactors<N>(SmallVec<[N; 8]>);

impl Composed {
    /// Sets the standard deviations of the increment of each state in a step, and of each output, at the states `x`; both come zeroed.
    pub fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        self.resolved(now, |now| {
            let factors = self.level_factors(|_| now.theta);
            self.noise_by(&factors, now, x, (process, measurement));
        });
    }

    /// As [`noise`](Self::noise), with all of θ and the factors of the parts there.
    pub(crate) fn noise_by(
        &self,
        factors: &LevelFactors<f64>,
        now: &Now<'_>,
        x: &[f64],
        (process, measurement): (&mut [f64], &mut [f64]),
    ) {
        self.own_noise(now, x, process, measurement);
        let in_proportion = |output: usize, share: LevelValue, measurement: &mut [f64]| {
            let share = share.value(now.theta);
            if share != 0.0 {
                let mut y: SmallVec<[f64; 4]> = SmallVec::from_elem(0.0, measurement.len());
                self.observe(now, x, &mut y);
                measurement[output] += share * y[output].abs();
            }
        };
        let levels = (process, measurement);
        self.join_levels(factors, (now, now.dt), levels, in_proportion);
    }

    /// Levels of the twin's own equations; `now` has all of θ.
    fn own_noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        let parts = &self.parts;
        let dt = parts.noise_step.unwrap_or(now.dt);
        self.inside(&Now { dt, ..*now }, Some(x), |own| {
            let own_states = &mut process[..parts.states];
            (self.own).noise(own, &x[..parts.states], own_states, measurement);
        });
    }

    /// Noise levels of the states `x`, four at most, and the output of several filters, one a lane.
    pub(crate) fn noise_lanes(
        &self,
        factors: &LevelFactors<Lanes>,
        at: &mut LanePlaces<'_>,
        x: &[Lanes],
        (process, measurement): (&mut [Lanes], &mut Lanes),
    ) {
        let parts = &self.parts;
        let n = process.len();
        if parts.acts.in_proportion || parts.is_late() {
            let noise = |now: &Now<'_>, x: &[f64], q: &mut [f64], r: &mut [f64]| {
                self.noise(now, x, q, r);
            };
            return noise_lanes(n, at.whole(), x, (process, measurement), noise);
        }
        if parts.acts.on_parameters {
            let noise = |now: &Now<'_>, x: &[f64], q: &mut [f64], r: &mut [f64]| {
                self.own_noise(now, x, q, r);
            };
            noise_lanes(n, at.whole(), x, (&mut *process, &mut *measurement), noise);
        } else {
            let (own, added) = process.split_at_mut(parts.states);
            added.fill(Lanes::ZERO);
            at.own_in_step(parts.noise_step, |now| {
                (self.own).noise_lanes(now, &x[..parts.states], own, measurement);
            });
        }
        let now = at.whole();
        let dt = Lanes::of_lanes(|lane| now.get(lane).unwrap_or(&now[0]).dt);
        let levels = (process, std::slice::from_mut(measurement));
        self.join_levels(factors, (&now[0], dt), levels, |_, _, _| {});
    }

    /// Returns the factors by which parts set levels; `theta` gives all of θ of a lane.
    pub(crate) fn level_factors<'t, N: Number>(
        &self,
        theta: impl Fn(usize) -> &'t [f64],
    ) -> LevelFactors<N> {
        let mut factors = SmallVec::new();
        if !self.parts.changes_levels() {
            return LevelFactors(factors);
        }
        let mut add = |value: &dyn Fn(&[f64]) -> f64| {
            factors.push(N::of_lanes(|lane| value(theta(lane))));
        };
        for added in &self.parts.list {
            match &added.part {
                TwinPart::Law(part) => match &part.law {
                    Law::ProcessNoise(law) | Law::MeasurementNoise(law) => {
                        add(&|theta| law(part.m(theta)));
                    }
                    _ => {}
                },
                TwinPart::Level { level, .. } => add(&|theta| level.value(theta)),
                TwinPart::Levels(levels) => {
                    for source in levels.process.iter().chain(&levels.measurement) {
                        add(&|theta| source.factor(theta));
                    }
                }
                TwinPart::Disturbance(part) => {
                    let share = Disturbance::share(part.memory);
                    add(&|theta| share * theta[part.sigma]);
                }
                _ => {}
            }
        }
        LevelFactors(factors)
    }

    /// Changes the twin's own levels of states and outputs as parts say; `now` is the first lane's, `dt` the step of each, and `in_proportion` adds
    /// a share of an output.
    #[inline(always)]
    fn join_levels<N: Number>(
        &self,
        factors: &LevelFactors<N>,
        (now, dt): (&Now<'_>, N),
        (process, measurement): (&mut [N], &mut [N]),
        in_proportion: impl Fn(usize, LevelValue, &mut [N]),
    ) {
        let parts = &self.parts;
        if !parts.changes_levels() {
            return;
        }
        let mut factors = factors.0.iter().copied();
        let mut factor = || factors.next().unwrap_or(N::ZERO);
        for added in &parts.list {
            let dt = added.step.map_or(dt, N::all);
            match &added.part {
                TwinPart::Law(part) => match &part.law {
                    Law::ProcessNoise(_) => join(&mut process[part.target], factor()),
                    Law::MeasurementNoise(_) => join(&mut measurement[part.target], factor()),
                    _ => {}
                },
                TwinPart::Level {
                    is_process,
                    target,
                    step,
                    ..
                } => match is_process {
                    // Variances add up over time: another step is not another physics.
                    true => process[*target] = of_step(factor(), dt, *step),
                    false => measurement[*target] = factor(),
                },
                TwinPart::Levels(levels) => {
                    levels.set(dt, &mut factor, process, measurement);
                }
                TwinPart::Share { output, share } => in_proportion(*output, *share, measurement),
                TwinPart::Late(_) => {
                    let share = parts.moving(now, added.delays).map_or(1.0, f64::sqrt);
                    process.iter_mut().for_each(|q| *q = *q * share);
                }
                TwinPart::Disturbance(_) => process[added.states.start] = factor(),
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

impl LevelSource {
    /// Returns the factor of the twin's own level, or the level itself; that of a state for a step of 1 s.
    fn factor(self, theta: &[f64]) -> f64 {
        match self {
            Self::Declared => 1.0,
            Self::Fitted { entry, declared } if declared > 0.0 => theta[entry] / declared,
            Self::Fitted { entry, .. } => theta[entry],
            Self::Follows { entry, share } => theta[entry] * share,
        }
    }

    /// Returns whether the twin's own level says how it depends on time and θ.
    fn scales_own(self) -> bool {
        match self {
            Self::Declared => true,
            Self::Fitted { declared, .. } => declared > 0.0,
            Self::Follows { .. } => false,
        }
    }
}

impl FittedLevels {
    /// Puts fitted levels in the place of declared ones, which are those of the study's step: variances add up over time. `factor` gives that of
    /// one level after the other.
    #[inline(always)]
    fn set<N: Number>(
        &self,
        dt: N,
        mut factor: impl FnMut() -> N,
        process: &mut [N],
        measurement: &mut [N],
    ) {
        let mut root = None;
        for (level, source) in process.iter_mut().zip(&self.process) {
            *level = factor()
                * match source.scales_own() {
                    true => of_step(*level, dt, self.step),
                    false => *root.get_or_insert_with(|| of_step(N::all(1.0), dt, 1.0)),
                };
        }
        for (level, source) in measurement.iter_mut().zip(&self.measurement) {
            *level = factor()
                * match source.scales_own() {
                    true => *level,
                    false => N::all(1.0),
                };
        }
    }
}
