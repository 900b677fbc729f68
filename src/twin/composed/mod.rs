//! Equations with everything that is added to them: held parameters, settings, effects, disturbances, fitted noise.
//!
//! | phase | file |
//! |---|---|
//! | the laws of parts, and the parts | `part.rs` |
//! | parts sorted by when they act; the inside of a delay | `parts.rs` |
//! | motion: rates, memories, limits, points of a step | `motion.rs` |
//! | outputs, starts and inputs | `signals.rs` |
//! | noise levels, starts from outside | `noise.rs` |
//! | inputs that act; the loop of a run | `simulation.rs` |
//! | a user's equations, compiled for all points of a step; those that take all in one call | `engine.rs`, `own.rs` |
//! | the trait of all simulators; the same parts over whole signals of a black box | `digital_twin.rs`, `black_box.rs`, `known_noise.rs` |

mod black_box;
mod digital_twin;
mod engine;
mod known_noise;
mod motion;
mod noise;
mod own;
mod part;
mod parts;
mod signals;
mod simulation;

pub use black_box::ComposedBlackBox;
pub use digital_twin::DigitalTwin;
pub(in crate::twin) use digital_twin::FREE_RUNS;
pub(crate) use known_noise::{KnownNoise, NoisePart, SensorNoise, WhiteLevel};
pub(crate) use noise::LevelFactors;
pub(crate) use part::{
    Disturbance, Entry, FittedLevels, Follows, LARGEST, Law, LawPart, LawPlace, LevelSource,
    LevelValue, ParameterChange, RateChange, Remember, Seen, SignalChange, StateLimit, TwinPart,
};
pub(crate) use simulation::{Acting, DeadTime, check_start, seconds_before};

use crate::record::{Drive, Record, Signal};
use crate::twin::integrator::felt;
use crate::twin::points::Layout;
use crate::twin::{
    Blocks, Event, Hold, Integrator, Interval, Noise, Now, Outliers, Outline, SimulationError,
    StateSpace, Stepping, StepsTaken, Workspace,
};
use own::OwnEquations;
pub(in crate::twin) use parts::Parts;
pub(in crate::twin) use parts::Theta;
use simulation::{RunSetup, check_lengths, simulate};
use std::sync::Arc;

/// Equations of a twin with all parts that are added to them, as filters and simulations see them; cheap to clone.
///
/// θ is that of the twin's free parameters, then that of the parts; x has the twin's states, then memories of parts. Parts are kept
/// flat: from here to the user's equations it is one call for all points of a step.
///
/// ```
/// use truetwin::twin::{Composed, Now};
/// use truetwin::twins::VanDerPol;
///
/// let twin = Composed::from(VanDerPol);
/// let mut rates = [0.0; 2];
/// twin.drift(&Now::new(0.0, 0.05, &[], &[1.5]), &[1.0, 2.0], &mut rates);
/// assert_eq!(rates, [2.0, -1.0]);
/// ```
#[derive(Clone)]
pub struct Composed {
    own: OwnEquations,
    parts: Arc<Parts>,
}

debug_by_name!(Composed);

impl<T: StateSpace + 'static> From<T> for Composed {
    fn from(own: T) -> Self {
        Self::new(Arc::new(own))
    }
}

impl From<&Composed> for Composed {
    fn from(twin: &Composed) -> Self {
        twin.clone()
    }
}

impl Composed {
    /// Returns a user's equations, without parts.
    pub fn new<T: StateSpace + 'static>(own: Arc<T>) -> Self {
        Self::without_parts(OwnEquations::one_by_one(own))
    }

    /// Returns equations that take all points of a step in one call, without parts.
    pub(crate) fn in_blocks<T: StateSpace + Blocks + 'static>(own: Arc<T>) -> Self {
        Self::without_parts(OwnEquations::in_blocks(own))
    }

    fn without_parts(own: OwnEquations) -> Self {
        let rule = (own.integrator(), own.stepping());
        let parts = Arc::new(Parts::none(own.outline(), own.limits(), rule));
        Self { own, parts }
    }

    /// Returns the same equations, of which a call waits for an exchange that so many passes may share.
    pub(crate) fn asked_beside(mut self, passes: usize) -> Self {
        self.own.beside = passes;
        self
    }

    /// Returns the number of passes that should be under way at once.
    pub(crate) fn beside(&self) -> usize {
        self.own.beside
    }

    /// Returns whether passes of several θ at once are calls of one, not of one pass after the other.
    pub(crate) fn joins_lanes(&self) -> bool {
        self.own.joins_lanes()
            && self.parts.acts.leave_motion()
            && self.integrator() != Integrator::Stiff
    }

    /// Returns names and units of the equations alone.
    pub(crate) fn own_outline(&self) -> Outline {
        self.own.outline()
    }

    /// Sets the start of the equations alone.
    pub(crate) fn own_start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.own.start(now, x);
    }

    /// Sets the rates of the equations alone, of one point or of several behind one another.
    pub(crate) fn own_rates(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let states = self.own.outline().states.len();
        self.own.drift_points(now, Layout::dense(states), x, dx);
    }

    /// Returns names and units of all that is free, of states of parts, too.
    pub fn outline(&self) -> Outline {
        self.parts.outline.clone()
    }

    /// Returns the box of each state.
    pub fn limits(&self) -> &[Interval] {
        &self.parts.limits
    }

    /// Returns the disturbances: where each enters, the index of its state, the entry of its size in θ.
    pub(crate) fn disturbances(&self) -> Vec<(Entry, usize, usize)> {
        let all = self.parts.disturbances();
        all.map(|(_, part, state)| (part.entry, state, part.sigma))
            .collect()
    }

    /// Returns whether a record fits the noise level of this state.
    pub(crate) fn fits_noise_of(&self, state: usize) -> bool {
        self.parts.list.iter().any(|added| match &added.part {
            // Memories of parts stand behind the states that levels are of.
            TwinPart::Levels(levels) => (levels.process.get(state))
                .is_some_and(|source| !matches!(source, LevelSource::Declared)),
            _ => false,
        })
    }

    /// Returns the integrator.
    pub(crate) fn integrator(&self) -> Integrator {
        self.parts.integrator
    }

    /// Returns substeps and hold.
    pub(crate) fn stepping(&self) -> Stepping {
        self.parts.stepping
    }

    /// Returns whether this is another handle of the same twin.
    pub(crate) fn is(&self, other: &Self) -> bool {
        self.own.is_same(&other.own) && Arc::ptr_eq(&self.parts, &other.parts)
    }

    /// Returns the time that the start belongs to, on the record's own clock; `None` for that of the first row.
    pub(crate) fn begins(&self) -> Option<f64> {
        self.parts.begins
    }

    /// Returns the number of states.
    fn states(&self) -> usize {
        self.parts.outline.states.len()
    }

    /// Returns the same equations with these parts.
    pub(in crate::twin) fn of(&self, parts: Arc<Parts>) -> Self {
        let own = self.own.clone();
        Self { own, parts }
    }

    /// Returns the same equations, whose starts belong to this time of a record's clock.
    pub(crate) fn beginning(&self, at: f64) -> Self {
        self.of(self.parts.with([], vec![TwinPart::Begins(Some(at))]))
    }

    pub(in crate::twin) fn parts(&self) -> &Parts {
        &self.parts
    }

    /// Returns the names of events whose times all lie outside these records, with the start of the twin.
    pub(crate) fn events_outside(&self, theta: &[f64], records: &[Record]) -> Vec<&str> {
        if !self.has_events() {
            return vec![];
        }
        let spans = records.iter().filter_map(|record| {
            let acting = Acting::of(self, theta, record.drive()).ok()?;
            Some((acting, record.drive().own_time(record.samples() - 1)))
        });
        let spans: Vec<_> = spans.collect();
        if spans.is_empty() {
            return vec![];
        }
        let is_outside = |event: &&Event| {
            spans.iter().all(|(acting, end)| {
                let start = acting.start();
                let times = self.inside(&start, None, |own| event.times(own));
                !times.is_empty() && times.iter().all(|at| *at < start.t || *at > *end)
            })
        };
        let events = self.parts.outline.events.iter();
        events.filter(is_outside).map(Event::name).collect()
    }

    /// Returns whether it has events, so that each pass needs a memory of its own.
    pub(crate) fn has_events(&self) -> bool {
        self.parts.acts.on_events
    }

    /// Returns what each input is between samples.
    pub(crate) fn holds(&self) -> Vec<Hold> {
        self.parts.outline.holds(self.stepping().hold)
    }

    /// Returns whether an input is an amount, given at its row.
    pub(super) fn is_amount(&self, input: usize) -> bool {
        let outline = &self.parts.outline;
        outline.hold_of(&outline.inputs[input], self.stepping().hold) == Hold::Impulse
    }

    /// Returns buffers for its motion.
    pub(crate) fn workspace(&self) -> Workspace {
        let rule = (self.integrator(), self.stepping());
        let events = &self.parts.outline.events;
        Workspace::of(&self.holds(), self.limits(), rule, events)
    }

    /// Returns all of θ from the free entries.
    pub(crate) fn complete(&self, theta: &[f64]) -> Theta {
        self.parts.complete(theta)
    }

    /// Calls `then` with all of θ in place of the free entries.
    #[inline(always)]
    fn resolved<R>(&self, now: &Now<'_>, then: impl FnOnce(&Now<'_>) -> R) -> R {
        if now.theta.len() == self.parts.entries() {
            return then(now);
        }
        let theta = self.complete(now.theta);
        then(&Now {
            theta: &theta,
            ..*now
        })
    }

    /// Calls `then` with the twin's own time and θ, as parts bend them beside the states `x`; without states, what follows them bends
    /// nothing. `now` has all of θ.
    #[inline(always)]
    fn inside<R>(&self, now: &Now<'_>, x: Option<&[f64]>, then: impl FnOnce(&Now<'_>) -> R) -> R {
        then(&self.own_now(now, self.bent(now, x).as_ref()))
    }

    /// The twin's own time and θ, which is that of `now` where nothing bends it.
    #[inline(always)]
    fn own_now<'n>(&self, now: &Now<'n>, bent: Option<&'n Theta>) -> Now<'n> {
        Now {
            t: self.parts.time(now, 0),
            theta: bent.map_or(&now.theta[..self.parts.parameters], |theta| theta),
            ..*now
        }
    }

    /// Returns the twin's own θ where parts bend it.
    #[inline(always)]
    fn bent(&self, now: &Now<'_>, x: Option<&[f64]>) -> Option<Theta> {
        let parts = &*self.parts;
        if !parts.acts.on_parameters {
            return None;
        }
        let mut theta = Theta::from_slice(&now.theta[..parts.parameters]);
        for added in parts.list.iter().rev() {
            match (&added.part, x) {
                (TwinPart::Law(part), x) => {
                    if let Law::Parameter(law) = &part.law
                        && (x.is_some() || !law.sees_states())
                    {
                        let at = parts.behind(now, added.delays);
                        let value = &mut theta[part.target];
                        *value = law.value(part.m(now.theta), &at, x.unwrap_or(&[]), *value);
                    }
                }
                (TwinPart::Disturbance(part), Some(x)) => {
                    if let Entry::Parameter(entry) = part.entry {
                        theta[entry] *= x[added.states.start].clamp(-LARGEST, LARGEST).exp();
                    }
                }
                _ => {}
            }
        }
        Some(theta)
    }

    /// Checks once before a run that θ can be simulated at this step.
    pub(crate) fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        let theta = self.complete(theta);
        (self.own).check_parameters(&theta[..self.parts.parameters], dt)?;
        self.parts.check(&theta, dt)
    }

    /// Returns why the last run at this θ failed, if the equations know more than its divergence.
    pub(crate) fn fault(&self, theta: &[f64]) -> Option<SimulationError> {
        let theta = self.complete(theta);
        self.own.fault(&theta[..self.parts.parameters])
    }

    /// Simulates the equations.
    pub(crate) fn run(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.parts.call_hooks()?;
        let outline = &self.parts.outline;
        check_lengths(outline, theta, drive)?;
        let theta = &self.parts.drawn(theta, noise);
        self.check_parameters(theta, drive.dt())?;
        let mut without_delays = theta.clone();
        let dead_time = DeadTime::of(self, &mut without_delays, drive);
        let mut setup = RunSetup {
            outline,
            limits: felt(self.limits()),
            acting: Acting::of(self, &without_delays, drive)?,
            dead_time,
            work: self.workspace(),
        };
        let outputs = if self.parts.acts.leave_runs() {
            setup.acting.first_entries(self.parts.parameters);
            self.own.run(setup, noise)
        } else {
            simulate(self, &mut setup, noise)
        };
        let mut outputs = outputs.map_err(|error| self.fault(theta).unwrap_or(error))?;
        self.finish(theta, noise, &mut outputs);
        Ok(outputs)
    }

    /// Returns the adaptive substeps of a run without noise at θ; `None` for fixed steps.
    pub(crate) fn steps_taken(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<StepsTaken>, SimulationError> {
        let mut setup = RunSetup {
            outline: &self.parts.outline,
            limits: felt(self.limits()),
            acting: Acting::of(self, theta, drive)?,
            dead_time: DeadTime::NONE,
            work: self.workspace(),
        };
        if setup.work.steps_taken().is_some() {
            simulate(self, &mut setup, Noise::OFF)?;
        }
        Ok(setup.work.steps_taken())
    }

    /// Returns the steps to which finished outputs are rounded, by output, 0 for none; empty without any. A filter takes an output for all
    /// signals that are rounded to it, whatever the offset of the steps.
    pub(crate) fn rounding(&self, theta: &[f64]) -> Vec<f64> {
        let (mut all, theta) = (vec![], self.complete(theta));
        for part in self.parts.laws() {
            if let Law::Rounding(step) = &part.law {
                all.resize(self.outputs(), 0.0);
                let own: f64 = step(part.m(&theta));
                all[part.target] = own.max(all[part.target]);
            }
        }
        all
    }

    /// Returns probability and size of outliers, by output; empty without any.
    pub(crate) fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        let (mut all, theta) = (vec![], self.complete(theta));
        for part in self.parts.laws() {
            if let Law::Outliers(law) = &part.law {
                let own = law(part.m(&theta));
                all.resize(self.outputs(), Outliers::default());
                let both: &mut Outliers = &mut all[part.target];
                // Both are rare: their probabilities add up, and the larger ones are seen.
                both.probability += own.probability;
                both.scale = both.scale.max(own.scale);
            }
        }
        all
    }

    /// Rounds finished outputs, and adds outliers, which are drawn over the whole record.
    pub(crate) fn finish(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        let theta = self.complete(theta);
        for part in self.parts.laws() {
            part.finish(&theta, noise, outputs);
        }
    }
}

impl Parts {
    fn check(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.list.iter().try_for_each(|added| match &added.part {
            TwinPart::Check(check) => check(theta, dt),
            _ => Ok(()),
        })
    }

    fn call_hooks(&self) -> Result<(), SimulationError> {
        self.list
            .iter()
            .rev()
            .try_for_each(|added| match &added.part {
                TwinPart::Hook(hook) => hook(),
                _ => Ok(()),
            })
    }
}

impl LawPart {
    /// Rounds its finished channel to multiples of its step, halves upwards, or adds its outliers.
    fn finish(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        let m = self.m(theta);
        match &self.law {
            Law::Rounding(step) => {
                let step = step(m);
                if step > 0.0 {
                    (outputs.column_mut(self.target))
                        .mapv_inplace(|value| step * (value / step + 0.5).floor());
                }
            }
            Law::Outliers(law) => {
                let (hits, mut source) = (law(m), noise.source(&self.name));
                for value in outputs.column_mut(self.target) {
                    // Both draws always, so that other magnitudes see the same draws.
                    let (hit, size) = (source.happens(hits.probability), source.normal());
                    *value += if hit { hits.scale * size } else { 0.0 };
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests;
