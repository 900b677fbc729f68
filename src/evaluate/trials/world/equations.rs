//! A world of equations: Runge–Kutta steps of its own, ten a sample.

use super::{Conditions, RecordNoise, System, WorldRun};
use crate::evaluate::trials::law::{Departure, DepartureLaw, DeparturePlace, Moment, above};
use crate::evaluate::trials::numbers::TRIAL;
use crate::math::nearest;
use crate::record::{Drive, Signal};
use crate::twin::{Acting, Bends, Between, Composed, DeadTime, Interval, Noise, Now};
use ndarray::{ArrayView1, s};

/// Makes a record; `None` where a state diverges.
pub(super) fn run(
    twin: &Composed,
    system: System<'_>,
    drive: &Drive,
    draws: RecordNoise,
) -> Option<WorldRun> {
    let outline = twin.outline();
    let (n, p) = (outline.states.len(), outline.outputs.len());
    let conditions = system.conditions;
    let mut plant = Plant {
        twin,
        departures: system.departures,
        memories: vec![vec![]; system.departures.len()],
        limits: twin.limits().to_vec(),
        stage: vec![0.0; n],
        slopes: vec![vec![0.0; n]; 4],
    };
    let mut process = conditions.noises(draws.process, "state", n);
    let mut measurement = conditions.noises(draws.measurement, "sensor", p);
    let mut x = vec![0.0; n];
    match conditions.lead {
        0 => plant.begin(system, drive, draws.process, &mut x)?,
        lead => x = behind_lead(twin, system, drive, (draws, lead))?,
    }
    let samples = drive.samples();
    let mut inputs = drive.inputs().clone();
    let mut sent = Sent::new(twin, system.theta, drive)?;
    let mut outputs = Signal::zeros((samples, p));
    let (mut states, mut rates) = (Signal::zeros((samples, n)), Signal::zeros((samples, n)));
    let (mut q, mut r) = (vec![0.0; n], vec![0.0; p]);
    let (mut y, mut rate) = (vec![0.0; p], vec![0.0; n]);
    let mut own = twin.complete(system.theta);
    let mut dead_time = DeadTime::of(twin, &mut own, drive);
    let holds = conditions.holds(&twin.holds());
    // Of the record's inputs: what departs moves the ends of a curve.
    let bends = Bends::of(drive, &holds);
    for k in 0..samples {
        let (t, dt) = (drive.time(k), drive.step(k));
        let mut command = drive.input(k).to_vec();
        if let Some(feedback) = &conditions.feedback
            && k > 0
        {
            let wanted = command[0] + feedback.gain * (feedback.setpoint - outputs[[k - 1, 0]]);
            command[0] = nearest(wanted, feedback.low, feedback.high);
            inputs[[k, 0]] = command[0];
        }
        let moment = Moment::new(t, &x, &command);
        let u = sent.acting(k, plant.inputs(&moment, dt))?;
        let theta = plant.theta(&own, &moment, dt);
        let now = Now::new(t, dt, &u, &theta);
        twin.observe(&now, &x, &mut y);
        dead_time.hold_back(t, &mut y);
        q.fill(0.0);
        r.fill(0.0);
        twin.noise(&now, &x, &mut q, &mut r);
        plant.sense(&moment, dt, false, &mut y);
        for (j, y) in y.iter_mut().enumerate() {
            let level = conditions.measurement_at(j, *y, r[j]);
            *y += draws.sign * level * measurement[j].next();
        }
        plant.sense(&moment, dt, true, &mut y);
        twin.readout(&now, &mut y);
        twin.drift(&now, &x, &mut rate);
        for (signal, row) in [(&mut outputs, &y), (&mut states, &x), (&mut rates, &rate)] {
            signal.row_mut(k).assign(&ArrayView1::from(row));
        }
        twin.update(&now, &mut x);
        let next = next_inputs(drive, k, &u);
        let between = Between {
            next: &next,
            holds: &holds,
            bends: bends.behind(k),
        };
        plant.advance(&now, between, &command, &mut x);
        for ((x, q), noise) in x.iter_mut().zip(&q).zip(&mut process) {
            *x += draws.sign * conditions.process * q * noise.next();
        }
        twin.constrain(&now, &mut x);
        plant.overflow(&mut x);
        plant.limit(&mut x);
        let finite = |v: &f64| v.abs() < TRIAL.diverged;
        if !x.iter().all(finite) || !y.iter().all(finite) {
            return None;
        }
    }
    twin.finish(system.theta, draws.measurement, &mut outputs);
    conditions.empty(&mut outputs, draws.process);
    Some(WorldRun {
        drive: drive.with_inputs(inputs).ok()?,
        outputs,
        states,
        rates,
    })
}

/// Inputs u of sample k at the next one, towards which they go where the twin says so.
fn next_inputs(drive: &Drive, k: usize, u: &[f64]) -> Vec<f64> {
    if k + 1 == drive.samples() {
        return u.to_vec();
    }
    let steps = drive.input(k).iter().zip(drive.input(k + 1));
    let ends = u.iter().zip(steps);
    ends.map(|(u, (from, to))| u + to - from).collect()
}

/// The last state of a run that ends a sample before the record.
fn behind_lead(
    twin: &Composed,
    system: System<'_>,
    drive: &Drive,
    (draws, lead): (RecordNoise, usize),
) -> Option<Vec<f64>> {
    let first = drive.samples().saturating_sub(lead);
    let inputs = drive.inputs().slice(s![first.., ..]).to_owned();
    let duration = inputs.nrows() as f64 * drive.dt();
    let before = Drive::new(drive.dt(), inputs).ok()?;
    let before = before.beginning_at(drive.first_time() - duration);
    let conditions = Conditions {
        lead: 0,
        gaps: 0.0,
        ..system.conditions.clone()
    };
    let system = System {
        conditions: &conditions,
        ..system
    };
    let states = run(twin, system, &before, draws.earlier())?.states;
    states
        .rows()
        .into_iter()
        .next_back()
        .map(|row| row.to_vec())
}

/// Inputs as departures leave them, on their way through the twin's own actuators. A controller answers row by row, so that they are not
/// known before.
struct Sent<'w> {
    twin: &'w Composed,
    theta: &'w [f64],
    /// The rows so far; none where the twin's inputs act as they are.
    drive: Option<Drive>,
}

impl<'w> Sent<'w> {
    fn new(twin: &'w Composed, theta: &'w [f64], drive: &Drive) -> Option<Self> {
        let actuated = twin.actuated(theta, drive).ok()?;
        Some(Self {
            twin,
            theta,
            drive: actuated.map(|_| drive.clone()),
        })
    }

    /// Row k behind the actuators.
    fn acting(&mut self, k: usize, u: Vec<f64>) -> Option<Vec<f64>> {
        let Some(drive) = &self.drive else {
            return Some(u);
        };
        let mut inputs = drive.inputs().clone();
        inputs.row_mut(k).assign(&ArrayView1::from(&u));
        let sent = drive.with_inputs(inputs).ok()?;
        let acting = self.twin.actuated(self.theta, &sent.first(k + 1)).ok()?;
        self.drive = Some(sent);
        Some(acting?.input(k).to_vec())
    }
}

/// Equations with departures, and the memories of these.
struct Plant<'w> {
    twin: &'w Composed,
    departures: &'w [Departure],
    memories: Vec<Vec<f64>>,
    limits: Vec<Interval>,
    stage: Vec<f64>,
    slopes: Vec<Vec<f64>>,
}

impl Plant<'_> {
    /// Sets the first state.
    fn begin(&self, system: System<'_>, drive: &Drive, noise: Noise, x: &mut [f64]) -> Option<()> {
        (self.twin.check_parameters(system.theta, drive.dt())).ok()?;
        let acting = Acting::of(self.twin, system.theta, drive).ok()?;
        let now = acting.at(0);
        self.twin.start(&now, x);
        let mut deviation = vec![0.0; x.len()];
        self.twin.start_deviation(&now, &mut deviation);
        let mut source = noise.source("world/start");
        for (i, x) in x.iter_mut().enumerate() {
            let shift = system.conditions.start.get(i).copied().unwrap_or(0.0);
            *x += shift + deviation[i] * source.normal();
        }
        self.limit(x);
        self.twin.begin(&now, x);
        Some(())
    }

    /// Inputs as they reach the system.
    fn inputs(&mut self, now: &Moment<'_>, dt: f64) -> Vec<f64> {
        let mut u = now.u.to_vec();
        for (departure, memory) in self.departures.iter().zip(&mut self.memories) {
            if let DeparturePlace::Actuator(j) = departure.place {
                u[j] = departure.law.through(&now.at(u[j]), dt, memory);
            }
        }
        u
    }

    /// Parameters at this sample; memories of random forces are moved on, too.
    fn theta(&mut self, own: &[f64], now: &Moment<'_>, dt: f64) -> Vec<f64> {
        let mut theta = own.to_vec();
        for (departure, memory) in self.departures.iter().zip(&mut self.memories) {
            match (departure.place, &departure.law) {
                (DeparturePlace::Parameter(i), law) => {
                    theta[i] *= law.factor(&now.at(own[i]), dt, memory);
                }
                (DeparturePlace::State(i), DepartureLaw::Random(law)) => {
                    law.remember(&now.at(now.x[i]), dt, memory);
                }
                _ => {}
            }
        }
        theta
    }

    /// Puts the outputs through the sensors' laws, before or after their noise.
    fn sense(&mut self, now: &Moment<'_>, dt: f64, readings: bool, y: &mut [f64]) {
        for (departure, memory) in self.departures.iter().zip(&mut self.memories) {
            if let DeparturePlace::Sensor(j) = departure.place
                && departure.law.is_of_readings() == readings
            {
                y[j] = departure.law.through(&now.at(y[j]), dt, memory);
            }
        }
    }

    /// Carries the state to the next sample.
    fn advance(&mut self, now: &Now<'_>, between: Between<'_>, command: &[f64], x: &mut [f64]) {
        let h = now.dt / TRIAL.world_substeps as f64;
        let mut inputs = now.u.to_vec();
        let mut drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| self.twin.drift(now, x, dx);
        between.jump(now, x, &mut inputs, &mut drift);
        for step in 0..TRIAL.world_substeps {
            for (stage, part) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
                let share = (step as f64 + part) / TRIAL.world_substeps as f64;
                let middle = (step as f64 + 0.5) / TRIAL.world_substeps as f64;
                between.inputs_at(share, middle, now.u, &mut inputs);
                let at = Now::new(now.t + share * now.dt, h, &inputs, now.theta);
                for (i, value) in self.stage.iter_mut().enumerate() {
                    let before = stage.checked_sub(1).map_or(0.0, |s| self.slopes[s][i]);
                    *value = x[i] + part * h * before;
                }
                self.twin.drift(&at, &self.stage, &mut self.slopes[stage]);
                let moment = Moment::new(at.t, &self.stage, command);
                for (departure, memory) in self.departures.iter().zip(&self.memories) {
                    if let DeparturePlace::State(i) = departure.place {
                        self.slopes[stage][i] += match &departure.law {
                            DepartureLaw::Force(law) => law.at(&moment),
                            DepartureLaw::Random(law) => law.at(&moment, memory),
                            _ => 0.0,
                        };
                    }
                }
            }
            for (i, x) in x.iter_mut().enumerate() {
                let [a, b, c, d] = [0, 1, 2, 3].map(|s| self.slopes[s][i]);
                *x += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
            }
            self.limit(x);
        }
    }

    /// Cuts what exceeds a ceiling.
    fn overflow(&self, x: &mut [f64]) {
        for departure in self.departures {
            if let (
                DeparturePlace::State(i),
                DepartureLaw::Ceiling {
                    level,
                    spill,
                    to,
                    softness,
                },
            ) = (departure.place, &departure.law)
            {
                let excess = above(x[i] - level, *softness);
                x[i] -= excess;
                if let Some(to) = to {
                    x[*to] += spill * excess;
                }
            }
        }
    }

    fn limit(&self, x: &mut [f64]) {
        for (x, limit) in x.iter_mut().zip(&self.limits) {
            *x = limit.clamp(*x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::trials::law::ForceDeparture;
    use crate::evaluate::trials::world::Conditions;
    use crate::twin::fixture::OneState;
    use crate::twin::{DigitalTwin, Integrator, Parameter};

    /// ẋ = −k·x + u, y = x, with noise.
    fn decay(noise: f64) -> OneState {
        OneState {
            start: Some(1.0),
            noise: [noise; 2],
            integrator: Integrator::RungeKutta4,
            ..OneState::leaking(Parameter::new("k", "1/s", 0.2, 2.0))
        }
    }

    fn draws(noise: Noise) -> RecordNoise {
        RecordNoise::of(noise)
    }

    fn made(noise: f64, departures: &[Departure], conditions: &Conditions) -> WorldRun {
        let drive = Drive::new(0.1, Signal::from_elem((200, 1), 0.5)).unwrap();
        let system = System {
            theta: &[0.7],
            departures,
            conditions,
        };
        run(
            &decay(noise).into(),
            system,
            &drive,
            draws(Noise::new(1, "w", 0)),
        )
        .unwrap()
    }

    /// Without noise and departures a world is its twin as far as the twin's integrator goes.
    #[test]
    fn a_world_without_departures_is_its_twin() {
        let run = made(0.0, &[], &Conditions::declared());
        let twin = DigitalTwin::free_run(&decay(0.0), &[0.7], &run.drive).unwrap();
        for (a, b) in run.outputs.iter().zip(&twin) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        let force = Departure {
            place: DeparturePlace::State(0),
            law: DepartureLaw::Force(ForceDeparture::Constant {
                force: 0.2,
                onset: 0.0,
            }),
        };
        // At rest x = (u + force)/k.
        let forced = made(0.0, &[force], &Conditions::declared());
        assert!((forced.outputs[[199, 0]] - 1.0).abs() < 1e-3);
    }

    /// At rest the variance of the state is q²/(1 − a²), a = exp(−k·Δt), times the factor's square.
    #[test]
    fn noise_has_its_level_and_its_factor() {
        let conditions = Conditions {
            process: 2.0,
            measurement: 0.0,
            ..Conditions::declared()
        };
        let drive = Drive::new(0.1, Signal::from_elem((20_000, 1), 0.5)).unwrap();
        let system = System {
            theta: &[0.7],
            departures: &[],
            conditions: &conditions,
        };
        let run = run(
            &decay(0.01).into(),
            system,
            &drive,
            draws(Noise::new(1, "w", 0)),
        )
        .unwrap();
        let tail: Vec<f64> = run.outputs.iter().copied().skip(500).collect();
        let variance = crate::math::deviation(&tail).powi(2);
        let expected = (0.02f64).powi(2) / (1.0 - (-0.14f64).exp());
        assert!(
            (variance / expected - 1.0).abs() < 0.15,
            "{variance} {expected}"
        );
    }

    /// From 1 the decay comes to rest at u/k = 0.714; a share of that is its noise.
    #[test]
    fn a_run_before_the_record_and_noise_in_proportion_are_as_they_are_called() {
        let conditions = Conditions {
            lead: 160,
            ..Conditions::declared()
        };
        let first = made(0.0, &[], &conditions).outputs[[0, 0]];
        assert!((first - 0.5 / 0.7).abs() < 1e-4, "{first}");
        let conditions = Conditions {
            proportional: 0.1,
            ..conditions
        };
        let outputs = made(0.0, &[], &conditions).outputs;
        let share = crate::math::deviation(&outputs.column(0).to_vec()) * 0.7 / 0.5;
        assert!((0.085..0.115).contains(&share), "{share}");
    }

    /// Between samples u = t is half a step more, on the mean, than its held value.
    #[test]
    fn sampled_inputs_go_on_a_line() {
        let input = Signal::from_shape_fn((100, 1), |(k, _)| 0.1 * k as f64);
        let drive = Drive::new(0.1, input).unwrap();
        let last = |sampled| {
            let conditions = Conditions {
                sampled,
                ..Conditions::declared()
            };
            let system = System::new(&[0.7], &conditions);
            let run = run(&decay(0.0).into(), system, &drive, draws(Noise::OFF));
            run.unwrap().outputs[[99, 0]]
        };
        // ẋ = −kx + u answers a constant 0.05 by 0.05/k.
        let more = last(true) - last(false);
        assert!((more - 0.05 / 0.7).abs() < 1e-3, "{more}");
    }

    #[test]
    fn feedback_moves_the_input_within_its_ends() {
        let conditions = Conditions {
            feedback: Some(super::super::Feedback {
                gain: 2.0,
                setpoint: 0.9,
                low: 0.0,
                high: 0.8,
            }),
            ..Conditions::declared()
        };
        let run = made(0.01, &[], &conditions);
        let inputs = run.drive.inputs();
        assert!(inputs.iter().all(|u| (0.0..=0.8).contains(u)));
        assert!(inputs.iter().any(|u| *u != 0.5));
    }
}
