//! Features of one's own, on a twin without equations.
//!
//! ```console
//! $ cargo run --release --example own_features -- check --twin amplifier
//! $ cargo run --release --example own_features -- demo
//! ```
//!
//! A study file takes them by their kind: `[features] kind = "gains"`, `ranges = 8`.

use serde::{Deserialize, Serialize};
use std::process::ExitCode;
use std::sync::Arc;
use truetwin::feature::{FeatureError, FeatureMap, FeatureRecipe};
use truetwin::prelude::*;

/// An amplifier that clips softly: y = a·tanh(u/b), and noise of its sensor.
struct Amplifier;

impl DigitalTwin for Amplifier {
    fn parameters(&self) -> ParameterSpace {
        ParameterSpace::new([
            Parameter::new("a", "V", 1.0, 3.0).within(0.1, 9.0),
            Parameter::new("b", "V", 0.5, 2.0).within(0.1, 4.0),
        ])
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        // Draws come from named sources and do not depend on θ: runs of the same noise are paired.
        let mut v = noise.source("sensor");
        let output = |u: f64| theta[0] * (u / theta[1]).tanh() + 0.05 * v.normal();
        Ok(drive.inputs().mapv(output))
    }
}

/// Mean of y·u over those samples whose |u| lies in each of so many equal ranges up to 3, over the mean of u² there.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Gains {
    ranges: usize,
}

#[typetag::serde(name = "gains")]
impl FeatureRecipe for Gains {
    fn bind(&self, _: &Twin) -> Result<Arc<dyn FeatureMap>, FeatureError> {
        match self.ranges {
            0 => Err(FeatureError::Setting {
                kind: "gains",
                problem: "ranges = 0; take at least 1".into(),
            }),
            ranges => Ok(Arc::new(Self { ranges })),
        }
    }
}

impl FeatureMap for Gains {
    fn dim(&self) -> usize {
        self.ranges
    }
    fn extract(&self, drive: &Drive, outputs: &Signal) -> Result<Vec<f64>, FeatureError> {
        // Half a unit for each, so that a range without samples has a gain of 0.
        let mut sums = vec![(0.0, 0.5); self.ranges];
        for (u, y) in drive.inputs().iter().zip(outputs) {
            let range = (u.abs() / 3.0 * self.ranges as f64) as usize;
            let (above, below) = &mut sums[range.min(self.ranges - 1)];
            *above += u * y;
            *below += u * u;
        }
        Ok(sums.iter().map(|(above, below)| above / below).collect())
    }
}

fn project() -> Result<Project, StudyError> {
    let plan = RecordPlan::levels(0.1, 300, -3.0, 3.0, 1);
    let study = Study::new("amplifier", Amplifier, plan)?;
    Ok(Project::from(study).with_features(Gains { ranges: 8 }))
}

fn main() -> ExitCode {
    truetwin::cli::run([project()])
}
