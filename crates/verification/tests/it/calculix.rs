//! A blade by CalculiX, through a study file.
//!
//! Its frequencies agree to six digits. Its response without joints agrees to 1e-5, with all
//! rows and reduced, and to 1e-8 with SciPy on the same matrices. `data/calculix/make.py` and
//! `direct.py` make the data.

use flate2::read::GzDecoder;
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use stickslip_study::read_file;
use stickslip_study::run::{Context, run};

fn data(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/calculix").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(data(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Unpacks the matrices of CalculiX.
fn unpack(name: &str, folder: &Path) {
    for name in [format!("{name}.sti"), format!("{name}.mas")] {
        let mut bytes = Vec::new();
        GzDecoder::new(File::open(data(&format!("{name}.gz"))).unwrap()).read_to_end(&mut bytes).unwrap();
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    std::fs::copy(data(&format!("{name}.dof")), folder.join(format!("{name}.dof"))).unwrap();
}

/// Makes a folder with these matrices and a study.
fn folder(more: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    unpack("blade", folder.path());
    let study = format!(
        "schema = 1\n[structure]\nstiffness = \"blade.sti\"\nmass = \"blade.mas\"\ndofs = \"blade.dof\"\nunits = \"mm-t-s\"\n\
         rayleigh = {{ mass = \"5 /s\", stiffness = \"1e-7 s\" }}\n{more}\n\
         {}[[force]]\non = \"tip.z\"\namplitude = \"1 N\"\n\
         [study]\nkind = \"response\"\nfrequency = {HERTZ:?}\npeaks = false\n[method]\nkind = \"harmonic-balance\"\n",
        PLACES.map(|(name, node)| format!("[[place]]\nname = \"{name}\"\nnodes = [\"{node}\"]\n")).concat()
    );
    std::fs::write(folder.path().join("blade.toml"), study).unwrap();
    folder
}

/// The nodes of `blade_response.csv`: the middle, the other corner of the tip, both edges, the
/// foot, and the driven node.
const PLACES: [(&str, u32); 6] =
    [("middle", 449), ("corner", 865), ("front", 655), ("back", 681), ("foot", 236), ("tip", 900)];

/// Frequencies on both sides of the three lowest resonances.
const HERTZ: [&str; 6] = ["451.3 Hz", "462.81 Hz", "2054.9 Hz", "2096.4 Hz", "3158.8 Hz", "3238.2 Hz"];

/// CalculiX prints seven digits; the library's values are accurate to more.
const SIX_DIGITS: f64 = 1e-6;

#[test]
fn frequencies_to_six_digits() {
    let folder = folder("reduce = { up_to = \"5 kHz\" }");
    let study = read_file(&folder.path().join("blade.toml"), &[]).unwrap();
    let model = study.case(0).unwrap().model;
    let component = &model.substructure.as_ref().unwrap().component;
    assert_eq!(component.dofs(), 2592);
    let expected: Vec<f64> = text("blade_frequencies_Hz.txt").lines().map(|line| line.parse().unwrap()).collect();
    assert_eq!(expected.len(), 20);
    for (own, expected) in component.frequencies(expected.len()).unwrap().iter().zip(expected) {
        assert!((own / TAU / expected - 1.0).abs() < SIX_DIGITS, "{} {expected}", own / TAU);
    }
}

/// Reads the rows of a response: Hz, node, and real and imaginary parts along x, y, z in mm.
fn rows(name: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|value| value.parse().unwrap()).collect();
    let rows: Vec<Vec<f64>> = text(name).lines().skip(1).map(row).collect();
    assert_eq!(rows.len(), PLACES.len() * HERTZ.len());
    rows
}

/// Returns, for each row, the frequency, the place, and the distance of the study's response
/// from it, relative to the largest component. `reduce` is the reduction of the study.
fn apart(rows: &[Vec<f64>], reduce: &str) -> Vec<(f64, &'static str, f64)> {
    let folder = folder(&format!("reduce = {reduce}"));
    let study = read_file(&folder.path().join("blade.toml"), &[]).unwrap();
    let found = run(&study, &Context::without_progress(1)).unwrap();
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    let table = &found.tables[0];
    let hertz = table.numbers("frequency_Hz").unwrap();
    let one = |row: &Vec<f64>| {
        let (place, _) = PLACES[PLACES.iter().position(|(_, node)| *node == row[1] as u32).unwrap()];
        let point = hertz.iter().position(|f| (f - row[0]).abs() < 1e-9).unwrap();
        let (mut apart, mut size) = (0.0f64, 0.0f64);
        for (k, along) in ["x", "y", "z"].iter().enumerate() {
            let column = |what: &str| table.numbers(&format!("{place}_{along}_{what}")).unwrap()[point];
            let own = Complex64::from_polar(1e3 * column("amplitude_m"), column("phase_deg").to_radians());
            let expected = Complex64::new(row[2 + k], row[5 + k]);
            apart = apart.max((own - expected).norm());
            size = size.max(expected.norm());
        }
        (row[0], place, apart / size)
    };
    rows.iter().map(one).collect()
}

/// Five digits agree with CalculiX where it is accurate to that. All nodes at all frequencies,
/// with the driven node, agree with SciPy on the same matrices.
#[test]
fn response_without_joints() {
    let (calculix, direct) = (rows("blade_response.csv"), rows("blade_direct.csv"));
    let all = [calculix.as_slice(), direct.as_slice()].concat();
    // the reduced model must reach the tolerance that it promises
    for (reduce, exact) in [("false", 1e-8), ("{ up_to = \"5 kHz\", tolerance = 1e-6 }", 1e-6)] {
        let found = apart(&all, reduce);
        let (of_calculix, of_direct) = found.split_at(calculix.len());
        for (hertz, place, apart) in of_calculix {
            // at the driven end, the modes that CalculiX omits matter at all but the first
            // resonance
            let bound = match (*place, *hertz < 500.0) {
                ("tip", true) => 5e-5,
                ("tip" | "corner", false) => continue,
                _ => 1e-5,
            };
            assert!(*apart < bound, "{reduce}, {place} at {hertz} Hz: {apart:e}");
        }
        for (hertz, place, apart) in of_direct {
            assert!(*apart < exact, "{reduce}, {place} at {hertz} Hz: {apart:e} of the direct solution");
        }
    }
}

/// Elements with incompatible modes have inner rows with stiffness and mass. Their nodes follow
/// those of the mesh, here after 42.
///
/// The frequencies agree with CalculiX. The first is that of a slender beam, up to the larger
/// stiffness of a plate. The response of the reduced model agrees with that of all rows.
#[test]
fn inner_rows_of_incompatible_modes() {
    let folder = tempfile::tempdir().unwrap();
    unpack("incompatible", folder.path());
    let found = |reduce: &str| {
        let text = format!(
            "schema = 1\n[structure]\nstiffness = \"incompatible.sti\"\nmass = \"incompatible.mas\"\ndofs = \"incompatible.dof\"\n\
             units = \"mm-t-s\"\nmodal_damping = 0.002\nreduce = {reduce}\n[[place]]\nname = \"tip\"\nnodes = [\"42\"]\n\
             [[force]]\non = \"tip.z\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\nfrequency = [\"800 Hz\", \"2 kHz\"]\n\
             [method]\nkind = \"harmonic-balance\"\n"
        );
        let path = folder.path().join("strip.toml");
        std::fs::write(&path, text).unwrap();
        let study = read_file(&path, &[]).unwrap();
        let data = run(&study, &Context::without_progress(1)).unwrap();
        assert!(data.failures.is_empty(), "{:?}", data.failures);
        let table = &data.tables[0];
        let error = table.numbers("reduction_error").map_or(0.0, |errors| errors[0]);
        (study, table.numbers("tip_z_amplitude_m").unwrap().to_vec(), error)
    };
    let (study, few, error) = found("{ up_to = \"10 kHz\" }");
    let model = study.case(0).unwrap().model;
    let component = &model.substructure.as_ref().unwrap().component;
    let node = |row: usize| component.rows()[row].split('.').next().unwrap().parse::<u32>().unwrap();
    let inner = |row: usize| node(row) > 42;
    assert_eq!((0..component.dofs()).filter(|row| inner(*row)).count(), 12 * 9, "nine for every element");
    let expected: Vec<f64> =
        text("incompatible_frequencies_Hz.txt").lines().map(|line| line.parse().unwrap()).collect();
    for (own, expected) in component.frequencies(expected.len()).unwrap().iter().zip(&expected) {
        assert!((own / TAU / expected - 1.0).abs() < SIX_DIGITS, "{} {expected}", own / TAU);
    }
    // 30 mm long, 1 mm thick, in m and kg
    let beam = 3.516 / TAU * 1e-3 / 0.03f64.powi(2) * (2.1e11 / (12.0 * 7850.0f64)).sqrt();
    assert!((1.0..1.05).contains(&(expected[0] / beam)), "{} {beam}", expected[0]);
    let (_, whole, _) = found("{ kind = \"none\", up_to = \"10 kHz\" }");
    for (few, whole) in few.iter().zip(whole) {
        assert!((few / whole - 1.0).abs() <= error.max(1e-9) && error > 0.0, "{few:e} {whole:e} {error:e}");
    }
}
