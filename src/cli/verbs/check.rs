//! `check`: tests a twin before training.

use crate::cli::args::Subject;
use crate::cli::context::{Context, Verb};
use crate::cli::failure::Failure;
use crate::cli::output;
use crate::estimator::PresetName;
use crate::twin::conformance::{Severity, check, check_step};
use crate::twin::{Noise, SimulationError, Twin};
use clap::Args;
use serde_json::json;
use std::process::ExitCode;
use std::sync::Arc;

/// Check a twin before training: repeatable, paired noise, finite outputs, identifiable parameters.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin check --twin tanks\n  \
        truetwin check --program 'python3 model.py'\n\
        Failures end with exit code 1. Next: truetwin pretrain with the same twin")]
pub(in crate::cli) struct Check {
    #[command(flatten)]
    subject: Subject,
}

impl Verb for Check {
    fn subject(&self) -> Option<&Subject> {
        Some(&self.subject)
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let project = context.project(&self.subject)?;
        let study = project.study();
        let drive = study
            .drives()?
            .draw(Noise::new(context.seed, "check input", 0))?;
        let stage = Arc::new(context.progress.stage("runs", runs(study.twin())));
        let counter = stage.clone();
        let twin = (study.twin())
            .watched(move || (counter.tick()).map_err(|stop| SimulationError::Fatal(stop.into())));
        let mut findings = check(&twin, &drive, context.seed);
        if findings.iter().all(|f| f.severity < Severity::Failure) {
            findings.extend(check_step(&twin, &twin.parameters().centre(), &drive));
        }
        stage.finish();
        context.progress.checkpoint().map_err(Failure::internal)?;
        if findings.iter().all(|f| f.severity < Severity::Failure) {
            findings.push(project.check_features(PresetName::Default, &drive, context.seed)?);
        }
        let word = |severity| match severity {
            Severity::Pass => "pass",
            Severity::Warning => "warning",
            Severity::Failure => "failure",
        };
        let failed = findings.iter().any(|f| f.severity == Severity::Failure);
        if context.json {
            output::print_json(&json!({
                "schema": "truetwin.check/1", "twin": study.name(), "passed": !failed, "findings": findings,
            }))?;
        } else {
            let lines: Vec<String> = (findings.iter())
                .map(|f| format!("{:<8} {:<13} {}", word(f.severity), f.check, f.message))
                .collect();
            output::print(&lines.join("\n"))?;
        }
        Ok(if failed {
            ExitCode::FAILURE
        } else {
            ExitCode::SUCCESS
        })
    }
}

/// Estimates the number of runs: corners of the prior, differences for each parameter; a black box's free run is the mean
/// of 32.
fn runs(twin: &Twin) -> usize {
    let d = twin.parameters().len();
    let free = twin.runs_of_a_free_run();
    (1 << d.min(6)) + 2 * d * free + 4
}
