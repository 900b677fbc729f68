//! Power: the smallest magnitude of each listed effect that records like these reveal in 80 of 100 cases.
//!
//! Let d⊥ be the change of the innovations by an effect of magnitude m that θ and noise levels cannot imitate (`fit/reference.rs`). The
//! root of twice the gain in likelihood is about |N(‖d⊥(m)‖, 1)|, and a gain of g nats is needed to be seen:
//!
//! ```text
//! ‖d⊥(m₈₀)‖ = √(2g) + 0.84
//! ```
//!
//! Sizes are linear in d⊥; of thresholds the values on the grid of the search are looked at, the mildest that shows.

use crate::diagnose::outcome::Visible;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::axis::SMALL;
use crate::fit::reference::Reference;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::search::screen::looked;
use crate::hypothesis::term::{Part, Term};
use crate::parallel::try_each;
use crate::study::StudyError;
use std::sync::Arc;

/// The smallest visible magnitude of each listed effect.
pub(in crate::diagnose) fn power(
    model: &Model,
    terms: &[Arc<Term>],
) -> Result<Vec<Visible>, StudyError> {
    let Some(reference) = model.reference()? else {
        return Ok(vec![]);
    };
    let need = (2.0 * THRESHOLDS.seen).sqrt() + THRESHOLDS.power_quantile;
    let each = try_each(terms, |term| {
        let (value, distance) = smallest(model, &reference, term, need)?;
        let visible = Visible {
            id: term.id.clone(),
            target: term.target.clone(),
            magnitude: first_magnitude(term),
            value,
        };
        Ok::<_, StudyError>((term.key(), visible, distance))
    })?;
    // Of several ways to use one effect, the one that shows best.
    let mut best: Vec<(String, Visible, f64)> = vec![];
    for way in each {
        match best.iter_mut().find(|(key, ..)| *key == way.0) {
            Some(old) if old.2 <= way.2 => {}
            Some(old) => *old = way,
            None => best.push(way),
        }
    }
    Ok(best.into_iter().map(|(_, visible, _)| visible).collect())
}

fn first_magnitude(term: &Term) -> String {
    match &term.part {
        Part::Effect { effect, held, .. } => (effect.magnitudes().iter())
            .find(|m| !held.contains_key(m.name))
            .map_or_else(String::new, |m| m.name.to_owned()),
        Part::Disturbance { .. } | Part::Share { .. } | Part::Function(_) => String::new(),
    }
}

/// The smallest first magnitude that shows, and ‖d⊥‖ there over what is needed; infinite where none does.
fn smallest(
    model: &Model,
    reference: &Reference,
    term: &Arc<Term>,
    need: f64,
) -> Result<(Option<f64>, f64), StudyError> {
    let extended = model.extend(term)?;
    let axis = &extended.problem.axes[extended.entries[0]];
    let all = looked(model, &extended, |look, there| {
        let own = reference.own(&reference.direction(there)).sqrt();
        match look.scales {
            true if own > 0.0 => Some((look.m[0].abs() * need / own, need / own * SMALL)),
            false if own >= need => Some((look.m[0], own / need)),
            _ => None,
        }
    })?;
    let mut best = (None, f64::INFINITY);
    for found in all.into_iter().flatten() {
        if found.1 < best.1 && axis.bounds.contains(found.0) {
            best = (Some(found.0), found.1);
        }
    }
    Ok(best)
}
