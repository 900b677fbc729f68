//! Effects whose time, delay or frequency ended in a valley of its own.

use super::explanation::Explanation;
use super::fits::settling_last;
use super::model::Model;
use crate::fit::climb::{Reached, climb, reach, reached};
use crate::hypothesis::limits::{SEARCH, TERM};
use crate::hypothesis::term::Term;
use crate::likelihood::kalman::FilterError;
use crate::parallel::try_each;

/// θ of the twin and magnitudes.
type Start = (Vec<f64>, Vec<f64>);

/// Fits effects again that may be better, `all` being sorted, best first: from where the same law ended at places where it explains more,
/// with either sign of its size; the best ones from times nearby.
pub(super) fn leave_valleys(
    model: &Model,
    all: &mut [Explanation],
    floor: f64,
) -> Result<(), FilterError> {
    let top = all.first().map_or(floor, |f| f.log_z);
    let least = (top - SEARCH.candidates).max(floor + SEARCH.null_like);
    let better = try_each(0..all.len(), |i| again(model, &all[i], &all[..i], least))?;
    for (old, new) in all.iter_mut().zip(better) {
        if let Some(new) = new.filter(|new| new.log_z > old.log_z) {
            *old = new;
        }
    }
    Ok(())
}

/// One effect fitted again; `None` where no start leads further. Only effects of at least so many nats are looked at.
fn again(
    model: &Model,
    found: &Explanation,
    before: &[Explanation],
    least: f64,
) -> Result<Option<Explanation>, FilterError> {
    let Some(shape) = found.last().shape() else {
        return Ok(None);
    };
    let term = found.last();
    let alike = (before.iter())
        .filter(|other| other.log_z > least && other.last().shape().as_ref() == Some(&shape))
        .filter_map(|other| Some((other.own_theta()?, other.magnitudes()?)));
    let mut starts: Vec<Start> = vec![];
    for (theta, m) in alike.take(SEARCH.places) {
        if term.starts.iter().all(|start| start.scales) {
            let mut opposite = m.clone();
            opposite[0] = -opposite[0];
            starts.push((theta.clone(), opposite));
        }
        starts.push((theta, m));
    }
    let is_beaten = !starts.is_empty();
    if found.log_z > least {
        starts.extend(nearby(found, term));
    }
    if is_beaten {
        starts.extend(between(model, found)?);
    }
    if starts.is_empty() {
        return Ok(None);
    }
    let mut best = begun_again(model, found, &starts)?;
    for _ in 1..SEARCH.rounds {
        let Some(old) = best.as_ref().filter(|old| old.log_z > least) else {
            break;
        };
        let next = begun_again(model, old, &nearby(old, term))?;
        match next.filter(|next| next.log_z > old.log_z + SEARCH.better) {
            Some(next) => best = Some(next),
            None => break,
        }
    }
    Ok(best)
}

/// The best fit from these θ and magnitudes; `None` where none is better than its own.
fn begun_again(
    model: &Model,
    found: &Explanation,
    starts: &[Start],
) -> Result<Option<Explanation>, FilterError> {
    let Some(own) = &found.model else {
        return Ok(None);
    };
    let extended = model.extend(found.last())?;
    let settled = settling_last(&own.problem, &extended);
    let from: Vec<Vec<f64>> = (starts.iter())
        .map(|(theta, m)| settled(extended.from(theta, model.beside(&extended, m))))
        .collect::<Result<_, _>>()?;
    let all = reached(&own.problem, &from, SEARCH.begun_again)?;
    let better = |end: &&Reached| end.objective > own.fitted.objective;
    let mut carried = None;
    for end in all.iter().take_while(better) {
        carried = climb(&own.problem, &end.theta, SEARCH.carried)?;
        if carried.is_some() {
            break;
        }
    }
    let better = carried.and_then(|carried| own.refitted(carried));
    Ok(better.map(|m| Explanation {
        terms: m.terms.clone(),
        log_z: found.log_z + m.log_evidence - own.log_evidence,
        model: Some(m),
    }))
}

/// The best of times closer together than those tried first, θ and the size having answered each; `None` for a law without a time, or
/// with several.
fn between(model: &Model, found: &Explanation) -> Result<Option<Start>, FilterError> {
    let (Some(own), &[time]) = (&found.model, &found.last().times()[..]) else {
        return Ok(None);
    };
    let extended = model.extend(found.last())?;
    let time = extended.entries[time];
    let held = own.problem.holding(|j| j == time);
    let record = &own.problem.records[0];
    let (count, mut theta) = (SEARCH.closer * (TERM.times + 1), own.fitted.theta.clone());
    let mut best: Option<Reached> = None;
    for i in 1..count {
        theta[time] = record.drive().dt() * (record.samples() * i) as f64 / count as f64;
        if let Some(end) = reach(&held, &theta, SEARCH.answers)? {
            theta.clone_from(&end.theta);
            if best
                .as_ref()
                .is_none_or(|best| end.objective > best.objective)
            {
                best = Some(end);
            }
        }
    }
    let d = own.base.parameters().len();
    Ok(best.map(|best| {
        let m = extended.entries.iter().map(|&j| best.theta[j]).collect();
        (best.theta[..d].to_vec(), m)
    }))
}

/// θ of the twin and magnitudes with each time or delay moved.
fn nearby(found: &Explanation, term: &Term) -> Vec<Start> {
    let (Some(theta), Some(m), Some(model)) =
        (found.own_theta(), found.magnitudes(), found.model.as_ref())
    else {
        return vec![];
    };
    let record = &model.problem.records[0];
    let longest = 0.25 * record.samples() as f64 / (TERM.times + 1) as f64;
    let moves: Vec<f64> =
        std::iter::successors(Some(SEARCH.first_move), |samples| Some(2.0 * samples))
            .take_while(|samples| *samples <= longest.max(2.0 * SEARCH.first_move))
            .collect();
    let mut all = vec![];
    for i in term.kinked() {
        for samples in moves.iter().flat_map(|samples| [-samples, *samples]) {
            let mut m = m.clone();
            m[i] += samples * record.drive().dt();
            all.push((theta.clone(), m));
        }
    }
    all
}
