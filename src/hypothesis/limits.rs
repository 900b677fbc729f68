//! Sizes and thresholds of terms, and of the search for them.

numbers! {
    /// Ranges in which the magnitudes of terms are searched, and when two of them are one.
    pub(crate) const TERM: TermLimits = {
        /// Moments of each record at which equations are compared: many more than a law that is not the same could agree at by chance.
        moments: usize = 48,
        /// Largest share of a term's square that another one may not have: rounding makes 10⁻²⁰, and 10⁻³ would show at thousands of nats alone.
        same_square: f64 = 1e-6,
        /// Share of the range by which a function's is wider at each end: its terms vanish at the ends.
        margin: f64 = 0.2,
        /// Most states for which functions of any two are rivals; beyond, only those with the state's own value.
        most_states: usize = 4,
        /// Frequencies in 1/T that are tried: half a cycle apart, since a gain falls off within one; the slow ones in any case, up to eight cycles.
        frequencies_per_cycle: f64 = 2.0,
        slow: usize = 16,
        /// Nats for a mark that outputs bear, such as repeated values of a quantiser.
        mark_present: f64 = 12.0,
        /// Longest lag or delay, as a share of the record: a longer one shows fewer than four times, and passes for the twin's own motion. At half
        /// of it, a delay of 0.15 records is told as two shorter ones.
        longest: f64 = 0.25,
        /// Shortest lag or delay, in steps. A delay of a fifth of a step is worth 127 nats where noise is a hundredth of the signal, and a lag that may not
        /// be as short was named in its place. At half of it there are few nats to tell.
        shortest: f64 = 0.05,
        /// Times of a change that are tried, evenly over the record.
        times: usize = 9,
        /// Share of the span of a state by which a level may lie beyond it: the twin that lacks the threshold follows the record with other values of
        /// the state, and where its scale shows in no output, with any. Without it, a ceiling of tanks ended 2 nats short.
        beyond: f64 = 0.5,
        /// Longest step of a fit to a level, in its range. A step that is cut is cut for θ, too: with 0.15, diagnoses of real tanks with a ceiling
        /// ended 50 nats short.
        longest_to_level: f64 = 0.5,
        /// Time constants of signals of a black box, whose functions are not screened.
        lags_of_box: usize = 3,
        /// Correlation from which an output shows nothing but a state, and its traces are those of the state.
        same_trace: f64 = 0.999,
        /// Multiples of the frequency: symmetric laws answer in odd ones, others in the second first.
        harmonics: usize = 3,
        /// Share of a signal's variance that a line must hold: a square wave's first harmonic holds 0.8, a saw tooth's 0.6. Of inputs that draw a
        /// level anew twelve times a record a quarter pass, of 24 times none; at 0.4 half of the first pass, at 0.6 few, and no saw tooth does.
        line: f64 = 0.5,
        /// Cycles of the record from which a line is one.
        least_cycles: f64 = 1.5,
        /// Points of a periodogram for each cycle of the record.
        periodogram_points: usize = 8,
        /// Change of a magnitude whose consequences are looked at, as a share of where fits start; where those are far off, of what the rates vary.
        change: f64 = 1e-3,
        /// Factor to a change that is seen from one that is not, and how often it is looked for.
        farther: f64 = 1e5,
        looks: usize = 5,
    }
}

impl TermLimits {
    /// Share of a function's whole range at each end that the records do not show.
    pub(crate) fn unseen(&self) -> f64 {
        self.margin / (1.0 + 2.0 * self.margin)
    }
}

numbers! {
    /// Numbers of starts and iterations of a search, and the nats that it decides by.
    pub(crate) const SEARCH: SearchBudget = {
        /// Nats from which another kind of noise becomes that of a fit: 20 to 1. With half of it, one record in a hundred of constant noise gets one
        /// that grows; with twice as many, a share of 5 % is missed where the signal moves by less than itself.
        asked_noise: f64 = 3.0,
        /// Nats that a score must promise of such a kind for it to be fitted at all: a third of the above, as the likelihood is not quadratic. With
        /// half, one record in five of constant noise pays for the fit; with twice, shares go unseen that are just worth it.
        noise_promise: f64 = 1.0,
        /// Functions that are refitted, of those of one or two variables: what they promise says little of what a refit gains. With 5, the mean
        /// logarithm of the probability of the truth is −1.75 on open trials, with 12 −1.34, in 1.35 times the time.
        functions: usize = 12,
        /// Functions that are refitted where it is known about what is missing.
        few_functions: usize = 3,
        /// Distance to the best, in nats, within which a single effect may still be the explanation.
        candidates: f64 = 6.0,
        /// Evidence up to which few hypotheses are refitted: nothing seems to be missing.
        null_like: f64 = 4.0,
        /// Evidence by which a fit from elsewhere must be better to count: fits end where they promise a hundredth of it.
        better: f64 = 1.0,
        /// Evidence from which fits begin with loud noise, too: where much is missing, the likelihood of quiet noise has narrow valleys.
        deep: f64 = 30.0,
        /// Highest frequency that is tried beside those of the residuals, in sampling rates.
        highest_frequency: f64 = 0.2,
        /// Most of them; a longer record has them closer together and more of them, each of more samples.
        most_frequencies: usize = 2000,
        /// Iterations at each level of held noise, and those of the free fit that follows.
        held: usize = 6,
        released: usize = 40,
        /// Iterations of a fit from the prior's centre, and starts of a term with a time, a delay or a shape.
        afresh: usize = 10,
        afresh_shapes: usize = 4,
        /// Most iterations of the fits that are carried on: they end as soon as a step promises nothing, most of them after a few.
        carried: usize = 60,
        /// Points at which a law is looked at, over three times what the record spans on both sides of zero.
        fold_points: usize = 601,
        fold_reach: f64 = 3.0,
        /// Most signals that are told apart at a row.
        fold_sides: usize = 4,
        /// Peaks of each periodogram.
        peaks: usize = 3,
        /// Starts of a term in its first fit; those near the best begin from more, later.
        first_starts: usize = 2,
        /// Starts of an effect with a time, a delay or a shape, each of which has a valley of its own, if it stands out. With 3, a delay beside a lag
        /// was 52 nats short on an open trial; 12 take 8 % more time in all.
        starts_of_shape: usize = 12,
        /// Nats that averaging over its size takes off an effect that nothing speaks for.
        averaged: f64 = 2.0,
        /// Nats below the best, with noise half-way down, from which an effect is given up: loud noise makes differences smaller than they will be.
        lost: f64 = 25.0,
        /// Iterations of a fit that is carried on to its end.
        to_the_end: usize = 40,
        /// Nats that the best of all frequencies is worth less than it looks, before a refit says how sharp it is.
        price_of_frequency: f64 = 2.5,
        /// Places from which the same law begins again elsewhere.
        places: usize = 2,
        /// Iterations before a new start is compared with the old end.
        begun_again: usize = 12,
        /// Samples of the first move of a time or a delay, doubled up to a quarter of the distance between the times that are tried: the likelihood
        /// has a kink at each sample, and θ moves with the time.
        first_move: f64 = 0.5,
        /// Most times that the best effects move on.
        rounds: usize = 6,
        /// Times in place of one that was tried first, where the same law explains more at another place: a peak of the likelihood can be a
        /// fortieth of the record wide. Half as many miss it, twice as many cost as much again as the rest of the fit.
        closer: usize = 4,
        /// Iterations with which θ and the size answer a time, beginning with the answer to the one before.
        answers: usize = 3,
    }
}
