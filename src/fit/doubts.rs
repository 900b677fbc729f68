//! Reasons to doubt a fit.

use super::certificate::Side;
use super::effects::magnitude::Kind;
use super::outcome::{Convergence, FittedNoise, FittedValue, NOT_CONVERGED, OutputErrors, Warning};
use super::problem::Problem;
use crate::math::three_digits;
use crate::record::Signal;
use crate::setting::number;
use crate::twin::conformance::{Severity, check_step};
use std::collections::BTreeMap;

const BOUNDS: &str = "widen [bounds] if other values are possible; its error means little here";
const LACKS: &str = "look for what the twin lacks: truetwin diagnose";

/// Warnings of a fit.
pub(super) struct Doubts<'a> {
    problem: &'a Problem,
    theta: &'a [f64],
    pub all: Vec<Warning>,
}

impl<'a> Doubts<'a> {
    /// No warnings yet about a fit at θ.
    pub fn new(problem: &'a Problem, theta: &'a [f64]) -> Self {
        Self {
            problem,
            theta,
            all: vec![],
        }
    }

    fn warn(&mut self, code: &'static str, what: String, remedy: &'static str) {
        self.all.push(Warning { code, what, remedy });
    }

    /// Warns of a fit that is less likely than one without effects.
    pub fn below(&mut self, without: Option<f64>, log_likelihood: f64) {
        let Some(without) = without else { return };
        let less = number(three_digits(without - log_likelihood));
        self.warn(
            "below-the-twin-alone",
            format!("the fit is {less} nats less likely than with its effects off"),
            "give the magnitudes of [[effect]] a narrower [bounds], or leave effects out",
        );
    }

    /// Warns of a search that has not arrived.
    pub fn search(&mut self, convergence: &Convergence) {
        if convergence.converged {
            return;
        }
        let what = format!(
            "the search has not arrived: {:.2} standard deviations from the top, {} of {} searches agree",
            convergence.distance, convergence.agreeing, convergence.searches
        );
        self.warn(
            NOT_CONVERGED,
            what,
            "narrow [prior], or fix a parameter that the record does not identify",
        );
    }

    /// Warns of parameters, magnitudes and noise levels at a bound.
    pub fn bounds(
        &mut self,
        parameters: &[FittedValue],
        noise: &[FittedNoise],
        kinds: &BTreeMap<String, Kind>,
    ) {
        let word = |side: Side| match side {
            Side::Low => "lower",
            Side::High => "upper",
        };
        for p in parameters {
            let Some(side) = p.at_bound else { continue };
            match kinds.get(&p.name) {
                Some(Kind::Switch { off, .. } | Kind::Size(off)) if p.value == *off => self.warn(
                    "at-bound",
                    format!("{} lies where the effect is off", p.name),
                    "leave the [[effect]] out: the record does not ask for it",
                ),
                _ => self.warn(
                    "at-bound",
                    format!("{} lies at its {} bound", p.name, word(side)),
                    BOUNDS,
                ),
            }
        }
        for level in noise {
            let Some(side) = level.at_bound else { continue };
            // A black box has noise of its own, and needs none on top.
            if side == Side::Low && self.problem.is_simulated() {
                continue;
            }
            let what = format!(
                "the {} noise of {} lies at its {} bound",
                level.role,
                level.name,
                word(side)
            );
            self.warn(
                "noise-at-bound",
                what,
                "declare the level in [noise], or hold it there with known = true",
            );
        }
    }

    /// Warns of free runs that do not follow the records.
    pub fn runs(&mut self, errors: &[OutputErrors]) {
        for e in errors {
            match e.free_run {
                None => self.warn(
                    "free-run-diverges",
                    format!("the free run of {} diverges", e.name),
                    "judge by one-step errors, or look for what the twin lacks: truetwin diagnose",
                ),
                Some(rmse) if rmse >= e.deviation => self.warn(
                    "no-better-than-constant",
                    format!("the free run of {} is no better than a constant", e.name),
                    LACKS,
                ),
                Some(_) => {}
            }
        }
    }

    /// Warns of channels that never move, and of a step that is too long for the fitted twin: a free run that diverges says nothing of
    /// the step.
    pub fn records(&mut self, runs: bool) {
        let (problem, theta) = (self.problem, self.theta);
        let signals = problem.twin.signals();
        for (r, record) in problem.records.iter().enumerate() {
            let of = match problem.records.len() {
                1 => String::new(),
                _ => format!(" of record {}", r + 1),
            };
            for (name, values) in signals.inputs.iter().zip(columns(record.drive().inputs())) {
                if is_constant(&values) {
                    self.warn(
                        "constant-input",
                        format!("the input {}{of} never moves", name.name),
                        "what shows only when it moves cannot be known from this record; take one in which it moves",
                    );
                }
            }
            for (name, values) in signals.outputs.iter().zip(columns(record.outputs())) {
                if is_constant(&values) {
                    self.warn(
                        "constant-output",
                        format!("the output {}{of} never moves", name.name),
                        "a sensor that is stuck tells nothing of the twin; take a record in which it moves",
                    );
                }
            }
            if !runs {
                continue;
            }
            let step = check_step(&problem.twin, &problem.of_record(r, theta), record.drive());
            if let Some(finding) = step.filter(|f| f.severity == Severity::Warning) {
                self.warn(
                    "step-matters",
                    format!("the step{of} is {}", finding.message),
                    "fit again with such a study",
                );
            }
        }
    }
}

fn columns(signal: &Signal) -> Vec<Vec<f64>> {
    signal.columns().into_iter().map(|c| c.to_vec()).collect()
}

/// Returns whether every value that is there is the same.
fn is_constant(values: &[f64]) -> bool {
    let mut there = values.iter().filter(|v| !v.is_nan());
    there.next().is_some_and(|first| there.all(|v| v == first))
}
