//! `bank`: simulations onto the disk.

use super::args::BankArguments;
use super::{Context, Failure, output};
use crate::shards::BankPlan;
use serde_json::json;
use std::process::ExitCode;
use std::time::Instant;

pub(super) fn run(context: &Context<'_>, options: &BankArguments) -> Result<ExitCode, Failure> {
    let study = context.study(&options.subject)?;
    let plan = BankPlan {
        study: &study,
        preset: options.preset.into(),
        size: options.size,
        seed: context.seed,
    };
    let share = context.share(options.shard)?;
    // What other ranks do counts too; one rank looks.
    let before = match context.team.leads() {
        true => plan.finish(&options.out).map_or(0, |filled| filled.rows),
        false => 0,
    };
    context.team.wait();
    let clock = Instant::now();
    plan.fill(&options.out, share, context.progress)?;
    context.team.wait();
    if !context.team.leads() {
        return Ok(ExitCode::SUCCESS);
    }
    let seconds = clock.elapsed().as_secs_f64();
    let filled = plan.finish(&options.out)?;
    let made = filled.rows.saturating_sub(before);
    let rate = made as f64 / seconds;
    let folder = options.out.display();
    if context.json {
        output::print_json(&json!({
            "schema": "truetwin.bank/1",
            "twin": study.name(),
            "folder": options.out,
            "size": options.size,
            "seed": context.seed,
            "shards": { "there": filled.there, "of": filled.of },
            "simulated": made,
            "simulations_per_second": rate,
            "seconds": seconds,
        }))?;
    } else {
        let next = match filled.there == filled.of {
            true => format!("next: truetwin pretrain … --bank {folder} --out EST"),
            false => "the other shards are those of other jobs; put their folders together with truetwin merge".into(),
        };
        output::print(&format!(
            "{folder}: {} of {} shards, {} of {} simulations; {made} of them now, in {seconds:.1} s ({rate:.0} a second)\n{next}",
            filled.there, filled.of, filled.rows, options.size,
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
