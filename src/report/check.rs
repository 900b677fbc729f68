//! Findings of a check as a document.

use super::document::Column::Text;
use super::document::{Block, Document};
use crate::twin::conformance::{Finding, Severity};

/// The number of checks that did not pass, then one line a check. Each line names the remedy.
pub(crate) fn check_document(subject: &str, findings: &[Finding]) -> Document {
    let word = |severity| match severity {
        Severity::Pass => "pass",
        Severity::Warning => "warning",
        Severity::Failure => "failure",
    };
    let row = |f: &Finding| vec![word(f.severity).into(), f.check.into(), f.message.clone()];
    let found = findings
        .iter()
        .filter(|f| f.severity != Severity::Pass)
        .count();
    let all = findings.len();
    let headline = match found {
        0 => format!("{subject}: all {all} checks passed."),
        n => format!("{subject}: {n} of {all} checks found something."),
    };
    let head = [("result", Text), ("check", Text), ("finding", Text)];
    Document {
        title: format!("{subject}: check"),
        answer: vec![
            Block::Headline(headline),
            Block::table("", &head, findings.iter().map(row).collect()),
        ],
        ..Document::default()
    }
}
