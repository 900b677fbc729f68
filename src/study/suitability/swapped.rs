//! Swapped outputs.

use super::limits::LIMITS;
use crate::math::correlation;
use crate::record::{Record, RecordError, Signal};
use crate::study::Study;
use crate::twin::conformance::Finding;

/// Checks whether two outputs look more like each other's runs; also returns the order that they seem to have.
pub(super) fn check(study: &Study, record: &Record, runs: &[Signal]) -> (Vec<Finding>, Vec<usize>) {
    let outputs = study.twin().signals().outputs;
    let mut order: Vec<usize> = (0..outputs.len()).collect();
    // The parameters are unknown: the run that is most alike counts.
    let most = |i: usize, j: usize| {
        let runs = runs.iter().map(|run| alike(record.outputs(), i, run, j));
        runs.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut findings = vec![];
    for i in 0..outputs.len() {
        for j in i + 1..outputs.len() {
            if order[i] != i || order[j] != j {
                continue;
            }
            let (own, other) = ([most(i, i), most(j, j)], [most(i, j), most(j, i)]);
            let left =
                |r: [f64; 2]| (1.0 - r[0]).max(f64::EPSILON) * (1.0 - r[1]).max(f64::EPSILON);
            if other.iter().all(|r| *r > LIMITS.alike)
                && left(other) * LIMITS.better.powi(2) < left(own)
            {
                let (a, b) = (&outputs[i].name, &outputs[j].name);
                findings.push(Finding::warning(
                    "swapped",
                    format!(
                        "output {a} looks like {b} and {b} like {a}: correlations with the twin's runs {:.2} and {:.2}, as given {:.2} and {:.2}; swap their columns",
                        other[0], other[1], own[0], own[1]
                    ),
                ));
                order.swap(i, j);
            }
        }
    }
    if outputs.len() > 1 && findings.is_empty() {
        findings.push(Finding::pass(
            "swapped",
            "each output looks like its own run",
        ));
    }
    (findings, order)
}

/// The record with its outputs in another order.
pub(super) fn in_order(record: &Record, order: &[usize]) -> Result<Record, RecordError> {
    let outputs = record.outputs().select(ndarray::Axis(1), order);
    Record::new(record.drive().clone(), outputs)
}

/// Correlation of an output with an output of a run, over the rows that have a value.
fn alike(record: &Signal, i: usize, run: &Signal, j: usize) -> f64 {
    let pairs: Vec<(f64, f64)> = (record.column(i).iter().copied())
        .zip(run.column(j).iter().copied())
        .filter(|(a, _)| a.is_finite())
        .collect();
    correlation(&pairs)
}
