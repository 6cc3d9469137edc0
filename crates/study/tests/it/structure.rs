//! Studies of structures given by matrices, against dense solutions without places, reductions
//! or studies.
//!
//! The tests cover files in several formats and units, added masses and joints, and every kind
//! of wrong file.

#[path = "../../../stickslip/tests/it/reduction/brick.rs"]
#[allow(dead_code)] // other tests use the rest of it
mod brick;

use brick::Brick;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;
use stickslip::structure::Reduction;
use stickslip_formats::{Matrix, Symmetry, names, write};
use stickslip_study::dataset::Dataset;
use stickslip_study::read_file;
use stickslip_study::run::{Context, check, run};

/// Rayleigh damping: factors of mass (1/s) and stiffness (s).
const RAYLEIGH: (f64, f64) = (20.0, 2e-6);
const DIRECTIONS: [&str; 3] = ["x", "y", "z"];

/// A steel blade 80 mm long, fixed at x = 0, with 8 x 2 x 1 elements: 144 rows.
fn blade() -> Brick {
    Brick::new([8, 2, 1], [0.08, 0.02, 0.004], true)
}

/// Returns `node.direction` for every row; nodes count from 101.
fn named(brick: &Brick) -> Vec<String> {
    (0..brick.dofs()).map(|row| format!("{}.{}", 101 + row / 3, DIRECTIONS[row % 3])).collect()
}

/// Returns the name of a node at the free end.
fn tip(brick: &Brick, y: usize, z: usize) -> String {
    (101 + brick.row([8, y, z], 0).unwrap() / 3).to_string()
}

fn full(matrix: &stickslip_numerics::sparse::SparseMatrix) -> DMatrix<f64> {
    let mut full = DMatrix::zeros(matrix.n(), matrix.n());
    matrix.entries().for_each(|(row, column, value)| full[(row, column)] = value);
    full
}

/// Writes both matrices in units with a stiffness unit of `units.0` N/m and a mass unit of
/// `units.1` kg.
fn write_pair(folder: &Path, brick: &Brick, ending: &str, units: (f64, f64)) {
    for (name, matrix, unit) in [("k", &brick.stiffness, units.0), ("m", &brick.mass, units.1)] {
        let entries = matrix.entries().map(|(row, column, value)| (row, column, value / unit));
        let made = Matrix::new(matrix.n(), matrix.n(), Symmetry::General, entries).unwrap();
        match ending {
            // CalculiX: upper triangle, indices from 1
            "sti" => {
                let mut text = String::new();
                for entry in made.both_triangles().filter(|entry| entry.column >= entry.row) {
                    let _ = writeln!(text, "{} {} {:e}", entry.row + 1, entry.column + 1, entry.value);
                }
                std::fs::write(folder.join(format!("{name}.{ending}")), text).unwrap();
            }
            _ => write(folder.join(format!("{name}.{ending}")), &made).unwrap(),
        }
        let made = made.with_names(named(brick)).unwrap();
        names::write(folder.join("rows.csv"), &made).unwrap();
    }
    let numbers = |row: usize| format!("{}.{}\n", 101 + row / 3, row % 3 + 1);
    std::fs::write(folder.join("rows.dof"), (0..brick.dofs()).map(numbers).collect::<String>()).unwrap();
}

fn structure(ending: &str, dofs: &str, units: &str, more: &str) -> String {
    format!(
        "schema = 1\n[structure]\nstiffness = \"k.{ending}\"\nmass = \"m.{ending}\"\ndofs = \"{dofs}\"\nunits = \"{units}\"\n\
         {more}\n"
    )
}

const DAMPED: &str = "rayleigh = { mass = \"20 /s\", stiffness = \"2e-6 s\" }";

/// Runs a study whose files are in `folder`.
fn results(folder: &Path, text: &str) -> Dataset {
    let path = folder.join("study.toml");
    std::fs::write(&path, text).unwrap();
    let study = read_file(&path, &[]).unwrap_or_else(|error| panic!("{error:?}\n{text}"));
    let data = run(&study, &Context::without_progress(1)).unwrap();
    assert!(data.failures.is_empty(), "{:?}", data.failures);
    data
}

fn numbers<'a>(data: &'a Dataset, column: &str) -> &'a [f64] {
    data.tables[0].numbers(column).unwrap_or_else(|| panic!("no {column}: {:?}", data.tables[0].columns))
}

/// Returns the amplitudes of all rows under a force along `load`, with added mass and
/// stiffness.
fn dense(brick: &Brick, hertz: f64, load: &DVector<f64>, added: &[(usize, f64, f64)]) -> DVector<Complex64> {
    let omega = hertz * TAU;
    let (mut mass, mut stiffness) = (full(&brick.mass), full(&brick.stiffness));
    let damping = &mass * RAYLEIGH.0 + &stiffness * RAYLEIGH.1;
    for (row, m, k) in added {
        mass[(*row, *row)] += m;
        stiffness[(*row, *row)] += k;
    }
    let z = (stiffness - mass * (omega * omega)).map(|v| Complex64::new(v, 0.0))
        + damping.map(|v| Complex64::new(0.0, omega * v));
    z.lu().solve(&load.map(|v| Complex64::new(v, 0.0))).unwrap()
}

/// A force of 1 N along z on a node at the tip, and the frequencies of the test, Hz. The first
/// bending mode is near 520 Hz.
const FORCED: &str = "[[force]]\non = \"tip.z\"\namplitude = \"1 N\"\n\
    [study]\nkind = \"response\"\nfrequency = [\"300 Hz\", \"515 Hz\", \"900 Hz\"]\n";
const HERTZ: [f64; 3] = [300.0, 515.0, 900.0];

fn place(name: &str, node: &str) -> String {
    format!("[[place]]\nname = \"{name}\"\ndofs = [\"{node}.x\", \"{node}.y\", \"{node}.z\"]\n")
}

/// The response is that of a dense solution in every format and unit.
#[test]
fn files_of_several_formats_and_units_have_one_response() {
    let brick = blade();
    let node = tip(&brick, 0, 1);
    let z = brick.row([8, 0, 1], 2).unwrap();
    let mut load = DVector::zeros(brick.dofs());
    load[z] = 1.0;
    let pound = 4.4482216152605;
    for (ending, dofs, units, (k, m)) in [
        ("mtx", "rows.csv", "m-kg-s", (1.0, 1.0)),
        ("npz", "rows.csv", "mm-t-s", (1e3, 1e3)),
        ("sti", "rows.dof", "in-lbf-s", (pound / 0.0254, pound / 0.0254)),
        ("mtx", "rows.dof", "mm-kg-ms", (1e6, 1.0)),
    ] {
        let folder = tempfile::tempdir().unwrap();
        write_pair(folder.path(), &brick, ending, (k, m));
        let more = format!("{DAMPED}\nreduce = false");
        let text = structure(ending, dofs, units, &more) + &place("tip", &node) + FORCED;
        let text = text + "[method]\nkind = \"harmonic-balance\"\n";
        let data = results(folder.path(), &text);
        for (i, hertz) in HERTZ.iter().enumerate() {
            let x = dense(&brick, *hertz, &load, &[]);
            for (k, along) in DIRECTIONS.iter().enumerate() {
                let (found, expected) = (numbers(&data, &format!("tip_{along}_amplitude_m"))[i], x[z - 2 + k].norm());
                assert!((found - expected).abs() < 1e-8 * x[z].norm(), "{ending} {hertz} {along}: {found} {expected}");
            }
        }
    }
}

/// The error of a reduced model is at most the recorded one, for each kind of reduction and by
/// every method.
#[test]
fn reduced_models_meet_their_error() {
    let brick = blade();
    let (node, z) = (tip(&brick, 0, 1), brick.row([8, 0, 1], 2).unwrap());
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let mut load = DVector::zeros(brick.dofs());
    load[z] = 1.0;
    for (reduce, method) in [
        ("", "harmonic-balance"),
        ("reduce = { up_to = \"5 kHz\", tolerance = 1e-6 }", "event-driven"),
        ("reduce = { modes = 12, kind = \"craig-bampton\" }", "harmonic-balance"),
        ("reduce = { modes = 12 }", "shooting"),
    ] {
        let text =
            structure("npz", "rows.csv", "m-kg-s", &format!("{DAMPED}\n{reduce}")) + &place("tip", &node) + FORCED;
        let data = results(folder.path(), &format!("{text}[method]\nkind = \"{method}\"\n"));
        let error = numbers(&data, "reduction_error")[0];
        // With a given number of modes the error covers frequencies up to the last mode. Near a
        // resonance a small frequency shift is a large error.
        assert!(error > 0.0 && (reduce.contains("modes") || error < 1e-4), "{reduce}: {error:e}");
        for (i, hertz) in HERTZ.iter().enumerate() {
            let expected = dense(&brick, *hertz, &load, &[])[z].norm();
            let off = numbers(&data, "tip_z_amplitude_m")[i] / expected - 1.0;
            // near the resonance at 515 Hz, an error of its frequency is amplified by 1 / (2
            // zeta) = 60
            assert!(off.abs() < 60.0 * error.max(1e-6), "{reduce} {method} {hertz}: {off:e}, {error:e}");
        }
    }
}

/// With a given number of modes the error is that over the frequencies of the study. It is
/// smaller for lower excitation frequencies, and the record states the range. Craig-Bampton
/// takes the modes that an error requires, on solids more than three times the highest
/// frequency.
#[test]
fn errors_are_those_of_the_studys_frequencies() {
    let brick = blade();
    let (node, folder) = (tip(&brick, 0, 1), tempfile::tempdir().unwrap());
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let told = |reduce: &str, to: &str| {
        let study = format!(
            "[[force]]\non = \"tip.z\"\namplitude = \"1 N\"\n[study]\nkind = \"response\"\nfrequency = [\"100 Hz\", \"{to}\"]\n"
        );
        let text =
            structure("npz", "rows.csv", "m-kg-s", &format!("{DAMPED}\n{reduce}")) + &place("tip", &node) + &study;
        let file = folder.path().join("study.toml");
        std::fs::write(&file, text).unwrap();
        let summary = check(&read_file(&file, &[]).unwrap()).unwrap().summary().clone();
        let reduced = summary.structure.unwrap().reduced.unwrap();
        (reduced.error, reduced.up_to / TAU)
    };
    let few = "reduce = { modes = 4, kind = \"craig-bampton\" }";
    let (near, far) = (told(few, "400 Hz"), told(few, "3 kHz"));
    assert!((near.1 - 400.0).abs() < 1e-9 && (far.1 - 3000.0).abs() < 1e-9, "{near:?} {far:?}");
    assert!(near.0 < 0.01 && far.0 > near.0, "{near:?} {far:?}");
    let close = told("reduce = { up_to = \"5 kHz\", kind = \"craig-bampton\", tolerance = 1e-5 }", "400 Hz");
    assert!(close.0 <= 1e-5, "{close:?}");
}

/// The mass of the blade without its fixed face shows wrong units where frequencies cannot.
/// Along x the mass of 8 elements with a fixed first face is `ρ V (1 - (2/3)/8)`: the square of
/// a line from 0 to 1 has the mean 1/3.
#[test]
fn summary_states_the_mass() {
    let brick = blade();
    let (node, folder) = (tip(&brick, 0, 1), tempfile::tempdir().unwrap());
    // written in tonnes and newtons per millimetre
    write_pair(folder.path(), &brick, "npz", (1e3, 1e3));
    let expected = 7850.0 * 0.08 * 0.02 * 0.004 * (1.0 - 2.0 / 3.0 / 8.0);
    for (units, factor) in [("mm-t-s", 1.0), ("m-kg-s", 1e-3), ("mm-kg-s", 1e-3), ("cm-g-s", 1e-6)] {
        let text = structure("npz", "rows.csv", units, DAMPED) + &place("tip", &node) + FORCED;
        let file = folder.path().join("study.toml");
        std::fs::write(&file, text).unwrap();
        let checked = check(&read_file(&file, &[]).unwrap()).unwrap();
        let found = checked.summary().structure.as_ref().unwrap().mass;
        for along in found {
            let ratio = along.unwrap() / (factor * expected);
            assert!((ratio - 1.0).abs() < 1e-12, "{units}: {found:?} {}", factor * expected);
        }
        assert!(checked.summary().to_string().contains("kg along x, y, z"), "{}", checked.summary());
    }
}

/// If two matrices differ in size, the message names the file with fewer rows as truncated.
#[test]
fn a_truncated_matrix_is_named() {
    let brick = blade();
    let (node, folder) = (tip(&brick, 0, 1), tempfile::tempdir().unwrap());
    write_pair(folder.path(), &brick, "sti", (1.0, 1.0));
    for (short, other) in [("k.sti", "stiffness"), ("m.sti", "mass")] {
        let path = folder.path().join(short);
        let whole = std::fs::read_to_string(&path).unwrap();
        // entries of the first rows only, as in a file that ends too early
        let cut: String = whole.lines().filter(|line| early(line)).map(|line| format!("{line}\n")).collect();
        std::fs::write(&path, cut).unwrap();
        let text = structure("sti", "rows.csv", "m-kg-s", DAMPED) + &place("tip", &node) + FORCED;
        let file = folder.path().join("study.toml");
        std::fs::write(&file, text).unwrap();
        let said = read_file(&file, &[]).unwrap_err().to_string();
        assert!(said.contains(&format!("the {other} matrix has 60 rows")) && said.contains("144"), "{said}");
        std::fs::write(&path, whole).unwrap();
    }
}

/// Returns whether both indices of a line `row column value` are at most 60.
fn early(line: &str) -> bool {
    line.split_whitespace().take(2).all(|index| index.parse::<usize>().unwrap() <= 60)
}

/// Without an excitation frequency the range of a reduction is undetermined, and the message
/// asks for it.
#[test]
fn a_reduction_needs_a_frequency_range() {
    let brick = blade();
    let (node, folder) = (tip(&brick, 0, 1), tempfile::tempdir().unwrap());
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let text = structure("npz", "rows.csv", "m-kg-s", DAMPED)
        + &place("tip", &node)
        + "[study]\nkind = \"modes\"\namplitude = { from = \"1 um\", to = \"1 mm\" }\n";
    let file = folder.path().join("study.toml");
    std::fs::write(&file, text).unwrap();
    let said = read_file(&file, &[]).unwrap_err().to_string();
    assert!(said.contains("no excitation frequency that defines the frequency range"), "{said}");
}

/// Drawn parameters in a study with matrices alone: every draw is the response with its values,
/// all on one reduction.
#[test]
fn parameters_of_a_structure_are_drawn() {
    let brick = blade();
    let (node, z) = (tip(&brick, 0, 1), brick.row([8, 0, 1], 2).unwrap());
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let more = format!("{DAMPED}\nreduce = {{ up_to = \"5 kHz\", tolerance = 1e-7 }}");
    let text = structure("npz", "rows.csv", "m-kg-s", &more)
        + &place("tip", &node)
        + "[parameters]\nF = \"1 N\"\nk = \"1 N/m\"\n[sample]\ncount = 3\nseed = 5\n\
           of = { F = { uniform = [\"1 N\", \"2 N\"] }, k = { uniform = [\"1e4 N/m\", \"2e4 N/m\"] } }\n\
           [[spring]]\nbetween = [\"tip.z\", \"ground\"]\nstiffness = \"k\"\n[[force]]\non = \"tip.z\"\namplitude = \"F\"\n\
           [study]\nkind = \"response\"\nfrequency = [\"300 Hz\", \"900 Hz\"]\n";
    let data = results(folder.path(), &text);
    let drawn = |name: &str| numbers(&data, name).to_vec();
    let (forces, springs, found) = (drawn("F_N"), drawn("k_N_per_m"), drawn("tip_z_amplitude_m"));
    assert!(found.len() == 6 && forces[0] != forces[2] && springs[0] != springs[2], "{forces:?} {springs:?}");
    for row in 0..found.len() {
        let mut load = DVector::zeros(brick.dofs());
        load[z] = forces[row];
        let expected = dense(&brick, [300.0, 900.0][row % 2], &load, &[(z, 0.0, springs[row])])[z].norm();
        assert!((found[row] / expected - 1.0).abs() < 1e-5, "{row}: {} {expected}", found[row]);
    }
}

/// A lumped mass with a spring to the blade and another one to the ground equals a dense
/// solution.
#[test]
fn masses_and_springs_are_added_at_places() {
    let brick = blade();
    let (node, z) = (tip(&brick, 2, 0), brick.row([8, 2, 0], 2).unwrap());
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    let (spring, mass, hold) = (4e5, 0.02, 1e5);
    let more = format!("{DAMPED}\nreduce = {{ up_to = \"20 kHz\", tolerance = 1e-7 }}");
    let text = structure("mtx", "rows.csv", "m-kg-s", &more)
        + &format!("[[place]]\nname = \"tip\"\ndof = \"{node}.z\"\n")
        + "[[mass]]\nname = \"damper\"\nmass = \"20 g\"\n\
           [[spring]]\nbetween = [\"tip\", \"damper\"]\nstiffness = \"4e5 N/m\"\n\
           [[spring]]\nbetween = [\"damper\", \"ground\"]\nstiffness = \"1e5 N/m\"\n\
           [[force]]\non = \"damper\"\namplitude = \"1 N\"\n\
           [study]\nkind = \"response\"\nfrequency = [\"300 Hz\", \"515 Hz\", \"900 Hz\"]\n";
    let data = results(folder.path(), &text);
    for (i, hertz) in HERTZ.iter().enumerate() {
        // the added mass is eliminated: it loads the tip by its dynamic stiffness
        let own = spring + hold - mass * (hertz * TAU).powi(2);
        let mut load = DVector::zeros(brick.dofs());
        load[z] = spring / own;
        let tip = dense(&brick, *hertz, &load, &[(z, 0.0, spring - spring * spring / own)])[z];
        let damper = (tip * spring + 1.0) / own;
        for (column, expected) in [("tip_amplitude_m", tip.norm()), ("damper_amplitude_m", damper.norm())] {
            let off = numbers(&data, column)[i] / expected - 1.0;
            assert!(off.abs() < 1e-5, "{column} {hertz}: {off:e}");
        }
    }
}

/// A row of the structure has an imposed motion. The others equal a dense solution with its
/// column on the right-hand side.
#[test]
fn rows_can_have_imposed_motions() {
    let brick = blade();
    let (node, z) = (tip(&brick, 0, 0), brick.row([8, 0, 0], 2).unwrap());
    let other = brick.row([4, 1, 1], 2).unwrap();
    let name = named(&brick)[other].clone();
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    for (reduce, tolerance) in [("false", 1e-8), ("{ up_to = \"5 kHz\", tolerance = 1e-7 }", 1e-5)] {
        let text = structure("mtx", "rows.csv", "m-kg-s", &format!("{DAMPED}\nreduce = {reduce}"))
            + &format!(
                "[[place]]\nname = \"tip\"\ndof = \"{node}.z\"\n[[place]]\nname = \"middle\"\ndof = \"{name}\"\n"
            )
            + "[[motion]]\non = \"tip\"\namplitude = \"0.1 mm\"\n\
               [study]\nkind = \"response\"\nfrequency = [\"300 Hz\", \"515 Hz\", \"900 Hz\"]\n\
               [method]\nkind = \"harmonic-balance\"\n";
        let data = results(folder.path(), &text);
        for (i, hertz) in HERTZ.iter().enumerate() {
            // the receptance of the force that moves it
            let mut load = DVector::zeros(brick.dofs());
            load[z] = 1.0;
            let x = dense(&brick, *hertz, &load, &[]);
            let expected = (x[other] / x[z]).norm() * 1e-4;
            let off = numbers(&data, "middle_amplitude_m")[i] / expected - 1.0;
            assert!(off.abs() < tolerance, "{reduce} {hertz}: {off:e}");
        }
    }
}

/// Friction in the plane is isotropic: tangents rotated by 30 degrees about the normal give the
/// same orbit.
#[test]
fn a_turned_frame_has_the_same_orbit() {
    let brick = blade();
    let (node, far) = (tip(&brick, 0, 0), tip(&brick, 2, 1));
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    let of = |tangent: &str| {
        let text = structure("mtx", "rows.csv", "m-kg-s", &format!("{DAMPED}\nreduce = {{ up_to = \"5 kHz\" }}"))
            + &format!("[[place]]\nname = \"pad\"\nnodes = [\"{node}\"]\nnormal = [0, 0, 1]\ntangent = {tangent}\n")
            + &place("tip", &far)
            + "[[joint]]\nname = \"rub\"\nbetween = [\"pad\", \"ground\"]\n\
               law = { kind = \"friction-contact\", tangential = \"2e5 N/m\", normal = \"3e5 N/m\", friction = 0.3, preload = \"20 N\" }\n\
               [[force]]\non = \"tip.y\"\namplitude = \"150 N\"\n[[force]]\non = \"tip.z\"\namplitude = \"2 N\"\nphase = \"50 deg\"\n\
               [study]\nkind = \"response\"\nfrequency = [\"600 Hz\", \"700 Hz\"]\n\
               [method]\nkind = \"harmonic-balance\"\nharmonics = 7\n";
        results(folder.path(), &text)
    };
    let straight = of("[1, 0, 0]");
    let turned = of("[\"cos(30 deg)\", \"sin(30 deg)\", 0]");
    let slip = numbers(&straight, "rub_slip_fraction");
    assert!(slip.iter().all(|share| *share > 0.05), "{slip:?}");
    let largest = numbers(&straight, "tip_y_amplitude_m").iter().fold(0.0f64, |most, x| most.max(*x));
    for column in ["tip_x_amplitude_m", "tip_y_amplitude_m", "tip_z_amplitude_m", "pad_n_amplitude_m"] {
        for (a, b) in numbers(&straight, column).iter().zip(numbers(&turned, column)) {
            assert!((a - b).abs() < 1e-6 * largest, "{column}: {a} {b}");
        }
    }
    // the tangential motions themselves differ, so the frame has an effect
    let first = numbers(&straight, "pad_t1_amplitude_m")[0];
    assert!((first - numbers(&turned, "pad_t1_amplitude_m")[0]).abs() > 1e-2 * first);
}

/// A frame takes the rows of a node along x, y and z by their names, in any order.
#[test]
fn rows_of_a_frame_are_taken_by_their_names() {
    let brick = blade();
    let node = tip(&brick, 0, 0);
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    let of = |rows: [&str; 3]| {
        let rows = rows.map(|along| format!("\"{node}.{along}\"")).join(", ");
        let text = structure("mtx", "rows.csv", "m-kg-s", &format!("{DAMPED}\nreduce = {{ up_to = \"5 kHz\" }}"))
            + &format!("[[place]]\nname = \"pad\"\ndofs = [{rows}]\nnormal = [0, 1, 2]\n")
            + "[[force]]\non = \"pad.n\"\namplitude = \"5 N\"\n\
               [study]\nkind = \"response\"\nfrequency = [\"600 Hz\", \"700 Hz\"]\n\
               [method]\nkind = \"harmonic-balance\"\nharmonics = 1\n";
        let data = results(folder.path(), &text);
        ["pad_t1_amplitude_m", "pad_t2_amplitude_m", "pad_n_amplitude_m"].map(|column| numbers(&data, column).to_vec())
    };
    let straight = of(["x", "y", "z"]);
    assert!(straight[2].iter().all(|x| *x > 0.0));
    assert_eq!(of(["z", "x", "y"]), straight);
}

/// Each error names the file or key, and what to do.
#[test]
fn errors_name_file_or_key() {
    let brick = blade();
    let node = tip(&brick, 0, 1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    write_pair(path, &brick, "mtx", (1.0, 1.0));
    let rows = brick.dofs();
    std::fs::write(path.join("wide.mtx"), "%%MatrixMarket matrix coordinate real general\n2 3 1\n1 1 1.0\n").unwrap();
    std::fs::write(path.join("complex.mtx"), "%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1.0 2.0\n")
        .unwrap();
    std::fs::write(path.join("cut.mtx"), "%%MatrixMarket matrix coordinate real general\n2 2 3\n1 1 1.0\n").unwrap();
    std::fs::write(path.join("few.dof"), "101.1\n101.2\n").unwrap();
    let negative = brick
        .mass
        .entries()
        .map(|(row, column, value)| (row, column, if row == 5 && column == 5 { -value } else { value }));
    write(path.join("negative.mtx"), &Matrix::new(rows, rows, Symmetry::General, negative).unwrap()).unwrap();
    let slanted = brick
        .stiffness
        .entries()
        .map(|(row, column, value)| (row, column, if row == 3 && column == 0 { 2.0 * value } else { value }));
    write(path.join("slanted.mtx"), &Matrix::new(rows, rows, Symmetry::General, slanted).unwrap()).unwrap();
    let pulled = brick.stiffness.entries().map(|(row, column, value)| (row, column, -value));
    write(path.join("pulled.mtx"), &Matrix::new(rows, rows, Symmetry::General, pulled).unwrap()).unwrap();
    let good = structure("mtx", "rows.csv", "m-kg-s", DAMPED) + &place("tip", &node) + FORCED;
    let wrong = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        std::fs::write(path.join("study.toml"), good.replacen(from, to, 1)).unwrap();
        let error = read_file(&path.join("study.toml"), &[]).map(|_| ()).expect_err(to);
        format!("{} | {}", error, error.help_text().unwrap_or_default())
    };
    let told = |from: &str, to: &str, words: &[&str]| {
        let text = wrong(from, to);
        assert!(words.iter().all(|word| text.contains(word)), "{to}: {text}");
    };
    told("\"k.mtx\"", "\"gone.mtx\"", &["study.toml:3", "gone.mtx"]);
    told("\"k.mtx\"", "\"wide.mtx\"", &["wide.mtx", "2 rows and 3 columns"]);
    told("\"k.mtx\"", "\"complex.mtx\"", &["complex.mtx", "complex"]);
    told("\"k.mtx\"", "\"cut.mtx\"", &["cut.mtx"]);
    told("\"k.mtx\"", "\"slanted.mtx\"", &["not symmetric", "row 4, column 1"]);
    told("\"k.mtx\"", "\"pulled.mtx\"", &["study.toml:3", "not positive semidefinite", "signs"]);
    told("\"m.mtx\"", "\"negative.mtx\"", &["study.toml:4", "negative"]);
    told("\"m.mtx\"", "\"k.mtx\"", &["study.toml:4", "the stiffness matrix again"]);
    told(
        "stiffness = \"k.mtx\"\nmass = \"m.mtx\"",
        "stiffness = \"m.mtx\"\nmass = \"k.mtx\"",
        &["are the files of `stiffness` and `mass` exchanged?", "Hz"],
    );
    told("\"rows.csv\"", "\"few.dof\"", &["study.toml:5", "few.dof", "2 names for 144 rows"]);
    told("units = \"m-kg-s\"\n", "", &["`units` is missing", "mm-t-s"]);
    told("\"m-kg-s\"", "\"mm-t\"", &["mm-t-s"]);
    told(&format!("\"{node}.z\""), "\"7.z\"", &["no row `7.z`"]);
    told(&format!("\"{node}.z\"]"), &format!("\"{node}.w\"]"), &["no row", "the rows of this node are"]);
    // no name is similar to a number: the first and the last row show the range
    told(&format!("\"{node}.z\""), "\"9999.z\"", &["no row", "its 144 rows are", ", … `"]);
    told(DAMPED, &format!("{DAMPED}\nreduce = {{ kind = \"none\", modes = 3 }}"), &["remove `kind` or `modes`"]);
    told(DAMPED, &format!("{DAMPED}\nreduce = {{ orders = 2 }}"), &["`orders`", "add `modes`"]);
    let held = "reduce = { modes = 3, orders = 2, kind = \"craig-bampton\" }";
    told(DAMPED, &format!("{DAMPED}\n{held}"), &["no residual vectors", "kind = \"rubin\""]);
    told(DAMPED, &format!("{DAMPED}\nmodal_damping = 0.01"), &["one damping"]);
    told(DAMPED, "damping = \"2 %\"", &["`2 %` is not a file", "modal_damping = \"2 %\""]);
    told(DAMPED, "reduce = { modes = 3, up_to = \"1 kHz\" }", &["remove one of them"]);
    told("dofs = [", "normal = [0, 0, 0]\ndofs = [", &["normal"]);
    told(&format!("\"{node}.z\"]"), &format!("\"{node}.x\"]"), &["is named twice", "sum = {"]);
    told("tip.z", "tip", &["several directions"]);
    told("tip.z", "top.z", &["no place `top.z`"]);
    // a place on the row of an imposed motion follows that motion
    let twin = format!("dofs = [\"{node}.x\", \"{node}.y\", \"{node}.z\"]\n");
    let moved = format!(
        "{twin}[[place]]\nname = \"twin\"\ndof = \"{node}.x\"\n[[motion]]\non = \"twin\"\namplitude = \"1 mm\"\n"
    );
    told(&twin, &moved, &["`tip.x` is determined by the imposed motion of `twin`", "remove the place"]);
    for ratio in ["1e300", "2"] {
        told(DAMPED, &format!("modal_damping = {ratio}"), &["study.toml:7", "a mode does not oscillate", "0.1 %"]);
    }
    told(
        DAMPED,
        &format!("{DAMPED}\nreduce = {{ up_to = \"1e12 Hz\" }}"),
        &["has no modes far above", "lowest frequencies", "reduce = false"],
    );
    // stiffness in wrong units: frequencies of 5e-4 Hz and 5e8 Hz
    let other = good.replacen("k.mtx\"\nmass = \"m.mtx", "k.npz\"\nmass = \"m.npz", 1);
    for unit in [1e12, 1e-12] {
        write_pair(path, &brick, "npz", (unit, 1.0));
        std::fs::write(path.join("study.toml"), &other).unwrap();
        let study = read_file(&path.join("study.toml"), &[]);
        let text = match study.and_then(|study| check(&study)) {
            Ok(checked) => checked.summary().warnings.join("; "),
            Err(error) => error.help_text().unwrap_or_default().to_owned(),
        };
        assert!(text.contains("units"), "{unit}: {text}");
    }
}

/// A free vibration of the reduced blade with a nearly ineffective joint. Amplitudes are those
/// of places, and the largest one is the requested amplitude. They equal a dense eigenvalue
/// solution.
#[test]
fn a_mode_is_given_at_places() {
    let brick = blade();
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    let nodes = [tip(&brick, 0, 1), (101 + brick.row([4, 0, 1], 0).unwrap() / 3).to_string()];
    let places: String = ["tip", "middle"].iter().zip(&nodes).map(|(name, node)| place(name, node)).collect();
    let text = structure("mtx", "rows.csv", "m-kg-s", &format!("{DAMPED}\nreduce = {{ up_to = \"2 kHz\" }}"))
        + &places
        + "[[joint]]\nname = \"rub\"\nbetween = [\"middle.z\", \"ground\"]\nlaw = { kind = \"jenkins\", stiffness = \"1 N/m\", limit = \"1 N\" }\n\
           [study]\nkind = \"modes\"\nharmonics = 1\nsamples = 64\namplitude = { from = \"1 um\", to = \"1 mm\", points = 2 }\n";
    let data = results(folder.path(), &text);
    let (mass, stiffness) = (full(&brick.mass), full(&brick.stiffness));
    let inverse = mass.cholesky().unwrap().l().try_inverse().unwrap();
    let eigen = (&inverse * stiffness * inverse.transpose()).symmetric_eigen();
    let first = eigen.eigenvalues.imin();
    let shape = inverse.transpose() * eigen.eigenvectors.column(first);
    let at = |corner: [usize; 3], along: usize| shape[brick.row(corner, along).unwrap()].abs();
    let largest = at([8, 0, 1], 2);
    for (row, asked) in [1e-6, 1e-3].into_iter().enumerate() {
        for (name, corner) in [("tip", [8, 0, 1]), ("middle", [4, 0, 1])] {
            for (along, direction) in DIRECTIONS.iter().enumerate() {
                let found = numbers(&data, &format!("{name}_{direction}_amplitude_m"))[row];
                // the tolerance of the reduction
                assert!(
                    (found / asked - at(corner, along) / largest).abs() < 1e-3,
                    "{row} {name} {direction}: {found}"
                );
            }
        }
    }
}

/// Constrained rows, marked by 1e36 on the diagonal or by empty rows, are left out. Damping
/// comes from a file. One place is a weighted sum of rows, another the mean of two nodes.
#[test]
fn constrained_rows_sums_means_and_damping_by_a_file() {
    let brick = blade();
    let (n, unit) = (brick.dofs(), 1e3); // mm-t-s: N/mm and t
    let folder = tempfile::tempdir().unwrap();
    let mut rows = named(&brick);
    rows.extend(["900.x".to_owned(), "901.x".to_owned()]);
    let (mass, stiffness) = (full(&brick.mass), full(&brick.stiffness));
    let damping = &mass * RAYLEIGH.0 + &stiffness * RAYLEIGH.1;
    for (name, matrix, clamped) in [("k", stiffness, Some(1e36)), ("m", mass, None), ("c", damping, None)] {
        let entries = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|at| (at.0, at.1, matrix[at] / unit));
        let entries = entries.filter(|entry| entry.2 != 0.0).chain(clamped.map(|value| (n, n, value)));
        let made = Matrix::new(n + 2, n + 2, Symmetry::General, entries).unwrap();
        write(folder.path().join(format!("{name}.mtx")), &made).unwrap();
        names::write(folder.path().join("rows.csv"), &made.with_names(rows.clone()).unwrap()).unwrap();
    }
    let (a, b) = (tip(&brick, 0, 1), tip(&brick, 2, 1));
    let at = |y: usize, along: usize| brick.row([8, y, 1], along).unwrap();
    for (reduce, tolerance) in [("false", 1e-8), ("{ up_to = \"5 kHz\", tolerance = 1e-7 }", 1e-5)] {
        let text = structure("mtx", "rows.csv", "mm-t-s", &format!("damping = \"c.mtx\"\nreduce = {reduce}"))
            + &format!("[[place]]\nname = \"lever\"\nsum = {{ \"{a}.z\" = 0.75, \"{b}.z\" = -0.5 }}\n")
            + &format!("[[place]]\nname = \"both\"\nnodes = [\"{a}\", \"{b}\"]\n")
            + &FORCED.replace("tip.z", "lever")
            + "[method]\nkind = \"harmonic-balance\"\n";
        let data = results(folder.path(), &text);
        let mut load = DVector::zeros(n);
        (load[at(0, 2)], load[at(2, 2)]) = (0.75, -0.5);
        for (i, hertz) in HERTZ.iter().enumerate() {
            let x = dense(&brick, *hertz, &load, &[]);
            let check = |column: &str, expected: Complex64| {
                let found = numbers(&data, column)[i];
                let off = (found - expected.norm()).abs() / x[at(0, 2)].norm();
                assert!(off < tolerance, "{reduce} {column} {hertz}: {found} {expected}");
            };
            check("lever_amplitude_m", x[at(0, 2)] * 0.75 - x[at(2, 2)] * 0.5);
            for (k, along) in DIRECTIONS.iter().enumerate() {
                check(&format!("both_{along}_amplitude_m"), (x[at(0, k)] + x[at(2, k)]) * 0.5);
            }
        }
    }
}

/// Matrices in Nastran's punch format: a massless row, and a free body whose rigid motion
/// appears at 1 Hz because of lost digits.
#[test]
fn a_row_without_mass_and_a_rigid_motion_at_one_hertz() {
    let folder = tempfile::tempdir().unwrap();
    // mass - spring - massless - spring - mass, with a very soft spring to the ground
    let (spring, mass) = (4e5, 0.5);
    let rigid = mass * TAU.powi(2);
    let k = [[spring + rigid, -spring, 0.0], [-spring, 2.0 * spring, -spring], [0.0, -spring, spring + rigid]];
    let m = [[mass, 0.0, 0.0], [0.0; 3], [0.0, 0.0, mass]];
    for (name, matrix) in [("KAAX", k), ("MAAX", m)] {
        let mut text = format!("DMIG    {name}           0       6       2       0                       3\n");
        for column in 0..3 {
            let entries = (column..3).filter(|row| matrix[*row][column] != 0.0);
            let lines: String = entries
                .map(|row| {
                    format!(
                        "*       {:>16}{:>16}{:>16}\n",
                        row + 1,
                        0,
                        format!("{:.9e}", matrix[row][column]).replace('e', "D")
                    )
                })
                .collect();
            if !lines.is_empty() {
                text += &format!("DMIG*   {name:<16}{:>16}{:>16}\n{lines}", column + 1, 0);
            }
        }
        std::fs::write(folder.path().join(format!("{name}.pch")), text).unwrap();
    }
    for reduce in ["false", "{ up_to = \"1 kHz\" }"] {
        let text = format!(
            "schema = 1\n[structure]\nstiffness = \"KAAX.pch\"\nmass = \"MAAX.pch\"\nunits = \"m-kg-s\"\n\
             rayleigh = {{ mass = \"20 /s\" }}\nreduce = {reduce}\n\
             [[place]]\nname = \"one\"\ndof = 1\n[[place]]\nname = \"middle\"\ndof = 2\n\
             [[force]]\non = \"one\"\namplitude = \"1 N\"\n\
             [study]\nkind = \"response\"\nfrequency = [\"0.5 Hz\", \"1 Hz\", \"90 Hz\", \"200 Hz\"]\n\
             [method]\nkind = \"harmonic-balance\"\n"
        );
        let data = results(folder.path(), &text);
        for (i, hertz) in [0.5, 1.0, 90.0, 200.0].into_iter().enumerate() {
            let s = Complex64::new(0.0, hertz * TAU);
            // the massless row is in the middle: two masses on one spring of half the
            // stiffness, by their common and opposed motion
            let own = s * s * mass + s * 20.0 * mass + rigid;
            let (common, opposed) = (0.5 / own, 0.5 / (own + spring));
            for (column, expected) in [("one_amplitude_m", common + opposed), ("middle_amplitude_m", common)] {
                let off = numbers(&data, column)[i] / expected.norm() - 1.0;
                // ten digits of a stiffness that is 2e4 times that of the rigid motion
                assert!(off.abs() < 1e-5, "{reduce} {column} {hertz}: {off:e}");
            }
        }
    }
}

/// A free body with modal damping but an undamped rigid motion, and a mass on another spring,
/// by the event-driven method. Nearly equal roots are not modes. The free chain of three masses
/// has the shapes (1, 0, -1) and (1, -2, 1) at k/m and 3 k/m.
#[test]
fn a_free_body_with_modal_damping_and_a_sprung_mass() {
    let folder = tempfile::tempdir().unwrap();
    let (spring, ratio, beside, soft) = (1e5, 0.01, 0.1, (1e4, 1.0));
    let chain = |a: f64, b: f64, c: f64| [(0, 0, a), (1, 1, b), (2, 2, a), (0, 1, c), (1, 0, c), (1, 2, c), (2, 1, c)];
    for (name, entries) in [("k", chain(spring, 2.0 * spring, -spring)), ("m", chain(1.0, 1.0, 0.0))] {
        let entries = entries.into_iter().filter(|entry| entry.2 != 0.0);
        write(folder.path().join(format!("{name}.mtx")), &Matrix::new(3, 3, Symmetry::General, entries).unwrap())
            .unwrap();
    }
    let text = "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\nmodal_damping = 0.01\n\
         [[place]]\nname = \"one\"\ndof = 1\n[[place]]\nname = \"mean\"\nsum = { \"2\" = 0.5, \"3\" = 0.5 }\n\
         [[mass]]\nname = \"beside\"\nmass = \"100 g\"\n\
         [[spring]]\nbetween = [\"beside\", \"mean\"]\nstiffness = \"10 N/mm\"\ndamping = \"1 kg/s\"\n\
         [[force]]\non = \"one\"\namplitude = \"1 N\"\n\
         [study]\nkind = \"response\"\nfrequency = [\"20 Hz\", \"45 Hz\", \"70 Hz\"]\npeaks = false\n\
         [method]\nkind = \"event-driven\"\n";
    let data = results(folder.path(), text);
    let shapes = [([1.0, 0.0, -1.0], 2.0, spring), ([1.0, -2.0, 1.0], 6.0, 3.0 * spring)];
    let tie = [0.0, -0.5, -0.5, 1.0];
    for (i, hertz) in [20.0, 45.0, 70.0].into_iter().enumerate() {
        let s = Complex64::new(0.0, hertz * TAU);
        let mut stiffness = DMatrix::from_fn(4, 4, |i, j| (s * soft.1 + soft.0) * tie[i] * tie[j]);
        for at in 0..4 {
            stiffness[(at, at)] += s * s * if at < 3 { 1.0 } else { beside };
        }
        for (shape, size, value) in shapes {
            let own = (s * 2.0 * ratio * f64::sqrt(value) + value) / size;
            for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                stiffness[(row, column)] += own * shape[row] * shape[column];
            }
        }
        let x = stiffness.lu().solve(&DVector::from_fn(4, |i, _| Complex64::new(f64::from(i == 0), 0.0))).unwrap();
        for (column, expected) in
            [("one_amplitude_m", x[0]), ("mean_amplitude_m", (x[1] + x[2]) * 0.5), ("beside_amplitude_m", x[3])]
        {
            let off = numbers(&data, column)[i] / expected.norm() - 1.0;
            assert!(off.abs() < 1e-9, "{column} {hertz}: {off:e}");
        }
    }
}

/// Returns λ and the shapes of unit mass, by the Cholesky factor of M.
fn modes(brick: &Brick) -> (Vec<f64>, DMatrix<f64>) {
    let factor = full(&brick.mass).cholesky().unwrap().l();
    let inverse = factor.solve_lower_triangular(&DMatrix::identity(brick.dofs(), brick.dofs())).unwrap();
    let eigen = (&inverse * full(&brick.stiffness) * inverse.transpose()).symmetric_eigen();
    (eigen.eigenvalues.as_slice().to_vec(), inverse.transpose() * eigen.eigenvectors)
}

/// Modal damping without a reduction: the ratio holds for every mode up to five times the
/// highest excitation frequency, or up to the given frequency. It grows with the frequency
/// above. The model also has a mass, a spring and an imposed motion, and some methods need full
/// matrices.
#[test]
fn modal_damping_without_a_reduction() {
    let brick = blade();
    let (node, z) = (tip(&brick, 0, 1), brick.row([8, 0, 1], 2).unwrap());
    let (other, moved) = (tip(&brick, 2, 0), brick.row([8, 2, 0], 2).unwrap());
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let (values, shapes) = modes(&brick);
    let (ratio, mass, spring) = (0.01, 0.002, 3e3);
    let shapes = full(&brick.mass) * shapes;
    for (reduce, up_to, motion, method) in [
        ("false", 4500.0, 0.0, "harmonic-balance"),
        ("{ kind = \"none\", up_to = \"2 kHz\" }", 2000.0, 1e-5, "harmonic-balance"),
        ("false", 4500.0, 1e-5, "event-driven"),
    ] {
        let more = format!("modal_damping = {ratio}\nreduce = {reduce}");
        let motions = format!("[[motion]]\non = \"foot.z\"\namplitude = \"{motion} m\"\n");
        let text = structure("npz", "rows.csv", "m-kg-s", &more)
            + &place("tip", &node)
            + &place("foot", &other)
            + if motion > 0.0 { &motions } else { "" }
            + "[[mass]]\nname = \"weight\"\nmass = \"2 g\"\n\
               [[spring]]\nbetween = [\"weight\", \"tip.z\"]\nstiffness = \"3 N/mm\"\n"
            + FORCED
            + &format!("[method]\nkind = \"{method}\"\n");
        let data = results(folder.path(), &text);
        let n = brick.dofs();
        let up_to = up_to * TAU;
        let modal = |omega: f64| 2.0 * ratio * if omega < up_to { omega } else { omega * omega / up_to };
        let rates = DVector::from_fn(n, |k, _| modal(values[k].sqrt()));
        let damping = &shapes * DMatrix::from_diagonal(&rates) * shapes.transpose();
        for (i, hertz) in HERTZ.iter().enumerate() {
            let omega = hertz * TAU;
            let own = full(&brick.stiffness) - full(&brick.mass) * (omega * omega);
            let mut stiffness = DMatrix::zeros(n + 1, n + 1);
            stiffness.view_mut((0, 0), (n, n)).copy_from(&own.zip_map(&damping, |k, c| Complex64::new(k, omega * c)));
            for (row, column, k) in [(z, z, spring), (n, n, spring), (z, n, -spring), (n, z, -spring)] {
                stiffness[(row, column)] += k;
            }
            stiffness[(n, n)] -= mass * omega * omega;
            let mut load = DVector::zeros(n + 1);
            load[z] = Complex64::new(1.0, 0.0);
            if motion > 0.0 {
                load -= stiffness.column(moved) * Complex64::new(motion, 0.0);
                stiffness.row_mut(moved).fill(Complex64::ZERO);
                stiffness[(moved, moved)] = Complex64::new(1.0, 0.0);
                load[moved] = Complex64::new(motion, 0.0);
                (0..=n).filter(|row| *row != moved).for_each(|row| stiffness[(row, moved)] = Complex64::ZERO);
            }
            let x = stiffness.lu().solve(&load).unwrap();
            for (column, expected) in [("tip_z_amplitude_m", x[z]), ("weight_amplitude_m", x[n])] {
                let off = numbers(&data, column)[i] / expected.norm() - 1.0;
                // accuracy of a dense solution with 1e9 N/m and 1e3 N/m
                assert!(off.abs() < 1e-8, "{reduce} {method} {column} {hertz}: {off:e}");
            }
        }
    }
}

/// With friction the modal damping is that of a reduction with the same last frequency. The
/// energies balance: the work of the forces equals the dissipation of the joint and the modes.
#[test]
fn modal_damping_with_friction_without_a_reduction() {
    let brick = blade();
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let run = |reduce: &str| {
        let text = structure("npz", "rows.csv", "m-kg-s", &format!("modal_damping = 0.002\nreduce = {reduce}"))
            + &place("tip", &tip(&brick, 0, 1))
            + "[[joint]]\nname = \"pad\"\nbetween = [\"tip.z\", \"ground\"]\n\
               law = { kind = \"jenkins\", limit = \"0.004 N\", stiffness = \"2 N/mm\" }\n"
            + FORCED
            + "[method]\nkind = \"harmonic-balance\"\nharmonics = 9\n";
        results(folder.path(), &text)
    };
    let (whole, few) = (run("{ kind = \"none\", up_to = \"9 kHz\" }"), run("{ up_to = \"9 kHz\", tolerance = 1e-8 }"));
    for column in ["tip_z_amplitude_m", "pad_dissipation_J"] {
        for (a, b) in numbers(&whole, column).iter().zip(numbers(&few, column)) {
            assert!((a / b - 1.0).abs() < 1e-5 && *b > 0.0, "{column}: {a:e} {b:e}");
        }
    }
}

/// With a fixed number of modes, more orders of residual vectors reduce the error. Each order
/// makes two more terms of the residual series exact.
#[test]
fn orders_of_residual_vectors() {
    let brick = blade();
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let error = |orders: &str| {
        let more = format!("{DAMPED}\nreduce = {{ modes = 4{orders} }}");
        let text = structure("npz", "rows.csv", "m-kg-s", &more) + &place("tip", &tip(&brick, 0, 1)) + FORCED;
        numbers(&results(folder.path(), &text), "reduction_error")[0]
    };
    let [one, two, three] = ["", ", orders = 2", ", orders = 3"].map(error);
    assert_eq!(one.to_bits(), error(", orders = 1, kind = \"rubin\"").to_bits());
    // (900 Hz / 3 kHz of the first omitted mode)⁴ for each order; rounding limits the third
    assert!(two < 0.1 * one && three <= two.max(1e-9), "{one:e} {two:e} {three:e}");
}

/// The error of the reduction is in every row with an orbit or a frequency, of every kind: in
/// all tables except time samples.
#[test]
fn every_result_has_its_reduction_error() {
    let brick = blade();
    let folder = tempfile::tempdir().unwrap();
    write_pair(folder.path(), &brick, "npz", (1.0, 1.0));
    let range = "frequency = { from = \"450 Hz\", to = \"560 Hz\", points = 5 }";
    let mut met = Vec::new();
    for (kind, method) in [
        ("hysteresis\"\nfrequency = \"500 Hz\"", true),
        ("orbit\"\nfrequency = \"500 Hz\"\nmultipliers = true", true),
        (&format!("response\"\n{range}\n[figure]\nreferences = true"), true),
        (&format!("performance\"\n{range}\nvary = {{ Ft = [\"1 mN\", \"4 mN\", \"20 mN\"] }}"), true),
        (
            &format!(
                "map\"\n{range}\nover = {{ Ft = {{ from = \"1 mN\", to = \"4 mN\", points = 2 }}, F0 = {{ from = \"1 N\", \
                 to = \"2 N\", points = 2 }} }}"
            ),
            true,
        ),
        (&format!("branch\"\n{}\nharmonics = 1\nsamples = 64", range.replace(", points = 5", "")), false),
        ("transient\"\nduration = \"20 ms\"\ntime_step = \"0.05 ms\"\nstart = { hung = \"1 mm\" }", false),
        ("modes\"\namplitude = { from = \"0.01 mm\", to = \"1 mm\", points = 4 }", false),
        ("campbell\"\nspeed = { from = \"100 Hz\", to = \"600 Hz\", points = 3 }", false),
    ] {
        let free = kind.starts_with("transient");
        let text =
            "[parameters]\nFt = \"4 mN\"\nF0 = \"1 N\"\n".to_owned()
                + &structure("npz", "rows.csv", "m-kg-s", "modal_damping = 0.01\nreduce = { up_to = \"3 kHz\" }")
                    .replacen("schema = 1\n", "", 1)
                + &place("tip", &tip(&brick, 0, 1))
                + "[[mass]]\nname = \"hung\"\nmass = \"1 g\"\n\
               [[spring]]\nbetween = [\"hung\", \"tip.z\"]\nstiffness = \"100 N/mm\"\ndamping = \"0.1 kg/s\"\n\
               [[joint]]\nname = \"pad\"\nbetween = [\"tip.z\", \"ground\"]\n\
               law = { kind = \"jenkins\", limit = \"Ft\", stiffness = \"2 N/mm\" }\n"
                + if free { "" } else { "[[force]]\non = \"tip.z\"\namplitude = \"1 N\"\n" }
                + &format!("[study]\nkind = \"{kind}\n")
                + if method { "[method]\nkind = \"harmonic-balance\"\nharmonics = 3\n" } else { "" };
        let data = results(folder.path(), &format!("schema = 1\n{text}"));
        for table in data.tables.iter().filter(|table| table.rows() > 0) {
            let has = |name: &str| table.columns.iter().any(|column| column.name == name);
            let sampled = has("time_s") && !has("mass");
            let errors = table.numbers("reduction_error");
            assert_eq!(errors.is_none(), sampled, "{kind}: {} {:?}", table.name, table.columns);
            assert!(errors.unwrap_or_default().iter().all(|error| *error > 0.0 && *error < 1e-4), "{kind}");
            met.push(table.name.clone());
        }
    }
    // some studies may have no rows; these must have some
    for name in [
        "loops_summary",
        "orbits",
        "multipliers",
        "curve",
        "peaks",
        "references",
        "performance",
        "optimum",
        "map",
        "branch",
        "motion_summary",
        "modes",
        "modes_summary",
        "campbell",
        "crossings",
    ] {
        assert!(met.iter().any(|met| met == name), "{name}: {met:?}");
    }
}

/// Writes a chain of masses on springs of 20 N/um, fixed at one end and free at the other, as
/// `k.mtx` and `m.mtx`.
fn write_chain(folder: &Path, masses: usize) {
    let spring = 2e7;
    let mass = (0..masses).map(|i| (i, i, 0.05 + 0.01 * (i as f64).sin()));
    let own = (0..masses).map(|i| (i, i, if i + 1 == masses { spring } else { 2.0 * spring }));
    let stiffness = own.chain((1..masses).flat_map(|i| [(i, i - 1, -spring), (i - 1, i, -spring)]));
    for (name, entries) in [("k", stiffness.collect::<Vec<_>>()), ("m", mass.collect())] {
        let made = Matrix::new(masses, masses, Symmetry::General, entries).unwrap();
        write(folder.join(format!("{name}.mtx")), &made).unwrap();
    }
}

/// Harmonics of a joint meet modes far above the excitation, here the seventh harmonic. The
/// default frequency range contains these modes. This small structure is not reduced by default.
#[test]
fn default_reduction_covers_joint_harmonics() {
    let folder = tempfile::tempdir().unwrap();
    write_chain(folder.path(), 60);
    let of = |reduce: &str| {
        let text = format!(
            "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\n\
             rayleigh = {{ mass = \"1 /s\", stiffness = \"2e-6 s\" }}\n{reduce}\n\
             [[place]]\nname = \"tip\"\ndof = \"60\"\n[[place]]\nname = \"mid\"\ndof = \"35\"\n\
             [[joint]]\nname = \"j\"\nbetween = [\"mid\", \"ground\"]\n\
             law = {{ kind = \"jenkins\", stiffness = \"200 N/mm\", limit = \"4 N\" }}\n\
             [[force]]\non = \"tip\"\namplitude = \"6 N\"\n\
             [study]\nkind = \"response\"\nfrequency = [\"82 Hz\", \"84 Hz\"]\n[method]\nkind = \"event-driven\"\n"
        );
        results(folder.path(), &text)
    };
    let (few, all) = (of("reduce = { up_to = \"1260 Hz\" }"), of("reduce = false"));
    assert!(numbers(&few, "j_slip_fraction").iter().all(|share| *share > 0.1), "no harmonics without slip");
    let said = |data: &Dataset| data.notes.iter().any(|note| note.contains("solved again"));
    assert!(said(&few) && !said(&all), "{:?}", few.notes);
    assert!(numbers(&few, "reduction_error").iter().all(|error| *error < Reduction::TOLERANCE));
    for column in ["tip_amplitude_m", "mid_amplitude_m"] {
        for (few, all) in numbers(&few, column).iter().zip(numbers(&all, column)) {
            assert!((few / all - 1.0).abs() < Reduction::TOLERANCE, "{column}: {few} {all}");
        }
    }
    assert_eq!(format!("{:?}", of("").tables), format!("{:?}", all.tables), "few rows are all kept");
}

/// Masses without springs, one of them on a stuck joint: its spring is the only stiffness, and
/// the other modes are all the same.
#[test]
fn a_structure_without_stiffness() {
    let folder = tempfile::tempdir().unwrap();
    let head = "%%MatrixMarket matrix coordinate real symmetric\n5 5";
    let masses: String = (1..=5).map(|i| format!("{i} {i} 1\n")).collect();
    std::fs::write(folder.path().join("k.mtx"), format!("{head} 0\n")).unwrap();
    std::fs::write(folder.path().join("m.mtx"), format!("{head} 5\n{masses}")).unwrap();
    let found = results(
        folder.path(),
        "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\nmodal_damping = \"0.1 %\"\n\
         [[place]]\nname = \"tip\"\ndof = \"2\"\n[[joint]]\nname = \"j\"\nbetween = [\"tip\", \"ground\"]\n\
         law = { kind = \"jenkins\", stiffness = \"1e5 N/m\", limit = \"0.5 N\" }\n[[force]]\non = \"tip\"\namplitude = \"1 N\"\n\
         [study]\nkind = \"response\"\nfrequency = [\"300 Hz\", \"400 Hz\"]\n",
    );
    for (hertz, amplitude) in [300.0, 400.0].iter().zip(numbers(&found, "tip_amplitude_m")) {
        let expected = 1.0 / ((TAU * hertz).powi(2) - 1e5);
        assert!((amplitude / expected - 1.0).abs() < 1e-9, "{amplitude} {expected}");
    }
}

/// A stiff slider at the driven end of a nearly undamped chain produces harmonics far above the
/// range of the reduced model. The note of the run states the difference from all rows, here
/// computed by another method.
#[test]
fn reduction_error_of_joint_harmonics_is_measured() {
    const MASSES: usize = 300;
    let folder = tempfile::tempdir().unwrap();
    write_chain(folder.path(), MASSES);
    let varied = |reduce: &str, limit: &str, vary: &str, method: &str| {
        let text = format!(
            "schema = 1\n[parameters]\nFt = \"1 N\"\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\n\
             modal_damping = \"0.03 %\"\n{reduce}\n[[place]]\nname = \"tip\"\ndof = \"{MASSES}\"\n\
             [[joint]]\nname = \"j\"\nbetween = [\"tip\", \"ground\"]\n\
             law = {{ kind = \"jenkins\", stiffness = \"2 N/um\", limit = \"{limit}\" }}\n\
             [[force]]\non = \"tip\"\namplitude = \"6 N\"\n\
             [study]\nkind = \"response\"\nfrequency = [\"9.25 Hz\", \"9.5 Hz\", \"10 Hz\"]\n{vary}\n[method]\n{method}\n"
        );
        results(folder.path(), &text)
    };
    let of = |reduce: &str, limit: &str, method: &str| varied(reduce, limit, "", method);
    let exact = "kind = \"event-driven\"";
    let few = of("", "4 N", exact);
    let all = of("reduce = false", "4 N", "kind = \"harmonic-balance\"\ntolerance = 3e-4");
    let pairs = numbers(&few, "tip_amplitude_m").iter().zip(numbers(&all, "tip_amplitude_m"));
    let off = pairs.map(|(few, all)| (few / all - 1.0).abs()).fold(0.0, f64::max);
    assert!(off > 0.02, "nothing to be measured: {off}");
    for error in numbers(&few, "reduction_error") {
        assert!((error / off - 1.0).abs() < 0.1, "{error} for {off}");
    }
    let told = few.notes.iter().find(|note| note.contains("solved again")).unwrap();
    assert!(told.starts_with("warning: ") && told.contains("reduce = { up_to = "), "{told}");
    // each of several cases is compared with a larger model, so its rows equal those of a study
    // of that case alone
    let several = varied("", "Ft", "vary = { Ft = [\"4 kN\", \"4 N\"] }", exact);
    let (alone, among) = (numbers(&few, "reduction_error"), numbers(&several, "reduction_error"));
    assert_eq!(alone, &among[alone.len()..]);
    let stuck = of("", "4 kN", exact);
    assert!(!stuck.notes.iter().any(|note| note.contains("slip")), "{:?}", stuck.notes);
    assert!(numbers(&stuck, "reduction_error").iter().all(|error| *error < Reduction::TOLERANCE));
}

/// The tip of a blade is pulled to 2 mm and released, without a frequency range for the reduction
/// or the damping. The pulled shape is `K⁻¹ f` with the tip at 2 mm, from the dense matrices, for
/// all rows and for a reduced model, and it decays with the stated damping ratio. A stuck joint
/// at the middle is a spring.
#[test]
fn a_pulled_place_is_in_equilibrium() {
    let folder = tempfile::tempdir().unwrap();
    let brick = Brick::new([4, 1, 1], [0.08, 0.02, 0.004], true);
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    let number = |x: usize| 101 + brick.row([x, 0, 0], 0).unwrap() / 3;
    let row = |x: usize| brick.row([x, 0, 0], 2).unwrap();
    let (tip, middle, joint) = (row(4), row(2), 2e5);
    let mut stiffness = full(&brick.stiffness);
    stiffness[(middle, middle)] += joint;
    let mut force = DVector::zeros(brick.dofs());
    force[tip] = 1.0;
    let shape = stiffness.lu().solve(&force).unwrap();
    let expected = 2e-3 * shape[middle] / shape[tip];
    for reduce in ["reduce = false", "reduce = { up_to = \"20 kHz\" }", ""] {
        let text = format!(
            "{}modal_damping = \"0.3 %\"\n{reduce}\n[[place]]\nname = \"tip\"\ndof = \"{}.z\"\n\
             [[place]]\nname = \"middle\"\ndof = \"{}.z\"\n[[joint]]\nname = \"j\"\nbetween = [\"middle\", \"ground\"]\n\
             law = {{ kind = \"jenkins\", stiffness = \"200 N/mm\", limit = \"10 kN\" }}\n\
             [study]\nkind = \"transient\"\nstart = {{ tip = \"2 mm\" }}\nduration = \"40 ms\"\ntime_step = \"0.1 ms\"\n",
            structure("mtx", "rows.csv", "m-kg-s", ""),
            number(4),
            number(2),
        );
        let path = folder.path().join("study.toml");
        std::fs::write(&path, text).unwrap();
        let found = run(
            &read_file(&path, &[]).unwrap_or_else(|error| panic!("{reduce}: {error}")),
            &Context::without_progress(1),
        )
        .unwrap();
        let start = |place: &str| found.tables[0].numbers(&format!("{place}_displacement_m")).unwrap()[0];
        assert!((start("tip") - 2e-3).abs() < 1e-14, "{reduce}: {}", start("tip"));
        assert!((start("middle") / expected - 1.0).abs() < 1e-3, "{reduce}: {} {expected}", start("middle"));
    }
}

/// The place of a structure does not determine an unloaded beginning or a velocity.
#[test]
fn a_place_of_a_structure_is_held_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let brick = Brick::new([4, 1, 1], [0.08, 0.02, 0.004], true);
    write_pair(folder.path(), &brick, "mtx", (1.0, 1.0));
    let tip = 101 + brick.row([4, 0, 0], 0).unwrap() / 3;
    for (start, key) in [
        ("start = { tip = \"2 mm\" }\nbegin = \"unloaded\"", "start"),
        ("start_velocity = { tip = \"1 m/s\" }", "start_velocity"),
    ] {
        let text = format!(
            "{}modal_damping = \"0.3 %\"\n[[place]]\nname = \"tip\"\ndof = \"{tip}.z\"\n[study]\nkind = \"transient\"\n{start}\n\
             duration = \"4 ms\"\ntime_step = \"0.1 ms\"\n",
            structure("mtx", "rows.csv", "m-kg-s", ""),
        );
        let path = folder.path().join("study.toml");
        std::fs::write(&path, text).unwrap();
        let error = read_file(&path, &[]).unwrap_err().to_string();
        assert!(error.contains(key) && error.contains("the place `tip` alone"), "{error}");
    }
}
