//! The command that starts a program.

use std::process::Command;

/// A program and its arguments. No shell is run: `*`, `|`, `$` and the like mean themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ProgramCommand {
    program: String,
    arguments: Vec<String>,
}

impl ProgramCommand {
    /// The program and its arguments, each as it is.
    pub fn new<S: Into<String>>(program: &str, arguments: impl IntoIterator<Item = S>) -> Self {
        Self {
            program: program.into(),
            arguments: arguments.into_iter().map(Into::into).collect(),
        }
    }

    pub(super) fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments);
        // Ctrl-C is for us: we end the program.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command
    }
}

/// The words as they would be typed; those with spaces or quotes stand in quotes.
impl std::fmt::Display for ProgramCommand {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let plain = |c: char| c.is_alphanumeric() || "_-./=:,+@%".contains(c);
        let word = |word: &str| match !word.is_empty() && word.chars().all(plain) {
            true => word.to_owned(),
            false => format!("'{}'", word.replace('\'', r"'\''")),
        };
        f.write_str(&word(&self.program))?;
        (self.arguments.iter()).try_for_each(|argument| write!(f, " {}", word(argument)))
    }
}
