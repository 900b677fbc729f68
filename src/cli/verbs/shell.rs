//! `completions` and `man`: shell completion and manual pages, generated from the options.

use crate::cli::prelude::*;
use crate::cli::shell_word::{quoted, shown};
use crate::setting::did_you_mean;
use clap::builder::PossibleValuesParser;
use clap::{Args, Command};
use clap_complete::Shell;
use clap_mangen::Man as Page;

/// Print a shell script that completes verbs, options and twin names.
#[derive(Debug, Args)]
#[command(after_help = "Run once, and after each update:\n  \
        bash        truetwin completions bash > ~/.local/share/bash-completion/completions/truetwin\n  \
        zsh         truetwin completions zsh  > \"${fpath[1]}/_truetwin\"\n  \
        fish        truetwin completions fish > ~/.config/fish/completions/truetwin.fish\n  \
        PowerShell  truetwin completions powershell >> $PROFILE\n\
        Then open a new shell.")]
pub(in crate::cli) struct Completions {
    /// Shell.
    #[arg(value_enum)]
    shell: Shell,
}

impl Verb for Completions {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let mut command = command(context);
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, context.program, &mut script);
        let script = String::from_utf8(script).map_err(Failure::internal)?;
        let json = json!({
            "schema": "truetwin.completions/1", "shell": self.shell.to_string(), "script": script,
        });
        context.print(&json, || script)
    }
}

/// Print or write manual pages: one for the program, one for each verb.
#[derive(Debug, Args)]
#[command(after_help = "Read one page, or install all of them:\n  \
        truetwin man estimate | man -l -\n  \
        truetwin man --out man1 && sudo mv man1/* /usr/local/share/man/man1/")]
pub(in crate::cli) struct Man {
    /// Verb of the page to print [default: the program's page].
    #[arg(value_name = "VERB", conflicts_with = "out")]
    verb: Option<String>,
    /// New folder for all pages.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for Man {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        let pages = pages(context)?;
        if let Some(out) = &self.out {
            let folder = output::new_folder(out)?;
            for (name, text) in &pages {
                folder.write(&format!("{name}.1"), text)?;
            }
            folder.finish()?;
            let names: Vec<&String> = pages.iter().map(|(name, _)| name).collect();
            let json =
                json!({ "schema": "truetwin.man/1", "folder": output::name(out), "pages": names });
            return context.print(&json, || {
                let page = out.join(format!("{}.1", context.program));
                let folder = shown(out);
                let page = quoted(page.as_os_str());
                format!("{folder}: {} pages\nnext: man {page}", names.len())
            });
        }
        let verb = self.verb.as_deref().unwrap_or_default();
        let asked = match verb {
            "" => context.program.to_owned(),
            verb => format!("{}-{verb}", context.program),
        };
        let Some((name, text)) = pages.iter().find(|(name, _)| *name == asked) else {
            let verbs = command(context);
            let known: Vec<&str> = verbs.get_subcommands().map(Command::get_name).collect();
            return Err(Failure::user(format!(
                "man: no verb is called {verb}{}; there are {}",
                did_you_mean(verb, &known),
                known.join(", ")
            )));
        };
        let json = json!({ "schema": "truetwin.man/1", "page": name, "text": text });
        context.print(&json, || text.clone())
    }
}

/// Returns the command line with this program's name, and its twins as values of `--twin`.
fn command(context: &Context<'_>) -> Command {
    let names = context.projects.iter().map(|p| p.study().name().to_owned());
    let names: Vec<String> = names.collect();
    ((context.command)().name(context.program.to_owned())).mut_subcommands(|verb| {
        verb.mut_args(|option| match option.get_id() == "twin" {
            true => option.value_parser(PossibleValuesParser::new(names.clone())),
            false => option,
        })
    })
}

/// Renders all pages: names and roff texts.
fn pages(context: &Context<'_>) -> Result<Vec<(String, String)>, Failure> {
    let mut whole = command(context).bin_name(context.program.to_owned());
    // Copies the global options to each verb.
    whole.build();
    let mut pages = vec![(context.program.to_owned(), whole.clone())];
    for verb in whole
        .get_subcommands()
        .filter(|verb| verb.get_name() != "help")
    {
        let name = format!("{}-{}", context.program, verb.get_name());
        pages.push((name, verb.clone()));
    }
    let rendered = |(name, verb): (String, Command)| {
        let mut text = Vec::new();
        let page = Page::new(verb).title(name.to_uppercase());
        page.render(&mut text).map_err(Failure::internal)?;
        Ok((name, String::from_utf8(text).map_err(Failure::internal)?))
    };
    pages.into_iter().map(rendered).collect()
}
