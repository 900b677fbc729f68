//! Unlisted departures: no effect of the library describes them. One a row.

use super::listed::Scene;
use super::world::{ForceLaw, ParameterLaw, Perturbation, SignalLaw, World};
use crate::twin::Source;

/// A departure with its name and its target.
pub(super) struct Unlisted {
    pub name: &'static str,
    pub target: String,
    pub perturbation: Perturbation,
}

/// A kind of departure.
struct Departure {
    name: &'static str,
    needs_input: bool,
    make: fn(&Frame<'_>) -> (Perturbation, String),
}

/// Scale of a departure's numbers.
struct Frame<'a> {
    world: &'a World,
    scene: &'a Scene,
    /// From a twentieth of what is usual, hardly visible, to all of it.
    part: f64,
    /// A random state, and a random parameter.
    on: usize,
    number: usize,
    /// Uniform in [0, 1): for shapes.
    shape: f64,
}

impl Frame<'_> {
    /// The part of the usual rate of the state.
    fn rate(&self) -> f64 {
        self.part * self.world.rate_sizes[self.on]
    }

    /// The other state, and its usual size.
    fn other(&self) -> (usize, f64) {
        let of = 1 - self.on;
        (of, self.world.state_sizes[of])
    }

    /// Range of the output without noise, and its width.
    fn output(&self) -> (f64, f64, f64) {
        let (low, high) = self.scene.states[self.world.output];
        (low, high, high - low)
    }

    /// Largest input.
    fn input(&self) -> f64 {
        self.scene.input.1.abs().max(1e-9)
    }

    fn force(&self, law: ForceLaw) -> (Perturbation, String) {
        let perturbation = Perturbation::Force { on: self.on, law };
        (perturbation, self.world.state_names[self.on].into())
    }

    fn parameter(&self, law: ParameterLaw) -> (Perturbation, String) {
        let perturbation = Perturbation::Parameter {
            number: self.number,
            law,
        };
        (perturbation, self.world.parameters[self.number].into())
    }
}

fn sensor(law: SignalLaw) -> (Perturbation, String) {
    (Perturbation::Sensor(law), "sensor".into())
}

fn actuator(law: SignalLaw) -> (Perturbation, String) {
    (Perturbation::Actuator(law), "actuator".into())
}

const fn anywhere(name: &'static str, make: fn(&Frame<'_>) -> (Perturbation, String)) -> Departure {
    Departure {
        name,
        needs_input: false,
        make,
    }
}

const fn with_input(
    name: &'static str,
    make: fn(&Frame<'_>) -> (Perturbation, String),
) -> Departure {
    Departure {
        name,
        needs_input: true,
        make,
    }
}

const DEPARTURES: [Departure; 17] = [
    anywhere("product-of-states", |f| {
        let [a, b] = f.world.state_sizes;
        f.force(ForceLaw::Product {
            coefficient: 0.4 * f.rate() / (a * b),
        })
    }),
    anywhere("sine-of-a-state", |f| {
        let (of, size) = f.other();
        f.force(ForceLaw::Sine {
            coefficient: 0.8 * f.rate(),
            wavenumber: (5.0 + 4.0 * f.shape) / size,
            of,
        })
    }),
    anywhere("fading-memory", |f| {
        let (of, size) = f.other();
        f.force(ForceLaw::Memory {
            coefficient: 0.6 * f.rate() / size,
            memory: f.scene.duration * (0.03 + 0.05 * f.shape),
            of,
        })
    }),
    anywhere("one-sided-stop", |f| {
        let (low, high) = f.scene.states[f.on];
        f.force(ForceLaw::Stop {
            coefficient: 8.0 * f.rate() / (high - low).powi(2),
            at: low + 0.6 * (high - low),
            of: f.on,
        })
    }),
    anywhere("chirp", |f| {
        f.force(ForceLaw::Chirp {
            amplitude: 0.6 * f.rate(),
            frequency: 1.5 / f.scene.duration,
            sweep: 15.0 / f.scene.duration.powi(2),
        })
    }),
    anywhere("bursts", |f| {
        f.force(ForceLaw::Bursts {
            amplitude: f.rate(),
            each: 0.08 * f.scene.duration,
        })
    }),
    anywhere("sensor-play", |f| {
        sensor(SignalLaw::Play {
            width: 0.4 * f.part * f.output().2,
            compliance: 0.0,
        })
    }),
    anywhere("sensor-asymmetry", |f| {
        sensor(SignalLaw::Asymmetry {
            error: 0.3 * f.part,
        })
    }),
    anywhere("sensor-level-delay", |f| {
        let (low, high, _) = f.output();
        sensor(SignalLaw::LevelDelay {
            delay: 0.04 * f.part * f.scene.duration,
            span: low.abs().max(high.abs()),
        })
    }),
    anywhere("sensor-glitches", |f| {
        sensor(SignalLaw::Glitches {
            height: 0.6 * f.part * f.output().2,
            each: 0.1 * f.scene.duration,
        })
    }),
    anywhere("sensor-sticking", |f| {
        sensor(SignalLaw::Sticking {
            length: 0.1 * f.part * f.scene.duration,
            each: 0.1 * f.scene.duration,
        })
    }),
    anywhere("parameter-oscillation", |f| {
        f.parameter(ParameterLaw::Oscillation {
            amplitude: 0.6 * f.part,
            frequency: (2.0 + 4.0 * f.shape) / f.scene.duration,
        })
    }),
    anywhere("parameter-wander", |f| {
        f.parameter(ParameterLaw::Wander {
            std: 0.8 * f.part / f.scene.duration.sqrt(),
        })
    }),
    with_input("actuator-asymmetry", |f| {
        actuator(SignalLaw::Asymmetry {
            error: 0.5 * f.part,
        })
    }),
    with_input("actuator-curve", |f| {
        actuator(SignalLaw::Curve {
            coefficient: f.part / f.input(),
        })
    }),
    with_input("actuator-fading", |f| {
        actuator(SignalLaw::Fading {
            loss: 0.7 * f.part,
            capacity: 0.3 * f.input() * f.scene.duration,
        })
    }),
    with_input("input-times-state", |f| {
        f.force(ForceLaw::InputTimesState {
            coefficient: 0.5 * f.rate() / (f.world.state_sizes[f.on] * f.input()),
            of: f.on,
        })
    }),
];

impl World {
    /// The kinds of departure that this world can have.
    fn departures(&self) -> Vec<&'static Departure> {
        (DEPARTURES.iter())
            .filter(|d| self.has_input || !d.needs_input)
            .collect()
    }

    /// An unlisted departure, in `strength` from 0, hardly visible, to 1, obvious.
    pub(super) fn unlisted(&self, strength: f64, scene: &Scene, source: &mut Source) -> Unlisted {
        let all = self.departures();
        let departure = all[index(source, all.len())];
        self.made(departure, strength, scene, source)
    }

    fn made(
        &self,
        departure: &Departure,
        strength: f64,
        scene: &Scene,
        source: &mut Source,
    ) -> Unlisted {
        let frame = Frame {
            world: self,
            scene,
            part: 0.05 * 20f64.powf(strength),
            on: index(source, 2),
            number: index(source, self.parameters.len()),
            shape: source.uniform(),
        };
        let (perturbation, target) = (departure.make)(&frame);
        Unlisted {
            name: departure.name,
            target,
            perturbation,
        }
    }
}

/// A number below `n`.
pub(super) fn index(source: &mut Source, n: usize) -> usize {
    ((source.uniform() * n as f64) as usize).min(n - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;
    use crate::twin::Noise;

    /// Every kind moves the output, more where it is stronger.
    #[test]
    fn every_kind_shows() {
        for study in reference_studies().unwrap() {
            let world = World::of(study.name()).unwrap();
            let noise = Noise::new(2, "unlisted", 0);
            let theta = study.twin().parameters().centre();
            let drive = study.drives().unwrap().draw(noise).unwrap();
            let scene = Scene::of(world, &theta, &drive).unwrap();
            let plain = world.run(&theta, &drive, &[], 1, noise).unwrap();
            for departure in world.departures() {
                let moved = |strength: f64| -> f64 {
                    let mut source = noise.source(departure.name);
                    let perturbation = world
                        .made(departure, strength, &scene, &mut source)
                        .perturbation;
                    let perturbed = world
                        .run(&theta, &drive, &[perturbation], 1, noise)
                        .unwrap();
                    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
                    perturbed.iter().zip(&plain).map(square).sum::<f64>().sqrt()
                };
                let (weak, strong) = (moved(0.1), moved(0.9));
                let name = (departure.name, study.name());
                assert!(strong > weak && strong > 0.0, "{name:?}: {weak} {strong}");
            }
        }
    }
}
