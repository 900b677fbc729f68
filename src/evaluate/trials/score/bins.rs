//! Fates by expected information, or by the evidence that a record holds.

use super::count::Count;
use crate::evaluate::trials::Kind;
use crate::evaluate::trials::row::{Fate, Row};
use serde::Serialize;

/// Ends of the bins, in nats.
const NATS: [f64; 5] = [0.0, 3.0, 10.0, 30.0, f64::INFINITY];

/// Trials of about as many nats; each count is of all of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Bin {
    /// `listed`: a listed effect is there; `random`: a random law.
    pub truths: &'static str,
    /// From, in nats.
    pub low: f64,
    /// To, in nats; none for the last bin.
    #[serde(serialize_with = "finite")]
    pub high: f64,
    pub called_structural: Count,
    pub delivered: Count,
    pub partial: Count,
    pub incomplete: Count,
    pub in_class: Count,
    pub wrong_name: Count,
    pub refused: Count,
    pub abstained: Count,
    pub missed: Count,
    pub failed: Count,
    /// "None of these", or more said to be missing than was accepted: of trials in which nothing listed is right.
    pub abstained_or_partial: Count,
    /// Delivered, of trials whose twin takes a step so coarse that it shows beside the departure.
    pub coarse_delivered: Count,
    /// The place that is stated is a true one.
    #[serde(rename = "where")]
    pub place: Count,
}

fn finite<S: serde::Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    value.is_finite().then_some(*value).serialize(serializer)
}

/// Bins of listed truths, then of random ones, over the rows that have nats; empty bins are left out.
pub(super) fn bins(rows: &[Row], nats: impl Fn(&Row) -> Option<f64>) -> Vec<Bin> {
    let mut all = Vec::new();
    for truths in ["listed", "random"] {
        let of_group = |row: &Row| match row.kind {
            Kind::None | Kind::Outside => false,
            Kind::Random => truths == "random",
            Kind::Listed | Kind::Otherwise | Kind::Pair | Kind::Beside => truths == "listed",
        };
        for (low, high) in NATS.iter().zip(&NATS[1..]) {
            let within = |nats: f64| (*low == 0.0 || *low <= nats) && nats < *high;
            let inside = |row: &Row| of_group(row) && nats(row).is_some_and(within);
            let fate = |fate: Fate| Count::over(rows, inside, |row| row.fate() == fate);
            let bin = Bin {
                truths,
                low: *low,
                high: *high,
                called_structural: Count::over(rows, inside, Row::called),
                delivered: fate(Fate::Delivered),
                partial: fate(Fate::Partial),
                incomplete: fate(Fate::Incomplete),
                in_class: fate(Fate::InClass),
                wrong_name: fate(Fate::WrongName),
                refused: fate(Fate::Refused),
                abstained: fate(Fate::Abstained),
                missed: fate(Fate::Missed),
                failed: fate(Fate::Failed),
                abstained_or_partial: Count::over(
                    rows,
                    |row| inside(row) && row.must_abstain(),
                    Row::says_unknown,
                ),
                coarse_delivered: Count::over(
                    rows,
                    |row| inside(row) && row.is_coarse_gap(),
                    |row| row.fate() == Fate::Delivered,
                ),
                place: Count::over(rows, inside, |row| row.called() && row.place_is_right()),
            };
            if bin.delivered.of > 0 {
                all.push(bin);
            }
        }
    }
    all
}
