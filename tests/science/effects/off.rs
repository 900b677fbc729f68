//! Off changes no bit, on changes something.

use super::*;

#[test]
fn off_changes_no_bit() {
    for (name, base, theta, drive) in twins() {
        let noise = Noise::new(1, "off", 0);
        let plain = bits(&base.simulate(&theta, &drive, noise).unwrap());
        for effect in Catalogue::default().applicable(&base) {
            let what = format!("{name}: {effect:?}");
            let magnitudes = effect.magnitudes().to_vec();
            let twin = augment(base.clone(), vec![effect]).unwrap();
            // Shapes at any value: there are at most four starts.
            for i in 0..4 {
                let off = magnitudes
                    .iter()
                    .map(|m| m.off.unwrap_or(m.starts[i % m.starts.len()]));
                let at: Vec<f64> = theta.iter().copied().chain(off).collect();
                assert_eq!(
                    bits(&twin.simulate(&at, &drive, noise).unwrap()),
                    plain,
                    "{what}"
                );
            }
        }
    }
}

/// All that a twin may lack, each off, at once: memories and channels do not mix.
#[test]
fn all_off_together_change_no_bit() {
    for (name, base, mut theta, drive) in twins() {
        let noise = Noise::new(2, "off", 0);
        let plain = bits(&base.simulate(&theta, &drive, noise).unwrap());
        let effects = Catalogue::default().applicable(&base);
        for m in effects.iter().flat_map(|e| e.magnitudes()) {
            theta.push(m.off.unwrap_or(m.starts[0]));
        }
        let y = augment(base, effects)
            .unwrap()
            .simulate(&theta, &drive, noise)
            .unwrap();
        assert_eq!(bits(&y), plain, "{name}");
    }
}

/// And each does something once it is on, at one of its starts at least.
#[test]
fn on_changes_the_record() {
    for (name, base, theta, drive) in twins() {
        let noise = Noise::new(3, "on", 0);
        let plain = base.simulate(&theta, &drive, noise).unwrap();
        for effect in Catalogue::default().applicable(&base) {
            let what = format!("{name}: {effect:?}");
            let magnitudes = effect.magnitudes().to_vec();
            let twin = augment(base.clone(), vec![effect]).unwrap();
            let moves = (0..4).any(|i| {
                let starts = magnitudes.iter().map(|m| m.starts[i % m.starts.len()]);
                let at: Vec<f64> = theta.iter().copied().chain(starts).collect();
                twin.simulate(&at, &drive, noise).is_ok_and(|y| y != plain)
            });
            // A level above 0 has no sign to lose, and no start of a jump lies within 7.5 s.
            let idle = name == "tanks" && what.contains("sensor-rectification")
                || name == "van-der-pol" && what.contains("parameter-step");
            assert!(moves || idle, "{what}");
        }
    }
}
