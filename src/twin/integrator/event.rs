//! Events: changes of states at given times, or where a condition becomes true.

use super::Now;
use std::sync::Arc;

/// Function of time, inputs, parameters and states.
type MarginOf = dyn Fn(&Now<'_>, &[f64]) -> f64 + Send + Sync;
/// Times of an event.
type TimesOf = dyn Fn(&Now<'_>) -> Vec<f64> + Send + Sync;
/// Change of the states.
type ChangeOf = dyn Fn(&Now<'_>, &mut [f64]) + Send + Sync;

/// A change of states within the motion: at times, or where a condition goes from false to true.
///
/// A twin has those of its [`Outline`](crate::twin::Outline). The place of a condition is located between two samples, for each point of a
/// filter its own. A condition that is true at the start is no event.
///
/// ```
/// use truetwin::prelude::*;
/// use truetwin::twin::{Event, Integrator};
///
/// /// A ball that loses a share of its speed at the floor.
/// struct Ball;
/// impl StateSpace for Ball {
///     fn outline(&self) -> Outline {
///         Outline::new()
///             .parameter(Parameter::new("e", "-", 0.5, 0.9))
///             .state("h", "m")
///             .state("v", "m/s")
///             .output("y", "m")
///             .event(Event::when("bounce", |_, x| -x[0], |now, x| {
///                 x[0] = 0.0;
///                 x[1] *= -now.theta[0];
///             }))
///     }
///     fn drift(&self, _: &Now, x: &[f64], dx: &mut [f64]) {
///         (dx[0], dx[1]) = (x[1], -10.0);
///     }
///     fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
///         y[0] = x[0];
///     }
///     fn start(&self, _: &Now, x: &mut [f64]) {
///         x[0] = 5.0;
///     }
///     fn integrator(&self) -> Integrator {
///         Integrator::RungeKutta4
///     }
/// }
/// // It falls for 1 s, and is back at 0.8² of its height 0.8 s later.
/// let y = Ball.simulate(&[0.8], &Drive::autonomous(0.9, 3)?, Noise::OFF)?;
/// assert!((y[[2, 0]] - 3.2).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Event {
    name: String,
    trigger: Trigger,
    change: Arc<ChangeOf>,
}

#[derive(Clone)]
enum Trigger {
    Margin(Arc<MarginOf>),
    Times(Arc<TimesOf>),
}

impl Event {
    /// Creates an event of a condition, which is true where its margin is above zero: `|now, x| x[0] - 3.0` for x₀ > 3. A margin that
    /// changes smoothly is located in a few steps, one that jumps in some fifty.
    pub fn when(
        name: &str,
        margin: impl Fn(&Now<'_>, &[f64]) -> f64 + Send + Sync + 'static,
        change: impl Fn(&Now<'_>, &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            trigger: Trigger::Margin(Arc::new(margin)),
            change: Arc::new(change),
        }
    }

    /// Creates an event at times in seconds, on the record's own clock. At the time of a row it acts behind that row.
    pub fn at(
        name: &str,
        times: impl Fn(&Now<'_>) -> Vec<f64> + Send + Sync + 'static,
        change: impl Fn(&Now<'_>, &mut [f64]) + Send + Sync + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            trigger: Trigger::Times(Arc::new(times)),
            change: Arc::new(change),
        }
    }

    /// Name in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the margin of its condition; of one at times a negative number.
    pub(super) fn margin(&self, now: &Now<'_>, x: &[f64]) -> f64 {
        match &self.trigger {
            Trigger::Margin(margin) => margin(now, x),
            Trigger::Times(_) => -1.0,
        }
    }

    /// Returns whether it is one at times.
    pub(super) fn is_timed(&self) -> bool {
        matches!(self.trigger, Trigger::Times(_))
    }

    /// Returns its times; none of one of a condition.
    pub(in crate::twin) fn times(&self, now: &Now<'_>) -> Vec<f64> {
        match &self.trigger {
            Trigger::Margin(_) => vec![],
            Trigger::Times(times) => times(now),
        }
    }

    /// Changes the states.
    pub(super) fn change(&self, now: &Now<'_>, x: &mut [f64]) {
        (self.change)(now, x);
    }
}

impl std::fmt::Debug for Event {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Event").field(&self.name).finish()
    }
}

/// Two are equal that are copies of each other: functions cannot be compared.
impl PartialEq for Event {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && Arc::ptr_eq(&self.change, &other.change)
    }
}
