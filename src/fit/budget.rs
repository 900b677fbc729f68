//! Budget of a fit: its cost, and the tolerances at which it ends.

use crate::likelihood::kalman::FilterError;
use crate::progress::{Cancelled, Progress, put_together};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Iterations of each search: loud noise has a way to go.
pub(crate) const ITERATIONS: usize = 80;

numbers! {
    /// Budget of a fit.
    pub(super) const BUDGET: FitBudget = {
        /// Nats to the best within which a search is carried on.
        near: f64 = 3.0,
        /// Gain in nats at which it then ends.
        polished_gain: f64 = 1e-4,
        /// Random points whose likelihood is looked at with loud noise: its wide valleys are met by few.
        loud_points: u64 = 48,
        /// The same with quiet noise, for each free entry.
        quiet_points: u64 = 64,
        /// Entries that such points are taken for, at most.
        quiet_entries: usize = 8,
        /// Points of either that become starts.
        screened_starts: usize = 3,
        /// Deviations of the prior between two starts that lie apart: nearer ones are mostly of one valley.
        starts_apart: f64 = 1.0,
        /// Nats within which two searches have found the same top.
        same_top: f64 = 0.1,
        /// Times that other starts are tried while only one search ends at the best top.
        more_starts: u64 = 3,
        /// Samples that are filtered to look along all axes through the best top: a fifth of a fit of few parameters. Half as many miss waves
        /// of a tenth of the record, twice as many find those of a fortieth.
        scan_samples: usize = 400_000,
        /// Points of an axis: fewer than the first say nothing of other tops, more than the second are of no use.
        scan_points: (usize, usize) = (24, 512),
        /// Way that is looked at, on both sides of the prior's centre, in its deviations.
        scan_reach: f64 = 3.0,
        /// Simplex searches one after another where a climb ends at a kink, at most; their steps for each entry, and the standard deviation of the
        /// simplex's values in nats at which one ends.
        kink_rounds: usize = 4,
        simplex_steps: u64 = 40,
        simplex_end: f64 = 0.02,
        /// Distance from the top that counts as arrived, in standard deviations: what is left to gain is its square's half, 0.02 nats.
        arrived: f64 = 0.2,
        /// The same where three searches, or most of them, end at one top: dry friction and thresholds make kinks, and at a kink no gradient vanishes.
        agreed: f64 = 1.0,
        /// Searches from points of the prior in a round.
        restarts: u64 = 3,
        /// Rounds of them at most.
        restart_rounds: u64 = 3,
        /// Gain in nats by which a restart shows that the searches had not arrived.
        restart_gain: f64 = 0.5,
        /// Nats by which a fit with effects may end below one without, since the priors of the effects count, too.
        below_without: f64 = 0.5,
        /// Searches from posterior draws that are better than the best fit, at most.
        restarts_from_draws: usize = 6,
        /// Shares of the records that a black box is fitted to before the whole of them.
        grown_shares: [f64; 2] = [0.25, 0.5],
        /// Rows that tell where the tops of a long record are: searches begin there, and those that meet there end on all of it as one. They save
        /// half of a fit of 100 000 rows, and nothing where a record begins at rest. Half and twice as many have not been tried.
        sketched_rows: usize = 2000,
        /// The same as a share, where that is more: each sketch then tells the next, ten times longer, where to begin.
        sketched_share: f64 = 0.1,
        /// Best fits that go on to the next share.
        grown_kept: usize = 2,
        /// Random points whose likelihood is looked at over the first share.
        grown_points: u64 = 32,
        /// Points of these that become starts.
        grown_starts: usize = 4,
        /// Trial points of a search of a black box, at most.
        grown_iterations: usize = 25,
        /// Samples that are filtered in a round of posterior draws, and of which what filters side by side saw is held at once.
        round_samples: usize = 200_000,
        /// Draws that makes at least.
        least_draws: usize = 100,
        /// Draws that makes at most.
        most_draws: usize = 500,
        /// Draws of the last round for each that is asked for: weights are uneven, and fewer would repeat draws.
        draws_each: usize = 4,
        /// Rounds of adaptation where draws are asked for, or are to be steady; else one.
        adaptations: usize = 3,
        /// Effective draws of a first round, as a share of it, from which no other follows unless a number of draws is asked for: of a
        /// normal posterior of four entries they are 0.86, of twelve 0.69. Twice is more than any has; with half, a tenth of the draws makes most of an interval.
        even_weights: f64 = 0.7,
        /// Share of the first proposals' covariance in those that follow their draws.
        kept_covariance: f64 = 0.05,
        /// Nats below the best top within which another counts: a mode with a thousandth of the mass is none.
        counting_top: f64 = 7.0,
        /// Standard deviations between two tops of their own.
        tops_apart: f64 = 3.0,
        /// Gain in nats at which a draw is better than the fit.
        better_draw: f64 = 0.1,
        /// Draws that count, for each entry of φ: weights are flattened until so many do, so that a proposal follows more than a few draws.
        counting_draws: f64 = 4.0,
        /// Different posterior draws that intervals need: three of them lie beyond an end at 0.9.
        interval_draws: usize = 60,
        /// Draws for each parameter that a covariance needs.
        region_draws: usize = 10,
        /// Samples that are filtered in a round of draws for the evidence.
        evidence_samples: usize = 400_000,
        /// Draws that makes at least.
        least_evidence_draws: usize = 200,
        /// Draws that makes at most.
        most_evidence_draws: usize = 1000,
        /// Monte-Carlo error of the evidence in nats that is small enough.
        evidence_error: f64 = 0.03,
        /// Draws for each control variate that is used, at least: with half, the error that is told is a tenth too small.
        draws_a_control: usize = 10,
        /// Draws from which none are used: their error is small enough, and each control is a number a draw.
        controlled_draws: usize = 20_000,
        /// Rounds for which more draws are taken, at most.
        evidence_rounds: usize = 4,
        /// Effective draws below which these say less of the evidence than Laplace.
        effective_draws: f64 = 30.0,
        /// Damping of the first step, and the least one: far from the top the information is often too small.
        first_damping: f64 = 0.1,
        least_damping: f64 = 1e-6,
        /// Largest entry of a step in φ that is not worth a pass.
        least_step: f64 = 1e-9,
        /// Damping beyond which no step helps.
        most_damping: f64 = 1e5,
        /// Damping after the first rejected step, at least.
        rejected_damping: f64 = 1e-3,
        /// Steps may be so many times the longest of an entry where entries answer each other.
        longer_steps: f64 = 2.0,
        /// A step that promises less than this share of the gain at which a search ends is not tried.
        least_promise: f64 = 0.2,
        /// Share of the variance of a free run's error that must go with the process noise before a fit speaks of it. A quarter of it is seen beside
        /// twins that lack a little, too; of twice as much, nothing would be left.
        swallowed: f64 = 0.5,
        /// Nats by which a rule must move the innovations, θ free to answer, to be fitted at all: less is hardly 2 nats of a gain.
        hold_shows: f64 = 1.0,
        /// Nats from which another rule becomes that of the twin: 20 to 1, as the user is then asked to change the study. Twice asks two records in a
        /// hundred fewer whose inputs are sampled; half takes noise for a rule in one of twenty.
        hold_wins: f64 = 3.0,
        /// Factor to a fine step from any: the error of a fourth-order rule falls to a 256th, as that of Euler's does with its square nearly. Twice
        /// costs twice the passes; half leaves a sixteenth, which may still decide.
        finer_step: usize = 4,
        /// A direction that θ imitates up to this share of its square is no direction of its own.
        collinear: f64 = 1e-3,
        /// Pull of the prior on a value, in standard errors, from which its interval is the profile's. At a quarter an interval of 90 % about the pulled
        /// value misses the truth 11 times in 100; at a half 14 times, at one 26 times.
        pull: f64 = 0.25,
        /// Variance over that without the prior, from which down it is as well: the prior then makes an interval 5 % narrower than the records do; at half
        /// that, 2.5 %.
        narrowed: f64 = 0.9,
        /// Information that directions have of which the records say nothing, as a share of that with the prior.
        no_information: f64 = 1e-6,
        /// Parts of the way to the end of the interval, in √(max ℓ − ℓ), that a step should make.
        profile_parts: f64 = 3.0,
        /// Fits on a side, at most: steps double, so that with half of them a parameter that is not identified ends early at a thousand errors.
        most_profile_fits: usize = 20,
        /// Points on a side, at least: a curve of fewer has corners.
        least_profile_points: usize = 6,
        /// Secants to an end, at most, and the error of √(max ℓ − ℓ) that is small enough: a hundredth of a standard error.
        secants: usize = 4,
        profile_error: f64 = 0.007,
        /// Length of an axis over the longest at which it is none: a start that is known, say.
        least_axis: f64 = 1e-9,
        /// Share of the draws that a top must have for the region to hold it: a 90 % interval misses a tenth. Tops along one ridge share it, and
        /// the best of them may have little of it; a far top of less mass would make the region larger than what the records leave open.
        least_share: f64 = 0.05,
        /// Points over bounds and prior whose eigenvalues are looked at: no pass of a filter.
        spectral_points: u64 = 512,
        /// Points that become starts.
        spectral_starts: usize = 2,
        /// Largest damping ratio of a pole that swings: beyond, it shows less than one cycle.
        damped: f64 = 0.6,
        /// Fastest swing that is told, in parts of half the sampling rate.
        fastest: f64 = 0.8,
        /// Ridge of the regression, as a share of its mean square.
        spectral_ridge: f64 = 1e-9,
    }
}

/// Passes over a record, of a filter or of an ensemble of simulations, with or without derivatives. Clones share the count, and end together
/// once a listener asks to stop.
#[derive(Clone, Default)]
pub(crate) struct Passes(Arc<Counted>);

#[derive(Default)]
struct Counted {
    passes: AtomicU64,
    /// Listener that may ask to stop; silent by default.
    progress: Progress,
    /// `true` once nobody is asked any more.
    goes_on: AtomicBool,
}

impl Passes {
    /// Passes that end when `progress` is cancelled.
    pub fn heard_by(progress: &Progress) -> Self {
        Self(Arc::new(Counted {
            progress: progress.clone(),
            ..Counted::default()
        }))
    }

    /// Counts so many more; fails once the work is to stop.
    pub fn count(&self, more: usize) -> Result<(), Cancelled> {
        self.0.passes.fetch_add(more as u64, Ordering::Relaxed);
        match self.0.goes_on.load(Ordering::Relaxed) {
            true => Ok(()),
            false => self.0.progress.checkpoint(),
        }
    }

    /// Lets the passes go on from here whoever asks: what was found is put together.
    pub fn go_on(&self) {
        self.0.goes_on.store(true, Ordering::Relaxed);
        put_together(true);
    }

    /// Asks again.
    fn ask(&self) {
        self.0.goes_on.store(false, Ordering::Relaxed);
        put_together(false);
    }

    pub fn so_far(&self) -> u64 {
        self.0.passes.load(Ordering::Relaxed)
    }
}

/// The stages of a fit behind its search. Where a partial answer is wanted, those that are left once the work is to stop are skipped.
pub(crate) struct FitStages {
    passes: Passes,
    gives_partial: bool,
    is_cut: bool,
}

impl FitStages {
    pub fn new(passes: &Passes, gives_partial: bool) -> Self {
        Self {
            passes: passes.clone(),
            gives_partial,
            is_cut: false,
        }
    }

    /// Returns what a stage finds, or `without` where the work is to stop.
    pub fn of<T>(
        &mut self,
        without: T,
        stage: impl FnOnce() -> Result<T, FilterError>,
    ) -> Result<T, FilterError> {
        if self.is_cut {
            return Ok(without);
        }
        match stage() {
            Err(error) if self.gives_partial && error.is_cancelled() => {
                self.is_cut = true;
                // The answer is put together yet.
                self.passes.go_on();
                Ok(without)
            }
            found => found,
        }
    }

    /// Returns what work finds that no answer can do without: it goes on whoever asks.
    pub fn whole<T>(&self, work: impl FnOnce() -> T) -> T {
        if !self.gives_partial || self.is_cut {
            return work();
        }
        self.passes.go_on();
        let found = work();
        self.passes.ask();
        found
    }

    /// Returns whether stages were skipped.
    pub fn are_cut(&self) -> bool {
        self.is_cut
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Listener;

    struct Stop;
    impl Listener for Stop {
        fn advanced(&self, _: &str, _: u64, _: u64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }

    #[test]
    fn passes_end_when_they_are_asked_to_until_the_end_is_at_hand() {
        let passes = Passes::heard_by(&Progress::new(Arc::new(Stop)));
        let shared = passes.clone();
        assert!(shared.count(1).is_err());
        passes.go_on();
        assert!(shared.count(1).is_ok());
        assert_eq!(passes.so_far(), 2);
        assert!(Passes::default().count(1).is_ok());
    }

    #[test]
    fn stages_are_skipped_once_the_work_is_to_stop() {
        let passes = Passes::heard_by(&Progress::new(Arc::new(Stop)));
        let stage = || Ok(passes.count(1).map(|()| 1)?);
        assert!(FitStages::new(&passes, false).of(0, stage).is_err());
        let mut stages = FitStages::new(&passes, true);
        assert!(stages.whole(stage).is_ok());
        assert!(!stages.are_cut() && passes.count(1).is_err());
        assert_eq!(stages.of(0, stage).unwrap(), 0);
        assert!(stages.are_cut() && passes.count(1).is_ok());
        assert_eq!(
            stages.of(0, || Ok(1)).unwrap(),
            0,
            "what is left is skipped"
        );
    }
}
