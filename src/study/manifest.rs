//! What work over a study depends on, as far as the study decides it.

use super::{InputPlan, Study};
use crate::work::{Manifest, WorkError, checksum};
use serde_json::{Value, json};

impl Study {
    /// A manifest of a folder that `verb` makes, with the twin, its parameters, the study file, records and inputs (an input
    /// file by its checksum).
    ///
    /// # Errors
    ///
    /// An input file that cannot be read.
    pub fn manifest(&self, verb: &'static str, layout: u32) -> Result<Manifest, WorkError> {
        let space = self.twin().parameters();
        let parameters: Vec<Value> = (space.iter())
            .map(|p| json!({ "name": p.name, "prior": p.prior, "bounds": p.bounds }))
            .collect();
        let plan = self.plan();
        let manifest = Manifest::new(verb, layout)
            .with("twin", self.name())
            .with("parameters", parameters)
            // A file that was read can be written.
            .with("study", toml::to_string(self.file()).unwrap_or_default())
            .with("record", json!([plan.step, plan.samples]));
        Ok(match &plan.input {
            Some(InputPlan::File(path)) => manifest.with("input file", checksum(path)?),
            input => manifest.with("input", json!(input)),
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::study::{RecordPlan, Study};
    use crate::twins::CascadedTanks;

    fn tanks(high: f64) -> Study {
        let plan = RecordPlan::levels(0.5, 40, 0.0, high, 5);
        Study::new("tanks", CascadedTanks, plan).unwrap()
    }

    #[test]
    fn another_input_is_another_study() {
        let manifest = |high| tanks(high).manifest("bank", 1).unwrap();
        assert_eq!(manifest(3.0).differs(&manifest(3.0)), None);
        let difference = manifest(3.0).differs(&manifest(2.0)).unwrap();
        assert!(difference.starts_with("input was"), "{difference}");
    }
}
