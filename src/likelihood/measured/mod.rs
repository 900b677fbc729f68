//! A twin as measured records show it: noise levels that are fitted with θ, a start that is not quite known.
//!
//! Noise of a real rig is never known. A level that is held fixed makes everything that the twin lacks look like a gap of a fixed
//! size, or hides it; a level that is fitted lets the record say how well the twin predicts.
//!
//! ```text
//! state i   increment in Δt:  N(0, σ_i²·Δt)       σ_i in units of the state per √s
//! output j  error of a row:   N(0, r_j²)
//! ln σ ~ N(ln σ_0, s²)                             σ_0 declared: s = ln factor;  nothing declared: from the record, s = 2
//! x(0) ~ N(start, d²)                              d declared, or the size of the state's own motion
//! ```

mod level;
mod motion;
#[cfg(test)]
mod tests;

pub(crate) use level::{Beliefs, Level, Measured};

use super::ensemble;
use super::kalman::FilterError;
use crate::record::Record;
use crate::twin::{Composed, ParameterSpace, Role, Twin, TwinError, TwinPart, fix};
use level::{Sizes, build};
use motion::{declared_levels, followed_motion, free_motion, size};
use std::collections::BTreeMap;

/// The twin as these records show it. A black box has noise of its own, or is given that of a sensor.
pub(crate) fn measured(
    twin: &Twin,
    records: &[Record],
    beliefs: &Beliefs,
) -> Result<Measured, FilterError> {
    match twin {
        Twin::Equations(base) => measured_equations(base, records, beliefs),
        Twin::BlackBox(base) => {
            let (twin, is_silent) = ensemble::measured(base, records)?;
            Ok(Measured {
                twin,
                levels: vec![],
                is_silent,
            })
        }
    }
}

/// The twin with these noise levels in place of its own; all else stays, its start too. Levels by state, per √s, or by output; each run draws
/// one of several lists. A black box stays as it is.
pub(crate) fn with_levels(
    twin: &Twin,
    record: &Record,
    beliefs: &Beliefs,
    draws: &[BTreeMap<String, f64>],
) -> Result<Twin, TwinError> {
    let Twin::Equations(base) = twin else {
        return Ok(twin.clone());
    };
    let outline = base.outline();
    let beliefs = Beliefs {
        starts: outline.states.iter().map(|s| s.name.clone()).collect(),
        ..beliefs.clone()
    };
    let records = std::slice::from_ref(record);
    let theta = without_effects(&outline.parameters);
    // Sizes make guesses alone, and none is used.
    let sizes = Sizes {
        states: vec![1.0; outline.states.len()],
        outputs: vec![1.0; outline.outputs.len()],
        declared: declared_levels(base, records, &theta, beliefs.step),
    };
    let measured = build(base, &outline, records, &beliefs, &sizes);
    let values = |levels: &BTreeMap<String, f64>| -> Vec<f64> {
        let value = |level: &Level| {
            let own = level.declared.unwrap_or(0.0);
            levels.get(level.parameter.target()).copied().unwrap_or(own)
        };
        measured.levels.iter().map(value).collect()
    };
    let values: Vec<Vec<f64>> = draws.iter().map(values).collect();
    let names = measured.levels.iter().map(|level| &level.parameter.name);
    let held = names.cloned().zip(values[0].iter().copied()).collect();
    let fixed = fix(measured.twin, &held)?;
    let first = twin.entries();
    Ok(fixed.with([], vec![TwinPart::Drawn { first, values }]))
}

/// The prior's centre, sizes, lags and delays of effects at zero: what the twin's own motion tells must not hang on a guess of these, and the
/// centre of a delay's prior may be longer than its law keeps.
fn without_effects(space: &ParameterSpace) -> Vec<f64> {
    (space.iter().zip(space.centre()))
        .map(|(p, centre)| match p.role {
            Role::Magnitude => p.bounds.clamp(0.0),
            _ => centre,
        })
        .collect()
}

fn measured_equations(
    base: &Composed,
    records: &[Record],
    beliefs: &Beliefs,
) -> Result<Measured, FilterError> {
    let outline = base.outline();
    let theta = without_effects(&outline.parameters);
    let size_of = |column: &dyn Fn(&Record) -> Vec<f64>| -> f64 {
        records.iter().map(|r| size(&column(r))).fold(0.0, f64::max)
    };
    let outputs: Vec<f64> = (0..outline.outputs.len())
        .map(|j| size_of(&|r| r.outputs().column(j).to_vec()))
        .collect();
    let fallback = outputs.iter().copied().fold(0.0, f64::max);
    let mut sizes = Sizes {
        states: free_motion(base, records, &theta, fallback),
        outputs,
        declared: declared_levels(base, records, &theta, beliefs.step),
    };
    // States that follow the record tell their size better than a run that may drift away from it.
    let loud = build(base, &outline, records, beliefs, &sizes);
    if let Some(followed) = followed_motion(&loud, records, &theta)? {
        for (size, followed) in sizes.states.iter_mut().zip(followed) {
            if followed > 0.0 && followed.is_finite() {
                *size = followed;
            }
        }
    }
    Ok(build(base, &outline, records, beliefs, &sizes))
}
