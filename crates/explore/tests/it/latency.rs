//! Times in the browser, printed: from a slider to the new curve, to the first curve of a page,
//! bytes per curve, and memory while a slider moves.
//!
//! ```sh
//! cargo test --release -p stickslip-explore --test it -- --ignored --nocapture latency
//! ```

use super::browser::{CURVE, open};
use super::chromium::Browser;
use super::load::memory;
use serde_json::Value;
use std::time::Duration;
use stickslip_explore::Start;

/// Moves a slider to values that were not computed before and returns the times until the curve
/// is drawn, ms, in ascending order. The full curve of the last value ends before the next move.
fn slide(browser: &mut Browser, slider: &str, values: usize) -> Vec<f64> {
    let script = format!(
        "const moving = document.getElementById('{slider}'); const times = []; \
         for (let i = 0; i < {values}; i += 1) {{ \
           await new Promise((next) => setTimeout(next, 1500)); performance.clearMarks(); \
           const begun = performance.now(); moving.value = 300 + 7 * i; moving.dispatchEvent(new Event('input')); \
           await new Promise((drawn) => {{ const look = () => (performance.getEntriesByName('curve-drawn').length ? drawn() : setTimeout(look, 1)); look(); }}); \
           times.push(performance.getEntriesByName('curve-drawn')[0].startTime - begun); \
         }} times.map(Math.round)"
    );
    let mut times: Vec<f64> = browser.evaluate(&script).as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    times.sort_by(f64::total_cmp);
    times
}

fn describe(times: &[f64]) -> String {
    let at = |part: f64| times[((times.len() - 1) as f64 * part).round() as usize];
    format!("median {:.0} ms, 95 % {:.0} ms, longest {:.0} ms", at(0.5), at(0.95), at(1.0))
}

/// Returns the time from the navigation to the first curve, ms.
fn first_curve(browser: &mut Browser) -> f64 {
    browser.wait_long("performance.getEntriesByName('curve-drawn').length > 0");
    browser.number("performance.getEntriesByName('curve-drawn')[0].startTime")
}

#[test]
#[ignore = "measures times"]
fn latency_of_the_blade_couple() {
    let Some((server, mut browser)) = open(Start::Template("blade-couple".into())) else { return };
    let cold = first_curve(&mut browser);
    browser.go(server.address());
    std::thread::sleep(Duration::from_secs(1));
    let again = first_curve(&mut browser);
    eprintln!("first curve of Fig. 6 after {cold:.0} ms, again {again:.0} ms");
    browser.wait(CURVE);
    let times = slide(&mut browser, "q-parameters-kt-slider", 50);
    eprintln!("slider to the curve of Fig. 6, 50 values: {}", describe(&times));
    let bytes = browser.number(
        "performance.getEntriesByType('resource').filter((one) => one.name.endsWith('/api/run')).at(-1).transferSize",
    );
    eprintln!("bytes per curve of Fig. 6: {bytes:.0}");
}

#[test]
#[ignore = "measures times"]
fn latency_of_a_ring_of_24_blades() {
    let Some((_server, mut browser)) = open(Start::Template("bladed-ring".into())) else { return };
    eprintln!("first curves of the tuned ring after {:.0} ms", first_curve(&mut browser));
    let times = slide(&mut browser, "q-parameters-kt-slider", 20);
    eprintln!("slider to the curves of the tuned ring: {}", describe(&times));
    let text = stickslip_study::templates::find("bladed-ring").unwrap().study;
    let text =
        text.replace("sectors = \"N\"", "sectors = \"N\"\nmistuning = { of = \"k\", deviation = \"1 %\", seed = 1 }");
    let text = text.replace("Ft = [\"2.5 N\", \"5 N\", \"10 N\", \"20 N\"]", "Ft = [\"10 N\"]");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mistuned.toml");
    std::fs::write(&file, text).unwrap();
    let Some((server, mut browser)) = open(Start::File(file)) else { return };
    browser.wait_long(CURVE);
    browser.go(server.address());
    std::thread::sleep(Duration::from_secs(1));
    eprintln!("first curve of the mistuned ring after {:.0} ms", first_curve(&mut browser));
    browser.wait_long(CURVE);
    let whole = browser.number("performance.getEntriesByName('curve-drawn').at(-1).startTime");
    eprintln!("all 181 points after {whole:.0} ms");
    let times = slide(&mut browser, "q-parameters-kt-slider", 10);
    eprintln!("slider to a curve of the mistuned ring: {}", describe(&times));
}

#[test]
#[ignore = "takes ten minutes"]
fn latency_memory_while_a_slider_moves() {
    let Some((_server, mut browser)) = open(Start::Template("blade-couple".into())) else { return };
    browser.wait(CURVE);
    let drag = "const moving = document.getElementById('q-parameters-kt-slider'); const end = performance.now() + 30000; let i = 0; \
                while (performance.now() < end) { i += 1; moving.value = 500 + 300 * Math.sin(i / 40); moving.dispatchEvent(new Event('input')); await new Promise((next) => setTimeout(next, 16)); } \
                moving.dispatchEvent(new Event('change')); i";
    for half_minute in 1..=20 {
        let moves = browser.evaluate(drag);
        browser.forget_events();
        eprintln!(
            "after {} s and {moves} more moves: page {:.1} MB, server {} MB",
            30 * half_minute,
            browser.heap() / 1e6,
            memory() / 1_000_000
        );
    }
}
