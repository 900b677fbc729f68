//! Noise and starts as the tables of states and outputs declare them.

use super::entries::TableEntry;
use super::error::EquationsError;
use super::graph::{Id, Varies};
use super::names::Scope;
use crate::setting::number;
use crate::twin::KNOWN_WITH_FACTOR;
use std::collections::{BTreeMap, BTreeSet};
use toml::de::{DeTable, DeValue};

/// Declarations of a text: levels and starts, for likelihoods of measured records.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Declared {
    /// States and outputs whose noise is known: nothing is fitted.
    pub known: BTreeSet<String>,
    /// Factors that one standard deviation of a level is.
    pub factors: BTreeMap<String, f64>,
    /// States whose start is looked for around a mean.
    pub estimated: BTreeSet<String>,
    /// Time that starts belong to, before the first row.
    pub begins: Option<f64>,
    /// True where an input says what it is between samples, a dose apart.
    pub holds: bool,
}

/// The noise of a state or an output.
pub(super) struct NoiseValue {
    pub level: Id,
    /// `true` for a state's level per √s.
    pub is_per_second: bool,
}

/// The start of a state.
pub(super) struct StartValue {
    pub mean: Id,
    pub deviation: Id,
    /// `false` where nothing is said: it is unknown.
    pub is_given: bool,
}

/// Key of a noise level.
const NOISE: &str = "noise";
/// Key of a start.
const START: &str = "start";

impl Declared {
    /// Reads `noise`: a level, or a table.
    pub(super) fn noise(
        &mut self,
        entry: &TableEntry<'_, '_>,
        keys: &DeTable<'_>,
        names: &mut Scope<'_>,
    ) -> Result<NoiseValue, EquationsError> {
        let mut noise = NoiseValue {
            level: names.graph.number(0.0),
            is_per_second: false,
        };
        let Some(value) = keys.get(NOISE) else {
            return Ok(noise);
        };
        let DeValue::Table(_) = value.get_ref() else {
            noise.level = names.value(&entry.expression_of(NOISE, value)?)?;
            self.check_level(entry, names, noise.level)?;
            return Ok(noise);
        };
        let table = TableEntry {
            name: NOISE,
            value,
            byte: value.span().start,
            ..*entry
        };
        let keys = table.keys(&["std", "known", "factor", "per"])?;
        let Some(std) = table.expression(keys, "std")? else {
            return table.error("noise has no std; give its standard deviation");
        };
        noise.level = names.value(&std)?;
        self.check_level(entry, names, noise.level)?;
        if let Some(known) = keys.get("known") {
            match known.get_ref().as_bool() {
                Some(true) => {
                    self.known.insert(entry.name.into());
                }
                Some(false) => {}
                None => return table.wrong("known", known, "true or false"),
            }
        }
        if let Some(value) = keys.get("factor") {
            match super::place::number(value.get_ref()) {
                Some(_) if self.known.contains(entry.name) => {
                    return table.error(KNOWN_WITH_FACTOR);
                }
                Some(factor) if factor > 1.0 && factor.is_finite() => {
                    self.factors.insert(entry.name.into(), factor);
                }
                _ => return table.wrong("factor", value, "a number above 1, such as 2"),
            }
        }
        if let Some(value) = keys.get("per") {
            noise.is_per_second = match value.get_ref().as_str() {
                Some("second") => true,
                Some("step") => false,
                _ => return table.wrong("per", value, "\"step\" or \"second\""),
            };
        }
        Ok(noise)
    }

    fn check_level(
        &self,
        entry: &TableEntry<'_, '_>,
        names: &Scope<'_>,
        level: Id,
    ) -> Result<(), EquationsError> {
        match names.graph.constant(level) {
            Some(level) if level < 0.0 => entry.error(format!(
                "noise = {}; a standard deviation is 0 or more",
                number(level)
            )),
            _ => Ok(()),
        }
    }

    /// Reads `start`: a value of parameters, also at an earlier time; a mean with a deviation; a mean alone or nothing where it is unknown.
    pub(super) fn start(
        &mut self,
        entry: &TableEntry<'_, '_>,
        keys: &DeTable<'_>,
        names: &mut Scope<'_>,
    ) -> Result<StartValue, EquationsError> {
        const OF: &str =
            "a start is before all rows; name parameters, constants and definitions of these alone";
        let zero = names.graph.number(0.0);
        let mut start = StartValue {
            mean: zero,
            deviation: zero,
            is_given: false,
        };
        let Some(value) = keys.get(START) else {
            return Ok(start);
        };
        let DeValue::Table(_) = value.get_ref() else {
            start.is_given = true;
            let placed = entry.expression_of(START, value)?;
            start.mean = names.value_within(&placed, Varies::ByParameters, OF)?;
            return Ok(start);
        };
        let table = TableEntry {
            name: START,
            value,
            byte: value.span().start,
            ..*entry
        };
        let keys = table.keys(&["mean", "std", "value", "at"])?;
        if let Some(value) = keys.get("at") {
            let Some(at) = super::place::number(value.get_ref()).filter(|at| at.is_finite()) else {
                return table.wrong("at", value, "a time in seconds");
            };
            if self.begins.is_some_and(|other| other != at) {
                return table.error("states start at two times; give all the same at");
            }
            self.begins = Some(at);
        }
        if keys.contains_key("value") && keys.contains_key("mean") {
            return table
                .error("start has value and mean; a value is known, a mean with std is not");
        }
        let key = if keys.contains_key("value") {
            "value"
        } else {
            "mean"
        };
        let Some(mean) = table.expression(keys, key)? else {
            return table.error("start has no mean; write { mean = …, std = … }, or a number");
        };
        start.mean = names.value_within(&mean, Varies::ByParameters, OF)?;
        start.is_given = true;
        match table.expression(keys, "std")? {
            Some(_) if key == "value" => {
                return table.error("start has value and std; write { mean = …, std = … }");
            }
            Some(std) => start.deviation = names.value_within(&std, Varies::ByParameters, OF)?,
            // A mean alone says where an unknown start is looked for.
            None if key == "mean" => {
                self.estimated.insert(entry.name.into());
            }
            None => {}
        }
        match names.graph.constant(start.deviation) {
            Some(std) if !(std >= 0.0 && std.is_finite()) => {
                let std = number(std);
                table.error(format!("std = {std}; a standard deviation is 0 or more"))
            }
            _ => Ok(start),
        }
    }
}
