//! Entries for the fuzz tests that otherwise only a whole FMU reaches. No part of the library's interface.

use super::description::ModelDescription;
use super::variable::FmuVariable;
use crate::record::Signals;

/// Reads a text as a `modelDescription.xml`.
pub fn description(text: &str) -> Result<(), String> {
    let found = ModelDescription::parse(text, false)?;
    let parameters: Vec<_> = found
        .parameters
        .iter()
        .map(FmuVariable::parameter)
        .collect();
    let signals = Signals {
        inputs: found.inputs.iter().map(FmuVariable::quantity).collect(),
        outputs: Vec::new(),
    };
    let _ = (found.plan(&signals), parameters);
    Ok(())
}
