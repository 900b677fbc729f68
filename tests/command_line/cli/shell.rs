//! The command line at home in a shell: completions, manual pages, and what `--help` teaches.

use super::{done, json, refused, truetwin};
use std::fs;
use std::process::Command;

/// The verbs that `--help` lists.
fn verbs() -> Vec<String> {
    let help = done(&["--help"]);
    let list = help.split("Commands:").nth(1).unwrap();
    let list = list.split("\n\n").next().unwrap();
    let names = list.lines().filter_map(|line| {
        let line = line.strip_prefix("  ")?;
        (!line.starts_with(' ')).then(|| line.split_whitespace().next().map(str::to_owned))?
    });
    names.filter(|name| name != "help").collect()
}

/// The long options that a verb's `--help` lists.
fn options(verb: &str) -> Vec<String> {
    let help = done(&[verb, "--help"]);
    let lines = help.lines().map(str::trim_start);
    let options = lines.filter_map(|line| {
        let at = match line.starts_with('-') {
            true => line.find("--")?,
            false => return None,
        };
        let name: String = (line[at + 2..].chars())
            .take_while(|c| c.is_alphanumeric() || *c == '-')
            .collect();
        (!name.is_empty()).then_some(name)
    });
    options.collect()
}

#[test]
fn scripts_complete_every_verb_and_the_names_of_twins() {
    let verbs = verbs();
    assert!(verbs.len() >= 15, "{verbs:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = done(&["completions", shell]);
        for word in verbs.iter().map(String::as_str).chain(["validation"]) {
            assert!(script.contains(word), "{shell}: no {word}");
        }
        // Scripts of the other two complete no values.
        let values = ["bash", "zsh", "fish"].contains(&shell);
        assert!(!values || script.contains("van-der-pol"), "{shell}");
    }
    assert_eq!(json(&["completions", "fish", "--json"])["shell"], "fish");
    refused(&["completions", "tcsh"], &["tcsh", "bash"]);
}

/// A shell reads the script; then it knows what may follow.
#[test]
fn bash_takes_its_script() {
    let Ok(version) = Command::new("bash").arg("--version").output() else {
        println!("skipped: no bash");
        return;
    };
    assert!(version.status.success());
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("truetwin.bash");
    fs::write(&script, done(&["completions", "bash"])).unwrap();
    let checked = Command::new("bash")
        .arg("-n")
        .arg(&script)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&checked.stderr).into_owned();
    assert!(checked.status.success() && said.is_empty(), "{said}");
    let ask = "source \"$1\"; COMP_WORDS=(truetwin check --twin ''); COMP_CWORD=3; \
               _truetwin truetwin '' --twin; printf '%s\\n' \"${COMPREPLY[@]}\"";
    let answer = (Command::new("bash").args(["-c", ask, "bash"]))
        .arg(&script)
        .output()
        .unwrap();
    let offered = String::from_utf8(answer.stdout).unwrap();
    assert_eq!(offered, "van-der-pol\ntanks\n");
}

#[test]
fn the_manual_has_every_verb_and_every_option() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("man1");
    let place = place.to_str().unwrap();
    let said = done(&["man", "--out", place]);
    let verbs = verbs();
    assert!(
        said.contains(&format!("{} pages", verbs.len() + 1)),
        "{said}"
    );
    let page = |name: &str| {
        let text = fs::read_to_string(format!("{place}/{name}.1")).unwrap();
        text.replace("\\-", "-")
    };
    let whole = page("truetwin");
    for verb in &verbs {
        assert!(whole.contains(&format!("truetwin-{verb}(1)")), "{verb}");
        let text = page(&format!("truetwin-{verb}"));
        assert!(text.contains(".TH"), "{verb}");
        for option in options(verb) {
            assert!(
                text.contains(&format!("--{option}")),
                "{verb}: no --{option}"
            );
        }
    }
    assert!(
        options("estimate")
            .iter()
            .any(|option| option == "validation")
    );
    assert_eq!(
        done(&["man", "estimate"]).replace("\\-", "-"),
        page("truetwin-estimate")
    );
    assert_eq!(done(&["man"]).replace("\\-", "-"), whole);
    refused(&["man", "--out", place], &[place, "exists already"]);
    refused(&["man", "guess"], &["guess", "estimate"]);
    assert_eq!(json(&["man", "bank", "--json"])["page"], "truetwin-bank");
}

/// Each verb tells a newcomer its purpose, a call to copy, and its exit codes.
#[test]
fn every_help_has_a_purpose_an_example_and_exit_codes() {
    let whole = done(&["--help"]);
    assert!(whole.contains("Exit codes: 0 done; 2 ") && whole.contains("truetwin demo"));
    for verb in verbs() {
        let help = done(&[&verb, "--help"]);
        let purpose = help.lines().next().unwrap();
        assert!(
            purpose.len() > 20 && !purpose.starts_with("Usage"),
            "{verb}: {purpose}"
        );
        assert!(help.contains("Usage: truetwin "), "{verb}");
        let call = format!("truetwin {verb}");
        assert!(
            help.matches(&call).count() >= 2,
            "{verb} shows no call to copy"
        );
        assert!(help.contains("Exit codes: "), "{verb} tells no exit codes");
    }
}

/// Bars are for people: a file or a pipe gets none, a terminal gets one with the time that is left.
#[test]
fn bars_are_shown_on_a_terminal_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let bank = |out: &str| {
        [
            "bank",
            "--twin",
            "van-der-pol",
            "--preset",
            "paper",
            "--size",
            "150000",
            "--threads",
            "1",
            "--out",
            out,
        ]
        .map(str::to_owned)
    };
    let call = bank(&at("quiet"));
    let words: Vec<&str> = call.iter().map(String::as_str).collect();
    let quiet = truetwin(&words[..]);
    assert!(quiet.status.success());
    // A line comes every half minute, no bar.
    let said = String::from_utf8_lossy(&quiet.stderr);
    assert!(!said.contains(['\r', '\x1b', '█']), "{said}");
    let program = env!("CARGO_BIN_EXE_truetwin");
    let call = format!("{program} {} 2>&1 >/dev/null", bank(&at("shown")).join(" "));
    let shown = (Command::new("script"))
        .args(["-q", "-e", "-c", &call, "/dev/null"])
        .env("TERM", "xterm")
        .output();
    match shown {
        Err(_) => println!("skipped: no script"),
        Ok(shown) => {
            let text = String::from_utf8_lossy(&shown.stdout).into_owned();
            assert!(shown.status.success(), "{text}");
            assert!(text.contains("bank") && text.contains(" left"), "{text}");
        }
    }
}
