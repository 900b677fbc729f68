//! A diagnosis as JSON, `truetwin.gap/2`.

use crate::diagnose::Diagnosis;
use serde_json::Value;

/// File of the record to measure next, beside the report.
pub const NEXT_INPUT: &str = "next-input.csv";

/// The diagnosis as one JSON object, `truetwin.gap/2`.
///
/// | key | holds |
/// |---|---|
/// | `verdict`, `detection` | kind of gap, and the evidence for it |
/// | `parameters`, `nuisance` | θ beside the accepted effects; all other estimates |
/// | `where` | places by probability, missing functions, maps of the residuals, time of a change |
/// | `which` | effects with probabilities, the accepted ones first, and those that do the same in this twin (`also`); rivals, what remains, the next input |
/// | `shrinkage` | prediction errors on held-out data over several horizons, the share closed, controls |
/// | `discovery` | exploratory law of the missing function |
/// | `correlated_noise`, `outliers`, `integrator`, `substeps` | noise and step that the diagnosis used in place of the twin's |
/// | `power`, `not_tested`, `candidates` | smallest detectable magnitudes; effects left out; explanations tested |
/// | `warnings` | `code`, `what`, `remedy` of everything that makes the result doubtful |
/// | `quick`, `interrupted`, `seconds` | extent of the search |
///
/// All keys are always there; what was skipped is null, and so are numbers that are not finite.
pub fn gap_json(diagnosis: &Diagnosis) -> Value {
    // Fails for keys that are no strings; there are none.
    serde_json::to_value(diagnosis).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::fixture::{diagnoses, made, validator};

    #[test]
    fn every_verdict_keeps_to_the_contract() {
        let by_hand = [
            made::tanks_class(),
            made::oscillator_none(),
            made::oscillator_no_gap(),
            made::rig_pair(),
        ];
        for diagnosis in diagnoses().iter().chain(&by_hand) {
            let read: Value = serde_json::from_str(&gap_json(diagnosis).to_string()).unwrap();
            let complaints: Vec<String> = (validator("gap").iter_errors(&read))
                .map(|error| format!("{}: {error}", error.instance_path))
                .collect();
            assert!(complaints.is_empty(), "{complaints:?}");
            for (list, key) in [("targets", "probability"), ("windows", "share")] {
                let shares = read["where"][list].as_array().unwrap().iter();
                let sum: f64 = shares.map(|s| s[key].as_f64().unwrap()).sum();
                assert!(sum <= 1.0 + 1e-9, "{list}: {sum}");
            }
        }
    }

    #[test]
    fn what_is_infinite_is_null() {
        let mut diagnosis = diagnoses()[1].clone();
        diagnosis.cause.effects[0].magnitudes = vec![("level".into(), f64::INFINITY)];
        let value = gap_json(&diagnosis);
        assert!(value["which"]["effects"][0]["magnitudes"]["level"].is_null());
    }
}
