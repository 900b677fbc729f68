//! One pass of a filter over a record: 400 rows of tanks, 300 of van der Pol; then ratios of cases that take turns: scores side
//! by side over one by one, twins with effects over the bare tanks, chains of tanks.
//!
//! To compare with an older checkout, run the same bench there, both in turn on the same machine, and compare the least times.

use crate::Clock;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use truetwin::effect::{Catalogue, augment};
use truetwin::likelihood::kalman::{
    Coordinates, FilterError, FilterSettings, Kalman, Method, Score,
};
use truetwin::record::{Drive, Record, Signal};
use truetwin::twin::{Composed, DigitalTwin, Interval, Noise, Now, Outline, Parameter, StateSpace};
use truetwin::twins::{CascadedTanks, VanDerPol};

const TANKS: [f64; 4] = [0.6, 0.5, 0.55, 1.0];

/// A chain of tanks, each running into the next.
struct Chain(usize);

impl StateSpace for Chain {
    fn outline(&self) -> Outline {
        let all = 0..self.0;
        let parameter = |i| Parameter::new(&format!("k{i}"), "-", 0.3, 1.0);
        let outline = all
            .clone()
            .fold(Outline::new(), |o, i| o.parameter(parameter(i)));
        let outline = all.fold(outline, |o, i| o.state(&format!("h{i}"), "m"));
        outline.input("u", "V").output("y", "m")
    }
    fn drift(&self, now: &Now<'_>, h: &[f64], dh: &mut [f64]) {
        let mut into = now.u[0];
        for i in 0..h.len() {
            let out = now.theta[i] * h[i].abs().max(1e-6).sqrt();
            dh[i] = into - out;
            into = out;
        }
    }
    fn observe(&self, _: &Now<'_>, h: &[f64], y: &mut [f64]) {
        y[0] = h[h.len() - 1];
    }
    fn start(&self, _: &Now<'_>, h: &mut [f64]) {
        h.fill(4.0);
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process.fill(0.03);
        measurement[0] = 0.05;
    }
    fn limits(&self) -> Vec<Interval> {
        let limit = Interval::new(0.0, 10.0).expect("an interval");
        vec![limit; self.0]
    }
}

fn levels(rows: usize) -> Drive {
    let levels = Signal::from_shape_fn((rows, 1), |(k, _)| ((k / 30) * 7 % 5) as f64 * 0.6);
    Drive::new(0.5, levels).expect("the step is positive")
}

fn simulated(twin: &dyn DigitalTwin, theta: &[f64], drive: &Drive, run: u64) -> Record {
    let outputs = twin.simulate(theta, drive, Noise::new(1, "bench", run));
    Record::new(drive.clone(), outputs.expect("it is stable")).expect("the outputs are finite")
}

/// Least microseconds of cases that take turns, so that other work on the machine meets all of them alike.
fn in_turn<const CASES: usize>(mut cases: [&mut dyn FnMut(); CASES]) -> [f64; CASES] {
    let mut least = [f64::INFINITY; CASES];
    for _ in 0..100 {
        for (case, least) in cases.iter_mut().zip(&mut least) {
            let start = Instant::now();
            case();
            *least = least.min(1e6 * start.elapsed().as_secs_f64());
        }
    }
    least
}

fn ratios(clock: &Clock) {
    if !clock.wants("filter: ratios") {
        return;
    }
    let (settings, drive) = (FilterSettings::default(), levels(400));
    let record = simulated(&CascadedTanks, &TANKS, &drive, 0);
    let twin = Composed::from(CascadedTanks);
    let kalman = Kalman::new(&twin, &record, &settings).expect("it fits");
    let coordinates = Coordinates::new(kalman.parameters());
    let score = |of: fn(&Kalman<'_>, &[f64], &Coordinates) -> Result<Score, FilterError>| {
        assert!(black_box(of(&kalman, black_box(&TANKS), &coordinates)).is_ok());
    };
    let eight: Vec<Record> = (0..8)
        .map(|run| simulated(&CascadedTanks, &TANKS, &drive, run))
        .collect();
    let kalmans: Vec<Kalman<'_>> = (eight.iter())
        .map(|record| Kalman::new(&twin, record, &settings).expect("it fits"))
        .collect();
    let [before, now, of_eight] = in_turn([
        &mut || score(Score::forward_one_by_one),
        &mut || score(Score::forward),
        &mut || {
            let found = Score::forward_all(&kalmans, black_box(&TANKS), &coordinates);
            assert!(black_box(found).iter().all(Result::is_ok));
        },
    ]);
    let (ratio, each) = (before / now, of_eight / 8.0);
    println!(
        "filter: ratios, score: {before:.1} µs one by one, {now:.1} µs side by side: {ratio:.2}"
    );
    let ratio = before / each;
    println!("filter: ratios, score: {each:.1} µs a record, eight side by side: {ratio:.2}");
    let library = Catalogue::default();
    let listed = |id, target| library.effect(id, target).expect("it is listed");
    for (effect, magnitudes) in [
        (listed("quadratic-drag", "h1"), &[0.01][..]),
        (listed("state-ceiling", "h1").with_other("h2"), &[4.0, 0.5]),
        (listed("sensor-lag", "sensor"), &[0.7]),
    ] {
        let name = effect.id().to_owned();
        let twin = augment(Arc::new(CascadedTanks), vec![effect]).expect("it stands there");
        let twin = twin.equations().expect("a twin with equations");
        let theta = [&TANKS[..], magnitudes].concat();
        let grown = Kalman::new(twin, &record, &settings).expect("it fits");
        let pass = |of: &Kalman<'_>, theta: &[f64]| {
            assert!(black_box(of.log_likelihood(black_box(theta))).is_ok());
        };
        let [bare, augmented] =
            in_turn([&mut || pass(&kalman, &TANKS), &mut || pass(&grown, &theta)]);
        let ratio = augmented / bare;
        println!(
            "filter: ratios, tanks with {name}: {augmented:.1} µs over {bare:.1} µs: {ratio:.2}"
        );
        let score = |of: &Kalman<'_>, theta: &[f64]| {
            let coordinates = Coordinates::new(of.parameters());
            assert!(black_box(Score::forward(of, black_box(theta), &coordinates)).is_ok());
        };
        let [bare, augmented] = in_turn([&mut || score(&kalman, &TANKS), &mut || {
            score(&grown, &theta)
        }]);
        // Passes of a score: one, and one a parameter.
        let each = [
            bare / (1 + TANKS.len()) as f64,
            augmented / (1 + theta.len()) as f64,
        ];
        println!(
            "filter: ratios, score with {name}, a pass: {:.1} µs over {:.1} µs: {:.2}",
            each[1],
            each[0],
            each[1] / each[0]
        );
    }
    for n in [2, 5, 10, 20] {
        let (twin, drive) = (Chain(n), levels(200));
        let theta: Vec<f64> = (0..n).map(|i| 0.5 + 0.02 * i as f64).collect();
        let record = simulated(&twin, &theta, &drive, 0);
        let kalman = Kalman::new(twin, &record, &settings).expect("it fits");
        let [pass] = in_turn([&mut || drop(black_box(kalman.log_likelihood(black_box(&theta))))]);
        println!("filter: ratios, chain of {n} tanks, 200 rows: {pass:.1} µs");
    }
}

pub fn run(clock: &Clock) {
    ratios(clock);
    let levels = Signal::from_shape_fn((400, 1), |(k, _)| ((k / 30) * 7 % 5) as f64 * 0.6);
    let forced = Drive::new(0.5, levels).expect("the step is positive");
    let free = Drive::autonomous(0.05, 300).expect("the step is positive");
    let cases: [(&str, Composed, Drive, &[f64]); 2] = [
        (
            "tanks",
            CascadedTanks.into(),
            forced,
            &[0.6, 0.5, 0.55, 1.0],
        ),
        ("van der Pol", VanDerPol.into(), free, &[3.0]),
    ];
    for (name, twin, drive, theta) in cases {
        let outputs =
            (twin_outputs(name, theta, &drive)).expect("these parameters can be simulated");
        let record = Record::new(drive, outputs).expect("the outputs are finite");
        for method in [Method::Points, Method::Extended] {
            let settings = FilterSettings::default().with_method(method);
            let kalman = Kalman::new(&twin, &record, &settings).expect("the channels agree");
            let name = |part: &str| format!("filter: {name}, {method:?}, {part}");
            clock.time(&name("log-likelihood"), 1, || {
                kalman.log_likelihood(black_box(theta))
            });
            if method == Method::Points {
                let coordinates = Coordinates::new(kalman.parameters());
                clock.time(&name("one-sided score"), 1, || {
                    Score::forward(&kalman, black_box(theta), &coordinates)
                });
                clock.time(&name("score"), 1, || Score::at(&kalman, black_box(theta)));
            }
        }
    }
}

fn twin_outputs(
    name: &str,
    theta: &[f64],
    drive: &Drive,
) -> Result<Signal, Box<dyn std::error::Error>> {
    let noise = Noise::new(1, "bench", 0);
    Ok(match name {
        "tanks" => CascadedTanks.simulate(theta, drive, noise)?,
        _ => VanDerPol.simulate(theta, drive, noise)?,
    })
}
