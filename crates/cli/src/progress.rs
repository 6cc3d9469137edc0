//! A progress bar on a terminal, silence in a pipe, and Ctrl-C that keeps what is finished.

use indicatif::{ProgressBar, ProgressStyle};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The flag that Ctrl-C sets; a second Ctrl-C ends the program at once.
pub fn stop_flag() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    // a second handler in the same process is an error that changes nothing
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
        eprintln!("\nstopping: finished points are kept; press Ctrl-C again to stop at once");
    });
    stop
}

/// A bar over `points`; it draws nothing unless standard error is a terminal.
pub fn bar(points: u64, what: &str) -> ProgressBar {
    let bar = ProgressBar::new(points);
    if let Ok(style) = ProgressStyle::with_template("{msg:20} {bar:40} {pos}/{len} points, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(what.to_owned());
    bar
}
