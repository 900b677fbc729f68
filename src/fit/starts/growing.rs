//! Starts from fits to the beginning of the records, then to more of them.
//!
//! A black box, or equations without process noise, does not follow a record, it starts with it: at a wrong θ a run of an oscillator is soon in
//! another phase, and the likelihood of a whole record has a top for each cycle that is lost. Over the first quarter of a record there is one.

use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::fit::starts::{Screen, climbs, random_point, ranked, screened};
use crate::likelihood::kalman::FilterError;
use crate::record::Record;
use crate::twin::Noise;

/// The same twin on the beginning of long records; `None` where that is more than a first share of them.
///
/// Searches move where many rows agree, and a long record repeats what its beginning tells: to find tops there, and to end them on all rows,
/// takes a few passes of the whole in place of all. A sketch may be long enough for one of its own.
pub(in crate::fit) fn sketch(problem: &Problem) -> Option<Problem> {
    let share = BUDGET.sketched_rows as f64 / problem.samples() as f64;
    let share = share.max(BUDGET.sketched_share);
    (share < BUDGET.grown_shares[0] && !problem.is_simulated()).then(|| begun(problem, share))
}

/// The same twin on the beginning of each record.
fn begun(problem: &Problem, share: f64) -> Problem {
    let part = |r: &Record| {
        let part = r.first_part(((share * r.samples() as f64) as usize).max(1));
        part.unwrap_or_else(|| r.clone())
    };
    problem.on(problem.records.iter().map(part).collect::<Vec<_>>())
}

/// Random starts that fits to the beginning of the records have moved.
pub(super) fn grown(
    problem: &Problem,
    noise: Noise,
    iterations: usize,
) -> Result<Vec<Vec<f64>>, FilterError> {
    let starts = |short: &Problem| {
        let loud = screened(short, noise.child("loud"), Screen::LOUD_APART)?;
        let quiet = screened(short, noise.child("quiet"), Screen::quiet(short))?;
        Ok([loud, quiet].concat())
    };
    grow(problem, starts, (iterations, usize::MAX))
}

/// Starts over the beginning of the records, moved by fits to ever more of these, of which so many are kept, the best first.
fn grow(
    problem: &Problem,
    starts: impl FnOnce(&Problem) -> Result<Vec<Vec<f64>>, FilterError>,
    (iterations, kept): (usize, usize),
) -> Result<Vec<Vec<f64>>, FilterError> {
    let [first, second] = BUDGET.grown_shares.map(|share| begun(problem, share));
    let mut starts = starts(&first)?;
    for short in [first, second] {
        let fits = climbs(&short, &starts, iterations)?;
        starts = fits.into_iter().take(kept).map(|fit| fit.theta).collect();
    }
    Ok(starts)
}

/// The best θ of all starts; `None` where the twin can be simulated at none.
pub(crate) fn base_fit(
    problem: &Problem,
    initial: Option<&[f64]>,
    noise: Noise,
) -> Result<Option<Fitted>, FilterError> {
    let initial = initial.map(|theta| problem.clamp(&problem.full(theta)));
    let points = (0..BUDGET.grown_points)
        .map(|i| random_point(problem, i, noise.child("starts")))
        .chain([problem.centre()])
        .chain(initial.clone())
        .collect();
    let best = |short: &Problem| {
        let mut starts = ranked(short, points)?;
        starts.truncate(BUDGET.grown_starts);
        Ok(starts)
    };
    let budget = (BUDGET.grown_iterations, BUDGET.grown_kept);
    let mut starts = grow(problem, best, budget)?;
    starts.extend(initial);
    starts.push(problem.centre());
    Ok(climbs(problem, &starts, BUDGET.grown_iterations)?
        .into_iter()
        .next())
}
