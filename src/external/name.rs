//! Names of twins, parameters and channels that come from programs and FMUs.

use crate::storage::untrusted::hidden;

/// Longest name or unit, in characters.
const LONGEST: usize = 100;

fn odd(c: char) -> bool {
    c.is_whitespace() || hidden(c) || ",=@\"'\\".contains(c)
}

/// Replaces characters that [`check`] refuses by `_`.
#[cfg(feature = "fmi")]
pub(super) fn made_fit(name: &str) -> String {
    let fit = |c| if odd(c) { '_' } else { c };
    name.chars().take(LONGEST).map(fit).collect()
}

/// Checks that `name` can be written on a command line (`--theta a=1,b=2`), in a study file and in a table. The error says what is wrong.
pub(super) fn check(name: &str) -> Result<(), String> {
    if name.is_empty() {
        return Err("a name is empty; give each its own".into());
    }
    if name.chars().count() > LONGEST {
        return Err(format!(
            "a name has more than {LONGEST} characters; shorten it"
        ));
    }
    match name.chars().find(|&c| odd(c)) {
        Some(c) => Err(format!(
            "the name {name:?} contains {c:?}; use letters, digits, _ - . instead"
        )),
        None => Ok(()),
    }
}

/// Replaces hidden characters of a unit by `_` and cuts it to the longest one.
#[cfg(feature = "fmi")]
pub(super) fn made_fit_unit(unit: &str) -> String {
    let fit = |c| if hidden(c) { '_' } else { c };
    unit.chars().take(LONGEST).map(fit).collect()
}

/// Checks that a unit can be shown beside a number. The error says what is wrong.
pub(super) fn check_unit(unit: &str) -> Result<(), String> {
    if unit.chars().count() > LONGEST {
        return Err(format!(
            "a unit has more than {LONGEST} characters; shorten it"
        ));
    }
    match unit.chars().find(|&c| hidden(c)) {
        Some(c) => Err(format!("the unit {unit:?} contains {c:?}; remove it")),
        None => Ok(()),
    }
}

/// Checks each of `names` as [`check`] does, and that no two are the same.
pub(super) fn check_all<'a>(
    what: &str,
    names: impl IntoIterator<Item = &'a str>,
) -> Result<(), String> {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        check(name).map_err(|problem| format!("{what}: {problem}"))?;
        if !seen.insert(name) {
            return Err(format!("{what}: duplicate name {name}; rename one"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_a_command_line_cannot_hold_are_refused() {
        for good in ["k", "body.mass", "der(x)", "x[1]", "ν", "heat-loss_2"] {
            assert_eq!(check(good), Ok(()), "{good}");
        }
        for bad in [
            "",
            "a b",
            "a,b",
            "a=b",
            "gain@u",
            "new\nline",
            "\u{9b}2J",
            "turned\u{202e}",
            &"x".repeat(101),
        ] {
            assert!(check(bad).is_err(), "{bad:?}");
        }
        assert_eq!(check_unit("µm·s⁻² (a \"b\")"), Ok(()));
        for bad in ["\u{1b}[2J", "a\nb", &"x".repeat(101)] {
            let problem = check_unit(bad).unwrap_err();
            assert!(!problem.contains(hidden), "{problem}");
        }
        let twice = check_all("inputs", ["u", "u"]).unwrap_err();
        assert!(
            twice.contains("inputs: duplicate name u; rename one"),
            "{twice}"
        );
    }
}
