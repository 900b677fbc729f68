//! The paper's studies: twins, presets and test points.
//!
//! What the text leaves open is from the authors' code: Huber δ, ε, eight starts, λ in G, the hybrid's share, weight
//! decay, the evaluation input. γ and λ stand in units of the prior's width here.
//!
//! Source: Lakshminarayanan, Guerrero & Rojas, section V.

use crate::feature::{Ar, Arx};
use crate::network::{Compact, Deep, Training, architecture};
use crate::refine::RefineSettings;
use crate::study::{CloudSettings, Preset, PresetName, RecordPlan, Settings, Study, StudyError};
use crate::twin::{Drive, DriveError, Noise, Signal, parse_record};
use crate::twins::{CascadedTanks, VanDerPol};
use std::path::Path;
use std::sync::Arc;

/// Made by `truetwin simulate --twin van-der-pol --theta nu=3.2 --seed 2026`.
const DEMO: &str = include_str!("demo-van-der-pol.csv");

/// The reference twins under their command-line names, `van-der-pol` and `tanks`.
pub fn reference_studies() -> Result<Vec<Study>, StudyError> {
    Ok(vec![van_der_pol()?, tanks()?])
}

fn van_der_pol() -> Result<Study, StudyError> {
    let width = 2.5f64;
    let settings = paper(width, 1e-3, 200, 0.0, 400);
    let preset = |settings| Preset {
        features: Arc::new(Ar { order: 5 }),
        architecture: architecture::<Compact>(),
        settings,
    };
    let plan = RecordPlan::autonomous(0.05, 300);
    let demo = parse_record(DEMO, Path::new("demo-van-der-pol.csv"))?;
    Ok(Study::new("van-der-pol", VanDerPol, plan)?
        .with_preset(PresetName::Paper, preset(settings))
        .with_demo(demo))
}

fn tanks() -> Result<Study, StudyError> {
    let width = 0.4f64;
    let paper = Preset {
        features: Arc::new(Arx {
            outputs: 64,
            inputs: 64,
        }),
        architecture: architecture::<Deep>(),
        settings: paper(width, 1e-4, 250, 5e-4, 1000),
    };
    let plan = RecordPlan::levels(0.5, 400, 0.0, 3.0, 30);
    Ok(Study::new("tanks", CascadedTanks, plan)?.with_preset(PresetName::Paper, paper))
}

/// The paper's numbers for priors of one `width`; `pull` is γ in parameter units.
fn paper(width: f64, pull: f64, epochs: usize, orthogonality: f64, cloud: usize) -> Settings {
    let common = Settings::paper();
    Settings {
        training: Training {
            epochs,
            orthogonality,
            ..common.training
        },
        refine: RefineSettings {
            pull: pull * width * width,
            ridge: 1e-3 * width * width,
            ..common.refine
        },
        cloud: CloudSettings {
            size: cloud,
            ..common.cloud
        },
        tuning: Training {
            orthogonality,
            ..common.tuning
        },
        ..common
    }
}

/// Where true parameters come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scenario {
    /// Drawn from the prior.
    InDistribution,
    /// The paper's OOD 1.
    First,
    /// The paper's OOD 2.
    Second,
}

/// Levels of the authors' evaluation input, each held for 30 samples.
const EVALUATION_LEVELS: [f64; 14] = [
    1.81107, 0.892673, 2.0621, 2.216834, 0.29633, 0.961995, 0.589052, 0.838648, 2.555016, 0.061703,
    0.483433, 2.016987, 0.857486, 2.415572,
];

/// True parameters and drive of run number `run`, or `None` for a study that the paper does not have.
pub fn scenario(
    study: &Study,
    scenario: Scenario,
    noise: Noise,
) -> Option<Result<(Vec<f64>, Drive), DriveError>> {
    // Name, OOD 1, OOD 2.
    let points: &[(&str, f64, f64)] = match study.name() {
        "van-der-pol" => &[("nu", 3.0, 5.0)],
        "tanks" => &[
            ("k1", 1.2, 1.3),
            ("k2", 1.2, 1.3),
            ("k3", 0.9, 0.6),
            ("k4", 1.0, 0.7),
        ],
        _ => return None,
    };
    let space = study.twin().parameters();
    let drawn = space.draw_prior(noise);
    // What a study has beyond the paper's parameters is drawn from its prior.
    let theta = (space.iter().zip(drawn))
        .map(
            |(p, drawn)| match points.iter().find(|(name, ..)| *name == p.name) {
                Some((_, first, _)) if scenario == Scenario::First => *first,
                Some((_, _, second)) if scenario == Scenario::Second => *second,
                _ => drawn,
            },
        )
        .collect();
    let plan = study.plan();
    let inputs = study.twin().signals().inputs.len();
    let levels = Signal::from_shape_fn((plan.samples, inputs), |(k, _)| {
        EVALUATION_LEVELS[(k / 30) % EVALUATION_LEVELS.len()]
    });
    Some(Drive::new(plan.step, levels).map(|drive| (theta, drive)))
}
