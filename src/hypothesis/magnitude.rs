//! Ranges of magnitudes on a record: the prior of each shape, and the values at which a search looks.

use crate::effect::{Effect, Magnitude, Shape, TargetKind};
use crate::fit::axis::{Axis, EvidencePrior};
use crate::hypothesis::limits::TERM;
use crate::math::{deviation, ends, quantile};
use crate::twin::{Interval, Law, Parameter};
use std::f64::consts::{FRAC_PI_2, PI};

/// Levels that are tried for a threshold: shares of the values that lie below an upper one, above a lower one.
const LEVELS: [f64; 6] = [0.97, 0.9, 0.8, 0.65, 0.5, 0.35];
/// Limits of a rate that are tried, as shares of the fastest step of the record.
const RATES: [f64; 5] = [0.02, 0.05, 0.1, 0.2, 0.5];
/// Widths that are tried, in deviations of the signal.
const WIDTHS: [f64; 4] = [0.2, 0.6, 1.5, 3.0];
/// Widths over which a law turns that are tried, in spans.
const KNEES: [f64; 3] = [0.02, 0.08, 0.25];
/// Shares of its range at which a number with two ends is tried.
const SHARES: [f64; 5] = [0.0, 0.1, 0.3, 0.6, 1.0];

/// An effect on a record: values of the signal or state that it bends, steps and length in seconds.
pub(super) struct Ranges<'a> {
    pub effect: &'a Effect,
    /// None for a parameter.
    pub values: &'a [f64],
    /// Those of a state at the prior's centre.
    pub before: &'a [f64],
    /// Values of the other state of a law between two.
    pub others: &'a [f64],
    pub dt: f64,
    pub duration: f64,
    /// Frequencies to try, in Hz.
    pub frequencies: &'a [f64],
    /// True where each look costs simulations.
    pub is_dear: bool,
}

impl Ranges<'_> {
    /// Values of one magnitude to try, and its axis. `largest` is the size at which the effect is as large as the twin's own terms, where the
    /// twin's equations tell it.
    pub fn of(
        &self,
        m: &Magnitude,
        parameter: &Parameter,
        largest: impl FnOnce() -> Option<f64>,
    ) -> (Vec<f64>, Axis) {
        let size = self.size();
        match self.effect.law() {
            Law::Outliers(_) if m.shape == Shape::Share => {
                return logarithmic(parameter, (0.003, 0.3), vec![0.03, 0.08]);
            }
            Law::Outliers(_) => {
                let grid = vec![0.5 * size, 2.0 * size];
                return logarithmic(parameter, (0.05 * size, 10.0 * size), grid);
            }
            law if law.is_noise() => {
                let grid = [3e-3, 0.02, 0.1].map(|share| share * size).to_vec();
                return logarithmic(parameter, (1e-4 * size, 2.0 * size), grid);
            }
            _ => {}
        }
        match (m.shape, m.off) {
            (Shape::Rate, Some(off)) if off.is_infinite() => self.rate_limit(parameter),
            (Shape::Frequency, Some(off)) if off.is_infinite() => self.mode(parameter),
            (_, Some(off)) if off.is_infinite() => self.threshold(parameter, off > 0.0),
            (Shape::Delay | Shape::TimeConstant, Some(_)) => self.lateness(parameter),
            (Shape::Time, _) => {
                let part = self.duration / (TERM.times + 1) as f64;
                let grid = (1..=TERM.times).map(|i| part * i as f64).collect();
                linear(parameter, (0.0, self.duration), grid)
            }
            (Shape::Frequency, _) => {
                frequency(parameter, (self.dt, self.duration), self.frequencies)
            }
            (Shape::Phase, _) => {
                let grid = vec![-FRAC_PI_2, 0.0, FRAC_PI_2, PI];
                let (grid, axis) = linear(parameter, (m.limits.low(), m.limits.high()), grid);
                // Each angle counts once, however often the limits hold it.
                let evidence = EvidencePrior::Uniform { low: -PI, high: PI };
                (grid, Axis { evidence, ..axis })
            }
            (Shape::Level, Some(_)) => self.width(parameter),
            (Shape::Level, None) => self.knee(parameter),
            (shape, Some(_)) => {
                let largest = largest().unwrap_or_else(|| self.usual(shape));
                let axis = Axis {
                    counts: false,
                    ..size_axis(parameter, largest)
                };
                (vec![0.0], axis)
            }
            _ => number(m, parameter),
        }
    }

    /// Deviation of the values; a share of the largest one where nothing moves.
    fn size(&self) -> f64 {
        let (low, high) = self.ends();
        let size = deviation(self.values).max(1e-3 * low.abs().max(high.abs()));
        if size > 0.0 { size } else { 1.0 }
    }

    fn ends(&self) -> (f64, f64) {
        match self.values.is_empty() {
            true => (0.0, 1.0),
            false => ends(self.values),
        }
    }

    /// The largest size where no equations tell it: half of the whole, over the record where it is a rate. Laws on parameters are relative.
    fn usual(&self, shape: Shape) -> f64 {
        let is_share = shape == Shape::Share || self.effect.law().target() == TargetKind::Parameter;
        let whole = if is_share { 0.5 } else { self.size() };
        match shape {
            Shape::Rate => 2.0 * whole / self.duration,
            _ => whole,
        }
    }

    /// Limit of a rate: beyond the fastest step of the record it is off, below its slowest wander nothing passes.
    fn rate_limit(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let (low, high) = self.ends();
        let fastest = (high - low).max(self.size()) / self.dt;
        let grid = RATES.map(|share| share * fastest).to_vec();
        let slowest = 2.0 * self.size() / self.duration;
        logarithmic(parameter, (slowest, fastest), grid)
    }

    /// Level among the values, or beyond those of a state: uniform, and with longer steps. A state that no sensor shows is larger where the effect acts
    /// than without it, by as much as its parameters leave open.
    fn threshold(&self, parameter: &Parameter, is_upper: bool) -> (Vec<f64>, Axis) {
        let (mut low, mut high) = self.ends();
        if !self.before.is_empty() {
            let before = ends(self.before);
            (low, high) = (low.min(before.0), high.max(before.1));
        }
        let beyond = match self.effect.law().target() {
            TargetKind::State => TERM.beyond * (high - low),
            _ => 0.0,
        };
        let (low, high) = match is_upper {
            true => (low, high + beyond),
            false => (low - beyond, high),
        };
        let range = (low, high.max(low + 1e-9));
        let grid = (LEVELS.iter())
            .filter_map(|p| quantile(self.values, if is_upper { *p } else { 1.0 - p }).ok())
            .collect();
        let (grid, axis) = linear(parameter, range, grid);
        let longest = TERM.longest_to_level * (range.1 - range.0);
        (grid, Axis { longest, ..axis })
    }

    /// Lag or delay.
    fn lateness(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let mut longest = (TERM.longest * self.duration).max(2.0 * TERM.shortest * self.dt);
        if let Some(most) = self.effect.kind().longest_dead_time(self.dt) {
            longest = longest.min(most);
        }
        let octaves = std::iter::successors(Some(0.5 * self.dt), |tau| Some(2.0 * tau));
        let octaves = octaves.take_while(|tau| *tau < longest);
        let grid = octaves.chain([longest]).collect();
        logarithmic(parameter, (TERM.shortest * self.dt, longest), grid)
    }

    /// Frequency of a mode: from two cycles of the record, by octaves, and where residuals peak. Where a look is dear, every second octave.
    fn mode(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let (low, high) = (2.0 / self.duration, 0.5 / self.dt);
        let factor = if self.is_dear { 4.0 } else { 2.0 };
        let octaves = std::iter::successors(Some(2.0 * low), |f| Some(factor * f));
        let octaves = octaves.take_while(|f| *f < high);
        let peaks = self.frequencies.iter().copied();
        let peaks = peaks.filter(|f| *f > low && !self.is_dear);
        logarithmic(parameter, (low, high), octaves.chain(peaks).collect())
    }

    /// Width over which a law turns, in what it is a law of: between the narrowest that rows resolve and half of the span.
    fn knee(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let values = if self.others.is_empty() {
            self.values
        } else {
            self.others
        };
        let (low, high) = match values.is_empty() {
            true => (0.0, 1.0),
            false => ends(values),
        };
        let span = (high - low).max(1e-9);
        let grid = KNEES.map(|share| share * span).to_vec();
        logarithmic(parameter, (0.003 * span, 0.5 * span), grid)
    }

    /// Width in the signal: beyond the widest, a dead zone or a play lets nothing pass. Readings are behind the play of a sensor, which may have taken off
    /// as much of them as it left.
    fn width(&self, parameter: &Parameter) -> (Vec<f64>, Axis) {
        let (low, high) = self.ends();
        let seen = match self.effect.law().target() {
            TargetKind::Sensor => 0.5,
            _ => 1.0,
        };
        let widest = (2.0 * low.abs().max(high.abs())).max((high - low).max(1e-9)) / seen;
        let size = self.size();
        let grid = WIDTHS.map(|share| share * size).to_vec();
        linear(parameter, (0.0, widest), grid)
    }
}

/// Frequencies to try, in Hz, and their axis: uniform in the logarithm, up to half the sampling rate.
pub(super) fn frequency(
    parameter: &Parameter,
    (dt, duration): (f64, f64),
    frequencies: &[f64],
) -> (Vec<f64>, Axis) {
    let range = (0.7 / duration, 0.5 / dt);
    let (grid, axis) = logarithmic(parameter, range, frequencies.to_vec());
    let axis = Axis {
        // A search must stay at its peak of the spectrum.
        longest: 0.02,
        deviation: 10.0,
        ..axis
    };
    (grid, axis)
}

/// An exponent, or a share without an effect of its own.
fn number(m: &Magnitude, parameter: &Parameter) -> (Vec<f64>, Axis) {
    if m.limits.is_finite() {
        let (low, high) = (m.limits.low(), m.limits.high());
        // Of a whole, and of exponents, all values are as likely; other numbers have their usual ones.
        let grid = match m.shape {
            Shape::Share if high != 1.0 => m.starts.to_vec(),
            _ => SHARES.map(|share| low + share * (high - low)).to_vec(),
        };
        return linear(parameter, (low, high), grid);
    }
    let (first, last) = ends(m.starts);
    let reach = 3.0 * (last - first);
    let low = m.limits.low().max(first - reach);
    let high = m.limits.high().min(last + reach);
    linear(parameter, (low, high), m.starts.to_vec())
}

/// Axis that is uniform over a range, and values within it.
fn linear(parameter: &Parameter, range: (f64, f64), grid: Vec<f64>) -> (Vec<f64>, Axis) {
    let parameter = within(parameter, range);
    let axis = Axis {
        counts: false,
        ..uniform_axis(&parameter, false)
    };
    (clamped(grid, &parameter), axis)
}

/// The same in the logarithm.
fn logarithmic(parameter: &Parameter, range: (f64, f64), grid: Vec<f64>) -> (Vec<f64>, Axis) {
    let parameter = within(parameter, range);
    let axis = Axis {
        counts: false,
        longest: 0.7,
        deviation: 3.0,
        ..uniform_axis(&parameter, true)
    };
    (clamped(grid, &parameter), axis)
}

fn clamped(grid: Vec<f64>, parameter: &Parameter) -> Vec<f64> {
    let mut grid: Vec<f64> = (grid.into_iter())
        .map(|v| parameter.bounds.clamp(v))
        .collect();
    grid.dedup();
    grid
}

/// A magnitude whose bounds are what the record can show and the user allows; the record's word alone where they have nothing in common.
fn within(parameter: &Parameter, (low, high): (f64, f64)) -> Parameter {
    let both = (
        low.max(parameter.bounds.low()),
        high.min(parameter.bounds.high()),
    );
    let (low, high) = if both.0 < both.1 { both } else { (low, high) };
    Parameter {
        bounds: Interval::unchecked(low, high),
        ..parameter.clone()
    }
}

/// Axis of a magnitude that is uniform within its bounds, or in its logarithm. A level has no zero of its own, and is never taken in its
/// logarithm.
pub(super) fn uniform_axis(parameter: &Parameter, is_log: bool) -> Axis {
    let bounds = parameter.bounds;
    let axis = Axis::of(parameter);
    if bounds.low() >= bounds.high() {
        return axis;
    }
    let [low, high] = [bounds.low(), bounds.high()].map(|v| if is_log { v.ln() } else { v });
    let (centre, width) = (0.5 * (low + high), high - low);
    Axis {
        is_log,
        centre: if is_log { centre.exp() } else { centre },
        deviation: 2.0 * width,
        longest: 0.15 * width,
        width: if is_log { 1.0 } else { 0.05 * width },
        evidence: EvidencePrior::Uniform { low, high },
        ..axis
    }
}

/// Axis of the size of an effect that is as large as the twin's own terms at `largest`.
pub(super) fn size_axis(parameter: &Parameter, largest: f64) -> Axis {
    Axis {
        centre: 0.0,
        deviation: 2.0 * largest,
        width: largest,
        longest: largest,
        evidence: EvidencePrior::Magnitude { largest },
        ..Axis::of(parameter)
    }
}
