//! Plan of simulated records: step, length, input.

use crate::math::{ends, six_digits};
use crate::record::{
    Drive, LARGEST, MOST_SAMPLES, Quantity, Record, RecordError, RecordReader, Signal, Signals,
    UNIFORM, column_names,
};
use crate::setting::{count, number};
use crate::storage::untrusted::MOST_NUMBERS;
use crate::study::error::StudyError;
use crate::study::input_plan::{InputPlan, PlannedInputs};
use crate::twin::{Interval, Noise};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Stretches of constant input in a record that is like a measured one.
const HOLDS: usize = 15;

/// Step, length and input of simulated records.
///
/// ```
/// use truetwin::study::RecordPlan;
///
/// let with_input = RecordPlan::levels(0.1, 300, 0.0, 1.0, 20); // levels in [0, 1], each for 20 samples
/// let without = RecordPlan::autonomous(0.1, 300);
/// assert_eq!((with_input.samples, without.step), (300, 0.1));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RecordPlan {
    /// Step Δt in seconds.
    pub step: f64,
    /// Samples N.
    pub samples: usize,
    /// Inputs; `None` for a twin without.
    pub(crate) input: Option<PlannedInputs>,
    /// Time of the first row, in seconds.
    pub(crate) first_time: f64,
}

impl RecordPlan {
    /// A record without inputs, its first row at 0 s.
    pub fn autonomous(step: f64, samples: usize) -> Self {
        Self {
            step,
            samples,
            input: None,
            first_time: 0.0,
        }
    }

    /// A record under random levels in `[low, high]`, each held for `hold` samples.
    pub fn levels(step: f64, samples: usize, low: f64, high: f64, hold: usize) -> Self {
        let levels = Interval::unchecked(low, high);
        Self {
            step,
            samples,
            input: Some(PlannedInputs::Alike { levels, hold }),
            first_time: 0.0,
        }
    }

    /// A record whose inputs have a plan each, by the twin's names of them.
    ///
    /// ```
    /// use truetwin::study::{InputPlan, RecordPlan};
    ///
    /// let plan = RecordPlan::by_input(2.0, 400, [
    ///     ("hot_flow", InputPlan::levels(0.05, 0.4, 25)), // levels in [0.05, 0.4], each for 25 samples
    ///     ("cold_flow", InputPlan::Constant(0.2)),
    /// ]);
    /// assert_eq!((plan.samples, plan.step), (400, 2.0));
    /// ```
    pub fn by_input<N: Into<String>>(
        step: f64,
        samples: usize,
        inputs: impl IntoIterator<Item = (N, InputPlan)>,
    ) -> Self {
        let plans = inputs.into_iter().map(|(name, plan)| (name.into(), plan));
        Self {
            input: Some(PlannedInputs::Each(plans.collect())),
            ..Self::autonomous(step, samples)
        }
    }

    /// A record like a measured one: its times, levels in the range of its inputs.
    pub(super) fn like(record: &Record) -> Self {
        let drive = record.drive();
        let (step, samples) = (drive.dt(), record.samples());
        let inputs: Vec<f64> = drive.inputs().iter().copied().collect();
        let plan = match inputs.is_empty() {
            true => Self::autonomous(step, samples),
            false => {
                let (low, high) = ends(&inputs);
                Self::levels(step, samples, low, high, (samples / HOLDS).max(1))
            }
        };
        Self {
            first_time: drive.first_time(),
            ..plan
        }
    }

    /// Checks step, length and levels; a file of inputs is not read.
    pub(super) fn check(&self, signals: &Signals) -> Result<(), StudyError> {
        let channels = signals.inputs.len();
        let all = channels + signals.outputs.len();
        let samples = self.samples;
        let problem = if samples == 0 {
            Some("samples = 0; at least one is needed".into())
        } else if samples > MOST_SAMPLES {
            Some(format!(
                "samples = {}; at most {MOST_SAMPLES} can be simulated: take a larger step or a shorter record",
                number(samples as f64)
            ))
        } else if samples.saturating_mul(all) > MOST_NUMBERS {
            Some(format!(
                "samples = {samples} for {all} inputs and outputs; at most {} numbers can be simulated: take a shorter record",
                number(MOST_NUMBERS as f64)
            ))
        } else if self.step * samples as f64 > LARGEST {
            Some(format!(
                "step = {}; a record of {} ends beyond {LARGEST:e} s: take a smaller step",
                number(self.step),
                count(samples, "sample")
            ))
        } else if self.input.is_some() && channels == 0 {
            Some("input is given, but the twin has none; remove it".into())
        } else {
            let input = self.input.as_ref();
            input.and_then(|input| input.check(&signals.inputs).err())
        };
        if let Some(problem) = problem {
            return Err(StudyError::Plan(problem));
        }
        let levels = match &self.input {
            Some(PlannedInputs::Alike { levels, .. }) => [levels.low(), levels.high()],
            _ => [0.0; 2],
        };
        // The ends of the levels, one after the other, are what any drive is drawn between.
        let ends = Signal::from_shape_fn((samples.min(2), 1), |(k, _)| levels[k]);
        Drive::new(self.step, ends)?;
        Ok(())
    }

    /// Draws the input of a record of a twin with these channels; a fixed one is the same for any noise.
    pub fn drive(&self, signals: &Signals, noise: Noise) -> Result<Drive, StudyError> {
        Ok(self.prepare(signals)?.draw(noise)?)
    }

    /// Makes ready what drives are drawn from; reads the input file, if one is named.
    pub(crate) fn prepare(&self, signals: &Signals) -> Result<DriveSource, StudyError> {
        self.check(signals)?;
        let inputs = &signals.inputs;
        let mut source = DriveSource {
            plan: self.clone(),
            inputs: vec![],
            doses: vec![],
            fixed: None,
        };
        match &self.input {
            None if inputs.is_empty() => {
                let drive = Drive::autonomous(self.step, self.samples)?;
                source.fixed = Some(drive.beginning_at(self.first_time));
            }
            None => return Err(StudyError::NoInput(inputs.len())),
            Some(PlannedInputs::File(path)) => source.fixed = Some(read(path, inputs.len())?),
            Some(PlannedInputs::Alike { levels, hold }) => {
                let (levels, hold) = (*levels, *hold);
                source.inputs = vec![InputSource::Levels { levels, hold }; inputs.len()];
            }
            Some(PlannedInputs::Each(plans)) => {
                source.inputs = self.sources(plans, inputs, &mut source.plan.first_time)?;
            }
        }
        Ok(source)
    }

    /// Makes ready what each input is drawn from, in the order of the twin; files say when the first row is.
    fn sources(
        &self,
        plans: &BTreeMap<String, InputPlan>,
        inputs: &[Quantity],
        first_time: &mut f64,
    ) -> Result<Vec<InputSource>, StudyError> {
        let mut first: Option<(&Path, f64)> = None;
        let mut source = |input: &Quantity| match plans.get(&input.name) {
            Some(InputPlan::Levels { levels, hold }) => Ok(InputSource::Levels {
                levels: *levels,
                hold: *hold,
            }),
            Some(InputPlan::Constant(value)) => Ok(InputSource::Constant(*value)),
            Some(InputPlan::File(path)) => {
                let drive = self.column(path, input, inputs)?;
                *first_time = drive.first_time();
                let (other, time) = *first.get_or_insert((path, *first_time));
                if (*first_time - time).abs() > UNIFORM * self.step {
                    return Err(StudyError::Plan(format!(
                        "{}: column t begins at {} s, that of {} at {} s; inputs of one record begin together: cut or shift one",
                        path.display(),
                        number(*first_time),
                        other.display(),
                        number(time)
                    )));
                }
                let values = drive.inputs().iter().copied();
                Ok(InputSource::Given(values.collect()))
            }
            // All are named: checked before.
            None => Err(StudyError::NoInput(inputs.len())),
        };
        inputs.iter().map(&mut source).collect()
    }

    /// Reads the column of one input from a file with the step and the length of the plan.
    fn column(
        &self,
        path: &Path,
        input: &Quantity,
        inputs: &[Quantity],
    ) -> Result<Drive, StudyError> {
        let at = inputs.iter().position(|other| other == input);
        let usual = column_names("u", inputs.len()).swap_remove(at.unwrap_or_default());
        let mut names = vec![input.name.as_str()];
        // A name of the twin's own goes before the usual name of another input.
        if inputs.iter().all(|other| other.name != usual) {
            names.push(&usual);
        }
        let drive = (RecordReader::default().input(path, &names)).map_err(of_input)?;
        check_one_step(path, &drive)?;
        let (step, samples) = (drive.dt(), drive.samples());
        if (step - self.step).abs() > UNIFORM * self.step || samples != self.samples {
            return Err(StudyError::Plan(format!(
                "{}: {}, step {} s; simulated records have {}, step {} s: write the file so, or plan records of its step and length",
                path.display(),
                count(samples, "sample"),
                number(step),
                self.samples,
                number(self.step)
            )));
        }
        Ok(drive)
    }

    /// Checks whether a record has the study's step, to 1e-3 of it.
    pub fn check_step(&self, record: &Record) -> Result<(), StudyError> {
        let (given, expected) = (record.drive().dt(), self.step);
        if (given - expected).abs() > UNIFORM * expected {
            return Err(StudyError::OtherStep {
                given: six_digits(given),
                expected,
            });
        }
        Ok(())
    }
}

/// Reads a file of inputs, one step and so many channels.
fn read(path: &Path, channels: usize) -> Result<Drive, StudyError> {
    let drive = Drive::read(path)?;
    check_one_step(path, &drive)?;
    match drive.inputs().ncols() {
        given if given == channels => Ok(drive),
        given => Err(StudyError::Plan(format!(
            "{}: {}, the twin has {channels}; give each its column",
            path.display(),
            count(given, "input")
        ))),
    }
}

fn check_one_step(path: &Path, drive: &Drive) -> Result<(), StudyError> {
    match drive.oddest_step(drive.dt()) {
        None => Ok(()),
        Some(k) => Err(StudyError::Plan(format!(
            "{}, row {}, column t: a step of {} s in place of {} s; simulated records need one step: write the inputs with one",
            path.display(),
            drive.rows().line(k + 1),
            number(six_digits(drive.step(k))),
            number(six_digits(drive.dt()))
        ))),
    }
}

/// The error of a file of one input, whose columns have no other names.
fn of_input(error: RecordError) -> StudyError {
    match error {
        RecordError::Columns { .. } => StudyError::Plan(error.to_string()),
        error => error.into(),
    }
}

/// Step and length of records, with the first file that has them; none without a file.
pub(super) type FilesGrid<'p> = Option<(&'p Path, f64, usize)>;

/// Step and length of the records of a plan, as its files have them.
///
/// # Errors
///
/// A file that cannot be read, or two of them with other steps or lengths; with the input that it is of, as [`PlannedInputs::files`] has it.
pub(super) fn grid_of_files(
    plan: &PlannedInputs,
) -> Result<FilesGrid<'_>, (Option<&str>, StudyError)> {
    let mut grid: FilesGrid<'_> = None;
    for (input, path) in plan.files() {
        let drive = match input {
            None => Drive::read(path).map_err(|error| match error {
                RecordError::Columns { .. } => {
                    StudyError::Plan(format!("{error}; or give each input a file of its own"))
                }
                error => error.into(),
            }),
            // The twin, whose names tell which column it is, may not be known yet.
            Some(_) => RecordReader::default().input(path, &[]).map_err(of_input),
        };
        let drive = drive.map_err(|error| (input, error))?;
        let (step, samples) = (drive.dt(), drive.samples());
        let (first, other, length) = *grid.get_or_insert((path, step, samples));
        if (step - other).abs() > UNIFORM * other || samples != length {
            let problem = format!(
                "{}: {}, step {} s, and {} has {length}, step {} s; inputs of one record have one step and length: write them alike",
                path.display(),
                count(samples, "sample"),
                number(step),
                first.display(),
                number(other)
            );
            return Err((input, StudyError::Plan(problem)));
        }
    }
    Ok(grid)
}

/// Draws the inputs of simulated records.
#[derive(Debug, Clone)]
pub struct DriveSource {
    plan: RecordPlan,
    /// One an input, unless all are fixed.
    inputs: Vec<InputSource>,
    /// Which inputs are amounts that are added at a row; none known for a twin without equations.
    doses: Vec<bool>,
    fixed: Option<Drive>,
}

/// Where the values of one input come from.
#[derive(Debug, Clone)]
enum InputSource {
    Levels { levels: Interval, hold: usize },
    Constant(f64),
    Given(Arc<[f64]>),
}

impl DriveSource {
    /// The same, where random levels of these inputs are doses: given at the first row of each, and nothing until the next.
    pub(super) fn with_doses(mut self, doses: Vec<bool>) -> Self {
        self.doses = doses;
        self
    }

    /// The drive of one record; random levels come from the noise sources `input/1`, `input/2`, …, so that the draws of an input do not
    /// depend on the plans of others.
    pub fn draw(&self, noise: Noise) -> Result<Drive, RecordError> {
        if let Some(drive) = &self.fixed {
            return Ok(drive.clone());
        }
        let mut inputs = Signal::zeros((self.plan.samples, self.inputs.len()));
        for ((j, mut channel), input) in inputs
            .columns_mut()
            .into_iter()
            .enumerate()
            .zip(&self.inputs)
        {
            match input {
                InputSource::Constant(value) => channel.fill(*value),
                InputSource::Given(values) => {
                    for (value, given) in channel.iter_mut().zip(values.iter()) {
                        *value = *given;
                    }
                }
                InputSource::Levels { levels, hold } => {
                    let mut source = noise.source(&format!("input/{}", j + 1));
                    let is_dose = self.doses.get(j).is_some_and(|is_dose| *is_dose);
                    let mut level = 0.0;
                    for (k, value) in channel.iter_mut().enumerate() {
                        if k % hold == 0 {
                            level = levels.low() + levels.width() * source.uniform();
                        } else if is_dose {
                            level = 0.0;
                        }
                        *value = level;
                    }
                }
            }
        }
        Ok(Drive::new(self.plan.step, inputs)?.beginning_at(self.plan.first_time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{Study, StudyFile};

    /// A drug is swallowed once a day, and not all day long.
    #[test]
    fn doses_are_given_once() {
        let text = include_str!("../../examples/pharmacokinetics.toml");
        let file = StudyFile::parse(text, "pk.toml".as_ref()).unwrap();
        let drive = Study::of_file(&file).unwrap().drive(Noise::new(1, "t", 0));
        let doses = drive.unwrap().inputs().column(0).to_vec();
        for (k, dose) in doses.iter().enumerate() {
            let given = k % 24 == 0;
            assert_eq!((50.0..=200.0).contains(dose), given, "row {k}: {dose}");
            assert!(given || *dose == 0.0);
        }
    }

    #[test]
    fn levels_are_held_and_fresh_for_each_record() {
        let plan = RecordPlan::levels(0.5, 100, 0.0, 3.0, 30);
        let source = plan.prepare(&Signals::default()).unwrap();
        let a = source.draw(Noise::new(1, "t", 0)).unwrap();
        let b = source.draw(Noise::new(1, "t", 1)).unwrap();
        assert_ne!(a, b);
        for drive in [&a, &b] {
            let u: Vec<f64> = drive.inputs().iter().copied().collect();
            assert!(u.iter().all(|v| (0.0..3.0).contains(v)));
            assert!((1..100).all(|k| (u[k] != u[k - 1]) == (k % 30 == 0)));
        }
    }

    fn signals(names: &[&str]) -> Signals {
        Signals {
            inputs: names.iter().map(|name| Quantity::new(name, "")).collect(),
            ..Signals::default()
        }
    }

    /// Draws of an input are those of the same levels of all inputs, whatever the others do.
    #[test]
    fn each_input_follows_its_own_plan() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("w.csv");
        std::fs::write(&file, "t,y,other\n5,0,1\n5.5,0,2\n6,0,4\n").unwrap();
        let signals = signals(&["a", "b", "c"]);
        let noise = Noise::new(1, "t", 0);
        let draw = |plan: RecordPlan| plan.drive(&signals, noise).unwrap();
        let alike = draw(RecordPlan::levels(0.5, 3, 0.0, 2.0, 2));
        let each = draw(RecordPlan::by_input(
            0.5,
            3,
            [
                ("c", InputPlan::levels(0.0, 2.0, 2)),
                ("a", InputPlan::Constant(60.0)),
                ("b", InputPlan::File(file)),
            ],
        ));
        assert_eq!(each.inputs().column(0).to_vec(), [60.0; 3]);
        assert_eq!(each.inputs().column(1).to_vec(), [1.0, 2.0, 4.0]);
        assert_eq!(each.inputs().column(2), alike.inputs().column(2));
        assert_eq!(
            (each.first_time(), each.dt(), alike.first_time()),
            (5.0, 0.5, 0.0)
        );
    }

    /// The twin's name of an input goes first, then the usual one, then the only column.
    #[test]
    fn the_column_of_an_input_is_found_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("w.csv");
        let column = |names: &[&str], input: &str, header: &str| {
            std::fs::write(&file, format!("{header}\n0,1,2,3\n1,1,2,3\n2,1,2,3\n")).unwrap();
            let plans = (names.iter()).map(|name| match *name == input {
                true => (*name, InputPlan::File(file.clone())),
                false => (*name, InputPlan::Constant(9.0)),
            });
            let plan = RecordPlan::by_input(1.0, 3, plans);
            let drive = plan.drive(&signals(names), Noise::new(1, "t", 0));
            let at = names.iter().position(|name| *name == input).unwrap();
            (drive.map(|drive| drive.inputs()[[0, at]])).map_err(|error| error.to_string())
        };
        assert_eq!(column(&["a", "b"], "b", "t,a,b,y"), Ok(2.0));
        assert_eq!(column(&["a", "b"], "b", "t,u1,u2,y"), Ok(2.0));
        assert_eq!(column(&["u2", "u1"], "u1", "t,u1,u2,y"), Ok(1.0));
        assert_eq!(column(&["a", "b"], "a", "t,y1,y2,pump"), Ok(3.0));
        for (header, part) in [
            (
                "t,calm,deep,y",
                "no column is called \"b\"; the columns are t, calm, deep, y: rename one to b",
            ),
            ("t,b,b,y", "column \"b\" appears twice"),
            ("b,c,d,y", "column t is missing"),
            ("t,B,d,y", "(did you mean \"B\"?)"),
        ] {
            let message = column(&["a", "b"], "b", header).unwrap_err();
            assert!(message.contains(part), "{header}: {message}");
        }
    }

    #[test]
    fn a_file_of_another_grid_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, rows: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("t,u\n{rows}")).unwrap();
            InputPlan::File(path)
        };
        let good = write("good.csv", "0,1\n1,1\n2,1\n");
        for (rows, part) in [
            (
                "0,1\n2,1\n4,1\n",
                "3 samples, step 2 s; simulated records have 3, step 1 s",
            ),
            ("0,1\n1,1\n", "2 samples, step 1 s"),
            (
                "0,1\n1,1\n3,1\n",
                "row 4, column t: a step of 2 s in place of 1 s",
            ),
            ("5,1\n6,1\n7,1\n", "begins at 5 s"),
        ] {
            let other = write("other.csv", rows);
            let plan = RecordPlan::by_input(1.0, 3, [("a", good.clone()), ("b", other)]);
            let message = plan.prepare(&signals(&["a", "b"])).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let error = RecordPlan::autonomous(0.5, 9).prepare(&Signals::default());
        assert!(error.unwrap_err().to_string().contains("1 input;"));
        let plan = RecordPlan::levels(0.5, 9, 0.0, 1.0, 0);
        assert!(matches!(
            plan.prepare(&Signals::default()),
            Err(StudyError::Plan(_))
        ));
    }
}
