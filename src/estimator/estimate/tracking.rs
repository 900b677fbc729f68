//! Free run of the calibrated twin beside the record.

use crate::fit::least_squares::{Bounds, GaussNewton, ResidualProblem};
use crate::math::MathError;
use crate::math::Stencil;
use crate::record::{Record, Signal};
use crate::twin::{DigitalTwin, Interval, ParameterSpace, Role};
use nalgebra::{DMatrix, DVector};
use ndarray::Array1;

/// A free run beside a record.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Tracking {
    /// Outputs of the free run, N × channels.
    pub outputs: Signal,
    /// Root mean square of record − free run over all outputs that are not missing, in output units.
    pub rmse: f64,
    /// θ with unknown starts refitted to this record.
    pub theta: Vec<f64>,
}

/// The free run at θ, unknown starts refitted to the record by least squares; other parameters stay.
pub fn track(
    twin: &dyn DigitalTwin,
    theta: &[f64],
    record: &Record,
) -> Result<Tracking, MathError> {
    let space = twin.parameters();
    let starts: Vec<usize> = (0..space.len())
        .filter(|&j| space[j].role == Role::Start)
        .collect();
    let mut fitted = theta.to_vec();
    if !starts.is_empty() {
        let problem = StartFit {
            twin,
            space: &space,
            theta,
            record,
            starts: &starts,
        };
        let at = |of: fn(Interval) -> f64| -> DVector<f64> {
            DVector::from_iterator(starts.len(), starts.iter().map(|&j| of(space[j].bounds)))
        };
        let bounds = Bounds::new(at(Interval::low), at(Interval::high))
            .map_err(|error| MathError::Fatal(error.into()))?;
        let begin = DVector::from_iterator(starts.len(), starts.iter().map(|&j| theta[j]));
        let scale =
            DVector::from_iterator(starts.len(), starts.iter().map(|&j| space[j].prior.width()));
        let minimum = GaussNewton::default().minimise(&problem, &begin, &bounds, &scale)?;
        for (&j, value) in starts.iter().zip(minimum.theta.iter()) {
            fitted[j] = *value;
        }
    }
    let outputs = twin
        .free_run(&fitted, record.drive())
        .map_err(|error| MathError::Start(error.into()))?;
    let errors = record.outputs() - &outputs;
    let squares: Array1<f64> = (errors.iter())
        .filter(|d| !d.is_nan())
        .map(|d| d * d)
        .collect();
    Ok(Tracking {
        rmse: squares.mean().unwrap_or(0.0).sqrt(),
        outputs,
        theta: fitted,
    })
}

/// Residuals of the free run as a function of the unknown starts.
struct StartFit<'a> {
    twin: &'a dyn DigitalTwin,
    space: &'a ParameterSpace,
    theta: &'a [f64],
    record: &'a Record,
    starts: &'a [usize],
}

impl ResidualProblem for StartFit<'_> {
    fn dimension(&self) -> usize {
        self.starts.len()
    }

    fn residual(&self, starts: &DVector<f64>) -> Result<DVector<f64>, MathError> {
        let mut theta = self.theta.to_vec();
        for (&j, value) in self.starts.iter().zip(starts.iter()) {
            theta[j] = *value;
        }
        let run = (self.twin.free_run(&theta, self.record.drive())).map_err(MathError::rejected)?;
        let rows = (self.record.outputs().iter().zip(&run))
            .filter(|(y, _)| !y.is_nan())
            .map(|(y, f)| f - y);
        Ok(DVector::from_vec(rows.collect()))
    }

    fn jacobian(&self, starts: &DVector<f64>) -> Result<DMatrix<f64>, MathError> {
        let of = |value: fn(&crate::twin::Parameter) -> f64| -> Vec<f64> {
            self.starts.iter().map(|&j| value(&self.space[j])).collect()
        };
        let stencil = Stencil::new(
            starts.as_slice(),
            &of(|p| 1e-4 * p.prior.width()),
            &of(|p| p.bounds.low()),
            &of(|p| p.bounds.high()),
        )
        .map_err(MathError::fatal)?;
        stencil.jacobian(|point| self.residual(&DVector::from_column_slice(point)))
    }
}
