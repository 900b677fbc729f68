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
        let message = ModelDescription::parse(&TWO.replace(from, to)).unwrap_err();
        assert!(message.contains(part) || part == "line", "{message}");
    }
}
