//! A progress bar on a terminal, silence in a pipe, and Ctrl-C that keeps what is finished; SIGTERM and SIGHUP are like Ctrl-C.

use crate::args::Progress as Shown;
use crate::speak;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use serde_json::json;
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The flag that Ctrl-C sets; a second Ctrl-C ends the program at once.
pub fn stop_flag() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    let first = Mutex::new(None::<Instant>);
    // a second handler in the same process is an error that changes nothing
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            // some senders signal a process and then its group: that is one request
            let repeated = first.lock().is_ok_and(|first| first.is_some_and(|first| first.elapsed() < REPEATED));
            if !repeated {
                std::process::exit(1);
            }
            return;
        }
        if let Ok(mut first) = first.lock() {
            *first = Some(Instant::now());
        }
        complain!("\nstopping: finished parts are kept; Ctrl-C again ends at once");
    });
    stop
}

/// Signals closer than this to the first are the same request.
const REPEATED: Duration = Duration::from_millis(400);

/// Shows how a run goes on.
#[derive(Clone)]
pub enum Progress {
    /// On a terminal.
    Bar(ProgressBar),
    /// For programs: the study, its points so far, units that are kept, when it began, and when it was said last.
    Lines(Arc<Lines>),
    /// Not at all.
    Silent,
}

/// What programs are told.
pub struct Lines {
    study: String,
    points: AtomicU64,
    kept: AtomicU64,
    begun: Instant,
    said: Mutex<Instant>,
}

/// Programs are told no more often than this.
const SAID: Duration = Duration::from_millis(500);

impl Progress {
    /// Of a study with so many points, of which the first `done` are there.
    pub fn new(how: Shown, points: Option<u64>, done: u64, study: &str) -> Progress {
        match how {
            Shown::None => Progress::Silent,
            Shown::Bar => {
                let bar = bar(points, study);
                bar.inc(done);
                bar.reset_eta();
                Progress::Bar(bar)
            }
            Shown::Json => Progress::Lines(Arc::new(Lines {
                study: study.to_owned(),
                points: AtomicU64::new(done),
                kept: AtomicU64::new(0),
                begun: Instant::now(),
                said: Mutex::new(Instant::now()),
            })),
        }
    }

    /// A point is finished.
    pub fn point(&self) {
        match self {
            Progress::Bar(bar) => bar.inc(1),
            Progress::Lines(lines) => {
                lines.points.fetch_add(1, Ordering::Relaxed);
                // who finds it taken leaves the saying to the other
                if let Ok(mut said) = lines.said.try_lock()
                    && said.elapsed() >= SAID
                {
                    *said = Instant::now();
                    lines.say();
                }
            }
            Progress::Silent => {}
        }
    }

    /// So many units are on the disk.
    pub fn kept(&self, units: usize) {
        if let Progress::Lines(lines) = self {
            lines.kept.store(units as u64, Ordering::Relaxed);
        }
    }

    /// The end.
    pub fn end(&self) {
        match self {
            Progress::Bar(bar) => bar.finish_and_clear(),
            Progress::Lines(lines) => lines.say(),
            Progress::Silent => {}
        }
    }
}

impl Lines {
    fn say(&self) {
        speak::event(
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

/// A bar over `points`, or a count where their number is not known before; it draws nothing unless standard error is a terminal.
fn bar(points: Option<u64>, what: &str) -> ProgressBar {
    let bar = points.map_or_else(ProgressBar::no_length, ProgressBar::new);
    let template = match points {
        Some(_) => "{msg} {bar:24} {pos}/{len} points, {left}",
        None => "{msg} {pos} points, as many as the curve needs",
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.with_key("left", |state: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&left(state.pos(), state.len().unwrap_or(0), state.eta()));
        }));
    }
    bar.set_message(what.to_owned());
    // also while a point takes long: the estimate grows with the time that has gone by
    bar.enable_steady_tick(TICK);
    bar
}

/// How often the bar is drawn anew.
const TICK: Duration = Duration::from_millis(250);

/// What the bar says of the time that is left; never that none is left while there is work.
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
        assert_eq!(at(10, 0), "finishing"); // refined peaks, figures, files
    }
}
