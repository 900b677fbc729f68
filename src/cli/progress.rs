//! Progress on standard error: bars on a terminal, a line now and then in a log.

use super::failure::say;
use super::stop;
use crate::progress::{Listener, Progress};
use crate::setting::number;
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::HashMap;
use std::io::{IsTerminal, stderr};
use std::sync::{Arc, Mutex, Weak};
use std::thread;
use std::time::{Duration, Instant};

/// Time after which a stage gets its bar.
const PATIENCE: Duration = Duration::from_millis(500);
/// Refresh interval; one unit of a stage may take long.
const LOOK: Duration = Duration::from_millis(250);
/// Interval of the lines in a log: an hour fills two pages.
const LINES: Duration = Duration::from_secs(30);

/// The time left is unknown before the first unit is done.
const FIRST: &str = "{prefix:>13} {bar:32} {pos}/{len}  {elapsed} elapsed";
const LATER: &str = "{prefix:>13} {bar:32} {pos}/{len}  {elapsed} elapsed, {eta} left";

/// Creates progress bars with the time left, or lines where there is no terminal.
pub(super) fn bars() -> Progress {
    let bars = Arc::new(Bars {
        terminal: stderr().is_terminal(),
        all: MultiProgress::default(),
        open: Mutex::default(),
    });
    let watched = Arc::downgrade(&bars);
    // Without this thread nothing is shown; the work goes on.
    let _ = thread::Builder::new().spawn(move || watch(&watched));
    Progress::new(bars)
}

fn watch(bars: &Weak<Bars>) {
    loop {
        thread::sleep(LOOK);
        match bars.upgrade() {
            Some(bars) => bars.show(),
            None => return,
        }
    }
}

struct Bars {
    terminal: bool,
    all: MultiProgress,
    open: Mutex<HashMap<String, Open>>,
}

/// A running stage.
struct Open {
    since: Instant,
    done: u64,
    total: u64,
    bar: Option<ProgressBar>,
    /// Lines in a log so far.
    lines: u32,
}

impl Open {
    fn new(total: u64) -> Self {
        Self {
            since: Instant::now(),
            done: 0,
            total,
            bar: None,
            lines: 0,
        }
    }

    /// Draws the bar of a stage that has lasted long enough.
    fn draw(&mut self, stage: &str, all: &MultiProgress) {
        if self.since.elapsed() < PATIENCE || self.done >= self.total {
            return;
        }
        let template = if self.done == 0 { FIRST } else { LATER };
        let style = ProgressStyle::with_template(template);
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = self.bar.take().unwrap_or_else(|| {
            // Complete before it is drawn: a bar that changes its template leaves its first picture behind.
            let bar = ProgressBar::with_draw_target(Some(self.total), ProgressDrawTarget::hidden());
            let bar = bar.with_elapsed(self.since.elapsed());
            all.add(bar.with_prefix(stage.to_owned()).with_style(style.clone()))
        });
        bar.set_style(style);
        bar.set_position(self.done);
        bar.tick();
        self.bar = Some(bar);
    }

    /// The next line of a log, once it is time.
    fn line(&mut self, stage: &str) -> Option<String> {
        let elapsed = self.since.elapsed();
        if elapsed < LINES * (self.lines + 1) {
            return None;
        }
        self.lines = (elapsed.as_secs() / LINES.as_secs()) as u32;
        let [done, total] = [self.done, self.total].map(|n| number(n as f64));
        Some(format!(
            "{stage}: {done} of {total} done, {} s elapsed",
            elapsed.as_secs()
        ))
    }
}

impl Bars {
    fn show(&self) {
        // A poisoned lock means that another thread panicked.
        let Ok(mut open) = self.open.lock() else {
            return;
        };
        for (stage, entry) in open.iter_mut() {
            if self.terminal {
                entry.draw(stage, &self.all);
            } else if let Some(line) = entry.line(stage) {
                say(&line);
            }
        }
    }
}

impl Drop for Bars {
    /// Clears the bars of failed stages before the error message.
    fn drop(&mut self) {
        let _ = self.all.clear();
    }
}

impl Listener for Bars {
    fn cancelled(&self) -> bool {
        stop::asked()
    }

    fn advanced(&self, stage: &str, done: u64, total: u64) {
        let Ok(mut open) = self.open.lock() else {
            return;
        };
        if done == 0 {
            open.insert(stage.into(), Open::new(total));
        } else if done >= total {
            if let Some(Open { bar: Some(bar), .. }) = open.remove(stage) {
                bar.finish_and_clear();
            }
        } else if let Some(entry) = open.get_mut(stage) {
            entry.done = done;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log gets a line each half minute, and not one for each missed.
    #[test]
    fn lines_come_now_and_then() {
        let mut open = Open::new(5);
        open.done = 2;
        assert_eq!(open.line("explain"), None);
        let Some(earlier) = open.since.checked_sub(Duration::from_secs(95)) else {
            return;
        };
        open.since = earlier;
        let line = open.line("explain").unwrap();
        assert_eq!(line, "explain: 2 of 5 done, 95 s elapsed");
        assert_eq!(open.line("explain"), None);
    }
}
