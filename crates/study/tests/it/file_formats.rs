//! Small matrices in the formats of other programs. Each has a reference value computed without
//! this software: in closed form, or by NumPy and SciPy.

use std::f64::consts::TAU;
use std::path::Path;
use stickslip_study::dataset::Dataset;
use stickslip_study::read_file;
use stickslip_study::run::{CheckedStudy, Context, check};

/// Returns the checked study, next to these files of matrices.
fn checked(files: &[(&str, &str)], text: &str) -> CheckedStudy {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    let path = folder.path().join("study.toml");
    std::fs::write(&path, format!("schema = 1\n{text}")).unwrap();
    check(&read_file(&path, &[]).unwrap_or_else(|error| panic!("{error:?}\n{text}"))).unwrap()
}

fn run(checked: &CheckedStudy) -> Dataset {
    let data = checked.run(&Context::without_progress(1)).unwrap();
    assert!(data.failures.is_empty(), "{:?}", data.failures);
    data
}

/// Returns the natural frequencies with all joints free, Hz.
fn frequencies(checked: &CheckedStudy) -> Vec<f64> {
    checked.summary().free.elastic.iter().map(|mode| mode.omega / TAU).collect()
}

fn close(found: &[f64], expected: &[f64], error: f64) {
    let each = found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < error);
    assert!(each, "{found:?} instead of {expected:?}");
}

fn column(data: &Dataset, table: &str, name: &str) -> Vec<f64> {
    let table = data.tables.iter().find(|found| found.name == table).unwrap_or_else(|| panic!("no table {table}"));
    table.numbers(name).unwrap_or_else(|| panic!("no {name}: {:?}", table.columns)).to_vec()
}

/// `K = 1000 [2 -1 0; -1 2 -1; 0 -1 1]`, `M = 1`, 1 % modal damping: eigenvalues by NumPy, and
/// modal superposition.
#[test]
fn a_chain_of_three_from_every_file() {
    let one = "%%MatrixMarket matrix coordinate real symmetric\n3 3 3\n1 1 1\n2 2 1\n3 3 1\n";
    let bare = "3 3 3\n1 1 1\n2 2 1\n3 3 1\n";
    let files = [
        ("chain_no_banner.mtx", "\"K\"", "\"mass.mtx\"", bare, "3"),
        ("chain_indented_banner.mtx", "\"K\"", "\"mass.mtx\"", one, "3"),
        ("chain_indented_comment.mtx", "\"K\"", "\"mass.mtx\"", one, "3"),
        ("chain_skipped_column.rsa", "\"K\"", "\"mass.mtx\"", one, "3"),
        ("chain_repeated_group.rsa", "\"K\"", "\"mass.mtx\"", one, "3"),
        ("chain_digit.op4", "{ file = \"K\", name = \"1MAT\" }", "\"mass.mtx\"", one, "3"),
        ("chain_blank.op4", "\"K\"", "\"mass.mtx\"", one, "3"),
        (
            "chain_complex_beside.pch",
            "{ file = \"K\", name = \"KAAX\" }",
            "{ file = \"K\", name = \"MAAX\" }",
            one,
            "1.z",
        ),
    ];
    for (file, stiffness, mass, mass_file, dof) in files {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../formats/tests/data").join(file);
        let content = std::fs::read_to_string(path).unwrap();
        let text = format!(
            "[structure]\nstiffness = {stiffness}\nmass = {mass}\nunits = \"m-kg-s\"\nmodal_damping = \"1 %\"\n\
             [[place]]\nname = \"tip\"\ndof = \"{dof}\"\n[[force]]\non = \"tip\"\namplitude = \"1 N\"\n\
             [study]\nkind = \"response\"\nfrequency = {{ from = \"1 Hz\", to = \"4 Hz\", points = 121 }}\n"
        );
        let checked = checked(&[("K", &content), ("mass.mtx", mass_file)], &text);
        close(&frequencies(&checked), &[2.239861, 6.275950, 9.069011], 3e-7);
        let data = run(&checked);
        // a maximum is flat: its location has half the digits of its height
        close(&column(&data, "peaks", "frequency_Hz"), &[2.2395889], 1e-6);
        close(&column(&data, "peaks", "amplitude_m"), &[0.1371246], 5e-7);
    }
}

/// Two coordinates that share one mass, `M = v vᵀ` with `v = (0.1, 0.3)`:
/// `ω² = 1 / (vᵀ K⁻¹ v)`; amplitudes by direct solution.
#[test]
fn a_mass_that_two_coordinates_share() {
    let mass = "%%MatrixMarket matrix array real symmetric\n2 2\n1.0000000000000002e-02\n2.9999999999999999e-02\n\
                8.9999999999999997e-02\n";
    let stiffness = "%%MatrixMarket matrix array real symmetric\n2 2\n3000\n-1000\n2000\n";
    let text = "[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\n[[place]]\nname = \"u\"\ndof = \"1\"\n\
                [[spring]]\nbetween = [\"u\", \"ground\"]\ndamping = \"1 N s/m\"\n[[force]]\non = \"u\"\namplitude = \"2 N\"\n\
                [study]\nkind = \"response\"\nfrequency = [\"15 Hz\", \"19 Hz\", \"20 Hz\", \"25 Hz\"]\n";
    let checked = checked(&[("k.mtx", stiffness), ("m.mtx", mass)], text);
    close(&frequencies(&checked), &[19.022654], 3e-8);
    let expected = [1.267447e-3, 16.59366e-3, 2.175960e-3, 0.1213734e-3];
    close(&column(&run(&checked), "curve", "u_amplitude_m"), &expected, 5e-7);
}

/// Two masses on a rigid link, `Tᵀ M T` in three coordinates, with a friction joint.
/// Frequencies come from condensing the massless part and from QZ of the pencil. Amplitudes
/// come from harmonic balance with 15 and 31 harmonics, which agree to 6e-5.
#[test]
fn masses_on_a_rigid_link_with_friction() {
    let mass = "%%MatrixMarket matrix array real general\n3 3\n4.5\n-1.7500000000000004e-01\n4.5000000000000001e-01\n\
                -1.7499999999999999e-01\n5.5124999999999991e-01\n-1.7500000000000002e-02\n\
                4.5000000000000001e-01\n-1.7500000000000012e-02\n4.5000000000000005e-02\n";
    let stiffness = "%%MatrixMarket matrix array real symmetric\n3 3\n5e5\n1e4\n0\n3e4\n-2e3\n4e4\n";
    let text = "[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\n[[place]]\nname = \"u\"\ndof = \"1\"\n\
                [[spring]]\nbetween = [\"u\", \"ground\"]\ndamping = \"20 N s/m\"\n\
                [[joint]]\nname = \"rub\"\nbetween = [\"u\", \"ground\"]\n\
                law = { kind = \"jenkins\", stiffness = \"1e5 N/m\", limit = \"1 N\" }\n\
                [[force]]\non = \"u\"\namplitude = \"2 N\"\n\
                [study]\nkind = \"response\"\nfrequency = [\"50 Hz\", \"52 Hz\", \"55 Hz\", \"60 Hz\"]\n";
    let checked = checked(&[("k.mtx", stiffness), ("m.mtx", mass)], text);
    close(&frequencies(&checked), &[36.26612, 51.26761], 2e-7);
    let expected = [27.83837e-6, 89.04413e-6, 27.93863e-6, 12.93144e-6];
    close(&column(&run(&checked), "curve", "u_amplitude_m"), &expected, 1e-3);
}

/// A shaft in two directions with gyroscopic coupling in its damping matrix: eigenvalues of the
/// first-order system, and the direct solution.
#[test]
fn gyroscopic_coupling_in_the_damping() {
    let damping = "%%MatrixMarket matrix coordinate real general\n2 2 4\n1 1 50\n2 2 50\n1 2 300\n2 1 -300\n";
    let diagonal =
        |value: &str| format!("%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 {value}\n2 2 {value}\n");
    let files = [("k.mtx", &diagonal("1e6")[..]), ("m.mtx", &diagonal("5")), ("c.mtx", damping)];
    let structure = "[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\ndamping = \"c.mtx\"\nunits = \"m-kg-s\"\n\
                     [[place]]\nname = \"x\"\ndof = \"1\"\n";
    let forced = "[[force]]\non = \"x\"\namplitude = \"1 N\"\n\
                  [study]\nkind = \"response\"\nfrequency = { from = \"64 Hz\", to = \"68 Hz\", points = 41 }\n";
    let checked_response = checked(&files, &format!("{structure}{forced}"));
    close(&frequencies(&checked_response), &[66.55715407, 76.10645066], 1e-9);
    let damping: Vec<f64> = checked_response.summary().free.elastic.iter().map(|mode| mode.damping).collect();
    close(&damping, &[0.0111552656, 0.0111552656], 1e-8);
    assert!(checked_response.summary().warnings.is_empty(), "{:?}", checked_response.summary().warnings);
    let data = run(&checked_response);
    close(&column(&data, "peaks", "frequency_Hz"), &[66.49507], 2e-7);
    close(&column(&data, "peaks", "amplitude_m"), &[24.25485e-6], 3e-7);
    let campbell =
        "[study]\nkind = \"campbell\"\nspeed = { from = \"10 Hz\", to = \"20 Hz\", points = 2 }\nmodes = 2\n";
    let whole = structure.replace("[[place]]", "reduce = false\n[[place]]");
    let data = run(&checked(&files, &format!("{whole}{campbell}")));
    let mut found = column(&data, "campbell", "frequency_Hz");
    found.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-9);
    assert!(found.iter().any(|f| (f / 66.55715407 - 1.0).abs() < 1e-9), "{found:?}");
    assert!(found.iter().any(|f| (f / 76.10645066 - 1.0).abs() < 1e-9), "{found:?}");
}
