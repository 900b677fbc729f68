//! The searches of a fit: of the twin without the effects of its study, then with them.

use super::beginnings::Search;
use super::magnitude::{Kind, kinds, largest, size_axis};
use crate::effect::Effect;
use crate::fit::axis::Axis;
use crate::fit::climb::Fitted;
use crate::fit::growing::base_fit;
use crate::fit::problem::Problem;
use crate::fit::starts::{Care, polish, search};
use crate::likelihood::Measured;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::record::{Record, Signal};
use crate::twin::{Noise, Role};
use std::collections::BTreeMap;

/// Iterations of each search: loud noise has a way to go.
pub(in crate::fit) const ITERATIONS: usize = 80;

/// Ends of all searches.
pub(in crate::fit) struct Searched {
    pub problem: Problem,
    /// Best first.
    pub fits: Vec<Fitted>,
    /// Log-likelihood of the twin with all effects off; none without effects that are fitted.
    pub without: Option<f64>,
    /// Kinds of the magnitudes of effects.
    pub kinds: BTreeMap<String, Kind>,
}

/// Fits a twin from all starts.
pub(in crate::fit) fn searched(
    measured: &Measured,
    effects: &[Effect],
    records: &[Record],
    noise: Noise,
) -> Result<Searched, FilterError> {
    let plain = Problem::of_measured(measured, records);
    let space = measured.twin.parameters();
    if space.iter().all(|p| p.role != Role::Magnitude) {
        return Ok(Searched {
            fits: fits(&plain, &[], noise)?,
            problem: plain,
            without: None,
            kinds: BTreeMap::new(),
        });
    }
    let twin = &measured.twin;
    let without = off(&plain, &kinds(twin, effects, records, &[]));
    let base = fits(&without, &[], noise)?;
    let Some(base) = base.into_iter().next() else {
        return Ok(Searched {
            fits: fits(&plain, &[], noise)?,
            problem: plain,
            without: None,
            kinds: BTreeMap::new(),
        });
    };
    // Where the twin follows the record: thresholds on states are somewhere among these.
    let states: Vec<Signal> = match plain.is_simulated() {
        true => vec![],
        false => (recoverable(without.states(&base.theta))?
            .unwrap_or_default()
            .into_iter())
        .map(|(_, states)| states)
        .collect(),
    };
    let kinds = kinds(twin, effects, records, &states);
    let problem = scaled(&plain, &without, &kinds)?;
    let mut theta = base.theta.clone();
    for (j, parameter) in space.iter().enumerate() {
        if let Some(kind) = kinds.get(&parameter.name) {
            theta[j] = problem.axes[j].bounds.clamp(kind.off(parameter));
        }
    }
    let initial = match problem.is_simulated() {
        true => vec![theta],
        false => {
            let search = Search {
                problem: &problem,
                effects,
                kinds: &kinds,
                fit: &|problem, initial| fits(problem, initial, noise),
            };
            search.starts(&theta)?
        }
    };
    Ok(Searched {
        fits: fits(&problem, &initial, noise)?,
        problem,
        without: Some(base.log_likelihood),
        kinds,
    })
}

/// Fits from `initial`, from the prior's centre and from random points, best first.
fn fits(problem: &Problem, initial: &[Vec<f64>], noise: Noise) -> Result<Vec<Fitted>, FilterError> {
    if !problem.is_simulated() {
        return search(problem, initial, noise, ITERATIONS, Care::Thorough);
    }
    let theta = initial.first().map(Vec::as_slice);
    let fit = base_fit(problem, theta, noise)?;
    polish(problem, fit.into_iter().collect(), ITERATIONS)
}

/// The problem with every effect held where it is off.
fn off(problem: &Problem, kinds: &BTreeMap<String, Kind>) -> Problem {
    with_axes(problem, |axis, j, space| {
        if let Some(kind) = kinds.get(&space[j].name) {
            axis.centre = kind.off(&space[j]);
            axis.held = true;
        }
    })
}

/// The problem with the magnitudes of effects in the units of the record. Sizes are told from the states where the twin without effects
/// follows the record with loud noise.
fn scaled(
    problem: &Problem,
    without: &Problem,
    kinds: &BTreeMap<String, Kind>,
) -> Result<Problem, FilterError> {
    let begin = without.begin(&without.centre());
    let states: Option<Vec<Signal>> = match problem.is_simulated() {
        true => None,
        false => recoverable(without.states(&begin))?
            .map(|all| all.into_iter().map(|(_, states)| states).collect()),
    };
    Ok(with_axes(problem, |axis, j, space| {
        let parameter = &space[j];
        match (kinds.get(&parameter.name), &states) {
            (Some(Kind::Size(_)), Some(states)) => {
                let entry = (j, parameter);
                let size = largest(&problem.twin, &begin, entry, &problem.records, states);
                if let Some(size) = size {
                    *axis = size_axis(parameter, size);
                }
            }
            (Some(kind), _) => *axis = kind.axis(parameter),
            (None, _) => {}
        }
    }))
}

/// The problem with other axes.
fn with_axes(
    problem: &Problem,
    change: impl Fn(&mut Axis, usize, &crate::twin::ParameterSpace),
) -> Problem {
    let space = problem.twin.parameters();
    let mut axes = problem.axes[..space.len()].to_vec();
    for (j, axis) in axes.iter_mut().enumerate() {
        change(axis, j, &space);
    }
    problem.with_twin(problem.twin.clone(), axes)
}
