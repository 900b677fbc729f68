//! Projects: a study with the recipes of its estimators.

use crate::estimator::settings::Settings;
use crate::feature::{Ar, Arx, FeatureError, FeatureRecipe, Score};
use crate::likelihood::likelihood_of;
use crate::network::{Architecture, Deep, HeadArchitecture, architecture};
use crate::record::Drive;
use crate::setting::count;
use crate::study::{Study, StudyError, StudyFile};
use crate::twin::Noise;
use crate::twin::conformance::{Finding, Severity};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A [`Study`] with features, network and settings for each preset. A study alone becomes a project with the standard recipes.
///
/// ```
/// use truetwin::estimator::Project;
/// use truetwin::feature::Ar;
/// use truetwin::network::Compact;
/// use truetwin::study::{RecordPlan, Study};
/// use truetwin::twins::VanDerPol;
///
/// let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 300))?;
/// let project = Project::from(study).with_features(Ar { order: 4 }).with_architecture::<Compact>();
/// assert_eq!(project.study().name(), "oscillator");
/// # Ok::<(), truetwin::study::StudyError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Project {
    study: Study,
    recipes: BTreeMap<PresetName, Recipe>,
}

impl From<Study> for Project {
    fn from(study: Study) -> Self {
        let recipes = BTreeMap::from([
            (PresetName::Default, Recipe::standard(&study)),
            (PresetName::Paper, Recipe::paper(&study)),
        ]);
        Self { study, recipes }.with_features_of_file()
    }
}

impl From<&Study> for Project {
    fn from(study: &Study) -> Self {
        study.clone().into()
    }
}

impl From<&Project> for Project {
    fn from(project: &Project) -> Self {
        project.clone()
    }
}

impl Project {
    /// Replaces the recipe of a preset.
    #[must_use]
    pub(crate) fn with_recipe(mut self, name: PresetName, recipe: Recipe) -> Self {
        self.recipes.insert(name, recipe);
        self
    }

    /// Replaces the features of both presets.
    #[must_use]
    pub fn with_features(self, features: impl FeatureRecipe + 'static) -> Self {
        self.with_shared_features(Arc::new(features))
    }

    fn with_shared_features(mut self, features: Arc<dyn FeatureRecipe>) -> Self {
        for recipe in self.recipes.values_mut() {
            recipe.features = features.clone();
        }
        self
    }

    fn with_features_of_file(self) -> Self {
        match self.study.file().features.clone() {
            Some(features) => self.with_shared_features(features),
            None => self,
        }
    }

    /// Replaces the network of both presets.
    #[must_use]
    pub fn with_architecture<A: HeadArchitecture>(mut self) -> Self {
        for recipe in self.recipes.values_mut() {
            recipe.architecture = architecture::<A>();
        }
        self
    }

    /// Replaces the settings of the default preset.
    #[must_use]
    pub fn with_settings(mut self, settings: Settings) -> Self {
        if let Some(recipe) = self.recipes.get_mut(&PresetName::Default) {
            recipe.settings = settings;
        }
        self
    }

    /// Applies a study file to the study, and its `[features]` to the recipes.
    pub fn configure(&self, file: &StudyFile) -> Result<Self, StudyError> {
        let study = self.study.configure(file)?;
        let recipes = self.recipes.clone();
        Ok(Self { study, recipes }.with_features_of_file())
    }

    /// The study.
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// The recipe of a preset.
    pub(crate) fn recipe(&self, name: PresetName) -> &Recipe {
        &self.recipes[&name]
    }

    /// Returns the network with this id among the recipes' networks.
    pub(super) fn architecture(&self, id: &str) -> Option<Arc<dyn Architecture>> {
        (self.recipes.values())
            .map(|recipe| &recipe.architecture)
            .find(|architecture| architecture.id() == id)
            .cloned()
    }

    /// Checks that the recipe's features exist for a simulated record, and that the network takes as many.
    ///
    /// # Errors
    ///
    /// Features that cannot be bound to this twin.
    pub(crate) fn check_features(
        &self,
        preset: PresetName,
        drive: &Drive,
        seed: u64,
    ) -> Result<Finding, FeatureError> {
        let recipe = self.recipe(preset);
        let twin = self.study.twin();
        let map = recipe.features.bind(twin)?;
        let noise = Noise::new(seed, "check features", 0);
        let features = (twin.simulate(&twin.parameters().centre(), drive, noise))
            .map_err(|error| error.to_string())
            .and_then(|y| map.extract(drive, &y).map_err(|error| error.to_string()));
        let (severity, message) = match features {
            Err(error) => (Severity::Failure, error),
            Ok(x) => match recipe.check_width(x.len()) {
                Err(problem) => (Severity::Failure, problem),
                Ok(()) => (
                    Severity::Pass,
                    format!("{} of a record", count(x.len(), "feature")),
                ),
            },
        };
        Ok(Finding {
            check: "features",
            severity,
            message,
        })
    }
}

/// Name of one of the two recipes of a [`Project`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum PresetName {
    /// The paper's method; what its text leaves open is taken from the authors' code.
    Paper,
    /// This project's improved method, for any twin.
    #[default]
    Default,
}

impl std::fmt::Display for PresetName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::Default => "default",
        })
    }
}

/// Features, network and settings of an estimator.
#[derive(Debug, Clone)]
pub struct Recipe {
    /// Stage 1: record to features.
    pub features: Arc<dyn FeatureRecipe>,
    /// Stage 2: features to parameters.
    pub architecture: Arc<dyn Architecture>,
    /// All numbers of the method.
    pub settings: Settings,
}

impl Recipe {
    /// Returns the default recipe: the [`Score`] of a twin with equations (AR(5) or ARX(8, 8) of a black box), and [`Deep`].
    pub(super) fn standard(study: &Study) -> Self {
        let features: Arc<dyn FeatureRecipe> = match likelihood_of(study.twin()).is_simulated() {
            false => Arc::new(Score::default()),
            true => regression(study),
        };
        Self {
            features,
            architecture: architecture::<Deep>(),
            settings: Settings::default(),
        }
    }

    /// Checks that the network takes so many features.
    pub(super) fn check_width(&self, features: usize) -> Result<(), String> {
        let (id, most) = (self.architecture.id(), self.architecture.max_features());
        match features <= most {
            true => Ok(()),
            false => Err(format!(
                "{}, network \"{id}\" takes at most {most}; lower their order",
                count(features, "feature")
            )),
        }
    }
}

/// Steps of an estimate in which the presets differ.
#[derive(Debug, Clone, Copy)]
pub(super) struct Steps {
    /// The record is fitted by its likelihood; tests and simulations take the noise that it shows.
    pub fits_noise: bool,
    /// The network's estimate is kept if the gate agrees.
    pub trusts_prior: bool,
    /// A refit that explains the record worse than the network's estimate is refused.
    pub compares: bool,
}

impl Steps {
    /// The steps of a preset.
    pub fn of(preset: PresetName, study: &Study) -> Self {
        match preset {
            PresetName::Paper => Self::PAPER,
            PresetName::Default => Self {
                fits_noise: true,
                trusts_prior: study.trusts_prior(),
                compares: true,
            },
        }
    }
}

/// The features of a twin that shows no equations, and of the paper.
pub(super) fn regression(study: &Study) -> Arc<dyn FeatureRecipe> {
    if study.twin().signals().inputs.is_empty() {
        Arc::new(Ar { order: 5 })
    } else {
        Arc::new(Arx {
            outputs: 8,
            inputs: 8,
        })
    }
}
