//! Disturbances that stand for whatever is not in the library.

use crate::diagnose::hypotheses::disturbed_signals;
use crate::diagnose::hypotheses::entry::{Entry, share};
use crate::record::{Quantity, Signal};
use crate::twin::{
    DigitalTwin, Integrator, Interval, Now, Outliers, Outline, Parameter, ParameterSpace, Role,
    SimulationError, StateSpace,
};
use smallvec::SmallVec;
use std::sync::Arc;

/// The twin with an Ornstein–Uhlenbeck disturbance: what an effect that nobody listed would look like to a filter.
///
/// ```text
/// d ← a·d + σ·√(1 − a²)·w        (a = 1: d ← d + σ·w)        ẋ_i + d,   y_j + d   or   θ_i·exp(d)
/// ```
///
/// θ is longer by σ > 0. A filter that may follow d gains on every gap at the right place, and on one elsewhere less.
pub(in crate::diagnose) fn disturbed(
    base: Arc<dyn DigitalTwin>,
    place: Entry,
    memory: f64,
) -> Arc<dyn DigitalTwin> {
    let Some(mut outline) = base.state_space().map(StateSpace::outline) else {
        return disturbed_signals::disturbed(base, place, memory);
    };
    outline.states.push(Quantity::new("disturbance/0", ""));
    let sigma = Parameter::new("disturbance", "", 0.01, 1.0).with_role(Role::Effect);
    outline.parameters = ParameterSpace::new(outline.parameters.iter().cloned().chain([sigma]));
    Arc::new(Disturbed {
        base,
        place,
        memory,
        outline,
    })
}

struct Disturbed {
    base: Arc<dyn DigitalTwin>,
    place: Entry,
    memory: f64,
    outline: Outline,
}

impl Disturbed {
    fn inner(&self) -> &dyn StateSpace {
        self.base
            .state_space()
            .expect("only twins with equations are disturbed")
    }

    fn states(&self) -> usize {
        self.outline.states.len() - 1
    }

    fn with<R>(&self, now: &Now<'_>, d: f64, f: impl FnOnce(&dyn StateSpace, &Now<'_>) -> R) -> R {
        let own = &now.theta[..now.theta.len() - 1];
        let Entry::Parameter(i) = self.place else {
            return f(self.inner(), &Now { theta: own, ..*now });
        };
        let mut theta: SmallVec<[f64; 16]> = SmallVec::from_slice(own);
        theta[i] *= d.clamp(-5.0, 5.0).exp();
        let now = Now {
            theta: &theta,
            ..*now
        };
        f(self.inner(), &now)
    }
}

impl StateSpace for Disturbed {
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let n = self.states();
        let d = x[n];
        let (base, own) = dx.split_at_mut(n);
        own[0] = 0.0;
        self.with(now, d, |twin, now| twin.drift(now, &x[..n], base));
        if let Entry::State(i) = self.place {
            base[i] += d;
        }
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let n = self.states();
        self.with(now, x[n], |twin, now| twin.observe(now, &x[..n], y));
        if let Entry::Sensor(j) = self.place {
            y[j] += x[n];
        }
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        let n = self.states();
        x[n] = 0.0;
        self.with(now, 0.0, |twin, now| twin.start(now, &mut x[..n]));
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        let n = self.states();
        self.with(now, 0.0, |twin, now| {
            twin.noise(now, &mut process[..n], measurement);
        });
        let share = share(self.memory);
        process[n] = share * now.theta[now.theta.len() - 1];
    }
    fn limits(&self) -> Vec<Interval> {
        let mut limits = self.inner().limits();
        limits.push(Interval::EVERYTHING);
        limits
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        let n = self.states();
        let d = x[n];
        self.with(now, d, |twin, now| twin.constrain(now, &mut x[..n]));
    }
    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        let n = self.states();
        let d = x[n];
        self.with(now, d, |twin, now| twin.update(now, &mut x[..n]));
        // Limits and motion of this step see the new value, as a held input does.
        x[n] = self.memory * d;
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.with(now, 0.0, |twin, now| twin.readout(now, y));
    }
    fn admit(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.inner().admit(&theta[..theta.len() - 1], dt)
    }
    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        self.inner().outliers(&theta[..theta.len() - 1])
    }
    fn strike(&self, theta: &[f64], noise: crate::twin::Noise, outputs: &mut Signal) {
        self.inner()
            .strike(&theta[..theta.len() - 1], noise, outputs);
    }
    fn integrator(&self) -> Integrator {
        self.inner().integrator()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;
    use crate::twin::Noise;
    use crate::twins::CascadedTanks;

    /// Without strength, nothing changes; with it, the disturbance has the standard deviation that σ says.
    #[test]
    fn a_disturbance_has_its_strength() {
        let base: Arc<dyn DigitalTwin> = Arc::new(CascadedTanks);
        let drive = Drive::new(0.5, Signal::from_elem((3000, 1), 1.5)).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let noise = Noise::new(2, "t", 0);
        let plain = base.simulate(&theta, &drive, noise).unwrap();
        let twin = disturbed(base, Entry::Sensor(0), 0.8);
        let run = |sigma: f64| {
            let theta: Vec<f64> = theta.iter().copied().chain([sigma]).collect();
            twin.simulate(&theta, &drive, noise).unwrap()
        };
        assert_eq!(run(0.0), plain);
        let difference = &run(0.3) - &plain;
        let variance = difference.mapv(|d| d * d).mean().unwrap();
        // Effective number of draws: 3000·(1 − a²)/(1 + a²) = 660; five standard deviations of the variance.
        assert!((variance / 0.09 - 1.0).abs() < 5.0 * (2.0f64 / 660.0).sqrt());
    }
}
