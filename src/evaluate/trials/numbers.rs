//! Numbers of the trials.

/// Thresholds of scores; sizes of what is drawn, simulated and compared.
pub(super) struct TrialNumbers {
    /// A twin whose own step shows by more nats than this is no null: its integrator is the gap.
    pub coarse_step: f64,
    /// A record decides for the truth where every wrong name leaves more nats than this: odds of 20 to 1.
    pub clear_rival: f64,
    /// Expected information that a diagnosis need not see, in nats.
    pub faint_gap: f64,
    /// A truth of probability 0 costs as much as one of this.
    pub least_probability: f64,
    /// Seeds besides the trial's own.
    pub other_seeds: u64,
    /// Iterations of the fit of the twin whose residuals are correlated.
    pub correlation_iterations: usize,
    /// Probability of a correlation that stands out by chance, over all signals.
    pub correlation_level: f64,
    /// Largest size of a random law, in units of the twin's own terms.
    pub largest_law: f64,
    /// A departure may move an output so many times as far as it moves without one; beyond, the system is another.
    pub output_reach: f64,
    /// Moments of the record at which equations are compared.
    pub structure_moments: usize,
    /// Step of a difference, as a share of a parameter's prior or of an input's range.
    pub structure_step: f64,
    /// Step to another value of a state or input, as a share of its range.
    pub structure_range: f64,
    /// Relative change of a slope that rounding makes.
    pub structure_rounding: f64,
    /// Mean length of a gap, in samples.
    pub gap_length: f64,
    /// Steps of the integrator within a sample.
    pub world_substeps: usize,
    /// A state beyond this has diverged, in any unit.
    pub diverged: f64,
    /// Values of a parameter that a run is made for, where it changes with time.
    pub parameter_values: usize,
    /// Steps of a lag that is integrated, per sample.
    pub lag_steps: usize,
    /// Random Fourier features of a sample of a Gaussian process.
    pub wave_features: usize,
    /// Probability that a trial has a nuisance.
    pub nuisance_probability: f64,
    /// Factors on declared noise levels: from 0.3 to 3.
    pub noise_factor: f64,
    /// Measurement noise of a twin that declares none: part of an output's deviation.
    pub silent_noise: f64,
    /// Trials that are drawn before their records are written.
    pub trials_in_memory: usize,
}

pub(super) const TRIAL: TrialNumbers = TrialNumbers {
    coarse_step: 1.0,
    clear_rival: 3.0,
    faint_gap: 3.0,
    least_probability: 1e-3,
    other_seeds: 4,
    correlation_iterations: 40,
    correlation_level: 0.05,
    largest_law: 3.0,
    output_reach: 20.0,
    structure_moments: 6,
    structure_step: 1e-3,
    structure_range: 0.1,
    structure_rounding: 1e-6,
    gap_length: 4.0,
    world_substeps: 10,
    diverged: 1e12,
    parameter_values: 9,
    lag_steps: 20,
    wave_features: 24,
    nuisance_probability: 0.5,
    noise_factor: 3.0,
    silent_noise: 0.03,
    trials_in_memory: 64,
};
