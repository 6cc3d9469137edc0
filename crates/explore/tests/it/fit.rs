//! Fits to measured data.

use serde_json::Value;
use std::path::{Path, PathBuf};
use stickslip_explore::answer::{Tables, answer};
use stickslip_explore::fit::FitTarget;
use stickslip_explore::view::{Range, View, ViewSettings, show};
use stickslip_study::run::{Context, run};
use stickslip_study::{Study, read_file, read_study};

/// The slip limit of the measured body, N.
pub const LIMIT: f64 = 1.4;

/// Writes a body with friction whose slip limit is 1 N, and the first harmonic that was measured
/// at [`LIMIT`], under the name of the body in micrometres; returns its study file.
pub fn rig(folder: &Path) -> PathBuf {
    let model = "schema = 1\n[parameters]\nFt = \"1 N\"        # slip limit\nk = \"10 N/mm\"     # stiffness\n\
        [[mass]]\nname = \"body\"\nmass = \"1 kg\"\n\
        [[spring]]\nbetween = [\"body\", \"ground\"]\nstiffness = \"k\"\ndamping = \"2 N s/m\"\n\
        [[joint]]\nname = \"foot\"\nbetween = [\"body\", \"ground\"]\n\
        law = { kind = \"jenkins\", stiffness = \"2 N/mm\", limit = \"Ft\" }\n\
        [[force]]\non = \"body\"\namplitude = \"2 N\"\n\
        [study]\nkind = \"response\"\nfrequency = { from = \"14 Hz\", to = \"19 Hz\", points = 21 }\npeaks = false\noutput = [\"harmonics\"]\n";
    let truth = model.replace("\"1 N\"", &format!("\"{LIMIT} N\""));
    let dataset = run(&read_study("truth.toml", &truth, &[]).unwrap(), &Context::without_progress(2)).unwrap();
    let column = |name: &str| dataset.tables[0].numbers(name).unwrap();
    let rows = column("frequency_Hz").iter().zip(column("body_harmonic1_m"));
    let rows: String = rows.map(|(frequency, amplitude)| format!("{frequency},{}\n", 1e6 * amplitude)).collect();
    std::fs::write(folder.join("rig.csv"), format!("frequency_Hz,body [um]\n{rows}")).unwrap();
    let file = folder.join("rig.toml");
    std::fs::write(&file, format!("{model}[[data]]\nname = \"rig\"\nfile = \"rig.csv\"\n")).unwrap();
    file
}

fn fitted(study: &Study) -> Value {
    answer(study, &run(study, &Context::without_progress(2)).unwrap(), Tables::Small, None)
}

#[test]
fn a_fit_finds_the_measured_slip_limit_in_the_unit_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = rig(folder.path());
    let text = std::fs::read_to_string(&file).unwrap();
    let target = FitTarget {
        data: "rig".into(),
        is: "response".into(),
        at: "body".into(),
        quantity: "displacement".into(),
        column: Some("body".into()),
    };
    let range = |name: &str, from: &str, to: &str| Range {
        name: name.into(),
        from: from.into(),
        to: to.into(),
        points: 2,
        log: true,
    };
    let parameters = vec![range("Ft", "0.1 N", "10 N"), range("k", "5 N/mm", "20 N/mm")];
    let view = View::Fit { target: target.clone(), parameters, starts: 0 };
    let mut document = text.parse().unwrap();
    show(&mut document, &view, &ViewSettings::default()).unwrap();
    let study = read_study(file.to_str().unwrap(), &document.to_string(), &[]).unwrap();
    assert_eq!(study.kind().name, "identify");
    let found = fitted(&study);
    let rows = &found["fitted"];
    for (row, (name, unit, exact)) in [("Ft", "N", LIMIT), ("k", "N/mm", 10.0)].into_iter().enumerate() {
        let [value, low, high] = ["value", "low", "high"].map(|key| rows[row][key].as_f64().unwrap());
        assert_eq!([&rows[row]["name"], &rows[row]["unit"]], [name, unit], "{rows}");
        assert!((value / exact - 1.0).abs() < 1e-5 && low <= value && value <= high, "{rows}");
    }
    // without parameters, and for data that do not exist
    let none = View::Fit { target: target.clone(), parameters: vec![], starts: 0 };
    assert!(show(&mut text.parse().unwrap(), &none, &ViewSettings::default()).is_err());
    let other = FitTarget { data: "other".into(), ..target };
    let other = View::Fit { target: other, parameters: vec![range("Ft", "0.1 N", "10 N")], starts: 0 };
    assert!(show(&mut text.parse().unwrap(), &other, &ViewSettings::default()).is_err());
    // a response has no fitted values
    assert!(fitted(&read_file(&file, &[]).unwrap())["fitted"].is_null());
}
