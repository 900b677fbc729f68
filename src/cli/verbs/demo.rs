//! `demo`: estimates the parameters behind an embedded record.

use super::estimate::Answer;
use crate::cli::prelude::*;
use crate::cli::shell_word::shown;
use crate::estimator::{EstimateOptions, PresetName, PretrainOptions, pretrain};
use crate::record::{Columns, Record, named_csv_text};
use crate::twin::Noise;

/// A small bank and few epochs keep the demo short; the refinement corrects the rough network.
const BANK: usize = 2000;
const EPOCHS: usize = 40;

/// Calibrate a twin to an embedded record: a first look in seconds.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin demo --out demo\n\
        Next: look at demo/overlay.svg, then truetwin twins")]
pub(in crate::cli) struct Demo {
    /// Name of the twin [default: the first one that has a demo record].
    #[arg(long)]
    twin: Option<String>,
    /// New folder for result, picture and record.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Demo {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let folder = output::asked_folder(&self.out)?;
        let project = match &self.twin {
            Some(name) => context.named(name)?,
            None => (context.projects.iter().find(|p| p.study().demo().is_some()))
                .or(context.projects.first())
                .ok_or_else(|| {
                    Failure::user("no twin is registered; give --program 'COMMAND' or --fmu M.fmu")
                })?,
        };
        let (project, record, origin) = match project.study().demo() {
            Some((file, record)) => (project.configure(file)?, record.clone(), "embedded record"),
            None => (
                project.clone(),
                simulated(context, project.study())?,
                "record simulated at parameters drawn from the bounds",
            ),
        };
        let study = project.study();
        output::say(&format!(
            "demo: {origin}, twin {}; training on {BANK} simulations from the prior",
            study.name()
        ));
        let settings = PretrainOptions {
            preset: PresetName::Default,
            bank_size: Some(BANK),
            epochs: Some(EPOCHS),
            seed: context.seed,
        };
        let (estimator, _) = pretrain(&project, &settings, context.progress)?;
        let settings = EstimateOptions {
            seed: context.seed,
            ..EstimateOptions::default()
        };
        let estimate = estimator.estimate_with(&record, &settings, context.progress)?;
        let provenance = Provenance::new(context);
        let answer = Answer {
            study,
            record: &record,
            estimate: &estimate,
        };
        let write = || {
            let Some((folder, out)) = folder.zip(self.out.as_ref()) else {
                return Ok(());
            };
            folder.write(
                "record.csv",
                named_csv_text(&record, &Columns::default().header(&study.twin().signals())),
            )?;
            answer.write(&folder, &provenance)?;
            folder.finish()?;
            output::say(&format!(
                "demo: {0}/overlay.svg shows measured and twin, {0}/record.csv is the record",
                shown(out)
            ));
            Ok(())
        };
        answer.deliver(context, &provenance, write)
    }
}

/// Simulates a record at parameters drawn from the bounds, most likely outside the prior.
fn simulated(context: &Context<'_>, study: &Study) -> Result<Record, Failure> {
    let noise = Noise::new(context.seed, "demo", 0);
    let drive = study.drives()?.draw(noise)?;
    let theta = study.twin().parameters().draw_bounds(noise);
    let outputs = study.twin().simulate(&theta, &drive, noise)?;
    Ok(Record::complete(drive, outputs)?)
}
