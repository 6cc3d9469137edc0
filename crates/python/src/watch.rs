//! Long work: on threads of Rust, while Python's lock is free, with progress and Ctrl-C.

use crate::error;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::Duration;
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

/// The process in which threads were first made: those of a fork are gone.
static PROCESS: OnceLock<u32> = OnceLock::new();
/// Pools that nobody uses, by their number of threads: calls beside each other have threads of their own.
static POOLS: Mutex<BTreeMap<usize, Vec<rayon::ThreadPool>>> = Mutex::new(BTreeMap::new());

/// Threads that are lent to one call.
struct Lent {
    number: usize,
    pool: Option<rayon::ThreadPool>,
}

impl Lent {
    fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().unwrap_or_else(|| unreachable!("a pool is given back once"))
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
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
    Ok(Lent { number, pool: Some(pool) })
}

/// Does `work` on the threads of a pool. Meanwhile progress is told and Ctrl-C stops the work, which then has as long to end as it needs for
/// the orbits that are under way.
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
                        wrong = Some(error);
                    }
                }
            }
        };
        if let Some(error) = wrong {
            return Err(error);
        }
        let outcome = outcome.unwrap_or_else(|panic| resume_unwind(panic));
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
