//! `compare`: several studies, fitted to the same records and scored on another.

use crate::cli::prelude::*;
use crate::fit::FitSettings;
use crate::report::{ComparedStudy, compare_document, compare_json, compare_svg};

/// Share of a record that is fitted where no other is given.
const FITTED: f64 = 2.0 / 3.0;

/// Compare studies of one system: each is fitted to the records and scored on the validation record.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin compare plain.toml friction.toml lag.toml --record R.csv --validation V.csv --out compared\n\
        Next: truetwin diagnose V.csv --study BEST.toml, for what the best of them lacks")]
pub(in crate::cli) struct Compare {
    /// Study files; the first is the one that others are compared with.
    #[arg(value_name = "S.toml", required = true)]
    studies: Vec<PathBuf>,
    /// Records that all studies are fitted to [default: the first two thirds of the validation record].
    #[arg(long = "record", value_name = "R.csv")]
    records: Vec<PathBuf>,
    /// Record that they are scored on.
    #[arg(long, value_name = "V.csv")]
    validation: PathBuf,
    #[command(flatten)]
    columns: FileColumns,
    /// New folder for compare.json and overlay.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Compare {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let folder = output::asked_folder(&self.out)?;
        let mut compared = vec![];
        let mut shown = None;
        for (path, study) in self.studies.iter().zip(self.configured(context)?) {
            let reader = self.columns.reader(&study);
            let (mut measured, validation) =
                records::read(reader, &self.records, Some(&self.validation))?;
            let all = (self.records.iter().zip(&measured))
                .chain([&self.validation].into_iter().zip(&validation));
            records::warn_of_times(&study, all, context.seed);
            let Some(validation) = validation else {
                continue;
            };
            if measured.is_empty() {
                let samples = (FITTED * validation.samples() as f64) as usize;
                measured.extend(validation.first_part(samples));
            }
            let settings = FitSettings {
                seed: context.seed,
                ..FitSettings::default()
            };
            let fit = study.fit_with(&measured, &settings, context.progress);
            let fit = fit.in_file(path)?;
            let score = study.score(&fit, &validation).in_file(path)?;
            let name = path.file_stem().unwrap_or_default();
            let name = name.to_string_lossy().into();
            compared.push(ComparedStudy {
                name,
                study,
                fit,
                score,
            });
            shown = Some(validation);
        }
        let provenance = Provenance::new(context)
            .files("validation", [&self.validation])
            .files("study", &self.studies)
            .files("record", &self.records);
        let json = provenance.on(compare_json(&compared));
        let write = || {
            let Some((folder, record)) = folder.zip(shown.as_ref()) else {
                return Ok(());
            };
            folder.write("compare.json", format!("{json:#}"))?;
            folder.write("overlay.svg", compare_svg(&compared, record))?;
            Ok(folder.finish()?)
        };
        let what = match self.records.is_empty() {
            true => "on the whole of the record whose first two thirds were fitted",
            false => "on the validation record",
        };
        let text = || compare_document(&compared, what).text();
        provenance.deliver(context, &json, write, text)
    }
}

impl Compare {
    /// Returns the studies; refuses a program or FMU that none of them takes.
    fn configured(&self, context: &Context<'_>) -> Result<Vec<Study>, Failure> {
        let study = |path: &PathBuf| Ok(context.configured(path)?.study().clone());
        let studies: Vec<Study> = self
            .studies
            .iter()
            .map(study)
            .collect::<Result<_, Failure>>()?;
        let external = context.external.map(|project| project.study().name());
        match external.filter(|name| studies.iter().all(|study| study.name() != *name)) {
            Some(name) => Err(Failure::user(format!(
                "none of the studies is of the twin {name}, which --program or --fmu starts; remove it, or add a study of that twin"
            ))),
            None => Ok(studies),
        }
    }
}
