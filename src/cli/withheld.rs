//! `withheld`: what `diagnose` is worth, on trials whose truth is sealed.

use super::args::{Subject, at_least_one};
use super::{Context, Failure, Verb, output};
use crate::evaluate::trials::{self, Kind, Settings};
use crate::report::{scorecard_html, scorecard_json, scorecard_text};
use crate::storage::work::Share;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// Score `diagnose` on trials whose truth is sealed: false alarms, detection, which effect, where, when to abstain.
///
/// Records come from simulators written apart from the twins. The SHA-256 of the key file is printed before the first
/// diagnosis; keys are read once every answer is there. What each score means: docs/withheld.md.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin withheld --twin tanks --trials 100 --out trials\n\n\
        DIR holds scorecard.json (as --json), scorecard.html, and what it takes to go on: manifest.json, seal.txt,\n\
        keys.json, records, answers. Interrupted, the same call goes on where it stopped; another call is refused.")]
pub(super) struct Withheld {
    #[command(flatten)]
    subject: Subject,
    /// Records.
    #[arg(long, value_parser = at_least_one)]
    trials: usize,
    /// A folder for the trials: a new one, or one of this very call to go on with.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Kinds of truth; all unless given.
    #[arg(long, value_name = "KIND,..", value_delimiter = ',', value_parser = kind)]
    kinds: Option<Vec<Kind>>,
    /// Take the true effects out of the library: where there is one, the right answer is to abstain.
    #[arg(long)]
    without: bool,
    /// Give each diagnosis a second record.
    #[arg(long)]
    validation: bool,
    /// End each diagnosis with its verdict: false alarms and detection, in a third of the time.
    #[arg(long)]
    detection_only: bool,
    /// Only part i of n of the diagnoses, for job arrays; once all parts are done, the same call without it ends the work.
    #[arg(long, value_name = "I/N")]
    shard: Option<Share>,
}

impl Verb for Withheld {
    fn subject(&self) -> Option<&Subject> {
        Some(&self.subject)
    }

    fn is_resumed(&self) -> bool {
        true
    }

    fn is_shared_out(&self) -> bool {
        true
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let study = context.study(&self.subject)?;
        let settings = Settings {
            trials: self.trials,
            seed: context.seed,
            kinds: self.kinds.clone().unwrap_or(Kind::ALL.to_vec()),
            without: self.without,
            validation: self.validation,
            detection_only: self.detection_only,
        };
        let sealed = trials::Withheld::new(&study, settings)?.seal(&self.out, context.progress)?;
        if context.team.leads() {
            // Published before the first diagnosis.
            output::say(&format!("keys sealed: sha256 {}", sealed.seal()));
        }
        let share = context.share(self.shard)?;
        let answers = sealed.answer(share, context.progress)?.len();
        if self.shard.is_some() && answers < self.trials {
            return output::print_share(context, &self.out, "trials", answers, self.trials);
        }
        context.team.wait();
        sealed.open_keys(share, context.progress)?;
        context.team.wait();
        if !context.team.leads() {
            return Ok(ExitCode::SUCCESS);
        }
        let card = sealed.score(context.progress)?;
        let json = scorecard_json(&card);
        sealed.write("scorecard.html", &scorecard_html(&card))?;
        // Last: where it is, everything is.
        sealed.write("scorecard.json", &format!("{json:#}\n"))?;
        match context.json {
            true => output::print_json(&json)?,
            false => output::print(&scorecard_text(&card))?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A kind of truth.
fn kind(text: &str) -> Result<Kind, String> {
    let known = || Kind::ALL.map(Kind::id).join(", ");
    Kind::named(text).ok_or_else(|| format!("kinds are {}", known()))
}
