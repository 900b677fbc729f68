//! Times of rows with one step, as people write them.

/// Times of rows k = 0, 1, …:
///
/// ```text
/// t_k = (first + k·step)/scale
/// ```
///
/// Where Δt and the first time have few decimal places, all three are whole numbers, and t_k is the double nearest to the decimal: row 3 of a
/// step of 0.1 s is at 0.3 s, as a file says it, and not at 3·0.1 = 0.30000000000000004 s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clock {
    first: f64,
    step: f64,
    scale: f64,
}

impl Clock {
    /// The clock of a step of `dt` seconds whose row 0 is at `first` seconds.
    pub fn new(dt: f64, first: f64) -> Self {
        // 10²² is the largest power of ten that is a double.
        let scales = (0..=22).map(|places| 10f64.powi(places));
        let decimal = |scale| Some((decimal_step(dt, scale)?, decimal_time(first, scale)?, scale));
        let (step, first, scale) = scales
            .into_iter()
            .find_map(decimal)
            .unwrap_or((dt, first, 1.0));
        Self { first, step, scale }
    }

    /// Seconds from row 0 to row k.
    pub fn since(&self, k: usize) -> f64 {
        k as f64 * self.step / self.scale
    }

    /// Time of row k.
    pub fn time(&self, k: usize) -> f64 {
        (self.first + k as f64 * self.step) / self.scale
    }
}

/// A step in units of 1/scale, where that is a whole number of ten digits at most but for what rounding leaves of a step that was computed from
/// times. One step in 25 000 that is no decimal is one of ten digits by chance; with three digits more, one in 25.
fn decimal_step(dt: f64, scale: f64) -> Option<f64> {
    let scaled = dt * scale;
    let whole = scaled.round();
    let is_near = (scaled - whole).abs() <= 8.0 * f64::EPSILON * scaled;
    (is_near && whole <= 1e10).then_some(whole)
}

/// A time in units of 1/scale, where that is a whole number to the last digit.
fn decimal_time(time: f64, scale: f64) -> Option<f64> {
    let whole = (time * scale).round();
    (whole / scale == time && whole.abs() < 1.0 / f64::EPSILON).then_some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The time of a row is the double that its decimal is read as; a step without one is multiplied.
    #[test]
    fn times_are_those_that_a_file_says() {
        for (dt, first, places) in [
            (0.1, 0.0, 1),
            (0.05, -2.5, 2),
            (0.003, 1_700_000_000.25, 3),
            (20.0, 7.0, 0),
        ] {
            let clock = Clock::new(dt, first);
            for k in 0..2000 {
                let (time, since) = (clock.time(k), clock.since(k));
                let written = |t: f64| format!("{t:.places$}").parse::<f64>().unwrap();
                assert_eq!(
                    (time, since),
                    (written(time), written(since)),
                    "row {k} of {dt}"
                );
                assert!((time - first - k as f64 * dt).abs() < 1e-6);
            }
        }
        // As a file of rounded times gives the step.
        assert_eq!(Clock::new(0.7 / 7.0, 0.0), Clock::new(0.1, 0.0));
        let third = Clock::new(1.0 / 3.0, 0.5);
        assert_eq!(
            (third.time(4), third.since(4)),
            (0.5 + 4.0 / 3.0, 4.0 / 3.0)
        );
        assert_eq!(Clock::new(1e-200, 0.0).since(2), 2e-200);
    }

    /// Steps that are no decimals are multiplied, and a first time is what it was.
    #[test]
    fn what_is_no_decimal_stays() {
        for parts in [3.0, 9.0, 17.0, 360.0, 44_100.0] {
            let clock = Clock::new(1.0 / parts, 0.0);
            for seconds in 1..200 {
                let k = seconds as f64 * parts;
                assert_eq!(clock.time(k as usize), k * (1.0 / parts), "{k} of {parts}");
            }
        }
        for first in [
            1_700_000_000.000_001,
            1_700_000_000.250_000_5,
            0.1 + 0.2,
            -1.0 / 3.0,
        ] {
            for dt in [0.5, 0.1, 1.0, 1.0 / 7.0] {
                assert_eq!(Clock::new(dt, first).time(0), first, "{first} {dt}");
            }
        }
    }
}
