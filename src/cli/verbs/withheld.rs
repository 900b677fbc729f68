//! `withheld`: scores `diagnose` on trials with sealed truth.

use crate::cli::prelude::*;
use crate::diagnose::Ablation;
use crate::evaluate::MOST_RECORDS;
use crate::evaluate::trials::{self, Families, Kind, NuisanceKind, TrialSettings};
use crate::setting::did_you_mean;
use crate::storage::work::Share;

/// Score `diagnose` on trials with sealed truth: false alarms, detection, effect, location, abstention.
///
/// Records come from your own twin, moved by another integrator, with departures that the diagnosis does not know. The SHA-256 of
/// the key file is printed before the first diagnosis; keys are read after the last one. Scores: docs/withheld.md.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin withheld --twin tanks --trials 100 --out trials\n\n\
        DIR holds scorecard.json (as --json), scorecard.html, and the state of the work: manifest.json, seal.txt,\n\
        keys.json, records, answers. Interrupted, the same command resumes it; a different command is refused.")]
pub(in crate::cli) struct Withheld {
    #[command(flatten)]
    subject: Subject,
    /// Number of trials, one record each.
    #[arg(long, value_parser = number_of_trials)]
    trials: usize,
    /// Output folder; rerunning the same command resumes it.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Kinds of truth [default: all].
    #[arg(long, value_name = "KIND,..", value_delimiter = ',', value_parser = kind)]
    kinds: Option<Vec<Kind>>,
    /// Nuisances, of which each record has one [default: half of the records have one of all].
    #[arg(long, value_name = "KIND,..", value_delimiter = ',', value_parser = nuisance)]
    nuisances: Vec<NuisanceKind>,
    /// Families of random laws: open to choose constants with, closed for reports.
    #[arg(long, value_name = "HALF", default_value = "all")]
    families: Families,
    /// Measured record whose inputs, length, step and gaps the trials have [default: the study's plan].
    #[arg(long, value_name = "RECORD.csv")]
    like: Option<PathBuf>,
    #[command(flatten)]
    columns: FileColumns,
    /// Remove the true effects from the library: the right answer is then to abstain.
    #[arg(long)]
    without: bool,
    /// Give each diagnosis a validation record.
    #[arg(long)]
    validation: bool,
    /// Stop each diagnosis at its verdict: false alarms and detection only, in a third of the time.
    #[arg(long)]
    detection_only: bool,
    /// Parts taken out of the diagnosis, to measure what they are worth: fitted-noise, unknown-functions, evidence.
    #[arg(long, value_name = "PART,..", value_delimiter = ',', value_parser = ablation)]
    ablate: Vec<Ablation>,
    /// Repeat the diagnosis of the first N trials with other seeds, twice the record, other units, another order of the library.
    #[arg(long, value_name = "N", default_value_t = 0)]
    steadiness: usize,
    /// Share i of n of the diagnoses, for job arrays; when all shares are done, rerun without --shard to merge.
    #[arg(long, value_name = "I/N")]
    shard: Option<Share>,
}

impl Verb for Withheld {
    fn is_shared_out(&self) -> bool {
        true
    }

    fn kept(&self) -> Option<PathBuf> {
        Some(self.out.clone())
    }

    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        (self.columns).check_used(self.like.is_some(), "--like RECORD.csv")?;
        let study = context.study(&self.subject)?;
        let like = self.like.as_deref();
        let like = like.map(|path| self.columns.reader(&study).record(path));
        let settings = TrialSettings {
            trials: self.trials,
            seed: context.seed,
            kinds: self.kinds.clone().unwrap_or(Kind::ALL.to_vec()),
            nuisances: self.nuisances.clone(),
            families: self.families,
            like: like.transpose()?,
            without: self.without,
            validation: self.validation,
            detection_only: self.detection_only,
            ablated: self.ablate.clone(),
            steadiness: self.steadiness,
        };
        // What the call cannot ask for is said before anything is written.
        let share = context.share(self.shard)?;
        let sealed = trials::Withheld::new(&study, settings)?.seal(&self.out, context.progress)?;
        if context.ranks.is_root() {
            // Printed before the first diagnosis.
            output::say(&format!("keys sealed: sha256 {}", sealed.seal()));
        }
        let answers = sealed.answer(share, context.progress)?.len();
        if self.shard.is_some() && answers < self.trials {
            return context.print_share(&self.out, "trials", answers, self.trials);
        }
        context.ranks.wait();
        if !context.ranks.is_root() {
            return Ok(ExitCode::SUCCESS);
        }
        let card = sealed.score(context.progress)?;
        let provenance = Provenance::new(context).files("record", &self.like);
        let json = provenance.on(card.json());
        let write = || {
            sealed.write("scorecard.html", &provenance.page(card.document()))?;
            // Written last: it marks the folder as complete.
            Ok(sealed.write("scorecard.json", &format!("{json:#}\n"))?)
        };
        provenance.deliver(context, &json, write, || card.text())
    }
}

/// Parses a number of trials. A number that is too large is refused with the limit, however it is written.
fn number_of_trials(text: &str) -> Result<usize, String> {
    match text.parse::<f64>() {
        Ok(number) if number > MOST_RECORDS as f64 => Err(format!("choose at most {MOST_RECORDS}")),
        _ => at_least_one(text),
    }
}

/// Parses a part of a diagnosis.
fn ablation(text: &str) -> Result<Ablation, String> {
    known("part", text, Ablation::ALL.map(|part| (part.id(), part)))
}

/// Parses a kind of truth.
fn kind(text: &str) -> Result<Kind, String> {
    known("kind", text, Kind::ALL.map(|kind| (kind.id(), kind)))
}

/// Parses a nuisance.
fn nuisance(text: &str) -> Result<NuisanceKind, String> {
    known(
        "nuisance",
        text,
        NuisanceKind::ALL.map(|kind| (kind.id(), kind)),
    )
}

/// The value of this name; else an error that lists the names.
fn known<T, const N: usize>(what: &str, text: &str, all: [(&str, T); N]) -> Result<T, String> {
    let names = all.each_ref().map(|(name, _)| *name);
    let found = all.into_iter().find(|(name, _)| *name == text);
    found.map(|(_, value)| value).ok_or_else(|| {
        let near = did_you_mean(text, names);
        let all = names.join(", ");
        format!("no {what} is called \"{text}\"{near}; there are {all}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_many_trials_are_refused_with_the_limit() {
        for text in ["1e12", "1000001", "99999999999999999999999", "inf"] {
            let refused = number_of_trials(text).unwrap_err();
            assert_eq!(refused, "choose at most 1000000", "{text}");
        }
        assert_eq!(number_of_trials("1000000"), Ok(1_000_000));
        assert!(number_of_trials("0").unwrap_err().contains("at least 1"));
        assert!(number_of_trials("many").is_err());
    }
}
