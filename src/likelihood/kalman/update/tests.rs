use crate::likelihood::kalman::{FilterSettings, Kalman, STOPPED, Score};
use crate::math::deviation;
use crate::record::{Drive, Record, Signal};
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

/// The same with two sensors.
struct TwoGauges;

impl StateSpace for TwoGauges {
    fn outline(&self) -> Outline {
        Gauge.outline().output("z", "V")
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        Gauge.drift(now, x, dx);
    }
    fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
        y.fill(x[0]);
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        Gauge.start(now, x);
    }
    fn noise(&self, now: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process[0] = now.theta[1];
        measurement.fill(now.theta[2]);
    }
    fn readout(&self, _: &Now<'_>, y: &mut [f64]) {
        y[1] = y[1].clamp(0.0, 1.0);
    }
}

fn record(theta: &[f64], samples: usize, run: u64) -> Record {
    let drive = Drive::autonomous(1.0, samples).unwrap();
    let outputs = Gauge.simulate(theta, &drive, Noise::new(8, "gauge", run));
    Record::new(drive, outputs.unwrap()).unwrap()
}

/// Readings of a level that does not move have the density of the noise inside the range, and at an end the probability of all
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
/// at an end: noise is not taken for less where readings repeat. The information is near the covariance of the slopes.
#[test]
fn noise_behind_a_range_is_told_without_bias() {
    let theta = [0.5, 0.1, 0.2];
    let settings = FilterSettings::default();
    let [mut slopes, mut information] = [(); 2].map(|()| vec![vec![]; 3]);
    let (n, mut at_an_end) = (200, 0);
    for run in 0..n {
        let record = record(&theta, 200, run);
        let is_end = |y: &&f64| **y == 0.0 || **y == 1.0;
        at_an_end += record.outputs().iter().filter(is_end).count();
        let kalman = Kalman::new(Gauge, &record, &settings).unwrap();
        let score = Score::at(&kalman, &theta).unwrap();
        for i in 0..3 {
            slopes[i].push(score.gradient[i]);
            information[i].push(score.fisher[(i, i)]);
        }
    }
    assert!(at_an_end > 50 * n as usize, "{at_an_end}");
    let mean = |of: &[f64]| of.iter().sum::<f64>() / n as f64;
    for (i, (slopes, information)) in slopes.iter().zip(&information).enumerate() {
        let (slope, error) = (mean(slopes), deviation(slopes) / (n as f64).sqrt());
        assert!(slope.abs() < 4.0 * error, "{i}: {slope} ± {error}");
        // Relative deviation of a mean of so many squares: 0.1.
        let ratio = deviation(slopes).powi(2) / mean(information);
        println!("{i}: {slope} ± {error}, {ratio}");
        // Tails tell almost nothing of a spread, which the information takes for some of what noise alone would tell.
        let least = if i == 0 { 0.6 } else { 0.3 };
        assert!((least..1.4).contains(&ratio), "{i}: {ratio}");
    }
}

/// Two gauges of one level, of which the second one stops: the density of both is that of the first one times that of the second one given it.
#[test]
fn a_stopped_output_counts_given_the_others() {
    let theta = [0.9, 0.4, 0.05];
    let settings = FilterSettings::default();
    let drive = Drive::autonomous(1.0, 2).unwrap();
    for other in [0.8, 1.1, 2.0, 3.0] {
        let outputs = Signal::from_shape_vec((2, 2), vec![0.9, 0.9, other, 1.0]).unwrap();
        let record = Record::new(drive.clone(), outputs).unwrap();
        let kalman = Kalman::new(TwoGauges, &record, &settings).unwrap();
        let found = kalman.log_likelihood(&theta).unwrap();
        let jitter = kalman.jitter[1];
        // The level behind the first row, then the first gauge, then the second one given it.
        let (start, r) = (0.9, 0.05f64.powi(2));
        let density = |y: f64, mean: f64, variance: f64| {
            -0.5 * ((y - mean).powi(2) / variance + (std::f64::consts::TAU * variance).ln())
        };
        let first = 2.0 * density(0.9, start, r);
        let spread = 0.4f64.powi(2);
        let gain = spread / (spread + r);
        let (mean, variance) = (start + gain * (other - start), spread * (1.0 - gain) + r);
        let above = Normal::new(mean, variance.sqrt()).unwrap().sf(1.0);
        let at_end = above.ln() - (jitter * std::f64::consts::TAU.sqrt()).ln();
        let expected = first + density(other, start, spread + r) + at_end;
        assert!(
            (found - expected).abs() < 0.1,
            "{other}: {found} {expected}"
        );
    }
}
