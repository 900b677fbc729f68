//! A twin together with everything that estimating its parameters needs, checked.

mod configure;
mod error;
mod file;
mod fit;
mod input_plan;
mod manifest;
mod noise_table;
mod own_runs;
mod plan;
mod suitability;
mod tables;

pub use error::StudyError;
pub use file::StudyFile;
pub use input_plan::InputPlan;
pub(crate) use input_plan::PlannedInputs;
pub(crate) use noise_table::NoiseTable;
pub use noise_table::ProcessNoise;
pub(crate) use plan::DriveSource;
pub use plan::RecordPlan;
pub(crate) use tables::{Library, RecordTable};

use crate::effect::{Catalogue, Effect, EffectKey, EffectKind, EffectPattern};
use crate::equations::Declared;
use crate::record::{Drive, Record, RecordError};
use crate::setting::did_you_mean;
use crate::twin::{DeclaredNoise, DigitalTwin, Hold, Noise, NoiseLevel, Twin, check_twin};
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

/// Name of a twin that was given none.
const UNNAMED: &str = "twin";

/// A twin, the records it is compared with, and the effects it may lack.
///
/// ```
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
///
/// // To fit and diagnose measured records.
/// let study = Study::of(VanDerPol)?;
/// assert_eq!(study.twin().parameters().names(), ["nu"]);
/// // To simulate records as well, as an estimator needs it: 300 samples, 0.05 s apart.
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 300))?;
/// assert_eq!(study.plan().map(|plan| plan.samples), Some(300));
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Clone)]
pub struct Study {
    name: String,
    /// As registered.
    base: Twin,
    /// In the setting of `file`.
    twin: Twin,
    /// Plan of simulated records, which measured ones do not need.
    plan: Option<RecordPlan>,
    file: StudyFile,
    demo: Option<Arc<(StudyFile, Record)>>,
    /// The twin as the text of a study file.
    text: Option<&'static str>,
    /// The library's effects and the study's own.
    catalogue: Catalogue,
    /// `true` where the starts of the twin's code stand, whatever the first rows say.
    trusts_starts: bool,
    /// Noise and starts as the twin's equations declare them, where these are a text.
    declared: Declared,
    /// Hold of all inputs between samples, as the file of the twin's equations says.
    hold: Option<Hold>,
    /// A simulator of the same system, where the twin has one beside its equations.
    own_runs: Option<Arc<dyn DigitalTwin>>,
}

debug_by_name!(Study);

impl Study {
    /// Creates a study of measured records. To simulate records, it needs a plan ([`Study::new`], or the study file).
    pub fn of(twin: impl DigitalTwin + 'static) -> Result<Self, StudyError> {
        Self::named(UNNAMED, twin, None)
    }

    /// Creates a study of `twin` under `name`, whose simulated records follow `plan`.
    pub fn new(
        name: &str,
        twin: impl DigitalTwin + 'static,
        plan: RecordPlan,
    ) -> Result<Self, StudyError> {
        Self::named(name, twin, Some(plan))
    }

    /// Creates the study of a file that has the twin's equations.
    ///
    /// ```
    /// use truetwin::study::{Study, StudyFile};
    ///
    /// let text = r#"
    ///     [twin]
    ///     name = "tank"
    ///     [parameters]
    ///     k = { unit = "1/s", prior = [0.2, 1.0], bounds = [0.05, 3.0] }
    ///     [states]
    ///     h = { unit = "m", rate = "-k*h", start = 1.0 }
    ///     [outputs]
    ///     y = { unit = "m", value = "h", noise = 0.02 }
    /// "#;
    /// let study = Study::of_file(&StudyFile::parse(text, "tank.toml".as_ref())?)?;
    /// assert_eq!(study.twin().parameters().names(), ["k"]);
    /// # Ok::<(), truetwin::study::StudyError>(())
    /// ```
    pub fn of_file(file: &StudyFile) -> Result<Self, StudyError> {
        let equations = file.equations_of_twin()?;
        let mut study = Self::named(&file.twin, equations.clone(), None)?;
        study.declared = equations.declared().clone();
        study.hold = file.record.hold;
        study.configure(file)
    }

    /// As [`of_file`](Self::of_file), with a twin in place of the file's equations, whose declarations it has.
    pub(crate) fn of_file_with(
        file: &StudyFile,
        twin: impl DigitalTwin + 'static,
    ) -> Result<Self, StudyError> {
        let mut study = Self::named(&file.twin, twin, None)?;
        study.declared = file.equations_of_twin()?.declared().clone();
        study.hold = file.record.hold;
        // The text is not the twin: nobody is to read it as that.
        study.configure(&StudyFile {
            equations: None,
            origin: None,
            ..file.clone()
        })
    }

    /// As [`of_file`](Self::of_file), from its path.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        Self::of_file(&StudyFile::read(path)?)
    }

    fn named(
        name: &str,
        twin: impl DigitalTwin + 'static,
        plan: Option<RecordPlan>,
    ) -> Result<Self, StudyError> {
        let base = Twin::new(twin);
        check_twin(&base)
            .map_err(|error| StudyError::Table(format!("twin \"{name}\": {error}")))?;
        Ok(Self {
            name: name.into(),
            twin: base.clone(),
            base,
            plan,
            file: StudyFile {
                twin: name.into(),
                ..StudyFile::default()
            },
            demo: None,
            text: None,
            catalogue: Catalogue::default(),
            trusts_starts: false,
            declared: Declared::default(),
            hold: None,
            own_runs: None,
        })
    }

    /// Creates a study of another twin, which has this study's name and plan.
    pub fn with_twin(&self, twin: impl DigitalTwin + 'static) -> Result<Self, StudyError> {
        Self::named(&self.name, twin, self.plan.clone())
    }

    /// Adds effects that the twin may lack and the library does not have. Each is offered at every place that it can stand at,
    /// and files know its id.
    #[must_use]
    pub fn with_effects(mut self, kinds: impl IntoIterator<Item = EffectKind>) -> Self {
        self.catalogue = kinds.into_iter().fold(self.catalogue, Catalogue::with);
        self
    }

    /// With a simulator of the same system, which `check` compares with the equations.
    #[must_use]
    pub(crate) fn with_own_runs(mut self, own: Arc<dyn DigitalTwin>) -> Self {
        self.own_runs = Some(own);
        self
    }

    /// The study of a twin whose starts in code stand, whatever the first rows of its records say.
    pub(crate) fn trusting_starts(&self) -> Self {
        Self {
            trusts_starts: true,
            ..self.clone()
        }
    }

    /// With a record to show the program on, and the setting that the record is of.
    #[must_use]
    pub fn with_demo(mut self, file: StudyFile, record: Record) -> Self {
        self.demo = Some(Arc::new((file, record)));
        self
    }

    /// Returns the study with one word for the process noise of all states that its file has no entry of.
    ///
    /// # Errors
    ///
    /// [`StudyError`]: a black box, or an entry that contradicts the word.
    pub fn with_process_noise(&self, process: ProcessNoise) -> Result<Self, StudyError> {
        let mut file = self.file.clone();
        file.noise.process = Some(process);
        self.configure(&file)
    }

    /// With the twin as the text of a study file, for whoever wants to change its equations.
    #[must_use]
    pub fn with_text(mut self, text: &'static str) -> Self {
        self.text = Some(text);
        self
    }

    /// The twin and its setting as the text of a study file; `None` of compiled equations without one.
    pub fn text(&self) -> Option<String> {
        if self.file.own_equations().is_some() {
            return self.file.written().ok();
        }
        let text = self.text?;
        if self.file.names_twin_alone() {
            return Some(text.to_owned());
        }
        let own = StudyFile::parse(text, Path::new(self.name())).ok()?;
        let mut file = self.file.upon(&own);
        self.noise_of_step(own.record.step?, &mut file);
        file.written().ok()
    }

    /// Declares the process noise of the twin's code where it is another in a step of this file than in the `own` step of the twin's text, which has a
    /// number for it.
    fn noise_of_step(&self, own: f64, file: &mut StudyFile) {
        let Some(step) = file.record.step.filter(|_| file.noise.process.is_none()) else {
            return;
        };
        let own = self.base.process_noise(own);
        for ((state, level), (_, at_own)) in self.base.process_noise(step).into_iter().zip(own) {
            if level != at_own {
                let declared = DeclaredNoise {
                    known: false,
                    ..DeclaredNoise::known(level)
                };
                let levels = &mut file.noise.levels;
                levels
                    .entry(state)
                    .or_insert(NoiseLevel::Declared(declared));
            }
        }
    }

    /// Returns the study with a plan: its own, or that of the first of these records.
    pub(crate) fn for_records(&self, records: &[Record]) -> Result<Cow<'_, Self>, StudyError> {
        let first = records.first().ok_or(StudyError::NoRecord)?;
        Ok(match &self.plan {
            Some(_) => Cow::Borrowed(self),
            None => Cow::Owned(Self {
                plan: Some(RecordPlan::like(first)),
                ..self.clone()
            }),
        })
    }

    /// Refuses a study of which nothing is left to estimate, where simulations are to teach an estimator.
    pub(crate) fn check_estimated(&self) -> Result<(), StudyError> {
        match self.twin.parameters().is_empty() {
            true => Err(StudyError::AllFixed),
            false => Ok(()),
        }
    }

    /// Returns whether estimates may lean on the prior: `[prior] trust = true`.
    pub(crate) fn trusts_prior(&self) -> bool {
        self.file.prior.trust
    }

    /// Returns whether the file of the study adds this effect.
    pub(crate) fn has_effect(&self, key: &EffectKey) -> bool {
        let mut own = self.file.effect.iter();
        own.any(|own| own.id == key.id && own.target == key.target)
    }

    /// Returns whether a pattern names an effect of the library or of the study's own.
    pub fn knows_effect(&self, pattern: &EffectPattern) -> bool {
        self.catalogue.knows(pattern, &self.twin)
    }

    /// Adds to the name of an unknown effect the known one that is nearest.
    pub(crate) fn nearest_effect(&self, pattern: &EffectPattern) -> String {
        let effects = self.effects();
        let name = pattern.as_str();
        let known = effects.iter().map(|e| match name.parse::<EffectKey>() {
            Ok(_) => e.key().to_string(),
            Err(_) => e.id().to_owned(),
        });
        did_you_mean(name, known)
    }

    /// Returns all effects that this program knows.
    pub fn catalogue(&self) -> &Catalogue {
        &self.catalogue
    }

    /// Returns the library's effects and the study's own, each once for each target of this twin, all magnitudes free.
    pub fn effects(&self) -> Vec<Effect> {
        self.catalogue.applicable(&self.twin)
    }

    /// Returns what the twin may lack: those of [`Study::effects`] that `[library]` lets through.
    pub fn candidates(&self) -> Vec<Effect> {
        let mut all = self.effects();
        all.retain(|effect| self.file.library.lets(effect.key()));
        all
    }

    /// A record to show the program on, and its setting.
    pub fn demo(&self) -> Option<(&StudyFile, &Record)> {
        self.demo.as_deref().map(|(file, record)| (file, record))
    }

    /// Name of the twin.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The twin in this study's setting.
    pub fn twin(&self) -> &Twin {
        &self.twin
    }

    /// Step, length and input of simulated records; none of a study of measured records alone.
    pub fn plan(&self) -> Option<&RecordPlan> {
        self.plan.as_ref()
    }

    fn needed_plan(&self) -> Result<&RecordPlan, StudyError> {
        self.plan.as_ref().ok_or(StudyError::NoPlan)
    }

    /// The file that would make this study from the registered one.
    pub fn file(&self) -> &StudyFile {
        &self.file
    }

    /// Draws the input of a record; a fixed one is the same for any noise.
    pub fn drive(&self, noise: Noise) -> Result<Drive, StudyError> {
        Ok(self.drives()?.draw(noise)?)
    }

    /// Prepares the source of drives.
    pub(crate) fn drives(&self) -> Result<DriveSource, StudyError> {
        let source = self.needed_plan()?.prepare(&self.twin.signals())?;
        Ok(source.with_doses(self.twin.doses()))
    }

    /// Checks whether features can be taken of a record: it has the step and the channels of this study, and no output is missing.
    pub fn check_record(&self, record: &Record) -> Result<(), StudyError> {
        let plan = self.needed_plan()?;
        self.check_channels(record)?;
        record.check_complete_at(plan.step)?;
        plan.check_step(record)
    }

    /// Checks that a record has the channels of this study, and that no output is missing.
    pub(crate) fn check_complete(&self, record: &Record) -> Result<(), StudyError> {
        self.check_channels(record)?;
        Ok(record.check_complete()?)
    }

    /// As [`check_channels`](Self::check_channels), of one of several records, or of the validation record.
    pub(crate) fn check_one_of(
        &self,
        which: Option<usize>,
        record: &Record,
    ) -> Result<(), StudyError> {
        (self.check_channels(record)).map_err(|error| StudyError::Channels {
            record: which,
            error,
        })
    }

    /// Checks that a record has the channels of this study, and steps that its twin can take.
    pub(crate) fn check_channels(&self, record: &Record) -> Result<(), RecordError> {
        record.check_channels(&self.twin.signals())?;
        self.twin.check_drive(record.drive())
    }
}
