//! Memory that a run may take.

/// Memory that a run may take unless it is told otherwise, bytes. What the machine has free may be less.
pub const MEMORY_LIMIT: u64 = 2_000_000_000;

/// What may be used when nobody says: [`MEMORY_LIMIT`], or what the machine has if that is less.
pub(crate) fn default_limit() -> u64 {
    MEMORY_LIMIT.min(available().unwrap_or(MEMORY_LIMIT))
}

/// Memory that the machine can give, where Linux tells it.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}
