//! The error of a twin as text.

use crate::storage::untrusted::line;
use std::path::{Path, PathBuf};

/// A fault in the text of a twin: where it is, the word there, and the remedy.
///
/// ```
/// use truetwin::equations::Equations;
///
/// let text = "[parameters]\nk = { prior = [0.1, 1.0] }\n[states]\nh = { rate = \"-kk*h\" }\n[outputs]\ny = { value = \"h\" }";
/// let error = Equations::parse(text).unwrap_err();
/// assert_eq!((error.line(), error.column()), (4, 16));
/// assert!(error.to_string().contains("unknown name \"kk\" (did you mean \"k\"?)"));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}line {line}, column {column}: {problem}", prefix(path.as_deref()))]
pub struct EquationsError {
    path: Option<PathBuf>,
    line: usize,
    column: usize,
    problem: String,
}

fn prefix(path: Option<&Path>) -> String {
    path.map_or(String::new(), |path| format!("{}, ", path.display()))
}

impl EquationsError {
    /// Creates an error at a byte of a text.
    pub(super) fn at(text: &str, byte: usize, problem: impl Into<String>) -> Self {
        let before = &text.as_bytes()[..byte.min(text.len())];
        let start = before
            .iter()
            .rposition(|b| *b == b'\n')
            .map_or(0, |at| at + 1);
        // Columns count characters: bytes that begin one.
        let column = before[start..].iter().filter(|b| (**b & 0xc0) != 0x80);
        Self {
            path: None,
            line: line(text, byte),
            column: 1 + column.count(),
            problem: problem.into(),
        }
    }

    /// Scope the file.
    #[must_use]
    pub fn in_file(mut self, path: &Path) -> Self {
        self.path = Some(path.into());
        self
    }

    /// Line, from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// Column, from 1, in characters.
    pub fn column(&self) -> usize {
        self.column
    }

    /// Returns the problem and the remedy.
    pub fn problem(&self) -> &str {
        &self.problem
    }
}
