//! The quick start, run as it is written.

use super::{Piece, pieces, read, root};
use std::fs;
use std::process::Command;

/// Numbers that depend on the machine and its load: those before a unit of time.
fn timeless(text: &str) -> String {
    let mut words: Vec<String> = vec![];
    for word in text.split_whitespace() {
        let unit = matches!(word.trim_end_matches(['.', ',', ';', ')']), "s" | "ms");
        if let Some(number) = words.last_mut().filter(|_| unit) {
            *number = "…".into();
        }
        words.push(word.into());
    }
    words.join(" ")
}

/// Calls and what is printed after them, as far as the page shows it. A line … stands for any number of lines; an output that starts
/// with `error:` is that of a call that fails, one that starts with `warning:` is on standard error.
fn shown(text: &str) -> Vec<(String, String)> {
    let mut steps: Vec<(String, String)> = vec![];
    for piece in pieces(text) {
        let Piece::Block { language, text } = piece else {
            continue;
        };
        if language == "toml" {
            // A file to be written, its name in the first line.
            let name = text.lines().next().and_then(|line| line.strip_prefix("# "));
            steps.push((format!("write {}", name.unwrap()), text));
            continue;
        }
        if language != "console" {
            continue;
        }
        for line in text.lines() {
            match (line.strip_prefix("$ "), steps.last_mut()) {
                (Some(call), _) => steps.push((call.into(), String::new())),
                (None, Some((_, printed))) => {
                    printed.push_str(line);
                    printed.push('\n');
                }
                (None, None) => panic!("{line}"),
            }
        }
    }
    steps
}

#[test]
fn the_quick_start_prints_what_it_shows() {
    let room = tempfile::tempdir().unwrap();
    let mut run = 0;
    for (call, shown) in shown(&read(&root().join("docs/quick-start.md"))) {
        if let Some(name) = call.strip_prefix("write ") {
            fs::write(room.path().join(name), shown).unwrap();
            continue;
        }
        if call.starts_with("awk ") {
            let mut shell = Command::new("sh");
            let status = shell.args(["-c", &call]).current_dir(room.path()).status();
            assert!(status.unwrap().success(), "{call}");
            continue;
        }
        let Some(arguments) = call.strip_prefix("truetwin ") else {
            // Getting, building and opening need a network, minutes or a screen.
            assert!(
                ["git ", "cd ", "cargo ", "export "]
                    .iter()
                    .any(|word| call.starts_with(word)),
                "{call}"
            );
            continue;
        };
        let arguments = shell_words::split(arguments.split(" #").next().unwrap()).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_truetwin"))
            .args(&arguments)
            .current_dir(room.path())
            .output()
            .unwrap();
        let messages = String::from_utf8(output.stderr).unwrap();
        // A call that is shown with an error is to fail with it.
        let refused = shown.starts_with("error: ");
        assert_eq!(output.status.success(), !refused, "{call}: {messages}");
        let printed = match refused || shown.starts_with("warning: ") {
            true => messages,
            false => String::from_utf8(output.stdout).unwrap(),
        };
        let printed = timeless(&printed);
        for part in format!("\n{shown}")
            .split("\n…\n")
            .map(timeless)
            .filter(|part| !part.is_empty())
        {
            assert!(
                printed.contains(&part),
                "{call}\nshown:   {part}\nprinted: {printed}"
            );
        }
        run += 1;
    }
    assert!(run >= 28, "{run}");
    for file in [
        "demo/overlay.svg",
        "result/estimate.json",
        "gap/report.html",
    ] {
        assert!(room.path().join(file).exists(), "{file}");
    }
}
