//! Unknown functions of states, inputs and time that enter at an output or in a parameter.
//!
//! ```text
//! y_j + f(z)   or   θ_i·exp(f(z))        z: a state, an input or time
//! ```

use super::basis::{Of, TERMS, sum_of_one};
use super::entry::{Entered, Entry, LARGEST, with_coefficients};
use crate::twin::{Layout, Modify, Now, Outline, StateSpace, Twin};
use smallvec::SmallVec;
use std::sync::Arc;

/// The twin with a function; θ is longer by its coefficients. A black box stays.
pub(crate) fn with_function(base: Twin, function: Entered) -> Twin {
    base.modified(|base| {
        let mut outline = base.outline();
        outline.parameters = with_coefficients(&outline.parameters);
        WithFunction {
            base,
            function,
            outline,
        }
    })
}

struct WithFunction {
    base: Arc<dyn StateSpace>,
    function: Entered,
    outline: Outline,
}

impl WithFunction {
    /// The function's value beside these states and this signal.
    fn value(&self, now: &Now<'_>, x: &[f64], signal: f64) -> f64 {
        let coefficients = &now.theta[now.theta.len() - TERMS..];
        let z = self.function.of.value(now.t, x, now.u, signal);
        sum_of_one(coefficients, z, self.function.ends)
    }

    /// Calls `then` with θ as it is beside the states x.
    fn bent<R>(&self, now: &Now<'_>, x: &[f64], then: impl FnOnce(&Now<'_>) -> R) -> R {
        let mut theta: SmallVec<[f64; 16]> =
            SmallVec::from_slice(&now.theta[..now.theta.len() - TERMS]);
        if let Entry::Parameter(i) = self.function.entry {
            theta[i] *= self.value(now, x, 0.0).clamp(-LARGEST, LARGEST).exp();
        }
        then(&Now {
            theta: &theta,
            ..*now
        })
    }

    /// Changes each x, θ being as it is beside the value before.
    fn each_bent(
        &self,
        now: &Now<'_>,
        at: Layout,
        x: &mut [f64],
        change: impl Fn(&Now<'_>, &mut [f64]),
    ) {
        for x in at.each_mut(x) {
            let seen: SmallVec<[f64; 16]> = SmallVec::from_slice(x);
            self.bent(now, &seen, |now| change(now, x));
        }
    }

    /// Returns whether θ is the same beside all states.
    fn is_common(&self) -> bool {
        !matches!(
            (self.function.entry, self.function.of),
            (Entry::Parameter(_), Of::State(_))
        )
    }
}

impl Modify for WithFunction {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&theta[..theta.len() - TERMS])
    }
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn drift_each(&self, now: &Now<'_>, at: Layout, x: &[f64], dx: &mut [f64]) {
        if self.is_common() {
            return self.bent(now, &[], |now| self.base.drift_each(now, at, x, dx));
        }
        for (x, dx) in at.each(x).zip(at.each_mut(dx)) {
            self.bent(now, x, |now| self.base.drift(now, x, dx));
        }
    }
    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        if self.is_common() {
            self.bent(now, &[], |now| self.base.observe_each(now, at, p, x, y));
        } else {
            for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
                self.bent(now, x, |now| self.base.observe(now, x, y));
            }
        }
        if let Entry::Sensor(j) = self.function.entry {
            for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
                y[j] += self.value(now, x, y[j]);
            }
        }
    }
    fn constrain_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        if self.is_common() {
            return self.bent(now, &[], |now| self.base.constrain_each(now, at, x));
        }
        self.each_bent(now, at, x, |now, x| self.base.constrain(now, x));
    }
    fn update_each(&self, now: &Now<'_>, at: Layout, x: &mut [f64]) {
        if self.is_common() {
            return self.bent(now, &[], |now| self.base.update_each(now, at, x));
        }
        self.each_bent(now, at, x, |now, x| self.base.update(now, x));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twins::CascadedTanks;
    use std::f64::consts::{PI, SQRT_2};

    fn rising() -> Drive {
        let inputs = Signal::from_shape_fn((50, 1), |(k, _)| 1.0 + 0.02 * k as f64);
        Drive::new(0.5, inputs).unwrap()
    }

    const THETA: [f64; 4] = [0.6, 0.5, 0.55, 1.0];

    /// The output alone moves, by the function of the input.
    #[test]
    fn an_output_has_its_function() {
        let (base, drive) = (Twin::new(CascadedTanks), rising());
        let plain = base.free_run(&THETA, &drive).unwrap();
        let function = Entered {
            entry: Entry::Sensor(0),
            of: Of::Input(0),
            ends: (0.0, 4.0),
        };
        let twin = with_function(base, function);
        let mut longer = [&THETA[..], &[0.0; TERMS]].concat();
        assert_eq!(twin.free_run(&longer, &drive).unwrap(), plain);
        longer[4] = 0.3;
        let moved = twin.free_run(&longer, &drive).unwrap() - &plain;
        for (k, moved) in moved.iter().enumerate() {
            let z = drive.input(k)[0] / 4.0;
            let f = 0.3 * SQRT_2 * (PI * z).sin();
            assert!((moved - f).abs() < 1e-12, "{k}");
        }
    }

    /// A gain of the pump that follows its own input is that of a twin whose input is larger by as much; one that follows a level is
    /// another one.
    #[test]
    fn a_parameter_follows_its_function() {
        let (base, drive) = (Twin::new(CascadedTanks), rising());
        let theta: Vec<f64> = THETA
            .iter()
            .copied()
            .chain([0.3])
            .chain([0.0; TERMS - 1])
            .collect();
        let twin = |of| {
            let function = Entered {
                entry: Entry::Parameter(3),
                of,
                ends: (0.0, 4.0),
            };
            with_function(base.clone(), function)
                .free_run(&theta, &drive)
                .unwrap()
        };
        let larger = drive
            .inputs()
            .mapv(|u| u * (0.3 * SQRT_2 * (PI * u / 4.0).sin()).exp());
        let larger = Drive::new(0.5, larger).unwrap();
        let expected = base.free_run(&THETA, &larger).unwrap();
        let difference = |found: Signal| (found - &expected).mapv(f64::abs).sum();
        assert!(difference(twin(Of::Input(0))) < 1e-9);
        assert!(difference(twin(Of::State(0))) > 1e-3);
        assert!(difference(twin(Of::Time)) > 1e-3);
    }
}
