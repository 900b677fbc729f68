//! The tests of an estimate: at the network's, and at the refitted one. An answer near its level is taken again from more simulations.

use super::EstimateRun;
use crate::estimator::bank::FeatureSimulator;
use crate::estimator::error::EstimatorError;
use crate::estimator::gate::{GateForm, GateOutcome, GateSettings, GateTest};
use crate::estimator::refine::RefinedEstimate;
use nalgebra::DVector;

impl EstimateRun<'_> {
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
    pub(super) fn gate(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
    ) -> Result<GateOutcome, EstimatorError> {
        let settings = &self.settings.gate;
        let simulator = &self.in_drawn_noise(simulator)?;
        let first = self.tested(simulator, initial, settings, "gate")?;
        match (first.is_unsure(), settings.form) {
            (true, GateForm::Calibrated) => {
                self.tested(simulator, initial, &settings.larger(), "gate, larger")
            }
            _ => Ok(first),
        }
    }

    /// The test with these settings.
    fn tested(
        &self,
        simulator: &FeatureSimulator,
        initial: &[f64],
        settings: &GateSettings,
        purpose: &str,
    ) -> Result<GateOutcome, EstimatorError> {
        let test = GateTest {
            settings,
            ..self.gate_test(simulator, purpose)
        };
        let gate = match settings.form {
            GateForm::Paper => test.at(initial)?,
            GateForm::Calibrated => {
                // The hypothesis is a θ in the prior; the network extrapolates, and errs, beyond.
                let space = self.estimator.study().twin().parameters();
                let initial = space.clamp_to_prior(initial);
                let refinement = self.refinement(simulator, self.observed, &self.settings.refine);
                let jacobians = refinement.jacobians_at(&initial)?;
                let near = (self.estimator.calibration).truths_near(&initial, &space.widths());
                test.at_estimate(&initial, &near, &jacobians, |features| {
                    Ok(self.estimator.predict(features)?)
                })?
            }
        };
        Ok(gate.test(self.observed))
    }

    /// The test of the refitted answer; `None` where no degree of freedom is left, or where simulations at the answer cannot be tested
    /// (they diverge, say).
    pub(super) fn after(
        &self,
        simulator: &FeatureSimulator,
        theta: &[f64],
        refined: &RefinedEstimate,
        observed: &DVector<f64>,
    ) -> Result<Option<GateOutcome>, EstimatorError> {
        let simulator = self.in_drawn_noise(simulator)?;
        let tested = |settings: &GateSettings, purpose: &str| {
            let test = GateTest {
                settings,
                ..self.gate_test(&simulator, purpose)
            };
            match test.after_refit(theta, &refined.jacobian, observed) {
                Err(EstimatorError::Hopeless { .. } | EstimatorError::Whitening(_)) => Ok(None),
                outcome => outcome,
            }
        };
        let settings = &self.settings.gate;
        match tested(settings, "after")? {
            Some(first) if first.is_unsure() => tested(&settings.larger(), "after, larger"),
            first => Ok(first),
        }
    }
}
