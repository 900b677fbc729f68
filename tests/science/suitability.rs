//! `Study::check_suitability`: spoilt records are named, right ones are not.

use truetwin::evaluate::paper::reference_studies;
use truetwin::prelude::*;
use truetwin::study::StudyFile;
use truetwin::twin::Interval;
use truetwin::twin::conformance::Severity;
use truetwin::twins::CascadedTanks;

/// The tanks with a sensor in each.
struct BothTanks;
impl StateSpace for BothTanks {
    fn outline(&self) -> Outline {
        let outline = StateSpace::outline(&CascadedTanks);
        Outline {
            outputs: vec![],
            ..outline
        }
        .output("upper", "V")
        .output("lower", "V")
    }
    fn drift(&self, now: &Now<'_>, h: &[f64], dh: &mut [f64]) {
        CascadedTanks.drift(now, h, dh);
    }
    fn observe(&self, _: &Now<'_>, h: &[f64], y: &mut [f64]) {
        y.copy_from_slice(h);
    }
    fn noise(&self, _: &Now<'_>, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        process.fill(0.1);
        measurement.fill(0.15);
    }
    fn limits(&self) -> Vec<Interval> {
        CascadedTanks.limits()
    }
}

fn both_tanks() -> Study {
    let plan = RecordPlan::levels(0.5, 400, 0.0, 3.0, 30);
    Study::new("both", BothTanks, plan).unwrap()
}

/// A record of a study at a point of its prior, under other inputs if `change` says so.
fn record(study: &Study, seed: u64, change: impl Fn(f64) -> f64) -> Record {
    let noise = Noise::new(seed, "suitability test", 0);
    let theta = study.twin().parameters().draw_prior(noise);
    let drive = study.drive(noise).unwrap();
    let drive = Drive::new(drive.dt(), drive.inputs().mapv(change)).unwrap();
    let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

/// Checks that did not pass, with their messages.
fn warnings(study: &Study, record: &Record) -> Vec<(&'static str, String)> {
    let findings = study.check_suitability(record, 1, &Progress::silent());
    (findings.unwrap().into_iter())
        .filter(|finding| finding.severity != Severity::Pass)
        .map(|finding| (finding.check, finding.message))
        .collect()
}

#[test]
fn right_records_have_no_finding() {
    let mut studies = reference_studies().unwrap();
    studies.push(both_tanks());
    for study in studies {
        let mut wrong = vec![];
        for seed in 0..12 {
            let found = warnings(&study, &record(&study, seed, |u| u));
            wrong.extend(found.into_iter().map(|finding| (seed, finding)));
        }
        println!("{}: {} findings in 12 records", study.name(), wrong.len());
        assert!(wrong.is_empty(), "{}: {wrong:#?}", study.name());
    }
}

/// Doses, jumps at events, limits and spikes that some points of the prior show are the twin's, not the sensor's: of a run that is drawn as the
/// 25 of the check are, at most 1.5 % show what none of these does.
#[test]
fn what_a_twin_does_at_some_points_of_its_prior_is_no_damage() {
    let texts = [
        (
            "doses",
            "[parameters]\nk = { prior = [0.05, 2.0], bounds = [0.01, 5.0] }\n\
          [states]\nblood = { rate = \"dose - k*blood\", start = 0.0 }\n[inputs]\ndose = { hold = \"impulse\" }\n\
          [outputs]\ny = { value = \"blood\", noise = 0.05 }\n\
          [record]\nstep = 0.5\nsamples = 200\ninput = { levels = [5.0, 20.0], hold = 20 }\n",
        ),
        (
            "resets",
            "[parameters]\nrate = { prior = [0.1, 3.0], bounds = [0.01, 9.0] }\n\
          [states]\nx = { rate = \"rate\", start = 0.0 }\n[outputs]\ny = { value = \"x\", noise = 0.02 }\n\
          [[event]]\nwhen = \"x > 3\"\nset = { x = 0 }\n[record]\nstep = 0.5\nsamples = 200\n",
        ),
        (
            "limits",
            "[parameters]\ngain = { prior = [0.2, 2.0], bounds = [0.1, 5.0] }\n\
          [states]\nx = { rate = \"gain*u - x\", start = 0.0, limits = [0.0, 1.5] }\n[inputs]\nu = {}\n\
          [outputs]\ny = { value = \"x\", noise = 1e-4 }\n[noise]\nprocess = \"none\"\n\
          [record]\nstep = 0.2\nsamples = 300\ninput = { levels = [0.0, 1.0], hold = 20 }\n",
        ),
        (
            "spikes",
            "[parameters]\nsharp = { prior = [1.0, 400.0], bounds = [0.5, 900.0] }\n\
          [states]\nphase = { rate = \"1\", start = 0.0 }\n[outputs]\ny = { value = \"exp(sharp*(cos(phase) - 1))\", noise = 1e-3 }\n\
          [noise]\nprocess = \"none\"\n[record]\nstep = 0.15\nsamples = 300\n",
        ),
    ];
    let damages = ["clipped", "constant", "outliers", "quantised"];
    let mut wrong = vec![];
    for (name, text) in texts {
        let file = StudyFile::parse(text, "twin.toml".as_ref()).unwrap();
        let study = Study::of_file(&file).unwrap();
        for seed in 0..12 {
            let found = warnings(&study, &record(&study, seed, |u| u)).into_iter();
            let found = found.filter(|(check, _)| damages.contains(check));
            wrong.extend(found.map(|finding| (name, seed, finding)));
        }
    }
    assert!(wrong.len() <= 2, "{wrong:#?}");
}

/// Of few levels, all may be small: short records of the plan itself have no wrong unit.
#[test]
fn short_records_have_small_inputs() {
    let mut wrong = vec![];
    for (samples, hold) in [(16, 30), (40, 20), (60, 20)] {
        let plan = RecordPlan::levels(0.5, samples, 0.0, 3.0, hold);
        let study = Study::new("short", BothTanks, plan).unwrap();
        for seed in 0..30 {
            // An output that is not as large as the runs follows from the input.
            let mut found = warnings(&study, &record(&study, seed, |u| u)).into_iter();
            wrong.extend(found.find(|(check, _)| ["scale", "inputs"].contains(check)));
        }
    }
    // One level in 63 lies below two fifths of the least of 24: of 30 records of one level, more than two would be wrong once in 70 times.
    assert!(wrong.len() <= 2, "{wrong:#?}");
}

/// Twelve ways to spoil a record, each with the check that names it.
#[test]
fn spoilt_records_are_named() {
    type Spoil = fn(&Study, u64) -> Record;
    fn with(study: &Study, seed: u64, change: impl Fn(&mut Signal)) -> Record {
        let right = record(study, seed, |u| u);
        let mut outputs = right.outputs().clone();
        change(&mut outputs);
        Record::new(right.drive().clone(), outputs).unwrap()
    }
    let spoils: [(&str, &str, Spoil); 12] = [
        ("pump off", "parameters", |s, seed| record(s, seed, |_| 0.0)),
        ("outputs swapped", "swapped", |s, seed| {
            with(s, seed, |y| y.invert_axis(ndarray::Axis(1)))
        }),
        ("milliseconds", "time", |s, seed| {
            let right = record(s, seed, |u| u);
            let inputs = right.drive().inputs().clone();
            let drive = Drive::new(1000.0 * right.drive().dt(), inputs).unwrap();
            Record::new(drive, right.outputs().clone()).unwrap()
        }),
        ("clipped", "clipped", |s, seed| {
            with(s, seed, |y| {
                let mut lower = y.column_mut(1);
                let limit = 0.7 * lower.iter().copied().fold(0.0, f64::max);
                lower.mapv_inplace(|y| y.min(limit));
            })
        }),
        ("constant input", "constant", |s, seed| {
            record(s, seed, |_| 1.5)
        }),
        ("constant output", "constant", |s, seed| {
            with(s, seed, |y| y.column_mut(0).fill(2.0))
        }),
        ("output times 1000", "scale", |s, seed| {
            with(s, seed, |y| y.column_mut(1).mapv_inplace(|y| 1000.0 * y))
        }),
        ("input times 1000", "scale", |s, seed| {
            let right = record(s, seed, |u| u);
            let inputs = right.drive().inputs().mapv(|u| 1000.0 * u);
            let drive = Drive::new(right.drive().dt(), inputs).unwrap();
            Record::new(drive, right.outputs().clone()).unwrap()
        }),
        ("outliers", "outliers", |s, seed| {
            with(s, seed, |y| {
                for k in [40, 173, 310] {
                    y[[k, 1]] += 6.0;
                }
            })
        }),
        ("quantised", "quantised", |s, seed| {
            with(s, seed, |y| {
                y.column_mut(1).mapv_inplace(|y| (2.0 * y).round() / 2.0);
            })
        }),
        ("too coarse", "sampling", |s, seed| {
            let right = record(s, seed, |u| u);
            let every = |signal: &Signal| signal.slice(ndarray::s![..;20, ..]).to_owned();
            let drive = Drive::new(10.0, every(right.drive().inputs())).unwrap();
            Record::new(drive, every(right.outputs())).unwrap()
        }),
        ("inputs outside the plan", "inputs", |s, seed| {
            record(s, seed, |u| 1.6 * u)
        }),
    ];
    let study = both_tanks();
    let mut missed = vec![];
    for (name, check, spoil) in spoils {
        let (mut named, mut others) = (0, 0);
        for seed in 0..6 {
            let found = warnings(&study, &spoil(&study, seed));
            let is_named = found.iter().any(|(given, _)| *given == check);
            named += usize::from(is_named);
            others += found.iter().filter(|(given, _)| *given != check).count();
            if seed == 0 || !is_named {
                println!("{name}, seed {seed}: {found:#?}");
            }
            if !is_named {
                missed.push((name, seed));
            }
        }
        println!("{name}: {named} of 6 named, {others} other findings");
    }
    assert!(missed.is_empty(), "{missed:?}");
}
