//! Models of rotation: moments of inertia in kg m², stiffnesses in N m/rad, moments in N m.

use stickslip_study::dataset::Dataset;
use stickslip_study::kinds::response;
use stickslip_study::read_study;
use stickslip_study::run::{Context, check, run};

const CHAIN: &str = r#"
schema = 1
[parameters]
J = "0.05 kg m^2"
[[mass]]
name = "hub"
mass = "J"
[[mass]]
name = "ring"
mass = "J/5"
[[spring]]
between = ["hub", "ground"]
stiffness = "2000 N m/rad"
damping = "0.05 N m s/rad"
[[joint]]
name = "clutch"
between = ["hub", "ring"]
law = { kind = "coulomb", limit = "3 N m" }
[[force]]
on = "hub"
amplitude = "10 N m"
[study]
kind = "response"
frequency = ["25 Hz", "28 Hz", "30 Hz", "35 Hz"]
output = ["joint_force", "joint_motion", "velocity"]
"#;

fn computed(text: &str) -> Dataset {
    let study = read_study("chain.toml", text, &[]).unwrap_or_else(|error| panic!("{error}"));
    run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{error}"))
}

fn columns(dataset: &Dataset, table: usize) -> Vec<&str> {
    dataset.tables[table].columns.iter().map(|column| column.name.as_str()).collect()
}

/// Amplitudes of the hub by steps with exact friction, 6400 a period (own program, 1e-4).
#[test]
fn a_friction_damper_on_a_torsional_chain() {
    let dataset = computed(CHAIN);
    let amplitude = dataset.tables[0].numbers("hub_amplitude_rad").expect("an angle");
    for (found, expected) in amplitude.iter().zip([17.76259e-3, 25.9499e-3, 45.8998e-3, 17.16617e-3]) {
        assert!((found / expected - 1.0).abs() < 2e-4, "{found} {expected}");
    }
    let names = columns(&dataset, 0);
    for name in ["clutch_force_amplitude_N_m", "clutch_amplitude_rad", "hub_velocity_amplitude_rad_per_s"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    assert!(!names.iter().any(|name| name.ends_with("_m") && !name.ends_with("N_m")), "{names:?}");
    let largest = dataset.tables[0].numbers("clutch_force_amplitude_N_m").expect("a moment");
    assert!(largest.iter().all(|moment| (moment - 3.0).abs() < 1e-9), "{largest:?}");
    assert_eq!(dataset.figure.panels[0].y.unit, "mrad");
}

#[test]
fn peaks_and_typed_results_of_rotations() {
    let text = CHAIN.replace(
        "frequency = [\"25 Hz\", \"28 Hz\", \"30 Hz\", \"35 Hz\"]",
        "frequency = { from = \"25 Hz\", to = \"36 Hz\", points = 23 }",
    );
    let study = read_study("chain.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let dataset = run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{error}"));
    assert!(columns(&dataset, 1).contains(&"amplitude_rad"), "{:?}", columns(&dataset, 1));
    let curves = response::curves(&study, &dataset).expect("typed results");
    let peak = curves[0].masses[0].highest_peak().expect("a peak");
    assert!(peak.amplitude > 45.8998e-3 && !peak.at_range_end, "{peak:?}");
    let words = check(&study).unwrap_or_else(|error| panic!("{error}")).summary().to_string();
    assert!(words.contains("slips at 3 N m"), "{words}");
}

#[test]
fn a_rotation_pulled_and_released() {
    // undamped: the angle is a cosine
    let text = CHAIN.replace("damping = \"0.05 N m s/rad\"\n", "");
    let (model, _) = text.split_once("[[joint]]").expect("a joint");
    let text = format!(
        "{model}[study]\nkind = \"transient\"\nduration = \"0.1 s\"\ntime_step = \"1 ms\"\nstart = {{ hub = \"2 deg\" \
         }}\nstart_velocity = {{ ring = \"0.5 rad/s\" }}\n"
    );
    let dataset = computed(&text);
    let table = &dataset.tables[0];
    let (time, angle) = (table.numbers("time_s").expect("time"), table.numbers("hub_displacement_rad").expect("angle"));
    let ring = table.numbers("ring_displacement_rad").expect("angle");
    let omega = f64::sqrt(2000.0 / 0.05);
    for ((t, angle), ring) in time.iter().zip(angle).zip(ring) {
        assert!((angle - 2f64.to_radians() * (omega * t).cos()).abs() < 1e-9, "{t} {angle}");
        assert!((ring - 0.5 * t).abs() < 1e-9, "{t} {ring}");
    }
}

#[test]
fn mixed_units_are_refused() {
    let refused = |from: &str, to: &str| {
        let text = CHAIN.replacen(from, to, 1);
        assert_ne!(text, CHAIN, "{from}");
        let error = read_study("chain.toml", &text, &[]).expect_err(to);
        format!("{error} {}", error.help_text().unwrap_or_default())
    };
    for (from, to, words) in [
        ("mass = \"J/5\"", "mass = \"1 kg\"", "`ring` is a mass (kg), but `hub` is a moment of inertia"),
        ("limit = \"3 N m\"", "limit = \"3 N\"", "expected energy or moment"),
        ("stiffness = \"2000 N m/rad\"", "stiffness = \"2000 N/m\"", "expected angular stiffness"),
        ("amplitude = \"10 N m\"", "amplitude = \"10 N\"", "expected energy or moment"),
        ("mass = \"J/5\"", "mass = \"J/5\"\ndirections = [\"x\", \"y\"]", "about one axis"),
        (
            "[[spring]]",
            "[[body]]\nname = \"b\"\nmass = \"1 kg\"\ninertia = \"1 kg m^2\"\ndirections = [\"x\", \"y\"]\n[[spring]]",
            "but a [[body]] has displacements",
        ),
        ("J = \"0.05 kg m^2\"", "J = \"0.05 kg\"", "moment of inertia in kg m^2"),
        ("kind = \"coulomb\"", "kind = \"coulomb-tanh\", velocity = 0.1", "rotation 0.1 has no unit"),
    ] {
        let said = refused(from, to);
        assert!(said.contains(words), "{to}: {said}");
    }
}

/// A cantilever of 1 mm length by matrices: its rotation in rad is 1500 times its deflection in m,
/// `1.5/L`. The amplitude of a mode is that of the deflection.
#[test]
fn an_observed_rotation_of_a_structure_is_an_angle() {
    let folder = tempfile::tempdir().expect("a folder");
    let (length, bending) = (1e-3f64, 1e-6);
    let unit = bending / length.powi(3);
    let stiffness = [(1, 1, 12.0 * unit), (2, 1, -6.0 * length * unit), (2, 2, 4.0 * length * length * unit)];
    let mass = [(1, 1, 1e-3), (2, 2, 1e-12)];
    let write = |name: &str, entries: &[(usize, usize, f64)]| {
        let rows: String = entries.iter().map(|(row, column, value)| format!("{row} {column} {value:e}\n")).collect();
        let text = format!("%%MatrixMarket matrix coordinate real symmetric\n2 2 {}\n{rows}", entries.len());
        std::fs::write(folder.path().join(name), text).expect("a matrix");
    };
    write("k.mtx", &stiffness);
    write("m.mtx", &mass);
    std::fs::write(folder.path().join("rows.csv"), "row,name\n1,1.z\n2,1.ry\n").expect("the rows");
    let head = "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\ndofs = \"rows.csv\"\nunits = \"m-kg-s\"\n\
        reduce = false\nrayleigh = { stiffness = \"1e-6 s\" }\n\
        [[place]]\nname = \"w\"\ndof = \"1.z\"\n[[place]]\nname = \"t\"\ndof = \"1.ry\"\n\
        [[joint]]\nname = \"pad\"\nbetween = [\"w\", \"ground\"]\nlaw = { kind = \"jenkins\", stiffness = 10.0, limit = \"1 N\" }\n";
    let run = |study: &str| {
        let path = folder.path().join("study.toml");
        std::fs::write(&path, format!("{head}{study}")).expect("the study");
        let study = stickslip_study::read_file(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
        run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{error}"))
    };
    let response = run(
        "[[force]]\non = \"w\"\namplitude = \"1 mN\"\n[study]\nkind = \"response\"\nfrequency = [\"0.01 Hz\", \"0.02 Hz\"]\n",
    );
    let first = |column: &str| response.tables[0].numbers(column).unwrap_or_else(|| panic!("{column}"))[0];
    let deflection = 1e-3 / (3.0 * unit + 10.0);
    assert!((first("w_amplitude_m") / deflection - 1.0).abs() < 1e-6);
    assert!((first("t_amplitude_rad") / (1.5 / length * deflection) - 1.0).abs() < 1e-6);
    let peak = "[[force]]\non = \"w\"\namplitude = \"1 mN\"\n[study]\nkind = \"response\"\nfrequency = [\"0.01 Hz\", \"0.02 Hz\"]\n\
        peak_of = \"t\"\n";
    let path = folder.path().join("peak.toml");
    std::fs::write(&path, format!("{head}{peak}")).expect("the study");
    let error = stickslip_study::read_file(&path, &[]).map(drop).unwrap_err().to_string();
    assert!(error.contains("`t` is a rotation, but this key needs a displacement"), "{error}");
    let modes = run("[study]\nkind = \"modes\"\namplitude = { from = \"1 um\", to = \"1 mm\", points = 3 }\n");
    let amplitudes = modes.tables[0].numbers("w_amplitude_m").expect("the deflection");
    assert!((amplitudes[2] / 1e-3 - 1.0).abs() < 0.01, "{amplitudes:?}");
}
