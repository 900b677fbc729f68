//! Times of the parts that take long: `cargo bench --bench speed`, with `-- bank` those whose names hold a word. Run them with
//! `RAYON_NUM_THREADS=1` for the figures of docs/scaling.md.

mod bank;
mod estimate;
mod features;
mod filter;
mod network;

use std::hint::black_box;
use std::time::{Duration, Instant};

/// Time for one figure.
const PATIENCE: Duration = Duration::from_secs(3);
/// Calls are timed in batches of at least this length.
const BATCH: Duration = Duration::from_millis(5);

/// Runs what the command line asks for, and prints medians.
#[derive(Debug)]
pub struct Clock {
    words: Vec<String>,
}

impl Clock {
    /// Returns true if a name is asked for.
    pub fn wants(&self, name: &str) -> bool {
        self.words.is_empty() || self.words.iter().any(|word| name.contains(word))
    }

    /// Prints the median time of a call, and elements a second where a call handles more than one.
    pub fn time<T>(&self, name: &str, elements: u64, mut work: impl FnMut() -> T) {
        self.print(name, elements, |calls| {
            let start = Instant::now();
            for _ in 0..calls {
                black_box(work());
            }
            start.elapsed()
        });
    }

    /// As [`time`](Self::time), of `calls` calls that measure themselves.
    pub fn print(&self, name: &str, elements: u64, mut calls: impl FnMut(u32) -> Duration) {
        if !self.wants(name) {
            return;
        }
        let first = calls(1).max(Duration::from_nanos(1));
        let batch = (BATCH.as_secs_f64() / first.as_secs_f64()).clamp(1.0, 1e6) as u32;
        let (start, mut seconds) = (Instant::now(), Vec::new());
        while seconds.len() < 5 || start.elapsed() < PATIENCE {
            seconds.push(calls(batch).as_secs_f64() / f64::from(batch));
        }
        seconds.sort_by(f64::total_cmp);
        let median = seconds[seconds.len() / 2];
        let rate = elements as f64 / median;
        let rate = (elements > 1).then(|| format!(", {rate:.0} a second"));
        let rate = rate.unwrap_or_default();
        println!("{name}: {:.4} ms{rate}", 1e3 * median);
    }
}

fn main() {
    let words = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with("--"));
    let clock = Clock {
        words: words.collect(),
    };
    bank::run(&clock);
    estimate::run(&clock);
    features::run(&clock);
    filter::run(&clock);
    network::run(&clock);
}
