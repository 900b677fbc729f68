//! Seeds of a training, derived from one.

use crate::twin::mix;

/// Use of a number drawn from the seed; each has draws of its own.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Weights,
    Split,
    Shuffle,
    Dropout,
}

/// Derives a seed for `purpose` and `counter`, which may be the epoch or the step.
pub(super) fn derive(seed: u64, purpose: Purpose, counter: u64) -> u64 {
    // The seed is mixed, too, lest neighbouring seeds meet at neighbouring counters.
    mix(mix(mix(seed) ^ purpose as u64) ^ counter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn derived_seeds_differ_by_seed_purpose_and_counter() {
        let mut seen = HashSet::new();
        for seed in 0..10 {
            for counter in 0..100 {
                for purpose in [Purpose::Weights, Purpose::Shuffle, Purpose::Dropout] {
                    assert!(seen.insert(derive(seed, purpose, counter)));
                }
            }
        }
    }
}
