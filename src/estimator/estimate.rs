//! From a measured record to a calibrated twin.

use super::calibration::Spread;
use super::cloud::{Around, cloud};
use super::tracking::track;
use super::tune::tune;
use super::{Estimator, PresetName, Settings, Tracking};
use crate::estimator::bank::{BankError, Draws, FeatureSimulator};
use crate::estimator::gate::{GateError, GateForm, GateOutcome, GateTest};
use crate::estimator::refine::{Information, RefineError, RefineSettings, Refined, Refinement};
use crate::estimator::sample::EllipsoidError;
use crate::feature::FeatureError;
use crate::network::NetworkError;
use crate::progress::{Cancelled, Progress};
use crate::record::Record;
use crate::setting::SettingError;
use crate::study::StudyError;
use crate::twin::{Noise, Role};
use nalgebra::DVector;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::time::Instant;

/// Level of the intervals given with an estimate.
pub const INTERVAL_LEVEL: f64 = 0.9;
/// The tuned estimate is kept while its whitened misfit is within this quantile of χ²_d.
const KEEP_TUNED: f64 = 0.999;

/// What may be chosen for an estimate.
#[derive(Debug, Clone, Default)]
pub struct EstimateOptions {
    /// Seed of all simulations.
    pub seed: u64,
    /// Numbers of another preset than the estimator's own; features and network stay.
    pub preset: Option<PresetName>,
    /// Refine and tune whatever the gate says.
    pub always_refine: bool,
    /// A second record to score the calibrated twin on.
    pub validation: Option<Record>,
}

/// What an estimate is made of. Skipped stages are `None`.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Estimate {
    /// Names of θ: the twin's parameters, then unknown noise levels, starts and magnitudes.
    pub names: Vec<String>,
    /// What each parameter stands for.
    pub roles: Vec<Role>,
    /// The network's estimate.
    pub initial: Vec<f64>,
    /// The test of the network's estimate.
    pub gate: GateOutcome,
    /// Gauss–Newton's estimate.
    pub gauss_newton: Option<Vec<f64>>,
    /// The tuned heads' estimate.
    pub fine: Option<Vec<f64>>,
    /// The estimate: the network's where the gate kept it, else the tuned one unless its misfit is too large, else
    /// Gauss–Newton's.
    pub theta: Vec<f64>,
    /// Standard errors of `theta`.
    pub std_error: Vec<f64>,
    /// Ends of the 90 % interval, within the bounds.
    pub low: Vec<f64>,
    /// Upper ends.
    pub high: Vec<f64>,
    /// Information and directions at Gauss–Newton's estimate, or at the network's where the gate kept it.
    pub information: Option<Information>,
    /// The test after the refit; `None` where no degree of freedom is left.
    pub after: Option<GateOutcome>,
    /// Whether a refit was made at all.
    pub refitted: bool,
    /// The free run at `theta`, unknown starts refitted; `None` where it diverges.
    pub tracking: Option<Tracking>,
    /// The free run at the network's estimate, for comparison; `None` without a refit, or where it diverges.
    pub tracking_initial: Option<Tracking>,
    /// The free run on the validation record; `None` without one, or where it diverges.
    pub validation: Option<Tracking>,
    /// Simulator calls.
    pub simulations: usize,
    /// The cloud that the heads were tuned on, and measured on: its last rows they never saw.
    pub cloud: Option<Draws>,
    /// Wall-clock times.
    pub seconds: Seconds,
}

/// Wall-clock seconds of each stage; `None` for skipped ones.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct Seconds {
    /// Features and network.
    pub predict: f64,
    /// The test.
    pub gate: f64,
    /// Gauss–Newton.
    pub gauss_newton: Option<f64>,
    /// The cloud.
    pub cloud: Option<f64>,
    /// The heads.
    pub tune: Option<f64>,
    /// Everything, free runs included.
    pub total: f64,
}

/// A parameter that is estimated without being asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Nuisance {
    /// State, output, or `id@target.magnitude`.
    pub name: String,
    /// "start", "noise" or "effect".
    pub role: &'static str,
    /// Estimate.
    pub value: f64,
    /// Standard error.
    pub std_error: f64,
}

/// Why there is no estimate.
///
/// ```
/// use truetwin::progress::Cancelled;
/// use truetwin::estimator::EstimateError;
///
/// assert_eq!(EstimateError::from(Cancelled).to_string(), "cancelled");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The record is not one of this study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The record has no features.
    #[error(transparent)]
    Feature(#[from] FeatureError),
    /// A setting is out of range.
    #[error(transparent)]
    Settings(#[from] SettingError),
    /// Simulations failed.
    #[error(transparent)]
    Bank(#[from] BankError),
    /// The test failed.
    #[error(transparent)]
    Gate(#[from] GateError),
    /// Gauss–Newton failed.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// The cloud has no ellipsoid.
    #[error(transparent)]
    Ellipsoid(#[from] EllipsoidError),
    /// The network failed.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl Estimate {
    /// Start states, noise levels and magnitudes among θ.
    pub fn nuisance(&self) -> Vec<Nuisance> {
        (0..self.names.len())
            .filter_map(|j| {
                let role = match self.roles[j] {
                    Role::Physical => return None,
                    Role::Start => "start",
                    Role::Noise => "noise",
                    Role::Effect => "effect",
                };
                let name = self.names[j].strip_prefix(&format!("{role}."));
                Some(Nuisance {
                    name: name.unwrap_or(&self.names[j]).into(),
                    role,
                    value: self.theta[j],
                    std_error: self.std_error[j],
                })
            })
            .collect()
    }

    /// The twin's own parameters out of a vector over all of θ.
    pub fn physical<T: Clone>(&self, all: &[T]) -> Vec<T> {
        (all.iter().zip(&self.roles))
            .filter(|(_, role)| **role == Role::Physical)
            .map(|(value, _)| value.clone())
            .collect()
    }
}

impl Estimate {
    /// Draws of the cloud that were drawn again: out of bounds, diverged, or without features.
    pub fn redrawn(&self) -> usize {
        self.cloud.as_ref().map_or(0, |draws| draws.redrawn)
    }
}

impl Estimator {
    /// Estimates θ from a record: features, network, gate; and where the gate rejects: Gauss–Newton, cloud, tuned
    /// heads, gate again.
    ///
    /// # Errors
    ///
    /// A record that does not fit, simulations that fail, a listener that cancels: [`EstimateError`].
    pub fn estimate(
        &self,
        record: &Record,
        options: &EstimateOptions,
        progress: &Progress,
    ) -> Result<Estimate, EstimateError> {
        let clock = Instant::now();
        self.study().check_record(record)?;
        if let Some(validation) = &options.validation {
            self.study().check_record(validation)?;
        }
        let settings = match options.preset {
            Some(name) if name != self.preset => &self.project.recipe(name).settings,
            _ => &self.settings,
        };
        settings.check()?;
        let simulator = self.simulator()?;
        let observed = simulator.observe(record)?;
        let initial = self.predict_one(&observed)?;
        let mut seconds = Seconds {
            predict: clock.elapsed().as_secs_f64(),
            ..Seconds::default()
        };
        let run = Run {
            estimator: self,
            settings,
            record,
            observed: &observed,
            noise: Noise::new(options.seed, "estimate", 0),
            seed: options.seed,
            progress,
        };
        let lap = Instant::now();
        let gate = run.gate(&simulator, &initial)?;
        seconds.gate = lap.elapsed().as_secs_f64();
        let outcome = if gate.out_of_distribution || options.always_refine {
            run.refit(&simulator, &initial, &mut seconds)?
        } else {
            run.keep(&simulator, &initial)?
        };
        let twin = simulator.twin();
        // A free run may diverge where noisy runs do not; the estimate stands all the same.
        let follow = |theta: &[f64], record: &Record| track(twin, theta, record).ok();
        let tracking = follow(&outcome.answer.theta, record);
        let fitted = tracking
            .as_ref()
            .map_or(&outcome.answer.theta, |t| &t.theta);
        let validation = (options.validation.as_ref()).and_then(|record| follow(fitted, record));
        let tracking_initial = (outcome.refitted)
            .then(|| follow(&initial, record))
            .flatten();
        let space = twin.parameters();
        seconds.total = clock.elapsed().as_secs_f64();
        Ok(Estimate {
            names: space.names().into_iter().map(str::to_owned).collect(),
            roles: space.iter().map(|p| p.role).collect(),
            tracking_initial,
            initial,
            gate,
            gauss_newton: outcome.gauss_newton,
            fine: outcome.fine,
            low: space.clamp(&outcome.answer.low),
            high: space.clamp(&outcome.answer.high),
            theta: outcome.answer.theta,
            std_error: outcome.answer.std_error,
            information: outcome.information,
            after: outcome.after,
            refitted: outcome.refitted,
            tracking,
            validation,
            simulations: simulator.calls(),
            cloud: outcome.cloud,
            seconds,
        })
    }
}

/// One estimate under way.
struct Run<'a> {
    estimator: &'a Estimator,
    settings: &'a Settings,
    record: &'a Record,
    observed: &'a DVector<f64>,
    noise: Noise,
    seed: u64,
    progress: &'a Progress,
}

/// What the stages after the gate give.
struct Outcome {
    answer: Answer,
    gauss_newton: Option<Vec<f64>>,
    fine: Option<Vec<f64>>,
    information: Option<Information>,
    after: Option<GateOutcome>,
    refitted: bool,
    cloud: Option<Draws>,
}

/// An estimate with its uncertainty.
struct Answer {
    theta: Vec<f64>,
    std_error: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Answer {
    fn new(theta: Vec<f64>, spread: Spread) -> Self {
        let shifted = |by: &[f64]| theta.iter().zip(by).map(|(t, b)| t + b).collect();
        Self {
            low: shifted(&spread.low),
            high: shifted(&spread.high),
            std_error: spread.std_error,
            theta,
        }
    }
}

impl Run<'_> {
    fn gate_test<'a>(&'a self, simulator: &'a FeatureSimulator, purpose: &str) -> GateTest<'a> {
        GateTest {
            simulator,
            drive: self.record.drive(),
            settings: &self.settings.gate,
            noise: self.noise.child(purpose),
            progress: self.progress,
        }
    }

    /// Whether the record is what the twin makes at the network's estimate.
    fn gate(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
    ) -> Result<GateOutcome, EstimateError> {
        let test = self.gate_test(simulator, "gate");
        let gate = match self.settings.gate.form {
            GateForm::Paper => test.at(initial)?,
            GateForm::Calibrated => {
                // The hypothesis is a θ in the prior; the network extrapolates, and errs, beyond.
                let space = self.estimator.study().twin().parameters();
                let initial: Vec<f64> = (space.iter().zip(initial))
                    .map(|(p, v)| p.prior.clamp(*v))
                    .collect();
                let refinement = self.refinement(simulator, self.observed, &self.settings.refine);
                let jacobians = refinement.jacobians_at(&initial)?;
                test.at_estimate(&initial, &jacobians, |features| {
                    Ok::<_, EstimateError>(self.estimator.predict(features)?)
                })?
            }
        };
        Ok(gate.test(self.observed))
    }

    fn refinement<'a>(
        &'a self,
        simulator: &'a FeatureSimulator,
        observed: &'a DVector<f64>,
        settings: &'a RefineSettings,
    ) -> Refinement<'a> {
        Refinement {
            simulator,
            drive: self.record.drive(),
            observed,
            settings,
            gate: &self.settings.gate,
            noise: self.noise.child("refine"),
            progress: self.progress,
        }
    }

    /// The gate kept the network's estimate: its error is that of simulations predicted nearby.
    fn keep(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
    ) -> Result<Outcome, EstimateError> {
        let space = self.estimator.study().twin().parameters();
        let spread = (self.estimator.calibration).spread(initial, &space.widths(), INTERVAL_LEVEL);
        let unknown = || Spread::normal(vec![f64::NAN; initial.len()], INTERVAL_LEVEL);
        // The estimate stands whether or not its directions can be told.
        let information = match self
            .refinement(simulator, self.observed, &self.settings.refine)
            .describe_at(initial)
        {
            Ok(refined) => Some(refined.information),
            Err(RefineError::Cancelled(stop)) => return Err(stop.into()),
            Err(_) => None,
        };
        Ok(Outcome {
            answer: Answer::new(initial.to_vec(), spread.unwrap_or_else(unknown)),
            gauss_newton: None,
            fine: None,
            information,
            after: None,
            refitted: false,
            cloud: None,
        })
    }

    /// Gauss–Newton, cloud, tuned heads, gate again.
    fn refit(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
        seconds: &mut Seconds,
    ) -> Result<Outcome, EstimateError> {
        let (settings, progress) = (self.settings, self.progress);
        let lap = Instant::now();
        // Features that can find the record's neighbourhood by themselves do, and are taken about it from here on.
        let noise = self.noise.child("centre");
        let centred = simulator.centred(self.record, initial, noise)?;
        let (simulator, initial, refine) = match &centred {
            Some((simulator, centred)) => {
                let refine = settings.refine.centred();
                (simulator, centred.theta.as_slice(), refine)
            }
            None => (simulator, initial, settings.refine.clone()),
        };
        let observed = simulator.observe(self.record)?;
        let refinement = self.refinement(simulator, &observed, &refine);
        let refined = refinement.run(initial)?;
        seconds.gauss_newton = Some(lap.elapsed().as_secs_f64());
        let lap = Instant::now();
        let around = Around {
            simulator,
            drive: self.record.drive(),
            refined: &refined,
            region: centred.as_ref().map(|(_, centred)| centred),
            settings,
        };
        let draws = cloud(&around, self.noise.child("cloud"), progress)?;
        seconds.cloud = Some(lap.elapsed().as_secs_f64());
        let lap = Instant::now();
        let tuned = tune(
            self.estimator,
            &draws,
            &refined,
            &observed,
            settings,
            self.seed,
            progress,
        )?;
        seconds.tune = Some(lap.elapsed().as_secs_f64());
        let gauss_newton = refined.theta.as_slice().to_vec();
        let fine = tuned.theta.clone();
        let answer = match tuned.spread {
            Some(spread) if self.keeps(&refinement, &refined, &tuned.theta) => {
                Answer::new(tuned.theta, spread)
            }
            _ => {
                let spread = Spread::normal(refined.information.std_error.clone(), INTERVAL_LEVEL);
                Answer::new(gauss_newton.clone(), spread)
            }
        };
        let after = self.gate_test(simulator, "after").after_refit(
            &answer.theta,
            &refined.jacobian,
            &observed,
        );
        let after = match after {
            Ok(after) => after,
            // Simulations at the answer cannot be tested (they diverge, say); the answer stands.
            Err(GateError::Bank(BankError::Hopeless { .. }) | GateError::Whitening(_)) => None,
            Err(error) => return Err(error.into()),
        };
        Ok(Outcome {
            answer,
            gauss_newton: Some(gauss_newton),
            fine: Some(fine),
            information: Some(refined.information),
            after,
            refitted: true,
            cloud: Some(draws),
        })
    }

    /// Whether the tuned estimate stays within the misfit that θ could still explain by chance: the part of its whitened
    /// residual in the Jacobian's column space against χ²_d(0.999).
    fn keeps(&self, refinement: &Refinement<'_>, refined: &Refined, theta: &[f64]) -> bool {
        let threshold = ChiSquared::new(theta.len() as f64).map(|chi| chi.inverse_cdf(KEEP_TUNED));
        let misfit = (refinement.whitened_residual(refined, theta))
            .map(|residual| refined.explainable_misfit(&residual));
        matches!((misfit, threshold), (Ok(misfit), Ok(threshold)) if misfit <= threshold)
    }
}
