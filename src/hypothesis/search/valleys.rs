//! Effects whose time, delay or frequency ended in a valley of its own.

use super::explanation::Explanation;
use super::fits::settling_last;
use super::model::{Extended, Model};
use crate::fit::climb::{Reached, climb, reach, reached};
use crate::fit::problem::Problem;
use crate::hypothesis::limits::{SEARCH, TERM};
use crate::hypothesis::term::Term;
use crate::likelihood::kalman::FilterError;
use crate::parallel::try_each;

/// θ of the twin and magnitudes.
type Start = (Vec<f64>, Vec<f64>);

/// Full θ, and the objective there.
type Place = (Vec<f64>, f64);

/// Fits effects again that may be better, `all` being sorted, best first: from where the same law ended at places where it explains more,
/// with either sign of its size; from better times; the best ones from all times nearby.
pub(super) fn leave_valleys(
    model: &Model,
    all: &mut [Explanation],
    floor: f64,
) -> Result<(), FilterError> {
    let top = all.first().map_or(floor, |f| f.log_z);
    let worth = floor + SEARCH.null_like;
    let levels = [worth, worth.max(top - SEARCH.candidates)];
    let better = try_each(0..all.len(), |i| again(model, &all[i], &all[..i], levels))?;
    for (old, new) in all.iter_mut().zip(better) {
        if let Some(new) = new.filter(|new| new.log_z > old.log_z) {
            *old = new;
        }
    }
    Ok(())
}

/// One effect fitted again; `None` where no start leads further. From `worth` on an effect has its time moved, from `least` on it is near the best.
fn again(
    model: &Model,
    found: &Explanation,
    before: &[Explanation],
    [worth, least]: [f64; 2],
) -> Result<Option<Explanation>, FilterError> {
    let (Some(shape), Some(own)) = (found.last().shape(), &found.model) else {
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
    if !is_beaten && found.log_z <= worth {
        return Ok(None);
    }
    let extended = model.extend(term)?;
    // One sample beside its time an effect may be a dozen nats short: none is called worse before it has the best time in reach. Of a black box
    // each look costs an ensemble.
    let is_cheap = !own.problem.is_simulated();
    if found.log_z > least {
        starts.extend(nearby(found, term));
    } else if found.log_z > worth && is_cheap {
        starts.extend(at_another_time(own, &extended, term)?);
    }
    if is_beaten && let Some(mut place) = between(own, &extended, term)? {
        if is_cheap {
            place = at_its_time(own, &extended, term, place)?;
        }
        starts.push(start_of(own, &extended, place));
    }
    let mut best = begun_again(model, &extended, found, &starts)?;
    for _ in 1..SEARCH.rounds {
        let Some(old) = best.as_ref().filter(|old| old.log_z > least) else {
            break;
        };
        let next = begun_again(model, &extended, old, &nearby(old, term))?;
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
    extended: &Extended,
    found: &Explanation,
    starts: &[Start],
) -> Result<Option<Explanation>, FilterError> {
    let Some(own) = found.model.as_ref().filter(|_| !starts.is_empty()) else {
        return Ok(None);
    };
    let settled = settling_last(&own.problem, extended);
    let from: Vec<Vec<f64>> = (starts.iter())
        .map(|(theta, m)| settled(extended.from(theta, model.beside(extended, m))))
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
fn between(own: &Model, extended: &Extended, term: &Term) -> Result<Option<Place>, FilterError> {
    let &[time] = &term.times()[..] else {
        return Ok(None);
    };
    let time = extended.entries[time];
    let held = own.problem.holding(|j| j == time);
    let record = &own.problem.records[0];
    let (count, mut theta) = (SEARCH.closer * (TERM.times + 1), own.fitted.theta.clone());
    let mut best: Option<Place> = None;
    for i in 1..count {
        theta[time] = record.drive().dt() * (record.samples() * i) as f64 / count as f64;
        if let Some(end) = reach(&held, &theta, SEARCH.answers)? {
            theta.clone_from(&end.theta);
            if best.as_ref().is_none_or(|best| end.objective > best.1) {
                best = Some((end.theta, end.objective));
            }
        }
    }
    Ok(best)
}

/// A better time or delay of a fit than its own; `None` where there is none in reach.
fn at_another_time(
    own: &Model,
    extended: &Extended,
    term: &Term,
) -> Result<Option<Start>, FilterError> {
    let here = own.fitted.objective;
    let place = at_its_time(own, extended, term, (own.fitted.theta.clone(), here))?;
    Ok((place.1 > here).then(|| start_of(own, extended, place)))
}

fn start_of(own: &Model, extended: &Extended, (theta, _): Place) -> Start {
    let m = extended.entries.iter().map(|&j| theta[j]).collect();
    (theta[..own.base.parameters().len()].to_vec(), m)
}

/// The place that moves of each time or delay lead to, the longest first, each as long as it gains; all others answer.
fn at_its_time(
    own: &Model,
    extended: &Extended,
    term: &Term,
    mut best: Place,
) -> Result<Place, FilterError> {
    let dt = own.problem.records[0].drive().dt();
    for i in term.kinked() {
        let entry = extended.entries[i];
        let held = own.problem.holding(|j| j == entry);
        // Others have to answer here, too, or their answers pass for those to a move.
        best = moved(&held, &best, entry, 0.0)?.unwrap_or(best);
        for samples in moves(&own.problem).rev() {
            for by in [-samples * dt, samples * dt] {
                while let Some(better) = moved(&held, &best, entry, by)? {
                    best = better;
                }
            }
        }
    }
    Ok(best)
}

/// The place with an entry moved, the others having answered; `None` where it is no better, or the entry at its bound.
fn moved(
    held: &Problem,
    from: &Place,
    entry: usize,
    by: f64,
) -> Result<Option<Place>, FilterError> {
    let mut theta = from.0.clone();
    let there = held.axes[entry].bounds.clamp(theta[entry] + by);
    let before = std::mem::replace(&mut theta[entry], there);
    if by != 0.0 && there == before {
        return Ok(None);
    }
    let end = reach(held, &theta, SEARCH.answers)?;
    let better = end.filter(|end| end.objective > from.1 + held.done());
    Ok(better.map(|end| (end.theta, end.objective)))
}

/// Moves of a time or a delay in samples, each twice the one before, up to a quarter of the distance between the times that are tried first.
fn moves(problem: &Problem) -> impl DoubleEndedIterator<Item = f64> {
    let longest = 0.25 * problem.records[0].samples() as f64 / (TERM.times + 1) as f64;
    let doublings = (longest / SEARCH.first_move).log2().max(1.0) as i32;
    (0..=doublings).map(|doubling| SEARCH.first_move * 2f64.powi(doubling))
}

/// θ of the twin and magnitudes with each time or delay moved.
fn nearby(found: &Explanation, term: &Term) -> Vec<Start> {
    let (Some(theta), Some(m), Some(model)) =
        (found.own_theta(), found.magnitudes(), found.model.as_ref())
    else {
        return vec![];
    };
    let dt = model.problem.records[0].drive().dt();
    let mut all = vec![];
    for i in term.kinked() {
        for samples in moves(&model.problem).flat_map(|samples| [-samples, samples]) {
            let mut m = m.clone();
            m[i] += samples * dt;
            all.push((theta.clone(), m));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::{fitted, record, tanks};
    use crate::effect::{Catalogue, augment};
    use std::sync::Arc;

    /// A step that ended three samples before its time, far below another effect: it was left there, several nats short.
    #[test]
    fn an_effect_far_below_another_finds_its_time() {
        let study = tanks(150);
        let effect = Catalogue::default().effect("parameter-step", "k3").unwrap();
        let twin = augment(study.twin().clone(), vec![effect]).unwrap();
        let truth = [study.twin().parameters().centre(), vec![-0.4, 257.0]].concat();
        let (model, terms) = fitted(&study, &[record(&study, &twin, &truth, 3)]);
        let of = |key: &str| terms.iter().find(|term| term.key() == key).unwrap();
        let (step, bias) = (of("parameter-step@k3"), of("sensor-bias@sensor"));
        let ended = |term: &Arc<Term>, m: &[f64]| {
            let extended = model.extend(term).unwrap();
            let held = extended
                .problem
                .holding(|j| extended.entries[1..].contains(&j));
            let end = climb(&held, &model.beside(&extended, m), 40)
                .unwrap()
                .unwrap();
            Explanation::of(extended.fitted(model.base.clone(), end).unwrap())
        };
        let found = ended(step, &[-0.4, 245.0]);
        let floor = model.log_evidence;
        assert!(
            found.log_z > floor + SEARCH.null_like,
            "{}",
            found.log_z - floor
        );
        let mut best = ended(bias, &[0.01]);
        best.log_z = found.log_z + 50.0;
        let mut all = [best, found.clone()];
        leave_valleys(&model, &mut all, floor).unwrap();
        let time = all[1].magnitudes().unwrap()[1];
        assert!((time - 257.0).abs() < 4.0, "{time}");
        assert!(
            all[1].log_z > found.log_z + 3.0,
            "{} {}",
            all[1].log_z,
            found.log_z
        );
    }
}
