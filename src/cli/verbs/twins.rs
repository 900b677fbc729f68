//! `twins`: lists the twins.

use crate::cli::prelude::*;
use crate::estimator::Project;
use crate::record::Quantity;

/// List the twins: parameters, units, prior, bounds, channels.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        truetwin twins\n\
        Next: truetwin check --twin NAME, then truetwin pretrain --twin NAME --out NAME.est")]
pub(in crate::cli) struct Twins {}

impl Verb for Twins {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let studies = || context.projects.iter().map(Project::study);
        let twins: Vec<Value> = studies().map(describe).collect();
        let json = json!({ "schema": "truetwin.twins/1", "twins": twins });
        context.print(&json, || {
            studies().map(in_words).collect::<Vec<_>>().join("\n")
        })
    }
}

fn describe(study: &Study) -> Value {
    let twin = study.twin();
    let signals = twin.signals();
    let states = twin.outline().map(|outline| outline.states);
    json!({
        "name": study.name(),
        "equations": states.is_some(),
        "parameters": twin.parameters().iter().collect::<Vec<_>>(),
        "states": states.unwrap_or_default(),
        "inputs": signals.inputs,
        "outputs": signals.outputs,
        "record": study.plan().map(|plan| json!({ "step": plan.step, "samples": plan.samples })),
    })
}

fn in_words(study: &Study) -> String {
    let twin = study.twin();
    let signals = twin.signals();
    let names = |all: &[Quantity]| match all {
        [] => "none".to_owned(),
        _ => {
            let all = all.iter().map(|q| format!("{} [{}]", q.name, q.unit));
            all.collect::<Vec<_>>().join(", ")
        }
    };
    let states = twin.outline().map(|outline| names(&outline.states));
    let record = study
        .plan()
        .map(|p| format!("{} samples, step {} s", p.samples, p.step));
    let mut text = format!(
        "{}\n  states  {}\n  inputs  {}\n  outputs {}\n  record  {}\n  {:<12} {:<8} {:<16} bounds\n",
        study.name(),
        states.unwrap_or("hidden (black box)".into()),
        names(&signals.inputs),
        names(&signals.outputs),
        record.unwrap_or("as measured".into()),
        "parameter",
        "unit",
        "prior",
    );
    for p in twin.parameters().iter() {
        let (prior, bounds) = (p.prior.to_string(), p.bounds);
        text += &format!("  {:<12} {:<8} {prior:<16} {bounds}\n", p.name, p.unit);
    }
    text
}
