//! Progress bars on standard error, on a terminal only.

use super::stop;
use crate::progress::{Listener, Progress};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A stage shows its bar once it has lasted this long.
const PATIENCE: Duration = Duration::from_millis(500);

/// Bars with the time left.
pub(super) fn bars() -> Progress {
    Progress::new(Arc::new(Bars::default()))
}

#[derive(Default)]
struct Bars {
    all: MultiProgress,
    open: Mutex<HashMap<String, (Instant, Option<ProgressBar>)>>,
}

impl Listener for Bars {
    fn cancelled(&self) -> bool {
        stop::asked()
    }

    fn advanced(&self, stage: &str, done: u64, total: u64) {
        // A poisoned lock means that a thread panicked; bars are not worth another panic.
        let Ok(mut open) = self.open.lock() else {
            return;
        };
        if done == 0 {
            open.insert(stage.into(), (Instant::now(), None));
            return;
        }
        let Some((since, bar)) = open.get_mut(stage) else {
            return;
        };
        if bar.is_none() && since.elapsed() >= PATIENCE && done < total {
            let style = ProgressStyle::with_template(
                "{prefix:>13} {bar:32} {pos}/{len}  {elapsed} gone, {eta} to go",
            );
            let new = self.all.add(ProgressBar::new(total));
            new.set_prefix(stage.to_owned());
            if let Ok(style) = style {
                new.set_style(style);
            }
            *bar = Some(new);
        }
        if let Some(bar) = bar {
            bar.set_position(done);
        }
        if done >= total
            && let Some((_, Some(bar))) = open.remove(stage)
        {
            bar.finish_and_clear();
        }
    }
}
