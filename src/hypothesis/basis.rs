//! Sums of sines that unknown functions of one and two variables are written as, and their variables.

use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

/// Terms of a function of one variable. At the shortest length the last one has e^−2 of the first one's variance; half of them cannot
/// turn as fast as a ceiling does, twice of them double the time.
pub(in crate::hypothesis) const TERMS: usize = 10;
/// Most that the orders of a product of two add up to.
const ORDER: usize = 7;
const HIGHEST: usize = 6;

/// Kind of a function's variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Of {
    /// State of this index.
    State(usize),
    /// Input of this index.
    Input(usize),
    /// Output of this index, as the twin's own equations show it; only its trace is a variable.
    Output(usize),
    /// The signal that passes a sensor or actuator.
    Signal,
    /// Time in seconds.
    Time,
}

impl Of {
    /// The variable's value.
    pub fn value(self, time: f64, states: &[f64], inputs: &[f64], signal: f64) -> f64 {
        match self {
            Self::State(i) => states[i],
            Self::Input(i) => inputs[i],
            Self::Signal | Self::Output(_) => signal,
            Self::Time => time,
        }
    }
}

/// Pairs of orders of a function of two variables.
pub(super) fn pairs() -> impl Iterator<Item = (usize, usize)> {
    (1..=HIGHEST)
        .flat_map(|i| (1..=HIGHEST).map(move |j| (i, j)))
        .filter(|(i, j)| i + j <= ORDER)
}

/// The terms of a function of one variable where it is `value`.
pub(in crate::hypothesis) fn terms_of_one(value: f64, ends: (f64, f64)) -> [f64; TERMS] {
    let mut phi = [0.0; TERMS];
    sines(value, ends, &mut phi);
    phi
}

/// √2·sin(kπz) for k = 1… into `out`, z = (value − a)/(b − a) held in [0, 1].
fn sines(value: f64, (a, b): (f64, f64), out: &mut [f64]) {
    let z = ((value - a) / (b - a)).clamp(0.0, 1.0);
    let (sin, cos) = (PI * z).sin_cos();
    let (mut before, mut now) = (0.0, SQRT_2 * sin);
    for out in out {
        *out = now;
        (before, now) = (now, 2.0 * cos * now - before);
    }
}

/// The sum of a function of one variable.
pub(super) fn sum_of_one(m: &[f64], value: f64, ends: (f64, f64)) -> f64 {
    if is_nothing(m) {
        return 0.0;
    }
    let mut phi = [0.0; TERMS];
    sines(value, ends, &mut phi[..m.len()]);
    m.iter().zip(phi).map(|(m, phi)| m * phi).sum()
}

/// The sum of a function of two variables, its coefficients in the order of [`pairs`].
pub(super) fn sum_of_two(m: &[f64], values: [f64; 2], ends: [(f64, f64); 2]) -> f64 {
    if is_nothing(m) {
        return 0.0;
    }
    let mut phi = [[0.0; HIGHEST]; 2];
    for ((phi, value), ends) in phi.iter_mut().zip(values).zip(ends) {
        sines(value, ends, phi);
    }
    let (mut sum, mut rest) = (0.0, m);
    for (i, first) in phi[0].iter().enumerate() {
        let (own, others) = rest.split_at(ORDER - 1 - i);
        rest = others;
        if !is_nothing(own) {
            let inner: f64 = own.iter().zip(phi[1]).map(|(m, phi)| m * phi).sum();
            sum += first * inner;
        }
    }
    sum * FRAC_1_SQRT_2
}

/// True before a function is fitted: most of its coefficients are zero where one is looked at after the other.
fn is_nothing(m: &[f64]) -> bool {
    m.iter().all(|m| *m == 0.0)
}

/// The value of a fitted function where its variable is `value`; of one variable.
pub(crate) fn basis(value: f64, variable: &(String, f64, f64), count: usize) -> Vec<f64> {
    let mut phi = vec![0.0; count];
    sines(value, (variable.1, variable.2), &mut phi);
    phi
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sines by their recurrence.
    #[test]
    fn terms_are_sines() {
        let mut phi = [0.0; TERMS];
        sines(0.3, (-1.0, 2.0), &mut phi);
        for (k, value) in (1..).zip(phi) {
            let expected = SQRT_2 * (f64::from(k) * PI * 1.3 / 3.0).sin();
            assert!((value - expected).abs() < 1e-12, "{k}");
        }
    }

    /// Every pair of orders has its own coefficient.
    #[test]
    fn functions_of_two_are_products_of_sines() {
        let ends = [(-1.0, 2.0), (0.0, 5.0)];
        let sine = |k: usize, z: f64| SQRT_2 * (k as f64 * PI * z).sin();
        for (n, (i, j)) in pairs().enumerate() {
            let mut m = [0.0; 21];
            m[n] = 1.5;
            let expected = 1.5 * sine(i, 1.3 / 3.0) * sine(j, 0.4) * FRAC_1_SQRT_2;
            let value = sum_of_two(&m, [0.3, 2.0], ends);
            assert!((value - expected).abs() < 1e-12, "{i}, {j}");
        }
    }
}
