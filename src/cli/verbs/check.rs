//! `check`: tests a twin before training, or a record before a fit.

use crate::cli::prelude::*;
use crate::cli::remedy::Remedy;
use crate::estimator::PresetName;
use crate::report::check_document;
use crate::twin::conformance::{Finding, Severity, blamed_step, check, check_points, check_step};
use crate::twin::{Noise, SimulationError, Twin};
use std::sync::Arc;

/// Check a twin before training (repeatable, paired noise, finite outputs, identifiable parameters), or whether a record suits it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin check --twin tanks\n  \
        truetwin check --program 'python3 model.py'\n  \
        truetwin check R.csv --twin tanks\n\
        Failures of a twin end with exit code 1; findings about a record end with 0.\n\
        Next: truetwin pretrain with the same twin, or truetwin fit R.csv")]
pub(in crate::cli) struct Check {
    /// Measured record: checks units, sampling, damaged channels, inputs, and which parameters it can tell.
    #[arg(value_name = "R.csv")]
    record: Option<PathBuf>,
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    columns: FileColumns,
}

impl Verb for Check {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        self.columns.check_used(self.record.is_some(), "a record")?;
        let project = context.project(&self.subject)?;
        let study = project.study();
        if let Some(path) = &self.record {
            return self.check_record(context, study, path);
        }
        let passes = |findings: &[Finding]| findings.iter().all(|f| f.severity < Severity::Failure);
        let drive = study
            .drives()?
            .draw(Noise::new(context.seed, "check input", 0))?;
        let stage = Arc::new(context.progress.stage("runs", runs(study.twin())));
        let counter = stage.clone();
        let twin = (study.twin())
            .watched(move || (counter.tick()).map_err(|stop| SimulationError::Fatal(stop.into())));
        let mut findings = check(&twin, &drive, context.seed);
        let centre = twin.parameters().centre();
        if passes(&findings) {
            findings.extend(check_step(&twin, &centre, &drive));
        } else if let Some(blamed) = blamed_step(&twin, &centre, &drive) {
            findings.push(Finding::warning("step", blamed));
        }
        stage.finish();
        context.progress.checkpoint().map_err(Failure::internal)?;
        if passes(&findings) {
            findings.push(project.check_features(PresetName::Default, &drive, context.seed)?);
        }
        if passes(&findings) {
            findings.extend(check_points(study.twin(), &drive));
            findings.extend(study.check_own_runs(&drive, context.seed));
        }
        let passed = passes(&findings);
        let json = json!({
            "schema": "truetwin.check/1", "twin": study.name(), "passed": passed, "findings": findings,
        });
        let text = || check_document(study.name(), &findings).text();
        let done = Provenance::new(context).print_beside(context, json, text)?;
        Ok(if passed { done } else { ExitCode::FAILURE })
    }
}

impl Check {
    /// Checks whether a record suits the twin.
    fn check_record(
        &self,
        context: &Context<'_>,
        study: &Study,
        path: &Path,
    ) -> Result<ExitCode, Failure> {
        let record = self.columns.reader_of_any(study).record(path)?;
        let mut result = study.suitability(&record, context.seed, context.progress)?;
        for finding in &mut result.findings {
            if let Some(remedy) = finding.remedy() {
                finding.message += &format!(" ({remedy})");
            }
        }
        let json = json!({
            "schema": "truetwin.suitability/1", "twin": study.name(), "record": output::name(path), "suits": result.suits(),
            "findings": result.findings, "parameters": result.parameters,
        });
        let text = || check_document(study.name(), &result.findings).text();
        (Provenance::new(context).files("record", [path])).print_beside(context, json, text)
    }
}

/// Estimates the number of runs: corners of the prior, differences for each parameter; a black box's free run is the mean of 32.
fn runs(twin: &Twin) -> usize {
    let d = twin.parameters().len();
    let free = twin.runs_of_a_free_run();
    (1 << d.min(6)) + 2 * d * free + 4
}
