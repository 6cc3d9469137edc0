//! Memory limit of a run.

/// Default memory limit of a run, bytes. The limit is lower if the machine has less free
/// memory.
pub const DEFAULT_MEMORY_LIMIT: u64 = 2_000_000_000;

/// Returns the default limit: [`DEFAULT_MEMORY_LIMIT`], or the machine's free memory if that is
/// less.
pub(crate) fn default_limit() -> u64 {
    DEFAULT_MEMORY_LIMIT.min(available_memory().unwrap_or(DEFAULT_MEMORY_LIMIT))
}

/// Returns the available memory of the machine, bytes; `None` if the system is not Linux.
fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}
