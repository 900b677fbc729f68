//! From a measured record to a calibrated twin.

mod cloud;
mod gates;
mod merit;
mod noise;
mod outcome;
mod together;
mod tracking;
mod tune;
mod warnings;

pub(crate) use outcome::{Answer, Seconds};
pub use outcome::{Estimate, EstimateOptions};
pub use together::Together;
pub use tracking::{Tracking, track};
pub(crate) use tune::Contributions;

use crate::estimator::bank::{Draws, FeatureSimulator};
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::gate::GateOutcome;
use crate::estimator::readout::{INTERVAL_LEVEL, Spread};
use crate::estimator::recipe::PresetName;
use crate::estimator::refine::{Information, RefineSettings, Refined, Refinement};
use crate::estimator::settings::Settings;
use crate::fit::posterior::Region;
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::{Noise, Twin};
use cloud::{Around, cloud};
use merit::{Merit, error_by_chance};
use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::time::Instant;
use tune::tune;
use warnings::warnings;

/// The tuned estimate is kept within this quantile of χ²_d: of its squared distance from the record's posterior, or of its whitened misfit.
const KEEP_TUNED: f64 = 0.999;

impl Estimator {
    /// Estimates θ from a record: features, network, gate; then Gauss–Newton, cloud, tuned heads, gate again, so that the answer is
    /// the record's own and does not lean on the prior. Where the study trusts its prior (`[prior] trust = true`; the paper's preset
    /// does), the network's estimate is kept if the gate agrees.
    ///
    /// The tests simulate in noise drawn from the record's fit; cloud and errors take its levels where they are surely not the declared ones
    /// ([`Estimate::noise`]).
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
        for record in [record].into_iter().chain(&options.validation) {
            self.check_record(record, options.step_of_record)?;
        }
        let preset = options.preset.unwrap_or(self.preset);
        let settings = match preset == self.preset {
            true => &self.settings,
            false => &self.project.recipe(preset).settings,
        };
        settings.check()?;
        // The paper takes the prior and the declared noise at their word.
        let is_paper = preset == PresetName::Paper;
        let (study, seed) = (self.study(), options.seed);
        let declared = self.simulator()?;
        let observed = declared.observe(record)?;
        let initial = self.predict_one(&observed)?;
        let mut seconds = Seconds {
            predict: clock.elapsed().as_secs_f64(),
            ..Seconds::default()
        };
        let lap = Instant::now();
        let mut shown = match is_paper && options.draws == 0 {
            true => None,
            false => noise::shown(study, record, options, progress)?,
        };
        if let Some(shown) = shown.as_mut().filter(|_| is_paper) {
            shown.levels.clear();
        }
        let in_noise = (shown.as_ref()).filter(|shown| !shown.levels.is_empty());
        let simulator = match in_noise {
            Some(shown) => declared.of(&shown.twin, None)?,
            None => declared,
        };
        let run = Run {
            estimator: self,
            settings,
            record,
            observed: &observed,
            drawn: (shown.as_ref())
                .filter(|_| !is_paper)
                .map(|shown| &shown.drawn),
            noise: Noise::new(seed, "estimate", 0),
            seed,
            progress,
        };
        let gate = run.gate(&simulator, &initial)?;
        seconds.gate = lap.elapsed().as_secs_f64();
        let trusting = run.trusting(&initial);
        let is_trusted = is_paper || study.trusts_prior();
        let is_kept = is_trusted && !gate.out_of_distribution && !options.always_refine;
        let mut outcome = match is_kept {
            true => run.keep(&simulator, &trusting)?,
            false => {
                let bound = in_noise.map(|shown| simulator.of(&shown.twin, Some(&*self.recipe)));
                let bound = bound.transpose()?;
                let bound = bound.as_ref().unwrap_or(&simulator);
                let region = shown.as_ref().and_then(|shown| shown.fit.region.as_ref());
                run.refit(bound, &initial, region, &mut seconds)?
            }
        };
        let twin = simulator.twin();
        // A free run may diverge where noisy runs do not; the estimate stands all the same.
        let follow = |theta: &[f64], record: &Record| track(twin, theta, record).ok();
        let mut tracking = follow(&outcome.answer.theta, record);
        let tracking_initial = (outcome.refitted)
            .then(|| follow(&initial, record))
            .flatten();
        let mut refinement_refused = false;
        if outcome.refitted && !is_paper {
            let merit = |theta: &[f64], run: &Option<Tracking>| {
                Merit::of(twin, record, theta, run.as_ref())
            };
            let first = merit(&initial, &tracking_initial);
            let refined = merit(&outcome.answer.theta, &tracking);
            let by_chance = || {
                let noise = Noise::new(seed, "merit", 0);
                error_by_chance(twin, &outcome.answer.theta, record, noise)
            };
            if refined.is_worse_than(&first, initial.len(), by_chance) {
                refinement_refused = true;
                outcome.answer = trusting.clone();
                tracking = tracking_initial.clone();
            }
        }
        let fitted = tracking
            .as_ref()
            .map_or(&outcome.answer.theta, |t| &t.theta);
        let validation = (options.validation.as_ref()).and_then(|record| follow(fitted, record));
        let space = twin.parameters();
        let mut estimate = Estimate {
            names: space.names().into_iter().map(str::to_owned).collect(),
            roles: space.iter().map(|p| p.role).collect(),
            tracking_initial,
            initial,
            trusting,
            gate,
            noise: in_noise.map_or_else(Vec::new, |shown| shown.levels.clone()),
            gauss_newton: outcome.gauss_newton,
            fine: outcome.fine,
            contributions: outcome.contributions,
            theta: outcome.answer.theta,
            std_error: outcome.answer.std_error,
            low: outcome.answer.low,
            high: outcome.answer.high,
            information: outcome.information,
            after: outcome.after,
            refitted: outcome.refitted,
            refinement_refused,
            tracking,
            validation,
            posterior: shown.as_ref().and_then(|shown| shown.fit.posterior.clone()),
            warnings: vec![],
            simulations: simulator.calls(),
            cloud: outcome.cloud,
            seconds,
        };
        let fit = shown.as_ref().map(|shown| &shown.fit);
        estimate.warnings = warnings(twin, record, &estimate, fit);
        estimate.seconds.total = clock.elapsed().as_secs_f64();
        Ok(estimate)
    }
}

/// One estimate under way.
struct Run<'a> {
    estimator: &'a Estimator,
    settings: &'a Settings,
    record: &'a Record,
    observed: &'a DVector<f64>,
    /// The twin in levels of noise drawn from the record's fit, for the tests.
    drawn: Option<&'a Twin>,
    noise: Noise,
    seed: u64,
    progress: &'a Progress,
}

/// Results of the stages after the gate.
struct Outcome {
    answer: Answer,
    gauss_newton: Option<Vec<f64>>,
    fine: Option<Vec<f64>>,
    contributions: Option<Contributions>,
    information: Option<Information>,
    after: Option<GateOutcome>,
    refitted: bool,
    cloud: Option<Draws>,
}

impl Run<'_> {
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

    /// The network's estimate, with the errors of simulations of the prior that were predicted nearby.
    fn trusting(&self, initial: &[f64]) -> Answer {
        let space = self.estimator.study().twin().parameters();
        let spread = (self.estimator.calibration).spread(initial, &space.widths(), INTERVAL_LEVEL);
        let unknown = || Spread::normal(vec![f64::NAN; initial.len()], INTERVAL_LEVEL);
        Answer::new(initial.to_vec(), spread.unwrap_or_else(unknown), &space)
    }

    /// The gate kept the network's estimate.
    fn keep(
        &self,
        simulator: &FeatureSimulator,
        trusting: &Answer,
    ) -> Result<Outcome, EstimatorError> {
        // The estimate stands whether or not its directions can be told.
        let information = match self
            .refinement(simulator, self.observed, &self.settings.refine)
            .describe_at(&trusting.theta)
        {
            Ok(refined) => Some(refined.information),
            Err(error @ EstimatorError::Cancelled(_)) => return Err(error),
            Err(_) => None,
        };
        Ok(Outcome {
            answer: trusting.clone(),
            gauss_newton: None,
            fine: None,
            contributions: None,
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
        region: Option<&Region>,
        seconds: &mut Seconds,
    ) -> Result<Outcome, EstimatorError> {
        let (settings, progress) = (self.settings, self.progress);
        let lap = Instant::now();
        // Features with a reference are taken about the record's own θ from here on.
        let about = region.and_then(|region| Some((simulator.about(&region.theta)?, region)));
        let (simulator, initial, refine) = match &about {
            Some((simulator, region)) => {
                let refine = settings.refine.centred();
                (simulator, region.theta.as_slice(), refine)
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
            region: about.as_ref().map(|(_, region)| *region),
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
        let fine = tuned.theta;
        let space = simulator.twin().parameters();
        // What is kept while nothing speaks against it, and what stands in for it.
        let (keeps, instead, std_error) = match around.region {
            Some(region) => (
                is_likely(region.squared_distance(&fine), fine.len()),
                &region.theta,
                region.std_errors(),
            ),
            None => (
                self.keeps(&refinement, &refined, &fine),
                &gauss_newton,
                refined.information.std_error.clone(),
            ),
        };
        let answer = match tuned.spread {
            Some(spread) if keeps => Answer::new(fine.clone(), spread, &space),
            _ => {
                let spread = Spread::normal(std_error, INTERVAL_LEVEL);
                Answer::new(instead.clone(), spread, &space)
            }
        };
        let after = self.after(simulator, &answer, &refined, &observed)?;
        Ok(Outcome {
            answer,
            gauss_newton: Some(gauss_newton),
            fine: Some(fine),
            contributions: tuned.contributions,
            information: Some(refined.information),
            after,
            refitted: true,
            cloud: Some(draws),
        })
    }

    /// Returns whether the tuned estimate stays within the misfit that θ could still explain by chance: the part of its whitened
    /// residual in the Jacobian's column space against χ²_d(0.999).
    fn keeps(&self, refinement: &Refinement<'_>, refined: &Refined, theta: &[f64]) -> bool {
        (refinement.whitened_residual(refined, theta))
            .map(|residual| refined.explainable_misfit(&residual))
            .is_ok_and(|misfit| is_likely(misfit, theta.len()))
    }
}

/// Returns whether a squared distance of so many degrees of freedom is one of chance.
fn is_likely(square: f64, freedom: usize) -> bool {
    ChiSquared::new(freedom as f64).is_ok_and(|chi| square <= chi.inverse_cdf(KEEP_TUNED))
}

#[cfg(test)]
mod tests;
