//! Two effects together.

use super::attribute::{Explanation, explanations};
use super::decide::{Step, grown};
use super::null::{Bench, Look};
use super::{DiagnoseError, Setting};
use crate::progress::Stage;

/// First effects, and second effects for each, that pairs are made of.
const FIRSTS: usize = 2;
const SECONDS: usize = 12;
/// How often a partner of the best pair is kept and the other one looked for anew.
const EXCHANGES: usize = 3;

/// The best two of the `listed` explanations: the best beside each of the first few, then the best beside the partner that
/// was found, and so on. Neither of two effects need be much by itself. `first` is the first one, grown; `look`, how the
/// records look with it.
pub(super) fn best_pair<'a>(
    setting: &Setting<'a>,
    bench: &Bench<'a>,
    listed: &[&Explanation],
    (first, look): (&Step<'a>, Option<&Look>),
    stage: &Stage,
) -> Result<Option<Step<'a>>, DiagnoseError> {
    let mut tried = vec![first.accepted[0].key()];
    let mut best = match look {
        Some(look) => beside(setting, first, look, stage)?,
        None => None,
    };
    let mut take = |key: String, explanation: &Explanation| -> Result<_, DiagnoseError> {
        if tried.contains(&key) {
            return Ok(None);
        }
        tried.push(key);
        let Some(step) = grown(setting, bench, &[], explanation)? else {
            return Ok(None);
        };
        match step.bench.own_look()? {
            Some(look) => beside(setting, &step, &look, stage),
            None => Ok(None),
        }
    };
    let key = |e: &Explanation| bench.dictionary.candidates[e.candidate].key();
    let better = |best: &mut Option<Step<'a>>, pair: Option<Step<'a>>| {
        let gains =
            (pair.as_ref()).is_some_and(|p| best.as_ref().is_none_or(|b| p.score > b.score));
        if gains {
            *best = pair;
        }
        gains
    };
    for other in listed.iter().skip(1).take(FIRSTS - 1) {
        let pair = take(key(other), other)?;
        better(&mut best, pair);
    }
    for _ in 0..EXCHANGES {
        let Some(partner) = best.as_ref().map(|pair| pair.accepted[1].key()) else {
            break;
        };
        let Some(explanation) = listed.iter().find(|e| key(e) == partner) else {
            break;
        };
        let pair = take(partner, explanation)?;
        if !better(&mut best, pair) {
            break;
        }
    }
    Ok(best)
}

/// The best second effect beside a first one, if it beats a catch-all beside the first.
fn beside<'a>(
    setting: &Setting<'a>,
    step: &Step<'a>,
    look: &Look,
    stage: &Stage,
) -> Result<Option<Step<'a>>, DiagnoseError> {
    let bench = &step.bench;
    let candidates = &bench.dictionary.candidates;
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| look.gains[b].total_cmp(&look.gains[a]));
    let mut tried: Vec<usize> = (order.iter().copied())
        .filter(|&c| candidates[c].is_listed())
        .take(SECONDS)
        .collect();
    // And the catch-all that promises most.
    tried.extend(order.iter().copied().find(|&c| !candidates[c].is_listed()));
    let found = explanations(bench, look, setting.validation, Some(&tried), stage)?;
    let Some(best) = found
        .first()
        .filter(|e| candidates[e.candidate].is_listed())
    else {
        return Ok(None);
    };
    let pair = grown(setting, bench, &step.accepted, best)?;
    Ok(pair.map(|mut pair| {
        pair.score += step.score;
        pair
    }))
}
