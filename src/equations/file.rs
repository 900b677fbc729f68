//! The tables of a file as a twin.

use super::declared::{Declared, NoiseValue, StartValue};
use super::entries::{TableEntry, entries};
use super::error::EquationsError;
use super::event::{EventText, events};
use super::graph::{Graph, Id, Varies};
use super::jumps::Jumps;
use super::names::{Meaning, Scope};
use super::place::{SourceText, number};
use super::program::{Program, Tapes};
use super::tape::OperationTape;
use super::twin::Equations;
use super::written::{TABLES, written};
use crate::record::Quantity;
use crate::setting::did_you_mean;
use crate::storage::untrusted::{check_name, excerpt, message};
use crate::twin::{
    Hold, Integrator, Interval, MOST_SUBSTEPS, Outline, Parameter, Stepping, TOLERANCES,
};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Table of records, of which the integrator is read here.
const RECORD: &str = "record";
/// Name of a twin that has none.
const UNNAMED: &str = "twin";
/// Longest text, in bytes.
const MOST: usize = 1 << 20;

impl Equations {
    /// Reads the tables `twin`, `parameters`, `constants`, `define`, `states`, `inputs`, `outputs`, the list `event`, and the integrator of
    /// `record`.
    ///
    /// A whole study file is read by [`StudyFile`](crate::study::StudyFile).
    ///
    /// # Errors
    ///
    /// [`EquationsError`]: no TOML, unknown keys or names, definitions in a circle, names in two tables.
    pub fn parse(text: &str) -> Result<Self, EquationsError> {
        let source = SourceText(text);
        if text.len() > MOST {
            return source.error(
                0,
                format!(
                    "more than {} MiB of text; a twin of that size needs Rust",
                    MOST >> 20
                ),
            );
        }
        let file = DeTable::parse(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let problem = format!("{}; correct the TOML there", message(error.message()));
            EquationsError::at(text, start, problem)
        })?;
        let file = file.get_ref();
        for key in file.keys() {
            let name: &str = key.get_ref();
            if !TABLES.contains(&name) && name != RECORD {
                let problem = format!(
                    "\"{}\" is no table of a twin{}; there are {} and {RECORD}; a study file has more",
                    excerpt(name),
                    did_you_mean(name, TABLES),
                    TABLES.join(", ")
                );
                return source.error(key.span().start, problem);
            }
        }
        read(source, file)
    }
}

/// Takes the tables of a twin out of a study file, whose key `twin` then is a name; `None` where the file has no equations.
pub(crate) fn take(
    text: &str,
    file: &mut DeTable<'_>,
) -> Result<Option<Equations>, EquationsError> {
    let given = |table: &&str| file.get(*table).is_some();
    let Some(first) = TABLES[1..].iter().find(|table| given(table)) else {
        return Ok(None);
    };
    if !file.contains_key("states") {
        let byte = file.get(*first).map_or(0, |value| value.span().start);
        let problem =
            format!("{first} belongs to equations, and there are no states; add that table");
        return SourceText(text).error(byte, problem);
    }
    let equations = read(SourceText(text), file)?;
    for table in TABLES {
        file.remove(table);
    }
    let name = DeValue::String(equations.name().to_owned().into());
    file.insert(Spanned::new(0..0, "twin".into()), Spanned::new(0..0, name));
    Ok(Some(equations))
}

/// Values of one state.
struct StateText {
    motion: Id,
    start: StartValue,
    noise: NoiseValue,
    /// Ends of its limits.
    limits: [Id; 2],
}

/// A twin while its tables are read.
struct Reader<'t> {
    names: Scope<'t>,
    outline: Outline,
    declared: Declared,
    /// Key by which states are given: `rate` or `next`.
    motion: Option<&'static str>,
}

fn read(source: SourceText<'_>, file: &DeTable<'_>) -> Result<Equations, EquationsError> {
    let all = |table| entries(source, file, table);
    let (states, inputs, outputs) = (all("states")?, all("inputs")?, all("outputs")?);
    let mut reader = Reader {
        names: Scope::new(source),
        outline: Outline::new(),
        declared: Declared::default(),
        motion: None,
    };
    for (index, entry) in all("parameters")?.iter().enumerate() {
        reader.names.add(entry, Meaning::Parameter(index))?;
        reader.parameter(entry)?;
    }
    for (table, is_constant) in [("constants", true), ("define", false)] {
        for entry in all(table)? {
            let placed = entry.expression_of("the value", entry.value)?;
            reader.names.define(&entry, placed, is_constant)?;
        }
    }
    for (index, entry) in states.iter().enumerate() {
        reader.names.add(entry, Meaning::State(index))?;
    }
    for (index, entry) in inputs.iter().enumerate() {
        reader.names.add(entry, Meaning::Input(index))?;
    }
    for entry in &outputs {
        reader.names.add(entry, Meaning::Output)?;
    }
    reader.names.resolve()?;
    for (table, given) in [("states", &states), ("outputs", &outputs)] {
        if given.is_empty() {
            let byte = file.get(table).map_or(0, |value| value.span().start);
            return source.error(
                byte,
                format!("the twin has no {table}; add that table with one entry or more"),
            );
        }
    }
    let hold = reader.inputs(&inputs)?;
    let events = events(source, file, (&states, &mut reader.names))?;
    let named = states;
    let states: Vec<StateText> =
        (named.iter().map(|entry| reader.state(entry))).collect::<Result<_, _>>()?;
    reader.hold_switches(&named, &states, &events);
    let outputs: Vec<(Id, NoiseValue)> =
        (outputs.iter().map(|entry| reader.output(entry))).collect::<Result<_, _>>()?;
    let (integrator, stepping) = integrator(source, file, reader.motion == Some("next"))?;
    let name = name(source, file)?;
    let is_discrete = integrator == Integrator::Discrete;
    let rates = states.iter().map(|state| state.motion);
    let jumping: Vec<Id> = rates
        .chain(events.iter().filter_map(EventText::condition))
        .collect();
    let jumps = Jumps::of(&mut reader.names.graph, &jumping).filter(|_| !is_discrete);
    let graph = &reader.names.graph;
    let tapes = tapes(graph, &states, &outputs, jumps);
    let compiled = events.iter().map(|event| event.compiled(graph));
    reader.outline.events.extend(compiled);
    let program = Program {
        limits: limits(graph, &states),
        outline: reader.outline,
        tapes,
        integrator,
        stepping: Stepping { hold, ..stepping },
    };
    Ok(Equations {
        name,
        program: Arc::new(program),
        declared: reader.declared,
        text: written(file).into(),
    })
}

impl Reader<'_> {
    fn parameter(&mut self, entry: &TableEntry<'_, '_>) -> Result<(), EquationsError> {
        let keys = entry.keys(&["prior", "bounds", "unit", "words"])?;
        let Some(prior) = entry.interval(keys, "prior")? else {
            let name = excerpt(entry.name);
            return entry.error(format!(
                "{name} has no prior; write {name} = {{ prior = [low, high] }}"
            ));
        };
        let bounds = entry.interval(keys, "bounds")?.unwrap_or(prior);
        let unit = entry.text(keys, "unit")?;
        entry.text(keys, "words")?;
        let parameter = Parameter::new(entry.name, &unit, prior.low(), prior.high())
            .within(bounds.low(), bounds.high());
        if let Err(problem) = parameter.check() {
            return entry.error(problem.to_string());
        }
        self.outline.parameters.push(parameter);
        Ok(())
    }

    /// Reads inputs and what they are between samples.
    fn inputs(&mut self, inputs: &[TableEntry<'_, '_>]) -> Result<Hold, EquationsError> {
        let mut holds = BTreeMap::new();
        for entry in inputs {
            let keys = entry.keys(&["unit", "hold", "words"])?;
            self.outline.inputs.push(quantity(entry, keys)?);
            let own = match keys.get("hold") {
                None => Hold::Zero,
                Some(value) => {
                    let word = value.get_ref().as_str();
                    let mut rules = Hold::NAMES.iter();
                    match rules.find(|(_, name)| word == Some(*name)) {
                        Some((hold, _)) => *hold,
                        None => {
                            let [all @ .., last] =
                                &Hold::NAMES.map(|(_, name)| format!("\"{name}\""));
                            let all = format!("{} or {last}", all.join(", "));
                            return entry.wrong("hold", value, &all);
                        }
                    }
                }
            };
            self.declared.holds |= keys.contains_key("hold") && own != Hold::Impulse;
            holds.insert(entry.name.to_owned(), own);
        }
        let doses = |hold: &Hold| *hold == Hold::Impulse;
        let mut others = holds.values().copied().filter(|hold| !doses(hold));
        let usual = others.next().unwrap_or_default();
        if others.any(|hold| hold != usual) {
            self.outline.held = holds;
            return Ok(Hold::Zero);
        }
        holds.retain(|_, hold| doses(hold));
        self.outline.held = holds;
        Ok(usual)
    }

    fn state(&mut self, entry: &TableEntry<'_, '_>) -> Result<StateText, EquationsError> {
        let keys = entry.keys(&["rate", "next", "unit", "start", "noise", "limits", "words"])?;
        let name = excerpt(entry.name);
        let key = match (keys.contains_key("rate"), keys.contains_key("next")) {
            (true, false) => "rate",
            (false, true) => "next",
            (true, true) => {
                return entry.error(format!("{name} has rate and next; give one of them"));
            }
            (false, false) => {
                return entry.error(format!(
                    "{name} has no rate; give its rate of change, or next, its value at the next sample"
                ));
            }
        };
        if self.motion.is_some_and(|before| before != key) {
            return entry.error(format!(
                "{name} has {key}, states before have not; give all states a rate, or all next"
            ));
        }
        self.motion = Some(key);
        let Some(motion) = entry.expression(keys, key)? else {
            return entry.error(format!("{name} has no {key}; give it"));
        };
        self.outline.states.push(quantity(entry, keys)?);
        let state = StateText {
            motion: self.names.value(&motion)?,
            start: self.declared.start(entry, keys, &mut self.names)?,
            noise: self.declared.noise(entry, keys, &mut self.names)?,
            limits: self.limits(entry, keys)?,
        };
        let [start, low, high] = [state.start.mean, state.limits[0], state.limits[1]]
            .map(|id| self.names.graph.constant(id));
        if let (true, Some(start), Some(value)) = (state.start.is_given, start, keys.get("start"))
            && (low.is_some_and(|low| start < low) || high.is_some_and(|high| start > high))
        {
            let problem = format!("{name} starts outside its limits; give a start within them");
            return entry.source.error(value.span().start, problem);
        }
        Ok(state)
    }

    /// States that only events move have no noise of their own, unless they say so.
    fn hold_switches(
        &mut self,
        entries: &[TableEntry<'_, '_>],
        states: &[StateText],
        events: &[EventText],
    ) {
        let graph = &self.names.graph;
        let is_zero = |id| graph.constant(id) == Some(0.0);
        for state in events.iter().flat_map(EventText::states) {
            let of = &states[state];
            if is_zero(of.motion) && is_zero(of.noise.level) && self.motion == Some("rate") {
                self.declared.known.insert(entries[state].name.into());
            }
        }
    }

    fn limits(
        &mut self,
        entry: &TableEntry<'_, '_>,
        keys: &DeTable<'_>,
    ) -> Result<[Id; 2], EquationsError> {
        const OF: &str =
            "limits change with time; name parameters, constants and definitions of these alone";
        let graph = &mut self.names.graph;
        let Some(value) = keys.get("limits") else {
            return Ok([graph.number(f64::NEG_INFINITY), graph.number(f64::INFINITY)]);
        };
        let ends = match value.get_ref().as_array() {
            Some(ends) if ends.len() == 2 => [&ends[0], &ends[1]],
            _ => return entry.wrong("limits", value, "two ends, [low, high]"),
        };
        let mut ids = [0; 2];
        for (id, end) in ids.iter_mut().zip(ends) {
            let open = number(end.get_ref()).filter(|end| end.is_infinite());
            *id = match open {
                Some(end) => self.names.graph.number(end),
                None => {
                    let placed = entry.expression_of("an end of limits", end)?;
                    self.names.value_within(&placed, Varies::ByParameters, OF)?
                }
            };
        }
        let known = ids.map(|id| self.names.graph.constant(id));
        if let [Some(low), Some(high)] = known
            && let Err(error) = Interval::new(low, high)
        {
            return entry.source.error(value.span().start, error.to_string());
        }
        Ok(ids)
    }

    fn output(&mut self, entry: &TableEntry<'_, '_>) -> Result<(Id, NoiseValue), EquationsError> {
        let keys = entry.keys(&["value", "unit", "noise", "words"])?;
        let Some(value) = entry.expression(keys, "value")? else {
            let name = excerpt(entry.name);
            return entry.error(format!(
                "{name} has no value; give what it shows, such as value = \"x\""
            ));
        };
        self.outline.outputs.push(quantity(entry, keys)?);
        let value = self.names.value(&value)?;
        let noise = self.declared.noise(entry, keys, &mut self.names)?;
        match noise.is_per_second {
            true => entry.error("noise of an output is of each row; leave out per"),
            false => Ok((value, noise)),
        }
    }
}

fn quantity(entry: &TableEntry<'_, '_>, keys: &DeTable<'_>) -> Result<Quantity, EquationsError> {
    let mut quantity = Quantity::new(entry.name, &entry.text(keys, "unit")?);
    quantity.description = entry.text(keys, "words")?;
    Ok(quantity)
}

fn tapes(
    graph: &Graph,
    states: &[StateText],
    outputs: &[(Id, NoiseValue)],
    jumps: Option<Jumps>,
) -> Tapes {
    let noises = || {
        states
            .iter()
            .map(|s| &s.noise)
            .chain(outputs.iter().map(|o| &o.1))
    };
    let levels: Vec<Id> = noises().map(|noise| noise.level).collect();
    let ids = |of: &dyn Fn(&StateText) -> Id| -> Vec<Id> { states.iter().map(of).collect() };
    let ends: Vec<Id> = states.iter().flat_map(|state| state.limits).collect();
    let is_constant = ends.iter().all(|id| graph.constant(*id).is_some());
    Tapes {
        drift: OperationTape::new(graph, &ids(&|state| state.motion)),
        jumps,
        observe: OperationTape::new(graph, &outputs.iter().map(|o| o.0).collect::<Vec<_>>()),
        noise: OperationTape::new(graph, &levels),
        per_second: noises().map(|noise| noise.is_per_second).collect(),
        given: (0..states.len())
            .filter(|i| states[*i].start.is_given)
            .collect(),
        start: OperationTape::new(graph, &ids(&|state| state.start.mean)),
        deviation: OperationTape::new(graph, &ids(&|state| state.start.deviation)),
        ends: (!is_constant).then(|| OperationTape::new(graph, &ends)),
    }
}

/// Limits that are numbers; those that are not are felt beside them.
fn limits(graph: &Graph, states: &[StateText]) -> Vec<Interval> {
    let of = |state: &StateText| {
        let [low, high] = state.limits.map(|id| graph.constant(id));
        Interval::unchecked(
            low.unwrap_or(f64::NEG_INFINITY),
            high.unwrap_or(f64::INFINITY),
        )
    };
    states.iter().map(of).collect()
}

/// Reads the name of the twin.
fn name(source: SourceText<'_>, file: &DeTable<'_>) -> Result<String, EquationsError> {
    let Some(twin) = file.get("twin") else {
        return Ok(UNNAMED.into());
    };
    let whole = TableEntry {
        source,
        table: "twin",
        name: "twin",
        byte: twin.span().start,
        value: twin,
    };
    let name = match twin.get_ref().as_str() {
        Some(name) => name.into(),
        None => whole.text(whole.keys(&["name"])?, "name")?,
    };
    check_name(&name).or_else(|problem| whole.error(problem))?;
    Ok(if name.is_empty() {
        UNNAMED.into()
    } else {
        name
    })
}

/// Reads the integrator, the number of its steps within a sample and the tolerance of adaptive ones.
fn integrator(
    source: SourceText<'_>,
    file: &DeTable<'_>,
    is_discrete: bool,
) -> Result<(Integrator, Stepping), EquationsError> {
    let record = file
        .get(RECORD)
        .and_then(|value| value.get_ref().as_table());
    let value = record.and_then(|record| record.get("integrator"));
    let named = match value.and_then(|value| value.get_ref().as_str()) {
        None => None,
        Some("euler") => Some(Integrator::Euler),
        Some("runge-kutta-4") => Some(Integrator::RungeKutta4),
        Some("discrete") => Some(Integrator::Discrete),
        Some("adaptive") => Some(Integrator::Adaptive),
        Some("stiff") => Some(Integrator::Stiff),
        Some(other) => {
            let byte = value.map_or(0, |value| value.span().start);
            let problem = format!(
                "unknown integrator \"{}\"; there are adaptive, stiff, discrete, euler and runge-kutta-4",
                excerpt(other)
            );
            return source.error(byte, problem);
        }
    };
    let byte = value.map_or(0, |value| value.span().start);
    let integrator = match (named, is_discrete) {
        (None | Some(Integrator::Discrete), true) => Integrator::Discrete,
        (Some(_), true) => {
            return source.error(
                byte,
                "states that have next are discrete; leave out the integrator",
            );
        }
        (Some(Integrator::Discrete), false) => {
            return source.error(byte, "discrete is for states that have next, and these have a rate; choose another integrator");
        }
        (Some(other), false) => other,
        (None, false) => Integrator::Adaptive,
    };
    Ok((integrator, stepping(record, &source)?))
}

/// Substeps and tolerance of the table `record`.
fn stepping(
    record: Option<&DeTable<'_>>,
    source: &SourceText<'_>,
) -> Result<Stepping, EquationsError> {
    let given = |key| {
        let value = record.and_then(|record| record.get(key))?;
        Some((value.span(), number(value.get_ref()).unwrap_or(f64::NAN)))
    };
    let refused = |key, at: Range<usize>, remedy: String| {
        let written = excerpt(&source.0[at.clone()]);
        source.error(at.start, format!("{key} = {written}; {remedy}"))
    };
    let mut stepping = Stepping::default();
    if let Some((at, substeps)) = given("substeps") {
        if substeps.fract() != 0.0 || !(1.0..=MOST_SUBSTEPS as f64).contains(&substeps) {
            let remedy = format!("choose a whole number between 1 and {MOST_SUBSTEPS}");
            return refused("substeps", at, remedy);
        }
        stepping.substeps = substeps as usize;
    }
    if let Some((at, tolerance)) = given("tolerance") {
        if !TOLERANCES.contains(&tolerance) {
            let (least, most) = (TOLERANCES.start(), TOLERANCES.end());
            let remedy = format!("choose a share between {least:e} and {most}");
            return refused("tolerance", at, remedy);
        }
        stepping.tolerance = tolerance;
    }
    Ok(stepping)
}
