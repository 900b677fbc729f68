//! A twin as measured records show it: noise levels that are fitted with θ, a start that is not quite known.
//!
//! Noise of a real rig is never known. A level that is held fixed makes everything that the twin lacks look like a gap of a fixed
//! size, or hides it; a level that is fitted lets the record say how well the twin predicts.
//!
//! ```text
//! state i   increment in Δt:  N(0, σ_i²·Δt)       σ_i in units of the state per √s
//! output j  error of a row:   N(0, r_j²)
//! ln σ ~ N(ln σ_0, s²)                             σ_0 declared: s = ln factor;  nothing declared: from the record, s = 2
//! x(0) ~ N(start, d²)                              d declared; 0 where the twin or the study says the start; else, in quadrature, the size of
//!                                                  the state's own motion and the distance of its first row from the twin's start
//! ```

mod level;
mod motion;
mod start;
#[cfg(test)]
mod tests;

pub(crate) use level::{
    Beliefs, LARGEST_SHARE, Level, Measured, StartElsewhere, share_name, with_share,
};
pub(crate) use start::with_better_start;

use super::ensemble;
use super::kalman::FilterError;
use crate::record::{Record, check_size};
use crate::twin::{Composed, ParameterSpace, Role, Twin, TwinError, TwinPart, fix};
use level::{RecordSizes, build};
use motion::{declared_levels, followed_motion, free_motion, size};
use start::{Starts, distances};
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
                elsewhere: None,
            })
        }
    }
}

/// A start that the twin or the study says, and that is not that of these records.
pub(crate) fn start_elsewhere(
    twin: &Twin,
    records: &[Record],
    beliefs: &Beliefs,
) -> Option<StartElsewhere> {
    let twin = twin.equations()?;
    let theta = without_effects(&twin.outline().parameters, beliefs);
    Starts::of(twin, records, beliefs, &theta).elsewhere
}

/// Outputs that are less noisy than what their readings are rounded to, with the least noise that counts: q/√2π.
pub(crate) fn rounded(twin: &Twin, records: &[Record], theta: &[f64]) -> Vec<(usize, f64)> {
    let Some(twin) = twin.equations() else {
        return vec![];
    };
    let (own, levels) = (
        twin.rounding(theta),
        declared_levels(twin, records, theta, 1.0),
    );
    let least = |j: usize| {
        let cells = records.iter().map(|record| record.cells()[j].sqrt());
        cells.fold(0.0, f64::max)
    };
    let levels = levels.measurement.into_iter().enumerate();
    let quiet =
        levels.filter(|(j, level)| *level < least(*j) && !own.get(*j).is_some_and(|q| *q > 0.0));
    quiet.map(|(j, _)| (j, least(j))).collect()
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
    let records = std::slice::from_ref(record);
    let theta = without_effects(&outline.parameters, beliefs);
    // Sizes make guesses alone, and none is used; starts stay as they are.
    let states = outline.states.len();
    let sizes = RecordSizes {
        states: vec![1.0; states],
        outputs: vec![1.0; outline.outputs.len()],
        starts: vec![None; states],
        declared: declared_levels(base, records, &theta, beliefs.step),
    };
    let measured = build(base, &outline, records, beliefs, &sizes);
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

/// The prior's centre, effects off: what the twin's own motion tells must not hang on a guess of these, and the centre of a delay's prior may
/// be longer than its law keeps.
fn without_effects(space: &ParameterSpace, beliefs: &Beliefs) -> Vec<f64> {
    (space.iter().zip(space.centre()))
        .map(|(p, centre)| match p.role {
            Role::Magnitude => p
                .bounds
                .clamp(beliefs.off.get(&p.name).copied().unwrap_or(0.0)),
            _ => centre,
        })
        .collect()
}

/// Widths of starts as two looks from these find them: the first is held back by its own prior. `None` where the twin cannot be smoothed.
fn looked(
    from: Vec<f64>,
    sizes: &mut RecordSizes,
    (widths, built): (
        &impl Fn(&[f64]) -> Vec<Option<f64>>,
        &impl Fn(&RecordSizes) -> Measured,
    ),
    (records, theta): (&[Record], &[f64]),
) -> Result<Option<Vec<f64>>, FilterError> {
    let mut reach = from;
    for _ in 0..2 {
        sizes.starts = widths(&reach);
        let loud = built(sizes);
        let at = loud.begun_loud(theta);
        let Some(twin) = loud.twin.equations() else {
            return Ok(None);
        };
        let Some(distances) = distances(twin, records, &at)? else {
            return Ok(None);
        };
        for ((reach, size), distance) in reach.iter_mut().zip(&sizes.states).zip(distances) {
            *reach = size.hypot(distance);
        }
    }
    Ok(Some(reach))
}

fn measured_equations(
    base: &Composed,
    records: &[Record],
    beliefs: &Beliefs,
) -> Result<Measured, FilterError> {
    let outline = base.outline();
    let theta = without_effects(&outline.parameters, beliefs);
    let size_of = |j: usize| -> Option<f64> {
        let having = records.iter().filter(|record| record.has_output(j));
        having
            .map(|record| size(&record.outputs().column(j).to_vec()))
            .reduce(f64::max)
    };
    let sizes: Vec<Option<f64>> = (0..outline.outputs.len()).map(size_of).collect();
    let fallback = sizes.iter().flatten().copied().fold(0.0, f64::max);
    let outputs: Vec<f64> = sizes.iter().map(|size| size.unwrap_or(fallback)).collect();
    let starts = Starts::of(base, records, beliefs, &theta);
    let widths = |widths: &[f64]| -> Vec<Option<f64>> {
        (starts.unknown.iter().zip(widths))
            .map(|(unknown, width)| unknown.then_some(*width))
            .collect()
    };
    let motion = free_motion(base, records, &theta, fallback);
    let finite = motion
        .iter()
        .enumerate()
        .filter(|(_, size)| size.is_finite());
    for (i, &size) in finite {
        check_size("state", size, || outline.states[i].name.clone())?;
    }
    let mut sizes = RecordSizes {
        starts: widths(&motion),
        states: motion,
        outputs,
        declared: declared_levels(base, records, &theta, beliefs.step),
    };
    let built = |sizes: &RecordSizes| build(base, &outline, records, beliefs, sizes);
    // States that follow the record tell their size better than a run that may drift away from it.
    if let Some(followed) = followed_motion(&built(&sizes), records, &theta)? {
        for (size, followed) in sizes.states.iter_mut().zip(followed) {
            if followed > 0.0 && followed.is_finite() {
                *size = followed;
            }
        }
    }
    // A record at an operating point moves little, far from the twin's start; a look from a width that is too small for its first row finds nothing.
    // Where none explains the first rows, something else does.
    let mut reach = sizes.states.clone();
    // Twelve decades are pascals beside micropascals.
    let decades = (0..=12).take_while(|_| starts.unknown.contains(&true));
    for decades in decades {
        let wide = 10f64.powi(decades);
        let from: Vec<f64> = sizes.states.iter().map(|size| wide * size).collect();
        let Some(found) = looked(from, &mut sizes, (&widths, &built), (records, &theta))? else {
            break;
        };
        let is_explained = starts.explain(base, records, &theta, &found);
        if decades == 0 || is_explained {
            reach = found;
        }
        if is_explained {
            break;
        }
    }
    sizes.starts = widths(&reach);
    Ok(Measured {
        elsewhere: starts.elsewhere,
        ..built(&sizes)
    })
}
