//! Inputs of simulated records, as study files and descriptions of programs plan them.

use crate::record::Quantity;
use crate::setting::{did_you_mean, number};
use crate::storage::untrusted::{excerpt, quoted};
use crate::twin::Interval;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::fmt::{Formatter, Result as Written};
use std::path::PathBuf;

/// Plan of one input of simulated records, for [`RecordPlan::by_input`](crate::study::RecordPlan::by_input).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum InputPlan {
    /// A staircase, fresh for each record.
    Levels {
        /// Range that the levels are drawn from, uniformly, in the unit of the input.
        levels: Interval,
        /// Samples that a level is held, at least 1.
        hold: usize,
    },
    /// The same value in every sample, in the unit of the input.
    Constant(f64),
    /// The column of this input in a CSV file, for every record. The file has the step and the length of the records. A file with one
    /// input serves it whatever the name of its column.
    File(PathBuf),
}

impl InputPlan {
    /// Levels in `[low, high]`, each held for `hold` samples.
    pub fn levels(low: f64, high: f64, hold: usize) -> Self {
        let levels = Interval::unchecked(low, high);
        Self::Levels { levels, hold }
    }

    /// Checks numbers; a file is not read.
    fn check(&self) -> Result<(), String> {
        match self {
            Self::Levels { hold: 0, .. } => {
                Err("hold = 0; a level is held for at least 1 sample".into())
            }
            // Of numbers of 1e308, the width is none.
            Self::Levels { levels, .. } if levels.low() > levels.high() || !levels.is_finite() => {
                Err(wrong_ends(&[levels.low(), levels.high()]))
            }
            Self::Constant(value) if !value.is_finite() => {
                Err(format!("{}; give a finite number", number(*value)))
            }
            _ => Ok(()),
        }
    }
}

/// Inputs of simulated records.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum PlannedInputs {
    /// Every input a staircase of its own, all with this range and hold.
    Alike {
        /// Range of the levels.
        levels: Interval,
        /// Samples that a level is held.
        hold: usize,
    },
    /// All inputs from one file, for every record, in the order of its columns; its step and length are the study's.
    File(PathBuf),
    /// Each input by its name.
    Each(BTreeMap<String, InputPlan>),
}

impl PlannedInputs {
    /// Paths of all files, with the name of the input that each is of; none for that of all inputs.
    pub fn files(&self) -> Vec<(Option<&str>, &PathBuf)> {
        match self {
            Self::Alike { .. } => vec![],
            Self::File(path) => vec![(None, path)],
            Self::Each(plans) => (plans.iter())
                .filter_map(|(name, plan)| match plan {
                    InputPlan::File(path) => Some((Some(name.as_str()), path)),
                    _ => None,
                })
                .collect(),
        }
    }

    /// Applies a change to the path of each file.
    pub fn change_files(&mut self, change: impl Fn(&mut PathBuf)) {
        match self {
            Self::Alike { .. } => {}
            Self::File(path) => change(path),
            Self::Each(plans) => {
                for plan in plans.values_mut() {
                    if let InputPlan::File(path) = plan {
                        change(path);
                    }
                }
            }
        }
    }

    /// Returns the range of the levels of an input; none where they are those of a file.
    pub fn range(&self, input: &str) -> Option<(f64, f64)> {
        let levels = match self {
            Self::Alike { levels, .. } => levels,
            Self::File(_) => return None,
            Self::Each(plans) => match plans.get(input)? {
                InputPlan::Levels { levels, .. } => levels,
                InputPlan::Constant(value) => return Some((*value, *value)),
                InputPlan::File(_) => return None,
            },
        };
        Some((levels.low(), levels.high()))
    }

    /// Checks numbers, and that each of the twin's inputs has its plan; files are not read.
    pub fn check(&self, inputs: &[Quantity]) -> Result<(), String> {
        let plans = match self {
            Self::Alike { hold: 0, .. } => {
                return Err("input: hold = 0; a level is held for at least 1 sample".into());
            }
            Self::Alike { levels, .. } if !levels.is_finite() => {
                let problem = wrong_ends(&[levels.low(), levels.high()]);
                return Err(format!("input: {problem}"));
            }
            Self::Alike { .. } | Self::File(_) => return Ok(()),
            Self::Each(plans) => plans,
        };
        let names = || inputs.iter().map(|input| input.name.as_str());
        let all = || excerpt(&names().collect::<Vec<_>>().join(", "));
        if let Some(name) = plans
            .keys()
            .find(|name| names().all(|known| known != *name))
        {
            let alike = match name.as_str() {
                "levels" | "hold" => {
                    ", or plan all of them alike: { levels = [low, high], hold = n }"
                }
                _ => "",
            };
            return Err(format!(
                "input: the twin has no input \"{}\"{}; name its inputs {}{alike}",
                quoted(name),
                did_you_mean(name, names()),
                all()
            ));
        }
        if let Some(name) = names().find(|name| !plans.contains_key(*name)) {
            return Err(format!(
                "input: {} has no plan; give each of {} its own: {{ levels = [low, high], hold = n }}, a number, or in a study file a file",
                excerpt(name),
                all()
            ));
        }
        (plans.iter()).try_for_each(|(name, plan)| {
            (plan.check()).map_err(|problem| format!("input {}: {problem}", excerpt(name)))
        })
    }
}

/// The error of levels that are no interval.
fn wrong_ends(ends: &[f64]) -> String {
    let given: Vec<String> = ends.iter().take(4).map(|end| number(*end)).collect();
    let more = if ends.len() > 4 { ", …" } else { "" };
    format!(
        "invalid levels [{}{more}]; write levels = [low, high] with low < high and a finite width",
        given.join(", ")
    )
}

/// A value in a table of inputs.
enum Given {
    Whole(i64),
    Number(f64),
    Text(String),
    List(Vec<f64>),
    Staircase(Staircase),
}

#[derive(Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "{ levels = [low, high], hold = n }, a number, or the name of a CSV file"
)]
struct Staircase {
    levels: Ends,
    hold: usize,
}

#[derive(Deserialize)]
#[serde(try_from = "Vec<f64>")]
struct Ends(Interval);

impl TryFrom<Vec<f64>> for Ends {
    type Error = String;

    fn try_from(ends: Vec<f64>) -> Result<Self, String> {
        match ends[..] {
            [low, high] => Interval::new(low, high)
                .map(Self)
                .map_err(|_| wrong_ends(&ends)),
            _ => Err(wrong_ends(&ends)),
        }
    }
}

impl<'de> Deserialize<'de> for Given {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(GivenVisitor)
    }
}

struct GivenVisitor;

impl<'de> Visitor<'de> for GivenVisitor {
    type Value = Given;

    fn expecting(&self, text: &mut Formatter<'_>) -> Written {
        text.write_str(
            "{ levels = [low, high], hold = n }, a number, or the name of a CSV file for an input",
        )
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Given, E> {
        Ok(Given::Whole(value))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Given, E> {
        Ok(i64::try_from(value).map_or(Given::Number(value as f64), Given::Whole))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Given, E> {
        Ok(Given::Number(value))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Given, E> {
        Ok(Given::Text(text.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Given, A::Error> {
        let mut values = vec![];
        while let Some(value) = list.next_element()? {
            values.push(value);
        }
        Ok(Given::List(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Given, A::Error> {
        Staircase::deserialize(MapAccessDeserializer::new(map)).map(Given::Staircase)
    }
}

impl<'de> Deserialize<'de> for PlannedInputs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PlannedVisitor)
    }
}

struct PlannedVisitor;

impl<'de> Visitor<'de> for PlannedVisitor {
    type Value = PlannedInputs;

    fn expecting(&self, text: &mut Formatter<'_>) -> Written {
        text.write_str(
            "{ levels = [low, high], hold = n } with low < high, a table with a plan for each input, or the name of a CSV file",
        )
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<PlannedInputs, E> {
        Ok(PlannedInputs::File(text.into()))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<PlannedInputs, A::Error> {
        let mut given = BTreeMap::new();
        while let Some(name) = map.next_key::<String>()? {
            if given.contains_key(&name) {
                let name = quoted(&name);
                return Err(A::Error::custom(format!(
                    "\"{name}\" is given twice; give it once"
                )));
            }
            given.insert(name, map.next_value::<Given>()?);
        }
        planned(given).map_err(A::Error::custom)
    }
}

/// Tells the two kinds of tables apart by their shape: `levels` is a list where it is the range of all inputs. The plan of an input that
/// happens to be called `levels` is never a list.
fn planned(mut given: BTreeMap<String, Given>) -> Result<PlannedInputs, String> {
    if let Some(Given::List(ends)) = given.get("levels") {
        let Ends(levels) = ends.clone().try_into()?;
        let hold = match given.remove("hold") {
            Some(Given::Whole(hold)) => usize::try_from(hold).ok(),
            _ => None,
        };
        let hold = hold.ok_or(
            "hold is missing, or no whole number; write { levels = [low, high], hold = n }",
        )?;
        return match given.keys().find(|name| *name != "levels") {
            None => Ok(PlannedInputs::Alike { levels, hold }),
            Some(other) => Err(format!(
                "unknown key \"{}\" beside the levels of all inputs; remove it, or give each input its plan: {{ u1 = {{ levels = [low, high], hold = n }}, u2 = 1.0 }}",
                quoted(other)
            )),
        };
    }
    let plans = given.into_iter().map(|(name, given)| {
        let plan = match given {
            Given::Whole(value) => InputPlan::Constant(value as f64),
            Given::Number(value) => InputPlan::Constant(value),
            Given::Text(path) => InputPlan::File(path.into()),
            Given::Staircase(Staircase { levels, hold }) => {
                let Ends(levels) = levels;
                InputPlan::Levels { levels, hold }
            }
            Given::List(_) => {
                return Err(format!(
                    "{} is a list; write {{ levels = [low, high], hold = n }}, a number, or the name of a CSV file",
                    quoted(&name)
                ));
            }
        };
        Ok((name, plan))
    });
    plans.collect::<Result<_, _>>().map(PlannedInputs::Each)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn toml(text: &str) -> Result<PlannedInputs, String> {
        let table: BTreeMap<String, PlannedInputs> =
            toml::from_str(&format!("input = {text}")).map_err(|e| e.message().to_owned())?;
        Ok(table["input"].clone())
    }

    fn check(text: &str, inputs: &[&str]) -> Result<(), String> {
        let inputs: Vec<_> = (inputs.iter().map(|name| Quantity::new(name, ""))).collect();
        toml(text)?.check(&inputs)
    }

    #[test]
    fn each_input_has_its_plan_and_is_written_as_it_was_read() {
        let text = "{ u1 = { levels = [-1, 1.5], hold = 20 }, u2 = 60, u3 = 'f.csv', u4 = -0.5 }";
        let read = toml(text).unwrap();
        let expected = [
            ("u1", InputPlan::levels(-1.0, 1.5, 20)),
            ("u2", InputPlan::Constant(60.0)),
            ("u3", InputPlan::File("f.csv".into())),
            ("u4", InputPlan::Constant(-0.5)),
        ];
        let expected = expected.map(|(name, plan)| (name.to_owned(), plan));
        assert_eq!(read, PlannedInputs::Each(expected.into()));
        assert_eq!(read.range("u1"), Some((-1.0, 1.5)));
        assert_eq!(
            (read.range("u2"), read.range("u3")),
            (Some((60.0, 60.0)), None)
        );
        for plans in [text, "{ levels = [0, 3], hold = 4 }", "'u.csv'"] {
            let read = toml(plans).unwrap();
            let table = BTreeMap::from([("input", read.clone())]);
            let again: BTreeMap<String, PlannedInputs> =
                toml::from_str(&toml::to_string(&table).unwrap()).unwrap();
            assert_eq!(again["input"], read);
            let again: PlannedInputs = serde_json::from_value(json!(read)).unwrap();
            assert_eq!(again, read);
        }
    }

    /// Inputs may be called as the keys of a staircase are.
    #[test]
    fn the_shape_tells_inputs_from_keys() {
        let alike = toml("{ hold = 20, levels = [0, 1] }").unwrap();
        assert!(matches!(alike, PlannedInputs::Alike { hold: 20, .. }));
        for text in [
            "{ levels = { levels = [0, 1], hold = 2 }, hold = 3 }",
            "{ levels = 2.0, hold = 'h.csv' }",
        ] {
            assert_eq!(check(text, &["hold", "levels"]), Ok(()), "{text}");
        }
        let message = check("{ hold = 20 }", &["u"]).unwrap_err();
        assert!(message.contains("{ levels = [low, high]"), "{message}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let two = ["pump", "valve"];
        for (text, part) in [
            (
                "{ pump = 1 }",
                "valve has no plan; give each of pump, valve",
            ),
            (
                "{ pump = 1, vavle = 2 }",
                "no input \"vavle\" (did you mean \"valve\"?); name its inputs pump, valve",
            ),
            ("{ pump = 1, valve = nan }", "input valve: NaN; give"),
            (
                "{ pump = 1, valve = { levels = [0, 1], hold = 0 } }",
                "input valve: hold = 0",
            ),
            (
                "{ pump = 1, valve = { levels = [0, inf], hold = 1 } }",
                "input valve: invalid levels [0, inf]",
            ),
            (
                "{ pump = 1, valve = { levels = [1, 0], hold = 1 } }",
                "invalid levels [1, 0]; write levels = [low, high]",
            ),
            (
                "{ pump = 1, valve = { levels = [0, 1] } }",
                "missing field `hold`",
            ),
            (
                "{ pump = 1, valve = { levels = [0, 1], hold = 1, step = 2 } }",
                "unknown field `step`",
            ),
            (
                "{ pump = 1, valve = [0, 1] }",
                "valve is a list; write { levels",
            ),
            ("{ pump = 1, valve = true }", "a number, or the name"),
            (
                "{ levels = [0, 1], hold = 1, valve = 2 }",
                "unknown key \"valve\" beside",
            ),
            (
                "{ levels = [0, 1, 2], hold = 1 }",
                "invalid levels [0, 1, 2]",
            ),
            ("{ levels = [0, 1] }", "hold is missing"),
            ("{ levels = [0, 1], hold = -1 }", "hold is missing, or no"),
            ("{ levels = [0, 1], hold = 0 }", "hold = 0"),
            ("[0, 1]", "a plan for each input"),
        ] {
            let message = check(text, &two).unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
        let twice = serde_json::from_str::<PlannedInputs>(r#"{"u": 1, "u": 2}"#);
        assert!(twice.unwrap_err().to_string().contains("given twice"));
    }
}
