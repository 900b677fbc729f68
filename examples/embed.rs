//! Embedding: arrays in, result out, with progress and cancellation; nothing is printed by the library.
//!
//! `cargo run --release --example embed`

use ndarray::Array2;
use std::slice;
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
    // The measurement, as an application has it: plain arrays. Here ν = 3, outside of the prior [0, 2.5].
    let drive = Drive::autonomous(0.05, 300)?;
    let measured: Array2<f64> = VanDerPol.simulate(&[3.0], &drive, Noise::new(7, "measured", 0))?;
    let no_input = Array2::zeros((300, 0));
    let record = Record::from_views(0.05, no_input.view(), measured.view())?;

    let study = Study::of(VanDerPol)?;
    let nu = &study.fit(slice::from_ref(&record))?.parameters[0];
    println!(
        "nu {:.3}, {:.3} to {:.3} (truth 3)",
        nu.value, nu.low, nu.high
    );

    // With progress, and a stop button that ends long work at the next unit.
    let window = Arc::new(Window::default());
    let progress = Progress::new(window.clone());
    let quick = DiagnoseSettings {
        quick: true,
        ..DiagnoseSettings::default()
    };
    let diagnosis = diagnose(&study, slice::from_ref(&record), None, &quick, &progress)?;
    println!("{:?}", diagnosis.verdict);
    window.stop.store(true, Ordering::Relaxed);
    match diagnose(&study, slice::from_ref(&record), None, &quick, &progress) {
        Err(error) => println!("stopped: {error}"),
        Ok(_) => return Err("the stop button did nothing".into()),
    }
    Ok(())
}
