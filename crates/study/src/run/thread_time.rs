//! Processor time of the current thread: other programs on a busy machine do not lengthen it.

use std::path::{Path, PathBuf};
use std::time::Duration;

/// A reading of the clock. Readings of different threads have nothing in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct ThreadTime(Duration);

impl ThreadTime {
    /// Reads the clock of this thread.
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    pub fn now() -> ThreadTime {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        ThreadTime(Duration::try_from(time).unwrap_or_default())
    }

    /// Reads a clock that does not stop while other programs run: this system offers no other one
    /// without unsafe code.
    #[cfg(not(any(target_os = "linux", target_os = "macos")))]
    pub fn now() -> ThreadTime {
        static BEGUN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        ThreadTime(BEGUN.get_or_init(std::time::Instant::now).elapsed())
    }

    /// Returns the time from an earlier reading, s.
    pub fn seconds_since(self, earlier: ThreadTime) -> f64 {
        self.0.saturating_sub(earlier.0).as_secs_f64()
    }
}

/// The processor time of a thread, for other threads. Linux tells it in a file.
#[derive(Debug, Clone)]
pub(super) struct ThreadClock {
    file: PathBuf,
}

impl ThreadClock {
    /// Returns the clock of this thread; `None` on systems without that file.
    pub fn of_this_thread() -> Option<ThreadClock> {
        let thread = std::fs::read_link("/proc/thread-self").ok()?;
        let clock = ThreadClock { file: Path::new("/proc").join(thread).join("schedstat") };
        clock.read().is_some().then_some(clock)
    }

    /// Returns the processor time; `None` after the end of the thread.
    pub fn read(&self) -> Option<Duration> {
        let text = std::fs::read_to_string(&self.file).ok()?;
        Some(Duration::from_nanos(text.split(' ').next()?.parse().ok()?))
    }
}

#[cfg(all(test, any(target_os = "linux", target_os = "macos")))]
mod tests {
    use super::*;
    use std::hint::black_box;
    use std::time::Instant;

    #[test]
    fn waiting_takes_no_processor_time_and_computing_does() {
        let (begun, thread) = (Instant::now(), ThreadTime::now());
        std::thread::sleep(Duration::from_millis(200));
        let waited = ThreadTime::now();
        assert!(waited.seconds_since(thread) < 0.05, "{}", waited.seconds_since(thread));
        while ThreadTime::now().seconds_since(waited) < 0.02 {
            black_box((0..1000).map(f64::from).sum::<f64>());
        }
        assert!(begun.elapsed().as_secs_f64() > 0.22);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn another_thread_reads_the_same_time() {
        let (clock, begun) = (ThreadClock::of_this_thread().unwrap(), ThreadTime::now());
        while ThreadTime::now().seconds_since(begun) < 0.1 {
            black_box((0..1000).map(f64::from).sum::<f64>());
        }
        let seen = std::thread::spawn(move || clock.read()).join().unwrap().unwrap().as_secs_f64();
        let own = ThreadTime::now().0.as_secs_f64();
        assert!((0.08..=own + 1e-6).contains(&seen), "{seen} {own}");
    }
}
