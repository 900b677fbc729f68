//! Reasons to doubt a result: one list for `fit`, `estimate` and `diagnose`, one wording each.

use super::follow::Swallowed;
use super::outcome::{Convergence, FittedNoise, FittedValue, NOT_CONVERGED, OutputErrors, Warning};
use super::problem::Problem;
use super::searched::WithoutEffects;
use crate::effect::Magnitude;
use crate::likelihood::{StartElsewhere, rounded};
use crate::math::{deviation, is_constant, norm, three_digits};
use crate::record::{Quantity, Record, Signal, Signals};
use crate::setting::{number, unit_suffix};
use crate::twin::conformance::{StepLength, step_length};
use crate::twin::{Hold, Side, Stepping, Twin};
use std::f64::consts::TAU;

/// Code of a free run that diverges.
pub(crate) const DIVERGES: &str = "free-run-diverges";
/// Code of an output that keeps one value.
pub(crate) const STILL_OUTPUT: &str = "constant-output";
/// Code of a free run that shows nothing of the record.
pub(crate) const NO_BETTER: &str = "no-better-than-constant";

/// Remedy of what is off.
const LEAVE_OUT: &str = "leave the effect out: the record does not ask for it";

/// Remedy of each reason.
const REMEDIES: [(&str, &str); 25] = [
    (
        "at-bound",
        "widen its bounds if other values are possible; its error means little here",
    ),
    (
        "below-the-twin-alone",
        "give the magnitudes of the effects narrower bounds, or leave effects out",
    ),
    (
        "coarse-step",
        "give the study the integrator and the substeps that this report has",
    ),
    (
        "constant-input",
        "what acts through it cannot be told from a constant; take a record in which it moves",
    ),
    (
        STILL_OUTPUT,
        "a sensor that is stuck tells nothing of the twin; take a record in which it moves",
    ),
    (
        "event-outside",
        "give its times on the clock of the records",
    ),
    (
        "first-rows",
        "if something may begin later, diagnose that part of the record alone",
    ),
    (
        DIVERGES,
        "narrow the bounds, judge by one-step errors, or diagnose what the twin lacks",
    ),
    ("gate-near-level", "take neither answer of the test as sure"),
    (
        "inputs-between-samples",
        "declare in the study how inputs move between samples, if you know it",
    ),
    ("interrupted", "fit again, and let it end"),
    (
        "leans-on-prior",
        "do not trust the prior, or refine always, for what the record says alone",
    ),
    (NO_BETTER, "diagnose what the twin lacks"),
    (
        "noise-at-bound",
        "declare the level of noise, or hold it there as known",
    ),
    (
        "noise-not-declared",
        "declare that level of noise; if it is louder than it can be, diagnose what the twin lacks",
    ),
    (
        "not-asked",
        "leave out what the record does not ask for, one effect at a time",
    ),
    (
        NOT_CONVERGED,
        "narrow the priors, or fix a parameter, a start or a noise level that the record does not identify",
    ),
    (
        "process-noise",
        "if the twin is deterministic, declare that it has no process noise, and fit again",
    ),
    (
        "refinement-worse",
        "widen the prior and train again, or diagnose what the twin lacks",
    ),
    ("repeated-record", "give each record once"),
    (
        "rounded-readings",
        "log more digits, or add the effect sensor-quantization, which rounds what the twin shows, too",
    ),
    (
        "start-elsewhere",
        "declare the start of these records, or the time that it belongs to",
    ),
    ("step-matters", "fit or train again with such a step"),
    ("time-unit", "convert t to seconds"),
    (
        "validation-is-record",
        "give a second measurement: the share closed is otherwise that of fitted data",
    ),
];

impl Warning {
    /// A reason with the remedy of its code.
    pub(crate) fn new(code: &'static str, what: String) -> Self {
        let remedy = REMEDIES.iter().find(|(own, _)| *own == code);
        Self {
            code,
            what,
            remedy: remedy.map_or("", |(_, remedy)| remedy),
        }
    }

    /// A value that lies at a bound.
    pub(crate) fn at_bound(code: &'static str, what: &str, side: Side) -> Self {
        let side = if side == Side::Low { "lower" } else { "upper" };
        Self::new(code, format!("{what} lies at its {side} bound"))
    }

    /// A free run that is no better than a constant.
    pub(crate) fn no_better(output: &str) -> Self {
        Self::new(
            NO_BETTER,
            format!("the free run of {output} is no better than a constant"),
        )
    }

    /// Outputs of which record − run is as large as the record's own variation.
    pub(crate) fn no_better_of(outputs: &[Quantity], record: &Record, run: &Signal) -> Vec<Self> {
        let is_no_better = |j: &usize| {
            let (values, errors) = beside(record, run, *j);
            norm(&errors) >= deviation(&values) * (values.len() as f64).sqrt()
        };
        let all = (0..outputs.len()).filter(is_no_better);
        all.map(|j| Self::no_better(&outputs[j].name)).collect()
    }

    /// A step that moves outputs by more than their noise; `of` names the record.
    pub(crate) fn step(twin: &Twin, theta: &[f64], record: &Record, of: &str) -> Option<Self> {
        let StepLength::Coarse(fault) = step_length(twin, theta, record.drive())? else {
            return None;
        };
        Some(Self::new(
            "step-matters",
            format!("the step{of} is {fault}"),
        ))
    }

    /// Events of a twin at times that no record has.
    pub(crate) fn events_outside(twin: &Twin, theta: &[f64], records: &[Record]) -> Vec<Self> {
        let names = twin.events_outside(theta, records).into_iter();
        let told = names.map(|name| format!("{name} never acts: these lie outside the records"));
        told.map(|what| Self::new("event-outside", what)).collect()
    }

    /// Times of record `r` of so many that are in another unit than seconds, by what shows it.
    pub(crate) fn time_unit(shown: String, r: usize, records: usize) -> Self {
        let of = match records {
            1 => String::new(),
            _ => format!("record {}: ", r + 1),
        };
        Self::new("time-unit", of + &shown)
    }

    /// A rule for inputs between samples that is not the study's.
    pub(crate) fn hold(stepping: Stepping, gain: Option<f64>) -> Self {
        let rule = match stepping.hold {
            Hold::Zero => "are held at the last sample",
            Hold::Linear => "move on a line",
            Hold::Spline => "move on a smooth curve",
            Hold::Nearest => "are held at the nearest sample",
            Hold::Impulse => "are amounts that are added at samples",
        };
        let substeps = match stepping.substeps {
            1 => String::new(),
            substeps => format!(", with {substeps} substeps"),
        };
        let gain = gain.map_or(String::new(), |gain| {
            format!(
                ", which explains the records better by {} nats",
                number(three_digits(gain))
            )
        });
        let name = stepping.hold.name();
        let what = format!(
            "between samples, inputs {rule} (hold = \"{name}\"){gain}; this is used{substeps}"
        );
        Self::new("inputs-between-samples", what)
    }

    /// A start that is not that of a record, of so many.
    pub(crate) fn elsewhere(start: &StartElsewhere, records: usize) -> Self {
        let StartElsewhere { output, .. } = start;
        let which = match records {
            1 => "the record".to_owned(),
            _ => format!("record {}", start.record + 1),
        };
        let unit = unit_suffix(&output.unit);
        let [value, expected] = [start.value, start.expected].map(|v| number(three_digits(v)));
        let fate = match start.is_held {
            true => "is declared, and stands",
            false => "is taken as unknown",
        };
        let what = format!(
            "{which} begins at {} = {value}{unit}, the start says {expected}{unit}: that of {} {fate}",
            output.name,
            start.states.join(", ")
        );
        Self::new("start-elsewhere", what)
    }

    /// Channels that have one value in all records.
    pub(crate) fn still(signals: &Signals, records: &[Record]) -> Vec<Self> {
        let one = |code, word: &str, quantities: &[Quantity], of: fn(&Record) -> &Signal| {
            let is_still = |j: usize| {
                let all = records.iter().filter(|record| j < of(record).ncols());
                let values: Vec<f64> = all.flat_map(|r| of(r).column(j).to_vec()).collect();
                is_constant(&values)
            };
            let still = quantities.iter().enumerate().filter(|(j, _)| is_still(*j));
            let told = still.map(|(_, q)| format!("the {word} {} never changes", q.name));
            told.map(|what| Self::new(code, what)).collect::<Vec<_>>()
        };
        [
            one("constant-input", "input", &signals.inputs, |r| {
                r.drive().inputs()
            }),
            one(STILL_OUTPUT, "output", &signals.outputs, Record::outputs),
        ]
        .concat()
    }
}

/// Values of an output that a record has, and what a run leaves of them.
pub(crate) fn beside(record: &Record, run: &Signal, output: usize) -> (Vec<f64>, Vec<f64>) {
    let pairs = (record.outputs().column(output).into_iter()).zip(run.column(output));
    let present = pairs.filter(|(y, _)| y.is_finite());
    present.map(|(y, run)| (*y, y - run)).unzip()
}

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

    fn warn(&mut self, code: &'static str, what: String) {
        self.all.push(Warning::new(code, what));
    }

    /// Warns of a fit that is less likely than one without effects.
    pub fn below(&mut self, without: Option<f64>, log_likelihood: f64) {
        let Some(without) = without else { return };
        let less = number(three_digits(without - log_likelihood));
        self.warn(
            "below-the-twin-alone",
            format!("the fit is {less} nats less likely than with its effects off"),
        );
    }

    /// Warns of a start that is not that of the records, unless it stands and fitted effects explain the first row, as residuals in
    /// their deviations show.
    pub fn start(&mut self, start: Option<&StartElsewhere>, residuals: &[Signal]) {
        let records = self.problem.records.len();
        let outputs = self.problem.twin.signals().outputs;
        let is_explained = |start: &&StartElsewhere| {
            let output = outputs.iter().position(|output| *output == start.output);
            output.is_some_and(|j| StartElsewhere::is_explained_at(residuals[start.record][[0, j]]))
        };
        let told = start.filter(|start| !(start.is_held && is_explained(start)));
        self.all
            .extend(told.map(|start| Warning::elsewhere(start, records)));
    }

    /// Warns of a search that has not arrived, [`by_step`](Self::steps) or for want of what a record tells.
    pub fn search(&mut self, convergence: &Convergence, by_step: bool) {
        if convergence.converged {
            return;
        }
        let distance = match convergence.distance {
            far if far.is_finite() => {
                let far = number(three_digits(far));
                format!("{far} standard deviations from the top, ")
            }
            _ => String::new(),
        };
        let what = format!(
            "the search has not arrived: {distance}{} of {} searches agree",
            convergence.agreeing, convergence.searches
        );
        let mut doubt = Warning::new(NOT_CONVERGED, what);
        if by_step {
            doubt.remedy = "give the twin a step that it can take, and fit again";
        }
        self.all.push(doubt);
    }

    /// Returns whether a search ends at what the records can show, before the bound of the parameter itself.
    fn is_end_of_record(&self, name: &str, side: Side) -> bool {
        let space = self.problem.twin.parameters();
        let Ok(j) = space.position(name) else {
            return false;
        };
        let [shown, own] = [self.problem.axes[j].bounds, space[j].bounds];
        match side {
            Side::Low => shown.low() > own.low(),
            Side::High => shown.high() < own.high(),
        }
    }

    /// Warns of parameters, magnitudes and noise levels at a bound, and of effects that gain nothing.
    pub fn bounds(
        &mut self,
        parameters: &[FittedValue],
        noise: &[FittedNoise],
        (without, gained): (Option<&WithoutEffects>, Option<f64>),
    ) {
        let off = |p: &FittedValue| without?.off(self.problem, &p.name);
        // At the end of what records show, a threshold may well be felt.
        let is_felt = gained.is_some_and(|gained| gained > 0.0);
        let is_off = |p: &FittedValue| {
            let magnitude = without.and_then(|without| without.magnitudes.get(&p.name));
            let is_end = magnitude.is_some_and(Magnitude::is_threshold);
            off(p) == Some(p.value) && !(is_end && is_felt)
        };
        let effect = |p: &FittedValue| p.name.rsplit_once('.').map(|(effect, _)| effect.to_owned());
        for p in parameters {
            let Some(side) = p.at_bound else { continue };
            let mut doubt = Warning::at_bound("at-bound", &p.name, side);
            if self.is_end_of_record(&p.name, side) {
                doubt.remedy = "hold it where it is known to lie beyond: records show values in this range alone";
            }
            if is_off(p) {
                let mut same = parameters.iter().filter(|other| effect(other) == effect(p));
                doubt.what = format!("{} lies where the effect is off", p.name);
                doubt.remedy = match same.all(|other| is_off(other) || off(other).is_none()) {
                    true => LEAVE_OUT,
                    false => "hold it there: the record does not ask for this part of the effect",
                };
            }
            self.all.push(doubt);
        }
        for level in noise {
            let Some(side) = level.at_bound else { continue };
            // A black box has noise of its own, and needs none on top.
            if side == Side::Low && self.problem.is_simulated() {
                continue;
            }
            let what = format!("the {} noise of {}", level.role, level.name);
            let mut doubt = Warning::at_bound("noise-at-bound", &what, side);
            if level.declared.is_some() {
                doubt.remedy = match side {
                    Side::Low => "declare less noise, or hold it there as known",
                    Side::High => "declare more noise, or hold it there as known",
                };
            }
            self.all.push(doubt);
        }
        self.effects(gained);
    }

    /// Warns of effects that gain no evidence, unless one of them is [off](Self::bounds) or the [search](Self::search) has not arrived.
    fn effects(&mut self, gained: Option<f64>) {
        let speaks = |doubt: &Warning| doubt.remedy == LEAVE_OUT || doubt.code == NOT_CONVERGED;
        let is_told = self.all.iter().any(speaks);
        if let Some(gained) = gained.filter(|gained| *gained < 0.0 && !is_told) {
            let less = number(three_digits(-gained));
            self.warn(
                "not-asked",
                format!("the fitted effects gain no evidence: {less} nats less than without them"),
            );
        }
    }

    /// Warns of free runs that do not follow the records; of those that diverge, unless [the step](Self::steps) is to blame.
    pub fn runs(&mut self, errors: &[OutputErrors], by_step: bool) {
        for e in errors {
            match e.free_run {
                None if by_step => {}
                None => self.warn(DIVERGES, format!("the free run of {} diverges", e.name)),
                Some(rmse) if rmse >= e.deviation => self.all.push(Warning::no_better(&e.name)),
                Some(_) => {}
            }
        }
    }

    /// Warns of process noise that explains what parameters could.
    pub fn swallowed(&mut self, swallowed: Option<Swallowed>) {
        let Some(output) = swallowed else { return };
        let told = |value| number(three_digits(value));
        let what = format!(
            "process noise of which nothing is declared explains what parameters could: the free run of {} is off by {}, fitted without that noise by {}",
            output.name,
            told(output.with),
            told(output.without)
        );
        self.warn("process-noise", what);
    }

    /// Warns of readings that are rounded to more than their noise.
    pub fn rounded(&mut self) {
        let problem = self.problem;
        let theta = problem.of_record(0, self.theta);
        for (j, least) in rounded(&problem.twin, &problem.records, &theta) {
            let output = &problem.twin.signals().outputs[j];
            let [step, least] = [least * TAU.sqrt(), least].map(|v| number(three_digits(v)));
            let (name, unit) = (&output.name, unit_suffix(&output.unit));
            let what = format!(
                "{name} moves in steps of {step}{unit}: its noise counts as {least}{unit}, whatever less is declared or fitted"
            );
            self.warn("rounded-readings", what);
        }
    }

    /// Warns of channels that never move, and of events that never act.
    pub fn still(&mut self) {
        let problem = self.problem;
        let theta = problem.of_record(0, self.theta);
        (self.all).extend(Warning::events_outside(
            &problem.twin,
            &theta,
            &problem.records,
        ));
        self.all
            .extend(Warning::still(&problem.twin.signals(), &problem.records));
    }

    /// Warns of a fit that was stopped behind its search.
    pub fn interrupted(&mut self, is_cut: bool) {
        if is_cut {
            let what = "the fit was stopped before all was asked of the records: intervals are of first order, profiles and draws are left out";
            self.warn("interrupted", what.into());
        }
    }

    /// Warns of steps that are too long for the fitted twin; returns whether free runs diverge, and all that do by their step.
    pub fn steps(&mut self, free_runs: &[Option<Signal>]) -> bool {
        let problem = self.problem;
        let (mut diverging, mut by_step) = (0, 0);
        for (r, (record, run)) in problem.records.iter().zip(free_runs).enumerate() {
            let of = match problem.records.len() {
                1 => String::new(),
                _ => format!(" of record {}", r + 1),
            };
            let theta = problem.of_record(r, self.theta);
            let doubt = Warning::step(&problem.twin, &theta, record, &of);
            diverging += usize::from(run.is_none());
            by_step += usize::from(run.is_none() && doubt.is_some());
            self.all.extend(doubt);
        }
        diverging > 0 && by_step == diverging
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;

    /// A channel is still if it has one value in all records together, missing values apart.
    #[test]
    fn a_channel_that_differs_between_records_moves() {
        let record = |u: f64| {
            let mut y = Signal::from_elem((3, 1), 1.0);
            y[[1, 0]] = f64::NAN;
            let drive = Drive::new(1.0, Signal::from_elem((3, 1), u)).unwrap();
            Record::new(drive, y).unwrap()
        };
        let signals = Signals {
            inputs: vec![Quantity::new("u", "V")],
            outputs: vec![Quantity::new("y", "V")],
        };
        let codes = |records: &[Record]| -> Vec<&str> {
            Warning::still(&signals, records)
                .iter()
                .map(|w| w.code)
                .collect()
        };
        assert_eq!(codes(&[record(1.0)]), ["constant-input", "constant-output"]);
        assert_eq!(codes(&[record(1.0), record(2.0)]), ["constant-output"]);
    }

    #[test]
    fn every_reason_has_a_remedy() {
        assert!(REMEDIES.is_sorted());
        assert!(!Warning::no_better("y").remedy.is_empty());
    }
}
