//! A world of a simulator: departures before its inputs, after its outputs, and of its parameters.

use super::{RecordNoise, System, WorldRun};
use crate::evaluate::trials::law::{DepartureLaw, DeparturePlace, Moment};
use crate::evaluate::trials::numbers::TRIAL;
use crate::math::ends;
use crate::record::{Drive, Signal};
use crate::twin::DigitalTwin;

/// Makes a record; `None` where the simulator fails or diverges.
pub(super) fn run(
    twin: &dyn DigitalTwin,
    system: System<'_>,
    drive: &Drive,
    draws: RecordNoise,
) -> Option<WorldRun> {
    let mut inputs = drive.inputs().clone();
    for departure in system.departures {
        if let DeparturePlace::Actuator(j) = departure.place {
            pass(&departure.law, j, drive, &mut inputs);
        }
    }
    let driven = drive.with_inputs(inputs).ok()?;
    let mut outputs = simulated(twin, system, &driven, draws)?;
    let conditions = system.conditions;
    let mut measurement = conditions.noises(draws.measurement, "sensor", outputs.ncols());
    let sense = |late: bool, outputs: &mut Signal| {
        for departure in system.departures {
            if let DeparturePlace::Sensor(j) = departure.place
                && departure.law.is_of_readings() == late
            {
                pass(&departure.law, j, drive, outputs);
            }
        }
    };
    sense(false, &mut outputs);
    for ((_, j), y) in outputs.indexed_iter_mut() {
        *y += conditions.measurement_at(j, *y, 0.0) * measurement[j].next();
    }
    sense(true, &mut outputs);
    if !outputs.iter().all(|y| y.abs() < TRIAL.diverged) {
        return None;
    }
    conditions.empty(&mut outputs, draws.process);
    let none = Signal::zeros((drive.samples(), 0));
    Some(WorldRun {
        drive: drive.clone(),
        outputs,
        states: none.clone(),
        rates: none,
    })
}

/// Outputs of the simulator. Where a parameter changes, they follow the runs at fixed values: exact for a parameter that acts on
/// the outputs at once, an approximation for others.
fn simulated(
    twin: &dyn DigitalTwin,
    system: System<'_>,
    drive: &Drive,
    draws: RecordNoise,
) -> Option<Signal> {
    let changing = (system.departures.iter()).find_map(|departure| match departure.place {
        DeparturePlace::Parameter(i) => Some((i, &departure.law)),
        _ => None,
    });
    let one = |theta: &[f64]| twin.simulate(theta, drive, draws.process).ok();
    let Some((i, law)) = changing else {
        return one(system.theta);
    };
    let mut memory = vec![];
    let values: Vec<f64> = (0..drive.samples())
        .map(|k| {
            let own = system.theta[i];
            let now = Moment::new(drive.time(k), &[], drive.input(k)).at(own);
            own * law.factor(&now, drive.step(k), &mut memory)
        })
        .collect();
    let (low, high) = ends(&values);
    if low == high {
        return one(system.theta);
    }
    let step = (high - low) / (TRIAL.parameter_values - 1) as f64;
    let runs = (0..TRIAL.parameter_values)
        .map(|m| {
            let mut theta = system.theta.to_vec();
            theta[i] = low + step * m as f64;
            one(&theta)
        })
        .collect::<Option<Vec<Signal>>>()?;
    let (rows, columns) = runs[0].dim();
    Some(Signal::from_shape_fn((rows, columns), |(k, j)| {
        let place = ((values[k] - low) / step)
            .max(0.0)
            .min((TRIAL.parameter_values - 1) as f64);
        let m = (place as usize).min(TRIAL.parameter_values - 2);
        let share = place - m as f64;
        (1.0 - share) * runs[m][[k, j]] + share * runs[m + 1][[k, j]]
    }))
}

/// Puts one channel of a signal through a law.
fn pass(law: &DepartureLaw, channel: usize, drive: &Drive, signal: &mut Signal) {
    let mut memory = vec![];
    for k in 0..drive.samples() {
        let now = Moment::new(drive.time(k), &[], drive.input(k)).at(signal[[k, channel]]);
        signal[[k, channel]] = law.through(&now, drive.step(k), &mut memory);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::trials::law::{Departure, ParameterDeparture, SignalDeparture};
    use crate::evaluate::trials::world::Conditions;
    use crate::twin::Noise;
    use crate::twin::fixture::AtOnce;

    #[test]
    fn departures_of_signals_and_parameters_reach_the_outputs() {
        let drive = Drive::new(1.0, Signal::from_elem((10, 1), 2.0)).unwrap();
        let made = |place, law| {
            let departures = [Departure { place, law }];
            let conditions = Conditions::declared();
            let system = System {
                theta: &[1.0],
                departures: &departures,
                conditions: &conditions,
            };
            run(
                &AtOnce::<1>(|a, u| a[0] * u),
                system,
                &drive,
                RecordNoise::of(Noise::OFF),
            )
            .unwrap()
            .outputs
        };
        let bias = || {
            DepartureLaw::Signal(SignalDeparture::Bias {
                offset: 0.5,
                settling: 0.0,
            })
        };
        assert_eq!(made(DeparturePlace::Sensor(0), bias())[[4, 0]], 2.5);
        assert_eq!(made(DeparturePlace::Actuator(0), bias())[[4, 0]], 2.5);
        let step = DepartureLaw::Parameter(ParameterDeparture::Step {
            size: 0.5,
            time: 5.0,
            ramp: 0.0,
        });
        let stepped = made(DeparturePlace::Parameter(0), step);
        assert!((stepped[[4, 0]] - 2.0).abs() < 1e-9 && (stepped[[5, 0]] - 3.0).abs() < 1e-9);
    }
}
