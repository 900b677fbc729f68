//! Searches for the most probable θ, and where they begin: at drawn points, at the poles of a record (`spectral`), and where fits to its
//! beginning end (`growing`), and at tops along the axes through the best one (`scan`).

pub(crate) mod growing;
mod scan;
mod spectral;

use crate::math::descending;
use growing::{grown, sketch};
use scan::scanned;
pub(crate) use spectral::spectral_starts;

use crate::fit::budget::{BUDGET, ITERATIONS};
use crate::fit::climb::{Fitted, climb};
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::parallel::try_each;
use crate::twin::Noise;

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
    let sketch = sketch(problem);
    let spectral = spectral_starts(sketch.as_ref().unwrap_or(problem));
    let initial = [initial, &spectral].concat();
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
    descending(&mut all, |a| a.0);
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

/// Searches from all starts, best first.
pub(super) fn climbs(
    problem: &Problem,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Vec<Fitted>, FilterError> {
    let ends = ends(problem, starts, iterations)?;
    let mut fits: Vec<Fitted> = ends.into_iter().flatten().collect();
    sort(&mut fits);
    Ok(fits)
}

/// The end of the search from each start. Those of long records go over their [`sketch`] first; from a top there, one way leads on.
fn ends(
    problem: &Problem,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Vec<Option<Fitted>>, FilterError> {
    let begun = match sketch(problem) {
        Some(sketch) => ends(&sketch, starts, iterations)?,
        None => vec![None; starts.len()],
    };
    let all: Vec<(Option<Fitted>, &Vec<f64>)> = begun.into_iter().zip(starts).collect();
    let is_same = |(one, _): &(Option<Fitted>, _), (other, _): &(Option<Fitted>, _)| {
        one.as_ref()
            .zip(other.as_ref())
            .is_some_and(|(one, other)| is_one_top(problem, one, other))
    };
    once_each(&all, is_same, |(begun, start)| {
        let from = begun.as_ref().map_or(*start, |fit| &fit.theta);
        climb(problem, from, iterations)
    })
}

/// Returns whether two searches have found the same top at the same place.
fn is_one_top(problem: &Problem, one: &Fitted, other: &Fitted) -> bool {
    (one.objective - other.objective).abs() <= BUDGET.same_top
        && other.squared_distance(problem, one) <= 1.0
}

/// Does work once for all items that are the same, on all cores; returns what it finds for each item.
fn once_each<T: Sync, R: Clone + Send>(
    items: &[T],
    is_same: impl Fn(&T, &T) -> bool,
    work: impl Fn(&T) -> Result<R, FilterError> + Sync,
) -> Result<Vec<R>, FilterError> {
    let mut firsts: Vec<&T> = vec![];
    let of: Vec<usize> = (items.iter())
        .map(|item| {
            let known = firsts.iter().position(|first| is_same(item, first));
            known.unwrap_or_else(|| {
                firsts.push(item);
                firsts.len() - 1
            })
        })
        .collect();
    let found = try_each(firsts, work)?;
    Ok(of.into_iter().map(|i| found[i].clone()).collect())
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
    let is_same = |one: &Fitted, other: &Fitted| one.theta == other.theta;
    let mut fits = once_each(&fits, is_same, |fit| {
        if best - fit.objective > BUDGET.near {
            return Ok(fit.clone());
        }
        Ok(climb(&precise, &fit.theta, iterations)?.unwrap_or_else(|| fit.clone()))
    })?;
    sort(&mut fits);
    Ok(fits)
}

/// Best first; of equal ones the first start's stays first.
pub(super) fn sort(fits: &mut [Fitted]) {
    descending(fits, |a| a.objective);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::{Beliefs, measured};
    use crate::record::{Drive, Record};
    use crate::twin::{DigitalTwin, Twin};
    use crate::twins::VanDerPol;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn what_is_the_same_is_done_once() {
        let calls = AtomicUsize::new(0);
        let halves = once_each(
            &[4, 7, 5, 8, 6],
            |a, b| a / 2 == b / 2,
            |item| {
                calls.fetch_add(1, Ordering::Relaxed);
                Ok(item / 2)
            },
        );
        assert_eq!(halves.unwrap(), [2, 3, 2, 4, 3]);
        assert_eq!(calls.into_inner(), 3);
    }

    /// Searches of a long record that meet over its beginning end as one, each counted, where a search over all of it ends.
    #[test]
    fn searches_of_a_long_record_end_where_one_of_it_does() {
        let drive = Drive::autonomous(0.05, 9000).unwrap();
        let outputs = VanDerPol.simulate(&[1.3], &drive, Noise::new(1, "long", 0));
        let records = [Record::new(drive, outputs.unwrap()).unwrap()];
        let beliefs = Beliefs {
            step: 0.05,
            ..Beliefs::default()
        };
        let measured = measured(&Twin::new(VanDerPol), &records, &beliefs).unwrap();
        let problem = Problem::of_measured(&measured, records);
        assert_eq!(sketch(&problem).unwrap().samples(), 2000);
        let starts: Vec<Vec<f64>> = [1.0, 1.5, 2.0]
            .map(|nu| {
                let mut theta = problem.centre();
                theta[0] = nu;
                problem.begin(&theta)
            })
            .into();
        let found = climbs(&problem, &starts, ITERATIONS).unwrap();
        let whole = climb(&problem, &starts[0], ITERATIONS).unwrap().unwrap();
        assert_eq!((found.len(), agreeing(&found)), (3, 3));
        assert!(found.iter().all(|fit| fit.theta == found[0].theta));
        assert!((found[0].objective - whole.objective).abs() < 0.02);
    }
}
