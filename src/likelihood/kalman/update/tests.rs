use crate::likelihood::kalman::{FilterSettings, Kalman, STOPPED, Score};
use crate::math::deviation;
use crate::record::{Drive, Record};
use crate::twin::{DigitalTwin, Noise, Now, Outline, Parameter, StateSpace};
use statrs::distribution::{ContinuousCDF, Normal};

/// A level that wanders by its second parameter a row, read with noise of its third by a sensor that shows 0 to 1.
struct Gauge;

impl StateSpace for Gauge {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("start", "V", -2.0, 2.0))
            .parameter(Parameter::new("wander", "V", 1e-9, 1.0))
            .parameter(Parameter::new("noise", "V", 1e-3, 1.0))
            .state("x", "V")
            .output("y", "V")
    }
    fn drift(&self, _: &Now<'_>, _: &[f64], dx: &mut [f64]) {
        dx.fill(0.0);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        x[0] = now.theta[0];
    }
    fn noise(&self, now: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        (process[0], measurement[0]) = (now.theta[1], now.theta[2]);
    }
    fn readout(&self, _: &Now<'_>, y: &mut [f64]) {
        y[0] = y[0].clamp(0.0, 1.0);
    }
}

fn record(theta: &[f64], samples: usize, run: u64) -> Record {
    let drive = Drive::autonomous(1.0, samples).unwrap();
    let outputs = Gauge.simulate(theta, &drive, Noise::new(8, "gauge", run));
    Record::new(drive, outputs.unwrap()).unwrap()
}

/// Of a level that does not move, readings inside the range have the density of the noise, those at an end the probability of all
/// that is beyond it, over that of a jitter.
#[test]
fn readings_at_an_end_have_its_probability() {
    for (level, noise) in [(0.9, 0.3), (0.5, 0.8), (-0.4, 0.5), (1.6, 0.4)] {
        let theta = [level, 1e-9, noise];
        let record = record(&theta, 400, 1);
        let outputs = record.outputs().column(0).to_vec();
        let size = deviation(&outputs) * (399.0_f64 / 400.0).sqrt();
        let normal = Normal::new(level, noise).unwrap();
        let most = 1.0 / (STOPPED * size * std::f64::consts::TAU.sqrt());
        let density = |y: &f64| match *y {
            0.0 => normal.cdf(0.0) * most,
            1.0 => normal.sf(1.0) * most,
            y => (-0.5 * ((y - level) / noise).powi(2)).exp() / (noise * 2.506_628_274_631),
        };
        let expected: f64 = outputs.iter().map(|y| density(y).ln()).sum();
        let settings = FilterSettings::default();
        let kalman = Kalman::new(Gauge, &record, &settings).unwrap();
        let found = kalman.log_likelihood(&theta).unwrap();
        // A reading at an end may also be one inside that the jitter moved there.
        let off = (found - expected) / 400.0;
        assert!(off.abs() < 2e-3, "{level} {noise}: {found} {expected}");
    }
}

/// At the true levels of noise the slopes of the log-likelihood vanish over many records, as those of a density do, half of whose readings are
/// at an end: noise is not taken for less where readings repeat.
#[test]
fn noise_behind_a_range_is_told_without_bias() {
    let theta = [0.5, 0.1, 0.2];
    let settings = FilterSettings::default();
    let (mut slopes, mut at_an_end) = (vec![vec![]; 3], 0);
    let n = 60;
    for run in 0..n {
        let record = record(&theta, 200, run);
        at_an_end += record
            .outputs()
            .iter()
            .filter(|y| **y == 0.0 || **y == 1.0)
            .count();
        let kalman = Kalman::new(Gauge, &record, &settings).unwrap();
        let score = Score::at(&kalman, &theta).unwrap();
        (0..3).for_each(|i| slopes[i].push(score.gradient[i]));
    }
    assert!(at_an_end > 50 * n as usize, "{at_an_end}");
    for (i, slopes) in slopes.iter().enumerate() {
        let mean = slopes.iter().sum::<f64>() / n as f64;
        let error = deviation(slopes) / (n as f64).sqrt();
        assert!(mean.abs() < 4.0 * error, "{i}: {mean} ± {error}");
    }
}
