//! One pass of a filter over a record: 400 rows of tanks, 300 of van der Pol.

use crate::Clock;
use std::hint::black_box;
use truetwin::likelihood::kalman::{Coordinates, FilterSettings, Kalman, Method, Score};
use truetwin::record::{Drive, Record, Signal};
use truetwin::twin::{DigitalTwin, Noise, StateSpace};
use truetwin::twins::{CascadedTanks, VanDerPol};

pub fn run(clock: &Clock) {
    let levels = Signal::from_shape_fn((400, 1), |(k, _)| ((k / 30) * 7 % 5) as f64 * 0.6);
    let forced = Drive::new(0.5, levels).expect("the step is positive");
    let free = Drive::autonomous(0.05, 300).expect("the step is positive");
    let cases: [(&str, &dyn StateSpace, Drive, &[f64]); 2] = [
        ("tanks", &CascadedTanks, forced, &[0.6, 0.5, 0.55, 1.0]),
        ("van der Pol", &VanDerPol, free, &[3.0]),
    ];
    for (name, twin, drive, theta) in cases {
        let outputs =
            (twin_outputs(name, theta, &drive)).expect("these parameters can be simulated");
        let record = Record::new(drive, outputs).expect("the outputs are finite");
        for method in [Method::Points, Method::Extended] {
            let settings = FilterSettings::default().with_method(method);
            let kalman = Kalman::new(twin, &record, &settings).expect("the channels agree");
            let name = |part: &str| format!("filter: {name}, {method:?}, {part}");
            clock.time(&name("log-likelihood"), 1, || {
                kalman.log_likelihood(black_box(theta))
            });
            if method == Method::Points {
                let coordinates = Coordinates::new(kalman.parameters());
                clock.time(&name("one-sided score"), 1, || {
                    Score::forward(&kalman, black_box(theta), &coordinates)
                });
                clock.time(&name("score"), 1, || Score::at(&kalman, black_box(theta)));
            }
        }
    }
}

fn twin_outputs(
    name: &str,
    theta: &[f64],
    drive: &Drive,
) -> Result<Signal, Box<dyn std::error::Error>> {
    let noise = Noise::new(1, "bench", 0);
    Ok(match name {
        "tanks" => CascadedTanks.simulate(theta, drive, noise)?,
        _ => VanDerPol.simulate(theta, drive, noise)?,
    })
}
