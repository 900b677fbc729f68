//! `reproduce`: errors of the estimator's stages on the paper's test points.

use super::args::ReproduceArguments;
use super::{Context, Failure, output};
use crate::experiment::{MonteCarlo, Scenario, score};
use crate::two_stage::{Estimator, PretrainOptions, pretrain};
use serde_json::{Value, json};
use std::process::ExitCode;

pub(super) fn run(
    context: &Context<'_>,
    options: &ReproduceArguments,
) -> Result<ExitCode, Failure> {
    let study = context.study(&options.subject)?;
    let estimator = match &options.estimator {
        Some(path) => {
            let estimator = Estimator::load(path, context.studies)?;
            let made_for = estimator.study().name();
            if made_for != study.name() {
                let asked = study.name();
                return Err(Failure::user(format!(
                    "{}: made for twin {made_for}, --twin says {asked}; name the same twin",
                    path.display()
                )));
            }
            estimator
        }
        None => {
            let settings = PretrainOptions {
                preset: options.preset.into(),
                bank_size: options.bank_size,
                epochs: options.epochs,
                seed: context.seed,
            };
            pretrain(&study, &settings, context.progress)?.0
        }
    };
    let plan = MonteCarlo {
        scenario: match options.scenario {
            0 => Scenario::InDistribution,
            1 => Scenario::First,
            _ => Scenario::Second,
        },
        runs: options.runs,
        seed: context.seed,
    };
    let scores = score(&estimator, &plan, context.progress)?;
    let finite = |v: f64| Some(v).filter(|v| v.is_finite());
    if context.json {
        let methods: Vec<Value> = (scores.iter())
            .map(|s| {
                json!({
                    "method": s.method.to_string(),
                    "initialisation": s.method.initialisation().map(|i| i.to_string()),
                    "mse": finite(s.mse), "median": finite(s.median), "ms": finite(s.milliseconds),
                })
            })
            .collect();
        output::print_json(&json!({
            "schema": "truetwin.reproduce/1", "twin": study.name(), "scenario": options.scenario,
            "runs": options.runs, "preset": estimator.preset(), "methods": methods,
        }))?;
    } else {
        let mut text = format!(
            "{}, scenario {}, {} runs, preset {}\n{:<14} {:>12} {:>12} {:>10}\n",
            study.name(),
            options.scenario,
            options.runs,
            estimator.preset(),
            "method",
            "MSE",
            "median",
            "ms"
        );
        for s in &scores {
            text.push_str(&format!(
                "{:<14} {:>12.3e} {:>12.3e} {:>10.1}\n",
                match s.method.initialisation() {
                    Some(start) => format!("{} ({start})", s.method),
                    None => s.method.to_string(),
                },
                s.mse,
                s.median,
                s.milliseconds
            ));
        }
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}
