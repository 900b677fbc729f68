//! Other kinds of noise: alone, beside one effect, in the place of a second one.

use super::findings::{Findings, suffices};
use super::found::Found;
use super::search::{Breadth, listed};
use super::terms::{Terms, on_top};
use crate::diagnose::thresholds::Thresholds;
use crate::hypothesis::model::Model;
use crate::hypothesis::term::{Part, Term};
use crate::study::StudyError;
use std::sync::Arc;

/// Adds other kinds of noise to what was found alone.
pub(super) fn with_noise(
    base: &Model,
    terms: &Terms<'_>,
    breadth: Breadth,
    findings: Findings,
) -> Result<Findings, StudyError> {
    let (origin, every) = (base.log_evidence, breadth.of_all());
    let noise = listed(base, terms.noise, origin, &[], every)?;
    Ok(Findings {
        noise_pairs: noise_pairs(&noise, terms.noise, origin, every)?,
        noise,
        noise_beside: noise_beside(&findings.listed, terms.noise, origin, every)?,
        ..findings
    })
}

/// The outliers that are likeliest beside the best listed effect, at other sensors than its own. Correlated noise is not asked for here:
/// it would pass for what an effect leaves.
fn noise_beside(
    singles: &[Found],
    noise: &[Arc<Term>],
    origin: f64,
    breadth: Breadth,
) -> Result<Option<(String, f64)>, StudyError> {
    let best = singles.first().filter(|f| f.gain > Thresholds::WIDER);
    let Some((best, model)) = best.and_then(|f| Some((f, f.model.as_ref()?))) else {
        return Ok(None);
    };
    let outliers: Vec<Arc<Term>> = (noise.iter())
        .filter(|term| matches!(term.part, Part::Effect { .. }))
        .filter(|term| term.target != best.last().target)
        .cloned()
        .collect();
    let found = listed(model, &outliers, origin, &[], breadth)?;
    Ok((found.first()).map(|f| (f.last().key(), f.gain - best.gain)))
}

/// The kind of noise that explains more beside one effect of the best pair than the other effect does, its price paid, and leaves nothing:
/// what remains beside an effect, noise would hide.
pub(super) fn instead_of_second(
    findings: &Findings,
    terms: &Terms<'_>,
    origin: f64,
    breadth: Breadth,
) -> Result<Option<(String, f64)>, StudyError> {
    let first = findings.several.first();
    let Some(pair) = first.filter(|pair| findings.wins(pair)) else {
        return Ok(None);
    };
    let keys = pair.keys();
    let mut best: Option<(Found, f64)> = None;
    for single in (findings.listed.iter()).filter(|f| keys.contains(&f.last().key())) {
        let Some(model) = &single.model else { continue };
        let found = listed(model, terms.noise, origin, &[], breadth.shallow().of_all())?;
        let Some(found) = found.into_iter().next() else {
            continue;
        };
        if best.as_ref().is_none_or(|(best, _)| found.gain > best.gain) {
            let gain = found.gain - single.gain;
            best = Some((found, gain));
        }
    }
    let enough = pair.gain - findings.price(2);
    let Some((found, gain)) = best.filter(|(found, _)| found.gain > enough) else {
        return Ok(None);
    };
    let on_top = on_top(&found, terms, origin, breadth.few())?;
    let is_enough = on_top.is_some_and(|on_top| suffices(&found, &on_top));
    Ok(is_enough.then(|| (found.last().key(), gain)))
}

/// Second kinds of noise beside the likeliest one.
fn noise_pairs(
    noise: &[Found],
    terms: &[Arc<Term>],
    origin: f64,
    breadth: Breadth,
) -> Result<Vec<Found>, StudyError> {
    let best = noise.first().filter(|f| f.gain > Thresholds::NOISE);
    let Some((best, model)) = best.and_then(|f| Some((f, f.model.as_ref()?))) else {
        return Ok(vec![]);
    };
    let others: Vec<Arc<Term>> = (terms.iter())
        .filter(|term| term.key() != best.last().key())
        .cloned()
        .collect();
    listed(model, &others, origin, &[], breadth)
}
