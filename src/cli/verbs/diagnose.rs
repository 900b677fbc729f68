//! `diagnose`: tests whether the twin explains the record, and finds what it lacks.

use crate::cli::failure::STOPPED;
use crate::cli::prelude::*;
use crate::cli::stop;
use crate::diagnose::{DiagnoseSettings, diagnose};
use crate::effect::EffectPattern;
use crate::estimator::Estimator;
use crate::record::{Record, drive_csv_text};
use crate::report::{NEXT_INPUT, Report};
use crate::setting::number;
use crate::study::StudyError;

/// Diagnose what the twin lacks: can parameters explain the record; if not, where, which effect, how much of the gap closes.
///
/// Needs no training. DIR holds report.json, report.html and, if another record can separate rivals, next-input.csv.
/// For a black-box twin, only sensor and actuator effects can be named.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin diagnose R.csv --twin tanks --validation V.csv --out gap\n  \
        truetwin diagnose R1.csv R2.csv --study S.toml --without sensor-bias,state-ceiling@h1 --out gap\n\
        Next: open gap/report.html; docs/diagnosing-a-gap.md says how to read it")]
pub(in crate::cli) struct Diagnose {
    /// Measured records of one system; they share all parameters except unknown starts.
    #[arg(value_name = "R.csv", required = true)]
    records: Vec<PathBuf>,
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    columns: FileColumns,
    /// Estimator of the same twin; its estimate is one starting point of the fit.
    #[arg(long, value_name = "EST")]
    estimator: Option<PathBuf>,
    /// Record that no fit uses: the share of the gap closed is measured on it.
    #[arg(long, value_name = "V.csv")]
    validation: Option<PathBuf>,
    /// Simulate N records of the fitted twin and diagnose them alike, for a p-value.
    #[arg(long, value_name = "N", default_value_t = 0)]
    calibrate: usize,
    /// Quick look: effects one at a time, from few starts; no pairs, smallest visible effects or next input.
    #[arg(long)]
    quick: bool,
    /// Effects to exclude.
    #[arg(long, value_name = "ID[@TARGET],..", value_delimiter = ',')]
    without: Vec<EffectPattern>,
    /// Take records whose step is not the study's: the twin then steps as they do, and declared process noise is scaled to that step.
    #[arg(long)]
    step_of_record: bool,
    /// New folder for report.json, report.html and next-input.csv.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Diagnose {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let folder = output::asked_folder(&self.out)?;
        let study = context.study(&self.subject)?;
        let reader = self.columns.reader(&study);
        let (records, validation) =
            records::read(reader, &self.records, self.validation.as_deref())?;
        self.check_step(&study, &records[0])?;
        let initial = (self.estimator.as_ref())
            .map(|path| first_estimate(context, &study, path, &records[0]))
            .transpose()?;
        stop::let_end();
        let settings = DiagnoseSettings {
            seed: context.seed,
            calibrate: self.calibrate,
            quick: self.quick,
            give_partial: true,
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
            let validation = self.validation.as_ref();
            Failure::of_records(error, Failure::diagnosis, &self.records, validation)
        })?;
        let provenance = Provenance::new(context)
            .files("record", &self.records)
            .files("validation", &self.validation)
            .files("estimator", &self.estimator);
        let json = provenance.on(found.json(&study));
        let write = || {
            let Some(folder) = folder else { return Ok(()) };
            folder.write("report.json", format!("{json:#}"))?;
            folder.write("report.html", provenance.page(found.document(&study)))?;
            if let Some(next) = &found.cause.next_input {
                folder.write(
                    NEXT_INPUT,
                    drive_csv_text(&next.drive, &study.twin().signals()),
                )?;
            }
            Ok(folder.finish()?)
        };
        let done = provenance.deliver(context, &json, write, || found.text(&study))?;
        Ok(match found.interrupted {
            true => ExitCode::from(STOPPED),
            false => done,
        })
    }
}

impl Diagnose {
    /// Checks that the first record has the study's step, as all others then must: equations that hold for one step may lack something with
    /// another.
    fn check_step(&self, study: &Study, record: &Record) -> Result<(), Failure> {
        let Some(plan) = study.plan() else {
            return Ok(());
        };
        match plan.check_step(record) {
            Err(StudyError::OtherStep { given, expected }) if self.step_of_record => {
                output::say(&format!(
                    "the twin steps {} s, as the record does, in place of the study's {} s; its process noise is scaled to that",
                    number(given),
                    number(expected)
                ));
                Ok(())
            }
            checked => checked
                .map_err(Failure::diagnosis)
                .in_file(&self.records[0]),
        }
    }
}

/// Returns the network's estimate for the first record.
fn first_estimate(
    context: &Context<'_>,
    study: &Study,
    path: &Path,
    record: &Record,
) -> Result<Vec<f64>, Failure> {
    let estimator = Estimator::load(path, context.projects)?;
    let names = |study: &Study| study.twin().parameters().names().join(", ");
    let (theirs, ours) = (names(estimator.study()), names(study));
    if theirs != ours {
        return Err(Failure::user(format!(
            "{}: the estimator has parameters {theirs}, the study has {ours}; pretrain one for this twin and study",
            path.display(),
        )));
    }
    estimator.study().check_record(record)?;
    let features = estimator.observe(record)?;
    Ok(estimator.predict_one(&features)?)
}
