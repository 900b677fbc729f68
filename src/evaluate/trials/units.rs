//! A study in other units of its outputs.

use super::world::World;
use crate::evaluate::EvaluateError;
use crate::record::{Drive, Record, Signal};
use crate::study::{Study, StudyFile};
use crate::twin::{
    Integrator, Interval, Noise, Now, Outliers, Outline, SimulationError, StateSpace, Stepping,
};
use std::sync::Arc;

/// New units in one old one: from metres to millimetres.
const FACTOR: f64 = 1000.0;

/// Equations whose outputs are read in other units.
struct Rescaled(Arc<dyn StateSpace>);

/// The study and its records with outputs in other units; `None` for a black box, or where the study declares noise or starts in
/// the old ones.
pub(super) fn rescaled(
    study: &Study,
    record: &Record,
    validation: Option<&Record>,
) -> Result<Option<(Study, Record, Option<Record>)>, EvaluateError> {
    let file = study.file();
    let World::Equations(twin) = World::new(study.twin()) else {
        return Ok(None);
    };
    if !file.noise.is_empty() || !file.start.is_empty() || !file.effect.is_empty() {
        return Ok(None);
    }
    let same = StudyFile {
        twin: study.name().into(),
        library: file.library.clone(),
        ..StudyFile::default()
    };
    let new = Study::new(study.name(), Rescaled(twin), study.plan().clone())?;
    let kinds = study.catalogue().kinds().iter();
    let new = new.with_effects(kinds.map(|kind| kind.as_ref().clone()));
    let scaled = |record: &Record| Record::new(record.drive().clone(), record.outputs() * FACTOR);
    let validation = validation.map(scaled).transpose()?;
    Ok(Some((new.configure(&same)?, scaled(record)?, validation)))
}

impl StateSpace for Rescaled {
    fn outline(&self) -> Outline {
        let mut outline = self.0.outline();
        for output in &mut outline.outputs {
            output.unit = format!("{}/{FACTOR}", output.unit);
        }
        outline
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.0.drift(now, x, dx);
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.0.observe(now, x, y);
        y.iter_mut().for_each(|y| *y *= FACTOR);
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.start(now, x);
    }
    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.0.start_deviation(now, std);
    }
    fn begin(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.begin(now, x);
    }
    fn noise(&self, now: &Now<'_>, process: &mut [f64], measurement: &mut [f64]) {
        self.0.noise(now, process, measurement);
        measurement.iter_mut().for_each(|r| *r *= FACTOR);
    }
    fn limits(&self) -> Vec<Interval> {
        self.0.limits()
    }
    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.constrain(now, x);
    }
    fn update(&self, now: &Now<'_>, x: &mut [f64]) {
        self.0.update(now, x);
    }
    fn readout(&self, now: &Now<'_>, y: &mut [f64]) {
        y.iter_mut().for_each(|y| *y /= FACTOR);
        self.0.readout(now, y);
        y.iter_mut().for_each(|y| *y *= FACTOR);
    }
    fn check_parameters(&self, theta: &[f64], dt: f64) -> Result<(), SimulationError> {
        self.0.check_parameters(theta, dt)
    }
    fn corrupt_outputs(&self, theta: &[f64], noise: Noise, outputs: &mut Signal) {
        *outputs /= FACTOR;
        self.0.corrupt_outputs(theta, noise, outputs);
        *outputs *= FACTOR;
    }
    fn outliers(&self, theta: &[f64]) -> Vec<Outliers> {
        let scaled = |o: Outliers| Outliers {
            scale: FACTOR * o.scale,
            ..o
        };
        self.0.outliers(theta).into_iter().map(scaled).collect()
    }
    fn integrator(&self) -> Integrator {
        self.0.integrator()
    }
    fn stepping(&self) -> Stepping {
        self.0.stepping()
    }
    fn run(&self, theta: &[f64], drive: &Drive, noise: Noise) -> Result<Signal, SimulationError> {
        Ok(self.0.run(theta, drive, noise)? * FACTOR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;

    #[test]
    fn a_rescaled_twin_makes_rescaled_records() {
        for study in reference_studies().unwrap() {
            let noise = Noise::new(1, "units", 0);
            let theta = study.twin().parameters().draw_prior(noise);
            let drive = study.drives().unwrap().draw(noise).unwrap();
            let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
            let record = Record::new(drive.clone(), outputs).unwrap();
            let (new, scaled, _) = rescaled(&study, &record, None).unwrap().unwrap();
            let again = new.twin().simulate(&theta, &drive, noise).unwrap();
            for (a, b) in again.iter().zip(scaled.outputs()) {
                assert!((a - b).abs() < 1e-9 * b.abs().max(1.0));
            }
            assert_eq!(new.candidates().len(), study.candidates().len());
        }
    }
}
