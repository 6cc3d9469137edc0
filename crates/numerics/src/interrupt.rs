//! Interruption of long computations: a caller that may want them to end lends its thread a
//! [`Stop`], loops [`check`] it between their steps, and the stack unwinds when it is set.
//!
//! Threads without a [`Stop`], which is all of them unless a caller asks, never unwind. What was
//! being computed is lost: whoever keeps state across an interruption drops it.

use std::any::Any;
use std::cell::RefCell;
use std::fmt;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the stack unwinds with when a computation is interrupted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

/// A flag that ends computations, shared by the caller and the threads that compute.
///
/// # Example
/// ```
/// use std::panic::{AssertUnwindSafe, catch_unwind};
/// use stickslip_numerics::interrupt::{Interrupted, Stop, check};
/// let stop = Stop::new();
/// assert_eq!(stop.watch(|| { check(); 3 }), 3);
/// stop.set();
/// let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| check()))).unwrap_err();
/// assert_eq!(ended.downcast_ref(), Some(&Interrupted));
/// check(); // nobody watches any more
/// ```
#[derive(Clone, Default)]
pub struct Stop(Arc<Inner>);

#[derive(Default)]
struct Inner {
    set: AtomicBool,
    /// Asked at every check besides the flag.
    ask: Option<Box<dyn Fn() -> bool + Send + Sync>>,
}

thread_local! {
    static WATCHED: RefCell<Option<Stop>> = const { RefCell::new(None) };
}

impl Stop {
    /// A flag that is not set.
    pub fn new() -> Stop {
        Stop::default()
    }

    /// A flag that is also set once `ask` says so; it is asked at every check, on the thread that
    /// computes.
    pub fn asking(ask: impl Fn() -> bool + Send + Sync + 'static) -> Stop {
        Stop(Arc::new(Inner { set: AtomicBool::new(false), ask: Some(Box::new(ask)) }))
    }

    /// Ends what is watched at its next check.
    pub fn set(&self) {
        self.0.set.store(true, Ordering::Relaxed);
    }

    /// Whether it was set.
    pub fn is_set(&self) -> bool {
        self.0.set.load(Ordering::Relaxed)
    }

    /// Does `work`, which this flag ends.
    ///
    /// # Panics
    /// Unwinds with [`Interrupted`] at the first [`check`] after the flag was set, and with what
    /// [`throw`] was given.
    pub fn watch<T>(&self, work: impl FnOnce() -> T) -> T {
        let _lent = Lent(WATCHED.replace(Some(self.clone())));
        work()
    }
}

impl fmt::Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stop").field("set", &self.is_set()).finish_non_exhaustive()
    }
}

/// Lends this thread a flag until it is lent another one or none: for threads that others give work
/// to.
pub fn lend(stop: Option<Stop>) {
    WATCHED.set(stop);
}

/// Gives the thread back what it was watched by before.
struct Lent(Option<Stop>);

impl Drop for Lent {
    fn drop(&mut self) {
        WATCHED.set(self.0.take());
    }
}

/// Unwinds if the computation of this thread is to end.
#[inline]
pub fn check() {
    // not borrowed while it asks: the answer may come from a computation that is watched itself
    if let Some(stop) = WATCHED.with_borrow(Clone::clone)
        && (stop.is_set() || stop.0.ask.as_ref().is_some_and(|ask| ask()))
    {
        stop.set();
        resume_unwind(Box::new(Interrupted));
    }
}

/// Ends the computation of this thread, and of all that share its flag, with a reason. Returns
/// where nobody watches.
pub fn throw(reason: Box<dyn Any + Send>) {
    let watched = WATCHED.with_borrow(Clone::clone);
    if let Some(stop) = watched {
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
        let stop = Stop::new();
        let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| throw(Box::new(7_u8))))).unwrap_err();
        assert_eq!(ended.downcast_ref(), Some(&7_u8));
        let other = stop.clone();
        let thread = std::thread::spawn(move || other.watch(check));
        assert_eq!(thread.join().unwrap_err().downcast_ref(), Some(&Interrupted));
    }

    #[test]
    fn a_question_is_asked_until_it_is_answered_with_yes() {
        let asked = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let count = asked.clone();
        let stop = Stop::asking(move || count.fetch_add(1, Ordering::Relaxed) == 2);
        let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| (0..9).for_each(|_| check()))));
        assert!(ended.is_err() && stop.is_set());
        assert_eq!(asked.load(Ordering::Relaxed), 3);
        // the flag outside counts again behind the one inside
        let (outer, inner) = (Stop::new(), Stop::new());
        outer.watch(|| {
            inner.watch(|| ());
            outer.set();
            assert!(catch_unwind(AssertUnwindSafe(check)).is_err());
        });
        check();
    }

    #[test]
    fn what_nobody_watches_goes_on() {
        Stop::new().set();
        check();
        throw(Box::new("nobody hears it"));
    }
}
