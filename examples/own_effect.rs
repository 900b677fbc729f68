//! An effect of one's own: a magnet that pulls the oscillator to the middle, and only there.
//!
//! ```console
//! $ cargo run --release --example own_effect -- effects --twin van-der-pol      # lists it as the last one
//! $ cargo run --release --example own_effect -- simulate --twin van-der-pol --theta nu=1.5 --effect magnet.toml --out R.csv
//! ```
//!
//! with this `magnet.toml`:
//!
//! ```toml
//! [[effect]]
//! id = "magnet"
//! target = "x2"
//! magnitudes = { strength = 0.5 }
//! ```

use std::process::ExitCode;
use truetwin::effect::{EffectKind, Magnitude};
use truetwin::prelude::*;
use truetwin::twins::VanDerPol;

/// A force on a state's rate, off at 0.
fn magnet() -> EffectKind {
    EffectKind::force("magnet", "ẋ − strength·x·exp(−x²)", |m, at| {
        -m[0] * at.x * (-at.x * at.x).exp()
    })
    // Starts of a fit, per unit of the rate that the effect bends.
    .magnitude(Magnitude::positive("strength", "1/s", &[0.1, 0.3]))
}

fn study() -> Result<Study, StudyError> {
    let plan = RecordPlan::autonomous(0.05, 300);
    Ok(Study::new("van-der-pol", VanDerPol, plan)?.with_effects([magnet()]))
}

fn main() -> ExitCode {
    truetwin::cli::run([study()])
}
