//! What nobody listed: departures that no effect of the library describes.

use super::listed::Scene;
use super::world::{Bend, ForceLaw, ParameterLaw, SignalLaw, World};
use crate::twin::Source;

/// Kinds that any world can have, and those that need an input.
const ANYWHERE: [&str; 12] = [
    "product-of-states",
    "sine-of-a-state",
    "fading-memory",
    "one-sided-stop",
    "chirp",
    "bursts",
    "sensor-play",
    "sensor-asymmetry",
    "sensor-level-delay",
    "sensor-glitches",
    "sensor-sticking",
    "parameter-oscillation",
];
const WITH_INPUT: [&str; 5] = [
    "parameter-wander",
    "actuator-asymmetry",
    "actuator-curve",
    "actuator-fading",
    "input-times-state",
];

/// A departure with its name and its target.
pub(super) struct Unlisted {
    pub name: &'static str,
    pub target: String,
    pub bend: Bend,
}

impl World {
    /// An unlisted departure, in `strength` from 0, hardly visible, to 1, obvious.
    pub(super) fn unlisted(&self, strength: f64, scene: &Scene, source: &mut Source) -> Unlisted {
        let kinds: Vec<&str> = match self.has_input {
            true => ANYWHERE.into_iter().chain(WITH_INPUT).collect(),
            false => ANYWHERE.to_vec(),
        };
        let name = kinds[index(source, kinds.len())];
        self.unlisted_kind(name, strength, scene, source)
    }

    fn unlisted_kind(
        &self,
        name: &'static str,
        strength: f64,
        scene: &Scene,
        source: &mut Source,
    ) -> Unlisted {
        // From a twentieth of what is usual to all of it.
        let part = 0.05 * 20f64.powf(strength);
        let on = index(source, 2);
        let number = index(source, self.parameters.len());
        let rate = part * self.rate_sizes[on];
        let sizes = self.state_sizes;
        let (low, high) = scene.states[self.output];
        let span = high - low;
        let force = |law| (Bend::Force { on, law }, self.state_names[on].to_owned());
        let sensor = |law| (Bend::Sensor(law), "sensor".to_owned());
        let actuator = |law| (Bend::Actuator(law), "actuator".to_owned());
        let parameter = |law| {
            let bend = Bend::Parameter { number, law };
            (bend, self.parameters[number].to_owned())
        };
        let (bend, target) = match name {
            "product-of-states" => force(ForceLaw::Product {
                coefficient: 0.4 * rate / (sizes[0] * sizes[1]),
            }),
            "sine-of-a-state" => force(ForceLaw::Sine {
                coefficient: 0.8 * rate,
                wavenumber: (5.0 + 4.0 * source.uniform()) / sizes[1 - on],
                of: 1 - on,
            }),
            "fading-memory" => force(ForceLaw::Memory {
                coefficient: 0.6 * rate / sizes[1 - on],
                memory: scene.duration * (0.03 + 0.05 * source.uniform()),
                of: 1 - on,
            }),
            "one-sided-stop" => {
                let (low, high) = scene.states[on];
                force(ForceLaw::Stop {
                    coefficient: 8.0 * rate / (high - low).powi(2),
                    at: low + 0.6 * (high - low),
                    of: on,
                })
            }
            "chirp" => force(ForceLaw::Chirp {
                amplitude: 0.6 * rate,
                frequency: 1.5 / scene.duration,
                sweep: 15.0 / scene.duration.powi(2),
            }),
            "bursts" => force(ForceLaw::Bursts {
                amplitude: rate,
                each: 0.08 * scene.duration,
            }),
            "sensor-play" => sensor(SignalLaw::Play {
                width: 0.4 * part * span,
                compliance: 0.0,
            }),
            "sensor-asymmetry" => sensor(SignalLaw::Asymmetry { error: 0.3 * part }),
            "sensor-level-delay" => sensor(SignalLaw::LevelDelay {
                delay: 0.04 * part * scene.duration,
                span: low.abs().max(high.abs()),
            }),
            "sensor-glitches" => sensor(SignalLaw::Glitches {
                height: 0.6 * part * span,
                each: 0.1 * scene.duration,
            }),
            "sensor-sticking" => sensor(SignalLaw::Sticking {
                length: 0.1 * part * scene.duration,
                each: 0.1 * scene.duration,
            }),
            "parameter-oscillation" => parameter(ParameterLaw::Oscillation {
                amplitude: 0.6 * part,
                frequency: (2.0 + 4.0 * source.uniform()) / scene.duration,
            }),
            "parameter-wander" => parameter(ParameterLaw::Wander {
                std: 0.8 * part / scene.duration.sqrt(),
            }),
            "actuator-asymmetry" => actuator(SignalLaw::Asymmetry { error: 0.5 * part }),
            "actuator-curve" => actuator(SignalLaw::Curve {
                coefficient: part / scene.input.1.abs().max(1e-9),
            }),
            "actuator-fading" => actuator(SignalLaw::Fading {
                loss: 0.7 * part,
                capacity: 0.3 * scene.input.1.abs() * scene.duration,
            }),
            _ => force(ForceLaw::InputTimesState {
                coefficient: 0.5 * rate / (sizes[on] * scene.input.1.abs().max(1e-9)),
                of: on,
            }),
        };
        Unlisted { name, target, bend }
    }
}

/// A number below `n`.
pub(super) fn index(source: &mut Source, n: usize) -> usize {
    ((source.uniform() * n as f64) as usize).min(n - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::reference_studies;
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
            let kinds = ANYWHERE.into_iter().chain(WITH_INPUT);
            for name in kinds.take(if world.has_input { 17 } else { 12 }) {
                let moved = |strength: f64| -> f64 {
                    let mut source = noise.source(name);
                    let bend = world
                        .unlisted_kind(name, strength, &scene, &mut source)
                        .bend;
                    let bent = world.run(&theta, &drive, &[bend], 1, noise).unwrap();
                    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
                    bent.iter().zip(&plain).map(square).sum::<f64>().sqrt()
                };
                let (weak, strong) = (moved(0.1), moved(0.9));
                assert!(
                    strong > weak && strong > 0.0,
                    "{name} of {}: {weak} {strong}",
                    study.name()
                );
            }
        }
    }
}
