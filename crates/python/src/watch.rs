//! Long work: while Python's lock is free, with progress, and ended at once by Ctrl-C or by what a
//! law in Python raises.
//!
//! Work that is to end unwinds, see [`stickslip_numerics::interrupt`]: what it was changing is
//! lost.

use crate::error;
use pyo3::prelude::*;
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};
use stickslip_numerics::interrupt::{self, Interrupted, Stop};
use stickslip_study::run::Context;

/// How often progress is told and Ctrl-C looked for.
const LOOK: Duration = Duration::from_millis(50);
/// Most threads that may be asked for.
const MOST_THREADS: usize = 1024;

/// How a call is watched.
pub struct Watch {
    /// Threads that it may use; those of the machine, or of `RAYON_NUM_THREADS`, without it.
    pub threads: Option<usize>,
    /// Called with the points done and the points of all, `None` where that is not known before.
    pub progress: Option<Py<PyAny>>,
    /// Points of all.
    pub total: Option<u64>,
}

/// Does short `work` on this thread.
pub fn alone<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let raised: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let (begun, looked) = (Instant::now(), AtomicU64::new(0));
    let kept = raised.clone();
    let stop = Stop::asking(move || {
        let now = begun.elapsed().as_millis() as u64;
        if now < looked.load(Ordering::Relaxed) + LOOK.as_millis() as u64 {
            return false;
        }
        looked.store(now, Ordering::Relaxed);
        let error = Python::attach(|py| py.check_signals()).err();
        let ends = error.is_some();
        *kept.lock().unwrap_or_else(PoisonError::into_inner) = error;
        ends
    });
    let outcome = py.detach(|| catch_unwind(AssertUnwindSafe(|| stop.watch(work))));
    outcome.map_err(|panic| ended(panic, raised.lock().unwrap_or_else(PoisonError::into_inner).take()))
}

/// Does long `work` on a thread of its own, which Ctrl-C leaves behind where it cannot end at once.
pub fn apart<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    let stop = Stop::new();
    let (send, receive) = mpsc::channel();
    let watched = stop.clone();
    let spawned = std::thread::Builder::new().spawn(move || {
        // nobody listens any more if it was left behind
        let _ = send.send(catch_unwind(AssertUnwindSafe(|| watched.watch(work))));
    });
    spawned.map_err(|cause| error::exception(py, "StickslipError", format!("no thread: {cause}")))?;
    let receive = Mutex::new(receive);
    loop {
        let next = py.detach(|| receive.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
        match next {
            Ok(outcome) => return outcome.map_err(|panic| ended(panic, None)),
            Err(mpsc::RecvTimeoutError::Disconnected) => unreachable!("work always sends its outcome"),
            Err(mpsc::RecvTimeoutError::Timeout) => py.check_signals().inspect_err(|_| stop.set())?,
        }
    }
}

/// The exception that ended work: what a law raised, or what Ctrl-C did. Any other panic is a bug,
/// and goes on.
fn ended(panic: Box<dyn Any + Send>, interrupted: Option<PyErr>) -> PyErr {
    match (panic.downcast::<PyErr>(), interrupted) {
        (Ok(error), _) => *error,
        (Err(panic), Some(error)) if panic.is::<Interrupted>() => error,
        (Err(panic), _) => resume_unwind(panic),
    }
}

/// The process in which threads were first made: those of a fork are gone.
static PROCESS: OnceLock<u32> = OnceLock::new();
/// Pools that nobody uses, by their number of threads: calls beside each other have threads of their own.
static POOLS: Mutex<BTreeMap<usize, Vec<rayon::ThreadPool>>> = Mutex::new(BTreeMap::new());

/// Threads that are lent to one call.
struct Lent {
    number: usize,
    pool: Option<rayon::ThreadPool>,
    /// What ends their work.
    stop: Stop,
}

impl Lent {
    fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().unwrap_or_else(|| unreachable!("a pool is given back once"))
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if self.stop.is_set() {
            return; // they may still be at work
        }
        let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        pools.entry(self.number).or_default().extend(self.pool.take());
    }
}

/// Threads for one call: as many as asked for, or as the machine has.
fn lent(py: Python<'_>, threads: Option<usize>) -> PyResult<Lent> {
    let process = std::process::id();
    if *PROCESS.get_or_init(|| process) != process {
        let message = "this process was forked from one in which Stickslip had begun to work, and has none of its threads: \
                       start processes with multiprocessing's method \"spawn\" or \"forkserver\"";
        return Err(error::exception(py, "StickslipError", message.to_owned()));
    }
    let number = threads.unwrap_or(0);
    if threads == Some(0) || number > MOST_THREADS {
        let message = format!("threads must be a whole number from 1 to {MOST_THREADS}, found {number}");
        return Err(error::exception(py, "StickslipError", message));
    }
    let idle = POOLS.lock().unwrap_or_else(PoisonError::into_inner).get_mut(&number).and_then(Vec::pop);
    let pool = match idle {
        Some(pool) => pool,
        None => rayon::ThreadPoolBuilder::new()
            .num_threads(number)
            .build()
            .map_err(|cause| error::exception(py, "StickslipError", format!("no threads: {cause}")))?,
    };
    let stop = Stop::new();
    pool.broadcast(|_| interrupt::lend(Some(stop.clone())));
    Ok(Lent { number, pool: Some(pool), stop })
}

/// Does `work` on the threads of a pool. Meanwhile progress is told, and Ctrl-C ends the work.
pub fn watched<T: Send>(py: Python<'_>, watch: &Watch, work: impl FnOnce(&Context) -> T + Send) -> PyResult<T> {
    let lent = lent(py, watch.threads)?;
    let pool = lent.pool();
    let (stop, done) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let counter = done.clone();
    let count = move || {
        counter.fetch_add(1, Ordering::Relaxed);
    };
    let context =
        Context { stop: stop.clone(), finished: Arc::new(count), ..Context::unwatched(pool.current_num_threads()) };
    let (send, receive) = mpsc::channel();
    let receive = Mutex::new(receive);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let outcome = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(&context))));
            // who called waits for it, whatever happens
            let _ = send.send(outcome);
        });
        let mut wrong: Option<PyErr> = None;
        let mut told = None;
        let outcome = loop {
            let next = py.detach(|| receive.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
            match next {
                Ok(outcome) => break outcome,
                Err(mpsc::RecvTimeoutError::Disconnected) => unreachable!("work always sends its outcome"),
                Err(mpsc::RecvTimeoutError::Timeout) if wrong.is_some() => {}
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    let look = py.check_signals().and_then(|()| tell(py, watch, &done, &mut told));
                    if let Err(error) = look {
                        stop.store(true, Ordering::Relaxed);
                        lent.stop.set();
                        wrong = Some(error);
                    }
                }
            }
        };
        if let Some(error) = wrong {
            return Err(error);
        }
        let outcome = outcome.map_err(|panic| ended(panic, None))?;
        py.check_signals()?;
        tell(py, watch, &done, &mut told)?;
        Ok(outcome)
    })
}

fn tell(py: Python<'_>, watch: &Watch, done: &AtomicU64, told: &mut Option<u64>) -> PyResult<()> {
    let now = done.load(Ordering::Relaxed);
    if let Some(progress) = watch.progress.as_ref().filter(|_| *told != Some(now)) {
        progress.call1(py, (now, watch.total))?;
        *told = Some(now);
    }
    Ok(())
}
