//! The server's part of the time from a slider to a new figure: the changed text is read,
//! checked, run and drawn. Fig. 6 of the paper has four curves with 964 exact orbits.

use divan::Bencher;
use stickslip_explore::answer::{Tables, answer};
use stickslip_explore::change::{Change, NewValue, changed};
use stickslip_explore::quantities::path;
use stickslip_explore::view::{View, ViewSettings, show};
use stickslip_study::read_study;
use stickslip_study::run::{Context, check};

fn main() {
    divan::main();
}

/// A new figure for a contact stiffness that was not computed before; with 964 or 244 orbits.
#[divan::bench(args = [241, 61])]
fn new_figure_6(bencher: Bencher, points: i64) {
    let text = stickslip_study::templates::find("blade-couple").unwrap().study;
    let view = View::Study { points: Some(points), output: Vec::new(), references: true, scale: None, panels: None };
    let mut stiffness = 8000.0;
    bencher
        .with_inputs(|| {
            stiffness += 7.0;
            Change { path: path("parameters.kt"), value: NewValue::Text(format!("{stiffness} N/m")) }
        })
        .bench_local_values(|change| {
            let mut document = changed(text, &[change]).unwrap();
            show(&mut document, &view, &ViewSettings::default()).unwrap();
            let study = read_study("couple.toml", &document.to_string(), &[]).unwrap();
            let dataset = check(&study).unwrap().run(&Context::without_progress(2)).unwrap();
            answer(&study, &dataset, Tables::Small, None).to_string()
        });
}
