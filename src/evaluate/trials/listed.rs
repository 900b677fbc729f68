//! Effects of the library as perturbations of a world: in the library's own terms, or the same physics written otherwise.

use super::world::{ForceLaw, MissingEffect, ParameterLaw, Perturbation, SignalLaw, Wave, World};
use crate::record::Drive;
use crate::twin::{Noise, Source};
use std::f64::consts::{PI, TAU};

/// Scale of magnitudes: one record of the unperturbed world.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    /// In seconds.
    pub duration: f64,
    /// Smallest and largest value of each state, without noise.
    pub states: [(f64, f64); 2],
    /// Smallest and largest value of the input; zeros where there is none.
    pub input: (f64, f64),
}

impl Scene {
    /// Simulates a world at θ; `None` where it runs away.
    pub fn of(world: &World, theta: &[f64], drive: &Drive) -> Option<Self> {
        let states = world.states(theta, drive, &[], 1, Noise::OFF)?;
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            })
        };
        let inputs = drive.inputs();
        Some(Self {
            duration: drive.samples() as f64 * drive.dt(),
            states: [0, 1].map(|i| range(&mut states.iter().map(|x| x[i]))),
            input: match world.has_input {
                true => range(&mut inputs.iter().copied()),
                false => (0.0, 0.0),
            },
        })
    }
}

/// Form in which a law is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// As in the library's table.
    Listed,
    /// The same physics in other terms, with other edges, by another discretisation.
    Other,
}

impl World {
    /// A listed effect whose first magnitude has the size `amount`; sign and shapes are drawn. `None` for an id that worlds do
    /// not have.
    pub(super) fn listed(
        &self,
        missing: &MissingEffect,
        amount: f64,
        form: Form,
        scene: &Scene,
        source: &mut Source,
    ) -> Option<Perturbation> {
        let draw = Draw {
            form,
            scene,
            amount,
            signed: if source.happens(0.5) { -amount } else { amount },
        };
        let (kind, law) = missing.id.split_once('-')?;
        match kind {
            "sensor" if law == "noise" => Some(Perturbation::MeasurementNoise {
                std: amount,
                uniform: draw.other(),
            }),
            "sensor" => {
                let range = scene.states[self.output];
                let perturbed = draw.signal(law, range, source)?;
                // Noise enters between the two.
                Some(match law {
                    "saturation" | "quantization" | "outliers" => Perturbation::Reading(perturbed),
                    _ => Perturbation::Sensor(perturbed),
                })
            }
            "actuator" => Some(Perturbation::Actuator(draw.signal(
                law,
                scene.input,
                source,
            )?)),
            "parameter" => Some(Perturbation::Parameter {
                number: self.parameters.iter().position(|p| *p == missing.target)?,
                law: draw.parameter(law, source)?,
            }),
            _ => {
                let on = self.state_names.iter().position(|s| *s == missing.target)?;
                draw.on_state(missing.id, on, self.state_sizes, source)
            }
        }
    }
}

/// Amount and manner of one effect.
struct Draw<'a> {
    form: Form,
    scene: &'a Scene,
    amount: f64,
    /// The amount with a random sign.
    signed: f64,
}

impl Draw<'_> {
    fn other(&self) -> bool {
        self.form == Form::Other
    }

    /// `width` in the other form, 0 in the library's.
    fn soft(&self, width: f64) -> f64 {
        if self.other() { width } else { 0.0 }
    }

    /// The law of a sensor or actuator whose signal has this range.
    fn signal(&self, law: &str, (low, high): (f64, f64), source: &mut Source) -> Option<SignalLaw> {
        let (amount, span) = (self.amount, high - low);
        Some(match law {
            "bias" => SignalLaw::Bias {
                offset: self.signed,
                settling: self.soft(0.02 * self.scene.duration),
            },
            "gain" => SignalLaw::Gain {
                factor: 1.0 + self.signed,
            },
            "drift" => SignalLaw::Drift {
                rate: self.signed,
                levelling: self.other().then_some(2.0 * self.scene.duration),
            },
            "lag" if self.other() => SignalLaw::LowPass {
                cutoff: 1.0 / (2.0 * PI * amount),
            },
            "lag" => SignalLaw::Lag { tau: amount },
            "delay" => SignalLaw::Delay {
                delay: amount,
                cubic: self.other(),
            },
            "rectification" => SignalLaw::Rectification {
                fraction: amount,
                rounding: self.soft(0.02 * span),
            },
            "saturation" => {
                // A signal around zero may be cut below; one that rests at its low end shows nothing there.
                let below = low < -0.2 * span && source.happens(0.5);
                SignalLaw::Saturation {
                    low: below.then_some(low + amount * span),
                    high: (!below).then_some(high - amount * span),
                    knee: self.soft(0.01 * span),
                }
            }
            "quantization" => SignalLaw::Quantization {
                step: amount,
                half_way: self.other(),
            },
            "outliers" => SignalLaw::Outliers {
                probability: amount,
                scale: span * (0.2 + 0.4 * source.uniform()),
                alike: self.other(),
            },
            "dead-zone" => SignalLaw::DeadZone {
                width: amount,
                knee: self.soft(0.03 * amount),
            },
            "backlash" => SignalLaw::Play {
                width: amount,
                compliance: self.soft(0.1),
            },
            "rate-limit" => SignalLaw::RateLimit {
                rate: amount,
                knee: self.soft(0.3),
            },
            _ => return None,
        })
    }

    fn parameter(&self, law: &str, source: &mut Source) -> Option<ParameterLaw> {
        let duration = self.scene.duration;
        Some(match law {
            "drift" => ParameterLaw::Drift {
                rate: self.signed,
                exponential: self.other(),
            },
            "step" => ParameterLaw::Step {
                size: self.signed,
                time: duration * (0.2 + 0.6 * source.uniform()),
                ramp: self.soft(0.02 * duration),
            },
            _ => return None,
        })
    }

    /// A force, a ceiling or noise on the state number `on`.
    fn on_state(
        &self,
        id: &str,
        on: usize,
        sizes: [f64; 2],
        source: &mut Source,
    ) -> Option<Perturbation> {
        let (amount, signed) = (self.amount, self.signed);
        let power = |exponent, of: usize| ForceLaw::Power {
            coefficient: amount,
            exponent,
            of,
            rounding: self.soft(0.03 * sizes[of]),
        };
        let span = |of: usize| self.other().then_some(6.0 * sizes[of]);
        let law = match id {
            "constant-forcing" => ForceLaw::Constant {
                force: signed,
                onset: self.soft(0.02 * self.scene.duration),
            },
            "coulomb-friction" => ForceLaw::Friction {
                force: amount,
                of: on,
                width: self.soft(0.03 * sizes[on]),
            },
            "linear-loss" => ForceLaw::Linear {
                rate: -amount,
                of: on,
                span: span(on),
            },
            "cross-coupling" => ForceLaw::Linear {
                rate: signed,
                of: 1 - on,
                span: span(1 - on),
            },
            "quadratic-drag" => power(2.0, on),
            "cubic-stiffness" => power(3.0, 1 - on),
            // Away from one and two, which have names of their own.
            "power-law" => power(
                if source.happens(0.5) {
                    1.3 + 0.4 * source.uniform()
                } else {
                    2.5 + 0.5 * source.uniform()
                },
                on,
            ),
            "periodic-disturbance" => ForceLaw::Periodic {
                amplitude: amount,
                frequency: (3.0 + 9.0 * source.uniform()) / self.scene.duration,
                phase: TAU * source.uniform(),
                wave: match (self.other(), source.happens(0.5)) {
                    (false, _) => Wave::Sine,
                    (true, true) => Wave::Triangle,
                    (true, false) => Wave::Swelling,
                },
            },
            "state-ceiling" => {
                let (low, high) = self.scene.states[on];
                let span = high - low;
                return Some(Perturbation::Ceiling {
                    on,
                    level: high - amount * span,
                    spill: source.uniform(),
                    softness: self.soft(0.01 * span),
                });
            }
            "process-noise" => {
                return Some(Perturbation::ProcessNoise {
                    on,
                    std: amount,
                    uniform: self.other(),
                });
            }
            _ => return None,
        };
        Some(Perturbation::Force { on, law })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Signal;

    /// Every listed effect of both worlds can be perturbed in both forms, moves the output, and the forms are close.
    #[test]
    fn both_forms_show_and_are_close() {
        for (name, theta) in [
            ("van-der-pol", vec![1.2]),
            ("tanks", vec![0.6, 0.55, 0.6, 1.0]),
        ] {
            let world = World::of(name).unwrap();
            let drive = match world.has_input {
                false => Drive::autonomous(0.05, 300).unwrap(),
                true => Drive::new(
                    0.5,
                    Signal::from_shape_fn((400, 1), |(k, _)| [2.5, 0.4, 1.7, 1.1][k / 30 % 4]),
                )
                .unwrap(),
            };
            let noise = Noise::new(1, "forms", 0);
            let run = |perturbations: &[Perturbation]| {
                world.run(&theta, &drive, perturbations, 1, noise).unwrap()
            };
            let scene = Scene::of(world, &theta, &drive).unwrap();
            let distance = |a: &[f64], b: &[f64]| -> f64 {
                a.iter()
                    .zip(b)
                    .map(|(a, b)| (a - b).powi(2))
                    .sum::<f64>()
                    .sqrt()
            };
            let plain = run(&[]);
            for missing in world.missing_effects.iter().chain(world.absorbed) {
                let amount = (missing.range.0 * missing.range.1).sqrt();
                let perturbation = |form| {
                    let mut source = noise.source(missing.id);
                    world
                        .listed(missing, amount, form, &scene, &mut source)
                        .unwrap()
                };
                let (listed, other) = (
                    run(&[perturbation(Form::Listed)]),
                    run(&[perturbation(Form::Other)]),
                );
                let (moved, apart) = (distance(&listed, &plain), distance(&listed, &other));
                assert!(moved > 0.0, "{} of {name} shows nothing", missing.id);
                // Noise and outliers of another distribution and levels half-way between are other draws altogether.
                let redrawn = ["noise", "quantization", "outliers"]
                    .iter()
                    .any(|law| missing.id.ends_with(law));
                assert!(
                    redrawn || apart < 0.8 * moved,
                    "{}@{}: {apart} of {moved}",
                    missing.id,
                    missing.target
                );
            }
        }
    }
}
