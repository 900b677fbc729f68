//! Seeds of a training, derived from one.

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
    // The finaliser of SplitMix64; the seed passes it too, lest neighbouring seeds meet at neighbouring counters.
    let scramble = |state: u64| {
        let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    scramble(scramble(scramble(seed) ^ purpose as u64) ^ counter)
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
