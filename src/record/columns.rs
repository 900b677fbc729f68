//! The columns of a file that hold the channels of a twin, or of none that is known.

use super::channels::{self, Quantity, Signals, column_names, is_usual, usual_name};
use crate::setting::did_you_mean;
use crate::storage::untrusted::{excerpt, quoted};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

/// Columns of files that do not have the usual names: name in the twin → column in the file.
///
/// Names in the twin are `t`, its inputs and outputs, or `u`, `u1`, `y`, `y1` and so on.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    try_from = "BTreeMap<String, String>",
    into = "BTreeMap<String, String>"
)]
pub struct Columns(BTreeMap<String, String>);

impl From<Columns> for BTreeMap<String, String> {
    fn from(columns: Columns) -> Self {
        columns.0
    }
}

impl TryFrom<BTreeMap<String, String>> for Columns {
    type Error = &'static str;

    fn try_from(columns: BTreeMap<String, String>) -> Result<Self, Self::Error> {
        // A date reads as a table of one key of the parser's own.
        match columns.keys().any(|key| key.starts_with('$')) {
            true => Err("found a date, expected a table of columns, such as t = \"time\""),
            // Cells of a header have no blanks at their ends either.
            false => Ok(Self(
                (columns.into_iter())
                    .map(|(key, column)| (key, column.trim().to_owned()))
                    .collect(),
            )),
        }
    }
}

impl Columns {
    /// Returns `true` if all columns have their usual names.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Checks that each key is a channel of a twin, or the time.
    pub(crate) fn check(&self, signals: &Signals) -> Result<(), String> {
        let mut keys = self.0.keys();
        keys.try_for_each(|key| channel_of(key, Some(signals)).map(drop))?;
        let header = self.header(signals);
        let cells: Vec<&str> = header.iter().map(String::as_str).collect();
        let is_repeated = |at: &usize| cells[*at].is_empty() || cells[..*at].contains(&cells[*at]);
        let odd = match (0..cells.len()).find(is_repeated) {
            Some(at) => Some(at),
            None => {
                let read = self.usual_names(&cells, Some(signals));
                let read = read.map_err(|problem| format!("columns: {problem}"))?;
                let usual = channels::columns(signals.inputs.len(), signals.outputs.len());
                (read.iter().zip(&usual)).position(|(read, usual)| read.as_ref() != Some(usual))
            }
        };
        match odd {
            None => Ok(()),
            Some(at) => Err(format!(
                "columns: \"{}\" is no column, or that of two channels; give each channel a column of its own",
                quoted(cells[at])
            )),
        }
    }

    /// Header of a file that is read with these columns as a record of a twin: other columns have names that its reader tells apart.
    pub(crate) fn header(&self, signals: &Signals) -> Vec<String> {
        let given = |name: &str| {
            let is_it = |key: &str| usual_name(key, Some(signals)).is_some_and(|own| own == name);
            let found = self.0.iter().find(|(key, _)| is_it(key));
            found.map(|(_, column)| column.clone())
        };
        let usual = channels::columns(signals.inputs.len(), signals.outputs.len());
        let outputs = usual.len() - signals.outputs.len();
        (usual
            .iter()
            .zip(channels::header(signals, true))
            .enumerate())
        .map(|(at, (usual, header))| {
            let own = at.checked_sub(outputs).map(|j| &signals.outputs[j].name);
            let own = own.filter(|own| self.is_by_name(own, Some(signals)));
            given(usual).or(own.cloned()).unwrap_or(header)
        })
        .collect()
    }

    /// Returns whether a column is an output of the twin by its name alone, as each is that is not given beside others that are.
    fn is_by_name(&self, column: &str, signals: Option<&Signals>) -> bool {
        let (Some(signals), Some(usual)) = (signals, usual_name(column, signals)) else {
            return false;
        };
        let keys = self.0.keys();
        let given: Vec<String> = keys
            .filter_map(|key| usual_name(key, Some(signals)))
            .collect();
        channels::is_cell(column)
            && self.0.values().all(|other| other != column)
            && signals.outputs.iter().any(|output| output.name == column)
            && given.iter().any(|given| given.starts_with('y'))
            && !given.contains(&usual)
    }

    /// The same without those of outputs, for files of time and inputs.
    pub(super) fn without_outputs(&self, signals: Option<&Signals>) -> Self {
        let is_output = |key: &str| usual_name(key, signals).is_some_and(|n| n.starts_with('y'));
        let mut columns = self.0.clone();
        columns.retain(|key, _| !is_output(key));
        Self(columns)
    }

    /// Translates a header into the usual names, `None` for a column that is left out.
    ///
    /// Times, inputs and outputs that are given here come from these columns alone; the others from columns with their usual
    /// names or the twin's. Columns are left out only where some are given.
    pub(super) fn usual_names(
        &self,
        header: &[&str],
        signals: Option<&Signals>,
    ) -> Result<Vec<Option<String>>, String> {
        let given = self.given(header, signals)?;
        let letters: Vec<char> = (given.iter().flatten())
            .filter_map(|name| name.chars().next())
            .collect();
        let is_given = |letter: char| letters.contains(&letter);
        let names = (header.iter().zip(given).enumerate())
            .map(|(at, (column, given))| {
                if self.0.values().any(|asked| asked == column) && header[..at].contains(column) {
                    return Err(appears_twice(column));
                }
                if given.is_some() {
                    return Ok(given);
                }
                let usual = usual_name(column, signals).unwrap_or_else(|| (*column).to_owned());
                let is_replaced = usual.starts_with(is_given) && !self.is_by_name(column, signals);
                let is_other = !is_usual(&usual) || is_replaced;
                Ok((self.is_empty() || !is_other).then_some(usual))
            })
            .collect::<Result<Vec<_>, String>>()?;
        match signals.and_then(|signals| ambiguous(header, &names, signals)) {
            Some(problem) => Err(problem),
            None => Ok(names),
        }
    }

    /// Returns the usual name of each column that is given here.
    fn given(
        &self,
        header: &[&str],
        signals: Option<&Signals>,
    ) -> Result<Vec<Option<String>>, String> {
        let mut names: Vec<Option<String>> = vec![None; header.len()];
        let lacks = signals.is_some_and(|signals| signals.outputs.len() > 1);
        for (key, column) in &self.0 {
            let usual = channel_of(key, signals)?;
            let at = (header.iter()).position(|name| name == column);
            let has_other = |key: &String| {
                let is_output = |key| usual_name(key, signals).is_some_and(|n| n.starts_with('y'));
                is_output(key.as_str()) && header.contains(&self.0[key].as_str())
            };
            // A record may lack a sensor that others have.
            if at.is_none() && usual.starts_with('y') && lacks && self.0.keys().any(has_other) {
                continue;
            }
            let at = at.ok_or_else(|| {
                let near = did_you_mean(column, header);
                format!(
                    "no column is called \"{}\"{near}, which is to be {}; the columns are {}",
                    quoted(column),
                    quoted(key),
                    excerpt(&header.join(", "))
                )
            })?;
            if names.iter().flatten().any(|name| *name == usual) {
                return Err(format!(
                    "two columns are to be {}, which is also {}; give one of them",
                    quoted(key),
                    usual
                ));
            }
            if let Some(other) = names[at].replace(usual) {
                return Err(format!(
                    "column \"{}\" is to be both {other} and {}; give each its own column",
                    quoted(column),
                    quoted(key)
                ));
            }
        }
        if let Some(at) = header.iter().position(|name| *name == "t")
            && let Some(other) = names[at].as_ref().filter(|name| *name != "t")
            && !names.iter().flatten().any(|name| name == "t")
        {
            return Err(format!(
                "column t is to be {other}, and no other one is the time; give its column as t"
            ));
        }
        for letter in ["u", "y"].into_iter().filter(|l| *l == "u" || !lacks) {
            let given: Vec<&String> = (names.iter().flatten())
                .filter(|name| name.starts_with(letter))
                .collect();
            let is_missing = |number: &usize| {
                let numbered = format!("{letter}{number}");
                let alone = *number == 1 && given.iter().any(|name| *name == letter);
                !alone && !given.contains(&&numbered)
            };
            if let Some(number) = (1..=given.len()).find(is_missing) {
                return Err(format!(
                    "no column is given for {letter}{number}; give every input, or none, and every output, or none"
                ));
            }
        }
        Ok(names)
    }
}

/// Columns of a file that are read.
#[derive(Clone, Copy)]
pub(super) enum Wanted<'a> {
    /// Those of a record of a twin with these channels, if they are known.
    Record(&'a Columns, Option<&'a Signals>),
    /// The time, and the input that has the first of these names in the file; none where there are no names.
    Input(&'a [&'a str]),
    /// Those of a record of any twin: `u…` are inputs, `y…` outputs, in the order of the file.
    ByLetter,
}

impl<'a> Wanted<'a> {
    /// Returns `true` if no column is given another name.
    pub fn is_usual(self) -> bool {
        match self {
            Self::Record(columns, _) => columns.is_empty(),
            Self::Input(_) | Self::ByLetter => true,
        }
    }

    /// Channels of the twin, where it is known.
    pub fn signals(self) -> Option<&'a Signals> {
        match self {
            Self::Record(_, signals) => signals,
            _ => None,
        }
    }

    /// Translates a header into the usual names, `None` for a column that is left out.
    pub fn usual_names(self, header: &[&str]) -> Result<Vec<Option<String>>, String> {
        let names = match self {
            Self::Record(columns, signals) => return columns.usual_names(header, signals),
            Self::Input(names) => names,
            Self::ByLetter => return by_letter(header),
        };
        let input = match names.first() {
            Some(name) => Some(input_column(header, names, name)?),
            None => None,
        };
        let usual = |(at, column): (usize, &&str)| match *column {
            _ if Some(at) == input => Some("u".to_owned()),
            "t" => Some("t".to_owned()),
            _ => None,
        };
        Ok(header.iter().enumerate().map(usual).collect())
    }
}

/// The error of a column whose name another one has.
fn appears_twice(column: &str) -> String {
    format!(
        "column \"{}\" appears twice; rename or remove one",
        quoted(column)
    )
}

/// The usual name of each column by its first letter, in the order of the file; other columns as they are.
fn by_letter(header: &[&str]) -> Result<Vec<Option<String>>, String> {
    let count = |letter: char| {
        let own = header
            .iter()
            .filter(|c| is_usual(c) && c.starts_with(letter));
        own.count()
    };
    let [mut inputs, mut outputs] = [("u", 'u'), ("y", 'y')]
        .map(|(name, letter)| column_names(name, count(letter)).into_iter());
    (header.iter().enumerate())
        .map(|(at, column)| {
            if header[..at].contains(column) {
                return Err(appears_twice(column));
            }
            let usual = match column.chars().next().filter(|_| is_usual(column)) {
                Some('u') => inputs.next(),
                Some('y') => outputs.next(),
                _ => None,
            };
            Ok(Some(usual.unwrap_or_else(|| (*column).to_owned())))
        })
        .collect()
}

/// Index of the column of an input: the first of `names` that a column has, or the only column that is neither time nor output.
fn input_column(header: &[&str], names: &[&str], own: &str) -> Result<usize, String> {
    let at = |name: &&str| header.iter().position(|column| column == name);
    if let Some(at) = names.iter().find_map(at) {
        return match header[at + 1..].contains(&header[at]) {
            false => Ok(at),
            true => Err(appears_twice(header[at])),
        };
    }
    let is_output = |column: &str| is_usual(column) && column.starts_with('y');
    let inputs: Vec<usize> = (0..header.len())
        .filter(|at| header[*at] != "t" && !is_output(header[*at]))
        .collect();
    match inputs[..] {
        [at] => Ok(at),
        _ => Err(format!(
            "no column is called \"{}\"{}; the columns are {}: rename one to {}",
            quoted(own),
            did_you_mean(own, inputs.iter().map(|at| header[*at])),
            excerpt(&header.join(", ")),
            quoted(own)
        )),
    }
}

/// Parses `t=time,u=pump,y=level`.
impl FromStr for Columns {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut columns = BTreeMap::new();
        // A name that begins with a quote ends with one, and has two for each of its own.
        let (mut before, mut has_quotes, mut is_quoted) = (',', false, false);
        let between = |c: char| {
            has_quotes |= c == '"' && before == '=';
            is_quoted ^= c == '"' && has_quotes;
            let ends = c == ',' && !is_quoted;
            has_quotes &= !ends;
            before = if c.is_whitespace() { before } else { c };
            ends
        };
        for part in text.split(between) {
            let (key, column) = (part.split_once('='))
                .map(|(key, column)| (key.trim(), unquoted(column.trim())))
                .filter(|(key, column)| !key.is_empty() && !column.is_empty())
                .ok_or_else(|| {
                    format!(
                        "\"{}\" is not name=column; write t=time,u=pump, or u=\"pump, V\" for a name with a comma",
                        quoted(part)
                    )
                })?;
            if columns.insert(key.to_owned(), column.to_owned()).is_some() {
                return Err(format!("{} is given twice; give it once", quoted(key)));
            }
        }
        Ok(Self(columns))
    }
}

/// The name between quotes.
fn unquoted(name: &str) -> String {
    let inner = name
        .strip_prefix('"')
        .and_then(|name| name.strip_suffix('"'));
    inner.map_or(name.to_owned(), |inner| inner.trim().replace("\"\"", "\""))
}

/// Returns the two columns of a header that are one channel of the twin, under different names; or one that is two channels.
fn ambiguous(header: &[&str], names: &[Option<String>], signals: &Signals) -> Option<String> {
    let has = |channels: &[Quantity], name: &str| channels.iter().any(|c| c.name == name);
    for (at, (column, name)) in header.iter().zip(names).enumerate() {
        // Time is time, whatever channels are called.
        let is_channel = name.as_deref().is_some_and(|name| name != "t");
        if is_channel && has(&signals.inputs, column) && has(&signals.outputs, column) {
            return Some(format!(
                "column \"{0}\" is the name of an input and of an output; name the columns {1}",
                quoted(column),
                excerpt(&channels::header(signals, true).join(", "))
            ));
        }
        let same = |(other, its): (&&str, &Option<String>)| its == name && other != column;
        let before = header[..at].iter().zip(names);
        if let Some((other, _)) = before
            .into_iter()
            .find(|pair| same(*pair) && name.is_some())
        {
            return Some(format!(
                "columns \"{}\" and \"{}\" are one channel of the twin; name each by its own name, {}",
                quoted(other),
                quoted(column),
                excerpt(&channels::header(signals, true).join(", "))
            ));
        }
    }
    None
}

/// Returns the usual name of the channel, or the time, that a key is, or the error.
fn channel_of(key: &str, signals: Option<&Signals>) -> Result<String, String> {
    let own = usual_name(key, signals).filter(|name| is_of(name, signals));
    own.ok_or_else(|| unknown_key(key, signals))
}

/// Returns whether the twin has a channel of this usual name, as far as it is known.
fn is_of(usual: &str, signals: Option<&Signals>) -> bool {
    let (Some(signals), false) = (signals, usual == "t") else {
        return true;
    };
    let channels = match usual.starts_with('u') {
        true => signals.inputs.len(),
        false => signals.outputs.len(),
    };
    match &usual[1..] {
        "" => channels == 1,
        number => (number.parse()).is_ok_and(|number| (1..=channels).contains(&number)),
    }
}

/// The error of a name that is not the twin's.
fn unknown_key(key: &str, signals: Option<&Signals>) -> String {
    let own = signals.map(|s| s.inputs.iter().chain(&s.outputs));
    let mut known = vec!["t"];
    match own {
        Some(channels) => known.extend(channels.map(|channel| channel.name.as_str())),
        None => known.extend(["u", "u1", "u2", "y", "y1", "y2"]),
    }
    format!(
        "columns: no channel is called \"{}\"{}; there are {}",
        quoted(key),
        did_you_mean(key, &known),
        excerpt(&known.join(", "))
    )
}

#[cfg(test)]
mod tests {
    use super::super::channels;
    use super::*;
    use crate::record::{Drive, Record, RecordReader, Signal};

    fn names(columns: &str, header: &str) -> Result<Vec<String>, String> {
        let signals = Signals {
            inputs: vec![Quantity::new("pump", "V")],
            outputs: vec![Quantity::new("upper", "m"), Quantity::new("lower", "m")],
        };
        let columns = match columns {
            "" => Columns::default(),
            text => text.parse()?,
        };
        let header: Vec<&str> = header.split(',').collect();
        let names = columns.usual_names(&header, Some(&signals))?;
        Ok(names.into_iter().map(Option::unwrap_or_default).collect())
    }

    #[test]
    fn columns_are_found_by_the_names_of_the_twin() {
        let own = names("", "t,pump,lower,upper").unwrap();
        assert_eq!(own, ["t", "u", "y2", "y1"]);
        let mixed = names("t=time,upper=A,y2=B", "B,t,time,u,A,note,y1").unwrap();
        assert_eq!(mixed, ["y2", "", "t", "u", "y1", "", ""]);
        assert_eq!(names("", "t,u,note").unwrap(), ["t", "u", "note"]);
        assert_eq!(names("lower=a", "t,a").unwrap(), ["t", "y2"]);
        assert_eq!(names("lower=a,upper=b", "t,a").unwrap(), ["t", "y2"]);
        // Beside an output that is given, another one is found by its own name alone: y1 may be anything.
        let beside = names("lower=a", "t,upper,a").unwrap();
        assert_eq!(beside, ["t", "y1", "y2"]);
        assert_eq!(names("lower=a", "t,y1,a").unwrap(), ["t", "", "y2"]);
        assert_eq!(names("lower=\" a \"", "t,a").unwrap(), ["t", "y2"]);
    }

    /// Whatever the channels are called, the reader takes the columns of the header for the channels that they are written from.
    #[test]
    fn a_header_is_read_as_it_was_written() {
        let place = tempfile::tempdir().unwrap();
        let [path, moved] = ["r.csv", "read.csv"].map(|name| place.path().join(name));
        let pool = [
            "u", "u0", "u1", "u2", "u3", "u01", "y", "y0", "y1", "y2", "y3", "y01", "t", "a", "b",
            "a,b", " a", "",
        ];
        let mut state = 1_u64;
        let mut below = |n: usize| {
            state = (state.wrapping_mul(6_364_136_223_846_793_005))
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % n
        };
        let (mut own, mut partly) = (0, 0);
        for trial in 0..500 {
            let mut drawn = |count: usize| {
                let mut names: Vec<&str> = vec![];
                while names.len() < count {
                    let name = pool[below(pool.len())];
                    if !names.contains(&name) {
                        names.push(name);
                    }
                }
                names
                    .into_iter()
                    .map(|name| Quantity::new(name, ""))
                    .collect()
            };
            let signals = Signals {
                inputs: drawn(trial % 4),
                outputs: drawn(1 + trial % 5),
            };
            for outputs in [true, false] {
                let written = channels::header(&signals, outputs);
                let shown = if outputs { signals.outputs.len() } else { 0 };
                let expected = channels::columns(signals.inputs.len(), shown);
                own += usize::from(written != expected);
                let columns: Vec<&str> = written.iter().map(String::as_str).collect();
                let read = Columns::default().usual_names(&columns, Some(&signals));
                let read: Vec<String> = read.unwrap().into_iter().flatten().collect();
                assert_eq!(read, expected, "{signals:?}: {written:?}");
            }
            let value = |k: usize, j: usize| (10 * j + k) as f64;
            let inputs = Signal::from_shape_fn((3, signals.inputs.len()), |(k, j)| value(k, j));
            let outputs = Signal::from_shape_fn((3, signals.outputs.len()), |(k, j)| -value(k, j));
            let record = Record::new(Drive::new(0.5, inputs).unwrap(), outputs).unwrap();
            // One of several outputs may have a column of another name.
            let given = format!("y{}", 1 + below(signals.outputs.len()));
            let mut all = vec![Columns::default()];
            if signals.outputs.len() > 1 {
                all.push(Columns([(given, "logged".to_owned())].into()));
            }
            for columns in all.into_iter().filter(|all| all.check(&signals).is_ok()) {
                partly += usize::from(!columns.is_empty());
                record
                    .write_named(&path, &columns.header(&signals))
                    .unwrap();
                std::fs::rename(&path, &moved).unwrap();
                let mut reader = RecordReader::new(columns, Some(signals.clone()));
                let read = reader.record(&moved).unwrap();
                let inputs = read.drive().inputs();
                assert_eq!(inputs, record.drive().inputs(), "{signals:?}");
                assert_eq!(read.outputs(), record.outputs(), "{signals:?}");
            }
        }
        assert!(partly > 100, "only {partly} headers have a given column");
        assert!(own > 100, "only {own} headers need names of their own");
    }

    #[test]
    fn a_name_of_a_channel_is_that_channel_alone() {
        let quantities =
            |names: &[&str]| names.iter().map(|name| Quantity::new(name, "")).collect();
        let read = |inputs: &[&str], outputs: &[&str], header: &[&str]| {
            let signals = Signals {
                inputs: quantities(inputs),
                outputs: quantities(outputs),
            };
            let names = Columns::default().usual_names(header, Some(&signals))?;
            Ok::<_, String>(names.into_iter().flatten().collect::<Vec<_>>())
        };
        let swapped = read(&["u"], &["y2", "y1"], &["t", "u", "y1", "y2"]).unwrap();
        assert_eq!(swapped, ["t", "u", "y2", "y1"]);
        let from_zero = read(&[], &["y0", "y1"], &["t", "y0", "y1"]).unwrap();
        assert_eq!(from_zero, ["t", "y1", "y2"]);
        let twice = read(&[], &["y0", "y1"], &["t", "y1", "y2"]).unwrap_err();
        assert!(
            twice.contains("\"y1\" and \"y2\" are one channel"),
            "{twice}"
        );
        let both = read(&["y"], &["y"], &["t", "u", "y"]).unwrap_err();
        assert!(both.contains("an input and of an output"), "{both}");
    }

    #[test]
    fn a_date_is_no_table_of_columns() {
        #[derive(Debug, Deserialize)]
        struct File {
            columns: Columns,
        }
        let read = |text: &str| toml::from_str::<File>(text).map(|file| file.columns);
        assert!(!read("columns = { t = 'time' }").unwrap().is_empty());
        let date = read("columns = 1979-05-27T07:32:00Z").unwrap_err();
        assert!(date.to_string().contains("expected a table"), "{date}");
    }

    #[test]
    fn wrong_columns_are_named() {
        for (columns, header, part) in [
            (
                "t=tim",
                "time,u",
                "no column is called \"tim\" (did you mean \"time\"?)",
            ),
            (
                "pumpp=a",
                "t,a",
                "no channel is called \"pumpp\" (did you mean \"pump\"?)",
            ),
            ("t=a,u=a", "a,b", "column \"a\" is to be both"),
            ("y1=t", "t,u,y", "no other one is the time"),
            (
                "pump=\"a, V\",y1=b",
                "t,a,b",
                "no column is called \"a, V\"",
            ),
            ("y3=y", "t,u,y", "no channel is called \"y3\""),
            ("u0=y", "t,u,y", "no channel is called \"u0\""),
            ("u=a,pump=b", "a,b", "two columns are to be u"),
            ("upper=a,y1=b", "a,b", "two columns are to be"),
            ("t=a", "a,a", "column \"a\" appears twice"),
            ("t=a,t=b", "a,b", "t is given twice"),
            ("time", "a,b", "not name=column"),
            ("t=", "a,b", "not name=column"),
        ] {
            let error = names(columns, header).unwrap_err();
            assert!(error.contains(part), "{columns}: {error}");
        }
    }
}
