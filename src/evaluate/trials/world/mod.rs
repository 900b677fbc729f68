//! Worlds: the reference systems once more, written apart from the twins, and perturbed in ways of their own.
//!
//! Nothing here uses the crate's integrators, twins, effects or `augment`: what is shared is the physics alone. Signals are
//! perturbed as whole series, not sample by sample with memories, and forces are plain functions of the moment, so that a
//! mistake in the library of effects cannot be made here in the same way.

mod force;
mod parameter;
mod signal;
mod tanks;
mod van_der_pol;

pub(super) use force::{ForceLaw, Wave};
pub(super) use parameter::ParameterLaw;
pub(super) use signal::SignalLaw;

use crate::record::Drive;
use crate::twin::{Noise, Source};
use force::Moment;
use serde::{Deserialize, Serialize};
use signal::above;

/// One departure of a world from its twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Perturbation {
    /// Distortion of the input on its way to the system.
    Actuator(SignalLaw),
    /// Distortion of the measured state, before noise.
    Sensor(SignalLaw),
    /// Distortion of the noisy reading.
    Reading(SignalLaw),
    /// More measurement noise, normal or uniform.
    MeasurementNoise { std: f64, uniform: bool },
    /// A term in the rate of the state with this number.
    Force { on: usize, law: ForceLaw },
    /// More noise on the state with this number, a sample.
    ProcessNoise { on: usize, std: f64, uniform: bool },
    /// The excess of a state over a level is lost, but for a part that the other state takes.
    Ceiling {
        on: usize,
        level: f64,
        spill: f64,
        softness: f64,
    },
    /// A change of the parameter with this number.
    Parameter { number: usize, law: ParameterLaw },
}

impl Perturbation {
    /// A parameter's step, moved to the start of the record; anything else stays as it is.
    pub fn at_once(&mut self) {
        if let Self::Parameter {
            law: ParameterLaw::Step { time, .. },
            ..
        } = self
        {
            *time = 0.0;
        }
    }
}

/// A listed effect that a world can have, with magnitudes from hardly visible to obvious.
#[derive(Debug, Clone, Copy)]
pub(super) struct MissingEffect {
    /// As in the library.
    pub id: &'static str,
    /// As in the library.
    pub target: &'static str,
    /// The first magnitude where the effect hardly shows and where it is obvious, in its own unit; of a law that cuts
    /// (`…-saturation`, `state-ceiling`), the part of the signal's range that is cut.
    pub range: (f64, f64),
}

impl MissingEffect {
    /// `id@target`.
    pub fn key(&self) -> String {
        crate::effect::EffectKey::new(self.id, self.target).to_string()
    }
}

/// A system of two states, at most one input, and one output that is one of the states.
pub(super) struct World {
    /// Name of the twin.
    pub twin: &'static str,
    pub state_names: [&'static str; 2],
    pub parameters: &'static [&'static str],
    pub has_input: bool,
    start: [f64; 2],
    /// State that is measured.
    pub output: usize,
    /// Standard deviations of the noise added at each sample, by the step in seconds.
    process: fn(f64) -> [f64; 2],
    measurement: f64,
    limits: [(f64, f64); 2],
    /// Rates from θ, u and x.
    rates: fn(&[f64], f64, [f64; 2]) -> [f64; 2],
    /// Numbers of steps a sample that give the same system.
    pub substeps: &'static [usize],
    /// Usual size of each state, and of each state's rate.
    pub state_sizes: [f64; 2],
    pub rate_sizes: [f64; 2],
    /// The listed effects that show.
    pub missing_effects: &'static [MissingEffect],
    /// Pairs of listed effects that imitate each other.
    pub doubles: &'static [[&'static str; 2]],
    /// Listed effects that some θ stands in for.
    pub absorbed: &'static [MissingEffect],
}

impl World {
    /// The world of a twin.
    pub fn of(twin: &str) -> Option<&'static Self> {
        [&van_der_pol::WORLD, &tanks::WORLD]
            .into_iter()
            .find(|world| world.twin == twin)
    }

    /// Names of all twins that there is a world for.
    pub fn known() -> [&'static str; 2] {
        [van_der_pol::WORLD.twin, tanks::WORLD.twin]
    }

    /// The output at every sample, or `None` where the perturbed system runs away.
    pub fn run(
        &self,
        theta: &[f64],
        drive: &Drive,
        perturbations: &[Perturbation],
        substeps: usize,
        noise: Noise,
    ) -> Option<Vec<f64>> {
        let states = self.states(theta, drive, perturbations, substeps, noise)?;
        let truth = states.iter().map(|x| x[self.output]).collect();
        Some(self.measured(truth, drive.dt(), perturbations, noise))
    }

    /// The states at every sample, or `None` where the perturbed system runs away.
    pub fn states(
        &self,
        theta: &[f64],
        drive: &Drive,
        perturbations: &[Perturbation],
        substeps: usize,
        noise: Noise,
    ) -> Option<Vec<[f64; 2]>> {
        let (n, dt) = (drive.samples(), drive.dt());
        let input = self.input(drive, perturbations, noise);
        let factors = self.factors(n, dt, perturbations, noise);
        let mut process: Vec<Source> = (0..2)
            .map(|i| noise.source(&format!("world/state {i}")))
            .collect();
        let mut added: Vec<Source> = (0..perturbations.len())
            .map(|i| noise.source(&format!("world/perturbation {i}")))
            .collect();
        let own = (self.process)(dt);
        let mut x = self.start;
        let mut past = Vec::with_capacity(n);
        let mut theta_now = theta.to_vec();
        for k in 0..n {
            past.push(x);
            for (now, (own, factors)) in theta_now.iter_mut().zip(theta.iter().zip(&factors)) {
                *now = own * factors[k];
            }
            let h = dt / substeps as f64;
            for sub in 0..substeps {
                let now = Moment {
                    t: k as f64 * dt + sub as f64 * h,
                    dt,
                    x,
                    u: input.get(k).copied().unwrap_or(0.0),
                    past: &past,
                };
                let rate = (self.rates)(&theta_now, now.u, x);
                for i in 0..2 {
                    x[i] += h * (rate[i] + forces(perturbations, i, &now));
                }
            }
            for i in 0..2 {
                x[i] += own[i] * process[i].normal();
            }
            for (perturbation, source) in perturbations.iter().zip(&mut added) {
                after_step(perturbation, &mut x, source);
            }
            for (x, (low, high)) in x.iter_mut().zip(self.limits) {
                *x = x.max(low).min(high);
            }
            // Beyond a hundred times its usual size a system is another one.
            if !x
                .iter()
                .zip(self.state_sizes)
                .all(|(x, size)| x.abs() < 100.0 * size)
            {
                return None;
            }
        }
        Some(past)
    }

    /// The input as it reaches the system.
    fn input(&self, drive: &Drive, perturbations: &[Perturbation], noise: Noise) -> Vec<f64> {
        let mut u: Vec<f64> = match self.has_input {
            true => drive.inputs().column(0).to_vec(),
            false => vec![],
        };
        for perturbation in perturbations {
            if let Perturbation::Actuator(law) = perturbation {
                u = law.apply(&u, drive.dt(), noise.child("actuator"));
            }
        }
        u
    }

    /// The factor on each parameter at each sample.
    fn factors(
        &self,
        n: usize,
        dt: f64,
        perturbations: &[Perturbation],
        noise: Noise,
    ) -> Vec<Vec<f64>> {
        let mut all = vec![vec![1.0; n]; self.parameters.len()];
        for perturbation in perturbations {
            if let Perturbation::Parameter { number, law } = perturbation {
                let factors = law.factors(n, dt, noise.child("parameter"));
                for (all, factor) in all[*number].iter_mut().zip(factors) {
                    *all *= factor;
                }
            }
        }
        all
    }

    /// Returns the reading: the sensor's laws, noise, what is made of the reading.
    fn measured(
        &self,
        truth: Vec<f64>,
        dt: f64,
        perturbations: &[Perturbation],
        noise: Noise,
    ) -> Vec<f64> {
        let mut y = truth;
        for perturbation in perturbations {
            if let Perturbation::Sensor(law) = perturbation {
                y = law.apply(&y, dt, noise.child("sensor"));
            }
        }
        let mut own = noise.source("world/sensor");
        y.iter_mut()
            .for_each(|y| *y += self.measurement * own.normal());
        for perturbation in perturbations {
            match perturbation {
                Perturbation::MeasurementNoise { std, uniform } => {
                    let mut more = noise.source("world/more sensor noise");
                    y.iter_mut()
                        .for_each(|y| *y += std * draw(&mut more, *uniform));
                }
                Perturbation::Reading(law) => y = law.apply(&y, dt, noise.child("reading")),
                _ => {}
            }
        }
        y
    }
}

/// The sum of the forces on a state.
fn forces(perturbations: &[Perturbation], state: usize, now: &Moment<'_>) -> f64 {
    (perturbations.iter())
        .map(|perturbation| match perturbation {
            Perturbation::Force { on, law } if *on == state => law.at(now),
            _ => 0.0,
        })
        .sum()
}

/// Added noise and overflow at the end of a step.
fn after_step(perturbation: &Perturbation, x: &mut [f64; 2], source: &mut Source) {
    match *perturbation {
        Perturbation::ProcessNoise { on, std, uniform } => x[on] += std * draw(source, uniform),
        Perturbation::Ceiling {
            on,
            level,
            spill,
            softness,
        } => {
            let excess = above(x[on] - level, softness);
            x[on] -= excess;
            x[1 - on] += spill * excess;
        }
        _ => {}
    }
}

/// A draw of mean 0 and standard deviation 1.
fn draw(source: &mut Source, uniform: bool) -> f64 {
    match uniform {
        true => 12f64.sqrt() * (source.uniform() - 0.5),
        false => source.normal(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paper::reference_studies;

    /// Without noise and perturbations, integrated as the twin is, a world is its twin to rounding.
    #[test]
    fn unperturbed_worlds_are_their_twins() {
        for study in reference_studies().unwrap() {
            let world = World::of(study.name()).unwrap();
            let drives = study.drives().unwrap();
            for sample in 0..5 {
                let noise = Noise::new(3, "world", sample);
                let theta = study.twin().parameters().draw_prior(noise);
                let drive = drives.draw(noise).unwrap();
                let twin = study.twin().simulate(&theta, &drive, Noise::OFF).unwrap();
                let run = world.run(&theta, &drive, &[], 1, Noise::OFF).unwrap();
                for (a, b) in twin.iter().zip(&run) {
                    assert!((a - b).abs() < 1e-12, "{}: {a} {b}", study.name());
                }
            }
        }
    }

    /// The noise has the standard deviations of the twin: of the innovations of the first samples, over many records.
    #[test]
    fn noise_is_as_strong_as_the_twins() {
        for study in reference_studies().unwrap() {
            let world = World::of(study.name()).unwrap();
            let noise = Noise::new(4, "world", 0);
            let theta = study.twin().parameters().centre();
            let drive = study.drives().unwrap().draw(noise).unwrap();
            let at = |k: usize, of_twin: bool| {
                let values: Vec<f64> = (0..400)
                    .map(|i| match of_twin {
                        true => study
                            .twin()
                            .simulate(&theta, &drive, noise.sample(i))
                            .unwrap()[[k, 0]],
                        false => world.run(&theta, &drive, &[], 1, noise.sample(i)).unwrap()[k],
                    })
                    .collect();
                let mean = values.iter().sum::<f64>() / 400.0;
                (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 400.0).sqrt()
            };
            let (twin, own) = (at(25, true), at(25, false));
            assert!(
                (twin / own).ln().abs() < 0.2,
                "{}: {twin} {own}",
                study.name()
            );
        }
    }

    #[test]
    fn an_overflow_spills_and_a_runaway_is_noticed() {
        let mut x = [5.0, 1.0];
        let ceiling = Perturbation::Ceiling {
            on: 0,
            level: 3.0,
            spill: 0.25,
            softness: 0.0,
        };
        after_step(&ceiling, &mut x, &mut Noise::OFF.source("t"));
        assert_eq!(x, [3.0, 1.5]);
        let world = World::of("van-der-pol").unwrap();
        let drive = Drive::autonomous(0.05, 300).unwrap();
        let perturbation = Perturbation::Force {
            on: 1,
            law: ForceLaw::Linear {
                rate: 5.0,
                of: 0,
                span: None,
            },
        };
        assert_eq!(
            world.run(&[0.1], &drive, &[perturbation], 1, Noise::OFF),
            None
        );
    }
}
