//! Where the likelihood of a record lies: Fisher scoring from several starts, then importance sampling. No simulations.

use crate::likelihood::kalman::{Coordinates, FilterError, Kalman, Score, recoverable};
use crate::twin::{Noise, ParameterSpace};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

/// Random points in the bounds whose likelihood is looked at, for each parameter, and how many of the best become starts,
/// beside the estimate at hand and the prior's centre. A few random starts alone miss narrow tops.
const SCREENED: u64 = 64;
const SCREENED_STARTS: usize = 4;
/// Scoring iterations of every start, how many of the best go on, and iterations of these.
const SURVEY: usize = 5;
const LEADING: usize = 2;
const ITERATIONS: usize = 20;
/// Gain of an iteration, in nats a parameter, below which importance sampling takes over.
const LEAST_GAIN: f64 = 0.02;
/// Largest step in φ.
const LARGEST_STEP: f64 = 0.5;
/// Rounds of importance sampling, and draws in each for each parameter.
const ROUNDS: u64 = 3;
const DRAWS: u64 = 250;
/// Parameters that are counted for either number.
const MOST_PARAMETERS: u64 = 8;
/// Half-width of the sampled box, in standard deviations.
const REACH: f64 = 3.5;
/// Weights are flattened until so many draws count.
const EFFECTIVE: f64 = 30.0;

/// Mean and axes of the posterior, uniform in the bounds.
pub(super) struct Located {
    /// Mean, θ.
    pub theta: Vec<f64>,
    /// Columns: principal axes of the covariance, one standard deviation long, θ units.
    pub axes: DMatrix<f64>,
}

/// Mean and covariance in φ.
type Moments = (DVector<f64>, DMatrix<f64>);

/// Parameters that draws are made for.
fn counted(parameters: usize) -> u64 {
    (parameters as u64).min(MOST_PARAMETERS)
}

/// Finds the posterior of a record. `None` where the filter works at no start.
pub(super) fn localise(
    kalman: &Kalman<'_>,
    space: &ParameterSpace,
    coordinates: &Coordinates,
    initial: &[f64],
    noise: Noise,
) -> Result<Option<Located>, FilterError> {
    let mut screened: Vec<(f64, Vec<f64>)> = (0..SCREENED * counted(space.len()))
        .into_par_iter()
        .map(|i| {
            let theta = space.draw_bounds(noise.child("starts").sample(i));
            let value = recoverable(kalman.log_likelihood(&theta))?;
            Ok(value.map(|value| (value, theta)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?
        .into_iter()
        .flatten()
        .collect();
    screened.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = screened
        .into_iter()
        .take(SCREENED_STARTS)
        .map(|(_, theta)| theta);
    let starts: Vec<Vec<f64>> = ([initial.to_vec(), space.centre()].into_iter())
        .chain(best)
        .collect();
    let on = |mut climb: Climb, iterations| {
        climb.on(kalman, coordinates, iterations)?;
        Ok::<_, FilterError>(climb)
    };
    let first: Vec<Option<Climb>> = (starts.par_iter())
        .map(|start| {
            let climb = recoverable(Climb::from(kalman, coordinates, start))?;
            climb.map(|climb| on(climb, SURVEY)).transpose()
        })
        .collect::<Result<_, FilterError>>()?;
    let mut leading: Vec<Climb> = first.into_iter().flatten().collect();
    leading.sort_by(|a, b| b.score.log_likelihood.total_cmp(&a.score.log_likelihood));
    leading.truncate(LEADING);
    let best = (leading.into_par_iter())
        .map(|climb| on(climb, ITERATIONS))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .reduce(|best, other| {
            if other.score.log_likelihood > best.score.log_likelihood {
                other
            } else {
                best
            }
        });
    let Some(Climb {
        phi: mut centre,
        score,
        ..
    }) = best
    else {
        return Ok(None);
    };
    let information = score.fisher;
    let d = centre.len();
    let mut covariance = (information + DMatrix::identity(d, d))
        .try_inverse()
        .unwrap_or_else(|| DMatrix::identity(d, d));
    for round in 0..ROUNDS {
        let noise = noise.child("importance").sample(round);
        match importance(kalman, coordinates, &centre, &covariance, noise)? {
            Some(found) => (centre, covariance) = found,
            None => break,
        }
    }
    // From φ to θ at first order.
    let theta = coordinates.theta(centre.as_slice());
    let slopes = DMatrix::from_diagonal(&DVector::from_vec(coordinates.slopes(&theta)));
    let eigen = SymmetricEigen::new(&slopes * covariance * &slopes);
    let lengths = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    Ok(Some(Located {
        theta,
        axes: eigen.eigenvectors * DMatrix::from_diagonal(&lengths),
    }))
}

/// Damped Fisher scoring within the bounds.
struct Climb {
    phi: DVector<f64>,
    score: Score,
    damping: f64,
    done: bool,
}

impl Climb {
    fn from(
        kalman: &Kalman<'_>,
        coordinates: &Coordinates,
        start: &[f64],
    ) -> Result<Self, FilterError> {
        let phi = coordinates.clamp(&DVector::from_vec(coordinates.of(start)));
        Ok(Self {
            score: Score::forward(kalman, &coordinates.theta(phi.as_slice()), coordinates)?,
            phi,
            damping: 1.0,
            done: false,
        })
    }

    /// Goes on for at most so many iterations.
    fn on(
        &mut self,
        kalman: &Kalman<'_>,
        coordinates: &Coordinates,
        iterations: usize,
    ) -> Result<(), FilterError> {
        for _ in 0..iterations {
            if self.done {
                break;
            }
            let fisher = &self.score.fisher;
            let damped =
                fisher + DMatrix::from_diagonal(&fisher.diagonal().map(|v| self.damping * v + 1.0));
            let Some(factor) = damped.cholesky() else {
                self.done = true;
                break;
            };
            let mut step = factor.solve(&self.score.gradient);
            let longest = step.amax();
            if longest > LARGEST_STEP {
                step *= LARGEST_STEP / longest;
            }
            let next = coordinates.clamp(&(&self.phi + step));
            let moved = (&next - &self.phi).amax();
            let theta = coordinates.theta(next.as_slice());
            match recoverable(Score::forward(kalman, &theta, coordinates))? {
                Some(better) if better.log_likelihood > self.score.log_likelihood => {
                    let gain = better.log_likelihood - self.score.log_likelihood;
                    (self.phi, self.score) = (next, better);
                    self.damping = (0.2 * self.damping).max(1e-6);
                    self.done |= gain < LEAST_GAIN * self.phi.len() as f64;
                }
                _ => self.damping *= 5.0,
            }
            self.done |= moved < 1e-7 || self.damping > 1e6;
        }
        Ok(())
    }
}

/// One round: uniform draws in the eigenbox of the covariance within the bounds, weighted by the likelihood, the weights
/// tempered to an effective number.
fn importance(
    kalman: &Kalman<'_>,
    coordinates: &Coordinates,
    centre: &DVector<f64>,
    covariance: &DMatrix<f64>,
    noise: Noise,
) -> Result<Option<Moments>, FilterError> {
    let eigen = SymmetricEigen::new(covariance.clone());
    let lengths = eigen.eigenvalues.map(|v| REACH * v.max(1e-18).sqrt());
    let draw = |i: u64| -> Option<DVector<f64>> {
        let mut source = noise.sample(i).source("box");
        let u = lengths.map(|length| length * (2.0 * source.uniform() - 1.0));
        let phi = centre + &eigen.eigenvectors * u;
        let ends = coordinates.lower().iter().zip(coordinates.upper());
        (phi.iter().zip(ends))
            .all(|(v, (low, high))| (low..=high).contains(&v))
            .then_some(phi)
    };
    let weighed: Vec<Option<(DVector<f64>, f64)>> = (0..DRAWS * counted(centre.len()))
        .into_par_iter()
        .map(|i| {
            let Some(phi) = draw(i) else {
                return Ok(None);
            };
            let value = recoverable(kalman.log_likelihood(&coordinates.theta(phi.as_slice())))?;
            Ok(value.map(|value| (phi, value)))
        })
        .collect::<Result<_, FilterError>>()?;
    let weighed: Vec<_> = weighed.into_iter().flatten().collect();
    if weighed.len() < 2 * centre.len() + 2 {
        return Ok(None);
    }
    let weights = tempered(&weighed.iter().map(|w| w.1).collect::<Vec<_>>());
    let mut mean = DVector::zeros(centre.len());
    for ((phi, _), weight) in weighed.iter().zip(&weights) {
        mean += phi * *weight;
    }
    let mut spread = DMatrix::zeros(centre.len(), centre.len());
    for ((phi, _), weight) in weighed.iter().zip(&weights) {
        let difference = phi - &mean;
        spread += &difference * difference.transpose() * *weight;
    }
    Ok(Some((mean, spread)))
}

/// Normalised weights exp(β·ℓ), β ≤ 1 the largest for which (Σw)²/Σw² reaches [`EFFECTIVE`].
fn tempered(log_likelihoods: &[f64]) -> Vec<f64> {
    let top = log_likelihoods
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let weights = |beta: f64| -> Vec<f64> {
        let raw: Vec<f64> = (log_likelihoods.iter())
            .map(|l| (beta * (l - top)).exp())
            .collect();
        let sum: f64 = raw.iter().sum();
        raw.iter().map(|w| w / sum).collect()
    };
    let effective = |beta: f64| 1.0 / weights(beta).iter().map(|w| w * w).sum::<f64>();
    let goal = EFFECTIVE.min(0.5 * log_likelihoods.len() as f64);
    if effective(1.0) >= goal {
        return weights(1.0);
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if effective(middle) >= goal {
            low = middle;
        } else {
            high = middle;
        }
    }
    weights(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tempering_reaches_the_effective_number() {
        let peaked: Vec<f64> = (0..500).map(|i| -f64::from(i)).collect();
        let weights = tempered(&peaked);
        let effective = 1.0 / weights.iter().map(|w| w * w).sum::<f64>();
        assert!((effective - EFFECTIVE).abs() < 0.01, "{effective}");
        let flat = tempered(&[0.0; 100]);
        assert!(flat.iter().all(|w| (w - 0.01).abs() < 1e-12));
    }
}
