//! The study file: a twin in the user's own setting.

use crate::effect::{EffectEntry, line_of_effect};
use crate::equations::{self, Equations};
use crate::feature::FeatureRecipe;
use crate::record::UNIFORM;
use crate::setting::{count, number};
use crate::storage::untrusted::{all_keyed, check_names, line, message, read_text};
use crate::study::error::StudyError;
use crate::study::noise_table::NoiseTable;
use crate::study::plan::grid_of_files;
use crate::study::tables::{
    Library, PriorTable, RecordTable, check_features, check_shapes, check_tables, dotted,
};
use crate::twin::{Interval, StartLevel, TwinError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest study file, in bytes: a hundred times one that names every parameter and effect.
const MOST: u64 = 1 << 20;

/// Content of a study file; everything but `twin` is optional, unknown keys are refused.
///
/// In place of `twin = "tanks"`, a file may have the twin itself: the tables that [`Equations`] reads.
///
/// ```toml
/// twin = "tanks"
/// [record]
/// step = 4.0
/// samples = 1024
/// input = { levels = [0.5, 6.0], hold = 25 }   # or a file: "U.csv"; or a plan for each input: { u = 2.0 }
/// hold = "linear"   # inputs on the line between samples; "spline" puts them on a smooth curve, "nearest" holds the nearest, "zero" the last
/// integrator = "runge-kutta-4"   # or "euler"
/// substeps = 4      # steps of the integrator within a sample
/// columns = { t = "time", u = "pump", y = "level" }   # of measured records
/// [prior]
/// k1 = [0.01, 0.1]
/// start.h1 = [0.0, 10.0]
/// trust = true      # estimates may lean on these boxes; by default they do not
/// [bounds]
/// k1 = [0.001, 1.0]
/// [fixed]
/// k4 = 1.0
/// [limits]
/// h1 = [0.0, 10.0]
/// [noise]
/// h1 = 0.1          # declared: standard deviation of the increment a step of the study
/// h2 = { std = 0.05, known = true, per = "second" }   # not fitted; in units of the state per √s
/// y = "estimate"    # a parameter of its own, which an estimator learns
/// process = "fitted"   # of all other states; "none": a deterministic twin, "declared": held as the twin declares it
/// [start]
/// h1 = { mean = 2.0, std = 0.5 }   # or a value that is known, or "estimate"
/// [features]
/// kind = "deviation"
/// blocks = 64
/// [[effect]]
/// id = "sensor-lag"
/// target = "sensor"
/// magnitudes = { tau = 3.0 }                   # what is not given is estimated
/// ```
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StudyFile {
    /// Name of the twin.
    pub twin: String,
    /// Step, length and input of simulated records.
    #[serde(skip_serializing_if = "RecordTable::is_empty")]
    pub(crate) record: RecordTable,
    /// Prior boxes.
    #[serde(skip_serializing_if = "PriorTable::is_empty")]
    pub(crate) prior: PriorTable,
    /// Physical bounds.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "dotted"
    )]
    pub(crate) bounds: BTreeMap<String, Interval>,
    /// Parameters that are known.
    #[serde(
        skip_serializing_if = "BTreeMap::is_empty",
        deserialize_with = "dotted"
    )]
    pub(crate) fixed: BTreeMap<String, f64>,
    /// Limits of states.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) limits: BTreeMap<String, Interval>,
    /// Noise of states and outputs.
    #[serde(skip_serializing_if = "NoiseTable::is_empty")]
    pub(crate) noise: NoiseTable,
    /// Starts of states.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) start: BTreeMap<String, StartLevel>,
    /// Features, in place of the preset's.
    pub(crate) features: Option<Arc<dyn FeatureRecipe>>,
    /// Effects added to the twin.
    #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "all_keyed")]
    pub(crate) effect: Vec<EffectEntry>,
    /// Which effects a diagnosis may name.
    #[serde(skip_serializing_if = "Library::is_empty")]
    pub(crate) library: Library,
    /// The twin, if the file has its equations.
    #[serde(skip)]
    pub(crate) equations: Option<Equations>,
    /// Path and text that it was parsed from, for the lines in messages; none if it was made in the program.
    #[serde(skip)]
    pub(crate) origin: Option<(PathBuf, Arc<str>)>,
}

impl StudyFile {
    /// Reads a study file. A relative input file is looked for beside it; its step and length become the study's.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let text = read_text(path, MOST).map_err(|error| StudyError::Io {
            path: path.into(),
            error,
        })?;
        let mut file = Self::parse(&text, path)?;
        if let Some(input) = &mut file.record.input {
            // A path beside a study that is named alone stays as it is: written, the study is read as the same.
            input.change_files(|file| *file = path.with_file_name(&*file));
        }
        let of_input = |(input, error): (Option<&str>, _)| {
            let key = input.map_or("input".into(), |name| format!("input.{name}"));
            file.located_at(("record", &key), error)
        };
        let grid = (file.record.input.as_ref())
            .map(|input| grid_of_files(input).map_err(of_input))
            .transpose()?;
        if let Some((input, step, samples)) = grid.flatten() {
            let (own_step, own_samples) = (file.record.step, file.record.samples);
            let contradicts = |key, own: String| {
                let problem = format!(
                    "{key} = {own} contradicts {}, which has {}, step {} s; leave it out",
                    input.display(),
                    count(samples, "sample"),
                    number(step)
                );
                file.located(StudyError::Plan(problem))
            };
            if let Some(own) = own_step.filter(|own| (own - step).abs() > UNIFORM * step) {
                return Err(contradicts("step", number(own)));
            }
            if let Some(own) = own_samples.filter(|own| *own != samples) {
                return Err(contradicts("samples", number(own as f64)));
            }
            (file.record.step, file.record.samples) = (Some(step), Some(samples));
        }
        Ok(file)
    }

    /// Parses the text of a study file; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self, StudyError> {
        let wrong = |line, problem: &str| StudyError::Syntax {
            path: path.into(),
            line,
            message: message(problem),
        };
        // Not every text comes from a file of its own: an estimator holds one, too.
        if text.len() as u64 > MOST {
            return Err(wrong(1, &format!("more than {} MiB of text", MOST >> 20)));
        }
        let unread = |error: toml::de::Error| match error.span() {
            Some(span) => wrong(
                line(text, span.start),
                match error.message() {
                    // Of a word that begins as `true` or `false` does.
                    told if told.starts_with("invalid boolean") => {
                        "a text without quotes; write it in quotes, or true or false"
                    }
                    told => told,
                },
            ),
            None => wrong(line_of_depth(text), "a table or a list is nested too deep"),
        };
        let mut table = DeTable::parse(text).map_err(unread)?;
        let keys = all_keys(table.get_ref());
        let syntax = |error: toml::de::Error| {
            let start = error.span().map_or(0, |span| span.start);
            let start = key_within(text, &keys, start, error.message()).unwrap_or(start);
            wrong(line(text, start), error.message())
        };
        let at = |(start, problem): (usize, String)| wrong(line(text, start), &problem);
        check_tables(table.get_ref()).map_err(at)?;
        check_shapes(table.get_ref()).map_err(at)?;
        let equations =
            equations::take(text, table.get_mut()).map_err(|error| error.in_file(path))?;
        check_names(table.get_ref()).map_err(at)?;
        if let Some(features) = table.get_ref().get("features") {
            check_features(features).map_err(at)?;
        }
        if !table.get_ref().contains_key("twin") {
            return Err(StudyError::NoTwin(path.into()));
        }
        let mut file = Self::deserialize(toml::de::Deserializer::from(table)).map_err(syntax)?;
        file.equations = equations;
        file.origin = Some((path.into(), text.into()));
        Ok(file)
    }

    /// The twin of the file, if it has one in equations.
    pub fn own_equations(&self) -> Option<&Equations> {
        self.equations.as_ref()
    }

    /// The twin of the file, in equations.
    pub(super) fn equations_of_twin(&self) -> Result<&Equations, StudyError> {
        (self.own_equations()).ok_or_else(|| StudyError::NoEquations(self.twin.clone()))
    }

    /// Returns the file with the equations of the twin's own file, if this one names the twin alone; how they are integrated goes with them.
    pub(super) fn with_equations_of(&self, own: &Self) -> Self {
        let mut file = self.clone();
        if file.equations.is_none() && own.equations.is_some() {
            file.equations.clone_from(&own.equations);
            let (record, own) = (&mut file.record, &own.record);
            record.integrator = record.integrator.or(own.integrator);
            record.substeps = record.substeps.or(own.substeps);
            record.tolerance = record.tolerance.or(own.tolerance);
            record.hold = record.hold.or(own.hold);
        }
        file
    }

    /// Returns the file with the equations and the records of the twin's own file, if this one names the twin alone.
    pub(super) fn upon(&self, own: &Self) -> Self {
        let mut file = self.with_equations_of(own);
        let (record, own) = (&mut file.record, &own.record);
        record.step = record.step.or(own.step);
        record.samples = record.samples.or(own.samples);
        record.input = record.input.take().or_else(|| own.input.clone());
        file
    }

    /// Returns whether the file sets nothing but which twin it is.
    pub(super) fn names_twin_alone(&self) -> bool {
        let table = toml::Table::try_from(self).unwrap_or_default();
        self.equations.is_none() && table.keys().all(|key| key == "twin")
    }

    /// Returns the text of a file that is read as this one.
    pub(crate) fn written(&self) -> Result<String, toml::ser::Error> {
        let Some(equations) = &self.equations else {
            return toml::to_string(self);
        };
        // The equations name the twin.
        let mut rest = toml::Table::try_from(self)?;
        rest.remove("twin");
        Ok(format!("{}{}", equations.text(), toml::to_string(&rest)?))
    }

    /// Adds to the error of effect `index` its line, if the file was parsed from a text.
    pub(super) fn effect_error(&self, index: usize, error: TwinError) -> StudyError {
        let line = |text: &str| line_of_effect(text, index, self.effect.get(index)?, &error);
        let line = self.origin.as_ref().and_then(|(_, text)| line(text));
        self.at(line, error.into())
    }

    /// Adds to an error the line of the value that it is about, if the file was parsed from a text that has it.
    pub(crate) fn located(&self, error: StudyError) -> StudyError {
        match error.key() {
            Some((table, name)) => {
                let name = name.into_owned();
                self.located_at((table, &name), error)
            }
            None => error,
        }
    }

    /// Adds to an error the line of a table's value, if the file was parsed from a text that has the table.
    fn located_at(&self, (table, name): (&str, &str), error: StudyError) -> StudyError {
        let line = |text: &str| {
            let file = DeTable::parse(text).ok()?;
            let of = |table| value_of(&file, table, name);
            // What a prior leaves may be told in the other table alone.
            let value = of(table).or_else(|| (table == "prior").then(|| of("bounds"))?);
            let table = file.get_ref().get(table).map(|table| table.span().start);
            Some(line(text, value.or(table)?))
        };
        let line = self.origin.as_ref().and_then(|(_, text)| line(text));
        self.at(line, error)
    }

    fn at(&self, line: Option<usize>, error: StudyError) -> StudyError {
        match (&self.origin, line) {
            (Some((path, _)), Some(line)) => StudyError::At {
                path: path.clone(),
                line,
                error: error.into(),
            },
            _ => error,
        }
    }
}

/// Returns where a value of a table stands in a file, or a name in one of its lists.
fn value_of(file: &Spanned<DeTable<'_>>, table: &str, name: &str) -> Option<usize> {
    let table = file.get_ref().get(table)?;
    // Names may be dotted.
    let value = (table.get_ref().get(name))
        .or_else(|| (name.split('.')).try_fold(table, |at, key| at.get_ref().get(key)));
    let entries = table.get_ref().as_table()?.values();
    let listed = || {
        let mut lists = entries.filter_map(|value| value.get_ref().as_array());
        lists.find_map(|list| list.iter().find(|of| of.get_ref().as_str() == Some(name)))
    };
    let whole = || table.get_ref().get(name.split('.').next()?);
    let value = value.or_else(listed).or_else(whole);
    value.map(|value| value.span().start)
}

/// Returns the line of a text at which tables or lists are nested deeper than the parser goes.
fn line_of_depth(text: &str) -> usize {
    let ends: Vec<usize> = text.match_indices('\n').map(|(end, _)| end + 1).collect();
    let is_too_deep = |to: usize| DeTable::parse(&text[..to]).is_err_and(|e| e.span().is_none());
    ends.partition_point(|end| !is_too_deep(*end)) + 1
}

/// Returns all keys of tables within tables, by where they stand.
fn all_keys(table: &DeTable<'_>) -> BTreeMap<usize, String> {
    let mut keys = BTreeMap::new();
    for (key, value) in table {
        keys.insert(key.span().start, key.get_ref().to_string());
        match value.get_ref() {
            DeValue::Table(inner) => keys.extend(all_keys(inner)),
            DeValue::Array(items) => {
                let tables = items.iter().filter_map(|item| item.get_ref().as_table());
                keys.extend(tables.flat_map(all_keys));
            }
            _ => {}
        }
    }
    keys
}

/// Returns where the key stands that a message is about, of which the parser may tell the table alone, at `start`: `k1: …` or ``… `blobs` …``, where
/// also a value may stand so.
fn key_within(
    text: &str,
    keys: &BTreeMap<usize, String>,
    start: usize,
    message: &str,
) -> Option<usize> {
    // Behind it are keys that would be right.
    let message = message.split(", expected").next().unwrap_or(message);
    let before_colon = message.split(": ").next().filter(|key| !key.contains(' '));
    let quoted = message.split('`').skip(1).step_by(2);
    let first = text[..start].rfind('\n').map_or(0, |end| end + 1);
    let end = text[start..]
        .find("\n[")
        .map_or(text.len(), |end| start + end);
    // Names may be dotted.
    let is_of = |told: &str, key: &str| {
        let rest = told.strip_prefix(key);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    let place = |told: &str| {
        let mut own = keys.range(first..end);
        own.find(|(_, key)| is_of(told, key)).map(|(at, _)| *at)
    };
    before_colon.into_iter().chain(quoted).find_map(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::NoiseLevel;

    fn parse(text: &str) -> Result<StudyFile, String> {
        StudyFile::parse(text, Path::new("s.toml")).map_err(|e| e.to_string())
    }

    #[test]
    fn every_table_is_read_and_written_again() {
        let text = r#"
            twin = "tanks"
            [record]
            step = 4
            samples = 1024
            input = { levels = [0.5, 6.0], hold = 25 }
            hold = "linear"
            substeps = 4
            columns = { t = "time (s)", y = "level" }
            [prior]
            k1 = [0.01, 0.1]
            start.h1 = [0, 10]
            trust = true
            [fixed]
            k4 = 1
            [limits]
            h1 = [0, inf]
            [noise]
            h1 = 0
            y = "estimate"
            process = "declared"
            [start]
            h1 = "estimate"
            h2 = 5.2
            h3 = { value = 5.2, at = -1.0 }
            [features]
            kind = "arx"
            outputs = 4
            inputs = 8
            [library]
            without = ["sensor-lag"]
        "#;
        let file = parse(text).unwrap();
        assert_eq!(
            file.prior.boxes["start.h1"],
            Interval::new(0.0, 10.0).unwrap()
        );
        assert!(file.prior.trust);
        assert_eq!(file.noise.levels["y"], NoiseLevel::Estimate);
        assert_eq!(file.start["h2"], StartLevel::known(5.2));
        let written = toml::to_string(&file).unwrap();
        let again = parse(&written).unwrap();
        assert_eq!(written, toml::to_string(&again).unwrap());
        for part in [
            "trust",
            "start.h1",
            "inf",
            "sensor-lag",
            "arx",
            "time (s)",
            "at = -1.0",
        ] {
            assert!(written.contains(part), "{written}");
        }
    }

    /// Files are looked for beside the study; the text that is kept finds them again.
    #[test]
    fn a_plan_for_each_input_is_written_again_with_its_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("w.csv"), "t,w\n0,1\n0.5,2\n1,3\n").unwrap();
        let text = "twin = 'tanks'\n[record.input]\nu1 = { levels = [0, 1], hold = 2 }\nu2 = 60.0\nw = 'w.csv'\n";
        std::fs::write(at("s.toml"), text).unwrap();
        let file = StudyFile::read(&at("s.toml")).unwrap();
        assert_eq!(
            (file.record.step, file.record.samples),
            (Some(0.5), Some(3))
        );
        let again = parse(&file.written().unwrap()).unwrap();
        assert_eq!(again.record, file.record);
        assert!(
            file.written()
                .unwrap()
                .contains(at("w.csv").to_str().unwrap())
        );
        std::fs::write(at("v.csv"), "t,v\n0,1\n1,2\n2,3\n").unwrap();
        std::fs::write(at("s.toml"), format!("{text}v = 'v.csv'\n")).unwrap();
        let message = StudyFile::read(&at("s.toml")).unwrap_err().to_string();
        assert!(
            message.contains("inputs of one record have one step"),
            "{message}"
        );
    }

    #[test]
    fn messages_are_one_line_with_the_place() {
        for (text, expected) in [
            (
                "twin = 'tanks'\nstep = 1\n",
                "s.toml, line 2: unknown key `step`",
            ),
            (
                "twin = 'tanks'\n\n[priors]\nk1 = [0.4, 0.8]\n",
                "s.toml, line 3: unknown key `priors` (did you mean \"prior\"?), expected one of twin, parameters,",
            ),
            (
                "[parameters]\nk = { prior = [0, 1] }\n[states]\nh = { rate = 'k' }\n[outputs]\ny = { value = 'h' }\n[outputz]\n",
                "s.toml, line 7: unknown key `outputz` (did you mean \"outputs\"?)",
            ),
            (
                "[states]\nh = { rate = '1' }\n[[events]]\nat = 1\n",
                "line 3: unknown key `events` (did you mean \"event\"?)",
            ),
            (
                "twin = 'tanks'\n[prior]\nk1 = [0.8, 0.4]\n",
                "invalid interval",
            ),
            ("twin = 'x'\n[features]\nkind = 'arma'\n", "`arx`"),
            ("twin = \n", "s.toml, line 1"),
            (
                "twin = 'x'\n[record]\nhold = 'cubic'\n",
                "s.toml, line 3: unknown value `cubic`, expected one of `zero`, `linear`, `spline`, `nearest`",
            ),
            (
                "twin = 'x'\n[record.input]\nu1 = 1\nu2 = { levels = [2, 1], hold = 3 }\n",
                "s.toml, line 4: invalid levels [2, 1]; write levels = [low, high]",
            ),
            (
                "twin = 'x'\n[record.input]\nu1 = 2024-03-31\n",
                "s.toml, line 3: [record] input u1 is no date",
            ),
            (
                "twin = 'x'\n[record.input]\nu1 = {}\n",
                "s.toml, line 3: [record] input u1 has no plan",
            ),
            (
                "twin = 'x'\n[record]\n\nsamples = {}\n",
                "s.toml, line 4: [record] samples has no value; write a number",
            ),
            (
                "twin = 'x'\n[record]\ninput = ''\n",
                "s.toml, line 3: [record] input names no file; write its path",
            ),
            (
                "twin = 'x'\n[prior]\n\n'sensor-noise@sensor.std' = [0.3, 0.01]\n",
                "s.toml, line 4: sensor-noise@sensor.std: invalid interval",
            ),
            (
                "twin = 'x'\n[record]\ninput = {}\n",
                "s.toml, line 3: [record] input has no plan",
            ),
            ("twin = 'x'\n[record]\nsubsteps = 1e9\n", "s.toml, line 3"),
            ("twin = 'x'\n[record]\nsubsteps = -1\n", "s.toml, line 3"),
            (
                "twin = 'x'\n[features]\nkind = 'ar'\norder = -1\n",
                "s.toml, line 4: invalid value",
            ),
            (
                "twin = 'x'\n[features]\nkind = 'score'\nfilter = 3\n",
                "s.toml, line 4: filter: found integer `3`, expected a table of settings",
            ),
            (
                "twin = 'x'\n[features]\nkind = 'arx'\noutputs = 8\ninputs = '8'\n",
                "s.toml, line 5: inputs: found string",
            ),
            (
                "twin = 'x'\n[features]\nkin = 'arx'\noutputs = 8\n",
                "s.toml, line 3: unknown key `kin` (did you mean \"kind\"?)",
            ),
            (
                "twin = 'x'\n[features]\nkind = 'arx'\noutputs = 8\n",
                "s.toml, line 2: missing key `inputs`",
            ),
            (
                "twin = 'x'\n[prior]\nk2 = [0, 1]\nk1 = { low = 0.4, high = 0.8 }\nk3 = [0, 1]\n",
                "s.toml, line 4: k1.",
            ),
            (
                "twin = 'x'\n[record]\nstepp = 0.5\nsamples = 60\nhold = 'zero'\n",
                "s.toml, line 3: unknown key `stepp`",
            ),
            (
                "twin = 'x'\n[record]\nhold = 'impulse'\n",
                "hold = \"impulse\" is of a single input",
            ),
            (
                "twin = 'x'\n[fixed]\nk4 = 1.0\n[library]\nwithout = ['sensor-lag\u{200b}']\n",
                "s.toml, line 5: \"sensor-lag\" holds the hidden character",
            ),
            (
                "[constnts]\ng = 1\n[states]\nh = { rate = 'g' }\n[outputs]\ny = { value = 'h' }\n",
                "s.toml, line 1: unknown key `constnts` (did you mean \"constants\"?)",
            ),
            ("twin = 'x'\n[noise]\ny = 'guess'\n", "s.toml, line 3"),
            (
                "twin = 'x'\n[noise]\nprocess = 'no'\n",
                "s.toml, line 3: process is \"none\", \"fitted\" or \"declared\"",
            ),
        ] {
            let message = parse(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }
}
