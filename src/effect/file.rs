//! Effects from files.

use crate::effect::{Effects, UnmodelledEffect};
use crate::storage::untrusted::{MESSAGE, check_names, one_line, read_text};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Longest effect file, in bytes: thousands of effects.
const MOST: u64 = 1 << 20;

/// What is wrong with an effect file: which file, where, and what to do.
///
/// ```
/// use truetwin::effect::{EffectFileError, parse_effects};
///
/// let error: EffectFileError = parse_effects("[[effect]]\nid = 'sensor-rust'\ntarget = 'sensor'").unwrap_err();
/// assert!(error.to_string().contains("sensor-rust"), "{error}");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EffectFileError {
    /// The file cannot be read.
    #[error("{}: {error}; give the path of an effect file", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// The text is no list of effects: bad TOML, an unknown id, an unknown or a missing key.
    #[error(
        "{}, line {line}: {problem}; write [[effect]], then id, target and magnitudes = {{ name = value }}",
        path.display()
    )]
    Text {
        /// File; `effects` for a text that came without one.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong there.
        problem: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectFile {
    #[serde(default)]
    effect: Vec<toml::Spanned<toml::Value>>,
}

/// Effects from the text of a file.
///
/// ```
/// use truetwin::effect::parse_effects;
/// let effects = parse_effects(
///     r#"
///     [[effect]]
///     id = "sensor-lag"
///     target = "sensor"
///     magnitudes = { tau = 2.5 }
///     "#,
/// )?;
/// assert_eq!(effects[0].given().get("tau"), Some(2.5));
/// # Ok::<(), truetwin::effect::EffectFileError>(())
/// ```
///
/// Whether targets and magnitudes exist is checked when the effects are added to a twin.
pub fn parse_effects(text: &str) -> Result<Effects, EffectFileError> {
    parse(text, Path::new("effects"))
}

/// Effects from a file.
///
/// ```
/// use truetwin::effect::read_effects;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("E.toml");
/// std::fs::write(&path, "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\nmagnitudes = { tau = 2.5 }")?;
/// assert_eq!(read_effects(&path)?[0].given().get("tau"), Some(2.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_effects(path: &Path) -> Result<Effects, EffectFileError> {
    let text = read_text(path, MOST).map_err(|error| EffectFileError::Io {
        path: path.into(),
        error,
    })?;
    parse(&text, path)
}

fn parse(text: &str, path: &Path) -> Result<Effects, EffectFileError> {
    if let Ok(table) = toml::from_str(text) {
        check_names(&table).map_err(|problem| EffectFileError::Text {
            path: path.into(),
            line: 1,
            problem,
        })?;
    }
    let wrong = |at: usize, error: toml::de::Error| {
        let lines = error.message().lines().map(str::trim);
        EffectFileError::Text {
            path: path.into(),
            line: 1 + text.bytes().take(at).filter(|b| *b == b'\n').count(),
            problem: one_line(
                &(lines.filter(|line| !line.is_empty()))
                    .collect::<Vec<_>>()
                    .join(", ")
                    // The only variants here are ids.
                    .replace("unknown variant", "unknown id"),
                MESSAGE,
            ),
        }
    };
    let file: EffectFile =
        toml::from_str(text).map_err(|e| wrong(e.span().map_or(0, |span| span.start), e))?;
    (file.effect.into_iter())
        .map(|table| {
            // Each effect for itself: an error inside then points at its own [[effect]].
            let at = table.span().start;
            Box::<dyn UnmodelledEffect>::deserialize(table.into_inner())
                .map(Into::into)
                .map_err(|e| wrong(at, e))
        })
        .collect()
}
