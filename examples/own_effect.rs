//! An effect of one's own: a magnet that pulls the oscillator to the middle, and only there.
//!
//! ```console
//! $ cargo run --release --example own_effect -- effects --twin van-der-pol      # lists it as the last one
//! $ cargo run --release --example own_effect -- simulate --twin van-der-pol --theta nu=1.5 --effect magnet.toml --out R.csv
//! ```
//!
//! where `magnet.toml` says
//!
//! ```toml
//! [[effect]]
//! id = "magnet"
//! target = "x2"
//! magnitudes = { strength = 0.5 }
//! ```

use serde::{Deserialize, Serialize};
use std::process::ExitCode;
use std::sync::Arc;
use truetwin::effect::{Given, Law, Magnitude, UnmodelledEffect};
use truetwin::prelude::*;
use truetwin::twins::VanDerPol;

/// ẋ − strength·x·exp(−x²): a force on a state's rate, off at 0.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Magnet {
    /// The state.
    target: String,
    /// Magnitudes that a file gives; the others are fitted.
    #[serde(default)]
    magnitudes: Given,
}

#[typetag::serde(name = "magnet")]
impl UnmodelledEffect for Magnet {
    fn target(&self) -> &str {
        &self.target
    }
    fn given(&self) -> &Given {
        &self.magnitudes
    }
    fn law(&self) -> Law {
        Law::Force
    }
    fn magnitudes(&self) -> Vec<Magnitude> {
        // Starts of a fit, per unit of the rate that the effect bends.
        vec![Magnitude::positive("strength", "1/s", &[0.1, 0.3])]
    }
    fn force(&self, m: &[f64], _t: f64, x: f64, _from: f64) -> f64 {
        -m[0] * x * (-x * x).exp()
    }
}

fn study() -> Result<Study, StudyError> {
    let plan = RecordPlan::autonomous(0.05, 300);
    let magnets = ["x1", "x2"].map(|state| {
        Arc::new(Magnet {
            target: state.into(),
            magnitudes: Given::default(),
        }) as Arc<dyn UnmodelledEffect>
    });
    Ok(Study::new("van-der-pol", VanDerPol, plan)?.with_effects(magnets))
}

fn main() -> ExitCode {
    truetwin::cli::run([study()])
}
