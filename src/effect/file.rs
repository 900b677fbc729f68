//! Effect files.

use super::catalogue::Catalogue;
use super::placed::{Effect, EffectEntry};
use crate::storage::untrusted::{check_names, message, read_text};
use crate::twin::TwinError;
use serde::Deserialize;
use std::path::Path;

/// Longest effect file, in bytes: thousands of effects.
const LARGEST_FILE: u64 = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectFile {
    #[serde(default)]
    effect: Vec<toml::Spanned<toml::Value>>,
}

impl Catalogue {
    /// Reads effects from the text of a file.
    ///
    /// Targets and magnitudes are checked when the effects are added to a twin.
    pub fn parse(&self, text: &str) -> Result<Vec<Effect>, TwinError> {
        self.parse_file(text, Path::new("effects"))
    }

    /// Reads effects from a file.
    pub fn read(&self, path: &Path) -> Result<Vec<Effect>, TwinError> {
        let text = read_text(path, LARGEST_FILE).map_err(|error| TwinError::EffectFile {
            path: path.into(),
            error: error.to_string(),
        })?;
        self.parse_file(&text, path)
    }

    fn parse_file(&self, text: &str, path: &Path) -> Result<Vec<Effect>, TwinError> {
        if let Ok(table) = toml::from_str(text) {
            check_names(&table).map_err(|problem| TwinError::EffectText {
                path: path.into(),
                line: 1,
                problem,
            })?;
        }
        let at = |byte: usize, problem: &str| {
            let lines = problem.lines().map(str::trim);
            let lines: Vec<_> = lines.filter(|line| !line.is_empty()).collect();
            TwinError::EffectText {
                path: path.into(),
                line: 1 + text.bytes().take(byte).filter(|b| *b == b'\n').count(),
                problem: message(&lines.join(", ")),
            }
        };
        let file: EffectFile = toml::from_str(text)
            .map_err(|error| at(error.span().map_or(0, |span| span.start), error.message()))?;
        (file.effect.into_iter())
            .map(|table| {
                // Each effect for itself: an error inside then points at its own [[effect]].
                let start = table.span().start;
                let entry = EffectEntry::deserialize(table.into_inner())
                    .map_err(|error| at(start, error.message()))?;
                self.resolve(&entry)
                    .map_err(|error| at(start, &error.to_string()))
            })
            .collect()
    }
}
