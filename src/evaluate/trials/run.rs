//! The trials from end to end: sealed, diagnosed, opened, scored.

use super::folder::{ANSWERS, Filling, Folder, OPENED};
use super::kind::assign_kinds;
use super::opened::Opened;
use super::truth::TruthSampler;
use super::unlisted::index;
use super::{Answer, Kind, Row, Scorecard};
use crate::diagnose::DiagnoseSettings;
use crate::evaluate::EvaluateError;
use crate::progress::Progress;
use crate::record::Record;
use crate::setting::SettingError;
use crate::storage::StorageError;
use crate::storage::work::{Manifest, Piece, Pieces, Share};
use crate::study::Study;
use crate::twin::Noise;
use serde_json::json;
use std::path::Path;

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 4;
/// Most trials of a folder; their keys are in memory.
const MOST: usize = 1_000_000;

/// Settings of sealed trials.
///
/// | setting | default | meaning |
/// |---|---|---|
/// | `trials` | 100 | records |
/// | `seed` | 1 | of truths, records and diagnoses |
/// | `kinds` | all | kinds of truth, assigned in the proportions of docs/withheld.md |
/// | `without` | no | whether the true effects are taken out of the library: then every trial with one must abstain |
/// | `validation` | no | whether each trial has a second record |
/// | `detection_only` | no | whether a diagnosis ends with its verdict: for false alarms over many trials |
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Records.
    pub trials: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Kinds of truth.
    pub kinds: Vec<Kind>,
    /// True if the true effects are taken out of the library.
    pub without: bool,
    /// True if each trial has a validation record.
    pub validation: bool,
    /// True if a diagnosis ends with its verdict.
    pub detection_only: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            trials: 100,
            seed: 1,
            kinds: Kind::ALL.to_vec(),
            without: false,
            validation: false,
            detection_only: false,
        }
    }
}

/// Sealed trials over one study.
///
/// ```
/// use truetwin::evaluate::paper::reference_studies;
/// use truetwin::progress::Progress;
/// use truetwin::evaluate::trials::{Kind, Settings, Withheld};
///
/// let study = &reference_studies()?[0];
/// let settings = Settings { trials: 1, kinds: vec![Kind::None], ..Settings::default() };
/// let place = tempfile::tempdir()?;
/// let sealed = Withheld::new(study, settings)?.seal(&place.path().join("trials"), &Progress::silent())?;
/// println!("sha256 {}", sealed.seal());
/// let card = sealed.score(&Progress::silent())?;
/// assert_eq!(card.false_alarms.of, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Withheld<'a> {
    sampler: TruthSampler<'a>,
    settings: Settings,
}

debug_by_name!(Withheld<'_>);

impl<'a> Withheld<'a> {
    /// Trials of a study of a reference twin.
    ///
    /// # Errors
    ///
    /// [`EvaluateError`]: a twin without a world, a study that changes the twin, kinds that cannot be drawn, no trials.
    pub fn new(study: &'a Study, settings: Settings) -> Result<Self, EvaluateError> {
        let sampler = TruthSampler::new(study)?;
        if settings.trials == 0 {
            return Err(EvaluateError::Nothing("trials"));
        }
        let limit = format!("choose at most {MOST}");
        SettingError::unless(settings.trials <= MOST, "trials", settings.trials, limit)?;
        if settings.kinds.is_empty() {
            return Err(EvaluateError::Nothing("kinds"));
        }
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
        let Settings { trials, seed, .. } = self.settings;
        let stage = progress.stage("seal", trials);
        let mut source = Noise::new(seed, "withheld kinds", 0).source("deal");
        let kinds = assign_kinds(&self.settings.kinds, trials, |n| index(&mut source, n));
        let mut keys = Vec::with_capacity(trials);
        for (trial, kind) in kinds.into_iter().enumerate() {
            let noise = Noise::new(seed, "withheld", trial as u64);
            let drawn = (self.sampler).draw(trial, kind, self.settings.validation, noise)?;
            filling.record(trial, false, &drawn.record)?;
            if let Some(validation) = &drawn.validation {
                filling.record(trial, true, validation)?;
            }
            keys.push(drawn.truth);
            stage.tick()?;
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
        Ok(study
            .manifest("withheld", LAYOUT)?
            .with("trials", settings.trials)
            .with("seed", settings.seed)
            .with("kinds", json!(kinds))
            .with("without", settings.without)
            .with("validation", settings.validation)
            .with("detection_only", settings.detection_only))
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
    /// [`EvaluateError`]: files that cannot be read or written, keys that are not those that were sealed, a stop.
    pub fn score(&self, progress: &Progress) -> Result<Scorecard, EvaluateError> {
        let answers = self.answer(Share::WHOLE, progress)?;
        let opened = self.open(Share::WHOLE, progress)?;
        let keys = self.folder.keys(self.trials.settings.trials)?;
        let without = self.trials.settings.without;
        let rows: Vec<Row> = (keys.iter().zip(&answers).zip(&opened))
            .map(|((truth, answer), opened)| Row::new(truth, answer, opened, without))
            .collect();
        let twin = self.trials.sampler.study().name();
        let alpha = DiagnoseSettings::default().alpha;
        let seed = self.trials.settings.seed;
        Ok(Scorecard::new(twin, seed, alpha, self.seal(), rows))
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
    ) -> Result<Vec<Answer>, EvaluateError> {
        let left_out = self.left_out()?;
        self.pieces(ANSWERS, share).all(
            &progress.stage("trials", self.trials.settings.trials),
            |_: &Answer| Ok(()),
            |trial| {
                let (record, validation) = self.records(trial)?;
                let settings = self.diagnosis(trial, left_out[trial].clone());
                let study = self.trials.sampler.study();
                let answer = Answer::of(
                    trial,
                    study,
                    record,
                    validation.as_ref(),
                    &settings,
                    progress,
                );
                Ok::<_, EvaluateError>(answer?)
            },
        )
    }

    /// Works out what the opened keys of a share add, where that has not been done; how many trials are finished then.
    ///
    /// # Errors
    ///
    /// As [`score`](Self::score); [`EvaluateError::Unanswered`] before every answer is there, whatever the share.
    pub(crate) fn open_keys(
        &self,
        share: Share,
        progress: &Progress,
    ) -> Result<usize, EvaluateError> {
        Ok(self.open(share, progress)?.len())
    }

    fn open(&self, share: Share, progress: &Progress) -> Result<Vec<Opened>, EvaluateError> {
        let Settings { trials, seed, .. } = self.trials.settings;
        let answers: Vec<Answer> = self.pieces(ANSWERS, share).kept(|_| Ok(()))?;
        if answers.len() < trials {
            return Err(EvaluateError::Unanswered {
                done: answers.len(),
                of: trials,
            });
        }
        // Every answer is there: now, and not before, the keys.
        let keys = self.folder.keys(trials)?;
        let left_out = self.left_out()?;
        self.pieces(OPENED, share).all(
            &progress.stage("open", trials),
            |_: &Opened| Ok(()),
            |trial| {
                Opened::of(
                    &self.trials.sampler,
                    &keys[trial],
                    answers[trial].outcome.as_ref(),
                    self.records(trial)?,
                    Noise::new(seed, "withheld", trial as u64),
                    &self.diagnosis(trial, left_out[trial].clone()),
                    progress,
                )
            },
        )
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
        let Settings {
            trials, without, ..
        } = self.trials.settings;
        if without {
            self.folder.left_out(trials)
        } else {
            Ok(vec![vec![]; trials])
        }
    }

    fn records(&self, trial: usize) -> Result<(Record, Option<Record>), EvaluateError> {
        let validation = self.trials.settings.validation;
        let validation = validation.then(|| self.folder.record(trial, true));
        Ok((self.folder.record(trial, false)?, validation.transpose()?))
    }

    /// Settings of a trial's diagnosis.
    fn diagnosis(&self, trial: usize, without: Vec<String>) -> DiagnoseSettings {
        let noise = Noise::new(
            self.trials.settings.seed,
            "withheld diagnosis",
            trial as u64,
        );
        DiagnoseSettings {
            seed: noise.seed().unwrap_or_default(),
            without: without.into_iter().map(Into::into).collect(),
            detection_only: self.trials.settings.detection_only,
            ..DiagnoseSettings::default()
        }
    }
}

impl Piece for Answer {
    fn number(&self) -> usize {
        self.trial
    }
}

impl Piece for Opened {
    fn number(&self) -> usize {
        self.trial
    }
}

#[cfg(test)]
mod tests;
