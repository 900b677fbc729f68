//! Starts from fits to the beginning of the records, then to more of them.
//!
//! A black box, or equations without process noise, does not follow a record, it starts with it: at a wrong θ a run of an oscillator is soon in
//! another phase, and the likelihood of a whole record has a top for each cycle that is lost. Over the first quarter of a record there is one.

use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::fit::starts::{Screen, climbs, screened};
use crate::likelihood::kalman::FilterError;
use crate::record::Record;
use crate::twin::Noise;

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
    let mut starts = vec![];
    for (level, share) in BUDGET.grown_shares.into_iter().enumerate() {
        let short = begun(problem, share);
        if level == 0 {
            starts = screened(&short, noise.child("loud"), Screen::LOUD_APART)?;
            let quiet = Screen::quiet(&short);
            starts.extend(screened(&short, noise.child("quiet"), quiet)?);
        }
        let fits = climbs(&short, &starts, iterations)?;
        starts = fits.into_iter().map(|fit| fit.theta).collect();
    }
    Ok(starts)
}

/// The best θ of all starts; `None` where the twin can be simulated at none.
pub(crate) fn base_fit(
    problem: &Problem,
    initial: Option<&[f64]>,
    noise: Noise,
) -> Result<Option<Fitted>, FilterError> {
    let space = problem.twin.parameters();
    let initial = initial.map(|theta| problem.clamp(&problem.full(theta)));
    let mut starts: Vec<Vec<f64>> = (0..BUDGET.grown_points)
        .map(|i| {
            let noise = noise.child("starts").sample(i);
            let theta = match i % 2 {
                0 => space.draw_prior(noise),
                _ => space.draw_bounds(noise),
            };
            problem.drawn(problem.full(&theta), noise)
        })
        .chain([problem.centre()])
        .chain(initial.clone())
        .collect();
    for (level, share) in BUDGET.grown_shares.into_iter().enumerate() {
        let short = begun(problem, share);
        if level == 0 {
            let values = short.log_posteriors(&starts)?;
            let mut all: Vec<(f64, Vec<f64>)> = (values.into_iter().zip(starts))
                .filter_map(|(value, theta)| Some((value?, theta)))
                .collect();
            all.sort_by(|a, b| b.0.total_cmp(&a.0));
            starts = all
                .into_iter()
                .take(BUDGET.grown_starts)
                .map(|(_, theta)| theta)
                .collect();
        }
        let mut fits = climbs(&short, &starts, BUDGET.grown_iterations)?;
        fits.truncate(BUDGET.grown_kept);
        starts = fits.into_iter().map(|f| f.theta).collect();
    }
    starts.extend(initial);
    starts.push(problem.centre());
    Ok(climbs(problem, &starts, BUDGET.grown_iterations)?
        .into_iter()
        .next())
}
