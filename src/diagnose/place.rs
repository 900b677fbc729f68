//! Where the gap lies: targets, windows, regions.

use super::DiagnoseError;
use super::attribute::{Explanation, probabilities};
use super::decide::Answer;
use super::localise::{Cell, shares};
use super::null::{Bench, Test};
use super::result::*;
use crate::filter::recoverable;
use crate::twin::{Outline, Signal};

/// Windows and regions are reported below this p-value.
const NOTABLE: f64 = 0.1;

/// `where` of the report, from what explains the record and from what the simulations say of each cell.
pub(super) fn locate(
    bench: &Bench<'_>,
    found: &[Explanation],
    test: &Test,
    answer: &Answer,
    outline: &Outline,
) -> Result<Where, DiagnoseError> {
    let candidates = &bench.dictionary.candidates;
    let chances = probabilities(found);
    let mut targets: Vec<TargetShare> = vec![];
    for (e, chance) in found.iter().zip(&chances) {
        let candidate = &candidates[e.candidate];
        let p_value = test.candidates.get(e.candidate).copied().unwrap_or(1.0);
        match targets.iter_mut().find(|t| t.target == candidate.target) {
            Some(known) => {
                known.share += chance;
                known.p_value = known.p_value.min(p_value);
            }
            None => targets.push(TargetShare {
                target: candidate.target.clone(),
                p_value,
                share: *chance,
            }),
        }
    }
    targets.sort_by(|a, b| b.share.total_cmp(&a.share));
    let target = match answer.accepted.first() {
        Some(accepted) => Some(accepted.target.clone()),
        None => answer
            .catch_all
            .clone()
            .or_else(|| targets.first().map(|t| t.target.clone())),
    };
    // The best explanation, whatever it is, says when it helps.
    let states = bench.problem.states(&bench.fitted.theta)?;
    let means: Vec<Signal> = states.iter().map(|(_, s)| s.clone()).collect();
    let before: Vec<_> = states.into_iter().map(|(f, _)| f).collect();
    let after = match found.first() {
        Some(best) => recoverable(bench.explained(best).filtered(&best.fitted.theta))?,
        None => None,
    };
    let records = bench.problem.records;
    let shares = shares(&bench.bins, &means, records, &before, after.as_deref());
    let (mut windows, mut regions) = (vec![], vec![]);
    for ((cell, p), share) in bench.bins.cells.iter().zip(&test.local).zip(shares) {
        if *p > NOTABLE {
            continue;
        }
        match cell {
            Cell::Window {
                record,
                channel,
                from,
                to,
            } => windows.push(Window {
                record: *record,
                start: records[*record].drive().time(*from),
                end: records[*record].drive().time(to - 1),
                channel: outline.outputs[*channel].name.clone(),
                p_value: *p,
                share,
            }),
            Cell::Region {
                variable,
                low,
                high,
            } => regions.push(Region {
                variable: bench.bins.variables[*variable].clone(),
                low: *low,
                high: *high,
                p_value: *p,
                share,
            }),
        }
    }
    // Shares of all channels and variables add up to one.
    let channels = outline.outputs.len() as f64;
    windows.iter_mut().for_each(|w| w.share /= channels);
    let variables = bench.bins.variables.len().max(1) as f64;
    regions.iter_mut().for_each(|r| r.share /= variables);
    windows.sort_by(|a, b| {
        b.share
            .total_cmp(&a.share)
            .then(a.p_value.total_cmp(&b.p_value))
    });
    regions.sort_by(|a, b| {
        b.share
            .total_cmp(&a.share)
            .then(a.p_value.total_cmp(&b.p_value))
    });
    Ok(Where {
        target,
        targets,
        windows,
        regions,
    })
}
