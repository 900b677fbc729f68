//! The trials from end to end: sealed, diagnosed, opened, scored.

use super::folder::{ANSWERS, Filling, Folder, OPENED};
use super::kind::deal;
use super::opened::Opened;
use super::truth::Urn;
use super::unlisted::index;
use super::{Answer, Kind, Row, Scorecard, WithheldError};
use crate::diagnose::DiagnoseSettings;
use crate::experiment::crew::share_out;
use crate::progress::Progress;
use crate::study::Study;
use crate::twin::{Noise, Record};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Layout of the folder; raised when it changes.
const SCHEMA: &str = "truetwin.withheld-folder/2";

/// What is tried.
///
/// | setting | default | meaning |
/// |---|---|---|
/// | `trials` | 100 | records |
/// | `seed` | 1 | of truths, records and diagnoses |
/// | `kinds` | all | kinds of truth, dealt in the proportions of docs/withheld.md |
/// | `without` | no | whether the true effects are taken out of the library: then every trial with one must abstain |
/// | `validation` | no | whether each trial has a second record |
/// | `detection_only` | no | whether a diagnosis ends with its verdict: for false alarms over many trials |
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Records.
    pub trials: usize,
    /// Of everything random.
    pub seed: u64,
    /// Kinds of truth.
    pub kinds: Vec<Kind>,
    /// Whether the true effects are taken out of the library.
    pub without: bool,
    /// Whether each trial has a validation record.
    pub validation: bool,
    /// Whether a diagnosis ends with its verdict.
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
/// use truetwin::experiment::reference_studies;
/// use truetwin::progress::Progress;
/// use truetwin::withheld::{Kind, Settings, Withheld};
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
    urn: Urn<'a>,
    settings: Settings,
}

impl<'a> Withheld<'a> {
    /// Trials of a study of a reference twin.
    ///
    /// # Errors
    ///
    /// [`WithheldError`]: a twin without a world, a study that changes the twin, kinds that cannot be drawn, no trials.
    pub fn new(study: &'a Study, settings: Settings) -> Result<Self, WithheldError> {
        let urn = Urn::new(study)?;
        if settings.trials == 0 {
            return Err(WithheldError::Nothing("trials"));
        }
        if settings.kinds.is_empty() {
            return Err(WithheldError::Nothing("kinds"));
        }
        for kind in &settings.kinds {
            urn.check(*kind)?;
        }
        Ok(Self { urn, settings })
    }

    /// Draws every truth, writes records, keys and seal into a new folder; or goes on with the folder of the same call.
    ///
    /// # Errors
    ///
    /// [`WithheldError`]: a folder of another call, a place that cannot be written.
    pub fn seal(self, path: &Path, progress: &Progress) -> Result<Sealed<'a>, WithheldError> {
        let manifest = self.manifest();
        let folder = match Folder::open(path, &manifest)? {
            Some(folder) => folder,
            None => self.fill(path, &manifest, progress)?,
        };
        Ok(Sealed {
            trials: self,
            folder,
        })
    }

    fn fill(
        &self,
        path: &Path,
        manifest: &Map<String, Value>,
        progress: &Progress,
    ) -> Result<Folder, WithheldError> {
        let Settings { trials, seed, .. } = self.settings;
        let filling = Filling::new(path)?;
        let stage = progress.stage("seal", trials);
        let mut dealer = Noise::new(seed, "withheld kinds", 0).source("deal");
        let kinds = deal(&self.settings.kinds, trials, |n| index(&mut dealer, n));
        let mut keys = Vec::with_capacity(trials);
        for (trial, kind) in kinds.into_iter().enumerate() {
            let noise = Noise::new(seed, "withheld", trial as u64);
            let drawn = (self.urn).draw(trial, kind, self.settings.validation, noise)?;
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
        filling.finish(&keys, manifest)
    }

    /// What the trials depend on.
    fn manifest(&self) -> Map<String, Value> {
        let study = self.urn.study();
        let settings = &self.settings;
        let kinds: Vec<&str> = settings.kinds.iter().map(|kind| kind.id()).collect();
        let entries = [
            ("schema", SCHEMA.into()),
            ("version", env!("CARGO_PKG_VERSION").into()),
            ("twin", study.name().into()),
            ("trials", settings.trials.into()),
            ("seed", settings.seed.into()),
            ("kinds", json!(kinds)),
            ("without", settings.without.into()),
            ("validation", settings.validation.into()),
            ("detection_only", settings.detection_only.into()),
            // A file that was read can be written.
            (
                "study",
                toml::to_string(study.file()).unwrap_or_default().into(),
            ),
        ];
        (entries.into_iter())
            .map(|(key, value)| (key.to_owned(), value))
            .collect()
    }
}

/// Trials whose keys are sealed.
pub struct Sealed<'a> {
    trials: Withheld<'a>,
    folder: Folder,
}

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
    /// [`WithheldError`]: files that cannot be read or written, keys that are not those that were sealed, a stop.
    pub fn score(&self, progress: &Progress) -> Result<Scorecard, WithheldError> {
        let Settings {
            trials,
            seed,
            without,
            ..
        } = self.trials.settings;
        let left_out = match without {
            true => self.folder.left_out(trials)?,
            false => vec![vec![]; trials],
        };
        let answers = self.each(
            "trials",
            ANSWERS,
            progress,
            |a: &Answer| a.trial,
            |trial| {
                let (record, validation) = self.records(trial)?;
                let settings = self.diagnosis(trial, left_out[trial].clone());
                let study = self.trials.urn.study();
                Ok(Answer::of(
                    trial,
                    study,
                    record,
                    validation.as_ref(),
                    &settings,
                    progress,
                )?)
            },
        )?;
        // Every answer is there: now, and not before, the keys.
        let keys = self.folder.keys(trials)?;
        let opened = self.each(
            "open",
            OPENED,
            progress,
            |o: &Opened| o.trial,
            |trial| {
                Opened::of(
                    &self.trials.urn,
                    &keys[trial],
                    answers[trial].outcome.as_ref(),
                    self.records(trial)?,
                    Noise::new(seed, "withheld", trial as u64),
                    &self.diagnosis(trial, left_out[trial].clone()),
                    progress,
                )
            },
        )?;
        let rows: Vec<Row> = (keys.iter().zip(&answers).zip(&opened))
            .map(|((truth, answer), opened)| Row::new(truth, answer, opened, without))
            .collect();
        let twin = self.trials.urn.study().name();
        let alpha = DiagnoseSettings::default().alpha;
        Ok(Scorecard::new(twin, seed, alpha, self.seal(), rows))
    }

    /// Puts a result into the folder, in place of an earlier one.
    pub fn write(&self, name: &str, text: &str) -> Result<(), WithheldError> {
        self.folder.write(name, text)
    }

    /// Something of every trial, in order: kept, or made and kept.
    fn each<T: serde::Serialize + serde::de::DeserializeOwned + Send>(
        &self,
        stage: &'static str,
        what: &str,
        progress: &Progress,
        number: impl Fn(&T) -> usize,
        make: impl Fn(usize) -> Result<T, WithheldError> + Sync,
    ) -> Result<Vec<T>, WithheldError> {
        let trials = self.trials.settings.trials;
        let stage = progress.stage(stage, trials);
        let (mut all, mut missing) = (Vec::with_capacity(trials), vec![]);
        for trial in 0..trials {
            match self.folder.kept(what, trial, &number)? {
                Some(kept) => {
                    all.push(kept);
                    stage.tick()?;
                }
                None => missing.push(trial),
            }
        }
        all.extend(share_out(&missing, |trial| {
            let made = make(trial)?;
            self.folder.keep(what, trial, &made)?;
            stage.tick()?;
            Ok::<_, WithheldError>(made)
        })?);
        all.sort_by_key(|one| number(one));
        Ok(all)
    }

    fn records(&self, trial: usize) -> Result<(Record, Option<Record>), WithheldError> {
        let validation = match self.trials.settings.validation {
            true => Some(self.folder.record(trial, true)?),
            false => None,
        };
        Ok((self.folder.record(trial, false)?, validation))
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
            without,
            detection_only: self.trials.settings.detection_only,
            ..DiagnoseSettings::default()
        }
    }
}

#[cfg(test)]
mod tests;
