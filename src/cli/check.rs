//! `check`: what is wrong with a twin.

use super::args::Subject;
use super::{Context, Failure, Verb, output};
use crate::study::PresetName;
use crate::twin::Noise;
use crate::twin::conformance::{Severity, check};
use clap::Args;
use serde_json::{Value, json};
use std::process::ExitCode;

/// Check a twin before any training: repeatable, paired noise, finite, identifiable.
#[derive(Debug, Args)]
pub(super) struct Check {
    #[command(flatten)]
    subject: Subject,
}

impl Verb for Check {
    fn subject(&self) -> Option<&Subject> {
        Some(&self.subject)
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let study = context.study(&self.subject)?;
        let drive = study
            .drives()?
            .draw(Noise::new(context.seed, "check input", 0))?;
        let mut findings = check(study.twin().as_ref(), &drive, context.seed);
        if findings.iter().all(|f| f.severity < Severity::Failure) {
            findings.push(study.check_features(PresetName::Default, &drive, context.seed)?);
        }
        let word = |severity| match severity {
            Severity::Pass => "pass",
            Severity::Warning => "warning",
            Severity::Failure => "failure",
        };
        let failed = findings.iter().any(|f| f.severity == Severity::Failure);
        if context.json {
            let findings: Vec<Value> = (findings.iter())
                .map(
                    |f| json!({ "check": f.check, "severity": word(f.severity), "message": f.message }),
                )
                .collect();
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
