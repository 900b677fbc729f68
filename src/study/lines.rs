//! Lines of `[[effect]]` tables, for messages.

use super::error::StudyError;
use crate::effect::EffectEntry;
use crate::twin::TwinError;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use toml::Spanned;

/// The first line that sets a key or begins its table, from 1.
pub(super) fn line_of(text: &str, key: &str) -> usize {
    let begins = |line: &str| {
        let line = line
            .trim_start()
            .trim_start_matches('[')
            .trim_start_matches('"');
        let path = line.split(['=', ']', '"']).next().unwrap_or_default();
        path.trim().rsplit('.').next() == Some(key)
    };
    text.lines().position(begins).map_or(1, |at| at + 1)
}

/// The tables of a study file that effects stand in, each value with its place in the text.
#[derive(Deserialize)]
struct Tables {
    #[serde(default)]
    effect: Vec<Keys>,
}

#[derive(Deserialize)]
struct Keys {
    id: Spanned<String>,
    target: Spanned<String>,
    from: Option<Spanned<String>>,
    to: Option<Spanned<String>>,
    #[serde(default)]
    magnitudes: BTreeMap<String, Spanned<f64>>,
}

impl Keys {
    /// Returns whether the table is that of `entry`: a caller may have changed the effects since.
    fn is(&self, entry: &EffectEntry) -> bool {
        self.id.as_ref() == &entry.id && self.target.as_ref() == &entry.target
    }

    /// Returns the byte at which the value that `error` is about starts.
    fn start(&self, error: &TwinError) -> usize {
        let id = self.id.span().start;
        let of = |value: &Option<Spanned<String>>| value.as_ref().map(|v| v.span().start);
        let other = of(&self.from).or(of(&self.to));
        match error {
            TwinError::EffectTarget { name, .. } if name == self.target.as_ref() => {
                self.target.span().start
            }
            TwinError::DuplicateEffect { .. } => self.target.span().start,
            TwinError::EffectTarget { .. }
            | TwinError::EffectOnItself { .. }
            | TwinError::OtherState { key: "from", .. } => other.unwrap_or(id),
            TwinError::OtherState { .. } => of(&self.to).unwrap_or(id),
            TwinError::UnknownMagnitude { name, .. } | TwinError::MagnitudeValue { name, .. } => {
                (self.magnitudes.get(name)).map_or(id, |value| value.span().start)
            }
            _ => id,
        }
    }
}

/// Adds to the error of effect `index`, which is `entry`, its line in the text of the file.
pub(super) fn with_line(
    error: TwinError,
    (path, text): &(PathBuf, Arc<str>),
    index: usize,
    entry: &EffectEntry,
) -> StudyError {
    let tables = toml::from_str::<Tables>(text).ok();
    let keys = tables.as_ref().and_then(|tables| tables.effect.get(index));
    match keys.filter(|keys| keys.is(entry)) {
        Some(keys) => StudyError::EffectAt {
            path: path.clone(),
            line: line(text, keys.start(&error)),
            error,
        },
        None => error.into(),
    }
}

/// Returns the line, from 1, of a byte of a text.
pub(super) fn line(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count()
}
