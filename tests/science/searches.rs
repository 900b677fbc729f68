//! Searches of likelihoods with several tops: how many seeds arrive, and whether another top is ever taken for the best.

use truetwin::fit::{Fit, FitSettings};
use truetwin::prelude::*;
use truetwin::study::StudyFile;

/// Nats within which a fit has arrived at the best known top.
const ARRIVED: f64 = 0.5;

/// A twin whose parameters a record tells, and whose likelihood has tops beside the best one.
struct Search {
    name: &'static str,
    text: &'static str,
    /// Parameters of the record, magnitudes of the study's effects last.
    theta: &'static [f64],
    /// What the record has beside the twin's equations.
    effect: &'static str,
}

macro_rules! search {
    ($name:literal, $theta:expr) => {
        search!($name, $theta, "")
    };
    ($name:literal, $theta:expr, $effect:expr) => {
        Search {
            name: $name,
            text: include_str!(concat!("searches/", $name, ".toml")),
            theta: &$theta,
            effect: $effect,
        }
    };
}

const DELAY: &str =
    "[[effect]]\nid = 'actuator-delay'\ntarget = 'actuator'\nmagnitudes = { delay = 0.7 }\n";
const CEILING: &str = "[[effect]]\nid = 'state-ceiling'\ntarget = 'h1'\nto = 'h2'\nmagnitudes = { level = 4.0, spill = 0.3 }\n";

const ALL: [Search; 15] = [
    search!("oscillator", [11.0, 0.01]),
    search!("two-modes", [5.0, 11.0, 2.0, 3.0]),
    search!("predator-prey", [0.6, 0.028, 0.84, 0.026]),
    search!("brusselator", [1.0, 3.0]),
    search!("pendulum", [2.5, 0.2, 8.0]),
    search!("dead-time", [1.0, 2.0], DELAY),
    search!("valley", [0.6, 0.5, 1.5]),
    search!("ceiling", [0.6, 0.5], CEILING),
    search!("hidden-sign", [1.0, 0.7, 0.8]),
    search!("rectified", [1.0, 0.4, 8.0, 0.1]),
    search!("relaxation", [4.0, 1.2]),
    search!("spikes", [0.2, 0.2, 3.0]),
    search!("duffing", [1.0, 1.0, 0.3, 0.4]),
    search!("late-decay", [2.0, 0.8, 3.3]),
    search!("wave", [2.0, 0.3, 1.7, 1.0]),
];

/// Seeds of one search, by what became of them.
#[derive(Default)]
struct Tally {
    seeds: usize,
    /// Within half a nat of the best.
    arrived: usize,
    /// Of these, those that were said to have converged.
    converged: usize,
    /// Said to have converged elsewhere.
    astray: usize,
    seconds: f64,
}

impl Search {
    fn study(&self) -> Study {
        let file = StudyFile::parse(self.text, self.name.as_ref()).unwrap();
        Study::of_file(&file).unwrap()
    }

    /// Fits of one record with these seeds.
    fn fits(&self, seeds: std::ops::Range<u64>) -> Vec<Fit> {
        let study = self.study();
        let noise = Noise::new(7, "searches", 0);
        let record = crate::diagnose::trials::record(
            study.twin(),
            self.effect,
            self.theta,
            study.drive(noise).unwrap(),
            noise,
        );
        let fit = |seed| {
            let settings = FitSettings {
                seed,
                ..FitSettings::default()
            };
            let record = std::slice::from_ref(&record);
            study.fit_with(record, &settings, &Progress::silent())
        };
        seeds.map(|seed| fit(seed).unwrap()).collect()
    }

    fn tally(&self, seeds: std::ops::Range<u64>) -> Tally {
        let fits = self.fits(seeds);
        let best = fits.iter().map(|fit| fit.log_likelihood);
        let best = best.fold(f64::NEG_INFINITY, f64::max);
        let mut tally = Tally::default();
        for fit in &fits {
            tally.seeds += 1;
            tally.seconds += fit.seconds;
            let arrived = fit.log_likelihood > best - ARRIVED;
            tally.arrived += usize::from(arrived);
            tally.converged += usize::from(arrived && fit.convergence.converged);
            tally.astray += usize::from(!arrived && fit.convergence.converged);
        }
        println!(
            "| {} | {} of {} | {} | {} | {:.1} |",
            self.name,
            tally.arrived,
            tally.seeds,
            tally.converged,
            tally.astray,
            tally.seconds / tally.seeds as f64
        );
        tally
    }
}

/// Those that take least, two seeds each: all arrive, and none is told to have converged where it has not.
#[test]
fn searches_arrive() {
    for search in &ALL {
        if !["oscillator", "valley", "late-decay", "hidden-sign"].contains(&search.name) {
            continue;
        }
        let tally = search.tally(1..3);
        assert_eq!((tally.arrived, tally.astray), (2, 0), "{}", search.name);
    }
}

/// Twenty seeds of each: an hour or two of one core.
#[test]
#[ignore = "minutes; cargo test --release --test science searches -- --ignored --nocapture"]
fn searches_of_twenty_seeds_arrive() {
    println!("| fit | arrived | said so | converged elsewhere | seconds |");
    let all: Vec<Tally> = ALL.iter().map(|search| search.tally(101..121)).collect();
    let sum = |of: fn(&Tally) -> usize| all.iter().map(of).sum::<usize>();
    let (seeds, arrived) = (sum(|t| t.seeds), sum(|t| t.arrived));
    println!(
        "{arrived} of {seeds}, {} of them said so",
        sum(|t| t.converged)
    );
    assert!(arrived * 100 >= 95 * seeds, "{arrived} of {seeds}");
    assert_eq!(sum(|t| t.astray), 0);
}
