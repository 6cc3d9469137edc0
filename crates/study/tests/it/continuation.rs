//! Studies with continuation or search: performance curves, nonlinear modes and branches.

use stickslip_study::dataset::{Dataset, Style, Table};
use stickslip_study::{
    read_study,
    run::{Context, run},
};

fn dataset(text: &str) -> Dataset {
    let study = read_study("study.toml", text, &[]).unwrap();
    run(&study, &Context::without_progress(1)).unwrap()
}

fn table<'a>(dataset: &'a Dataset, name: &str) -> &'a Table {
    dataset.tables.iter().find(|table| table.name == name).unwrap()
}

/// An oscillator of 1 kg and 1 N/m with a joint to the ground.
fn oscillator(damping: &str, law: &str, study: &str) -> Dataset {
    dataset(&oscillating(damping, law, study))
}

fn oscillating(damping: &str, law: &str, study: &str) -> String {
    format!(
        r#"
schema = 1
title = "Oscillator"
[parameters]
F0 = "1 N"
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/m"
damping = "{damping}"
[[joint]]
name = "contact"
between = ["m", "ground"]
law = {law}
[[force]]
on = "m"
amplitude = "F0"
[study]
{study}
"#
    )
}

/// Theory 6.6 in a study: the slip limit that minimizes the peak of blade 1.
#[test]
fn performance_finds_the_best_slip_limit() {
    let text = r#"
schema = 1
title = "Best slip limit"
[model]
template = "blade-couple"
[study]
kind = "performance"
frequency = { from = "120 Hz", to = "121.5 Hz", points = 31 }
vary = { Ft = ["5.5 N", "6.5 N", "7.5 N"] }
"#;
    let found = dataset(text);
    assert!(found.failures.is_empty());
    let best = table(&found, "optimum");
    assert!((best.numbers("Ft_N").unwrap()[0] - 6.684).abs() < 0.01);
    assert!((best.numbers("amplitude_m").unwrap()[0] - 0.019_747).abs() < 1e-6);
    // a series that is too short does not look converged
    let short = dataset(&(text.to_owned() + "[method]\nkind = \"harmonic-balance\"\nharmonics = 3\n"));
    assert_eq!(short.record.points.get("truncated"), Some(&3), "{:?}", short.record.points);
    assert!(short.notes.iter().any(|note| note.contains("too short")), "{:?}", short.notes);
}

/// A slider with a limit above the force keeps the mass at rest. Then no limit is the best, and
/// if only some limits do so, none of these is.
#[test]
fn no_optimum_without_motion() {
    let found = |limits: &str| {
        let study = format!(
            "kind = \"performance\"\nfrequency = {{ from = \"0.1 Hz\", to = \"0.2 Hz\", points = 5 }}\nvary = {{ Fc = {limits} }}"
        );
        let law = r#"{ kind = "coulomb", limit = "Fc" }"#;
        let text = oscillating("0.1 kg/s", law, &study).replace("F0 = \"1 N\"", "F0 = \"1 N\"\nFc = \"1 N\"");
        let found = dataset(&text);
        let best = table(&found, "optimum");
        assert!(best.numbers("amplitude_m").unwrap()[0].is_nan() && best.texts("status").unwrap()[0] == "none");
        assert!(!found.figure.panels[0].series.iter().any(|series| series.label == "optimum"));
        found.notes.join("; ")
    };
    let still = found("[\"2 N\", \"3 N\", \"4 N\"]");
    assert!(still.contains("no place of `peak_of` moves at any value of Fc"), "{still}");
    let level = found("[\"0.2 N\", \"2 N\", \"3 N\", \"4 N\"]");
    assert!(level.contains("3 values of Fc, from Fc = 2 N to Fc = 4 N, have the same lowest peak"), "{level}");
    let falling = found("[\"0.1 N\", \"0.2 N\", \"0.3 N\"]");
    assert!(falling.contains("is at an end"), "{falling}");
}

/// (10.3) at its ends: stuck with the spring of the joint, free without it.
#[test]
fn modes_go_from_stuck_to_free() {
    let law = r#"{ kind = "jenkins", stiffness = "0.2 N/m", limit = "1 N" }"#;
    let found =
        oscillator("0 kg/s", law, "kind = \"modes\"\namplitude = { from = \"1 m\", to = \"10000 m\", points = 21 }");
    let modes = table(&found, "modes");
    let omega: Vec<f64> = modes.numbers("frequency_Hz").unwrap().iter().map(|f| f * std::f64::consts::TAU).collect();
    assert!((omega[0] - 1.2f64.sqrt()).abs() < 1e-9, "{omega:?}");
    assert!((omega[20] - 1.0).abs() < 1e-4, "{omega:?}");
    let damping = modes.numbers("damping_ratio").unwrap();
    assert!(damping[0].abs() < 1e-9 && damping[20] < 1e-3 && damping.iter().any(|zeta| *zeta > 0.025), "{damping:?}");
}

/// Summary of a mode, (10.3): both ends, and the largest damping `Im k/(2 (1 + Re k))` over the
/// amplitudes, with the complex stiffness k of the slider.
#[test]
fn modes_are_summarised() {
    let law = r#"{ kind = "jenkins", stiffness = "0.2 N/m", limit = "1 N" }"#;
    let study =
        "kind = \"modes\"\nharmonics = 1\nsamples = 4096\namplitude = { from = \"1 m\", to = \"1000 m\", points = 5 }";
    let found = oscillator("0 kg/s", law, study);
    assert!(found.failures.is_empty() && found.notes.is_empty(), "{:?} {:?}", found.failures, found.notes);
    let summary = table(&found, "modes_summary");
    let value = |column: &str| summary.numbers(column).unwrap()[0];
    let damping = |a: f64| {
        let slip = (1.0 - 10.0 / a).acos();
        let scale = 0.2 / std::f64::consts::PI;
        let (re, im) = (scale * (slip - 0.5 * (2.0 * slip).sin()), scale * slip.sin().powi(2));
        im / (2.0 * (1.0 + re))
    };
    let at =
        (0..20_000).map(|i| 5.0 + 0.001 * f64::from(i)).max_by(|a, b| damping(*a).total_cmp(&damping(*b))).unwrap();
    assert!((value("small_end_frequency_Hz") * std::f64::consts::TAU - 1.2f64.sqrt()).abs() < 1e-9);
    assert!((value("large_end_frequency_Hz") * std::f64::consts::TAU - 1.0).abs() < 1e-3);
    assert!((value("largest_damping_ratio") / damping(at) - 1.0).abs() < 1e-6, "{summary:?}");
    assert!((value("amplitude_there_m") / at - 1.0).abs() < 2e-3, "{summary:?} {at}");
}

/// If two modes nearly merge, the run reports that amplitude and does not look like a success.
#[test]
fn merging_modes_are_reported() {
    let study = |points: u32| {
        dataset(&format!(
            r#"
schema = 1
title = "Couple"
[model]
template = "blade-couple"
[parameters]
Ft = "8 N"
[study]
kind = "modes"
mode = 2
harmonics = 9
amplitude = {{ from = "0.01 mm", to = "100 mm", points = {points} }}
"#
        ))
    };
    let (coarse, fine) = (study(3), study(50));
    assert_eq!(fine.record.points.get("merging"), Some(&1), "{:?}", fine.record.points);
    let reason = &fine.failures[0].reason;
    assert!(fine.failures[0].location == "mode 2" && reason.contains("nearly merges with another mode"), "{reason}");
    assert_eq!(coarse.failures, fine.failures);
    let largest = |found: &Dataset| table(found, "modes_summary").numbers("largest_damping_ratio").unwrap()[0];
    assert!((largest(&coarse) / largest(&fine) - 1.0).abs() < 1e-6 && largest(&fine) > 0.05);
}

/// A range of amplitudes without slip gives a linear mode, and a note says it.
#[test]
fn a_mode_without_slip_is_reported() {
    let law = r#"{ kind = "jenkins", stiffness = "0.2 N/m", limit = "1 N" }"#;
    let study = |to: &str| format!("kind = \"modes\"\namplitude = {{ from = \"0.1 m\", to = \"{to} m\", points = 5 }}");
    let told =
        |to: &str| oscillator("0.1 kg/s", law, &study(to)).notes.iter().any(|note| note.contains("no joint slips"));
    assert!(told("4.9") && !told("6"));
}

/// A branch along a force with two folds: two turns in its table, and an unstable part in its
/// figure.
#[test]
fn a_branch_has_two_folds() {
    let study = r#"kind = "branch"
frequency = "1.04880885 rad/s"
vary = { F0 = ["2 N", "0.5 N"] }
steps = 75
harmonics = 31
tolerance = 0.3"#;
    let found = oscillator("-0.03 kg/s", r#"{ kind = "coulomb", limit = "1 N" }"#, study);
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    let turns = table(&found, "turns").numbers("F0_N").unwrap();
    // the first where (0.1 a)² + (4/π - 0.03 ω a)² is least, up to the higher harmonics; the
    // second above the sticking force
    assert!(turns.len() == 2 && (turns[0] - 1.21).abs() < 0.05 && turns[1] > turns[0], "{turns:?}");
    let values = table(&found, "branch").numbers("F0_N").unwrap();
    assert_eq!((values[0], *values.last().unwrap()), (2.0, 0.5));
    let styles: Vec<Style> = found.figure.panels[0].series.iter().map(|series| series.style).collect();
    assert_eq!(styles, [Style::Solid, Style::Dashed, Style::Solid]);
    let unstable = table(&found, "branch").flags("stable").unwrap().iter().filter(|stable| **stable == Some(false));
    let warning = format!("warning: at {} points the orbit is unstable", unstable.count());
    assert!(found.notes.iter().any(|note| note.starts_with(&warning)), "{warning}: {:?}", found.notes);
}

/// Along the frequency a branch ends at the ends of its range, and its peak is that of the
/// response curve.
#[test]
fn a_branch_along_frequency_has_the_peak_of_the_curve() {
    let text = r#"
schema = 1
title = "Blade couple"
[model]
template = "blade-couple-massless"
[study]
kind = "KIND"
frequency = { from = "120 Hz", to = "122 Hz", points = 41 }
vary = { Ft = ["2 N", "4 N"] }
"#;
    let branch = dataset(&text.replace("KIND", "branch").replace(", points = 41", ""));
    let curve = dataset(&text.replace("KIND", "response"));
    assert_eq!(branch.record.points.keys().collect::<Vec<_>>(), ["converged"]);
    let peaks = table(&branch, "peaks").numbers("amplitude_m").unwrap();
    let of_curve = table(&curve, "peaks");
    let (limits, heights) = (of_curve.numbers("Ft_N").unwrap(), of_curve.numbers("amplitude_m").unwrap());
    // the highest peak of the curve is that of blade 1; 15 harmonics are within 3e-5 of the
    // exact curve
    assert_eq!(peaks.len(), 2);
    for (peak, limit) in peaks.iter().zip([2.0, 4.0]) {
        let all = (0..of_curve.rows()).filter(|&row| limits[row] == limit).map(|row| heights[row]);
        let expected = all.fold(0.0, f64::max);
        assert!((peak / expected - 1.0).abs() < 3e-5, "{peaks:?} {heights:?}");
    }
}

/// Returns the amplitudes at which a branch passes a frequency (rad/s), in order, interpolated
/// linearly.
fn passed(branch: &Dataset, omega: f64) -> Vec<f64> {
    let rows = table(branch, "branch");
    let at: Vec<f64> = rows.numbers("frequency_Hz").unwrap().iter().map(|f| f * std::f64::consts::TAU).collect();
    let amplitudes = rows.numbers("m_amplitude_m").unwrap();
    let close = |row: usize| (at[row] - omega).abs() < 1e-9;
    let between = |row: usize| (at[row] - omega) * (at[row + 1] - omega) < 0.0 && !close(row) && !close(row + 1);
    let line = |row: usize| {
        let share = (omega - at[row]) / (at[row + 1] - at[row]);
        amplitudes[row] + share * (amplitudes[row + 1] - amplitudes[row])
    };
    let on = (0..at.len()).filter(|row| close(*row)).map(|row| (row, amplitudes[row]));
    let beside = (0..at.len() - 1).filter(|row| between(*row)).map(|row| (row, line(row)));
    let mut found: Vec<(usize, f64)> = on.chain(beside).collect();
    found.sort_by_key(|(row, _)| *row);
    found.into_iter().map(|(_, amplitude)| amplitude).collect()
}

fn near(found: &[f64], expected: &[f64]) {
    let all = found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-3);
    assert!(all, "{found:?} instead of {expected:?}");
}

/// `x'' + 0.02 x' + x - 0.05 x³ = 0.05 cos ωt`, in twentieths of x, softens: it has three
/// orbits between 0.805663 and 0.957875 rad/s. A range that begins there contains all of them,
/// in both directions.
///
/// Reference: an independent harmonic balance with arc length, 15 harmonics, in NumPy.
#[test]
fn a_branch_that_begins_between_folds_covers_its_range() {
    let soft = |frequency: &str| {
        let study = format!("kind = \"branch\"\nfrequency = {frequency}");
        oscillator("0.02 kg/s", r#"{ kind = "cubic", stiffness = "-1.25e-4 N/m^3" }"#, &study)
    };
    let times = |values: &[f64]| values.iter().map(|x| 20.0 * x).collect::<Vec<_>>();
    for (frequency, up) in [
        (r#"{ from = "0.85 rad/s", to = "1.2 rad/s" }"#, true),
        (r#"{ from = "1.2 rad/s", to = "0.85 rad/s" }"#, false),
    ] {
        let branch = soft(frequency);
        assert!(branch.failures.is_empty(), "{:?}", branch.failures);
        let from_below = |values: &[f64]| -> Vec<f64> {
            let mut values = times(values);
            if !up {
                values.reverse();
            }
            values
        };
        near(&passed(&branch, 0.85), &from_below(&[0.180_623_1, 2.664_511, 2.727_506_4]));
        near(&passed(&branch, 0.9), &from_below(&[0.265_614, 2.154_925_5, 2.307_118_1]));
        near(&passed(&branch, 1.0), &times(&[1.063_259]));
        near(&passed(&branch, 1.1), &times(&[0.234_504_7]));
        // the curve is interrupted where it leaves the range
        assert!(branch.figure.panels[0].series.len() >= 3);
        let turns = table(&branch, "turns").numbers("frequency_Hz").unwrap();
        assert!(turns.len() == 1 && (turns[0] - 0.152_448_6).abs() < 1e-4, "{turns:?}");
    }
    for frequency in [r#"{ from = "0.7 rad/s", to = "1.2 rad/s" }"#, r#"{ from = "1.2 rad/s", to = "0.7 rad/s" }"#] {
        let branch = soft(frequency);
        near(table(&branch, "peaks").numbers("amplitude_m").unwrap(), &times(&[3.024_735_4]));
        near(table(&branch, "peaks").numbers("frequency_Hz").unwrap(), &[0.805_724 / std::f64::consts::TAU]);
    }
}

/// The oscillator above with a hardening spring: three orbits between 1.040154 and 1.094317
/// rad/s, and the peak above the start of the range.
#[test]
fn a_branch_that_begins_between_folds_has_the_peak_of_its_range() {
    let study = "kind = \"branch\"\nfrequency = { from = \"1.06 rad/s\", to = \"1.3 rad/s\" }";
    let branch = oscillator("0.02 kg/s", r#"{ kind = "cubic", stiffness = "1.25e-4 N/m^3" }"#, study);
    assert!(branch.failures.is_empty(), "{:?}", branch.failures);
    let mut begin = passed(&branch, 1.06);
    begin.sort_by(f64::total_cmp);
    near(&begin, &[0.420_732_4, 1.650_830_2, 1.928_548_5].map(|x| 20.0 * x));
    near(table(&branch, "peaks").numbers("amplitude_m").unwrap(), &[20.0 * 2.300_106_1]);
    near(table(&branch, "peaks").numbers("frequency_Hz").unwrap(), &[1.093_993_2 / std::f64::consts::TAU]);
}

/// A branch without a range is refused with the reason.
#[test]
fn a_branch_without_a_range_is_refused() {
    let law = r#"{ kind = "coulomb", limit = "1 N" }"#;
    let refused = |frequency: &str| {
        let study = format!("kind = \"branch\"\nfrequency = {frequency}");
        let error = read_study("study.toml", &oscillating("0.1 kg/s", law, &study), &[]).unwrap_err();
        assert_eq!((error.key(), error.line()), (Some("frequency"), Some(22)), "{error}");
        assert!(error.to_string().contains("a branch needs a range"), "{error}");
    };
    refused("\"1 rad/s\"");
    refused("[\"1 rad/s\", \"2 rad/s\", \"1 rad/s\"]");
    refused("\"1 rad/s\"\nvary = { F0 = \"1 N\" }");
    // also with two values of a parameter that are equal
    let same = oscillator("0.1 kg/s", law, "kind = \"branch\"\nfrequency = 0.1\nvary = { F0 = [\"2 N\", \"2 N\"] }");
    assert!(same.failures[0].reason.contains("a branch needs a range"), "{:?}", same.failures);
}

/// A mass of 1 kg on 2 N/m and bristles of 1e5 N/m. Friction of 1 N overdamps its vibration at
/// amplitudes between 10 µm and half a metre. The study follows the mode from small amplitudes.
///
/// Reference: free modes of 9 and 15 harmonics in SciPy, which agree to 5e-6. At rest `lugre`
/// has the damping ratio `(s1 + s2)/(2 √((s0 + k) m))` = 0.500628 at 50.3297 Hz.
#[test]
fn stiff_bristles_on_a_soft_spring_have_their_mode() {
    let lugre = r#"{ kind = "lugre", stiffness = "1e5 N/m", damping = "316.2278 N s/m", viscous = "0.4 N s/m", limit = "1 N", static_limit = "1.5 N", velocity = "0.001 m/s" }"#;
    let dahl = r#"{ kind = "dahl", stiffness = "1e5 N/m", limit = "1 N" }"#;
    let mode = |law: &str, range: &str| {
        let text = oscillating("0 kg/s", law, &format!("kind = \"modes\"\namplitude = {range}"));
        dataset(&text.replace("1 N/m\"\ndamping", "2 N/m\"\ndamping"))
    };
    let check = |found: &Dataset, expected: &[(f64, f64, f64)]| {
        let rows = table(found, "modes");
        let column = |name: &str| rows.numbers(name).unwrap();
        let (sizes, frequencies, ratios) =
            (column("m_first_harmonic_m"), column("frequency_Hz"), column("damping_ratio"));
        for (size, frequency, ratio) in expected {
            let row = sizes.iter().position(|x| (x / size - 1.0).abs() < 1e-6).unwrap_or_else(|| panic!("{size}"));
            let errors = [frequencies[row] / frequency - 1.0, ratios[row] / ratio - 1.0];
            assert!(errors.iter().all(|error| error.abs() < 1e-3), "{size}: {} {}", frequencies[row], ratios[row]);
        }
    };
    let found = mode(lugre, r#"{ from = "1 nm", to = "1 um", points = 4 }"#);
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    check(
        &found,
        &[
            (1e-9, 50.3290, 0.500_649),
            (1e-8, 50.3226, 0.500_840),
            (1e-7, 50.2581, 0.502_753),
            (1e-6, 49.5658, 0.522_349),
        ],
    );
    let found = mode(dahl, r#"{ from = "1 um", to = "1 m", points = 7 }"#);
    check(&found, &[(1e-6, 50.23725, 0.021_215_9), (1e-5, 43.1561, 0.208_170)]);
}

/// With the limit zero in every joint the mode is linear: ω = √(k/m), with the damping ratio
/// c/(2 √(k m)).
#[test]
fn a_mode_without_friction_is_linear() {
    let study = r#"kind = "modes"
amplitude = { from = "1 mm", to = "1 m", points = 5 }"#;
    for law in [r#"{ kind = "coulomb", limit = 0 }"#, r#"{ kind = "jenkins", stiffness = "0.5 N/m", limit = 0 }"#] {
        let found = oscillator("0.1 kg/s", law, study);
        assert!(found.failures.is_empty(), "{law}: {:?}", found.failures);
        let modes = table(&found, "modes");
        let (frequencies, damping) = (modes.numbers("frequency_Hz").unwrap(), modes.numbers("damping_ratio").unwrap());
        assert_eq!(frequencies.len(), 5);
        for (frequency, damping) in frequencies.iter().zip(damping) {
            assert!((frequency * std::f64::consts::TAU - 1.0).abs() < 1e-9, "{law}: {frequency}");
            assert!((damping - 0.05).abs() < 1e-9, "{law}: {damping}");
        }
    }
}

/// A list of values has the same optimum in any order, and its rows keep the order of the list.
#[test]
fn performance_takes_values_in_any_order() {
    let of = |limits: &str| {
        let study = format!(
            "kind = \"performance\"\nfrequency = {{ from = \"0.14 Hz\", to = \"0.24 Hz\", points = 21 }}\nvary = {{ F = {limits} }}"
        );
        let text = oscillating("0.1 kg/s", "{ kind = \"jenkins\", stiffness = \"0.5 N/m\", limit = \"F\" }", &study);
        let text = text.replace("F0 = \"1 N\"", "F0 = \"1 N\"\nF = \"1 N\"");
        let data = dataset(&text);
        let optimum = table(&data, "optimum").numbers("F_N").unwrap()[0];
        (optimum, table(&data, "performance").numbers("F_N").unwrap().to_vec())
    };
    let (rising, _) = of("[\"0.1 N\", \"0.5 N\", \"1 N\", \"4 N\"]");
    let (mixed, listed) = of("[\"0.1 N\", \"4 N\", \"0.5 N\", \"1 N\"]");
    assert!(rising > 0.1 && rising < 4.0 && mixed == rising, "{rising} {mixed}");
    assert_eq!(listed, [0.1, 4.0, 0.5, 1.0]);
}

/// Curves of a performance study carry the value of their outer parameter, so that a figure of
/// many curves has a colour bar.
#[test]
fn performance_curves_carry_their_parameter() {
    let law = r#"{ kind = "coulomb", limit = "Ft" }"#;
    let study = r#"kind = "performance"
frequency = { from = "0.6 rad/s", to = "1.4 rad/s", points = 9 }
vary = { F0 = ["1 N", "2 N"], Ft = ["0.2 N", "0.4 N", "0.6 N"] }"#;
    let text = oscillating("0.1 kg/s", law, study).replace("[parameters]", "[parameters]\nFt = \"1 N\"");
    let figure = dataset(&text).figure;
    let axis = figure.varied.unwrap();
    assert_eq!((axis.quantity.as_str(), axis.unit.as_str()), ("F0", "N"));
    let curves = figure.panels[0].series.iter().filter(|series| series.style == Style::Solid);
    assert_eq!(curves.map(|series| series.value).collect::<Vec<_>>(), [Some(1.0), Some(2.0)]);
}

/// Peaks of a series that is too short for its tolerance have triangles.
#[test]
fn inexact_peaks_are_marked() {
    let law = r#"{ kind = "coulomb", limit = "Ft" }"#;
    let study = r#"kind = "performance"
frequency = { from = "0.6 rad/s", to = "1.4 rad/s", points = 9 }
vary = { Ft = ["200 mN", "400 mN"] }
[method]
kind = "harmonic-balance"
harmonics = 3
tolerance = 1e-9"#;
    let text = oscillating("0.1 kg/s", law, study).replace("[parameters]", "[parameters]\nFt = \"1 N\"");
    let figure = dataset(&text).figure;
    assert_eq!(figure.panels[0].x.unit, "mN");
    let series = &figure.panels[0].series;
    let marked = series.iter().find(|series| series.style == Style::Warning).expect("triangles");
    assert_eq!((marked.label.as_str(), &marked.x[..]), ("points: 2 less exact than requested", &[200.0, 400.0][..]));
}

/// Invalid options that depend on the model are reported at their place in the file.
#[test]
fn harmonics_below_the_excitation_are_refused_in_their_place() {
    let text = r#"
schema = 1
title = "Fifth harmonic"
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/m"
[[force]]
on = "m"
amplitude = "1 N"
harmonic = 5
[study]
kind = "branch"
frequency = { from = "1 rad/s", to = "2 rad/s", points = 2 }
harmonics = 3
"#;
    let study = read_study("study.toml", text, &[]).unwrap();
    let error = run(&study, &Context::without_progress(1)).unwrap_err();
    assert_eq!(error.key(), Some("harmonics"));
    assert_eq!(error.line(), Some(17), "{error}");
}

/// A hardening cubic spring: `branch` turns twice, as does the one-term formula
/// `F² = ((k + ¾ k₃ a² - ω²)² + c² ω²) a²`. The orbits between the two turns are unstable.
#[test]
fn a_duffing_oscillator_has_both_folds_and_an_unstable_middle() {
    let text = oscillating("0.1 kg/s", r#"{ kind = "cubic", stiffness = "1 N/m^3" }"#, "").replace("1 N\"", "0.3 N\"");
    let text = text.split("[study]").next().unwrap().to_owned()
        + "[method]\nkind = \"harmonic-balance\"\nharmonics = 9\n[study]\nkind = \"branch\"\n\
           frequency = { from = \"0.1 Hz\", to = \"0.4 Hz\", points = 151 }\n";
    let dataset = dataset(&text);
    // ω² of both sides of the backbone by amplitude, and the turning points of ω along the
    // curve
    let omega = |a: f64, side: f64| {
        let (spring, c2, f2) = (1.0 + 0.75 * a * a, 0.01, 0.09);
        let middle = spring - 0.5 * c2;
        let root = middle * middle - spring * spring + f2 / (a * a);
        (root >= 0.0).then(|| (middle + side * root.sqrt()).max(0.0).sqrt())
    };
    let upper: Vec<(f64, f64)> =
        (300..1800).filter_map(|i| Some((omega(1e-3 * f64::from(i), 1.0)?, 1e-3 * f64::from(i)))).collect();
    let lower = upper.iter().copied().fold((f64::INFINITY, 0.0), |best, one| if one.0 < best.0 { one } else { best });
    let highest = upper
        .iter()
        .copied()
        .filter(|one| one.1 > lower.1)
        .fold((0.0, 0.0), |best: (f64, f64), one| if one.0 > best.0 { one } else { best });
    let turns = table(&dataset, "turns");
    let (frequency, amplitude) = (turns.numbers("frequency_Hz").unwrap(), turns.numbers("amplitude_m").unwrap());
    assert_eq!(frequency.len(), 2, "{frequency:?}");
    for (i, (omega, a)) in [highest, lower].into_iter().enumerate() {
        let hertz = omega / std::f64::consts::TAU;
        assert!((frequency[i] / hertz - 1.0).abs() < 0.01, "{i}: {} {hertz}", frequency[i]);
        // higher harmonics raise the largest displacement by a few percent
        assert!((amplitude[i] / a - 1.0).abs() < 0.05, "{i}: {} {a}", amplitude[i]);
    }
    let branch = table(&dataset, "branch");
    let stable = branch.flags("stable").unwrap();
    let first = stable.iter().position(|s| *s == Some(false)).unwrap();
    let last = stable.iter().rposition(|s| *s == Some(false)).unwrap();
    assert!(first > 0 && last + 1 < stable.len() && last - first > 5);
    assert!(stable[first..=last].iter().all(|s| *s == Some(false)), "the unstable orbits are one piece");
}

/// A block on a belt sticks until its spring pulls with the static limit. Then it slides about
/// the deflection of the dynamic limit, initially with the velocity of the belt. The belt is a
/// slow and long imposed motion, as the book advises.
#[test]
fn a_slow_motion_models_a_belt() {
    let book = include_str!("../../../../docs/src/laws.md");
    let from = book.find("schema = 1\n[parameters]\nv =").unwrap();
    let text = &book[from..from + book[from..].find("```").unwrap()];
    let found = dataset(text);
    assert!(found.failures.is_empty() && found.record.points.get("converged") == Some(&1), "{:?}", found.record);
    let x = table(&found, "motion").numbers("block_displacement_m").unwrap();
    let (fs, fc, k, omega, v) = (2.0f64, 1.0, 100.0, 10.0, 0.05);
    let slide = ((fs - fc) / k).hypot(v / omega);
    let late = &x[x.len() / 2..];
    let (low, high) = late.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    // between samples the turning points are missed by slide (ω Δt)²/8
    let missed = slide * (omega * 2e-3f64).powi(2) / 8.0 + 1e-9;
    assert!((high - fc / k - slide).abs() < missed && (low - fc / k + slide).abs() < missed, "{low} {high} {slide}");
}

/// A node begins at the given displacements, direction by direction; its name alone is refused.
#[test]
fn a_node_begins_along_its_directions() {
    let text = |start: &str| {
        format!(
            "schema = 1\ntitle = \"Node\"\n[[mass]]\nname = \"b\"\nmass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n\
             [[spring]]\nbetween = [\"b.x\", \"ground\"]\nstiffness = \"1 N/m\"\n\
             [[spring]]\nbetween = [\"b.z\", \"ground\"]\nstiffness = \"4 N/m\"\n\
             [study]\nkind = \"transient\"\nstart = {{ {start} }}\nduration = \"1 s\"\ntime_step = \"0.1 s\"\n"
        )
    };
    let dataset = dataset(&text("\"b.z\" = \"5 mm\""));
    let motion = table(&dataset, "motion");
    assert_eq!(motion.numbers("b_x_displacement_m").unwrap()[0], 0.0);
    assert_eq!(motion.numbers("b_z_displacement_m").unwrap()[0], 5e-3);
    let study = read_study("study.toml", &text("b = \"5 mm\""), &[]);
    let problem = study.err().map(|error| error.to_string()).unwrap_or_default();
    assert!(problem.contains("`b` has several directions"), "{problem}");
}
