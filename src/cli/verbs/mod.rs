//! The verbs.

mod bank;
mod check;
mod compare;
mod demo;
mod diagnose;
mod effects;
mod estimate;
mod features;
mod fit;
mod merge;
mod pretrain;
mod reproduce;
mod resample;
mod shell;
mod simulate;
mod twins;
mod withheld;

use super::context::Verb;
use clap::Subcommand;

/// The verbs, in the order of `--help`. A new verb needs a file, a `mod`, a variant and an arm here.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Twins(twins::Twins),
    Effects(effects::Effects),
    Check(check::Check),
    Resample(resample::Resample),
    Simulate(simulate::Simulate),
    Bank(bank::Bank),
    Features(features::Features),
    Merge(merge::Merge),
    Pretrain(pretrain::Pretrain),
    Fit(fit::Fit),
    Estimate(estimate::Estimate),
    Compare(compare::Compare),
    Diagnose(diagnose::Diagnose),
    Reproduce(reproduce::Reproduce),
    Withheld(withheld::Withheld),
    Demo(demo::Demo),
    Completions(shell::Completions),
    Man(shell::Man),
}

impl Command {
    /// Returns the verb of a call.
    pub fn verb(&self) -> &dyn Verb {
        match self {
            Self::Twins(verb) => verb,
            Self::Effects(verb) => verb,
            Self::Check(verb) => verb,
            Self::Resample(verb) => verb,
            Self::Simulate(verb) => verb,
            Self::Bank(verb) => verb,
            Self::Features(verb) => verb,
            Self::Merge(verb) => verb,
            Self::Pretrain(verb) => verb,
            Self::Fit(verb) => verb,
            Self::Estimate(verb) => verb,
            Self::Compare(verb) => verb,
            Self::Diagnose(verb) => verb,
            Self::Reproduce(verb) => verb,
            Self::Withheld(verb) => verb,
            Self::Demo(verb) => verb,
            Self::Completions(verb) => verb,
            Self::Man(verb) => verb,
        }
    }
}
