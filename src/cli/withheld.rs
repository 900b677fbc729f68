//! `withheld`: what `diagnose` is worth, on trials whose truth is sealed.

use super::args::WithheldArguments;
use super::{Context, Failure, output};
use crate::report::{scorecard_html, scorecard_json, scorecard_text};
use crate::withheld::{Kind, Settings, Withheld};
use std::process::ExitCode;

pub(super) fn run(context: &Context<'_>, options: &WithheldArguments) -> Result<ExitCode, Failure> {
    let study = context.study(&options.subject)?;
    let settings = Settings {
        trials: options.trials,
        seed: context.seed,
        kinds: options.kinds.clone().unwrap_or(Kind::ALL.to_vec()),
        without: options.without,
        validation: options.validation,
        detection_only: options.detection_only,
    };
    let sealed = Withheld::new(&study, settings)?.seal(&options.out, context.progress)?;
    if context.team.leads() {
        // Published before the first diagnosis.
        output::say(&format!("keys sealed: sha256 {}", sealed.seal()));
    }
    let share = context.share(options.shard)?;
    let answers = sealed.answer(share, context.progress)?.len();
    if options.shard.is_some() && answers < options.trials {
        return output::print_share(context, &options.out, "trials", answers, options.trials);
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
