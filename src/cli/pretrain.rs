//! `pretrain`: bank and network, into one file.

use super::args::PretrainArguments;
use super::{Context, Failure, output};
use crate::two_stage::{PretrainOptions, pretrain};
use serde_json::json;
use std::process::ExitCode;
use std::time::Instant;

pub(super) fn run(context: &Context<'_>, options: &PretrainArguments) -> Result<ExitCode, Failure> {
    output::check_new(&options.out)?;
    let study = context.study(&options.subject)?;
    let clock = Instant::now();
    let settings = PretrainOptions {
        preset: options.preset.into(),
        bank_size: options.bank_size,
        epochs: options.epochs,
        seed: context.seed,
    };
    let (estimator, history) = pretrain(&study, &settings, context.progress)?;
    estimator.save(&options.out)?;
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
