//! Programs that keep to the protocol, also where they break down now and then.

use super::{drive, lag, place, python, run, started, twin};
use rayon::prelude::*;
use std::fs;
use std::time::Duration;
use truetwin::external::program::{ProgramSettings, ProgramTwin};
use truetwin::record::Signal;
use truetwin::twin::conformance::{Severity, check};
use truetwin::twin::{DigitalTwin, Noise};

fn workers(number: usize) -> ProgramSettings {
    ProgramSettings {
        workers: Some(number),
        ..ProgramSettings::default()
    }
}

/// Forty runs from the prior on three threads.
fn many(twin: &ProgramTwin) -> Vec<Signal> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(3)
        .build()
        .unwrap();
    let space = twin.parameters();
    let one = |i| {
        let noise = Noise::new(3, "many", i);
        twin.simulate(&space.draw_prior(noise), &drive(), noise)
            .unwrap()
    };
    pool.install(|| (0..40).into_par_iter().map(one).collect())
}

#[test]
fn the_example_is_a_sound_twin() {
    let Some(python) = python() else { return };
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/pendulum.py");
    let study = ProgramTwin::start(python, [script], workers(2))
        .unwrap()
        .into_study()
        .unwrap();
    let drive = study.drive(Noise::new(1, "input", 0)).unwrap();
    for finding in check(study.twin(), &drive, 1) {
        assert_eq!(finding.severity, Severity::Pass, "{finding:?}");
    }
}

#[test]
fn outputs_are_those_of_the_equations_and_noise_is_as_asked() {
    if python().is_none() {
        return;
    }
    let twin = twin("plain.py", "pass", workers(1));
    let y = twin.simulate(&[2.0, 1.25], &drive(), Noise::OFF).unwrap();
    let keep = (-0.25f64).exp();
    let mut x = 0.0;
    for (k, u) in drive().inputs().iter().enumerate() {
        assert!((y[[k, 0]] - x).abs() < 1e-12);
        x = keep * x + (1.0 - keep) * 1.25 * u;
    }
    let noisy = run(&twin, 0).unwrap();
    let spread = (&noisy - &y).std(0.0);
    assert!((0.012..0.03).contains(&spread), "{spread}");
    assert_ne!(noisy, run(&twin, 1).unwrap());
}

#[test]
fn results_depend_neither_on_workers_nor_on_crashes_nor_on_chatter() {
    if python().is_none() {
        return;
    }
    let expected = many(&twin("one.py", "pass", workers(1)));
    let same = |name: &str, before: &str, number: usize| {
        assert!(
            many(&twin(name, before, workers(number))) == expected,
            "{name}"
        );
    };
    same("three.py", "pass", 3);
    same("fifth.py", "if count == 5: os._exit(3)", 2);
    same("one-shot.py", "if count == 2: sys.exit()", 2);
    same("chatter.py", "sys.stderr.write('working … ' * 20_000)", 2);
    same("pretty.py", "print(flush=True)", 1);
    let late = "if os.getpid() % 2 == 0 and count == 9: time.sleep(60)";
    let settings = ProgramSettings {
        timeout: Duration::from_secs(2),
        ..workers(2)
    };
    assert!(
        many(&twin("late.py", late, settings)) == expected,
        "late.py"
    );
}

/// Nothing is left of the program, whether it ends by itself or hangs.
#[cfg(target_os = "linux")]
#[test]
fn no_process_outlives_its_twin() {
    if python().is_none() {
        return;
    }
    let pids = place().join("pids");
    fs::create_dir_all(&pids).unwrap();
    let note = format!(
        "open({:?} + str(os.getpid()), 'w').close()\n",
        format!("{}/", pids.display())
    );
    let stubborn = lag(&note) + "while True: time.sleep(1)\n";
    let stubborn = started("stubborn.py", &stubborn, workers(3)).unwrap();
    many(&stubborn);
    let crashing = twin(
        "mortal.py",
        &(note + "if count == 3: os._exit(1)"),
        workers(2),
    );
    many(&crashing);
    let all = || {
        fs::read_dir(&pids)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
    };
    let there = |pid: &std::ffi::OsString| std::path::Path::new("/proc").join(pid).exists();
    let (lived, alive) = (all().count(), all().filter(there).count());
    assert!(lived > 10, "{lived} workers noted themselves");
    assert!(
        (1..=5).contains(&alive),
        "{alive} of 3 and 2 workers live, no dead one is a zombie"
    );
    drop((stubborn, crashing));
    assert_eq!(all().filter(there).count(), 0);
}

/// Far more than a pipe holds, in both directions.
#[test]
fn a_large_request_and_a_large_answer_pass() {
    if python().is_none() {
        return;
    }
    let twin = twin("large.py", "pass", workers(1));
    let inputs = Signal::from_shape_fn((50_000, 1), |(k, _)| (k as f64).sin());
    let drive = truetwin::record::Drive::new(0.1, inputs).unwrap();
    let y = twin
        .simulate(&[2.0, 1.0], &drive, Noise::new(1, "t", 0))
        .unwrap();
    assert_eq!(y.dim(), (50_000, 1));
}
