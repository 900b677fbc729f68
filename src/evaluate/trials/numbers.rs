//! Numbers of the trials.

numbers! {
    /// Thresholds of scores; sizes of what is drawn, simulated and compared.
    pub(super) const TRIAL: TrialNumbers = {
        /// A twin whose own step shows by more nats than this is no null: its integrator is the gap.
        coarse_step: f64 = 1.0,
        /// A record decides for the truth where every wrong name leaves more nats than this: odds of 20 to 1.
        clear_rival: f64 = 3.0,
        /// Expected information that a diagnosis need not see, in nats.
        faint_gap: f64 = 3.0,
        /// A truth of probability 0 costs as much as one of this.
        least_probability: f64 = 1e-3,
        /// Seeds besides the trial's own.
        other_seeds: u64 = 4,
        /// Iterations of the fit of the twin whose residuals are correlated.
        correlation_iterations: usize = 40,
        /// Probability of a correlation that stands out by chance, over all signals.
        correlation_level: f64 = 0.05,
        /// Largest size of a random law, in units of the twin's own terms.
        largest_law: f64 = 3.0,
        /// A departure may move an output so many times as far as it moves without one; beyond, the system is another.
        output_reach: f64 = 20.0,
        /// Moments of the record at which equations are compared.
        structure_moments: usize = 6,
        /// Step of a difference, as a share of a parameter's prior or of an input's range.
        structure_step: f64 = 1e-3,
        /// Step to another value of a state or input, as a share of its range.
        structure_range: f64 = 0.1,
        /// Relative change of a slope that rounding makes.
        structure_rounding: f64 = 1e-6,
        /// Mean length of a gap, in samples.
        gap_length: f64 = 4.0,
        /// Steps of the integrator within a sample.
        world_substeps: usize = 10,
        /// A state beyond this has diverged, in any unit.
        diverged: f64 = 1e12,
        /// Values of a parameter that a run is made for, where it changes with time.
        parameter_values: usize = 9,
        /// Steps of a lag that is integrated, per sample.
        lag_steps: usize = 20,
        /// Random Fourier features of a sample of a Gaussian process.
        wave_features: usize = 24,
        /// Probability that a trial has a nuisance.
        nuisance_probability: f64 = 0.5,
        /// Factors on declared noise levels: from 0.3 to 3.
        noise_factor: f64 = 3.0,
        /// Measurement noise of a twin that declares none: part of an output's deviation.
        silent_noise: f64 = 0.03,
        /// Trials that are drawn before their records are written.
        trials_in_memory: usize = 64,
        /// Part of the weak prior that is kept: just enough for parameters that no record tells apart.
        known_share: f64 = 1e-4,
        /// Substeps that stand for an exact step of the twin.
        exact_substeps: usize = 20,
        /// Iterations of a fit from the truth.
        truth_iterations: usize = 30,
        /// New units in one old one: from metres to millimetres.
        unit_factor: f64 = 1000.0,
        /// A law that is proportional to its size is not tried at a larger one where its small change leaves more than this share.
        unlike: f64 = 0.9,
        /// Share that is as good as nothing: no search can improve on it.
        nothing_left: f64 = 1e-3,
        /// Sizes on either side of the screened one, as a factor.
        size_reach: f64 = 3.0,
        /// Evaluations of a search.
        size_evaluations: usize = 12,
        /// Draws before a trial is given up.
        truth_attempts: u64 = 60,
        /// First size that is tried: small.
        first_size: f64 = 0.03,
        /// Tries in all.
        size_tries: usize = 10,
        /// A size is taken within this distance of the wanted information, as a logarithm.
        near_wanted: f64 = 0.15,
        /// Farthest that is taken where no nearer one was found.
        far_from_wanted: f64 = 1.0,
        /// Less than this is no departure.
        least_information: f64 = 0.5,
        /// A departure of a pair of whose information the other explains more than nine tenths is the other in another form. Half or twice of it
        /// changes how many pairs are drawn again, not how large the others are.
        own_information: f64 = 0.1,
    }
}
