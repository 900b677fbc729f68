//! `fit`: finds the most probable parameters of a twin, given records.

use crate::cli::failure::STOPPED;
use crate::cli::posterior::{self, PosteriorDraws};
use crate::cli::prelude::*;
use crate::cli::stop;
use crate::fit::FitSettings;
use crate::report::{Report, overlay_svg};

/// Fit the parameters, noise levels and starts of a twin to measured records; no training.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin fit R.csv --twin tanks --out result\n\
        If the free run does not follow the record, next: truetwin diagnose R.csv --twin tanks --out gap")]
pub(in crate::cli) struct Fit {
    /// Measured records of one system.
    #[arg(value_name = "R.csv", required = true)]
    records: Vec<PathBuf>,
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    columns: FileColumns,
    #[command(flatten)]
    draws: PosteriorDraws,
    /// Profile likelihood of each parameter, in fit.json and on the page. Without this, of those alone whose posterior the prior shapes:
    /// their intervals hold those of the profile, too.
    #[arg(long)]
    profile: bool,
    /// New folder for fit.json, the page report.html and a picture of each record (overlay.svg, overlay-2.svg, …).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Fit {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let folder = output::asked_folder(&self.out)?;
        let study = context.study(&self.subject)?;
        let (records, _) = records::read(self.columns.reader(&study), &self.records, None)?;
        let settings = FitSettings {
            seed: context.seed,
            draws: self.draws.count()?,
            profile: self.profile,
            give_partial: true,
            ..FitSettings::default()
        };
        stop::let_end();
        let fit = study.fit_with(&records, &settings, context.progress);
        let fit = fit.inspect_err(|_| {
            records::warn_of_times(&study, self.records.iter().zip(&records), context.seed);
        });
        let fit = fit.map_err(|e| Failure::of_records(e, Failure::from, &self.records, None))?;
        let provenance = Provenance::new(context).files("record", &self.records);
        let json = provenance.on(fit.json(&study));
        let write = || {
            let Some(folder) = folder else { return Ok(()) };
            folder.write("fit.json", format!("{json:#}"))?;
            let page = provenance.page(fit.document(&study, &records));
            folder.write("report.html", page)?;
            for (r, (record, run)) in records.iter().zip(&fit.free_runs).enumerate() {
                let Some(run) = run else { continue };
                let number = if r == 0 {
                    String::new()
                } else {
                    format!("-{}", r + 1)
                };
                let overlay = overlay_svg(&study, record, None, Some(run));
                folder.write(&format!("overlay{number}.svg"), overlay)?;
            }
            if let Some(draws) = &fit.posterior {
                posterior::write(&folder, &study, draws)?;
            }
            Ok(folder.finish()?)
        };
        let done = provenance.deliver(context, &json, write, || fit.text(&study))?;
        Ok(match fit.interrupted {
            true => ExitCode::from(STOPPED),
            false => done,
        })
    }
}
