//! The list of parts of a twin, and the inside of its delays.

use super::part::{Disturbance, Entry, Follows, Law, LawPart, TwinPart};
use crate::record::Quantity;
use crate::twin::{
    Integrator, Interval, Noise, Now, Outline, Parameter, ParameterSpace, Stepping, TwinError,
};
use smallvec::SmallVec;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Values that a dead time keeps as states: it reads between two of them, and is moved by less than a sample where a filter differentiates.
const BETWEEN_SAMPLES: usize = 3;

/// θ of a twin, without the heap where it is short.
pub(in crate::twin) type Theta = SmallVec<[f64; 16]>;

/// A part in its place.
#[derive(Clone)]
pub(in crate::twin) struct Added {
    pub part: TwinPart,
    /// Number of delays of the twin inside of it: it sees those of this index on.
    pub delays: usize,
    /// Its memory in the state.
    pub states: Range<usize>,
    /// Step at which noise levels are asked, where it is not the present one.
    pub step: Option<f64>,
}

/// Parts of a twin, sorted by place.
#[derive(Clone)]
pub(in crate::twin) struct Parts {
    /// Parameters that are free; states of the twin, then of parts.
    pub outline: Outline,
    /// All parameters: the twin's, then those of parts. Free ones are `None`.
    held: Vec<Option<f64>>,
    /// Number of the twin's own states.
    pub states: usize,
    /// Number of the twin's own parameters.
    pub parameters: usize,
    pub limits: Vec<Interval>,
    pub integrator: Integrator,
    pub stepping: Stepping,
    /// From the inside out. Of parts that are added together, those that act from the outside in (on parameters, limits, inputs) stand in
    /// the opposite order.
    pub list: Vec<Added>,
    /// Entries of θ that add up to each delay, in seconds.
    delays: Vec<Vec<usize>>,
    /// Step at which the twin's own noise is asked.
    pub noise_step: Option<f64>,
    /// Time that the start belongs to, on the record's own clock; `None` for that of the first row.
    pub begins: Option<f64>,
    pub acts: Acts,
}

/// Phases of a step in which parts act: the others are the twin's own.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::twin) struct Acts {
    pub on_parameters: bool,
    /// `true` where a parameter follows states.
    pub by_states: bool,
    pub on_rates: bool,
    pub on_limits: bool,
    pub on_outputs: bool,
    pub on_readings: bool,
    pub on_noise: bool,
    /// `true` where noise levels are fitted.
    pub in_levels: bool,
    /// `true` where noise grows with its signal.
    pub in_proportion: bool,
    pub on_start: bool,
    /// `true` where sensors remember.
    pub in_sensors: bool,
    /// `true` where laws remember signals inside the twin.
    pub in_memories: bool,
    /// `true` where disturbances move.
    pub in_disturbances: bool,
    /// `true` for a twin with events.
    pub on_events: bool,
}

impl Acts {
    fn add(&mut self, part: &TwinPart) {
        match part {
            TwinPart::Law(part) => self.add_law(part),
            TwinPart::Late(_) => (self.on_rates, self.on_noise) = (true, true),
            TwinPart::Unit(_) => {
                (self.on_outputs, self.on_noise, self.on_readings) = (true, true, true);
            }
            TwinPart::Level { .. } => self.on_noise = true,
            TwinPart::Share { .. } => (self.on_noise, self.in_proportion) = (true, true),
            TwinPart::Levels(_) => self.in_levels = true,
            TwinPart::Start { .. } | TwinPart::UncertainStart { .. } => self.on_start = true,
            TwinPart::Disturbance(part) => {
                (self.in_disturbances, self.on_noise, self.on_start) = (true, true, true);
                match part.entry {
                    Entry::State(_) => self.on_rates = true,
                    Entry::Sensor(_) => self.on_outputs = true,
                    Entry::Parameter(_) => (self.on_parameters, self.by_states) = (true, true),
                    Entry::Actuator(_) => {}
                }
            }
            _ => {}
        }
    }

    fn add_law(&mut self, part: &LawPart) {
        self.in_memories |= part.follows.is_some();
        match &part.law {
            Law::Parameter(law) => {
                self.on_parameters = true;
                self.by_states |= law.sees_states();
            }
            Law::Force(_) => self.on_rates = true,
            Law::Limit(_) => self.on_limits = true,
            Law::Reading(_) => self.on_readings = true,
            Law::Sensor(_) => {
                self.on_outputs = true;
                self.in_sensors |= part.memory > 0 && part.follows.is_none();
            }
            Law::MeasurementNoise(_) | Law::ProcessNoise(_) => self.on_noise = true,
            Law::Actuator(_) | Law::Rounding(_) | Law::Outliers(_) => {}
        }
    }

    /// Returns whether the equations move as the twin's own do.
    pub fn leave_motion(self) -> bool {
        let remembers = self.in_sensors || self.in_memories || self.in_disturbances;
        let bent = self.on_parameters || self.on_rates || self.on_limits;
        !(bent || remembers || self.on_events)
    }

    /// Returns whether a run is one of the twin's own equations.
    pub fn leave_runs(self) -> bool {
        let changed = self.on_outputs || self.on_readings || self.on_start;
        self.leave_motion() && !(changed || self.on_noise || self.in_levels)
    }
}

impl Parts {
    /// Returns no parts of a twin.
    pub fn none(outline: Outline, limits: Vec<Interval>, rule: (Integrator, Stepping)) -> Self {
        let acts = Acts {
            on_events: !outline.events.is_empty(),
            ..Acts::default()
        };
        Self {
            held: vec![None; outline.parameters.len()],
            states: outline.states.len(),
            parameters: outline.parameters.len(),
            outline,
            limits,
            integrator: rule.0,
            stepping: rule.1,
            list: vec![],
            delays: vec![],
            noise_step: None,
            begins: None,
            acts,
        }
    }

    /// Number of all parameters, held ones counted.
    pub fn entries(&self) -> usize {
        self.held.len()
    }

    /// Returns the entry of the free parameter of this index.
    pub fn entry(&self, free: usize) -> usize {
        let open = |entry: &usize| self.held[*entry].is_none();
        (0..self.held.len())
            .filter(open)
            .nth(free)
            .unwrap_or(usize::MAX)
    }

    /// Returns all of θ from the free entries; all of it is left as it is.
    pub fn complete(&self, theta: &[f64]) -> Theta {
        if theta.len() == self.held.len() {
            return Theta::from_slice(theta);
        }
        let mut free = theta.iter();
        (self.held.iter())
            .map(|held| held.unwrap_or_else(|| free.next().copied().unwrap_or(f64::NAN)))
            .collect()
    }

    /// Returns all of θ for a run with this noise, with those held values that each run draws.
    pub fn drawn(&self, theta: &[f64], noise: Noise) -> Theta {
        let mut all = self.complete(theta);
        for added in &self.list {
            if let TwinPart::Drawn { first, values } = &added.part {
                let chosen = noise.source("levels").uniform() * values.len() as f64;
                let chosen = &values[chosen as usize];
                all[*first..][..chosen.len()].copy_from_slice(chosen);
            }
        }
        all
    }

    /// Returns the parts with priors and bounds as `change` leaves them.
    pub fn with_space(
        &self,
        change: impl FnOnce(&mut ParameterSpace) -> Result<(), TwinError>,
    ) -> Result<Arc<Self>, TwinError> {
        let mut all = self.clone();
        change(&mut all.outline.parameters)?;
        Ok(Arc::new(all))
    }

    /// Returns the parts with these parameters held; `free` are the others.
    pub fn holding(&self, values: &BTreeMap<String, f64>, free: ParameterSpace) -> Arc<Self> {
        let mut all = self.clone();
        let open = all.held.iter_mut().filter(|held| held.is_none());
        for (held, parameter) in open.zip(self.outline.parameters.iter()) {
            *held = values.get(&parameter.name).copied();
        }
        all.outline.parameters = free;
        Arc::new(all)
    }

    /// Returns the parts with parameters and parts more, which act together: along a signal in this order, behind those that are there; a
    /// delay of the twin holds for all of them.
    pub fn with(
        &self,
        parameters: impl IntoIterator<Item = Parameter>,
        parts: Vec<TwinPart>,
    ) -> Arc<Self> {
        let mut all = self.clone();
        for parameter in parameters {
            all.outline.parameters.push(parameter);
            all.held.push(None);
        }
        let (mut late, mut inputs, mut inside, mut outside) = (vec![], vec![], vec![], vec![]);
        for part in parts {
            match &part {
                TwinPart::Late(_) => late.push(part),
                TwinPart::Law(LawPart { law, .. }) => match law {
                    Law::Actuator(_) => inputs.insert(0, part),
                    Law::Parameter(_) | Law::Limit(_) => inside.insert(0, part),
                    Law::Force(_) => inside.push(part),
                    _ => outside.push(part),
                },
                _ => outside.push(part),
            }
        }
        for part in [inside, late, outside, inputs].into_iter().flatten() {
            all.add(part);
        }
        Arc::new(all)
    }

    fn add(&mut self, part: TwinPart) {
        let (from, delays) = (self.outline.states.len(), self.delays.len());
        match &part {
            TwinPart::Box { state, limit } => self.limits[*state] = *limit,
            TwinPart::Begins(at) => self.begins = *at,
            TwinPart::Steps(integrator, stepping) => {
                (self.integrator, self.stepping) = (*integrator, *stepping);
            }
            TwinPart::Late(entries) => self.delays.push(entries.clone()),
            TwinPart::Law(part) if part.follows.is_some() || matches!(part.law, Law::Sensor(_)) => {
                let memory = match part.is_dead_time {
                    true => BETWEEN_SAMPLES,
                    false => part.memory,
                };
                (0..memory).for_each(|k| self.add_state(&format!("{}/{k}", part.name)));
            }
            // Noise may be coloured where something else is disturbed.
            TwinPart::Disturbance(_) => self.add_state(&format!("disturbance/{from}")),
            TwinPart::Levels(levels) => {
                // What is inside is asked at the step of declared levels.
                let inside = self.list.iter_mut().map(|inside| &mut inside.step);
                for step in inside.chain([&mut self.noise_step]) {
                    step.get_or_insert(levels.step);
                }
            }
            TwinPart::Unit(factor) => {
                for output in &mut self.outline.outputs {
                    output.unit = format!("{}/{factor}", output.unit);
                }
            }
            _ => {}
        }
        self.acts.add(&part);
        self.list.push(Added {
            part,
            delays,
            states: from..self.outline.states.len(),
            step: None,
        });
    }

    fn add_state(&mut self, name: &str) {
        self.outline.states.push(Quantity::new(name, ""));
        self.limits.push(Interval::EVERYTHING);
    }

    /// Returns whether outputs are read as the twin's own are.
    pub fn leave_readings(&self) -> bool {
        !(self.acts.on_readings || self.acts.on_parameters) && self.delays.is_empty()
    }

    /// Returns whether any part changes noise levels.
    pub fn changes_levels(&self) -> bool {
        self.acts.on_noise || self.acts.in_levels
    }

    /// Returns the laws.
    pub fn laws(&self) -> impl Iterator<Item = &LawPart> {
        self.list.iter().filter_map(|added| match &added.part {
            TwinPart::Law(part) => Some(part),
            _ => None,
        })
    }

    /// Returns the laws that remember signals inside the twin.
    pub fn memories(&self) -> impl Iterator<Item = (&Added, &LawPart, &Follows)> {
        self.list.iter().filter_map(|added| match &added.part {
            TwinPart::Law(part) => Some((added, part, part.follows.as_ref()?)),
            _ => None,
        })
    }

    /// Returns the disturbances of equations, each with the index of its state.
    pub fn disturbances(&self) -> impl Iterator<Item = (&Added, &Disturbance, usize)> {
        self.list.iter().filter_map(|added| match &added.part {
            TwinPart::Disturbance(part) => Some((added, part, added.states.start)),
            _ => None,
        })
    }

    /// Returns whether the twin's own clock is late.
    pub fn is_late(&self) -> bool {
        !self.delays.is_empty()
    }

    /// Returns the delay of this index in seconds.
    pub fn delay(&self, delay: usize, theta: &[f64]) -> f64 {
        self.delays[delay].iter().map(|&j| theta[j]).sum()
    }

    /// Number of delays of the whole twin.
    pub fn delays(&self) -> usize {
        self.delays.len()
    }

    /// Returns by how many seconds what is behind the delays from this index on is late.
    pub fn late(&self, theta: &[f64], delays: usize) -> f64 {
        let delays = delays.min(self.delays.len())..self.delays.len();
        delays.map(|delay| self.delay(delay, theta)).sum()
    }

    /// Returns the time on the record's own clock that is seen behind the delays from this index on: never before the start.
    #[inline]
    pub fn time(&self, now: &Now<'_>, delays: usize) -> f64 {
        if delays >= self.delays.len() {
            return now.t;
        }
        let delays = delays..self.delays.len();
        delays
            .fold(now.t, |t, delay| t - self.delay(delay, now.theta))
            .max(now.begun)
    }

    /// Returns the time from the first row that laws see behind the delays from this index on; 0 before it.
    #[inline]
    pub fn law_time(&self, now: &Now<'_>, delays: usize) -> f64 {
        (self.time(now, delays) - now.first_time).max(0.0)
    }

    /// Returns `now` as laws of signals and parameters see it: behind the delays from this index on, with no θ but their magnitudes.
    #[inline]
    pub fn behind<'n>(&self, now: &Now<'n>, delays: usize) -> Now<'n> {
        let t = self.law_time(now, delays);
        let theta = &[];
        Now { t, theta, ..*now }
    }

    /// Returns the share of its rates that what is behind a delay has at a stage of a step; `None` for all of them. Adaptive steps end where the
    /// delay is over.
    pub fn moving_rates(&self, now: &Now<'_>, delay: usize) -> Option<f64> {
        if !self.integrator.is_adaptive() {
            return self.moving(now, delay);
        }
        let t = self.time(now, delay + 1) - now.begun;
        (t < self.delay(delay, now.theta)).then_some(0.0)
    }

    /// Returns the share of a step in which what is behind a delay moves; `None` for all of it.
    pub fn moving(&self, now: &Now<'_>, delay: usize) -> Option<f64> {
        let t = self.time(now, delay + 1) - now.begun;
        let share = (t + now.dt - self.delay(delay, now.theta)) / now.dt;
        (share < 1.0).then_some(share.max(0.0))
    }

    /// Returns whether what is behind the delays from this index on moves for most of the step: what moves at samples only waits for a
    /// whole one.
    #[inline]
    pub fn moves(&self, now: &Now<'_>, delays: usize) -> bool {
        let mut delays = delays..self.delays.len();
        delays.all(|delay| self.moving(now, delay).is_none_or(|share| share >= 0.5))
    }
}
