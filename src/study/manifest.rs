//! Settings of a study that its results depend on.

use super::{PlannedInputs, Study, StudyError};
use crate::record::Signal;
use crate::storage::StorageError;
use crate::storage::checksum::sha256;
use crate::storage::work::{Manifest, checksum};
use crate::twin::Noise;
use serde_json::{Value, json};
use std::collections::BTreeMap;

impl Study {
    /// A manifest of a folder that `verb` makes, with the twin, its parameters, the study file, records and inputs (an input
    /// file by its checksum), and the checksum of one simulation, which tells a twin whose equations have changed since.
    pub fn manifest(&self, verb: &'static str, layout: u32) -> Result<Manifest, StorageError> {
        // It reads the input files, whose checksums are of what was read last.
        let simulation = self.simulation();
        if simulation != self.simulation() {
            return Err(StorageError::Unrepeatable);
        }
        let space = self.twin().parameters();
        let parameters: Vec<Value> = (space.iter())
            .map(|p| json!({ "name": p.name, "prior": p.prior, "bounds": p.bounds }))
            .collect();
        let manifest = Manifest::new(verb, layout)
            .with("twin", self.name())
            .with("parameters", parameters)
            .with("study", self.written()?)
            .with("record", json!(self.plan().map(|p| (p.step, p.samples))));
        let manifest = match self.plan().and_then(|plan| plan.input.as_ref()) {
            Some(PlannedInputs::File(path)) => manifest.with("input file", checksum(path)?),
            Some(input @ PlannedInputs::Each(_)) if !input.files().is_empty() => {
                let sums: Result<BTreeMap<_, _>, StorageError> = (input.files().into_iter())
                    .filter_map(|(name, path)| Some((name?, checksum(path))))
                    .map(|(name, sum)| Ok((name, sum?)))
                    .collect();
                manifest
                    .with("input", json!(input))
                    .with("input files", json!(sums?))
            }
            input => manifest.with("input", json!(input)),
        };
        // Last: what else is different tells more.
        Ok(manifest.with("simulation", simulation))
    }

    /// The text of the study file.
    fn written(&self) -> Result<String, StorageError> {
        let input = self.plan().and_then(|plan| plan.input.as_ref());
        let files = input.map(PlannedInputs::files).unwrap_or_default();
        match files.iter().find(|(_, path)| path.to_str().is_none()) {
            Some((_, path)) => Err(StorageError::NoText((*path).clone())),
            // A file that was read can be written.
            None => Ok(self.file().written().unwrap_or_default()),
        }
    }

    /// Checksum of a simulation at a point of the prior; of what is wrong with it, where it fails.
    fn simulation(&self) -> String {
        let noise = Noise::new(0, "manifest", 0);
        let simulated = || -> Result<Signal, StudyError> {
            let drive = self.drives()?.draw(noise)?;
            let theta = self.twin.parameters().draw_prior(noise);
            Ok(self.twin.simulate(&theta, &drive, noise)?)
        };
        match simulated() {
            Ok(signal) => {
                let bytes: Vec<u8> = (signal.iter()).flat_map(|v| v.to_le_bytes()).collect();
                sha256(&bytes)
            }
            Err(error) => error.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::record::{Drive, Signal, Signals};
    use crate::storage::StorageError;
    use crate::study::{InputPlan, RecordPlan, Study};
    use crate::twin::{DigitalTwin, Noise, Parameter, ParameterSpace, SimulationError};
    use crate::twins::CascadedTanks;
    use std::sync::atomic::{AtomicU64, Ordering};

    fn tanks(high: f64) -> Study {
        let plan = RecordPlan::levels(0.5, 40, 0.0, high, 5);
        Study::new("tanks", CascadedTanks, plan).unwrap()
    }

    /// A simulator with a memory beside its seed.
    #[derive(Debug)]
    struct Counter(AtomicU64);

    impl DigitalTwin for Counter {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new([Parameter::new("k", "1", 0.0, 1.0)])
        }
        fn signals(&self) -> Signals {
            DigitalTwin::signals(&CascadedTanks)
        }
        fn simulate(&self, _: &[f64], drive: &Drive, _: Noise) -> Result<Signal, SimulationError> {
            let calls = self.0.fetch_add(1, Ordering::Relaxed);
            Ok(Signal::from_elem((drive.samples(), 1), calls as f64))
        }
    }

    #[test]
    fn work_that_cannot_be_repeated_is_refused() {
        let plan = RecordPlan::levels(0.5, 40, 0.0, 1.0, 5);
        let study = Study::new("counter", Counter(AtomicU64::new(0)), plan).unwrap();
        let error = study.manifest("bank", 1).unwrap_err();
        assert!(matches!(error, StorageError::Unrepeatable), "{error}");
    }

    #[test]
    fn another_input_is_another_study() {
        let manifest = |high| tanks(high).manifest("bank", 1).unwrap();
        assert_eq!(manifest(3.0).differs(&manifest(3.0)), None);
        let difference = manifest(3.0).differs(&manifest(2.0)).unwrap();
        assert!(difference.starts_with("input was"), "{difference}");
    }
    #[test]
    fn another_file_of_an_input_is_another_study() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("u.csv");
        let manifest = |level: f64| {
            std::fs::write(&path, format!("t,u\n0,{level}\n1,1\n")).unwrap();
            let plan = RecordPlan::by_input(1.0, 2, [("u", InputPlan::File(path.clone()))]);
            let study = Study::new("tanks", CascadedTanks, plan).unwrap();
            study.manifest("bank", 1).unwrap()
        };
        let difference = manifest(1.0).differs(&manifest(2.0)).unwrap();
        assert!(difference.starts_with("other input files"), "{difference}");
    }
}
