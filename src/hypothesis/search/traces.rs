//! Screen of functions of traces: from first-order responses, without a filter's pass for any of them.
//!
//! ```text
//! X = [φ_1(z), φ_2(z), …] passed through the responses, standardised      b = Xᵀr,  F = XᵀX,  θ projected out of both
//! ```
//!
//! The best time constant or width of each pair of variable and place, and of these the best few, are then weighed as other functions are.

use super::breadth::Breadth;
use super::model::Model;
use crate::fit::evidence::linear_evidence;
use crate::fit::reference::Reference;
use crate::hypothesis::basis::{Of, TERMS, terms_of_one};
use crate::hypothesis::entry::Entry;
use crate::hypothesis::term::Term;
use crate::hypothesis::trace::Trail;
use crate::likelihood::kalman::{FilterError, Responses, recoverable};
use crate::math::{descending, log_mean};
use crate::parallel::each;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Functions of traces that were screened.
#[derive(Default)]
pub(super) struct ScreenedTraces {
    /// Those to be weighed, and functions that need no screen.
    pub kept: Vec<Arc<Term>>,
    /// The best of each other pair of variable and place, with its nats.
    pub others: Vec<(Arc<Term>, f64)>,
    /// Nats by which the best of a grid is better than the grid: its time constants or widths share one prior.
    pub ways: BTreeMap<String, f64>,
}

/// Screens functions of traces beside a model, and keeps so many of those that promise enough.
pub(super) fn screened(
    model: &Model,
    reference: Option<&Reference>,
    terms: Vec<Arc<Term>>,
    breadth: Breadth,
) -> Result<ScreenedTraces, FilterError> {
    let (traced, kept): (Vec<_>, Vec<_>) = (terms.into_iter()).partition(|t| t.trail.is_some());
    let theta = &model.fitted.theta;
    let responses = recoverable(model.problem.responses(theta))?.unwrap_or_default();
    let Some(reference) = reference.filter(|_| !responses.is_empty()) else {
        // Without equations there are few, and all are weighed.
        let kept = match model.problem.is_simulated() {
            true => [kept, traced].concat(),
            false => kept,
        };
        return Ok(ScreenedTraces {
            kept,
            ..ScreenedTraces::default()
        });
    };
    let screen = TraceScreen::new(model, reference, &responses);
    let gains = screen.gains(&traced);
    let mut grids: BTreeMap<String, Vec<(Arc<Term>, f64)>> = BTreeMap::new();
    for (term, gain) in traced.into_iter().zip(gains) {
        let grid = grids.entry(term.key()).or_default();
        grid.push((term, gain));
    }
    let (mut best, mut ways) = (vec![], BTreeMap::new());
    for (key, mut grid) in grids {
        descending(&mut grid, |a| a.1);
        let all: Vec<f64> = grid.iter().map(|(_, gain)| *gain).collect();
        if all[0].is_finite() {
            ways.insert(key, all[0] - log_mean(&all));
            best.extend(grid.into_iter().next());
        }
    }
    descending(&mut best, |a| a.1);
    let is_worth = |(_, gain): &&(Arc<Term>, f64)| *gain > breadth.least;
    let most = best.iter().take(breadth.functions).take_while(is_worth);
    let others = best.split_off(most.count());
    let chosen = best.into_iter().map(|(term, _)| term);
    Ok(ScreenedTraces {
        kept: kept.into_iter().chain(chosen).collect(),
        others,
        ways,
    })
}

/// Innovations of a model, ready to be compared with responses.
struct TraceScreen<'s> {
    reference: &'s Reference,
    responses: &'s [Responses],
    /// Step of each record.
    steps: Vec<f64>,
    /// Directions of θ, row by row, and standardised innovations; without those of variances.
    directions: Vec<f64>,
    residual: Vec<f64>,
}

impl<'s> TraceScreen<'s> {
    fn new(model: &Model, reference: &'s Reference, responses: &'s [Responses]) -> Self {
        let (directions, residual) = reference.of_means();
        let records = model.problem.records.iter();
        Self {
            reference,
            responses,
            steps: records.map(|r| r.drive().dt()).collect(),
            directions: directions.transpose().as_slice().to_vec(),
            residual: residual.as_slice().to_vec(),
        }
    }

    /// Nats of each function. Those of one trace share its values: they stand side by side.
    fn gains(&self, terms: &[Arc<Term>]) -> Vec<f64> {
        let source = |term: &Arc<Term>| term.trail.map(|t| (t.of, t.trace, t.ends));
        let groups = terms.chunk_by(|a, b| source(a) == source(b));
        let gains = each(groups, |group| -> Vec<f64> {
            let courses = group[0].trail.map(|trail| self.courses(&trail));
            let gain = |term: &Arc<Term>| self.gain(term, courses.as_deref()?);
            (group.iter())
                .map(|term| gain(term).unwrap_or(f64::NEG_INFINITY))
                .collect()
        });
        gains.concat()
    }

    /// Terms of a function along each record, sample by sample.
    fn courses(&self, trail: &Trail) -> Vec<Vec<f64>> {
        let records = self.responses.iter().zip(&self.steps);
        records
            .map(|(responses, dt)| {
                let (signals, column) = match trail.of {
                    Of::State(i) => (&responses.states, i),
                    Of::Input(i) => (&responses.inputs, i),
                    Of::Output(j) => (&responses.outputs, j),
                    Of::Signal | Of::Time => return vec![],
                };
                let values: Vec<f64> = signals.column(column).to_vec();
                let trace = trail.trace.of(&values, *dt).into_iter();
                trace.flat_map(|z| terms_of_one(z, trail.ends)).collect()
            })
            .collect()
    }

    /// Nats of a function, to second order; none where it has no finite answer.
    fn gain(&self, term: &Term, courses: &[Vec<f64>]) -> Option<f64> {
        let (trail, (weights, largest)) = (term.trail?, term.family.as_ref()?);
        let answers = self.answers(trail.entry, courses);
        let d = self.directions.len() / self.residual.len();
        let mut slope = DVector::zeros(TERMS);
        let mut information = DMatrix::zeros(TERMS, TERMS);
        let mut with_theta = DMatrix::zeros(d, TERMS);
        let rows = answers.chunks_exact(TERMS).zip(&self.residual);
        for (row, (x, residual)) in rows.enumerate() {
            let direction = &self.directions[row * d..][..d];
            for (a, x_a) in x.iter().enumerate() {
                slope[a] += x_a * residual;
                for (b, x_b) in x[..=a].iter().enumerate() {
                    information[(a, b)] += x_a * x_b;
                }
                for (j, direction) in direction.iter().enumerate() {
                    with_theta[(j, a)] += direction * x_a;
                }
            }
        }
        information.fill_upper_triangle_with_lower_triangle();
        slope -= with_theta.tr_mul(self.reference.step());
        information -= with_theta.tr_mul(&self.reference.solved(&with_theta));
        let is_finite = information
            .iter()
            .chain(slope.iter())
            .all(|v| v.is_finite());
        is_finite.then(|| linear_evidence(&slope, &information, (weights, *largest)))
    }

    /// Changes of the standardised predictions by each term of a function, row by row.
    fn answers(&self, entry: Entry, courses: &[Vec<f64>]) -> Vec<f64> {
        let p = self.reference.channels();
        let mut all = vec![0.0; self.residual.len() * TERMS];
        let mut first = 0;
        for (responses, courses) in self.responses.iter().zip(courses) {
            responses.of(entry, (TERMS, courses), |k, j, changes| {
                let row = first + k;
                for i in j..p {
                    let factor = self.reference.inverse_root(row, i, j);
                    let to = &mut all[(row * p + i) * TERMS..][..TERMS];
                    for (to, change) in to.iter_mut().zip(changes) {
                        *to += factor * change;
                    }
                }
            });
            first += responses.samples();
        }
        all
    }
}
