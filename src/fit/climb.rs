//! The most probable θ of a twin, given its records and a weak prior.
//!
//! With equations, the filter's score gives gradient and information. Without, differences do: innovations and covariances a step beside θ,
//! of the same draws, give the directions D; for Gaussian innovations the gradient is D·r and the information DᵀD, as in `reference.rs`.

use crate::fit::budget::BUDGET;
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::fit::solver::{LocalModel, Objective, Solver};
use crate::likelihood::kalman::{FilterError, Filtered, recoverable};
use crate::math::descending;
use crate::parallel::try_each;
use nalgebra::{DMatrix, DVector};

/// Result of a fit.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    /// Full θ.
    pub theta: Vec<f64>,
    pub log_likelihood: f64,
    /// Objective of the fit: likelihood and all priors.
    pub objective: f64,
    /// Gradient of the objective in φ.
    pub gradient: DVector<f64>,
    /// Information in φ, that of the priors included.
    pub information: DMatrix<f64>,
}

impl Fitted {
    /// Standard deviations of θ from information and prior, first order.
    pub fn std_errors(&self, problem: &Problem) -> Vec<f64> {
        let slopes = problem.coordinates.slopes(&self.theta);
        match self.information.clone().try_inverse() {
            Some(covariance) => (slopes.iter().enumerate())
                .map(|(j, slope)| slope * covariance[(j, j)].max(0.0).sqrt())
                .collect(),
            None => vec![f64::NAN; slopes.len()],
        }
    }

    /// Square of the distance to another end, in standard deviations of this one.
    pub fn squared_distance(&self, problem: &Problem, other: &Self) -> f64 {
        let phi = |fit: &Self| DVector::from_vec(problem.coordinates.of(&fit.theta));
        let off = phi(other) - phi(self);
        off.dot(&(&self.information * &off))
    }
}

/// Place at which a climb has ended, with the derivatives that it knows there.
#[derive(Debug, Clone)]
pub(crate) struct Reached {
    /// Full θ.
    pub theta: Vec<f64>,
    /// Objective of the fit: likelihood and all priors.
    pub objective: f64,
    model: Option<LocalModel>,
}

impl Reached {
    /// The fit, with its derivatives; `None` where there are none.
    pub fn fitted(self, problem: &Problem) -> Result<Option<Fitted>, FilterError> {
        let model = match self.model {
            Some(model) => Some(model),
            None => recoverable(model(problem, &self.theta, None))?,
        };
        let finite = model.filter(|model| model.cost.is_finite());
        Ok(finite.map(|model| Fitted {
            log_likelihood: -model.cost - problem.log_prior(&self.theta, true),
            objective: -model.cost,
            gradient: -model.gradient,
            information: model.information,
            theta: self.theta,
        }))
    }
}

/// Damped Fisher scoring from one start, within the bounds; `None` where the filter does not work at the start.
///
/// The information holds that of the weak prior, too.
pub(crate) fn climb(
    problem: &Problem,
    start: &[f64],
    iterations: usize,
) -> Result<Option<Fitted>, FilterError> {
    match ended(problem, start, iterations, (true, f64::NEG_INFINITY))? {
        Some(end) => end.fitted(problem),
        None => Ok(None),
    }
}

/// As [`climb`], for those who ask for the place alone: derivatives there would cost as much as ten likelihoods.
pub(crate) fn reach(
    problem: &Problem,
    start: &[f64],
    iterations: usize,
) -> Result<Option<Reached>, FilterError> {
    ended(problem, start, iterations, (false, f64::NEG_INFINITY))
}

/// As [`climb`], with derivatives at the end or without, and no farther than it takes to see that no more than `least` is in reach.
fn ended(
    problem: &Problem,
    start: &[f64],
    iterations: usize,
    (models_end, least): (bool, f64),
) -> Result<Option<Reached>, FilterError> {
    let c = &problem.coordinates;
    let solver = Solver {
        lower: c.lower(),
        upper: c.upper(),
        longest: problem.axes.iter().map(|axis| axis.longest).collect(),
        held: problem.axes.iter().map(|axis| axis.held).collect(),
        iterations: iterations as u64,
        trials: 1,
        damping: BUDGET.first_damping,
        least_damping: BUDGET.least_damping,
        gain: problem.done(),
        relative_gain: 0.0,
        least_step: BUDGET.least_step,
        least_cost: -least,
        models_end,
    };
    let start = DVector::from_vec(c.of(&problem.clamp(start)));
    let end = recoverable(solver.minimise(&LogPosterior(problem), &start))?;
    Ok(end.map(|end| Reached {
        theta: c.theta(end.x.as_slice()),
        objective: -end.cost,
        model: end.model,
    }))
}

/// Minus the log-posterior of the weak priors, in φ.
struct LogPosterior<'p>(&'p Problem);

impl Objective for LogPosterior<'_> {
    /// Innovations of a black box.
    type Trial = Option<Vec<Filtered>>;
    type Error = FilterError;

    fn is_rejection(error: &FilterError) -> bool {
        error.is_recoverable()
    }

    fn cost(&self, phi: &DVector<f64>) -> Result<(f64, Self::Trial), FilterError> {
        let theta = self.0.coordinates.theta(phi.as_slice());
        let trial = self.0.evaluate(&theta)?;
        let objective = trial.log_likelihood + self.0.log_prior(&theta, true);
        Ok((-objective, trial.innovations))
    }

    fn model(
        &self,
        phi: &DVector<f64>,
        trial: Option<Self::Trial>,
    ) -> Result<LocalModel, FilterError> {
        let theta = self.0.coordinates.theta(phi.as_slice());
        let model = model(self.0, &theta, trial.flatten())?;
        match model.cost.is_finite() {
            true => Ok(model),
            false => Err(FilterError::Diverged { at: 0.0 }),
        }
    }
}

/// Quadratic model of minus the log-posterior at θ, the weak priors included; `innovations` are those of a black box at θ, where they are known.
fn model(
    problem: &Problem,
    theta: &[f64],
    innovations: Option<Vec<Filtered>>,
) -> Result<LocalModel, FilterError> {
    let d = problem.dimension();
    let mut model = LocalModel {
        cost: 0.0,
        gradient: DVector::zeros(d),
        information: DMatrix::zeros(d, d),
    };
    if problem.is_simulated() {
        let innovations = innovations.map_or_else(|| problem.filtered(theta), Ok)?;
        add_differences(problem, theta, innovations, &mut model)?;
    } else {
        add_scores(problem, theta, &mut model)?;
    }
    model.cost -= problem.log_prior(theta, true);
    let phi = problem.coordinates.of(theta);
    for (j, (centre, precision)) in problem.prior_terms().enumerate() {
        model.gradient[j] += precision * (phi[j] - centre);
        model.information[(j, j)] += precision;
    }
    Ok(model)
}

/// Adds the filter's score of each record.
fn add_scores(problem: &Problem, theta: &[f64], model: &mut LocalModel) -> Result<(), FilterError> {
    for (r, place) in problem.places.iter().enumerate() {
        let Some(score) = problem.score(r, theta)? else {
            continue;
        };
        model.cost -= score.log_likelihood;
        for (a, &i) in place.iter().enumerate() {
            model.gradient[i] -= score.gradient[a];
            for (b, &j) in place.iter().enumerate() {
                model.information[(i, j)] += score.fisher[(a, b)];
            }
        }
    }
    Ok(())
}

/// Adds an ensemble's likelihood at θ with these innovations, derivatives from differences.
fn add_differences(
    problem: &Problem,
    theta: &[f64],
    innovations: Vec<Filtered>,
    model: &mut LocalModel,
) -> Result<(), FilterError> {
    let here = Reference::bare(innovations);
    let neighbours = problem.neighbours(theta).into_iter().enumerate();
    let directions = try_each(neighbours, |(j, (moved, distance))| {
        if problem.axes[j].held {
            return Ok(None);
        }
        let there: Vec<Filtered> = problem.filtered(&moved)?;
        Ok::<_, FilterError>(Some(here.direction(&there) / distance))
    })?;
    model.cost -= here.filtered.iter().map(|f| f.log_likelihood).sum::<f64>();
    for (i, a) in directions.iter().enumerate() {
        let Some(a) = a else { continue };
        model.gradient[i] = -here.residual().dot(a);
        for (j, b) in directions.iter().enumerate().take(i + 1) {
            let Some(b) = b else { continue };
            model.information[(i, j)] = a.dot(b);
            model.information[(j, i)] = model.information[(i, j)];
        }
    }
    Ok(())
}

/// Returns what moves a start to where all other entries have answered those of a shape, which stay: a threshold, a lag or a time would go
/// anywhere from afar. With no such entry a start stays where it is.
pub(crate) fn settling(
    problem: &Problem,
    is_shape: &dyn Fn(usize) -> bool,
    iterations: usize,
) -> impl Fn(Vec<f64>) -> Result<Vec<f64>, FilterError> + use<> {
    let has_shape = (0..problem.axes.len()).any(is_shape);
    let held = has_shape.then(|| problem.holding(is_shape));
    move |start| match &held {
        Some(held) => Ok(reach(held, &start, iterations)?.map_or(start, |settled| settled.theta)),
        None => Ok(start),
    }
}

/// The best of several starts.
pub(crate) fn fit(
    problem: &Problem,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Option<Fitted>, FilterError> {
    if let [start] = starts {
        return climb(problem, start, iterations);
    }
    for end in reached(problem, starts, iterations)? {
        if let Some(fitted) = end.fitted(problem)? {
            return Ok(Some(fitted));
        }
    }
    Ok(None)
}

/// Places that climbs from several starts reach, best first; of equal ones that of the first start is first. One that will not pass the best before it
/// ends on its way.
pub(crate) fn reached(
    problem: &Problem,
    starts: &[Vec<f64>],
    iterations: usize,
) -> Result<Vec<Reached>, FilterError> {
    let (mut ends, mut best) = (vec![], f64::NEG_INFINITY);
    for start in starts {
        let end = ended(problem, start, iterations, (false, best))?;
        best = end.iter().fold(best, |best, end| best.max(end.objective));
        ends.extend(end);
    }
    descending(&mut ends, |end| end.objective);
    Ok(ends)
}
