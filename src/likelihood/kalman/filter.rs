//! A filter bound to one twin and one record.

use super::gaussian::Gaussian;
use super::normal::clip::clip;
use super::{FilterError, FilterSettings};
use crate::record::Record;
use crate::twin::{Composed, Interval, ParameterSpace, TwinError};

/// A filter for many θ on one record: what does not depend on θ is prepared once.
///
/// ```text
/// row k:   predict ȳ_k from (m, P),  S_k,  e_k = y_k − ȳ_k          log p += −½(p·log 2π + log det S_k + e_kᵀS_k⁻¹e_k)
///          put y_k into (m, P)
///          carry (m, P) to row k + 1 under u_k, the states held in their limits
/// ```
///
/// [`Method::Points`](super::Method::Points): m and P are carried by points at ±√3 standard deviations along each direction that varies, state
/// and process noise alike; what does not vary (a known start, unused memories) costs no point. Points start
/// within the limits; what arrives is a normal state, and a limited one gets the mean and variance of the clipped
/// normal, its covariances the share that is inside.
///
/// [`Method::Extended`](super::Method::Extended): the same with derivatives at the mean, held in its limits, in place of points.
///
/// Missing outputs are left out of the row; a row without any is only carried on. Steps may vary from row to row.
///
/// A twin without measurement noise gets a variance of `noise_floor` times that of the record's output.
///
/// Sources: Nørgaard, Poulsen & Ravn, "New developments in state estimation for nonlinear systems", *Automatica* 36
/// (2000); Särkkä, *Bayesian Filtering and Smoothing* (2013), chapters 5, 6 and 9.
///
/// ```
/// use truetwin::likelihood::kalman::{FilterSettings, Kalman};
/// use truetwin::effect::*;
/// use truetwin::record::*;
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let settings = FilterSettings::default();
/// let kalman = Kalman::new(VanDerPol, &record, &settings)?;
/// assert!(kalman.log_likelihood(&[1.5])? > kalman.log_likelihood(&[1.6])?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Kalman<'a> {
    pub(super) twin: Composed,
    pub(super) record: &'a Record,
    pub(super) settings: &'a FilterSettings,
    pub(super) parameters: ParameterSpace,
    pub(super) states: usize,
    pub(super) channels: usize,
    /// `true` if outputs are missing.
    pub(super) gaps: bool,
    /// Limits of the states.
    pub(super) limits: Vec<Interval>,
    /// Least variances of the measurement noise.
    pub(super) floor: Vec<f64>,
    /// The same where the record's values are rounded, and the twin's are not.
    pub(super) unrounded: Vec<f64>,
    /// Jitter of readings at an end of the sensor's range, as standard deviations.
    pub(super) jitter: Vec<f64>,
    pub(super) start_covariance: Option<Vec<f64>>,
}

debug_by_name!(Kalman<'_>);

impl<'a> Kalman<'a> {
    /// Prepares a record.
    ///
    /// # Errors
    ///
    /// [`FilterError::Record`] where the channels differ, or settings that cannot be used.
    pub fn new(
        twin: impl Into<Composed>,
        record: &'a Record,
        settings: &'a FilterSettings,
    ) -> Result<Self, FilterError> {
        let twin = twin.into();
        let outline = twin.outline();
        let states = outline.states.len();
        settings.check(states)?;
        record.check_channels(&crate::record::Signals {
            inputs: outline.inputs,
            outputs: outline.outputs,
        })?;
        let limits = twin.limits().to_vec();
        let floor = settings.floors(record);
        Ok(Self {
            twin,
            record,
            settings,
            parameters: outline.parameters,
            states,
            channels: record.outputs().ncols(),
            gaps: !record.is_complete(),
            limits,
            unrounded: floor.clone(),
            floor,
            jitter: FilterSettings::jitters(record),
            start_covariance: (settings.start_covariance.as_ref())
                .map(|p| p.transpose().as_slice().to_vec()),
        })
    }

    /// Gives no row more than one density per cell of what the record's values are rounded to, unless the twin rounds them itself: a quiet
    /// twin could otherwise be as likely as it likes where a value repeats, and readings at an end of a range, too.
    ///
    /// ```text
    /// r² ≥ q²/2π:   N(ȳ; ȳ, r²) ≤ 1/q
    /// ```
    pub(in crate::likelihood) fn of_cells(mut self) -> Self {
        for (j, cell) in self.record.cells().iter().enumerate() {
            self.unrounded[j] = self.unrounded[j].max(*cell);
            self.jitter[j] = self.jitter[j].max(cell.sqrt());
        }
        self
    }

    /// The parameters of the twin.
    pub fn parameters(&self) -> &ParameterSpace {
        &self.parameters
    }

    /// Checks whether θ has the twin's length.
    pub(super) fn check(&self, theta: &[f64]) -> Result<(), TwinError> {
        if theta.len() == self.parameters.len() {
            return Ok(());
        }
        Err(TwinError::Length {
            given: theta.len(),
            expected: self.parameters.len(),
            names: self.parameters.names().join(", "),
        })
    }

    /// Returns a state held in its limits, as people see it.
    pub(super) fn held_in_limits(&self, mut state: Gaussian) -> Gaussian {
        let mut scale = vec![1.0; self.states];
        clip(&mut state.mean, &mut state.cov, &self.limits, &mut scale);
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Drive, Signal};
    use crate::twin::{Now, Outline, Parameter};

    /// Shows its input, without noise.
    struct Through;
    impl crate::twin::StateSpace for Through {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("none", "1", 0.5, 1.5))
                .state("x", "V")
                .input("u", "V")
                .output("y", "V")
        }
        fn drift(&self, _: &Now<'_>, _: &[f64], dx: &mut [f64]) {
            dx.fill(0.0);
        }
        fn observe(&self, now: &Now<'_>, _: &[f64], y: &mut [f64]) {
            y[0] = now.u[0];
        }
    }

    /// A twin that meets rounded values exactly is no likelier than one that is sure of every cell; unrounded values have no cells.
    #[test]
    fn no_row_has_more_than_one_density_per_cell() {
        let settings = FilterSettings::default();
        let log_likelihood = |values: &dyn Fn(usize) -> f64| {
            let u = Signal::from_shape_fn((200, 1), |(k, _)| values(k));
            let record = Record::new(Drive::new(0.5, u.clone()).unwrap(), u).unwrap();
            let bare = Kalman::new(Through, &record, &settings).unwrap();
            let bare = bare.log_likelihood(&[1.0]).unwrap();
            let kalman = Kalman::new(Through, &record, &settings).unwrap().of_cells();
            (bare, kalman.log_likelihood(&[1.0]).unwrap())
        };
        let wave = |k: usize| 3.0 * (0.7 * k as f64).sin();
        let (bare, of_cells) = log_likelihood(&|k| (wave(k) / 0.4).round() * 0.4);
        let bound = -200.0 * 0.4f64.ln();
        assert!(
            (of_cells - bound).abs() < 1e-6 * bound.abs(),
            "{of_cells} {bound}"
        );
        assert!(bare > 2.0 * bound, "{bare}");
        let (bare, of_cells) = log_likelihood(&wave);
        assert_eq!(bare, of_cells);
    }
}
