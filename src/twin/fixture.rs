//! Twins for tests.

use super::{
    DigitalTwin, Integrator, Noise, Now, Outline, Parameter, ParameterSpace, SimulationError,
    StateSpace, Stepping,
};
use crate::record::{Drive, Signal, Signals};

/// y = f(θ, u) at once, without noise; parameters `a` and `b`, of which it has D.
pub(crate) struct AtOnce<const D: usize>(pub fn(&[f64], f64) -> f64);

impl<const D: usize> DigitalTwin for AtOnce<D> {
    fn parameters(&self) -> ParameterSpace {
        let names = ["a", "b"].into_iter().take(D);
        ParameterSpace::new(names.map(|name| Parameter::new(name, "", 0.5, 2.0)))
    }

    fn simulate(&self, theta: &[f64], drive: &Drive, _: Noise) -> Result<Signal, SimulationError> {
        Ok(Signal::from_shape_fn((drive.samples(), 1), |(k, _)| {
            self.0(theta, drive.input(k).first().copied().unwrap_or(0.0))
        }))
    }
}

/// One state that is measured: ẋ = rate(θ, u, x), y = x.
#[derive(Clone)]
pub(crate) struct OneState {
    pub parameters: ParameterSpace,
    pub state: &'static str,
    /// Inputs, all of one name.
    pub inputs: usize,
    pub rate: fn(&[f64], &[f64], f64) -> f64,
    /// `None` where the start is unknown.
    pub start: Option<f64>,
    /// Levels of the state's noise and of the output's.
    pub noise: [f64; 2],
    pub integrator: Integrator,
    pub substeps: usize,
}

impl OneState {
    /// Without noise, from an unknown start.
    pub fn new(
        parameters: impl IntoIterator<Item = Parameter>,
        rate: fn(&[f64], &[f64], f64) -> f64,
    ) -> Self {
        Self {
            parameters: ParameterSpace::new(parameters),
            state: "x",
            inputs: 1,
            rate,
            start: None,
            noise: [0.0; 2],
            integrator: Integrator::Euler,
            substeps: 1,
        }
    }

    /// ẋ = Σu − k·x.
    pub fn leaking(k: Parameter) -> Self {
        Self::new([k], |theta, u, x| u.iter().sum::<f64>() - theta[0] * x)
    }
}

impl StateSpace for OneState {
    fn outline(&self) -> Outline {
        let outline = Outline {
            parameters: self.parameters.clone(),
            ..Outline::new()
        };
        (0..self.inputs)
            .fold(outline, |outline, _| outline.input("u", "m"))
            .state(self.state, "m")
            .output("y", "m")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        dx[0] = (self.rate)(now.theta, now.u, x[0]);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now<'_>, x: &mut [f64]) {
        x[0] = self.start.unwrap_or(x[0]);
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        [process[0], measurement[0]] = self.noise;
    }
    fn integrator(&self) -> Integrator {
        self.integrator
    }
    fn stepping(&self) -> Stepping {
        Stepping {
            substeps: self.substeps,
            ..Stepping::default()
        }
    }
}

/// A twin without its equations.
pub(crate) struct Unseen<T>(pub T);

impl<T: StateSpace + 'static> DigitalTwin for Unseen<T> {
    fn parameters(&self) -> ParameterSpace {
        DigitalTwin::parameters(&self.0)
    }
    fn signals(&self) -> Signals {
        DigitalTwin::signals(&self.0)
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.0.simulate(theta, drive, noise)
    }
}
