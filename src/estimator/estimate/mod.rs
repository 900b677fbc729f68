//! From a measured record to a calibrated twin: a fit of the likelihood, and the network.
//!
//! ```text
//! record ─ fit ─▶ noise levels, posterior region ─────────────┐ (the paper's preset leaves the fit out)
//!        ─ network ─▶ θ_init ─ gate ─ kept, if the prior is trusted
//!                               └─▶ refit: Gauss–Newton, cloud, tuned heads ─▶ θ̂ ─ gate again
//! ```

mod cloud;
mod outcome;
mod record_fit;
mod refit;
mod together;
mod tracking;
mod warnings;

pub(crate) use outcome::{Contributions, Stages};
pub use outcome::{Estimate, EstimateOptions, Refit};
pub use together::Together;
pub use tracking::Tracking;

use crate::estimator::bank::FeatureSimulator;
use crate::estimator::error::EstimatorError;
use crate::estimator::estimator::Estimator;
use crate::estimator::gate::{GateOutcome, GateTest};
use crate::estimator::project::Steps;
use crate::estimator::readout::PointEstimate;
use crate::estimator::refine::{RefinedEstimate, Refinement};
use crate::estimator::settings::{GateForm, GateSettings, RefineSettings, Settings};
use crate::progress::Progress;
use crate::record::Record;
use crate::twin::Noise;
use nalgebra::DVector;
use outcome::Seconds;
use record_fit::RecordFit;
use std::time::Instant;
use tracking::{explains_worse, track};
use warnings::warnings;

impl Estimator {
    /// Estimates θ from a record: features, network, gate; then Gauss–Newton, cloud, tuned heads, gate again, so that the answer is
    /// the record's own and does not lean on the prior. Where the study trusts its prior (`[prior] trust = true`; the paper's preset
    /// does), the network's estimate is kept if the gate agrees.
    ///
    /// The record is also fitted by its likelihood. The tests simulate in noise drawn from that fit; cloud and errors take its levels where
    /// they are surely not the declared ones ([`Estimate::noise`]).
    ///
    /// # Errors
    ///
    /// A record that does not fit, simulations that fail: [`EstimatorError`].
    pub fn estimate(&self, record: &Record) -> Result<Estimate, EstimatorError> {
        self.estimate_with(record, &EstimateOptions::default(), &Progress::silent())
    }

    /// As [`estimate`](Self::estimate), with options, and progress that can cancel it.
    ///
    /// # Errors
    ///
    /// As [`estimate`](Self::estimate); options that cannot be used, cancellation.
    pub fn estimate_with(
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
        let steps = Steps::of(preset, self.study());
        let declared = self.simulator()?;
        let observed = declared.observe(record)?;
        let initial = self.initial(self.predict_one(&observed)?);
        let predict = clock.elapsed().as_secs_f64();
        let lap = Instant::now();
        let fit = match steps.fits_noise || options.draws > 0 {
            true => RecordFit::new(self.study(), record, options, progress)?,
            false => None,
        };
        let taken = fit.as_ref().filter(|_| steps.fits_noise);
        let simulator = match taken {
            Some(fit) => declared.of(&fit.twin, None)?,
            None => declared,
        };
        let run = EstimateRun {
            estimator: self,
            simulator: &simulator,
            settings,
            record,
            observed: &observed,
            fit: taken,
            noise: Noise::new(options.seed, "estimate", 0),
            seed: options.seed,
            progress,
        };
        let gate = run.gate(&initial.theta)?;
        let seconds = (predict, lap.elapsed().as_secs_f64());
        let is_kept = steps.trusts_prior && !gate.out_of_distribution && !options.always_refine;
        let (stages, tracking) = match is_kept {
            true => run.keep(&initial)?,
            false => run.refine(&initial, steps)?,
        };
        let answer = match &stages {
            Stages::Refitted(refit) if !refit.is_refused => refit.answer.clone(),
            _ => initial.clone(),
        };
        let fitted = tracking.as_ref().map_or(&answer.theta, |run| &run.theta);
        let twin = simulator.twin();
        let validation =
            (options.validation.as_ref()).and_then(|record| track(twin, fitted, record).ok());
        let space = twin.parameters();
        let mut estimate = Estimate {
            names: space.names().into_iter().map(str::to_owned).collect(),
            roles: space.iter().map(|p| p.role).collect(),
            initial,
            gate,
            stages,
            noise: taken.map_or_else(Vec::new, |fit| fit.levels.clone()),
            theta: answer.theta,
            std_error: answer.std_error,
            low: answer.low,
            high: answer.high,
            tracking,
            validation,
            posterior: fit.as_ref().and_then(|fit| fit.fit.posterior.clone()),
            warnings: vec![],
            simulations: simulator.calls(),
            seconds: Seconds {
                predict: seconds.0,
                gate: seconds.1,
                total: 0.0,
            },
        };
        estimate.warnings = warnings(twin, record, &estimate, fit.as_ref().map(|fit| &fit.fit));
        estimate.seconds.total = clock.elapsed().as_secs_f64();
        Ok(estimate)
    }

    /// The network's estimate, with the errors of simulations of the prior that were predicted nearby.
    fn initial(&self, theta: Vec<f64>) -> PointEstimate {
        let space = self.study().twin().parameters();
        let estimate = (self.calibration).estimate(theta.clone(), &space.widths(), &space);
        let unknown = vec![f64::NAN; theta.len()];
        estimate.unwrap_or_else(|| PointEstimate::normal(theta, unknown, &space))
    }
}

/// One estimate under way.
struct EstimateRun<'a> {
    estimator: &'a Estimator,
    /// The twin in the record's noise, and its features.
    simulator: &'a FeatureSimulator,
    settings: &'a Settings,
    record: &'a Record,
    observed: &'a DVector<f64>,
    /// The record's fit, where the preset takes its noise.
    fit: Option<&'a RecordFit>,
    noise: Noise,
    seed: u64,
    progress: &'a Progress,
}

impl EstimateRun<'_> {
    fn refinement<'a>(
        &'a self,
        simulator: &'a FeatureSimulator,
        observed: &'a DVector<f64>,
        settings: &'a RefineSettings,
    ) -> Refinement<'a> {
        Refinement {
            test: self.gate_test(simulator, &self.settings.gate, "refine"),
            observed,
            settings,
        }
    }

    /// The test of the network's estimate: is the record what the twin makes there?
    fn gate(&self, initial: &[f64]) -> Result<GateOutcome, EstimatorError> {
        let simulator = &self.in_drawn_noise(self.simulator)?;
        if self.settings.gate.form == GateForm::Paper {
            let test = self.gate_test(simulator, &self.settings.gate, "gate");
            return Ok(test.at(initial)?.test(self.observed));
        }
        // The hypothesis is a θ in the prior; the network extrapolates, and errs, beyond.
        let space = self.estimator.study().twin().parameters();
        let initial = space.clamp_to_prior(initial);
        let near = (self.estimator.calibration).truths_near(&initial, &space.widths());
        let refinement = self.refinement(simulator, self.observed, &self.settings.refine);
        self.sure(simulator, "gate", |test| {
            let jacobians = refinement.jacobians_at(&initial)?;
            let predict = |features: &_| Ok(self.estimator.predict(features)?);
            let gate = test.at_estimate(&initial, &near, &jacobians, predict)?;
            Ok(gate.test(self.observed))
        })
    }

    /// The test of the refitted answer; `None` where no degree of freedom is left, or where simulations at the answer cannot be tested
    /// (they diverge, say).
    fn after(
        &self,
        simulator: &FeatureSimulator,
        theta: &[f64],
        refined: &RefinedEstimate,
        observed: &DVector<f64>,
    ) -> Result<Option<GateOutcome>, EstimatorError> {
        let simulator = &self.in_drawn_noise(simulator)?;
        self.sure(simulator, "after", |test| {
            match test.after_refit(theta, &refined.jacobian, observed) {
                Err(EstimatorError::Hopeless { .. } | EstimatorError::Whitening(_)) => Ok(None),
                outcome => outcome,
            }
        })
    }

    /// Tests; takes an answer near the level again, from more simulations.
    fn sure<T: Copy + Into<Option<GateOutcome>>>(
        &self,
        simulator: &FeatureSimulator,
        purpose: &str,
        test: impl Fn(&GateTest<'_>) -> Result<T, EstimatorError>,
    ) -> Result<T, EstimatorError> {
        let settings = &self.settings.gate;
        let first = test(&self.gate_test(simulator, settings, purpose))?;
        match first.into() {
            Some(outcome) if outcome.is_unsure() => {
                let purpose = format!("{purpose}, larger");
                test(&self.gate_test(simulator, &settings.larger(), &purpose))
            }
            _ => Ok(first),
        }
    }

    fn gate_test<'a>(
        &'a self,
        simulator: &'a FeatureSimulator,
        settings: &'a GateSettings,
        purpose: &str,
    ) -> GateTest<'a> {
        GateTest {
            simulator,
            drive: self.record.drive(),
            settings,
            noise: self.noise.child(purpose),
            progress: self.progress,
        }
    }

    /// The simulator in noise drawn from the record's fit, where there is one.
    fn in_drawn_noise(
        &self,
        simulator: &FeatureSimulator,
    ) -> Result<FeatureSimulator, EstimatorError> {
        Ok(match self.fit {
            Some(fit) => simulator.of(&fit.drawn, None)?,
            None => simulator.clone(),
        })
    }

    /// Keeps the network's estimate.
    fn keep(&self, initial: &PointEstimate) -> Result<(Stages, Option<Tracking>), EstimatorError> {
        let refine = &self.settings.refine;
        let refinement = self.refinement(self.simulator, self.observed, refine);
        let information = match refinement.describe_at(&initial.theta) {
            Ok(refined) => Some(refined.information),
            Err(error @ EstimatorError::Cancelled(_)) => return Err(error),
            // The features do not tell it.
            Err(_) => None,
        };
        // A free run may diverge where noisy runs do not; the estimate stands all the same.
        let tracking = track(self.simulator.twin(), &initial.theta, self.record).ok();
        Ok((Stages::Kept(information), tracking))
    }

    /// Refits the record, and follows it with what explains it better.
    fn refine(
        &self,
        initial: &PointEstimate,
        steps: Steps,
    ) -> Result<(Stages, Option<Tracking>), EstimatorError> {
        let simulator = self.simulator;
        let recipe = &*self.estimator.recipe;
        let bound = self.fit.map(|fit| simulator.of(&fit.twin, Some(recipe)));
        let bound = bound.transpose()?;
        let bound = bound.as_ref().unwrap_or(simulator);
        let region = self.fit.and_then(|fit| fit.fit.region.as_ref());
        let mut refit = self.refit(bound, &initial.theta, region)?;
        let twin = simulator.twin();
        let [tracking, first] =
            [&refit.answer, initial].map(|at| track(twin, &at.theta, self.record).ok());
        let noise = Noise::new(self.seed, "merit", 0);
        refit.is_refused = steps.compares
            && explains_worse(
                twin,
                self.record,
                (&refit.answer.theta, tracking.as_ref()),
                (&initial.theta, first.as_ref()),
                noise,
            );
        let tracking = match refit.is_refused {
            true => first.clone(),
            false => tracking,
        };
        refit.tracking_initial = first;
        Ok((Stages::Refitted(Box::new(refit)), tracking))
    }
}

#[cfg(test)]
mod tests;
