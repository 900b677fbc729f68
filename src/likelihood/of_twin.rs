//! Likelihood of a record under a twin of either kind, chosen once.

use super::ensemble;
use super::kalman::{
    Coordinates, FilterError, FilterSettings, Filtered, Gaussian, Kalman, Responses, Score, States,
    recoverable,
};
use crate::parallel::try_each;
use crate::record::{Record, Signal};
use crate::twin::{Composed, ComposedBlackBox, DigitalTwin, Outline, Twin};
use std::sync::Arc;

/// Likelihood of a record at θ.
pub(crate) trait Likelihood: Send + Sync {
    /// States, inputs and outputs.
    fn outline(&self) -> Outline;
    /// Innovations and their densities.
    fn filtered(&self, theta: &[f64], record: &Record) -> Result<Filtered, FilterError>;
    /// As [`filtered`](Self::filtered) at several θ, on all cores; `None` where the twin does not work.
    fn filtered_all(
        &self,
        thetas: &[Vec<f64>],
        record: &Record,
    ) -> Result<Vec<Option<Filtered>>, FilterError>;
    /// Innovations with the filtered states.
    fn states(&self, theta: &[f64], record: &Record) -> Result<(Filtered, Signal), FilterError>;
    /// The state at the first sample given the whole record; `None` where there are no states.
    fn first_state(&self, theta: &[f64], record: &Record) -> Result<Option<Gaussian>, FilterError>;
    /// Process noise of each step and states given the whole record, in state units; `None` where there are no states.
    fn disturbances(
        &self,
        theta: &[f64],
        record: &Record,
    ) -> Result<Option<(Signal, States)>, FilterError>;
    /// Outputs predicted from the rows before, over missing rows as far ahead as these last; `None` where only free runs are known.
    fn predicted(&self, theta: &[f64], record: &Record) -> Result<Option<Signal>, FilterError>;
    /// Responses of predictions to small additions; `None` without equations.
    fn responses(&self, theta: &[f64], record: &Record) -> Result<Option<Responses>, FilterError>;
    /// Log-likelihood, with the innovations where they come at no extra cost.
    fn log_likelihood(
        &self,
        theta: &[f64],
        record: &Record,
    ) -> Result<(f64, Option<Filtered>), FilterError>;
    /// Log-likelihoods at several θ, on all cores; `None` where the twin does not work.
    fn log_likelihoods(
        &self,
        thetas: &[Vec<f64>],
        record: &Record,
    ) -> Result<Vec<Option<f64>>, FilterError>;
    /// Gradient and information; `None` where only differences give them.
    fn score(
        &self,
        theta: &[f64],
        record: &Record,
        coordinates: &Coordinates,
    ) -> Result<Option<Score>, FilterError>;
    /// True where each likelihood costs an ensemble of simulations.
    fn is_simulated(&self) -> bool;
}

/// Returns a filter's likelihood for a twin with equations, an ensemble's for any other.
pub(crate) fn likelihood_of(twin: &Twin) -> Arc<dyn Likelihood> {
    match twin {
        Twin::Equations(twin) => {
            Arc::new(FilterLikelihood(twin.clone(), FilterSettings::default()))
        }
        Twin::BlackBox(twin) => Arc::new(EnsembleLikelihood(twin.clone())),
    }
}

struct FilterLikelihood(Composed, FilterSettings);

impl FilterLikelihood {
    fn kalman<'a>(
        &'a self,
        record: &'a Record,
        settings: &'a FilterSettings,
    ) -> Result<Kalman<'a>, FilterError> {
        Ok(Kalman::new(&self.0, record, settings)?.of_cells())
    }
}

impl Likelihood for FilterLikelihood {
    fn outline(&self) -> Outline {
        self.0.outline()
    }
    fn filtered(&self, theta: &[f64], record: &Record) -> Result<Filtered, FilterError> {
        self.kalman(record, &self.1)?.filter(theta)
    }
    fn filtered_all(
        &self,
        thetas: &[Vec<f64>],
        record: &Record,
    ) -> Result<Vec<Option<Filtered>>, FilterError> {
        self.kalman(record, &self.1)?.filter_all(thetas)
    }
    fn states(&self, theta: &[f64], record: &Record) -> Result<(Filtered, Signal), FilterError> {
        let settings = FilterSettings {
            keep_states: true,
            ..self.1.clone()
        };
        let mut filtered = self.kalman(record, &settings)?.filter(theta)?;
        let states = (filtered.states.take()).map_or_else(|| Signal::zeros((0, 0)), |s| s.means);
        Ok((filtered, states))
    }
    fn first_state(&self, theta: &[f64], record: &Record) -> Result<Option<Gaussian>, FilterError> {
        self.kalman(record, &self.1)?.first_state(theta).map(Some)
    }
    fn disturbances(
        &self,
        theta: &[f64],
        record: &Record,
    ) -> Result<Option<(Signal, States)>, FilterError> {
        (self.kalman(record, &self.1)?.disturbances(theta)).map(Some)
    }
    fn predicted(&self, theta: &[f64], record: &Record) -> Result<Option<Signal>, FilterError> {
        self.kalman(record, &self.1)?.predictions(theta).map(Some)
    }
    fn responses(&self, theta: &[f64], record: &Record) -> Result<Option<Responses>, FilterError> {
        self.kalman(record, &self.1)?.responses(theta).map(Some)
    }
    fn log_likelihood(
        &self,
        theta: &[f64],
        record: &Record,
    ) -> Result<(f64, Option<Filtered>), FilterError> {
        let kalman = self.kalman(record, &self.1)?;
        Ok((kalman.log_likelihood(theta)?, None))
    }
    fn log_likelihoods(
        &self,
        thetas: &[Vec<f64>],
        record: &Record,
    ) -> Result<Vec<Option<f64>>, FilterError> {
        self.kalman(record, &self.1)?.log_likelihoods(thetas)
    }
    fn score(
        &self,
        theta: &[f64],
        record: &Record,
        coordinates: &Coordinates,
    ) -> Result<Option<Score>, FilterError> {
        let kalman = self.kalman(record, &self.1)?;
        Score::forward(&kalman, theta, coordinates).map(Some)
    }
    fn is_simulated(&self) -> bool {
        false
    }
}

struct EnsembleLikelihood(ComposedBlackBox);

impl Likelihood for EnsembleLikelihood {
    /// The predicted outputs stand for states.
    fn outline(&self) -> Outline {
        let signals = self.0.signals();
        Outline {
            parameters: self.0.parameters(),
            states: signals.outputs.clone(),
            inputs: signals.inputs,
            outputs: signals.outputs,
            ..Outline::new()
        }
    }
    fn filtered(&self, theta: &[f64], record: &Record) -> Result<Filtered, FilterError> {
        ensemble::filtered(&self.0, theta, record)
    }
    fn filtered_all(
        &self,
        thetas: &[Vec<f64>],
        record: &Record,
    ) -> Result<Vec<Option<Filtered>>, FilterError> {
        try_each(thetas, |theta| recoverable(self.filtered(theta, record)))
    }
    fn states(&self, theta: &[f64], record: &Record) -> Result<(Filtered, Signal), FilterError> {
        let filtered = self.filtered(theta, record)?;
        let predicted = filtered.held_predictions(record.outputs());
        Ok((filtered, predicted))
    }
    fn first_state(&self, _: &[f64], _: &Record) -> Result<Option<Gaussian>, FilterError> {
        Ok(None)
    }
    fn disturbances(&self, _: &[f64], _: &Record) -> Result<Option<(Signal, States)>, FilterError> {
        Ok(None)
    }
    fn predicted(&self, _: &[f64], _: &Record) -> Result<Option<Signal>, FilterError> {
        Ok(None)
    }
    fn responses(&self, _: &[f64], _: &Record) -> Result<Option<Responses>, FilterError> {
        Ok(None)
    }
    fn log_likelihood(
        &self,
        theta: &[f64],
        record: &Record,
    ) -> Result<(f64, Option<Filtered>), FilterError> {
        let filtered = self.filtered(theta, record)?;
        Ok((filtered.log_likelihood, Some(filtered)))
    }
    fn log_likelihoods(
        &self,
        thetas: &[Vec<f64>],
        record: &Record,
    ) -> Result<Vec<Option<f64>>, FilterError> {
        let found = self.filtered_all(thetas, record)?.into_iter();
        Ok(found
            .map(|filtered| Some(filtered?.log_likelihood))
            .collect())
    }
    fn score(&self, _: &[f64], _: &Record, _: &Coordinates) -> Result<Option<Score>, FilterError> {
        Ok(None)
    }
    fn is_simulated(&self) -> bool {
        true
    }
}
