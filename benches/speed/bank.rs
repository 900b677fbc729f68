//! Simulations with features a second, and the price of writing a twin as equations: the tanks beside a loop by hand, one at a
//! time and in batches on more and more threads.

use crate::Clock;
use rayon::prelude::*;
use std::hint::black_box;
use truetwin::feature::{Ar, Arx, FeatureRecipe};
use truetwin::record::Drive;
use truetwin::study::{RecordPlan, Study};
use truetwin::twin::{DigitalTwin, Noise};
use truetwin::twins::{CascadedTanks, VanDerPol};

/// Simulations an iteration.
const BANK: usize = 200;
const THETA: [f64; 4] = [0.6, 0.5, 0.55, 1.0];

/// Draws from the prior, each with its own input, as pretraining does.
fn bank(clock: &Clock) {
    let free = RecordPlan::autonomous(0.05, 300);
    let staircase = RecordPlan::levels(0.5, 400, 0.0, 3.0, 30);
    let arx = |lags| Arx {
        outputs: lags,
        inputs: lags,
    };
    let oscillator = Study::new("oscillator", VanDerPol, free).expect("a plan of this twin");
    let tanks = Study::new("tanks", CascadedTanks, staircase).expect("a plan of this twin");
    let cases: [(&str, &Study, &dyn FeatureRecipe); 3] = [
        ("van der Pol, AR(5)", &oscillator, &Ar { order: 5 }),
        ("tanks, ARX(8, 8)", &tanks, &arx(8)),
        ("tanks, ARX(64, 64)", &tanks, &arx(64)),
    ];
    for (name, study, features) in cases {
        let twin = study.twin();
        let (space, map) = (
            twin.parameters(),
            features.bind(twin).expect("fits the twin"),
        );
        let row = |i| {
            let noise = Noise::new(1, "bench", i);
            let drive = study.drive(noise).ok()?;
            let outputs = twin
                .simulate(&space.draw_prior(noise), &drive, noise)
                .ok()?;
            map.extract(&drive, &outputs).ok()
        };
        clock.time(&format!("bank: {name}"), BANK as u64, || {
            (0..BANK as u64)
                .into_par_iter()
                .map(row)
                .collect::<Vec<_>>()
        });
    }
}

/// The tanks as `StateSpace` runs them, noise and limits included.
fn by_hand(theta: &[f64; 4], drive: &Drive, noise: Noise) -> Vec<f64> {
    let [k1, k2, k3, k4] = *theta;
    let [mut w1, mut w2] = ["process/h1", "process/h2"].map(|name| noise.source(name));
    let mut v = noise.source("measurement/y");
    let (dt, inputs) = (drive.dt(), drive.inputs());
    let (mut h1, mut h2) = (0.0f64, 0.0f64);
    inputs
        .iter()
        .map(|u| {
            let y = h2 + 0.15 * v.normal();
            let (upper, lower) = (h1.max(1e-6).sqrt(), h2.max(1e-6).sqrt());
            h1 = (h1 + dt * (-k1 * upper + k4 * u) + 0.1 * w1.normal()).clamp(0.0, 10.0);
            h2 = (h2 + dt * (k2 * upper - k3 * lower) + 0.1 * w2.normal()).clamp(0.0, 10.0);
            y
        })
        .collect()
}

fn simulators(clock: &Clock) {
    let plan = RecordPlan::levels(0.5, 400, 0.0, 3.0, 30);
    let drive = plan.drive(&CascadedTanks.signals(), Noise::OFF);
    let drive = drive.expect("a plan of the tanks");
    for (noises, noise) in [
        ("noise", Noise::new(1, "bench", 0)),
        ("no noise", Noise::OFF),
    ] {
        let generic = (CascadedTanks.simulate(&THETA, &drive, noise)).expect("it is stable");
        let hand = by_hand(&THETA, &drive, noise);
        let equal = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
        assert!(generic.iter().zip(&hand).all(equal), "the same equations");
        let name = |how: &str| format!("simulator, tanks, {how}, {noises}");
        clock.time(&name("equations"), 1, || {
            CascadedTanks.simulate(black_box(&THETA), &drive, noise)
        });
        clock.time(&name("by hand"), 1, || {
            by_hand(black_box(&THETA), &drive, noise)
        });
    }
}

/// Records at once, on so many threads.
const BATCH: u64 = 512;

/// Batches of tanks records on pools of threads, by the generic simulator and by hand.
fn threads(clock: &Clock) {
    let plan = RecordPlan::levels(0.5, 400, 0.0, 3.0, 30);
    let drive = plan.drive(&CascadedTanks.signals(), Noise::OFF);
    let drive = drive.expect("a plan of the tanks");
    let most = std::thread::available_parallelism().map_or(1, usize::from);
    for threads in (0..).map(|i| 1 << i).take_while(|n| *n <= most) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads can be started");
        let noise = |i| Noise::new(1, "bench", i);
        // The last output of each record, so that none is left out.
        let generic = |i| match CascadedTanks.simulate(&THETA, &drive, noise(i)) {
            Ok(y) => y[[y.nrows() - 1, 0]],
            Err(_) => f64::NAN,
        };
        let hand = |i| by_hand(&THETA, &drive, noise(i))[drive.samples() - 1];
        let name = |how: &str| format!("batch of tanks records, {how}, {threads} threads");
        clock.time(&name("equations"), BATCH, || {
            pool.install(|| (0..BATCH).into_par_iter().map(generic).sum::<f64>())
        });
        clock.time(&name("by hand"), BATCH, || {
            pool.install(|| (0..BATCH).into_par_iter().map(hand).sum::<f64>())
        });
    }
}

pub fn run(clock: &Clock) {
    bank(clock);
    simulators(clock);
    threads(clock);
}
