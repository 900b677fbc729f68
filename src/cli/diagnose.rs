//! `diagnose`: what the twin lacks.

use super::args::Subject;
use super::{Context, Failure, Verb, output};
use crate::diagnose::{DiagnoseSettings, GivenRecord, diagnose};
use crate::effect::EffectPattern;
use crate::estimator::Estimator;
use crate::record::{Record, drive_csv_text, read_record};
use crate::report::{NEXT_INPUT, gap_html, gap_json, gap_text};
use crate::study::Study;
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Learn what the twin lacks: whether parameters can explain the record, where not, which effect, how far it closes the gap.
///
/// Needs no training. DIR holds report.json, report.html and, where another record would tell rivals apart,
/// next-input.csv. Of a twin that shows no equations, only effects of sensors and actuators can be named.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin diagnose R.csv --twin tanks --validation V.csv --out gap\n  \
        truetwin diagnose R1.csv R2.csv --study S.toml --without sensor-bias,state-ceiling@h1 --out gap\n\
        Next: open gap/report.html; docs/diagnosing-a-gap.md says how to read it")]
pub(super) struct Diagnose {
    /// Measured records of one system; they share θ, but for unknown starts.
    #[arg(value_name = "R.csv", required = true)]
    records: Vec<PathBuf>,
    #[command(flatten)]
    subject: Subject,
    /// An estimator of the same twin, whose first estimate is a start of the fit.
    #[arg(long, value_name = "EST")]
    estimator: Option<PathBuf>,
    /// A record that no fit sees: sharper test and ranking, and the share of the gap that closes.
    #[arg(long, value_name = "V.csv")]
    validation: Option<PathBuf>,
    /// Effects that are not to be named.
    #[arg(long, value_name = "ID[@TARGET],..", value_delimiter = ',')]
    without: Vec<EffectPattern>,
    /// A new folder for report.json, report.html and next-input.csv.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Diagnose {
    fn subject(&self) -> Option<&Subject> {
        Some(&self.subject)
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        if let Some(out) = &self.out {
            output::check_new(out)?;
        }
        let study = context.study(&self.subject)?;
        let records: Vec<Record> = (self.records.iter())
            .map(|path| read_record(path))
            .collect::<Result<_, _>>()?;
        let validation = self.validation.as_deref().map(read_record).transpose()?;
        let initial = match &self.estimator {
            Some(path) => Some(first_estimate(context, &study, path, &records[0])?),
            None => None,
        };
        let settings = DiagnoseSettings {
            seed: context.seed,
            without: self.without.clone(),
            initial,
            ..DiagnoseSettings::default()
        };
        let found = diagnose(
            &study,
            &records,
            validation.as_ref(),
            &settings,
            context.progress,
        )
        .map_err(|error| {
            let path = match error.record() {
                Some(GivenRecord::Validation) => self.validation.as_ref(),
                Some(GivenRecord::Measured(index)) => self.records.get(index),
                None => None,
            };
            let failure = Failure::from(error);
            match path {
                Some(path) => failure.within(path),
                None => failure,
            }
        })?;
        let json = gap_json(&found);
        if let Some(out) = &self.out {
            let folder = output::NewFolder::new(out)?;
            let text = serde_json::to_string_pretty(&json).map_err(Failure::internal)?;
            folder.write("report.json", &text)?;
            folder.write("report.html", &gap_html(&study, &found))?;
            if let Some(next) = &found.which.next_input {
                folder.write(NEXT_INPUT, &drive_csv_text(&next.drive))?;
            }
            folder.finish()?;
        }
        if context.json {
            output::print_json(&json)?;
        } else {
            output::print(&gap_text(&found))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// What a pretrained network reads off the first record.
fn first_estimate(
    context: &Context<'_>,
    study: &Study,
    path: &Path,
    record: &Record,
) -> Result<Vec<f64>, Failure> {
    let estimator = Estimator::load(path, context.projects)?;
    let names = |study: &Study| -> Vec<String> {
        let space = study.twin().parameters();
        space.names().into_iter().map(Into::into).collect()
    };
    let (theirs, ours) = (names(estimator.study()), names(study));
    if theirs != ours {
        return Err(Failure::user(format!(
            "{}: the estimator is of {}, the call of {}; pretrain one for this twin and study",
            path.display(),
            theirs.join(", "),
            ours.join(", ")
        )));
    }
    let checked = estimator.study().check_record(record);
    checked.map_err(Failure::from)?;
    let features = estimator.observe(record)?;
    Ok(estimator.predict_one(&features)?)
}
