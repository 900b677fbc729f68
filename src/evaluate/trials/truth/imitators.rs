//! Listed effects that a record cannot tell from a departure, and the nearest one that it can.
//!
//! ```text
//! left = min over the size of ½·‖(change of the departure − change of the effect)⊥‖²   in nats
//! ```
//!
//! Laws are those of the world. Two changes screen an effect, a small one and one as large as the departure's: no search where multiples
//! of both leave much.

use super::Rival;
use super::listed::Listed;
use super::sizing::{FIRST, Sized, Stage};
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::information::{Change, Information, Match};
use crate::evaluate::trials::listed::{ListedLaw, Sign, Variant};

/// An effect is a right answer if it leaves less than this share of the information, and less than this in nats.
const IMITATES: (f64, f64) = (0.02, 1.0);
/// An effect is searched if a multiple of a change of it leaves less than this share, and less than this in nats.
const PROMISES: (f64, f64) = (0.5, 6.0);
/// A law that is proportional to its size is not tried at a larger one where its small change leaves more than this share.
const UNLIKE: f64 = 0.9;
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
    /// Every other effect.
    pub wrong: Vec<Rival>,
}

/// A law of a sign and a shape at its screened size.
struct Screened {
    draft: Draft,
    size: f64,
    unexplained: f64,
}

impl Imitators {
    /// Compares a departure with every listed effect; `own` is its own key, where it has one. A black box with noise of its own answers
    /// too slowly to be asked about others.
    pub fn of(
        sized: &Sized,
        own: Option<&String>,
        listed: &[Listed],
        stage: &Stage<'_>,
        information: &Information,
    ) -> Result<Self, EvaluateError> {
        let mut imitators = Self {
            right: own.into_iter().cloned().collect(),
            wrong: vec![],
        };
        if information.costs_ensembles {
            return Ok(imitators);
        }
        let (share, nats) = IMITATES;
        for effect in listed.iter().filter(|effect| Some(&effect.key) != own) {
            // `left` is a share: the best fit of the twin may bound the nats.
            let left = left(sized, effect, stage, information)?;
            if left < share && left * sized.nats < nats {
                imitators.right.push(effect.key.clone());
            } else {
                imitators.wrong.push(Rival {
                    effect: effect.key.clone(),
                    nats: left * sized.nats,
                });
            }
        }
        imitators.right.sort();
        Ok(imitators)
    }
}

/// Returns the effect that leaves least of any departure and is a right answer to none.
pub(super) fn rival(all: &[Imitators]) -> Option<Rival> {
    let is_right = |key: &String| all.iter().any(|imitators| imitators.right.contains(key));
    (all.iter().flat_map(|imitators| &imitators.wrong))
        .filter(|rival| !is_right(&rival.effect))
        .min_by(|a, b| a.nats.total_cmp(&b.nats))
        .cloned()
}

/// Share of a departure's information that an effect leaves at its best sign, shape and size.
fn left(
    sized: &Sized,
    effect: &Listed,
    stage: &Stage<'_>,
    information: &Information,
) -> Result<f64, EvaluateError> {
    let mut least = 1.0_f64;
    let mut promising = Vec::new();
    let (share, nats) = PROMISES;
    for variant in Variant::of(&effect.id) {
        let Some(screened) = screened(sized, effect, variant, stage, information)? else {
            continue;
        };
        let left = screened.unexplained;
        if left < share && left * sized.nats < nats {
            promising.push(screened);
        } else {
            least = least.min(left);
        }
    }
    // Shapes that look alike in small differ at the size that it takes.
    let mut best: Option<(f64, Screened)> = None;
    for screened in promising {
        let left = left_at(sized, &screened, screened.size, stage, information)?;
        if best.as_ref().is_none_or(|(least, _)| left < *least) {
            best = Some((left, screened));
        }
    }
    match best {
        None => Ok(least),
        Some((left, _)) if left < NOTHING => Ok(left),
        Some((left, screened)) => {
            let searched = searched(sized, &screened, stage, information)?;
            Ok(left.min(searched))
        }
    }
}

/// Matches changes of an effect; `None` for one that cannot be made or has the other sign.
fn screened(
    sized: &Sized,
    effect: &Listed,
    variant: Variant,
    stage: &Stage<'_>,
    information: &Information,
) -> Result<Option<Screened>, EvaluateError> {
    let draft = |variant| Draft::variant(&effect.id, effect.place, effect.other, variant);
    let Some(positive) = draft(variant) else {
        return Ok(None);
    };
    let Some(small) = stage.changed(&positive, FIRST, information)? else {
        return Ok(None);
    };
    let nats = information.nats(&small);
    let small = information.matched(&sized.change, &small);
    let signs = ListedLaw::named(&effect.id).map_or(Sign::One, |law| law.sign);
    let sign = match signs.is_both() {
        true => small.multiple.signum(),
        false => 1.0,
    };
    let Some(draft) = draft(Variant { sign, ..variant }) else {
        return Ok(None);
    };
    let largest = draft.largest();
    let mut best = Screened {
        draft,
        size: FIRST * sign * small.multiple,
        unexplained: small.unexplained,
    };
    if signs == Sign::Threshold || (best.size > 0.0 && small.unexplained < UNLIKE) {
        // An end of a range, a play, a level at its limit: the size at which the effect changes as much as the departure does.
        let same = match nats > 0.0 {
            true => FIRST * (information.nats(&sized.change) / nats).sqrt(),
            false => 10.0 * FIRST,
        };
        let same = same.clamp(0.1 * FIRST, largest);
        if let Some(large) = stage.changed(&best.draft, same, information)? {
            let large: Match = information.matched(&sized.change, &large);
            if large.multiple > 0.0 && (best.size <= 0.0 || large.unexplained < best.unexplained) {
                best.size = same * large.multiple;
                best.unexplained = large.unexplained;
            }
        }
    }
    best.size = best.size.min(largest);
    Ok((best.size > 0.0).then_some(best))
}

/// Share that an effect of a size leaves. One that cannot be made leaves everything.
fn left_at(
    sized: &Sized,
    screened: &Screened,
    size: f64,
    stage: &Stage<'_>,
    information: &Information,
) -> Result<f64, EvaluateError> {
    let all = information.nats(&sized.change);
    let by: Option<Change> = stage.changed(&screened.draft, size, information)?;
    Ok(by.map_or(1.0, |by| {
        (information.left(&sized.change, &by) / all).min(1.0)
    }))
}

/// Share that is left at the best size: golden section on its logarithm.
fn searched(
    sized: &Sized,
    screened: &Screened,
    stage: &Stage<'_>,
    information: &Information,
) -> Result<f64, EvaluateError> {
    let left = |log: f64| left_at(sized, screened, log.exp(), stage, information);
    let middle = screened.size.ln();
    let largest = screened.draft.largest().ln();
    let (mut low, mut high) = (middle - REACH.ln(), (middle + REACH.ln()).min(largest));
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = [left(inner[0])?, left(inner[1])?];
    for _ in 2..SEARCH {
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
    Ok(values[0].min(values[1]))
}

#[cfg(test)]
mod tests;
