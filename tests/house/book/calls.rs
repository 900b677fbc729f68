//! Every `truetwin …` of the pages is a call that the program takes, as far as can be said without running it.

use super::{Piece, pages, pieces, prose, read, root};
use std::process::{Command, Output};

/// A call as a page has it.
#[derive(Debug, PartialEq)]
struct Call {
    arguments: Vec<String>,
    /// True if nothing is left out: required arguments are asked for, too.
    whole: bool,
}

fn truetwin(arguments: &[String]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_truetwin"));
    command.args(arguments).output().unwrap()
}

/// The call in a line of a shell; none in lines of other programs.
fn call(line: &str, whole: bool) -> Option<Call> {
    let line = line.split(" #").next().unwrap();
    let line = line.replace("$SCRATCH", "scratch").replace("$I", "1");
    let line = line.replace("$SLURM_ARRAY_TASK_ID", "1");
    let words = shell_words::split(&line).unwrap_or_else(|error| panic!("{line}: {error}"));
    let start = match words.iter().position(|word| word == "truetwin") {
        Some(at) => at + 1,
        None => {
            let run = words.first()? == "cargo" && words.get(1)? == "run";
            let dashes = words.iter().position(|word| word == "--")?;
            if let Some(at) = words.iter().position(|word| word == "--example") {
                let example = format!("examples/{}.rs", words[at + 1]);
                let code = read(&root().join(&example));
                assert!(run, "{line}");
                if !code.contains("cli::run") {
                    return None;
                }
            }
            dashes + 1
        }
    };
    let mut arguments: Vec<String> = vec![];
    let mut cut = false;
    for word in &words[start..] {
        let word = word.trim_matches(['[', ']']);
        let after_option = arguments.last().is_some_and(|last| last.starts_with("--"));
        match word {
            "…" => {
                cut = true;
                if after_option {
                    arguments.push("something".into());
                }
            }
            "N" | "M" | "S" if after_option => arguments.push("1".into()),
            "i/n" | "I/N" => arguments.push("1/2".into()),
            "&&" | "|" | ">" => break,
            word => arguments.push(word.into()),
        }
    }
    let verb = arguments.first()?;
    (verb != "VERB").then_some(Call {
        whole: whole && !cut,
        arguments,
    })
}

/// Calls that a page tells its readers to type.
fn calls(text: &str) -> Vec<Call> {
    let mut found = vec![];
    for piece in pieces(text) {
        let Piece::Block { language, text } = piece else {
            continue;
        };
        let text = text.replace("\\\n", " ");
        let lines = text.lines().filter_map(|line| match language.as_str() {
            "console" => line.strip_prefix("$ "),
            "bash" => Some(line).filter(|line| !line.starts_with('#')),
            _ => None,
        });
        found.extend(lines.filter_map(|line| call(line, true)));
    }
    let (_, code) = prose(text);
    let spoken = code
        .iter()
        .filter(|code| code.contains("truetwin ") && !code.contains("::"));
    found.extend(spoken.filter_map(|code| call(code, false)));
    found
}

/// A whole call goes through the parser with a number of threads that is refused before any work; a part of one asks for help.
fn check(call: &Call) -> Result<(), String> {
    let mut arguments = call.arguments.clone();
    let said = |output: &Output| String::from_utf8_lossy(&output.stderr).into_owned();
    if !call.whole {
        arguments.push("--help".into());
        let output = truetwin(&arguments);
        return match output.status.success() {
            true => Ok(()),
            false => Err(said(&output)),
        };
    }
    match arguments.iter().position(|word| word == "--threads") {
        Some(at) => arguments[at + 1] = "0".into(),
        None => arguments.extend(["--threads".into(), "0".into()]),
    }
    let stderr = said(&truetwin(&arguments));
    match stderr.starts_with("error: --threads 0: choose") {
        true => Ok(()),
        false => Err(stderr),
    }
}

#[test]
fn every_call_is_taken() {
    let (mut checked, mut refused) = (0, vec![]);
    for page in pages() {
        for call in calls(&read(&page)) {
            checked += 1;
            if let Err(error) = check(&call) {
                let name = page.file_name().unwrap().to_string_lossy();
                refused.push(format!(
                    "{name}: truetwin {}\n  {error}",
                    call.arguments.join(" ")
                ));
            }
        }
    }
    assert!(refused.is_empty(), "{}", refused.join("\n"));
    assert!(checked > 80, "{checked}");
}

#[test]
fn a_wrong_call_is_seen() {
    let wrong = |line: &str, whole: bool| check(&call(line, whole).unwrap()).is_err();
    assert!(!wrong(
        "truetwin pretrain --twin tanks --out t.est # two minutes",
        true
    ));
    assert!(
        wrong("truetwin pretrain --twin tanks", true),
        "--out is missing"
    );
    assert!(!wrong("truetwin pretrain --twin T --seed S", false));
    assert!(wrong("truetwin pretrain --twins tanks", false));
    assert!(wrong("truetwin train", false));
    assert!(wrong("cargo run --release -- demo --outt demo", true));
    assert!(wrong("truetwin reproduce --twin tanks --runs many", false));
}

/// Verbs and options that `--help` knows, without those of every program.
fn options() -> Vec<String> {
    let help = |arguments: &[&str]| {
        let arguments: Vec<String> = arguments.iter().map(|word| (*word).into()).collect();
        String::from_utf8(truetwin(&arguments).stdout).unwrap()
    };
    let top = help(&["--help"]);
    let listed = top.split("Commands:").nth(1).unwrap();
    let verbs: Vec<String> = (listed.lines().skip(1))
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        .filter(|verb| verb != "help")
        .collect();
    assert!(verbs.len() > 10, "{top}");
    let mut options = vec![];
    for verb in &verbs {
        let text = help(&[verb, "--help"]);
        options.push(format!("truetwin {verb}"));
        let words = text
            .lines()
            .filter(|line| line.trim_start().starts_with('-'));
        options.extend(words.filter_map(|line| {
            let option = line
                .split_whitespace()
                .find(|word| word.starts_with("--"))?;
            Some(option.trim_end_matches(['.', ',']).to_owned())
        }));
    }
    options.sort();
    options.dedup();
    options
}

/// No verb and no option is without a word in the pages.
#[test]
fn every_option_is_told_of() {
    let all: String = pages().iter().map(|page| read(page)).collect();
    let told = |option: &String| all.contains(option.as_str());
    let untold: Vec<String> = (options().into_iter())
        .filter(|option| option != "--version" && !told(option))
        .collect();
    assert!(untold.is_empty(), "{}", untold.join(", "));
}
