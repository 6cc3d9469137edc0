//! Messages on standard error: sentences for users, or one JSON object per line for programs.
//!
//! Every object has the key `event`:
//! - `begin`: a study, with the number of its `points` (null if unknown), its `units` of work,
//!   their range `from` and `to`, and the number of units `kept` from an earlier run.
//! - `progress`: finished `points`, units `kept` on disk and `elapsed_s`, at most twice a
//!   second.
//! - `written`: the `files`.
//! - `end`: the `status` (`done`, `some-failed`, `interrupted`) and the `points` by status.
//! - `message` and `error`: `text`.

use serde_json::{Value, json};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static JSON: AtomicBool = AtomicBool::new(false);

/// Switches to messages for programs.
pub fn for_programs() {
    JSON.store(true, Ordering::Relaxed);
}

/// Returns `true` if messages are for programs.
pub fn is_for_programs() -> bool {
    JSON.load(Ordering::Relaxed)
}

/// Prints a message. A closed pipe is not an error.
pub fn message(text: &str) {
    if is_for_programs() {
        return event("message", json!({ "text": text.trim() }));
    }
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Prints an error that ends the command.
pub fn error(text: &str) {
    if is_for_programs() {
        return event("error", json!({ "text": text.trim() }));
    }
    let _ = writeln!(std::io::stderr(), "error: {text}");
}

/// Prints an event if messages are for programs.
pub fn event(name: &str, mut value: Value) {
    if is_for_programs() {
        value["event"] = json!(name);
        // A single write keeps the lines of two threads separate.
        let _ = std::io::stderr().write_all(format!("{value}\n").as_bytes());
    }
}
