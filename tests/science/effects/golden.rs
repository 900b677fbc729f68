//! The records that a second program wrote.

use super::*;

fn contract() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/contract/effects")
}

/// The records that a second program wrote from the same laws, each to 1e-9.
#[test]
fn golden_records() {
    let mut bad = Vec::new();
    let mut seen = BTreeSet::new();
    for entry in std::fs::read_dir(contract()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "csv") {
            continue;
        }
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let (id, twin) = name.split_once('.').unwrap();
        let (base, theta): (Twin, &[f64]) = match twin {
            "tanks" => (Twin::new(CascadedTanks), &TANKS),
            _ => (Twin::new(VanDerPol), &NU),
        };
        // The contract's step is exact; the file's last digit decides whether a step falls on a sample.
        let dt = if twin == "tanks" { 0.5 } else { 0.05 };
        let effects = match id {
            "none" => vec![],
            _ => Catalogue::default()
                .read(&path.with_extension("toml"), dt)
                .unwrap(),
        };
        seen.insert(id.to_owned());
        let record = Record::read(&path).unwrap();
        let drive = Drive::new(dt, record.drive().inputs().clone()).unwrap();
        let y = run(base, theta, effects, &drive, Noise::OFF);
        let off = (&y - record.outputs())
            .iter()
            .fold(0.0f64, |a, d| a.max(d.abs()));
        if off.is_nan() || off > 1e-9 {
            bad.push(format!("{name}: {off:e}"));
        }
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
    let random = ["sensor-noise", "sensor-outliers", "process-noise"];
    for member in Catalogue::default().kinds() {
        assert!(
            seen.contains(member.id()) != random.contains(&member.id()),
            "{}",
            member.id()
        );
    }
}
