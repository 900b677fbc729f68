//! Dictionary of candidates: magnitudes to try, in the units of the record.

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::hypotheses::candidate::{Addition, Candidate};
use crate::diagnose::hypotheses::choice::product;
use crate::diagnose::hypotheses::plan::{Lead, Plan, Planner};
use crate::diagnose::hypotheses::scales::Scales;
use crate::diagnose::hypotheses::variant::Variant;
use crate::diagnose::thresholds::Thresholds;
use crate::fit::problem::Problem;
use crate::fit::reference::{Gain, Reference};
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::twin::Twin;
use rayon::prelude::*;

/// One point to try.
#[derive(Debug, Clone)]
pub(in crate::diagnose) struct Point {
    /// Index among the variants.
    pub variant: usize,
    /// Free magnitudes.
    pub m: Vec<f64>,
    /// Multiples of the secant that make sense.
    pub range: (f64, f64),
    /// True where a multiple of the secant is that multiple of the first magnitude.
    pub linear: bool,
}

/// All points, and the twins to try them with.
pub(in crate::diagnose) struct Dictionary {
    pub candidates: Vec<Candidate>,
    pub variants: Vec<Variant>,
    pub points: Vec<Point>,
}

impl Dictionary {
    /// Plans and tries the points of all candidates on the twin `study` with the effects `accepted`; `problem` and `reference` are that twin's.
    pub fn new(
        study: &Twin,
        accepted: &[Addition],
        candidates: Vec<Candidate>,
        problem: &Problem<'_>,
        theta: &[f64],
        reference: &Reference,
        scales: &Scales<'_>,
    ) -> Result<Self, DiagnoseError> {
        let planner = Planner {
            study,
            accepted,
            problem,
            scales,
            // With effects added, it is enough to see that something is left.
            coarse: !accepted.is_empty(),
        };
        let mut plans: Vec<Plan> = Vec::new();
        for (index, candidate) in candidates.iter().enumerate() {
            plans.extend(planner.plans(index, candidate)?);
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
                let visibility = |first: f64| -> Result<Option<f64>, FilterError> {
                    let m: Vec<f64> = [first].into_iter().chain(shape.iter().copied()).collect();
                    let of = plan.variant.problem(problem);
                    let there = recoverable(of.filtered(
                        &of.full(&plan.variant.theta(&problem.of_record(0, theta), &m)),
                    ))?;
                    Ok(there.map(|there| reference.direction(&there).norm_squared()))
                };
                let lead_point = try_lead(lead, visibility)?;
                Ok(lead_point.map(|(first, linear)| Point {
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
        (self.points.par_iter())
            .map(|point| {
                let (of, full) = self.at(problem, theta, point);
                let there = recoverable(of.filtered(&full))?;
                Ok(there.map_or(Gain::default(), |there| {
                    reference.gain(&reference.direction(&there), point.range)
                }))
            })
            .collect()
    }

    /// The twin with the effect of a point, and its full θ there.
    pub fn at<'a>(
        &self,
        problem: &Problem<'a>,
        theta: &[f64],
        point: &Point,
    ) -> (Problem<'a>, Vec<f64>) {
        self.variants[point.variant].at(problem, theta, &point.m)
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

/// Finds the first magnitude to visibility at; `None` where nothing can be seen or filtered. Also whether it is linear.
fn try_lead(
    lead: Lead,
    visibility: impl Fn(f64) -> Result<Option<f64>, FilterError>,
) -> Result<Option<(f64, bool)>, FilterError> {
    let seen = |q: f64| q.is_finite() && q > 1e-6;
    match lead {
        Lead::At(value) => Ok(visibility(value)?
            .filter(|q| seen(*q))
            .map(|_| (value, false))),
        Lead::Shrink(mut value) => {
            for _ in 0..12 {
                match visibility(value)? {
                    Some(q) if q <= Thresholds::COARSE => {
                        return Ok(seen(q).then_some((value, false)));
                    }
                    _ => value *= 0.5,
                }
            }
            Ok(None)
        }
        Lead::Visible { guess, linear } => {
            let mut value = guess;
            for _ in 0..20 {
                let factor = match visibility(value)? {
                    Some(q)
                        if (0.3 * Thresholds::VISIBLE..=4.0 * Thresholds::VISIBLE).contains(&q) =>
                    {
                        return Ok(Some((value, linear)));
                    }
                    // Between the powers of a shift (2) and of a variance (4).
                    Some(q) if q.is_finite() => (Thresholds::VISIBLE / q.max(1e-12))
                        .powf(0.3)
                        .clamp(0.05, 20.0),
                    _ => 0.1,
                };
                value *= factor;
            }
            Ok(None)
        }
    }
}
