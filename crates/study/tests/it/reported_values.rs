//! Small studies whose right values were computed without this program, in Python with NumPy and
//! SciPy: linear motion by formulas, integration in time (Radau, 1e-8 a step), own harmonic balance
//! with 11 and 15 harmonics.

use stickslip_study::dataset::{Dataset, Table};
use stickslip_study::read_study;
use stickslip_study::run::{Context, run};

fn dataset(text: &str) -> Dataset {
    let study = read_study("study.toml", &format!("schema = 1\n{text}"), &[]).unwrap();
    run(&study, &Context::without_progress(1)).unwrap()
}

fn table<'d>(dataset: &'d Dataset, name: &str) -> &'d Table {
    dataset.tables.iter().find(|table| table.name == name).unwrap()
}

fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{found} {expected}");
}

/// A block of 1 kg with bristle friction, on a spring of 2 N/m to `end`.
fn bristles(end: &str, study: &str) -> String {
    format!(
        r#"[[mass]]
name = "block"
mass = "1 kg"
[[spring]]
between = ["block", "{end}"]
stiffness = "2 N/m"
[[joint]]
name = "rub"
between = ["block", "ground"]
law = {{ kind = "lugre", stiffness = "1e5 N/m", damping = "316.2278 N s/m", viscous = "0.4 N s/m", limit = "1 N", static_limit = "1.5 N", velocity = "0.001 m/s" }}
{study}"#
    )
}

/// In small motion the bristles are a spring and a damper: `F/(k + s₀ + jω (s₁ + s₂) - ω² m)`. The
/// force reaches 8e-4 of the slip limit, which changes the amplitude by some 1e-4.
#[test]
fn small_motion_on_bristles_is_linear() {
    let found = dataset(&bristles(
        "ground",
        r#"[[force]]
on = "block"
amplitude = "1 mN"
[study]
kind = "response"
frequency = "40 Hz"
"#,
    ));
    let amplitude = table(&found, "curve").numbers("block_amplitude_m").unwrap()[0];
    assert_near(amplitude, 0.011_403_860e-6, 5e-4);
}

/// A block that a spring pulls whose end moves at constant speed, after 40 s.
#[test]
fn a_pulled_block_on_bristles_moves_as_it_does_in_scipy() {
    let found = dataset(&bristles(
        "hand",
        r#"[[motion]]
on = "hand"
amplitude = "1000 m"
phase = "-90 deg"
[study]
kind = "transient"
frequency = "1e-4 rad/s"
duration = "40 s"
time_step = "10 ms"
"#,
    ));
    let last = *table(&found, "motion").numbers("block_displacement_m").unwrap().last().unwrap();
    assert_near(last, 3.306_778, 1e-4);
}

/// Coulomb friction shifts the centre of each swing, and not the time between two turning points:
/// every cycle has the frequency `ω sqrt(1 - ζ²)/2π`.
#[test]
fn every_cycle_of_a_decay_has_its_frequency() {
    let found = dataset(
        r#"[[mass]]
name = "m"
mass = "2 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "800 N/m"
damping = "4 N s/m"
[[joint]]
name = "rub"
between = ["m", "ground"]
law = { kind = "coulomb", limit = "3 N" }
[study]
kind = "transient"
start = { m = "0.1 m" }
duration = "5 s"
time_step = "10 ms"
"#,
    );
    let frequencies = table(&found, "decay").numbers("frequency_Hz").unwrap();
    assert!(frequencies.len() > 1);
    frequencies.iter().for_each(|frequency| assert_near(*frequency, 3.179_117_5, 1e-6));
}

/// A cubic energy sink on a linear oscillator, beside its peak and at its peak.
#[test]
fn an_energy_sink_vibrates_as_own_harmonic_balance_says() {
    let sink = r#"[[mass]]
name = "main"
mass = "2 kg"
[[mass]]
name = "sink"
mass = "0.1 kg"
[[spring]]
between = ["main", "ground"]
stiffness = "8 N/m"
damping = "0.04 N s/m"
[[spring]]
between = ["main", "sink"]
damping = "0.04 N s/m"
[[joint]]
name = "cubic"
between = ["main", "sink"]
law = { kind = "cubic", stiffness = "800 N/m^3" }
[[force]]
on = "main"
amplitude = "0.016 N"
[study]
kind = "response"
"#;
    let found = dataset(&format!("{sink}frequency = [\"1.8 rad/s\", \"2 rad/s\"]\n"));
    let amplitudes = table(&found, "curve").numbers("main_amplitude_m").unwrap();
    assert_near(amplitudes[0], 19.981_89e-3, 1e-3);
    assert_near(amplitudes[1], 11.513_80e-3, 1e-3);
    let range = "frequency = { from = \"1.9 rad/s\", to = \"2 rad/s\", points = 11 }\npeak_of = \"main\"\n";
    let found = dataset(&format!("{sink}{range}"));
    let peaks = table(&found, "peaks");
    assert_near(peaks.numbers("amplitude_m").unwrap()[0], 0.172_109_4, 2e-6);
    assert_near(peaks.numbers("frequency_Hz").unwrap()[0], 0.308_982_0, 1e-6);
}

/// A lap joint is pulled and let go. It carries the force of its displacement, so that the first
/// swing goes from 200 to -175.7375 µm (own integration in NumPy with 2000 sliders). A joint
/// relaxed at the place of release would go to -121.86 µm.
#[test]
fn a_lap_joint_that_is_let_go_swings_about_zero() {
    let found = dataset(
        r#"[[mass]]
name = "m"
mass = "10 kg"
[[spring]]
between = ["m", "ground"]
stiffness = "20 N/um"
damping = "20 N s/m"
[[joint]]
name = "bolt"
between = ["m", "ground"]
law = { kind = "iwan", stiffness = "10 N/um", limit = "1 kN", chi = -0.4, beta = 0.5 }
[study]
kind = "transient"
start = { m = "0.2 mm" }
duration = "16 ms"
time_step = "0.01 ms"
"#,
    );
    let motion = table(&found, "motion").numbers("m_displacement_m").unwrap();
    let lowest = motion.iter().copied().fold(f64::INFINITY, f64::min);
    assert_near(lowest, -175.7375e-6, 1e-4);
    // from the turning points with the closed form of the law (DOP853, 1e-13)
    let amplitudes = table(&found, "decay").numbers("amplitude_m").unwrap();
    assert!(amplitudes.len() >= 3, "{amplitudes:?}");
    for (found, expected) in amplitudes.iter().zip([169.573_468e-6, 143.864_298e-6, 124.894_735e-6]) {
        assert_near(*found, expected, 1e-6);
    }
}

/// A strap that a bolt holds on a plate, both pulled and let go. The bolt slips while it is
/// pulled, and carries its limit at first. The strap swings with the plate, about a position that
/// the slip left (own integration in NumPy, 3000 sliders, steps of 1 µs).
#[test]
fn a_strap_on_a_plate_swings_with_it() {
    let found = dataset(
        r#"[[mass]]
name = "plate"
mass = "5 kg"
[[mass]]
name = "strap"
mass = "3 kg"
[[spring]]
between = ["plate", "ground"]
stiffness = "2 N/um"
damping = "20 N s/m"
[[joint]]
name = "bolt"
between = ["plate", "strap"]
law = { kind = "iwan", stiffness = "40 N/um", limit = "2 kN", chi = -0.4, beta = 0.5 }
[study]
kind = "transient"
start = { plate = "0.1 mm", strap = "0.3 mm" }
duration = "20 ms"
time_step = "1 ms"
"#,
    );
    let motion = table(&found, "motion");
    let at = |place: &str, index: usize| motion.numbers(&format!("{place}_displacement_m")).unwrap()[index];
    for (milliseconds, plate, strap) in [
        (1, 1.313_542e-4, 2.087_649e-4),
        (5, -1.051_696e-4, 2.092_649e-5),
        (12, 1.175_542e-4, 2.477_413e-4),
        (20, -1.079_882e-4, 3.017e-6),
    ] {
        let errors = [at("plate", milliseconds) - plate, at("strap", milliseconds) - strap];
        assert!(errors.iter().all(|error| error.abs() < 5e-9), "{milliseconds} ms: {errors:?} m");
    }
}

/// A contact that slips in the first periods into a state in which it just reaches its limit. It
/// then sticks and loses nothing.
#[test]
fn a_contact_that_has_slipped_into_stick_sticks() {
    let found = dataset(
        r#"[[mass]]
name = "m"
mass = "1.268 kg"
directions = ["x", "y", "z"]
[[spring]]
between = ["m.x", "ground"]
stiffness = "135.205 N/mm"
damping = "1.19 %"
[[spring]]
between = ["m.y", "ground"]
stiffness = "17.353 N/mm"
damping = "3.28 %"
[[spring]]
between = ["m.z", "ground"]
stiffness = "50.236 N/mm"
damping = "2.14 %"
[[place]]
name = "foot"
of = "m"
normal = [0.173, 0.672, 1.0]
[[joint]]
name = "c"
between = ["foot", "ground"]
law = { kind = "friction-contact", tangential = "113.67 N/mm", normal = "137.17 N/mm", friction = 0.464, preload = "16.51 N" }
[[force]]
on = "m.x"
amplitude = "1.074*F"
phase = "95.9 deg"
[[force]]
on = "m.y"
amplitude = "1.223*F"
phase = "212.8 deg"
[[force]]
on = "m.x"
amplitude = "0.897 N"
harmonic = 0
[parameters]
F = "1 N"
[study]
kind = "orbit"
frequency = "15.60 Hz"
vary = { F = ["0.1 N", "0.4 N", "2 N"] }
[method]
kind = "harmonic-balance"
"#,
    );
    let orbits = table(&found, "orbits");
    let (slip, loss) = (orbits.numbers("c_slip_fraction").unwrap(), orbits.numbers("c_dissipation_J").unwrap());
    assert_eq!(slip[..2], [0.0, 0.0], "{slip:?}");
    assert!(loss[1].abs() < 1e-15 && slip[2] > 0.0 && loss[2] > 1e-9, "{slip:?} {loss:?}");
}
