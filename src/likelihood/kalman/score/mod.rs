//! The gradient of the log-likelihood.

mod response;

use super::order::Order;
use super::pass::{AnyPass, FilterJob, Innovation, Sink};
use super::run::{LaneRows, SideBySide};
use super::{Coordinates, FilterError, Kalman};
use crate::math::{LANES, Lanes, Stencil};
use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;
pub(crate) use response::Responses;
use std::ops::Range;

/// Gradient of the log-likelihood in the [`Coordinates`] φ, by central differences (one-sided at a bound); d parameters, N samples.
///
/// ```text
/// s = Σ ∂ log p(y_k | y_0 … y_{k−1}) / ∂φ
/// fisher = Σ ∂e_kᵀ S_k⁻¹ ∂e_k + ½·tr(S_k⁻¹ ∂S_k S_k⁻¹ ∂S_k)             e, S: innovations and their covariances
/// ```
///
/// Readings at an end of a range, rounded ones and possible outliers tell less of their signal than noise alone would let them. That is in S_k, and not in its
/// change: ∂S_k is that of the signal with noise.
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

/// Rows of a block: their values at eight points fill a tenth of a core's cache. Half or twice as many take the same time.
const BLOCK: usize = 512;

/// The blocks of a record, one after the other.
fn blocks(rows: usize) -> impl Iterator<Item = Range<usize>> {
    (0..rows)
        .step_by(BLOCK)
        .map(move |first| first..(first + BLOCK).min(rows))
}

/// A derivative by one entry of φ, from two passes.
struct Slope {
    entry: usize,
    /// The points, as their numbers in a list, and how far they are apart.
    points: [usize; 2],
    distance: f64,
    /// Where between the points the slope is taken.
    middle: f64,
}

/// Log-density of each row of a block, innovation and covariance as of a signal with noise alone, and the variances with which it was seen.
struct ScoreRows {
    first: usize,
    width: usize,
    values: DVector<f64>,
}

impl ScoreRows {
    fn of(rows: Range<usize>, p: usize) -> Self {
        let width = 1 + 2 * p + p * p;
        Self {
            first: rows.start,
            width,
            values: DVector::zeros(rows.len() * width),
        }
    }
}

impl Sink for ScoreRows {
    fn innovation(&mut self, i: usize, of: &Innovation<'_>) {
        let (p, at) = (of.innovation.len(), (i - self.first) * self.width);
        let row = &mut self.values.as_mut_slice()[at..at + self.width];
        row[0] = of.log_density();
        let [innovation, variances] = of.plain;
        row[1..=p].copy_from_slice(innovation);
        let (covariance, seen) = row[p + 1..].split_at_mut(p * p);
        covariance.copy_from_slice(of.covariance);
        for j in 0..p {
            covariance[j * p + j] = variances[j];
            seen[j] = of.covariance[j * p + j];
        }
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
        let points: Vec<Vec<f64>> = (stencil.points().iter()).map(|phi| c.theta(phi)).collect();
        let thetas: Vec<&[f64]> = [theta]
            .into_iter()
            .chain(points.iter().map(|p| &p[..]))
            .collect();
        Self::of_passes(kalman, &thetas, theta.len(), |values| {
            stencil.assemble(&values[1..])
        })
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
        kalman.check(theta)?;
        let phi = coordinates.of(theta);
        let mut thetas = vec![theta.to_vec()];
        let mut slopes = vec![];
        for entry in coordinates.free() {
            let mut point = |share: f64| {
                let (moved, distance) = coordinates.beside(&phi, entry, share);
                thetas.push(coordinates.theta(&moved));
                (thetas.len() - 1, distance)
            };
            let (there, distance) = point(FORWARD);
            // Times of events are told so sharply that half a step counts: the other side takes it away.
            let (back, _) = coordinates.beside(&phi, entry, -FORWARD);
            let is_central = kalman.twin.has_events()
                && distance > 0.0
                && back[entry] >= coordinates.lower()[entry];
            let (other, behind) = match is_central {
                true => point(-FORWARD),
                false => (0, 0.0),
            };
            slopes.push(Slope {
                entry,
                points: [there, other],
                distance: distance - behind,
                middle: 0.5 * (distance + behind),
            });
        }
        let thetas: Vec<&[f64]> = thetas.iter().map(|theta| &theta[..]).collect();
        let found = Self::of_passes(kalman, &thetas, phi.len(), |values| {
            let mut jacobian = DMatrix::zeros(values[0].len(), phi.len());
            for of in &slopes {
                let [there, other] = of.points.map(|point| &values[point]);
                jacobian.set_column(of.entry, &((there - other) / of.distance));
            }
            jacobian
        })?;
        Ok(found.led_back(coordinates, slopes.iter().map(|of| (of.entry, of.middle))))
    }

    /// From passes at points of which the first is θ: `jacobian` has the derivatives of the rows' values from those at the points.
    ///
    /// All passes go through a block of rows before the next: what a record needs at once does not grow with its length.
    fn of_passes(
        kalman: &Kalman<'_>,
        thetas: &[&[f64]],
        d: usize,
        jacobian: impl Fn(&[DVector<f64>]) -> DMatrix<f64>,
    ) -> Result<Self, FilterError> {
        let order = Order::of(kalman, thetas[0])?;
        let jobs: Vec<[FilterJob<'_>; 1]> = (thetas.iter())
            .map(|theta| Ok([kalman.job(&order, theta)?]))
            .collect::<Result<_, FilterError>>()?;
        let mut passes: Vec<_> = jobs.iter().map(|job| kalman.pass(job)).collect();
        let mut score = Self::of_no_rows(d);
        for rows in blocks(order.rows()) {
            let values = |(pass, theta): (&mut Box<dyn AnyPass<f64> + '_>, &&[f64])| {
                let mut to = ScoreRows::of(rows.clone(), kalman.channels);
                let run = pass.run_to(rows.end, &mut to);
                run.map_err(|error| kalman.reason_of(error, theta))?;
                Ok(to.values)
            };
            // Passes that wait for exchanges wait together.
            let values: Result<Vec<DVector<f64>>, FilterError> = match kalman.twin.beside() {
                1 => passes.iter_mut().zip(thetas).map(values).collect(),
                _ => passes.par_iter_mut().zip(thetas).map(values).collect(),
            };
            let values = values?;
            (score.add_rows(&values[0], &jacobian(&values), kalman.channels)).map_err(|i| {
                let k = order.state_of(rows.start + i);
                FilterError::NoSpread {
                    at: kalman.record.drive().time(k),
                }
            })?;
        }
        score.log_likelihood = passes[0].log_likelihood();
        Ok(score)
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

    fn of_no_rows(d: usize) -> Self {
        Self {
            log_likelihood: 0.0,
            gradient: DVector::zeros(d),
            fisher: DMatrix::zeros(d, d),
        }
    }

    /// Adds rows by derivatives of log-densities and of innovations and variances, both in standard deviations.
    fn add_one_output(&mut self, samples: &DMatrix<f64>, changes: [&DMatrix<f64>; 2]) {
        let [shift, spread] = changes;
        self.gradient += samples.row_sum_tr();
        self.fisher.gemm_tr(1.0, shift, shift, 1.0);
        self.fisher.gemm_tr(0.5, spread, spread, 1.0);
    }

    /// With rows that lanes found at θ and at the points beside it.
    fn with_lanes(mut self, each: &[(&LaneRows, usize)], moves: &[Move]) -> Self {
        let (centre, c) = each[0];
        let (n, d) = (centre.0.len(), self.gradient.len());
        let [mut samples, mut shifts, mut spreads] = [(); 3].map(|()| DMatrix::zeros(n, d));
        // Reciprocals of variance and deviation.
        let scales: Vec<[f64; 2]> = (centre.0.iter())
            .map(|row| row.seen[1].0[c])
            .map(|s| [1.0 / s, 1.0 / s.sqrt()])
            .collect();
        for ((moved, m), to) in each[1..].iter().zip(moves) {
            let (m, j) = (*m, to.entry);
            let rows = (centre.0.iter().zip(&moved.0)).zip(&scales);
            let [samples, shifts, spreads] = [&mut samples, &mut shifts, &mut spreads]
                .map(|of| of.as_mut_slice()[j * n..(j + 1) * n].iter_mut());
            let results = samples.zip(shifts).zip(spreads);
            let per_distance = 1.0 / to.distance;
            for (((here, there), [per_s, per_sd]), ((sample, shift), spread)) in rows.zip(results) {
                let [e, _, excess] = here.seen.map(|of| of.0[c]);
                let [e_moved, s_moved, excess_moved] = there.seen.map(|of| of.0[m]);
                let square = e_moved * e_moved / s_moved - e * e * per_s;
                let log = 0.5 * (ln_near_one(s_moved * per_s) + square);
                *sample = (excess_moved - excess - log) * per_distance;
                let [e, s] = here.plain.map(|of| of.0[c]);
                let [e_moved, s_moved] = there.plain.map(|of| of.0[m]);
                *shift = (e_moved - e) * per_distance * per_sd;
                *spread = (s_moved - s) * per_distance * per_s;
            }
        }
        self.add_one_output(&samples, [&shifts, &spreads]);
        self
    }

    /// Adds rows by their values and the derivatives of these; fails with the row whose innovations have no spread.
    fn add_rows(
        &mut self,
        centre: &DVector<f64>,
        jacobian: &DMatrix<f64>,
        p: usize,
    ) -> Result<(), usize> {
        let (d, width) = (jacobian.ncols(), 1 + 2 * p + p * p);
        let n = centre.len() / width;
        let samples = DMatrix::from_fn(n, d, |k, j| jacobian[(k * width, j)]);
        if p == 1 {
            let scale = |k: usize| centre[k * width + 3];
            let shift =
                DMatrix::from_fn(n, d, |k, j| jacobian[(k * width + 1, j)] / scale(k).sqrt());
            let change = DMatrix::from_fn(n, d, |k, j| jacobian[(k * width + 2, j)] / scale(k));
            self.add_one_output(&samples, [&shift, &change]);
            return Ok(());
        }
        self.gradient += samples.row_sum_tr();
        for k in 0..n {
            let at = k * width + 1;
            let row = &centre.as_slice()[at + p..(k + 1) * width];
            let mut covariance = DMatrix::from_column_slice(p, p, &row[..p * p]);
            covariance.set_diagonal(&DVector::from_column_slice(&row[p * p..]));
            let change = &jacobian.rows(at, p + p * p);
            add_information(covariance, change, &mut self.fisher).ok_or(k)?;
        }
        Ok(())
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
    let held: Vec<_> = all.chunks(lanes).map(SideBySide::of).collect();
    let mut passes: Vec<Option<LanePass<'_>>> = (held.iter())
        .map(|held| held.as_ref().map(SideBySide::pass))
        .collect();
    // Pass and lane of each filter of a record.
    let place = |job: usize| Some((job / lanes, held[job / lanes].as_ref()?.lane(job % lanes)?));
    let places: Vec<Option<Vec<(usize, usize)>>> = (0..kalmans.len())
        .map(|record| record * thetas.len()..(record + 1) * thetas.len())
        .map(|jobs| jobs.map(place).collect())
        .collect();
    let mut scores: Vec<Option<Score>> = (places.iter())
        .map(|places| places.as_ref().map(|_| Score::of_no_rows(phi.len())))
        .collect();
    let (beside, samples) = (kalmans.first()).map_or((1, 0), |kalman| {
        (kalman.twin.beside(), kalman.record.samples())
    });
    for rows in blocks(samples) {
        let values = |pass: &mut Option<LanePass<'_>>| {
            let mut to = LaneRows::default();
            let run = pass.as_mut()?.run_to(rows.end, &mut to);
            *pass = pass.take().filter(|_| run.is_ok());
            pass.as_ref().map(|_| to)
        };
        let values: Vec<Option<LaneRows>> = match beside {
            1 => passes.iter_mut().map(values).collect(),
            _ => passes.par_iter_mut().map(values).collect(),
        };
        for (score, places) in scores.iter_mut().zip(&places) {
            let rows = |&(pass, lane): &(usize, usize)| Some((values[pass].as_ref()?, lane));
            let each = |places: &Vec<(usize, usize)>| places.iter().map(rows).collect();
            let each: Option<Vec<(&LaneRows, usize)>> = places.as_ref().and_then(each);
            *score = each.and_then(|each| Some(score.take()?.with_lanes(&each, &moves)));
        }
    }
    let log_likelihood = |&(pass, lane): &(usize, usize)| {
        let values = passes[pass].as_ref()?.log_likelihood();
        Some(values.0[lane]).filter(|value| value.is_finite())
    };
    (scores.into_iter().zip(&places))
        .map(|(score, places)| {
            let mut score = score?;
            let all = places.as_ref()?.iter().map(log_likelihood);
            score.log_likelihood = all.collect::<Option<Vec<f64>>>()?[0];
            let middles = moves.iter().map(|to| (to.entry, 0.5 * to.distance));
            Some(score.led_back(coordinates, middles))
        })
        .collect()
}

type LanePass<'p> = Box<dyn AnyPass<Lanes> + 'p>;

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
    covariance: DMatrix<f64>,
    change: &DMatrixView<'_, f64>,
    fisher: &mut DMatrix<f64>,
) -> Option<()> {
    let p = covariance.nrows();
    let inverse = covariance.cholesky()?.inverse();
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
