//! The server under load: 200 requests per second for a minute from ten clients. One in five is
//! malformed, too large, without the token, or arrives slowly.
//!
//! ```sh
//! cargo test --release -p stickslip-explore --test it -- --ignored --nocapture load
//! ```

use super::server::{Answer, Page, events, read, study};
use std::io::Write;
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

/// Requests of a client and their answers.
#[derive(Debug, Default)]
struct Counts {
    results: usize,
    superseded: usize,
    refused: usize,
    busy: usize,
    others: Vec<u16>,
    longest: Duration,
}

/// Returns the resident memory of this process, bytes. Server and clients are one process.
pub(crate) fn memory() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    text.split(' ').nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap_or(0) * 4096
}

/// Sends request number `index` of a client and returns its answer; `None` if no answer is
/// awaited.
fn request(page: &Page, client: usize, index: usize) -> Option<Answer> {
    let own = ["HOST", "ORIGIN", "TOKEN"];
    match index % 20 {
        0 => Some(page.ask("POST /api/run", &own, "{\"client\": 7")),
        1 => Some(page.ask("POST /api/run", &own, &"x".repeat(600_000))),
        2 => Some(page.ask("GET /api/catalog", &["HOST"], "")),
        3 => {
            // half a request; the connection stays open for a second
            let mut half = page.connect();
            let _ = half.write_all(b"POST /api/run HTTP/1.1\r\nhost: ");
            thread::spawn(move || {
                thread::sleep(Duration::from_secs(1));
                drop(half);
            });
            None
        }
        4 => Some(page.ask("GET /api/catalog", &["HOST", "TOKEN"], "")),
        _ => Some(read(page.run(&study(&format!("client {client}"), 9 + (index % 7) as i64)))),
    }
}

#[test]
#[ignore = "takes a minute"]
fn the_server_bears_load_for_a_minute() {
    let page = Page::start();
    let (rate, time, clients) = (20.0, Duration::from_secs(60), 10);
    let all = Mutex::new(Counts::default());
    let begun = Instant::now();
    let samples = Mutex::new(Vec::new());
    thread::scope(|scope| {
        for client in 0..clients {
            let (page, all) = (&page, &all);
            scope.spawn(move || {
                for index in 0.. {
                    let due = begun + Duration::from_secs_f64(index as f64 / rate);
                    if due.duration_since(begun) > time {
                        return;
                    }
                    thread::sleep(due.saturating_duration_since(Instant::now()));
                    let sent = Instant::now();
                    let Some(answer) = request(page, client, index) else { continue };
                    let mut all = all.lock().unwrap();
                    all.longest = all.longest.max(sent.elapsed());
                    match answer.status {
                        200 => match events(&answer).pop() {
                            Some(event) if event["event"] == "superseded" => all.superseded += 1,
                            _ => all.results += 1,
                        },
                        400 | 401 | 413 | 0 => all.refused += 1,
                        429 | 503 => all.busy += 1,
                        other => all.others.push(other),
                    }
                }
            });
        }
        let samples = &samples;
        scope.spawn(move || {
            while begun.elapsed() < time {
                thread::sleep(Duration::from_secs(5));
                samples.lock().unwrap().push(memory() / 1_000_000);
            }
        });
    });
    let took = begun.elapsed();
    let counts = all.into_inner().unwrap();
    let after = Instant::now();
    let answer = read(page.run(&study("afterwards", 9)));
    let answered = after.elapsed();
    samples.lock().unwrap().push(memory() / 1_000_000);
    eprintln!("{counts:?} in {took:?}; memory every 5 s, MB: {samples:?}; afterwards an answer in {answered:?}");
    assert_eq!(events(&answer).last().unwrap()["event"], "result");
    assert!(counts.others.is_empty(), "{counts:?}");
    assert!(answered < Duration::from_secs(2), "{answered:?}");
    let samples = samples.into_inner().unwrap();
    let (early, late) = (samples[2], *samples.last().unwrap());
    assert!(late < early + 50, "memory grows from {early} to {late} MB");
}
