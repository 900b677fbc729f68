//! Effect files, and effects that do not fit.

use super::*;

#[test]
fn bad_files_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    let bias = "[[effect]]\nid = \"sensor-bias\"\ntarget = \"sensor\"\n";
    for (text, says) in [
        (
            bias.replace("bias", "bais"),
            vec!["line 2", "sensor-bais", "sensor-bias", "parameter-step"],
        ),
        (
            format!("{bias}\n{bias}colour = 1\n"),
            vec!["line 8", "colour", "magnitudes"],
        ),
        (format!("{bias}from = \"h1\"\n"), vec!["from"]),
        ("[[effekt]]\n".into(), vec!["line 1", "effekt", "effect"]),
        ("[[effect]]\ntarget = \"sensor\"\n".into(), vec!["id"]),
        (
            "[[effect]]\nid = \"cross-coupling\"\ntarget = \"h1\"\n".into(),
            vec!["from"],
        ),
        (
            format!("{bias}magnitudes = {{ offset = \"x\" }}\n"),
            vec!["\"x\""],
        ),
        (format!("{bias}magnitudes = \n"), vec!["line 4"]),
        (
            format!("{bias}magnitudes = {{ ofset = 1 }}\n"),
            vec!["line 4", "ofset", "offset"],
        ),
        (
            format!("{bias}magnitudes = {{ offset = nan }}\n"),
            vec!["line 4", "offset", "NaN"],
        ),
        (
            "[[effect]]\nid = \"sensor-lag\"\ntarget = \"sensor\"\nmagnitudes = { tau = -1.0 }".into(),
            vec!["line 4", "tau = -1", "[0, inf]"],
        ),
        (
            "[[effect]]\nid = \"state-ceiling\"\ntarget = \"h1\"\nto = \"h2\"\nmagnitudes = { spill = 1.5 }".into(),
            vec!["line 5", "spill = 1.5", "[0, 1]"],
        ),
        (
            "[[effect]]\nid = \"sensor-delay\"\ntarget = \"sensor\"\nmagnitudes = { delay = 40 }".into(),
            vec!["line 4", "delay = 40 s, but at a step of 0.5 s at most 31.5 s are kept"],
        ),
    ] {
        std::fs::write(&path, &text).unwrap();
        let error = Catalogue::default().read(&path, 0.5).unwrap_err().to_string();
        assert!(
            error.contains("bad.toml") && !error.contains('\n') && !error.contains(", ,"),
            "{error}"
        );
        for word in says {
            assert!(error.contains(word), "{word}: {error}");
        }
    }
    let missing = Catalogue::default()
        .read(&folder.path().join("none.toml"), 0.5)
        .unwrap_err();
    assert!(missing.to_string().contains("none.toml"), "{missing}");
}

#[test]
fn effects_that_do_not_fit_a_twin_are_refused_in_one_line() {
    for (effects, says) in [
        (one("sensor-bias", "sensor2", ""), ["sensor2", "sensor"]),
        (one("linear-loss", "h3", ""), ["h3", "h1, h2"]),
        (
            one("cross-coupling", "h1", "from = \"h9\""),
            ["h9", "h1, h2"],
        ),
        (one("parameter-drift", "k9", ""), ["k9", "k1, k2, k3, k4"]),
        (
            one("state-ceiling", "h1", "to = \"h1\""),
            ["h1 to itself", "name another state"],
        ),
        (
            one("cross-coupling", "h1", "from = \"h1\""),
            ["h1 to itself", "name another state"],
        ),
    ] {
        let error = augment(Twin::new(CascadedTanks), effects)
            .err()
            .unwrap()
            .to_string();
        assert!(!error.contains('\n'), "{error}");
        for word in says {
            assert!(error.contains(word), "{word}: {error}");
        }
    }
    let late = one("sensor-delay", "sensor", "magnitudes = { delay = 40.0 }");
    let (theta, drive) = (held(&TANKS, &late), twins()[0].3.clone());
    let twin = augment(Twin::new(CascadedTanks), late).unwrap();
    let error = twin
        .simulate(&theta, &drive, Noise::OFF)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("sensor-delay") && error.contains("31.5 s"),
        "{error}"
    );
}

/// Infinite off values, and whole numbers, come through files.
#[test]
fn files_hold_off_values_and_survive_a_round_trip() {
    let effects = from(
        "[[effect]]\nid = \"actuator-saturation\"\ntarget = \"actuator\"\nmagnitudes = { low = -inf, high = 2 }\n\
         [[effect]]\nid = \"state-ceiling\"\ntarget = \"h1\"\nto = \"h2\"\nmagnitudes = { level = inf }\n",
    );
    assert_eq!(effects[0].given("low"), Some(f64::NEG_INFINITY));
    assert_eq!(effects[0].given("high"), Some(2.0));
    assert_eq!(effects[1].given("spill"), None);
    assert!(augment(Twin::new(CascadedTanks), effects.clone()).is_ok());
    let file: BTreeMap<_, Vec<_>> =
        [("effect", effects.iter().map(Effect::entry).collect())].into();
    let text = toml::to_string(&file).unwrap();
    assert_eq!(format!("{:?}", from(&text)), format!("{effects:?}"));
}
