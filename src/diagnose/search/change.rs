//! Changes that a search asks for: another step, another kind of noise, more rows.

use super::Search;
use super::evidence::{Change, Evidence, Purpose};
use crate::diagnose::thresholds::THRESHOLDS;
use crate::hypothesis::set::TermSet;
use crate::study::StudyError;

impl<E: Evidence> Search<E> {
    /// The change that the records ask for. A gap may pass for another kind of noise or for the error of a step, and hide it.
    pub(super) fn asks_for(&mut self) -> Result<Option<Change>, StudyError> {
        if self.is_partial {
            return Ok(None);
        }
        // What is missing may have made a finer step look better beside the twin alone.
        if !self.is_own_step_searched && self.is_gap() && !self.refused.contains(&Change::OwnStep) {
            return Ok(Some(Change::OwnStep));
        }
        if let Some(noise) = self.asks_for_noise() {
            return Ok(Some(noise));
        }
        // A second effect may imitate the step's error, and so may an effect that explains a little more than the right one. Where nothing
        // listed does, noise levels are fitted loud beside a gap, and hide it: the twin alone is asked.
        let top = self.known.top();
        let candidates = self.known.candidates().into_iter().map(|e| e.set());
        let twin = (self.evidence.has_own_step() && self.is_gap()).then(TermSet::default);
        for set in candidates.chain(twin).collect::<Vec<_>>() {
            if !self.asked.insert((Purpose::Step, set.clone())) {
                continue;
            }
            let finer = match self.known.get(&set) {
                Some(beside) => self.evidence.finer_step(beside, &self.known)?,
                None => None,
            };
            if let Some((step, gain)) = finer {
                let is_minor = gain < self.budget.minor * top && self.evidence.has_own_noise();
                let change = Change::Step { step, is_minor };
                if !self.refused.contains(&change) {
                    return Ok(Some(change));
                }
            }
        }
        Ok(None)
    }

    /// The rows that are to be seen next. A wave's frequency is known as sharply as the record is long: it is looked for in all rows.
    pub(super) fn asks_for_rows(&self) -> Option<Change> {
        let (seen, all) = self.evidence.rows();
        let is_clear = self.known.posterior().log_odds >= self.budget.clear
            && !self.known.leads_with_wave()
            && !self.refused.contains(&Change::AllRows);
        match is_clear {
            _ if seen >= all => None,
            true => Some(Change::AllRows),
            false => (!self.is_partial).then_some(Change::MoreRows),
        }
    }

    /// The kind of noise that the records ask for: where something is missing beside it, where nothing is without it.
    fn asks_for_noise(&self) -> Option<Change> {
        let alone = || {
            let best = self.known.noise().into_iter().next()?;
            let is_enough = self.known.gain(best) > THRESHOLDS.noise && !self.is_gap();
            is_enough.then(|| Change::Noise(best.set()))
        };
        let noise = self.asks_for_noise_beside().or_else(alone);
        noise.filter(|noise| !self.refused.contains(noise))
    }

    /// The kind of noise that the records ask for beside listed effects.
    pub(super) fn asks_for_noise_beside(&self) -> Option<Change> {
        let noise = Change::Noise(self.known.asks_for_noise_beside()?.set());
        (!self.refused.contains(&noise)).then_some(noise)
    }
}
