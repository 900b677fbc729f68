//! The lines that go to a program and come from it.

use super::description::Description;
use crate::record::{Drive, Signal, Signals};
use crate::setting::{count, number};
use crate::storage::untrusted::{Keyed, excerpt, message};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// The version of the protocol, told with the first request.
const VERSION: u32 = 1;
/// Longest description, in bytes.
pub(super) const LONGEST_DESCRIPTION: usize = 1 << 20;

/// The line that asks a program what it is.
pub(super) fn describe() -> String {
    format!("{{\"truetwin\": {VERSION}, \"request\": \"describe\"}}\n")
}

/// Values by name, written as an object in the given order.
struct Named<'a, V>(Vec<(&'a str, V)>);

impl<V: Serialize> Serialize for Named<'_, V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

#[derive(Serialize)]
struct SimulateRequest<'a> {
    request: &'static str,
    id: u64,
    theta: Named<'a, f64>,
    step: f64,
    samples: usize,
    /// Time of the first sample, where it is not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<f64>,
    inputs: Named<'a, Vec<f64>>,
    seed: Option<u64>,
}

/// The line that asks for one run; numbers survive it bit for bit.
pub(super) fn simulate(
    id: u64,
    description: &Description,
    theta: &[f64],
    drive: &Drive,
    seed: Option<u64>,
) -> String {
    let names = description.parameters.names();
    let inputs = &description.signals.inputs;
    let columns = drive.inputs().columns().into_iter();
    let request = SimulateRequest {
        request: "simulate",
        id,
        theta: Named(names.into_iter().zip(theta.iter().copied()).collect()),
        step: drive.dt(),
        samples: drive.samples(),
        start: Some(drive.first_time()).filter(|start| *start != 0.0),
        inputs: Named(
            (inputs.iter())
                .map(|q| q.name.as_str())
                .zip(columns.map(|c| c.to_vec()))
                .collect(),
        ),
        seed,
    };
    // Plain numbers and strings: nothing here can fail to be written.
    let mut line = serde_json::to_string(&request).unwrap_or_default();
    line.push('\n');
    line
}

/// Longest line that can be an honest answer: 32 bytes a number, names, an error's text.
pub(super) fn longest_answer(signals: &Signals, samples: usize) -> usize {
    let names: usize = signals.outputs.iter().map(|q| q.name.len() + 16).sum();
    (32 * samples)
        .saturating_mul(signals.outputs.len())
        .saturating_add(names + (1 << 16))
}

/// ProgramAnswer of a program to a simulation.
#[derive(Debug, PartialEq)]
pub(super) enum ProgramAnswer {
    /// Outputs, samples × channels, all finite.
    Outputs(Signal),
    /// The run left the finite numbers at this time, in seconds.
    Diverged(f64),
    /// The program says that it cannot go on.
    Error(String),
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with id and outputs, diverged or error"
)]
struct ToldAnswer {
    id: u64,
    outputs: Option<ToldOutputs>,
    diverged: Option<f64>,
    error: Option<String>,
}

/// Outputs by name, each once.
#[derive(Debug)]
struct ToldOutputs(BTreeMap<String, Vec<Option<f64>>>);

impl<'de> Deserialize<'de> for ToldOutputs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EachOnce;
        impl<'de> Visitor<'de> for EachOnce {
            type Value = BTreeMap<String, Vec<Option<f64>>>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object with a list of numbers for each output")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut all = BTreeMap::new();
                while let Some((name, values)) = map.next_entry::<String, _>()? {
                    if all.contains_key(&name) {
                        let name = excerpt(&name);
                        return Err(A::Error::custom(format!("output {name} is given twice")));
                    }
                    all.insert(name, values);
                }
                Ok(all)
            }
        }
        deserializer.deserialize_map(EachOnce).map(Self)
    }
}

/// Checks that an answer is that of request `id`.
pub(super) fn check_id(told: u64, id: u64) -> Result<(), String> {
    match told == id {
        true => Ok(()),
        false => Err(format!(
            "the answer has id {told}, the request has {id}; answer each request once, in order"
        )),
    }
}

/// Returns what a program says of why it cannot go on, in one line.
pub(super) fn error_text(told: &str) -> Result<String, String> {
    match excerpt(told) {
        text if text.is_empty() => Err("error is empty; say in it what is wrong".into()),
        text => Ok(text),
    }
}

/// Reads the answer to request `id`; the error says what is wrong with it and what to answer instead.
pub(super) fn answer(
    line: &str,
    id: u64,
    signals: &Signals,
    drive: &Drive,
) -> Result<ProgramAnswer, String> {
    let Keyed::<ToldAnswer>(told) = match serde_json::from_str(line) {
        Ok(told) => told,
        Err(error) => serde_json::from_str(&finite_only(line)).map_err(|_| {
            let error = message(&error.to_string());
            format!("{error}; write answers alone to standard output, one line each, and all else to standard error")
        })?,
    };
    check_id(told.id, id)?;
    match (told.outputs, told.diverged, told.error) {
        (Some(outputs), None, None) => stack(outputs.0, signals, drive),
        (None, Some(at), None) => {
            let end = drive.time(drive.samples());
            // The end as the program computes it may differ in its last bits.
            if (0.0..=end * (1.0 + 1e-9)).contains(&at) {
                Ok(ProgramAnswer::Diverged(at))
            } else {
                Err(format!(
                    "diverged = {}; give a time between 0 and {} s, the end of the record",
                    number(at),
                    number(end)
                ))
            }
        }
        (None, None, Some(text)) => error_text(&text).map(ProgramAnswer::Error),
        _ => Err(
            "exactly one of outputs, diverged (a number, the time in seconds) and error is needed; leave the others out"
                .into(),
        ),
    }
}

/// Channels by name as a signal; what is not finite is a divergence at its time.
fn stack(
    mut outputs: BTreeMap<String, Vec<Option<f64>>>,
    signals: &Signals,
    drive: &Drive,
) -> Result<ProgramAnswer, String> {
    let samples = drive.samples();
    let mut signal = Signal::zeros((samples, signals.outputs.len()));
    let mut bad = samples;
    for (quantity, mut column) in signals.outputs.iter().zip(signal.columns_mut()) {
        let name = &quantity.name;
        let Some(values) = outputs.remove(name) else {
            return Err(format!("outputs lack {name}; give each output"));
        };
        if values.len() != samples {
            let given = values.len();
            return Err(format!(
                "output {name} has {}, for {}; give one number a sample",
                count(given, "value"),
                count(samples, "sample")
            ));
        }
        for (k, (to, value)) in column.iter_mut().zip(values).enumerate() {
            match value {
                Some(value) => *to = value,
                None => bad = bad.min(k),
            }
        }
    }
    if let Some(name) = outputs.keys().next() {
        return Err(format!(
            "{} is no output of this twin; leave it out, or describe it",
            excerpt(name)
        ));
    }
    Ok(match bad < samples {
        true => ProgramAnswer::Diverged(drive.time(bad)),
        false => ProgramAnswer::Outputs(signal),
    })
}

/// A line whose NaN and Infinity, which JSON has not but many writers write, are null.
fn finite_only(line: &str) -> String {
    let mut fixed = String::with_capacity(line.len());
    let mut rest = line;
    let mut quoted = false;
    while let Some(c) = rest.chars().next() {
        let mut taken = c.len_utf8();
        if quoted && c == '\\' {
            taken += rest[1..].chars().next().map_or(0, char::len_utf8);
        } else if c == '"' {
            quoted = !quoted;
        } else if !quoted && c.is_ascii_alphabetic() {
            taken = rest
                .find(|c: char| !c.is_ascii_alphabetic())
                .unwrap_or(rest.len());
            let word = rest[..taken].to_ascii_lowercase();
            if ["nan", "inf", "infinity"].contains(&word.as_str()) {
                while fixed.ends_with(['-', '+']) {
                    fixed.pop();
                }
                fixed.push_str("null");
                rest = &rest[taken..];
                continue;
            }
        }
        fixed.push_str(&rest[..taken]);
        rest = &rest[taken..];
    }
    fixed
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<ProgramAnswer, String> {
        let drive = Drive::autonomous(0.5, 3).unwrap();
        answer(line, 7, &Signals::default(), &drive)
    }

    #[test]
    fn a_request_is_one_line_and_loses_no_bit() {
        let values = [0.1 + 0.2, -1e-310, 1.0, 5e300 / 3.0];
        let inputs = Signal::from_shape_vec((4, 1), values.to_vec()).unwrap();
        let drive = Drive::new(1.0 / 3.0, inputs).unwrap();
        let line = r#"{"name": "two", "parameters": [{"name": "b", "prior": [0, 1]}, {"name": "a", "prior": [0, 3]}],
            "inputs": [{"name": "u", "unit": "V"}], "outputs": [{"name": "y"}], "record": {"step": 0.1, "samples": 9}}"#;
        let description = Description::parse(line).unwrap();
        let line = simulate(3, &description, &[1.0 / 7.0, 2.0], &drive, None);
        assert_eq!(line.matches('\n').count(), 1);
        assert!(
            line.starts_with("{\"request\":\"simulate\",\"id\":3,\"theta\":{\"b\":"),
            "{line}"
        );
        assert!(line.ends_with("\"seed\":null}\n"), "{line}");
        let back: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert_eq!(back["theta"]["b"].as_f64(), Some(1.0 / 7.0));
        assert_eq!(back["step"].as_f64(), Some(1.0 / 3.0));
        assert!(back.get("start").is_none());
        let late = drive.clone().beginning_at(100.5);
        let late = simulate(3, &description, &[1.0 / 7.0, 2.0], &late, None);
        assert!(
            late.contains("\"samples\":4,\"start\":100.5,\"inputs\""),
            "{late}"
        );
        for (k, value) in values.iter().enumerate() {
            assert_eq!(back["inputs"]["u"][k].as_f64(), Some(*value));
        }
    }

    #[test]
    fn answers_are_read() {
        let outputs = read(r#"{"id": 7, "outputs": {"y": [1, 0.25, -3e-7]}}"#).unwrap();
        let expected = Signal::from_shape_vec((3, 1), vec![1.0, 0.25, -3e-7]).unwrap();
        assert_eq!(outputs, ProgramAnswer::Outputs(expected));
        assert_eq!(
            read(r#"{"id": 7, "diverged": 1.2}"#),
            Ok(ProgramAnswer::Diverged(1.2))
        );
        for odd in ["-1", "1.6", "1e300"] {
            let error = read(&format!(r#"{{"id": 7, "diverged": {odd}}}"#)).unwrap_err();
            assert!(error.contains("between 0 and 1.5 s"), "{error}");
        }
        let error = read(r#"{"id": 7, "error": "no\nlicence"}"#);
        assert_eq!(error, Ok(ProgramAnswer::Error("no licence".into())));
    }

    #[test]
    fn what_is_not_finite_is_a_divergence_at_its_time() {
        for word in ["NaN", "-Infinity", "null", "nan", "-nan", "inf"] {
            let line = format!("{{\"id\": 7, \"outputs\": {{\"y\": [1, {word}, 2]}}}}");
            assert_eq!(read(&line), Ok(ProgramAnswer::Diverged(0.5)), "{word}");
        }
        assert_eq!(
            finite_only(r#"{"nan": "a\"NaN", "b": true}"#),
            r#"{"nan": "a\"NaN", "b": true}"#
        );
    }

    #[test]
    fn nonsense_is_named() {
        for (line, part) in [
            ("Loading model ...", "standard error"),
            (
                r#"{"id": 6, "outputs": {"y": [1, 2, 3]}}"#,
                "id 6, the request has 7",
            ),
            (
                r#"{"id": 7, "outputs": {"y": [1, 2]}}"#,
                "2 values, for 3 samples",
            ),
            (r#"{"id": 7, "outputs": {}}"#, "outputs lack y"),
            (
                r#"{"id": 7, "outputs": {"y": [1, 2, 3], "z": []}}"#,
                "z is no output",
            ),
            (
                r#"{"id": 7, "outputs": {"y": [1, 2, 3], "y": [4, 5, 6]}}"#,
                "output y is given twice",
            ),
            (r#"{"id": 7}"#, "exactly one of"),
            (r#"{"id": 7, "outptus": {}}"#, "unknown key `outptus`"),
            ("[7]", "expected an object with id and outputs"),
            (
                r#"[7, {"y": [1, 2, 3]}, null, null]"#,
                "expected an object with id and outputs",
            ),
            (r#"{"id": 7, "error": "\n"}"#, "error is empty"),
        ] {
            let message = read(line).unwrap_err();
            assert!(message.contains(part), "{message}");
            assert!(message.contains("; "), "no remedy: {message}");
        }
    }
}
