//! The trials from end to end: sealed, diagnosed, opened, scored.

use super::answer::TrueShare;
use super::answer::{TrialAnswer, TrialQuestion};
use super::correlation::correlated;
use super::draft::index;
use super::folder::{ANSWERS, Filling, Folder, SHARES, Which};
use super::row::TrialRow;
use super::score::TrialSetup;
use super::settings::assign_kinds;
use super::steadiness::repeats;
use super::truth::{Extra, Truth, TruthSampler};
use super::{Kind, Scorecard, TrialSettings};
use crate::diagnose::{DiagnoseSettings, greedy};
use crate::evaluate::trials::numbers::TRIAL;
use crate::evaluate::{EvaluateError, MOST_RECORDS};
use crate::likelihood::kalman::recoverable;
use crate::parallel::try_each;
use crate::progress::Progress;
use crate::record::record_csv_text;
use crate::setting::SettingError;
use crate::storage::StorageError;
use crate::storage::checksum::sha256;
use crate::storage::work::{Manifest, Piece, Pieces, Share};
use crate::study::Study;
use crate::twin::Noise;
use serde_json::json;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 13;

/// Sealed trials over one study.
///
/// ```
/// use truetwin::evaluate::paper::reference_studies;
/// use truetwin::progress::Progress;
/// use truetwin::evaluate::trials::{Kind, TrialSettings, Withheld};
///
/// let study = &reference_studies()?[0];
/// let settings = TrialSettings { trials: 1, kinds: vec![Kind::None], ..TrialSettings::default() };
/// let place = tempfile::tempdir()?;
/// let sealed = Withheld::new(study, settings)?.seal(&place.path().join("trials"), &Progress::silent())?;
/// println!("sha256 {}", sealed.seal());
/// let card = sealed.score(&Progress::silent())?;
/// assert_eq!(card.trials, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Withheld<'a> {
    sampler: TruthSampler<'a>,
    settings: TrialSettings,
}

debug_by_name!(Withheld<'_>);

impl<'a> Withheld<'a> {
    /// Creates trials over a study.
    ///
    /// # Errors
    ///
    /// [`EvaluateError`]: kinds that cannot be drawn, no trials or too many, a record that does not fit the twin.
    pub fn new(study: &'a Study, settings: TrialSettings) -> Result<Self, EvaluateError> {
        if settings.trials == 0 {
            return Err(EvaluateError::Nothing("trials"));
        }
        SettingError::unless_at_most("trials", settings.trials, MOST_RECORDS)?;
        if settings.kinds.is_empty() {
            return Err(EvaluateError::Nothing("kinds"));
        }
        let drawn = (settings.families, settings.nuisances.clone());
        let sampler = TruthSampler::new(study, drawn, settings.like.as_ref())?;
        for kind in &settings.kinds {
            sampler.check(*kind)?;
        }
        Ok(Self { sampler, settings })
    }

    /// Draws every truth, writes records, keys and seal into a new folder; or goes on with the folder of the same call.
    ///
    /// # Errors
    ///
    /// [`EvaluateError`]: a folder of another call, a place that cannot be written.
    pub fn seal(self, path: &Path, progress: &Progress) -> Result<Sealed<'a>, EvaluateError> {
        let fill = |filling: &Filling<'_>| self.fill(filling, progress);
        let folder = Folder::open(path, &self.manifest()?, fill)?;
        Ok(Sealed {
            trials: self,
            folder,
        })
    }

    fn fill(&self, filling: &Filling<'_>, progress: &Progress) -> Result<(), EvaluateError> {
        let TrialSettings { trials, seed, .. } = self.settings;
        let stage = progress.stage("seal", trials);
        let mut source = Noise::new(seed, "withheld kinds", 0).source("deal");
        let kinds = assign_kinds(&self.settings.kinds, trials, |n| index(&mut source, n));
        let extra = |trial| Extra {
            validation: self.settings.validation,
            doubled: trial < self.settings.steadiness,
        };
        let numbered: Vec<(usize, Kind)> = kinds.into_iter().enumerate().collect();
        let mut keys = Vec::with_capacity(trials);
        // Part by part: the records of a million trials do not fit into memory.
        for part in numbered.chunks(TRIAL.trials_in_memory) {
            let draw = |&(trial, kind): &(usize, Kind)| {
                let noise = Noise::new(seed, "withheld", trial as u64);
                let drawn = (self.sampler).draw(trial, kind, extra(trial), noise)?;
                stage.tick()?;
                Ok::<_, EvaluateError>(drawn)
            };
            let drawn = try_each(part, draw)?;
            for drawn in drawn {
                let records = [
                    (Which::Own, Some(&drawn.record)),
                    (Which::Validation, drawn.validation.as_ref()),
                    (Which::Doubled, drawn.doubled.as_ref()),
                ];
                for (which, record) in records {
                    if let Some(record) = record {
                        filling.record(drawn.truth.trial, which, record)?;
                    }
                }
                keys.push(drawn.truth);
            }
        }
        if self.settings.without {
            let effects: Vec<&Vec<String>> = keys.iter().map(|key| &key.effects).collect();
            filling.left_out(&effects)?;
        }
        Ok(filling.keys(&keys)?)
    }

    /// Everything that the trials depend on.
    fn manifest(&self) -> Result<Manifest, StorageError> {
        let study = self.sampler.study();
        let settings = &self.settings;
        let kinds: Vec<&str> = settings.kinds.iter().map(|kind| kind.id()).collect();
        let nuisances: Vec<&str> = settings.nuisances.iter().map(|kind| kind.id()).collect();
        let like = settings.like.as_ref();
        let like = like.map(|record| sha256(record_csv_text(record).as_bytes()));
        Ok(study
            .manifest("withheld", LAYOUT)?
            .with("trials", settings.trials)
            .with("seed", settings.seed)
            .with("kinds", json!(kinds))
            .with("nuisances", json!(nuisances))
            .with("without", settings.without)
            .with("families", settings.families.to_string())
            .with("like", like)
            .with("validation", settings.validation)
            .with("detection_only", settings.detection_only)
            .with("ablated", json!(settings.ablated))
            .with("steadiness", settings.steadiness))
    }
}

/// Trials whose keys are sealed.
pub struct Sealed<'a> {
    trials: Withheld<'a>,
    folder: Folder,
}

debug_by_name!(Sealed<'_>);

impl Sealed<'_> {
    /// SHA-256 of the key file: publish it before [`score`](Self::score).
    pub fn seal(&self) -> &str {
        &self.folder.seal
    }

    /// Diagnoses every record that has no answer yet, then opens the keys and scores.
    ///
    /// Trials run in parallel, each on its share of the current threads; answers do not depend on their number.
    ///
    /// # Errors
    ///
    /// [`EvaluateError`]: files that cannot be read or written, keys or records that are not those that were sealed, a stop.
    pub fn score(&self, progress: &Progress) -> Result<Scorecard, EvaluateError> {
        let answers = self.answer(Share::WHOLE, progress)?;
        let settings = &self.trials.settings;
        // Every answer is there: now, and not before, the keys.
        let keys = self.folder.keys(settings.trials)?;
        if settings.without {
            self.folder.check_left_out(&keys)?;
        }
        let sampler = &self.trials.sampler;
        let parameters: Arc<[String]> = sampler.parameters().into();
        let mut shares = self.true_shares(&keys, progress)?.into_iter();
        let rows = (keys.into_iter().zip(answers))
            .map(|(truth, answer)| {
                let (share, names) = (shares.next(), parameters.clone());
                TrialRow::new(truth, answer, share, names, settings.without)
            })
            .collect();
        let setup = TrialSetup {
            twin: sampler.study().name().into(),
            settings: settings.clone(),
            seal: self.seal().into(),
        };
        Ok(Scorecard::new(setup, rows))
    }

    /// Diagnoses the records of a share that have no answer yet; returns all answers that are there then.
    ///
    /// # Errors
    ///
    /// As [`score`](Self::score).
    pub(crate) fn answer(
        &self,
        share: Share,
        progress: &Progress,
    ) -> Result<Vec<TrialAnswer>, EvaluateError> {
        self.check_records(share, progress)?;
        let left_out = self.left_out()?;
        self.pieces(ANSWERS, share).all(
            &progress.stage("trials", self.trials.settings.trials),
            |_: &TrialAnswer| Ok(()),
            |trial| {
                let without = left_out[trial].clone();
                self.asked(trial, without, |question| {
                    self.one(trial, question, progress)
                })
            },
        )
    }

    /// Refuses a share whose records are not those that were sealed: those with an answer are not read again otherwise.
    fn check_records(&self, share: Share, progress: &Progress) -> Result<(), EvaluateError> {
        let own = &self.trials.settings;
        let mine = (0..own.trials).filter(|trial| share.takes(*trial));
        try_each(mine, |trial| {
            progress.checkpoint()?;
            self.folder.check_record(trial, Which::Own)?;
            if own.validation {
                self.folder.check_record(trial, Which::Validation)?;
            }
            if self.is_doubled(trial) {
                self.folder.check_record(trial, Which::Doubled)?;
            }
            Ok::<_, EvaluateError>(())
        })
        .map(|_| ())
    }

    /// Returns whether a trial has a record that is twice as long: one with uneven steps has none.
    fn is_doubled(&self, trial: usize) -> bool {
        let own = &self.trials.settings;
        trial < own.steadiness && (own.like.as_ref()).is_none_or(|like| like.drive().is_uniform())
    }

    /// Shares that the true effects close; none where diagnoses do without effects, or without a part.
    fn true_shares(
        &self,
        keys: &[Truth],
        progress: &Progress,
    ) -> Result<Vec<TrueShare>, EvaluateError> {
        let own = &self.trials.settings;
        if own.without || own.detection_only || !own.ablated.is_empty() {
            return Ok(vec![]);
        }
        self.pieces(SHARES, Share::WHOLE).all(
            &progress.stage("shares", own.trials),
            |_: &TrueShare| Ok(()),
            |trial| {
                self.asked(trial, vec![], |question| {
                    Ok(TrueShare::new(&keys[trial], question))
                })
            },
        )
    }

    /// Reads a trial's records and does something with its question, without some effects of the library.
    fn asked<T>(
        &self,
        trial: usize,
        without: Vec<String>,
        act: impl FnOnce(&TrialQuestion<'_>) -> Result<T, EvaluateError>,
    ) -> Result<T, EvaluateError> {
        let own = &self.trials.settings;
        let noise = Noise::new(own.seed, "withheld diagnosis", trial as u64);
        let record = self.folder.record(trial, Which::Own)?;
        let validation = (own.validation)
            .then(|| self.folder.record(trial, Which::Validation))
            .transpose()?;
        act(&TrialQuestion {
            study: self.trials.sampler.study(),
            record: &record,
            validation: validation.as_ref(),
            settings: DiagnoseSettings {
                seed: noise.seed().unwrap_or_default(),
                without: without.into_iter().map(Into::into).collect(),
                detection_only: own.detection_only,
                ablated: own.ablated.clone(),
                ..DiagnoseSettings::default()
            },
        })
    }

    /// Diagnoses one trial, and answers it by the baselines. A baseline that fails says nothing.
    fn one(
        &self,
        trial: usize,
        question: &TrialQuestion<'_>,
        progress: &Progress,
    ) -> Result<TrialAnswer, EvaluateError> {
        let (study, record, own) = (question.study, question.record, &self.trials.settings);
        let clock = Instant::now();
        let (outcome, failure) = match question.ask(progress)? {
            Ok(outcome) => (Some(outcome), None),
            Err(failure) => (None, Some(failure)),
        };
        let seconds = clock.elapsed().as_secs_f64();
        let is_repeated = trial < own.steadiness;
        let doubled = (self.is_doubled(trial))
            .then(|| self.folder.record(trial, Which::Doubled))
            .transpose()?;
        Ok(TrialAnswer {
            trial,
            outcome,
            failure,
            seconds,
            correlated: recoverable(correlated(study, record))?.flatten(),
            greedy: greedy(study, record, &question.settings.without)
                .ok()
                .flatten(),
            repeats: match is_repeated {
                true => repeats(question, doubled.as_ref(), progress)?,
                false => vec![],
            },
        })
    }

    /// Puts a result into the folder, in place of an earlier one.
    pub fn write(&self, name: &str, text: &str) -> Result<(), EvaluateError> {
        Ok(self.folder.work.write(name, text)?)
    }

    fn pieces(&self, part: &'static str, share: Share) -> Pieces<'_> {
        Pieces {
            folder: Some(&self.folder.work),
            part,
            count: self.trials.settings.trials,
            share,
        }
    }

    /// The effects that each trial's library does without.
    fn left_out(&self) -> Result<Vec<Vec<String>>, EvaluateError> {
        let TrialSettings {
            trials, without, ..
        } = self.trials.settings;
        if without {
            self.folder.left_out(trials)
        } else {
            Ok(vec![vec![]; trials])
        }
    }
}

impl Piece for TrialAnswer {
    fn number(&self) -> usize {
        self.trial
    }
}

#[cfg(test)]
mod tests;
