//! Two Kalman filters side by side: one for the states, one for θ.

use crate::evaluate::EvaluateError;
use crate::likelihood::kalman::FilterError;
use crate::math::{Stencil, to_vector};
use crate::record::{Drive, Record, Signal};
use crate::setting::SettingError;
use crate::twin::{Acting, Interval, Now, ParameterSpace, StateSpace, Workspace};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Where the states of a [`DualFilter`] start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum DualStart {
    /// Every state at the first output, as in the authors' code.
    #[default]
    FirstOutput,
    /// Where the twin says.
    Twin,
}

/// Settings of the dual extended Kalman filter.
///
/// At each row, with A = ∂F/∂x, C = ∂g/∂x and the derivative W = ∂x̂/∂θ carried along,
///
/// ```text
/// e = y − g(x̂),    K = P·Cᵀ·(C·P·Cᵀ + R)⁻¹,      x̂ ← x̂ + K·e,    P ← (I − K·C)·P
/// H = C·W,         L = P_θ·Hᵀ·(H·P_θ·Hᵀ + R)⁻¹,   θ ← clip(θ + L·e),   P_θ ← (I − L·H)·P_θ
/// W ← A·(I − K·C)·W + ∂F/∂θ,   x̂ ← F(x̂, θ),   P ← A·P·Aᵀ + Q,   P_θ ← P_θ + Q_θ
/// ```
///
/// with all derivatives by differences, and states and θ brought into their limits and bounds.
///
/// | setting | default | range | meaning |
/// |---|---|---|---|
/// | `start` | first output | | where the states start |
/// | `state_variance`, `parameter_variance` | 1e-2, 0.1 | ≥ 0 | diagonals of P and P_θ at the first row, in squared units |
/// | `state_walk`, `parameter_walk` | 1e-5, 1e-7 | ≥ 0 | diagonals of Q and Q_θ, in squared units a step |
/// | `measurement` | 0.02 | > 0 | √R, in output units |
///
/// The numbers are those of the authors' code, whatever the twin's own noise is.
///
/// Source: Wan & Nelson, "Dual extended Kalman filter methods", in Haykin (ed.), *Kalman Filtering and Neural Networks*
/// (2001), chapter 5, without the gain's own derivative.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DualFilter {
    /// Where the states start.
    pub start: DualStart,
    /// Variance of each state at the first row.
    pub state_variance: f64,
    /// Variance of each parameter at the first row.
    pub parameter_variance: f64,
    /// Variance added to each state a step.
    pub state_walk: f64,
    /// Variance added to each parameter a step.
    pub parameter_walk: f64,
    /// Standard deviation of the measurement.
    pub measurement: f64,
}

impl Default for DualFilter {
    fn default() -> Self {
        Self {
            start: DualStart::default(),
            state_variance: 1e-2,
            parameter_variance: 0.1,
            state_walk: 1e-5,
            parameter_walk: 1e-7,
            measurement: 0.02,
        }
    }
}

/// Result of a dual filter.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DualFiltered {
    /// θ after the last row, within the bounds.
    pub theta: Vec<f64>,
    /// θ after each row (N × d).
    pub trajectory: Signal,
    /// Covariance of θ after the last row, as the filter believes (d × d).
    pub covariance: DMatrix<f64>,
}

/// Step of differences, relative to the scale of what is varied.
const DIFFERENCE: f64 = 1e-5;

impl DualFilter {
    /// Tracks θ along a record from `start`, which is brought into the bounds first.
    ///
    /// # Errors
    ///
    /// [`EvaluateError`]: what does not fit; [`FilterError::Diverged`] when the filter leaves the finite numbers.
    pub fn run(
        &self,
        twin: &dyn StateSpace,
        record: &Record,
        start: &[f64],
    ) -> Result<DualFiltered, EvaluateError> {
        for (name, value) in [
            ("state_variance", self.state_variance),
            ("parameter_variance", self.parameter_variance),
            ("state_walk", self.state_walk),
            ("parameter_walk", self.parameter_walk),
        ] {
            SettingError::unless(value >= 0.0, name, value, "a variance is 0 or more")?;
        }
        let sd = self.measurement;
        SettingError::unless(
            sd > 0.0,
            "measurement",
            sd,
            "it must be positive, such as 0.02",
        )?;
        let outline = twin.outline();
        record.check_channels(&crate::record::Signals {
            inputs: outline.inputs.clone(),
            outputs: outline.outputs.clone(),
        })?;
        record.check_complete()?;
        let space = &outline.parameters;
        let mut theta = space.clamp(start);
        space.check_point(&theta)?;
        let drive = record.drive();
        twin.check_parameters(&theta, drive.dt())?;
        let (n, p, d) = (outline.states.len(), outline.outputs.len(), theta.len());
        let mut step = Step::new(twin, space, p);

        let mut x = vec![0.0; n];
        twin.start(&Acting::of(twin, &theta, drive)?.at(0, &theta), &mut x);
        if self.start == DualStart::FirstOutput {
            x.fill(record.outputs()[[0, 0]]);
        }
        step.hold(&mut x);
        let mut x = DVector::from_vec(x);
        let mut spread = DMatrix::identity(n, n) * self.state_variance;
        let mut belief = DMatrix::identity(d, d) * self.parameter_variance;
        let mut sensitivity = DMatrix::zeros(n, d);
        let noise = DMatrix::identity(p, p) * (sd * sd);
        let mut trajectory = Signal::zeros((record.samples(), d));
        for k in 0..record.samples() {
            let acting = Acting::of(twin, &theta, drive)?;
            let now = acting.at(k, &theta);
            let diverged = || FilterError::Diverged { at: now.t };
            let seen = step.observe(&now, x.as_slice());
            let slope = step.observe_slope(&now, x.as_slice())?;
            let error = to_vector(&record.outputs().row(k)) - seen;
            let gain = gain(&spread, &slope, &noise).ok_or_else(diverged)?;
            let kept = DMatrix::identity(n, n) - &gain * &slope;
            x += &gain * &error;
            step.hold(x.as_mut_slice());
            spread = symmetric(&kept * spread);

            let by_theta = &slope * &sensitivity;
            let gain = self::gain(&belief, &by_theta, &noise).ok_or_else(diverged)?;
            let change = &gain * &error;
            let moved: Vec<f64> = theta.iter().zip(&change).map(|(a, b)| a + b).collect();
            let next = space.clamp(&moved);
            belief = symmetric((DMatrix::identity(d, d) - &gain * by_theta) * belief);
            let finite = x.iter().chain(&spread).chain(&belief).chain(&next);
            if !finite.into_iter().all(|v| v.is_finite()) {
                return Err(diverged().into());
            }
            theta = next;
            for (to, from) in trajectory.row_mut(k).iter_mut().zip(&theta) {
                *to = *from;
            }

            let acting = Acting::of(twin, &theta, drive)?;
            let now = acting.at(k, &theta);
            let motion = step.advance_slope(&now, x.as_slice())?;
            sensitivity = &motion * (kept * sensitivity)
                + step.theta_slope((drive, k), &theta, x.as_slice())?;
            x = DVector::from_vec(step.advance(&now, x.as_slice()));
            step.hold(x.as_mut_slice());
            spread = symmetric(&motion * spread * motion.transpose());
            for i in 0..n {
                spread[(i, i)] += self.state_walk;
            }
            for j in 0..d {
                belief[(j, j)] += self.parameter_walk;
            }
        }
        Ok(DualFiltered {
            theta,
            trajectory,
            covariance: belief,
        })
    }
}

/// P·Cᵀ·(C·P·Cᵀ + R)⁻¹.
fn gain(spread: &DMatrix<f64>, slope: &DMatrix<f64>, noise: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let cross = spread * slope.transpose();
    let total = symmetric(slope * &cross + noise);
    Some(total.cholesky()?.solve(&cross.transpose()).transpose())
}

fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

/// One step of the twin without noise, and its derivatives.
struct Step<'a> {
    twin: &'a dyn StateSpace,
    limits: Vec<Interval>,
    p: usize,
    steps: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    work: Workspace,
}

impl<'a> Step<'a> {
    fn new(twin: &'a dyn StateSpace, space: &ParameterSpace, p: usize) -> Self {
        Self {
            twin,
            limits: twin.limits(),
            p,
            steps: space.widths().iter().map(|w| DIFFERENCE * w).collect(),
            lower: space.bounds().iter().map(|b| b.low()).collect(),
            upper: space.bounds().iter().map(|b| b.high()).collect(),
            work: Workspace::new(twin),
        }
    }

    fn hold(&self, x: &mut [f64]) {
        for (x, limit) in x.iter_mut().zip(&self.limits) {
            *x = limit.clamp(*x);
        }
    }

    /// Without limits: their slope would be zero, and θ would be unseen ever after.
    fn advance(&mut self, now: &Now<'_>, x: &[f64]) -> Vec<f64> {
        let mut next = x.to_vec();
        self.twin.advance(now, &mut next, &mut self.work);
        self.twin.constrain(now, &mut next);
        next
    }

    fn observe(&self, now: &Now<'_>, x: &[f64]) -> DVector<f64> {
        let mut y = DVector::zeros(self.p);
        self.twin.observe(now, x, y.as_mut_slice());
        y
    }

    fn around(x: &[f64]) -> Result<Stencil, EvaluateError> {
        let steps: Vec<f64> = x.iter().map(|v| DIFFERENCE * v.abs().max(1e-2)).collect();
        let free = vec![f64::INFINITY; x.len()];
        let below = vec![f64::NEG_INFINITY; x.len()];
        Ok(Stencil::new(x, &steps, &below, &free)?)
    }

    fn observe_slope(&self, now: &Now<'_>, x: &[f64]) -> Result<DMatrix<f64>, EvaluateError> {
        Self::around(x)?.jacobian(|x| Ok(self.observe(now, x)))
    }

    fn advance_slope(&mut self, now: &Now<'_>, x: &[f64]) -> Result<DMatrix<f64>, EvaluateError> {
        Self::around(x)?.jacobian(|x| Ok(DVector::from_vec(self.advance(now, x))))
    }

    /// At row k of a drive.
    fn theta_slope(
        &mut self,
        (drive, k): (&Drive, usize),
        theta: &[f64],
        x: &[f64],
    ) -> Result<DMatrix<f64>, EvaluateError> {
        let stencil = Stencil::new(theta, &self.steps, &self.lower, &self.upper)?;
        stencil.jacobian(|theta| {
            let acting = Acting::of(self.twin, theta, drive)?;
            Ok(DVector::from_vec(self.advance(&acting.at(k, theta), x)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Quantity;
    use crate::twin::{DigitalTwin, Noise, Outline, Parameter};

    /// ẋ = −k·x + u, measured well.
    struct Leak;
    impl StateSpace for Leak {
        fn outline(&self) -> Outline {
            Outline {
                parameters: ParameterSpace::new([
                    Parameter::new("k", "1/s", 0.5, 1.5).within(0.1, 4.0)
                ]),
                states: vec![Quantity::new("x", "m")],
                inputs: vec![Quantity::new("u", "m/s")],
                outputs: vec![Quantity::new("y", "m")],
            }
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = now.u[0] - now.theta[0] * x[0];
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
        fn noise(&self, _: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
            process[0] = 0.003;
            measurement[0] = 0.02;
        }
    }

    #[test]
    fn it_converges_on_an_easy_linear_twin() {
        let inputs = Signal::from_shape_fn((600, 1), |(k, _)| [1.0, -0.5, 2.0][k / 50 % 3]);
        let drive = Drive::new(0.1, inputs).unwrap();
        for run in 0..6 {
            let outputs = Leak
                .simulate(&[1.4], &drive, Noise::new(1, "dual", run))
                .unwrap();
            let record = Record::new(drive.clone(), outputs).unwrap();
            for start in [0.7, 2.5] {
                let found = DualFilter::default().run(&Leak, &record, &[start]).unwrap();
                let error = (found.theta[0] - 1.4).abs();
                assert!(error < 0.05, "from {start}: {}", found.theta[0]);
                assert_eq!(found.trajectory[[599, 0]], found.theta[0]);
                assert!(found.covariance[(0, 0)] < 0.1);
            }
        }
    }

    #[test]
    fn it_stays_in_the_bounds_and_names_bad_settings() {
        let drive = Drive::new(0.1, Signal::ones((50, 1))).unwrap();
        let record = Record::new(drive, Signal::from_elem((50, 1), 40.0)).unwrap();
        let found = DualFilter::default().run(&Leak, &record, &[9.0]).unwrap();
        assert!(found.trajectory.iter().all(|k| (0.1..=4.0).contains(k)));
        let bad = DualFilter {
            measurement: 0.0,
            ..DualFilter::default()
        };
        let error = bad.run(&Leak, &record, &[1.0]).unwrap_err().to_string();
        assert!(error.starts_with("measurement = 0"), "{error}");
    }

    /// A parameter that acts on an output only through two steps of the motion is seen: derivatives are carried along.
    #[test]
    fn derivatives_are_carried_through_the_states() {
        let drive = Drive::autonomous(0.05, 300).unwrap();
        let twin = crate::twins::VanDerPol;
        let outputs = twin
            .simulate(&[1.5], &drive, Noise::new(1, "dual", 0))
            .unwrap();
        let record = Record::new(drive, outputs).unwrap();
        for start in [DualStart::Twin, DualStart::FirstOutput] {
            let filter = DualFilter {
                start,
                ..DualFilter::default()
            };
            let found = filter.run(&twin, &record, &[1.3]).unwrap();
            assert!(
                (found.theta[0] - 1.5).abs() < 0.1,
                "{start:?} {:?}",
                found.theta
            );
        }
    }
}
