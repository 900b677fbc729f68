//! Equations made of other equations.

mod together;

use crate::record::{Drive, Signal};
use crate::twin::{
    Advance, Integrator, Interval, Layout, Noise, Now, Outliers, Outline, Points, SimulationError,
    StateSpace, Stepping, Workspace,
};
use together::advance_together;

/// A change of a base twin's equations. Every hook forwards to the base unless it is overridden.
///
/// Hooks of motion and outputs take several points at once, so that a filter pays one call for all of them.
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

    /// Calls `then` with the base twin's `now`.
    fn now<R>(&self, now: &Now<'_>, then: impl FnOnce(&Now<'_>) -> R) -> R {
        self.theta(now.theta, |theta| then(&Now { theta, ..*now }))
    }

    fn outline(&self) -> Outline {
        self.base().outline()
    }

    /// Rates of added states are zero.
    fn drift_each(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        let own = at.without(self.added());
        if own.states < at.states {
            for dx in at.each_mut(dx) {
                dx[own.states..].fill(0.0);
            }
        }
        self.now(now, |now| self.base().drift_each(now, own, x, dx));
    }

    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        let own = at.without(self.added());
        self.now(now, |now| self.base().observe_each(now, own, p, x, y));
    }

    /// Added states start at zero.
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        let (x, added) = x.split_at_mut(x.len() - self.added());
        added.fill(0.0);
        self.now(now, |now| self.base().start(now, x));
    }

    fn begin(&self, now: &Now<'_>, x: &mut [f64]) {
        let (x, _) = x.split_at_mut(x.len() - self.added());
        self.now(now, |now| self.base().begin(now, x));
    }

    /// The start of added states is known, or follows from the others.
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        let own = std.len() - self.added();
        self.now(now, |now| {
            self.base().start_deviation(now, &mut std[..own]);
        });
    }

    /// Added states have no noise.
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        let own = process.len() - self.added();
        self.now(now, |now| {
            self.base().noise(now, &mut process[..own], measurement);
        });
    }

    /// Added states have no limits.
    fn limits(&self) -> Vec<Interval> {
        let mut limits = self.base().limits();
        limits.resize(limits.len() + self.added(), Interval::EVERYTHING);
        limits
    }

    fn constrain_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        let own = at.without(self.added());
        self.now(now, |now| self.base().constrain_each(now, own, x));
    }

    fn update_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        let own = at.without(self.added());
        self.now(now, |now| self.base().update_each(now, own, x));
    }

    /// Returns whether any output changed.
    fn readout_each(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool {
        self.now(now, |now| self.base().readout_each(now, p, y))
    }

    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.theta(theta, |theta| self.base().check_parameters(theta, dt))
    }

    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.theta(theta, |theta| {
            self.base().corrupt_outputs(theta, noise, outputs);
        });
    }

    fn rounding(&self, theta: &[f64]) -> Vec<f64> {
        self.theta(theta, |theta| self.base().rounding(theta))
    }

    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        self.theta(theta, |theta| self.base().outliers(theta))
    }

    fn integrator(&self) -> Integrator {
        self.base().integrator()
    }

    fn stepping(&self) -> Stepping {
        self.base().stepping()
    }

    fn actuated(&self, theta: &[f64], drive: &Drive) -> Result<Option<Drive>, SimulationError> {
        self.theta(theta, |theta| self.base().actuated(theta, drive))
    }

    fn dead_time(&self, theta: &[f64], dt: f64) -> Vec<usize> {
        self.theta(theta, |theta| self.base().dead_time(theta, dt))
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
        self.drift_each(now, Layout::dense(x.len()), x, dx);
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.observe_each(now, Layout::dense(x.len()), y.len(), x, y);
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.start(now, x);
    }
    fn begin(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.begin(now, x);
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.0.start_deviation(now, std);
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.0.noise(now, process, measurement);
    }
    fn limits(&self) -> Vec<Interval> {
        self.0.limits()
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.constrain_each(now, Layout::dense(x.len()), x);
    }
    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        self.update_each(now, Layout::dense(x.len()), x);
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.readout_each(now, y.len(), y);
    }
    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.0.check_parameters(theta, dt)
    }
    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.0.corrupt_outputs(theta, noise, outputs);
    }
    fn rounding(&self, theta: &[f64]) -> Vec<f64> {
        self.0.rounding(theta)
    }
    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        self.0.outliers(theta)
    }
    fn integrator(&self) -> Integrator {
        self.0.integrator()
    }
    fn stepping(&self) -> Stepping {
        self.0.stepping()
    }
    fn actuated(&self, theta: &[f64], drive: &Drive) -> Result<Option<Drive>, SimulationError> {
        self.0.actuated(theta, drive)
    }
    fn dead_time(&self, theta: &[f64], dt: f64) -> Vec<usize> {
        self.0.dead_time(theta, dt)
    }
    fn run(&self, theta: &[f64], drive: &Drive, noise: Noise) -> Result<Signal, SimulationError> {
        M::run(self, theta, drive, noise)
    }
    fn drift_each(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        self.0.drift_each(now, at, x, dx);
    }
    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        self.0.observe_each(now, at, p, x, y);
    }
    fn update_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        self.0.update_each(now, at, x);
    }
    fn constrain_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        self.0.constrain_each(now, at, x);
    }
    fn readout_each(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool {
        self.0.readout_each(now, p, y)
    }
    fn advance_each(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool {
        // Loops of known length, for the sizes of most twins.
        match points.shifts.len() {
            2 => advance_together(self, 2, now, points, work),
            3 => advance_together(self, 3, now, points, work),
            4 => advance_together(self, 4, now, points, work),
            n => advance_together(self, n, now, points, work),
        }
    }
}
