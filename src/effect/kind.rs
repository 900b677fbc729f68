//! One row of the library: id, law, magnitudes.

use super::law::{ForcePoint, NOISE_ENTERS};
use super::magnitude::Magnitude;
use super::marks::OutputMark;
use crate::twin::{Law, Now, Outliers, Remember};
use std::fmt;
use std::sync::Arc;

/// The other state of a law between two states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OtherState {
    /// Any other state acts on the target; `from` in files.
    From,
    /// The state whose rate the target is acts on it; `from` in files.
    RateOf,
    /// The state whose rate the target is acts on it, or else the target itself; `from` in files.
    RateOfOrItself,
    /// Any other state takes what the target loses, or none on a twin of one state; `to` in files.
    To,
}

impl OtherState {
    /// Returns the key in files.
    pub fn key(self) -> &'static str {
        match self {
            Self::From | Self::RateOf | Self::RateOfOrItself => "from",
            Self::To => "to",
        }
    }
}

/// Check of magnitudes at a step Δt; the error names the remedy.
type MagnitudeCheck = fn(&[f64], f64) -> Result<(), String>;

/// An effect that a twin may lack, wherever it stands: its law, and the magnitudes of the law.
///
/// At the off values of its magnitudes an effect must change no bit of a trajectory.
///
/// ```
/// use truetwin::effect::{EffectKind, Magnitude};
///
/// /// A push that grows with the square of time.
/// fn thrust() -> EffectKind {
///     EffectKind::force("thrust", "ẋ + growth·t²", |m, at| m[0] * at.t * at.t)
///         .magnitude(Magnitude::signed("growth", "state/s³", &[0.1]))
/// }
/// assert_eq!(thrust().id(), "thrust");
/// ```
#[derive(Clone)]
pub struct EffectKind {
    id: String,
    formula: String,
    sentence: Option<String>,
    law: Law,
    magnitudes: Vec<Magnitude>,
    other: Option<OtherState>,
    only_on: Option<Vec<String>>,
    order: u32,
    memory: usize,
    follows: Option<Arc<dyn Remember>>,
    dead_time: bool,
    mark: Option<fn(&[f64]) -> OutputMark>,
    check: Option<MagnitudeCheck>,
}

impl EffectKind {
    /// Creates an effect that changes an output: `law(m, now, memory, s)` returns the signal that the sensor shows; `now` has time, step
    /// and inputs.
    pub fn sensor(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64], &Now<'_>, &mut [f64], f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Sensor(Arc::new(law)))
    }

    /// Creates an effect that changes an input: `law(m, now, memory, u)` returns the signal that acts; `now` has time, step and inputs.
    pub fn actuator(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64], &Now<'_>, &mut [f64], f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Actuator(Arc::new(law)))
    }

    /// Creates an effect on the rate of a state: `law(m, at)` is added to it.
    pub fn force(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64], &ForcePoint<'_>) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Force(Arc::new(law)))
    }

    /// Creates an effect on a state after each step: `law(m, x, other)` changes both.
    pub fn limit(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64], &mut f64, Option<&mut f64>) + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Limit(Arc::new(law)))
    }

    /// Creates an effect on a parameter: `law(m, t, value)` returns its value at time t.
    pub fn parameter(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64], f64, f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Parameter(Arc::new(law)))
    }

    /// Creates noise of an output: `law(m)` is its standard deviation.
    pub fn measurement_noise(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64]) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::MeasurementNoise(Arc::new(law))).order(NOISE_ENTERS)
    }

    /// Creates noise of a state: `law(m)` is the standard deviation of its increment a step.
    pub fn process_noise(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64]) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::ProcessNoise(Arc::new(law)))
    }

    /// Creates rounding of an output, halves upwards: `law(m)` is its step. A filter takes what is read for all that rounds to it.
    pub fn rounding(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64]) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Rounding(Arc::new(law))).order(90)
    }

    /// Creates rare large errors of an output: `law(m)` is their frequency and size.
    pub fn outliers(
        id: &str,
        formula: &str,
        law: impl Fn(&[f64]) -> Outliers + Send + Sync + 'static,
    ) -> Self {
        Self::new(id, formula, Law::Outliers(Arc::new(law))).order(100)
    }

    fn new(id: &str, formula: &str, law: Law) -> Self {
        Self {
            id: id.into(),
            formula: formula.into(),
            sentence: None,
            law,
            magnitudes: vec![],
            other: None,
            only_on: None,
            order: 0,
            memory: 0,
            follows: None,
            dead_time: false,
            mark: None,
            check: None,
        }
    }

    /// Adds a magnitude, behind those before it.
    #[must_use]
    pub fn magnitude(mut self, magnitude: Magnitude) -> Self {
        self.magnitudes.push(magnitude);
        self
    }

    /// Sets the position along a signal: small first; the measurement noise enters at 70.
    #[must_use]
    pub fn order(mut self, order: u32) -> Self {
        self.order = order;
        self
    }

    /// Sets the number of values that a signal law remembers. They begin at the first value of the signal.
    #[must_use]
    pub fn memory(mut self, values: usize) -> Self {
        self.memory = values;
        self
    }

    /// Gives a force a memory of its other state, or of its target where it has none: it moves once a sample.
    #[must_use]
    pub(super) fn follows(mut self, by: impl Remember + 'static) -> Self {
        self.follows = Some(Arc::new(by));
        self
    }

    /// Says that the law shows its signal as it was so many seconds ago, its first magnitude. Equations then keep only what lies between
    /// samples in their states: whole samples are left to who reads or writes the outputs.
    #[must_use]
    pub(super) fn dead_time(mut self) -> Self {
        self.dead_time = true;
        self
    }

    /// Says in a sentence what the effect does. `{place}` stands for where it acts, `{other}` for the other state, `{name}` for the
    /// magnitude of that name with its unit, `{%name}` for it in percent.
    #[must_use]
    pub fn with_sentence(mut self, sentence: &str) -> Self {
        self.sentence = Some(sentence.into());
        self
    }

    /// Makes it a law between two states.
    #[must_use]
    pub fn other(mut self, other: OtherState) -> Self {
        self.other = Some(other);
        self
    }

    /// Offers the effect at these targets only; at every target of its kind otherwise.
    #[must_use]
    pub fn only_on<'a>(mut self, targets: impl IntoIterator<Item = &'a str>) -> Self {
        self.only_on = Some(targets.into_iter().map(Into::into).collect());
        self
    }

    /// Sets a check of magnitudes and step: an error says what is wrong and what to do.
    #[must_use]
    pub fn check(mut self, check: fn(&[f64], f64) -> Result<(), String>) -> Self {
        self.check = Some(check);
        self
    }

    /// Sets the search for the effect's mark on measured outputs.
    #[must_use]
    pub(super) fn mark(mut self, mark: fn(&[f64]) -> OutputMark) -> Self {
        self.mark = Some(mark);
        self
    }

    /// Returns the id, as in files.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Returns the law in one line, for people.
    pub fn formula(&self) -> &str {
        &self.formula
    }

    /// Returns what it does in a sentence with names in braces, if it has one.
    pub fn sentence(&self) -> Option<&str> {
        self.sentence.as_deref()
    }

    /// Returns the law.
    pub(crate) fn law(&self) -> &Law {
        &self.law
    }

    /// Returns the magnitudes in the order of θ.
    pub fn magnitudes(&self) -> &[Magnitude] {
        &self.magnitudes
    }

    /// Returns which other state the law needs, if any.
    pub fn other_state(&self) -> Option<OtherState> {
        self.other
    }

    pub(super) fn may_stand_on(&self, target: &str) -> bool {
        let only = self.only_on.as_ref();
        only.is_none_or(|targets| targets.iter().any(|t| t == target))
    }

    pub(super) fn position(&self) -> u32 {
        self.order
    }

    /// Returns how the memory of a force moves, if it has one.
    pub(crate) fn remembers(&self) -> Option<&Arc<dyn Remember>> {
        self.follows.as_ref()
    }

    /// Number of memory values that a law needs.
    pub(crate) fn memory_values(&self) -> usize {
        self.memory
    }

    /// Returns whether the law shows its signal as it was so many seconds ago.
    pub(crate) fn is_dead_time(&self) -> bool {
        self.dead_time
    }

    /// Seconds that a dead time may last at this step; `None` of other laws.
    pub(crate) fn longest_dead_time(&self, dt: f64) -> Option<f64> {
        self.dead_time.then(|| (self.memory - 1) as f64 * dt)
    }

    /// Looks for the effect's mark on measured outputs of its target.
    pub(crate) fn marks(&self, outputs: &[f64]) -> OutputMark {
        self.mark.map_or(OutputMark::Unmarked, |mark| mark(outputs))
    }

    pub(super) fn check_values(&self, m: &[f64], dt: f64) -> Result<(), String> {
        self.check.map_or(Ok(()), |check| check(m, dt))
    }
}

impl fmt::Debug for EffectKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("EffectKind")
            .field("id", &self.id)
            .field("magnitudes", &self.magnitudes)
            .finish_non_exhaustive()
    }
}
