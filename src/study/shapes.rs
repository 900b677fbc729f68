//! Shapes of a study file's tables, before they are read: a parser takes lists for tables, and what stands behind two ends.

use toml::{Table, Value};

/// Tables of a study file.
const TABLES: [&str; 9] = [
    "record", "prior", "bounds", "fixed", "limits", "noise", "start", "features", "library",
];
/// Tables of intervals.
const INTERVALS: [&str; 3] = ["prior", "bounds", "limits"];

/// Checks that tables are tables and intervals have two ends; else returns the key and what is wrong with it.
pub(super) fn check_shapes(file: &Table) -> Result<(), (String, String)> {
    for name in TABLES {
        match file.get(name) {
            None => {}
            Some(Value::Table(table)) => check_table(name, table)?,
            Some(_) => {
                let problem = format!("{name} is a table; write [{name}], and its keys below");
                return Err((name.into(), problem));
            }
        }
    }
    Ok(())
}

fn check_table(name: &str, table: &Table) -> Result<(), (String, String)> {
    let keeps_intervals = INTERVALS.contains(&name);
    for (key, value) in table {
        let problem = match value {
            Value::Table(inner) if inner.is_empty() && name != "features" => "is empty; remove it",
            Value::Table(inner) if keeps_intervals || name == "fixed" => {
                check_table(name, inner)?;
                continue;
            }
            _ if name == "prior" && key == "trust" && !value.is_bool() => "is true or false",
            Value::Array(ends) if keeps_intervals && ends.len() != 2 => {
                "has two ends: write [low, high]"
            }
            Value::Array(_) if name == "noise" => {
                "is no list; give a standard deviation, or { std = .., known = true }"
            }
            Value::Array(_) if name == "start" => {
                "is no list; give a value, \"estimate\", or { mean = .., std = .. }"
            }
            _ => continue,
        };
        return Err((key.clone(), format!("[{name}] {key} {problem}")));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_no_tables_and_intervals_have_two_ends() {
        for (text, part) in [
            ("record = [0.5, 80]", "write [record]"),
            ("[limits]\nh1 = [0, 5, 'x']", "[limits] h1 has two ends"),
            ("[prior]\nstart.h1 = [1.0]", "[prior] h1 has two ends"),
            ("[prior]\ntrust = 'yes'", "[prior] trust is true or false"),
            ("[prior]\nk1 = {}", "[prior] k1 is empty"),
            ("[start]\nh1 = [1, 2]", "[start] h1 is no list"),
            ("[noise]\nh1 = [0.1, true]", "[noise] h1 is no list"),
        ] {
            let (_, problem) = check_shapes(&toml::from_str(text).unwrap()).unwrap_err();
            assert!(problem.contains(part), "{problem}");
        }
        let fine = "[prior]\nk1 = [0, 1]\nstart.h1 = [0, 1]\ntrust = true\n[noise]\nh1 = { std = 0.1 }\n[features]\nkind = 'score'";
        assert_eq!(check_shapes(&toml::from_str(fine).unwrap()), Ok(()));
    }
}
