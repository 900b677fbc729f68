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
    // Published before the first diagnosis.
    eprintln!("keys sealed: sha256 {}", sealed.seal());
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
