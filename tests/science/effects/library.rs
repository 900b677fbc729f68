//! Contents of the library.

use super::*;

/// Each member once; limits hold the off value and the starts; θ of a twin with it makes sense.
#[test]
fn the_library_makes_sense() {
    let catalogue = Catalogue::default();
    let library = catalogue.kinds();
    let ids: BTreeSet<_> = library.iter().map(|member| member.id()).collect();
    assert_eq!((library.len(), ids.len()), (37, 37));
    for member in library {
        assert!(
            member.magnitudes().iter().any(|m| m.off.is_some()),
            "{}",
            member.id()
        );
        for m in member.magnitudes() {
            assert!(
                m.off.is_none_or(|off| m.limits.contains(off)),
                "{}",
                member.id()
            );
            assert!(
                m.starts.iter().all(|s| m.limits.contains(*s)),
                "{}",
                member.id()
            );
            assert!(!m.starts.is_empty(), "{}", member.id());
        }
    }
    for (name, base, ..) in twins() {
        for effect in Catalogue::default().applicable(&base) {
            let twin = augment(base.clone(), vec![effect]).unwrap();
            twin.parameters()
                .check()
                .unwrap_or_else(|e| panic!("{name}: {e}"));
        }
    }
}

/// Counts by hand from the table; the cubic spring only on the oscillator's rate.
#[test]
fn what_may_be_lacking() {
    let counts: Vec<_> = twins()
        .iter()
        .map(|t| Catalogue::default().applicable(&t.1).len())
        .collect();
    // Tanks: 13 sensor, 9 actuator, 2 × (7 forces + 1 hysteresis + 1 coupling + 1 ceiling + 1 floor + 1 noise), 4 × 2 parameters.
    // Oscillator: no actuator, one parameter, one cubic spring.
    assert_eq!(counts, [13 + 9 + 24 + 8, 13 + 24 + 2 + 1, 22, 13]);
    let springs: Vec<_> = (twins().iter())
        .flat_map(|t| Catalogue::default().applicable(&t.1))
        .filter(|e| e.id() == "cubic-stiffness")
        .map(|e| (e.target().to_owned(), e.other().unwrap().to_owned()))
        .collect();
    assert_eq!(springs, [("x2".to_owned(), "x1".to_owned())]);
}
