//! Texts against the equations in Rust that they stand for, and texts that are wrong.

use super::Equations;
use super::event::BALL;
use crate::likelihood::kalman::{FilterSettings, Kalman};
use crate::record::{Drive, Record, Signal};
use crate::twin::{Composed, DigitalTwin, Noise, Now, StateSpace, Twin};
use crate::twins::{CascadedTanks, TANKS, VAN_DER_POL, VanDerPol};
use std::sync::Arc;

#[path = "../../examples/rooms.rs"]
#[allow(dead_code, clippy::duplicate_mod)]
mod rooms;

/// A twin in Rust, the same as text, the number of its inputs.
fn pairs() -> Vec<(&'static str, Twin, Equations)> {
    let text = |text| Equations::parse(text).unwrap();
    let rooms = include_str!("../../examples/rooms.toml");
    vec![
        ("tanks", Twin::new(CascadedTanks), text(TANKS)),
        ("van-der-pol", Twin::new(VanDerPol), text(VAN_DER_POL)),
        ("rooms", Twin::new(rooms::Rooms), text(rooms)),
    ]
}

fn drive(twin: &Twin, step: f64) -> Drive {
    let inputs = twin.signals().inputs.len();
    let u = Signal::from_shape_fn((200, inputs), |(k, j)| {
        [0.9, 0.1, 2.0, 1.1][(k / 25 + j) % 4]
    });
    Drive::new(step, u).unwrap()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * (1.0 + a.abs())
}

#[test]
fn reference_twins_and_their_texts_are_the_same() {
    for (name, rust, text) in pairs() {
        let outline = rust.outline().unwrap();
        assert_eq!(outline, text.program.outline(), "{name}");
        let (own, other) = (
            rust.equations().unwrap(),
            Arc::new(text.clone()).equations().unwrap(),
        );
        assert_eq!(own.limits(), other.limits(), "{name}");
        let (n, p) = (outline.states.len(), outline.outputs.len());
        for point in 0..20 {
            let noise = Noise::new(3, "texts", point);
            let theta = outline.parameters.draw_prior(noise);
            let mut source = noise.source("point");
            let x: Vec<f64> = (0..9 * n).map(|_| 3.0 * source.normal()).collect();
            let u: Vec<f64> = outline.inputs.iter().map(|_| source.uniform()).collect();
            let now = Now::new(0.7, 0.05, &u, &theta);
            // One point and nine of them: both ways through the tape.
            for x in [&x[..n], &x[..]] {
                let values = |twin: &Composed| {
                    let (mut dx, mut y) = (vec![0.0; x.len()], vec![0.0; x.len() / n * p]);
                    twin.drift(&now, x, &mut dx);
                    twin.observe(&now, x, &mut y);
                    let (mut q, mut r, mut start) = (vec![0.0; n], vec![0.0; p], vec![0.0; n]);
                    twin.noise(&now, &x[..n], &mut q, &mut r);
                    twin.start(&now, &mut start);
                    [dx, y, q, r, start].concat()
                };
                for (a, b) in values(own).iter().zip(values(&other)) {
                    assert!(near(*a, b), "{name}: {a} {b}");
                }
            }
        }
        let drive = drive(&rust, 0.05);
        let theta = outline.parameters.centre();
        for noise in [Noise::OFF, Noise::new(1, "texts", 0)] {
            let a = rust.simulate(&theta, &drive, noise).unwrap();
            let b = text.simulate(&theta, &drive, noise).unwrap();
            assert!(a.iter().zip(&b).all(|(a, b)| near(*a, *b)), "{name}");
        }
    }
}

/// Scores take the lanes, filters of larger twins the points: both see the same likelihood as in Rust.
#[test]
fn likelihoods_of_texts_are_those_of_rust() {
    for (name, rust, text) in pairs() {
        let step = if name == "van-der-pol" { 0.05 } else { 0.2 };
        let drive = drive(&rust, step);
        let theta = rust.parameters().centre();
        let outputs = rust
            .simulate(&theta, &drive, Noise::new(2, "texts", 0))
            .unwrap();
        let record = Record::new(drive, outputs).unwrap();
        let study = |twin: Twin| crate::study::Study::of(twin).unwrap();
        let fit = |twin: Twin| study(twin).fit(std::slice::from_ref(&record)).unwrap();
        let (a, b) = (fit(rust), fit(Twin::new(text)));
        let log_z = |fit: crate::fit::Fit| fit.evidence.unwrap().log_evidence;
        let (a, b) = (log_z(a), log_z(b));
        assert!((a - b).abs() <= 1e-6 * a.abs(), "{name}: {a} {b}");
    }
}

fn problem(text: &str) -> String {
    Equations::parse(text).unwrap_err().to_string()
}

/// A text whose states and outputs are given.
fn with(tables: &str) -> String {
    format!("[parameters]\nk = {{ prior = [0.1, 1.0] }}\n{tables}")
}

const OUTPUT: &str = "[outputs]\ny = { value = \"h\" }\n";

#[test]
fn faults_are_one_line_with_their_place() {
    for (tables, expected) in [
        (
            "[states]\nh = { rate = \"-kk*h\" }\n",
            "line 4, column 16: unknown name \"kk\" (did you mean \"k\"?)",
        ),
        (
            "[states]\nh = { rate = \"-k*(h\" }\n",
            "line 4, column 20: the expression ends",
        ),
        (
            "[states]\nh = { rate = '''\n-k*h + sinn(h)''' }\n",
            "line 5, column 8: unknown function \"sinn\"",
        ),
        (
            "[states]\nh = { rate = \"\\u002dk*h + \\x28zz)\" }\n",
            "line 4, column 31: unknown name \"zz\"",
        ),
        (
            "[states]\nh = { rate = \"\"\"\nk*h + \\\n   sinn(h)\"\"\" }\n",
            "line 6, column 4: unknown function \"sinn\"",
        ),
        (
            "[states]\nh = { rate = \"1\", noise = { std = 0.1, known = true, factor = 2.0 } }\n",
            "line 4, column 27: a known level is not fitted, and has no factor",
        ),
        (
            "[states]\nh = { rate = \"1\", nois = 1 }\n",
            "line 4, column 19: unknown key \"nois\" (did you mean \"noise\"?)",
        ),
        (
            "[states]\nk = { rate = \"1\" }\n",
            "\"k\" is in parameters already",
        ),
        (
            "[states]\nsin = { rate = \"1\" }\n",
            "\"sin\" is a word of expressions",
        ),
        (
            "[states]\n\"h-1\" = { rate = \"1\" }\n",
            "cannot stand in an expression",
        ),
        (
            &format!(
                "[states]\nh = {{ rate = \"1\" }}\n[twin]\nname = \"{}\"\n",
                "a".repeat(2000)
            ),
            "has more than 1000 characters; shorten it",
        ),
        (
            "[define]\na = \"b + 1\"\nb = \"2*a\"\n[states]\nh = { rate = \"a\" }\n",
            "a definition in a circle: ",
        ),
        (
            "[constants]\ng = \"2*k\"\n[states]\nh = { rate = \"g\" }\n",
            "g is no constant",
        ),
        (
            "[constants]\ng = \"kk\"\nh0 = 1\n[states]\nh = { rate = \"g\" }\n",
            "unknown name \"kk\"; there are h0, pi",
        ),
        (
            "[states]\nh = { rate = \"if(h => 1, 0, 1)\" }\n",
            "=>; write >= to compare",
        ),
        (
            "[states]\nh = { rate = \"-k*h**2\" }\n",
            "**; write ^ for a power",
        ),
        (
            "[states]\nh = { rate = \"1\", next = \"2\" }\n",
            "h has rate and next",
        ),
        ("[states]\nh = { unit = \"m\" }\n", "h has no rate"),
        ("[states]\nh = { rate = \"y\" }\n", "\"y\" is an output"),
        (
            "[states]\nh = { rate = \"1\", start = \"h\" }\n",
            "a start is before all rows",
        ),
        (
            "[states]\nh = { rate = \"1\", noise = -0.1 }\n",
            "a standard deviation is 0 or more",
        ),
        (
            "[states]\nh = { rate = \"1\", limits = [2, 1] }\n",
            "low must be below high",
        ),
        (
            "[constants]\ng = nan\n[states]\nh = { rate = \"g\" }\n",
            "line 4, column 5: the value is NaN; write what is a finite number",
        ),
        (
            "[states]\nh = { rate = \"1\", start = \"1/0\" }\n",
            "the value is inf",
        ),
        (
            "[states]\nh = { rate = \"1\", limits = [nan, \"k\"] }\n",
            "the value is NaN",
        ),
        (
            "[states]\nh = { rate = true }\n",
            "rate of h cannot be read; write a number or an expression",
        ),
        (
            "[states]\nh = { rate = \"1\" }\n[record]\nintegrator = \"stif\"\n",
            "there are adaptive, stiff, discrete, euler and runge-kutta-4",
        ),
        (
            "[states]\nh = { rate = \"1\" }\n[evnt]\n",
            "\"evnt\" is no table of a twin (did you mean \"event\"?)",
        ),
        (
            "[states]\nh = { rate = \"1\" }\n[inputs]\nu = { hold = \"pulse\" }\n",
            "hold of u cannot be read",
        ),
        (
            "[states]\nh = { rate = \"a < b < 1\" }\n",
            "a second comparison",
        ),
        ("", "the twin has no states"),
    ] {
        let error = problem(&with(&format!("{tables}{OUTPUT}")));
        assert!(error.contains(expected), "{tables}: {error}");
        assert!(!error.contains('\n') && error.contains(';'), "{error}");
    }
}

#[test]
fn constants_fold_and_definitions_come_in_any_order() {
    let text = with(
        "[constants]\ng = 9.81\ntwice = \"2*g\"\n[define]\nb = \"a*twice\"\na = \"k*if(h > 1, 2, 3)\"\n\
         [states]\nh = { rate = \"b - t\", start = \"2*k\", noise = \"0.1*abs(h)\", limits = [0, \"4*k\"] }\n\
         [outputs]\ny = { value = \"min(h, 5, pi)\", noise = { std = 0.2, known = true } }\n",
    );
    let twin = Equations::parse(&text).unwrap();
    let theta = [0.5];
    let now = Now::new(3.0, 0.25, &[], &theta);
    let mut dx = [0.0];
    for (h, factor) in [(0.5, 3.0), (1.5, 2.0)] {
        StateSpace::drift(&*twin.program, &now, &[h], &mut dx);
        assert!(near(dx[0], 0.5 * factor * 2.0 * 9.81 - 3.0));
    }
    let (mut start, mut q, mut r, mut y) = ([0.0], [0.0], [0.0], [0.0]);
    StateSpace::start(&*twin.program, &now, &mut start);
    StateSpace::noise(&*twin.program, &now, &[-2.0], &mut q, &mut r);
    StateSpace::observe(&*twin.program, &now, &[4.0], &mut y);
    assert_eq!(
        (start, q, r, y),
        ([1.0], [0.2], [0.2], [std::f64::consts::PI])
    );
    let mut h = [7.0];
    StateSpace::constrain(&*twin.program, &now, &mut h);
    assert_eq!(h, [2.0], "the limit follows a parameter");
    assert!(twin.declared().known.contains("y") && twin.declared().estimated.is_empty());
    // What is written is read again.
    let again = Equations::parse(twin.text()).unwrap();
    assert_eq!(
        (again.text(), again.program.outline()),
        (twin.text(), twin.program.outline())
    );
}

/// A logistic map, and a force on it: one value a sample, whatever the step.
#[test]
fn next_is_the_value_at_the_next_sample() {
    let text = "[parameters]\nr = { prior = [1.0, 4.0] }\n[states]\nx = { next = \"r*x*(1 - x)\", start = 0.3 }\n[outputs]\ny = { value = \"x\" }\n";
    let twin = Equations::parse(text).unwrap();
    let y = twin
        .simulate(&[3.2], &Drive::autonomous(0.5, 20).unwrap(), Noise::OFF)
        .unwrap();
    let mut x = 0.3;
    for y in &y {
        assert!((y - x).abs() < 1e-13);
        x *= 3.2 * (1.0 - x);
    }
    assert!(
        problem(&format!("{text}[record]\nintegrator = \"euler\"\n"))
            .contains("leave out the integrator")
    );
}

/// Substeps and tolerances out of range are told with their place, in a text without a study around it as well.
#[test]
fn steps_of_a_record_have_a_range() {
    let text = "[states]\nx = { rate = \"-x\" }\n[outputs]\ny = { value = \"x\" }\n[record]\n";
    for (line, expected) in [
        (
            "substeps = 2000",
            "line 6, column 12: substeps = 2000; choose a whole number between 1 and 1000",
        ),
        ("substeps = 2.5", "choose a whole number"),
        ("substeps = 'two'", "'two'; choose a whole number"),
        (
            "tolerance = 0.5",
            "tolerance = 0.5; choose a share between 1e-12 and 0.1",
        ),
        ("tolerance = nan", "choose a share"),
    ] {
        let told = problem(&format!("{text}{line}\n"));
        assert!(told.contains(expected), "{line}: {told}");
    }
    let twin = Equations::parse(&format!("{text}substeps = 1000\ntolerance = 1e-5\n")).unwrap();
    assert_eq!(twin.program.stepping().substeps, 1000);
}

/// Over 1000 values of each parameter, as near as those of a difference and as far as those of a search, the log-likelihood is smooth: steps
/// that are chosen anew leave no jump of a millionth of it.
#[test]
fn likelihoods_under_adaptive_steps_are_smooth() {
    let twin = Equations::parse(include_str!("../../examples/pendulum.toml")).unwrap();
    let drive = drive(&Twin::new(twin.clone()), 0.05);
    let outputs = twin.simulate(&[1.1, 0.3], &drive, Noise::new(2, "texts", 0));
    let record = Record::new(drive, outputs.unwrap()).unwrap();
    let twin = Arc::new(twin).equations().unwrap();
    let settings = FilterSettings::default();
    let filter = Kalman::new(twin, &record, &settings).unwrap();
    let at = |theta: [f64; 2]| filter.log_likelihood(&theta).unwrap();
    let top = at([1.1, 0.3]);
    for width in [1e-4, 0.2] {
        let values: Vec<f64> = (0..1000)
            .map(|k| at([1.1 + width * (f64::from(k) / 1000.0 - 0.5), 0.3]))
            .collect();
        // Fourth differences of what is smooth vanish at this distance.
        for five in values.windows(5) {
            let jump = five[0] - 4.0 * five[1] + 6.0 * five[2] - 4.0 * five[3] + five[4];
            assert!(jump.abs() < 1e-6 * top.abs(), "{width}: {jump:e} of {top}");
        }
    }
}

/// A cup that cools from a known temperature, first measured after 3 s; a dose and a wind that moves on a line, each by its own rule.
#[test]
fn starts_have_times_and_inputs_rules() {
    let text = "[parameters]\nk = { prior = [0.1, 1.0] }\n\
        [states]\nT = { rate = \"-k*T + heat\", start = { value = 80.0, at = 2.0 } }\nw = { rate = \"wind\", start = 0.0 }\n\
        [inputs]\nheat = { hold = \"impulse\" }\nwind = { hold = \"linear\" }\n\
        [outputs]\ny = { value = \"T\" }\nz = { value = \"w\" }\n";
    let twin = Equations::parse(text).unwrap();
    let inputs = Signal::from_shape_fn((4, 2), |(k, input)| match input {
        0 => [0.0, 10.0, 0.0, 0.0][k],
        _ => k as f64,
    });
    let drive = Drive::new(0.5, inputs).unwrap().beginning_at(5.0);
    let y = twin.simulate(&[0.4], &drive, Noise::OFF).unwrap();
    let mut expected = 80.0 * (-1.2f64).exp();
    for k in 0..4 {
        assert!(
            (y[(k, 0)] - expected).abs() < 1e-5,
            "{k}: {} {expected}",
            y[(k, 0)]
        );
        // The dose of row 1 shows in row 2.
        let dose = if k == 1 { 10.0 } else { 0.0 };
        expected = (expected + dose) * (-0.2f64).exp();
        let way = 0.25 * (k * k) as f64;
        assert!((y[(k, 1)] - way).abs() < 1e-9, "{k}: {}", y[(k, 1)]);
    }
    let two = text.replace("start = 0.0", "start = { value = 0.0, at = 1.0 }");
    assert!(problem(&two).contains("two times"));
}

/// Random changes of good texts: read or refused in a line, and what is read computes without a panic.
#[test]
fn texts_that_are_nearly_right_do_no_harm() {
    const PIECES: [&str; 24] = [
        "(", ")", "^", "-", "if(", ",", "1e308", "\"", "h1", "k9", "[", "]", "{", "}", "=", "\n",
        "and", "0", "\u{200b}", "θ", "mod(", "inf", "nan", "not ",
    ];
    let mut accepted = 0;
    for sample in 0..600 {
        let mut source = Noise::new(5, "texts", sample).source("change");
        let mut text = [TANKS, VAN_DER_POL, BALL][sample as usize % 3].to_owned();
        for _ in 0..1 + sample % 3 {
            let mut at = (source.uniform() * text.len() as f64) as usize;
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            let piece = PIECES[(source.uniform() * PIECES.len() as f64) as usize];
            if source.happens(0.3) {
                let end = (at..=text.len()).find(|end| *end > at && text.is_char_boundary(*end));
                text.replace_range(at..end.unwrap_or(at), piece);
            } else {
                text.insert_str(at, piece);
            }
        }
        match Equations::parse(
            &text
                .replace("samples", "#")
                .replace("input =", "#")
                .replace("step =", "#"),
        ) {
            Ok(twin) => {
                accepted += 1;
                let inputs = twin.program.outline().inputs.len();
                let drive = Drive::new(0.1, Signal::ones((5, inputs))).unwrap();
                let theta = twin.program.outline().parameters.centre();
                // It may diverge.
                let _ = twin.simulate(&theta, &drive, Noise::OFF);
            }
            Err(error) => {
                let error = error.to_string();
                assert!(!error.contains('\n') && error.contains(';'), "{error}");
            }
        }
    }
    assert!(accepted > 10, "{accepted}");
}

/// A level that meets its limits between rows, and what follows it: as in 2048 steps of Euler's rule, whether a limit is a number or a parameter.
#[test]
fn limits_hold_between_rows() {
    let run = |high: &str, record: &str, parts: usize| {
        let text = format!(
            "[parameters]\na = {{ prior = [0.1, 2.0] }}\ntop = {{ prior = [0.1, 1.0] }}\n[inputs]\nu = {{}}\n\
             [states]\nx = {{ rate = \"-0.1*x + z\", start = 0.0 }}\n\
             z = {{ rate = \"-a*z + 3*u\", start = 0.0, limits = [-0.2, {high}] }}\n\
             [outputs]\ny = {{ value = \"x\", noise = 0.05 }}\n[record]\n{record}"
        );
        let twin = Arc::new(Equations::parse(&text).unwrap());
        let u = Signal::from_shape_fn((60 * parts, 1), |(k, _)| [1.0, -1.0][k / (10 * parts) % 2]);
        let drive = Drive::new(0.3 / parts as f64, u).unwrap();
        let y = twin.free_run(&[0.8, 0.3], &drive).unwrap();
        y.iter().step_by(parts).copied().collect::<Vec<f64>>()
    };
    let expected = run("0.3", "integrator = 'euler'", 2048);
    let worst = |y: &[f64]| {
        let errors = y.iter().zip(&expected).map(|(a, b)| (a - b).abs());
        errors.fold(0.0, f64::max)
    };
    for high in ["0.3", "\"top\""] {
        for (record, parts) in [
            ("", 1),
            ("integrator = 'stiff'", 1),
            ("integrator = 'runge-kutta-4'", 16),
            ("integrator = 'runge-kutta-4'\nsubsteps = 16", 1),
        ] {
            let error = worst(&run(high, record, parts));
            assert!(error < 1e-3, "{high}, {record}: {error}");
        }
    }
    // One row of many meetings, at any tolerance: four swings, of which a fine grid knows the way.
    let swing = |record: &str| {
        let text = format!(
            "[parameters]\nk = {{ prior = [0.1, 2.0] }}\n[states]\nh = {{ rate = \"k*cos(t)\", start = 0.0, limits = [-0.3, 0.5] }}\n\
             w = {{ rate = \"h\", start = 0.0 }}\n[outputs]\ny = {{ value = \"w\" }}\n[record]\n{record}"
        );
        let twin = Equations::parse(&text).unwrap();
        twin.free_run(&[1.0], &Drive::autonomous(16.0, 2).unwrap())
            .unwrap()[[1, 0]]
    };
    for rule in ["adaptive", "stiff"] {
        for (tolerance, close) in [("1e-7", 5e-5), ("1e-9", 1e-6)] {
            let w = swing(&format!("integrator = '{rule}'\ntolerance = {tolerance}"));
            assert!((w - 2.0612687).abs() < close, "{rule} to {tolerance}: {w}");
        }
    }
    // Limits that parameters set in the wrong order hold nothing, and no rate.
    let free = run("1e9", "", 1);
    let crossed = run("\"top - 1\"", "", 1);
    assert!((free[9] - crossed[9]).abs() < 1e-6 && worst(&free) > 0.5);
}
