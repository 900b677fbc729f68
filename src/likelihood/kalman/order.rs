//! Order in which a filter takes the values of a record.

use super::{FilterError, Kalman};
use crate::twin::seconds_before;
use std::sync::Arc;

/// Values of a record beside the states that they show: those of an output with a dead time come so many samples earlier.
///
/// ```text
/// row k   y_j(k + d_j)   missing behind the end of the record
/// ```
///
/// Rows before the first show the states of the steps that lead to it, or the start where these begin later.
///
/// Where steps vary, each value of such an output has a row of its own, at the first sample or step that is no more than the dead time before it:
///
/// ```text
/// y_j(k)   behind the others of row i:   t_i ≥ t_k − d_j > t_{i−1}
/// ```
///
/// A density of all values is the same in any order, and a filter need not remember d samples as states.
#[derive(Clone)]
pub(super) struct Order<'k> {
    /// Samples by which each output is late; empty where none is.
    dead_time: Vec<usize>,
    values: Values<'k>,
    channels: usize,
    /// Rows before the first.
    before: usize,
    /// Steps from the start to the first row, of a twin with late outputs.
    steps_before: usize,
    /// Rows where steps vary and an output is late.
    by_time: Option<Arc<[TimedRow]>>,
    /// `true` if outputs are missing.
    pub gaps: bool,
}

/// Values of a record, row by row: its own where no output is late.
#[derive(Clone)]
enum Values<'k> {
    Own(&'k [f64]),
    Arranged(Arc<[f64]>),
}

/// A row at a sample, or at a step before the first: its punctual outputs, or a value of a late one.
#[derive(Clone, Copy)]
struct TimedRow {
    place: ShownState,
    late: Option<LateReading>,
}

/// The state that a row shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum ShownState {
    /// The state where this step from the start to the first row begins.
    Before(usize),
    Sample(usize),
}

/// A value that the record has at a later sample.
#[derive(Clone, Copy)]
struct LateReading {
    output: usize,
    sample: usize,
    /// Time in seconds from what is shown to the sample of the record.
    after: f64,
}

impl<'k> Order<'k> {
    /// At θ, of which the length is checked.
    pub fn of(kalman: &'k Kalman<'_>, theta: &[f64]) -> Result<Self, FilterError> {
        kalman.check(theta)?;
        if !kalman.record.drive().is_uniform() {
            let delays = kalman.twin.delays(theta);
            if delays.iter().any(|delay| *delay > 0.0) {
                return Ok(Self::by_time(kalman, &delays));
            }
        }
        let dead_time = (kalman.twin).dead_time(theta, kalman.record.drive().dt());
        let before = dead_time.iter().copied().max().unwrap_or(0);
        let steps_before = match before {
            0 => 0,
            _ => seconds_before(&kalman.twin, kalman.record.drive()).len(),
        };
        let mut order = Self {
            dead_time,
            values: Values::Own(kalman.record.values()),
            channels: kalman.channels,
            before,
            steps_before,
            by_time: None,
            gaps: kalman.gaps || before > 0,
        };
        if before > 0 {
            order.values = Values::Arranged(order.arranged(kalman.record.values()));
        }
        Ok(order)
    }

    /// Rows of a record whose steps vary, its outputs late by so many seconds.
    fn by_time(kalman: &'k Kalman<'_>, delays: &[f64]) -> Self {
        let drive = kalman.record.drive();
        let (times, ahead) = (drive.times(), seconds_before(&kalman.twin, drive));
        // All that a row may show, in order of time.
        let steps = (ahead.iter().enumerate()).map(|(i, ahead)| (-ahead, ShownState::Before(i)));
        let samples = (times.iter().enumerate()).map(|(k, time)| (*time, ShownState::Sample(k)));
        let places: Vec<(f64, ShownState)> = steps.chain(samples).collect();
        let (mut rows, mut dead_time) = (vec![], vec![0; kalman.channels]);
        for (sample, time) in times.iter().enumerate() {
            rows.push(TimedRow {
                place: ShownState::Sample(sample),
                late: None,
            });
            for (output, delay) in delays.iter().enumerate().filter(|(_, d)| **d > 0.0) {
                let at = places.partition_point(|(t, _)| *t < time - delay);
                let shown = at.saturating_sub(ahead.len());
                dead_time[output] = dead_time[output].max(sample - shown).max(1);
                let (seen, place) = places[at];
                // Before the first of them, its value stands.
                let after = if at == 0 { f64::INFINITY } else { time - seen };
                let late = LateReading {
                    output,
                    sample,
                    after,
                };
                let late = Some(late);
                rows.push(TimedRow { place, late });
            }
        }
        rows.sort_by_key(|row| row.place);
        let mut order = Self {
            dead_time,
            values: Values::Own(&[]),
            channels: kalman.channels,
            before: 0,
            steps_before: ahead.len(),
            gaps: true,
            by_time: Some(rows.into()),
        };
        order.values = Values::Arranged(order.arranged(kalman.record.values()));
        order
    }

    /// The same without the outputs that are late, and without rows before the first.
    pub fn punctual(&self, kalman: &Kalman<'_>) -> Self {
        let mut values = kalman.record.values().to_vec();
        for row in values.chunks_exact_mut(self.channels) {
            for j in (0..self.channels).filter(|&j| self.is_late(j)) {
                row[j] = f64::NAN;
            }
        }
        Self {
            dead_time: vec![],
            values: Values::Arranged(values.into()),
            channels: self.channels,
            before: 0,
            steps_before: 0,
            by_time: None,
            gaps: true,
        }
    }

    fn arranged(&self, outputs: &[f64]) -> Arc<[f64]> {
        let p = self.channels;
        let samples = outputs.len() / p;
        let rows = (self.by_time.as_ref()).map_or(self.before + samples, |rows| rows.len());
        (0..rows * p)
            .map(|cell| match self.sample_of(cell / p, cell % p) {
                Some(k) if k < samples => outputs[k * p + cell % p],
                _ => f64::NAN,
            })
            .collect()
    }

    #[inline(always)]
    fn values(&self) -> &[f64] {
        match &self.values {
            Values::Own(values) => values,
            Values::Arranged(values) => values,
        }
    }

    /// Returns whether output j has a dead time.
    pub fn is_late(&self, j: usize) -> bool {
        self.dead_time.get(j).is_some_and(|late| *late > 0)
    }

    /// Returns the samples by which each output is late; empty where none is.
    pub fn late(&self) -> &[usize] {
        &self.dead_time
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.values().len() / self.channels
    }

    /// Values of row i.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values()[i * self.channels..(i + 1) * self.channels]
    }

    /// The state that row i shows.
    #[inline(always)]
    pub fn place(&self, i: usize) -> ShownState {
        match &self.by_time {
            None => match i.checked_sub(self.before) {
                Some(k) => ShownState::Sample(k),
                None if self.steps_before == 0 => ShownState::Sample(0),
                None => ShownState::Before((self.steps_before + i).saturating_sub(self.before)),
            },
            Some(rows) => rows[i].place,
        }
    }

    /// Sample of the state that row i shows, the first one for those before it.
    #[inline(always)]
    pub fn state_of(&self, i: usize) -> usize {
        match self.place(i) {
            ShownState::Before(_) => 0,
            ShownState::Sample(k) => k,
        }
    }

    /// Returns whether row i is the last that shows its sample or its step.
    #[inline(always)]
    pub fn is_last(&self, i: usize) -> bool {
        i >= self.before && self.by_time.is_none()
            || i + 1 == self.rows()
            || self.place(i + 1) > self.place(i)
    }

    /// Time in seconds from what row i shows to where its late output is read; `None` where whole samples tell it.
    #[inline(always)]
    pub fn read_after(&self, i: usize) -> Option<f64> {
        let late = self.by_time.as_ref()?[i].late;
        Some(late.map_or(0.0, |late| late.after))
    }

    /// Returns whether rows are those of the record.
    pub fn is_plain(&self) -> bool {
        self.before == 0 && self.by_time.is_none()
    }

    /// Most samples by which an output is ahead of those that are punctual.
    pub fn ahead(&self) -> usize {
        self.dead_time.iter().copied().max().unwrap_or(0)
    }

    /// Sample at which the record has output j of row i, perhaps behind its end; `None` where the row before the first has none.
    pub fn sample_of(&self, i: usize, j: usize) -> Option<usize> {
        if let Some(rows) = &self.by_time {
            return match rows[i].late {
                Some(late) => (late.output == j).then_some(late.sample),
                None => (!self.is_late(j)).then(|| self.state_of(i)),
            };
        }
        let late = self.dead_time.get(j).copied().unwrap_or(0);
        (i + late).checked_sub(self.before)
    }
}

#[cfg(test)]
mod tests;
