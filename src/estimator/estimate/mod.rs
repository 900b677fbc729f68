//! From a measured record to a calibrated twin.

mod cloud;
mod outcome;
mod tracking;
mod tune;

pub use outcome::{Estimate, EstimateOptions, Seconds};
pub use tracking::{Tracking, track};

use crate::estimator::bank::{Draws, FeatureSimulator};
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::gate::{GateForm, GateOutcome, GateTest};
use crate::estimator::readout::{INTERVAL_LEVEL, Spread};
use crate::estimator::refine::{Information, RefineSettings, Refined, Refinement};
use crate::estimator::settings::Settings;
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::Noise;
use cloud::{Around, cloud};
use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::time::Instant;
use tune::tune;

/// The tuned estimate is kept while its whitened misfit is within this quantile of χ²_d.
const KEEP_TUNED: f64 = 0.999;

impl Estimator {
    /// Estimates θ from a record: features, network, gate; and where the gate rejects: Gauss–Newton, cloud, tuned
    /// heads, gate again.
    ///
    /// # Errors
    ///
    /// A record that does not fit, simulations that fail, a listener that cancels: [`EstimatorError`].
    pub fn estimate(
        &self,
        record: &Record,
        options: &EstimateOptions,
        progress: &Progress,
    ) -> Result<Estimate, EstimatorError> {
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

/// Results of the stages after the gate.
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

    /// Returns whether the record is what the twin makes at the network's estimate.
    fn gate(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
    ) -> Result<GateOutcome, EstimatorError> {
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
                    Ok(self.estimator.predict(features)?)
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
    ) -> Result<Outcome, EstimatorError> {
        let space = self.estimator.study().twin().parameters();
        let spread = (self.estimator.calibration).spread(initial, &space.widths(), INTERVAL_LEVEL);
        let unknown = || Spread::normal(vec![f64::NAN; initial.len()], INTERVAL_LEVEL);
        // The estimate stands whether or not its directions can be told.
        let information = match self
            .refinement(simulator, self.observed, &self.settings.refine)
            .describe_at(initial)
        {
            Ok(refined) => Some(refined.information),
            Err(error @ EstimatorError::Cancelled(_)) => return Err(error),
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
    ) -> Result<Outcome, EstimatorError> {
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
            Err(EstimatorError::Hopeless { .. } | EstimatorError::Whitening(_)) => None,
            Err(error) => return Err(error),
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

    /// Returns whether the tuned estimate stays within the misfit that θ could still explain by chance: the part of its whitened
    /// residual in the Jacobian's column space against χ²_d(0.999).
    fn keeps(&self, refinement: &Refinement<'_>, refined: &Refined, theta: &[f64]) -> bool {
        let threshold = ChiSquared::new(theta.len() as f64).map(|chi| chi.inverse_cdf(KEEP_TUNED));
        let misfit = (refinement.whitened_residual(refined, theta))
            .map(|residual| refined.explainable_misfit(&residual));
        matches!((misfit, threshold), (Ok(misfit), Ok(threshold)) if misfit <= threshold)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::estimate::EstimateOptions;
    use crate::estimator::pretrain::{PretrainOptions, pretrain};
    use crate::study::{RecordPlan, Study, StudyFile};
    use crate::twins::CascadedTanks;

    /// The tanks, all physical parameters fixed.
    fn fixed(tables: &str) -> Study {
        let text =
            format!("twin = 'tanks'\n[fixed]\nk1 = 0.6\nk2 = 0.6\nk3 = 0.6\nk4 = 0.6\n{tables}");
        let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
        let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        study.configure(&file).unwrap()
    }

    const SMALL: PretrainOptions = PretrainOptions {
        preset: crate::estimator::recipe::PresetName::Default,
        bank_size: Some(100),
        epochs: Some(1),
        seed: 1,
    };

    #[test]
    fn a_start_alone_is_estimated() {
        let study = fixed("[start]\nh1 = 'estimate'");
        let (estimator, _) = pretrain(&study, &SMALL, &Progress::silent()).unwrap();
        let noise = Noise::new(1, "record", 0);
        let drive = study.drives().unwrap().draw(noise).unwrap();
        let theta = study.twin().parameters().centre();
        let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
        let record = Record::new(drive, outputs).unwrap();
        for always_refine in [false, true] {
            let options = EstimateOptions {
                always_refine,
                ..EstimateOptions::default()
            };
            let estimate = estimator
                .estimate(&record, &options, &Progress::silent())
                .unwrap();
            assert_eq!(estimate.names, ["start.h1"]);
            assert!(estimate.std_error[0].is_finite());
        }
    }
}
