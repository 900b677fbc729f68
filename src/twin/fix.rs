//! A twin with some parameters held at known values.

use super::state_space::check_parameters;
use crate::record::{Drive, Signal, Signals};
use crate::twin::{
    DigitalTwin, Integrator, Interval, Noise, Now, Outliers, Outline, ParameterError,
    ParameterSpace, SimulationError, StateSpace,
};
use smallvec::SmallVec;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The twin with the named parameters held; θ is shorter by them.
///
/// # Errors
///
/// [`ParameterError`] for an unknown name, or when nothing is left to estimate. Whether values make sense is the
/// caller's to check: a magnitude may be held at infinity.
///
/// ```
/// use std::collections::BTreeMap;
/// use std::sync::Arc;
/// use truetwin::twin::{DigitalTwin, fix};
/// use truetwin::twins::CascadedTanks;
///
/// let held = BTreeMap::from([("k4".to_owned(), 1.0)]);
/// let twin = fix(Arc::new(CascadedTanks), &held)?;
/// assert_eq!(twin.parameters().names(), ["k1", "k2", "k3"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fix(
    base: Arc<dyn DigitalTwin>,
    values: &BTreeMap<String, f64>,
) -> Result<Arc<dyn DigitalTwin>, ParameterError> {
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
    free.check()?;
    let map = Held { held };
    Ok(match base.state_space().map(StateSpace::outline) {
        Some(outline) => Arc::new(FixedTwin {
            equations: FixedEquations {
                outline: Outline {
                    parameters: free,
                    ..outline
                },
                base,
                map,
            },
        }),
        None => Arc::new(FixedBlackBox { base, free, map }),
    })
}

/// Where the free parameters stand among all.
struct Held {
    held: Vec<Option<f64>>,
}

impl Held {
    fn complete(&self, free: &[f64]) -> SmallVec<[f64; 16]> {
        let mut free = free.iter();
        (self.held.iter())
            .map(|held| held.unwrap_or_else(|| free.next().copied().unwrap_or(f64::NAN)))
            .collect()
    }
}

/// A state-space twin with held parameters. Its runs are the base twin's own, which may do more than equations.
struct FixedTwin {
    equations: FixedEquations,
}

impl DigitalTwin for FixedTwin {
    fn parameters(&self) -> ParameterSpace {
        self.equations.outline.parameters.clone()
    }
    fn state_space(&self) -> Option<&dyn StateSpace> {
        Some(&self.equations)
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let FixedEquations { base, map, outline } = &self.equations;
        check_parameters(outline.parameters.len(), theta)?;
        base.simulate(&map.complete(theta), drive, noise)
    }
}

struct FixedEquations {
    base: Arc<dyn DigitalTwin>,
    map: Held,
    outline: Outline,
}

impl FixedEquations {
    fn inner<R>(&self, now: &Now<'_>, with: impl FnOnce(&dyn StateSpace, &Now<'_>) -> R) -> R {
        let theta = self.map.complete(now.theta);
        let now = Now {
            theta: &theta,
            ..*now
        };
        with(self.equations(), &now)
    }

    fn equations(&self) -> &dyn StateSpace {
        self.base
            .state_space()
            .expect("fix builds this type for twins with equations only")
    }
}

impl StateSpace for FixedEquations {
    fn outline(&self) -> Outline {
        self.outline.clone()
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.inner(now, |twin, now| twin.drift(now, x, dx));
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.inner(now, |twin, now| twin.observe(now, x, y));
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.inner(now, |twin, now| twin.start(now, x));
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.inner(now, |twin, now| twin.noise(now, process, measurement));
    }
    fn limits(&self) -> Vec<Interval> {
        self.equations().limits()
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.inner(now, |twin, now| twin.constrain(now, x));
    }
    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        self.inner(now, |twin, now| twin.update(now, x));
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        self.inner(now, |twin, now| twin.readout(now, y));
    }
    fn integrator(&self) -> Integrator {
        self.equations().integrator()
    }
    fn admit(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.equations().admit(&self.map.complete(theta), dt)
    }
    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        self.equations().outliers(&self.map.complete(theta))
    }
    fn strike(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        self.equations()
            .strike(&self.map.complete(theta), noise, outputs);
    }
}

/// A black box with held parameters.
struct FixedBlackBox {
    base: Arc<dyn DigitalTwin>,
    free: ParameterSpace,
    map: Held,
}

impl DigitalTwin for FixedBlackBox {
    fn parameters(&self) -> ParameterSpace {
        self.free.clone()
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
        check_parameters(self.free.len(), theta)?;
        self.base.simulate(&self.map.complete(theta), drive, noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Quantity;
    use crate::twin::Parameter;

    /// y = a + 10·b.
    struct Sum;
    impl DigitalTwin for Sum {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new(["a", "b"].map(|n| Parameter::new(n, "", 0.0, 9.0)))
        }
        fn signals(&self) -> Signals {
            Signals {
                inputs: vec![],
                outputs: vec![Quantity::new("y", "")],
            }
        }
        fn simulate(
            &self,
            theta: &[f64],
            drive: &Drive,
            _: Noise,
        ) -> Result<Signal, SimulationError> {
            Ok(Signal::from_elem(
                (drive.samples(), 1),
                theta[0] + 10.0 * theta[1],
            ))
        }
    }

    #[test]
    fn held_parameters_leave_theta() {
        let values = |pairs: &[(&str, f64)]| pairs.iter().map(|&(n, v)| (n.into(), v)).collect();
        let twin = fix(Arc::new(Sum), &values(&[("a", 3.0)])).unwrap();
        assert_eq!(twin.parameters().names(), ["b"]);
        let drive = Drive::autonomous(1.0, 1).unwrap();
        assert_eq!(
            twin.simulate(&[2.0], &drive, Noise::OFF).unwrap()[[0, 0]],
            23.0
        );
        for bad in [&[("c", 1.0)][..], &[("a", 1.0), ("b", 1.0)]] {
            assert!(fix(Arc::new(Sum), &values(bad)).is_err());
        }
    }
}
