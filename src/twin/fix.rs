//! A twin with some parameters held at known values.

use super::simulation::check_length;
use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    DigitalTwin, KnownNoise, Modified, Modify, Noise, Outline, ParameterSpace, SimulationError,
    StateSpace, Twin, TwinError,
};
use smallvec::SmallVec;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Holds the named parameters of a twin; θ is shorter by them.
///
/// Refuses unknown names. All parameters may be held. Values are not checked: a magnitude may be held at infinity.
pub(crate) fn fix(
    base: impl Into<Twin>,
    values: &BTreeMap<String, f64>,
) -> Result<Twin, TwinError> {
    let base = base.into();
    if values.is_empty() {
        return Ok(base);
    }
    let all = base.parameters();
    for name in values.keys() {
        all.position(name)?;
    }
    let held: Vec<Option<f64>> = all.iter().map(|p| values.get(&p.name).copied()).collect();
    let free = ParameterSpace::new(
        (all.iter().zip(&held))
            .filter(|(_, held)| held.is_none())
            .map(|(p, _)| p.clone()),
    );
    if !free.is_empty() {
        free.check()?;
    }
    let held = Held(held);
    Ok(match base {
        Twin::Equations(base) => {
            let mut outline = base.outline();
            outline.parameters = free;
            Twin::Equations(Arc::new(Modified(Fixed {
                base,
                outline,
                held,
            })))
        }
        Twin::BlackBox(base) => Twin::BlackBox(Arc::new(HeldBlackBox {
            base,
            parameters: free,
            held,
        })),
    })
}

/// Values of all parameters; none for those that are free.
pub(super) struct Held(Vec<Option<f64>>);

impl Held {
    /// Leaves all of `parameters` free.
    pub fn none(parameters: usize) -> Self {
        Self(vec![None; parameters])
    }

    fn complete(&self, free: &[f64]) -> SmallVec<[f64; 16]> {
        let mut free = free.iter();
        (self.0.iter())
            .map(|held| held.unwrap_or_else(|| free.next().copied().unwrap_or(f64::NAN)))
            .collect()
    }
}

/// Equations with held parameters.
struct Fixed {
    base: Arc<dyn StateSpace>,
    outline: Outline,
    held: Held,
}

impl Modify for Fixed {
    fn base(&self) -> &dyn StateSpace {
        self.base.as_ref()
    }
    fn theta<R>(&self, theta: &[f64], then: impl FnOnce(&[f64]) -> R) -> R {
        then(&self.held.complete(theta))
    }
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn run(
        whole: &Modified<Self>,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let fixed = &whole.0;
        check_length(fixed.outline.parameters.len(), theta)?;
        (fixed.base).run(&fixed.held.complete(theta), drive, noise)
    }
}

/// A black box with held parameters, and the free ones in another setting.
pub(super) struct HeldBlackBox {
    pub base: Arc<dyn DigitalTwin>,
    pub parameters: ParameterSpace,
    pub held: Held,
}

impl DigitalTwin for HeldBlackBox {
    fn parameters(&self) -> ParameterSpace {
        self.parameters.clone()
    }
    fn signals(&self) -> Signals {
        self.base.signals()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        check_length(self.parameters.len(), theta)?;
        (self.base).simulate(&self.held.complete(theta), drive, noise)
    }
    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        check_length(self.parameters.len(), theta)?;
        self.base.free_run(&self.held.complete(theta), drive)
    }
    fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        check_length(self.parameters.len(), theta)?;
        (self.base).known_noise(&self.held.complete(theta), drive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::fixture::AtOnce;

    #[test]
    fn held_parameters_leave_theta() {
        let sum = || AtOnce::<2>(|theta, _| theta[0] + 10.0 * theta[1]);
        let values = |pairs: &[(&str, f64)]| pairs.iter().map(|&(n, v)| (n.into(), v)).collect();
        let twin = fix(Twin::new(sum()), &values(&[("a", 3.0)])).unwrap();
        assert_eq!(twin.parameters().names(), ["b"]);
        let drive = Drive::autonomous(1.0, 1).unwrap();
        assert_eq!(
            twin.simulate(&[2.0], &drive, Noise::OFF).unwrap()[[0, 0]],
            23.0
        );
        let whole = fix(Twin::new(sum()), &values(&[("a", 1.0), ("b", 2.0)])).unwrap();
        assert!(whole.parameters().is_empty());
        let run = whole.simulate(&[], &drive, Noise::OFF).unwrap();
        assert_eq!(run[[0, 0]], 21.0);
        assert!(fix(Twin::new(sum()), &values(&[("c", 1.0)])).is_err());
    }
}
