//! The interface between the command line and its verbs.

use super::failure::{Failure, InFile};
use super::options::Subject;
use super::output;
use super::shell_word::shown;
use crate::estimator::{Estimator, Project};
use crate::progress::Progress;
use crate::storage::work::{Ranks, Share};
use crate::study::{Study, StudyError, StudyFile};
use clap::Command;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A verb: its options and its work.
pub(super) trait Verb {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure>;

    /// Returns the folder that keeps finished work, where rerunning the same command resumes it.
    fn kept(&self) -> Option<PathBuf> {
        None
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
    /// The study file of the call.
    pub study_file: Option<PathBuf>,
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
        let (project, option) = match (&subject.twin, &subject.study) {
            (Some(name), _) => (self.named(name)?.clone(), "--twin"),
            (None, Some(path)) => (self.configured(path)?, "--study"),
            (None, None) => return self.external.cloned().ok_or_else(|| {
                Failure::user(
                    "no twin given; add --twin NAME (`truetwin twins` lists them), --study S.toml, --program 'COMMAND', or --fmu M.fmu",
                )
            }),
        };
        self.check_external_is(project.study().name(), option)?;
        Ok(project)
    }

    /// Returns the project of a study file.
    pub fn configured(&self, path: &Path) -> Result<Project, Failure> {
        let file = StudyFile::read(path)?;
        if file.own_equations().is_some() {
            return Ok(Study::of_file(&file).in_file(path)?.into());
        }
        let project = (self.named(&file.twin))
            .map_err(|error| file.located(error))
            .in_file(path)?;
        project.configure(&file).in_file(path)
    }

    /// Refuses a program or FMU with another twin than the one that `option` names: it would be ignored.
    pub fn check_external_is(&self, name: &str, option: &str) -> Result<(), Failure> {
        match self.external.map(|project| project.study().name()) {
            Some(external) if external != name => Err(Failure::user(format!(
                "{option} names the twin {name}, --program or --fmu the twin {external}; give one of them"
            ))),
            _ => Ok(()),
        }
    }

    /// Loads an estimator; refuses one of another twin, or where the call has a study, of another setting, than the one that is asked for, if one is.
    pub fn estimator(
        &self,
        path: &Path,
        asked: Option<&Study>,
        subject: &Subject,
    ) -> Result<Estimator, Failure> {
        let estimator = Estimator::load(path, self.projects)?;
        self.check_external_is(estimator.study().name(), "--estimator")?;
        let Some(study) = asked else {
            return Ok(estimator);
        };
        let (made_for, asked) = (estimator.study().name(), study.name());
        if made_for != asked {
            return Err(Failure::user(format!(
                "{}: made for twin {made_for}, the call names {asked}; name the same twin",
                path.display()
            )));
        }
        if subject.study.is_some() {
            let [made_for, asked] = [estimator.study(), study].map(|s| s.manifest("reproduce", 0));
            if let Some(difference) = asked?.differs(&made_for?) {
                return Err(Failure::user(format!(
                    "{}: made for another setting: {difference}; name the study that it was trained with, or the twin alone",
                    path.display()
                )));
            }
        }
        Ok(estimator)
    }

    /// Returns the share of this process in numbered work: that of `--shard`, or of its rank.
    pub fn share(&self, asked: Option<Share>) -> Result<Share, Failure> {
        match asked {
            Some(_) if !self.ranks.is_alone() => Err(Failure::user(
                "--shard cannot be used under mpirun, where ranks share the work; remove it",
            )),
            asked => Ok(asked.unwrap_or(self.ranks.share())),
        }
    }

    pub fn named(&self, name: &str) -> Result<&Project, StudyError> {
        let mut projects = self.projects.iter();
        let project = projects.find(|project| project.study().name() == name);
        project.ok_or_else(|| {
            let known: Vec<&str> = self.projects.iter().map(|p| p.study().name()).collect();
            let (given, known) = (name.into(), known.join(", "));
            StudyError::Twin { given, known }
        })
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
            "schema": "truetwin.share/1", "folder": output::name(folder), "pieces": pieces, "there": done, "of": of,
        });
        self.print(&json, || {
            format!(
                "{}: {done} of {of} {pieces} done; when all shards are done, rerun without --shard to merge",
                shown(folder)
            )
        })
    }
}
