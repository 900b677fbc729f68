//! Where the candidates are looked for: magnitudes in the units of this record.

use super::DiagnoseError;
use super::candidate::{Addition, Candidate, Kind, with, with_disturbance};
use super::catch_all::Place;
use super::fit::recoverable;
use super::problem::{Axis, Problem};
use super::scan::{Gain, Reference};
use super::shorten::LONG;
use crate::filter::FilterError;
use crate::math::quantile;
use crate::twin::{DigitalTwin, Interval, Law, Magnitude, Record, Signal};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

/// d·d at which a magnitude is one that could just be seen.
const VISIBLE: f64 = 10.0;
/// d·d beyond which a secant is shortened.
const COARSE: f64 = 400.0;
/// Frequencies, times and levels that are looked at, and how many where it is enough to see that something is left.
const FREQUENCIES: [usize; 2] = [8, 4];
const TIMES: [usize; 2] = [8, 4];
/// Delays in steps, each with a register that just holds it: the shorter the register, the faster the filter.
const DELAYS: [&[f64]; 3] = [&[0.5, 1.5], &[3.0], &[5.5]];
const REGISTERS: [usize; 3] = [3, 5, 8];

/// A candidate with those of its thresholds that are in use, as a twin.
pub(super) struct Variant {
    /// Index among the candidates.
    pub candidate: usize,
    pub twin: Arc<dyn DigitalTwin>,
    /// Free magnitudes in the order of θ; the others are held at their off values.
    pub free: Vec<Magnitude>,
    pub held: BTreeMap<String, f64>,
    /// Memory values that filters keep of a delay.
    pub kept: Option<usize>,
    /// Axes of the free magnitudes.
    pub axes: Vec<Axis>,
    /// Free magnitudes without a derivative (the time of a jump).
    pub jumps: Vec<usize>,
}

/// One place to look at.
#[derive(Debug, Clone)]
pub(super) struct Point {
    /// Index among the variants.
    pub variant: usize,
    /// Free magnitudes.
    pub m: Vec<f64>,
    /// Multiples of the secant that make sense.
    pub range: (f64, f64),
    /// Whether a multiple of the secant is that multiple of the first magnitude.
    pub linear: bool,
}

/// All places, and the twins to look with.
pub(super) struct Dictionary {
    pub candidates: Vec<Candidate>,
    pub variants: Vec<Variant>,
    pub points: Vec<Point>,
}

/// What the dictionary's units are taken from.
pub(super) struct Scales<'a> {
    pub records: &'a [Record],
    /// Filtered states of each record at θ̂.
    pub states: &'a [Signal],
}

impl Scales<'_> {
    fn columns(&self, law: Law, target: usize) -> Vec<f64> {
        let column = |signal: &Signal| -> Vec<f64> {
            if target < signal.ncols() {
                signal.column(target).to_vec()
            } else {
                vec![]
            }
        };
        let all: Vec<Vec<f64>> = match law {
            Law::Sensor | Law::MeasurementNoise | Law::Outliers => {
                self.records.iter().map(|r| column(r.outputs())).collect()
            }
            Law::Actuator => (self.records.iter())
                .map(|r| column(r.drive().inputs()))
                .collect(),
            _ => self.states.iter().map(column).collect(),
        };
        all.concat()
    }

    fn dt(&self) -> f64 {
        self.records[0].drive().dt()
    }

    /// Length of the longest record in seconds.
    fn duration(&self) -> f64 {
        let longest = self.records.iter().map(Record::samples).max().unwrap_or(1);
        longest as f64 * self.dt()
    }
}

/// A variant before its points are tried.
struct Plan {
    variant: Variant,
    /// First magnitude, and the shapes: what is tried.
    leads: Vec<Lead>,
    shapes: Vec<Vec<f64>>,
    range: (f64, f64),
}

#[derive(Clone, Copy)]
enum Lead {
    /// As it is.
    At(f64),
    /// As it is, halved while it is coarse.
    Shrink(f64),
    /// Scaled until it is just visible; a multiple of the secant is one of the magnitude if `linear`.
    Visible { guess: f64, linear: bool },
}

impl Dictionary {
    /// Of candidates on the twin `study` with the effects `accepted`; `problem` and `reference` are that twin's.
    pub fn new(
        study: &Arc<dyn DigitalTwin>,
        accepted: &[Addition],
        candidates: Vec<Candidate>,
        problem: &Problem<'_>,
        theta: &[f64],
        reference: &Reference,
        scales: &Scales<'_>,
    ) -> Result<Self, DiagnoseError> {
        // With effects added, it is enough to see that something is left.
        let coarse = !accepted.is_empty();
        let mut plans = Vec::new();
        for (index, candidate) in candidates.iter().enumerate() {
            plans.extend(plan(
                study, accepted, candidate, index, problem, scales, coarse,
            )?);
        }
        let combinations: Vec<(usize, Lead, Vec<f64>)> = (plans.iter().enumerate())
            .flat_map(|(v, plan)| {
                let shapes = product(&plan.shapes);
                plan.leads.iter().flat_map(move |lead| {
                    let shapes = shapes.clone();
                    shapes.into_iter().map(move |shape| (v, *lead, shape))
                })
            })
            .collect();
        let tried: Vec<Option<Point>> = combinations
            .into_par_iter()
            .map(|(v, lead, shape)| {
                let plan = &plans[v];
                let look = |first: f64| -> Result<Option<f64>, FilterError> {
                    let m: Vec<f64> = [first].into_iter().chain(shape.iter().copied()).collect();
                    let of = plan.variant.problem(problem);
                    let there = recoverable(of.filtered(
                        &of.full(&plan.variant.theta(&problem.of_record(0, theta), &m)),
                    ))?;
                    Ok(there.map(|there| reference.direction(&there).norm_squared()))
                };
                let found = try_lead(lead, look)?;
                Ok(found.map(|(first, linear)| Point {
                    variant: v,
                    m: [first].into_iter().chain(shape.iter().copied()).collect(),
                    range: plan.range,
                    linear,
                }))
            })
            .collect::<Result<_, FilterError>>()?;
        let points: Vec<Point> = tried.into_iter().flatten().collect();
        let mut variants: Vec<Variant> = plans.into_iter().map(|plan| plan.variant).collect();
        for (v, variant) in variants.iter_mut().enumerate() {
            let visible = points.iter().filter(|p| p.variant == v && p.linear);
            let unit = visible.map(|p| p.m[0].abs()).fold(0.0, f64::max);
            variant.rescale(unit);
        }
        Ok(Self {
            candidates,
            variants,
            points,
        })
    }

    /// Gains of all points, of records like those of `problem`.
    pub fn scan(
        &self,
        problem: &Problem<'_>,
        theta: &[f64],
        reference: &Reference,
    ) -> Result<Vec<Gain>, FilterError> {
        let base = |variant: &Variant, point: &Point| {
            let of = variant.problem(problem);
            // Starts of further records stand behind the magnitudes.
            let mut full = of.full(&variant.theta(&problem.of_record(0, theta), &point.m));
            for r in 1..problem.records.len() {
                let own = variant.theta(&problem.of_record(r, theta), &point.m);
                of.place(r, &own, &mut full);
            }
            recoverable(of.filtered(&full))
        };
        (self.points.par_iter())
            .map(|point| {
                let there = base(&self.variants[point.variant], point)?;
                Ok(there.map_or(Gain::default(), |there| {
                    reference.gain(&reference.direction(&there), point.range)
                }))
            })
            .collect()
    }

    /// The best gain of each candidate.
    pub fn best(&self, gains: &[Gain]) -> Vec<f64> {
        let mut best = vec![0.0; self.candidates.len()];
        for (point, gain) in self.points.iter().zip(gains) {
            let best: &mut f64 = &mut best[self.variants[point.variant].candidate];
            *best = best.max(gain.nats);
        }
        best
    }
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

    /// Sets the scale of the first magnitude to what is just visible.
    fn rescale(&mut self, unit: f64) {
        let Some(first) = self.axes.first_mut() else {
            return;
        };
        if unit > 0.0 && first.width.is_nan() {
            let limits = self.free[0].limits;
            // A twin without measurement noise sees what is a millionth of any start.
            let start = first.longest;
            let reach = (300.0 * unit).max(3.0 * start);
            let low = limits.low().max(-reach);
            first.bounds = Interval::unchecked(low, limits.high().min(reach));
            first.centre = first.bounds.clamp(0.0);
            first.deviation = reach;
            first.width = unit;
            first.longest = (20.0 * unit).max(0.3 * start);
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

/// Finds the first magnitude to look at; `None` where nothing can be seen or filtered. Also whether it is linear.
fn try_lead(
    lead: Lead,
    look: impl Fn(f64) -> Result<Option<f64>, FilterError>,
) -> Result<Option<(f64, bool)>, FilterError> {
    let seen = |q: f64| q.is_finite() && q > 1e-6;
    match lead {
        Lead::At(value) => Ok(look(value)?.filter(|q| seen(*q)).map(|_| (value, false))),
        Lead::Shrink(mut value) => {
            for _ in 0..12 {
                match look(value)? {
                    Some(q) if q <= COARSE => return Ok(seen(q).then_some((value, false))),
                    _ => value *= 0.5,
                }
            }
            Ok(None)
        }
        Lead::Visible { guess, linear } => {
            let mut value = guess;
            for _ in 0..20 {
                let factor = match look(value)? {
                    Some(q) if (0.3 * VISIBLE..=4.0 * VISIBLE).contains(&q) => {
                        return Ok(Some((value, linear)));
                    }
                    // Between the powers of a shift (2) and of a variance (4).
                    Some(q) if q.is_finite() => {
                        (VISIBLE / q.max(1e-12)).powf(0.3).clamp(0.05, 20.0)
                    }
                    _ => 0.1,
                };
                value *= factor;
            }
            Ok(None)
        }
    }
}

/// Variants of a candidate, and where to look.
fn plan(
    study: &Arc<dyn DigitalTwin>,
    accepted: &[Addition],
    candidate: &Candidate,
    index: usize,
    problem: &Problem<'_>,
    scales: &Scales<'_>,
    coarse: bool,
) -> Result<Vec<Plan>, DiagnoseError> {
    let unset = f64::NAN;
    let log_axis = |low: f64, high: f64, centre: f64| Axis {
        bounds: Interval::unchecked(low, high),
        centre,
        deviation: 3.0,
        width: 1.0,
        longest: 0.7,
        counts: false,
        held: false,
    };
    let effect = match &candidate.kind {
        Kind::CatchAll(place, memory) => {
            let guess = match place {
                Place::State(i) => 0.05 * deviation(&scales.columns(Law::Force, *i)) / scales.dt(),
                Place::Sensor(j) => 0.05 * deviation(&scales.columns(Law::Sensor, *j)),
                Place::Parameter(_) => 0.05,
            };
            let variant = Variant {
                candidate: index,
                twin: with_disturbance(&problem.twin, *place, *memory),
                free: candidate.magnitudes(),
                held: BTreeMap::new(),
                kept: None,
                axes: vec![log_axis(unset, unset, guess)],
                jumps: vec![],
            };
            let lead = Lead::Visible {
                guess,
                linear: true,
            };
            return Ok(vec![Plan {
                variant,
                leads: if coarse {
                    vec![lead]
                } else {
                    vec![lead, Lead::At(guess)]
                },
                shapes: vec![],
                range: (0.0, 1e4),
            }]);
        }
        Kind::Listed(effect) => effect,
    };
    let law = effect.law();
    let magnitudes = effect.magnitudes();
    let outline = study.state_space().map(|t| t.outline());
    let known = crate::twin::targets(law, outline.as_ref(), &study.signals());
    let target = (known.iter().position(|k| k == effect.target())).unwrap_or(0);
    let values = scales.columns(law, target);
    let size = deviation(&values).max(1e-9 * largest(&values)).max(1e-12);
    let (dt, duration) = (scales.dt(), scales.duration());
    let infinite = |m: &Magnitude| m.off.is_some_and(f64::is_infinite);
    let thresholds: Vec<usize> = (0..magnitudes.len())
        .filter(|&i| infinite(&magnitudes[i]))
        .collect();
    // One threshold at a time.
    let choices: Vec<(Option<usize>, Option<usize>)> = match thresholds.len() {
        0 | 1 if effect.memory() > LONG => {
            // The delays of a state need its covariances with the past; those of an input cost less.
            let registers = if law == Law::Actuator { 3 } else { 2 };
            (0..registers).map(|i| (None, Some(i))).collect()
        }
        0 | 1 => vec![(None, None)],
        _ => thresholds.iter().map(|&i| (Some(i), None)).collect(),
    };
    let mut plans = Vec::new();
    for (choice, register) in choices {
        let held: BTreeMap<String, f64> = (thresholds.iter())
            .filter(|&&i| choice.is_some_and(|c| c != i))
            .map(|&i| {
                (
                    magnitudes[i].name.to_owned(),
                    magnitudes[i].off.unwrap_or(0.0),
                )
            })
            .collect();
        let free: Vec<Magnitude> = (magnitudes.iter())
            .filter(|m| !held.contains_key(m.name))
            .cloned()
            .collect();
        let Some(first) = free.first().cloned() else {
            continue;
        };
        let positive = first.limits.low() >= 0.0;
        let in_unit = |v: f64| v * unit(first.unit, size, dt);
        let starts = first.starts.iter().copied();
        let greatest = in_unit(starts.clone().fold(0.0, |a: f64, v| a.max(v.abs())));
        let (leads, axis, range): (Vec<Lead>, Axis, (f64, f64)) = if infinite(&first) && !positive {
            let (low, high) = ends(&values);
            let span = (high - low).max(1e-9);
            let shares = match first.off {
                Some(off) if off > 0.0 => [0.9, 0.5, 0.97, 0.75],
                _ => [0.1, 0.5, 0.03, 0.25],
            };
            let count = if coarse { 2 } else { 4 };
            let levels = shares[..count]
                .iter()
                .filter_map(|p| quantile(&values, *p).ok());
            let axis = Axis {
                bounds: Interval::unchecked(low - 0.3 * span, high + 0.3 * span),
                centre: low + 0.5 * span,
                deviation: 3.0 * span,
                width: 0.05 * span,
                longest: 0.15 * span,
                counts: false,
                held: false,
            };
            (levels.map(Lead::At).collect(), axis, (0.0, 1.5))
        } else if infinite(&first) {
            let leads = starts.map(|v| Lead::At(in_unit(v))).collect();
            let axis = log_axis(1e-3 * greatest, 1e2 * greatest, greatest);
            (leads, axis, (0.0, 1.5))
        } else if let (Some(register), "s") = (register, first.unit) {
            let leads = (DELAYS[register].iter())
                .map(|v| Lead::Shrink(v * dt))
                .collect();
            let axis = Axis {
                bounds: Interval::unchecked(0.0, (REGISTERS[register] - 1) as f64 * dt),
                centre: dt,
                deviation: 10.0 * dt,
                width: 0.1 * dt,
                longest: 1.5 * dt,
                counts: false,
                held: false,
            };
            (leads, axis, (0.0, 3.0))
        } else if first.unit == "s" {
            let leads = starts.map(|v| Lead::Shrink(in_unit(v))).collect();
            (
                leads,
                log_axis(0.05 * dt, 0.5 * duration, 2.0 * dt),
                (0.0, 3.0),
            )
        } else if matches!(law, Law::MeasurementNoise | Law::ProcessNoise) {
            let lead = Lead::Visible {
                guess: greatest,
                linear: true,
            };
            let fixed = starts.filter(|_| !coarse).map(|v| Lead::At(in_unit(v)));
            let leads = [lead].into_iter().chain(fixed).collect();
            (leads, log_axis(unset, unset, greatest), (0.0, 1e4))
        } else if positive && first.unit == "signal" {
            let visible = Lead::Visible {
                guess: greatest,
                linear: false,
            };
            let leads = (starts.map(|v| Lead::At(in_unit(v))))
                .chain([visible])
                .collect();
            let axis = log_axis(1e-3 * greatest, 10.0 * greatest, 0.1 * greatest);
            (leads, axis, (0.0, 2.0))
        } else {
            let lead = Lead::Visible {
                guess: 0.1 * greatest,
                linear: true,
            };
            let axis = Axis {
                bounds: Interval::EVERYTHING,
                centre: 0.0,
                deviation: 1.0,
                width: unset,
                longest: greatest,
                counts: false,
                held: false,
            };
            let least = if positive { 0.0 } else { f64::NEG_INFINITY };
            (vec![lead], axis, (least, f64::INFINITY))
        };
        let mut axes = vec![axis];
        let mut shapes = Vec::new();
        let mut jumps = Vec::new();
        for (i, shape) in free.iter().enumerate().skip(1) {
            let (values, axis) = shape_axis(shape, dt, duration, coarse);
            if shape.unit == "s" {
                jumps.push(i);
            }
            shapes.push(values);
            axes.push(axis);
        }
        let addition = Addition {
            effect: effect.clone(),
            held: held.clone(),
            kept: register.map(|i| REGISTERS[i]),
        };
        let additions: Vec<Addition> = accepted.iter().cloned().chain([addition]).collect();
        plans.push(Plan {
            variant: Variant {
                candidate: index,
                twin: with(study, &additions)?,
                free,
                held,
                kept: register.map(|i| REGISTERS[i]),
                axes,
                jumps,
            },
            leads,
            shapes,
            range,
        });
    }
    Ok(plans)
}

/// Values of a shape to look at, and how it moves in a fit.
fn shape_axis(shape: &Magnitude, dt: f64, duration: f64, coarse: bool) -> (Vec<f64>, Axis) {
    let linear = |low: f64, high: f64, width: f64, longest: f64| Axis {
        bounds: Interval::unchecked(low, high),
        centre: 0.5 * (low + high),
        deviation: 2.0 * (high - low),
        width,
        longest,
        counts: false,
        held: false,
    };
    match shape.unit {
        "Hz" => {
            let (low, high): (f64, f64) = (1.5 / duration, 0.15 / dt);
            let count = FREQUENCIES[usize::from(coarse)];
            let at = |i: usize| low * (high / low).powf(i as f64 / (count - 1) as f64);
            let axis = Axis {
                deviation: 3.0,
                centre: (low * high).sqrt(),
                longest: 0.3,
                ..linear(0.5 / duration, 0.5 / dt, 1.0, 0.3)
            };
            ((0..count).map(at).collect(), axis)
        }
        "rad" => (vec![0.0, FRAC_PI_2], linear(-TAU, TAU, 1.0, 1.0)),
        "s" => {
            let count = TIMES[usize::from(coarse)];
            let times = (1..=count).map(|i| duration * i as f64 / (count + 1) as f64);
            let axis = Axis {
                held: true,
                ..linear(0.0, duration, duration, 1.0)
            };
            (times.collect(), axis)
        }
        _ => {
            let ends = |limit: f64, other: f64| if limit.is_finite() { limit } else { other };
            let largest = shape.starts.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
            let low = ends(shape.limits.low(), -3.0 * largest);
            let high = ends(shape.limits.high(), 3.0 * largest);
            let span = high - low;
            // First and last of three, and all of the others.
            let mut values = shape.starts.to_vec();
            if shape.limits.is_finite() && values.len() == 3 && span <= 1.0 {
                values.remove(1);
            }
            if coarse {
                values = vec![values[values.len() / 2]];
            }
            (values, linear(low, high, 0.1 * span, 0.3 * span))
        }
    }
}

/// The size of one unit, of a signal or state of deviation `size`.
fn unit(name: &str, size: f64, dt: f64) -> f64 {
    let signal = match name {
        n if n.starts_with("signal") || n.starts_with("state") => size,
        _ => 1.0,
    };
    match name {
        "s" => dt,
        n if n.ends_with("/s") || n.ends_with("·s)") => signal / dt,
        _ => signal,
    }
}

fn product(lists: &[Vec<f64>]) -> Vec<Vec<f64>> {
    lists.iter().fold(vec![vec![]], |all, list| {
        all.iter()
            .flat_map(|head| {
                list.iter().map(move |v| {
                    let mut next = head.clone();
                    next.push(*v);
                    next
                })
            })
            .collect()
    })
}

fn deviation(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a: f64, v| a.max(v.abs()))
}

fn ends(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(*v), high.max(*v))
        })
}
