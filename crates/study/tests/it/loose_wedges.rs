//! Dampers that only contacts and a constant force hold, in study files, against the linear
//! structure with stuck contacts (NumPy) and an integration in time (own program in C).

use stickslip_study::dataset::{Dataset, Table};
use stickslip_study::read_study;
use stickslip_study::run::{Context, run};
use stickslip_study::summary::ModelSummary;

fn dataset(text: &str) -> Dataset {
    let found = run(&read_study("study.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap();
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    found
}

fn numbers<'a>(found: &'a Dataset, table: &str, column: &str) -> &'a [f64] {
    let table: &Table = found.tables.iter().find(|found| found.name == table).unwrap();
    table.numbers(column).unwrap_or_else(|| panic!("no column {column}"))
}

/// A wedge of 12 g between a blade and a heavy wall, pressed with 500 N on faces at 40 degrees.
fn wedge_on_a_wall(study: &str) -> Dataset {
    dataset(&format!(
        r#"schema = 1
[[mass]]
name = "blade"
mass = "250 g"
directions = ["x", "z"]
[[mass]]
name = "wall"
mass = "1000 kg"
directions = ["x", "z"]
[[mass]]
name = "wedge"
mass = "12 g"
directions = ["x", "z"]
[[spring]]
between = ["blade.x", "ground"]
stiffness = "160 N/mm"
damping = "20 N s/m"
[[spring]]
between = ["blade.z", "ground"]
stiffness = "20 kN/mm"
damping = "50 N s/m"
[[spring]]
between = ["wall.x", "ground"]
stiffness = "200 kN/mm"
damping = "500 kN s/m"
[[spring]]
between = ["wall.z", "ground"]
stiffness = "200 kN/mm"
damping = "500 kN s/m"
[[place]]
name = "left"
of = "wedge"
normal = ["-cos(40 deg)", 0, "sin(40 deg)"]
[[place]]
name = "right"
of = "wedge"
normal = ["cos(40 deg)", 0, "sin(40 deg)"]
[[place]]
name = "on_blade"
of = "blade"
normal = ["-cos(40 deg)", 0, "sin(40 deg)"]
[[place]]
name = "on_wall"
of = "wall"
normal = ["cos(40 deg)", 0, "sin(40 deg)"]
[[joint]]
name = "blade_face"
between = ["left", "on_blade"]
law = {{ kind = "friction-contact", tangential = "15 N/um", normal = "20 N/um", friction = 0.25 }}
[[joint]]
name = "wall_face"
between = ["right", "on_wall"]
law = {{ kind = "friction-contact", tangential = "15 N/um", normal = "20 N/um", friction = 0.25 }}
[[force]]
on = "wedge.z"
amplitude = "500 N"
harmonic = 0
[[force]]
on = "blade.x"
amplitude = "3 N"
[study]
{study}"#
    ))
}

/// Both contacts stick, so that the response is that of the structure of six linear degrees of
/// freedom.
#[test]
fn a_pressed_wedge_sticks_at_small_forces() {
    let found = wedge_on_a_wall(
        "kind = \"response\"\nfrequency = [\"100 Hz\", \"150 Hz\", \"200 Hz\", \"250 Hz\", \"300 Hz\"]\n",
    );
    let expected = [3.348_397_6e-7, 3.408_396_4e-7, 3.489_750_6e-7, 3.590_352_4e-7, 3.716_606_5e-7];
    for (found, expected) in numbers(&found, "curve", "blade_x_amplitude_m").iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    }
}

/// In time, the wedge settles to the same motion. It begins in static equilibrium under its load.
#[test]
fn a_pressed_wedge_settles_in_time() {
    let study =
        "kind = \"transient\"\nfrequency = \"200 Hz\"\nbegin = \"equilibrium\"\ncycles = 28\nsamples_per_cycle = 32\n";
    let found = wedge_on_a_wall(study);
    let motion = numbers(&found, "motion", "blade_x_displacement_m");
    let last = &motion[motion.len() - 33..];
    let (low, high) = last.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    let amplitude = 0.5 * (high - low);
    assert!((amplitude / 3.489_750_6e-7 - 1.0).abs() < 1e-3, "{amplitude}");
}

/// Two blades with a roof damper under their platforms at 1000 rpm. Five digits of half the
/// peak-to-peak motion of the first blade, by the integration in time; the contacts stick.
#[test]
fn a_roof_damper_between_two_blades() {
    let found = dataset(
        r#"schema = 1
[parameters]
md = "12 g"
load = "md * 320 mm * (1000 rpm/(1 rad))^2"
[[mass]]
repeat = { i = 2 }
name = "blade{i}"
mass = "250 g"
directions = ["x", "z"]
[[spring]]
repeat = { i = 2 }
between = ["blade{i}.x", "ground"]
stiffness = "160 N/mm"
damping = "0.5 N s/m"
[[spring]]
repeat = { i = 2 }
between = ["blade{i}.z", "ground"]
stiffness = "20 kN/mm"
damping = "5 N s/m"
[[mass]]
name = "roof"
mass = "md"
directions = ["x", "z"]
[[place]]
repeat = { i = 2 }
name = "side{i}"
of = "roof"
normal = ["(2*i - 3)*cos(40 deg)", 0, "sin(40 deg)"]
[[place]]
repeat = { i = 2 }
name = "platform{i}"
of = "blade{i}"
normal = ["(2*i - 3)*cos(40 deg)", 0, "sin(40 deg)"]
[[joint]]
repeat = { i = 2 }
name = "face{i}"
between = ["side{i}", "platform{i}"]
law = { kind = "friction-contact", tangential = "15 N/um", normal = "20 N/um", friction = 0.25 }
[[force]]
on = "roof.z"
amplitude = "load"
harmonic = 0
[[force]]
on = "blade1.x"
amplitude = "3 N"
[[force]]
on = "blade2.x"
amplitude = "3 N"
phase = "-150 deg"
[study]
kind = "response"
frequency = ["120 Hz", "150 Hz", "165 Hz", "175.5 Hz"]
"#,
    );
    let expected = [53.652e-6, 11.520e-6, 6.7442e-6, 5.1345e-6];
    for (found, expected) in numbers(&found, "curve", "blade1_x_amplitude_m").iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 5e-5, "{found} {expected}");
    }
}

/// A damper slips on both platforms while its vibration grows, and then sticks. No prescribed motion
/// of each contact alone, from static equilibrium, ends in this state. The vibration is that of the
/// structure with stuck contacts, with and without a neighbouring orbit.
#[test]
fn a_damper_that_slips_into_stick_vibrates_as_the_stuck_structure() {
    let found = dataset(
        r#"schema = 1
[parameters]
load = "12 g * 0.3 m * (2000 rpm/(1 rad))^2"
[[mass]]
repeat = { i = 2 }
name = "platform{i}"
mass = "0.35 kg"
directions = ["x", "z"]
[[body]]
name = "damper"
mass = "12 g"
inertia = "150 g mm^2"
directions = ["x", "z"]
[[place]]
repeat = { i = 2 }
name = "side{i}"
of = "damper"
offset = ["(2*i - 3) * 5 mm", 0, "2.5 mm"]
normal = ["(2*i - 3)*sin(35 deg)", 0, "cos(35 deg)"]
[[place]]
repeat = { i = 2 }
name = "seat{i}"
of = "platform{i}"
normal = ["(2*i - 3)*sin(35 deg)", 0, "cos(35 deg)"]
[[spring]]
repeat = { i = 2 }
between = ["platform{i}.x", "ground"]
stiffness = "(480 + 20*i) * 1 N/mm"
damping = "3 N s/m"
[[spring]]
repeat = { i = 2 }
between = ["platform{i}.z", "ground"]
stiffness = "8 N/um"
damping = "30 N s/m"
[[joint]]
repeat = { i = 2 }
name = "face{i}"
between = ["side{i}", "seat{i}"]
law = { kind = "friction-contact", tangential = "15 N/um", normal = "20 N/um", friction = 0.35, preload = "load/(2*cos(35 deg))" }
[[force]]
on = "damper.z"
amplitude = "load"
harmonic = 0
[[force]]
repeat = { i = 2 }
on = "platform{i}.z"
amplitude = "-load/2"
harmonic = 0
[[force]]
repeat = { i = 2 }
on = "platform{i}.x"
amplitude = "(3 - 2*i) * 20 N"
[study]
kind = "response"
frequency = ["185 Hz", "189 Hz"]
[figure]
references = true
[method]
kind = "harmonic-balance"
"#,
    );
    let expected = [1.637_230_346_690_045e-6, 2.568_436_078_256_65e-6];
    for (found, expected) in numbers(&found, "curve", "platform1_x_amplitude_m").iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }
    // constant forces do not keep a linear structure from having amplitudes
    let free = numbers(&found, "references", "platform1_x_free_amplitude_m");
    assert!(free.iter().all(|amplitude| amplitude.is_finite()), "{free:?}");
}

/// A pressed contact without friction slips all the time, and does not hold the block along its face.
#[test]
fn a_contact_without_friction_never_sticks() {
    let text = r#"schema = 1
[[mass]]
name = "block"
mass = "1 kg"
directions = ["x", "z"]
[[spring]]
between = ["block.x", "ground"]
stiffness = "100 N/mm"
damping = "20 N s/m"
[[spring]]
between = ["block.z", "ground"]
stiffness = "100 N/mm"
damping = "20 N s/m"
[[place]]
name = "foot"
of = "block"
normal = [0, 0, 1]
[[joint]]
name = "contact"
between = ["foot", "ground"]
law = { kind = "friction-contact", tangential = "1 N/um", normal = "1 N/um", friction = 0, preload = "50 N" }
[[force]]
on = "block.x"
amplitude = "1 N"
[study]
kind = "response"
frequency = ["40 Hz", "60 Hz"]
[method]
kind = "harmonic-balance"
"#;
    let found = dataset(text);
    assert!(!found.notes.iter().any(|note| note.contains("sticks permanently")), "{:?}", found.notes);
    assert_eq!(numbers(&found, "curve", "contact_slip_fraction"), [1.0, 1.0]);
    for (hertz, found) in [40.0, 60.0].into_iter().zip(numbers(&found, "curve", "block_x_amplitude_m")) {
        let omega = std::f64::consts::TAU * hertz;
        let expected = 1.0 / (1e5 - omega * omega).hypot(20.0 * omega);
        assert!((found / expected - 1.0).abs() < 1e-9, "{hertz} Hz: {found} {expected}");
    }
    let summary = ModelSummary::new(&read_study("study.toml", text, &[]).unwrap()).unwrap().to_string();
    // √(1e5 N/m / 1 kg) along the face, also with all joints stuck
    assert!(summary.contains("joints stuck   50.329,"), "{summary}");
}

/// Four contacts of different stiffness clamp a mass. Each point has the history that begins in
/// static equilibrium, whatever its neighbours needed. The amplitudes are those of an own
/// integration in C, whose excitation grows over 300 periods.
#[test]
fn a_clamped_mass_has_the_same_history_at_all_points() {
    let contacts: String = [(20, 0.25, 200, 400), (130, 0.3, 400, 680), (-115, 0.35, 600, 960), (-30, 0.4, 800, 1240)]
        .iter()
        .enumerate()
        .map(|(i, (angle, friction, tangential, normal))| {
            format!(
                r#"[[place]]
name = "face{i}"
of = "mass"
normal = ["cos({angle} deg)", 0, "sin({angle} deg)"]
[[joint]]
name = "contact{i}"
between = ["face{i}", "ground"]
law = {{ kind = "friction-contact", tangential = "{tangential} N/mm", normal = "{normal} N/mm", friction = {friction}, preload = "{} N" }}
"#,
                20 + 3 * i
            )
        })
        .collect();
    let found = dataset(&format!(
        r#"schema = 1
[[mass]]
name = "mass"
mass = "1 kg"
directions = ["x", "z"]
[[spring]]
between = ["mass.x", "ground"]
stiffness = "200 N/mm"
damping = "6 N s/m"
[[spring]]
between = ["mass.z", "ground"]
stiffness = "300 N/mm"
damping = "8 N s/m"
{contacts}
[[force]]
on = "mass.x"
amplitude = "3 N"
[[force]]
on = "mass.z"
amplitude = "1.8 N"
phase = "70 deg"
[study]
kind = "response"
frequency = ["244 Hz", "252 Hz", "260 Hz", "268 Hz", "276 Hz"]
peaks = false
"#
    ));
    let found = &numbers(&found, "curve", "mass_x_amplitude_m")[3..];
    for (found, expected) in found.iter().zip([21.994e-6, 15.493e-6]) {
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
    }
}
