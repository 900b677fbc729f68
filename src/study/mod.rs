//! A twin together with everything that estimating its parameters needs, checked.

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

use crate::effect::{Catalogue, Effect, EffectKey, EffectKind, EffectPattern, augment};
use crate::equations::Declared;
use crate::record::{Drive, Record, RecordError};
use crate::setting::{did_you_mean, number};
use crate::twin::{
    Adaptation, DigitalTwin, Hold, Integrator, MOST_SUBSTEPS, Noise, NoiseLevel, Role, Stepping,
    TOLERANCES, Twin, TwinError, adapt, check_twin, fix,
};
use std::borrow::Cow;
use std::collections::BTreeMap;
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

    /// The twin, and its setting where that is a file's, as the text of a study file; `None` of compiled equations without one.
    pub fn text(&self) -> Option<String> {
        match self.file.own_equations() {
            Some(_) => self.file.written().ok(),
            None => self.text.map(str::to_owned),
        }
    }

    /// The study in the setting of a file about the same twin. θ becomes: the twin's parameters that are not fixed,
    /// unknown noise levels, unknown starts, effects' magnitudes that are not given. Of a file before, the plan of records stays alone.
    pub fn configure(&self, file: &StudyFile) -> Result<Self, StudyError> {
        if file.twin != self.name {
            return Err(StudyError::Twin {
                given: file.twin.clone(),
                known: self.name.clone(),
            });
        }
        // Boxes of magnitudes apply once the effects are added; all others before.
        let of_effects = |name: &str| name.parse::<EffectKey>().is_ok();
        let part = |boxes: &BTreeMap<String, _>, effects: bool| {
            (boxes.iter())
                .filter(|(name, _)| of_effects(name) == effects)
                .map(|(name, value)| (name.clone(), *value))
                .collect()
        };
        let plan = self.plan_of(&file.record)?;
        let declares = |level: &NoiseLevel| matches!(level, NoiseLevel::Declared(_));
        let step = match &plan {
            Some(plan) => plan.step,
            None if !file.noise.levels.values().any(declares) => 1.0,
            None => return Err(StudyError::NoPlan),
        };
        for (table, boxes) in [("prior", &file.prior.boxes), ("bounds", &file.bounds)] {
            if let Some(name) = boxes.keys().find(|name| file.fixed.contains_key(*name)) {
                return Err(StudyError::Twice {
                    name: name.clone(),
                    table,
                });
            }
        }
        self.check_library(&file.library)?;
        let first = Adaptation {
            prior: part(&file.prior.boxes, false),
            bounds: part(&file.bounds, false),
            limits: file.limits.clone(),
            noise: (file.noise).entries(self.base.outline().as_ref())?,
            start: file.start.clone(),
        };
        let second = Adaptation {
            prior: part(&file.prior.boxes, true),
            bounds: part(&file.bounds, true),
            ..Adaptation::default()
        };
        let effects = (file.effect.iter().enumerate())
            .map(|(index, entry)| {
                (self.catalogue.resolve(entry)).map_err(|error| file.effect_error(index, error))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut twin = adapt(self.stepped(&file.record)?, &first, step)
            .map_err(|error| self.naming_magnitudes(error, &effects))?;
        twin =
            augmented(&twin, &effects).map_err(|(index, error)| file.effect_error(index, error))?;
        if second != Adaptation::default() {
            twin = adapt(twin, &second, step)?;
        }
        let fixed = |error: TwinError| StudyError::Table(format!("fixed: {error}"));
        let space = twin.parameters();
        for (name, &value) in &file.fixed {
            let position = space.position(name);
            (position.and_then(|at| space[at].check_value(value))).map_err(fixed)?;
        }
        let mut held = file.fixed.clone();
        held.extend(effects.iter().flat_map(Effect::given_by_parameter));
        twin = fix(twin, &held).map_err(fixed)?;
        if let Some(plan) = &plan {
            plan.check(&twin.signals())?;
        }
        Ok(Self {
            twin,
            plan,
            file: file.with_equations_of(&self.file),
            ..self.clone()
        })
    }

    /// Returns the plan of the study with what a file changes in it.
    fn plan_of(&self, record: &RecordTable) -> Result<Option<RecordPlan>, StudyError> {
        let own = self.plan.as_ref();
        let step = record.step.or(own.map(|plan| plan.step));
        let samples = record.samples.or(own.map(|plan| plan.samples));
        let input = (record.input.clone()).or_else(|| own?.input.clone());
        match (step, samples) {
            (Some(step), Some(samples)) => Ok(Some(RecordPlan {
                step,
                samples,
                input,
                first_time: own.map_or(0.0, |plan| plan.first_time),
            })),
            _ if record.is_plan() => Err(StudyError::NoPlan),
            _ => Ok(None),
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

    /// Returns the twin as registered, with the integrator, the substeps and the hold of a file.
    fn stepped(&self, record: &RecordTable) -> Result<Twin, StudyError> {
        let RecordTable {
            integrator,
            substeps,
            hold,
            tolerance,
            ..
        } = *record;
        let hold = hold.or(self.hold);
        let given = [
            (substeps.is_some(), "substeps"),
            (integrator.is_some(), "integrator"),
            (hold.is_some(), "hold"),
            (tolerance.is_some(), "tolerance"),
        ];
        let Some((_, key)) = given.into_iter().find(|(is_given, _)| *is_given) else {
            return Ok(self.base.clone());
        };
        if let Some(n) = substeps.filter(|n| !(1..=MOST_SUBSTEPS).contains(n)) {
            return Err(StudyError::Plan(format!(
                "substeps = {n}; choose between 1 and {MOST_SUBSTEPS}"
            )));
        }
        if hold == Some(Hold::Impulse) {
            return Err(StudyError::Plan(
                "hold = \"impulse\" is of a single input; say so where the input is declared"
                    .into(),
            ));
        }
        if let Some(tolerance) = tolerance.filter(|share| !TOLERANCES.contains(share)) {
            return Err(StudyError::Plan(format!(
                "tolerance = {}; choose a share between {:e} and {}",
                number(tolerance),
                TOLERANCES.start(),
                TOLERANCES.end()
            )));
        }
        let is_discrete = |rule: Integrator| rule == Integrator::Discrete;
        if let Some((own, _)) = self.base.integration() {
            let wrong = match integrator {
                Some(rule) => is_discrete(rule) != is_discrete(own),
                None => is_discrete(own),
            };
            if wrong || is_discrete(own) && (substeps, hold, tolerance) != (None, None, None) {
                return Err(StudyError::Plan(format!(
                    "{key}: {}",
                    match is_discrete(own) {
                        true =>
                            "the twin moves from sample to sample, with nothing between; remove it",
                        false =>
                            "the twin has rates, and no next values; choose another integrator",
                    }
                )));
            }
        }
        let change = |rule: &mut Integrator, stepping: &mut Stepping| {
            *rule = integrator.unwrap_or(*rule);
            stepping.hold = hold.unwrap_or(stepping.hold);
            stepping.substeps = substeps.unwrap_or(stepping.substeps);
            stepping.tolerance = tolerance.unwrap_or(stepping.tolerance);
        };
        self.base.stepped(change).ok_or_else(|| {
            StudyError::Plan(format!(
                "{key} needs the twin's equations, which a black box does not show; remove it"
            ))
        })
    }

    /// Adds the magnitudes of the file's effects to the names that an unknown name in `[prior]` or `[bounds]` is told.
    fn naming_magnitudes(&self, error: TwinError, effects: &[Effect]) -> TwinError {
        match (error, augment(self.base.clone(), effects.to_vec())) {
            (TwinError::UnknownIn { table, name, known }, Ok(twin))
                if matches!(table, "prior" | "bounds") =>
            {
                let space = twin.parameters();
                let magnitudes = space.iter().filter(|p| p.role == Role::Magnitude);
                let known = magnitudes.fold(known, |known, p| format!("{known}, {}", p.name));
                TwinError::UnknownIn { table, name, known }
            }
            (error, _) => error,
        }
    }

    /// Returns whether a pattern names an effect of the library or of the study's own.
    pub fn knows_effect(&self, pattern: &EffectPattern) -> bool {
        self.catalogue.knows(pattern, &self.twin)
    }

    fn check_library(&self, library: &Library) -> Result<(), StudyError> {
        let mut named = library.only.iter().chain(&library.without);
        let unknown = named.find(|name| !self.knows_effect(name));
        unknown.map_or(Ok(()), |name| {
            Err(StudyError::UnknownEffect(self.with_nearest_effect(name)))
        })
    }

    /// Adds to the name of an unknown effect the known one that is nearest.
    pub(crate) fn with_nearest_effect(&self, pattern: &EffectPattern) -> String {
        let effects = self.effects();
        let name = pattern.as_str();
        let known = effects.iter().map(|e| match name.parse::<EffectKey>() {
            Ok(_) => e.key().to_string(),
            Err(_) => e.id().to_owned(),
        });
        format!("{name}{}", did_you_mean(name, known))
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
        let Library { only, without } = &self.file.library;
        let named = |list: &[EffectPattern], effect: &Effect| {
            list.iter().any(|pattern| pattern.matches(effect.key()))
        };
        (self.effects().into_iter())
            .filter(|effect| only.is_empty() || named(only, effect))
            .filter(|effect| !named(without, effect))
            .collect()
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
        self.check_complete(record)?;
        self.needed_plan()?.check_step(record)
    }

    /// Checks that a record has the channels of this study, and that no output is missing.
    pub(crate) fn check_complete(&self, record: &Record) -> Result<(), StudyError> {
        self.check_channels(record)?;
        Ok(record.check_complete()?)
    }

    /// Checks that a record has the channels of this study, and begins no earlier than the start of the twin.
    pub(crate) fn check_channels(&self, record: &Record) -> Result<(), RecordError> {
        record.check_channels(&self.twin.signals())?;
        self.twin.check_start(record.drive())
    }
}

/// Adds effects to a twin; an error comes with the index of the first effect that cannot be added.
fn augmented(twin: &Twin, effects: &[Effect]) -> Result<Twin, (usize, TwinError)> {
    (1..=effects.len()).try_fold(twin.clone(), |_, n| {
        augment(twin.clone(), effects[..n].to_vec()).map_err(|error| (n - 1, error))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::fixture::AtOnce;
    use crate::twins::CascadedTanks;

    fn refused(tables: &str) -> String {
        let text = format!("twin = 'tanks'\n{tables}");
        let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
        let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        study.configure(&file).unwrap_err().to_string()
    }

    #[test]
    fn an_unknown_name_lists_parameters_and_magnitudes() {
        let effect = "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\n";
        let message = refused(&format!("[prior]\nk9 = [0.0, 1.0]\n{effect}"));
        for name in ["k9", "k1, k2, k3, k4", "sensor-lag@sensor.tau"] {
            assert!(message.contains(name), "{message}");
        }
    }

    #[test]
    fn the_hold_of_the_twins_own_file_stays_under_another_study() {
        let text = "[twin]\nname = 'tank'\n[parameters]\nk = { prior = [0.2, 1.0] }\n\
            [states]\nh = { rate = 'u - k*h', start = 1.0 }\n[inputs]\nu = {}\n\
            [outputs]\ny = { value = 'h', noise = 0.02 }\n[record]\nhold = 'linear'\n";
        let parse = |text: &str| StudyFile::parse(text, "s.toml".as_ref()).unwrap();
        let file = parse(text);
        let served = Study::of_file_with(&file, file.own_equations().unwrap().clone());
        for study in [Study::of_file(&file).unwrap(), served.unwrap()] {
            for (record, hold) in [("", Hold::Linear), ("[record]\nhold = 'zero'", Hold::Zero)] {
                let other = format!("twin = 'tank'\n[prior]\nk = [0.3, 0.9]\n{record}");
                let configured = study.configure(&parse(&other)).unwrap();
                assert_eq!(configured.twin().integration().unwrap().1.hold, hold);
                assert!(!configured.asks_hold(), "nothing is asked that is said");
            }
        }
    }

    #[test]
    fn substeps_have_a_range_and_need_equations() {
        for n in ["0", "1000000000"] {
            let message = refused(&format!("[record]\nsubsteps = {n}"));
            assert_eq!(
                message,
                format!("substeps = {n}; choose between 1 and 1000")
            );
        }
        let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
        let study = Study::new("boxed", AtOnce::<1>(|a, u| a[0] * u), plan).unwrap();
        for key in ["hold = 'linear'", "integrator = 'euler'", "substeps = 2"] {
            let text = format!("twin = 'boxed'\n[record]\n{key}");
            let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
            let message = study.configure(&file).unwrap_err().to_string();
            let name = key.split(' ').next().unwrap();
            assert!(message.starts_with(&format!("{name} needs")), "{message}");
            assert!(message.ends_with("remove it"), "{message}");
        }
    }

    #[test]
    fn a_wrong_effect_is_named_by_its_line() {
        let first = "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\n";
        for (second, expected) in [
            (
                "id = 'lagg'\ntarget = 'sensor'",
                "line 6: unknown effect id \"lagg\"",
            ),
            (
                "id = 'state-ceiling'\ntarget = 'h9'\nto = 'h2'",
                "line 7: effect state-ceiling: the twin has no state \"h9\"",
            ),
            (
                "id = 'state-ceiling'\ntarget = 'h1'\nto = 'h9'",
                "line 8: effect state-ceiling: the twin has no state \"h9\"",
            ),
            (
                "id = 'sensor-bias'\ntarget = 'sensor'\nfrom = 'h1'",
                "line 8: effect sensor-bias has no from",
            ),
            (
                "id = 'sensor-lag'\ntarget = 'sensor'",
                "line 7: effect sensor-lag on sensor is given twice",
            ),
            (
                "id = 'sensor-bias'\ntarget = 'sensor'\nmagnitudes = { ofset = 1 }",
                "line 8: effect sensor-bias has no magnitude \"ofset\"",
            ),
            (
                "id = 'sensor-bias'\ntarget = 'sensor'\n[effect.magnitudes]\noffset = nan",
                "line 9: effect sensor-bias: offset = NaN",
            ),
        ] {
            let message = refused(&format!("{first}[[effect]]\n{second}\n"));
            assert!(
                message.starts_with(&format!("s.toml, {expected}")),
                "{message}"
            );
        }
    }

    #[test]
    fn a_parameter_in_two_tables_is_refused() {
        let message = refused("[fixed]\nk1 = 0.5\n[bounds]\nk1 = [0.1, 1.0]");
        assert_eq!(message, "k1 appears in both fixed and bounds; remove one");
    }
}
