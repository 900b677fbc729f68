//! Departures whose size is not yet chosen.

use super::law::{
    Departure, Family, ForceLaw, Law, ParameterLaw, Place, RandomLaw, SignalLaw, Wave,
};
use super::scene::{Scene, Size};
use super::variant::{Variant, is_one_sided};
use crate::twin::Source;
use std::f64::consts::{PI, TAU};

/// Form in which a law is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// As in the library's table.
    Listed,
    /// The same physics in other terms, with other edges, by another discretisation.
    Other,
}

/// A departure with its shape, at any size: 1 is as large as the twin's own terms.
#[derive(Debug, Clone)]
pub(super) struct Draft {
    pub place: Place,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    Listed(Listed),
    Random(RandomLaw),
}

#[derive(Debug, Clone)]
struct Listed {
    id: String,
    /// The other state of a law between two.
    other: Option<usize>,
    form: Form,
    /// 1 or −1.
    sign: f64,
    /// Exponent of a power law.
    exponent: f64,
    /// Uniform in [0, 1): times, frequencies, ends of a range.
    shapes: [f64; 3],
}

/// Ids of listed laws that are written here. Noise and outliers are no departures but nuisances: fitted noise levels answer them.
const IDS: [&str; 26] = [
    "sensor-bias",
    "sensor-gain",
    "sensor-drift",
    "sensor-lag",
    "sensor-delay",
    "sensor-rectification",
    "sensor-saturation",
    "sensor-quantization",
    "actuator-gain",
    "actuator-bias",
    "actuator-dead-zone",
    "actuator-backlash",
    "actuator-saturation",
    "actuator-rate-limit",
    "actuator-lag",
    "actuator-delay",
    "constant-forcing",
    "coulomb-friction",
    "linear-loss",
    "cross-coupling",
    "quadratic-drag",
    "cubic-stiffness",
    "power-law",
    "periodic-disturbance",
    "parameter-drift",
    "parameter-step",
];
/// This one needs a state to spill into.
const CEILING: &str = "state-ceiling";

impl Draft {
    /// Returns true for the id of a law that is written here.
    pub fn knows(id: &str) -> bool {
        id == CEILING || IDS.contains(&id)
    }

    /// A listed law; its shape is drawn. `None` for an id that is not written here.
    pub fn listed(
        id: &str,
        place: Place,
        other: Option<usize>,
        form: Form,
        source: &mut Source,
    ) -> Option<Self> {
        if !Self::knows(id) {
            return None;
        }
        let sign = if source.happens(0.5) { -1.0 } else { 1.0 };
        let shapes = [(); 3].map(|()| source.uniform());
        // A spring that softens or a power law that pushes runs away.
        let is_kept = ["cubic-stiffness", "power-law"].contains(&id) || is_one_sided(id);
        Some(Self {
            place,
            kind: Kind::Listed(Listed {
                id: id.into(),
                other,
                form,
                sign: if is_kept { 1.0 } else { sign },
                // Away from one and two, which have names of their own.
                exponent: match shapes[0] {
                    shape if shape < 0.5 => 1.3 + 0.8 * shape,
                    shape => 2.0 + shape,
                },
                shapes,
            }),
        })
    }

    /// A listed law of a given sign and shape; `None` for an id that is not written here.
    pub fn variant(id: &str, place: Place, other: Option<usize>, of: Variant) -> Option<Self> {
        Self::knows(id).then(|| Self {
            place,
            kind: Kind::Listed(Listed {
                id: id.into(),
                other,
                form: Form::Listed,
                sign: of.sign,
                exponent: of.exponent,
                shapes: [of.shape; 3],
            }),
        })
    }

    /// A random law of a family at a place; `None` where nothing moves that it could depend on.
    pub fn random(
        family: Family,
        place: Place,
        scene: &Scene,
        source: &mut Source,
    ) -> Option<Self> {
        let mut variables = scene.variables(place);
        let mut arguments = Vec::new();
        let wanted = 1 + usize::from(source.happens(0.5));
        while arguments.len() < wanted && !variables.is_empty() {
            let variable = variables.swap_remove(index(source, variables.len()));
            arguments.extend(scene.argument(variable, place));
        }
        if arguments.is_empty() {
            return None;
        }
        let law = RandomLaw::draw(family, arguments, scene.duration, source);
        let law = law.standardised(&scene.moments(place), scene.dt)?;
        Some(Self {
            place,
            kind: Kind::Random(law),
        })
    }

    /// Largest size: beyond, the system is another one.
    pub fn largest(&self) -> f64 {
        match &self.kind {
            Kind::Listed(listed) => match listed.id.as_str() {
                "parameter-step" | "parameter-drift" | "sensor-rectification" => 0.9,
                id if id.ends_with("saturation") || id == CEILING => 0.9,
                _ => 3.0,
            },
            Kind::Random(_) => 3.0,
        }
    }

    /// Name of what is missing: `id@target` of a listed law, the family of a random one.
    pub fn label(&self, target: &str) -> String {
        match &self.kind {
            Kind::Listed(listed) => crate::effect::EffectKey::new(&listed.id, target).to_string(),
            Kind::Random(law) => format!("{} at {target}", law.family),
        }
    }

    /// Expression of a random law that has one.
    pub fn formula(&self) -> Option<String> {
        match &self.kind {
            Kind::Listed(_) => None,
            Kind::Random(law) => law.formula(),
        }
    }

    /// The departure of this size.
    pub fn of_size(&self, size: f64, scene: &Scene) -> Option<Departure> {
        let law = match &self.kind {
            Kind::Random(law) => {
                let mut law = law.clone();
                law.amount = size * scene.unit(self.place);
                Law::Random(law)
            }
            Kind::Listed(listed) => listed.law(self.place, size, scene)?,
        };
        Some(Departure {
            place: self.place,
            law,
        })
    }
}

impl Listed {
    fn law(&self, place: Place, size: f64, scene: &Scene) -> Option<Law> {
        Some(match place {
            Place::Sensor(j) => Law::Signal(self.signal(size, &scene.outputs[j], scene)?),
            Place::Actuator(j) => Law::Signal(self.signal(size, &scene.inputs[j], scene)?),
            Place::Parameter(_) => Law::Parameter(self.parameter(size, scene)?),
            Place::State(i) if self.id == CEILING => {
                let (range, span) = (&scene.states[i], scene.states[i].span());
                Law::Ceiling {
                    level: range.high - size * span,
                    spill: self.shapes[0],
                    to: self.other.filter(|other| *other != i),
                    softness: self.soft(0.01 * span),
                }
            }
            Place::State(i) => Law::Force(self.force(i, size * scene.unit(place), scene)?),
        })
    }

    /// `width` in the other form, 0 in the library's.
    fn soft(&self, width: f64) -> f64 {
        match self.form {
            Form::Listed => 0.0,
            Form::Other => width,
        }
    }

    fn is_other(&self) -> bool {
        self.form == Form::Other
    }

    fn signal(&self, size: f64, range: &Size, scene: &Scene) -> Option<SignalLaw> {
        let (signed, span) = (self.sign * size, range.span());
        let (_, law) = self.id.split_once('-')?;
        // Lags and delays of size 1 take a twentieth of the record.
        let time = 0.05 * size * scene.duration;
        Some(match law {
            "bias" => SignalLaw::Bias {
                offset: signed * range.deviation,
                settling: self.soft(0.02 * scene.duration),
            },
            "gain" => SignalLaw::Gain {
                factor: 1.0 + (0.5 * signed).max(-0.95),
            },
            "drift" => SignalLaw::Drift {
                rate: 2.0 * signed * range.deviation / scene.duration,
                levelling: self.is_other().then_some(2.0 * scene.duration),
            },
            "lag" if self.is_other() => SignalLaw::LowPass {
                cutoff: 1.0 / (2.0 * PI * time),
            },
            "lag" => SignalLaw::Lag { tau: time },
            // The library keeps 63 samples.
            "delay" => SignalLaw::Delay {
                delay: time.min(60.0 * scene.dt),
                cubic: self.is_other(),
            },
            "rectification" if range.low >= 0.0 => return None,
            "rectification" => SignalLaw::Rectification {
                fraction: size,
                rounding: self.soft(0.02 * span),
            },
            "saturation" => {
                let (below, cut) = (self.shapes[0] < 0.3, size * span);
                SignalLaw::Saturation {
                    low: below.then_some(range.low + cut),
                    high: (!below).then_some(range.high - cut),
                    knee: self.soft(0.01 * span),
                }
            }
            "quantization" => SignalLaw::Quantization {
                step: size * span,
                half_way: self.is_other(),
            },
            "dead-zone" => SignalLaw::DeadZone {
                width: size * span,
                knee: self.soft(0.03 * size * span),
            },
            "backlash" => SignalLaw::Play {
                width: size * span,
                compliance: self.soft(0.1),
            },
            // At size 1 the whole range takes a tenth of the record.
            "rate-limit" => SignalLaw::RateLimit {
                rate: 10.0 * span / (size * scene.duration),
                knee: self.soft(0.3),
            },
            _ => return None,
        })
    }

    fn parameter(&self, size: f64, scene: &Scene) -> Option<ParameterLaw> {
        let (signed, duration) = (self.sign * size, scene.duration);
        Some(match self.id.as_str() {
            "parameter-drift" => ParameterLaw::Drift {
                rate: signed / duration,
                exponential: self.is_other(),
            },
            "parameter-step" => ParameterLaw::Step {
                size: signed,
                time: duration * (0.2 + 0.6 * self.shapes[0]),
                ramp: self.soft(0.02 * duration),
            },
            _ => return None,
        })
    }

    /// A force on the state number `on`, of this size in its rate.
    fn force(&self, on: usize, rate: f64, scene: &Scene) -> Option<ForceLaw> {
        let signed = self.sign * rate;
        let rms = |of: usize| scene.states[of].rms.max(1e-9);
        let power = |exponent: f64, of: usize| ForceLaw::Power {
            coefficient: signed / rms(of).powf(exponent),
            exponent,
            of,
            rounding: self.soft(0.03 * rms(of)),
        };
        let linear = |rate: f64, of: usize| ForceLaw::Linear {
            rate: rate / rms(of),
            of,
            span: self.is_other().then_some(6.0 * rms(of)),
        };
        Some(match self.id.as_str() {
            "constant-forcing" => ForceLaw::Constant {
                force: signed,
                onset: self.soft(0.02 * scene.duration),
            },
            "coulomb-friction" => ForceLaw::Friction {
                force: signed,
                of: on,
                width: self.soft(0.03 * rms(on)),
            },
            "linear-loss" => linear(-signed, on),
            "cross-coupling" => linear(signed, self.other?),
            "quadratic-drag" => power(2.0, on),
            "cubic-stiffness" => power(3.0, self.other?),
            "power-law" => power(self.exponent, on),
            "periodic-disturbance" => ForceLaw::Periodic {
                amplitude: rate,
                frequency: (3.0 + 9.0 * self.shapes[0]) / scene.duration,
                phase: TAU * self.shapes[1],
                wave: match (self.form, self.shapes[2] < 0.5) {
                    (Form::Listed, _) => Wave::Sine,
                    (Form::Other, true) => Wave::Triangle,
                    (Form::Other, false) => Wave::Swelling,
                },
            },
            _ => return None,
        })
    }
}

/// A number below `n`.
pub(super) fn index(source: &mut Source, n: usize) -> usize {
    ((source.uniform() * n as f64) as usize).min(n - 1)
}
