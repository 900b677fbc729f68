//! A state-space twin with effects.

use super::finish::finish;
use super::{Place, Placed, Slots};
use crate::effect::batch::{Batch, Channel, ForceBatch, LimitBatch, SensorBatch};
use crate::effect::law::{ForcePoint, Instant, Law, NoiseLaw, ParameterLaw};
use crate::effect::library::whole_samples;
use crate::record::{Drive, Quantity, Signal};
use crate::twin::{Layout, Modify, Noise, Now, Outliers, Outline, SimulationError, StateSpace};
use smallvec::SmallVec;
use std::sync::Arc;

/// Short vectors that stay on the stack in the simulation loop.
type Short = SmallVec<[f64; SHORT]>;
const SHORT: usize = 16;

/// Equations with effects. The state is the base twin's, then the memories of the sensor effects, which carry no noise.
pub(super) struct AugmentedEquations {
    base: Arc<dyn StateSpace>,
    slots: Slots,
    /// Number of the base twin's states.
    states: usize,
    sensors: Vec<OnSensor>,
    /// Entries of θ by whose sum the whole twin is late, in seconds.
    late: Vec<usize>,
    forces: Vec<Placed<dyn ForceBatch>>,
    ceilings: Vec<Placed<dyn LimitBatch>>,
    parameters: Vec<Placed<ParameterLaw>>,
    process: Vec<Placed<NoiseLaw>>,
    measurement: Vec<Placed<NoiseLaw>>,
    outline: Outline,
}

/// A sensor effect and its memory in the state.
struct OnSensor {
    law: Arc<dyn SensorBatch>,
    at: Place,
    channel: Channel,
    after_noise: bool,
    is_dead_time: bool,
}

/// Values that a dead time keeps as states: it reads between two of them, and is moved by less than a sample where a filter differentiates.
const BETWEEN_SAMPLES: usize = 3;

impl AugmentedEquations {
    pub(super) fn new(base: Arc<dyn StateSpace>, slots: Slots) -> Self {
        let mut outline = base.outline();
        let states = outline.states.len();
        outline.parameters = slots.space(&outline.parameters);
        let mut sensors = Vec::new();
        let mut late = Vec::new();
        for slot in &slots.all {
            if slot.place.late {
                late.push(slot.place.magnitudes.start);
                continue;
            }
            let kind = slot.effect.kind();
            let Batch::Sensor(law) = kind.over_points() else {
                continue;
            };
            let from = outline.states.len();
            let memory = match kind.is_dead_time() {
                true => BETWEEN_SAMPLES,
                false => kind.memory_values(),
            };
            let names = (0..memory).map(|k| format!("{}/{k}", slot.effect.key()));
            outline
                .states
                .extend(names.map(|name| Quantity::new(&name, "")));
            sensors.push(OnSensor {
                law: law.clone(),
                at: slot.place.clone(),
                channel: Channel {
                    memory: from..outline.states.len(),
                    target: slot.place.target,
                },
                after_noise: slot.is_of_readings(),
                is_dead_time: kind.is_dead_time(),
            });
        }
        Self {
            states,
            sensors,
            late,
            forces: slots.of_law(|kind| match kind.over_points() {
                Batch::Force(law) => Some(law),
                _ => None,
            }),
            ceilings: slots.of_law(|kind| match kind.over_points() {
                Batch::Limit(law) => Some(law),
                _ => None,
            }),
            parameters: slots.of_law(|kind| match kind.law() {
                Law::Parameter(law) => Some(law),
                _ => None,
            }),
            process: slots.of_law(|kind| match kind.law() {
                Law::ProcessNoise(law) => Some(law),
                _ => None,
            }),
            measurement: slots.of_law(|kind| match kind.law() {
                Law::MeasurementNoise(law) => Some(law),
                _ => None,
            }),
            outline,
            base,
            slots,
        }
    }

    /// Calls `with` with the base twin and its own `Now`: its part of θ, bent by the parameter effects, and its own time.
    #[inline]
    fn inner<R>(&self, now: &Now<'_>, with: impl FnOnce(&dyn StateSpace, &Now<'_>) -> R) -> R {
        let own = &now.theta[..self.slots.base];
        let base = self.base.as_ref();
        let t = match self.late.is_empty() {
            true => now.t,
            false => (now.t - self.delay(now.theta)).max(0.0),
        };
        let now = &Now { t, ..*now };
        if self.parameters.is_empty() {
            return with(base, &Now { theta: own, ..*now });
        }
        let mut theta = Short::from_slice(own);
        for Placed { law, at } in &self.parameters {
            let value = &mut theta[at.target];
            *value = law(at.m(now.theta), now.t, *value);
        }
        let theta = &theta[..];
        with(base, &Now { theta, ..*now })
    }

    /// Seconds by which the whole twin is late.
    fn delay(&self, theta: &[f64]) -> f64 {
        self.late.iter().map(|&j| theta[j]).sum()
    }

    /// Share of a step in which a late twin moves; `None` for all of it.
    #[inline]
    fn moving(&self, now: &Now<'_>) -> Option<f64> {
        let share = match self.late.is_empty() {
            true => 1.0,
            false => (now.t + now.dt - self.delay(now.theta)) / now.dt,
        };
        (share < 1.0).then_some(share.max(0.0))
    }

    /// Adds the forces to the rates. `inner` is the base twin's.
    #[inline]
    fn push(&self, now: &Now<'_>, inner: &Now<'_>, own: Layout, x: &[f64], dx: &mut [f64]) {
        for Placed { law, at } in &self.forces {
            let point = ForcePoint {
                x: 0.0,
                other: 0.0,
                t: inner.t,
                states: &[],
                u: inner.u,
                theta: inner.theta,
            };
            law.push(at.m(now.theta), at.pair(), &point, own, x, dx);
        }
    }

    /// Sets the base twin's states by `base`, then fills the memories with the first values of their signals.
    fn set_out(
        &self,
        now: &Now<'_>,
        x: &mut [f64],
        base: impl FnOnce(&dyn StateSpace, &Now<'_>, &mut [f64]),
    ) {
        let mut y = Short::from_elem(0.0, self.outline.outputs.len());
        self.inner(now, |twin, now| {
            let x = &mut x[..self.states];
            base(twin, now, x);
            twin.observe(now, x, &mut y);
        });
        for sensor in &self.sensors {
            sensor.begin(now, x, &mut y);
        }
    }

    /// Sensor effects before the noise, or after it.
    fn sensors(&self, after_noise: bool) -> impl Iterator<Item = &OnSensor> {
        (self.sensors.iter()).filter(move |sensor| sensor.after_noise == after_noise)
    }

    /// Advances the memories of the sensor effects; `observe` gives the outputs of points, so many at once that they need no heap.
    fn remember(
        &self,
        now: &Now<'_>,
        at: Layout,
        x: &mut [f64],
        observe: impl Fn(&[f64], &mut [f64]),
    ) {
        let p = self.outline.outputs.len();
        let mut outputs = [0.0; SHORT];
        let mut heap = vec![0.0; if p > SHORT { p } else { 0 }];
        let y = if p > SHORT {
            &mut heap
        } else {
            &mut outputs[..]
        };
        for x in x.chunks_mut(SHORT / p.min(SHORT) * at.stride) {
            let y = &mut y[..x.len() / at.stride * p];
            observe(x, y);
            for sensor in self.sensors(false) {
                sensor.pass(now, (at, x), (p, y));
            }
        }
    }
}

impl OnSensor {
    /// Calls `then` with its magnitudes; a dead time loses its whole samples.
    #[inline]
    fn magnitudes<R>(&self, now: &Now<'_>, then: impl FnOnce(&[f64]) -> R) -> R {
        let m = self.at.m(now.theta);
        match self.is_dead_time {
            true => then(&[m[0] - whole_samples(m[0], now.dt) as f64 * now.dt]),
            false => then(m),
        }
    }

    /// Passes its channel of points through the effect; advances its memory.
    fn pass(&self, now: &Now<'_>, states: (Layout, &mut [f64]), channels: (usize, &mut [f64])) {
        self.magnitudes(now, |m| {
            (self.law).pass(m, instant(now), &self.channel, states, channels);
        });
    }

    /// As [`pass`](Self::pass), the memory left as it is.
    fn peek(&self, now: &Now<'_>, states: (Layout, &[f64]), channels: (usize, &mut [f64])) {
        self.magnitudes(now, |m| {
            (self.law).peek(m, instant(now), &self.channel, states, channels);
        });
    }

    /// As [`pass`](Self::pass) of an effect without memory; returns whether any value changed.
    fn read(&self, now: &Now<'_>, channels: (usize, &mut [f64])) -> bool {
        let m = self.at.m(now.theta);
        (self.law).read(m, instant(now), self.channel.target, channels)
    }

    /// Fills the memory with the first value of the channel, and passes that through the effect.
    fn begin(&self, now: &Now<'_>, x: &mut [f64], channels: &mut [f64]) {
        x[self.channel.memory.clone()].fill(channels[self.channel.target]);
        self.peek(now, (Layout::dense(x.len()), x), (channels.len(), channels));
    }
}

fn instant(now: &Now<'_>) -> Instant {
    Instant {
        t: now.t,
        dt: now.dt,
    }
}

impl Modify for AugmentedEquations {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }

    fn added(&self) -> usize {
        self.outline.states.len() - self.states
    }

    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&theta[..self.slots.base])
    }

    fn outline(&self) -> Outline {
        self.outline.clone()
    }

    fn drift_each(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        let own = at.without(self.added());
        if own.states < at.states {
            for dx in at.each_mut(dx) {
                dx[own.states..].fill(0.0);
            }
        }
        self.inner(now, |twin, inner| {
            twin.drift_each(inner, own, x, dx);
            self.push(now, inner, own, x, dx);
        });
        if let Some(share) = self.moving(now) {
            dx.iter_mut().for_each(|dx| *dx *= share);
        }
    }

    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        let own = at.without(self.added());
        self.inner(now, |twin, now| twin.observe_each(now, own, p, x, y));
        // Memories advance in `update`, once a sample; looking changes nothing.
        for sensor in self.sensors(false) {
            sensor.peek(now, (at, x), (p, y));
        }
    }

    fn readout_each(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool {
        let mut changed = self.inner(now, |twin, now| twin.readout_each(now, p, y));
        for sensor in self.sensors(true) {
            // After the noise nobody remembers.
            changed |= sensor.read(now, (p, y));
        }
        changed
    }

    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        x.fill(0.0);
        self.set_out(now, x, |twin, now, x| twin.start(now, x));
    }

    fn begin(&self, now: &Now<'_>, x: &mut [f64]) {
        self.set_out(now, x, |twin, now, x| twin.begin(now, x));
    }

    fn update_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        let own = at.without(self.added());
        self.inner(now, |twin, inner| {
            if !self.sensors.is_empty() {
                let p = self.outline.outputs.len();
                let observe = |x: &[f64], y: &mut [f64]| twin.observe_each(inner, own, p, x, y);
                self.remember(now, at, x, observe);
            }
            // What moves at samples only waits for a whole one.
            if self.moving(now).is_none_or(|share| share >= 0.5) {
                twin.update_each(inner, own, x);
            }
        });
    }

    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.inner(now, |twin, now| {
            twin.noise(now, &mut process[..self.states], measurement);
        });
        if let Some(share) = self.moving(now) {
            process.iter_mut().for_each(|q| *q *= share.sqrt());
        }
        for (added, levels) in [(&self.process, process), (&self.measurement, measurement)] {
            for Placed { law, at } in added {
                let level = &mut levels[at.target];
                let added = law(at.m(now.theta));
                // hypot is not exact for a zero side; off must be.
                if added != 0.0 {
                    *level = level.hypot(added);
                }
            }
        }
    }

    fn constrain_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        for Placed { law, at: place } in &self.ceilings {
            law.hold(place.m(now.theta), place.pair(), at, x);
        }
        let own = at.without(self.added());
        self.inner(now, |twin, now| twin.constrain_each(now, own, x));
    }

    fn actuated(&self, theta: &[f64], drive: &Drive) -> Result<Option<Drive>, SimulationError> {
        let mut own = self.slots.actuated(theta, drive)?;
        if !self.late.is_empty() {
            let acting = own.as_ref().unwrap_or(drive);
            let late = acting.late(self.delay(theta));
            own = Some(late.map_err(|error| SimulationError::Fatal(error.into()))?);
        }
        let acting = own.as_ref().unwrap_or(drive);
        let inner = self.theta(theta, |theta| self.base.actuated(theta, acting))?;
        Ok(inner.or(own))
    }

    fn dead_time(&self, theta: &[f64], dt: f64) -> Vec<usize> {
        let mut all = self.theta(theta, |theta| self.base.dead_time(theta, dt));
        for sensor in self.sensors.iter().filter(|sensor| sensor.is_dead_time) {
            all.resize(self.outline.outputs.len(), 0);
            all[sensor.channel.target] += whole_samples(sensor.at.m(theta)[0], dt);
        }
        all
    }

    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.theta(theta, |theta| self.base.check_parameters(theta, dt))?;
        self.slots.check(theta, dt)
    }

    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        let mut all = self.theta(theta, |theta| self.base.outliers(theta));
        for slot in &self.slots.all {
            let Law::Outliers(law) = slot.effect.law() else {
                continue;
            };
            let own = law(slot.place.m(theta));
            all.resize(self.outline.outputs.len(), Outliers::default());
            let both = &mut all[slot.place.target];
            // Both are rare: their probabilities add up, and the larger ones are seen.
            both.probability += own.probability;
            both.scale = both.scale.max(own.scale);
        }
        all
    }

    fn rounding(&self, theta: &[f64]) -> Vec<f64> {
        let mut all = self.theta(theta, |theta| self.base.rounding(theta));
        for slot in &self.slots.all {
            let Law::Rounding(law) = slot.effect.law() else {
                continue;
            };
            all.resize(self.outline.outputs.len(), 0.0);
            let step = &mut all[slot.place.target];
            *step = step.max(law(slot.place.m(theta)));
        }
        all
    }

    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.theta(theta, |theta| {
            self.base.corrupt_outputs(theta, noise, outputs);
        });
        for slot in &self.slots.all {
            finish(slot, theta, noise, outputs);
        }
    }
}
