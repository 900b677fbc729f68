//! A state-space twin with effects.

use super::outliers::strike;
use super::{Place, Placed, Slots};
use crate::effect::law::{
    ForceLaw, ForcePoint, Instant, Law, LimitLaw, NOISE_ENTERS, NoiseLaw, ParameterLaw, SignalLaw,
};
use crate::record::{Quantity, Signal};
use crate::twin::{Modify, Noise, Now, Outliers, Outline, SimulationError, StateSpace};
use smallvec::SmallVec;
use std::ops::Range;
use std::sync::Arc;

/// Short vectors that stay on the stack in the simulation loop.
type Short = SmallVec<[f64; 16]>;

/// Equations with effects. The state is the base twin's, then one held value for each input (where an
/// actuator effect stands), then the memories of the signal effects; the added ones carry no noise.
pub(super) struct AugmentedEquations {
    base: Arc<dyn StateSpace>,
    slots: Slots,
    /// Number of the base twin's states.
    states: usize,
    /// Held inputs in the state; empty without actuator effects.
    held: Range<usize>,
    sensors: Vec<OnSignal>,
    actuators: Vec<OnSignal>,
    forces: Vec<Placed<ForceLaw>>,
    ceilings: Vec<Placed<LimitLaw>>,
    parameters: Vec<Placed<ParameterLaw>>,
    process: Vec<Placed<NoiseLaw>>,
    measurement: Vec<Placed<NoiseLaw>>,
    outline: Outline,
}

/// A signal effect and its memory in the state.
struct OnSignal {
    law: Arc<SignalLaw>,
    at: Place,
    memory: Range<usize>,
    after_noise: bool,
}

impl AugmentedEquations {
    pub(super) fn new(base: Arc<dyn StateSpace>, slots: Slots) -> Self {
        let mut outline = base.outline();
        let (states, inputs) = (outline.states.len(), outline.inputs.len());
        outline.parameters = slots.space(&outline.parameters);
        let any_actuator = (slots.all.iter()).any(|s| matches!(s.effect.law(), Law::Actuator(_)));
        let held = states..states + if any_actuator { inputs } else { 0 };
        let hidden = |name: String| Quantity::new(&name, "");
        for j in 1..=held.len() {
            outline.states.push(hidden(format!("held/{j}")));
        }
        let mut signals = |pick: fn(&Law) -> Option<&Arc<SignalLaw>>| {
            let mut placed = Vec::new();
            for slot in &slots.all {
                let Some(law) = pick(slot.effect.law()) else {
                    continue;
                };
                let from = outline.states.len();
                for k in 0..slot.place.memory {
                    outline
                        .states
                        .push(hidden(format!("{}/{k}", slot.effect.key())));
                }
                placed.push(OnSignal {
                    law: law.clone(),
                    at: slot.place.clone(),
                    memory: from..outline.states.len(),
                    after_noise: slot.effect.kind().position() > NOISE_ENTERS,
                });
            }
            placed
        };
        let sensors = signals(|law| match law {
            Law::Sensor(law) => Some(law),
            _ => None,
        });
        let actuators = signals(|law| match law {
            Law::Actuator(law) => Some(law),
            _ => None,
        });
        Self {
            states,
            held,
            sensors,
            actuators,
            forces: slots.of_law(|law| match law {
                Law::Force(law) => Some(law),
                _ => None,
            }),
            ceilings: slots.of_law(|law| match law {
                Law::Limit(law) => Some(law),
                _ => None,
            }),
            parameters: slots.of_law(|law| match law {
                Law::Parameter(law) => Some(law),
                _ => None,
            }),
            process: slots.of_law(|law| match law {
                Law::ProcessNoise(law) => Some(law),
                _ => None,
            }),
            measurement: slots.of_law(|law| match law {
                Law::MeasurementNoise(law) => Some(law),
                _ => None,
            }),
            outline,
            base,
            slots,
        }
    }

    /// Calls `with` with the base twin and its own `Now`: its part of θ, bent by the parameter effects, and inputs `u`.
    #[inline]
    fn inner<R>(
        &self,
        now: &Now<'_>,
        u: &[f64],
        with: impl FnOnce(&dyn StateSpace, &Now<'_>) -> R,
    ) -> R {
        let own = &now.theta[..self.slots.base];
        let base = self.base.as_ref();
        if self.parameters.is_empty() {
            return with(
                base,
                &Now {
                    u,
                    theta: own,
                    ..*now
                },
            );
        }
        let mut theta = Short::from_slice(own);
        for Placed { law, at } in &self.parameters {
            let value = &mut theta[at.target];
            *value = law(at.m(now.theta), now.t, *value);
        }
        let now = Now {
            u,
            theta: &theta,
            ..*now
        };
        with(base, &now)
    }

    /// The inputs of this sample behind the actuator effects; advances their memories in `x`.
    fn actuate(&self, now: &Now<'_>, x: &mut [f64]) -> Short {
        let mut u = Short::from_slice(now.u);
        for actuator in &self.actuators {
            actuator.pass(now, &mut x[actuator.memory.clone()], &mut u);
        }
        u
    }

    /// Passes `y` through the sensor effects before (or after) the noise; advances their memories in `x`.
    fn sense(&self, now: &Now<'_>, x: &mut [f64], y: &mut [f64], after_noise: bool) {
        for sensor in &self.sensors {
            if sensor.after_noise == after_noise {
                // After the noise nobody remembers, and `x` is empty.
                let memory = x.get_mut(sensor.memory.clone()).unwrap_or_default();
                sensor.pass(now, memory, y);
            }
        }
    }
}

impl OnSignal {
    /// Passes its channel of a sample through the effect.
    #[inline]
    fn pass(&self, now: &Now<'_>, memory: &mut [f64], channels: &mut [f64]) {
        let instant = Instant {
            t: now.t,
            dt: now.dt,
        };
        let value = &mut channels[self.at.target];
        *value = (self.law)(self.at.m(now.theta), instant, memory, *value);
    }

    /// Fills the memory with the first value of the channel, and passes that through the effect.
    fn begin(&self, now: &Now<'_>, x: &mut [f64], channels: &mut [f64]) {
        let memory = &mut x[self.memory.clone()];
        memory.fill(channels[self.at.target]);
        self.pass(now, &mut Short::from_slice(memory), channels);
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

    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let (base, added) = dx.split_at_mut(self.states);
        added.fill(0.0);
        // Inputs as the effects left them at the last sample.
        let u = if self.held.is_empty() {
            now.u
        } else {
            &x[self.held.clone()]
        };
        let states = &x[..self.states];
        self.inner(now, u, |twin, own| {
            twin.drift(own, states, base);
            for Placed { law, at } in &self.forces {
                let point = ForcePoint {
                    x: x[at.target],
                    other: at.other.map_or(0.0, |j| x[j]),
                    t: own.t,
                    states,
                    u: own.u,
                    theta: own.theta,
                };
                base[at.target] += law(at.m(now.theta), &point);
            }
        });
    }

    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let own = &x[..self.states];
        if self.actuators.is_empty() && self.sensors.is_empty() {
            return self.inner(now, now.u, |twin, now| twin.observe(now, own, y));
        }
        // Memories advance in `update`, once a sample; looking changes nothing.
        let mut scratch = Short::from_slice(x);
        let u = self.actuate(now, &mut scratch);
        self.inner(now, &u, |twin, now| twin.observe(now, own, y));
        self.sense(now, &mut scratch, y, false);
    }

    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.inner(now, now.u, |twin, now| twin.readout(now, y));
        self.sense(now, &mut [], y, true);
    }

    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        x.fill(0.0);
        let mut u = Short::from_slice(now.u);
        for actuator in &self.actuators {
            actuator.begin(now, x, &mut u);
        }
        if !self.held.is_empty() {
            x[self.held.clone()].copy_from_slice(&u);
        }
        let mut y = Short::from_elem(0.0, self.outline.outputs.len());
        self.inner(now, &u, |twin, now| {
            let x = &mut x[..self.states];
            twin.start(now, x);
            twin.observe(now, x, &mut y);
        });
        for sensor in &self.sensors {
            sensor.begin(now, x, &mut y);
        }
    }

    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        if self.actuators.is_empty() && self.sensors.is_empty() {
            return self.inner(now, now.u, |twin, now| {
                twin.update(now, &mut x[..self.states]);
            });
        }
        let u = self.actuate(now, x);
        if !self.held.is_empty() {
            x[self.held.clone()].copy_from_slice(&u);
        }
        if !self.sensors.is_empty() {
            let mut y = Short::from_elem(0.0, self.outline.outputs.len());
            self.inner(now, &u, |twin, now| {
                twin.observe(now, &x[..self.states], &mut y);
            });
            self.sense(now, x, &mut y, false);
        }
        self.inner(now, &u, |twin, now| twin.update(now, &mut x[..self.states]));
    }

    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.inner(now, now.u, |twin, now| {
            twin.noise(now, &mut process[..self.states], measurement);
        });
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

    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        for Placed { law, at } in &self.ceilings {
            let (i, j) = (at.target, at.other.filter(|j| *j != at.target));
            let mut value = x[i];
            law(at.m(now.theta), &mut value, j.map(|j| &mut x[j]));
            x[i] = value;
        }
        self.inner(now, now.u, |twin, now| {
            twin.constrain(now, &mut x[..self.states]);
        });
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

    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.theta(theta, |theta| {
            self.base.corrupt_outputs(theta, noise, outputs);
        });
        for slot in &self.slots.all {
            strike(slot, theta, noise, outputs);
        }
    }
}
