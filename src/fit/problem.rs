//! A twin and the records that it is fitted to.

use crate::fit::axis::{Axis, EvidencePrior, Family};
use crate::fit::budget::{BUDGET, Passes};
use crate::likelihood::kalman::{
    Coordinates, FilterError, Filtered, Gaussian, Responses, Score, States,
};
use crate::likelihood::{Likelihood, Measured, likelihood_of};
use crate::math::LANES;
use crate::record::{Record, Signal};
use crate::twin::{Noise, Outline, Parameter, ParameterSpace, Role, Stepping, Twin};
use std::sync::Arc;

/// Longest step of a fit in the logarithm of a black box's noise level.
const LONGEST_NOISE: f64 = 2.0;

/// A twin and records, with one θ for all of them but for unknown starts, of which each record has its own.
///
/// The full θ is the twin's, then the starts of the second record, and so on.
#[derive(Clone)]
pub(crate) struct Problem {
    pub twin: Twin,
    pub records: Arc<[Record]>,
    /// Indices of the twin's parameters in the full θ, for each record.
    pub(super) places: Vec<Vec<usize>>,
    pub axes: Vec<Axis>,
    /// Entries whose priors belong together.
    pub families: Vec<Family>,
    pub coordinates: Coordinates,
    coordinates_of: Vec<Coordinates>,
    likelihood: Arc<dyn Likelihood>,
    /// Cost so far: of fits of this problem and of those made from it.
    passes: Passes,
    /// Gain at which a fit is done, in nats.
    done: f64,
}

/// Log-likelihood at one θ.
pub(super) struct Evaluation {
    pub log_likelihood: f64,
    /// Innovations of each record of a black box: the slope at the same θ needs them, and they cost an ensemble.
    pub innovations: Option<Vec<Filtered>>,
}

impl Problem {
    /// `axes` belong to the parameters of the twin; their likelihood is a filter's, or, without equations, that of an ensemble.
    pub fn new(twin: Twin, axes: Vec<Axis>, records: impl Into<Arc<[Record]>>) -> Self {
        let records = records.into();
        let space = twin.parameters();
        let mut all = axes;
        let mut places = Vec::new();
        for r in 0..records.len() {
            let mut of_record = Vec::new();
            for (j, p) in space.iter().enumerate() {
                if r > 0 && p.role == Role::Start {
                    all.push(all[j].clone());
                    of_record.push(all.len() - 1);
                } else {
                    of_record.push(j);
                }
            }
            places.push(of_record);
        }
        let coordinates = |axes: &mut dyn Iterator<Item = &Axis>| {
            let mut log = vec![];
            let space = ParameterSpace::new(axes.map(|axis| {
                log.push(axis.is_log);
                let mut p = Parameter::new("", "", 0.0, axis.width);
                p.bounds = axis.bounds;
                p
            }));
            Coordinates::with(&space, log)
        };
        // What simulations say is not worth the last of a gain.
        let likelihood = likelihood_of(&twin);
        Self {
            coordinates: coordinates(&mut all.iter()),
            coordinates_of: places
                .iter()
                .map(|place| coordinates(&mut place.iter().map(|&j| &all[j])))
                .collect(),
            places,
            axes: all,
            families: vec![],
            done: if likelihood.is_simulated() {
                5e-2
            } else {
                5e-3
            },
            likelihood,
            passes: Passes::default(),
            twin,
            records,
        }
    }

    /// Another twin or other axes on the same records; its passes are counted with those of this one.
    pub fn with_twin(&self, twin: Twin, axes: Vec<Axis>) -> Self {
        Self {
            done: self.done,
            ..Self::new(twin, axes, self.records.clone()).counted_with(&self.passes)
        }
    }

    /// The same problem, its passes added to these.
    pub fn counted_with(self, passes: &Passes) -> Self {
        Self {
            passes: passes.clone(),
            ..self
        }
    }

    /// A twin with noise levels in θ and the weak priors of its parameters. Unknown starts of equations are held: the filter integrates
    /// over the first state.
    pub fn of_measured(measured: &Measured, records: impl Into<Arc<[Record]>>) -> Self {
        let space = measured.twin.parameters();
        let own = space.len() - measured.levels.len();
        let axes: Vec<Axis> = (space.iter().take(own).map(Axis::of))
            .chain(measured.levels.iter().map(Axis::of_level))
            .collect();
        let problem = Self::new(measured.twin.clone(), axes, records);
        let is_simulated = problem.is_simulated();
        let d = space.len();
        problem.holding(|j| j < d && !is_simulated && space[j].role == Role::Start)
    }

    /// A twin with the weak priors of its own parameters.
    pub fn of_twin(twin: &Twin, records: impl Into<Arc<[Record]>>) -> Self {
        let space = twin.parameters();
        let axes = space.iter().map(Axis::of).collect();
        let mut problem = Self::new(twin.clone(), axes, records);
        if problem.is_simulated() {
            // An effect may explain all of a simulator's misfit.
            for (axis, p) in problem.axes.iter_mut().zip(space.iter()) {
                if p.role == Role::Noise {
                    axis.longest = LONGEST_NOISE;
                }
            }
        }
        problem
    }

    /// True where each likelihood costs an ensemble of simulations.
    pub fn is_simulated(&self) -> bool {
        self.likelihood.is_simulated()
    }

    /// The same with other substeps and another rule for inputs; `None` for a black box.
    pub fn stepped(&self, to: Stepping) -> Option<Self> {
        let twin = self.twin.stepped(|_, stepping| *stepping = to)?;
        let axes = self.axes[..twin.parameters().len()].to_vec();
        Some(Self {
            families: self.families.clone(),
            ..self.with_twin(twin, axes)
        })
    }

    /// The same twin on other records.
    pub fn on(&self, records: impl Into<Arc<[Record]>>) -> Self {
        let d = self.twin.parameters().len();
        let axes = self.axes[..d].to_vec();
        Self {
            families: self.families.clone(),
            ..Self::new(self.twin.clone(), axes, records).counted_with(&self.passes)
        }
    }

    /// States, inputs and outputs; of a black box, its predicted outputs stand for states.
    pub fn outline(&self) -> Outline {
        self.likelihood.outline()
    }

    /// Name of an entry of the full θ.
    pub(super) fn name(&self, entry: usize) -> String {
        let space = self.twin.parameters();
        let place = (self.places.iter().enumerate())
            .find_map(|(r, place)| Some((r, place.iter().position(|&j| j == entry)?)));
        let (r, j) = place.unwrap_or((0, entry));
        of_record(space[j].name.clone(), r)
    }

    /// Number of samples of all records.
    pub fn samples(&self) -> usize {
        self.records.iter().map(Record::samples).sum()
    }

    /// Dimension of the full θ.
    pub fn dimension(&self) -> usize {
        self.axes.len()
    }

    /// θ of one record.
    pub fn of_record(&self, r: usize, theta: &[f64]) -> Vec<f64> {
        self.places[r].iter().map(|&j| theta[j]).collect()
    }

    /// Full θ from that of one record: all records start alike.
    pub fn full(&self, theta: &[f64]) -> Vec<f64> {
        let mut full = vec![0.0; self.dimension()];
        for r in 0..self.places.len() {
            self.place(r, theta, &mut full);
        }
        full
    }

    /// Full θ from that of another problem, whose records are the first of these: others start as its first one does.
    pub fn carried(&self, other: &Problem, theta: &[f64]) -> Vec<f64> {
        let mut full = self.full(&other.of_record(0, theta));
        for r in 0..other.records.len().min(self.records.len()) {
            self.place(r, &other.of_record(r, theta), &mut full);
        }
        full
    }

    /// Puts θ of one record into the full θ.
    pub fn place(&self, r: usize, theta: &[f64], full: &mut [f64]) {
        for (&j, value) in self.places[r].iter().zip(theta) {
            full[j] = *value;
        }
    }

    /// The nearest θ within the bounds.
    pub fn clamp(&self, theta: &[f64]) -> Vec<f64> {
        let axes = self.axes.iter().zip(theta);
        axes.map(|(axis, v)| axis.bounds.clamp(*v)).collect()
    }

    /// The prior's centre.
    pub fn centre(&self) -> Vec<f64> {
        self.axes.iter().map(|a| a.bounds.clamp(a.centre)).collect()
    }

    /// Where a search from θ begins: within the bounds, noise loud.
    pub fn begin(&self, theta: &[f64]) -> Vec<f64> {
        (self.axes.iter().zip(theta))
            .map(|(axis, v)| axis.bounds.clamp(axis.begin.unwrap_or(*v)))
            .collect()
    }

    /// The same with noise as it is believed to be.
    pub(super) fn believed(&self, theta: &[f64]) -> Vec<f64> {
        (self.axes.iter().zip(theta))
            .map(|(axis, v)| match axis.begin {
                Some(_) => axis.bounds.clamp(axis.centre),
                None => *v,
            })
            .collect()
    }

    /// A random point from one of the twin's own parameters: magnitudes in the units of the record, held entries where they are held.
    pub(super) fn drawn(&self, mut theta: Vec<f64>, noise: Noise) -> Vec<f64> {
        for (j, (value, axis)) in theta.iter_mut().zip(&self.axes).enumerate() {
            // By name: one effect more draws the others alike.
            let mut source = noise.source(&self.name(j));
            *value = match axis.evidence {
                _ if axis.held => axis.centre,
                EvidencePrior::Magnitude { largest } => largest * (2.0 * source.uniform() - 1.0),
                EvidencePrior::Uniform { low, high } => {
                    let phi = low + source.uniform() * (high - low);
                    if axis.is_log { phi.exp() } else { phi }
                }
                _ => *value,
            };
        }
        self.clamp(&theta)
    }

    /// Log-density of the priors, up to a constant: of all axes, or of those that count.
    pub fn log_prior(&self, theta: &[f64], all: bool) -> f64 {
        let phi = self.coordinates.of(theta);
        self.prior_terms()
            .enumerate()
            .filter(|(j, _)| all || self.axes[*j].counts)
            .map(|(j, (centre, precision))| -0.5 * precision * (phi[j] - centre).powi(2))
            .sum()
    }

    /// Centre and precision of the priors in φ.
    pub fn prior_terms(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let logs = self.coordinates.is_log().iter();
        self.axes.iter().zip(logs).map(|(axis, log)| {
            let centre = if *log { axis.centre.ln() } else { axis.centre };
            (centre, axis.deviation.powi(-2))
        })
    }

    /// Log-likelihood of all records at θ.
    pub fn log_likelihood(&self, theta: &[f64]) -> Result<f64, FilterError> {
        Ok(self.evaluate(theta)?.log_likelihood)
    }

    /// Log-likelihoods of all records at several θ, on all cores; `None` where the twin does not work.
    pub fn log_likelihoods(&self, thetas: &[Vec<f64>]) -> Result<Vec<Option<f64>>, FilterError> {
        // As many as keep all cores busy: a stop is heard between them.
        let of_core = if self.is_simulated() { 1 } else { LANES };
        let at_once = of_core * rayon::current_num_threads();
        let mut sums = vec![Some(0.0); thetas.len()];
        for (r, record) in self.records.iter().enumerate() {
            let own: Vec<Vec<f64>> = thetas.iter().map(|t| self.of_record(r, t)).collect();
            for (own, sums) in own.chunks(at_once).zip(sums.chunks_mut(at_once)) {
                self.passes.count(own.len())?;
                let values = self.likelihood.log_likelihoods(own, record)?;
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum = sum.zip(value).map(|(sum, value)| sum + value);
                }
            }
        }
        Ok(sums)
    }

    /// As [`log_likelihoods`](Self::log_likelihoods), with the priors of all axes.
    pub fn log_posteriors(&self, thetas: &[Vec<f64>]) -> Result<Vec<Option<f64>>, FilterError> {
        let values = self.log_likelihoods(thetas)?.into_iter().zip(thetas);
        Ok(values
            .map(|(value, theta)| value.map(|value| value + self.log_prior(theta, true)))
            .collect())
    }

    /// Log-likelihood of all records at θ, with the innovations of a black box.
    pub(super) fn evaluate(&self, theta: &[f64]) -> Result<Evaluation, FilterError> {
        let (mut log_likelihood, mut innovations) = (0.0, Some(vec![]));
        for (r, record) in self.records.iter().enumerate() {
            let theta = self.of_record(r, theta);
            let (value, filtered) = self.counted()?.log_likelihood(&theta, record)?;
            log_likelihood += value;
            innovations = innovations.zip(filtered).map(|(mut all, filtered)| {
                all.push(filtered);
                all
            });
        }
        Ok(Evaluation {
            log_likelihood,
            innovations,
        })
    }

    /// Passes over records so far, of this problem and of those made from it.
    pub fn passes(&self) -> &Passes {
        &self.passes
    }

    /// The likelihood, about to pass over a record.
    fn counted(&self) -> Result<&dyn Likelihood, FilterError> {
        self.passes.count(1)?;
        Ok(self.likelihood.as_ref())
    }

    /// Outputs of a record predicted from its rows before, at θ of one record; `None` where only free runs are known.
    pub fn predicted(&self, theta: &[f64], record: &Record) -> Result<Option<Signal>, FilterError> {
        self.counted()?.predicted(theta, record)
    }

    /// Gradient and information of one record at the full θ; `None` where only differences give them.
    pub(super) fn score(&self, r: usize, theta: &[f64]) -> Result<Option<Score>, FilterError> {
        let axes = || self.places[r].iter().map(|&j| &self.axes[j]);
        let held = axes().map(|axis| axis.held).collect();
        // Evidence of unknown functions is weighed by slopes half a step away: led back, a law of a sensor next to without noise takes up what
        // random pushes of a state leave (5 of 12 records with bursts, in place of none).
        let of_functions = axes().map(|axis| axis.evidence == EvidencePrior::Member);
        let coordinates = (self.coordinates_of[r].clone())
            .holding(held)
            .leaving(of_functions.collect());
        let own = self.of_record(r, theta);
        self.counted()?.score(&own, &self.records[r], &coordinates)
    }

    /// Gain at which a fit is done, in nats.
    pub fn done(&self) -> f64 {
        self.done
    }

    /// The same problem, its fits carried on until they gain less than `nats`.
    pub fn until(&self, nats: f64) -> Self {
        Self {
            done: nats,
            ..self.clone()
        }
    }

    /// The same problem with some entries held where they are.
    pub fn holding(&self, held: impl Fn(usize) -> bool) -> Self {
        let mut problem = self.clone();
        for (j, axis) in problem.axes.iter_mut().enumerate() {
            axis.held |= held(j);
        }
        problem
    }

    /// Innovations of each record.
    pub fn filtered(&self, theta: &[f64]) -> Result<Vec<Filtered>, FilterError> {
        (self.records.iter().enumerate())
            .map(|(r, record)| self.counted()?.filtered(&self.of_record(r, theta), record))
            .collect()
    }

    /// Calls `then` with the innovations of each record at each of several θ, one after the other; `None` where the twin does not work.
    pub fn each_filtered<T>(
        &self,
        thetas: &[Vec<f64>],
        mut then: impl FnMut(usize, Vec<Filtered>) -> T,
    ) -> Result<Vec<Option<T>>, FilterError> {
        let at_once = match self.is_simulated() {
            true => rayon::current_num_threads(),
            false => (BUDGET.round_samples / self.samples()).clamp(1, LANES),
        };
        let mut all = Vec::with_capacity(thetas.len());
        for thetas in thetas.chunks(at_once) {
            let mut found: Vec<Option<Vec<Filtered>>> = vec![Some(vec![]); thetas.len()];
            for (r, record) in self.records.iter().enumerate() {
                let own: Vec<Vec<f64>> = thetas.iter().map(|t| self.of_record(r, t)).collect();
                self.passes.count(own.len())?;
                let filtered = self.likelihood.filtered_all(&own, record)?;
                for (found, filtered) in found.iter_mut().zip(filtered) {
                    let both = found.take().zip(filtered);
                    *found = both.map(|(mut all, filtered)| {
                        all.push(filtered);
                        all
                    });
                }
            }
            for filtered in found {
                let i = all.len();
                all.push(filtered.map(|filtered| then(i, filtered)));
            }
        }
        Ok(all)
    }

    /// Innovations and filtered states of each record.
    pub fn states(&self, theta: &[f64]) -> Result<Vec<(Filtered, Signal)>, FilterError> {
        (self.records.iter().enumerate())
            .map(|(r, record)| self.counted()?.states(&self.of_record(r, theta), record))
            .collect()
    }

    /// Responses of the predictions of each record to small additions inside the twin; empty for a black box.
    pub fn responses(&self, theta: &[f64]) -> Result<Vec<Responses>, FilterError> {
        (self.records.iter().enumerate())
            .map(|(r, record)| self.counted()?.responses(&self.of_record(r, theta), record))
            .filter_map(Result::transpose)
            .collect()
    }

    /// The state at the first sample of each record given all of it; empty for a black box.
    pub fn first_states(&self, theta: &[f64]) -> Result<Vec<Gaussian>, FilterError> {
        (self.records.iter().enumerate())
            .map(|(r, record)| {
                self.counted()?
                    .first_state(&self.of_record(r, theta), record)
            })
            .filter_map(Result::transpose)
            .collect()
    }

    /// Process noise of each step of each record and its states, given all of it; empty for a black box.
    pub fn disturbances(&self, theta: &[f64]) -> Result<Vec<(Signal, States)>, FilterError> {
        (self.records.iter().enumerate())
            .map(|(r, record)| {
                self.counted()?
                    .disturbances(&self.of_record(r, theta), record)
            })
            .filter_map(Result::transpose)
            .collect()
    }

    /// Points around θ whose innovations tell their derivatives: (moved θ, distance in φ), one for each entry.
    pub fn neighbours(&self, theta: &[f64]) -> Vec<(Vec<f64>, f64)> {
        // Runs are smooth in θ up to a simulator's own tolerance only.
        let share = if self.is_simulated() { 1.0 } else { 0.1 };
        let phi = self.coordinates.of(theta);
        (0..phi.len())
            .map(|j| {
                let (moved, distance) = self.coordinates.beside(&phi, j, share);
                (self.coordinates.theta(&moved), distance)
            })
            .collect()
    }
}
/// The name of an entry of record `r`, from 0.
pub(super) fn of_record(name: String, r: usize) -> String {
    match r {
        0 => name,
        r => format!("{name} (record {})", r + 1),
    }
}
