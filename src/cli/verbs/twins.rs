//! `twins`, `new` and `export`: lists the twins, writes texts to begin with.

use crate::cli::prelude::*;
use crate::estimator::Project;
use crate::record::Quantity;
use crate::setting::count;
use clap::ValueEnum;

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
        .map(|p| format!("{}, step {} s", count(p.samples, "sample"), p.step));
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

/// Write a study file with equations to begin with, commented.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin new pendulum > pendulum.toml\n\
        Next: change names and equations, then truetwin check --study pendulum.toml")]
pub(in crate::cli) struct New {
    /// The system that is nearest to yours.
    #[arg(value_enum, default_value_t = Template::Pendulum)]
    system: Template,
}

/// Systems of several fields, each a file of `examples/`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Template {
    /// A pushed pendulum: two states, one input, a known start.
    Pendulum,
    /// Two tanks: levels with limits, definitions.
    Tanks,
    /// A DC motor with dry friction.
    DcMotor,
    /// An epidemic: noise that follows the signal.
    Sir,
    /// A heat exchanger with two inputs and two outputs.
    HeatExchanger,
    /// A drug in two compartments: doses.
    Pharmacokinetics,
    /// A house of two capacities: a heater that is switched, weather that is sampled.
    House,
    /// Hares and lynxes: an oscillation of two states, both measured.
    PredatorPrey,
    /// A room with a thermostat: events that switch a heater.
    Thermostat,
}

impl Template {
    fn text(self) -> &'static str {
        match self {
            Self::Pendulum => include_str!("../../../examples/pendulum.toml"),
            Self::Tanks => include_str!("../../../examples/tanks.toml"),
            Self::DcMotor => include_str!("../../../examples/dc-motor.toml"),
            Self::Sir => include_str!("../../../examples/sir.toml"),
            Self::HeatExchanger => include_str!("../../../examples/heat-exchanger.toml"),
            Self::Pharmacokinetics => include_str!("../../../examples/pharmacokinetics.toml"),
            Self::House => include_str!("../../../examples/house.toml"),
            Self::PredatorPrey => include_str!("../../../examples/predator-prey.toml"),
            Self::Thermostat => include_str!("../../../examples/thermostat.toml"),
        }
    }
}

impl Verb for New {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let text = self.system.text();
        let json = json!({ "schema": "truetwin.new/1", "study": text });
        context.print(&json, || text.trim_end().to_owned())
    }
}

/// Write a twin as the text of a study file, for whoever wants to change its equations.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin export --twin tanks > tanks.toml\n\
        Next: change an equation, then truetwin check --study tanks.toml")]
pub(in crate::cli) struct Export {
    #[command(flatten)]
    subject: Subject,
}

impl Verb for Export {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let study = context.study(&self.subject)?;
        let Some(text) = study.text() else {
            return Err(Failure::user(format!(
                "the twin {} has no equations as text; `truetwin new` writes a file to begin with",
                study.name()
            )));
        };
        let json = json!({ "schema": "truetwin.export/1", "twin": study.name(), "study": text });
        context.print(&json, || text.trim_end().to_owned())
    }
}
