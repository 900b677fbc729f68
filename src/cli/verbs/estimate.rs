//! `estimate`: estimates the parameters behind a record.

use crate::cli::posterior::{self, PosteriorDraws};
use crate::cli::prelude::*;
use crate::estimator::bank::file;
use crate::estimator::{self, EstimateOptions, EstimatorError};
use crate::record::Record;
use crate::report::{Report, overlay_svg, together_document, together_json, trajectories_csv};

/// Estimate the parameters behind a measured record.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin estimate R.csv --estimator tanks.est --validation V.csv --out result\n  \
        truetwin estimate MONDAY.csv TUESDAY.csv --estimator tanks.est\n\
        If the calibrated twin does not explain the record, next: truetwin diagnose R.csv")]
pub(in crate::cli) struct Estimate {
    /// Measured records; of several, each is estimated, and the answers are weighed by their precision.
    #[arg(value_name = "R.csv", required = true)]
    records: Vec<PathBuf>,
    /// Estimator from `truetwin pretrain`.
    #[arg(long, value_name = "EST")]
    estimator: PathBuf,
    /// The estimator's own by default; where the call names one, the estimator must be of that.
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    columns: FileColumns,
    /// Second record of the same system, to score the calibrated twin.
    #[arg(long, value_name = "V.csv")]
    validation: Option<PathBuf>,
    /// Settings of the refinement [default: the estimator's own].
    #[arg(long, value_enum)]
    preset: Option<PresetArgument>,
    /// Refine though the study trusts its prior and the record is consistent with the network's estimate.
    #[arg(long)]
    always_refine: bool,
    /// Take records whose step is not the study's: the twin steps as they do. For features that are scores.
    #[arg(long)]
    step_of_record: bool,
    #[command(flatten)]
    draws: PosteriorDraws,
    /// New folder for estimate.json, the page report.html, overlay.svg, trajectories.csv and, after a refit, the cloud of simulations (cloud.npz); of several records, report-1.html and so on.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Estimate {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let folder = output::asked_folder(&self.out)?;
        let is_named = self.subject.twin.is_some() || self.subject.study.is_some();
        let named = is_named.then(|| context.study(&self.subject)).transpose()?;
        let estimator = context.estimator(&self.estimator, named.as_ref(), &self.subject)?;
        let study = estimator.study();
        let reader = self.columns.reader(study);
        let (records, validation) =
            records::read(reader, &self.records, self.validation.as_deref())?;
        if let Some((validation, path)) = validation.as_ref().zip(self.validation.as_ref()) {
            let checked = estimator.check_record(validation, self.step_of_record);
            checked.in_file(path)?;
        }
        let settings = EstimateOptions {
            seed: context.seed,
            preset: self.preset.map(Into::into),
            always_refine: self.always_refine,
            step_of_record: self.step_of_record,
            validation,
            draws: self.draws.count()?,
        };
        let provenance = || {
            Provenance::new(context)
                .files("record", &self.records)
                .files("estimator", [&self.estimator])
                .files("validation", &self.validation)
        };
        if let [record] = &records[..] {
            let estimate = estimator.estimate_with(record, &settings, context.progress);
            let answer = Answer {
                study,
                record,
                estimate: &estimate.in_file(&self.records[0])?,
            };
            let provenance = provenance();
            let write = || {
                let Some(folder) = folder else { return Ok(()) };
                answer.write(&folder, &provenance)?;
                Ok(folder.finish()?)
            };
            return answer.deliver(context, &provenance, write);
        }
        if settings.draws > 0 {
            return Err(Failure::user(
                "--draws with several records: estimate them one by one, or draw with truetwin fit, which fits them together",
            ));
        }
        let all = estimator
            .estimate_together(&records, &settings, context.progress)
            .map_err(|error| match error {
                EstimatorError::Record { number, error } => {
                    Failure::from(*error).within(&self.records[number - 1])
                }
                other => other.into(),
            })?;
        let names = self.records.iter().map(|path| path.display().to_string());
        let names: Vec<String> = names.collect();
        let provenance = provenance();
        let json = provenance.on(together_json(study, &all, &names));
        let write = || {
            let Some(folder) = folder else { return Ok(()) };
            folder.write("estimate.json", format!("{json:#}"))?;
            for (number, (record, estimate)) in (1..).zip(records.iter().zip(&all.records)) {
                let answer = Answer {
                    study,
                    record,
                    estimate,
                };
                answer.write_pictures(&folder, &provenance, &format!("-{number}"))?;
            }
            Ok(folder.finish()?)
        };
        let text = || together_document(study, &all, &names).text();
        provenance.deliver(context, &json, write, text)
    }
}

/// An estimate, its record, and its study.
pub(super) struct Answer<'a> {
    pub study: &'a Study,
    pub record: &'a Record,
    pub estimate: &'a estimator::Estimate,
}

impl Answer<'_> {
    /// Writes the files and prints the estimate.
    pub fn deliver(
        &self,
        context: &Context<'_>,
        provenance: &Provenance,
        write: impl FnOnce() -> Result<(), Failure>,
    ) -> Result<ExitCode, Failure> {
        let json = provenance.on(self.estimate.json(self.study));
        provenance.deliver(context, &json, write, || self.estimate.text(self.study))
    }

    /// Writes `estimate.json`, `report.html`, `overlay.svg`, `trajectories.csv`, `cloud.npz`.
    pub fn write(&self, folder: &NewFolder, provenance: &Provenance) -> Result<(), Failure> {
        let json = provenance.on(self.estimate.json(self.study));
        folder.write("estimate.json", format!("{json:#}"))?;
        if let Some(refit) = self.estimate.refit() {
            let bytes = file::npz(&refit.cloud).map_err(Failure::internal)?;
            folder.write("cloud.npz", bytes)?;
        }
        if let Some(draws) = &self.estimate.posterior {
            posterior::write(folder, self.study, draws)?;
        }
        self.write_pictures(folder, provenance, "")
    }

    /// Writes `report.html`, `overlay.svg` and `trajectories.csv`, with `part` before the dot.
    fn write_pictures(
        &self,
        folder: &NewFolder,
        provenance: &Provenance,
        part: &str,
    ) -> Result<(), Failure> {
        let Self {
            study,
            record,
            estimate,
        } = self;
        let page = provenance.page(estimate.document(study, Some(record)));
        folder.write(&format!("report{part}.html"), page)?;
        // A free run that diverged cannot be drawn; the text reports it.
        if let Some(after) = &estimate.tracking {
            let before = (estimate.refit()).and_then(|refit| refit.tracking_initial.as_ref());
            let before = before.map(|tracking| &tracking.outputs);
            let overlay = overlay_svg(study, record, before, Some(&after.outputs));
            folder.write(&format!("overlay{part}.svg"), overlay)?;
            let rows = trajectories_csv(record, before, &after.outputs);
            folder.write(&format!("trajectories{part}.csv"), rows)?;
        }
        Ok(())
    }
}
