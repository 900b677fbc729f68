//! Entries for the fuzz tests that otherwise only a whole FMU reaches. No part of the library's interface.

use super::description::{FmuVariable, ModelDescription};

/// Reads a text as a `modelDescription.xml`.
pub fn description(text: &str) -> Result<(), String> {
    let found = ModelDescription::parse(text)?;
    let parameters: Vec<_> = found
        .parameters
        .iter()
        .map(FmuVariable::parameter)
        .collect();
    let _ = (found.plan(), parameters);
    Ok(())
}
