//! `pretrain`: bank and network, into one file.

use super::args::PretrainArguments;
use super::{Context, Failure, output};
use crate::bank::{Bank, file};
use crate::shards::{BankPlan, ShardedBank};
use crate::study::Study;
use crate::two_stage::{GivenBank, PretrainOptions, Pretraining};
use crate::work::checksum;
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

pub(super) fn run(context: &Context<'_>, options: &PretrainArguments) -> Result<ExitCode, Failure> {
    output::check_folder(&options.out)?;
    let study = context.study(&options.subject)?;
    let clock = Instant::now();
    let settings = PretrainOptions {
        preset: options.preset.into(),
        bank_size: options.bank_size,
        epochs: options.epochs,
        seed: context.seed,
    };
    let pretraining = Pretraining::new(&study, settings).every(options.checkpoint);
    let (estimator, history) = match &options.bank {
        None => pretraining.write(&options.out, context.progress)?,
        Some(path) => {
            let (bank, checksum) = given(&study, path, &settings)?;
            let bank = GivenBank {
                bank: bank.as_ref(),
                checksum,
            };
            pretraining.on(bank).write(&options.out, context.progress)?
        }
    };
    let seconds = clock.elapsed().as_secs_f64();
    let bank = estimator.settings().bank_size;
    let loss = history.training.last().copied().unwrap_or(f64::NAN);
    if context.json {
        output::print_json(&json!({
            "schema": "truetwin.pretrain/1",
            "twin": study.name(),
            "estimator": options.out,
            "preset": estimator.preset(),
            "bank_size": bank,
            "features": estimator.network().inputs(),
            "epochs": history.epochs_run,
            "loss": if loss.is_finite() { Some(loss) } else { None },
            "seed": context.seed,
            "seconds": seconds,
        }))?;
    } else {
        output::print(&format!(
            "{}: estimator of {} from {bank} simulations, {} features, {} epochs, loss {loss:.4}, {seconds:.1} s\n\
             next: truetwin estimate RECORD.csv --estimator {}",
            options.out.display(),
            study.twin().parameters().names().join(", "),
            estimator.network().inputs(),
            history.epochs_run,
            options.out.display(),
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A bank that is there, and its checksum.
fn given(
    study: &Study,
    path: &Path,
    settings: &PretrainOptions,
) -> Result<(Box<dyn Bank>, String), Failure> {
    if file::is_named(path) {
        let bank = file::read(path, &study.twin().parameters().names())?;
        return Ok((Box::new(bank), checksum(path)?));
    }
    let bank = ShardedBank::open(path)?;
    let plan = BankPlan {
        study,
        preset: settings.preset,
        size: bank.size(),
        seed: bank.seed(),
    };
    plan.check(&bank)?;
    let checksum = bank.checksum();
    Ok((Box::new(bank), checksum))
}
