//! Plan of one candidate: its variants, start magnitudes, and the axis of each magnitude in a fit.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::hypotheses::candidate::{Addition, Candidate, Kind, with, with_disturbance};
use crate::diagnose::hypotheses::choice::{Choice, axis, choices, log_axis, unit, unset_log_axis};
use crate::diagnose::hypotheses::entry::Entry;
use crate::diagnose::hypotheses::scales::Scales;
use crate::diagnose::hypotheses::variant::Variant;
use crate::diagnose::thresholds::Thresholds;
use crate::effect::{Effect, Law, Magnitude, Mark, TargetKind};
use crate::fit::axis::Axis;
use crate::fit::problem::Problem;
use crate::math::quantile;
use crate::math::{deviation, ends, largest};
use crate::twin::{Interval, Twin};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A variant before its points are tried.
pub(in crate::diagnose) struct Plan {
    pub variant: Variant,
    /// First magnitude, and the shapes: what is tried.
    pub leads: Vec<Lead>,
    pub shapes: Vec<Vec<f64>>,
    /// Multiples of the secant that make sense.
    pub range: (f64, f64),
}

/// Search for the first magnitude to try.
#[derive(Clone, Copy)]
pub(in crate::diagnose) enum Lead {
    /// The value itself.
    At(f64),
    /// The value, halved while it is coarse.
    Shrink(f64),
    /// Scaled until it is just visible; a multiple of the secant is one of the magnitude if `linear`.
    Visible { guess: f64, linear: bool },
}

/// Inputs of the plans: the study's twin, its accepted effects, and the fit of both.
pub(in crate::diagnose) struct Planner<'a> {
    pub study: &'a Twin,
    pub accepted: &'a [Addition],
    pub problem: &'a Problem<'a>,
    pub scales: &'a Scales<'a>,
    /// True where fewer points are enough.
    pub coarse: bool,
}

/// Leads, axis and range of a first magnitude.
type First = (Vec<Lead>, Axis, (f64, f64));

impl Planner<'_> {
    /// Variants of a candidate, and where to statistics.
    pub fn plans(&self, index: usize, candidate: &Candidate) -> Result<Vec<Plan>, DiagnoseError> {
        match &candidate.kind {
            Kind::CatchAll(entry, memory) => {
                let free = candidate.magnitudes();
                Ok(vec![self.disturbance(index, free, *entry, *memory)])
            }
            Kind::Listed(effect) => {
                let values = self.values(effect);
                let mark = match effect.law() {
                    Law::Sensor(_) => effect.kind().marks(&values),
                    _ => Mark::Unmarked,
                };
                let plan = |choice: &Choice| self.listed(index, effect, &values, &mark, choice);
                let filtered = !self.problem.is_simulated();
                (choices(effect, &mark, filtered).iter())
                    .filter_map(|choice| plan(choice).transpose())
                    .collect()
            }
        }
    }

    fn disturbance(&self, index: usize, free: Vec<Magnitude>, entry: Entry, memory: f64) -> Plan {
        let scales = self.scales;
        let guess = match entry {
            Entry::State(i) => {
                0.05 * deviation(&scales.columns(TargetKind::State, i)) / scales.dt()
            }
            Entry::Sensor(j) => 0.05 * deviation(&scales.columns(TargetKind::Sensor, j)),
            Entry::Actuator(j) => 0.05 * deviation(&scales.columns(TargetKind::Actuator, j)),
            Entry::Parameter(_) => 0.05,
        };
        let visible = Lead::Visible {
            guess,
            linear: true,
        };
        let mut leads = vec![visible];
        if !self.coarse {
            leads.push(Lead::At(guess));
        }
        Plan {
            variant: Variant {
                candidate: index,
                twin: with_disturbance(&self.problem.twin, entry, memory),
                free,
                held: BTreeMap::new(),
                kept: None,
                mark: 0.0,
                axes: vec![unset_log_axis(guess)],
                jumps: vec![],
            },
            leads,
            shapes: vec![],
            range: (0.0, 1e4),
        }
    }

    /// Values of the signal or state that an effect sits at.
    fn values(&self, effect: &Effect) -> Vec<f64> {
        let outline = self.study.outline();
        let kind = effect.law().target();
        let known = crate::effect::targets(kind, outline.as_ref(), &self.study.signals());
        let target = known.iter().position(|k| k == effect.target()).unwrap_or(0);
        self.scales.columns(kind, target)
    }

    fn listed(
        &self,
        index: usize,
        effect: &Effect,
        values: &[f64],
        mark: &Mark,
        choice: &Choice,
    ) -> Result<Option<Plan>, DiagnoseError> {
        let magnitudes = effect.magnitudes();
        let held: BTreeMap<String, f64> = (magnitudes.iter().enumerate())
            .filter(|(i, _)| choice.off.contains(i))
            .map(|(_, m)| (m.name.to_owned(), m.off.unwrap_or(0.0)))
            .collect();
        let free: Vec<Magnitude> = (magnitudes.iter())
            .filter(|m| !held.contains_key(m.name))
            .cloned()
            .collect();
        let Some(first) = free.first() else {
            return Ok(None);
        };
        let (mut leads, axis, range) = self.first(first, effect.law(), values, choice.register);
        let mut axes = vec![axis];
        let (least, most) = effect.kind().memories();
        if choice.register.is_none() && least < most {
            // No later than the whole register reaches.
            let reach = (most - 1) as f64 * self.scales.dt();
            let bounds = axes[0].bounds;
            axes[0].bounds = Interval::unchecked(bounds.low(), bounds.high().min(reach));
        }
        let mut shapes = Vec::new();
        let mut jumps = Vec::new();
        for (i, shape) in free.iter().enumerate().skip(1) {
            let (tried, axis) = self.shape(shape, values);
            if shape.unit == "s" {
                jumps.push(i);
            }
            shapes.push(tried);
            axes.push(axis);
        }
        if let Mark::Present(m) = mark {
            // What the outputs show is not to be fitted.
            let mut shown = (m.iter().enumerate()).filter(|(i, _)| !choice.off.contains(i));
            leads = shown
                .next()
                .map(|(_, v)| Lead::At(*v))
                .into_iter()
                .collect();
            shapes = shown.map(|(_, v)| vec![*v]).collect();
            axes.iter_mut().for_each(|axis| axis.held = true);
        }
        let kept = choice.register.map(|i| Thresholds::REGISTERS[i]);
        let addition = Addition {
            effect: effect.clone(),
            held: held.clone(),
            kept,
        };
        let additions: Vec<Addition> = self.accepted.iter().cloned().chain([addition]).collect();
        Ok(Some(Plan {
            variant: Variant {
                candidate: index,
                twin: with(self.study, &additions)?,
                free,
                held,
                kept,
                mark: match mark {
                    Mark::Unmarked => 0.0,
                    Mark::Absent => Thresholds::MARK_ABSENT,
                    Mark::Present(_) => Thresholds::MARK_PRESENT,
                },
                axes,
                jumps,
            },
            leads,
            shapes,
            range,
        }))
    }

    /// Plans the first magnitude of an effect at a signal or state with these values.
    fn first(&self, m: &Magnitude, law: &Law, values: &[f64], register: Option<usize>) -> First {
        let (dt, duration) = (self.scales.dt(), self.scales.duration());
        let size = deviation(values).max(1e-9 * largest(values)).max(1e-12);
        let positive = m.limits.low() >= 0.0;
        let in_unit = |v: f64| v * unit(m.unit, size, dt);
        let starts = m.starts.iter().copied();
        let greatest = in_unit(starts.clone().fold(0.0, |a: f64, v| a.max(v.abs())));
        if m.is_threshold() && !positive {
            let (levels, axis) = self.threshold(m, values);
            (levels.into_iter().map(Lead::At).collect(), axis, (0.0, 1.5))
        } else if m.is_threshold() {
            let leads = starts.map(|v| Lead::At(in_unit(v))).collect();
            let axis = log_axis(1e-3 * greatest, 1e2 * greatest, greatest);
            (leads, axis, (0.0, 1.5))
        } else if let (Some(register), "s") = (register, m.unit) {
            let delays = Thresholds::DELAYS[register].iter();
            let longest = (Thresholds::REGISTERS[register] - 1) as f64 * dt;
            let bounds = Interval::unchecked(0.0, longest);
            let axis = axis(bounds, dt, 10.0 * dt, 0.1 * dt, 1.5 * dt);
            (
                delays.map(|v| Lead::Shrink(v * dt)).collect(),
                axis,
                (0.0, 3.0),
            )
        } else if m.unit == "s" {
            let leads = starts.map(|v| Lead::Shrink(in_unit(v))).collect();
            let axis = log_axis(0.05 * dt, 0.5 * duration, 2.0 * dt);
            (leads, axis, (0.0, 3.0))
        } else if matches!(law, Law::Outliers(_)) {
            let leads = starts.map(Lead::At).collect();
            (leads, log_axis(1e-4, 0.5, 0.02), (0.0, 2.0))
        } else if law.is_noise() {
            let visible = Lead::Visible {
                guess: greatest,
                linear: true,
            };
            let fixed = starts
                .filter(|_| !self.coarse)
                .map(|v| Lead::At(in_unit(v)));
            let leads = [visible].into_iter().chain(fixed).collect();
            (leads, unset_log_axis(greatest), (0.0, 1e4))
        } else if positive && m.unit == "signal" {
            let visible = Lead::Visible {
                guess: greatest,
                linear: false,
            };
            let leads = starts.map(|v| Lead::At(in_unit(v))).chain([visible]);
            let axis = log_axis(1e-3 * greatest, 10.0 * greatest, 0.1 * greatest);
            (leads.collect(), axis, (0.0, 2.0))
        } else {
            let visible = Lead::Visible {
                guess: 0.1 * greatest,
                linear: true,
            };
            let axis = axis(Interval::EVERYTHING, 0.0, 1.0, f64::NAN, greatest);
            let least = if positive { 0.0 } else { f64::NEG_INFINITY };
            (vec![visible], axis, (least, f64::INFINITY))
        }
    }

    /// Levels of a threshold to look at, and its axis.
    fn threshold(&self, m: &Magnitude, values: &[f64]) -> (Vec<f64>, Axis) {
        let (low, high) = ends(values);
        let span = (high - low).max(1e-9);
        let shares = match m.off {
            Some(off) if off > 0.0 => [0.9, 0.5, 0.97, 0.75],
            _ => [0.1, 0.5, 0.03, 0.25],
        };
        let levels = (shares[..Thresholds::LEVELS[usize::from(self.coarse)]].iter())
            .filter_map(|p| quantile(values, *p).ok());
        let bounds = Interval::unchecked(low - 0.3 * span, high + 0.3 * span);
        let axis = axis(
            bounds,
            low + 0.5 * span,
            3.0 * span,
            0.05 * span,
            0.15 * span,
        );
        (levels.collect(), axis)
    }

    /// Values of a shape to look at, and how it moves in a fit.
    fn shape(&self, shape: &Magnitude, values: &[f64]) -> (Vec<f64>, Axis) {
        let (dt, duration) = (self.scales.dt(), self.scales.duration());
        let linear = |low: f64, high: f64, width: f64, longest: f64| {
            let bounds = Interval::unchecked(low, high);
            let centre = 0.5 * (low + high);
            axis(bounds, centre, 2.0 * (high - low), width, longest)
        };
        match shape.unit {
            _ if shape.is_threshold() => {
                let (levels, axis) = self.threshold(shape, values);
                (levels[..1].to_vec(), axis)
            }
            "Hz" => {
                let (low, high): (f64, f64) = (1.5 / duration, 0.15 / dt);
                let count = Thresholds::FREQUENCIES[usize::from(self.coarse)];
                let at = |i: usize| low * (high / low).powf(i as f64 / (count - 1) as f64);
                let axis = Axis {
                    longest: 0.3,
                    ..log_axis(1.0 / duration, 0.5 / dt, (low * high).sqrt())
                };
                ((0..count).map(at).collect(), axis)
            }
            "rad" => (vec![0.0, FRAC_PI_2], linear(-TAU, TAU, 1.0, 1.0)),
            "s" => {
                let count = Thresholds::TIMES[usize::from(self.coarse)];
                let times = (1..=count).map(|i| duration * i as f64 / (count + 1) as f64);
                let axis = Axis {
                    held: true,
                    ..linear(0.0, duration, duration, 1.0)
                };
                (times.collect(), axis)
            }
            _ => {
                let ends = |limit: f64, other: f64| if limit.is_finite() { limit } else { other };
                let size = unit(shape.unit, deviation(values), dt);
                let starts: Vec<f64> = shape.starts.iter().map(|v| v * size).collect();
                let largest = starts.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
                if shape.limits.low() == 0.0 && !shape.limits.is_finite() && largest > 0.0 {
                    let axis = log_axis(1e-2 * largest, 10.0 * largest, starts[0]);
                    return (starts, axis);
                }
                let low = ends(shape.limits.low(), -3.0 * largest);
                let high = ends(shape.limits.high(), 3.0 * largest);
                let span = high - low;
                // First and last of three, and all of the others.
                let mut values = starts;
                if shape.limits.is_finite() && values.len() == 3 && span <= 1.0 {
                    values.remove(1);
                }
                if self.coarse {
                    values = vec![values[values.len() / 2]];
                }
                (values, linear(low, high, 0.1 * span, 0.3 * span))
            }
        }
    }
}
