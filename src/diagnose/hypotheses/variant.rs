//! A candidate as a twin, with the axes that its magnitudes move on.

use crate::diagnose::thresholds::Thresholds;
use crate::effect::Magnitude;
use crate::fit::axis::Axis;
use crate::fit::problem::Problem;
use crate::twin::{Interval, Twin};
use std::collections::BTreeMap;

const LONGEST: f64 = 40.0;

/// A candidate with those of its thresholds that are in use, as a twin.
pub(in crate::diagnose) struct Variant {
    /// Index among the candidates.
    pub candidate: usize,
    pub twin: Twin,
    /// Free magnitudes in the order of θ; the others are held at their off values.
    pub free: Vec<Magnitude>,
    pub held: BTreeMap<String, f64>,
    /// Memory values that filters keep of a delay.
    pub kept: Option<usize>,
    /// Nats that the effect's mark on the outputs, or its absence, is worth.
    pub mark: f64,
    /// Axes of the free magnitudes.
    pub axes: Vec<Axis>,
    /// Free magnitudes without a derivative (the time of a jump).
    pub jumps: Vec<usize>,
}

impl Variant {
    /// θ of the variant: that of the base twin, then the magnitudes.
    pub fn theta(&self, base: &[f64], m: &[f64]) -> Vec<f64> {
        base.iter().chain(m).copied().collect()
    }

    /// The variant on the records of the base twin's problem.
    pub fn problem<'a>(&self, base: &Problem<'a>) -> Problem<'a> {
        let d = base.twin.parameters().len();
        let axes = base.axes[..d].iter().chain(&self.axes).cloned().collect();
        Problem::new(self.twin.clone(), axes, base.records)
    }

    /// The variant on the records of the base twin's problem, and its full θ: the base's with these free magnitudes.
    pub fn at<'a>(&self, base: &Problem<'a>, theta: &[f64], m: &[f64]) -> (Problem<'a>, Vec<f64>) {
        let problem = self.problem(base);
        let mut full = problem.full(&self.theta(&base.of_record(0, theta), m));
        // Starts of further records stand behind the magnitudes.
        for r in 1..base.records.len() {
            problem.place(r, &self.theta(&base.of_record(r, theta), m), &mut full);
        }
        (problem, full)
    }

    /// Sets the scale of the first magnitude to what is just visible.
    pub fn rescale(&mut self, unit: f64) {
        let Some(first) = self.axes.first_mut() else {
            return;
        };
        if unit > 0.0 && first.width.is_nan() {
            let limits = self.free[0].limits;
            // A twin without measurement noise sees what is a millionth of any start.
            let start = first.longest;
            let reach = (Thresholds::REACH * unit).max(3.0 * start);
            let low = limits.low().max(-reach);
            first.bounds = Interval::unchecked(low, limits.high().min(reach));
            first.centre = first.bounds.clamp(0.0);
            first.deviation = reach;
            first.width = unit;
            first.longest = (LONGEST * unit).max(0.3 * start);
        } else if unit > 0.0 && first.bounds.low().is_nan() {
            // Up to there from what is visible, however little that is.
            let most = (1e3 * unit).max(10.0 * first.centre);
            first.bounds = Interval::unchecked(1e-3 * unit, most);
            first.centre = unit;
        } else if first.width.is_nan() || first.bounds.low().is_nan() {
            first.bounds = Interval::unchecked(0.0, 1.0);
            (first.centre, first.width, first.longest) = (0.0, 1.0, 0.1);
        }
    }
}
