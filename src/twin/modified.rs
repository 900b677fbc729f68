//! Equations made of other equations.

use crate::record::{Drive, Signal};
use crate::twin::{
    Advance, Integrator, Interval, Noise, Now, Outliers, Outline, SimulationError, StateSpace,
};

/// A change of a base twin's equations. Every hook forwards to the base unless it is overridden.
///
/// States that a change adds stand behind the base twin's. θ may be longer, shorter or of other values.
pub(crate) trait Modify: Send + Sync + Sized + 'static {
    /// The base twin's equations.
    fn base(&self) -> &dyn StateSpace;

    /// Number of added states.
    fn added(&self) -> usize {
        0
    }

    /// Calls `then` with the base twin's θ.
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(theta)
    }

    /// Calls `then` with the base twin's `now`. `added` holds the added states; it is empty where no state is at hand.
    fn now<R>(&self, now: &Now<'_>, _added: &[f64], then: impl FnOnce(&Now<'_>) -> R) -> R {
        self.theta(now.theta, |theta| then(&Now { theta, ..*now }))
    }

    fn outline(&self) -> Outline {
        self.base().outline()
    }

    /// Rates of added states are zero.
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let (x, added) = x.split_at(x.len() - self.added());
        let (dx, rates) = dx.split_at_mut(x.len());
        rates.fill(0.0);
        self.now(now, added, |now| self.base().drift(now, x, dx));
    }

    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let (x, added) = x.split_at(x.len() - self.added());
        self.now(now, added, |now| self.base().observe(now, x, y));
    }

    /// Added states start at zero.
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        let (x, added) = x.split_at_mut(x.len() - self.added());
        added.fill(0.0);
        self.now(now, added, |now| self.base().start(now, x));
    }

    /// Added states have no noise.
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        let own = process.len() - self.added();
        self.now(now, &[], |now| {
            self.base().noise(now, &mut process[..own], measurement);
        });
    }

    /// Added states have no limits.
    fn limits(&self) -> Vec<Interval> {
        let mut limits = self.base().limits();
        limits.resize(limits.len() + self.added(), Interval::EVERYTHING);
        limits
    }

    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        let (x, added) = x.split_at_mut(x.len() - self.added());
        self.now(now, added, |now| self.base().constrain(now, x));
    }

    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        let (x, added) = x.split_at_mut(x.len() - self.added());
        self.now(now, added, |now| self.base().update(now, x));
    }

    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.now(now, &[], |now| self.base().readout(now, y));
    }

    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.theta(theta, |theta| self.base().check_parameters(theta, dt))
    }

    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.theta(theta, |theta| {
            self.base().corrupt_outputs(theta, noise, outputs);
        });
    }

    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        self.theta(theta, |theta| self.base().outliers(theta))
    }

    fn integrator(&self) -> Integrator {
        self.base().integrator()
    }

    /// Simulates the modified equations; a change that leaves the motion alone may run the base twin instead.
    fn run(
        whole: &Modified<Self>,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        whole.run_equations(theta, drive, noise)
    }
}

/// The base twin's equations with a change. The lint refuses a method of [`StateSpace`] that is not forwarded.
pub(crate) struct Modified<M>(pub M);

#[deny(clippy::missing_trait_methods)]
impl<M: Modify> StateSpace for Modified<M> {
    fn outline(&self) -> Outline {
        self.0.outline()
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.0.drift(now, x, dx);
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.0.observe(now, x, y);
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.start(now, x);
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.0.noise(now, process, measurement);
    }
    fn limits(&self) -> Vec<Interval> {
        self.0.limits()
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.constrain(now, x);
    }
    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.update(now, x);
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.0.readout(now, y);
    }
    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.0.check_parameters(theta, dt)
    }
    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.0.corrupt_outputs(theta, noise, outputs);
    }
    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        self.0.outliers(theta)
    }
    fn integrator(&self) -> Integrator {
        self.0.integrator()
    }
    fn run(&self, theta: &[f64], drive: &Drive, noise: Noise) -> Result<Signal, SimulationError> {
        M::run(self, theta, drive, noise)
    }
}
