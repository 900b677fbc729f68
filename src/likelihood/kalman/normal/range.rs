//! A standard normal number behind a sensor whose range ends.

use super::Known;
use std::f64::consts::TAU;

/// Beyond the nearer end of half a line, or beyond 0, in standard deviations: nothing is so far out.
const FAR: f64 = 50.0;
/// Share of readings beyond the range that come as noise would bring them: 14 nats for each, where the range says that there is none. A hundredth of it
/// makes these 18 nats.
const WRONG: f64 = 1e-6;

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

    /// The reading of a sensor that shows it between `low` and `high`, and these ends beyond them, with a jitter of `width`:
    ///
    /// ```text
    /// y = clamp(z, low, high) + width·n,   z, n ~ N(0, 1)
    /// ```
    ///
    /// Inside the range z is the reading, but for the jitter; at an end all of a tail is possible. The jitter makes readings at an end,
    /// which come with a probability, comparable with the others, which have a density. Beyond an end, a reading may also be off by `noise`,
    /// so that a range that is a little wrong is not wrong beyond all bounds.
    pub fn in_range(reading: f64, (low, high): (f64, f64), width: f64, noise: f64) -> Self {
        // z given the reading, were there no ends.
        let spread = 1.0 + width * width;
        let (centre, deviation) = (reading / spread, width / spread.sqrt());
        let within = Self::between((low - centre) / deviation, (high - centre) / deviation);
        let inside = Self {
            log_density: within.log_density - 0.5 * (reading * reading / spread + spread.ln()),
            mean: centre + deviation * within.mean,
            variance: deviation * deviation * within.variance,
        };
        let at = |off: f64, beyond: Self| {
            let kernel = |width: f64| -0.5 * (off / width).powi(2) - width.ln();
            let (near, wide) = (kernel(width), kernel(noise.hypot(width)));
            let kernel = match off > 0.0 {
                true => near.max(WRONG.ln() + wide),
                false => near,
            };
            Self {
                log_density: beyond.log_density + kernel,
                ..beyond
            }
        };
        let (open_low, open_high) = (f64::NEG_INFINITY, f64::INFINITY);
        let below = (low.is_finite()).then(|| at(low - reading, Self::between(open_low, low)));
        let above = (high.is_finite()).then(|| at(reading - high, Self::between(high, open_high)));
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

    /// Density, mean and variance of z, by the trapezoidal rule, for a jitter that is narrow, and for one as wide as the noise.
    #[test]
    fn readings_at_an_end_tell_a_tail() {
        for (low, high) in [
            (f64::NEG_INFINITY, 0.7),
            (-1.2, f64::INFINITY),
            (-0.5, 0.4),
            (1.5, 4.0),
        ] {
            for width in [0.02, 1.0] {
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
                        let density = (-0.5 * (z * z + off * off)).exp() * step;
                        for (sum, power) in sums.iter_mut().zip([1.0, z, z * z]) {
                            *sum += density * power;
                        }
                    }
                    let (mean, square) = (sums[1] / sums[0], sums[2] / sums[0]);
                    let expected = Known {
                        log_density: (sums[0] / (TAU.sqrt() * width)).ln(),
                        mean,
                        variance: square - mean * mean,
                    };
                    let known = Known::in_range(reading, (low, high), width, width);
                    let place = format!("{reading} in {low} to {high}: {known:?}, {expected:?}");
                    for (found, expected) in [
                        (known.log_density, expected.log_density),
                        (known.mean, expected.mean),
                        (known.variance, expected.variance),
                    ] {
                        assert!((found - expected).abs() < 1e-3, "{place}");
                    }
                }
            }
        }
    }

    /// Far ends are not felt, and readings that cannot be have a bound.
    #[test]
    fn a_range_that_is_far_is_none() {
        let known = Known::in_range(0.3, (-40.0, 1e9), 1e-3, 0.5);
        assert!((known.log_density + 0.045).abs() < 1e-6 && (known.mean - 0.3).abs() < 1e-6);
        assert!((known.variance - 1e-6).abs() < 1e-9);
        for (low, high) in [(0.0, 1.0), (-90.0, -80.0), (1e6, f64::INFINITY)] {
            let known = Known::in_range(500.0, (low, high), 1e-3, 0.5);
            assert!(known.log_density.is_finite() && known.mean.is_finite());
        }
        let beyond = Known::in_range(1.5, (f64::NEG_INFINITY, 1.0), 1e-3, 0.5);
        assert!(beyond.log_density > -17.0, "{beyond:?}");
    }
}
