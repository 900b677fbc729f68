//! Disturbances that stand for whatever is not in the library.

use super::entry::{Entry, LARGEST, share, started};
use crate::record::Quantity;
use crate::twin::{
    Layout, Modify, Now, Outline, Parameter, ParameterSpace, Role, StateSpace, Twin,
};
use smallvec::SmallVec;
use std::sync::Arc;

/// The twin with an Ornstein–Uhlenbeck disturbance: what an effect that nobody listed would look like to a filter.
///
/// ```text
/// d ← a·d + σ·√(1 − a²)·w        (a = 1: d ← d + σ·w)        ẋ_i + d,   y_j + d   or   θ_i·exp(d)
/// d ~ N(0, σ²) at the start      (a = 1: 0)
/// ```
///
/// θ is longer by σ > 0; a black box stays. A filter that may follow d gains on every gap at the right place, and on one elsewhere less.
pub(crate) fn disturbed(base: Twin, entry: Entry, memory: f64) -> Twin {
    base.modified(|base| {
        let mut outline = base.outline();
        // Noise may be coloured where something else is disturbed.
        let name = format!("disturbance/{}", outline.states.len());
        outline.states.push(Quantity::new(&name, ""));
        let sigma = Parameter::new(&name, "", 0.01, 1.0).with_role(Role::Magnitude);
        outline.parameters = ParameterSpace::new(outline.parameters.iter().cloned().chain([sigma]));
        Disturbed {
            base,
            entry,
            memory,
            outline,
        }
    })
}

struct Disturbed {
    base: Arc<dyn StateSpace>,
    entry: Entry,
    memory: f64,
    outline: Outline,
}

impl Disturbed {
    /// Calls `then` with parameter i as the disturbance `d` moves it.
    fn bent<R>(&self, now: &Now<'_>, i: usize, d: f64, then: impl FnOnce(&Now<'_>) -> R) -> R {
        let own = &now.theta[..now.theta.len() - 1];
        let mut theta: SmallVec<[f64; 16]> = SmallVec::from_slice(own);
        theta[i] *= d.clamp(-LARGEST, LARGEST).exp();
        then(&Now {
            theta: &theta,
            ..*now
        })
    }
}

impl Modify for Disturbed {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }
    fn added(&self) -> usize {
        1
    }
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&theta[..theta.len() - 1])
    }
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn drift_each(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        let own = at.states - 1;
        if let Entry::Parameter(i) = self.entry {
            for (x, dx) in at.each(x).zip(at.each_mut(dx)) {
                let (x, d) = x.split_at(own);
                let (dx, rate) = dx.split_at_mut(own);
                rate[0] = 0.0;
                self.bent(now, i, d[0], |now| self.base.drift(now, x, dx));
            }
            return;
        }
        self.now(now, |now| {
            self.base.drift_each(now, at.without(1), x, dx);
        });
        for (x, dx) in at.each(x).zip(at.each_mut(dx)) {
            dx[own] = 0.0;
            if let Entry::State(i) = self.entry {
                dx[i] += x[own];
            }
        }
    }
    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        let own = at.states - 1;
        if let Entry::Parameter(i) = self.entry {
            for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
                let (x, d) = x.split_at(own);
                self.bent(now, i, d[0], |now| self.base.observe(now, x, y));
            }
            return;
        }
        self.now(now, |now| {
            self.base.observe_each(now, at.without(1), p, x, y);
        });
        if let Entry::Sensor(j) = self.entry {
            for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
                y[j] += x[own];
            }
        }
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        let (std, own) = std.split_at_mut(std.len() - 1);
        self.now(now, |now| self.base.start_deviation(now, std));
        own[0] = started(self.memory) * now.theta[now.theta.len() - 1];
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        let (process, own) = process.split_at_mut(process.len() - 1);
        self.now(now, |now| self.base.noise(now, process, measurement));
        own[0] = share(self.memory) * now.theta[now.theta.len() - 1];
    }
    fn constrain_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        let Entry::Parameter(i) = self.entry else {
            return self.now(now, |now| {
                self.base.constrain_each(now, at.without(1), x);
            });
        };
        for x in at.each_mut(x) {
            let (x, d) = x.split_at_mut(at.states - 1);
            self.bent(now, i, d[0], |now| self.base.constrain(now, x));
        }
    }
    fn update_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        let own = at.states - 1;
        if let Entry::Parameter(i) = self.entry {
            for x in at.each_mut(x) {
                let (x, d) = x.split_at_mut(own);
                self.bent(now, i, d[0], |now| self.base.update(now, x));
            }
        } else {
            self.now(now, |now| self.base.update_each(now, at.without(1), x));
        }
        // Limits and motion of this step see the new value, as a held input does.
        for x in at.each_mut(x) {
            x[own] *= self.memory;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::Noise;
    use crate::twins::CascadedTanks;

    /// Without strength, nothing changes; with it, the disturbance has the standard deviation that σ says.
    #[test]
    fn a_disturbance_has_its_strength() {
        let base = Twin::new(CascadedTanks);
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
