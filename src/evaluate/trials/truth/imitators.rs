//! Listed effects that a record cannot tell from a departure, and the nearest one that it can.
//!
//! ```text
//! left = min over the size of ½·‖(change of the departure − change of the effect)⊥‖²   in nats
//! ```
//!
//! Laws are those of the world. Two changes screen an effect, a small one and one as large as the departure's: no search where multiples
//! of both leave much.

use super::NearestEffect;
use super::sizing::{Experiment, Sized};
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::law::DeparturePlace;
use crate::evaluate::trials::listed::{ListedLaw, Sign, Variant};
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::places::TwinPlaces;
use crate::math::nearest;
use crate::study::Study;

/// An effect is a right answer if it leaves less than this share of the information, and less than this in nats.
const IMITATES: (f64, f64) = (0.02, 1.0);
/// An effect is searched if a multiple of a change of it leaves less than this share, and less than this in nats.
const PROMISES: (f64, f64) = (0.5, 6.0);

/// Listed effects beside a departure.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Imitators {
    /// Keys of the right answers, sorted.
    pub right: Vec<String>,
    /// Every other effect.
    pub wrong: Vec<NearestEffect>,
}

/// A law of a sign and a shape at its screened size.
struct Screened {
    draft: Draft,
    size: f64,
    /// Share that is left.
    left: f64,
}

impl Imitators {
    /// Compares a departure with every listed effect; `own` is its own key, where it has one. A black box with noise of its own answers
    /// too slowly to be asked about others.
    pub fn of(
        experiment: &Experiment<'_>,
        sized: &Sized,
        own: Option<&String>,
        listed: &[Listed],
    ) -> Result<Self, EvaluateError> {
        let mut imitators = Self {
            right: own.into_iter().cloned().collect(),
            wrong: vec![],
        };
        if experiment.information.costs_ensembles {
            return Ok(imitators);
        }
        let comparison = Comparison { experiment, sized };
        let (share, nats) = IMITATES;
        for listed in listed.iter().filter(|effect| Some(&effect.key) != own) {
            let effect = listed.key.clone();
            // `left` is a share: the best fit of the twin may bound the nats.
            let left = comparison.left(listed)?;
            if left < share && left * sized.nats < nats {
                imitators.right.push(effect);
            } else {
                let nats = left * sized.nats;
                imitators.wrong.push(NearestEffect { effect, nats });
            }
        }
        imitators.right.sort();
        Ok(imitators)
    }
}

/// Returns the effect that leaves least of any departure and is a right answer to none.
pub(super) fn rival(all: &[Imitators]) -> Option<NearestEffect> {
    let is_right = |key: &String| all.iter().any(|imitators| imitators.right.contains(key));
    (all.iter().flat_map(|imitators| &imitators.wrong))
        .filter(|rival| !is_right(&rival.effect))
        .min_by(|a, b| a.nats.total_cmp(&b.nats))
        .cloned()
}

/// A departure that effects are compared with.
struct Comparison<'c> {
    experiment: &'c Experiment<'c>,
    sized: &'c Sized,
}

impl Comparison<'_> {
    /// Share of the departure's information that an effect leaves at its best sign, shape and size.
    fn left(&self, effect: &Listed) -> Result<f64, EvaluateError> {
        let mut least = 1.0_f64;
        // Shapes that look alike in small differ at the size that it takes.
        let mut best: Option<Screened> = None;
        let (share, nats) = PROMISES;
        for variant in Variant::of(effect.law) {
            let Some(mut screened) = self.screened(effect, variant)? else {
                continue;
            };
            if screened.left >= share || screened.left * self.sized.nats >= nats {
                least = least.min(screened.left);
                continue;
            }
            screened.left = self.left_at(&screened.draft, screened.size)?;
            if best.as_ref().is_none_or(|best| screened.left < best.left) {
                best = Some(screened);
            }
        }
        match best {
            None => Ok(least),
            Some(best) if best.left < TRIAL.nothing_left => Ok(best.left),
            Some(best) => Ok(best.left.min(self.searched(&best)?)),
        }
    }

    /// Matches changes of an effect; `None` for one that cannot be made or has the other sign.
    fn screened(
        &self,
        effect: &Listed,
        variant: Variant,
    ) -> Result<Option<Screened>, EvaluateError> {
        let (experiment, information) = (self.experiment, &self.experiment.information);
        let Some(small) = experiment.changed(&effect.draft(variant), TRIAL.first_size)? else {
            return Ok(None);
        };
        let nats = information.nats(&small);
        let small = information.matched(&self.sized.change, &small);
        let sign = match effect.law.sign.is_both() {
            true => small.multiple.signum(),
            false => 1.0,
        };
        let draft = effect.draft(Variant { sign, ..variant });
        let largest = draft.largest();
        let mut best = Screened {
            draft,
            size: TRIAL.first_size * sign * small.multiple,
            left: small.unexplained,
        };
        if effect.law.sign == Sign::Threshold || (best.size > 0.0 && best.left < TRIAL.unlike) {
            // An end of a range, a play, a level at its limit: the size at which the effect changes as much as the departure does.
            let same = match nats > 0.0 {
                true => TRIAL.first_size * (information.nats(&self.sized.change) / nats).sqrt(),
                false => 10.0 * TRIAL.first_size,
            };
            let same = nearest(same, 0.1 * TRIAL.first_size, largest);
            let large = experiment.changed(&best.draft, same)?;
            let large = large.map(|large| information.matched(&self.sized.change, &large));
            if let Some(large) = large.filter(|large| large.multiple > 0.0)
                && (best.size <= 0.0 || large.unexplained < best.left)
            {
                (best.size, best.left) = (same * large.multiple, large.unexplained);
            }
        }
        best.size = best.size.min(largest);
        Ok((best.size > 0.0).then_some(best))
    }

    /// Share that an effect of a size leaves. One that cannot be made leaves everything.
    fn left_at(&self, draft: &Draft, size: f64) -> Result<f64, EvaluateError> {
        let (information, change) = (&self.experiment.information, &self.sized.change);
        let by = self.experiment.changed(draft, size)?;
        Ok(by.map_or(1.0, |by| {
            (information.left(change, &by) / information.nats(change)).min(1.0)
        }))
    }

    /// Share that is left at the best size: golden section on its logarithm.
    fn searched(&self, screened: &Screened) -> Result<f64, EvaluateError> {
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let left = |log: f64| self.left_at(&screened.draft, log.exp());
        let middle = screened.size.ln();
        let largest = screened.draft.largest().ln();
        let (mut low, mut high) = (
            middle - TRIAL.size_reach.ln(),
            (middle + TRIAL.size_reach.ln()).min(largest),
        );
        let mut inner = [high - golden * (high - low), low + golden * (high - low)];
        let mut values = [left(inner[0])?, left(inner[1])?];
        for _ in 2..TRIAL.size_evaluations {
            if values[0] < values[1] {
                high = inner[1];
                (inner[1], values[1]) = (inner[0], values[0]);
                inner[0] = high - golden * (high - low);
                values[0] = left(inner[0])?;
            } else {
                low = inner[0];
                (inner[0], values[0]) = (inner[1], values[1]);
                inner[1] = low + golden * (high - low);
                values[1] = left(inner[1])?;
            }
        }
        Ok(values[0].min(values[1]))
    }
}

#[cfg(test)]
mod tests;

/// An effect of the study's library, as a law of the world.
pub(super) struct Listed {
    pub key: String,
    pub law: &'static ListedLaw,
    pub place: DeparturePlace,
    /// The other state of a law between two.
    pub other: Option<usize>,
}

impl Listed {
    /// Returns the effects that the study may name and that worlds can have.
    pub fn all(study: &Study, places: &TwinPlaces) -> Vec<Self> {
        let state = |name: &str| places.states.iter().position(|s| s == name);
        (study.candidates().iter())
            .filter_map(|effect| {
                Some(Self {
                    key: effect.key().to_string(),
                    law: ListedLaw::named(effect.id())?,
                    place: places.find(effect.id(), effect.target())?,
                    other: effect.other().and_then(state),
                })
            })
            .collect()
    }

    /// A departure of this law, of a sign and a shape.
    pub fn draft(&self, variant: Variant) -> Draft {
        Draft::listed(self.law, self.place, self.other, variant)
    }
}
