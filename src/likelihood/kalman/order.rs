//! Order in which a filter takes the values of a record.

use super::{FilterError, Kalman};
use std::sync::Arc;

/// Values of a record beside the states that they show: those of an output with a dead time come so many samples earlier.
///
/// ```text
/// rows before the first   y_j(0) … y_j(d_j − 1)    which show the start, as the row after them does
/// row k                   y_j(k + d_j)             missing behind the end of the record
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
    pub before: usize,
    /// `true` if outputs are missing.
    pub gaps: bool,
}

/// Values of a record, row by row: its own where no output is late.
#[derive(Clone)]
enum Values<'k> {
    Own(&'k [f64]),
    Arranged(Arc<[f64]>),
}

impl<'k> Order<'k> {
    /// At θ, of which the length is checked.
    pub fn of(kalman: &'k Kalman<'_>, theta: &[f64]) -> Result<Self, FilterError> {
        kalman.check(theta)?;
        let dead_time = (kalman.twin).dead_time(theta, kalman.record.drive().dt());
        let before = dead_time.iter().copied().max().unwrap_or(0);
        let mut order = Self {
            dead_time,
            values: Values::Own(kalman.record.values()),
            channels: kalman.channels,
            before,
            gaps: kalman.gaps || before > 0,
        };
        if before > 0 {
            order.values = Values::Arranged(order.arranged(kalman.record.values()));
        }
        Ok(order)
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
            gaps: true,
        }
    }

    fn arranged(&self, outputs: &[f64]) -> Arc<[f64]> {
        let p = self.channels;
        let samples = outputs.len() / p;
        (0..(self.before + samples) * p)
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

    /// Sample of the state that row i shows.
    #[inline(always)]
    pub fn state_of(&self, i: usize) -> usize {
        i.saturating_sub(self.before)
    }

    /// Sample at which the record has output j of row i, perhaps behind its end; `None` where the row before the first has none.
    pub fn sample_of(&self, i: usize, j: usize) -> Option<usize> {
        let late = self.dead_time.get(j).copied().unwrap_or(0);
        match i.checked_sub(self.before) {
            Some(k) => Some(k + late),
            None => (i < late).then_some(i),
        }
    }
}

#[cfg(test)]
mod tests;
