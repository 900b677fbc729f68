//! Two Kalman filters side by side: one for the states, one for θ.

use super::BASELINE;
use crate::evaluate::EvaluateError;
use crate::likelihood::kalman::FilterError;
use crate::math::Stencil;
use crate::record::{Drive, Record};
use crate::twin::{Acting, Composed, Interval, Now, ParameterSpace, Workspace};
use nalgebra::{DMatrix, DVector};

/// Tracks θ along a record from `start`, brought into the bounds, and returns θ after the last row.
///
/// At each row, with A = ∂F/∂x, C = ∂g/∂x and the derivative W = ∂x̂/∂θ carried along,
///
/// ```text
/// e = y − g(x̂),    K = P·Cᵀ·(C·P·Cᵀ + R)⁻¹,      x̂ ← x̂ + K·e,    P ← (I − K·C)·P
/// H = C·W,         L = P_θ·Hᵀ·(H·P_θ·Hᵀ + R)⁻¹,   θ ← clip(θ + L·e),   P_θ ← (I − L·H)·P_θ
/// W ← A·(I − K·C)·W + ∂F/∂θ,   x̂ ← F(x̂, θ),   P ← A·P·Aᵀ + Q,   P_θ ← P_θ + Q_θ
/// ```
///
/// with all derivatives by differences, and states and θ brought into their limits and bounds. Every state starts at the
/// first output. This and the numbers are those of the authors' code, whatever the twin's own noise is.
///
/// Source: Wan & Nelson, "Dual extended Kalman filter methods", in Haykin (ed.), *Kalman Filtering and Neural Networks*
/// (2001), chapter 5, without the gain's own derivative.
pub fn dual_filter(
    twin: &Composed,
    record: &Record,
    start: &[f64],
) -> Result<Vec<f64>, EvaluateError> {
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
    let dead_time = twin.dead_time(&theta, drive.dt());
    let mut step = TwinStep::new(twin, space, p);

    let mut x = vec![record.outputs()[[0, 0]]; n];
    step.hold(&mut x);
    let mut x = DVector::from_vec(x);
    let mut spread = DMatrix::identity(n, n) * BASELINE.state_variance;
    let mut belief = DMatrix::identity(d, d) * BASELINE.parameter_variance;
    let mut sensitivity = DMatrix::zeros(n, d);
    let noise = DMatrix::identity(p, p) * (BASELINE.measurement * BASELINE.measurement);
    for k in 0..record.samples() {
        let acting = Acting::of(twin, &theta, drive)?;
        let now = acting.at(k);
        let diverged = || FilterError::Diverged { at: now.t };
        let seen = step.observe(&now, x.as_slice());
        let slope = step.observe_slope(&now, x.as_slice())?;
        let read = |j: usize| {
            let late = dead_time.get(j).copied().unwrap_or(0);
            record.outputs().get([k + late, j]).copied()
        };
        // Behind the end of the record, a late output says nothing.
        let error = DVector::from_fn(p, |j, _| read(j).map_or(0.0, |y| y - seen[j]));
        let gain = kalman_gain(&spread, &slope, &noise).ok_or_else(diverged)?;
        let kept = DMatrix::identity(n, n) - &gain * &slope;
        x += &gain * &error;
        step.hold(x.as_mut_slice());
        spread = symmetric(&kept * spread);

        let by_theta = &slope * &sensitivity;
        let gain = kalman_gain(&belief, &by_theta, &noise).ok_or_else(diverged)?;
        let change = &gain * &error;
        let moved: Vec<f64> = theta.iter().zip(&change).map(|(a, b)| a + b).collect();
        let next = space.clamp(&moved);
        belief = symmetric((DMatrix::identity(d, d) - &gain * by_theta) * belief);
        let finite = x.iter().chain(&spread).chain(&belief).chain(&next);
        if !finite.into_iter().all(|v| v.is_finite()) {
            return Err(diverged().into());
        }
        theta = next;

        let acting = Acting::of(twin, &theta, drive)?;
        let now = acting.at(k);
        let motion = step.advance_slope(&now, x.as_slice())?;
        sensitivity =
            &motion * (kept * sensitivity) + step.theta_slope((drive, k), &theta, x.as_slice())?;
        x = DVector::from_vec(step.advance(&now, x.as_slice()));
        step.hold(x.as_mut_slice());
        spread = symmetric(&motion * spread * motion.transpose());
        for i in 0..n {
            spread[(i, i)] += BASELINE.state_walk;
        }
        for j in 0..d {
            belief[(j, j)] += BASELINE.parameter_walk;
        }
    }
    Ok(theta)
}

/// P·Cᵀ·(C·P·Cᵀ + R)⁻¹.
fn kalman_gain(
    spread: &DMatrix<f64>,
    slope: &DMatrix<f64>,
    noise: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let cross = spread * slope.transpose();
    let total = symmetric(slope * &cross + noise);
    Some(total.cholesky()?.solve(&cross.transpose()).transpose())
}

fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

/// One step of the twin without noise, and its derivatives.
struct TwinStep<'a> {
    twin: &'a Composed,
    limits: Vec<Interval>,
    p: usize,
    steps: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    work: Workspace,
}

impl<'a> TwinStep<'a> {
    fn new(twin: &'a Composed, space: &ParameterSpace, p: usize) -> Self {
        Self {
            twin,
            limits: twin.limits().to_vec(),
            p,
            steps: space
                .widths()
                .iter()
                .map(|w| BASELINE.difference * w)
                .collect(),
            lower: space.bounds().iter().map(|b| b.low()).collect(),
            upper: space.bounds().iter().map(|b| b.high()).collect(),
            work: twin.workspace(),
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
        self.twin.step(now, &mut next, &mut self.work);
        self.twin.constrain(now, &mut next);
        next
    }

    fn observe(&self, now: &Now<'_>, x: &[f64]) -> DVector<f64> {
        let mut y = DVector::zeros(self.p);
        self.twin.observe(now, x, y.as_mut_slice());
        y
    }

    fn around(x: &[f64]) -> Result<Stencil, EvaluateError> {
        let steps: Vec<f64> = x
            .iter()
            .map(|v| BASELINE.difference * v.abs().max(1e-2))
            .collect();
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
            Ok(DVector::from_vec(self.advance(&acting.at(k), x)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Signal;
    use crate::twin::fixture::OneState;
    use crate::twin::{DigitalTwin, Noise, Parameter};

    /// ẋ = −k·x + u, measured well.
    fn leak() -> OneState {
        let k = Parameter::new("k", "1/s", 0.5, 1.5).within(0.1, 4.0);
        OneState {
            noise: [0.003, 0.02],
            ..OneState::leaking(k)
        }
    }

    #[test]
    fn it_converges_on_an_easy_linear_twin() {
        let inputs = Signal::from_shape_fn((600, 1), |(k, _)| [1.0, -0.5, 2.0][k / 50 % 3]);
        let drive = Drive::new(0.1, inputs).unwrap();
        for run in 0..6 {
            let outputs = leak()
                .simulate(&[1.4], &drive, Noise::new(1, "dual", run))
                .unwrap();
            let record = Record::new(drive.clone(), outputs).unwrap();
            for start in [0.7, 2.5] {
                let theta = dual_filter(&leak().into(), &record, &[start]).unwrap();
                assert!((theta[0] - 1.4).abs() < 0.05, "from {start}: {theta:?}");
            }
        }
    }

    #[test]
    fn it_stays_in_the_bounds() {
        let drive = Drive::new(0.1, Signal::ones((50, 1))).unwrap();
        let record = Record::new(drive, Signal::from_elem((50, 1), 40.0)).unwrap();
        let theta = dual_filter(&leak().into(), &record, &[9.0]).unwrap();
        assert!((0.1..=4.0).contains(&theta[0]), "{theta:?}");
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
        let theta = dual_filter(&twin.into(), &record, &[1.3]).unwrap();
        assert!((theta[0] - 1.5).abs() < 0.1, "{theta:?}");
    }
}
