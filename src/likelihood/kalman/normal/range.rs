//! A standard normal number behind a sensor whose range ends.

use super::Known;
use std::f64::consts::TAU;

/// Beyond the nearer end of half a line, or beyond 0, in standard deviations: nothing is so far out.
const FAR: f64 = 50.0;

impl Known {
    /// That it lies between `low` and `high`, of which any may be infinite; with the log of this probability in place of the density.
    pub fn between(low: f64, high: f64) -> Self {
        let (low, high) = match (low.is_finite(), high.is_finite()) {
            (true, true) => (low, high),
            (true, false) => (low, low.max(0.0) + FAR),
            (false, true) => (high.min(0.0) - FAR, high),
            (false, false) => (-FAR, FAR),
        };
        let known = Self::in_cell(0.5 * (low + high), high - low);
        Self {
            log_density: known.log_density + (high - low).ln() - 0.5 * TAU.ln(),
            ..known
        }
    }

    /// The reading of a sensor that shows it between `low` and `high`, and these ends beyond them, with a jitter of `width`.
    ///
    /// ```text
    /// p(y)·√2π = exp(−y²/2)·P(low < y + width·n < high) + (P(z < low)·exp(−(y − low)²/2·width²) + P(z > high)·…)/width,   n ~ N(0, 1)
    /// ```
    ///
    /// Inside the range z is the reading; at an end all of a tail is possible. The jitter makes readings at an end, which come with a
    /// probability, comparable with the others, which have a density.
    pub fn in_range(reading: f64, (low, high): (f64, f64), width: f64) -> Self {
        let inside = Self::between((low - reading) / width, (high - reading) / width).log_density;
        let inside = Self {
            log_density: inside - 0.5 * reading * reading,
            mean: reading,
            variance: 0.0,
        };
        let at = |end: f64, beyond: Self| {
            let off = (reading - end) / width;
            Self {
                log_density: beyond.log_density - width.ln() - 0.5 * off * off,
                ..beyond
            }
        };
        let below = low
            .is_finite()
            .then(|| at(low, Self::between(f64::NEG_INFINITY, low)));
        let above = high
            .is_finite()
            .then(|| at(high, Self::between(high, f64::INFINITY)));
        let all = || std::iter::once(inside).chain(below).chain(above);
        let most = all().fold(f64::NEG_INFINITY, |most, part| most.max(part.log_density));
        let weight = |part: &Self| (part.log_density - most).exp();
        let sum: f64 = all().map(|part| weight(&part)).sum();
        let mean = all().map(|part| weight(&part) * part.mean).sum::<f64>() / sum;
        let square = |part: Self| part.variance + (part.mean - mean).powi(2);
        Self {
            log_density: most + sum.ln(),
            mean,
            variance: all().map(|part| weight(&part) * square(part)).sum::<f64>() / sum,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Density, mean and variance of z and of readings, by the trapezoidal rule over both z and the jitter.
    #[test]
    fn readings_at_an_end_tell_a_tail() {
        let width = 0.02;
        for (low, high) in [
            (f64::NEG_INFINITY, 0.7),
            (-1.2, f64::INFINITY),
            (-0.5, 0.4),
            (1.5, 4.0),
        ] {
            for reading in [low, high, low + 0.03, high - 0.05, high + 0.01, 0.1] {
                let is_far = reading < low - 5.0 * width || reading > high + 5.0 * width;
                if is_far || !reading.is_finite() {
                    continue;
                }
                let mut sums = [0.0; 3];
                let step = 1e-4;
                for i in 0..160_001 {
                    let z = f64::from(i) * step - 8.0;
                    let off = (reading - z.max(low).min(high)) / width;
                    let density = (-0.5 * (z * z + off * off)).exp() / (TAU.sqrt() * width) * step;
                    for (sum, power) in sums.iter_mut().zip([1.0, z, z * z]) {
                        *sum += density * power;
                    }
                }
                let (mean, square) = (sums[1] / sums[0], sums[2] / sums[0]);
                let known = Known::in_range(reading, (low, high), width);
                let place = format!("{reading} in {low} to {high}: {known:?}, {sums:?}");
                assert!((known.log_density - sums[0].ln()).abs() < 0.01, "{place}");
                assert!((known.mean - mean).abs() < 0.01, "{place}");
                assert!(
                    (known.variance - (square - mean * mean)).abs() < 1e-3,
                    "{place}"
                );
            }
        }
    }

    #[test]
    fn a_range_that_is_far_is_none() {
        let known = Known::in_range(0.3, (-40.0, 1e9), 1e-3);
        assert!((known.log_density + 0.045).abs() < 1e-12 && (known.mean - 0.3).abs() < 1e-12);
        assert!(known.variance < 1e-12);
        for (low, high) in [(0.0, 1.0), (-90.0, -80.0), (1e6, f64::INFINITY)] {
            let known = Known::in_range(500.0, (low, high), 1e-3);
            assert!(known.log_density.is_finite() && known.mean.is_finite());
        }
    }
}
