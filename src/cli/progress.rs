//! Progress bars on standard error, on a terminal only.

use super::stop;
use crate::progress::{Listener, Progress};
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

/// The time left is unknown before the first unit is done.
const FIRST: &str = "{prefix:>13} {bar:32} {pos}/{len}  {elapsed} elapsed";
const LATER: &str = "{prefix:>13} {bar:32} {pos}/{len}  {elapsed} elapsed, {eta} left";

/// Creates progress bars with the time left.
pub(super) fn bars() -> Progress {
    let bars = Arc::new(Bars::default());
    if stderr().is_terminal() {
        let watched = Arc::downgrade(&bars);
        // Without this thread, bars appear with the first unit.
        let _ = thread::Builder::new().spawn(move || watch(&watched));
    }
    Progress::new(bars)
}

fn watch(bars: &Weak<Bars>) {
    loop {
        thread::sleep(LOOK);
        match bars.upgrade() {
            Some(bars) => bars.show_what_lasts(),
            None => return,
        }
    }
}

#[derive(Default)]
struct Bars {
    all: MultiProgress,
    open: Mutex<HashMap<String, Open>>,
}

/// A running stage.
struct Open {
    since: Instant,
    done: u64,
    total: u64,
    bar: Option<ProgressBar>,
}

impl Open {
    /// Shows a bar once the stage has lasted long enough.
    fn show(&mut self, stage: &str, all: &MultiProgress) {
        if self.bar.is_some() || self.since.elapsed() < PATIENCE || self.done >= self.total {
            return;
        }
        // Complete before it is drawn: a bar that changes its template leaves its first picture behind.
        let bar = ProgressBar::with_draw_target(Some(self.total), ProgressDrawTarget::hidden())
            .with_elapsed(self.since.elapsed())
            .with_prefix(stage.to_owned())
            .with_position(self.done);
        self.style(&bar);
        let bar = all.add(bar);
        bar.enable_steady_tick(LOOK);
        self.bar = Some(bar);
    }

    fn style(&self, bar: &ProgressBar) {
        let template = if self.done == 0 { FIRST } else { LATER };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
    }
}

impl Bars {
    fn show_what_lasts(&self) {
        // A poisoned lock means that another thread panicked.
        if let Ok(mut open) = self.open.lock() {
            for (stage, entry) in open.iter_mut() {
                entry.show(stage, &self.all);
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
            let entry = Open {
                since: Instant::now(),
                done,
                total,
                bar: None,
            };
            open.insert(stage.into(), entry);
            return;
        }
        let Some(entry) = open.get_mut(stage) else {
            return;
        };
        let first = entry.done == 0;
        entry.done = done;
        entry.show(stage, &self.all);
        if let Some(bar) = &entry.bar {
            if first {
                entry.style(bar);
            }
            bar.set_position(done);
        }
        if done >= total
            && let Some(Open { bar: Some(bar), .. }) = open.remove(stage)
        {
            bar.finish_and_clear();
        }
    }
}
