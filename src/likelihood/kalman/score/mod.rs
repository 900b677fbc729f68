//! The gradient of the log-likelihood.

mod response;

use super::order::Order;
use super::pass::{Innovation, Sink};
use super::run::{Together, together};
use super::{Coordinates, FilterError, Kalman};
use crate::math::{LANES, Stencil};
use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;
pub(crate) use response::Responses;

/// Gradient of the log-likelihood in the [`Coordinates`] φ, by central differences (one-sided at a bound); d parameters, N samples.
///
/// ```text
/// s = Σ ∂ log p(y_k | y_0 … y_{k−1}) / ∂φ
/// fisher = Σ ∂e_kᵀ S_k⁻¹ ∂e_k + ½·tr(S_k⁻¹ ∂S_k S_k⁻¹ ∂S_k)             e, S: innovations and their covariances
/// ```
///
/// Where the twin is right at θ, s has mean zero, and fisher has the Fisher information as its mean. (The outer product of
/// the rows' gradients has the same mean there, but is much too large elsewhere, and steps by it too short.) Takes
/// 2·d + 1 passes over the record.
///
/// Source: Alsing & Wandelt, "Generalized massive optimal data compression" (2018), for the score as a summary.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// log p(y | θ), in nats.
    pub log_likelihood: f64,
    /// s, in nats per unit of φ (d).
    pub gradient: DVector<f64>,
    /// Information expected from the innovations' derivatives (d × d).
    pub fisher: DMatrix<f64>,
}

/// Steps of one-sided differences over those of central ones.
const FORWARD: f64 = 1e-2;

/// Log-density, innovation and covariance of each row.
struct ScoreRows {
    width: usize,
    values: DVector<f64>,
}

impl ScoreRows {
    fn new(kalman: &Kalman<'_>, order: &Order<'_>) -> Self {
        let p = kalman.channels;
        let width = 1 + p + p * p;
        Self {
            width,
            values: DVector::zeros(order.rows() * width),
        }
    }
}

impl Sink for ScoreRows {
    fn innovation(&mut self, i: usize, of: &Innovation<'_>) {
        let p = of.innovation.len();
        let row = &mut self.values.as_mut_slice()[i * self.width..(i + 1) * self.width];
        row[0] = of.log_density();
        row[1..=p].copy_from_slice(of.innovation);
        row[p + 1..].copy_from_slice(of.covariance);
    }
}

impl Score {
    /// At θ within the bounds, of a prepared record.
    ///
    /// # Errors
    ///
    /// As [`Kalman::log_likelihood`], also at the neighbours; [`FilterError::Difference`] for θ outside the bounds.
    pub fn at(kalman: &Kalman<'_>, theta: &[f64]) -> Result<Self, FilterError> {
        kalman.parameters.check_point(theta)?;
        let c = Coordinates::new(&kalman.parameters);
        let stencil = Stencil::new(&c.of(theta), c.steps(), c.lower(), c.upper())?;
        let order = Order::of(kalman, theta)?;
        let rows = |theta: &[f64]| rows(kalman, &order, theta);
        let jacobian = stencil.jacobian(|phi| rows(&c.theta(phi)).map(|(_, rows)| rows))?;
        let (log_likelihood, centre) = rows(theta)?;
        Self::assemble(kalman, log_likelihood, &centre, &jacobian)
    }

    /// As [`at`](Self::at), by one-sided differences with steps of a hundredth: d + 1 passes over the record instead of
    /// 2·d + 1. For searches, and for features. Small twins run all passes side by side. Entries that the coordinates hold have zeros.
    ///
    /// Such a difference is the slope half a step away. The information, which is the curvature where the twin is right, leads back: what is left
    /// is the half step times what both differ by. Without this, a clock or a limit cycle that many periods tell ends 0.7 deviations from its top.
    ///
    /// # Errors
    ///
    /// As [`at`](Self::at).
    pub fn forward(
        kalman: &Kalman<'_>,
        theta: &[f64],
        coordinates: &Coordinates,
    ) -> Result<Self, FilterError> {
        let found = side_by_side(std::slice::from_ref(kalman), theta, coordinates).pop();
        Self::or_one_by_one(found.flatten(), kalman, theta, coordinates)
    }

    /// As [`forward`](Self::forward), of several records of one twin at one θ: their passes run side by side, too. The same bits.
    #[doc(hidden)]
    pub fn forward_all(
        kalmans: &[Kalman<'_>],
        theta: &[f64],
        coordinates: &Coordinates,
    ) -> Vec<Result<Self, FilterError>> {
        if !kalmans.iter().all(|k| k.fits_beside(&kalmans[0])) {
            let each = |kalman| Self::forward(kalman, theta, coordinates);
            return kalmans.iter().map(each).collect();
        }
        let found = side_by_side(kalmans, theta, coordinates);
        (kalmans.iter().zip(found))
            .map(|(kalman, found)| Self::or_one_by_one(found, kalman, theta, coordinates))
            .collect()
    }

    /// The score that lanes found, or, where they cannot hold the filter, one pass after the other.
    fn or_one_by_one(
        found: Option<Self>,
        kalman: &Kalman<'_>,
        theta: &[f64],
        coordinates: &Coordinates,
    ) -> Result<Self, FilterError> {
        match found {
            Some(score) => Ok(score),
            None => Self::forward_one_by_one(kalman, theta, coordinates),
        }
    }

    /// As [`forward`](Self::forward), one pass after the other.
    #[doc(hidden)]
    pub fn forward_one_by_one(
        kalman: &Kalman<'_>,
        theta: &[f64],
        coordinates: &Coordinates,
    ) -> Result<Self, FilterError> {
        let order = Order::of(kalman, theta)?;
        let rows = |theta: &[f64]| rows(kalman, &order, theta);
        let (log_likelihood, centre) = rows(theta)?;
        let phi = coordinates.of(theta);
        let slope = |j: usize| {
            let (moved, distance) = coordinates.beside(&phi, j, FORWARD);
            let (_, there) = rows(&coordinates.theta(&moved))?;
            // Times of events are told so sharply that half a step counts: the other side takes it away.
            let (back, behind) = coordinates.beside(&phi, j, -FORWARD);
            let is_central =
                kalman.twin.has_events() && distance > 0.0 && back[j] >= coordinates.lower()[j];
            let (other, behind) = match is_central {
                true => (&rows(&coordinates.theta(&back))?.1, behind),
                false => (&centre, 0.0),
            };
            let slope = (there - other) / (distance - behind);
            Ok((slope, 0.5 * (distance + behind)))
        };
        let free = coordinates.free();
        // Passes that wait for exchanges wait together.
        let slopes: Result<Vec<(DVector<f64>, f64)>, FilterError> = match kalman.twin.beside() {
            1 => free.iter().map(|j| slope(*j)).collect(),
            _ => free.par_iter().map(|j| slope(*j)).collect(),
        };
        let slopes = slopes?;
        let mut jacobian = DMatrix::zeros(centre.len(), phi.len());
        for (&j, (slope, _)) in free.iter().zip(&slopes) {
            jacobian.set_column(j, slope);
        }
        let found = Self::assemble(kalman, log_likelihood, &centre, &jacobian)?;
        let middles = slopes.iter().map(|(_, middle)| *middle);
        Ok(found.led_back(coordinates, free.into_iter().zip(middles)))
    }

    /// Leads slopes, each taken at a distance along its entry, back to the centre.
    fn led_back(
        mut self,
        coordinates: &Coordinates,
        middles: impl IntoIterator<Item = (usize, f64)>,
    ) -> Self {
        for (j, distance) in middles {
            if coordinates.leads_back(j) {
                self.gradient[j] += distance * self.fisher[(j, j)];
            }
        }
        self
    }

    /// From derivatives of log-densities and of innovations and variances, both in standard deviations.
    fn of_one_output(
        log_likelihood: f64,
        samples: &DMatrix<f64>,
        changes: [&DMatrix<f64>; 2],
    ) -> Self {
        let [shift, spread] = changes;
        Self {
            log_likelihood,
            gradient: samples.row_sum_tr(),
            fisher: shift.tr_mul(shift) + spread.tr_mul(spread) * 0.5,
        }
    }

    fn assemble(
        kalman: &Kalman<'_>,
        log_likelihood: f64,
        centre: &DVector<f64>,
        jacobian: &DMatrix<f64>,
    ) -> Result<Self, FilterError> {
        let p = kalman.channels;
        let (d, width) = (jacobian.ncols(), 1 + p + p * p);
        let n = centre.len() / width;
        let before = n - kalman.record.samples();
        let samples = DMatrix::from_fn(n, d, |k, j| jacobian[(k * width, j)]);
        let fisher = if p == 1 {
            let scale = |k: usize| centre[k * width + 2];
            let shift =
                DMatrix::from_fn(n, d, |k, j| jacobian[(k * width + 1, j)] / scale(k).sqrt());
            let change = DMatrix::from_fn(n, d, |k, j| jacobian[(k * width + 2, j)] / scale(k));
            let changes = [&shift, &change];
            return Ok(Self::of_one_output(log_likelihood, &samples, changes));
        } else {
            let mut fisher = DMatrix::zeros(d, d);
            for k in 0..n {
                let (at, end) = (k * width + 1, (k + 1) * width);
                add_information(
                    &centre.as_slice()[at + p..end],
                    &jacobian.rows(at, p + p * p),
                    &mut fisher,
                )
                .ok_or_else(|| FilterError::NoSpread {
                    at: kalman.record.drive().time(k.saturating_sub(before)),
                })?;
            }
            fisher
        };
        Ok(Self {
            log_likelihood,
            gradient: samples.row_sum_tr(),
            fisher,
        })
    }
}

/// One-sided scores by lanes; `None` where these cannot hold a filter.
fn side_by_side(
    kalmans: &[Kalman<'_>],
    theta: &[f64],
    coordinates: &Coordinates,
) -> Vec<Option<Score>> {
    if kalmans.iter().any(|kalman| kalman.check(theta).is_err()) {
        return kalmans.iter().map(|_| None).collect();
    }
    let phi = coordinates.of(theta);
    let moves: Vec<Move> = (coordinates.free().into_iter())
        .map(|entry| {
            let (moved, distance) = coordinates.beside(&phi, entry, FORWARD);
            Move {
                entry,
                theta: coordinates.theta(&moved),
                distance,
            }
        })
        .collect();
    let moved = moves.iter().map(|to| &to.theta[..]);
    let thetas: Vec<&[f64]> = std::iter::once(theta).chain(moved).collect();
    let all: Vec<(&Kalman<'_>, &[f64])> = (kalmans.iter())
        .flat_map(|kalman| thetas.iter().map(move |theta| (kalman, *theta)))
        .collect();
    let lanes = lanes_of(kalmans);
    let runs: Vec<Option<Together>> = match kalmans.first().map_or(1, |kalman| kalman.twin.beside())
    {
        1 => all.chunks(lanes).map(together).collect(),
        _ => all.par_chunks(lanes).map(together).collect(),
    };
    (0..kalmans.len())
        .map(|r| {
            let each: Option<Vec<(&Together, usize)>> = (r * thetas.len()..(r + 1) * thetas.len())
                .map(|job| {
                    let run = runs[job / lanes].as_ref()?;
                    Some((run, run.lane(job % lanes)?))
                })
                .collect();
            let score = of_lanes(&each?, &moves, phi.len());
            let middles = moves.iter().map(|to| (to.entry, 0.5 * to.distance));
            Some(score.led_back(coordinates, middles))
        })
        .collect()
}

/// Number of passes that go in lanes of one: where each waits for exchanges that passes share, and lanes would ask one after the other, one.
fn lanes_of(kalmans: &[Kalman<'_>]) -> usize {
    match kalmans {
        [one] if one.twin.beside() > 1 && one.twin.joins_lanes() => LANES,
        [one, ..] if one.twin.beside() > 1 => 1,
        _ => LANES,
    }
}

/// A point beside θ.
struct Move {
    /// The entry that differs.
    entry: usize,
    /// Its move in φ.
    distance: f64,
    theta: Vec<f64>,
}

/// Score of a record from its lanes at θ and at the points beside it; d parameters.
fn of_lanes(each: &[(&Together, usize)], moves: &[Move], d: usize) -> Score {
    let (centre, c) = each[0];
    let n = centre.rows.len();
    let [mut samples, mut shifts, mut spreads] = [(); 3].map(|()| DMatrix::zeros(n, d));
    // Reciprocals of variance and deviation.
    let scales: Vec<[f64; 2]> = (centre.rows.iter())
        .map(|[_, s]| [1.0 / s.0[c], 1.0 / s.0[c].sqrt()])
        .collect();
    for ((moved, m), to) in each[1..].iter().zip(moves) {
        let (m, j) = (*m, to.entry);
        let rows = (centre.rows.iter().zip(&moved.rows)).zip(&scales);
        let [samples, shifts, spreads] = [&mut samples, &mut shifts, &mut spreads]
            .map(|of| of.as_mut_slice()[j * n..(j + 1) * n].iter_mut());
        let results = samples.zip(shifts).zip(spreads);
        let per_distance = 1.0 / to.distance;
        for (([[e, _], [e_moved, s_moved]], [per_s, per_sd]), ((sample, shift), spread)) in
            rows.map(|((a, b), scale)| ([a, b], scale)).zip(results)
        {
            let (e, e_moved, s_moved) = (e.0[c], e_moved.0[m], s_moved.0[m]);
            let ratio = s_moved * per_s;
            let square = e_moved * e_moved / s_moved - e * e * per_s;
            *sample = -0.5 * (ln_near_one(ratio) + square) * per_distance;
            *shift = (e_moved - e) * per_distance * per_sd;
            *spread = (ratio - 1.0) * per_distance;
        }
    }
    let log_likelihood = centre.log_likelihoods.0[c];
    Score::of_one_output(log_likelihood, &samples, [&shifts, &spreads])
}

/// ln, by its series where it is short.
#[inline(always)]
fn ln_near_one(ratio: f64) -> f64 {
    let s = (ratio - 1.0) / (ratio + 1.0);
    let s2 = s * s;
    if s2 < 1e-6 {
        2.0 * s * (1.0 + s2 * (1.0 / 3.0 + s2 * (0.2 + s2 / 7.0)))
    } else {
        ratio.ln()
    }
}

/// One row's part of the expected information; `change` holds the derivatives of innovation and covariance.
fn add_information(
    covariance: &[f64],
    change: &DMatrixView<'_, f64>,
    fisher: &mut DMatrix<f64>,
) -> Option<()> {
    let p = change.nrows() - covariance.len();
    let inverse = (DMatrix::from_column_slice(p, p, covariance).cholesky())?.inverse();
    let parts: Vec<_> = (change.column_iter())
        .map(|of| {
            let shift = of.rows(0, p).into_owned();
            let spread = DMatrix::from_iterator(p, p, of.rows(p, p * p).iter().copied());
            (&inverse * &shift, shift, &inverse * spread)
        })
        .collect();
    for (i, (weighed, _, spread)) in parts.iter().enumerate() {
        for (j, (_, shift, other)) in parts.iter().enumerate() {
            fisher[(i, j)] += weighed.dot(shift) + 0.5 * spread.tr_dot(other);
        }
    }
    Some(())
}

fn rows(
    kalman: &Kalman<'_>,
    order: &Order<'_>,
    theta: &[f64],
) -> Result<(f64, DVector<f64>), FilterError> {
    let mut rows = ScoreRows::new(kalman, order);
    let sink: &mut dyn Sink = &mut rows;
    let log_likelihood = kalman.run_in(order, theta, sink)?;
    Ok((log_likelihood, rows.values))
}
