//! The size at which a departure has the expected information that it is to have.

use super::reject::Reject;
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::information::{Change, Information};
use crate::evaluate::trials::law::Departure;
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{Conditions, RecordNoise, System, World};
use crate::record::{Drive, Record};

/// First size that is tried: small.
pub(super) const FIRST: f64 = 0.03;
/// Tries in all.
const TRIES: usize = 10;
/// A size is taken within this distance of the wanted information, as a logarithm.
const NEAR: f64 = 0.15;
/// Farthest that is taken where no nearer one was found.
const FAR: f64 = 1.0;
/// Less than this is no departure.
const LEAST: f64 = 0.5;
/// A departure of a pair of whose information the other explains more than nine tenths is the other in another form. Half or twice of it
/// changes how many pairs are drawn again, not how large the others are.
const OWN: f64 = 0.1;

/// Everything of a trial but its departures.
pub(super) struct Stage<'a> {
    pub world: &'a World,
    pub theta: &'a [f64],
    pub conditions: &'a Conditions,
    pub drive: &'a Drive,
    pub draws: RecordNoise,
    pub scene: &'a Scene,
}

/// A departure with its information.
pub(super) struct Sized {
    pub departure: Departure,
    pub nats: f64,
    pub change: Change,
}

impl Stage<'_> {
    /// Makes the record with these departures; once more with other measurement noise; and with all noise of the other sign. `None`
    /// where one diverges.
    pub fn records(&self, departures: &[Departure]) -> Option<[Record; 3]> {
        let [own, again] = self.pair(departures)?;
        Some([own, again, self.record(departures, self.draws.mirrored())?])
    }

    /// The record with these departures, and once more with other measurement noise.
    fn pair(&self, departures: &[Departure]) -> Option<[Record; 2]> {
        let [own, again] =
            [self.draws, self.draws.remeasured()].map(|draws| self.record(departures, draws));
        Some([own?, again?])
    }

    fn record(&self, departures: &[Departure], draws: RecordNoise) -> Option<Record> {
        let system = System {
            theta: self.theta,
            departures,
            conditions: self.conditions,
        };
        let run = self.world.run(system, self.drive, draws)?;
        if !self.scene.is_near(&run) {
            return None;
        }
        Record::new(run.drive, run.outputs).ok()
    }

    /// The departure of a size, and what it changes; `None` where it cannot be made or diverges.
    fn of_size(
        &self,
        draft: &Draft,
        size: f64,
        information: &Information,
    ) -> Result<Option<Sized>, EvaluateError> {
        let Some(departure) = draft.of_size(size, self.scene) else {
            return Ok(None);
        };
        let Some([own, again, mirrored]) = self.records(std::slice::from_ref(&departure)) else {
            return Ok(None);
        };
        let Some(lost) = information.lost([&own, &mirrored])? else {
            return Ok(None);
        };
        Ok(information.change([own, again])?.map(|change| Sized {
            nats: information.nats(&change).min(lost),
            departure,
            change,
        }))
    }

    /// The change that a departure of a size makes; `None` where it cannot be made or diverges.
    pub fn changed(
        &self,
        draft: &Draft,
        size: f64,
        information: &Information,
    ) -> Result<Option<Change>, EvaluateError> {
        let departure = draft.of_size(size, self.scene);
        let Some(pair) = departure.and_then(|departure| self.pair(&[departure])) else {
            return Ok(None);
        };
        Ok(information.change(pair)?)
    }

    /// The departures at the sizes at which each has about the wanted nats. Of a pair, only what one departure adds to the other counts, and
    /// of that only what no multiple of the other explains.
    pub fn all_sized(
        &self,
        drafts: &[&Draft],
        wanted: &[f64],
        information: &Information,
    ) -> Result<Result<Vec<Sized>, Reject>, EvaluateError> {
        let sized = |each: &[f64]| -> Result<Option<Vec<Sized>>, EvaluateError> {
            (drafts.iter().zip(each))
                .map(|(draft, nats)| self.sized(draft, *nats, information))
                .collect()
        };
        let Some(all) = sized(wanted)? else {
            return Ok(Err(Reject::TooWeak));
        };
        let [first, second] = &all[..] else {
            return Ok(Ok(all));
        };
        let shares = [
            information.unexplained(&first.change, &second.change),
            information.unexplained(&second.change, &first.change),
        ];
        if shares.iter().any(|share| *share < OWN) {
            return Ok(Err(Reject::TooAlike));
        }
        let larger: Vec<f64> = wanted.iter().zip(shares).map(|(w, s)| w / s).collect();
        let Some(mut all) = sized(&larger)? else {
            return Ok(Err(Reject::TooAlike));
        };
        // One departure may hide the other: what counts is what each adds.
        let both: Vec<Departure> = all.iter().map(|sized| sized.departure.clone()).collect();
        let together = match self.pair(&both) {
            Some(records) => information.change(records)?,
            None => None,
        };
        let Some(together) = together else {
            return Ok(Err(Reject::TooAlike));
        };
        let added = [1, 0].map(|other| {
            let by = &all[other].change;
            let added = together.without(by);
            information.nats(&added) * information.unexplained(&added, by)
        });
        for (sized, nats) in all.iter_mut().zip(added) {
            sized.nats = sized.nats.min(nats);
        }
        let is_near = |(sized, wanted): (&Sized, &f64)| (sized.nats / wanted).ln().abs() <= FAR;
        match all.iter().zip(wanted).all(is_near) {
            true => Ok(Ok(all)),
            false => Ok(Err(Reject::TooAlike)),
        }
    }

    /// Searches the size at which a departure has about `wanted` nats; `None` where none comes near.
    pub fn sized(
        &self,
        draft: &Draft,
        wanted: f64,
        information: &Information,
    ) -> Result<Option<Sized>, EvaluateError> {
        let distance = |nats: f64| (nats / wanted).ln().abs();
        let mut best: Option<Sized> = None;
        // Logarithms of size and nats, below and above what is wanted.
        let (mut below, mut above): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
        let largest = draft.largest();
        let mut size = FIRST;
        for _ in 0..TRIES {
            match self.of_size(draft, size, information)? {
                None => above = Some([size.ln(), f64::INFINITY]),
                Some(sized) => {
                    let nats = sized.nats;
                    let at = Some([size.ln(), nats.max(1e-9).ln()]);
                    if nats < wanted {
                        below = at;
                    } else {
                        above = at;
                    }
                    if best
                        .as_ref()
                        .is_none_or(|b| distance(nats) < distance(b.nats))
                    {
                        best = Some(sized);
                    }
                    if distance(nats) < NEAR {
                        break;
                    }
                }
            }
            size = match (below, above) {
                (Some(low), Some(high)) if high[1].is_finite() => {
                    let share = (wanted.ln() - low[1]) / (high[1] - low[1]);
                    (low[0] + share.clamp(0.1, 0.9) * (high[0] - low[0])).exp()
                }
                (Some(low), Some(high)) => (0.5 * (low[0] + high[0])).exp(),
                (Some(_), None) if size >= largest => break,
                (Some(low), None) => {
                    let step = (0.5 * (wanted.ln() - low[1])).clamp(0.2, 3.0);
                    (size * step.exp()).min(largest)
                }
                (None, Some(high)) => {
                    let step = (0.5 * (high[1] - wanted.ln())).clamp(0.2, 3.0);
                    size * (-step).exp()
                }
                (None, None) => break,
            };
        }
        Ok(best.filter(|b| b.nats > LEAST && distance(b.nats) < FAR))
    }
}
