//! Noise as a value: independent streams by name, so that nothing shifts anything else.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// All the randomness of one simulation, named by (seed, purpose, sample).
///
/// [`source`](Self::source) opens an independent ChaCha stream for one physical source of noise. A draw depends
/// on (seed, purpose, sample, source name, position) alone: neither the number of threads, nor the order of
/// simulations, nor an effect added to the twin changes it. Two runs with the same `Noise` and different
/// parameters use the *same* draws (common random numbers), which finite differences need.
///
/// ```
/// use truetwin::twin::Noise;
/// let noise = Noise::new(1, "bank", 7);
/// let first = noise.source("process/h1").normal();
/// noise.source("added by an effect").normal();
/// assert_eq!(noise.source("process/h1").normal(), first);
/// assert_eq!(Noise::OFF.source("process/h1").normal(), 0.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noise {
    key: Option<(u64, u64)>,
}

impl Noise {
    /// No noise: every normal draw is zero.
    pub const OFF: Self = Self { key: None };

    /// Sample number `sample` of a `purpose` (`"bank"`, `"gate"`, …) under a user's `seed`.
    pub fn new(seed: u64, purpose: &str, sample: u64) -> Self {
        Self {
            key: Some((mix(seed ^ hash(purpose)), sample)),
        }
    }

    /// Another independent value under the same seed and sample: `noise.child("cloud")`.
    #[must_use]
    pub fn child(self, purpose: &str) -> Self {
        Self {
            key: self
                .key
                .map(|(key, sample)| (mix(key ^ hash(purpose)), sample)),
        }
    }

    /// Sample number `index` of a family that shares this value's key.
    #[must_use]
    pub fn sample(self, index: u64) -> Self {
        Self {
            key: self
                .key
                .map(|(key, sample)| (mix(key ^ mix(sample)), index)),
        }
    }

    /// The stream of one source of noise. The same name gives the same stream again.
    pub fn source(self, name: &str) -> Source {
        Source(self.key.map(|(key, sample)| {
            let mut rng = ChaCha8Rng::seed_from_u64(key ^ mix(hash(name)));
            rng.set_stream(sample);
            rng
        }))
    }

    /// One number for simulators that seed themselves (external programs); `None` asks for no noise.
    pub fn seed(self) -> Option<u64> {
        self.key.map(|(key, sample)| mix(key ^ mix(sample)))
    }

    /// Tells whether this is [`Noise::OFF`].
    pub fn is_off(self) -> bool {
        self.key.is_none()
    }
}

/// Draws of one source of noise.
#[derive(Debug, Clone)]
pub struct Source(Option<ChaCha8Rng>);

impl Source {
    /// Standard normal; 0 when the noise is off.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        self.0
            .as_mut()
            .map_or(0.0, |rng| StandardNormal.sample(rng))
    }

    /// Uniform in [0, 1); ½ when the noise is off.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        self.0.as_mut().map_or(0.5, |rng| rng.r#gen::<f64>())
    }

    /// `true` with `probability`; never when the noise is off.
    #[inline]
    pub fn happens(&mut self, probability: f64) -> bool {
        self.0
            .as_mut()
            .is_some_and(|rng| rng.r#gen::<f64>() < probability)
    }
}

/// Finaliser of SplitMix64: every bit of the result depends on every bit of `z`.
pub(crate) fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// FNV-1a: stable across platforms and versions, unlike the standard library's hasher.
fn hash(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |h, byte| {
        (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draws(noise: Noise, name: &str) -> Vec<f64> {
        let mut source = noise.source(name);
        (0..4000).map(|_| source.normal()).collect()
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64
    }

    /// Names, samples, purposes and seeds each give an independent stream: correlations stay within 4.5/√n.
    #[test]
    fn streams_are_independent() {
        let reference = draws(Noise::new(1, "bank", 7), "process/h1");
        for other in [
            draws(Noise::new(1, "bank", 7), "process/h2"),
            draws(Noise::new(1, "bank", 8), "process/h1"),
            draws(Noise::new(1, "gate", 7), "process/h1"),
            draws(Noise::new(2, "bank", 7), "process/h1"),
            draws(Noise::new(1, "bank", 7).child("x"), "process/h1"),
        ] {
            assert!(correlation(&reference, &other).abs() < 4.5 / 4000f64.sqrt());
        }
        let variance = correlation(&reference, &reference);
        assert!((variance - 1.0).abs() < 4.5 * (2.0 / 4000f64).sqrt());
    }

    /// Seeds are contracts: a change here changes every recorded result.
    #[test]
    fn draws_are_pinned() {
        let mut source = Noise::new(42, "bank", 3).source("process/h1");
        let pinned: Vec<_> = (0..3).map(|_| source.normal()).collect();
        assert_eq!(pinned, PINNED);
        assert_eq!(Noise::new(42, "bank", 3).seed(), Some(PINNED_SEED));
    }
    const PINNED: [f64; 3] = [-0.6290930657632117, 0.9777807088393383, 0.03491544003854599];
    const PINNED_SEED: u64 = 13_512_303_037_336_073_592;

    #[test]
    fn off_is_silent() {
        let mut source = Noise::OFF.source("any");
        assert_eq!((source.normal(), source.uniform()), (0.0, 0.5));
        assert!(!source.happens(1.0));
        assert!(Noise::OFF.child("x").is_off());
    }
}
