//! Predictive check of an all-clear.

use crate::diagnose::thresholds::THRESHOLDS;
use serde::Serialize;

/// Comparison of the measured records with records that the fitted twin simulates, noise and all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictiveCheck {
    /// Share of simulated records that depart as much from the others, the measured ones counted with them.
    pub p_value: f64,
    /// Number of simulated records.
    pub simulations: usize,
    /// Share of the output's variance that noise puts into predictions a tenth of the record ahead, beyond what noise as declared would: of
    /// levels beyond their declaration, and of correlated noise. None where nothing of the kind was fitted.
    pub noise_share: Option<f64>,
    /// Each statistic.
    #[serde(rename = "statistics")]
    pub rows: Vec<Predicted>,
    /// The disturbance that fitted noise swallows, where the records do not look like simulated ones.
    pub disturbance: Option<HiddenDisturbance>,
}

impl PredictiveCheck {
    /// Returns whether the records look like simulated ones.
    pub fn is_passed(&self) -> bool {
        self.p_value > THRESHOLDS.check_level
    }

    /// Returns whether noise of a kind or size that was not declared puts much into the output.
    pub fn is_loud(&self) -> bool {
        self.noise_share
            .is_some_and(|share| share > THRESHOLDS.swallowed)
    }

    /// Probability that nothing is missing where the check refutes an all-clear; `None` where it does not. A failed check leaves what its
    /// smallest Bayes factor does, prior odds even; loud noise of another kind what its gain in nats does.
    ///
    /// ```text
    /// P(nothing)/P(gap) = −e·p·ln p
    /// ```
    ///
    /// Source: Sellke, Bayarri & Berger, "Calibration of p values for testing precise null hypotheses", *The American Statistician* 55
    /// (2001).
    pub(in crate::diagnose) fn nothing(&self, noise_gain: f64) -> Option<f64> {
        let p = self.p_value;
        let odds = match (self.is_passed(), self.is_loud()) {
            (false, _) => -std::f64::consts::E * p * p.ln(),
            (true, true) => (-noise_gain).exp(),
            (true, false) => return None,
        };
        let odds = odds.clamp(0.0, 1.0);
        Some(odds / (1.0 + odds))
    }

    /// The statistic in which the records depart most from simulated ones.
    pub fn clearest(&self) -> Option<&Predicted> {
        (self.rows.iter()).max_by(|a, b| a.departure.total_cmp(&b.departure))
    }
}

/// One statistic of the measured records beside simulated ones.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Predicted {
    /// Name: `spread`, `whiteness`, `tails` or `bursts` of an output's standardised one-step residuals, `error` of predictions so far ahead
    /// over the deviation of the output.
    pub statistic: String,
    /// Value of the measured records.
    pub measured: f64,
    /// 90 % of simulated records lie between these.
    pub expected: [f64; 2],
    /// Distance from the mean of simulated records, in their standard deviations.
    pub deviations: f64,
    /// The distance as far as it counts against the twin.
    #[serde(skip)]
    pub(in crate::diagnose) departure: f64,
}

/// Noise that is none: it is larger, in windows of some length, than noise as declared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HiddenDisturbance {
    /// A state, or a sensor.
    pub place: String,
    /// Unit of the disturbance: that of the state per second, or of the output.
    pub unit: String,
    /// Root mean square of the disturbance given the records.
    pub size: f64,
    /// The same where noise is as declared, or fitted where nothing is declared.
    pub expected: f64,
    /// Length of the windows in which it is clearest, in seconds.
    pub time_scale: Option<f64>,
    /// Times in the first record at which it is larger than noise.
    pub bursts: Vec<Burst>,
    /// (time, disturbance) in the first record, for pictures.
    #[serde(skip)]
    pub course: Vec<(f64, f64)>,
}

/// A stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Burst {
    /// First instant, in seconds.
    pub start: f64,
    /// Last instant, in seconds.
    pub end: f64,
}
