//! A diagnosis as JSON, `truetwin.gap/2`.

use crate::diagnose::Diagnosis;
use serde_json::Value;

/// File of the record to measure next, beside the report.
pub const NEXT_INPUT: &str = "next-input.csv";

/// The diagnosis as one JSON object, `truetwin.gap/2`.
///
/// | key | holds |
/// |---|---|
/// | `verdict`, `detection` | which kind of gap, and the evidence for it |
/// | `parameters`, `nuisance` | θ beside accepted effects; what else was estimated |
/// | `where` | places by probability, missing functions, maps of the residuals |
/// | `which` | effects best first, what was accepted, rivals, what remains |
/// | `shrinkage` | free-run errors on held-out data |
///
/// Beyond the contract: `parameters[].prior`, of `where` all but target, targets, windows and regions, `windows[].record`,
/// `shrinkage.controls`, `discovery`, `correlated_noise`, `outliers`, `quick`, `interrupted`, `integrator`, `substeps`, `power`,
/// `candidates`, `not_tested`, `seconds`.
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
