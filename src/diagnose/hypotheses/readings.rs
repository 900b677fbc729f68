//! Unknown functions of states and inputs that an output may have beside what the twin's equations give it.

use super::basis::{Of, TERMS, sum_of_one};
use crate::twin::{
    Layout, Modify, Now, Outline, Parameter, ParameterSpace, Role, StateSpace, Twin,
};
use std::sync::Arc;

/// The twin with y_j + f(z), z a state or an input; θ is longer by the coefficients of f. A black box shows neither, and stays.
pub(in crate::diagnose) fn with_reading(
    base: Twin,
    output: usize,
    of: Of,
    ends: (f64, f64),
) -> Twin {
    base.modified(|base| {
        let mut outline = base.outline();
        let coefficients = (1..=TERMS).map(|k| {
            Parameter::new(&format!("reading/{k}"), "", -1.0, 1.0).with_role(Role::Magnitude)
        });
        outline.parameters =
            ParameterSpace::new(outline.parameters.iter().cloned().chain(coefficients));
        Reading {
            base,
            output,
            of,
            ends,
            outline,
        }
    })
}

struct Reading {
    base: Arc<dyn StateSpace>,
    output: usize,
    of: Of,
    ends: (f64, f64),
    outline: Outline,
}

impl Modify for Reading {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&theta[..theta.len() - TERMS])
    }
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn observe_each(&self, now: &Now<'_>, at: Layout, p: usize, x: &[f64], y: &mut [f64]) {
        self.now(now, |now| self.base.observe_each(now, at, p, x, y));
        let coefficients = &now.theta[now.theta.len() - TERMS..];
        for (x, y) in at.each(x).zip(y.chunks_exact_mut(p)) {
            let z = self.of.value(x, now.u, y[self.output]);
            y[self.output] += sum_of_one(coefficients, z, self.ends);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twins::CascadedTanks;

    /// The output alone moves, by the function of the input.
    #[test]
    fn an_output_has_its_function() {
        let base = Twin::new(CascadedTanks);
        let inputs = Signal::from_shape_fn((50, 1), |(k, _)| 1.0 + 0.02 * k as f64);
        let drive = Drive::new(0.5, inputs).unwrap();
        let theta = [0.6, 0.5, 0.55, 1.0];
        let plain = base.free_run(&theta, &drive).unwrap();
        let twin = with_reading(base, 0, Of::Input(0), (0.0, 4.0));
        let mut longer = [&theta[..], &[0.0; TERMS]].concat();
        assert_eq!(twin.free_run(&longer, &drive).unwrap(), plain);
        longer[4] = 0.3;
        let moved = twin.free_run(&longer, &drive).unwrap() - &plain;
        for (k, moved) in moved.iter().enumerate() {
            let z = drive.input(k)[0] / 4.0;
            let f = 0.3 * std::f64::consts::SQRT_2 * (std::f64::consts::PI * z).sin();
            assert!((moved - f).abs() < 1e-12, "{k}");
        }
    }
}
