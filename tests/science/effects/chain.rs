//! Order along the signals; black boxes; effects upon effects.

use super::*;

#[test]
fn a_black_box_takes_signal_effects_only() {
    for (name, base, ..) in twins() {
        let on_signals = Catalogue::default()
            .applicable(&base)
            .iter()
            .all(|e| e.target() == "sensor" || e.target() == "actuator");
        assert_eq!(on_signals, name.starts_with("boxed"));
    }
    let boxed: Twin = Twin::new(BlackBox(CascadedTanks));
    for effects in [
        one("linear-loss", "h1", ""),
        one("parameter-step", "k1", ""),
        one("process-noise", "h1", ""),
    ] {
        let error = augment(boxed.clone(), effects).err().unwrap().to_string();
        assert!(
            error.contains("black-box") && error.contains("sensor and actuator"),
            "{error}"
        );
    }
}

/// bias, noise, saturation, outliers, in this order whatever the file's: the noise is clipped, outliers are not.
#[test]
fn the_sensor_chain_keeps_its_order() {
    let chain = from(
        "[[effect]]\nid = \"sensor-saturation\"\ntarget = \"sensor\"\nmagnitudes = { low = 0.9, high = 1.1 }\n\
         [[effect]]\nid = \"sensor-outliers\"\ntarget = \"sensor\"\nmagnitudes = { probability = 0.1, scale = 50.0 }\n\
         [[effect]]\nid = \"sensor-noise\"\ntarget = \"sensor\"\nmagnitudes = { std = 1.0 }\n\
         [[effect]]\nid = \"sensor-bias\"\ntarget = \"sensor\"\nmagnitudes = { offset = 1.0 }\n",
    );
    let rest = chain[..1]
        .iter()
        .chain(&chain[2..])
        .cloned()
        .collect::<Vec<Effect>>();
    for (name, base, theta, drive) in twins() {
        let noise = Noise::new(7, "chain", 0);
        let clipped = run(base.clone(), &theta, rest.clone(), &drive, noise);
        assert!(clipped.iter().all(|y| (0.9..=1.1).contains(y)), "{name}");
        assert!(
            clipped.iter().any(|y| *y == 0.9) && clipped.iter().any(|y| *y == 1.1),
            "{name}"
        );
        let struck = run(base, &theta, chain.clone(), &drive, noise);
        assert!(struck.iter().any(|y| y.abs() > 5.0), "{name}");
        let hits = (&struck - &clipped).iter().filter(|d| **d != 0.0).count();
        assert!((1..50).contains(&hits), "{name}: {hits}");
    }
}

/// Signal effects act on a black box as on equations, where noise does not tell them apart.
#[test]
fn black_box_and_equations_agree_without_noise() {
    let (_, base, theta, drive) = twins().remove(0);
    for effect in Catalogue::default().applicable(&Twin::new(BlackBox(CascadedTanks))) {
        let starts = effect
            .magnitudes()
            .iter()
            .map(|m| m.starts[m.starts.len() - 1]);
        let at: Vec<f64> = theta.iter().copied().chain(starts).collect();
        let y = |base: Twin| {
            let twin = augment(base, vec![effect.clone()]).unwrap();
            bits(&twin.simulate(&at, &drive, Noise::OFF).unwrap())
        };
        assert_eq!(
            y(base.clone()),
            y(Twin::new(BlackBox(CascadedTanks))),
            "{effect:?}"
        );
    }
}

/// A twin with an effect is a twin: effects added one after the other are all there.
#[test]
fn effects_nest() {
    let lag = || one("actuator-lag", "actuator", "magnitudes = { tau = 2.0 }");
    let gain = || one("actuator-gain", "actuator", "magnitudes = { error = 0.3 }");
    let struck = || {
        one(
            "sensor-outliers",
            "sensor",
            "magnitudes = { probability = 0.2, scale = 3.0 }",
        )
    };
    let late = || one("sensor-delay", "sensor", "magnitudes = { delay = 40.0 }");
    for (_, base, theta, drive) in twins().into_iter().filter(|t| t.2.len() == 4) {
        let noise = Noise::new(8, "nest", 0);
        let both = |first: Vec<Effect>, then: Vec<Effect>| {
            let theta = held(&held(&theta, &first), &then);
            let twin = augment(augment(base.clone(), first).unwrap(), then).unwrap();
            twin.simulate(&theta, &drive, noise)
        };
        let flat =
            |effects: Vec<Vec<Effect>>| run(base.clone(), &theta, effects.concat(), &drive, noise);
        // The outer effect acts on the input first.
        assert_eq!(both(lag(), gain()).unwrap(), flat(vec![gain(), lag()]));
        let bias = one("sensor-bias", "sensor", "magnitudes = { offset = 0.0 }");
        assert_eq!(both(struck(), bias).unwrap(), flat(vec![struck()]));
        assert!(
            both(late(), gain()).is_err(),
            "the inner delay is checked too"
        );
        let inner = augment(base.clone(), [lag(), late()].concat()).unwrap();
        let targets = |twin: &Twin| {
            let all = Catalogue::default().applicable(twin);
            all.iter().map(|e| format!("{e:?}")).collect::<Vec<_>>()
        };
        assert_eq!(targets(&inner), targets(&base), "memories are no targets");
    }
}

/// A sensor may show the input at once; effects on the way see the same sample.
#[test]
fn feedthrough_sees_the_present_input() {
    struct Wire;
    impl StateSpace for Wire {
        fn outline(&self) -> Outline {
            Outline {
                parameters: ParameterSpace::new([Parameter::new("k", "-", 0.5, 2.0)]),
                states: vec![Quantity::new("x", "")],
                inputs: vec![Quantity::new("u", "")],
                outputs: vec![Quantity::new("y", "")],
                ..Outline::new()
            }
        }
        fn drift(&self, _: &Now<'_>, _: &[f64], dx: &mut [f64]) {
            dx.fill(0.0);
        }
        fn observe(&self, now: &Now<'_>, _: &[f64], y: &mut [f64]) {
            y[0] = now.theta[0] * now.u[0];
        }
    }
    let drive = Drive::new(0.1, Signal::from_shape_fn((5, 1), |(k, _)| k as f64)).unwrap();
    let bias = one("actuator-bias", "actuator", "magnitudes = { offset = 1.0 }");
    let y = run(Twin::new(Wire), &[2.0], bias, &drive, Noise::OFF);
    assert_eq!(y.column(0).to_vec(), [2.0, 4.0, 6.0, 8.0, 10.0]);
}
