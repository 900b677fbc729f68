//! `pretrain`: simulates a bank and trains the network.

use crate::cli::options::seconds;
use crate::cli::prelude::*;
use crate::cli::shell_word::{quoted, shown};
use crate::estimator::bank::{Bank, file};
use crate::estimator::shards::{BankPlan, ShardedBank};
use crate::estimator::{EstimatorError, PretrainOptions, Pretraining, Project};
use crate::setting::count;
use crate::storage::work::checksum;
use std::time::{Duration, Instant};

/// Simulate a bank from the prior, train the network, write one estimator file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin pretrain --twin tanks --out tanks.est\n  \
        truetwin pretrain --study S.toml --bank bank --out mine.est\n\
        After a stop, rerun the same command to resume: EST.part keeps bank and training until EST is complete.\n\
        Next: truetwin estimate R.csv --estimator tanks.est")]
pub(in crate::cli) struct Pretrain {
    #[command(flatten)]
    subject: Subject,
    /// Output file of the estimator.
    #[arg(long, value_name = "EST")]
    out: PathBuf,
    /// Number of simulations [default: the preset's].
    #[arg(long, value_name = "M")]
    bank_size: Option<usize>,
    /// Existing bank: folder of `truetwin bank`, or .npz or .csv file with theta and features.
    #[arg(long, value_name = "BANK", conflicts_with = "bank_size")]
    bank: Option<PathBuf>,
    /// Passes over the bank [default: the preset's].
    #[arg(long)]
    epochs: Option<usize>,
    /// Recipe of features, network and refinement.
    #[arg(long, value_enum, default_value = "default")]
    preset: PresetArgument,
    /// Time between checkpoints of the training; 0: after each block of the bank.
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = seconds)]
    checkpoint: Duration,
}

impl Verb for Pretrain {
    fn kept(&self) -> Option<PathBuf> {
        Some(Pretraining::work_folder(&self.out))
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        output::check_file(&self.out)?;
        let project = context.project(&self.subject)?;
        let study = project.study();
        let clock = Instant::now();
        let settings = PretrainOptions {
            preset: self.preset.into(),
            bank_size: self.bank_size,
            epochs: self.epochs,
            seed: context.seed,
        };
        let given = self.bank.as_ref();
        let pretraining = Pretraining {
            bank: given
                .map(|path| bank(&project, path, &settings))
                .transpose()?,
            every: self.checkpoint,
            ..Pretraining::new(&project, settings)
        };
        let written = pretraining.write(&self.out, context.progress);
        let (estimator, history) = written.map_err(|error| match (error, given) {
            (EstimatorError::Bank(problem), Some(path)) => EstimatorError::file(path, problem),
            (error, _) => error,
        })?;
        let seconds = clock.elapsed().as_secs_f64();
        let bank = estimator.settings().bank_size;
        let loss = history.training.last().copied().unwrap_or(f64::NAN);
        let json = json!({
            "schema": "truetwin.pretrain/1", "twin": study.name(), "estimator": output::name(&self.out),
            "preset": estimator.preset(), "bank_size": bank, "features": estimator.network().inputs(),
            "epochs": history.epochs_run, "loss": loss, "seed": context.seed, "seconds": seconds,
        });
        Provenance::new(context).print_beside(context, json, || {
            format!(
                "{}: estimator of {} from {}, {}, {}, loss {loss:.4}, {seconds:.1} s\n\
                 next: truetwin estimate RECORD.csv --estimator {}",
                shown(&self.out),
                study.twin().parameters().names().join(", "),
                count(bank, "simulation"),
                count(estimator.network().inputs(), "feature"),
                count(history.epochs_run, "epoch"),
                quoted(self.out.as_os_str()),
            )
        })
    }
}

/// A bank that is there, and its checksum.
fn bank(
    project: &Project,
    path: &Path,
    settings: &PretrainOptions,
) -> Result<(Box<dyn Bank>, String), Failure> {
    if file::is_named(path) {
        let bank = file::read(path, &project.study().twin().parameters())?;
        return Ok((Box::new(bank), checksum(path)?));
    }
    let bank = ShardedBank::open(path)?;
    let plan = BankPlan {
        project: project.clone(),
        preset: settings.preset,
        size: bank.size(),
        seed: bank.seed(),
    };
    plan.check(&bank)?;
    let checksum = bank.checksum();
    Ok((Box::new(bank), checksum))
}
