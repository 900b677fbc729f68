//! `merge`: the banks of a job array as one.

use super::args::MergeArguments;
use super::{Context, Failure, output};
use crate::bank::file;
use crate::shards::{merge, merge_into_file};
use serde_json::json;
use std::process::ExitCode;

pub(super) fn run(context: &Context<'_>, options: &MergeArguments) -> Result<ExitCode, Failure> {
    output::check_new(&options.out)?;
    let out = options.out.display();
    let (what, count) = match file::is_named(&options.out) {
        true => (
            "simulations",
            merge_into_file(&options.from, &options.out, context.progress)?,
        ),
        false => (
            "shards",
            merge(&options.from, &options.out, context.progress)?,
        ),
    };
    match context.json {
        true => output::print_json(&json!({
            "schema": "truetwin.merge/1", "out": options.out, "what": what, "count": count,
        }))?,
        false => output::print(&format!("{out}: {count} {what}"))?,
    }
    Ok(ExitCode::SUCCESS)
}
