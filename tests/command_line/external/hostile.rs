//! Programs that hang, crash or talk nonsense: bounded time, bounded memory, a message that says what happened.

use super::{drive, impatient, lag, python, run, started, twin};
use rayon::prelude::*;
use std::time::{Duration, Instant};
use truetwin::external::program::ProgramSettings;
use truetwin::record::{Drive, Signal};
use truetwin::twin::{DigitalTwin, Noise, SimulationError};

/// Runs until the twin is given up; how many runs that took, and the message.
fn given_up(name: &str, before: &str, settings: ProgramSettings) -> (usize, String) {
    let twin = twin(name, before, settings);
    for tried in 1..100 {
        match run(&twin, tried) {
            Err(SimulationError::Fatal(error)) => {
                let again = run(&twin, 0).unwrap_err();
                assert!(!again.costs_one_run(), "{again}");
                let message = error.to_string();
                assert!(!message.contains('\n'), "{message}");
                return (tried as usize, message);
            }
            Err(error) => assert!(error.costs_one_run()),
            Ok(_) => panic!("{name} answered"),
        }
    }
    panic!("{name} was never given up");
}

#[test]
fn what_never_works_is_given_up_soon_with_its_last_words() {
    if python().is_none() {
        return;
    }
    let begun = Instant::now();
    let (runs, message) = given_up("hangs.py", "time.sleep(60)", impatient());
    assert_eq!(runs, 5);
    assert!(message.contains("no answer within 1.5 s"), "{message}");
    assert!(begun.elapsed() < Duration::from_secs(15));
    let settings = ProgramSettings {
        retries: 1,
        ..impatient()
    };
    let (runs, message) = given_up("crashes.py", "raise ValueError('no such mesh')", settings);
    assert_eq!(runs, 5);
    for part in [
        "none of 5 simulations worked",
        "crashes.py",
        "exit status: 1",
        "ValueError: no such mesh",
        "attempt 2",
    ] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_program_that_describes_nothing_is_late_after_the_time_out() {
    if python().is_none() {
        return;
    }
    let begun = Instant::now();
    let error = started("mute.py", "import time; time.sleep(60)", impatient());
    let message = error.unwrap_err().to_string();
    for part in ["mute.py", "no answer within 1.5 s", "time-out"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(begun.elapsed() < Duration::from_secs(10));
}

#[test]
fn what_works_here_and_fails_there_costs_draws_alone() {
    if python().is_none() {
        return;
    }
    for (name, before) in [
        ("dies-there.py", "if theta['tau'] > 2: os._exit(1)"),
        ("hangs-there.py", "if theta['tau'] > 2.8: time.sleep(60)"),
        (
            "diverges-there.py",
            "if theta['tau'] > 2: request['inputs']['u'][3] = math.inf",
        ),
    ] {
        let twin = twin(name, before, impatient());
        let (space, drive) = (twin.parameters(), drive());
        let failed = (0..20u64).into_par_iter().filter(|&i| {
            let noise = Noise::new(1, "bank", i);
            let theta = space.draw_prior(noise);
            match twin.simulate(&theta, &drive, noise) {
                Ok(_) => assert!(theta[0] <= 2.8, "{name}"),
                Err(error) => {
                    assert!(error.costs_one_run(), "{name}: {error}");
                    return true;
                }
            }
            false
        });
        let failed = failed.count();
        assert!((1..20).contains(&failed), "{name}: {failed} of 20 failed");
    }
}

#[test]
fn nonsense_ends_the_work_and_is_quoted() {
    if python().is_none() {
        return;
    }
    let say = |text: &str| format!("print({text:?}, flush=True)\ncontinue");
    let table = [
        ("talks.py", say("Loading model"), "\"Loading model\""),
        (
            "id.py",
            "request['id'] += 1".into(),
            "the answer has id 2, the request has 1",
        ),
        (
            "lack.py",
            say("{\"id\": 1, \"outputs\": {}}"),
            "outputs lack y",
        ),
        (
            "short.py",
            "request['inputs']['u'].pop()".into(),
            "y has 59 values, for 60 samples",
        ),
        (
            "says.py",
            say("{\"id\": 1, \"error\": \"no licence\"}"),
            "says: no licence",
        ),
        (
            "both.py",
            say("{\"id\": 1, \"diverged\": 1, \"error\": \"\"}"),
            "exactly one of",
        ),
        (
            "bytes.py",
            "sys.stdout.buffer.write(b'\\xff\\n'); sys.stdout.flush()".into(),
            "no UTF-8",
        ),
        (
            "endless.py",
            "while True: sys.stdout.write('x' * 65536)".into(),
            "a line of more than",
        ),
        (
            "twice.py",
            "print(json.dumps({'id': 0, 'diverged': 1}))".into(),
            "once, in order",
        ),
    ];
    for (name, before, part) in &table {
        let (runs, message) = given_up(name, before, ProgramSettings::default());
        assert_eq!(runs, 1, "{name}");
        assert!(
            message.contains(part) && message.contains(name),
            "{message}"
        );
        assert!(message.chars().count() < 900, "{message}");
    }
}

#[test]
fn what_is_no_number_is_a_divergence_at_its_time() {
    if python().is_none() {
        return;
    }
    let twin = twin(
        "nan.py",
        "request['inputs']['u'][6] = math.nan",
        ProgramSettings::default(),
    );
    let error = run(&twin, 0).unwrap_err();
    assert!(
        matches!(error, SimulationError::Diverged { at: 3.5 }),
        "{error}"
    );
}

#[test]
fn what_does_not_read_holds_nobody_up() {
    if python().is_none() {
        return;
    }
    let deaf = lag("pass").replace("        count += 1\n", "").replace(
        "    print(json.dumps(answer), flush=True)",
        "    print(json.dumps(answer), flush=True)\n    time.sleep(60)",
    );
    let twin = started("deaf.py", &deaf, impatient()).unwrap();
    let inputs = Signal::from_elem((100_000, 1), 1.0 / 3.0);
    let drive = Drive::new(0.1, inputs).unwrap();
    let begun = Instant::now();
    let error = twin.simulate(&[2.0, 1.0], &drive, Noise::OFF).unwrap_err();
    assert!(error.costs_one_run(), "{error}");
    assert!(begun.elapsed() < Duration::from_secs(10));
}

#[test]
fn a_program_that_changes_between_two_starts_is_refused() {
    if python().is_none() {
        return;
    }
    let fickle = lag("os._exit(1)").replace("\"unit\": \"K\"", "\"unit\": str(time.time())");
    let twin = started("fickle.py", &fickle, ProgramSettings::default()).unwrap();
    let message = run(&twin, 0).unwrap_err().to_string();
    assert!(message.contains("describes itself otherwise"), "{message}");
}
