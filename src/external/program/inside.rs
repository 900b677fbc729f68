//! Equations in a program's description: the tables of a study file as JSON, and what the program computes of them itself.

use super::super::name;
use crate::equations::Equations;
use crate::setting::did_you_mean;
use crate::storage::untrusted::{excerpt, message};
use crate::study::{RecordTable, Study, StudyError, StudyFile};
use serde_json::{Map, Value};
use std::path::Path;

/// Keys of a description that show the twin's inside.
const SIGNS: [&str; 4] = ["states", "define", "constants", SERVES];
/// All keys of such a description, but for the name, in the order of a study file.
const KEYS: [&str; 8] = [
    "parameters",
    "constants",
    "define",
    "states",
    "inputs",
    "outputs",
    "record",
    SERVES,
];
/// Key of the list of methods.
const SERVES: &str = "serves";
/// The one that says that the program simulates, too, as one without an inside does.
const SIMULATES: &str = "simulate";

/// A method of the equations that the program computes for blocks of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ServedMethod {
    /// Rates of the states.
    Drift,
    /// States at the next sample.
    Next,
    /// Outputs without noise.
    Observe,
}

impl ServedMethod {
    const ALL: [Self; 3] = [Self::Drift, Self::Next, Self::Observe];

    /// Name in requests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Drift => "drift",
            Self::Next => "next",
            Self::Observe => "observe",
        }
    }

    /// Table and key that it computes.
    fn computes(self) -> (&'static str, &'static str) {
        match self {
            Self::Drift => ("states", "rate"),
            Self::Next => ("states", "next"),
            Self::Observe => ("outputs", "value"),
        }
    }
}

/// The inside of a twin as its program describes it.
#[derive(Debug, Clone)]
pub(super) struct Inside {
    /// Name of the twin.
    pub name: String,
    /// The description as a study file. What the program serves is 0 in it.
    pub file: StudyFile,
    /// The equations of the file.
    pub equations: Equations,
    /// Methods that the program computes; none of a twin that is text.
    pub serves: Vec<ServedMethod>,
    /// The program answers `simulate`, too.
    pub simulates: bool,
}

impl PartialEq for Inside {
    fn eq(&self, other: &Self) -> bool {
        (&self.serves, self.simulates) == (&other.serves, other.simulates)
            && self.equations.text() == other.equations.text()
            && self.file.record == other.file.record
    }
}

/// A study file while it is written.
#[derive(Default)]
struct TableWriter {
    text: String,
    /// The place that each line is of.
    places: Vec<String>,
}

impl TableWriter {
    fn line(&mut self, place: String, line: &str) {
        self.text += line;
        self.text.push('\n');
        self.places.push(place);
    }

    fn table(&mut self, name: &str, entries: &[(String, Value)]) -> Result<(), String> {
        self.line(name.into(), &format!("[{name}]"));
        for (key, value) in entries {
            let place = format!("{name}: {}", excerpt(key));
            let value = inline(value).map_err(|problem| format!("{place}: {problem}"))?;
            self.line(place, &format!("{} = {value}", quoted(key)));
        }
        Ok(())
    }
}

impl Inside {
    /// Returns whether a description shows the twin's inside.
    pub fn is_shown(told: &Map<String, Value>) -> bool {
        SIGNS.iter().any(|key| told.contains_key(*key))
    }

    /// Checks that a description has no other keys than those of one with an inside, which are all that there are.
    pub fn check_keys(told: &Map<String, Value>) -> Result<(), String> {
        let unknown = (told.keys()).find(|key| *key != "name" && !KEYS.contains(&key.as_str()));
        match unknown {
            None => Ok(()),
            Some(key) => Err(format!(
                "unknown key `{}`{}; there are name, {}",
                excerpt(key),
                did_you_mean(key, KEYS),
                KEYS.join(", ")
            )),
        }
    }

    /// Reads a description; the error says what is wrong and what to write.
    pub fn parse(told: &Map<String, Value>) -> Result<Self, String> {
        let Some(name) = told.get("name").and_then(Value::as_str) else {
            return Err("missing key `name`; give the twin one".into());
        };
        name::check(name).map_err(|problem| format!("name: {problem}"))?;
        let (serves, simulates) = serves(told.get(SERVES))?;
        let mut writer = TableWriter::default();
        writer.line("name".into(), &format!("[twin]\nname = {}", quoted(name)));
        writer.places.push("name".into());
        for table in KEYS.into_iter().filter(|key| *key != SERVES) {
            let Some(value) = told.get(table) else {
                continue;
            };
            let mut entries = entries(table, value)?;
            for method in &serves {
                let (of, key) = method.computes();
                if of == table {
                    leave_open(&mut entries, (table, key), method.name())?;
                }
            }
            writer.table(table, &entries)?;
        }
        let needed = ["states", "outputs"];
        if let Some(table) = needed.iter().find(|table| !told.contains_key(**table)) {
            return Err(format!("{table}: the twin has none; give one or more"));
        }
        // The lines are of a text that nobody has written.
        let at = |line: usize, problem: &str| {
            let place = writer.places.get(line - 1).map_or("", String::as_str);
            format!("{place}: {problem}")
        };
        let equations =
            Equations::parse(&writer.text).map_err(|error| at(error.line(), error.problem()))?;
        let wrong = |error| match error {
            StudyError::Syntax { line, message, .. } => at(line, &message),
            StudyError::At { line, error, .. } => at(line, &error.to_string()),
            other => message(&other.to_string()),
        };
        let file = StudyFile::parse(&writer.text, Path::new("the description")).map_err(wrong)?;
        check_record(&file.record)?;
        Study::of_file(&file).map_err(wrong)?;
        Ok(Self {
            name: name.into(),
            file,
            equations,
            serves,
            simulates,
        })
    }
}

/// Checks that a record has nothing of files: a program has no folder for them, and does not know how those of a user name their columns.
pub(super) fn check_record(record: &RecordTable) -> Result<(), String> {
    if !record.columns.is_empty() {
        return Err(
            "record: columns are those of a user's files; leave them to a study file".into(),
        );
    }
    let files = (record.input.iter()).flat_map(|input| input.files());
    match files.into_iter().next() {
        None => Ok(()),
        Some((_, path)) => Err(format!(
            "record: input is the file {}; say {{\"levels\": [low, high], \"hold\": n}}, and name files in a study file",
            path.display()
        )),
    }
}

/// Reads the methods that a program serves, and whether it simulates.
fn serves(value: Option<&Value>) -> Result<(Vec<ServedMethod>, bool), String> {
    let names = match value {
        None => return Ok((vec![], false)),
        Some(Value::Array(names)) => names.clone(),
        Some(name) => vec![name.clone()],
    };
    let (mut methods, mut simulates) = (vec![], false);
    for name in &names {
        if !simulates && name.as_str() == Some(SIMULATES) {
            simulates = true;
            continue;
        }
        let method =
            (ServedMethod::ALL.into_iter()).find(|method| name.as_str() == Some(method.name()));
        match method {
            Some(method) if !methods.contains(&method) => methods.push(method),
            _ => {
                return Err(format!(
                    "serves: {}; give drift or next, observe, simulate, or several as a list, each once",
                    excerpt(&name.to_string())
                ));
            }
        }
    }
    match methods.contains(&ServedMethod::Drift) && methods.contains(&ServedMethod::Next) {
        true => Err("serves: drift and next; states have rates or next values, not both".into()),
        false => Ok((methods, simulates)),
    }
}

/// Returns the entries of a table: an object, or a list of objects with names.
fn entries(table: &str, value: &Value) -> Result<Vec<(String, Value)>, String> {
    let list = match value {
        Value::Object(map) => {
            let entries = map.iter().map(|(key, value)| (key.clone(), value.clone()));
            return entries.map(|entry| with_unit(table, entry)).collect();
        }
        Value::Array(list) if !["constants", "define", "record"].contains(&table) => list,
        _ => {
            return Err(format!(
                "{table}: write an object, a name and its value each"
            ));
        }
    };
    let mut entries: Vec<(String, Value)> = vec![];
    for value in list {
        let mut keys = value.as_object().cloned().unwrap_or_default();
        let Some(Value::String(name)) = keys.shift_remove("name") else {
            return Err(format!("{table}: expected an object with name"));
        };
        if entries.iter().any(|(other, _)| *other == name) {
            let name = excerpt(&name);
            return Err(format!("{table}: duplicate name {name}; rename one"));
        }
        entries.push(with_unit(table, (name, Value::Object(keys)))?);
    }
    Ok(entries)
}

/// Checks the unit of an entry.
fn with_unit(table: &str, entry: (String, Value)) -> Result<(String, Value), String> {
    if let Some(unit) = entry.1.get("unit").and_then(Value::as_str) {
        name::check_unit(unit).map_err(|problem| format!("{table}: {problem}"))?;
    }
    Ok(entry)
}

/// Gives entries a 0 for what the program computes.
fn leave_open(
    entries: &mut [(String, Value)],
    (table, key): (&str, &str),
    method: &str,
) -> Result<(), String> {
    for (name, value) in entries {
        let name = excerpt(name);
        let Some(keys) = value.as_object_mut() else {
            return Err(format!("{table}: {name}: expected an object"));
        };
        if keys.insert(key.into(), 0.into()).is_some() {
            return Err(format!(
                "{table}: {name} has {key}, and {method} is served; leave one out"
            ));
        }
    }
    Ok(())
}

/// A text as JSON and TOML both have it.
fn quoted(text: &str) -> String {
    Value::from(text).to_string()
}

/// A value in one line of TOML.
fn inline(value: &Value) -> Result<String, String> {
    Ok(match value {
        Value::Null => return Err("null is no value; leave the key out".into()),
        Value::Array(all) => {
            let all: Vec<String> = all.iter().map(inline).collect::<Result<_, _>>()?;
            format!("[{}]", all.join(", "))
        }
        Value::Object(entries) => {
            let mut all = vec![];
            for (key, value) in entries {
                let value = match (key.as_str(), value) {
                    ("limits", Value::Array(ends)) => limits(ends)?,
                    _ => inline(value)?,
                };
                all.push(format!("{} = {value}", quoted(key)));
            }
            format!("{{ {} }}", all.join(", "))
        }
        // Their words and escapes are those of TOML.
        value => value.to_string(),
    })
}

/// Limits, of which null is an open end: JSON has no infinity.
fn limits(ends: &[Value]) -> Result<String, String> {
    let open = ["-inf", "inf"];
    let mut all = vec![];
    for (i, end) in ends.iter().enumerate() {
        all.push(match (end, open.get(i)) {
            (Value::Null, Some(open)) => (*open).to_owned(),
            _ => inline(end)?,
        });
    }
    Ok(format!("[{}]", all.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::{DigitalTwin, Integrator, Twin};

    const PENDULUM: &str = r#"{"name": "pendulum", "parameters": [{"name": "l", "unit": "m", "prior": [0.5, 2]}],
        "constants": {"g": 9.81}, "define": {"pull": "g/l*sin(q)"},
        "states": {"q": {"rate": "v", "start": 0.3, "limits": [null, 3.2]}, "v": {"rate": "-pull + u", "noise": {"std": 0.01, "per": "second"}}},
        "inputs": [{"name": "u"}], "outputs": {"y": {"unit": "rad", "value": "q", "noise": 0.02}},
        "record": {"step": 0.05, "samples": 60, "input": {"levels": [-1, 1], "hold": 5}, "integrator": "euler"}}"#;

    fn parse(text: &str) -> Result<Inside, String> {
        Inside::parse(
            serde_json::from_str::<Value>(text)
                .unwrap()
                .as_object()
                .unwrap(),
        )
    }

    #[test]
    fn the_tables_of_a_description_are_those_of_a_study_file() {
        let inside = parse(PENDULUM).unwrap();
        let expected = r#"
            [twin]
            name = "pendulum"
            [parameters]
            l = { unit = "m", prior = [0.5, 2] }
            [constants]
            g = 9.81
            [define]
            pull = "g/l*sin(q)"
            [states]
            q = { rate = "v", start = 0.3, limits = [-inf, 3.2] }
            v = { rate = "-pull + u", noise = { std = 0.01, per = "second" } }
            [inputs]
            u = {}
            [outputs]
            y = { unit = "rad", value = "q", noise = 0.02 }
            [record]
            step = 0.05
            samples = 60
            integrator = "euler"
            input = { levels = [-1, 1], hold = 5 }
        "#;
        let file = StudyFile::parse(expected, Path::new("s.toml")).unwrap();
        let own = file.own_equations().unwrap();
        assert_eq!(inside.equations.text(), own.text());
        assert_eq!(inside.file.record, file.record);
        let twin = Twin::new(inside.equations.clone());
        assert_eq!(twin.integration().unwrap().0, Integrator::Euler);
    }

    #[test]
    fn what_is_served_is_left_open_in_the_text() {
        let served = PENDULUM
            .replace("\"rate\": \"v\", ", "")
            .replace("\"rate\": \"-pull + u\", ", "")
            .replace(
                "\"name\": \"pendulum\"",
                "\"name\": \"p\", \"serves\": \"drift\"",
            );
        let inside = parse(&served).unwrap();
        assert_eq!(inside.serves, [ServedMethod::Drift]);
        assert_eq!(inside.equations.signals().outputs[0].name, "y");
        assert!(!inside.simulates);
        let simulating = served.replace("\"drift\"", "[\"drift\", \"simulate\"]");
        let inside = parse(&simulating).unwrap();
        assert_eq!(
            (&inside.serves[..], inside.simulates),
            (&[ServedMethod::Drift][..], true)
        );
        let both = served.replace("\"drift\"", "[\"next\", \"observe\"]");
        let problem = parse(&both).unwrap_err();
        assert!(
            problem.contains("outputs: y has value, and observe is served"),
            "{problem}"
        );
    }

    #[test]
    fn what_is_wrong_is_named_with_its_table() {
        const SERVING: &str = r#"{"name": "p", "serves": "drift", "outputs": {"y": {"value": 1}}}"#;
        for (from, to, part) in [
            (
                "\"v\", \"start\"",
                "\"vv\", \"start\"",
                "states: q: unknown name \"vv\" (did you mean \"v\"?)",
            ),
            ("\"rate\": \"v\", ", "", "q has no rate"),
            ("\"name\": \"pendulum\", ", "", "missing key `name`"),
            ("{\"g\": 9.81}", "{\"g\": null}", "constants: g: null"),
            (
                "[{\"name\": \"u\"}]",
                "[\"u\"]",
                "inputs: expected an object with name",
            ),
            (
                "{\"levels\": [-1, 1], \"hold\": 5}",
                "\"/etc/x.csv\"",
                "study file",
            ),
            ("\"euler\"", "\"eulre\"", "unknown integrator"),
            ("60", "0", "record: samples: samples = 0"),
            (
                "\"euler\"",
                "\"euler\", \"columns\": {\"t\": \"time\"}",
                "record: columns are those of a user's files",
            ),
            ("0.05", "-1", "record: step: step = -1 s"),
            (
                "\"euler\"",
                "\"euler\", \"substeps\": 0",
                "record: substeps: substeps = 0; choose a whole number between",
            ),
            ("\"rad\"", "\"\\u001b[2J\"", "outputs: the unit"),
            (
                "{\"name\": \"pendulum\"",
                "{\"serves\": \"drfit\", \"name\": \"p\"",
                "serves: \"drfit\"; give drift or next",
            ),
            (
                "{\"name\": \"pendulum\"",
                "{\"serves\": \"drift\", \"name\": \"p\"",
                "states: q has rate, and drift is served",
            ),
            (PENDULUM, SERVING, "states: the twin has none"),
        ] {
            assert!(PENDULUM.contains(from), "{from}");
            let problem = parse(&PENDULUM.replacen(from, to, 1)).unwrap_err();
            assert!(problem.contains(part), "{problem}");
            assert!(!problem.contains('\n'), "{problem}");
        }
    }
}
