//! Every method on many simulated records.

use super::scenario::ScenarioDraws;
use super::{Benchmark, BenchmarkRun, Scenario};
use crate::estimator::{Estimator, PretrainOptions, Recipe};
use crate::evaluate::{EvaluateError, MOST_RECORDS};
use crate::progress::Progress;
use crate::setting::SettingError;
use crate::storage::StorageError;
use crate::storage::work::{Manifest, Piece, Pieces, Share, WorkFolder, checksum};
use crate::study::Study;
use serde_json::json;
use std::path::Path;

/// Folder of kept runs.
pub(super) const RUNS: &str = "runs";

/// Layout of the folder; raised when it changes.
const LAYOUT: u32 = 4;

/// Source of a study's estimator.
#[derive(Debug, Clone, Copy)]
pub enum Origin<'a> {
    /// Trained for it, and kept in the folder.
    Trained(&'a Recipe, &'a PretrainOptions),
    /// From a file.
    File(&'a Path),
}

/// Plan of a study over many simulated records.
#[derive(Debug, Clone)]
pub struct MonteCarlo {
    /// Published knowledge about the twin: [`Benchmark::of`] for the paper's, the default for any other.
    pub benchmark: Benchmark,
    /// Source of θ.
    pub scenario: Scenario,
    /// Number of records.
    pub runs: usize,
    /// Seed of records and estimates.
    pub seed: u64,
}

impl MonteCarlo {
    /// Checks that the study has this scenario; worth asking before an estimator is trained.
    pub fn check(&self, study: &Study) -> Result<(), EvaluateError> {
        SettingError::unless_at_most("runs", self.runs, MOST_RECORDS)?;
        self.draws(study).map(|_| ())
    }

    pub(super) fn draws<'a>(&self, study: &'a Study) -> Result<ScenarioDraws<'a>, EvaluateError> {
        ScenarioDraws::new(study, &self.benchmark, self.scenario)
    }

    /// Runs every stage of `estimator`, and the baselines, on simulated records, in order. Records are independent:
    /// run i depends on (seed, i) alone, and on no number of threads.
    ///
    /// With a `folder`, each run is kept there as soon as it is done, and what is there already is not run again.
    ///
    /// Records run in parallel, each on its share of the current threads.
    pub(crate) fn run_in(
        &self,
        estimator: &Estimator,
        folder: Option<&WorkFolder>,
        progress: &Progress,
    ) -> Result<Vec<BenchmarkRun>, EvaluateError> {
        let runs = self.run_share(estimator, folder, Share::WHOLE, progress)?;
        if runs.iter().all(|run| run.failure.is_some()) {
            let failure = runs.into_iter().find_map(|run| run.failure);
            return Err(EvaluateError::Hopeless(failure.unwrap_or_default()));
        }
        Ok(runs)
    }

    /// As `run_in`, but only the runs of a share; returns these and all that the folder had before.
    pub(crate) fn run_share(
        &self,
        estimator: &Estimator,
        folder: Option<&WorkFolder>,
        share: Share,
        progress: &Progress,
    ) -> Result<Vec<BenchmarkRun>, EvaluateError> {
        let study = estimator.study();
        let draws = self.draws(study)?;
        let parameters = study.twin().parameters().len();
        let pieces = Pieces {
            folder,
            part: RUNS,
            count: self.runs,
            share,
        };
        pieces.all(
            &progress.stage("records", self.runs),
            |run: &BenchmarkRun| match run.fits(parameters) {
                true => Ok(()),
                false => Err("its methods or parameters are those of another study"),
            },
            |run| {
                let record = draws.simulated(self.seed, run)?;
                BenchmarkRun::new(estimator, run, &record, progress)
            },
        )
    }

    /// A folder for the runs of this plan over `study`, a new one or the one of the same call: `runs/0000.json`, … hold a
    /// [`BenchmarkRun`](super::Run) each; `estimator.est` is for an estimator that is trained for the study.
    pub(crate) fn folder(
        &self,
        path: &Path,
        study: &Study,
        origin: Origin<'_>,
    ) -> Result<WorkFolder, StorageError> {
        let manifest = self.manifest(study, origin)?;
        WorkFolder::open(path, &manifest, &[RUNS], |_| Ok(None))
    }

    /// Removes a folder that no run is in.
    pub(crate) fn remove_bare(folder: &WorkFolder) {
        folder.remove_bare(RUNS);
    }

    /// Everything that the runs depend on; files by their checksums.
    fn manifest(&self, study: &Study, origin: Origin<'_>) -> Result<Manifest, StorageError> {
        let manifest = study
            .manifest("reproduce", LAYOUT)?
            .with("scenario", self.scenario.number())
            .with("runs", self.runs)
            .with("seed", self.seed);
        Ok(match origin {
            Origin::File(path) => manifest.with("estimator", checksum(path)?),
            Origin::Trained(recipe, options) => manifest
                .with("preset", options.preset.to_string())
                .with("bank size", options.bank_size)
                .with("epochs", options.epochs)
                .with("training seed", options.seed)
                .with("network", recipe.architecture.id())
                .with("features", json!(recipe.features))
                .with("preset settings", json!(recipe.settings)),
        })
    }
}

impl Piece for BenchmarkRun {
    fn number(&self) -> usize {
        self.run
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::{PresetName, PretrainOptions, pretrain};
    use crate::evaluate::paper::{Origin, reference_projects, score};
    use crate::progress::Listener;
    use crate::record::{Drive, Signal};
    use crate::storage::StorageError;
    use crate::study::RecordPlan;
    use crate::twin::{DigitalTwin, Noise, Parameter, ParameterSpace, SimulationError};
    use std::fs;
    use std::path::Path;
    use std::sync::{Arc, OnceLock};

    const TRAINING: PretrainOptions = PretrainOptions {
        preset: PresetName::Paper,
        bank_size: Some(200),
        epochs: Some(2),
        seed: 1,
    };

    fn oscillator() -> &'static Estimator {
        static MADE: OnceLock<Estimator> = OnceLock::new();
        MADE.get_or_init(|| {
            let project = &reference_projects().unwrap()[0];
            pretrain(project, &TRAINING, &Progress::silent()).unwrap().0
        })
    }

    fn plan(scenario: Scenario, runs: usize) -> MonteCarlo {
        MonteCarlo {
            benchmark: Benchmark::of(oscillator().study()),
            scenario,
            runs,
            seed: 3,
        }
    }

    fn open(path: &Path, plan: &MonteCarlo) -> Result<WorkFolder, StorageError> {
        let project = &reference_projects().unwrap()[0];
        let origin = Origin::Trained(project.recipe(TRAINING.preset), &TRAINING);
        plan.folder(path, oscillator().study(), origin)
    }

    /// All but the times.
    fn answers(runs: Vec<BenchmarkRun>) -> Vec<BenchmarkRun> {
        let timeless = |mut run: BenchmarkRun| {
            run.answers.iter_mut().for_each(|answer| answer.ms = 0.0);
            run
        };
        runs.into_iter().map(timeless).collect()
    }

    #[test]
    fn shares_make_the_whole_and_each_keeps_to_its_own() {
        let place = tempfile::tempdir().unwrap();
        let plan = plan(Scenario::First, 3);
        let folder = open(&place.path().join("study"), &plan).unwrap();
        let share = |text: &str| {
            let share = text.parse().unwrap();
            let runs = plan.run_share(oscillator(), Some(&folder), share, &Progress::silent());
            runs.unwrap().iter().map(|run| run.run).collect::<Vec<_>>()
        };
        assert_eq!(share("2/2"), [0, 2]);
        assert_eq!(share("1/2"), [0, 1, 2]);
        let runs = plan.run_in(oscillator(), Some(&folder), &Progress::silent());
        let alone = plan.run_in(oscillator(), None, &Progress::silent());
        assert_eq!(answers(runs.unwrap()), answers(alone.unwrap()));
        fs::copy(folder.file("runs/0000.json"), folder.file("runs/0001.json")).unwrap();
        let error = plan.run_in(oscillator(), Some(&folder), &Progress::silent());
        let error = error.unwrap_err().to_string();
        assert!(error.contains("holds another number"), "{error}");
    }

    struct Stopped;
    impl Listener for Stopped {
        fn advanced(&self, _: &str, _: u64, _: u64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_stop_is_heard_inside_a_run_and_leaves_no_run_behind() {
        let place = tempfile::tempdir().unwrap();
        let plan = plan(Scenario::First, 2);
        let folder = open(&place.path().join("study"), &plan).unwrap();
        let progress = Progress::new(Arc::new(Stopped));
        let error = plan.run_in(oscillator(), Some(&folder), &progress);
        assert!(matches!(error, Err(EvaluateError::Cancelled(_))));
        assert_eq!(fs::read_dir(folder.file("runs")).unwrap().count(), 0);
    }

    /// A twin without equations that diverges in the upper half of its bounds.
    struct Amplifier;
    impl DigitalTwin for Amplifier {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new([Parameter::new("gain", "-", 1.0, 2.0).within(0.0, 6.0)])
        }
        fn simulate(
            &self,
            theta: &[f64],
            drive: &Drive,
            noise: Noise,
        ) -> Result<Signal, SimulationError> {
            let mut v = noise.source("sensor");
            match theta[0] > 3.0 {
                true => Err(SimulationError::Diverged { at: 0.0 }),
                false => Ok(drive.inputs().mapv(|u| theta[0] * u + 0.1 * v.normal())),
            }
        }
    }

    #[test]
    fn a_black_box_is_scored_and_drawn_again_where_it_diverges() {
        let levels = RecordPlan::levels(0.1, 80, -1.0, 1.0, 5);
        let study = Study::new("amplifier", Amplifier, levels).unwrap();
        let (estimator, _) = pretrain(&study, &TRAINING, &Progress::silent()).unwrap();
        let plan = MonteCarlo {
            benchmark: Benchmark::of(&study),
            ..plan(Scenario::Uniform, 6)
        };
        let runs = plan.run_in(&estimator, None, &Progress::silent()).unwrap();
        assert!(runs.iter().all(|run| run.truth[0] <= 3.0), "{runs:?}");
        let scores = score(&study, &plan, &runs);
        let failed: Vec<usize> = scores.methods.iter().map(|s| s.failed).collect();
        assert_eq!(failed[7..], [6; 3], "a filter needs equations");
        assert_eq!(failed[6], 6, "the bad start, the upper bound, diverges");
        assert!(failed[..6].iter().all(|n| *n < 6), "{failed:?}");
        assert!(scores.methods[8].mse.is_nan() && scores.methods[8].milliseconds.is_nan());
        let point = MonteCarlo {
            scenario: Scenario::Second,
            ..plan
        };
        assert!(matches!(
            point.check(&study),
            Err(EvaluateError::NoPoint(_))
        ));
    }
}
