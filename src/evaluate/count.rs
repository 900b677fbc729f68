//! Counts with their intervals.

use crate::math::clopper_pearson;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Level of the Clopper–Pearson intervals.
pub(crate) const LEVEL: f64 = 0.95;

/// Most records of a study, and of a folder of trials; what is known of each is in memory.
pub(crate) const MOST_RECORDS: usize = 1_000_000;

/// A count and the number of cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Count {
    pub count: u64,
    pub of: u64,
}

impl Serialize for Count {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Count", 3)?;
        object.serialize_field("count", &self.count)?;
        object.serialize_field("of", &self.of)?;
        object.serialize_field("interval", &self.interval())?;
        object.end()
    }
}

impl Count {
    /// One case where `of` holds; it counts where `count` does.
    pub fn case(of: bool, count: bool) -> Self {
        Self {
            count: (of && count).into(),
            of: of.into(),
        }
    }

    /// The share; none of nothing.
    pub fn share(self) -> Option<f64> {
        (self.of > 0).then(|| self.count as f64 / self.of as f64)
    }

    /// Clopper–Pearson interval of the probability, at 95 %.
    pub fn interval(self) -> (f64, f64) {
        // A count is never more than what it is of.
        clopper_pearson(self.count, self.of, LEVEL).unwrap_or((0.0, 1.0))
    }
}

impl std::iter::Sum for Count {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |sum, one| Self {
            count: sum.count + one.count,
            of: sum.of + one.of,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_clopper_and_pearsons() {
        let (low, high) = Count { count: 3, of: 10 }.interval();
        assert!((low - 0.066_739_5).abs() < 1e-6 && (high - 0.652_452_9).abs() < 1e-6);
        assert_eq!(Count::default().interval(), (0.0, 1.0));
        assert_eq!(Count::default().share(), None);
        let cases = [(true, true), (true, false), (false, true)];
        let count: Count = cases
            .map(|(of, count)| Count::case(of, count))
            .into_iter()
            .sum();
        assert_eq!(count, Count { count: 1, of: 2 });
    }
}
