//! The time grid and the inputs of one experiment.

use crate::math::six_digits;
use crate::record::RecordError;
use ndarray::{Array1, Array2, ArrayView1, s};
use std::sync::Arc;

mod checks;
mod clock;
mod file_rows;

use checks::{check_replicate, check_rows};
pub(crate) use checks::{check_size, check_sizes};
pub(super) use checks::{check_values, signal};
use clock::Clock;
pub(crate) use file_rows::FileRows;

/// Samples by channels: row k belongs to [`Drive::time`] of k. A system without inputs has zero columns and N rows.
pub type Signal = Array2<f64>;

/// Steps that differ by less than this share of the step count as one.
pub(crate) const UNIFORM: f64 = 1e-3;

/// Time grid and inputs of one experiment, each input held over a step. All steps are Δt, unless times are given.
///
/// ```
/// use truetwin::record::Drive;
/// let free = Drive::autonomous(0.05, 300)?;
/// assert_eq!((free.samples(), free.inputs().ncols()), (300, 0));
/// # Ok::<(), truetwin::record::RecordError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    dt: f64,
    /// Time of the first row on the record's own clock, in seconds.
    first_time: f64,
    /// Times of rows where all steps are Δt.
    clock: Clock,
    /// Shared by copies: a fit hands its records on many times.
    inputs: Arc<Signal>,
    /// Times on the record's own clock, one a row, where steps vary.
    times: Option<Arc<[f64]>>,
    /// The file that the rows were read from, for messages.
    rows: FileRows,
}

/// Value at a time, on the line between rows at these times: the first one before them, the last one behind.
pub(crate) fn on_line(times: &[f64], t: f64, value: impl Fn(usize) -> f64) -> f64 {
    let after = times.partition_point(|time| *time <= t);
    let before = after.saturating_sub(1);
    if after == 0 || after == times.len() {
        return value(before);
    }
    let share = (t - times[before]) / (times[after] - times[before]);
    (1.0 - share) * value(before) + share * value(after)
}

/// Mean of a signal between two times, held from each of its times to the next.
fn mean_held(times: &[f64], [from, to]: [f64; 2], signal: &ArrayView1<'_, f64>) -> f64 {
    let at = |t: f64| times.partition_point(|time| *time <= t).saturating_sub(1);
    let (first, last) = (at(from), at(to));
    let mut sum = 0.0;
    for i in first..=last {
        let begin = if i == first { from } else { times[i] };
        let end = if i == last { to } else { times[i + 1] };
        sum += (end - begin) * signal[i];
    }
    match first == last {
        true => signal[first],
        false => sum / (to - from),
    }
}

impl Drive {
    /// A drive of step Δt = `dt` seconds with `inputs` (N × channels), its first row at 0 s.
    pub fn new(dt: f64, inputs: Signal) -> Result<Self, RecordError> {
        if !(dt > 0.0 && dt.is_normal()) {
            return Err(RecordError::Step(dt));
        }
        if inputs.nrows() == 0 {
            return Err(RecordError::Empty);
        }
        check_values(&inputs, "input", |v| !v.is_finite())?;
        // Rows are read as slices in the simulation loop.
        let inputs = match inputs.is_standard_layout() {
            true => inputs,
            false => inputs.as_standard_layout().into_owned(),
        };
        Ok(Self {
            dt,
            first_time: 0.0,
            clock: Clock::new(dt, 0.0),
            inputs: Arc::new(inputs),
            times: None,
            rows: FileRows::default(),
        })
    }

    /// A drive of step Δt = `dt` seconds whose inputs come as one slice a channel.
    pub fn from_slices(dt: f64, inputs: &[impl AsRef<[f64]>]) -> Result<Self, RecordError> {
        Self::new(dt, signal(inputs)?)
    }

    /// A drive with one row of `inputs` at each of `times`, in seconds on the record's own clock. Times do not decrease; their steps may vary.
    /// Steps that are the same to 1e-3 become one step Δt, else Δt is the median step. Rows of one time are replicates: readings of one
    /// state, which have the same inputs.
    ///
    /// ```
    /// use truetwin::record::{Drive, Signal};
    /// let drive = Drive::with_times(&[2.0, 2.1, 2.4, 2.5], Signal::ones((4, 1)))?;
    /// assert_eq!((drive.first_time(), drive.own_time(2)), (2.0, 2.4));
    /// assert!((drive.time(2) - 0.4).abs() < 1e-12);
    /// assert!((drive.step(1) - 0.3).abs() < 1e-12);
    /// # Ok::<(), truetwin::record::RecordError>(())
    /// ```
    pub fn with_times(times: &[f64], inputs: Signal) -> Result<Self, RecordError> {
        check_rows(times.len(), &inputs)?;
        if times.len() < 2 {
            return Err(RecordError::Empty);
        }
        let mut steps = 0_u32;
        for (k, pair) in times.windows(2).enumerate() {
            let step = pair[1] - pair[0];
            // Also where a time is NaN.
            if !(step >= 0.0 && step.is_finite()) {
                return Err(RecordError::TimeOrder {
                    sample: k + 1,
                    time: pair[1],
                    before: pair[0],
                });
            }
            if step == 0.0 {
                check_replicate(&inputs, k + 1)?;
                continue;
            }
            if !step.is_normal() {
                return Err(RecordError::Step(step));
            }
            steps += 1;
        }
        if steps == 0 {
            return Err(RecordError::OneTime(times[0]));
        }
        let (first, last) = (times[0], times[times.len() - 1]);
        let dt = (last - first) / f64::from(steps);
        let is_repeated = steps as usize + 1 < times.len();
        let mut drive = Self::new(dt, inputs)?.beginning_at(first);
        let off = |(k, t): (usize, &f64)| (t - first - k as f64 * dt).abs() > UNIFORM * dt;
        if is_repeated || times.iter().enumerate().any(off) {
            drive.times = Some(times.into());
            let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
            let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
            let middle = (steps.len() - 1) / 2;
            drive.dt = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        // Times that differ by less than their last digit would be one.
        let size = first.abs().max(last.abs());
        match is_repeated && drive.dt < 2.0 * f64::EPSILON * size {
            true => Err(RecordError::Resolution {
                step: drive.dt,
                size,
            }),
            false => Ok(drive),
        }
    }

    /// The same drive, its first row at this time on the record's own clock, in seconds. Equations see that clock: `Now::t` of row k is
    /// [`own_time`](Self::own_time) of k.
    ///
    /// ```
    /// use truetwin::record::Drive;
    /// let drive = Drive::autonomous(0.5, 3)?.beginning_at(100.0);
    /// assert_eq!((drive.time(1), drive.own_time(1)), (0.5, 100.5));
    /// # Ok::<(), truetwin::record::RecordError>(())
    /// ```
    #[must_use]
    pub fn beginning_at(mut self, first_time: f64) -> Self {
        let shift = first_time - self.first_time;
        if let Some(times) = self.times.as_mut().filter(|_| shift != 0.0) {
            *times = times.iter().map(|t| t + shift).collect();
        }
        self.first_time = first_time;
        self.clock = Clock::new(self.dt, first_time);
        self
    }

    /// The same drive, its rows read from a file.
    pub(crate) fn read_from(self, rows: FileRows) -> Self {
        Self { rows, ..self }
    }

    /// The file that the rows were read from.
    pub(crate) fn rows(&self) -> &FileRows {
        &self.rows
    }

    /// Checks that all steps are the same, as a twin needs it that is told one step.
    pub(crate) fn check_uniform(&self) -> Result<(), RecordError> {
        self.oddest_step(self.dt).map_or(Ok(()), |k| {
            Err(RecordError::OneStep {
                row: self.rows.line(k + 1),
                column: self.rows.column(0, || "t".into()),
                given: six_digits(self.step(k)),
                expected: six_digits(self.dt),
            })
        })
    }

    /// The first samples, at least one of them.
    pub(crate) fn first(&self, samples: usize) -> Self {
        let rows = samples.max(1).min(self.samples());
        Self {
            dt: self.dt,
            first_time: self.first_time,
            clock: self.clock,
            inputs: Arc::new(self.inputs.slice(s![..rows, ..]).to_owned()),
            times: self.times.as_ref().map(|times| times[..rows].into()),
            rows: self.rows.clone(),
        }
    }

    /// The same time grid with other inputs, as many rows.
    pub(crate) fn with_inputs(&self, inputs: Signal) -> Result<Self, RecordError> {
        if let Some(times) = &self.times {
            check_rows(times.len(), &inputs)?;
        }
        Ok(Self {
            times: self.times.clone(),
            first_time: self.first_time,
            clock: self.clock,
            rows: self.rows.clone(),
            ..Self::new(self.dt, inputs)?
        })
    }

    /// The same inputs later by so many seconds; the first ones before the start. Those that are held have their mean over each step, which with equal
    /// steps is the value on the line between two.
    pub(crate) fn late(
        &self,
        delay: f64,
        are_held: impl IntoIterator<Item = bool>,
    ) -> Result<Self, RecordError> {
        let mut inputs = self.inputs.as_ref().clone();
        for (mut input, is_held) in inputs.columns_mut().into_iter().zip(are_held) {
            let late = match is_held && !self.is_uniform() {
                true => self.delayed_steps(input.view(), delay),
                false => self.delayed(input.view(), delay),
            };
            input.assign(&late);
        }
        self.with_inputs(inputs)
    }

    /// A signal at these times, later by so many seconds, linear between samples; its first value before the start.
    pub(crate) fn delayed(&self, signal: ArrayView1<'_, f64>, delay: f64) -> Array1<f64> {
        let times = self.times();
        let late = |k: usize| on_line(&times[..=k], times[k] - delay, |i| signal[i]);
        (0..self.samples()).map(late).collect()
    }

    /// A signal that is held between samples, later by so many seconds: its mean over each step.
    fn delayed_steps(&self, signal: ArrayView1<'_, f64>, delay: f64) -> Array1<f64> {
        let times = self.times();
        let ends = |k: usize| [times[k], times[k] + self.step(k)].map(|t| t - delay);
        let late = (0..times.len()).map(|k| mean_held(&times, ends(k), &signal));
        self.replicated(late.collect())
    }

    /// A signal of which the last row of each time is known, at all rows of it.
    fn replicated(&self, mut signal: Array1<f64>) -> Array1<f64> {
        for k in (0..self.samples()).rev().filter(|k| self.is_repeated(*k)) {
            signal[k] = signal[k + 1];
        }
        signal
    }

    /// Amounts at these times, later by so many seconds, 0 at least: one that falls between two times is shared by both, more of it at the nearer
    /// one, so that none is lost but behind the last.
    pub(crate) fn delayed_amounts(&self, amounts: ArrayView1<'_, f64>, delay: f64) -> Array1<f64> {
        let times = self.times();
        // An amount is told at each reading of its time, and is given once.
        let last_of = |k: usize| (k..).find(|k| !self.is_repeated(*k)).unwrap_or(k);
        let mut late = Array1::zeros(times.len());
        for (k, amount) in amounts.iter().enumerate() {
            if *amount == 0.0 || self.is_repeated(k) {
                continue;
            }
            let t = times[k] + delay.max(0.0);
            let after = times.partition_point(|time| *time <= t);
            let before = after - 1;
            let share = (t - times[before]) / self.step(before);
            if share < 1.0 {
                late[before] += (1.0 - share) * amount;
            }
            if share > 0.0 && after < times.len() {
                late[last_of(after)] += share * amount;
            }
        }
        self.replicated(late)
    }

    /// A drive without inputs, N = `samples`.
    pub fn autonomous(dt: f64, samples: usize) -> Result<Self, RecordError> {
        Self::new(dt, Signal::zeros((samples, 0)))
    }

    /// Step Δt in seconds; the median one where steps vary.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Step from sample k to the next, in seconds, 0 to a replicate; Δt after the last.
    pub fn step(&self, k: usize) -> f64 {
        match &self.times {
            Some(times) if k + 1 < times.len() => times[k + 1] - times[k],
            _ => self.dt,
        }
    }

    /// Time in seconds from the row before to row k, from the last one of an earlier time where they are replicates; Δt at the first time.
    #[inline]
    pub(crate) fn since(&self, k: usize) -> f64 {
        let Some(times) = &self.times else {
            return self.dt;
        };
        let earlier = match k {
            0 => 0,
            k if times[k - 1] < times[k] => k,
            k => times[..k].partition_point(|t| *t < times[k]),
        };
        match earlier {
            0 => self.dt,
            earlier => times[k] - times[earlier - 1],
        }
    }

    /// Row whose step differs most from the usual one; none where all are Δt.
    pub(crate) fn oddest_step(&self, usual: f64) -> Option<usize> {
        let off = |k: &usize| (self.step(*k) - usual).abs();
        let farthest = (0..self.samples()).max_by(|a, b| off(a).total_cmp(&off(b)));
        farthest.filter(|_| !self.is_uniform())
    }

    /// Returns whether the next row is another reading of the state of row k.
    #[inline]
    pub(crate) fn is_repeated(&self, k: usize) -> bool {
        match &self.times {
            None => false,
            Some(times) => k + 1 < times.len() && times[k + 1] == times[k],
        }
    }

    /// Number of rows that have the time of the row before them.
    pub(crate) fn replicates(&self) -> usize {
        (0..self.samples()).filter(|&k| self.is_repeated(k)).count()
    }

    /// Returns whether steps between different times vary.
    pub(crate) fn steps_vary(&self) -> bool {
        let varies = |k| {
            let step = self.step(k);
            step > 0.0 && (step - self.dt).abs() > UNIFORM * self.dt
        };
        self.times.is_some() && (0..self.samples()).any(varies)
    }

    /// Returns `true` if all steps are Δt.
    pub fn is_uniform(&self) -> bool {
        self.times.is_none()
    }

    /// Number of samples N.
    pub fn samples(&self) -> usize {
        self.inputs.nrows()
    }

    /// Inputs, N × channels, in row-major order.
    pub fn inputs(&self) -> &Signal {
        &self.inputs
    }

    /// Times of all samples, in seconds from the first.
    pub(crate) fn times(&self) -> Vec<f64> {
        (0..self.samples()).map(|k| self.time(k)).collect()
    }

    /// Time of sample k, in seconds from the first; steps of Δt behind the last.
    pub fn time(&self, k: usize) -> f64 {
        match &self.times {
            None => self.clock.since(k),
            Some(times) => {
                let last = times.len() - 1;
                let since = times[k.min(last)] - self.first_time;
                since + k.saturating_sub(last) as f64 * self.dt
            }
        }
    }

    /// Time of the first row on the record's own clock, in seconds: 0 unless the record says otherwise.
    pub fn first_time(&self) -> f64 {
        self.first_time
    }

    /// Time of sample k on the record's own clock, in seconds; steps of Δt behind the last.
    #[inline]
    pub fn own_time(&self, k: usize) -> f64 {
        match &self.times {
            Some(times) if k < times.len() => times[k],
            Some(_) => self.first_time + self.time(k),
            None => self.clock.time(k),
        }
    }

    /// The inputs at sample k.
    pub fn input(&self, k: usize) -> &[f64] {
        let m = self.inputs.ncols();
        // Row-major by construction.
        self.inputs
            .as_slice()
            .map_or(&[], |all| &all[k * m..(k + 1) * m])
    }
}

#[cfg(test)]
mod tests;
