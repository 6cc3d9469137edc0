//! What the command says on standard error: sentences for people, or one JSON object a line for programs.
//!
//! Every object has `event`. `begin`: a study with its number of `points` (null where nobody knows it before), its `units` of work from `from` to
//! `to`, and how many of them are `kept` from an earlier run. `progress`: `points` finished, units that are `kept` on the disk, `elapsed_s`; at
//! most twice a second. `written`: the `files`. `end`: the `status` (`done`, `some-failed`, `interrupted`) and the `points` by status. `message`
//! and `error`: `text`.

use serde_json::{Value, json};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static JSON: AtomicBool = AtomicBool::new(false);

/// From now on for programs.
pub fn for_programs() {
    JSON.store(true, Ordering::Relaxed);
}

/// Whether programs listen.
pub fn is_for_programs() -> bool {
    JSON.load(Ordering::Relaxed)
}

/// A sentence. A reader that has gone away is no reason to end.
pub fn line(text: &str) {
    if is_for_programs() {
        return event("message", json!({ "text": text.trim() }));
    }
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// What ends the command.
pub fn error(text: &str) {
    if is_for_programs() {
        return event("error", json!({ "text": text.trim() }));
    }
    let _ = writeln!(std::io::stderr(), "error: {text}");
}

/// Something that programs want to know.
pub fn event(name: &str, mut value: Value) {
    if is_for_programs() {
        value["event"] = json!(name);
        // one write: lines of two threads do not mix
        let _ = std::io::stderr().write_all(format!("{value}\n").as_bytes());
    }
}
