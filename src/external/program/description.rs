//! Description that a program gives of itself.

use super::super::name;
use super::inside::{Inside, check_record};
use super::once_each::OnceEach;
use crate::record::{Quantity, Signals};
use crate::setting::number;
use crate::storage::untrusted::{Keyed, all_keyed, keyed, message};
use crate::study::{RecordPlan, RecordTable};
use crate::twin::{DigitalTwin, Interval, Parameter, ParameterSpace};
use serde::Deserialize;
use serde_json::Value;

/// Most parameters, inputs or outputs of one program.
const MOST: usize = 1000;

/// The answer to `{"truetwin": 1, "request": "describe"}`, checked.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Description {
    /// Name of the twin.
    pub name: String,
    /// In the order of θ.
    pub parameters: ParameterSpace,
    /// Inputs and outputs.
    pub signals: Signals,
    /// Default plan of simulated records; a program that shows its equations may leave it out.
    pub record: Option<RecordPlan>,
    /// The equations, if the program shows them.
    pub inside: Option<Inside>,
}

/// As it stands in the line.
#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with name, parameters, outputs and record"
)]
struct Told {
    name: String,
    #[serde(deserialize_with = "all_keyed")]
    parameters: Vec<ToldParameter>,
    #[serde(default, deserialize_with = "all_keyed")]
    inputs: Vec<ToldQuantity>,
    #[serde(deserialize_with = "all_keyed")]
    outputs: Vec<ToldQuantity>,
    #[serde(deserialize_with = "keyed")]
    record: RecordTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with name and prior")]
struct ToldParameter {
    name: String,
    #[serde(default)]
    unit: String,
    prior: Interval,
    bounds: Option<Interval>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with name")]
struct ToldQuantity {
    name: String,
    #[serde(default)]
    unit: String,
}

impl Description {
    /// From the program's line; the error says what is wrong and what to write.
    pub fn parse(line: &str) -> Result<Self, String> {
        let wrong = |error: serde_json::Error| message(&error.to_string());
        let OnceEach(shown) = serde_json::from_str(line).map_err(wrong)?;
        if let Value::Object(shown) = &shown {
            Inside::check_keys(shown)?;
            if Inside::is_shown(shown) {
                return Self::with_inside(Inside::parse(shown)?);
            }
        }
        let Keyed::<Told>(told) = serde_json::from_str(line).map_err(wrong)?;
        name::check(&told.name).map_err(|problem| format!("name: {problem}"))?;
        let parameters = ParameterSpace::new(told.parameters.iter().map(|p| {
            let bounds = p.bounds.unwrap_or(p.prior);
            Parameter::new(&p.name, &p.unit, p.prior.low(), p.prior.high())
                .within(bounds.low(), bounds.high())
        }));
        let quantities = |all: &[ToldQuantity]| -> Vec<Quantity> {
            (all.iter())
                .map(|q| Quantity::new(&q.name, &q.unit))
                .collect()
        };
        let signals = Signals {
            inputs: quantities(&told.inputs),
            outputs: quantities(&told.outputs),
        };
        check_list("parameters", parameters.iter().map(|p| (&p.name, &p.unit)))?;
        check_list("inputs", signals.inputs.iter().map(|q| (&q.name, &q.unit)))?;
        check_list(
            "outputs",
            signals.outputs.iter().map(|q| (&q.name, &q.unit)),
        )?;
        if signals.outputs.is_empty() {
            return Err("no output; name at least one".into());
        }
        let channels = signals.inputs.iter().chain(&signals.outputs);
        let channels = channels.map(|channel| channel.name.as_str());
        let mut all = channels.chain(parameters.iter().map(|p| p.name.as_str()));
        name::check_all("parameters, inputs and outputs together", all.clone())?;
        if all.any(|name| name == "t") {
            return Err("a parameter or channel is called t, which is the time; rename it".into());
        }
        parameters.check().map_err(|error| error.to_string())?;
        let record = plan(&told.record)?;
        // Inputs may be left to a study file; all that is said is checked here.
        if signals.inputs.is_empty() || record.input.is_some() {
            record
                .prepare(&signals)
                .map_err(|error| error.to_string())?;
        }
        Ok(Self {
            name: told.name,
            parameters,
            signals,
            record: Some(record),
            inside: None,
        })
    }

    /// The description of a program that shows its equations.
    fn with_inside(inside: Inside) -> Result<Self, String> {
        let record = &inside.file.record;
        let record = match (record.step, record.samples) {
            (Some(step), Some(samples)) => Some(RecordPlan {
                input: record.input.clone(),
                ..RecordPlan::autonomous(step, samples)
            }),
            _ => None,
        };
        let description = Self {
            name: inside.name.clone(),
            parameters: inside.equations.parameters(),
            signals: inside.equations.signals(),
            record,
            inside: Some(inside),
        };
        description
            .parameters
            .check()
            .map_err(|error| error.to_string())?;
        Ok(description)
    }
}

/// Checks number, names and units of a list.
fn check_list<'a>(
    what: &str,
    list: impl ExactSizeIterator<Item = (&'a String, &'a String)> + Clone,
) -> Result<(), String> {
    if list.len() > MOST {
        return Err(format!("{} {what}; at most {MOST} are read", list.len()));
    }
    name::check_all(what, list.clone().map(|(name, _)| name.as_str()))?;
    for (_, unit) in list {
        name::check_unit(unit)?;
    }
    Ok(())
}

fn plan(table: &RecordTable) -> Result<RecordPlan, String> {
    let (Some(step), Some(samples)) = (table.step, table.samples) else {
        return Err(
            "record: step and samples are needed, as {\"step\": 0.1, \"samples\": 300}".into(),
        );
    };
    if !(step > 0.0 && step.is_normal()) || samples == 0 {
        return Err(format!(
            "record: step = {} s, samples = {samples}; choose at least one sample, and a step of at least 2.3e-308 s",
            number(step)
        ));
    }
    check_record(table)?;
    if table.hold.is_some() || table.integrator.is_some() || table.substeps.is_some() {
        return Err(
            "record: hold, integrator and substeps need the twin's equations, which this program does not show; leave them out"
                .into(),
        );
    }
    Ok(RecordPlan {
        input: table.input.clone(),
        ..RecordPlan::autonomous(step, samples)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::InputPlan;

    const GOOD: &str = r#"{"name": "lag", "parameters": [{"name": "tau", "unit": "s", "prior": [1, 3], "bounds": [0.1, 9]},
        {"name": "k", "prior": [0.5, 2]}], "inputs": [{"name": "u", "unit": "V"}], "outputs": [{"name": "y"}],
        "record": {"step": 0.1, "samples": 60, "input": {"levels": [-1, 1], "hold": 5}}}"#;

    #[test]
    fn a_description_is_read_whole() {
        let found = Description::parse(GOOD).unwrap();
        assert_eq!(found.name, "lag");
        assert_eq!(found.parameters.names(), ["tau", "k"]);
        assert_eq!(found.parameters[0].bounds, Interval::new(0.1, 9.0).unwrap());
        assert_eq!(found.parameters[1].bounds, found.parameters[1].prior);
        assert_eq!(found.signals.inputs, [Quantity::new("u", "V")]);
        assert_eq!(
            found.record,
            Some(RecordPlan::levels(0.1, 60, -1.0, 1.0, 5))
        );
    }

    #[test]
    fn each_input_may_have_its_plan() {
        let each = "{\"u\": {\"levels\": [-1, 1], \"hold\": 5}, \"v\": 60}";
        let text = (GOOD.replace("\"unit\": \"V\"}]", "\"unit\": \"V\"}, {\"name\": \"v\"}]"))
            .replace("{\"levels\": [-1, 1], \"hold\": 5}", each);
        let plans = [
            ("u", InputPlan::levels(-1.0, 1.0, 5)),
            ("v", InputPlan::Constant(60.0)),
        ];
        let expected = RecordPlan::by_input(0.1, 60, plans);
        assert_eq!(Description::parse(&text).unwrap().record, Some(expected));
        let message = Description::parse(&text.replace(", \"v\": 60", "")).unwrap_err();
        assert!(message.contains("v has no plan"), "{message}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (from, to, part) in [
            ("\"name\": \"lag\",", "", "missing key `name`"),
            ("\"lag\"", "\"a lag\"", "\"a lag\" contains ' '"),
            (
                "\"s\"",
                "\"\\u001b[2J\"",
                "the unit \"\\u{1b}[2J\" contains",
            ),
            ("\"k\"", "\"tau\"", "parameters: duplicate name tau"),
            ("[1, 3]", "[3, 1]", "invalid interval"),
            ("[0.1, 9]", "[2, 9]", "leaves its bounds"),
            ("[{\"name\": \"y\"}]", "[]", "no output"),
            (
                "[{\"name\": \"y\"}]",
                "[\"y\"]",
                "expected an object with name",
            ),
            ("\"samples\": 60,", "", "step and samples are needed"),
            ("0.1, \"samples\"", "-1, \"samples\"", "step = -1"),
            ("\"hold\": 5", "\"hold\": 0", "hold = 0"),
            (
                "{\"levels\": [-1, 1], \"hold\": 5}",
                "\"/etc/x.csv\"",
                "study file",
            ),
            (
                "{\"levels\": [-1, 1], \"hold\": 5}",
                "{\"u\": \"/etc/x.csv\"}",
                "study file",
            ),
            (
                "{\"levels\": [-1, 1], \"hold\": 5}",
                "{\"v\": 1}",
                "the twin has no input \"v\" (did you mean \"u\"?)",
            ),
            (
                "\"outputs\"",
                "\"outptus\"",
                "(did you mean \"outputs\"?); there are name,",
            ),
            ("\"inputs\"", "\"defines\"", "(did you mean \"define\"?)"),
            ("\"name\": \"y\"", "\"name\": \"u\"", "duplicate name u"),
            ("\"name\": \"y\"", "\"name\": \"k\"", "duplicate name k"),
            ("\"name\": \"y\"", "\"name\": \"t\"", "which is the time"),
            ("\"name\": \"k\"", "\"name\": \"t\"", "which is the time"),
            ("60,", "60, \"samples\": 70,", "\"samples\" stands twice"),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let message = Description::parse(&GOOD.replace(from, to)).unwrap_err();
            assert!(message.contains(part), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }

    /// Values without their keys would be read in an order that no page tells.
    #[test]
    fn lists_are_no_objects() {
        let name = "expected an object with name";
        for (from, to, part) in [
            (
                "{\"name\": \"k\", \"prior\": [0.5, 2]}",
                "[\"k\", \"\", [0.5, 2], null]",
                name,
            ),
            ("{\"name\": \"u\", \"unit\": \"V\"}", "[\"u\", \"V\"]", name),
            ("{\"name\": \"y\"}", "[\"y\", \"\"]", name),
            (
                "{\"step\": 0.1, \"samples\": 60, \"input\": {\"levels\": [-1, 1], \"hold\": 5}}",
                "[0.1, 60, {\"levels\": [-1, 1], \"hold\": 5}]",
                "expected a table with step",
            ),
            (
                GOOD,
                r#"["lag", [{"name": "k", "prior": [0.5, 2]}], [], [{"name": "y"}], {"step": 0.1, "samples": 60}]"#,
                "found a list, expected an object with name, parameters",
            ),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let message = Description::parse(&GOOD.replace(from, to)).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    /// Where a line is no JSON, or a value is wrong, that is told: neither another form of description, nor a line that nobody wrote.
    #[test]
    fn faults_of_equations_are_told_where_they_are() {
        const TEXT: &str = r#"{"name": "p", "parameters": {"a": {"prior": [0.1, 1]}}, "states": {"x": {"rate": "-a*x", "start": 1}},
            "outputs": {"y": {"value": "x", "noise": 0.1}}, "record": {"step": 0.1, "samples": 20}}"#;
        Description::parse(TEXT).unwrap();
        for (from, to, part) in [
            ("\"start\": 1}", "\"start\": 1,}", "trailing comma"),
            ("0.1}}", "NaN}}", "expected value at line"),
            (
                "\"start\": 1}",
                "\"start\": 1, \"start\": 2}",
                "\"start\" stands twice",
            ),
            ("20}}", "20}", "it ends inside an object"),
            ("20}}", "20}} {}", "trailing characters"),
            (
                "\"step\": 0.1",
                "\"step\": \"x\"",
                "record: step: found string",
            ),
        ] {
            assert!(TEXT.contains(from), "{from}");
            let message = Description::parse(&TEXT.replace(from, to)).unwrap_err();
            assert!(message.contains(part), "{message}");
            assert!(!message.contains("the description, line"), "{message}");
        }
    }
}
