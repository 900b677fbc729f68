//! A state-space twin with effects.

use super::outliers::strike;
use super::{Slot, Slots};
use crate::effect::{Instant, Law, NOISE_ENTERS};
use crate::record::{Quantity, Signal as Record};
use crate::twin::{
    Integrator, Interval, Noise, Now, Outliers, Outline, SimulationError, StateSpace,
};
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
    sensors: Vec<Signal>,
    actuators: Vec<Signal>,
    forces: Vec<Slot>,
    ceilings: Vec<Slot>,
    parameters: Vec<Slot>,
    process: Vec<Slot>,
    measurement: Vec<Slot>,
    outline: Outline,
}

/// A signal effect and its memory in the state.
struct Signal {
    slot: Slot,
    memory: Range<usize>,
}

impl AugmentedEquations {
    /// `base` must show its equations.
    pub(super) fn new(base: Arc<dyn StateSpace>, slots: Slots) -> Self {
        let mut outline = base.outline();
        let (states, inputs) = (outline.states.len(), outline.inputs.len());
        outline.parameters = slots.space(&outline.parameters);
        let any_actuator = slots.with(Law::Actuator).next().is_some();
        let held = states..states + if any_actuator { inputs } else { 0 };
        let hidden = |name: String| Quantity::new(&name, "");
        for j in 1..=held.len() {
            outline.states.push(hidden(format!("held/{j}")));
        }
        let mut signals = |law| {
            let mut placed = Vec::new();
            for slot in slots.with(law).cloned() {
                let from = outline.states.len();
                for k in 0..slot.memory {
                    let (id, target) = (slot.effect.typetag_name(), slot.effect.target());
                    outline.states.push(hidden(format!("{id}@{target}/{k}")));
                }
                placed.push(Signal {
                    slot,
                    memory: from..outline.states.len(),
                });
            }
            placed
        };
        let (sensors, actuators) = (signals(Law::Sensor), signals(Law::Actuator));
        let of = |law| slots.with(law).cloned().collect();
        Self {
            states,
            held,
            sensors,
            actuators,
            forces: of(Law::Force),
            ceilings: of(Law::Limit),
            parameters: of(Law::Parameter),
            process: of(Law::ProcessNoise),
            measurement: of(Law::MeasurementNoise),
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
        for slot in &self.parameters {
            let value = &mut theta[slot.target];
            *value = slot.effect.parameter(slot.m(now.theta), now.t, *value);
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
        let instant = Instant {
            t: now.t,
            dt: now.dt,
        };
        let mut u = Short::from_slice(now.u);
        for Signal { slot, memory } in &self.actuators {
            let (m, value) = (slot.m(now.theta), &mut u[slot.target]);
            *value = slot
                .effect
                .signal(m, instant, &mut x[memory.clone()], *value);
        }
        u
    }

    /// Passes `y` through the sensor effects before (or after) the noise. Memories are read from `x`, and
    /// advanced in it when it is `keep`.
    fn sense(&self, now: &Now<'_>, memory: &mut [f64], y: &mut [f64], after_noise: bool) {
        for Signal { slot, memory: at } in &self.sensors {
            if (slot.effect.order() > NOISE_ENTERS) == after_noise {
                let (m, value) = (slot.m(now.theta), &mut y[slot.target]);
                let instant = Instant {
                    t: now.t,
                    dt: now.dt,
                };
                // After the noise nobody remembers, and `memory` is empty.
                let memory = memory.get_mut(at.clone()).unwrap_or_default();
                *value = slot.effect.signal(m, instant, memory, *value);
            }
        }
    }
}

impl StateSpace for AugmentedEquations {
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
        self.inner(now, u, |twin, now| twin.drift(now, &x[..self.states], base));
        for slot in &self.forces {
            let other = slot.other.map_or(0.0, |j| x[j]);
            base[slot.target] += slot
                .effect
                .force(slot.m(now.theta), now.t, x[slot.target], other);
        }
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
        let instant = Instant {
            t: now.t,
            dt: now.dt,
        };
        let mut u = Short::from_slice(now.u);
        for Signal { slot, memory } in &self.actuators {
            let (m, value) = (slot.m(now.theta), &mut u[slot.target]);
            slot.effect.begin(m, &mut x[memory.clone()], *value);
            let mut scratch = Short::from_slice(&x[memory.clone()]);
            *value = slot.effect.signal(m, instant, &mut scratch, *value);
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
        for Signal { slot, memory } in &self.sensors {
            let (m, value) = (slot.m(now.theta), &mut y[slot.target]);
            slot.effect.begin(m, &mut x[memory.clone()], *value);
            let mut scratch = Short::from_slice(&x[memory.clone()]);
            *value = slot.effect.signal(m, instant, &mut scratch, *value);
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
        for (slots, levels) in [(&self.process, process), (&self.measurement, measurement)] {
            for slot in slots {
                let level = &mut levels[slot.target];
                let added = slot.effect.noise_level(slot.m(now.theta));
                // hypot is not exact for a zero side; off must be.
                if added != 0.0 {
                    *level = level.hypot(added);
                }
            }
        }
    }

    fn limits(&self) -> Vec<Interval> {
        let mut limits = self.base.as_ref().limits();
        limits.resize(self.outline.states.len(), Interval::EVERYTHING);
        limits
    }

    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        for slot in &self.ceilings {
            let m = slot.m(now.theta);
            let (i, j) = (slot.target, slot.other.filter(|j| *j != slot.target));
            let mut value = x[i];
            slot.effect.limit(m, &mut value, j.map(|j| &mut x[j]));
            x[i] = value;
        }
        self.inner(now, now.u, |twin, now| {
            twin.constrain(now, &mut x[..self.states]);
        });
    }

    fn integrator(&self) -> Integrator {
        self.base.as_ref().integrator()
    }

    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.base
            .as_ref()
            .check_parameters(&theta[..self.slots.base], dt)?;
        self.slots.check(theta, dt)
    }

    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        let mut all = self.base.as_ref().outliers(&theta[..self.slots.base]);
        for slot in self.slots.with(Law::Outliers) {
            let Some(own) = slot.effect.outliers(slot.m(theta)) else {
                continue;
            };
            all.resize(self.outline.outputs.len(), Outliers::default());
            let there = &mut all[slot.target];
            // Both are rare: their probabilities add up, and the larger ones are seen.
            there.probability += own.probability;
            there.scale = there.scale.max(own.scale);
        }
        all
    }

    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Record) {
        self.base
            .as_ref()
            .corrupt_outputs(&theta[..self.slots.base], noise, outputs);
        for slot in self.slots.with(Law::Outliers) {
            strike(slot, theta, noise, outputs);
        }
    }
}
