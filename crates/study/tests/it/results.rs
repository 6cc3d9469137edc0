//! Results as typed values: values that are read back from a dataset equal closed forms and the
//! results of other kinds.

use std::f64::consts::TAU;
use std::sync::{Arc, atomic::AtomicBool};
use stickslip_study::dataset::{CellValues, Dataset};
use stickslip_study::kinds::{hysteresis, performance, response};
use stickslip_study::results::{ResultsError, worst_evidence};
use stickslip_study::run::{Context, run};
use stickslip_study::{Study, read_study};

fn of(text: &str) -> (Study, Dataset) {
    let study = read_study("study.toml", text, &[]).unwrap();
    let dataset = run(&study, &Context::without_progress(1)).unwrap();
    (study, dataset)
}

/// Two independent oscillators of 1 kg, with 1 N/m and `k` N/m, each under 1 N.
fn oscillators(study: &str) -> (Study, Dataset) {
    of(&format!(
        r#"
schema = 1
title = "Two oscillators"
[parameters]
c = "0.2 kg/s"
k = "4 N/m"
[[mass]]
name = "slow"
mass = "1 kg"
[[mass]]
name = "fast"
mass = "1 kg"
[[spring]]
between = ["slow", "ground"]
stiffness = "1 N/m"
damping = "c"
[[spring]]
between = ["fast", "ground"]
stiffness = "k"
damping = "c"
[[force]]
on = "slow"
amplitude = "1 N"
[[force]]
on = "fast"
amplitude = "1 N"
[study]
{study}
"#
    ))
}

const SWEEP: &str = r#"
kind = "response"
frequency = { from = "0.4 rad/s", to = "3 rad/s", points = 27 }
vary = { k = ["4 N/m", "6 N/m"], c = ["0.2 kg/s", "0.4 kg/s"] }
"#;

/// Relative rounding error of a linear orbit, and of the conversion from hertz to rad/s and
/// back.
const ROUNDING: f64 = 1e-9;
/// Relative error of the frequency of a refined peak, near which the amplitude is flat.
const PLACE: f64 = 1e-3;

/// Every amplitude is `F/√((k - m ω²)² + (c ω)²)` with the values of its mass, case and
/// frequency. Every peak is at `√(k/m - c²/(2 m²))`, with the height `F/(c √(k/m - c²/(4 m²)))`.
#[test]
fn response_curves_are_those_of_their_case_and_mass() {
    let (study, dataset) = oscillators(SWEEP);
    let curves = response::curves(&study, &dataset).unwrap();
    let expected = [(4.0, 0.2), (4.0, 0.4), (6.0, 0.2), (6.0, 0.4)];
    assert_eq!(curves.len(), expected.len());
    for (curve, (stiff, c)) in curves.iter().zip(expected) {
        let varied: Vec<(&str, f64)> = curve.varied.iter().map(|v| (v.name.as_str(), v.si)).collect();
        assert_eq!(varied, [("k", stiff), ("c", c)]);
        assert_eq!(curve.frequency.len(), 27);
        assert_eq!(curve.masses.len(), 2);
        for (mass, (name, k)) in curve.masses.iter().zip([("slow", 1.0), ("fast", stiff)]) {
            assert_eq!(mass.mass, name);
            for (frequency, amplitude) in curve.frequency.iter().zip(&mass.amplitude) {
                let w = TAU * frequency;
                let exact = 1.0 / (k - w * w).hypot(c * w);
                assert!((amplitude / exact - 1.0).abs() < ROUNDING, "{name} at {w} rad/s: {amplitude}, not {exact}");
            }
            let peak = mass.highest_peak().unwrap();
            let exact = ((k - 0.5 * c * c).sqrt(), 1.0 / (c * (k - 0.25 * c * c).sqrt()));
            assert!((TAU * peak.frequency / exact.0 - 1.0).abs() < PLACE, "{name}: {peak:?}, not at {}", exact.0);
            assert!((peak.amplitude / exact.1 - 1.0).abs() < PLACE * PLACE, "{name}: {peak:?}, not {}", exact.1);
            assert!(!peak.at_range_end);
        }
    }
}

#[test]
fn curves_without_peaks_have_none() {
    let (study, dataset) = oscillators(&format!("{SWEEP}peaks = false\n"));
    let curves = response::curves(&study, &dataset).unwrap();
    assert!(curves.iter().flat_map(|curve| &curve.masses).all(|mass| mass.peaks.is_empty()));
    assert_eq!(curves.len(), 4);
}

/// Each loop loses `4 Ft (a - Ft/kt)` with the values of its joint and case, at any
/// frequency.
#[test]
fn loops_are_those_of_their_case_frequency_and_joint() {
    let (study, dataset) = of(r#"
schema = 1
title = "Two joints"
[parameters]
a = "2 m"
[[motion]]
on = "mover"
amplitude = "a"
[[joint]]
name = "weak"
between = ["mover", "ground"]
law = { kind = "jenkins", stiffness = "2 N/m", limit = "1 N" }
[[joint]]
name = "strong"
between = ["mover", "ground"]
law = { kind = "jenkins", stiffness = "4 N/m", limit = "3 N" }
[study]
kind = "hysteresis"
frequency = ["1 Hz", "2 Hz"]
vary = { a = ["2 m", "3 m"] }
samples = 40
"#);
    let loops = hysteresis::loops(&study, &dataset).unwrap();
    let mut expected = Vec::new();
    for a in [2.0, 3.0] {
        for frequency in [1.0, 2.0] {
            expected.extend([("weak", 2.0, 1.0), ("strong", 4.0, 3.0)].map(|joint| (a, frequency, joint)));
        }
    }
    assert_eq!(loops.len(), expected.len());
    for (found, (a, frequency, (joint, kt, limit))) in loops.iter().zip(expected) {
        assert_eq!((found.varied[0].name.as_str(), found.varied[0].si), ("a", a));
        assert_eq!((found.frequency, found.joint.as_str()), (frequency, joint));
        let loss = 4.0 * limit * (a - limit / kt);
        assert!((found.dissipation / loss - 1.0).abs() < ROUNDING, "{joint}: {} J, not {loss} J", found.dissipation);
        // ceq = loss/(π ω a²)
        let damping = loss / (0.5 * TAU * TAU * frequency * a * a);
        assert!((found.equivalent_damping / damping - 1.0).abs() < ROUNDING, "{joint}: {}", found.equivalent_damping);
        assert!(found.equivalent_stiffness > 0.0 && found.equivalent_stiffness < kt);
        let highest = |values: &[f64]| values.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
        assert!((highest(&found.displacement) / a - 1.0).abs() < ROUNDING);
        assert!((highest(&found.force) / limit - 1.0).abs() < ROUNDING);
        let period = found.time[found.time.len() - 1];
        assert!(found.time[0] == 0.0 && (period * frequency - 1.0).abs() < ROUNDING && found.time.is_sorted());
        assert_eq!((found.displacement.len(), found.force.len()), (found.time.len(), found.time.len()));
    }
}

/// The tables of a study with one frequency have no column for it.
#[test]
fn a_loop_knows_the_only_frequency() {
    let (study, dataset) = of(stickslip_study::templates::find("element").unwrap().study);
    let loops = hysteresis::loops(&study, &dataset).unwrap();
    for found in &loops {
        let period = found.time[found.time.len() - 1];
        assert!((period * found.frequency - 1.0).abs() < ROUNDING, "{} Hz, {period} s", found.frequency);
    }
    assert_eq!(loops.len(), study.cases());
}

fn couple(kind: &str, vary: &str) -> Study {
    let text = format!(
        r#"
schema = 1
title = "Couple"
[model]
template = "blade-couple"
[study]
kind = "{kind}"
frequency = {{ from = "120 Hz", to = "121.5 Hz", points = 31 }}
vary = {{ {vary} }}
"#
    );
    read_study("couple.toml", &text, &[]).unwrap()
}

/// Largest relative difference of two refinements of one peak.
const REFINED: f64 = 1e-9;

/// A point of a performance curve is the peak of the response with the same parameters, and so
/// is the optimum.
#[test]
fn performance_curves_are_made_of_the_peaks_of_responses() {
    let study = couple("performance", r#"kt = ["8000 N/m", "10000 N/m"], Ft = ["4 N", "6.5 N", "9 N"]"#);
    let dataset = run(&study, &Context::without_progress(1)).unwrap();
    let curves = performance::curves(&study, &dataset).unwrap();
    let peak_of_response = |kt: f64, limit: f64| {
        let study = couple("response", &format!(r#"kt = ["{kt} N/m"], Ft = ["{limit} N"]"#));
        let dataset = run(&study, &Context::without_progress(1)).unwrap();
        response::curves(&study, &dataset).unwrap()[0].masses[0].highest_peak().unwrap()
    };
    assert_eq!(curves.len(), 2);
    for (curve, kt) in curves.iter().zip([8000.0, 10000.0]) {
        assert_eq!(curve.points.len(), 3);
        for (point, limit) in curve.points.iter().zip([4.0, 6.5, 9.0]) {
            let varied: Vec<(&str, f64)> = point.varied.iter().map(|v| (v.name.as_str(), v.si)).collect();
            assert_eq!(varied, [("kt", kt), ("Ft", limit)]);
            let (peak, expected) = (point.peak.unwrap(), peak_of_response(kt, limit));
            assert!((peak.amplitude / expected.amplitude - 1.0).abs() < REFINED, "{peak:?}, not {expected:?}");
            assert!((peak.frequency / expected.frequency - 1.0).abs() < PLACE, "{peak:?}, not {expected:?}");
            assert!(!peak.at_range_end);
            assert_eq!(point.failed_orbits, 0);
        }
        // with the soft contact the peak still falls at the highest limit, which distinguishes
        // the curves
        let Some(optimum) = curve.optimum else {
            assert_eq!(kt, 8000.0);
            continue;
        };
        assert_eq!(kt, 10000.0);
        let expected = peak_of_response(kt, optimum.value);
        assert!((optimum.amplitude / expected.amplitude - 1.0).abs() < REFINED, "{optimum:?}, not {expected:?}");
        assert!((optimum.frequency / expected.frequency - 1.0).abs() < PLACE, "{optimum:?}, not {expected:?}");
        assert!(curve.points.iter().all(|point| point.peak.unwrap().amplitude >= optimum.amplitude));
    }
}

/// The peak of a damped oscillator only falls with its damping, so there is no optimum.
#[test]
fn a_curve_that_only_falls_has_no_optimum() {
    let (study, dataset) = oscillators(
        r#"
kind = "performance"
frequency = { from = "0.4 rad/s", to = "3 rad/s", points = 27 }
vary = { c = ["0.1 kg/s", "0.2 kg/s", "0.3 kg/s"] }
"#,
    );
    let curves = performance::curves(&study, &dataset).unwrap();
    assert_eq!((curves.len(), curves[0].points.len()), (1, 3));
    assert_eq!(curves[0].optimum, None);
}

/// A run that was stopped before it began has no results, which is not an error.
#[test]
fn an_interrupted_run_has_what_was_finished() {
    let stopped = |kind: &str| {
        let study = couple(kind, r#"Ft = ["4 N", "6 N", "8 N"]"#);
        let context = Context { stop: Arc::new(AtomicBool::new(true)), ..Context::without_progress(1) };
        let dataset = run(&study, &context).unwrap();
        assert!(dataset.record.interrupted);
        (study, dataset)
    };
    let (study, dataset) = stopped("response");
    assert_eq!(response::curves(&study, &dataset), Ok(Vec::new()));
    let (study, dataset) = stopped("performance");
    assert_eq!(performance::curves(&study, &dataset), Ok(Vec::new()));
    let (study, dataset) = stopped("hysteresis");
    assert_eq!(hysteresis::loops(&study, &dataset), Ok(Vec::new()));
}

#[test]
fn foreign_results_are_refused() {
    let (study, dataset) = oscillators(SWEEP);
    let wrong_kind = hysteresis::loops(&study, &dataset).unwrap_err();
    assert!(wrong_kind.to_string().contains("`study` is of kind `response`"), "{wrong_kind}");
    // without a column, or with a shorter one
    let mut broken = dataset.clone();
    broken.tables[0].columns.retain(|column| column.name != "fast_amplitude_m");
    let column = response::curves(&study, &broken).unwrap_err();
    assert!(column.to_string().contains("`curve` of `study` lacks the column `fast_amplitude_m`"), "{column}");
    let mut broken = dataset.clone();
    let CellValues::Number(values) = &mut broken.tables[1].columns[3].values else {
        panic!("k, c, mass, then the frequency")
    };
    values.pop();
    assert!(matches!(response::curves(&study, &broken), Err(ResultsError::Column { .. })));
    // of other cases
    let (other, _) = oscillators(&SWEEP.replace("6 N/m", "7 N/m"));
    let rows = response::curves(&other, &dataset).unwrap_err();
    assert!(matches!(rows, ResultsError::Rows { .. }), "{rows}");
}

/// The worst evidence is the largest number of a column over all tables, without NaN.
#[test]
fn the_worst_evidence_is_the_largest() {
    let (_, mut dataset) = oscillators(SWEEP);
    let (mut largest, mut least) = (0.0f64, f64::INFINITY);
    for column in dataset.tables[0].columns.iter_mut().filter(|column| column.name == "energy_gap") {
        let CellValues::Number(values) = &mut column.values else { panic!("a gap is a number") };
        values[3] = 0.5;
        values[4] = f64::NAN;
        values.iter().for_each(|value| (largest, least) = (largest.max(*value), least.min(*value)));
    }
    assert!(least < 0.5);
    let evidence = worst_evidence(&dataset);
    assert_eq!(evidence.energy_gap, Some(largest));
    assert!(evidence.residual.unwrap() < 1e-6);
    dataset.tables.clear();
    assert_eq!(worst_evidence(&dataset).residual, None);
}

/// Rigid joints in a triangle become indistinguishable within the first period, and the transient
/// breaks down. The rows until then exist, and their summary covers them.
#[test]
fn an_aborted_transient_keeps_its_rows() {
    let text = r#"
schema = 1
[[mass]]
name = "a"
mass = "1 kg"
[[mass]]
name = "b"
mass = "0.7 kg"
[[spring]]
between = ["a", "ground"]
stiffness = "20 N/mm"
damping = "3 kg/s"
[[spring]]
between = ["b", "ground"]
stiffness = "30 N/mm"
damping = "3 kg/s"
[[joint]]
name = "on_a"
between = ["a", "ground"]
law = { kind = "coulomb", limit = "5 N" }
[[joint]]
name = "on_b"
between = ["b", "ground"]
law = { kind = "coulomb", limit = "5 N" }
[[joint]]
name = "across"
between = ["a", "b"]
law = { kind = "coulomb", limit = "5 N" }
[[force]]
on = "a"
amplitude = "20 N"
[[force]]
on = "b"
amplitude = "12 N"
phase = "40 deg"
[study]
kind = "transient"
frequency = "5 Hz"
cycles = 20
"#;
    let (_, found) = of(text);
    assert_eq!(found.record.points.get("breakdown"), Some(&1), "{:?}", found.record.points);
    let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
    let (motion, summary) = (table("motion"), table("motion_summary"));
    let times = motion.numbers("time_s").unwrap();
    assert!(times.len() > 10, "{times:?}");
    for (row, mass) in ["a", "b"].iter().enumerate() {
        let column = motion.numbers(&format!("{mass}_displacement_m")).unwrap();
        let largest = column.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        // a turning point between two of 64 samples a period
        let ratio = summary.numbers("largest_displacement_m").unwrap()[row] / largest;
        assert!((1.0..1.01).contains(&ratio), "{ratio}");
    }
    // with the width that its message advises, it runs to the end
    let (_, smoothed) = of(&format!("{text}\n[method]\nkind = \"shooting\"\nwidth = \"0.1 mm/s\"\n"));
    assert_eq!(smoothed.record.points.get("converged"), Some(&1), "{:?}", smoothed.record.points);
}

/// A note reports a stuck joint in a model with a stop: the position at which it sticks
/// determines when the stop closes. Without the stop, or if the joint slips, there is no note.
#[test]
fn a_stuck_joint_with_a_stop_is_reported() {
    let stop = "[[joint]]\nname = \"stop\"\nbetween = [\"b\", \"ground\"]\nlaw = { kind = \"gap\", gap = \"0.05 mm\", stiffness = \"30 N/mm\" }\n";
    let (rigid, spring) = (r#"kind = "coulomb""#, r#"kind = "jenkins", stiffness = "20 N/mm""#);
    for (limit, law, stop, told) in [
        ("100 N", rigid, stop, true),
        ("100 N", spring, stop, true),
        ("100 N", rigid, "", false),
        ("100 N", spring, "", false),
        ("0.1 N", rigid, stop, false),
    ] {
        let text = format!(
            r#"
schema = 1
[[mass]]
name = "a"
mass = "0.2 kg"
[[mass]]
name = "b"
mass = "0.2 kg"
[[spring]]
between = ["a", "ground"]
stiffness = "100 N/mm"
damping = "5 kg/s"
[[spring]]
between = ["b", "ground"]
stiffness = "60 N/mm"
damping = "5 kg/s"
[[joint]]
name = "held"
between = ["a", "b"]
law = {{ {law}, limit = "{limit}" }}
{stop}[[force]]
on = "b"
amplitude = "8 N"
[[force]]
on = "b"
amplitude = "2 N"
harmonic = 0
[study]
kind = "response"
frequency = ["80 Hz", "90 Hz"]
peaks = false
[method]
kind = "event-driven"
"#
        );
        let notes = of(&text).1.notes;
        let found = notes.iter().find(|note| note.contains("several orbits are possible"));
        assert_eq!(found.is_some(), told, "{limit} {law} {stop}: {notes:?}");
        let right = found.is_none_or(|note| {
            note.starts_with("warning: at 2 points") && note.contains("`held`") && note.contains("`stop`")
        });
        assert!(right, "{found:?}");
    }
}

/// The stability of an orbit of more than 24 degrees of freedom is unknown. A damper of negative
/// damping may make it unstable, and a warning says so.
#[test]
fn unknown_stability_with_a_negative_damping_is_reported() {
    for (damping, is_reported) in [("-30 N s/m", true), ("30 N s/m", false)] {
        let text = r#"
schema = 1
title = "A row with a damper of negative damping"

[[mass]]
repeat = { i = 30 }
name = "m{i}"
mass = "1 kg"

[[spring]]
repeat = { i = 30 }
between = ["m{i}", "ground"]
stiffness = "10 N/mm"
damping = "2 N s/m"

[[spring]]
repeat = { i = 29 }
between = ["m{i}", "m{i+1}"]
stiffness = "2 N/mm"

[[spring]]
between = ["m3", "m4"]
stiffness = "0 N/mm"
damping = "-30 N s/m"

[[joint]]
name = "j"
between = ["m3", "ground"]
law = { kind = "cubic", stiffness = "1e9 N/m^3" }

[[force]]
on = "m1"
amplitude = "1 N"

[study]
kind = "response"
frequency = ["14 Hz", "18 Hz"]
peaks = false
"#
        .replace("-30 N s/m", damping);
        let notes = of(&text).1.notes;
        let found = notes.iter().find(|note| note.contains("the stability of the orbit is unknown"));
        assert_eq!(found.is_some(), is_reported, "{damping}: {notes:?}");
        assert!(found.is_none_or(|note| note.starts_with("warning: at 2 points")), "{found:?}");
    }
}

/// A contact that sticks may reach its limit for an instant of the period. The derivative of
/// the return map is then that of slip: 1.41 for a stable orbit, without the contact that stays
/// open. Such an orbit is one of a continuum, and its stability is unknown.
#[test]
fn sticking_up_to_the_limit_has_unknown_stability() {
    let text = r#"
schema = 1
[[mass]]
name = "m0"
mass = 0.239
directions = ["x", "z"]
[[mass]]
name = "m1"
mass = 0.523
directions = ["x", "z"]
[[spring]]
between = ["m0.x", "ground"]
stiffness = 584.8
damping = 1.163
[[spring]]
between = ["m0.z", "ground"]
stiffness = 1256.0
damping = 1.163
[[spring]]
between = ["m1.x", "m0.x"]
stiffness = 183.7
damping = 0.0
[[spring]]
between = ["m1.z", "m0.z"]
stiffness = 136.1
damping = 0.02326
[[joint]]
name = "j0"
between = ["m1", "ground"]
law = { kind = "jenkins-2d", stiffness = 140.2, limit = 0.05548 }
[[joint]]
name = "j1"
between = ["m0", "m1"]
law = { kind = "jenkins-2d", stiffness = 1537.0, limit = 0.01462 }
[[joint]]
name = "j2"
between = ["m0", "m1"]
law = { kind = "friction-contact", tangential = 102.7, normal = 1986.0, friction = 0.6843, preload = -0.127 }
[[force]]
on = "m0.x"
amplitude = 0.4493
phase = "127 deg"
harmonic = 1
[study]
kind = "orbit"
frequency = "43.3 rad/s"
[method]
kind = "shooting"
"#;
    let (_, found) = of(text);
    assert_eq!(found.record.points.get("converged"), Some(&1), "{:?}", found.record.points);
    let notes = &found.notes;
    assert!(!notes.iter().any(|note| note.contains("unstable")), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("`j0`") && note.contains("sticks permanently")), "{notes:?}");
}

/// The figure of an orbit shows the 12 places with the largest range. It shows nodes of contacts
/// only if no other place is observed.
#[test]
fn an_orbit_shows_few_curves() {
    let oscillator = |name: &str, force: f64| {
        format!(
            "[[mass]]\nname = \"{name}\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"{name}\", \"ground\"]\n\
             stiffness = \"4 N/m\"\ndamping = \"1 kg/s\"\n[[force]]\non = \"{name}\"\namplitude = \"{force} N\"\n"
        )
    };
    let shown = |elements: &str| -> (String, Vec<String>) {
        let study = "[study]\nkind = \"orbit\"\nfrequency = \"1 rad/s\"\n";
        let (_, dataset) = of(&format!("schema = 1\ntitle = \"oscillators\"\n{elements}{study}"));
        let panel = &dataset.figure.panels[0];
        (panel.title.clone(), panel.series.iter().map(|series| series.label.clone()).collect())
    };
    // the range is proportional to the force
    let many: String = (1..=15).map(|i| oscillator(&format!("m{i}"), f64::from(i * 7 % 16))).collect();
    let (title, names) = shown(&many);
    let largest: Vec<String> = (1..=15).filter(|i| i * 7 % 16 > 3).map(|i| format!("m{i}")).collect();
    assert!(
        names == largest && title.starts_with("displacement, 12 of 15 with the largest range"),
        "{title} {names:?}"
    );
    let contact = ["pad_a", "pad_b"].map(|name| oscillator(name, 1.0)).concat()
        + "[[joint]]\nname = \"pad\"\nbetween = [\"pad_a\", \"pad_b\"]\nlaw = { kind = \"jenkins\", stiffness = \"1 N/m\", limit = \"1 N\" }\n";
    assert_eq!(shown(&contact).1, ["pad_a", "pad_b"]);
    assert_eq!(shown(&(contact + &oscillator("tip", 1.0))).1, ["tip"]);
}
