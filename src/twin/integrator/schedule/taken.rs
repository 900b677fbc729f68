//! Counts of the substeps that a run took.

use crate::math::three_digits;
use serde::Serialize;

/// Adaptive substeps between the samples of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct StepsTaken {
    /// Samples.
    pub samples: usize,
    /// Substeps of all of them.
    pub substeps: usize,
    /// Most substeps of one.
    pub most: usize,
    /// Samples with implicit steps.
    pub implicit: usize,
}

impl StepsTaken {
    /// Those of two runs.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            substeps: self.substeps + other.substeps,
            most: self.most.max(other.most),
            implicit: self.implicit + other.implicit,
        }
    }

    /// Substeps of a sample, rounded up.
    pub(crate) fn mean(self) -> usize {
        self.substeps.div_ceil(self.samples.max(1))
    }

    /// As a sentence has them: `adaptive steps, 3.4 a sample, at most 12`.
    pub(crate) fn text(self) -> String {
        let mean = three_digits(self.substeps as f64 / self.samples.max(1) as f64);
        let implicit = match self.implicit {
            0 => String::new(),
            many if many == self.samples => ", all implicit".into(),
            many => format!(", implicit for {many} of {} samples", self.samples),
        };
        format!(
            "adaptive steps, {mean} a sample, at most {}{implicit}",
            self.most
        )
    }
}
