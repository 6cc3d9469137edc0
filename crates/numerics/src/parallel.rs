//! Independent computations on several threads, without the work stealing of a thread pool.
//!
//! A computation that holds a lock must not wait for tasks of a pool: its thread could begin
//! another task that waits for the same lock.

use crate::interrupt::{set_thread_flag, thread_flag};
use std::panic::resume_unwind;
use std::sync::{Mutex, PoisonError};

/// Returns `f` of every item, in their order, computed on up to `threads` threads. A
/// [`StopFlag`](crate::interrupt::StopFlag) of the caller ends all of them.
///
/// # Panics
/// Unwinds with the reason of an item that panics.
///
/// # Example
/// ```
/// use stickslip_numerics::parallel::map;
/// assert_eq!(map([1, 2, 3, 4, 5], 3, |x| x * x), [1, 4, 9, 16, 25]);
/// let mut list = [1, 2, 3];
/// map(&mut list, 2, |x| *x += 1);
/// assert_eq!(list, [2, 3, 4]);
/// ```
pub fn map<T: Send, R: Send>(items: impl IntoIterator<Item = T>, threads: usize, f: impl Fn(T) -> R + Sync) -> Vec<R> {
    let items: Vec<T> = items.into_iter().collect();
    let threads = threads.min(items.len());
    if threads < 2 {
        return items.into_iter().map(f).collect();
    }
    let queue = Mutex::new(items.into_iter().enumerate());
    let flag = thread_flag();
    let work = || {
        let mut own = Vec::new();
        loop {
            let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((index, item)) = next else { return own };
            own.push((index, f(item)));
        }
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let watched = || {
            set_thread_flag(flag.clone());
            work()
        };
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(watched)).collect();
        let mut all = work();
        for other in others {
            all.extend(other.join().unwrap_or_else(|reason| resume_unwind(reason)));
        }
        all
    });
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Returns `f` of every item of an array as [`map`] does.
///
/// # Panics
/// Unwinds with the reason of an item that panics.
pub fn map_array<T: Send, R: Send, const N: usize>(items: [T; N], threads: usize, f: impl Fn(T) -> R + Sync) -> [R; N] {
    let Ok(results) = map(items, threads, f).try_into() else { unreachable!("every item has a result") };
    results
}

/// Returns `f` of every item as [`map`] does.
///
/// # Errors
/// The error of the first item that has one; all items are computed.
///
/// # Panics
/// Unwinds with the reason of an item that panics.
pub fn try_map<T: Send, R: Send, E: Send>(
    items: impl IntoIterator<Item = T>,
    threads: usize,
    f: impl Fn(T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    map(items, threads, f).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interrupt::{Interrupted, StopFlag, check};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn the_flag_of_the_caller_ends_all_threads() {
        let stop = StopFlag::new();
        let work = |item: usize| {
            if item == 3 {
                stop.set();
            }
            loop {
                check();
                std::thread::yield_now();
            }
        };
        let ended = catch_unwind(AssertUnwindSafe(|| stop.watch(|| map(0..4usize, 4, |item| -> u8 { work(item) }))));
        assert_eq!(ended.unwrap_err().downcast_ref(), Some(&Interrupted));
    }

    #[test]
    fn a_panic_of_an_item_reaches_the_caller() {
        let ended = catch_unwind(|| map(0..8, 3, |item| assert!(item != 5, "item five")));
        assert!(ended.unwrap_err().downcast_ref() == Some(&"item five"));
    }
}
