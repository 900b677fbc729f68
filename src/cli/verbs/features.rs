//! `features`: compresses records to features.

use crate::cli::prelude::*;
use crate::cli::shell_word::shown;
use crate::estimator::bank::file;
use crate::setting::count;
use ndarray::Array2;

/// Compress records to the features that the network sees.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin features R1.csv R2.csv --twin tanks --out X.npy")]
pub(in crate::cli) struct Features {
    /// Records, measured or simulated.
    #[arg(value_name = "R.csv", required = true)]
    records: Vec<PathBuf>,
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    columns: FileColumns,
    /// Recipe of the features.
    #[arg(long, value_enum, default_value = "default")]
    preset: PresetArgument,
    /// New .npy, .npz or .csv file, one record per row [default: CSV on standard output].
    #[arg(long, value_name = "X.npy")]
    out: Option<PathBuf>,
}

impl Verb for Features {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        if let Some(out) = &self.out {
            output::check_new_file(out)?;
        }
        let project = context.project(&self.subject)?;
        let study = project.study();
        let map = (project.recipe(self.preset.into()).features).bind(study.twin())?;
        let mut all = Vec::new();
        let stage = context.progress.stage("records", self.records.len());
        for path in &self.records {
            let record = self.columns.reader(study).record(path)?;
            study.check_record(&record).in_file(path)?;
            let features = map.extract(record.drive(), record.outputs());
            all.extend(features.in_file(path)?);
            stage.tick().map_err(Failure::internal)?;
        }
        let features = Array2::from_shape_vec((self.records.len(), map.dim()), all)
            .map_err(Failure::internal)?;
        if let Some(out) = &self.out {
            write_result(out, |path| file::write_features(path, &features))?;
        }
        let rows: Vec<Vec<f64>> = features.rows().into_iter().map(|r| r.to_vec()).collect();
        let json = json!({
            "schema": "truetwin.features/1", "twin": study.name(), "features": rows,
        });
        let text = match &self.out {
            None => file::features_csv_text(&features).map_err(Failure::internal)?,
            Some(out) => {
                let (rows, n) = features.dim();
                format!("{}: {rows} × {}", shown(out), count(n, "feature"))
            }
        };
        context.print(&json, || text)
    }
}
