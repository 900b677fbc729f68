//! Units are for people: an own effect's shapes decide its search.

use super::*;
use truetwin::fit::FitSettings;
use truetwin::prelude::*;
use truetwin::study::StudyFile;

/// What the texts of units once decided: a time, a number, a frequency.
const UNITS: [&str; 3] = ["s", "", "Hz"];

/// ẋ = u − k·x, y = x.
struct Leak;

impl StateSpace for Leak {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("k", "1/s", 0.2, 1.0).within(0.05, 3.0))
            .state("x", "m")
            .input("u", "m/s")
            .output("y", "m")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        dx[0] = now.u[0] - now.theta[0] * x[0];
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn noise(&self, _: &Now, _: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        (process[0], measurement[0]) = (0.01, 0.02);
    }
}

/// Laws of one's own with magnitudes of every shape that the unit's text once decided, all in one unit.
fn own(unit: &'static str) -> Vec<EffectKind> {
    let size = |name| Magnitude::signed(name, unit, &[-0.1, 0.1]);
    let number = |name| Magnitude::positive(name, unit, &[0.3, 1.0]);
    vec![
        EffectKind::sensor(
            "own-step",
            "",
            |m, now, _, s| {
                if now.t >= m[1] { s + m[0] } else { s }
            },
        )
        .magnitude(size("size"))
        .magnitude(number("time").shape(Shape::Time)),
        EffectKind::sensor("own-lag", "", |m, now, memory, s| {
            let kept = if m[0] > 0.0 {
                (-now.dt / m[0]).exp()
            } else {
                0.0
            };
            memory[0] = kept * memory[0] + (1.0 - kept) * s;
            memory[0]
        })
        .magnitude(number("tau").shape(Shape::TimeConstant))
        .memory(1),
        EffectKind::actuator("own-delay", "", |m, now, memory, u| {
            memory.rotate_right(1);
            memory[0] = u;
            let ago = (m[0] / now.dt).clamp(0.0, 30.0);
            let i = ago as usize;
            memory[i] + (ago - i as f64) * (memory[i + 1] - memory[i])
        })
        .magnitude(number("delay").shape(Shape::Delay))
        .memory(32),
        EffectKind::force("own-wave", "", |m, at| {
            m[0] * (std::f64::consts::TAU * m[1] * at.t).sin()
        })
        .magnitude(size("size"))
        .magnitude(number("frequency").shape(Shape::Frequency)),
        EffectKind::force("own-force", "", |m, at| -m[0] * at.x * at.x).magnitude(size("size")),
    ]
}

fn study(unit: &'static str, effect: &str) -> Study {
    let plan = RecordPlan::levels(0.1, 80, 0.0, 1.0, 10);
    let study = Study::new("leak", Leak, plan)
        .unwrap()
        .with_effects(own(unit));
    let text = format!("twin = 'leak'\n{effect}");
    study
        .configure(&StudyFile::parse(&text, "own.toml".as_ref()).unwrap())
        .unwrap()
}

/// A record whose sensor has this bias from the middle on.
fn stepped(bias: f64) -> Record {
    let noise = Noise::new(3, "shapes", 0);
    let drive = study("", "").drive(noise).unwrap();
    let mut outputs = Leak.simulate(&[0.5], &drive, noise).unwrap();
    (outputs.column_mut(0).iter_mut().skip(40)).for_each(|y| *y += bias);
    Record::new(drive, outputs).unwrap()
}

/// All figures of a fit with each of the effects.
fn fits(unit: &'static str, record: &Record) -> Vec<Vec<u64>> {
    let effect = |id: &str, target: &str| format!("[[effect]]\nid = '{id}'\ntarget = '{target}'");
    let all = [
        effect("own-step", "sensor"),
        effect("own-lag", "sensor"),
        effect("own-delay", "actuator"),
        effect("own-wave", "x"),
        effect("own-force", "x"),
    ];
    let fit = |effect: &String| {
        let records = std::slice::from_ref(record);
        let fit = (study(unit, effect))
            .fit_with(records, &FitSettings::default(), &Progress::silent())
            .unwrap();
        let values = fit.parameters.iter().flat_map(|p| [p.value, p.std_error]);
        let evidence = fit.evidence.map(|evidence| evidence.log_evidence);
        (values.chain([fit.log_likelihood]).chain(evidence))
            .map(f64::to_bits)
            .collect()
    };
    all.iter().map(fit).collect()
}

/// What a diagnosis says of own effects alone.
fn diagnosis(unit: &'static str, record: &Record) -> String {
    let library = Catalogue::default();
    let ids: BTreeSet<String> = (library.applicable(&Twin::new(Leak)).iter())
        .map(|effect| effect.id().to_owned())
        .collect();
    let settings = DiagnoseSettings {
        without: ids.iter().map(|id| id.as_str().into()).collect(),
        ablated: vec![truetwin::diagnose::Ablation::UnknownFunctions],
        quick: true,
        ..DiagnoseSettings::default()
    };
    let records = std::slice::from_ref(record);
    let found = diagnose(
        &study(unit, ""),
        records,
        None,
        &settings,
        &Progress::silent(),
    )
    .unwrap();
    format!("{:?} {:?}", found.detection, found.cause)
}

#[test]
fn texts_of_units_decide_nothing() {
    let record = stepped(0.1);
    let first = (fits(UNITS[0], &record), diagnosis(UNITS[0], &record));
    for unit in &UNITS[1..] {
        assert_eq!(fits(unit, &record), first.0, "{unit}");
        assert_eq!(diagnosis(unit, &record), first.1, "{unit}");
    }
}
