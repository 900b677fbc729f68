//! Effects in files: `[[effect]]` tables, with the lines of what is wrong in them.

use super::catalogue::Catalogue;
use super::check::{check_at, check_given};
use super::placed::{Effect, EffectEntry};
use crate::storage::untrusted::{all_keyed, check_names, line, message, read_text};
use crate::twin::TwinError;
use serde::Deserialize;
use std::path::Path;
use toml::de::DeTable;

/// Longest effect file, in bytes: thousands of effects.
const LARGEST_FILE: u64 = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectFile {
    #[serde(default, deserialize_with = "all_keyed")]
    effect: Vec<EffectEntry>,
}

impl Catalogue {
    /// Reads effects from the text of a file.
    ///
    /// Magnitudes are checked; targets are, when the effects are added to a twin.
    pub fn parse(&self, text: &str) -> Result<Vec<Effect>, TwinError> {
        self.parse_file(text, Path::new("effects"), None)
    }

    /// Reads effects from a file, for simulations at this step in seconds.
    pub fn read(&self, path: &Path, step: f64) -> Result<Vec<Effect>, TwinError> {
        let text = read_text(path, LARGEST_FILE).map_err(|error| TwinError::EffectFile {
            path: path.into(),
            error: error.to_string(),
        })?;
        let effects = self.parse_file(&text, path, Some(step))?;
        match effects.is_empty() {
            true => Err(TwinError::EffectText {
                path: path.into(),
                line: 1,
                problem: "no effect; give it one with id and target".into(),
            }),
            false => Ok(effects),
        }
    }

    fn parse_file(
        &self,
        text: &str,
        path: &Path,
        step: Option<f64>,
    ) -> Result<Vec<Effect>, TwinError> {
        let wrong = |line: usize, problem: &str| {
            let lines = problem.lines().map(str::trim);
            let lines: Vec<_> = lines.filter(|line| !line.is_empty()).collect();
            TwinError::EffectText {
                path: path.into(),
                line,
                problem: message(&lines.join(", ")),
            }
        };
        if let Ok(table) = DeTable::parse(text) {
            check_names(table.get_ref())
                .map_err(|(byte, problem)| wrong(line(text, byte), &problem))?;
        }
        let file: EffectFile = toml::from_str(text).map_err(|error| {
            let byte = error.span().map_or(0, |span| span.start);
            wrong(line(text, byte), error.message())
        })?;
        (file.effect.iter().enumerate())
            .map(|(index, entry)| {
                let checked = self.resolve(entry).and_then(|effect| {
                    check_given(&effect)?;
                    step.map_or(Ok(()), |step| check_at(&effect, step))?;
                    Ok(effect)
                });
                checked.map_err(|error| {
                    let line = line_of_effect(text, index, entry, &error);
                    wrong(line.unwrap_or(1), &error.to_string())
                })
            })
            .collect()
    }
}

/// Returns the line of the value that `error` is about in effect `index` of a text; none where that is not `entry`, since a caller may
/// have changed the effects.
pub(crate) fn line_of_effect(
    text: &str,
    index: usize,
    entry: &EffectEntry,
    error: &TwinError,
) -> Option<usize> {
    let file = DeTable::parse(text).ok()?;
    let table = file
        .get_ref()
        .get("effect")?
        .get_ref()
        .get(index)?
        .get_ref();
    let is = |key, name: &str| {
        let value = table.get(key).and_then(|value| value.get_ref().as_str());
        value == Some(name)
    };
    if !is("id", &entry.id) || !is("target", &entry.target) {
        return None;
    }
    let value = match error {
        TwinError::Effect { key, .. } => match key.as_str() {
            key @ ("id" | "target" | "from" | "to") => table.get(key),
            name => (table.get("magnitudes")).and_then(|all| all.get_ref().get(name)),
        },
        _ => None,
    };
    Some(line(text, value.or(table.get("id"))?.span().start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let told = |text: &str| Catalogue::default().parse(text).unwrap_err().to_string();
        let no_table = told("effect = [3]");
        assert!(
            no_table.contains("expected a table with id and target"),
            "{no_table}"
        );
        let list = told("effect = [\n['sensor-bias', 'sensor', 'x', 'y', { offset = 3 }]]");
        let is_told = list.contains("line 2: found a list, expected a table with id and target");
        assert!(is_told, "{list}");
        let first = "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\n";
        for (second, line, problem) in [
            ("error = 'x'", 7, "unknown key `error`"),
            ("magnitudes = { tau = -1.0 }", 7, "tau = -1 is outside"),
            ("magnitudes = { tao = 1.0 }", 7, "did you mean \"tau\""),
            ("magnitudes.tau = 'x'", 7, "expected a number"),
        ] {
            let told = told(&format!("{first}{first}{second}\n"));
            let found = told.contains(&format!("line {line}: ")) && told.contains(problem);
            assert!(found, "{second}: {told}");
        }
        let missing = told(&format!("{first}\n[[effect]]\nid = 'sensor-lag'\n"));
        assert!(
            missing.contains("line 5: missing key `target`"),
            "{missing}"
        );
        let unknown = told(&format!("{first}[[effect]]\nid = 'lag'\ntarget = 'y'"));
        assert!(unknown.contains("line 5: "), "{unknown}");
        assert!(Catalogue::default().parse("# none\n").unwrap().is_empty());
    }
}
