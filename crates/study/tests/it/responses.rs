//! Additional results of a response, against closed forms of linear oscillators and sums over
//! single loops.

use std::f64::consts::TAU;
use stickslip_study::dataset::{CellValues, Dataset, Emphasis, Panel, Style, Table};
use stickslip_study::read_study;
use stickslip_study::run::{Context, run};

fn dataset(text: &str) -> Dataset {
    run(&read_study("study.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap()
}

fn table<'a>(dataset: &'a Dataset, name: &str) -> &'a Table {
    dataset.tables.iter().find(|table| table.name == name).unwrap()
}

fn numbers<'a>(dataset: &'a Dataset, name: &str, column: &str) -> &'a [f64] {
    let found = table(dataset, name).numbers(column);
    found.unwrap_or_else(|| panic!("{column} in {:?}", table(dataset, name).columns.iter().map(|c| &c.name)))
}

/// 1 kg on 100 N/m and 0.5 N s/m under 2 N, with a joint of 50 N/m.
fn oscillator(limit: &str, study: &str) -> Dataset {
    dataset(&format!(
        r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "100 N/m"
damping = "0.5 N s/m"
[[joint]]
name = "foot"
between = ["m", "ground"]
law = {{ kind = "jenkins", stiffness = "50 N/m", limit = "{limit}" }}
[[force]]
on = "m"
amplitude = "2 N"
{study}
"#
    ))
}

/// Amplitude of a linear oscillator of 1 kg and 0.5 N s/m under 2 N.
fn linear(stiffness: f64, omega: f64) -> f64 {
    2.0 / (stiffness - omega * omega).hypot(0.5 * omega)
}

#[test]
fn references_are_the_linear_structures() {
    let found = oscillator(
        "0.5 N",
        r#"
[study]
kind = "response"
frequency = { from = "1 Hz", to = "3 Hz", points = 21 }
[figure]
references = true
"#,
    );
    let frequency = numbers(&found, "references", "frequency_Hz");
    let (free, stuck) =
        (numbers(&found, "references", "m_free_amplitude_m"), numbers(&found, "references", "m_stuck_amplitude_m"));
    for (i, f) in frequency.iter().enumerate() {
        let ratios = (free[i] / linear(100.0, TAU * f) - 1.0, stuck[i] / linear(150.0, TAU * f) - 1.0);
        assert!(ratios.0.abs() < 1e-9 && ratios.1.abs() < 1e-9, "{f} Hz: {ratios:?}");
    }
    let references = found.figure.panels[0].series.iter().filter(|series| series.emphasis == Emphasis::Reference);
    assert_eq!(
        references.map(|series| series.label.as_str()).collect::<Vec<_>>(),
        ["all joints free", "all joints stuck"]
    );
}

/// A damper that only its joint holds against a constant force has amplitudes with free joints.
#[test]
fn a_free_damper_has_references() {
    let text = r#"
schema = 1
[[mass]]
name = "blade"
mass = "1 kg"
[[mass]]
name = "damper"
mass = "0.1 kg"
[[spring]]
between = ["blade", "ground"]
stiffness = "100 N/mm"
damping = "5 kg/s"
[[joint]]
name = "face"
between = ["damper", "blade"]
law = { kind = "jenkins", stiffness = "50 N/mm", limit = "1 N" }
[[force]]
on = "damper"
amplitude = "0.3 N"
harmonic = 0
[[force]]
on = "blade"
amplitude = "10 mN"
[study]
kind = "response"
frequency = { from = "40 Hz", to = "60 Hz", points = 5 }
[figure]
references = true
"#;
    let found = run(&read_study("damper.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap();
    let (frequencies, free) =
        (numbers(&found, "references", "frequency_Hz"), numbers(&found, "references", "blade_free_amplitude_m"));
    for (hertz, found) in frequencies.iter().zip(free) {
        let omega = TAU * hertz;
        let expected = 0.01 / (1e5 - omega * omega).hypot(5.0 * omega);
        assert!((found / expected - 1.0).abs() < 1e-9, "{hertz} Hz: {found} {expected}");
    }
    assert!(numbers(&found, "references", "blade_stuck_amplitude_m").iter().all(|value| *value > 0.0));
}

/// Three forces have three pairs of linear references, each in the colour of its case; three
/// limits have one pair.
#[test]
fn references_belong_to_their_cases() {
    let study = |vary: &str| {
        let text = format!(
            r#"
schema = 1
[parameters]
F = "1 N"
Ft = "1 N"
[[mass]]
name = "body"
mass = "1 kg"
[[spring]]
between = ["body", "ground"]
stiffness = "10 N/mm"
damping = "2 N s/m"
[[joint]]
name = "foot"
between = ["body", "ground"]
law = {{ kind = "jenkins", stiffness = "2 N/mm", limit = "Ft" }}
[[force]]
on = "body"
amplitude = "F"
[study]
kind = "response"
frequency = {{ from = "14 Hz", to = "19 Hz", points = 11 }}
vary = {{ {vary} }}
[figure]
references = true
"#
        );
        dataset(&text)
    };
    let found = study("F = [\"1 N\", \"2 N\", \"4 N\"]");
    let (force, frequency) = (numbers(&found, "references", "F_N"), numbers(&found, "references", "frequency_Hz"));
    for (what, k) in [("free", 10e3), ("stuck", 12e3)] {
        let column = format!("body_{what}_amplitude_m");
        for (i, amplitude) in numbers(&found, "references", &column).iter().enumerate() {
            let omega = TAU * frequency[i];
            let expected = force[i] / (k - omega * omega).hypot(2.0 * omega);
            assert!((amplitude / expected - 1.0).abs() < 1e-9, "{what} at {} N: {amplitude} {expected}", force[i]);
        }
    }
    let lines = |found: &Dataset, emphasis: Emphasis| -> Vec<(String, usize)> {
        let series = found.figure.panels[0].series.iter().filter(|series| series.emphasis == emphasis);
        series.map(|series| (series.label.clone(), series.colour)).collect()
    };
    let of = |what: &str, colour: usize| (format!("all joints {what}, for each case"), colour);
    let own: Vec<(String, usize)> = (0..3).flat_map(|case| [of("free", case), of("stuck", case)]).collect();
    assert_eq!((lines(&found, Emphasis::OwnReference), lines(&found, Emphasis::Reference)), (own, Vec::new()));
    // a limit does not change the linear structure
    let alike = study("Ft = [\"1 N\", \"2 N\", \"4 N\"]");
    let grey = ["all joints free", "all joints stuck"].map(|label| (label.to_owned(), 0));
    assert_eq!(
        (lines(&alike, Emphasis::OwnReference), lines(&alike, Emphasis::Reference)),
        (Vec::new(), grey.to_vec())
    );
    assert_eq!(numbers(&alike, "references", "Ft_N").iter().filter(|limit| **limit != 1.0).count(), 0);
    // of many cases, the first and the last are named
    let many = study("F = { from = \"1 N\", to = \"9 N\", points = 9 }");
    let named: Vec<String> = lines(&many, Emphasis::OwnReference).into_iter().map(|(label, _)| label).collect();
    let expected = ["free, F = 1 N", "stuck, F = 1 N", "free, F = 9 N", "stuck, F = 9 N"];
    assert_eq!(named, expected.map(|end| format!("all joints {end}")));
}

#[test]
fn outputs_of_a_linear_oscillator() {
    let found = oscillator(
        "0 N",
        r#"
[study]
kind = "response"
frequency = ["1 Hz", "2 Hz"]
output = ["velocity", "acceleration", "harmonics", "receptance", "joint_force", "joint_motion"]
"#,
    );
    for (row, f) in [1.0, 2.0].into_iter().enumerate() {
        let omega = TAU * f;
        let amplitude = linear(100.0, omega);
        let near = |column: &str, expected: f64| {
            let value = numbers(&found, "curve", column)[row];
            assert!((value - expected).abs() < 1e-5 * expected + 1e-12, "{column}: {value} {expected}");
        };
        near("m_velocity_amplitude_m_per_s", omega * amplitude);
        near("m_acceleration_amplitude_m_per_s2", omega * omega * amplitude);
        near("m_receptance_m_per_N", amplitude / 2.0);
        near("m_harmonic1_m", amplitude);
        near("m_harmonic3_m", 0.0);
        near("foot_force_amplitude_N", 0.0);
        near("foot_amplitude_m", amplitude);
    }
}

/// At this low frequency only springs and friction count: the joint slips at 2 N of the 5 N,
/// and loads the other blade by 2 N.
#[test]
fn auto_reports_the_replacing_method() {
    let found = dataset(
        r#"
schema = 1
[[mass]]
repeat = { i = 2 }
name = "blade{i}"
mass = "0.18 kg"
[[spring]]
repeat = { i = 2 }
between = ["blade{i}", "ground"]
stiffness = "99 N/mm + 6 N/mm * i"
damping = "0.1 kg/s"
[[joint]]
name = "shroud"
between = ["blade1", "blade2"]
law = { kind = "coulomb", limit = "2 N" }
[[force]]
on = "blade1"
amplitude = "5 N"
[study]
kind = "response"
frequency = { from = "0.0001 Hz", to = "0.001 Hz", points = 3 }
peaks = false
"#,
    );
    assert_eq!(found.record.points["converged"], 3);
    let expected = "At 3 points `event-driven`, the choice of `auto`, found no orbit; `harmonic-balance` found one.";
    assert!(found.notes.iter().any(|note| note == expected), "{:?}", found.notes);
    let (first, second) = (3.0 / 105e3, 2.0 / 111e3);
    for (column, expected) in [("blade1_amplitude_m", first), ("blade2_amplitude_m", second)] {
        let amplitudes = numbers(&found, "curve", column);
        // the tolerance of harmonic balance, relative to the largest vibration
        assert!(amplitudes.iter().all(|x| (x - expected).abs() < 1e-3 * first), "{column} {amplitudes:?}");
    }
}

#[test]
fn a_slipping_joint_carries_its_limit() {
    let study = "[study]\nkind = \"response\"\nfrequency = [\"1.7 Hz\"]\noutput = \"joint_force\"";
    let found = oscillator("0.5 N", study);
    assert!((numbers(&found, "curve", "foot_force_amplitude_N")[0] - 0.5).abs() < 1e-12);
}

/// Contacts under an imposed motion `a cos φ`. A slider behind a spring sticks after every
/// turning point until the motion has gone back by `2 Ft/kt`: `cos φ = 1 - 2 Ft/(kt a)`. A stop
/// at `g` is closed while `a cos φ > g`.
#[test]
fn shares_of_the_period_are_closed_forms() {
    let half_turn = std::f64::consts::PI;
    let stick = (1.0f64 - 2.0 * 0.15 / (0.2 * 2.0)).acos() / half_turn;
    let open = 1.0 - (1.2f64 / 2.0).acos() / half_turn;
    // a joint without contact faces
    let spring = "[[joint]]\nname = \"spring\"\nbetween = [\"m\", \"ground\"]\nlaw = { kind = \"cubic\", stiffness = \"1e3 N/m^3\" }";
    // tolerance by the sampling of contact in each method
    for (method, near) in
        [("event-driven", 1e-9), ("shooting", 2e-3), ("transient", 2e-3), ("harmonic-balance", 1.0 / 256.0)]
    {
        let found = dataset(&format!(
            r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[mass]]
name = "free"
mass = "1 kg"
[[spring]]
between = ["free", "ground"]
stiffness = "1 N/mm"
damping = "1 N s/m"
[[force]]
on = "free"
amplitude = "1 N"
[[motion]]
on = "m"
amplitude = "2 mm"
[[joint]]
name = "pad"
between = ["m", "ground"]
law = {{ kind = "jenkins", stiffness = "0.2 N/mm", limit = "0.15 N" }}
[[joint]]
name = "stop"
between = ["m", "ground"]
law = {{ kind = "gap", gap = "1.2 mm", stiffness = "1 N/mm" }}
{}
[study]
kind = "response"
frequency = ["1 Hz"]
output = "contact"
[method]
kind = "{method}"
{}
"#,
            if method == "event-driven" { "" } else { spring },
            if method == "harmonic-balance" { "harmonics = 9\nsamples = 512\ntolerance = 0.9" } else { "" }
        ));
        let share = |name: &str| numbers(&found, "curve", &format!("{name}_fraction"))[0];
        for (name, expected) in [
            ("pad_stick", stick),
            ("pad_slip", 1.0 - stick),
            ("pad_open", 0.0),
            ("stop_stick", 0.0),
            ("stop_slip", 0.0),
            ("stop_open", open),
        ] {
            assert!((share(name) - expected).abs() <= near, "{method}, {name}: {} {expected}", share(name));
        }
        assert!(method == "event-driven" || share("spring_stick").is_nan(), "{method}");
    }
}

/// Many joints are drawn as a map with a stripe for each one, shaded by the columns. A few are
/// drawn as areas that fill the period.
#[test]
fn contacts_are_drawn_as_a_map_or_as_areas() {
    let text = |sectors: usize, extra: &str| {
        format!(
            "schema = 1\nmodel = {{ template = \"bladed-ring\" }}\n[disk]\nsectors = {sectors}\n{extra}\n[study]\nkind = \"response\"\n\
             frequency = {{ from = \"110 Hz\", to = \"120 Hz\", points = 7 }}\noutput = \"contact\"\nvary = {{ Ft = [\"4 N\"] }}\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 3\ntolerance = 0.9\n"
        )
    };
    let found = dataset(&text(8, ""));
    let map = found.figure.panels.iter().find(|panel| !panel.y.names.is_empty()).unwrap();
    assert_eq!((map.y.names.len(), map.series.len()), (8, 8));
    for (joint, stripe) in map.series.iter().enumerate() {
        let slip = numbers(&found, "curve", &format!("{}_slip_fraction", map.y.names[joint]));
        assert!(stripe.shades.iter().zip(slip).all(|(shade, share)| *shade == 100.0 * share), "{joint}");
        assert_eq!(stripe.y, [joint as f64; 7]);
    }
    assert_eq!(found.figure.varied.as_ref().unwrap().range, Some([0.0, 100.0]));
    // two sectors: one panel each, and the areas together are the whole period
    let found = dataset(&text(2, ""));
    let areas = found.figure.panels.iter().filter(|panel| panel.y.quantity == "share of the period");
    let tops: Vec<&[f64]> = areas.map(|panel| &panel.series.last().unwrap().y[..]).collect();
    assert!(tops.len() == 2 && tops.iter().all(|top| top.iter().all(|y| (y - 100.0).abs() < 1e-9)), "{tops:?}");
    // with many cases the slip fraction is a curve for each, and with many joints it is their
    // mean
    let limits = "vary = { Ft = { from = \"1 N\", to = \"9 N\", points = 8 } }";
    let found = dataset(&text(8, "").replace("vary = { Ft = [\"4 N\"] }", limits));
    let panel = found.figure.panels.last().unwrap();
    assert_eq!((panel.title.as_str(), panel.series.len()), ("mean of 8 joints, slips", 8));
    let slip = |joint: usize| numbers(&found, "curve", &format!("damper_{joint}_slip_fraction"))[10];
    let mean = (0..8).map(slip).sum::<f64>() / 8.0;
    assert!((panel.series[1].y[3] - 100.0 * mean).abs() < 1e-9, "{} {mean}", panel.series[1].y[3]);
}

/// Two masses: of the named ones, the largest amplitude counts at every frequency.
#[test]
fn the_worst_of_several_masses_counts() {
    let text = r#"
schema = 1
[model]
template = "blade-couple"
[study]
kind = "response"
frequency = { from = "119.5 Hz", to = "122.5 Hz", points = 61 }
vary = { Ft = ["2 N", "8 N"] }
peak_of = "all"
"#;
    let found = dataset(text);
    let single = dataset(&text.replace("peak_of = \"all\"", ""));
    let all = table(&single, "peaks");
    let (limits, heights) = (numbers(&single, "peaks", "Ft_N"), numbers(&single, "peaks", "amplitude_m"));
    let CellValues::Text(masses) = &table(&found, "peaks").columns[1].values else { panic!() };
    for limit in [2.0, 8.0] {
        let highest = (0..all.rows()).filter(|&row| limits[row] == limit).map(|row| heights[row]).fold(0.0, f64::max);
        let rows = (0..masses.len()).filter(|&row| numbers(&found, "peaks", "Ft_N")[row] == limit);
        let worst = rows.map(|row| numbers(&found, "peaks", "amplitude_m")[row]).fold(0.0, f64::max);
        assert!((worst / highest - 1.0).abs() < 1e-9, "{limit} N: {worst} {highest}");
    }
    assert!(masses.iter().any(|mass| mass == "blade1"), "{masses:?}");
}

/// Ten parallel sliders: force and loss of the sum are the sums.
#[test]
fn loops_of_several_joints_add_up() {
    let text = r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[motion]]
on = "m"
amplitude = "1 mm"
[[joint]]
repeat = { i = 10 }
name = "j{i}"
between = ["m", "ground"]
law = { kind = "jenkins", stiffness = "0.2 N/mm", limit = "0.015 N * i" }
[study]
kind = "hysteresis"
frequency = "1 rad/s"
sum = true
"#;
    let found = dataset(text);
    // 4 Ft (a - Ft/kt) of those that slip, Ft < kt a = 0.2 N
    let loss: f64 = (1..=10).map(|i| 0.015 * f64::from(i)).map(|ft| 4.0 * ft * (1e-3 - ft / 200.0)).sum();
    assert!((numbers(&found, "loops_summary", "dissipation_J")[0] / loss - 1.0).abs() < 1e-9);
    let largest = numbers(&found, "loops", "force_N").iter().fold(0.0f64, |a, f| a.max(f.abs()));
    assert!((largest - 0.015 * 55.0).abs() < 1e-12, "{largest}");
    // over the displacement of the mass it is the same loop
    let against = dataset(
        &text
            .replace("sum = true", "sum = true\nagainst = \"m\"")
            .replace("[[motion]]\non = \"m\"\namplitude = \"1 mm\"", "[[force]]\non = \"m\"\namplitude = \"2 mN\""),
    );
    assert_eq!(table(&against, "loops_summary").rows(), 1);
}

#[test]
fn adaptive_frequencies_lie_where_the_curve_bends() {
    let found = oscillator(
        "0.5 N",
        "[study]\nkind = \"response\"\nfrequency = { from = \"0.5 Hz\", to = \"20 Hz\", tolerance = \"0.5 %\" }",
    );
    let frequency = numbers(&found, "curve", "frequency_Hz");
    assert_eq!((frequency[0], frequency[frequency.len() - 1]), (0.5, 20.0));
    assert!(frequency.is_sorted());
    let within = |from: f64, to: f64| frequency.iter().filter(|f| (from..to).contains(*f)).count() as f64 / (to - from);
    // resonances between 1.6 Hz (free) and 1.95 Hz (stuck)
    assert!(within(1.5, 2.1) > 10.0 * within(10.0, 20.0), "{} {}", within(1.5, 2.1), within(10.0, 20.0));
    let text = "schema = 1\n[model]\ntemplate = \"blade-couple\"\n[study]\nkind = \"orbit\"\nfrequency = { from = \"1 Hz\", to = \"2 Hz\", tolerance = \"1 %\" }";
    let error = read_study("study.toml", text, &[]).unwrap_err().to_string();
    assert!(error.contains("needs a fixed number of frequencies"), "{error}");
}

#[test]
fn many_masses_are_drawn_as_their_envelope() {
    let found = dataset(
        r#"
schema = 1
[[mass]]
repeat = { i = 9 }
name = "b{i}"
mass = "1 kg"
[[spring]]
repeat = { i = 9 }
between = ["b{i}", "ground"]
stiffness = "100 N/m * (1 + 0.01*i)"
damping = "1 N s/m"
[[force]]
repeat = { i = 9 }
on = "b{i}"
amplitude = "1 N"
[study]
kind = "response"
frequency = { from = "1 Hz", to = "2 Hz", points = 41 }
"#,
    );
    let series = &found.figure.panels[0].series;
    let (pale, normal): (Vec<_>, Vec<_>) = series.iter().partition(|series| series.emphasis == Emphasis::Pale);
    assert_eq!((pale.len(), normal.len()), (9, 1));
    let highest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    let largest = pale.iter().map(|series| highest(&series.y)).fold(0.0, f64::max);
    assert_eq!(highest(&normal[0].y), largest);
    assert!(series.iter().all(|series| series.label.ends_with("of 9 places")), "{:?}", series[0].label);
    // with equal damping, the softest place has the largest amplitude at its resonance: F/(c ω)
    assert!(found.figure.panels[0].title.contains("maximum at b1"), "{}", found.figure.panels[0].title);
}

/// The band of many places equals that of the exact curves at each of its abscissae. The places
/// are linear oscillators with resonances between the points of the curve, different in each
/// draw.
#[test]
fn bands_of_the_largest_of_many_places_are_exact() {
    let (count, damping) = (48, 0.05);
    let found = dataset(&format!(
        r#"
schema = 1
[parameters]
k = "100 N/m"
[sample]
count = {count}
of = {{ k = {{ uniform = ["95 N/m", "105 N/m"] }} }}
[[mass]]
repeat = {{ i = 9 }}
name = "b{{i}}"
mass = "1 kg"
[[spring]]
repeat = {{ i = 9 }}
between = ["b{{i}}", "ground"]
stiffness = "k * (1 + 0.02*i)"
damping = "{damping} N s/m"
[[force]]
repeat = {{ i = 9 }}
on = "b{{i}}"
amplitude = "1 N"
[study]
kind = "response"
frequency = {{ from = "1.4 Hz", to = "1.9 Hz", points = 11 }}
"#
    ));
    let drawn = numbers(&found, "curve", "k_N_per_m").to_vec();
    let stiffness: Vec<f64> = drawn.chunks(11).map(|rows| rows[0]).collect();
    assert_eq!(stiffness.len(), count);
    let series = &found.figure.panels[0].series;
    assert_eq!(series[0].x.len(), 11, "no draw's own peak is an abscissa of all");
    for (at, f) in series[0].x.iter().enumerate() {
        let omega = TAU * f;
        let amplitude = |k: f64| 1.0 / (k - omega * omega).hypot(damping * omega);
        let largest = |k: &f64| (1..=9).map(|i| amplitude(k * (1.0 + 0.02 * f64::from(i)))).fold(0.0, f64::max);
        let mut values: Vec<f64> = stiffness.iter().map(largest).collect();
        values.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let at = share * (count - 1) as f64;
            let below = values[at as usize];
            below + (values[at.ceil() as usize] - below) * at.fract()
        };
        let unit = if found.figure.panels[0].y.unit == "mm" { 1e3 } else { 1.0 };
        for (found, share) in [(series[0].base[at], 0.05), (series[0].y[at], 0.95), (series[1].y[at], 0.5)] {
            let expected = unit * quantile(share);
            assert!((found / expected - 1.0).abs() < 1e-9, "{f} Hz, {share}: {found} {expected}");
        }
    }
}

#[test]
fn axes_take_every_unit_of_their_quantity() {
    for (unit, shown) in [("rad/s", TAU), ("kHz", 1e-3), ("Hz", 1.0)] {
        let found = oscillator(
            "0.5 N",
            &format!("[study]\nkind = \"response\"\nfrequency = [\"1 Hz\", \"2 Hz\"]\n[figure]\nx_unit = \"{unit}\""),
        );
        let panel = &found.figure.panels[0];
        assert_eq!(panel.x.unit, unit);
        assert!((panel.series[0].x[1] / (2.0 * shown) - 1.0).abs() < 1e-12, "{unit}: {:?}", panel.series[0].x);
    }
}

/// Without damping, friction with a small limit does not bound the resonance, so the curve has
/// no peak. With damping it has one.
#[test]
fn an_unbounded_point_is_not_a_peak() {
    let text = r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "10 N/mm"
[[joint]]
name = "foot"
between = ["m", "ground"]
law = { kind = "coulomb", limit = "0.2 N" }
[[force]]
on = "m"
amplitude = "2 N"
[study]
kind = "response"
frequency = { from = "14 Hz", to = "19 Hz", points = 101 }
"#;
    let found = dataset(text);
    assert!(found.record.points.contains_key("peak-unsettled"), "{:?}", found.record.points);
    let damped = text.replace("stiffness = \"10 N/mm\"", "stiffness = \"10 N/mm\"\ndamping = \"2 N s/m\"");
    let found = dataset(&damped);
    assert_eq!(found.record.points.keys().collect::<Vec<_>>(), ["converged"]);
}

/// A mass of 1 kg on a spring with a damper, a joint to the ground and a force.
fn one_mass(spring: &str, damping: &str, law: &str, force: &str, rest: &str) -> String {
    format!(
        r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "{spring}"
damping = "{damping}"
[[joint]]
name = "joint"
between = ["m", "ground"]
law = {{ {law} }}
[[force]]
on = "m"
amplitude = "{force}"
{rest}
"#
    )
}

/// A stop with a gap bends the resonance. The upper branch is followed to its end for any
/// number and place of the points. The peak equals that of the branch by arc length. SciPy's
/// DOP853, swept up, is on it at 18.29 Hz.
#[test]
fn the_upper_branch_is_followed_on_every_grid() {
    for frequency in ["points = 151", "points = 601", "tolerance = \"0.1 %\""] {
        for method in ["auto", "harmonic-balance"] {
            let range = format!("frequency = {{ from = \"10 Hz\", to = \"25 Hz\", {frequency} }}");
            let rest = format!("[method]\nkind = \"{method}\"\n[study]\nkind = \"response\"\n{range}");
            let stop = r#"kind = "gap", gap = "1 mm", stiffness = "1e4 N/m""#;
            let text = one_mass("1e4 N/m", "2 kg/s", stop, "2 N", &rest);
            let found = dataset(&text);
            let peaks = found.tables.iter().find(|table| table.name == "peaks").unwrap();
            let (at, height) = (peaks.numbers("frequency_Hz").unwrap(), peaks.numbers("amplitude_m").unwrap());
            let highest = (0..height.len()).max_by(|&a, &b| height[a].total_cmp(&height[b])).unwrap();
            let (at, height) = (at[highest], height[highest]);
            assert!(
                (at - 18.2992).abs() < 2e-3 && (height / 8.66895e-3 - 1.0).abs() < 1e-3,
                "{method} {frequency}: {at} {height}"
            );
        }
    }
}

/// `auto` uses the event-driven method if Iwan's distribution is a few sliders, and harmonic
/// balance otherwise. One table has the columns of both.
#[test]
fn cases_of_two_methods_share_a_table() {
    let law = r#"kind = "iwan", stiffness = "2 N/mm", limit = "1 N", chi = -0.5, beta = 0.3, elements = "n""#;
    let rest = r#"
[parameters]
n = 4
[study]
kind = "response"
frequency = { from = "12 Hz", to = "20 Hz", points = 3 }
vary = { n = [4, 0, 4] }"#;
    let found = dataset(&one_mass("10 N/mm", "2 N s/m", law, "3 N", rest));
    let curve = &found.tables[0];
    assert_eq!(curve.rows(), 9);
    assert!(curve.columns.iter().all(|column| column.values.len() == 9));
    let defects = curve.numbers("return_defect").unwrap();
    assert!(defects[..3].iter().chain(&defects[6..]).all(|defect| defect.is_nan()), "{defects:?}");
    let truncation = curve.numbers("truncation").unwrap();
    assert!(truncation[3..6].iter().all(|error| *error >= 0.0), "{truncation:?}");
    // the first and the last case are the same
    let amplitude = curve.numbers("m_amplitude_m").unwrap();
    assert_eq!(amplitude[..3], amplitude[6..]);
}

/// A hardening spring bends the resonance over higher frequencies, and two motions are stable
/// there: a note says that the table has another orbit. With twenty times the damping the bend
/// is a hundredth of the width, and there is one orbit.
#[test]
fn a_folded_curve_is_swept_in_both_directions() {
    let study = |stiffness: &str, damping: f64, points: usize| {
        let law = format!("kind = \"cubic\", stiffness = \"{stiffness} N/m^3\"");
        let range = format!("frequency = {{ from = \"13 Hz\", to = \"20 Hz\", points = {points} }}");
        let rest = format!("[study]\nkind = \"response\"\n{range}");
        let text = one_mass("10 kN/m", &format!("{damping} N s/m"), &law, "10 N", &rest);
        let notes = dataset(&text).notes;
        notes.into_iter().filter(|note| note.contains("the reverse sweep finds another orbit")).collect::<Vec<String>>()
    };
    // fewer and more points than a block of the sweep
    for points in [41, 141] {
        for stiffness in ["2e7", "-1e6"] {
            let notes = study(stiffness, 1.0, points);
            assert!(notes.len() == 1 && notes[0].starts_with("warning: at "), "{stiffness} {points}: {notes:?}");
        }
        assert_eq!(study("1e6", 20.0, points), Vec::<String>::new());
    }
}

/// A softening spring bends the resonance to lower frequencies: the upward sweep jumps over the
/// peak, and only the reverse sweep meets it. The peak equals that of the branch by arc length,
/// which is independent of points and direction. The rows of the reverse sweep are on that
/// branch, and the figure shows them.
#[test]
fn the_reverse_sweep_finds_its_peak() {
    let study = |kind: &str, points: &str| {
        let range = format!("frequency = {{ from = \"14 Hz\", to = \"17 Hz\" {points} }}");
        let rest = format!("[study]\nkind = \"{kind}\"\n{range}");
        dataset(&one_mass("10 kN/m", "2 N s/m", "kind = \"cubic\", stiffness = \"-1e9 N/m^3\"", "0.3 N", &rest))
    };
    let table = |of: &Dataset, name: &str| of.tables.iter().find(|table| table.name == name).cloned().unwrap();
    let branch = table(&study("branch", ""), "peaks");
    let (at, height) = (branch.numbers("frequency_Hz").unwrap()[0], branch.numbers("amplitude_m").unwrap()[0]);
    for points in [", points = 61", ", tolerance = \"0.1 %\""] {
        let found = study("response", points);
        let peaks = table(&found, "peaks");
        let (frequency, amplitude) = (peaks.numbers("frequency_Hz").unwrap(), peaks.numbers("amplitude_m").unwrap());
        let back = peaks.flags("reverse_sweep").unwrap();
        let of_back: Vec<usize> = (0..back.len()).filter(|row| back[*row] == Some(true)).collect();
        assert_eq!(of_back.len(), 1, "{peaks:?}");
        let row = of_back[0];
        assert!((frequency[row] - at).abs() < 1e-5 && (amplitude[row] / height - 1.0).abs() < 1e-7, "{peaks:?}");
        assert!((0..back.len()).all(|other| other == row || amplitude[other] < 0.7 * height), "{peaks:?}");
        // above the peak's frequency the upper branch is lower than the peak, and higher than
        // the curve of the upward sweep
        let (curve, reverse_sweep) = (table(&found, "curve"), table(&found, "reverse_sweep"));
        let (there, low) = (curve.numbers("frequency_Hz").unwrap(), curve.numbers("m_amplitude_m").unwrap());
        let (over, high) =
            (reverse_sweep.numbers("frequency_Hz").unwrap(), reverse_sweep.numbers("m_amplitude_m").unwrap());
        assert!(over.len() > 10 && over.is_sorted() && over[0] > at, "{over:?}");
        assert!(high.is_sorted_by(|a, b| a > b) && high[0] < height, "{high:?}");
        for (omega, high) in over.iter().zip(high) {
            let same = there.iter().position(|known| known == omega).unwrap();
            assert!(*high > 1.5 * low[same], "{omega}");
        }
        let dotted = |panel: &Panel| panel.series.iter().filter(|series| series.label == "reverse sweep").count();
        assert_eq!(found.figure.panels.iter().map(dotted).collect::<Vec<_>>(), [1]);
    }
    // the same peak counts in the search for the parameter that minimizes it
    let rest = r#"
[parameters]
k3 = "-1e9 N/m^3"
[study]
kind = "performance"
frequency = { from = "14 Hz", to = "17 Hz", points = 61 }
vary = { k3 = ["-1e9 N/m^3", "-1 N/m^3"] }"#;
    let law = "kind = \"cubic\", stiffness = \"k3\"";
    let performance = table(&dataset(&one_mass("10 kN/m", "2 N s/m", law, "0.3 N", rest)), "performance");
    let peaks = performance.numbers("amplitude_m").unwrap();
    assert!((peaks[0] / height - 1.0).abs() < 1e-7, "{performance:?}");
    // F / (c √(k/m - c²/4m²)) of the linear one
    assert!((peaks[1] / (0.3 / (2.0 * f64::sqrt(1e4 - 1.0))) - 1.0).abs() < 1e-5, "{performance:?}");
    assert_eq!(performance.flags("reverse_sweep").unwrap(), [Some(true), Some(false)]);
}

/// Two and three masses with a stop, whose upper branch ends just beyond its peak.
///
/// Coarse curves left the branch at 59 Hz without a warning. It has its peak at 63.4068 Hz;
/// SciPy's DOP853, swept up, gives 4.32 mm at 63.0 Hz. The search for the peak of the other
/// model approached it slowly and gave up 3 % below. Both peaks by arc length must be found on
/// every grid.
#[test]
fn peaks_near_folds_are_found_on_coarse_grids() {
    let two = r#"
[[mass]]
name = "a0"
mass = "0.15779 kg"
[[spring]]
between = ["a0", "ground"]
stiffness = "71844 N/m"
damping = "0.56041 kg/s"
[[mass]]
name = "a1"
mass = "0.18033 kg"
[[spring]]
between = ["a1", "a0"]
stiffness = "48371 N/m"
damping = "0.56041 kg/s"
[[joint]]
name = "c"
between = ["a1", "ground"]
law = { kind = "gap", gap = "0.0029873 m", stiffness = "66950 N/m" }
[[force]]
on = "a0"
amplitude = "1.0 N"
"#;
    let three = r#"
[[mass]]
name = "a0"
mass = "0.71936 kg"
[[spring]]
between = ["a0", "ground"]
stiffness = "171.44 N/m"
damping = "0.22602 kg/s"
[[mass]]
name = "a1"
mass = "0.70328 kg"
[[spring]]
between = ["a1", "a0"]
stiffness = "180.99 N/m"
damping = "0.22602 kg/s"
[[mass]]
name = "a2"
mass = "0.81492 kg"
[[spring]]
between = ["a2", "a1"]
stiffness = "172.51 N/m"
damping = "0.22602 kg/s"
[[joint]]
name = "c"
between = ["a2", "ground"]
law = { kind = "gap", gap = "0.95861 m", stiffness = "10.953 N/m" }
[[force]]
on = "a1"
amplitude = "1.0 N"
"#;
    let grids = ["points = 41", "points = 81", "tolerance = \"1 %\""];
    let narrow = ["points = 81", "points = 141"];
    let cases = [
        (two, "36.9177 Hz", "98.4472 Hz", "peak_of = \"all\"", &grids[..]),
        (three, "0.693219 Hz", "1.84858 Hz", "peak_of = [\"a2\"]", &narrow[..]),
    ];
    for (model, from, to, of, grids) in cases {
        let top = |study: &str| {
            let found = dataset(&format!("schema = 1\n{model}[study]\n{study}\n"));
            let peaks = found.tables.iter().find(|table| table.name == "peaks").unwrap();
            let (at, height) = (peaks.numbers("frequency_Hz").unwrap(), peaks.numbers("amplitude_m").unwrap());
            let highest = (0..height.len()).max_by(|&a, &b| height[a].total_cmp(&height[b])).unwrap();
            (at[highest], height[highest])
        };
        let (omega, height) =
            top(&format!("kind = \"branch\"\nfrequency = {{ from = \"{from}\", to = \"{to}\" }}\n{of}\nsteps = 200"));
        for grid in grids {
            let found =
                top(&format!("kind = \"response\"\nfrequency = {{ from = \"{from}\", to = \"{to}\", {grid} }}\n{of}"));
            // near a fold the height grows with the square root of the distance
            assert!((found.0 / omega - 1.0).abs() < 1e-6, "{grid}: {found:?} {omega}");
            assert!((found.1 / height - 1.0).abs() < 3e-5, "{grid}: {found:?} {height}");
        }
    }
}

/// Theory 11.13: over a stop without a gap, at 2.6 times the natural frequency, the orbit with
/// the period of the excitation is unstable. With `period = 2` every method finds the orbit of
/// two periods, with the same columns.
#[test]
fn theory_11_13_motions_of_two_periods_from_a_study_file() {
    let orbit = |method: &str| {
        dataset(&format!(
            r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/m"
damping = "0.1 N s/m"
[[joint]]
name = "stop"
between = ["m", "ground"]
law = {{ kind = "gap", gap = "0 m", stiffness = "4 N/m" }}
[[force]]
on = "m"
amplitude = "1 N"
[study]
kind = "orbit"
frequency = "2.6 rad/s"
samples = 64
[method]
{method}
"#
        ))
    };
    let summary = |dataset: &Dataset, column: &str| numbers(dataset, "orbits", column)[0];
    let exact = orbit("kind = \"event-driven\"\nperiod = 2");
    let single = orbit("kind = \"event-driven\"");
    let amplitude = summary(&exact, "m_amplitude_m");
    assert!((amplitude / summary(&single, "m_amplitude_m") - 1.0).abs() > 0.1, "it repeats after one period");
    for (method, allowed) in [("harmonic-balance", 2e-3), ("shooting", 1e-5), ("transient", 1e-5)] {
        let found = orbit(&format!("kind = \"{method}\"\nperiod = 2"));
        let off = (summary(&found, "m_amplitude_m") / amplitude - 1.0).abs();
        assert!(off < allowed, "{method}: {off:.1e}");
        let names = |dataset: &Dataset| -> Vec<String> {
            let columns = table(dataset, "orbits").columns.iter().map(|column| column.name.clone());
            // only harmonic balance has this evidence
            columns.filter(|name| name != "return_defect").collect()
        };
        assert_eq!(names(&found), names(&exact), "{method}");
        // the table of the motion covers both periods
        for dataset in [&found, &exact] {
            let time = numbers(dataset, "orbit", "time_s");
            let last = time[time.len() - 1] / (TAU / 2.6);
            assert!((1.9..2.0 + 1e-9).contains(&last), "{method}: {last}");
        }
    }
}

/// 1 kg on 1 N/mm and 1 N s/m with a joint, under 2 N on the mass.
fn single(law: &str, study: &str) -> Dataset {
    dataset(&format!(
        r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/mm"
damping = "1 N s/m"
[[joint]]
name = "j"
between = ["m", "ground"]
law = {{ {law} }}
[[force]]
on = "m"
amplitude = "2 N"
[study]
{study}
"#
    ))
}

/// The contact state of joints with faces is stick, slip or apart; a stop is closed or open, by
/// its force; a spring has none. All methods agree.
#[test]
fn contact_states_need_faces() {
    let contacts = |law: &str, method: &str| {
        let found = single(law, &format!("kind = \"orbit\"\nfrequency = \"4 Hz\"\n[method]\nkind = \"{method}\""));
        let words = table(&found, "orbit").texts("j_contact").unwrap().to_vec();
        (words, numbers(&found, "orbit", "j_force_N").to_vec())
    };
    for method in ["event-driven", "shooting", "harmonic-balance"] {
        let (words, force) = contacts("kind = \"gap\", gap = \"1 mm\", stiffness = \"500 N/m\"", method);
        assert!(words.iter().any(|w| w == "touch") && words.iter().any(|w| w == "open"), "{method}");
        // the series of the force passes zero near the samples at which the contact changes
        let clear = 0.1 * force.iter().copied().fold(0.0, f64::max);
        for (word, force) in words.iter().zip(force).filter(|(_, force)| force.abs() > clear) {
            assert_eq!(word, if force > 0.0 { "touch" } else { "open" }, "{method}");
        }
        if method != "event-driven" {
            let (words, _) = contacts("kind = \"cubic\", stiffness = \"1e6 N/m^3\"", method);
            assert!(words.iter().all(String::is_empty), "{method}: {words:?}");
        }
    }
    let (words, _) = contacts("kind = \"jenkins\", stiffness = \"2 N/mm\", limit = \"0.5 N\"", "event-driven");
    assert!(words.iter().any(|w| w == "stick") && words.iter().any(|w| w == "slip+"));
}

/// Coulomb friction shifts the centre of each swing, not the time between two turning points.
/// Every cycle of a free decay has the frequency `ω √(1 - ζ²)/2π` of the oscillator without
/// friction, for any samples. About the centre `F/k` a swing decreases by the factor
/// `e^(-π ζ/√(1 - ζ²))`.
#[test]
fn every_cycle_of_a_decay_has_its_frequency() {
    let (m, k, c, friction, start) = (2.0, 800.0, 4.0, 3.0, 0.1);
    let omega: f64 = f64::sqrt(k / m);
    let zeta: f64 = c / (2.0 * m * omega);
    let root = (1.0 - zeta * zeta).sqrt();
    let (expected, shrinks) = (omega * root / TAU, (-0.5 * TAU * zeta / root).exp());
    for step in ["10 ms", "7.3 ms", "1 ms"] {
        let found = dataset(&format!(
            r#"
schema = 1
[[mass]]
name = "m"
mass = "2 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "800 N/m"
damping = "4 N s/m"
[[joint]]
name = "rub"
between = ["m", "ground"]
law = {{ kind = "coulomb", limit = "3 N" }}
[study]
kind = "transient"
start = {{ m = "0.1 m" }}
duration = "5 s"
time_step = "{step}"
"#
        ));
        let (frequencies, amplitudes) =
            (numbers(&found, "decay", "frequency_Hz"), numbers(&found, "decay", "amplitude_m"));
        assert_eq!(frequencies.len(), 3);
        let mut turn = start;
        for (frequency, amplitude) in frequencies.iter().zip(amplitudes) {
            assert!((frequency / expected - 1.0).abs() < 1e-9, "{step}: {frequency} instead of {expected}");
            // turning points on either side: each centre is F/k towards the side where the
            // swing begins
            let next = |turn: f64| shrinks * (turn - friction / k) - friction / k;
            let (second, third) = (next(turn), next(next(turn)));
            // the motion stops at the third turning point of the last cycle
            let last = if next(third) > -third { 0.5 * (third + next(third)) } else { 0.0 };
            let swings = [0.5 * (turn + second), 0.5 * (second + third), last];
            let mean = 0.5 * ((swings[0] + swings[1]) * (swings[1] + swings[2])).sqrt();
            assert!((amplitude / mean - 1.0).abs() < 1e-9, "{step}: {amplitude} instead of {mean}");
            turn = third;
        }
    }
}

/// A stiff Dahl element creeps under alternating load; the motion still loses energy in every
/// cycle.
#[test]
fn a_decay_with_creep_has_no_negative_damping() {
    let release = "kind = \"transient\"\nstart = { m = \"50 mm\" }\nduration = \"4 s\"\ntime_step = \"1 ms\"";
    let found = single("kind = \"dahl\", stiffness = \"20 N/mm\", limit = \"5 N\"", release);
    let ratios = numbers(&found, "decay", "damping_ratio");
    assert!(ratios.len() > 50, "{}", ratios.len());
    // The damper alone has c/(2 √(k m)) at 1 kg, with the stiffness of the stuck element in
    // parallel with the spring. The element only adds damping.
    let least = 1.0 / (2.0 * 21_000f64.sqrt());
    assert!(ratios.iter().all(|ratio| *ratio > 0.9 * least), "{ratios:?}");
}

/// A run that stops after all points of a unit, but before the search for its peaks, has not
/// finished that unit. A continued run computes the unit again, with its peaks.
#[test]
fn a_unit_without_its_peaks_is_unfinished() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    let text = stickslip_study::templates::find("blade-couple").unwrap().study.replace("points = 241", "points = 41");
    let checked = stickslip_study::run::check(&read_study("couple.toml", &text, &[]).unwrap()).unwrap();
    let rows = |block: &stickslip_study::result_block::Block, name: &str| {
        block.tables.iter().find(|table| table.name == name).unwrap().rows()
    };
    let whole = checked.block(0..1, &Context::without_progress(1)).unwrap();
    let points = rows(&whole, "curve");
    assert!(whole.tally.is_whole() && rows(&whole, "peaks") > 0 && points == 41);
    for last in [points - 1, points] {
        let (stop, finished) = (Arc::new(AtomicBool::new(false)), AtomicUsize::new(0));
        let set = stop.clone();
        let count = move || {
            if finished.fetch_add(1, Ordering::Relaxed) + 1 == last {
                set.store(true, Ordering::Relaxed);
            }
        };
        let context = Context { stop, finished: Arc::new(count), ..Context::without_progress(1) };
        let cut = checked.block(0..1, &context).unwrap();
        assert!(!cut.tally.is_whole(), "stopped after {last} of {points} points");
    }
}

/// Three places on two faces with several cases, with the fractions of stick and slip.
fn on_faces(limits: &str) -> Dataset {
    dataset(&format!(
        r#"
schema = 1
[parameters]
Ft = "1 N"
[[mass]]
repeat = {{ i = 3 }}
name = "m{{i}}"
mass = "1 kg"
[[spring]]
repeat = {{ i = 3 }}
between = ["m{{i}}", "ground"]
stiffness = "100 N/m"
damping = "0.5 N s/m"
[[joint]]
repeat = {{ i = 2 }}
name = "face{{i}}"
between = ["m{{i}}", "ground"]
law = {{ kind = "jenkins", stiffness = "50 N/m", limit = "Ft" }}
[[force]]
repeat = {{ i = 3 }}
on = "m{{i}}"
amplitude = "2 N"
[study]
kind = "response"
frequency = {{ from = "1 Hz", to = "2.5 Hz", points = 5 }}
output = ["contact", "joint_force"]
vary = {{ Ft = [{limits}] }}
"#
    ))
}

/// No case is left out of a figure without a note. If cases cannot have separate panels, each
/// has a curve in all panels.
#[test]
fn contacts_of_all_cases_are_drawn() {
    let found = on_faces("\"0.2 N\", \"0.5 N\", \"1 N\", \"1.5 N\", \"2 N\"");
    let slip = found.figure.panels.iter().find(|panel| panel.title == "face1 slips").unwrap();
    let labels: Vec<&str> = slip.series.iter().map(|series| series.label.as_str()).collect();
    assert_eq!(labels, ["Ft = 0.2 N", "Ft = 0.5 N", "Ft = 1 N", "Ft = 1.5 N", "Ft = 2 N"]);
    assert_eq!(found.figure.panels.len(), 3 + 2 + 2);
}

/// Places, forces and states have different colours in the legend of a figure.
#[test]
fn colours_are_unique() {
    let found = on_faces("\"0.5 N\", \"1 N\"");
    let named = found.figure.panels.iter().flat_map(|panel| &panel.series).filter(|series| !series.label.is_empty());
    let mut colours: std::collections::BTreeMap<usize, &str> = std::collections::BTreeMap::new();
    for series in named.filter(|series| series.label != "peak" && series.emphasis != Emphasis::Reference) {
        let first = *colours.entry(series.colour).or_insert(&series.label);
        assert_eq!(first, series.label, "colour {}", series.colour);
    }
    assert_eq!(colours.values().copied().collect::<Vec<_>>(), ["m1", "m2", "m3", "face1", "face2", "sticks", "slips"]);
}

/// If places move equally, the first one has the peak for any rounding. A place that is
/// higher between the points is the worst one in the title.
#[test]
fn equal_places_have_one_name() {
    let study = |stiffness: &str| {
        dataset(&format!(
            r#"
schema = 1
[[mass]]
repeat = {{ i = 8 }}
name = "b{{i}}"
mass = "1 kg"
[[spring]]
repeat = {{ i = 8 }}
between = ["b{{i}}", "ground"]
stiffness = "{stiffness}"
damping = "1 N s/m"
[[force]]
repeat = {{ i = 8 }}
on = "b{{i}}"
amplitude = "1 N"
[study]
kind = "response"
peak_of = "all"
frequency = {{ from = "1 Hz", to = "2 Hz", points = 21 }}
"#
        ))
    };
    let worst = |found: &Dataset| {
        let table = table(found, "peaks");
        let inner = table.flags("at_range_end").unwrap().iter().position(|end| *end == Some(false)).unwrap();
        table.texts("mass").unwrap()[inner].clone()
    };
    // equal except for 1e-9 of the stiffness, so the order of the peaks is undetermined
    let equal = study("100 N/m * (1 + 1e-9*i*(9 - i))");
    assert_eq!(worst(&equal), "b1");
    assert!(equal.figure.panels[0].title.contains("all places are equal"), "{}", equal.figure.panels[0].title);
    let softer = study("100 N/m * (1 - 0.02*i)");
    assert_eq!(worst(&softer), "b8");
    assert!(softer.figure.panels[0].title.contains("maximum at b8"), "{}", softer.figure.panels[0].title);
}

/// At an undamped resonance the motion grows without bound if friction does not limit it: the
/// figure has crosses there, and the legend counts them.
#[test]
fn points_without_an_orbit_are_drawn_and_counted() {
    let text = r#"
schema = 1
[parameters]
Ft = "1 N"
[[mass]]
name = "a"
mass = "1 kg"
[[spring]]
between = ["a", "ground"]
stiffness = "10 N/mm"
[[joint]]
name = "foot"
between = ["a", "ground"]
law = { kind = "coulomb", limit = "Ft" }
[[force]]
on = "a"
amplitude = "4 N"
[study]
kind = "response"
frequency = ["12 Hz", "15.915494309189533 Hz", "18 Hz"]
vary = { Ft = ["1 N", "2 N", "6 N"] }
peaks = false
[method]
kind = "event-driven"
"#;
    // 4 N grow without bound if the limit is below pi/4 of them, 3.14 N (Den Hartog 1931): 1 N
    // and 2 N, not 6 N
    let found = dataset(text);
    let status = table(&found, "curve").texts("status").unwrap();
    let failed: Vec<usize> = (0..9).filter(|row| !status[*row].starts_with("converged")).collect();
    assert_eq!(failed, [1, 4], "{status:?}");
    let crosses: Vec<(&str, Vec<f64>, usize)> = found.figure.panels[0]
        .series
        .iter()
        .filter(|series| series.style == Style::Missing)
        .map(|series| (series.label.as_str(), series.x.clone(), series.colour))
        .collect();
    let x = vec![15.915_494_309_189_533];
    assert_eq!(crosses, [("2 points without an orbit", x.clone(), 0), ("2 points without an orbit", x, 1)]);
}

/// Backbone of a mass on a cubic spring: the half of peak-to-peak includes the third harmonic;
/// the first harmonic has another column.
#[test]
fn modes_have_amplitude_and_first_harmonic() {
    let text = r#"
schema = 1
[[mass]]
name = "m"
mass = "1 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "1 N/m"
[[joint]]
name = "j"
between = ["m", "ground"]
law = { kind = "cubic", stiffness = "1 N/m^3" }
[study]
kind = "modes"
amplitude = { from = "1 mm", to = "2 m", points = 9 }
harmonics = 15
"#;
    let found = dataset(text);
    let (whole, first) = (numbers(&found, "modes", "m_amplitude_m"), numbers(&found, "modes", "m_first_harmonic_m"));
    let omega = numbers(&found, "modes", "frequency_Hz");
    // free vibration of x'' + x + x^3 = 0 from x = a: the period is 4 K(m)/sqrt(1 + a^2) with
    // the parameter m = a^2/(2 (1 + a^2))
    let period = |a: f64| {
        let (mut mean, mut other) = (1.0, (1.0 - a * a / (2.0 * (1.0 + a * a))).sqrt());
        for _ in 0..40 {
            (mean, other) = (0.5 * (mean + other), f64::sqrt(mean * other));
        }
        4.0 * (std::f64::consts::FRAC_PI_2 / mean) / (1.0 + a * a).sqrt()
    };
    for i in 0..whole.len() {
        assert!((omega[i] * period(whole[i]) - 1.0).abs() < 1e-6, "{} Hz at {} m", omega[i], whole[i]);
    }
    let last = whole.len() - 1;
    // at two metres the third harmonic is 3 % of the first
    assert!(whole[last] / first[last] > 1.02 && (whole[0] / first[0] - 1.0).abs() < 1e-6, "{whole:?} {first:?}");
}
