//! Importance sampling in φ: proposals about tops, weighed draws, and proposals that follow these.
//!
//! Source: Cappé, Guillin, Marin & Robert, "Population Monte Carlo" (2004).

use crate::fit::budget::BUDGET;
use crate::fit::climb::Fitted;
use crate::fit::problem::Problem;
use crate::likelihood::kalman::FilterError;
use crate::math::log_mean;
use crate::parallel::try_each;
use crate::twin::Source;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{PI, TAU};

/// Degrees of freedom of a proposal: heavier tails than a posterior's.
const FREEDOM: usize = 5;

/// Hermite polynomials of degree 1 to 4, of unit variance under a standard normal.
const HERMITE: [fn(f64) -> f64; 4] = [
    |z| z,
    |z| (z * z - 1.0) / 2f64.sqrt(),
    |z| (z * z - 3.0) * z / 6f64.sqrt(),
    |z| ((z * z - 6.0) * z * z + 3.0) / 24f64.sqrt(),
];

/// A Student density about one top, in the entries of φ that may move.
#[derive(Debug, Clone)]
pub(in crate::fit) struct Proposal {
    /// Entries that may move.
    pub free: Vec<usize>,
    /// The whole of φ.
    pub centre: DVector<f64>,
    /// Covariance of the posterior that it stands for, among the entries that may move.
    pub covariance: DMatrix<f64>,
    root: DMatrix<f64>,
    /// log of the density at the centre, and that of the normal with this covariance.
    log_peak: f64,
    normal_peak: f64,
}

impl Proposal {
    /// The proposal about the end of a search, from its information.
    pub fn around(problem: &Problem, fit: &Fitted) -> Option<Self> {
        let free: Vec<usize> = (0..fit.theta.len())
            .filter(|&j| !problem.axes[j].held)
            .collect();
        let information = fit.information.select_rows(&free).select_columns(&free);
        let centre = DVector::from_vec(problem.coordinates.of(&fit.theta));
        Self::new(free, centre, information.try_inverse()?)
    }

    /// None where nothing may move, or where the covariance has no root.
    pub fn new(free: Vec<usize>, centre: DVector<f64>, covariance: DMatrix<f64>) -> Option<Self> {
        if free.is_empty() {
            return None;
        }
        let root = covariance.clone().cholesky()?.l();
        let (nu, d) = (FREEDOM as f64, free.len() as f64);
        let gamma = statrs::function::gamma::ln_gamma;
        let log_determinant: f64 = root.diagonal().map(f64::ln).sum();
        Some(Self {
            log_peak: gamma(0.5 * (nu + d))
                - gamma(0.5 * nu)
                - 0.5 * d * (nu * PI).ln()
                - log_determinant,
            normal_peak: -0.5 * d * TAU.ln() - log_determinant,
            free,
            centre,
            covariance,
            root,
        })
    }

    /// The same proposal among some of its entries, others where `phi` has them.
    pub fn within(&self, free: &[usize], phi: &DVector<f64>) -> Option<Self> {
        let places: Vec<usize> = (free.iter())
            .filter_map(|j| self.free.iter().position(|own| own == j))
            .collect();
        let covariance = self.covariance.select_rows(&places).select_columns(&places);
        let mut centre = phi.clone();
        for &j in free {
            centre[j] = self.centre[j];
        }
        (places.len() == free.len())
            .then(|| Self::new(free.to_vec(), centre, covariance))
            .flatten()
    }

    fn draw(&self, source: &mut Source) -> DVector<f64> {
        let z = DVector::from_fn(self.free.len(), |_, _| source.normal());
        let square: f64 = (0..FREEDOM).map(|_| source.normal().powi(2)).sum();
        let stretch = (FREEDOM as f64 / square).sqrt();
        let mut phi = self.centre.clone();
        for (&j, step) in self.free.iter().zip((&self.root * z).iter()) {
            phi[j] += stretch * step;
        }
        phi
    }

    fn log_density(&self, phi: &DVector<f64>) -> f64 {
        let (nu, d) = (FREEDOM as f64, self.free.len() as f64);
        match self.standardised(phi) {
            Some(z) => self.log_peak - 0.5 * (nu + d) * (z.norm_squared() / nu).ln_1p(),
            None => f64::NEG_INFINITY,
        }
    }

    /// Entries that may move, in standard deviations from the centre.
    fn standardised(&self, phi: &DVector<f64>) -> Option<DVector<f64>> {
        let off = (phi - &self.centre).select_rows(&self.free);
        self.root.solve_lower_triangular(&off)
    }

    /// Adds the normal that this density stands for, times a weight, and the same times Hermite polynomials along each axis.
    fn add_controls(&self, phi: &DVector<f64>, log_weight: f64, to: &mut [f64]) {
        let Some(z) = self.standardised(phi) else {
            return;
        };
        let normal = (self.normal_peak - 0.5 * z.norm_squared() + log_weight).exp();
        let (first, others) = to.split_at_mut(1);
        first[0] += normal;
        for (row, polynomial) in others.chunks_exact_mut(z.len()).zip(HERMITE) {
            for (to, z) in row.iter_mut().zip(z.iter()) {
                *to += normal * polynomial(*z);
            }
        }
    }
}

/// Draws in φ from equal parts of several proposals.
#[derive(Debug, Clone)]
pub(in crate::fit) struct Round {
    pub draws: Vec<DVector<f64>>,
    /// Proposal that each draw belongs to.
    pub modes: Vec<usize>,
    /// log of the target at each draw; −∞ beyond the bounds and where the twin does not work.
    pub targets: Vec<f64>,
    /// log of target over proposal.
    pub logs: Vec<f64>,
    /// log of the proposals' mixture at each draw.
    mixtures: Vec<f64>,
    proposals: Vec<Proposal>,
    /// Target over proposal, over the largest.
    weights: Vec<f64>,
    /// Entries that may move.
    pub free: Vec<usize>,
}

impl Round {
    /// Draws `count` points and weighs them by likelihood and prior.
    pub fn new(
        problem: &Problem,
        proposals: &[Proposal],
        count: usize,
        source: &mut Source,
        log_prior: impl Fn(&DVector<f64>) -> f64,
    ) -> Result<Self, FilterError> {
        let draws = (0..count)
            .map(|i| {
                heard(problem, i)?;
                Ok(proposals[i % proposals.len()].draw(source))
            })
            .collect::<Result<Vec<DVector<f64>>, FilterError>>()?;
        let c = &problem.coordinates;
        let mut targets: Vec<f64> = (draws.iter())
            .map(|phi| match c.clamp(phi) == *phi {
                true => log_prior(phi),
                // Beyond the bounds nothing is possible.
                false => f64::NEG_INFINITY,
            })
            .collect();
        let possible: Vec<usize> = (0..count)
            .filter(|&i| targets[i] > f64::NEG_INFINITY)
            .collect();
        let thetas: Vec<Vec<f64>> = (possible.iter())
            .map(|&i| c.theta(draws[i].as_slice()))
            .collect();
        for (&i, value) in possible.iter().zip(problem.log_likelihoods(&thetas)?) {
            targets[i] += value.unwrap_or(f64::NEG_INFINITY);
        }
        let of_proposals = try_each(draws.iter().enumerate(), |(i, phi)| {
            heard(problem, i)?;
            let densities: Vec<f64> = proposals.iter().map(|q| q.log_density(phi)).collect();
            let mode = (0..densities.len())
                .max_by(|&a, &b| densities[a].total_cmp(&densities[b]))
                .unwrap_or(0);
            Ok::<_, FilterError>((mode, log_mean(&densities)))
        })?;
        let logs: Vec<f64> = (targets.iter().zip(&of_proposals))
            .map(|(target, (_, mixture))| target - mixture)
            .collect();
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(Self {
            draws,
            modes: of_proposals.iter().map(|(mode, _)| *mode).collect(),
            mixtures: of_proposals.iter().map(|(_, mixture)| *mixture).collect(),
            proposals: proposals.to_vec(),
            targets,
            weights: logs.iter().map(|log| (log - top).exp()).collect(),
            logs,
            free: proposals.first().map_or(vec![], |q| q.free.clone()),
        })
    }

    /// Draws of one proposal in one entry, weighed by a target.
    #[cfg(test)]
    pub fn of_target(
        proposal: &Proposal,
        count: usize,
        source: &mut Source,
        target: &dyn Fn(f64) -> f64,
    ) -> Self {
        let draws: Vec<DVector<f64>> = (0..count).map(|_| proposal.draw(source)).collect();
        let targets: Vec<f64> = draws.iter().map(|phi| target(phi[0])).collect();
        let mixtures: Vec<f64> = draws.iter().map(|phi| proposal.log_density(phi)).collect();
        let logs = targets.iter().zip(&mixtures).map(|(t, q)| t - q).collect();
        Self {
            modes: vec![0; count],
            weights: vec![1.0; count],
            free: proposal.free.clone(),
            proposals: vec![proposal.clone()],
            draws,
            targets,
            logs,
            mixtures,
        }
    }

    /// Draw with the largest target, and its log.
    pub fn best(&self) -> Option<(&DVector<f64>, f64)> {
        let best =
            (0..self.targets.len()).max_by(|&a, &b| self.targets[a].total_cmp(&self.targets[b]))?;
        Some((&self.draws[best], self.targets[best]))
    }

    /// Control variates of a draw: mean 0 over draws of the proposals, whatever the target is. Of a target that is nearly normal, weights are nearly
    /// in proportion to the first; the others are what an Edgeworth series adds.
    ///
    /// ```text
    /// N/q − 1,   N/q·He_m(z_j)          N: mean of the normals that the proposals stand for;  q: their own mean
    /// ```
    pub fn controls(&self, draw: usize) -> Vec<f64> {
        let log_weight = -self.mixtures[draw] - (self.proposals.len() as f64).ln();
        let mut controls = vec![0.0; 1 + HERMITE.len() * self.free.len()];
        for proposal in &self.proposals {
            proposal.add_controls(&self.draws[draw], log_weight, &mut controls);
        }
        controls[0] -= 1.0;
        controls
    }

    /// (Σw)²/Σw².
    pub fn effective(&self) -> f64 {
        effective(&self.weights)
    }

    /// Proposals that follow the draws, with a share of the covariance of those before; the ones before where too few draws count.
    pub fn adapted(&self, before: &[Proposal], kept: f64) -> Vec<Proposal> {
        let adapted = |(m, before): (usize, &Proposal)| {
            let (mean, spread) = self.moments(m)?;
            let covariance = spread + kept * &before.covariance;
            Proposal::new(before.free.clone(), mean, covariance)
        };
        (before.iter().enumerate())
            .map(|(m, before)| adapted((m, before)).unwrap_or_else(|| before.clone()))
            .collect()
    }

    /// Weighted mean (the whole of φ) and covariance (of the entries that may move) of the draws about one top, weights flattened; `None`
    /// where no flattening makes enough of them count.
    fn moments(&self, mode: usize) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let own: Vec<(&DVector<f64>, f64)> = (0..self.draws.len())
            .filter(|&i| self.modes[i] == mode)
            .map(|i| (&self.draws[i], self.weights[i]))
            .collect();
        let d = self.free.len();
        let weights = flattened(
            own.iter().map(|(_, w)| *w).collect(),
            BUDGET.counting_draws * d as f64,
        )?;
        let sum: f64 = weights.iter().sum();
        let own: Vec<_> = own.iter().map(|(x, _)| *x).zip(&weights).collect();
        // What may not move stays to the bit: a mean of equal values would round a value at its bound to one beyond.
        let mut mean = own.first()?.0.clone();
        for &j in &self.free {
            mean[j] = own.iter().map(|(x, w)| x[j] * *w / sum).sum();
        }
        let spread = own.iter().fold(DMatrix::zeros(d, d), |c, (x, w)| {
            let off = (*x - &mean).select_rows(&self.free);
            c + &off * off.transpose() * (**w / sum)
        });
        Some((mean, spread))
    }

    /// Indices of draws, each as often as its weight says.
    pub fn taken(&self, count: usize) -> Vec<usize> {
        let cumulated: Vec<f64> = (self.weights.iter())
            .scan(0.0, |sum, w| {
                *sum += w;
                Some(*sum)
            })
            .collect();
        let whole = cumulated.last().copied().unwrap_or(0.0);
        if !whole.is_finite() {
            return vec![];
        }
        (0..count)
            .map(|i| whole * (i as f64 + 0.5) / count as f64)
            .map(|at| cumulated.partition_point(|sum| *sum < at))
            .filter(|i| *i < self.draws.len())
            .collect()
    }
}

/// Fails once the work is to stop; asked at one draw of many, as each is quick and there may be millions.
fn heard(problem: &Problem, draw: usize) -> Result<(), FilterError> {
    if draw.is_multiple_of(1024) {
        problem.passes().count(0)?;
    }
    Ok(())
}

/// Weights to the largest power up to 1 at which `least` draws count; `None` where none is enough.
fn flattened(weights: Vec<f64>, least: f64) -> Option<Vec<f64>> {
    let power = |p: f64| -> Vec<f64> { weights.iter().map(|w| w.powf(p)).collect() };
    if effective(&weights) >= least {
        return Some(weights);
    }
    // Weights of 0 stay at 0: those beyond the bounds never count.
    let possible = weights.iter().filter(|w| **w > 0.0).count() as f64;
    if possible < least {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        match effective(&power(middle)) >= least {
            true => low = middle,
            false => high = middle,
        }
    }
    Some(power(low.max(f64::MIN_POSITIVE)))
}

/// Number of independent draws that weighed ones are worth.
pub(in crate::fit) fn effective(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    sum * sum / weights.iter().map(|w| w * w).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Noise;

    /// Where all entries lie at bounds, there is nothing to draw.
    #[test]
    fn nothing_is_proposed_where_nothing_may_move() {
        let centre = DVector::from_vec(vec![1.0, 2.0]);
        let one = Proposal::new(vec![1], centre.clone(), DMatrix::identity(1, 1)).unwrap();
        assert!(one.within(&[], &centre).is_none());
        assert!(one.within(&[1], &centre).is_some());
    }

    /// Draws are taken as often as their weights say, and nothing is made of a single heavy one.
    #[test]
    fn weights_are_frequencies() {
        let round = |weights: Vec<f64>| Round {
            draws: (0..weights.len())
                .map(|i| DVector::from_element(1, (i % 4) as f64))
                .collect(),
            modes: vec![0; weights.len()],
            targets: weights.iter().map(|w| w.ln()).collect(),
            logs: weights.iter().map(|w| w.ln()).collect(),
            mixtures: vec![0.0; weights.len()],
            proposals: vec![],
            weights,
            free: vec![0],
        };
        let even = round([1.0, 0.0, 2.0, 1.0].repeat(2));
        let taken = even.taken(80);
        for (draw, times) in (0..4).zip([10, 0, 20, 10]) {
            assert_eq!(taken.iter().filter(|t| **t == draw).count(), times);
        }
        let (mean, spread) = even.moments(0).unwrap();
        assert!((mean[0] - 1.75).abs() < 1e-12 && (spread[(0, 0)] - 1.1875).abs() < 1e-12);
        let heavy = round(vec![1.0, 0.0, 1e-9, 0.0]);
        assert!(heavy.moments(0).is_none());
        let flat = flattened(vec![1.0, 0.0, 1e-9, 1e-6, 1e-3], 3.0).unwrap();
        assert!((effective(&flat) - 3.0).abs() < 0.01 && flat[1] == 0.0);
    }

    /// The mean of q₁/q₂ over draws of q₂ is 1, and draws scatter as a Student's: ν/(ν − 2) of the covariance.
    #[test]
    fn a_proposal_has_the_density_of_its_draws() {
        let covariance = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 2.0]);
        let centre = DVector::from_vec(vec![1.0, 7.0, -1.0]);
        let proposal = Proposal::new(vec![0, 2], centre.clone(), covariance.clone()).unwrap();
        let mut source = Noise::new(1, "proposal", 0).source("z");
        let draws: Vec<DVector<f64>> = (0..20_000).map(|_| proposal.draw(&mut source)).collect();
        assert!(draws.iter().all(|phi| phi[1] == 7.0), "held entries stay");
        let n = draws.len() as f64;
        let variance = draws.iter().map(|phi| (phi[0] - 1.0).powi(2)).sum::<f64>() / n;
        assert!(
            (variance / (4.0 * 5.0 / 3.0) - 1.0).abs() < 0.1,
            "{variance}"
        );
        let other = Proposal::new(vec![0, 2], centre, 0.5 * covariance).unwrap();
        let ratio = |phi| (other.log_density(phi) - proposal.log_density(phi)).exp();
        let mean = draws.iter().map(ratio).sum::<f64>() / n;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
        let mut controls = vec![0.0; 1 + 2 * HERMITE.len()];
        for phi in &draws {
            proposal.add_controls(phi, -proposal.log_density(phi), &mut controls);
        }
        controls[0] -= n;
        assert!(
            controls.iter().all(|c| (c / n).abs() < 0.03),
            "{controls:?}"
        );
        let part = proposal
            .within(&[2], &DVector::from_vec(vec![9.0, 7.0, 5.0]))
            .unwrap();
        assert_eq!((part.centre[0], part.centre[2]), (9.0, -1.0));
        assert_eq!(part.covariance[(0, 0)], 2.0);
    }
}
