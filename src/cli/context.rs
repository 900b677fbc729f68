//! The interface between the command line and its verbs.

use super::failure::Failure;
use super::options::Subject;
use super::output;
use crate::estimator::Project;
use crate::progress::Progress;
use crate::storage::work::{Ranks, Share};
use crate::study::{Study, StudyError, StudyFile};
use clap::Command;
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;

/// A verb: its options and its work.
pub(super) trait Verb {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure>;

    /// The twin of the call, for verbs that need one.
    fn subject(&self) -> Option<&Subject> {
        None
    }

    /// Tells whether rerunning the same command resumes the work: what ranks share lies in a folder.
    fn is_resumed(&self) -> bool {
        self.is_shared_out()
    }

    /// Tells whether the ranks of a cluster share the work.
    fn is_shared_out(&self) -> bool {
        false
    }
}

/// Data that every verb gets.
pub(super) struct Context<'a> {
    /// All studies, including the external one.
    pub projects: &'a [Project],
    /// The external study of this call.
    pub external: Option<&'a Project>,
    /// Name of the program.
    pub program: &'a str,
    /// The call, without options that change no result.
    pub call: String,
    pub json: bool,
    pub seed: u64,
    pub progress: &'a Progress,
    pub ranks: &'a Ranks,
    /// Creates the whole command line.
    pub command: fn() -> Command,
}

impl Context<'_> {
    /// Returns the study of `--twin` or `--study`, or else the external one.
    pub fn study(&self, subject: &Subject) -> Result<Study, Failure> {
        Ok(self.project(subject)?.study().clone())
    }

    /// As [`study`](Self::study), with the recipes.
    pub fn project(&self, subject: &Subject) -> Result<Project, Failure> {
        match (&subject.twin, &subject.study) {
            (Some(name), _) => Ok(self.named(name)?.clone()),
            (None, Some(path)) => {
                let file = StudyFile::read(path)?;
                let at = |failure: Failure| failure.within(path);
                let project = self.named(&file.twin).map_err(at)?;
                project.configure(&file).map_err(|error| at(error.into()))
            }
            (None, None) => (self.external.cloned()).ok_or_else(|| {
                Failure::user(
                    "no twin given; add --twin NAME (`truetwin twins` lists them), --study S.toml, --program 'COMMAND', or --fmu M.fmu",
                )
            }),
        }
    }

    /// Refuses a program or FMU beside `--twin` or `--study` of another twin: it would be ignored.
    pub fn check_external_is_used(&self, subject: &Subject) -> Result<(), Failure> {
        if self.external.is_none() {
            return Ok(());
        }
        let (option, name) = match (&subject.twin, &subject.study) {
            (Some(name), _) => ("--twin", name.clone()),
            (None, Some(path)) => ("--study", StudyFile::read(path)?.twin),
            (None, None) => return Ok(()),
        };
        // An unknown name is refused where the twin is looked up, with the known ones.
        match self.named(&name) {
            Ok(_) => self.check_external_is(&name, option),
            Err(_) => Ok(()),
        }
    }

    /// Refuses a program or FMU with another twin than the one that `option` names.
    pub fn check_external_is(&self, name: &str, option: &str) -> Result<(), Failure> {
        match self.external.map(|project| project.study().name()) {
            Some(external) if external != name => Err(Failure::user(format!(
                "{option} names the twin {name}, --program or --fmu the twin {external}; give one of them"
            ))),
            _ => Ok(()),
        }
    }

    /// Returns the share of this process in numbered work: that of `--shard`, or of its rank.
    pub fn share(&self, asked: Option<Share>) -> Result<Share, Failure> {
        match asked {
            None => Ok(self.ranks.share()),
            Some(share) if self.ranks.is_alone() => Ok(share),
            Some(_) => Err(Failure::user(
                "--shard cannot be used under mpirun, where ranks share the work; remove it",
            )),
        }
    }

    pub fn named(&self, name: &str) -> Result<&Project, Failure> {
        let names = || self.projects.iter().map(|project| project.study().name());
        let project = names().position(|other| other == name);
        let unknown = || StudyError::Twin {
            given: name.into(),
            known: names().collect::<Vec<_>>().join(", "),
        };
        Ok(&self.projects[project.ok_or_else(unknown)?])
    }

    /// Prints a result: JSON if asked for, else text, if there is any.
    pub fn print(&self, json: &Value, text: impl FnOnce() -> String) -> Result<ExitCode, Failure> {
        if self.json {
            output::print_json(json)?;
        } else if let text = text()
            && !text.is_empty()
        {
            output::print(&text)?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Prints how much of a job array is done.
    pub fn print_share(
        &self,
        folder: &Path,
        pieces: &str,
        done: usize,
        of: usize,
    ) -> Result<ExitCode, Failure> {
        let json = json!({
            "schema": "truetwin.share/1", "folder": folder, "pieces": pieces, "there": done, "of": of,
        });
        self.print(&json, || {
            format!(
                "{}: {done} of {of} {pieces} done; when all shards are done, rerun without --shard to merge",
                folder.display()
            )
        })
    }
}
