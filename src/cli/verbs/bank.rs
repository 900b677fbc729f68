//! `bank`: simulates a bank to disk.

use crate::cli::prelude::*;
use crate::cli::shell_word::{quoted, shown};
use crate::estimator::shards::BankPlan;
use crate::setting::count;
use crate::storage::work::Share;
use std::time::Instant;

/// Simulate a bank from the prior to disk; rerunning the same command resumes it.
///
/// DIR holds manifest.json and shards/*.npz; each shard has `theta` and `features`, for `pretrain --bank DIR` or numpy.load.
/// Row i depends only on the seed and i: threads, jobs (--shard) and ranks (mpirun) give the same bytes.
#[derive(Debug, Args)]
#[command(after_help = "A job array of four, merged into one bank:\n  \
        truetwin bank --twin tanks --size 1000000 --shard $I/4 --out bank-$I\n  \
        truetwin merge bank-1 bank-2 bank-3 bank-4 --out bank\n  \
        truetwin pretrain --twin tanks --bank bank --out tanks.est\n\
        On a shared file system, give all jobs one DIR; no merge is needed. See docs/scaling.md.")]
pub(in crate::cli) struct Bank {
    #[command(flatten)]
    subject: Subject,
    /// Number of simulations.
    #[arg(long, value_name = "M", value_parser = at_least_one)]
    size: usize,
    /// Output folder; rerunning the same command resumes it.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Share i of n of the shards, for job arrays that count from 0 or from 1.
    #[arg(long, value_name = "I/N")]
    shard: Option<Share>,
    /// Recipe of the features.
    #[arg(long, value_enum, default_value = "default")]
    preset: PresetArgument,
}

impl Verb for Bank {
    fn is_shared_out(&self) -> bool {
        true
    }

    fn kept(&self) -> Option<PathBuf> {
        Some(self.out.clone())
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let project = context.project(&self.subject)?;
        let plan = BankPlan {
            project: project.clone(),
            preset: self.preset.into(),
            size: self.size,
            seed: context.seed,
        };
        let share = context.share(self.shard)?;
        // Rows of all ranks are counted, by one rank.
        let before = match context.ranks.is_root() {
            true => plan.finish(&self.out).map_or(0, |filled| filled.rows),
            false => 0,
        };
        context.ranks.wait();
        let clock = Instant::now();
        let own = plan.fill(&self.out, share, context.progress)?.made;
        context.ranks.wait();
        if !context.ranks.is_root() {
            return Ok(ExitCode::SUCCESS);
        }
        let seconds = clock.elapsed().as_secs_f64();
        let filled = plan.finish(&self.out)?;
        let made = own.max(filled.rows.saturating_sub(before));
        let rate = made as f64 / seconds;
        let folder = shown(&self.out);
        let json = json!({
            "schema": "truetwin.bank/1", "twin": project.study().name(), "folder": output::name(&self.out),
            "size": self.size, "seed": context.seed,
            "shards": { "there": filled.there, "of": filled.of },
            "simulated": made, "simulations_per_second": rate, "seconds": seconds,
        });
        Provenance::new(context).print_beside(context, json, || {
            let next = match filled.there == filled.of {
                true => format!(
                    "next: truetwin pretrain … --bank {} --out EST",
                    quoted(self.out.as_os_str())
                ),
                false => "other jobs make the other shards; merge their folders with truetwin merge".into(),
            };
            format!(
                "{folder}: {} of {}, {} of {}; {made} new in {seconds:.1} s ({rate:.0} per second)\n{next}",
                filled.there,
                count(filled.of, "shard"),
                filled.rows,
                count(self.size, "simulation"),
            )
        })
    }
}
