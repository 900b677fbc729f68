//! Model description, of either version of the standard.

use crate::record::Quantity;
use crate::storage::untrusted::message;
use crate::study::{InputPlan, RecordPlan};
use crate::twin::{Interval, Parameter};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;

/// Values beyond this mean "no limit": tools write 1e60 or the largest number.
const ENDLESS: f64 = 1e60;
/// Samples of a record whose step is not described.
const SAMPLES: f64 = 300.0;
/// Stretches of constant input in a record.
const HOLDS: usize = 15;

/// Version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

/// Used part of `modelDescription.xml`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ModelDescription {
    pub version: Version,
    /// As written: "2.0", "3.0.1".
    pub version_text: String,
    pub name: String,
    /// `guid` or `instantiationToken`.
    pub token: String,
    /// Name of the library.
    pub identifier: String,
    /// No more than one instance may exist.
    pub alone: bool,
    pub parameters: Vec<FmuVariable>,
    pub inputs: Vec<FmuVariable>,
    pub outputs: Vec<FmuVariable>,
    pub start: f64,
    pub stop: Option<f64>,
    pub step: Option<f64>,
}

/// A real scalar.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FmuVariable {
    pub name: String,
    pub unit: String,
    pub reference: u32,
    pub start: f64,
    pub min: Option<f64>,
    pub max: Option<f64>,
}

/// Attributes of a real variable or of its declared type.
#[derive(Default, Clone)]
struct Reals {
    unit: Option<String>,
    min: Option<f64>,
    max: Option<f64>,
}

impl Reals {
    fn of(node: Node<'_, '_>) -> Result<Self, String> {
        let limit = |name| Ok::<_, String>(number(node, name)?.filter(|v| v.abs() < ENDLESS));
        Ok(Self {
            unit: node.attribute("unit").map(str::to_owned),
            min: limit("min")?,
            max: limit("max")?,
        })
    }
}

fn number(node: Node<'_, '_>, name: &str) -> Result<Option<f64>, String> {
    let Some(text) = node.attribute(name) else {
        return Ok(None);
    };
    let of = || node.attribute("name").unwrap_or(node.tag_name().name());
    match text.trim().parse::<f64>() {
        Ok(value) if !value.is_nan() => Ok(Some(value)),
        _ => Err(format!("{name} = \"{text}\" of {} is no number", of())),
    }
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.has_tag_name(name))
}

fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str, String> {
    let tag = node.tag_name().name().to_owned();
    (node.attribute(name)).ok_or_else(|| format!("<{tag}> has no attribute {name}"))
}

impl ModelDescription {
    /// From the file's text; the error says what is missing.
    pub fn parse(text: &str) -> Result<Self, String> {
        Self::read(text).map_err(|problem| message(&problem))
    }

    fn read(text: &str) -> Result<Self, String> {
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
        let Some(simulation) = child(root, "CoSimulation") else {
            return Err(
                "it has no co-simulation, only model exchange; export it for co-simulation".into(),
            );
        };
        let experiment = child(root, "DefaultExperiment");
        let time = |name| experiment.map_or(Ok(None), |node| number(node, name));
        let once = simulation.attribute("canBeInstantiatedOnlyOncePerProcess");
        let mut found = Self {
            version,
            version_text: version_text.into(),
            name: attribute(root, "modelName")?.into(),
            token: attribute(root, token)?.into(),
            identifier: attribute(simulation, "modelIdentifier")?.into(),
            alone: once.is_some_and(|text| ["true", "1"].contains(&text)),
            parameters: Vec::new(),
            inputs: Vec::new(),
            outputs: Vec::new(),
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
        found.read_variables(root)?;
        Ok(found)
    }

    fn read_variables(&mut self, root: Node<'_, '_>) -> Result<(), String> {
        let mut types = BTreeMap::new();
        for node in child(root, "TypeDefinitions")
            .iter()
            .flat_map(|n| n.children())
        {
            let reals = match self.version {
                Version::Two => child(node, "Real"),
                Version::Three => Some(node).filter(|n| n.has_tag_name("Float64Type")),
            };
            if let (Some(reals), Some(name)) = (reals, node.attribute("name")) {
                types.insert(name, Reals::of(reals)?);
            }
        }
        for node in child(root, "ModelVariables")
            .iter()
            .flat_map(|n| n.children())
        {
            let reals = match self.version {
                Version::Two => child(node, "Real"),
                // Arrays have dimensions; they are left at their start.
                Version::Three => Some(node)
                    .filter(|n| n.has_tag_name("Float64") && child(*n, "Dimension").is_none()),
            };
            let Some(reals) = reals else { continue };
            let list = match (node.attribute("causality"), node.attribute("variability")) {
                (Some("parameter"), Some("constant")) => continue,
                (Some("parameter"), _) => &mut self.parameters,
                (Some("input"), _) => &mut self.inputs,
                (Some("output"), _) => &mut self.outputs,
                _ => continue,
            };
            let own = Reals::of(reals)?;
            let declared = reals.attribute("declaredType");
            let general = declared.and_then(|name| types.get(name)).cloned();
            let general = general.unwrap_or_default();
            let reference = attribute(node, "valueReference")?;
            list.push(FmuVariable {
                name: attribute(node, "name")?.into(),
                unit: own.unit.or(general.unit).unwrap_or_default(),
                reference: (reference.parse())
                    .map_err(|_| format!("valueReference = \"{reference}\" is no number"))?,
                start: number(reals, "start")?.unwrap_or(0.0),
                min: own.min.or(general.min),
                max: own.max.or(general.max),
            });
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
                "no real parameter, input or output is called {name}; there are {}",
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

    /// Step, length and, where all inputs have two limits, random levels between these.
    pub fn plan(&self) -> RecordPlan {
        let span = (self.stop.map(|stop| stop - self.start)).filter(|span| *span > 0.0);
        let step = (self.step.filter(|step| *step > 0.0))
            .or(span.map(|span| span / SAMPLES))
            .unwrap_or(0.01);
        let intervals = span.map_or(SAMPLES, |span| (span / step).round());
        let samples = (intervals as usize).saturating_add(1);
        let hold = (samples / HOLDS).max(1);
        let levels = |v: &FmuVariable| {
            let levels = Interval::new(v.min?, v.max?).ok()?;
            Some((v.name.clone(), InputPlan::Levels { levels, hold }))
        };
        let plans: Option<Vec<_>> = self.inputs.iter().map(levels).collect();
        match plans.filter(|plans| !plans.is_empty()) {
            Some(plans) => RecordPlan::by_input(step, samples, plans),
            None => RecordPlan::autonomous(step, samples),
        }
    }
}

impl FmuVariable {
    /// As a quantity.
    pub fn quantity(&self) -> Quantity {
        Quantity::new(&self.name, &self.unit)
    }

    /// Prior and bounds from `min` and `max`; without both, around `start`.
    pub fn parameter(&self) -> Parameter {
        let Self {
            name,
            unit,
            start,
            min,
            max,
            ..
        } = self;
        if let (Some(min), Some(max)) = (min, max) {
            return Parameter::new(name, unit, *min, *max);
        }
        let clip = |value: f64| {
            let raised = min.map_or(value, |min| value.max(min));
            max.map_or(raised, |max| raised.min(max))
        };
        let (near, far) = match *start {
            0.0 => ((-1.0, 1.0), (-10.0, 10.0)),
            s if s > 0.0 => ((0.5 * s, 1.5 * s), (0.1 * s, 10.0 * s)),
            s => ((1.5 * s, 0.5 * s), (10.0 * s, 0.1 * s)),
        };
        let bounds = (min.unwrap_or(far.0), max.unwrap_or(far.1));
        Parameter::new(name, unit, clip(near.0), clip(near.1)).within(bounds.0, bounds.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Mass" guid="{1}" vendorThing="x">
  <CoSimulation modelIdentifier="mass" canBeInstantiatedOnlyOncePerProcess="true"/>
  <TypeDefinitions><SimpleType name="Length"><Real unit="m" min="-2" max="2"/></SimpleType></TypeDefinitions>
  <DefaultExperiment startTime="1" stopTime="4" stepSize="0.1"/>
  <ModelVariables>
    <ScalarVariable name="m" valueReference="0" causality="parameter" variability="fixed"><Real start="2" unit="kg" min="0" max="1e60"/></ScalarVariable>
    <ScalarVariable name="g" valueReference="1" causality="parameter" variability="constant"><Real start="9.81"/></ScalarVariable>
    <ScalarVariable name="n" valueReference="2" causality="parameter"><Integer start="2"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="7" causality="input" canHandleMultipleSetPerTimeInstant="true"><Real start="0" declaredType="Length"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="8" causality="output"><Real declaredType="Length" unit="mm"/></ScalarVariable>
    <ScalarVariable name="v" valueReference="9"><Real/></ScalarVariable>
  </ModelVariables>
</fmiModelDescription>"#;

    #[test]
    fn the_second_version_is_read() {
        let found = ModelDescription::parse(TWO).unwrap();
        assert_eq!((found.version, found.alone), (Version::Two, true));
        let names = |list: &[FmuVariable]| list.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&found.parameters), ["m"]);
        assert_eq!(
            found.parameters[0].parameter(),
            Parameter::new("m", "kg", 1.0, 3.0).within(0.0, 20.0)
        );
        assert_eq!(found.inputs[0].quantity(), Quantity::new("u", "m"));
        assert_eq!(found.outputs[0].quantity(), Quantity::new("x", "mm"));
        let plans = [("u", InputPlan::levels(-2.0, 2.0, 2))];
        assert_eq!(found.plan(), RecordPlan::by_input(0.1, 31, plans));
    }

    #[test]
    fn the_third_version_is_read_and_arrays_are_left_alone() {
        let text = r#"<fmiModelDescription fmiVersion="3.0.1" modelName="M" instantiationToken="t">
            <CoSimulation modelIdentifier="m"/><ModelVariables>
            <Float64 name="k" valueReference="1" causality="parameter" unit="N/m" start="-4"/>
            <Float64 name="c" valueReference="2" causality="parameter" start="0"/>
            <Float64 name="A" valueReference="3" causality="parameter" start="1 2"><Dimension start="2"/></Float64>
            <Float64 name="y" valueReference="4" causality="output"/></ModelVariables></fmiModelDescription>"#;
        let mut found = ModelDescription::parse(text).unwrap();
        let parameters: Vec<_> = found
            .parameters
            .iter()
            .map(FmuVariable::parameter)
            .collect();
        assert_eq!(
            parameters[0],
            Parameter::new("k", "N/m", -6.0, -2.0).within(-40.0, -0.4)
        );
        assert_eq!(
            parameters[1],
            Parameter::new("c", "", -1.0, 1.0).within(-10.0, 10.0)
        );
        assert_eq!(parameters.len(), 2);
        assert_eq!(found.plan(), RecordPlan::autonomous(0.01, 301));
        found.select(&["c".into()]).unwrap();
        assert_eq!((found.parameters.len(), found.outputs.len()), (1, 1));
        let message = found.select(&["k".into()]).unwrap_err();
        assert!(message.contains("there are c, y"), "{message}");
    }

    #[test]
    fn what_cannot_be_used_is_named() {
        for (from, to, part) in [
            ("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\"", "FMI 1.0"),
            (
                "CoSimulation",
                "ModelExchange",
                "export it for co-simulation",
            ),
            (
                "modelIdentifier=\"mass\"",
                "",
                "no attribute modelIdentifier",
            ),
            (
                "modelIdentifier=\"mass\"",
                "modelIdentifier=\"../../mass\"",
                "is no name of a library",
            ),
            (
                "min=\"0\"",
                "min=\"none\"",
                "min = \"none\" of Real is no number",
            ),
            ("</fmiModelDescription>", "", "line"),
        ] {
            let message = ModelDescription::parse(&TWO.replace(from, to)).unwrap_err();
            assert!(message.contains(part) || part == "line", "{message}");
        }
    }
}
