//! Runs long work without the lock of the Python interpreter, with progress and interruption.
//!
//! Ctrl-C, or an exception in a law written in Python, ends the work at once. The stack of the
//! work unwinds, see [`stickslip_numerics::interrupt`], and its partial state is discarded.

use crate::error;
use pyo3::prelude::*;
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};
use stickslip_numerics::interrupt::{self, Interrupted, StopFlag};
use stickslip_study::run::Context;

/// Interval between progress reports, and between checks for Ctrl-C.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Supervision of a call.
pub struct Supervision {
    /// Number of threads. The default is that of the machine or of `RAYON_NUM_THREADS`.
    pub threads: Option<usize>,
    /// Receives the number of finished points and of all points (`None` if unknown).
    pub progress: Option<Py<PyAny>>,
    /// Number of all points.
    pub total: Option<u64>,
}

/// Runs short `work` on this thread.
pub fn run_here<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let raised: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let (begun, last_check) = (Instant::now(), AtomicU64::new(0));
    let slot = raised.clone();
    let stop = StopFlag::with_callback(move || {
        let now = begun.elapsed().as_millis() as u64;
        if now < last_check.load(Ordering::Relaxed) + POLL_INTERVAL.as_millis() as u64 {
            return false;
        }
        last_check.store(now, Ordering::Relaxed);
        let error = Python::attach(|py| py.check_signals()).err();
        let ends = error.is_some();
        *slot.lock().unwrap_or_else(PoisonError::into_inner) = error;
        ends
    });
    let outcome = py.detach(|| catch_unwind(AssertUnwindSafe(|| stop.watch(work))));
    outcome.map_err(|panic| ended(panic, raised.lock().unwrap_or_else(PoisonError::into_inner).take()))
}

/// The thread of some work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkThread {
    /// For short work: a new thread costs as much as an orbit of a small model.
    Caller,
    /// For work whose steps, such as a factorization of dense matrices, may take seconds.
    New,
}

/// Runs `work` on this thread or on a new one.
pub fn run_on<T: Send + 'static>(
    py: Python<'_>,
    thread: WorkThread,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    match thread {
        WorkThread::Caller => run_here(py, work),
        WorkThread::New => run_on_new_thread(py, work),
    }
}

/// Runs long `work` on a new thread, which Ctrl-C abandons if it does not end soon.
pub fn run_on_new_thread<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    let stop = StopFlag::new();
    let stop_flag = stop.clone();
    let receive = begin(py, move || catch_unwind(AssertUnwindSafe(|| stop_flag.watch(work))))?;
    outcome(py, receive, || py.check_signals(), || stop.set())
}

/// Starts `work` on a new thread.
fn begin<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<mpsc::Receiver<T>> {
    let (send, receive) = mpsc::channel();
    let spawned = std::thread::Builder::new().spawn(move || {
        // The result of an abandoned thread has no receiver.
        let _ = send.send(work());
    });
    spawned.map_err(|cause| error::exception(py, "StickslipError", format!("cannot create a thread: {cause}")))?;
    Ok(receive)
}

/// Waits for the outcome of work on another thread, and calls `poll` in every interval.
///
/// If `poll` fails, asks the work to `stop`, and abandons the work if it does not end soon.
fn outcome<T: Send>(
    py: Python<'_>,
    receive: mpsc::Receiver<std::thread::Result<T>>,
    mut poll: impl FnMut() -> PyResult<()>,
    stop: impl Fn(),
) -> PyResult<T> {
    let receive = Mutex::new(receive);
    let mut raised: Option<(PyErr, Instant)> = None;
    loop {
        let next = py.detach(|| receive.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(POLL_INTERVAL));
        match (next, raised.take()) {
            (Ok(outcome), None) => return outcome.map_err(|panic| ended(panic, None)),
            (Ok(_), Some((error, _))) => return Err(error),
            (Err(mpsc::RecvTimeoutError::Disconnected), _) => unreachable!("work always sends its outcome"),
            (Err(mpsc::RecvTimeoutError::Timeout), None) => {
                if let Err(error) = poll() {
                    stop();
                    raised = Some((error, Instant::now()));
                }
            }
            // A factorization of a large matrix cannot be interrupted.
            (Err(mpsc::RecvTimeoutError::Timeout), Some((error, since))) if since.elapsed().as_millis() > 500 => {
                return Err(error);
            }
            (Err(mpsc::RecvTimeoutError::Timeout), still) => raised = still,
        }
    }
}

/// Returns the exception that ended the work: that of a law, or that of Ctrl-C.
///
/// Any other panic is a bug and continues to unwind.
fn ended(panic: Box<dyn Any + Send>, interrupted: Option<PyErr>) -> PyErr {
    match (panic.downcast::<PyErr>(), interrupted) {
        (Ok(error), _) => *error,
        (Err(panic), Some(error)) if panic.is::<Interrupted>() => error,
        (Err(panic), _) => resume_unwind(panic),
    }
}

/// Process that first created threads; a forked process does not have them.
static PROCESS: OnceLock<u32> = OnceLock::new();
/// Idle thread pools by number of threads. Concurrent calls use different pools.
static POOLS: Mutex<BTreeMap<usize, Vec<rayon::ThreadPool>>> = Mutex::new(BTreeMap::new());

/// Threads in use by one call.
struct PoolLease {
    number: usize,
    pool: Option<rayon::ThreadPool>,
    /// Flag that ends their work.
    stop: StopFlag,
}

impl PoolLease {
    fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().unwrap_or_else(|| unreachable!("a pool is given back once"))
    }
}

impl Drop for PoolLease {
    fn drop(&mut self) {
        if self.stop.is_set() {
            return; // The threads may still be working.
        }
        let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        pools.entry(self.number).or_default().extend(self.pool.take());
    }
}

/// Returns threads for one call: the requested number, or that of the machine.
fn lease_pool(py: Python<'_>, threads: Option<usize>) -> PyResult<PoolLease> {
    // Maximum number of threads in a request.
    let most_threads: usize = 1024;
    let process = std::process::id();
    if *PROCESS.get_or_init(|| process) != process {
        let message = "this process was forked after Stickslip started its threads, which a fork does not \
                       inherit: start processes with multiprocessing's method \"spawn\" or \"forkserver\"";
        return Err(error::exception(py, "StickslipError", message.to_owned()));
    }
    let number = threads.unwrap_or(0);
    if threads == Some(0) || number > most_threads {
        let message = format!("threads must be a whole number from 1 to {most_threads}, found {number}");
        return Err(error::exception(py, "StickslipError", message));
    }
    let idle = POOLS.lock().unwrap_or_else(PoisonError::into_inner).get_mut(&number).and_then(Vec::pop);
    let pool = match idle {
        Some(pool) => pool,
        None => rayon::ThreadPoolBuilder::new()
            .num_threads(number)
            .build()
            .map_err(|cause| error::exception(py, "StickslipError", format!("cannot create threads: {cause}")))?,
    };
    let stop = StopFlag::new();
    pool.broadcast(|_| interrupt::set_thread_flag(Some(stop.clone())));
    Ok(PoolLease { number, pool: Some(pool), stop })
}

/// Runs `work` on the threads of a pool, reports progress, and lets Ctrl-C end the work.
pub fn run_supervised<T: Send + 'static>(
    py: Python<'_>,
    supervision: &Supervision,
    work: impl FnOnce(&Context) -> T + Send + 'static,
) -> PyResult<T> {
    let lease = lease_pool(py, supervision.threads)?;
    let (stop, done) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let counter = done.clone();
    let count = move || {
        counter.fetch_add(1, Ordering::Relaxed);
    };
    let context = Context {
        stop: stop.clone(),
        finished: Arc::new(count),
        ..Context::without_progress(lease.pool().current_num_threads())
    };
    let stop_flag = lease.stop.clone();
    let receive = begin(py, move || catch_unwind(AssertUnwindSafe(|| lease.pool().install(|| work(&context)))))?;
    let mut reported = None;
    let poll = || py.check_signals().and_then(|()| report_progress(py, supervision, &done, &mut reported));
    let end = || {
        stop.store(true, Ordering::Relaxed);
        stop_flag.set();
    };
    let found = outcome(py, receive, poll, end)?;
    py.check_signals()?;
    report_progress(py, supervision, &done, &mut reported)?;
    Ok(found)
}

fn report_progress(
    py: Python<'_>,
    supervision: &Supervision,
    done: &AtomicU64,
    reported: &mut Option<u64>,
) -> PyResult<()> {
    let now = done.load(Ordering::Relaxed);
    if let Some(progress) = supervision.progress.as_ref().filter(|_| *reported != Some(now)) {
        progress.call1(py, (now, supervision.total))?;
        *reported = Some(now);
    }
    Ok(())
}
