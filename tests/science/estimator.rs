//! The whole way of a record, and the file in between.

use ndarray::Array2;
use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use truetwin::estimator::{
    EstimateOptions, Estimator, EstimatorError, PretrainOptions, Project, Settings, pretrain,
};
use truetwin::evaluate::paper::reference_studies;
use truetwin::progress::{Listener, Progress};
use truetwin::record::Signals;
use truetwin::record::{Drive, Record, Signal};
use truetwin::report::Report;
use truetwin::study::{RecordPlan, Study, StudyFile};
use truetwin::twin::DigitalTwin;
use truetwin::twin::{Noise, Parameter, ParameterSpace, SimulationError};
use truetwin::twins::VanDerPol;

fn studies() -> Vec<Study> {
    reference_studies().unwrap()
}

/// The oscillator, its prior trusted or not.
fn oscillator(trust: bool) -> Study {
    let text = format!("twin = 'van-der-pol'\n[prior]\ntrust = {trust}\n");
    let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
    studies()[0].configure(&file).unwrap()
}

/// One small oscillator estimator for all tests, which trusts the prior.
fn estimator() -> &'static Estimator {
    static ESTIMATOR: OnceLock<Estimator> = OnceLock::new();
    ESTIMATOR.get_or_init(|| {
        let options = PretrainOptions {
            bank_size: Some(3000),
            epochs: Some(60),
            seed: 1,
            ..PretrainOptions::default()
        };
        pretrain(oscillator(true), &options, &Progress::silent())
            .unwrap()
            .0
    })
}

fn record(nu: f64, seed: u64) -> Record {
    stepped(nu, seed, 0.05)
}

/// Fifteen seconds of the oscillator.
fn stepped(nu: f64, seed: u64, step: f64) -> Record {
    let drive = Drive::autonomous(step, (15.0 / step).round() as usize).unwrap();
    let noise = Noise::new(seed, "test record", 0);
    let outputs = VanDerPol.simulate(&[nu], &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

fn estimate(nu: f64, seed: u64) -> truetwin::estimator::Estimate {
    let options = EstimateOptions {
        seed,
        ..EstimateOptions::default()
    };
    estimator()
        .estimate_with(&record(nu, seed), &options, &Progress::silent())
        .unwrap()
}

/// Outside of the prior [0, 2.5] the network is wrong by half a unit; gate, Gauss–Newton and tuned heads are not.
#[test]
fn out_of_distribution_records_are_found_and_mended() {
    let mut square = 0.0;
    for seed in 0..5 {
        let estimate = estimate(3.0, seed);
        assert!(estimate.gate.out_of_distribution && estimate.refit().is_some());
        assert!((estimate.initial.theta[0] - 3.0).abs() > 0.3);
        assert!(estimate.after().is_some_and(|after| after.p_value > 0.005));
        square += (estimate.theta[0] - 3.0).powi(2) / 5.0;
        let expected = estimate.std_error[0];
        assert!((0.002..0.05).contains(&expected), "{expected}");
    }
    // The Cramér–Rao bound of these features is 6.8e-5; five records, five times that.
    assert!(square < 3.4e-4, "{square}");
}

#[test]
fn in_distribution_most_records_keep_the_estimate_of_a_trusted_prior() {
    let kept: Vec<_> = (0..10)
        .map(|seed| estimate(1.2, seed))
        .filter(|e| !e.gate.out_of_distribution)
        .collect();
    assert!(kept.len() >= 5, "{} of 10 kept", kept.len());
    for estimate in kept {
        assert_eq!(estimate.theta, estimate.initial.theta);
        assert!(estimate.refit().is_none());
        assert!(estimate.low[0] < estimate.theta[0] && estimate.theta[0] < estimate.high[0]);
        let directions = &estimate.json(estimator().study())["directions"];
        assert!(directions.is_array(), "directions are given all the same");
    }
}

/// Of so many of the twin's own records, those that the gate keeps where the noise is the declared one, and where the noise that the network
/// has learnt is three times that of the records: the null errs as the network does.
fn kept_by_the_gate(records: u64) -> [u64; 2] {
    // The prior is trusted, and what is kept is not refined.
    let text = "twin = 'van-der-pol'\n[noise]\nx2 = 0.0212\n[prior]\ntrust = true";
    let file = StudyFile::parse(text, "s.toml".as_ref()).unwrap();
    let options = PretrainOptions {
        bank_size: Some(1000),
        epochs: Some(20),
        seed: 1,
        ..PretrainOptions::default()
    };
    let study = studies()[0].configure(&file).unwrap();
    let (loud, _) = pretrain(study, &options, &Progress::silent()).unwrap();
    let space = loud.study().twin().parameters();
    let kept = |estimator: &Estimator| {
        let of = |seed: &u64| {
            let nu = space.draw_prior(Noise::new(*seed, "prior", 0))[0];
            let options = EstimateOptions::default();
            let found =
                estimator.estimate_with(&record(nu, 400 + seed), &options, &Progress::silent());
            !found.unwrap().gate.out_of_distribution
        };
        (0..records).filter(of).count() as u64
    };
    [kept(estimator()), kept(&loud)]
}

/// Of 8, fewer than 5 have a chance of 1 in 200 at 90 %. With all of the null at the network's estimate 23 of 60 were kept: at that rate both
/// times 5 of 8 have a chance of 1 in 45.
#[test]
fn the_gate_keeps_records_of_the_twin_whatever_noise_is_declared() {
    let kept = kept_by_the_gate(8);
    assert!(kept.iter().all(|kept| *kept >= 5), "{kept:?} of 8");
}

/// Of 20, fewer than 13 have a chance of 1 in 2400 at 90 %, and 13 a chance of 1 in 70 at the rate of 23 in 60.
#[test]
#[ignore = "minutes; run it in release"]
fn the_gate_keeps_many_records_of_the_twin_whatever_noise_is_declared() {
    let kept = kept_by_the_gate(20);
    assert!(kept.iter().all(|kept| *kept >= 13), "{kept:?} of 20");
}

/// Four records of one ν, one of them half as long, one of half the step, so many times: errors shrink, 90 % intervals hold ν, and the records
/// agree. Two of another ν do not. `most` bounds the mean square of the errors.
fn weighed_together(trials: u64, most: f64) {
    let options = EstimateOptions {
        step_of_record: true,
        ..EstimateOptions::default()
    };
    let all = |records: &[Record]| {
        (estimator().estimate_together(records, &options, &Progress::silent())).unwrap()
    };
    let (mut held, mut agreed, mut square) = (0, 0, 0.0);
    for i in 0..trials {
        let mut records: Vec<Record> = (0..4).map(|r| record(3.0, 100 + 4 * i + r)).collect();
        records[2] = stepped(3.0, 100 + 4 * i + 2, 0.025);
        let drive = Drive::autonomous(0.05, 150).unwrap();
        let outputs = records[3]
            .outputs()
            .slice(ndarray::s![..150, ..])
            .to_owned();
        records[3] = Record::new(drive, outputs).unwrap();
        let found = all(&records);
        let least = found.records.iter().map(|one| one.std_error[0]);
        assert!(found.std_error[0] < least.fold(f64::INFINITY, f64::min));
        held += u64::from((found.low[0]..=found.high[0]).contains(&3.0));
        agreed += u64::from(found.p_value > 0.05);
        square += ((found.theta[0] - 3.0) / found.std_error[0]).powi(2) / trials as f64;
    }
    assert!(
        crate::binomial_bounds(trials, 0.9, 0.99).contains(&held),
        "{held}"
    );
    assert!(
        crate::binomial_bounds(trials, 0.95, 0.99).contains(&agreed),
        "{agreed}"
    );
    assert!(square < most, "{square}");
    let changed = all(&[record(3.0, 1), record(3.1, 2)]);
    assert!(changed.p_value < 0.01, "{}", changed.p_value);
}

/// χ² of two, over two, is below 4.6 in 99 of 100 cases. Errors stated at a third of their size fail with a probability of 0.6; weights that
/// do not tell another ν fail.
#[test]
fn records_of_one_system_are_weighed_together() {
    weighed_together(2, 4.6);
}

/// χ² of twelve, over twelve, is below 2.18 in 99 of 100 cases. Weights without the precisions, or simulations shared by records, fail.
#[test]
#[ignore = "a minute; run it in release"]
fn many_records_of_one_system_are_weighed_together() {
    weighed_together(12, 2.18);
}

/// Without trust in the prior the answer is the record's own: with one parameter alone outside its prior, 90 % intervals hold the truth
/// in the records that the gate does not reject, too. With the network's answers kept, k1 is missed in most. Of four, fewer than 3 have a
/// chance of 1 in 19; a version that holds every other one fails with a probability of 0.69.
#[test]
fn kept_answers_hold_outside_the_prior() {
    let (own, trusting) = hold_outside_the_prior(4);
    assert!(own >= 3 && trusting <= 2);
}

/// Of 30, fewer than 23 have a chance of 1 in 128.
#[test]
#[ignore = "minutes"]
fn kept_answers_hold_outside_the_prior_in_thirty() {
    let (own, trusting) = hold_outside_the_prior(30);
    assert!(own >= 23 && trusting <= 15);
}

/// Of so many records, those whose interval holds k1 by themselves, and with the prior trusted; a quarter of the features that tanks have
/// by default.
fn hold_outside_the_prior(records: u64) -> (usize, usize) {
    let options = PretrainOptions {
        bank_size: Some(1000),
        epochs: Some(20),
        seed: 2,
        ..PretrainOptions::default()
    };
    let text = "twin = 'tanks'\n[features]\nkind = 'arx'\noutputs = 16\ninputs = 16";
    let file = StudyFile::parse(text, "s.toml".as_ref()).unwrap();
    let study = &studies()[1].configure(&file).unwrap();
    let (estimator, _) = pretrain(study, &options, &Progress::silent()).unwrap();
    let theta = [1.0, 0.6, 0.6, 1.0];
    let (mut agreed, mut own, mut trusting) = (0, 0, 0);
    for seed in 0..records {
        let noise = Noise::new(seed, "outside", 0);
        let drive = study.drive(noise).unwrap();
        let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
        let record = Record::new(drive, outputs).unwrap();
        let estimate = (estimator.estimate(&record)).unwrap();
        assert!(estimate.refit().is_some());
        let json = estimate.json(study);
        let interval = &json["trusting_prior"]["interval"];
        agreed += usize::from(!estimate.gate.out_of_distribution);
        own += usize::from((estimate.low[0]..=estimate.high[0]).contains(&theta[0]));
        trusting += usize::from(
            (interval["low"][0].as_f64().unwrap()..=interval["high"][0].as_f64().unwrap())
                .contains(&theta[0]),
        );
    }
    eprintln!(
        "k1 outside its prior: gate agrees with {agreed} of {records}, intervals hold the truth in {own}, with the prior trusted in {trusting}"
    );
    (own, trusting)
}

/// Neither the number of threads nor a run before changes a bit.
#[test]
fn threads_change_no_bit() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let options = PretrainOptions {
                bank_size: Some(300),
                epochs: Some(3),
                seed: 9,
                ..PretrainOptions::default()
            };
            let (estimator, _) = pretrain(&studies()[1], &options, &Progress::silent()).unwrap();
            let drive = Drive::new(0.5, Array2::from_elem((150, 1), 1.0)).unwrap();
            let twin = estimator.study().twin();
            let outputs = twin.simulate(&[1.0, 1.0, 0.8, 1.0], &drive, Noise::new(3, "t", 0));
            let record = Record::new(drive, outputs.unwrap()).unwrap();
            let options = EstimateOptions {
                always_refine: true,
                ..EstimateOptions::default()
            };
            let estimate = estimator
                .estimate_with(&record, &options, &Progress::silent())
                .unwrap();
            (
                estimate.initial.theta.clone(),
                estimate.refit().map(|refit| refit.gauss_newton.clone()),
                estimate.refit().map(|refit| refit.fine.clone()),
                estimate.simulations,
            )
        })
    };
    assert_eq!(on(1), on(2));
}

fn saved() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("e.est");
    estimator().save(&path).unwrap();
    (folder, path)
}

#[test]
fn a_file_gives_the_same_estimator_and_the_same_bytes() {
    let (folder, path) = saved();
    let again = Estimator::load(&path, &studies()).unwrap();
    let copy = folder.path().join("copy.est");
    again.save(&copy).unwrap();
    assert_eq!(fs::read(&path).unwrap(), fs::read(&copy).unwrap());
    let of = |estimator: &Estimator| {
        let x = estimator.observe(&record(3.0, 1)).unwrap();
        estimator.predict_one(&x).unwrap()
    };
    assert_eq!(of(estimator()), of(&again));
}

/// Every truncation and every flipped byte is refused in one line that names the file.
#[test]
fn truncated_and_altered_files_are_refused() {
    let (_folder, path) = saved();
    let bytes = fs::read(&path).unwrap();
    let refused = |changed: &[u8]| {
        fs::write(&path, changed).unwrap();
        let error = Estimator::load(&path, &studies()).unwrap_err().to_string();
        assert!(error.contains("e.est") && !error.contains('\n'), "{error}");
        error
    };
    for length in [0, 7, 100, bytes.len() / 2, bytes.len() - 1] {
        refused(&bytes[..length]);
    }
    for at in (0..bytes.len()).step_by(bytes.len() / 97) {
        let mut changed = bytes.clone();
        changed[at] ^= 0x10;
        refused(&changed);
    }
    let mut weight = bytes.clone();
    *weight.last_mut().unwrap() ^= 1;
    assert!(refused(&weight).contains("altered"));
    assert!(refused(b"t,u,y\n0,1,2\n").contains("pretrain"));
}

#[test]
fn files_of_another_program_or_schema_are_refused() {
    let (_folder, path) = saved();
    let only_tanks = &studies()[1..];
    let error = Estimator::load(&path, only_tanks).unwrap_err().to_string();
    assert!(
        error.contains("\"van-der-pol\", known are tanks"),
        "{error}"
    );
    let text = fs::read(&path).unwrap();
    let from = b"\\\"schema\\\":2,";
    let at = text.windows(from.len()).position(|w| w == from).unwrap();
    let mut newer = text.clone();
    newer[at + from.len() - 2] = b'7';
    fs::write(&path, newer).unwrap();
    let error = Estimator::load(&path, &studies()).unwrap_err().to_string();
    assert!(
        error.contains("file schema 7, this version reads 2"),
        "{error}"
    );
}

#[test]
fn records_of_another_step_or_channels_are_refused_with_the_remedy() {
    let other = |drive: Drive, outputs: usize| {
        let y = Signal::from_shape_fn((drive.samples(), outputs), |(k, _)| (k as f64).sin());
        let record = Record::new(drive, y).unwrap();
        let options = EstimateOptions::default();
        let error = estimator().estimate_with(&record, &options, &Progress::silent());
        error.unwrap_err().to_string()
    };
    let error = other(Drive::autonomous(0.1, 300).unwrap(), 1);
    assert!(
        error.contains("step is 0.1 s, the study's 0.05 s; resample the record"),
        "{error}"
    );
    let error = other(Drive::autonomous(0.05, 300).unwrap(), 2);
    assert!(error.contains("2 outputs, the twin has 1 (y)"), "{error}");
    let error = other(Drive::new(0.05, Signal::zeros((300, 1))).unwrap(), 1);
    assert!(error.contains("1 input, the twin has 0"), "{error}");
    let error = other(Drive::autonomous(0.05, 7).unwrap(), 1);
    assert!(error.contains("7 samples"), "{error}");
}

/// Stops at a given number of units.
struct StopAt(u64, AtomicU64);
impl Listener for StopAt {
    fn advanced(&self, _: &str, _: u64, _: u64) {
        self.1.fetch_add(1, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.1.load(Ordering::Relaxed) > self.0
    }
}

#[test]
fn long_work_can_be_cancelled_in_every_stage() {
    let total = Arc::new(StopAt(u64::MAX, AtomicU64::new(0)));
    let options = EstimateOptions {
        always_refine: true,
        ..EstimateOptions::default()
    };
    let run = |listener: Arc<StopAt>| {
        estimator().estimate_with(&record(3.0, 1), &options, &Progress::new(listener))
    };
    run(total.clone()).unwrap();
    let units = total.1.load(Ordering::Relaxed);
    for part in [1, units / 4, units / 2, units - 2] {
        let error = run(Arc::new(StopAt(part, AtomicU64::new(0)))).unwrap_err();
        assert!(
            error.to_string().contains("cancelled"),
            "after {part} of {units}: {error}"
        );
    }
}

/// θ in a corner of the bounds, where nearly every free draw of the cloud falls outside.
#[test]
fn an_estimate_in_a_corner_of_the_bounds_stands() {
    let study = &studies()[1];
    let options = PretrainOptions {
        bank_size: Some(500),
        epochs: Some(5),
        seed: 1,
        ..PretrainOptions::default()
    };
    let (estimator, _) = pretrain(study, &options, &Progress::silent()).unwrap();
    let noise = Noise::new(5, "corner", 0);
    let drive = study.drive(noise).unwrap();
    let outputs = (study
        .twin()
        .simulate(&[1.45, 0.15, 1.4, 0.55], &drive, noise))
    .unwrap();
    let record = Record::new(drive, outputs).unwrap();
    let options = EstimateOptions {
        always_refine: true,
        ..EstimateOptions::default()
    };
    let estimate = (estimator.estimate_with(&record, &options, &Progress::silent())).unwrap();
    let bounds = study.twin().parameters().bounds();
    assert!(estimate.refit().is_some() && estimate.redrawn() > 0);
    assert!(
        estimate
            .theta
            .iter()
            .zip(&bounds)
            .all(|(t, b)| b.contains(*t))
    );
}

/// Every call of the simulator is counted: gate 150 + 199 and a Jacobian from 16 seeds, and what the refinement, the cloud, the second gate, the
/// free runs and the check of the step need. Effort is a result; a change of it should be seen.
#[test]
fn simulator_calls_are_pinned() {
    let kept = estimate(1.2, kept_seed());
    assert_eq!(
        kept.simulations,
        150 + 2 * 199 + 2 * 16 + 150 + 64 + 2 * 64 + 1
    );
    assert!(estimate(3.0, 0).simulations < 12_000);
}

/// Mean squared errors of the parts of a tuned estimate, in widths of the prior, θ from the bounds: Gauss–Newton, quadratic layer, layer and
/// heads, heads without a layer. docs/estimating.md has the result of
/// `cargo test --release --test science study_of_the_parts -- --ignored --nocapture`.
#[test]
#[ignore = "minutes; a study, not a test"]
fn study_of_the_parts() {
    const RECORDS: u64 = 60;
    for study in studies() {
        let space = study.twin().parameters();
        for quadratic in [true, false] {
            let mut settings = Settings::default();
            settings.cloud.quadratic = quadratic;
            let project = Project::from(study.clone()).with_settings(settings);
            let options = PretrainOptions {
                bank_size: Some(3000),
                epochs: Some(30),
                seed: 1,
                ..PretrainOptions::default()
            };
            let (estimator, _) = pretrain(&project, &options, &Progress::silent()).unwrap();
            let mut squares = [0.0; 3];
            for i in 0..RECORDS {
                let noise = Noise::new(35, study.name(), i);
                let theta = space.draw_bounds(noise);
                let drive = study.drive(noise).unwrap();
                let outputs = study.twin().simulate(&theta, &drive, noise).unwrap();
                let record = Record::new(drive, outputs).unwrap();
                let options = EstimateOptions {
                    seed: i,
                    ..EstimateOptions::default()
                };
                let found = estimator.estimate_with(&record, &options, &Progress::silent());
                let found = found.unwrap().json(&study);
                let parts = ["/theta/gauss_newton", "/heads/layer", "/theta/fine"];
                for (square, part) in squares.iter_mut().zip(parts) {
                    for (j, p) in space.iter().enumerate() {
                        let value = found.pointer(&format!("{part}/{j}"));
                        let value = value.and_then(|v| v.as_f64()).unwrap_or(f64::NAN);
                        let off = (value - theta[j]) / p.prior.width();
                        *square += off * off / (RECORDS * space.len() as u64) as f64;
                    }
                }
            }
            let [name, squares] = [
                study.name().into(),
                squares.map(|s| format!("{s:.2e}")).join(" "),
            ];
            println!("{name}, layer {quadratic}: Gauss–Newton, layer, tuned {squares}");
        }
    }
}

/// A seed whose in-distribution record the gate keeps.
fn kept_seed() -> u64 {
    (0..10)
        .find(|&seed| !estimate(1.2, seed).gate.out_of_distribution)
        .unwrap()
}

/// Nothing but failures: the error names the share and the remedy.
struct Broken;
impl DigitalTwin for Broken {
    fn parameters(&self) -> ParameterSpace {
        ParameterSpace::new([Parameter::new("a", "", 0.0, 1.0)])
    }
    fn signals(&self) -> Signals {
        Signals {
            inputs: vec![],
            ..Signals::default()
        }
    }
    fn simulate(&self, _: &[f64], _: &Drive, _: Noise) -> Result<Signal, SimulationError> {
        Err(SimulationError::Diverged { at: 0.5 })
    }
}

#[test]
fn a_diverging_twin_stops_with_the_remedy() {
    let study = Study::new("broken", Broken, RecordPlan::autonomous(0.1, 100)).unwrap();
    let error = pretrain(&study, &PretrainOptions::default(), &Progress::silent()).unwrap_err();
    assert!(matches!(error, EstimatorError::Hopeless { .. }));
    let text = error.to_string();
    assert!(
        text.contains("diverged at t = 0.5 s") && text.contains("shrink the prior"),
        "{text}"
    );
}
