//! The size at which a departure has the expected information that it is to have.

use super::{DrawEnd, Reject};
use crate::evaluate::EvaluateError;
use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::information::{Information, InnovationChange};
use crate::evaluate::trials::law::Departure;
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::trials::scene::Scene;
use crate::evaluate::trials::world::{RecordNoise, System, run};
use crate::record::Record;
use crate::study::Study;
use crate::twin::Twin;

/// The system of a trial without its departures, and the filter that measures what departures change.
pub(super) struct Experiment<'a> {
    twin: &'a Twin,
    system: System<'a>,
    pub scene: &'a Scene,
    pub information: Information,
}

/// A departure with its information.
pub(super) struct Sized {
    pub departure: Departure,
    pub nats: f64,
    pub change: InnovationChange,
}

/// The record of a system near a scene, with its inputs; `None` where it diverges.
fn record(twin: &Twin, system: System<'_>, scene: &Scene, draws: RecordNoise) -> Option<Record> {
    let run = run(twin, system, &scene.run.drive, draws)?;
    let is_near = scene.is_near(&run);
    Record::new(run.drive, run.outputs).ok().filter(|_| is_near)
}

impl<'a> Experiment<'a> {
    /// Filters records of the system without departures.
    pub fn new(study: &'a Study, system: System<'a>, scene: &'a Scene) -> Result<Self, DrawEnd> {
        let (twin, draws) = (study.twin(), scene.draws);
        let record = |draws| record(twin, system, scene, draws).ok_or(Reject::Diverged);
        let (again, mirrored) = (draws.remeasured(), draws.mirrored());
        let plain = [record(draws)?, record(again)?, record(mirrored)?];
        let information = Information::new(study, system, &plain)?.ok_or(Reject::NoFilter)?;
        Ok(Self {
            twin,
            system,
            scene,
            information,
        })
    }

    fn record(&self, departures: &[Departure], draws: RecordNoise) -> Option<Record> {
        let system = System {
            departures,
            ..self.system
        };
        record(self.twin, system, self.scene, draws)
    }

    /// The record with these departures, and once more with other measurement noise; `None` where one diverges.
    pub fn pair(&self, departures: &[Departure]) -> Option<[Record; 2]> {
        let again = self.scene.draws.remeasured();
        Some([
            self.record(departures, self.scene.draws)?,
            self.record(departures, again)?,
        ])
    }

    /// The record with these departures and all noise of the other sign.
    pub fn mirrored(&self, departures: &[Departure]) -> Option<Record> {
        self.record(departures, self.scene.draws.mirrored())
    }

    fn change(&self, departures: &[Departure]) -> Result<Option<InnovationChange>, EvaluateError> {
        match self.pair(departures) {
            Some(records) => Ok(self.information.change(records)?),
            None => Ok(None),
        }
    }

    /// The departure of a size, and what it changes; `None` where it cannot be made or diverges.
    fn of_size(&self, draft: &Draft, size: f64) -> Result<Option<Sized>, EvaluateError> {
        let Some(departure) = draft.of_size(size, self.scene) else {
            return Ok(None);
        };
        let departures = std::slice::from_ref(&departure);
        let (Some(pair), Some(mirrored)) = (self.pair(departures), self.mirrored(departures))
        else {
            return Ok(None);
        };
        let Some(lost) = self.information.lost([&pair[0], &mirrored])? else {
            return Ok(None);
        };
        Ok(self.information.change(pair)?.map(|change| Sized {
            nats: self.information.nats(&change).min(lost),
            departure,
            change,
        }))
    }

    /// The change that a departure of a size makes; `None` where it cannot be made or diverges.
    pub fn changed(
        &self,
        draft: &Draft,
        size: f64,
    ) -> Result<Option<InnovationChange>, EvaluateError> {
        let departure = draft.of_size(size, self.scene);
        departure.map_or(Ok(None), |departure| self.change(&[departure]))
    }

    /// The departures at the sizes at which each has about the wanted nats. Of a pair, only what one departure adds to the other counts, and
    /// of that only what no multiple of the other explains.
    pub fn all_sized(&self, drafts: &[&Draft], wanted: &[f64]) -> Result<Vec<Sized>, DrawEnd> {
        let information = &self.information;
        let sized = |each: &[f64]| -> Result<Option<Vec<Sized>>, EvaluateError> {
            (drafts.iter().zip(each))
                .map(|(draft, nats)| self.sized(draft, *nats))
                .collect()
        };
        let all = sized(wanted)?.ok_or(Reject::TooWeak)?;
        let [first, second] = &all[..] else {
            return Ok(all);
        };
        let shares = [
            information.unexplained(&first.change, &second.change),
            information.unexplained(&second.change, &first.change),
        ];
        if shares.iter().any(|share| *share < TRIAL.own_information) {
            return Err(Reject::TooAlike.into());
        }
        let larger: Vec<f64> = wanted.iter().zip(shares).map(|(w, s)| w / s).collect();
        let mut all = sized(&larger)?.ok_or(Reject::TooAlike)?;
        // One departure may hide the other: what counts is what each adds.
        let both: Vec<Departure> = all.iter().map(|sized| sized.departure.clone()).collect();
        let together = self.change(&both)?.ok_or(Reject::TooAlike)?;
        let added = [1, 0].map(|other| {
            let by = &all[other].change;
            let added = together.without(by);
            information.nats(&added) * information.unexplained(&added, by)
        });
        for (sized, nats) in all.iter_mut().zip(added) {
            sized.nats = sized.nats.min(nats);
        }
        let is_near = |(sized, wanted): (&Sized, &f64)| {
            (sized.nats / wanted).ln().abs() <= TRIAL.far_from_wanted
        };
        match all.iter().zip(wanted).all(is_near) {
            true => Ok(all),
            false => Err(Reject::TooAlike.into()),
        }
    }

    /// Searches the size at which a departure has about `wanted` nats; `None` where none comes near.
    pub fn sized(&self, draft: &Draft, wanted: f64) -> Result<Option<Sized>, EvaluateError> {
        let distance = |nats: f64| (nats / wanted).ln().abs();
        let mut best: Option<Sized> = None;
        // Logarithms of size and nats, below and above what is wanted.
        let (mut below, mut above): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
        let largest = draft.largest();
        let mut size = TRIAL.first_size;
        for _ in 0..TRIAL.size_tries {
            match self.of_size(draft, size)? {
                None => above = Some([size.ln(), f64::INFINITY]),
                Some(sized) => {
                    let nats = sized.nats;
                    let end = match nats < wanted {
                        true => &mut below,
                        false => &mut above,
                    };
                    *end = Some([size.ln(), nats.max(1e-9).ln()]);
                    let least = best.as_ref().map_or(f64::INFINITY, |b| distance(b.nats));
                    if best.is_none() || distance(nats) < least {
                        best = Some(sized);
                    }
                    if distance(nats) < TRIAL.near_wanted {
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
        Ok(best.filter(|b| {
            b.nats > TRIAL.least_information && distance(b.nats) < TRIAL.far_from_wanted
        }))
    }
}
