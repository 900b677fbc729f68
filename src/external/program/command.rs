//! The command that starts a program.

use std::process::Command;

/// A program and its arguments. No shell is run: `*`, `|`, `$` and the like mean themselves.
///
/// ```
/// use truetwin::external::program::ProgramCommand;
/// let command = ProgramCommand::parse("python3 'my models/pendulum.py' --length 2")?;
/// assert_eq!(command.arguments(), ["my models/pendulum.py", "--length", "2"]);
/// assert!(ProgramCommand::parse("python3 'pendulum.py").is_err());
/// # Ok::<(), truetwin::external::program::ProgramError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProgramCommand {
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

    /// From one line, split at spaces; quotes and backslashes keep what belongs together, as in a shell.
    ///
    /// # Errors
    ///
    /// No word at all, or a quote that is not closed.
    pub fn parse(line: &str) -> Result<Self, super::ProgramError> {
        let wrong = |problem: &str| super::ProgramError::Command {
            line: line.into(),
            problem: problem.into(),
        };
        let words = shell_words::split(line).map_err(|_| wrong("a quote is not closed"))?;
        match words.split_first() {
            Some((program, arguments)) if !program.is_empty() => {
                Ok(Self::new(program, arguments.iter().cloned()))
            }
            _ => Err(wrong("no program is named; write 'python3 model.py'")),
        }
    }

    /// The program.
    pub fn program(&self) -> &str {
        &self.program
    }

    /// Its arguments.
    pub fn arguments(&self) -> &[String] {
        &self.arguments
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

/// As it would be typed.
impl std::fmt::Display for ProgramCommand {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let words = std::iter::once(&self.program).chain(&self.arguments);
        f.write_str(&shell_words::join(words))
    }
}
