//! Forces whose amplitude depends on the excitation frequency.

use stickslip_study::dataset::Dataset;
use stickslip_study::read_study;
use stickslip_study::run::{Context, run};

const ROTOR: &str = r#"
schema = 1
[parameters]
me = "1e-4 kg*m"
[[mass]]
name = "rotor"
mass = "5 kg"
[[spring]]
between = ["rotor", "ground"]
stiffness = "200 N/mm"
damping = "20 N s/m"
[[joint]]
name = "damper"
between = ["rotor", "ground"]
law = { kind = "jenkins", stiffness = "100 N/mm", limit = "5 N" }
[[force]]
on = "rotor"
amplitude = "me*(frequency/(1 rad))^2"
"#;

fn computed(study: &str) -> Result<Dataset, String> {
    let study = read_study("rotor.toml", &format!("{ROTOR}{study}"), &[])
        .map_err(|error| format!("{error} {}", error.help_text().unwrap_or_default()))?;
    run(&study, &Context::without_progress(1)).map_err(|error| error.to_string())
}

fn numbers(dataset: &Dataset, table: &str, column: &str) -> Vec<f64> {
    let table = dataset.tables.iter().find(|one| one.name == table).unwrap_or_else(|| panic!("no table {table}"));
    table.numbers(column).unwrap_or_else(|| panic!("no column {column}")).to_vec()
}

/// Peak of the rotor: 139.2915 µm at 34.6497 Hz (harmonic balance of 31 harmonics, own program).
#[track_caller]
fn check_peak(frequency: f64, amplitude: f64) {
    assert!(
        (amplitude / 139.2915e-6 - 1.0).abs() < 1e-4 && (frequency - 34.6497).abs() < 2e-3,
        "{frequency} {amplitude}"
    );
}

/// Amplitudes at four frequencies and the peak (harmonic balance of 31 harmonics, own program).
#[test]
fn the_unbalance_of_a_rotor() {
    let study = "[study]\nkind = \"response\"\nfrequency = { from = \"20 Hz\", to = \"60 Hz\", points = 41 }\n\
        output = [\"receptance\", \"harmonics\"]\n";
    let dataset = computed(study).unwrap_or_else(|error| panic!("{error}"));
    let (frequency, amplitude) =
        (numbers(&dataset, "curve", "frequency_Hz"), numbers(&dataset, "curve", "rotor_amplitude_m"));
    for (at, expected) in [(35.0, 137.9832e-6), (40.0, 90.74722e-6), (50.0, 50.85867e-6), (60.0, 34.60652e-6)] {
        let row = frequency.iter().position(|f| *f == at).expect("a point");
        assert!((amplitude[row] / expected - 1.0).abs() < 1e-4, "{at}: {}", amplitude[row]);
        // the force at this frequency divides the first harmonic
        let omega = std::f64::consts::TAU * at;
        let receptance = numbers(&dataset, "curve", "rotor_receptance_m_per_N")[row];
        let harmonic = numbers(&dataset, "curve", "rotor_harmonic1_m")[row];
        assert!((receptance * 1e-4 * omega * omega / harmonic - 1.0).abs() < 1e-12, "{receptance}");
    }
    check_peak(numbers(&dataset, "peaks", "frequency_Hz")[0], numbers(&dataset, "peaks", "amplitude_m")[0]);
}

#[test]
fn every_kind_and_method_takes_the_unbalance() {
    for method in ["harmonic-balance", "event-driven"] {
        let study = format!("[study]\nkind = \"response\"\nfrequency = [\"40 Hz\"]\n[method]\nkind = \"{method}\"\n");
        let dataset = computed(&study).unwrap_or_else(|error| panic!("{method}: {error}"));
        let amplitude = numbers(&dataset, "curve", "rotor_amplitude_m")[0];
        assert!((amplitude / 90.74722e-6 - 1.0).abs() < 1e-4, "{method}: {amplitude}");
    }
    let branch = "[study]\nkind = \"branch\"\nfrequency = { from = \"30 Hz\", to = \"40 Hz\" }\n";
    let dataset = computed(branch).unwrap_or_else(|error| panic!("{error}"));
    check_peak(numbers(&dataset, "peaks", "frequency_Hz")[0], numbers(&dataset, "peaks", "amplitude_m")[0]);
    let performance = "[study]\nkind = \"performance\"\nfrequency = { from = \"30 Hz\", to = \"40 Hz\", points = 21 }\n\
        vary = { me = [\"1e-4 kg*m\"] }\n";
    let dataset = computed(performance).unwrap_or_else(|error| panic!("{error}"));
    check_peak(numbers(&dataset, "performance", "frequency_Hz")[0], numbers(&dataset, "performance", "amplitude_m")[0]);
}

#[test]
fn sums_of_terms_and_wrong_expressions() {
    let study = "[study]\nkind = \"response\"\nfrequency = [\"45 Hz\"]\n";
    let amplitude = |text: &str, at: &str| {
        let model = ROTOR.replace("me*(frequency/(1 rad))^2", text);
        let study = read_study("rotor.toml", &format!("{model}{study}{at}"), &[]);
        let study = study.map_err(|error| format!("{error} {}", error.help_text().unwrap_or_default()))?;
        let dataset = run(&study, &Context::without_progress(1)).map_err(|error| error.to_string())?;
        Ok::<f64, String>(numbers(&dataset, "curve", "rotor_amplitude_m")[0])
    };
    let omega = std::f64::consts::TAU * 45.0;
    let plain = amplitude(&format!("{} N", 3.0 + 0.01 * omega + 1e-4 * omega * omega), "").expect("a force");
    let sum = amplitude("3 N + 0.01 N s * frequency/(1 rad) + me*(frequency/(1 rad))^2", "").expect("a sum");
    assert!((sum / plain - 1.0).abs() < 1e-12, "{sum} {plain}");
    for (text, words) in [
        ("me*(frequency/(1 rad))^3*(1 s)", "a multiple of `frequency^2`"),
        ("1 N * sqrt(frequency/(1 Hz))", "a multiple of `frequency^2`"),
        ("me*frequency", "expected force"),
        ("2 N * (omega/(1 Hz))", "by the name `frequency`"),
    ] {
        let error = amplitude(text, "").expect_err(text);
        assert!(error.contains(words), "{text}: {error}");
    }
    let constant = ROTOR.replace("amplitude = \"me*", "harmonic = 0\namplitude = \"me*");
    let error = read_study("rotor.toml", &format!("{constant}{study}"), &[]).expect_err("a constant force");
    assert!(error.to_string().contains("a constant force cannot depend on the frequency"), "{error}");
    let stiffness = ROTOR.replace("\"20 N s/m\"", "\"20 N s/m * (frequency/(1 Hz))\"");
    let error = read_study("rotor.toml", &format!("{stiffness}{study}"), &[]).expect_err("a damping");
    assert!(error.to_string().contains("the excitation frequency has no value here"), "{error}");
}

/// A travelling unbalance on a ring of free blades is that of one blade.
#[test]
fn the_unbalance_of_a_ring() {
    let study = "[study]\nkind = \"response\"\nfrequency = [\"40 Hz\"]\n";
    let one = computed(study).unwrap_or_else(|error| panic!("{error}"));
    let ring = ROTOR.replace("amplitude = ", "engine_order = 1\namplitude = ");
    let ring = read_study("ring.toml", &format!("{ring}[disk]\nsectors = 3\n{study}"), &[]);
    let ring = run(&ring.unwrap_or_else(|error| panic!("{error}")), &Context::without_progress(1));
    let ring = ring.unwrap_or_else(|error| panic!("{error}"));
    let expected = numbers(&one, "curve", "rotor_amplitude_m")[0];
    for blade in 0..3 {
        let found = numbers(&ring, "curve", &format!("rotor_{blade}_amplitude_m"))[0];
        // the ring is solved by harmonic balance, one blade exactly
        assert!((found / expected - 1.0).abs() < 1e-5, "{blade}: {found} {expected}");
    }
}
