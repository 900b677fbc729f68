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

/// Defines the verbs of the command line.
macro_rules! verbs {
    ($($verb:ident($module:ident)),+ $(,)?) => {
        /// The verbs, in the order of `--help`.
        #[derive(Debug, Subcommand)]
        pub(super) enum Command {
            $($verb($module::$verb)),+
        }

        impl Command {
            /// Returns the verb of a call.
            pub fn verb(&self) -> &dyn Verb {
                match self {
                    $(Self::$verb(verb) => verb),+
                }
            }
        }
    };
}

// A new verb needs a file, a `mod`, and a line here.
verbs! {
    New(twins),
    Twins(twins),
    Export(twins),
    Effects(effects),
    Check(check),
    Resample(resample),
    Simulate(simulate),
    Bank(bank),
    Features(features),
    Merge(merge),
    Pretrain(pretrain),
    Fit(fit),
    Estimate(estimate),
    Compare(compare),
    Diagnose(diagnose),
    Reproduce(reproduce),
    Withheld(withheld),
    Demo(demo),
    Completions(shell),
    Man(shell),
}
