//! Shares of the gap that are told to close.

use super::count::Count;
use crate::evaluate::trials::row::{Fate, Row};
use crate::math::quantile;
use serde::Serialize;

/// Range of a share that is reported beside a right effect.
const WITHIN: [f64; 2] = [-0.1, 1.1];

/// Shares of the true effects, which should be 1, and those of right answers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Closed {
    /// Shares that are told, of trials whose departures are all listed.
    pub true_told: Count,
    /// Median of these shares.
    pub true_median: Option<f64>,
    /// 90 % intervals of told shares that hold 1.
    pub true_holds_one: Count,
    /// Shares from −0.1 to 1.1, of those told beside a right and complete answer.
    pub delivered_within: Count,
}

pub(super) fn closed(rows: &[Row]) -> Closed {
    let of_truth = || rows.iter().filter_map(|row| row.true_share);
    let told: Vec<f64> = of_truth().filter_map(|share| share.closed).collect();
    let delivered = (rows.iter()).filter(|row| row.fate() == Fate::Delivered);
    Closed {
        true_told: (of_truth().filter(|share| share.is_listed))
            .map(|share| share.closed.is_some())
            .collect(),
        true_median: quantile(&told, 0.5).ok(),
        true_holds_one: (of_truth().filter(|share| share.closed.is_some()))
            .filter_map(|share| share.interval)
            .map(|[low, high]| (low..=high).contains(&1.0))
            .collect(),
        delivered_within: delivered
            .filter_map(|row| row.outcome.as_ref()?.closed)
            .map(|share| (WITHIN[0]..=WITHIN[1]).contains(&share))
            .collect(),
    }
}
