//! Where a result comes from: version, call, seed, files.

use super::border::deliver;
use super::context::Context;
use super::failure::Failure;
use super::output;
use super::shell_word;
use crate::report::Document;
use crate::storage::files::keep_elsewhere;
use crate::storage::reading::{checksum_of_read, has_changed};
use crate::storage::result;
use jiff::Timestamp;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Options that change no result, and whether a value follows.
const SILENT: [(&str, bool); 6] = [
    ("--threads", true),
    ("--out", true),
    ("--shard", true),
    ("--workers", true),
    ("--timeout", true),
    ("--json", false),
];
/// Digits of a checksum in a line of text.
const SHORT: usize = 12;
/// Characters of `2026-11-21`.
const DAY: usize = 10;

/// Everything that repeats a result. The same call on the same files has the same provenance.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Provenance {
    /// Version of the program.
    version: &'static str,
    /// The call, without options that change no result.
    call: String,
    seed: u64,
    files: Vec<File>,
    /// Date in UTC from SOURCE_DATE_EPOCH; none without it, so that results repeat.
    date: Option<String>,
}

/// A file that a result was made from.
#[derive(Debug, Clone, Serialize)]
struct File {
    /// `record`, `validation`, `study`, `estimator`, `input` or `effect`.
    role: &'static str,
    #[serde(serialize_with = "as_text")]
    path: PathBuf,
    /// SHA-256 of the bytes that were read.
    sha256: Option<String>,
}

/// Serializes a path that may be no text.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&output::name(path))
}

impl Provenance {
    /// The provenance of a call and its study file; other files are added.
    pub fn new(context: &Context<'_>) -> Self {
        let epoch = std::env::var("SOURCE_DATE_EPOCH").ok();
        let provenance = Self {
            version: env!("CARGO_PKG_VERSION"),
            call: context.call.clone(),
            seed: context.seed,
            files: vec![],
            date: epoch.and_then(|epoch| {
                let date = Timestamp::from_second(epoch.parse().ok()?).ok()?;
                Some(date.to_string())
            }),
        };
        provenance.files("study", &context.study_file)
    }

    /// Adds files of one role.
    pub fn files(
        mut self,
        role: &'static str,
        paths: impl IntoIterator<Item = impl AsRef<Path>>,
    ) -> Self {
        self.files.extend(paths.into_iter().map(|path| File {
            role,
            path: path.as_ref().into(),
            sha256: checksum_of_read(path.as_ref()),
        }));
        self
    }

    /// The result with its provenance.
    pub fn on(&self, mut result: Value) -> Value {
        if let Some(object) = result.as_object_mut() {
            object.insert("provenance".into(), json!(self));
        }
        result
    }

    /// The text with a last line on where it comes from.
    fn below(&self, text: &str) -> String {
        let ends = if text.ends_with('\n') { "" } else { "\n" };
        format!("{text}{ends}{}\n", self.last_line())
    }

    /// Version, seed, files and call in one line.
    fn last_line(&self) -> String {
        format!("{}; call: {}", self.line(SHORT), self.call)
    }

    /// Prints a result: its JSON, which has its provenance, or else its text with the last line.
    pub fn print(
        &self,
        context: &Context<'_>,
        json: &Value,
        text: impl FnOnce() -> String,
    ) -> Result<ExitCode, Failure> {
        let code = context.print(json, || self.below(&text()))?;
        self.tell_changes();
        Ok(code)
    }

    /// Writes the files of a result and prints it, as [`print`](Self::print) does; where they cannot be written, its JSON is kept elsewhere.
    pub fn deliver(
        &self,
        context: &Context<'_>,
        json: &Value,
        write: impl FnOnce() -> Result<(), Failure>,
        text: impl FnOnce() -> String,
    ) -> Result<ExitCode, Failure> {
        let keep = || {
            let verb = json["schema"].as_str().unwrap_or_default();
            let verb = verb.split(['.', '/']).nth(1).unwrap_or("answer");
            match result() {
                Some(_) => None,
                None => keep_elsewhere(&format!("truetwin-{verb}.json"), &format!("{json:#}\n")),
            }
        };
        deliver(write, keep, || self.print(context, json, text))
    }

    /// Says which files have changed while the work went on.
    fn tell_changes(&self) {
        let mut paths: Vec<&Path> = self.files.iter().map(|file| &*file.path).collect();
        paths.dedup();
        for path in paths.into_iter().filter(|path| has_changed(path)) {
            output::say(&format!(
                "warning: {} has changed since it was read; this answer is of the file as it was, see its sha256",
                path.display()
            ));
        }
    }

    /// Prints a result that scripts read; where it comes from goes to standard error, without `--json`.
    pub fn print_beside(
        &self,
        context: &Context<'_>,
        json: Value,
        text: impl FnOnce() -> String,
    ) -> Result<ExitCode, Failure> {
        let code = context.print(&self.on(json), text)?;
        if !context.json {
            output::say(&self.last_line());
        }
        self.tell_changes();
        Ok(code)
    }

    /// The document as a page: files and date below its heading, where it comes from at its end.
    pub fn page(&self, document: Document) -> String {
        let measured = |file: &&File| ["record", "validation"].contains(&file.role);
        let names = self.files.iter().filter(measured).map(|file| {
            let name = file.path.file_name().unwrap_or(file.path.as_os_str());
            name.to_string_lossy().into_owned()
        });
        let day = self
            .date
            .clone()
            .unwrap_or_else(|| Timestamp::now().to_string());
        let byline: Vec<String> = names.chain([day.chars().take(DAY).collect()]).collect();
        let document = Document {
            byline: byline.join(", "),
            footer: vec![self.call.clone(), self.line(usize::MAX)],
            ..document
        };
        document.html()
    }

    fn line(&self, digits: usize) -> String {
        let mut parts = vec![
            format!("truetwin {}", self.version),
            format!("seed {}", self.seed),
        ];
        parts.extend(self.date.clone());
        parts.extend(self.files.iter().map(|file| {
            let path = shell_word::shown(&file.path);
            match &file.sha256 {
                Some(sum) => format!("{path} (sha256 {})", &sum[..digits.min(sum.len())]),
                None => path,
            }
        }));
        parts.join(", ")
    }
}

/// The words of a call as a shell reads them, without the program's folder and options that change no result.
pub(super) fn call(program: &str, words: &[OsString]) -> String {
    let mut call = vec![OsStr::new(program)];
    let mut rest = words.iter().skip(1);
    while let Some(word) = rest.next() {
        let text = word.to_string_lossy();
        let name = text.split('=').next().unwrap_or_default();
        if text == "--" {
            // No option stands behind it.
            call.push(word);
            call.extend(rest.map(OsString::as_os_str));
            break;
        }
        match SILENT.iter().find(|(silent, _)| *silent == name) {
            Some((_, true)) if !text.contains('=') => {
                rest.next();
            }
            Some(_) => {}
            None => call.push(word),
        }
    }
    shell_word::line(call)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Options that change no result are left out, but for a file of such a name.
    #[test]
    fn a_call_is_the_one_to_repeat() {
        let words = ["/bin/truetwin", "fit", "--json", "-q", "--", "--json"].map(OsString::from);
        assert_eq!(call("truetwin", &words), "truetwin fit -q -- --json");
    }

    /// The last line of a text repeats the result: version, seed, files with their checksums, call.
    #[test]
    fn the_last_line_has_the_call() {
        let provenance = Provenance {
            version: "0.1.0",
            call: "truetwin fit R.csv --study S.toml".into(),
            seed: 7,
            files: vec![File {
                role: "record",
                path: "R.csv".into(),
                sha256: Some("0123456789abcdef0123".into()),
            }],
            date: None,
        };
        assert_eq!(
            provenance.below("fitted"),
            "fitted\ntruetwin 0.1.0, seed 7, R.csv (sha256 0123456789ab); call: truetwin fit R.csv --study S.toml\n"
        );
    }

    #[test]
    fn options_that_change_nothing_are_left_out() {
        let words = [
            "/bin/truetwin",
            "fit",
            "R.csv",
            "--threads",
            "2",
            "--out=x",
            "--json",
            "--columns",
            "t=a b",
        ];
        let words = words.map(OsString::from);
        assert_eq!(
            call("truetwin", &words),
            "truetwin fit R.csv --columns 't=a b'"
        );
    }
}
