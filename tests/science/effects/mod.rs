//! The library of effects against its contract: golden records, off to the bit, noise, files, black boxes.

mod chain;
mod files;
mod golden;
mod library;
mod noise;
mod off;
mod shapes;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use truetwin::effect::*;
use truetwin::record::*;
use truetwin::twin::*;
use truetwin::twins::{CascadedTanks, VanDerPol};

/// θ of the contract's records.
const TANKS: [f64; 4] = [0.6, 0.5, 0.55, 1.0];
/// θ of the contract's records.
const NU: [f64; 1] = [1.5];

/// A reference twin without its equations: noise and all come out of one box.
struct BlackBox<T>(T);

impl<T: DigitalTwin> DigitalTwin for BlackBox<T> {
    fn parameters(&self) -> ParameterSpace {
        self.0.parameters()
    }
    fn signals(&self) -> Signals {
        self.0.signals()
    }
    fn simulate(&self, p: &[f64], d: &Drive, n: Noise) -> Result<Signal, SimulationError> {
        self.0.simulate(p, d, n)
    }
}

/// A name, a twin, a θ inside, and a drive that moves it.
type Case = (&'static str, Twin, Vec<f64>, Drive);

/// The reference twins, with their equations and without.
fn twins() -> Vec<Case> {
    let inputs = Signal::from_shape_fn((150, 1), |(k, _)| [2.6, 0.4, 3.0, 0.0, 1.7][k / 30]);
    let driven = Drive::new(0.5, inputs).unwrap();
    let free = Drive::autonomous(0.05, 150).unwrap();
    let (tanks, nu) = (TANKS.to_vec(), NU.to_vec());
    vec![
        (
            "tanks",
            Twin::new(CascadedTanks),
            tanks.clone(),
            driven.clone(),
        ),
        (
            "van-der-pol",
            Twin::new(VanDerPol),
            nu.clone(),
            free.clone(),
        ),
        (
            "boxed tanks",
            Twin::new(BlackBox(CascadedTanks)),
            tanks,
            driven,
        ),
        (
            "boxed van-der-pol",
            Twin::new(BlackBox(VanDerPol)),
            nu,
            free,
        ),
    ]
}

/// θ of a twin with these effects at what their files hold; nothing may be left free.
fn held(theta: &[f64], effects: &[Effect]) -> Vec<f64> {
    let magnitudes = effects
        .iter()
        .flat_map(|effect| (effect.magnitudes().iter()).map(|m| effect.given(m.name).unwrap()));
    theta.iter().copied().chain(magnitudes).collect()
}

/// Effects from the text of a file.
fn from(text: &str) -> Vec<Effect> {
    Catalogue::default().parse(text).unwrap()
}

/// One effect in a file; `rest` holds further keys.
fn one(id: &str, target: &str, rest: &str) -> Vec<Effect> {
    from(&format!(
        "[[effect]]\nid = \"{id}\"\ntarget = \"{target}\"\n{rest}"
    ))
}

/// One run of a twin with these effects.
fn run(base: Twin, theta: &[f64], e: Vec<Effect>, drive: &Drive, noise: Noise) -> Signal {
    let theta = held(theta, &e);
    (augment(base, e).unwrap().simulate(&theta, drive, noise)).unwrap()
}

fn bits(signal: &Signal) -> Vec<u64> {
    signal.iter().map(|v| v.to_bits()).collect()
}
