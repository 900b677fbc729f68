//! A twin of several states and outputs, with the whole command line: copy this file, change the equations.
//!
//! `cargo run --release --example rooms -- withheld --twin rooms --trials 40 --out trials`, or check, simulate, fit, diagnose, …
//!
//! Its records have one column for each output, in the order of the outline: `t,u,y1,y2`. Effects of a sensor are those of `sensor1`
//! (the wall) or `sensor2` (the room).

use truetwin::prelude::*;

/// A heater warms a wall, and the wall a room; temperatures are those above outdoors.
///
/// ```text
/// heater' = gain·power − 0.5·(heater − wall)
/// wall'   = 0.3·(heater − wall) − 0.2·(wall − room)
/// room'   = 0.2·(wall − room) − loss·room
/// ```
#[derive(Debug)]
pub struct Rooms;

impl StateSpace for Rooms {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("gain", "K/s", 0.5, 1.5).within(0.1, 4.0))
            .parameter(Parameter::new("loss", "1/s", 0.2, 0.6).within(0.05, 2.0))
            .state("heater", "K")
            .state("wall", "K")
            .state("room", "K")
            .input("power", "1")
            .output("wall_sensor", "K")
            .output("room_sensor", "K")
    }
    // Slices go in the order of the outline: states, rates and outputs alike.
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let (gain, loss) = (now.theta[0], now.theta[1]);
        let (heater, wall, room) = (x[0], x[1], x[2]);
        dx[0] = gain * now.u[0] - 0.5 * (heater - wall);
        dx[1] = 0.3 * (heater - wall) - 0.2 * (wall - room);
        dx[2] = 0.2 * (wall - room) - loss * room;
    }
    // Two of the three states are measured.
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        (y[0], y[1]) = (x[1], x[2]);
    }
    // Standard deviations: of the increment added to each state a step, and of each sensor.
    fn noise(&self, _: &Now, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process.fill(0.005);
        measurement.fill(0.01);
    }
}

fn main() -> std::process::ExitCode {
    // Records: step, samples, levels of the heater's power, samples that each is held.
    let records = RecordPlan::levels(0.1, 200, 0.0, 1.0, 25);
    truetwin::cli::run([Study::new("rooms", Rooms, records)])
}
