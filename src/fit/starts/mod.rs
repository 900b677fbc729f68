//! Searches for the most probable θ, and where they begin: at drawn points, at the poles of a record (`spectral`), and where fits to its
//! beginning end (`growing`), and at tops along the axes through the best one (`scan`).

pub(crate) mod growing;
mod scan;
mod spectral;

use growing::{grown, sketch};
use scan::scanned;
pub(crate) use spectral::spectral_starts;

use crate::fit::budget::{BUDGET, ITERATIONS};
use crate::fit::climb::{Fitted, climb};
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::twin::Noise;
use rayon::prelude::*;

/// Starts of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Care {
    /// With loud noise alone.
    Loud,
    /// With quiet noise, too, and more of them where only one ends at the best top.
    Thorough,
}

/// Fits from `initial`, from where the twin swings as the records do, and all that [`search`] begins from, with thorough care.
pub(crate) fn thorough(
    problem: &Problem,
    initial: &[Vec<f64>],
    noise: Noise,
) -> Result<Vec<Fitted>, FilterError> {
    let initial = [initial, &spectral_starts(problem)].concat();
    search(problem, &initial, noise, ITERATIONS, Care::Thorough)
}

/// Fits from the prior's centre, the full θ that are given, and the best of random ones, each to its end; best first.
pub(crate) fn search(
    problem: &Problem,
    initial: &[Vec<f64>],
    noise: Noise,
    iterations: usize,
    care: Care,
) -> Result<Vec<Fitted>, FilterError> {
    let (loud, quiet) = match care {
        Care::Loud => (Screen::LOUD, vec![]),
        Care::Thorough => {
            let noise = noise.child("quiet starts");
            let quiet = screened(problem, noise, Screen::quiet(problem))?;
            (Screen::LOUD_APART, quiet)
        }
    };
    let starts: Vec<Vec<f64>> = [problem.begin(&problem.centre())]
        .into_iter()
        .chain(initial.iter().map(|theta| problem.clamp(theta)))
        .chain(screened(problem, noise.child("starts"), loud)?)
        .chain(quiet)
        .collect();
    let fits = polish(problem, climbs(problem, &starts, iterations)?, iterations)?;
    match care {
        Care::Loud => Ok(fits),
        Care::Thorough => {
            let fits = scanned(problem, fits, iterations)?;
            agreed(problem, fits, noise.child("more starts"), iterations)
        }
    }
}

/// Searches from more starts while only one has ended at the best top.
pub(super) fn agreed(
    problem: &Problem,
    mut fits: Vec<Fitted>,
    noise: Noise,
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    for round in 0..BUDGET.more_starts {
        if agreeing(&fits) > 1 {
            break;
        }
        let starts = grown(problem, noise.sample(round), iterations)?;
        fits = joined(problem, fits, &starts, iterations)?;
    }
    Ok(fits)
}

/// Fits, and those of searches from more starts.
fn joined(
    problem: &Problem,
    mut fits: Vec<Fitted>,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    fits.extend(climbs(problem, starts, iterations)?);
    sort(&mut fits);
    polish(problem, fits, iterations)
}

/// A random point of the prior or, in turn, of the bounds.
fn random_point(problem: &Problem, i: u64, noise: Noise) -> Vec<f64> {
    let space = problem.twin.parameters();
    let noise = noise.sample(i);
    let theta = match i % 2 {
        0 => space.draw_prior(noise),
        _ => space.draw_bounds(noise),
    };
    problem.drawn(problem.full(&theta), noise)
}

/// Points where the twin works, the most probable first.
fn ranked(problem: &Problem, points: Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, FilterError> {
    let values = problem.log_posteriors(&points)?;
    let mut all: Vec<(f64, Vec<f64>)> = (values.into_iter().zip(points))
        .filter_map(|(value, theta)| Some((value?, theta)))
        .collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(all.into_iter().map(|(_, theta)| theta).collect())
}

/// Random points whose likelihood is looked at.
struct Screen {
    points: u64,
    /// `true` where levels of noise are loud: a likelihood of few tops, of which the widest draws all searches. `false` where they are
    /// what is believed of them: more tops, each found by more points, and the highest stands out.
    is_loud: bool,
    /// `true` where starts must lie apart: the best points of a screening are often of one valley.
    is_apart: bool,
}

impl Screen {
    const LOUD: Self = Self {
        points: BUDGET.loud_points,
        is_loud: true,
        is_apart: false,
    };
    const LOUD_APART: Self = Self {
        is_apart: true,
        ..Self::LOUD
    };

    fn quiet(problem: &Problem) -> Self {
        let free = problem
            .axes
            .iter()
            .filter(|axis| !axis.held && axis.begin.is_none());
        Self {
            points: BUDGET.quiet_points * free.count().min(BUDGET.quiet_entries) as u64,
            is_loud: false,
            is_apart: true,
        }
    }
}

/// The best of random points.
fn screened(problem: &Problem, noise: Noise, screen: Screen) -> Result<Vec<Vec<f64>>, FilterError> {
    let points = (0..screen.points)
        .map(|i| {
            let theta = random_point(problem, i, noise);
            match screen.is_loud {
                true => problem.begin(&theta),
                false => problem.believed(&theta),
            }
        })
        .collect();
    let sketch = sketch(problem);
    let mut starts: Vec<Vec<f64>> = vec![];
    for theta in ranked(sketch.as_ref().unwrap_or(problem), points)? {
        let is_new = |one: &Vec<f64>| !screen.is_apart || is_apart(problem, one, &theta);
        if starts.len() < BUDGET.screened_starts && starts.iter().all(is_new) {
            starts.push(theta);
        }
    }
    Ok(starts)
}

/// Returns whether two points differ by a part of the prior in some entry.
fn is_apart(problem: &Problem, one: &[f64], other: &[f64]) -> bool {
    let c = &problem.coordinates;
    let (one, other) = (c.of(one), c.of(other));
    (problem.axes.iter().enumerate())
        .filter(|(_, axis)| !axis.held && axis.begin.is_none())
        .any(|(j, axis)| {
            let unit = if axis.deviation.is_finite() {
                axis.deviation
            } else {
                axis.width
            };
            (one[j] - other[j]).abs() > BUDGET.starts_apart * unit
        })
}

/// Searches from all starts, best first; those of long records go over their [`sketch`] first.
pub(super) fn climbs(
    problem: &Problem,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    let sketch = sketch(problem);
    let search = |start: &Vec<f64>| {
        let found = match &sketch {
            Some(sketch) => climb(sketch, start, iterations)?.map(|fit| fit.theta),
            None => None,
        };
        climb(problem, found.as_ref().unwrap_or(start), iterations)
    };
    let mut fits: Vec<Fitted> = (starts.par_iter())
        .filter_map(|start| search(start).transpose())
        .collect::<Result<_, _>>()?;
    sort(&mut fits);
    Ok(fits)
}

/// Number of fits, best first, that end at the best top.
pub(super) fn agreeing(fits: &[Fitted]) -> usize {
    let best = fits.first().map_or(f64::NAN, |fit| fit.objective);
    (fits.iter())
        .filter(|fit| fit.objective >= best - BUDGET.same_top)
        .count()
}

/// Carries fits on that are near the best, until they gain hardly anything more.
pub(crate) fn polish(
    problem: &Problem,
    fits: Vec<Fitted>,
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    let precise = problem.until(BUDGET.polished_gain);
    let best = fits.first().map_or(f64::NAN, |fit| fit.objective);
    let mut fits: Vec<Fitted> = (fits.into_par_iter())
        .map(|fit| {
            if best - fit.objective > BUDGET.near {
                return Ok(fit);
            }
            Ok(climb(&precise, &fit.theta, iterations)?.unwrap_or(fit))
        })
        .collect::<Result<_, FilterError>>()?;
    sort(&mut fits);
    Ok(fits)
}

/// Best first; of equal ones the first start's stays first.
pub(super) fn sort(fits: &mut [Fitted]) {
    fits.sort_by(|a, b| b.objective.total_cmp(&a.objective));
}
