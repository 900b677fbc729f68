//! Embedding: arrays in, result out, with progress and cancellation; nothing is printed by the library.
//!
//! `cargo run --release --example embed` (add `-- small` for a run of a few seconds)

use ndarray::Array2;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use truetwin::prelude::*;
use truetwin::progress::Listener;
use truetwin::twins::VanDerPol;

/// Where an application would move a progress bar, and look at its stop button.
#[derive(Default)]
struct Window {
    shown: AtomicU64,
    stop: AtomicBool,
}

impl Listener for Window {
    fn advanced(&self, stage: &str, done: u64, total: u64) {
        let percent = 100 * done / total.max(1);
        if percent / 25 != self.shown.swap(percent, Ordering::Relaxed) / 25 {
            println!("{stage}: {percent} %");
        }
    }
    fn cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let small = std::env::args().any(|a| a == "small");
    let window = Arc::new(Window::default());
    let progress = Progress::new(window.clone());

    // A twin, and what its records look like: 300 samples, 0.05 s apart.
    let study = Study::new("oscillator", VanDerPol, RecordPlan::autonomous(0.05, 300))?;
    let options = PretrainOptions {
        bank_size: Some(if small { 500 } else { 5000 }),
        epochs: Some(if small { 10 } else { 60 }),
        seed: 1,
        ..PretrainOptions::default()
    };
    let (estimator, _history) = pretrain(&study, &options, &progress)?;

    // The measurement, as an application has it: plain arrays. Here ν = 3, outside of the prior [0, 2.5].
    let drive = Drive::autonomous(0.05, 300)?;
    let measured: Array2<f64> = VanDerPol.simulate(&[3.0], &drive, Noise::new(7, "measured", 0))?;
    let record = Record::new(drive, measured)?;

    let estimate = estimator.estimate(&record, &EstimateOptions::default(), &progress)?;
    println!(
        "gate p = {:.3}; nu: network {:.3}, calibrated {:.3} ± {:.3} (truth 3)",
        estimate.gate.p_value, estimate.initial.theta[0], estimate.theta[0], estimate.std_error[0]
    );

    // A stop button ends long work at the next unit, with an error that says so.
    window.stop.store(true, Ordering::Relaxed);
    match pretrain(&study, &options, &progress) {
        Err(error) => println!("stopped: {error}"),
        Ok(_) => return Err("the stop button did nothing".into()),
    }
    Ok(())
}
