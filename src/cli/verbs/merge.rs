//! `merge`: merges the banks of a job array.

use crate::cli::prelude::*;
use crate::cli::shell_word::shown;
use crate::estimator::bank::file;
use crate::estimator::shards::{merge, merge_into_file};
use crate::setting::count;

/// Merge the banks of a job array, or convert a bank into one .npz or .csv file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin merge bank-1 bank-2 --out bank\n  \
        truetwin merge bank --out bank.npz\n\
        Next: truetwin pretrain with --bank bank")]
pub(in crate::cli) struct Merge {
    /// Folders filled by one `truetwin bank` command.
    #[arg(value_name = "DIR", required = true)]
    from: Vec<PathBuf>,
    /// New folder for the bank, or new .npz or .csv file.
    #[arg(long, value_name = "OUT")]
    out: PathBuf,
}

/// Endings that nobody gives to a folder.
const FILES: [&str; 8] = ["csv", "gz", "json", "npy", "npz", "parquet", "txt", "zip"];

impl Verb for Merge {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let is_file = file::is_named(&self.out);
        match is_file {
            true => output::check_new_file(&self.out)?,
            false => output::check_new(&self.out)?,
        }
        let ending = self.out.extension().unwrap_or_default().to_string_lossy();
        if FILES.contains(&&*ending.to_lowercase()) && !is_file {
            return Err(Failure::user(format!(
                "{}: a file of a bank ends with .npz or .csv; name it so, or a folder without such an ending",
                self.out.display()
            )));
        }
        let out = shown(&self.out);
        let progress = context.progress;
        let (what, merged) = match is_file {
            true => (
                "simulation",
                merge_into_file(&self.from, &self.out, progress)?,
            ),
            false => ("shard", merge(&self.from, &self.out, progress)?),
        };
        let json = json!({
            "schema": "truetwin.merge/1", "out": output::name(&self.out), "what": format!("{what}s"), "count": merged,
        });
        let text = || format!("{out}: {}", count(merged, what));
        Provenance::new(context).print_beside(context, json, text)
    }
}
