//! Parts of a diagnosis beside the name: onset, missing functions, power, next input.

use super::trials::*;
use crate::binomial_bounds;
use truetwin::diagnose::{Decision, DiagnoseSettings, Verdict};
use truetwin::twin::Noise;

/// A parameter that jumps half-way: the record leaves its twin there, not before, and with the step added nothing is left. The step
/// is first, at its time, of effects on parameters, rates and the sensor.
#[test]
fn a_gap_begins_where_it_begins() {
    let study = study("tanks");
    let noise = Noise::new(41, "onset", 0);
    let text = "[[effect]]\nid='parameter-step'\ntarget='k3'\nmagnitudes={size=0.6,time=100.0}\n";
    let theta = [0.5, 0.45, 0.5, 0.8];
    let record = record(study.twin(), text, &theta, drive(&study, noise), noise);
    let rivals = [
        "parameter-step",
        "parameter-drift",
        "linear-loss",
        "constant-forcing",
        "state-ceiling",
        "sensor-drift",
    ];
    let found = found_among(&study, record, &rivals);
    println!("{}", line("parameter-step@k3", &found));
    let first = &found.cause.effects[0];
    assert_eq!(first.key(), "parameter-step@k3");
    let (name, at) = &first.magnitudes[1];
    assert!(name == "time" && (at - 100.0).abs() < 1.5, "{at} s");
    let maps = &found.location.maps;
    let onset = found.location.onset.as_ref().expect("no onset");
    assert!(
        (90.0..110.0).contains(&onset.time) && onset.parameter == "k3",
        "{onset:?}"
    );
    let sums = [
        maps.windows.iter().map(|cell| cell.share).sum::<f64>(),
        maps.regions.iter().map(|cell| cell.share).sum(),
        maps.channels.iter().map(|cell| cell.share).sum(),
        maps.lags.iter().map(|cell| cell.share).sum(),
        maps.bands.iter().map(|cell| cell.share).sum(),
    ];
    assert!(sums.iter().all(|sum| *sum <= 1.0 + 1e-9), "{sums:?}");
    let after = found
        .location
        .after
        .as_ref()
        .expect("nothing was drawn again");
    assert!(after.notable().windows.is_empty(), "{:?}", after.notable());
}

/// Neighbours that one record cannot tell apart: a next record is proposed that would tell more than the present one again.
#[test]
fn rivals_get_a_record_that_tells_more() {
    let study = study("tanks");
    let text = "[[effect]]\nid='quadratic-drag'\ntarget='h1'\nmagnitudes={coefficient=0.04}\n";
    let theta = [0.6, 0.6, 0.6, 1.0];
    let mut proposed = false;
    for i in [2, 0, 1] {
        let noise = Noise::new(42, "rivals", i);
        let record = record(study.twin(), text, &theta, drive(&study, noise), noise);
        let range = (record.drive().inputs().iter())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| {
                (low.min(*u), high.max(*u))
            });
        let found = found(&study, record, None);
        println!("{}", line("quadratic-drag@h1", &found));
        let Some(next) = &found.cause.next_input else {
            continue;
        };
        println!("{}: {:?}, again {:?}", next.kind, next.split, next.again);
        assert_eq!(found.cause.decision, Decision::Class);
        assert!(next.split[0] > next.again[0] && next.split[1] == next.again[1]);
        assert!(next.rivals.iter().all(|r| found.cause.class.contains(r)));
        let inputs = next.drive.inputs();
        assert!(inputs.iter().all(|u| (range.0..=range.1).contains(u)));
        proposed = true;
        break;
    }
    assert!(proposed, "no next input");
}

/// The cube of a spring that the library is not allowed to name is drawn, and read off as a law.
#[test]
fn the_missing_function_is_drawn() {
    let study = study("van-der-pol");
    let noise = Noise::new(43, "discover", 0);
    let text =
        "[[effect]]\nid='cubic-stiffness'\ntarget='x2'\nfrom='x1'\nmagnitudes={coefficient=0.4}\n";
    let drive = drive(&study, noise);
    let record = record(study.twin(), text, &[1.4], drive, noise);
    let every = study.effects();
    let settings = DiagnoseSettings {
        without: every.iter().map(|e| e.id().into()).collect(),
        ..DiagnoseSettings::default()
    };
    let found = with_settings(&study, record, &settings);
    assert_eq!(found.cause.decision, Decision::NoneOfThese);
    let function = (found.location.functions.iter())
        .find(|f| f.place == "x2" && f.variable == "x1")
        .expect("no function of x1");
    let at = |x: f64| {
        let near = (0..function.values.len())
            .min_by(|a, b| {
                (function.values[*a] - x)
                    .abs()
                    .total_cmp(&(function.values[*b] - x).abs())
            })
            .unwrap();
        (
            function.values[near],
            function.mean[near],
            function.std_error[near],
        )
    };
    // θ takes a linear part of the spring: the bend is what is left.
    let bend = at(1.5).1 - 2.0 * at(0.75).1 + at(0.0).1;
    let expected = -0.4 * (1.5f64.powi(3) - 2.0 * 0.75f64.powi(3));
    println!("{function:?}: bend {bend}, expected {expected}");
    assert!((bend / expected - 1.0).abs() < 0.4, "{bend} {expected}");
    let discovery = found.discovery.as_ref().expect("no law");
    assert_eq!(
        (discovery.equation.as_str(), discovery.variable.as_str()),
        ("x2", "x1")
    );
    assert!(
        discovery.terms[0].inclusion > 0.1 && discovery.explained > 0.8,
        "{discovery:?}"
    );
}

/// Counts, of so many records of each of three effects, those in which an effect is revealed that has the size which a record of the plain
/// twin says it would have revealed in 80 of 100 cases.
fn revealed(each: u64) -> (u64, u64) {
    let study = study("van-der-pol");
    let theta = [1.4];
    let plain = Noise::new(44, "plain", 0);
    let settings = DiagnoseSettings::default();
    let own = record(study.twin(), "", &theta, drive(&study, plain), plain);
    let found = with_settings(&study, own, &settings);
    assert_ne!(found.verdict, Verdict::StructuralGap);
    let only = DiagnoseSettings {
        detection_only: true,
        ..settings
    };
    let (mut seen, mut records) = (0, 0);
    for (id, target, more) in [
        ("linear-loss", "x2", ""),
        ("sensor-delay", "sensor", ""),
        ("cubic-stiffness", "x2", "from='x1'\n"),
    ] {
        let visible = (found.power.iter())
            .find(|v| v.id == id && v.target == target)
            .and_then(|v| Some((v.magnitude.clone(), v.value?)));
        let (name, value) = visible.expect("nothing is visible");
        let text = format!(
            "[[effect]]\nid='{id}'\ntarget='{target}'\n{more}magnitudes={{{name}={value}}}\n"
        );
        for i in 0..each {
            let noise = Noise::new(45, id, i);
            let drive = drive(&study, noise);
            let record = record(study.twin(), &text, &theta, drive, noise);
            let found = with_settings(&study, record, &only);
            assert!(found.location.targets.is_empty() && found.shrinkage.is_none());
            seen += u64::from(found.verdict == Verdict::StructuralGap);
            records += 1;
        }
        println!("{id} {name} = {value}: {seen} of {records} so far");
    }
    (seen, records)
}

/// Of 6 records, fewer than 3 have a chance of 1 in 59 at 0.8: sizes of which one in five is revealed fail with a probability of 0.90.
#[test]
fn power_is_what_it_says() {
    let (seen, records) = revealed(2);
    assert!(seen >= 3, "{seen} of {records}");
}

/// Of 60 records. To first order, and for this θ̂: somewhat more or less than 80 %. Sizes of which half, or all, are revealed fail.
#[test]
#[ignore = "minutes; run it in release"]
fn power_is_what_it_says_in_many_records() {
    let (seen, records) = revealed(20);
    let bounds = binomial_bounds(records, 0.8, 0.999);
    assert!(
        (bounds.start().saturating_sub(3)..=*bounds.end()).contains(&seen),
        "{seen} of {records}"
    );
}

/// Two effects at once, one in the equations and one at the sensor: both are accepted of eight, and nothing else.
#[test]
fn two_effects_are_both_accepted() {
    let study = study("van-der-pol");
    let noise = Noise::new(46, "pair", 0);
    let text = "[[effect]]\nid='coulomb-friction'\ntarget='x2'\nmagnitudes={force=0.2}\n\
                [[effect]]\nid='sensor-bias'\ntarget='sensor'\nmagnitudes={offset=0.15}\n";
    let record = record(study.twin(), text, &[1.4], drive(&study, noise), noise);
    let rivals = [
        "coulomb-friction",
        "power-law",
        "stribeck-friction",
        "linear-loss",
        "constant-forcing",
        "sensor-bias",
        "sensor-gain",
        "sensor-lag",
    ];
    let found = found_among(&study, record, &rivals);
    println!("{}", line("pair", &found));
    let mut accepted = found.cause.accepted.clone();
    accepted.sort();
    assert_eq!(accepted, ["coulomb-friction@x2", "sensor-bias@sensor"]);
    // A power law of exponent 0 is Coulomb's friction, and so is Stribeck's where little is in excess: rivals, if anything.
    let known = [
        "coulomb-friction@x2",
        "sensor-bias@sensor",
        "power-law@x2",
        "stribeck-friction@x2",
    ];
    assert!(
        found
            .cause
            .class
            .iter()
            .all(|c| known.contains(&c.as_str()))
    );
    let sum: f64 = found
        .cause
        .effects
        .iter()
        .skip(2)
        .map(|e| e.probability)
        .sum();
    assert!(sum <= 1.0, "{sum}");
}
