//! Model description, of either version of the standard.

use super::structure;
use super::variable::{FmuVariable, Types, Version, attribute, child, declared, number, variables};
use crate::record::{Quantity, Signals};
use crate::storage::untrusted::message;
use crate::study::{InputPlan, RecordPlan};
use crate::twin::Interval;
use roxmltree::{Document, Node};

/// Samples of a record whose step is not described.
const SAMPLES: f64 = 300.0;
/// Stretches of constant input in a record.
const HOLDS: usize = 15;

/// Interface of an FMU that is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Interface {
    /// Its equations.
    ModelExchange,
    /// Its own steps.
    CoSimulation,
}

/// Used part of `modelDescription.xml`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ModelDescription {
    pub version: Version,
    pub interface: Interface,
    /// As written: "2.0", "3.0.1".
    pub version_text: String,
    pub name: String,
    /// `guid` or `instantiationToken`.
    pub token: String,
    /// Name of the library.
    pub identifier: String,
    /// No more than one instance may exist.
    pub alone: bool,
    /// Equations are to be told of each step that is complete.
    pub told_of_steps: bool,
    pub parameters: Vec<FmuVariable>,
    pub inputs: Vec<FmuVariable>,
    pub outputs: Vec<FmuVariable>,
    /// Continuous states, in the order of the state vector.
    pub states: Vec<FmuVariable>,
    /// Number of event indicators.
    pub indicators: usize,
    pub start: f64,
    pub stop: Option<f64>,
    pub step: Option<f64>,
}

fn only_once(interface: Node<'_, '_>) -> bool {
    let once = interface.attribute("canBeInstantiatedOnlyOncePerProcess");
    once.is_some_and(|text| ["true", "1"].contains(&text))
}

/// Returns whether `completedIntegratorStep` is to be called: unless the model says that it needs none.
fn told_of_steps(interface: Node<'_, '_>, version: Version) -> bool {
    let (key, unneeded) = match version {
        Version::Two => ("completedIntegratorStepNotNeeded", ["true", "1"]),
        Version::Three => ("needsCompletedIntegratorStep", ["false", "0"]),
    };
    let told = interface.attribute(key);
    interface.has_tag_name("ModelExchange") && !told.is_some_and(|text| unneeded.contains(&text))
}

/// The equations where they can be run: they have states, and each thread may have instances; `stepped` where only its own steps are wanted.
fn chosen<'a, 'i>(
    root: Node<'a, 'i>,
    states: &Result<Vec<FmuVariable>, String>,
    stepped: bool,
) -> Result<(Interface, Node<'a, 'i>), String> {
    if stepped {
        return match child(root, "CoSimulation") {
            Some(node) => Ok((Interface::CoSimulation, node)),
            None => Err(
                "it offers no co-simulation; export it for that, or use its model exchange".into(),
            ),
        };
    }
    let problem = match (child(root, "ModelExchange"), states) {
        (Some(_), Err(problem)) => problem.as_str(),
        (Some(_), Ok(states)) if states.is_empty() => "its model exchange has no continuous states",
        (Some(node), _) if only_once(node) => "its model exchange allows one instance only",
        (Some(node), _) => return Ok((Interface::ModelExchange, node)),
        (None, _) => "it has neither model exchange nor co-simulation",
    };
    match child(root, "CoSimulation") {
        Some(node) => Ok((Interface::CoSimulation, node)),
        None => Err(format!("{problem}; export it for co-simulation")),
    }
}

impl ModelDescription {
    /// From the file's text, of its own steps where `stepped` asks for them; the error says what is missing.
    pub fn parse(text: &str, stepped: bool) -> Result<Self, String> {
        Self::read(text, stepped).map_err(|problem| message(&problem))
    }

    fn read(text: &str, stepped: bool) -> Result<Self, String> {
        let document = Document::parse(text).map_err(|error| error.to_string())?;
        let root = document.root_element();
        if !root.has_tag_name("fmiModelDescription") {
            return Err("it is no fmiModelDescription".into());
        }
        let version_text = attribute(root, "fmiVersion")?;
        let (version, token) = match version_text.split('.').next() {
            Some("2") => (Version::Two, "guid"),
            Some("3") => (Version::Three, "instantiationToken"),
            _ => {
                return Err(format!("FMI {version_text}; 2.0 and 3.0 can be used"));
            }
        };
        let types = declared(root, version)?;
        let states = structure::states(root, version, &types);
        let (interface, simulation) = chosen(root, &states, stepped)?;
        // What only equations need is no fault of others.
        let (states, indicators) = match interface {
            Interface::ModelExchange => (states?, structure::indicators(root, version)?),
            Interface::CoSimulation => (Vec::new(), 0),
        };
        let experiment = child(root, "DefaultExperiment");
        let time = |name| experiment.map_or(Ok(None), |node| number(node, name));
        let mut found = Self {
            version,
            interface,
            version_text: version_text.into(),
            name: attribute(root, "modelName")?.into(),
            token: attribute(root, token)?.into(),
            identifier: attribute(simulation, "modelIdentifier")?.into(),
            alone: only_once(simulation),
            told_of_steps: told_of_steps(simulation, version),
            parameters: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            states,
            indicators,
            start: time("startTime")?.unwrap_or(0.0),
            stop: time("stopTime")?,
            step: time("stepSize")?,
        };
        // The loader makes a path of it.
        if found.identifier.contains(['/', '\\', ':', '\0']) || found.identifier.starts_with('.') {
            return Err(format!(
                "modelIdentifier = \"{}\" is no name of a library",
                found.identifier
            ));
        }
        found.read_variables(root, &types)?;
        Ok(found)
    }

    fn read_variables(&mut self, root: Node<'_, '_>, types: &Types<'_>) -> Result<(), String> {
        for node in variables(root) {
            let list = match (node.attribute("causality"), node.attribute("variability")) {
                (Some("parameter"), Some("constant")) => continue,
                (Some("parameter"), _) => &mut self.parameters,
                (Some("input"), _) => &mut self.inputs,
                (Some("output"), _) => &mut self.outputs,
                _ => continue,
            };
            list.extend(FmuVariable::read(node, self.version, types)?);
        }
        Ok(())
    }

    /// Keeps what is named; of a kind that nothing is named of, all.
    pub fn select(&mut self, names: &[String]) -> Result<(), String> {
        let lists = [&mut self.parameters, &mut self.inputs, &mut self.outputs];
        let known: Vec<String> = (lists.iter())
            .flat_map(|list| list.iter().map(|v| v.name.clone()))
            .collect();
        if let Some(name) = names.iter().find(|name| !known.contains(name)) {
            return Err(format!(
                "no real parameter, input or output is called \"{name}\"; there are {}",
                known.join(", ")
            ));
        }
        for list in lists {
            if list.iter().any(|v| names.contains(&v.name)) {
                list.retain(|v| names.contains(&v.name));
            }
        }
        Ok(())
    }

    /// Step, length and, where all inputs have two limits, random levels between these, by the names of `signals`.
    pub fn plan(&self, signals: &Signals) -> RecordPlan {
        let span = (self.stop.map(|stop| stop - self.start)).filter(|span| *span > 0.0);
        let step = (self.step.filter(|step| *step > 0.0))
            .or(span.map(|span| span / SAMPLES))
            .unwrap_or(0.01);
        let intervals = span.map_or(SAMPLES, |span| (span / step).round());
        let samples = (intervals as usize).saturating_add(1);
        let hold = (samples / HOLDS).max(1);
        let levels = |(v, input): (&FmuVariable, &Quantity)| {
            let levels = Interval::new(v.min?, v.max?).ok()?;
            Some((input.name.clone(), InputPlan::Levels { levels, hold }))
        };
        let inputs = self.inputs.iter().zip(&signals.inputs);
        let plans: Option<Vec<_>> = inputs.map(levels).collect();
        match plans.filter(|plans| !plans.is_empty()) {
            Some(plans) => RecordPlan::by_input(step, samples, plans),
            None => RecordPlan::autonomous(step, samples),
        }
    }
}
