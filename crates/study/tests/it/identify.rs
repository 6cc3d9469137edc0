//! Identification from made data: known parameters come back, with errors that hold, and what the
//! data do not determine is said.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;
use stickslip_study::dataset::{Dataset, Table};
use stickslip_study::results::fitted_study;
use stickslip_study::run::{Context, run};
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, read_file, read_study};

/// Normally distributed numbers: the sum of twelve uniform ones of a linear congruential generator
/// (Knuth, MMIX).
pub(super) struct Noise(pub u64);

impl Noise {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Writes data and study into a folder and runs the study.
pub(super) fn identify_in(folder: &Path, data: &str, study: &str) -> (Study, Dataset) {
    std::fs::write(folder.join("data.csv"), data).expect("the data");
    let file = folder.join("study.toml");
    std::fs::write(&file, study).expect("the study");
    let study = read_file(&file, &[]).unwrap_or_else(|error| panic!("{error}"));
    let dataset = run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{error}"));
    (study, dataset)
}

fn identify(data: &str, study: &str) -> Dataset {
    identify_in(tempfile::tempdir().expect("a folder").path(), data, study).1
}

fn table<'d>(dataset: &'d Dataset, name: &str) -> &'d Table {
    let found = dataset.tables.iter().find(|table| table.name == name);
    found.unwrap_or_else(|| panic!("no {name}: {:?} {:?}", dataset.failures, dataset.notes))
}

/// A fitted parameter: value, standard error, ends of the interval, status.
pub(super) struct Estimate {
    pub value: f64,
    error: f64,
    pub low: f64,
    pub high: f64,
    pub status: String,
}

pub(super) fn estimate(dataset: &Dataset, name: &str) -> Estimate {
    let table = table(dataset, "parameters");
    let row = table.texts("parameter").expect("names").iter().position(|own| own == name).expect(name);
    let number = |column: &str| table.numbers(column).expect(column)[row];
    let status = table.texts("status").expect("the status")[row].clone();
    Estimate {
        value: number("value"),
        error: number("standard_error"),
        low: number("low_95"),
        high: number("high_95"),
        status,
    }
}

/// Force of a spring parallel to a Jenkins element under displacements of growing amplitude.
fn loops(spring: f64, stiffness: f64, limit: f64, largest: f64) -> Vec<(f64, f64)> {
    let (mut held, mut before) = (0.0f64, 0.0);
    (1..=300)
        .map(|i| {
            let t = f64::from(i) / 100.0;
            let u = largest * (0.4 + 0.2 * t) * (TAU * t).sin();
            held = (held + stiffness * (u - before)).clamp(-limit, limit);
            before = u;
            (u, held + spring * u)
        })
        .collect()
}

fn csv(head: &str, rows: impl IntoIterator<Item = Vec<f64>>) -> String {
    let mut text = format!("{head}\n");
    for row in rows {
        let _ = writeln!(text, "{}", row.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    }
    text
}

/// A study of a loop, whose start is a factor of ten away from the truth.
fn loop_study(extra: &str) -> String {
    format!(
        "schema = 1\n[[data]]\nname = \"rig\"\nfile = \"data.csv\"\n\
         [parameters]\nkt = \"1e5 N/m\"   # a comment stays\nFt = \"0.2 N\"\nk = \"1e2 N/m\"\n\
         [[mass]]\nname = \"slider\"\nmass = \"1 kg\"\n\
         [[spring]]\nbetween = [\"slider\", \"ground\"]\nstiffness = \"k\"\n\
         [[joint]]\nname = \"pad\"\nbetween = [\"slider\", \"ground\"]\nlaw = {{ kind = \"jenkins\", stiffness = \"kt\", limit = \"Ft\" }}\n\
         [study]\nkind = \"identify\"\n\
         fit.kt = {{ from = \"1e2 N/m\", to = \"1e6 N/m\", scale = \"log\" }}\n\
         fit.Ft = {{ from = \"0.02 N\", to = \"200 N\", scale = \"log\" }}\n\
         fit.k = {{ from = \"10 N/m\", to = \"1e5 N/m\", scale = \"log\" }}\n\
         targets = [{{ data = \"rig\", is = \"loop\", at = \"pad\"{extra} }}]\n"
    )
}

#[test]
fn a_loop_gives_its_parameters_and_a_study_file() {
    let mut noise = Noise(7);
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f + 0.02 * noise.normal()]);
    let dataset = identify(&csv("displacement_m,force_N", rows), &loop_study(", weight = \"0.02 N\""));
    for (name, truth) in [("kt", 1e4), ("Ft", 2.0), ("k", 1e3)] {
        let found = estimate(&dataset, name);
        assert_eq!(found.status, "determined");
        assert!((found.value - truth).abs() < 4.0 * found.error, "{name}: {} ± {}", found.value, found.error);
        assert!(found.error < 0.01 * truth && found.low < found.value && found.value < found.high, "{name}");
    }
    let summary = table(&dataset, "fit_summary");
    let rms = summary.numbers("rms_residual").expect("the residual")[0];
    assert!((rms - 1.0).abs() < 0.15, "{rms}");
    assert!(summary.numbers("autocorrelation").expect("a number")[0].abs() < 0.2);
    // the band of the fitted loop is far narrower than the noise
    let fit = table(&dataset, "fit");
    let width =
        fit.numbers("fitted_high_95").expect("the band")[100] - fit.numbers("fitted_low_95").expect("the band")[100];
    assert!(width > 0.0 && width < 0.02, "{width}");
    let text = fitted_study(&dataset).expect("a study file");
    assert!(text.contains("N/m\"   # a comment stays"), "{text}");
    assert_eq!(dataset.figure.panels.len(), 1);
}

/// A coefficient of friction and a normal load act only by their product.
/// Each group of loops begins unloaded, also after a group that ends in slip.
#[test]
fn groups_of_loops_are_records_of_their_own() {
    let (spring, stiffness, limit) = (2e3, 1e5, 3.0);
    let row = |group: f64| move |(u, force): (f64, f64)| vec![u, force, group];
    let first = loops(spring, stiffness, limit, 2e-4).into_iter().map(row(1.0));
    let second = loops(spring, stiffness, limit, 1e-4).into_iter().map(row(2.0));
    let dataset = identify(&csv("displacement_m,force_N,group", first.chain(second)), &loop_study(""));
    for (name, truth) in [("k", spring), ("kt", stiffness), ("Ft", limit)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < 1e-6, "{name}: {}", found.value);
    }
}

#[test]
fn undetermined_parameters_are_named() {
    let mut noise = Noise(3);
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f + 0.02 * noise.normal()]);
    let study = loop_study("").replace("Ft = \"0.2 N\"", "Ft = \"mu*N0\"\nmu = 0.1\nN0 = \"5 N\"").replace(
        "fit.Ft = { from = \"0.02 N\", to = \"200 N\", scale = \"log\" }",
        "fit.mu = { from = 0.001, to = 10, scale = \"log\" }\nfit.N0 = { from = \"0.1 N\", to = \"1 kN\", scale = \"log\" }",
    );
    let dataset = identify(&csv("displacement_m,force_N", rows), &study);
    for name in ["mu", "N0"] {
        let found = estimate(&dataset, name);
        assert!(
            found.status == "not-determined" && found.error.is_nan(),
            "{name}: {} {:?}",
            found.status,
            dataset.notes
        );
    }
    assert!((estimate(&dataset, "mu").value * estimate(&dataset, "N0").value - 2.0).abs() < 0.02);
    assert!(
        (estimate(&dataset, "kt").value / 1e4 - 1.0).abs() < 0.02 && estimate(&dataset, "kt").status == "determined"
    );
    let notes = dataset.notes.join("\n");
    assert!(notes.contains("do not determine `mu` and `N0` separately"), "{notes}");
    assert!(notes.contains("`mu` raised by 1.00 % with `N0` lowered by 1.00 %"), "{notes}");
}

/// The 95 % intervals contain the true value in 95 % of the cases.
#[test]
fn intervals_contain_the_truth() {
    let mut noise = Noise(11);
    let (mut inside, mut all) = (0, 0);
    for _ in 0..120 {
        let kt = 1e4 * 10f64.powf(noise.uniform() - 0.5);
        let limit = kt * 1e-4 * (1.0 + 3.0 * noise.uniform());
        let k = kt * (0.05 + 0.3 * noise.uniform());
        let rows = loops(k, kt, limit, 1e-3);
        let largest = rows.iter().fold(0.0f64, |most, row| most.max(row.1));
        let rows = rows.into_iter().map(|(u, f)| vec![u, f + 0.05 * largest * noise.normal()]).collect::<Vec<_>>();
        let dataset = identify(&csv("displacement_m,force_N", rows), &loop_study(""));
        for (name, truth) in [("kt", kt), ("Ft", limit), ("k", k)] {
            let found = estimate(&dataset, name);
            all += 1;
            inside += usize::from(found.low <= truth && truth <= found.high);
        }
    }
    let share = inside as f64 / f64::from(all);
    // 360 intervals: 95 % with a standard deviation of 1.1 %
    assert!((0.92..=0.98).contains(&share), "{share}");
}

/// A loss that limits outliers has intervals that contain the true value in 95 % of the cases, and
/// hardly wider ones than squares without outliers.
#[test]
fn intervals_contain_the_truth_in_spite_of_outliers() {
    let (k, kt, limit) = (1e3, 1e4, 2.0);
    let deviation = 0.05;
    let fitted = |loss: &str, outliers: f64, noise: &mut Noise| {
        let rows = loops(k, kt, limit, 1e-3).into_iter().map(|(u, f)| {
            let outlier = if noise.uniform() < outliers { 100.0 } else { 0.0 };
            vec![u, f + deviation * noise.normal() + outlier]
        });
        let rows: Vec<_> = rows.collect();
        let study = loop_study(&format!(", weight = \"{deviation} N\"")) + &format!("loss = \"{loss}\"\n");
        identify(&csv("displacement_m,force_N", rows), &study)
    };
    let usual = estimate(&fitted("squares", 0.0, &mut Noise(2)), "kt").error;
    for loss in ["soft-l1", "huber", "cauchy"] {
        let mut noise = Noise(5);
        let (mut inside, mut all) = (0, 0);
        for _ in 0..40 {
            let dataset = fitted(loss, 0.03, &mut noise);
            for (name, truth) in [("kt", kt), ("Ft", limit), ("k", k)] {
                let found = estimate(&dataset, name);
                all += 1;
                inside += i32::from(found.low <= truth && truth <= found.high);
            }
            let error = estimate(&dataset, "kt").error;
            assert!((0.8..1.6).contains(&(error / usual)), "{loss}: {error} instead of about {usual}");
        }
        let share = f64::from(inside) / f64::from(all);
        // 120 intervals: 95 % with a standard deviation of 2 %
        assert!((0.90..=0.99).contains(&share), "{loss}: {share}");
    }
}

/// Study of an oscillator with one fitted spring and damper.
fn oscillator(targets: &str, more: &str) -> String {
    format!(
        "schema = 1\n[[data]]\nname = \"test\"\nfile = \"data.csv\"\n\
         [parameters]\nk = \"1e3 N/m\"\nc = \"0.1 kg/s\"\nx0 = \"1 mm\"\n\
         [[mass]]\nname = \"m\"\nmass = \"2 kg\"\n\
         [[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"k\"\ndamping = \"c\"\n{more}\
         [study]\nkind = \"identify\"\n{targets}\n"
    )
}

const FORCE: &str = "[[force]]\non = \"m\"\namplitude = \"1 N\"\nphase = \"30 deg\"\n";
const FIT: &str = "fit.k = { from = \"1e2 N/m\", to = \"1e6 N/m\", scale = \"log\" }\n\
    fit.c = { from = \"1e-2 kg/s\", to = \"1e3 kg/s\", scale = \"log\" }\n";

/// Each row has its own force; the phase is that of the displacement, the amplitude that of the
/// acceleration.
#[test]
fn a_response_with_the_force_of_each_row() {
    let (m, k, c): (f64, f64, f64) = (2.0, 2e4, 3.0);
    let rows = (0..60).map(|i| {
        let f = 10.0 + 0.2 * f64::from(i);
        let (omega, force) = (TAU * f, 1.0 + 0.5 * f64::from(i % 7));
        let (re, im) = (k - omega * omega * m, omega * c);
        let displacement = force / re.hypot(im);
        vec![f, force, omega * omega * displacement, (-im).atan2(re)]
    });
    let targets = format!(
        "{FIT}targets = [{{ data = \"test\", is = \"response\", at = \"m\", quantity = \"acceleration\", phase_of = \
         \"displacement\", weight = \"relative 1 %\" }}]"
    );
    let dataset =
        identify(&csv("frequency_Hz,force_N,response_m_per_s2,phase_rad", rows), &oscillator(&targets, FORCE));
    for (name, truth) in [("k", k), ("c", c)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < 1e-6, "{name}: {}", found.value);
    }
}

/// Values in µm of a column without unit are read in m.
#[test]
fn a_wrong_unit_is_named() {
    let (m, k, c): (f64, f64, f64) = (2.0, 2e4, 3.0);
    let rows = (0..40).map(|i| {
        let omega = TAU * (10.0 + 0.3 * f64::from(i));
        vec![omega / TAU, 1.0, 1e6 / (k - omega * omega * m).hypot(omega * c)]
    });
    let targets = "fit.k = { from = \"1e4 N/m\", to = \"1e5 N/m\" }\nfit.c = { from = \"1 kg/s\", to = \"10 kg/s\" }\n\
                   targets = [{ data = \"test\", is = \"response\", at = \"m\" }]";
    let data = csv("frequency_Hz,force_N,response", rows);
    let dataset = identify(&data, &oscillator(targets, FORCE));
    let said = dataset.notes.iter().cloned().chain(dataset.failures.iter().map(|failure| failure.reason.clone()));
    let said: Vec<String> = said.collect();
    assert!(said.iter().any(|text| text.contains("times the computed ones: check the units")), "{said:?}");
}

#[test]
fn a_ring_down_with_an_unknown_start() {
    let (m, k, c, x0): (f64, f64, f64, f64) = (2.0, 2e4, 3.0, 2.5e-3);
    let (decay, omega) = (c / (2.0 * m), (k / m - (c / (2.0 * m)).powi(2)).sqrt());
    let rows = (0..400).map(|i| {
        let t = 2e-3 * f64::from(i);
        vec![3.0 + t, x0 * (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin())]
    });
    let targets = format!(
        "{FIT}fit.x0 = {{ from = \"0.1 mm\", to = \"10 mm\" }}\nstart = {{ m = \"x0\" }}\n\
         targets = [{{ data = \"test\", is = \"ring-down\", at = \"m\" }}]"
    );
    let dataset = identify(&csv("time_s,response_m", rows), &oscillator(&targets, ""));
    for (name, truth) in [("k", k), ("c", c), ("x0", x0)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < 1e-5, "{name}: {}", found.value);
    }
}

/// Free decay of the oscillator from a displacement and a velocity: closed form.
fn decay(t: f64, [k, c]: [f64; 2], displacement: f64, velocity: f64) -> f64 {
    let (m, rate) = (2.0, c / 4.0);
    let omega = (k / m - rate * rate).sqrt();
    (-rate * t).exp()
        * (displacement * (omega * t).cos() + (velocity + rate * displacement) / omega * (omega * t).sin())
}

/// Three records of one test: pulled, struck, and the one that is predicted.
#[test]
fn every_ring_down_has_its_own_start() {
    let truth = [2e4, 3.0];
    let rows = [(2.5e-3, 0.0), (0.0, 0.3), (1e-3, 0.1)].into_iter().enumerate().flat_map(|(record, (x0, v0))| {
        (0..200).map(move |i| {
            let t = 2e-3 * f64::from(i);
            vec![record as f64 + 1.0, t, decay(t, truth, x0, v0)]
        })
    });
    let targets = format!(
        "{FIT}fit.x0 = {{ from = \"0.1 mm\", to = \"10 mm\" }}\nstart = {{ m = \"x0\" }}\ntargets = [\n\
         {{ data = \"test\", is = \"ring-down\", at = \"m\", groups = 1 }},\n\
         {{ data = \"test\", is = \"ring-down\", at = \"m\", groups = 2, start = {{ m = 0 }}, \
         start_velocity = {{ m = \"0.3 m/s\" }} }},\n\
         {{ data = \"test\", is = \"ring-down\", at = \"m\", groups = 3, start = {{ m = \"0.4*x0\" }}, \
         start_velocity = {{ m = \"0.1 m/s\" }}, predict = true }}]"
    );
    let dataset = identify(&csv("group,time_s,response_m", rows), &oscillator(&targets, ""));
    for (name, truth) in [("k", truth[0]), ("c", truth[1]), ("x0", 2.5e-3)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < 1e-5, "{name}: {}", found.value);
    }
    let targets = table(&dataset, "fit_targets");
    assert_eq!(targets.texts("use").expect("uses"), ["fit", "fit", "prediction"]);
    assert_eq!(targets.integers("rows").expect("rows"), [200; 3]);
    let (measured, fitted) = (targets.numbers("measured_largest"), targets.numbers("fitted_largest"));
    for (measured, fitted) in measured.expect("measured").iter().zip(fitted.expect("fitted")) {
        assert!((fitted / measured - 1.0).abs() < 1e-4, "{fitted} {measured}");
    }
    assert!(targets.numbers("relative_deviation").expect("deviations").iter().all(|found| *found < 1e-4));
}

#[test]
fn a_ring_down_with_the_wrong_sign_or_unit_is_named() {
    for (factor, words) in [(-1.0, "opposite sign"), (1e3, "about 1e3 times")] {
        let rows = (0..400).map(|i| {
            let t = 2e-3 * f64::from(i);
            vec![t, factor * decay(t, [2e4, 3.0], 1e-3, 0.0)]
        });
        let targets =
            format!("{FIT}start = {{ m = \"x0\" }}\ntargets = [{{ data = \"test\", is = \"ring-down\", at = \"m\" }}]");
        let dataset = identify(&csv("time_s,response_m", rows), &oscillator(&targets, ""));
        let said = dataset.notes.iter().cloned().chain(dataset.failures.iter().map(|failure| failure.reason.clone()));
        let said: Vec<String> = said.collect();
        assert!(said.iter().any(|text| text.contains(words)), "{factor}: {said:?}");
    }
}

/// An exact fit of as many rows as parameters is no evidence for the model.
#[test]
fn rows_without_one_to_spare_have_the_errors_of_their_weight() {
    let targets = "fit.k = { from = \"1e3 N/m\", to = \"1e5 N/m\" }\ntargets = [{ data = \"test\", is = \"response\", \
                   at = \"m\", weight = \"relative 2 %\" }]";
    let data = csv("frequency_Hz,force_N,response_m", [vec![1.0, 1.0, 1.0 / 2e4]]);
    let dataset = identify(&data, &oscillator(targets, FORCE));
    let (found, omega) = (estimate(&dataset, "k"), TAU);
    // |X| = F/|k - 2 ω² + 0.1 i ω|
    let truth = 2.0 * omega * omega + (4e8 - (0.1 * omega).powi(2)).sqrt();
    assert!((found.value / truth - 1.0).abs() < 1e-6, "{}", found.value);
    // d|X|/|X| = -dk (k - 2 ω²)/|k - 2 ω² + 0.1 i ω|², 2 % of |X|
    let error = 0.02 * 4e8 / (truth - 2.0 * omega * omega);
    assert!((found.error / error - 1.0).abs() < 1e-4, "{} {error}", found.error);
    let warned = |text: &String| text.contains("1 measured number for 1 parameter: no row is left to test the model");
    assert!(dataset.notes.iter().any(warned), "{:?}", dataset.notes);
}

#[test]
fn a_column_of_another_quantity_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("data.csv"), "time_s,response_m_per_s2\n0,1\n1,0.5\n2,0.2\n").expect("the data");
    let targets =
        format!("{FIT}start = {{ m = \"x0\" }}\ntargets = [{{ data = \"test\", is = \"ring-down\", at = \"m\" }}]");
    let name = folder.path().join("study.toml").display().to_string();
    let error = read_study(&name, &oscillator(&targets, ""), &[]).map(|_| ()).unwrap_err();
    let help = "add quantity = \"acceleration\" to the target";
    assert!(error.help_text().is_some_and(|found| found.contains(help)), "{error}");
}

/// The velocity of one point does not determine the motion of its body: it is refused before the
/// run, as in a transient.
#[test]
fn the_most_unequal_step_of_a_ring_down_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let targets =
        format!("{FIT}start = {{ m = \"x0\" }}\ntargets = [{{ data = \"test\", is = \"ring-down\", at = \"m\" }}]");
    let name = folder.path().join("study.toml").display().to_string();
    let rows = "time_s,response_m\n0,1\n0.001,0.5\n0.002,0.2\n0.009,-0.1\n0.01,-0.2\n";
    std::fs::write(folder.path().join("data.csv"), rows).expect("the data");
    let error = read_study(&name, &oscillator(&targets, ""), &[]).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("equal steps: 7 ms from row 3 to row 4, usually 1 ms"), "{error}");
}

#[test]
fn phases_in_degrees_need_their_unit() {
    let folder = tempfile::tempdir().expect("a folder");
    let targets = format!("{FIT}targets = [{{ data = \"test\", is = \"response\", at = \"m\" }}]");
    let name = folder.path().join("study.toml").display().to_string();
    for (title, is_refused) in [("phase", true), ("phase_deg", false)] {
        let rows = format!("frequency_Hz,force_N,response_m,{title}\n10,1,1e-3,-4\n11,1,2e-3,-90\n12,1,1e-3,-176\n");
        std::fs::write(folder.path().join("data.csv"), rows).expect("the data");
        let error = read_study(&name, &oscillator(&targets, FORCE), &[]).err();
        assert_eq!(error.is_some(), is_refused, "{error:?}");
        if let Some(error) = error {
            let said = format!("{error} {}", error.help_text().unwrap_or_default());
            assert!(said.contains("reaches 176 without a unit") && said.contains("phase_deg"), "{said}");
        }
    }
}

#[test]
fn a_place_has_no_start_velocity() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("data.csv"), "time_s,response_m\n0,1\n1,0.5\n2,0.2\n").expect("the data");
    let bar = "[[body]]\nname = \"bar\"\nmass = \"1 kg\"\ninertia = \"0.01 kg m^2\"\ndirections = [\"x\", \"z\"]\n\
               [[spring]]\nbetween = [\"bar.z\", \"m\"]\nstiffness = \"1 N/mm\"\n\
               [[place]]\nname = \"tip\"\nof = \"bar\"\noffset = [\"0.1 m\", 0, 0]\n";
    let targets = format!(
        "{FIT}start_velocity = {{ \"tip.z\" = \"1 m/s\" }}\n\
         targets = [{{ data = \"test\", is = \"ring-down\", at = \"m\" }}]"
    );
    let name = folder.path().join("study.toml").display().to_string();
    let error = read_study(&name, &oscillator(&targets, bar), &[]).map(|_| ()).unwrap_err();
    assert_eq!(error.key(), Some("start_velocity"), "{error}");
    assert!(error.message().contains("the place `tip.z` alone does not determine the motion"), "{error}");
}

/// Backbone of a hardening spring: `ω² = k/m + 3/4 b a²/m` to first order.
#[test]
fn a_backbone_of_a_hardening_spring() {
    let (m, k, b): (f64, f64, f64) = (2.0, 2e4, 3e7);
    let rows = (0..15).map(|i| {
        let a = 1e-4 * 10f64.powf(f64::from(i) / 20.0);
        let omega2 = k / m + 0.75 * b * a * a / m;
        vec![a, omega2.sqrt() / TAU]
    });
    let joint =
        "[[joint]]\nname = \"hard\"\nbetween = [\"m\", \"ground\"]\nlaw = { kind = \"cubic\", stiffness = \"b\" }\n";
    let targets = "fit.k = { from = \"1e3 N/m\", to = \"1e6 N/m\", scale = \"log\" }\n\
        fit.b = { from = \"1e5 N/m^3\", to = \"1e9 N/m^3\", scale = \"log\" }\n\
        targets = [{ data = \"test\", is = \"backbone\", at = \"m\", weight = \"relative 0.01 %\" }]";
    let study = oscillator(targets, joint).replace("x0 = \"1 mm\"", "b = \"1e6 N/m^3\"");
    let dataset = identify(&csv("amplitude_m,frequency_Hz", rows), &study);
    for (name, truth, tolerance) in [("k", k, 1e-5), ("b", b, 1e-2)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < tolerance, "{name}: {}", found.value);
    }
}

/// Frequency and damping of a Jenkins element beside a stiff spring, by its describing function: the
/// damping has a kink where the element begins to slip, between rows.
#[test]
fn a_backbone_across_the_onset_of_slip() {
    let (m, k, kt, limit): (f64, f64, f64, f64) = (2.0, 2e4, 200.0, 0.02);
    let rows = (0..24).map(|i| {
        let a = limit / kt * 0.55 * 10f64.powf(f64::from(i) / 20.0);
        let theta = if a > limit / kt { (1.0 - 2.0 * limit / (kt * a)).acos() } else { std::f64::consts::PI };
        let stiffness = k + kt / std::f64::consts::PI * (theta - 0.5 * (2.0 * theta).sin());
        let loss = (4.0 * limit * (a - limit / kt)).max(0.0);
        vec![a, (stiffness / m).sqrt() / TAU, loss / (TAU * stiffness * a * a)]
    });
    let joint = "[[joint]]\nname = \"pad\"\nbetween = [\"m\", \"ground\"]\n\
        law = { kind = \"jenkins\", stiffness = \"b\", limit = \"F\" }\n";
    let targets = "fit.b = { from = \"10 N/m\", to = \"1e4 N/m\", scale = \"log\" }\n\
        fit.F = { from = \"1 mN\", to = \"1 N\", scale = \"log\" }\n\
        targets = [{ data = \"test\", is = \"backbone\", at = \"m\", weight = \"1 % of largest\" }]";
    let study = oscillator(targets, joint)
        .replace("x0 = \"1 mm\"", "b = \"1e3 N/m\"\nF = \"0.1 N\"")
        .replace("k = \"1e3 N/m\"\nc = \"0.1 kg/s\"", &format!("k = {k}\nc = 0"));
    let dataset = identify(&csv("amplitude_m,frequency_Hz,damping", rows), &study);
    for (name, truth) in [("b", kt), ("F", limit)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < 2e-3, "{name}: {} {:?}", found.value, dataset.notes);
    }
}

/// Amplitude, and loss of the damper per cycle, of settled vibrations; each row has its force.
#[test]
fn settled_vibrations() {
    let (m, k, c): (f64, f64, f64) = (2.0, 2e4, 3.0);
    let rows = (0..30).map(|i| {
        let f = 12.0 + 0.3 * f64::from(i);
        let (omega, force) = (TAU * f, 1.0 + 0.5 * f64::from(i % 4));
        vec![f, force, omega * force / (k - omega * omega * m).hypot(omega * c)]
    });
    let targets = format!(
        "{FIT}targets = [{{ data = \"test\", is = \"settled\", at = \"m\", quantity = \"velocity\", weight = \
         \"relative 1 %\" }}]"
    );
    let dataset = identify(&csv("frequency_Hz,force_N,amplitude_m_per_s", rows), &oscillator(&targets, FORCE));
    for (name, truth) in [("k", k), ("c", c)] {
        let found = estimate(&dataset, name);
        assert!((found.value / truth - 1.0).abs() < 1e-4, "{name}: {}", found.value);
    }
    // a sliding mass dissipates 4 F x per cycle: with its amplitude, the loss gives the limit
    let rows = [(6.0, 0.03), (8.0, 0.012), (10.0, 0.0061)].map(|(f, loss)| vec![f, loss]);
    let joint =
        "[[joint]]\nname = \"pad\"\nbetween = [\"m\", \"ground\"]\nlaw = { kind = \"coulomb\", limit = \"b\" }\n";
    let targets = "fit.b = { from = \"0.01 N\", to = \"5 N\" }\ntargets = [{ data = \"test\", is = \"settled\", at = \
        \"pad\", weight = \"1 mJ\" }]";
    let study = oscillator(targets, &format!("{joint}{FORCE}")).replace("x0 = \"1 mm\"", "b = \"0.1 N\"");
    let dataset =
        identify(&csv("frequency_Hz,dissipation_J", rows), &study.replace("\"1 N\"\nphase", "\"20 N\"\nphase"));
    assert_eq!(table(&dataset, "fit").texts("quantity").expect("names")[0], "dissipation_J");
    let found = estimate(&dataset, "b");
    assert!(found.value > 0.0 && found.status != "not-determined", "{}", found.value);
}

/// A model that is linear in its parameter: the profile is a parabola, and its interval that of the
/// standard error.
#[test]
fn the_profile_of_a_linear_parameter() {
    let mut noise = Noise(11);
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f + 0.02 * noise.normal()]);
    let study = loop_study(", weight = \"0.02 N\"")
        .replace("fit.k = { from = \"10 N/m\", to = \"1e5 N/m\", scale = \"log\" }", "profile = true")
        .replace("k = \"1e2 N/m\"", "k = \"1e3 N/m\"");
    let dataset = identify(&csv("displacement_m,force_N", rows), &study);
    let parameters = table(&dataset, "parameters");
    let number = |column: &str, row: usize| parameters.numbers(column).expect(column)[row];
    for row in 0..2 {
        let width = number("high_95", row) - number("low_95", row);
        for (own, other) in [("profile_low_95", "low_95"), ("profile_high_95", "high_95")] {
            assert!((number(own, row) - number(other, row)).abs() < 0.05 * width, "{row} {own}: {}", number(own, row));
        }
    }
    let profile = table(&dataset, "profile");
    let (rise, inside) = (profile.numbers("rise").expect("rise"), profile.flags("within_95").expect("flags"));
    assert!(profile.rows() > 12 && rise.iter().all(|rise| *rise > -1e-6));
    assert!(inside.contains(&Some(true)) && inside.contains(&Some(false)));
    let summary = table(&dataset, "fit_summary");
    let criterion = |name: &str| summary.numbers(name).expect(name)[0];
    // 3 parameters with the variance, 300 rows: 2 k n/(n - k - 1) instead of 2 k
    let difference = criterion("aicc") - criterion("aic");
    assert!((difference - (6.0 * 300.0 / 296.0 - 6.0)).abs() < 1e-9, "{difference}");
}

/// Two springs side by side whose ranges differ by a factor of 20: neither is determined, although
/// the data restrict the first one to a twentieth of its range.
#[test]
fn both_of_two_parallel_springs_are_undetermined() {
    let mut noise = Noise(3);
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f + 0.02 * noise.normal()]);
    let study = loop_study("")
        .replace("k = \"1e2 N/m\"", "k = \"500 N/m\"\nl = \"500 N/m\"")
        .replace(
            "fit.k = { from = \"10 N/m\", to = \"1e5 N/m\", scale = \"log\" }",
            "fit.k = { from = \"0 N/m\", to = \
            \"2e4 N/m\" }\nfit.l = { from = \"0 N/m\", to = \"1e3 N/m\" }",
        )
        .replace("[[joint]]", "[[spring]]\nbetween = [\"slider\", \"ground\"]\nstiffness = \"l\"\n[[joint]]");
    let dataset = identify(&csv("displacement_m,force_N", rows), &study);
    let status = |name: &str| estimate(&dataset, name).status;
    let both = dataset.notes.iter().any(|note| note.contains("do not determine `k` and `l` separately"));
    // the search may end anywhere along the valley, also at the end of a range
    assert_eq!(status("kt"), "determined");
    assert!(status("l") == "at-bound" || status("k") == "not-determined" && both, "{:?}", dataset.notes);
}

#[test]
fn a_bound_is_no_estimate() {
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f]);
    let study = loop_study("").replace("from = \"10 N/m\", to = \"1e5 N/m\"", "from = \"10 N/m\", to = \"500 N/m\"");
    let dataset = identify(&csv("displacement_m,force_N", rows), &study);
    let found = estimate(&dataset, "k");
    assert!(found.status == "at-bound" && found.error.is_nan() && found.low.is_nan(), "{}", found.status);
    assert!(dataset.notes.iter().any(|note| note.contains("end of its range")), "{:?}", dataset.notes);
}

/// A run that is stopped ends without a panic, in every stage.
#[test]
fn a_fit_can_be_stopped_at_any_time() {
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f]);
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("data.csv"), csv("displacement_m,force_N", rows)).expect("the data");
    let name = folder.path().join("study.toml").display().to_string();
    let study = read_study(&name, &loop_study(""), &[]).expect("a study");
    for step in 0..40 {
        let context = Context::without_progress(1);
        let stop = context.stop.clone();
        let timer = std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_millis(3 * step));
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
        });
        run(&study, &context).expect("a dataset");
        timer.join().expect("the timer");
    }
}

#[test]
fn forces_of_opposite_sign_are_named() {
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, -f]);
    let dataset = identify(&csv("displacement_m,force_N", rows), &loop_study(""));
    let said = dataset.notes.iter().chain(dataset.failures.iter().map(|failure| &failure.reason));
    assert!(said.clone().any(|text| text.contains("opposite sign of the computed ones")), "{:?}", dataset.notes);
}

#[test]
fn rows_that_are_predicted_are_not_fitted() {
    let rows =
        loops(1e3, 1e4, 2.0, 1e-3).into_iter().enumerate().map(|(i, (u, f))| vec![u, f, f64::from(u8::from(i >= 200))]);
    let study = loop_study(", groups = 0")
        .replace("targets = [", "targets = [{ data = \"rig\", is = \"loop\", at = \"pad\", predict = true }, ");
    let dataset = identify(&csv("displacement_m,force_N,group", rows), &study);
    assert_eq!(
        table(&dataset, "fit_summary")
            .columns
            .iter()
            .find(|column| column.name == "residuals")
            .map(|column| column.values.len()),
        Some(1)
    );
    assert!(dataset.notes.iter().any(|note| note.starts_with("prediction of `rig`, group 1")), "{:?}", dataset.notes);
}

/// With every parameter at a bound nothing is left to estimate; the run says so.
#[test]
fn all_parameters_at_a_bound() {
    let rows = loops(1e3, 1e4, 2.0, 1e-3).into_iter().map(|(u, f)| vec![u, f]);
    let one = |line: &str| !line.starts_with("fit.kt") && !line.starts_with("fit.k ");
    let study = loop_study("").replace("from = \"0.02 N\", to = \"200 N\"", "from = \"0.02 N\", to = \"1 N\"");
    let study = study.replace("kt = \"1e5 N/m\"", "kt = \"1e4 N/m\"").replace("k = \"1e2 N/m\"", "k = \"1e3 N/m\"");
    let study: Vec<&str> = study.lines().filter(|line| one(line)).collect();
    let dataset = identify(&csv("displacement_m,force_N", rows), &study.join("\n"));
    let found = estimate(&dataset, "Ft");
    assert!(found.status == "at-bound" && found.error.is_nan() && (found.value - 1.0).abs() < 1e-9, "{}", found.status);
    assert!(dataset.notes.iter().any(|note| note.contains("end of its range")), "{:?}", dataset.notes);
}

/// A stated value outside of the range of a parameter is a warning of `check`, before the search.
#[test]
fn a_start_outside_of_its_range_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("data.csv"), "displacement_m,force_N\n0,0\n1,1\n0.5,0\n").expect("the data");
    let warnings = |study: &str| {
        let name = folder.path().join("study.toml").display().to_string();
        ModelSummary::new(&read_study(&name, study, &[]).expect("a study")).expect("a summary").warnings
    };
    assert_eq!(warnings(&loop_study("")), Vec::<String>::new());
    let outside = warnings(&loop_study("").replace("from = \"0.02 N\"", "from = \"1 N\""));
    assert!(
        outside.len() == 1 && outside[0].contains("`Ft` = 0.2 N is outside of its range, 1 N to 200 N"),
        "{outside:?}"
    );
}

#[test]
fn wrong_targets_are_refused_before_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |text: &str| std::fs::write(folder.path().join("data.csv"), text).expect("the data");
    write("displacement_m,force_N\n0,0\n1,1\n0.5,0\n");
    let refused = |study: &str| {
        let name = folder.path().join("study.toml").display().to_string();
        read_study(&name, study, &[]).map(|_| ()).expect_err(study)
    };
    let study = loop_study("");
    for (from, to, part, help) in [
        ("data = \"rig\"", "data = \"rigg\"", "no [[data]] `rigg`", "rig"),
        ("at = \"pad\"", "at = \"pat\"", "no joint `pat`", "pad"),
        ("data.csv", "date.csv", "date.csv", "path"),
        ("is = \"loop\", at = \"pad\"", "is = \"response\", at = \"slider\"", "frequency", "columns"),
        ("is = \"loop\"", "is = \"response\"", "no place `pad`", ""),
        ("to = \"1e6 N/m\"", "to = \"1 N/m\"", "more than `from`", ""),
        ("fit.kt", "fit.kk", "no parameter `kk` to fit", "kt"),
        ("from = \"0.02 N\"", "from = \"0 N\"", "logarithmic", ""),
        ("from = \"0.02 N\"", "from = \"0.02 m\"", "force", ""),
        ("is = \"loop\"", "is = \"loop\", weight = \"1 mm\"", "`weight` must be", "relative"),
        ("name = \"rig\"", "name = \"rig\"\ncolumns = { force = \"F\" }", "no column `F`", "force_N"),
        ("is = \"loop\"", "is = \"loop\", groups = [0, 7]", "no row of `rig` is in group 7", "all rows are in group 0"),
    ] {
        let error = refused(&study.replacen(from, to, 1));
        let said = format!("{error} {}", error.help_text().unwrap_or_default());
        assert!(said.contains(part) && said.contains(help), "{to}: {said}");
    }
    write("displacement_m,force_N,group\n0,0,1\n1,1,2\n0.5,0,4\n");
    let error = refused(&study.replacen("is = \"loop\"", "is = \"loop\", groups = [1, 3]", 1));
    assert!(error.to_string().contains("group 3"), "{error}");
    assert_eq!(error.help_text(), Some("the column `group` contains `1`, `2` or `4`"));
    write("displacement_m,force_N\n0,0\n1,1\n0.5,\n");
    let said = refused(&study).to_string();
    assert!(said.contains("row 3 of `rig` has no number"), "{said}");
    write("displacement_m,force_N\n0,0\n0.5,1\n1,open\n");
    let said = refused(&study).to_string();
    assert!(said.contains("the column `force_N` of `rig` contains `open`, but numbers are expected"), "{said}");
}
