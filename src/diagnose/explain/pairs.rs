//! Two effects together.

use super::findings::{Findings, leaves_nothing};
use super::found::{Found, improve, keep, own_theta};
use super::search::{Breadth, listed};
use super::terms::{Terms, of_keys};
use crate::diagnose::thresholds::Thresholds;
use crate::hypothesis::model::Model;
use crate::hypothesis::term::Term;
use crate::study::StudyError;
use std::sync::Arc;

/// Single effects that are looked at for something left, or for a second one beside them.
pub(in crate::diagnose) const SINGLES: usize = 3;
/// Least share of the best single effect's evidence of a first of a pair.
pub(in crate::diagnose) const FIRST: f64 = 1.0 / 3.0;

/// Second effects on top of the best singles.
pub(super) fn pairs(
    findings: &Findings,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
    enough: bool,
) -> Result<Vec<Found>, StudyError> {
    let thetas: Vec<Vec<f64>> = findings
        .listed
        .iter()
        .take(2)
        .filter_map(own_theta)
        .collect();
    let mut all: Vec<Found> = vec![];
    let adequate = |f: &&Found| {
        let left = findings.left(&f.keys());
        left.is_some_and(|left| leaves_nothing(f.gain, left))
    };
    let stands_out = |f: &&Found| f.gain > FIRST * findings.top();
    let sources: Vec<&Found> = match enough {
        true => findings.listed.iter().find(adequate).into_iter().collect(),
        false => (findings.listed.iter().take(SINGLES))
            .filter(stands_out)
            .collect(),
    };
    for first in sources {
        let Some(model) = &first.model else { continue };
        let others: Vec<Arc<Term>> = (terms.listed.iter())
            .filter(|t| !first.terms.iter().any(|own| own.key() == t.key()))
            .cloned()
            .collect();
        let count = if enough { 4 } else { 8 };
        let seconds = Breadth {
            listed: count,
            annealed: count.min(breadth.annealed),
            least: 3.0,
            ..breadth
        };
        keep(&mut all, listed(model, &others, origin, &thetas, seconds)?);
    }
    // A pair that wins has rivals: the second effect beside the rivals of the first.
    if let Some(pair) = all.first().filter(|pair| findings.wins(pair)).cloned() {
        let second = of_keys(terms.listed, &[pair.last().key()]);
        let (keys, first) = (
            pair.keys(),
            findings.gain(&pair.keys()[..1]).unwrap_or(findings.top()),
        );
        let rivals = (findings.listed.iter())
            .filter(|f| f.gain > first - Thresholds::RIVALS && !keys.contains(&f.last().key()));
        for model in rivals.filter_map(|f| f.model.as_ref()).take(SINGLES) {
            keep(&mut all, listed(model, &second, origin, &thetas, breadth)?);
        }
    }
    all.truncate(Thresholds::PAIRS);
    Ok(all)
}

/// A pair may win since the fits of its effects alone stopped early, or since one of the two stood for a coarse step: these begin again
/// where the pair ended.
pub(super) fn alone(
    base: &Model,
    findings: &mut Findings,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
) -> Result<(), StudyError> {
    let first = findings.several.first();
    let Some(pair) = first.filter(|pair| findings.wins(pair)) else {
        return Ok(());
    };
    let keys = pair.keys();
    let own = of_keys(terms.listed, &keys);
    let thetas: Vec<Vec<f64>> = own_theta(pair).into_iter().collect();
    let again = listed(base, &own, origin, &thetas, breadth.of_all())?;
    improve(&mut findings.listed, again);
    Ok(())
}
