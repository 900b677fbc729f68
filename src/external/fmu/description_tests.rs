//! Descriptions that are read, chosen and refused.

use super::description::*;
use super::variable::*;
use crate::record::{Quantity, Signals};
use crate::study::{InputPlan, RecordPlan};
use crate::twin::Parameter;

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

fn signals(found: &ModelDescription) -> Signals {
    Signals {
        inputs: found.inputs.iter().map(FmuVariable::quantity).collect(),
        outputs: Vec::new(),
    }
}

#[test]
fn the_second_version_is_read() {
    let found = ModelDescription::parse(TWO, false).unwrap();
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
    assert_eq!(
        found.plan(&signals(&found)),
        RecordPlan::by_input(0.1, 31, plans)
    );
}

#[test]
fn the_third_version_is_read_and_arrays_are_left_alone() {
    let text = r#"<fmiModelDescription fmiVersion="3.0.1" modelName="M" instantiationToken="t">
            <CoSimulation modelIdentifier="m"/><ModelVariables>
            <Float64 name="k" valueReference="1" causality="parameter" unit="N/m" start="-4"/>
            <Float64 name="c" valueReference="2" causality="parameter" start="0"/>
            <Float64 name="A" valueReference="3" causality="parameter" start="1 2"><Dimension start="2"/></Float64>
            <Float64 name="y" valueReference="4" causality="output"/></ModelVariables></fmiModelDescription>"#;
    let mut found = ModelDescription::parse(text, false).unwrap();
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
    assert_eq!(
        found.plan(&signals(&found)),
        RecordPlan::autonomous(0.01, 301)
    );
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
            "no continuous states; export it for co-simulation",
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
        let message = ModelDescription::parse(&TWO.replace(from, to), false).unwrap_err();
        assert!(message.contains(part) || part == "line", "{message}");
    }
}

/// States of the second version go by place, those of the third by reference; derivatives say the order.
#[test]
fn states_are_those_that_the_structure_lists() {
    let two = r#"<fmiModelDescription fmiVersion="2.0" modelName="M" guid="g" numberOfEventIndicators="3">
        <ModelExchange modelIdentifier="m"/><CoSimulation modelIdentifier="c"/><ModelVariables>
        <ScalarVariable name="x" valueReference="7" description="way"><Real start="2" unit="m" min="0"/></ScalarVariable>
        <ScalarVariable name="n" valueReference="1"><Integer start="2"/></ScalarVariable>
        <ScalarVariable name="v" valueReference="8"><Real/></ScalarVariable>
        <ScalarVariable name="der(x)" valueReference="9"><Real derivative="1"/></ScalarVariable>
        <ScalarVariable name="der(v)" valueReference="10"><Real derivative="3"/></ScalarVariable></ModelVariables>
        <ModelStructure><Derivatives><Unknown index="5"/><Unknown index="4"/></Derivatives></ModelStructure></fmiModelDescription>"#;
    let three = r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="t">
        <ModelExchange modelIdentifier="m"/><ModelVariables>
        <Float64 name="x" valueReference="7" description="way" start="2" unit="m" min="0"/>
        <Float64 name="v" valueReference="8" derivative="7"/>
        <Float64 name="der(v)" valueReference="9" derivative="8"/></ModelVariables>
        <ModelStructure><ContinuousStateDerivative valueReference="9"/><ContinuousStateDerivative valueReference="8"/>
        <EventIndicator valueReference="3"/><EventIndicator valueReference="4"/><EventIndicator valueReference="5"/></ModelStructure>
        </fmiModelDescription>"#;
    for text in [two, three] {
        let found = ModelDescription::parse(text, false).unwrap();
        assert_eq!(found.interface, Interface::ModelExchange);
        assert_eq!((found.identifier.as_str(), found.indicators), ("m", 3));
        let [v, x] = &found.states[..] else {
            panic!("{:?}", found.states)
        };
        assert_eq!((v.name.as_str(), v.reference), ("v", 8));
        assert_eq!((x.name.as_str(), x.reference, x.start), ("x", 7, 2.0));
        assert_eq!(
            (x.description.as_str(), x.unit.as_str(), x.min),
            ("way", "m", Some(0.0))
        );
    }
    // Its own steps may be asked for, where it has them.
    let stepped = ModelDescription::parse(two, true).unwrap();
    assert_eq!(
        (stepped.interface, stepped.identifier.as_str()),
        (Interface::CoSimulation, "c")
    );
    let message = ModelDescription::parse(three, true).unwrap_err();
    assert!(message.contains("no co-simulation"), "{message}");
    // Equations that cannot be run give way to steps.
    for (from, to) in [
        ("<Unknown index=\"5\"/>", "<Unknown index=\"2\"/>"),
        (
            "<ModelExchange ",
            "<ModelExchange canBeInstantiatedOnlyOncePerProcess=\"true\" ",
        ),
    ] {
        let found = ModelDescription::parse(&two.replace(from, to), false).unwrap();
        assert_eq!(
            (found.interface, found.indicators),
            (Interface::CoSimulation, 0)
        );
    }
    let alone = three.replace(
        "<ContinuousStateDerivative valueReference=\"9\"/>",
        "<ContinuousStateDerivative valueReference=\"70\"/>",
    );
    let message = ModelDescription::parse(&alone, false).unwrap_err();
    assert!(
        message.contains("valueReference=\"70\"") && message.contains("for co-simulation"),
        "{message}"
    );
}
