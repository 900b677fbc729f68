//! Listed effects that a record cannot tell from a departure, and the nearest one that it can.
//!
//! ```text
//! left = min over the size of ½·‖(change of the departure − change of the effect)⊥‖²   in nats
//! ```
//!
//! Laws are those of the world. The small change of an effect screens it: no search where a multiple of that leaves much.

use super::Rival;
use super::listed::Listed;
use super::sizing::{FIRST, Sized, Stage};
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::information::{Change, Information, Match};
use crate::evaluate::trials::variant::{Variant, is_proportional, is_signed};

/// An effect is a right answer if it leaves less than this share of the information, and less than this in nats.
const IMITATES: (f64, f64) = (0.02, 1.0);
/// An effect is searched if a multiple of its small change leaves less than this share, and less than this in nats.
const PROMISES: (f64, f64) = (0.5, 6.0);
/// Share that is as good as nothing: no search can improve on it.
const NOTHING: f64 = 1e-3;
/// Sizes on either side of the screened one, as a factor.
const REACH: f64 = 3.0;
/// Evaluations of a search.
const SEARCH: usize = 12;
/// Golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Listed effects beside a departure.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Imitators {
    /// Keys of the right answers, sorted.
    pub right: Vec<String>,
    /// The nearest effect that is no right answer.
    pub rival: Option<Rival>,
}

/// A law of a sign and a shape at its screened size.
struct Screened {
    draft: Draft,
    size: f64,
    unexplained: f64,
}

impl Imitators {
    /// Compares a departure with every listed effect; `own` is its own key, where it has one. A black box answers too slowly to be asked
    /// about others.
    pub fn of(
        sized: &Sized,
        own: Option<&String>,
        listed: &[Listed],
        stage: &Stage<'_>,
        information: &Information<'_>,
    ) -> Result<Self, EvaluateError> {
        let mut imitators = Self {
            right: own.into_iter().cloned().collect(),
            rival: None,
        };
        if stage.world.is_black_box() {
            return Ok(imitators);
        }
        let (share, nats) = IMITATES;
        for effect in listed.iter().filter(|effect| Some(&effect.key) != own) {
            // `left` is a share: the best fit of the twin may bound the nats.
            let left = left(sized, effect, stage, information)?;
            if left < share && left * sized.nats < nats {
                imitators.right.push(effect.key.clone());
                continue;
            }
            let nats = left * sized.nats;
            if imitators.rival.as_ref().is_none_or(|r| nats < r.nats) {
                imitators.rival = Some(Rival {
                    effect: effect.key.clone(),
                    nats,
                });
            }
        }
        imitators.right.sort();
        Ok(imitators)
    }
}

/// Share of a departure's information that an effect leaves at its best sign, shape and size.
fn left(
    sized: &Sized,
    effect: &Listed,
    stage: &Stage<'_>,
    information: &Information<'_>,
) -> Result<f64, EvaluateError> {
    let mut best: Option<Screened> = None;
    for variant in Variant::of(&effect.id) {
        if let Some(screened) = screened(sized, effect, variant, stage, information)?
            && (best.as_ref()).is_none_or(|b| screened.unexplained < b.unexplained)
        {
            best = Some(screened);
        }
    }
    let Some(best) = best else {
        return Ok(1.0);
    };
    let (share, nats) = PROMISES;
    if best.unexplained > share || best.unexplained * sized.nats > nats {
        return Ok(best.unexplained);
    }
    searched(sized, &best, stage, information)
}

/// Matches a small change of an effect; `None` for one that cannot be made or has the other sign.
fn screened(
    sized: &Sized,
    effect: &Listed,
    variant: Variant,
    stage: &Stage<'_>,
    information: &Information<'_>,
) -> Result<Option<Screened>, EvaluateError> {
    let Some(draft) = Draft::variant(&effect.id, effect.place, effect.other, variant) else {
        return Ok(None);
    };
    let matched = |size: f64| -> Result<Option<(Match, f64)>, EvaluateError> {
        let change = stage.changed(&draft, size, information)?;
        Ok(change.map(|change| {
            let of_change = information.matched(&sized.change, &change);
            (of_change, information.nats(&change))
        }))
    };
    let Some((small, nats)) = matched(FIRST)? else {
        return Ok(None);
    };
    let (mut size, mut best) = (FIRST, small);
    if !is_proportional(&effect.id) {
        // An end of a range, a play: the size at which it changes as much as the departure does.
        let same = match nats > 0.0 {
            true => FIRST * (information.nats(&sized.change) / nats).sqrt(),
            false => 10.0 * FIRST,
        };
        let same = same.clamp(0.1 * FIRST, draft.largest());
        if let Some((large, _)) = matched(same)?
            && large.multiple > 0.0
            && (best.multiple <= 0.0 || large.unexplained < best.unexplained)
        {
            (size, best) = (same, large);
        }
    }
    if best.multiple < 0.0 && !is_signed(&effect.id) {
        return Ok(None);
    }
    let sign = if best.multiple < 0.0 { -1.0 } else { 1.0 };
    let draft = Draft::variant(
        &effect.id,
        effect.place,
        effect.other,
        Variant { sign, ..variant },
    );
    Ok(draft.map(|draft| Screened {
        size: (size * best.multiple.abs()).clamp(1e-6, draft.largest()),
        unexplained: best.unexplained,
        draft,
    }))
}

/// Share that is left at the best size: golden section on its logarithm.
fn searched(
    sized: &Sized,
    screened: &Screened,
    stage: &Stage<'_>,
    information: &Information<'_>,
) -> Result<f64, EvaluateError> {
    let all = information.nats(&sized.change);
    // A size that cannot be made leaves everything.
    let left = |log: f64| -> Result<f64, EvaluateError> {
        let by: Option<Change> = stage.changed(&screened.draft, log.exp(), information)?;
        Ok(by.map_or(1.0, |by| {
            (information.left(&sized.change, &by) / all).min(1.0)
        }))
    };
    let middle = screened.size.ln();
    let mut best = left(middle)?;
    if best < NOTHING {
        return Ok(best);
    }
    let largest = screened.draft.largest().ln();
    let (mut low, mut high) = (middle - REACH.ln(), (middle + REACH.ln()).min(largest));
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = [left(inner[0])?, left(inner[1])?];
    for _ in 3..SEARCH {
        if values[0] < values[1] {
            high = inner[1];
            (inner[1], values[1]) = (inner[0], values[0]);
            inner[0] = high - GOLDEN * (high - low);
            values[0] = left(inner[0])?;
        } else {
            low = inner[0];
            (inner[0], values[0]) = (inner[1], values[1]);
            inner[1] = low + GOLDEN * (high - low);
            values[1] = left(inner[1])?;
        }
    }
    best = best.min(values[0]).min(values[1]);
    Ok(best)
}

#[cfg(test)]
mod tests;
