//! Interruption of long computations.
//!
//! A caller gives its thread a [`StopFlag`]. Loops call [`check`] between their
//! steps, and the stack unwinds once the flag is set. A thread without a
//! [`StopFlag`], which is the default, never unwinds. The unwinding discards the
//! unfinished result, so callers must drop state that spans an interruption.

use std::any::Any;
use std::cell::RefCell;
use std::fmt;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The payload of the unwinding when a computation is interrupted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

/// A flag that ends computations, shared by the caller and the threads that compute.
///
/// # Example
/// ```
/// use std::panic::{AssertUnwindSafe, catch_unwind};
/// use stickslip_numerics::interrupt::{Interrupted, StopFlag, check};
/// let stop = StopFlag::new();
/// assert_eq!(stop.watch(|| { check(); 3 }), 3);
/// stop.set();
/// let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| check()))).unwrap_err();
/// assert_eq!(ended.downcast_ref(), Some(&Interrupted));
/// check(); // the thread has no flag any more
/// ```
#[derive(Clone, Default)]
pub struct StopFlag(Arc<Inner>);

#[derive(Default)]
struct Inner {
    set: AtomicBool,
    /// A function called at every check in addition to the flag.
    callback: Option<Box<dyn Fn() -> bool + Send + Sync>>,
}

thread_local! {
    static THREAD_FLAG: RefCell<Option<StopFlag>> = const { RefCell::new(None) };
}

impl StopFlag {
    /// Creates a flag that is not set.
    pub fn new() -> StopFlag {
        StopFlag::default()
    }

    /// Creates a flag that is also set once `callback` returns true.
    ///
    /// Every check calls `callback`, on the thread that computes.
    pub fn with_callback(callback: impl Fn() -> bool + Send + Sync + 'static) -> StopFlag {
        StopFlag(Arc::new(Inner { set: AtomicBool::new(false), callback: Some(Box::new(callback)) }))
    }

    /// Sets the flag: the watched computations end at their next check.
    pub fn set(&self) {
        self.0.set.store(true, Ordering::Relaxed);
    }

    /// Returns true if the flag is set.
    pub fn is_set(&self) -> bool {
        self.0.set.load(Ordering::Relaxed)
    }

    /// Runs `work`, which this flag can end.
    ///
    /// # Panics
    /// Unwinds with [`Interrupted`] at the first [`check`] after the flag is
    /// set, or with the reason given to [`throw`].
    pub fn watch<T>(&self, work: impl FnOnce() -> T) -> T {
        let _guard = FlagGuard(THREAD_FLAG.replace(Some(self.clone())));
        work()
    }
}

impl fmt::Debug for StopFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StopFlag").field("set", &self.is_set()).finish_non_exhaustive()
    }
}

/// Returns the flag of this thread, for threads that receive work from it.
pub fn thread_flag() -> Option<StopFlag> {
    THREAD_FLAG.with_borrow(Clone::clone)
}

/// Sets or removes the flag of this thread, for threads that receive work from
/// others. The flag stays until the next call.
pub fn set_thread_flag(stop: Option<StopFlag>) {
    THREAD_FLAG.set(stop);
}

/// Restores the thread's former flag when dropped.
struct FlagGuard(Option<StopFlag>);

impl Drop for FlagGuard {
    fn drop(&mut self) {
        THREAD_FLAG.set(self.0.take());
    }
}

/// Unwinds if the flag of this thread is set.
#[inline]
pub fn check() {
    // Cloned, not borrowed: `callback` may run a computation that has a flag too.
    if let Some(stop) = thread_flag()
        && (stop.is_set() || stop.0.callback.as_ref().is_some_and(|callback| callback()))
    {
        stop.set();
        resume_unwind(Box::new(Interrupted));
    }
}

/// Ends the computation of this thread, and of all threads that share its flag, with a reason.
///
/// Returns normally if the thread has no flag.
pub fn throw(reason: Box<dyn Any + Send>) {
    if let Some(stop) = thread_flag() {
        stop.set();
        resume_unwind(reason);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn a_reason_ends_all_that_share_the_flag() {
        let stop = StopFlag::new();
        let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| throw(Box::new(7_u8))))).unwrap_err();
        assert_eq!(ended.downcast_ref(), Some(&7_u8));
        let other = stop.clone();
        let thread = std::thread::spawn(move || other.watch(check));
        assert_eq!(thread.join().unwrap_err().downcast_ref(), Some(&Interrupted));
    }

    #[test]
    fn callback_runs_until_it_returns_true() {
        let asked = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let count = asked.clone();
        let stop = StopFlag::with_callback(move || count.fetch_add(1, Ordering::Relaxed) == 2);
        let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| (0..9).for_each(|_| check()))));
        assert!(ended.is_err() && stop.is_set());
        assert_eq!(asked.load(Ordering::Relaxed), 3);
        // After the inner flag ends, the outer flag counts again.
        let (outer, inner) = (StopFlag::new(), StopFlag::new());
        outer.watch(|| {
            inner.watch(|| ());
            outer.set();
            assert!(catch_unwind(AssertUnwindSafe(check)).is_err());
        });
        check();
    }

    #[test]
    fn threads_without_a_flag_continue() {
        StopFlag::new().set();
        check();
        throw(Box::new("without a flag"));
    }
}
