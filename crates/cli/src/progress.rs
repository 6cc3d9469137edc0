//! Progress display and interruption.
//!
//! A terminal shows a progress bar, a pipe shows nothing. Ctrl-C stops the run and keeps the
//! finished points, as do SIGTERM and SIGHUP.

use crate::args::Progress;
use crate::messages;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use serde_json::json;
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Returns the flag that Ctrl-C sets. A second Ctrl-C ends the program at once.
pub fn stop_flag() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    let first = Mutex::new(None::<Instant>);
    // Installing a second handler in the same process fails without any effect.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            // Some senders signal a process and then its group, which counts as one request.
            let repeated =
                first.lock().is_ok_and(|first| first.is_some_and(|first| first.elapsed() < SAME_SIGNAL_TIME));
            if !repeated {
                std::process::exit(1);
            }
            return;
        }
        if let Ok(mut first) = first.lock() {
            *first = Some(Instant::now());
        }
        complain!("\nstopping: finished points are kept; press Ctrl-C again to end at once");
    });
    stop
}

/// Signals within this time after the first are the same request.
const SAME_SIGNAL_TIME: Duration = Duration::from_millis(400);

/// Display of the progress of a run.
#[derive(Clone)]
pub enum ProgressDisplay {
    /// A bar on a terminal.
    Bar(ProgressBar),
    /// JSON lines for programs.
    Json(Arc<JsonProgress>),
    /// No display.
    Silent,
}

/// State of the JSON lines.
pub struct JsonProgress {
    study: String,
    points: AtomicU64,
    kept: AtomicU64,
    begun: Instant,
    last_line: Mutex<Instant>,
}

/// Minimum time between two progress lines.
const LINE_INTERVAL: Duration = Duration::from_millis(500);

impl ProgressDisplay {
    /// Starts the display for a study with `points` points, of which `done` are finished.
    pub fn new(how: Progress, points: Option<u64>, done: u64, study: &str) -> ProgressDisplay {
        match how {
            Progress::None => ProgressDisplay::Silent,
            Progress::Bar => {
                let bar = bar(points, study);
                bar.inc(done);
                bar.reset_eta();
                ProgressDisplay::Bar(bar)
            }
            Progress::Json => ProgressDisplay::Json(Arc::new(JsonProgress {
                study: study.to_owned(),
                points: AtomicU64::new(done),
                kept: AtomicU64::new(0),
                begun: Instant::now(),
                last_line: Mutex::new(Instant::now()),
            })),
        }
    }

    /// Counts a finished point.
    pub fn point(&self) {
        match self {
            ProgressDisplay::Bar(bar) => bar.inc(1),
            ProgressDisplay::Json(lines) => {
                lines.points.fetch_add(1, Ordering::Relaxed);
                // If another thread holds the lock, it prints the line.
                if let Ok(mut last_line) = lines.last_line.try_lock()
                    && last_line.elapsed() >= LINE_INTERVAL
                {
                    *last_line = Instant::now();
                    lines.say();
                }
            }
            ProgressDisplay::Silent => {}
        }
    }

    /// Sets the number of units on disk.
    pub fn kept(&self, units: usize) {
        if let ProgressDisplay::Json(lines) = self {
            lines.kept.store(units as u64, Ordering::Relaxed);
        }
    }

    /// Ends the display.
    pub fn end(&self) {
        match self {
            ProgressDisplay::Bar(bar) => bar.finish_and_clear(),
            ProgressDisplay::Json(lines) => lines.say(),
            ProgressDisplay::Silent => {}
        }
    }
}

impl JsonProgress {
    fn say(&self) {
        messages::event(
            "progress",
            json!({
                "study": self.study,
                "points": self.points.load(Ordering::Relaxed),
                "kept": self.kept.load(Ordering::Relaxed),
                "elapsed_s": self.begun.elapsed().as_secs_f64(),
            }),
        );
    }
}

/// Returns a bar over `points`, or a counter if their number is unknown.
///
/// It draws only if standard error is a terminal.
fn bar(points: Option<u64>, what: &str) -> ProgressBar {
    let bar = points.map_or_else(ProgressBar::no_length, ProgressBar::new);
    let template = match points {
        Some(_) => "{msg} {bar:24} {pos}/{len} points, {left}",
        None => "{msg} {pos} points (the total depends on the curve)",
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.with_key("left", |state: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&left(state.pos(), state.len().unwrap_or(0), state.eta()));
        }));
    }
    bar.set_message(what.to_owned());
    // Redraws also during a long point, because the estimate grows with the elapsed time.
    bar.enable_steady_tick(TICK);
    bar
}

/// Interval between redraws of the bar.
const TICK: Duration = Duration::from_millis(250);

/// Returns the text about the remaining time, which is never zero while there is work.
fn left(done: u64, all: u64, estimate: Duration) -> String {
    match (done, estimate.as_secs()) {
        (0, _) => "no estimate yet".to_owned(),
        _ if done >= all => "finishing".to_owned(),
        (_, 0) => "less than 1s left".to_owned(),
        _ => format!("about {} left", HumanDuration(estimate)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_work_is_left_in_no_time() {
        let at = |done, milliseconds| left(done, 10, Duration::from_millis(milliseconds));
        assert_eq!(at(0, 0), "no estimate yet");
        assert_eq!(at(5, 0), "less than 1s left");
        assert_eq!(at(5, 999), "less than 1s left");
        assert_eq!(at(9, 3_000), "about 3 seconds left");
        // Refining peaks and writing figures and files still remain.
        assert_eq!(at(10, 0), "finishing");
    }
}
