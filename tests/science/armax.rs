//! Information of ARMAX features on a black box with coloured noise, beside AR and ARX: Cramér–Rao bounds from simulated
//! features. The table of docs/method.md: `cargo test --release --test science armax -- --ignored --nocapture`.

use nalgebra::{DMatrix, DVector};
use truetwin::feature::{Ar, Armax, Arx, FeatureRecipe};
use truetwin::record::{Drive, Quantity, Signal, Signals};
use truetwin::study::RecordPlan;
use truetwin::twin::{DigitalTwin, Noise, Parameter, ParameterSpace, SimulationError, Twin};

/// A resonance driven by white noise, and by an input or none, seen through white noise of about its own size: what AR
/// and ARX models take for white is coloured. A black box.
struct Resonance {
    driven: bool,
}

impl DigitalTwin for Resonance {
    fn parameters(&self) -> ParameterSpace {
        let all = [
            Parameter::new("frequency", "rad/sample", 0.04, 0.2),
            Parameter::new("radius", "-", 0.9, 0.99),
            Parameter::new("gain", "-", 0.5, 1.5),
        ];
        ParameterSpace::new(all.into_iter().take(if self.driven { 3 } else { 2 }))
    }

    fn signals(&self) -> Signals {
        let inputs = if self.driven { &["u"][..] } else { &[] };
        Signals {
            inputs: inputs.iter().map(|name| Quantity::new(name, "")).collect(),
            ..Signals::default()
        }
    }

    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        let (mut force, mut sensor) = (noise.source("force"), noise.source("sensor"));
        let (a1, a2) = (2.0 * theta[1] * theta[0].cos(), -theta[1] * theta[1]);
        let mut x = [0.0; 2];
        let mut step = |u: f64| {
            x = [a1 * x[0] + a2 * x[1] + u + force.normal(), x[0]];
            x[0]
        };
        for _ in 0..200 {
            step(0.0);
        }
        Ok(Signal::from_shape_fn((drive.samples(), 1), |(k, _)| {
            let u: f64 = drive.input(k).iter().map(|u| theta[2] * u).sum();
            step(u) + 20.0 * sensor.normal()
        }))
    }
}

/// A recipe and how many of its last features are left out.
type Case<'a> = (&'a dyn FeatureRecipe, usize);

/// Cramér–Rao bounds on the parameters' standard errors from features simulated at `theta`, one row a case: JᵀS⁻¹J, with S
/// from simulations and J from central differences under common random numbers. Two halves of the simulations give two J,
/// whose errors do not multiply.
fn bounds(
    twin: Resonance,
    theta: &[f64],
    drive: &Drive,
    cases: &[Case],
    simulations: u64,
) -> Vec<Vec<f64>> {
    let twin = Twin::new(twin);
    (cases.iter())
        .map(|(recipe, left_out)| {
            let map = recipe.bind(&twin).unwrap();
            let (n, m) = (map.dim() - left_out, simulations as f64);
            let simulate = |theta: &[f64], purpose: &str| -> Vec<DVector<f64>> {
                (0..simulations)
                    .map(|i| {
                        let y = twin.simulate(theta, drive, Noise::new(1, purpose, i));
                        let x = map.extract(drive, &y.unwrap()).unwrap();
                        DVector::from_column_slice(&x[..n])
                    })
                    .collect()
            };
            let mean = |x: &[DVector<f64>]| x.iter().sum::<DVector<f64>>() / x.len() as f64;
            let x = simulate(theta, "covariance");
            let centre = mean(&x);
            let scatter = x.iter().fold(DMatrix::zeros(n, n), |sum, x| {
                let d = x - &centre;
                sum + &d * d.transpose()
            });
            // The inverse of a covariance from m simulations is too large by (m − 1)/(m − n − 2).
            let precision = scatter.try_inverse().unwrap() * (m - n as f64 - 2.0);
            let jacobian = |purpose: &str| {
                let column = |(j, width): (usize, &f64)| {
                    let at = |sign: f64| {
                        let mut theta = theta.to_vec();
                        theta[j] += sign * 0.05 * width;
                        mean(&simulate(&theta, purpose))
                    };
                    (at(1.0) - at(-1.0)) / (0.1 * width)
                };
                let widths = twin.parameters().widths();
                DMatrix::from_columns(&widths.iter().enumerate().map(column).collect::<Vec<_>>())
            };
            let half = jacobian("first").transpose() * precision * jacobian("second");
            let covariance = (&half + half.transpose()).try_inverse().unwrap() * 2.0;
            let bounds: Vec<f64> = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
            println!("{recipe:?}, {left_out} left out: {n} features, {bounds:.4?}");
            bounds
        })
        .collect()
}

/// Variances of the second over those of the first.
fn gain(first: &[f64], second: &[f64]) -> Vec<f64> {
    (first.iter().zip(second))
        .map(|(a, b)| (b / a).powi(2))
        .collect()
}

#[test]
fn armax_features_say_more_with_as_many_numbers() {
    compare(400);
}

#[test]
#[ignore = "a minute; the table of docs/method.md"]
fn armax_features_beside_others() {
    compare(1000);
}

fn compare(simulations: u64) {
    let armax = |lags, inputs| Armax {
        outputs: lags,
        inputs,
        noise: lags,
    };
    let free = Drive::autonomous(1.0, 300).unwrap();
    let found = bounds(
        Resonance { driven: false },
        &[0.08, 0.97],
        &free,
        &[
            (&armax(2, 0), 0),
            (&armax(2, 0), 1),
            (&Ar { order: 5 }, 0),
            (&Ar { order: 16 }, 0),
        ],
        simulations,
    );
    let gain_over_ar = gain(&found[0], &found[2]);
    assert!(gain_over_ar.iter().all(|g| *g > 1.2), "{gain_over_ar:?}");

    let arx = |lags| Arx {
        outputs: lags,
        inputs: lags,
    };
    let twin = Resonance { driven: true };
    let plan = RecordPlan::levels(1.0, 300, -3.0, 3.0, 20);
    let noise = Noise::new(5, "input", 0);
    let drive = plan.drive(&twin.signals(), noise).unwrap();
    let found = bounds(
        twin,
        &[0.08, 0.97, 1.0],
        &drive,
        &[
            (&armax(3, 3), 0),
            (&armax(3, 3), 1),
            (&arx(5), 0),
            (&arx(8), 0),
            (&arx(16), 0),
        ],
        simulations,
    );
    let gain_over_arx = gain(&found[0], &found[2]);
    assert!(gain_over_arx.iter().all(|g| *g > 1.15), "{gain_over_arx:?}");
}
