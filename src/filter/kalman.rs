//! A filter bound to one twin and one record.

use super::clip::clip;
use super::gaussian::{Gaussian, Root};
use super::moments::Moments;
use super::update::{Measured, Update};
use super::{FilterError, FilterSettings, Filtered, Method};
use crate::twin::{Interval, Now, ParameterError, ParameterSpace, Record, StateSpace};

/// A filter for many θ on one record: what does not depend on θ is prepared once.
///
/// ```text
/// row k:   predict ȳ_k from (m, P),  S_k,  e_k = y_k − ȳ_k          log p += −½(p·log 2π + log det S_k + e_kᵀS_k⁻¹e_k)
///          put y_k into (m, P)
///          carry (m, P) to row k + 1 under u_k, the states held in their limits
/// ```
///
/// [`Method::Points`]: m and P are carried by points at ±√3 standard deviations along each direction that varies, state
/// and process noise alike; what does not vary (a known start, unused memories) costs no point. Points start
/// within the limits; what arrives is a normal state, and a limited one gets the mean and variance of the clipped
/// normal, its covariances the share that is inside.
///
/// A twin without measurement noise gets a variance of `noise_floor` times that of the record's output.
///
/// Sources: Nørgaard, Poulsen & Ravn, "New developments in state estimation for nonlinear systems", *Automatica* 36
/// (2000); Särkkä, *Bayesian Filtering and Smoothing* (2013), chapters 5, 6 and 9.
///
/// ```
/// use truetwin::filter::{FilterSettings, Kalman};
/// use truetwin::twin::*;
/// use truetwin::twins::VanDerPol;
///
/// let drive = Drive::autonomous(0.05, 300)?;
/// let outputs = VanDerPol.simulate(&[1.5], &drive, Noise::new(1, "doc", 0))?;
/// let record = Record::new(drive, outputs)?;
/// let settings = FilterSettings::default();
/// let kalman = Kalman::new(&VanDerPol, &record, &settings)?;
/// assert!(kalman.log_likelihood(&[1.5])? > kalman.log_likelihood(&[1.6])?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Kalman<'a> {
    pub(super) twin: &'a dyn StateSpace,
    pub(super) record: &'a Record,
    pub(super) settings: &'a FilterSettings,
    pub(super) parameters: ParameterSpace,
    pub(super) states: usize,
    outputs: Vec<f64>,
    channels: usize,
    limits: Vec<(usize, Interval)>,
    floor: Vec<f64>,
    start_covariance: Option<Vec<f64>>,
}

/// What one row told.
pub(super) struct Innovation<'w> {
    pub log_density: f64,
    pub innovation: &'w [f64],
    /// p × p.
    pub covariance: &'w [f64],
    pub standardised: &'w [f64],
}

/// Who listens to a run. What is not needed is not computed.
pub(super) trait Sink {
    /// Whether [`carried`](Self::carried) is wanted.
    const CARRIED: bool = false;
    fn innovation(&mut self, _k: usize, _of: &Innovation<'_>) {}
    /// State given rows up to k.
    fn filtered(&mut self, _k: usize, _state: &Gaussian) {}
    /// State of row k + 1 given rows up to k, and cov(x_k, x_{k+1}).
    fn carried(&mut self, _k: usize, _next: &Gaussian, _cross: &[f64]) {}
}

impl Sink for () {}

impl<'a> Kalman<'a> {
    /// Prepares a record.
    ///
    /// # Errors
    ///
    /// [`FilterError::Record`] where the channels differ, or settings that cannot be used.
    pub fn new(
        twin: &'a dyn StateSpace,
        record: &'a Record,
        settings: &'a FilterSettings,
    ) -> Result<Self, FilterError> {
        let outline = twin.outline();
        let states = outline.states.len();
        settings.check(states)?;
        record.check_channels(&crate::twin::Signals {
            inputs: outline.inputs,
            outputs: outline.outputs,
        })?;
        let limits = (twin.limits().into_iter().enumerate())
            .filter(|(_, limit)| *limit != Interval::EVERYTHING)
            .collect();
        let floor = (record.outputs().columns().into_iter())
            .map(|y| settings.noise_floor * scale(y.iter().copied()))
            .collect();
        Ok(Self {
            twin,
            record,
            settings,
            parameters: outline.parameters,
            states,
            outputs: record.outputs().iter().copied().collect(),
            channels: record.outputs().ncols(),
            limits,
            floor,
            start_covariance: (settings.start_covariance.as_ref())
                .map(|p| p.transpose().as_slice().to_vec()),
        })
    }

    /// The parameters of the twin.
    pub fn parameters(&self) -> &ParameterSpace {
        &self.parameters
    }

    /// log p(y | θ), in nats.
    ///
    /// # Errors
    ///
    /// [`FilterError`]: θ of another length, a twin that refuses it, a filter that diverged or has no spread.
    pub fn log_likelihood(&self, theta: &[f64]) -> Result<f64, FilterError> {
        self.run(theta, &mut ())
    }

    /// Everything that [`Filtered`] holds.
    ///
    /// # Errors
    ///
    /// As [`log_likelihood`](Self::log_likelihood).
    pub fn filter(&self, theta: &[f64]) -> Result<Filtered, FilterError> {
        let states = self.settings.keep_states.then_some(self.states);
        let mut filtered = Filtered::new(self.record.samples(), self.channels, states);
        filtered.log_likelihood = self.run(theta, &mut filtered)?;
        if let Some(states) = &mut filtered.states {
            states.map(|state| self.told(state));
        }
        Ok(filtered)
    }

    /// The pass over the record; compiled once for each usual size, so that its loops have known ends.
    pub(super) fn run<S: Sink>(&self, theta: &[f64], sink: &mut S) -> Result<f64, FilterError> {
        match (self.states, self.channels) {
            (1, 1) => self.pass::<S, 1, 1>(theta, sink),
            (2, 1) => self.pass::<S, 2, 1>(theta, sink),
            (3, 1) => self.pass::<S, 3, 1>(theta, sink),
            (4, 1) => self.pass::<S, 4, 1>(theta, sink),
            _ => self.pass::<S, 0, 0>(theta, sink),
        }
    }

    /// The pass for N states and P outputs; 0: any number.
    fn pass<S: Sink, const N: usize, const P: usize>(
        &self,
        theta: &[f64],
        sink: &mut S,
    ) -> Result<f64, FilterError> {
        let drive = self.record.drive();
        let n = if N == 0 { self.states } else { N };
        let p = if P == 0 { self.channels } else { P };
        if theta.len() != self.parameters.len() {
            return Err(ParameterError::Length {
                given: theta.len(),
                expected: self.parameters.len(),
                names: self.parameters.names().join(", "),
            }
            .into());
        }
        self.twin.admit(theta, drive.dt())?;
        let mut now = Now {
            t: 0.0,
            dt: drive.dt(),
            u: drive.input(0),
            theta,
        };
        let mut moments = Moments::new(self.twin, self.settings.method, &self.limits, n, p);
        let mut update = Update::new(n, p);
        let (mut state, mut next) = (Gaussian::zero(n), Gaussian::zero(n));
        let mut root = Root::new(n);
        let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
        let (mut predicted, mut scale) = (vec![0.0; p], vec![1.0; n]);
        let mut cross = vec![0.0; if S::CARRIED { n * n } else { 0 }];
        self.twin.start(&now, &mut state.mean);
        if let Some(covariance) = &self.start_covariance {
            state.cov.copy_from_slice(covariance);
            self.hold(&mut state, &mut scale);
        }
        let mut log_likelihood = 0.0;
        let samples = drive.samples();
        for (k, y) in self.outputs.chunks_exact(p).enumerate() {
            (now.t, now.u) = (drive.time(k), drive.input(k));
            q.fill(0.0);
            r.fill(0.0);
            self.twin.noise(&now, &mut q, &mut r);
            root.factor(n, &state);
            let seen = moments.observe((n, p), &now, &state.mean, &root, &mut predicted);
            let row = Measured {
                y,
                predicted: &predicted,
                noise: &r,
                floor: &self.floor,
            };
            let log_density = (update.apply((n, p), (self.twin, &now), &row, seen, &mut state))
                .ok_or_else(|| self.lost(&state, &update, now.t))?;
            if !log_density.is_finite() {
                return Err(FilterError::Diverged { at: now.t });
            }
            log_likelihood += log_density;
            self.clamp_mean(&mut state);
            sink.innovation(
                k,
                &Innovation {
                    log_density,
                    innovation: &update.innovation,
                    covariance: &update.covariance,
                    standardised: &update.standardised,
                },
            );
            sink.filtered(k, &state);
            if k + 1 == samples {
                break;
            }
            root.factor(n, &state);
            moments.predict(n, &now, &q, &state.mean, &root, &mut next);
            let felt = self.hold(&mut next, &mut scale);
            if S::CARRIED {
                moments.cross(n, &root, &mut cross);
                if felt {
                    for row in cross.chunks_exact_mut(n) {
                        for (c, scale) in row.iter_mut().zip(&scale) {
                            *c *= scale;
                        }
                    }
                }
                sink.carried(k, &next, &cross);
            }
            std::mem::swap(&mut state, &mut next);
        }
        Ok(log_likelihood)
    }

    /// Holds the states in their limits; whether covariances were scaled.
    #[inline]
    fn hold(&self, state: &mut Gaussian, scale: &mut [f64]) -> bool {
        match self.settings.method {
            Method::Points => clip(state, &self.limits, scale),
            Method::Extended => {
                self.clamp_mean(state);
                false
            }
        }
    }

    /// After a row, only the linear filter holds its mean; the points of the other are held when they are carried on.
    #[inline]
    fn clamp_mean(&self, state: &mut Gaussian) {
        if self.settings.method == Method::Extended {
            for &(i, limit) in &self.limits {
                state.mean[i] = limit.clamp(state.mean[i]);
            }
        }
    }

    /// A state as it is told to people: within its limits.
    pub(super) fn told(&self, state: &Gaussian) -> Gaussian {
        let mut told = state.clone();
        self.hold(&mut told, &mut vec![1.0; self.states]);
        told
    }

    fn lost(&self, state: &Gaussian, update: &Update, at: f64) -> FilterError {
        let finite = (state.mean.iter().chain(&update.covariance)).all(|v| v.is_finite());
        if finite {
            FilterError::NoSpread { at }
        } else {
            FilterError::Diverged { at }
        }
    }
}

/// Variance of an output; of a constant one, its mean square; of zeros, one.
fn scale(y: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = y.clone().count() as f64;
    let mean = y.clone().sum::<f64>() / n;
    let variance = y.map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    [variance, mean * mean, 1.0]
        .into_iter()
        .find(|v| *v > 0.0)
        .unwrap_or(1.0)
}
