//! Meshes in a study: places on sets, and contacts from geometry.

use num_complex::Complex64;
use std::fmt::Write;
use std::path::Path;
use stickslip_study::dataset::{Column, Dataset, Table};
use stickslip_study::run::{Context, run};
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, StudyError, read_file, read_for_results};

/// A node: its number and its position in millimetres.
type Node = (i64, [f64; 3]);

/// A block of hexahedra of 1 mm with 3 x 3 x 2 nodes, from 1, and above it at `gap` (mm) a lid:
/// nodes from 101, either on the same grid or at the corners only.
fn nodes(gap: f64, same_grid: bool) -> Vec<Node> {
    let mut nodes = Vec::new();
    let grid = |first: i64, x: &[f64], z: [f64; 2], nodes: &mut Vec<Node>| {
        let points = z.iter().flat_map(|z| x.iter().flat_map(move |y| x.iter().map(move |x| [*x, *y, *z])));
        nodes.extend(points.enumerate().map(|(i, at)| (first + i as i64, at)));
    };
    grid(1, &[0.0, 1.0, 2.0], [0.0, 1.0], &mut nodes);
    let lid: &[f64] = if same_grid { &[0.0, 1.0, 2.0] } else { &[0.0, 2.0] };
    grid(101, lid, [1.0 + gap, 2.0 + gap], &mut nodes);
    nodes
}

/// The hexahedra of a grid of `n` x `n` nodes from `first`.
fn bricks(first: i64, n: i64) -> Vec<[i64; 8]> {
    let corner = |i: i64, j: i64, k: i64| first + i + n * j + n * n * k;
    let brick = |i: i64, j: i64| {
        let lower = |k| [corner(i, j, k), corner(i + 1, j, k), corner(i + 1, j + 1, k), corner(i, j + 1, k)];
        let mut all = [0; 8];
        all[..4].copy_from_slice(&lower(0));
        all[4..].copy_from_slice(&lower(1));
        all
    };
    (0..n - 1).flat_map(|j| (0..n - 1).map(move |i| (i, j))).map(|(i, j)| brick(i, j)).collect()
}

/// Writes a deck with the sets FOOT, PADS and LID, and matrices: a mass and a spring to the ground
/// at every row, and springs along the edges of the bricks.
fn write_files(folder: &Path, gap: f64, same_grid: bool) {
    let nodes = nodes(gap, same_grid);
    let elements = [bricks(1, 3), bricks(101, if same_grid { 3 } else { 2 })].concat();
    let mut deck = String::from("*NODE\n");
    nodes.iter().for_each(|(number, [x, y, z])| writeln!(deck, "{number}, {x}, {y}, {z}").unwrap());
    deck += "*ELEMENT, TYPE=C3D8, ELSET=ALL\n";
    for (i, element) in elements.iter().enumerate() {
        let all: Vec<String> = element.iter().map(ToString::to_string).collect();
        writeln!(deck, "{}, {}", i + 1, all.join(", ")).unwrap();
    }
    for (name, z, first) in [("FOOT", 0.0, 1), ("PADS", 1.0, 1), ("LID", 1.0 + gap, 101)] {
        writeln!(deck, "*NSET, NSET={name}").unwrap();
        for (number, _) in nodes.iter().filter(|(number, at)| at[2] == z && (*number >= 101) == (first == 101)) {
            writeln!(deck, "{number},").unwrap();
        }
    }
    let index = |number: &i64| nodes.iter().position(|(known, _)| known == number).unwrap();
    let n = 3 * nodes.len();
    let mut stiffness = vec![0.0; n * n];
    for row in 0..n {
        // different springs keep the motion free of symmetries
        stiffness[row * n + row] = 100.0 + 3.0 * ((row * 7) % 11) as f64;
    }
    let edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)];
    for (element, (a, b)) in elements.iter().flat_map(|element| edges.iter().map(move |edge| (element, *edge))) {
        for along in 0..3 {
            let (a, b) = (3 * index(&element[a]) + along, 3 * index(&element[b]) + along);
            for (row, column, value) in [(a, a, 500.0), (b, b, 500.0), (a, b, -500.0), (b, a, -500.0)] {
                stiffness[row * n + column] += value;
            }
        }
    }
    let (mut sti, mut mas, mut dof) = (String::new(), String::new(), String::new());
    for row in 0..n {
        for column in (0..=row).filter(|column| stiffness[row * n + column] != 0.0) {
            writeln!(sti, "{} {} {:e}", column + 1, row + 1, stiffness[row * n + column]).unwrap();
        }
        writeln!(mas, "{} {} 1e-6", row + 1, row + 1).unwrap();
        writeln!(dof, "{}.{}", nodes[row / 3].0, row % 3 + 1).unwrap();
    }
    for (name, text) in [("block.sti", sti), ("block.mas", mas), ("block.dof", dof), ("block.inp", deck)] {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

const HEAD: &str = "schema = 1\n[parameters]\nmu = 0.3\nkt = \"200 N/mm^3\"\n[structure]\nstiffness = \"block.sti\"\nmass = \"block.mas\"\n\
    dofs = \"block.dof\"\nunits = \"mm-t-s\"\nmesh = \"block.inp\"\nrayleigh = { stiffness = \"1e-6 s\" }\nreduce = false\n";

const STUDY: &str = "[[force]]\non = \"tip\"\namplitude = \"30 N\"\n[[place]]\nname = \"tip\"\ndof = \"1.x\"\n\
    [study]\nkind = \"response\"\nfrequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n\
    [method]\nkind = \"harmonic-balance\"\nharmonics = 5\ntolerance = 0.5\n";

const CONTACT: &str = "[[contact]]\nname = \"pad\"\nbetween = [\"PADS\", \"LID\"]\ntangent = [1, 1, 0]\n\
    law = { kind = \"friction-contact\", tangential = \"kt\", normal = \"300 N/mm^3\", friction = \"mu\", preload = \"10 MPa\" }\n";

fn read(folder: &Path, parts: &[&str]) -> Result<Study, StudyError> {
    let path = folder.join("study.toml");
    std::fs::write(&path, parts.concat()).unwrap();
    read_file(&path, &[])
}

fn dataset(folder: &Path, parts: &[&str]) -> Dataset {
    let study = read(folder, parts).unwrap_or_else(|error| panic!("{error}\n{}", parts.concat()));
    run(&study, &Context::without_progress(1)).unwrap()
}

/// Checks that all columns of both runs have the same names and values. Both have slip.
fn check_equal(found: &Dataset, expected: &Dataset, tolerance: f64) {
    let (found, expected) = (&found.tables[0], &expected.tables[0]);
    let names = |columns: &[Column]| columns.iter().map(|column| column.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&found.columns), names(&expected.columns));
    let mut compared = 0;
    for name in names(&found.columns).iter().filter(|name| name.contains("amplitude_m") || name.contains("mean_m")) {
        let (a, b) = (found.numbers(name).unwrap(), expected.numbers(name).unwrap());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= tolerance * b.abs() + 1e-20 && b.is_finite(), "{name}: {a} {b}");
            compared += 1;
        }
    }
    assert!(compared > 20, "{compared}");
    let slips = names(&found.columns).into_iter().filter(|name| name.ends_with("slip_fraction"));
    assert!(slips.filter(|name| found.numbers(name).unwrap()[0] > 0.01).count() > 2);
}

/// Areas of a bilinear face of 1 mm²: each node has a quarter of every face around it.
fn area(at: [f64; 3]) -> f64 {
    at[..2].iter().map(|x| if *x == 1.0 { 1.0 } else { 0.5 }).product()
}

/// Returns the joint of a node by hand: the rows of its counterpart, and the law times its area.
fn by_hand(number: i64, at: [f64; 3], rows: &str) -> String {
    by_hand_with_preload(number, at, rows, 10.0 * area(at))
}

fn by_hand_with_preload(number: i64, at: [f64; 3], rows: &str, newtons: f64) -> String {
    let area = area(at);
    format!(
        "[[place]]\nname = \"pad_{number}_a\"\nnodes = [\"{number}\"]\nnormal = [0, 0, 1]\ntangent = [1, 1, 0]\n\
         [[place]]\nname = \"pad_{number}_b\"\n{rows}\nnormal = [0, 0, 1]\ntangent = [1, 1, 0]\n\
         [[joint]]\nname = \"pad_{number}\"\nbetween = [\"pad_{number}_a\", \"pad_{number}_b\"]\n\
         law = {{ kind = \"friction-contact\", tangential = \"{} N/mm\", normal = \"{} N/mm\", friction = 0.3, preload = \"{newtons} N\" }}\n",
        200.0 * area,
        300.0 * area,
    )
}

#[test]
fn contacts_of_equal_meshes_are_the_joints_of_their_nodes() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let found = dataset(folder.path(), &[HEAD, STUDY, CONTACT]);
    let pads = nodes(0.01, true).into_iter().filter(|(number, at)| *number < 101 && at[2] == 1.0);
    let joints: String =
        pads.map(|(number, at)| by_hand(number, at, &format!("nodes = [\"{}\"]", number + 91))).collect();
    check_equal(&found, &dataset(folder.path(), &[&HEAD.replace("kt = \"200 N/mm^3\"\n", ""), STUDY, &joints]), 1e-12);
    // a parameter of the law can be varied
    let wear = STUDY.replace("peaks = false", "peaks = false\nvary = { mu = [0.1, 0.3] }");
    let varied = dataset(folder.path(), &[HEAD, &wear, CONTACT]);
    assert_eq!(varied.tables[0].rows(), 4);
}

/// A rigid body on the pads: each node meets the point of the body at its position.
#[test]
fn contacts_with_a_body_are_the_joints_of_its_points() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let body = "[[body]]\nname = \"slab\"\nmass = \"10 g\"\ndirections = [\"x\", \"y\", \"z\"]\n\
        inertia = [\"20 g mm^2\", \"20 g mm^2\", \"30 g mm^2\"]\nposition = [\"1.1 mm\", \"0.9 mm\", \"2 mm\"]\n\
        [[force]]\non = \"slab.z\"\namplitude = \"-40 N\"\nharmonic = 0\n\
        [[spring]]\nbetween = [\"slab.x\", \"ground\"]\nstiffness = \"100 N/mm\"\n\
        [[spring]]\nbetween = [\"slab.y\", \"ground\"]\nstiffness = \"100 N/mm\"\n";
    let contact = CONTACT.replace("\"LID\"", "\"slab\"");
    let study = &STUDY.replace("30 N", "10 N");
    let found = dataset(folder.path(), &[HEAD, study, body, &contact]);
    let pads = nodes(0.01, true).into_iter().filter(|(number, at)| *number < 101 && at[2] == 1.0);
    let point =
        |at: [f64; 3]| format!("of = \"slab\"\noffset = [\"{} mm\", \"{} mm\", \"-1 mm\"]", at[0] - 1.1, at[1] - 0.9);
    let joints: String = pads.map(|(number, at)| by_hand(number, at, &point(at))).collect();
    let head = HEAD.replace("kt = \"200 N/mm^3\"\n", "");
    check_equal(&found, &dataset(folder.path(), &[&head, study, body, &joints]), 1e-9);
    let summary = ModelSummary::new(&read(folder.path(), &[HEAD, study, body, &contact]).unwrap()).unwrap().to_string();
    // from the node at (1, 1, 1) and from the corner (0, 2, 1)
    let line = "pad: 9 joints of PADS on slab, area 4 of 4 mm^2, nodes 1.01 to 1.849 mm from the `position` of slab";
    assert!(summary.contains(line), "{summary}");
    let exchanged = contact.replace("[\"PADS\", \"slab\"]", "[\"slab\", \"PADS\"]");
    let error = read(folder.path(), &[HEAD, study, body, &exchanged]).unwrap_err();
    let said = format!("{error} {}", error.help_text().unwrap_or_default());
    assert!(said.contains("must be a set") && said.contains("[\"PADS\", \"slab\"]"), "{said}");
    for (from, to, words) in [
        ("position = [\"1.1 mm\", \"0.9 mm\", \"2 mm\"]\n", "", "position of the body `slab` is unknown"),
        ("\"1.1 mm\"", "\"mu*1 mm\"", "a parameter cannot change the position"),
        ("[\"x\", \"y\", \"z\"]", "[\"x\", \"z\"]", "does not move along all of them"),
    ] {
        let error = read(folder.path(), &[HEAD, study, &body.replace(from, to), &contact]).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
}

/// A body between two sectors touches the high side of its own and the low side of the next one.
#[test]
fn a_body_touches_its_own_and_the_next_sector() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = write_sector(folder.path());
    let (sin, cos) = (std::f64::consts::TAU / 6.0).sin_cos();
    // the damper is in the gap between the sectors, at 60 degrees
    let centre = [12.0 * cos, 12.0 * sin, 1.0];
    let body = format!(
        "[[body]]\nname = \"damper\"\nmass = \"2 g\"\ndirections = [\"x\", \"y\", \"z\"]\n\
         inertia = [\"2 g mm^2\", \"2 g mm^2\", \"3 g mm^2\"]\nposition = [\"{} mm\", \"{} mm\", \"{} mm\"]\n\
         [[spring]]\nbetween = [\"damper.x\", \"ground\"]\nstiffness = \"1 N/mm\"\n\
         [[spring]]\nbetween = [\"damper.y\", \"ground\"]\nstiffness = \"1 N/mm\"\n",
        centre[0], centre[1], centre[2]
    );
    let law = "law = { kind = \"friction-contact\", tangential = \"200 N/mm^3\", normal = \"300 N/mm^3\", friction = 0.3, preload = \"4 MPa\" }\n";
    let contact = |name: &str, set: &str| {
        format!("[[contact]]\nname = \"{name}\"\nbetween = [\"{set}\", \"damper\"]\ntangent = [0, 0, 1]\n{law}")
    };
    let study = SECTOR;
    let found = dataset(folder.path(), &[study, &body, &contact("own", "HIGH"), &contact("other", "next.LOW")]);
    let mut joints = String::new();
    for (number, at) in nodes.iter().filter(|(_, at)| at[1] != 1 && at[0] > 0) {
        let share = |x: usize, last: usize| if x == last || x + 2 == last { 0.5 } else { 1.0 };
        let area = share(at[0], 3) * share(at[2], 2);
        // the side faces of both sectors are in the same plane
        let offset =
            [(10.0 + at[0] as f64) * cos - centre[0], (10.0 + at[0] as f64) * sin - centre[1], at[2] as f64 - 1.0];
        let (name, next, normals) = match at[1] {
            2 => ("own", "", [[-sin, cos], [-sin, cos]]),
            _ => ("other", "next.", [[0.0, -1.0], [sin, -cos]]),
        };
        write!(
            joints,
            "[[place]]\nname = \"{name}_{number}_a\"\nnodes = [\"{number}\"]\nnormal = [{}, {}, 0]\ntangent = [0, 0, 1]\n\
             [[place]]\nname = \"{name}_{number}_b\"\nof = \"damper\"\noffset = [\"{} mm\", \"{} mm\", \"{} mm\"]\n\
             normal = [{}, {}, 0]\ntangent = [0, 0, 1]\n\
             [[joint]]\nname = \"{name}_{number}\"\nbetween = [\"{next}{name}_{number}_a\", \"{name}_{number}_b\"]\n\
             law = {{ kind = \"friction-contact\", tangential = \"{} N/mm\", normal = \"{} N/mm\", friction = 0.3, preload = \"{} N\" }}\n",
            normals[0][0], normals[0][1], offset[0], offset[1], offset[2], normals[1][0], normals[1][1],
            200.0 * area, 300.0 * area, 4.0 * area
        )
        .unwrap();
    }
    let expected = dataset(folder.path(), &[study, &body, &joints]);
    let (found, expected) = (&found.tables[0], &expected.tables[0]);
    let columns = expected.columns.iter().filter(|column| column.name.contains("amplitude_m"));
    let mut compared = 0;
    for column in columns {
        let [a, b] = [found, expected].map(|table| table.numbers(&column.name).unwrap().to_vec());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= 1e-9 * b.abs() + 1e-15 && b.is_finite(), "{}: {a} {b}", column.name);
            compared += 1;
        }
    }
    assert!(compared > 30, "{compared}");
}

/// The lid has nodes at its corners only: the counterpart of a node is a bilinear mean of them.
#[test]
fn contacts_of_different_meshes_are_weighted_sums() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, false);
    let found = dataset(folder.path(), &[HEAD, STUDY, CONTACT]);
    let pads = nodes(0.01, false).into_iter().filter(|(number, at)| *number < 101 && at[2] == 1.0);
    let rows = |at: [f64; 3]| {
        let (x, y) = (at[0] / 2.0, at[1] / 2.0);
        let weights = [(101, (1.0 - x) * (1.0 - y)), (102, x * (1.0 - y)), (103, (1.0 - x) * y), (104, x * y)];
        let sum = |along: &str| {
            let parts: Vec<String> = weights
                .iter()
                .filter(|(_, weight)| *weight > 0.0)
                .map(|(node, weight)| format!("\"{node}.{along}\" = {weight}"))
                .collect();
            format!("{{ {} }}", parts.join(", "))
        };
        format!("sum = [{}, {}, {}]", sum("x"), sum("y"), sum("z"))
    };
    let joints: String = pads.map(|(number, at)| by_hand(number, at, &rows(at))).collect();
    check_equal(&found, &dataset(folder.path(), &[&HEAD.replace("kt = \"200 N/mm^3\"\n", ""), STUDY, &joints]), 1e-12);
}

#[test]
fn check_lists_contacts_with_gaps_and_nodes_without_counterpart() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let summary = |contact: &str| ModelSummary::new(&read(folder.path(), &[HEAD, STUDY, contact]).unwrap()).unwrap();
    let found = summary(CONTACT);
    let [pad] = &found.contacts[..] else { panic!("one contact") };
    assert_eq!((pad.joints, pad.unpaired.len(), pad.angle), (9, 0, 0.0));
    assert!((pad.area[0] - 4e-6).abs() < 1e-18 && (pad.area[1] - 4e-6).abs() < 1e-18);
    assert!(pad.gaps.unwrap().iter().all(|gap| (gap - 1e-5).abs() < 1e-12), "{:?}", pad.gaps);
    let words = "pad: 9 joints of PADS on LID, area 4 of 4 mm^2, gaps 0.01 to 0.01 mm, angles up to 0 deg";
    assert!(found.to_string().contains(words), "{found}");
    let ground = summary(&CONTACT.replace("\"LID\"", "\"ground\""));
    assert!(ground.to_string().contains("9 joints of PADS on ground") && ground.joints.len() == 27, "{ground}");
    // the foot is 1 mm below the lid's upper neighbour: all of its nodes look away from it
    let error = read(folder.path(), &[HEAD, STUDY, &CONTACT.replace("PADS", "FOOT")]).unwrap_err().to_string();
    assert!(error.contains("node of FOOT face each other"), "{error}");
}

/// Returns the file of a static step, in which node 18 has no row, and a contact that uses it.
fn preloaded(columns: &str, value: impl Fn(i64, [f64; 3]) -> f64, preload: &str) -> [String; 2] {
    let rows: String = nodes(0.01, true)
        .into_iter()
        .filter(|(number, at)| (*number < 18 && at[2] == 1.0) || *number == 118)
        .map(|(number, at)| format!("{number},{}\n", value(number, at)))
        .collect();
    let contact = CONTACT.replace(", preload = \"10 MPa\"", "");
    [
        format!("node,{columns}\n{rows}"),
        format!("[[data]]\nname = \"static\"\nfile = \"static.csv\"\n{contact}preload = {{ {preload} }}\n"),
    ]
}

fn read_preloaded(folder: &Path, [file, contact]: &[String; 2]) -> Result<Study, StudyError> {
    std::fs::write(folder.join("static.csv"), file).unwrap();
    read(folder, &[HEAD, STUDY, contact])
}

/// Pressures or forces of a static step give each joint its own preload.
#[test]
fn preloads_of_a_static_step_are_those_of_the_nodes() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let pressure = |number: i64| if number == 18 { 0.0 } else { 6.0 + (number % 4) as f64 };
    let pads = || nodes(0.01, true).into_iter().filter(|(number, at)| *number < 101 && at[2] == 1.0);
    let joint = |factor: f64, (number, at): Node| {
        let rows = format!("nodes = [\"{}\"]", number + 91);
        let newtons = factor * pressure(number) * area(at);
        let balance = |side: &str, force: f64| {
            format!("[[force]]\non = \"pad_{number}_{side}.n\"\namplitude = \"{force} N\"\nharmonic = 0\n")
        };
        by_hand_with_preload(number, at, &rows, newtons) + &balance("a", newtons) + &balance("b", -newtons)
    };
    let head = HEAD.replace("kt = \"200 N/mm^3\"\n", "");
    let expected = |factor: f64| {
        let joints: String = pads().map(|node| joint(factor, node)).collect();
        dataset(folder.path(), &[&head, STUDY, &joints])
    };
    let total: f64 = pads().map(|(number, at)| pressure(number) * area(at)).sum();
    let whole = format!("data = \"static\", total = \"{} N\"", 1.01 * total);
    let computed = |files: &[String; 2]| {
        let study = read_preloaded(folder.path(), files).unwrap_or_else(|error| panic!("{error}"));
        (run(&study, &Context::without_progress(1)).unwrap(), ModelSummary::new(&study).unwrap())
    };
    let (found, summary) = computed(&preloaded("pressure_MPa", |number, _| pressure(number), &whole));
    check_equal(&found, &expected(1.0), 1e-12);
    let preload = summary.contacts[0].preload.clone().unwrap();
    assert!((preload.total / total - 1.0).abs() < 1e-12, "{preload:?} {total}");
    assert_eq!((preload.joints_without_row, preload.rows_without_joint), (1, 1));
    // the structure is already deformed, so that each joint has its whole preload at rest
    for joint in summary.joints.iter().filter(|joint| joint.name.ends_with(".n")) {
        let at_rest = joint.normal_force_at_rest;
        assert!(
            joint.normal_force == Some(0.0) || (at_rest.unwrap() / joint.normal_force.unwrap() - 1.0).abs() < 1e-9,
            "{joint:?}"
        );
    }
    let words = format!("preload {total} N in total, 0 to 9 MPa, none at 1 node");
    assert!(summary.to_string().contains(&words), "{words}: {summary}");
    // node 13 is open by 2 µm, at 300 N/mm^3 a preload of -0.6 MPa; the gap of a pressed node does not count
    let opened = |number: i64| if number == 13 { 0.0 } else { pressure(number) };
    for (scale, factor) in [("1", 1.0), ("mu/0.6", 0.5)] {
        let stated = format!("data = \"static\", scale = \"{scale}\"");
        let mut files = preloaded("pressure_MPa", |number, _| opened(number), &stated);
        files[0] = files[0]
            .lines()
            .map(|line| line.to_owned() + if line.starts_with("node") { ",gap_um\n" } else { ",2\n" })
            .collect();
        let joints: String = pads()
            .map(|(number, at)| match number {
                13 => by_hand_with_preload(number, at, "nodes = [\"104\"]", factor * -0.6 * area(at)),
                _ => joint(factor, (number, at)),
            })
            .collect();
        check_equal(&computed(&files).0, &dataset(folder.path(), &[&head, STUDY, &joints]), 1e-12);
    }
    // half of the forces, by a parameter
    let half = "data = \"static\", scale = \"mu/0.6\"";
    let (found, _) = computed(&preloaded("force_N", |number, at| pressure(number) * area(at), half));
    check_equal(&found, &expected(0.5), 1e-12);
}

#[test]
fn wrong_preloads_of_a_static_step_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let good = "data = \"static\"";
    let text = |columns: &str, preload: &str| {
        let [file, contact] = preloaded(columns, |_, _| 5.0, preload);
        let more = if columns.contains(',') { ",5\n" } else { "\n" };
        let lines = file.lines().map(|line| line.to_owned() + if line.starts_with("node") { "\n" } else { more });
        [lines.collect(), contact]
    };
    let changed = |from: &str, to: &str| {
        let [file, contact] = text("pressure_MPa", good);
        assert!(contact.contains(from), "{contact}");
        [file, contact.replace(from, to)]
    };
    let spring = "tangential = \"kt\", normal = \"300 N/mm^3\", friction = \"mu\"";
    for (files, words) in [
        (text("pressure_MPa", "data = \"statik\""), &["no [[data]] `statik`", "`static`"][..]),
        (text("stress_MPa", good), &["no column `pressure`", "stress_MPa"]),
        (text("force_N,pressure_MPa", good), &["`pressure` and a column `force`", "rename"]),
        (text("pressure_N", good), &["`pressure_N`", "has a unit of force (N) in its name"]),
        (text("pressure", good), &["Pa or MPa", "pressure [UNIT]"]),
        (text("pressure_MPa,gap", good), &["`gap`", "has no unit", "[mm]"]),
        (text("pressure_MPa", "data = \"static\", scale = -1"), &["`scale`"]),
        (
            text("pressure_MPa", "data = \"static\", total = \"2 kN\""),
            &["sum to 18.75 N", "`total` is 2000 N", "1 rows"],
        ),
        (text("pressure_MPa", "data = \"static\", total = \"mu*1 N\""), &["no parameter can change"]),
        (changed(spring, &format!("{spring}, preload = \"1 MPa\"")), &["both state a preload"]),
        (
            changed(&format!("friction-contact\", {spring}"), "jenkins\", stiffness = \"kt\", limit = \"1 MPa\""),
            &["`jenkins` has no preload"],
        ),
        (preloaded("pressure_MPa", |number, _| 12.0 - number as f64, good), &["row 4", "-1", "zero or more"]),
    ] {
        let error = read_preloaded(folder.path(), &files).expect_err(&files[1]);
        let said = format!("{error} {}", error.help_text().unwrap_or_default());
        assert!(words.iter().all(|words| said.contains(words)), "{words:?}: {said}");
    }
}

#[test]
fn places_on_sets_are_those_of_their_nodes() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let on_sets = "[[place]]\nname = \"foot\"\nset = \"foot\"\n[[place]]\nname = \"mean\"\nnodes = [\"FOOT\"]\n";
    let found = dataset(folder.path(), &[HEAD, STUDY, on_sets]);
    let mut by_hand: String = (1..=9).map(|n| format!("[[place]]\nname = \"foot_{n}\"\nnodes = [\"{n}\"]\n")).collect();
    by_hand += "[[place]]\nname = \"mean\"\nnodes = [\"1\", \"2\", \"3\", \"4\", \"5\", \"6\", \"7\", \"8\", \"9\"]\n";
    let expected = dataset(folder.path(), &[HEAD, STUDY, &by_hand]);
    let amplitudes = found.tables[0].columns.iter().filter(|column| column.name.ends_with("amplitude_m"));
    let mut compared = 0;
    for column in amplitudes {
        let values = |found: &Dataset| found.tables[0].numbers(&column.name).map(<[f64]>::to_vec);
        assert!(values(&found).is_some() && values(&found) == values(&expected), "{}", column.name);
        compared += 1;
    }
    assert_eq!(compared, 1 + 9 * 3 + 3);
    assert!(found.tables[0].numbers("foot_3_x_amplitude_m").unwrap()[0] > 0.0);
}

/// Stored results are read without the mesh; names that the file mentions are known.
#[test]
fn results_are_read_without_the_mesh() {
    let on_sets = "[[place]]\nname = \"foot\"\nset = \"FOOT\"\n";
    let figure = "[figure]\nonly = [\"foot_3.x\", \"pad_12\"]\n";
    let text = [HEAD, &STUDY.replace("\"tip\"\namp", "\"foot_7.z\"\namp"), CONTACT, on_sets, figure].concat();
    read_for_results("study.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn wrong_sets_and_contacts_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let refused = |head: &str, contact: &str| {
        let error = read(folder.path(), &[head, STUDY, contact]).expect_err(contact);
        format!("{error} {}", error.help_text().unwrap_or_default())
    };
    let without = HEAD.replace("mesh = \"block.inp\"\n", "");
    let place = "[[place]]\nname = \"foot\"\nset = \"FEET\"\n";
    for (head, contact, words) in [
        (HEAD, CONTACT.replace("\"LID\"", "\"LIDS\""), &["no set `LIDS`", "FOOT, PADS, LID"][..]),
        (HEAD, CONTACT.replace("\"LID\"", "\"FOOT\""), &["no node of PADS", "`distance`"]),
        (HEAD, CONTACT.replace(", \"LID\"", ""), &["between two sets"]),
        (HEAD, CONTACT.replace("\"kt\"", "\"200 N/mm\""), &["N/m^3", "N/mm^3"]),
        (HEAD, CONTACT.replace("\"10 MPa\"", "\"10 N\""), &["2 MPa"]),
        (HEAD, CONTACT.to_owned() + "distance = \"kt*1 m^4/N\"\n", &["a parameter cannot change"]),
        (HEAD, CONTACT.replace("[1, 1, 0]", "[0, 0, 1]"), &["tangent", "pad_10_a"]),
        (HEAD, place.to_owned(), &["no set `FEET`"]),
        (HEAD, place.replace("FEET", "FOOT") + "dof = \"1.x\"\n", &["exclude each other"]),
        (&without, CONTACT.to_owned(), &["needs a mesh", "mesh = \"blade.inp\""]),
        (&without, place.to_owned(), &["needs a mesh"]),
        (&HEAD.replace("block.inp", "none.inp"), CONTACT.to_owned(), &["none.inp"]),
        (&HEAD.replace("block.inp", "block.sti"), CONTACT.to_owned(), &["no known format of a mesh"]),
    ] {
        let said = refused(head, &contact);
        assert!(words.iter().all(|words| said.contains(words)), "{words:?}: {said}");
    }
}

/// A node without rows may have its displacements along any axes.
#[test]
fn rows_along_other_axes_than_those_of_the_mesh_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let head = HEAD.replace("block.inp", "block.bdf");
    for (turned, is_refused) in [(5, true), (999, false)] {
        let deck = format!("GRID,1,,0.,0.,0.\nGRID,{turned},,1.,0.,0.,7\nCORD2C,7,,0.,0.,0.,0.,0.,1.\n,1.\n");
        std::fs::write(folder.path().join("block.bdf"), deck).unwrap();
        let said = read(folder.path(), &[&head, STUDY]).err().map(|error| error.to_string());
        assert_eq!(said.as_ref().is_some_and(|said| said.contains("node 5 are along coordinate system 7")), is_refused);
        assert_eq!(said.is_some(), is_refused);
    }
}

/// Displacements of nodes that are places are those of the places, with and without a reduction;
/// the displacements of the other nodes agree between both within the error of the reduction.
#[test]
fn fields_are_the_displacements_of_all_nodes() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let corner = "[[place]]\nname = \"corner\"\nnodes = [\"118\"]\n";
    let study = STUDY.replace("kind = \"response\"", "kind = \"orbit\"\nfields = 8\nsamples = 8");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "frequency = \"1500 Hz\"\n");
    let of = |head: &str| {
        let found = dataset(folder.path(), &[head, &study, CONTACT, corner]);
        let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap().clone();
        let friction = found.tables.iter().find_map(|table| table.numbers("friction_J")).unwrap()[0];
        (table("orbit"), table("fields"), friction)
    };
    let whole = of(HEAD);
    let reduced = of(&HEAD.replace("reduce = false", "reduce = { modes = 20 }"));
    for (orbit, fields, _) in [&whole, &reduced] {
        assert_eq!(fields.rows(), 8 * 36);
        let (times, at) = (fields.numbers("time_s").unwrap(), orbit.numbers("time_s").unwrap());
        let nodes = fields.integers("node").unwrap();
        for row in (0..fields.rows()).filter(|row| [16, 118].contains(&nodes[*row])) {
            // the table of the orbit has the switches, too
            let instant = at.iter().position(|time| (time - times[row]).abs() < 1e-15).unwrap();
            if nodes[row] == 118 {
                for axis in ["x", "y", "z"] {
                    let place = orbit.numbers(&format!("corner_{axis}_displacement_m")).unwrap()[instant];
                    let node = fields.numbers(&format!("{axis}_m")).unwrap()[row];
                    assert!((place - node).abs() < 1e-12 * place.abs().max(1e-6), "{place} {node}");
                }
            } else {
                assert_eq!(fields.texts("contact").unwrap()[row], orbit.texts("pad_16_contact").unwrap()[instant]);
            }
        }
        let states = fields.texts("contact").unwrap();
        assert!(states.iter().zip(nodes).all(|(state, node)| state.is_empty() != (10..=18).contains(node)));
        assert!(states.iter().any(|state| state.starts_with("slip")) && states.iter().any(|state| state == "stick"));
    }
    // the joint of node 14, in the middle of the face, has the area of 1 mm²
    let (orbit, fields, grid) = (&whole.0, &whole.1, nodes(0.01, true));
    let (times, at) = (fields.numbers("time_s").unwrap(), orbit.numbers("time_s").unwrap());
    let numbers = fields.integers("node").unwrap();
    let force = |along: &str, instant: usize| orbit.numbers(&format!("pad_14_{along}_force_N")).unwrap()[instant];
    for row in (0..fields.rows()).filter(|row| numbers[*row] == 14) {
        let instant = at.iter().position(|time| (time - times[row]).abs() < 1e-15).unwrap();
        let expected = [force("n", instant) / 1e-6, force("t1", instant).hypot(force("t2", instant)) / 1e-6];
        for (name, expected) in ["pressure_Pa", "friction_Pa"].iter().zip(expected) {
            let found = fields.numbers(name).unwrap()[row];
            assert!((found - expected).abs() < 1e-9 * expected.abs(), "{name}: {found} {expected}");
        }
    }
    // the losses of all areas are the loss of the joints
    let loss = fields.numbers("loss_J_per_m2").unwrap();
    let area_of = |number: u64| 1e-6 * area(grid.iter().find(|(known, _)| *known as u64 == number).unwrap().1);
    let lost: f64 = (0..36).map(|row| loss[row] * area_of(numbers[row])).sum();
    assert!(lost > 0.0 && (lost / whole.2 - 1.0).abs() < 1e-9, "{lost} {}", whole.2);
    // the error of all nodes falls with the number of modes
    let values = |fields: &Table| ["x_m", "y_m", "z_m"].map(|axis| fields.numbers(axis).unwrap().to_vec()).concat();
    let expected = values(&whole.1);
    let size = expected.iter().fold(0.0f64, |size, x| size.max(x.abs()));
    let error = |(_, fields, _): &(Table, Table, f64)| {
        values(fields).iter().zip(&expected).map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max)
    };
    let finer = of(&HEAD.replace("reduce = false", "reduce = { modes = 45 }"));
    let (coarse, fine) = (error(&reduced), error(&finer));
    assert!(coarse < 0.05 && fine < 0.2 * coarse, "{coarse} {fine}");
}

/// Stresses are weighted sums of the displacements of all rows, along the axes of each sector.
#[test]
fn stresses_follow_from_the_displacements() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    // row 106 is 118.x; 2 N/mm^2 and -3 N/mm^2 for each mm
    let rows = std::fs::read_to_string(folder.path().join("block.dof")).unwrap();
    let row = |name: &str| 1 + rows.lines().position(|line| line.trim() == name).unwrap();
    let matrix = format!(
        "%%MatrixMarket matrix coordinate real general\n3 {} 4\n1 {} 2\n2 {} -3\n3 {} 2\n3 {} -3\n",
        rows.lines().count(),
        row("118.1"),
        row("118.3"),
        row("118.1"),
        row("118.3")
    );
    std::fs::write(folder.path().join("stress.mtx"), matrix).unwrap();
    std::fs::write(folder.path().join("rows.csv"), "row,name\n1,a\n2,b\n3,both\n").unwrap();
    let head =
        HEAD.replace("reduce = false\n", "reduce = false\nstress = \"stress.mtx\"\nstress_rows = \"rows.csv\"\n");
    let corner = "[[place]]\nname = \"corner\"\nnodes = [\"118\"]\n";
    let study = STUDY.replace("kind = \"response\"", "kind = \"orbit\"\nsamples = 256");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "frequency = \"1500 Hz\"\n");
    for reduction in ["reduce = false", "reduce = { modes = 20 }"] {
        let found = dataset(folder.path(), &[&head.replace("reduce = false", reduction), &study, CONTACT, corner]);
        let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
        let (orbit, stress) = (table("orbit"), table("stress"));
        assert_eq!(stress.texts("stress").unwrap(), ["a", "b", "both"]);
        let [x, z] = ["x", "z"].map(|axis| orbit.numbers(&format!("corner_{axis}_displacement_m")).unwrap());
        let times = orbit.numbers("time_s").unwrap();
        // a megapascal for a millimetre
        let factor = 1e9;
        let of: [&dyn Fn(usize) -> f64; 3] =
            [&|i| 2.0 * factor * x[i], &|i| -3.0 * factor * z[i], &|i| factor * (2.0 * x[i] - 3.0 * z[i])];
        for (number, of) in of.iter().enumerate() {
            let largest = stress.numbers("largest_Pa").unwrap()[number];
            let time = stress.numbers("time_of_largest_s").unwrap()[number];
            let instant = times.iter().position(|known| (known - time).abs() < 1e-15).unwrap();
            assert!((largest / of(instant) - 1.0).abs() < 1e-9, "{largest} {}", of(instant));
            let most = (0..times.len()).map(|i| of(i).abs()).fold(0.0, f64::max);
            assert!(largest.abs() > 0.999 * most && largest.abs() <= most * (1.0 + 1e-9), "{largest} {most}");
        }
    }
    std::fs::write(folder.path().join("stress.mtx"), "%%MatrixMarket matrix coordinate real general\n1 2 1\n1 1 2\n")
        .unwrap();
    let error = read(folder.path(), &[&head, &study, CONTACT, corner]).unwrap_err();
    let said = format!("{error} {}", error.help_text().unwrap_or_default());
    assert!(said.contains("2 columns") && said.contains("transpose"), "{said}");
}

/// The columns of whole sets follow from those of their joints and nodes.
#[test]
fn sets_have_sums_means_and_largest_values() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let foot = "[[place]]\nname = \"foot\"\nset = \"FOOT\"\n";
    let study =
        STUDY.replace("kind = \"response\"", "kind = \"orbit\"\nsamples = 1024\noutput = [\"sets\", \"contact\"]");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "frequency = \"1500 Hz\"\n");
    let found = dataset(folder.path(), &[HEAD, &study, CONTACT, foot]);
    let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
    let (summary, orbit) = (table("orbits"), table("orbit"));
    let number = |column: &str| summary.numbers(column).unwrap_or_else(|| panic!("{column}"))[0];
    let grid = nodes(0.01, true);
    let area_of = |n: u64| area(grid.iter().find(|(known, _)| *known as u64 == n).unwrap().1);
    let lost: f64 = (10..=18).map(|n| number(&format!("pad_{n}_dissipation_J"))).sum();
    assert!(lost > 0.0 && (number("pad_dissipation_J") / lost - 1.0).abs() < 1e-12);
    let all: f64 = (10..=18).map(area_of).sum();
    for share in ["slip_fraction", "open_fraction"] {
        let mean: f64 = (10..=18).map(|n| area_of(n) * number(&format!("pad_{n}_{share}"))).sum::<f64>() / all;
        assert!((number(&format!("pad_{share}")) - mean).abs() < 1e-12, "{share}");
    }
    let mut largest = 0.0f64;
    for n in 1..=9 {
        let along = ["x", "y", "z"].map(|axis| orbit.numbers(&format!("foot_{n}_{axis}_displacement_m")).unwrap());
        let distance = |row: usize| along.iter().map(|values| values[row] * values[row]).sum::<f64>().sqrt();
        largest = (0..orbit.rows()).map(distance).fold(largest, f64::max);
    }
    assert!(largest > 0.0 && (number("foot_largest_displacement_m") / largest - 1.0).abs() < 1e-12);
}

/// A node with an imposed motion follows it, and moves the other nodes as it moves their places.
#[test]
fn fields_follow_imposed_motions() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path(), 0.01, true);
    let places = "[[place]]\nname = \"corner\"\nnodes = [\"118\"]\n[[place]]\nname = \"other\"\nnodes = [\"116\"]\n";
    let motion = "[[motion]]\non = \"corner.x\"\namplitude = \"2 um\"\n";
    let study = STUDY.replace("kind = \"response\"", "kind = \"orbit\"\nfields = 8\nsamples = 8");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "frequency = \"1500 Hz\"\n");
    for reduction in ["reduce = false", "reduce = { modes = 20 }"] {
        let head = HEAD.replace("reduce = false", reduction);
        let found = dataset(folder.path(), &[&head, &study, CONTACT, places, motion]);
        let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
        let (orbit, fields) = (table("orbit"), table("fields"));
        let (times, at) = (fields.numbers("time_s").unwrap(), orbit.numbers("time_s").unwrap());
        let numbers = fields.integers("node").unwrap();
        for row in (0..fields.rows()).filter(|row| [116, 118].contains(&numbers[*row])) {
            let phase = std::f64::consts::TAU * 1500.0 * times[row];
            let instant = at.iter().position(|time| (time - times[row]).abs() < 1e-15).unwrap();
            for (column, what) in [("m", "displacement_m"), ("m_per_s", "velocity_m_per_s")] {
                for axis in ["x", "y", "z"] {
                    let name = if numbers[row] == 118 { "corner" } else { "other" };
                    let expected = match (numbers[row], axis, column) {
                        (118, "x", "m") => 2e-6 * phase.cos(),
                        (118, "x", _) => -2e-6 * std::f64::consts::TAU * 1500.0 * phase.sin(),
                        _ => orbit.numbers(&format!("{name}_{axis}_{what}")).unwrap()[instant],
                    };
                    let node = fields.numbers(&format!("{axis}_{column}")).unwrap()[row];
                    let scale = if column == "m" { 1e-6 } else { 1e-2 };
                    assert!((expected - node).abs() < 1e-9 * scale, "{name}.{axis} {column}: {expected} {node}");
                }
            }
        }
    }
}

/// A sector of a ring of six: three elements along the radius, two along the angle and two along
/// z, with nodes in polar coordinates (mm). The inner nodes tie the sectors; the sets LOW and HIGH
/// are the free parts of both sides.
fn write_sector(folder: &Path) -> Vec<(i64, [usize; 3])> {
    let angle = std::f64::consts::TAU / 6.0;
    let grid: Vec<[usize; 3]> = (0..3).flat_map(|k| (0..3).flat_map(move |j| (0..4).map(move |i| [i, j, k]))).collect();
    let number = |at: [usize; 3]| 1 + grid.iter().position(|known| *known == at).unwrap() as i64;
    let mut deck = String::from("*NODE\n");
    for at in &grid {
        let (radius, turn) = (10.0 + at[0] as f64, angle * at[1] as f64 / 2.0);
        writeln!(deck, "{}, {:.15}, {:.15}, {}", number(*at), radius * turn.cos(), radius * turn.sin(), at[2]).unwrap();
    }
    deck += "*ELEMENT, TYPE=C3D8, ELSET=ALL\n";
    let mut elements = Vec::new();
    for k in 0..2 {
        for j in 0..2 {
            for i in 0..3 {
                let lower = |k| [[i, j, k], [i + 1, j, k], [i + 1, j + 1, k], [i, j + 1, k]].map(&number);
                elements.push([lower(k), lower(k + 1)].concat());
            }
        }
    }
    for (e, element) in elements.iter().enumerate() {
        let all: Vec<String> = element.iter().map(ToString::to_string).collect();
        writeln!(deck, "{}, {}", e + 1, all.join(", ")).unwrap();
    }
    for (name, side) in [("LOW", 0), ("HIGH", 2)] {
        writeln!(deck, "*NSET, NSET={name}").unwrap();
        grid.iter().filter(|at| at[1] == side && at[0] > 0).for_each(|at| writeln!(deck, "{},", number(*at)).unwrap());
    }
    let n = 3 * grid.len();
    let mut stiffness = vec![0.0; n * n];
    for row in 0..n {
        // both sides of the tie have equal springs; others differ
        let at = grid[row / 3];
        stiffness[row * n + row] = if at[0] == 0 { 50.0 } else { 100.0 + 3.0 * ((row * 7) % 11) as f64 };
    }
    let edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)];
    for (element, (a, b)) in elements.iter().flat_map(|element| edges.iter().map(move |edge| (element, *edge))) {
        for along in 0..3 {
            let row = |node: i64| 3 * (node as usize - 1) + along;
            let (a, b) = (row(element[a]), row(element[b]));
            for (row, column, value) in [(a, a, 500.0), (b, b, 500.0), (a, b, -500.0), (b, a, -500.0)] {
                stiffness[row * n + column] += value;
            }
        }
    }
    let (mut sti, mut mas, mut dof) = (String::new(), String::new(), String::new());
    for row in 0..n {
        for column in (0..=row).filter(|column| stiffness[row * n + column] != 0.0) {
            writeln!(sti, "{} {} {:e}", column + 1, row + 1, stiffness[row * n + column]).unwrap();
        }
        writeln!(mas, "{} {} 1e-6", row + 1, row + 1).unwrap();
        writeln!(dof, "{}.{}", row / 3 + 1, row % 3 + 1).unwrap();
    }
    let mut pairs = String::from("low,high\n");
    (0..3).for_each(|k| writeln!(pairs, "{},{}", number([0, 0, k]), number([0, 2, k])).unwrap());
    for (name, text) in
        [("sector.sti", sti), ("sector.mas", mas), ("sector.dof", dof), ("sector.inp", deck), ("pairs.csv", pairs)]
    {
        std::fs::write(folder.join(name), text).unwrap();
    }
    grid.iter().map(|at| (number(*at), *at)).collect()
}

const SECTOR: &str = "schema = 1\n[structure]\nstiffness = \"sector.sti\"\nmass = \"sector.mas\"\ndofs = \"sector.dof\"\n\
    units = \"mm-t-s\"\nmesh = \"sector.inp\"\nrayleigh = { stiffness = \"1e-6 s\" }\nreduce = false\n\
    [disk]\nsectors = 6\nboundary = \"pairs.csv\"\naxis = \"z\"\n\
    [[force]]\non = \"tip.z\"\namplitude = \"20 N\"\nengine_order = 1\n[[place]]\nname = \"tip\"\nnodes = [\"4\"]\n\
    [study]\nkind = \"response\"\nfrequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n\
    [method]\nkind = \"harmonic-balance\"\nharmonics = 5\ntolerance = 0.5\n";

/// The fields of a disk are along fixed axes: each sector agrees with its places rotated about the
/// axis, and both sides of every boundary between sectors are one node.
#[test]
fn fields_of_a_disk_have_all_sectors_along_fixed_axes() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = write_sector(folder.path());
    let blade = nodes.iter().filter(|(_, at)| at[0] > 1).map(|(number, _)| format!("{number}\n"));
    std::fs::write(folder.path().join("blade.csv"), format!("node\n{}", blade.collect::<String>())).unwrap();
    let contact = "[[contact]]\nname = \"shroud\"\nbetween = [\"HIGH\", \"next.LOW\"]\ntangent = [\"cos(60 deg)\", \"sin(60 deg)\", 0]\n\
         law = { kind = \"friction-contact\", tangential = \"200 N/mm^3\", normal = \"300 N/mm^3\", friction = 0.3, preload = \"1 MPa\" }\n";
    let study = SECTOR.replace("kind = \"response\"", "kind = \"orbit\"\nfields = 3\nsamples = 9");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "frequency = \"1500 Hz\"\n");
    let mistuned = "axis = \"z\"\nblade = \"blade.csv\"\nmistuning = { of = \"blade.frequency\", deviation = \"5 %\", seed = 3 }\n";
    for (reduction, disk) in [
        ("reduce = false", "axis = \"z\"\n"),
        ("reduce = { modes = 8 }", "axis = \"z\"\n"),
        ("reduce = false", mistuned),
        ("reduce = { up_to = \"3 kHz\", tolerance = 1e-2 }", mistuned),
    ] {
        let study = study.replace("reduce = false", reduction).replace("axis = \"z\"\n", disk);
        let found = dataset(folder.path(), &[&study, contact]);
        let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
        let (orbit, fields) = (table("orbit"), table("fields"));
        let (times, at) = (fields.numbers("time_s").unwrap(), orbit.numbers("time_s").unwrap());
        let (sectors, numbers) = (fields.integers("sector").unwrap(), fields.integers("node").unwrap());
        assert_eq!(fields.rows(), 3 * 6 * 36, "{reduction} {disk}");
        let along = ["x", "y", "z"].map(|axis| fields.numbers(&format!("{axis}_m")).unwrap());
        let moved = |row: usize| along.map(|values| values[row]);
        let size = along.iter().flat_map(|values| values.iter()).fold(0.0, |size: f64, x| size.max(x.abs()));
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-9 * size);
        let mut compared = [0, 0];
        for row in 0..fields.rows() {
            let (_, place) = *nodes.iter().find(|(number, _)| *number as u64 == numbers[row]).unwrap();
            let instant = at.iter().position(|time| (time - times[row]).abs() < 1e-15).unwrap();
            if numbers[row] == 4 {
                let name = |axis: &str| format!("tip_{}_{axis}_displacement_m", sectors[row]);
                let own = ["x", "y", "z"].map(|axis| orbit.numbers(&name(axis)).unwrap()[instant]);
                let (sin, cos) = (std::f64::consts::TAU * sectors[row] as f64 / 6.0).sin_cos();
                let fixed = [cos * own[0] - sin * own[1], sin * own[0] + cos * own[1], own[2]];
                assert!(near(fixed, moved(row)), "{reduction} {disk}: {fixed:?} {:?}", moved(row));
                compared[0] += 1;
            }
            if place[0] == 0 && place[1] == 2 {
                let low = nodes.iter().find(|(_, other)| *other == [0, 0, place[2]]).unwrap().0 as u64;
                let same = |other: &usize| {
                    times[*other] == times[row] && sectors[*other] == (sectors[row] + 1) % 6 && numbers[*other] == low
                };
                let other = (0..fields.rows()).find(same).unwrap();
                assert!(near(moved(row), moved(other)), "{reduction} {disk}: {:?} {:?}", moved(row), moved(other));
                compared[1] += 1;
            }
        }
        assert_eq!(compared, [3 * 6, 3 * 6 * 3]);
        let contacts = fields.texts("contact").unwrap();
        assert_eq!(contacts.iter().filter(|state| !state.is_empty()).count(), 3 * 6 * 9);
        let pressure = fields.numbers("pressure_Pa").unwrap();
        assert!(pressure.iter().any(|pressure| *pressure > 1e5) && pressure.iter().all(|p| p.is_finite()));
    }
    let without = read(folder.path(), &[&study.replace("axis = \"z\"\n", "")]).unwrap_err();
    let said = format!("{without} {}", without.help_text().unwrap_or_default());
    assert!(said.contains("axis"), "{said}");
}

/// The shapes of modes at all nodes are those of the places, in every sector of a disk.
#[test]
fn fields_of_modes_are_the_shapes_of_their_places() {
    let folder = tempfile::tempdir().unwrap();
    write_sector(folder.path());
    let study = SECTOR.replace("[method]\nkind = \"harmonic-balance\"\nharmonics = 5\ntolerance = 0.5\n", "");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "");
    let diameters = study.replace("kind = \"response\"", "kind = \"nodal-diameter\"\nmodes = 2\nfields = 4");
    for reduction in ["reduce = false", "reduce = { modes = 8 }"] {
        let found = dataset(folder.path(), &[&diameters.replace("reduce = false", reduction)]);
        let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
        let (modes, fields) = (table("nodal_diameters"), table("fields"));
        let each = 4 * 6 * 36;
        assert_eq!(fields.rows(), each * modes.rows());
        let (sectors, numbers) = (fields.integers("sector").unwrap(), fields.integers("node").unwrap());
        let mut compared = 0;
        for row in (0..fields.rows()).filter(|row| numbers[*row] == 4) {
            let (mode, instant) = (row / each, row % each / (6 * 36));
            let diameter = modes.integers("nodal_diameter").unwrap()[mode] as f64;
            assert_eq!(fields.numbers("frequency_Hz").unwrap()[row], modes.numbers("frequency_Hz").unwrap()[mode]);
            let turn = std::f64::consts::TAU * sectors[row] as f64 / 6.0;
            let own = ["x", "y", "z"].map(|axis| {
                let shape = modes.numbers(&format!("tip_{axis}_shape_per_sqrt_kg")).unwrap()[mode];
                let phase = modes.numbers(&format!("tip_{axis}_phase_deg")).unwrap()[mode].to_radians();
                shape * (phase + diameter * turn + std::f64::consts::FRAC_PI_2 * instant as f64).cos()
            });
            let (sin, cos) = turn.sin_cos();
            let fixed = [cos * own[0] - sin * own[1], sin * own[0] + cos * own[1], own[2]];
            for (axis, expected) in ["x_m", "y_m", "z_m"].iter().zip(fixed) {
                let found = fields.numbers(axis).unwrap()[row];
                assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{axis}: {found} {expected}");
            }
            compared += 1;
        }
        assert_eq!(compared, modes.rows() * 4 * 6);
        // a chosen mode alone
        let chosen = diameters.replace("fields = 4", "fields = 4\nnodal_diameter = 2\nmode = 1\njoints = \"stuck\"");
        let found = dataset(folder.path(), &[&chosen.replace("reduce = false", reduction)]);
        let one = found.tables.iter().find(|table| table.name == "fields").unwrap();
        let [joints, all] = [one, fields].map(|table| table.texts("joints").unwrap());
        let (diameters, numbers) = (fields.integers("nodal_diameter").unwrap(), fields.integers("mode").unwrap());
        let own = (0..fields.rows()).filter(|&k| (&*all[k], diameters[k], numbers[k]) == ("stuck", 2, 1));
        let expected: Vec<f64> = own.map(|k| fields.numbers("x_m").unwrap()[k]).collect();
        assert_eq!((one.rows(), one.numbers("x_m").unwrap()), (each, &expected[..]));
        assert!(joints.iter().all(|state| state == "stuck"));
    }
    write_files(folder.path(), 0.01, true);
    let kind = "kind = \"modes\"\namplitude = { from = \"1 um\", to = \"1 mm\", points = 3 }\nfields = 4\n";
    let block = STUDY.replace("kind = \"response\"\nfrequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", kind);
    let block = block.split("[method]").next().unwrap();
    let corner = "[[place]]\nname = \"corner\"\nnodes = [\"118\"]\n";
    let found = dataset(folder.path(), &[HEAD, block, corner]);
    let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
    let (modes, fields) = (table("modes"), table("fields"));
    assert_eq!((modes.rows(), fields.rows()), (3, 2 * 4 * 36));
    let rows: Vec<usize> = (0..fields.rows()).filter(|row| fields.integers("node").unwrap()[*row] == 118).collect();
    for (end, row) in [(0, 0), (1, 2)] {
        for axis in ["x", "y", "z"] {
            let values = fields.numbers(&format!("{axis}_m")).unwrap();
            let found = values[rows[4 * end]].hypot(values[rows[4 * end + 1]]);
            let expected = modes.numbers(&format!("corner_{axis}_first_harmonic_m")).unwrap()[row];
            assert!((found - expected).abs() < 1e-9 * expected.max(1e-9), "{axis}: {found} {expected}");
        }
    }
}

/// The stresses of a mode are weighted sums of the displacements of its places: of a nodal diameter
/// per unit of modal amplitude, of a nonlinear mode at every amplitude.
#[test]
fn stresses_of_modes_follow_from_their_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let write_stress = |rows: &str, [first, second]: [&str; 2]| {
        let row = |name: &str| 1 + rows.lines().position(|line| line.trim() == name).unwrap();
        let matrix = format!(
            "%%MatrixMarket matrix coordinate real general\n1 {} 2\n1 {} 2\n1 {} -3\n",
            rows.lines().count(),
            row(first),
            row(second)
        );
        std::fs::write(folder.path().join("stress.mtx"), matrix).unwrap();
        std::fs::write(folder.path().join("rows.csv"), "row,name\n1,root\n").unwrap();
    };
    // 2 N/mm^2 and -3 N/mm^2 for each mm along x and z
    let factor = 1e9;
    let stress_of = |x: Complex64, z: Complex64| (x * 2.0 - z * 3.0) * factor;
    let with_stress = "stress = \"stress.mtx\"\nstress_rows = \"rows.csv\"\nreduce = ";

    write_sector(folder.path());
    write_stress(&std::fs::read_to_string(folder.path().join("sector.dof")).unwrap(), ["4.1", "4.3"]);
    let study = SECTOR.replace("[method]\nkind = \"harmonic-balance\"\nharmonics = 5\ntolerance = 0.5\n", "");
    let study = study.replace("frequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", "");
    let study = study.replace("kind = \"response\"", "kind = \"nodal-diameter\"\nmodes = 2");
    for reduction in ["false", "{ modes = 8 }"] {
        let found = dataset(folder.path(), &[&study.replace("reduce = false", &format!("{with_stress}{reduction}"))]);
        let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
        let (modes, stress) = (table("nodal_diameters"), table("stress"));
        assert_eq!(stress.rows(), modes.rows());
        assert_eq!(stress.numbers("frequency_Hz"), modes.numbers("frequency_Hz"));
        assert_eq!(stress.integers("nodal_diameter"), modes.integers("nodal_diameter"));
        for row in 0..modes.rows() {
            let shape = |axis: &str| {
                let size = modes.numbers(&format!("tip_{axis}_shape_per_sqrt_kg")).unwrap()[row];
                Complex64::from_polar(size, modes.numbers(&format!("tip_{axis}_phase_deg")).unwrap()[row].to_radians())
            };
            let expected = stress_of(shape("x"), shape("z"));
            let size = stress.numbers("amplitude_Pa_per_m_sqrt_kg").unwrap()[row];
            let found = Complex64::from_polar(size, stress.numbers("phase_deg").unwrap()[row].to_radians());
            assert!((found - expected).norm() < 1e-9 * (factor + expected.norm()), "{row}: {found} {expected}");
        }
    }

    write_files(folder.path(), 0.01, true);
    write_stress(&std::fs::read_to_string(folder.path().join("block.dof")).unwrap(), ["118.1", "118.3"]);
    let kind = "kind = \"modes\"\namplitude = { from = \"1 um\", to = \"1 mm\", points = 3 }\n";
    let block = STUDY.replace("kind = \"response\"\nfrequency = [\"1500 Hz\", \"1700 Hz\"]\npeaks = false\n", kind);
    let block = block.split("[method]").next().unwrap();
    let corner = "[[place]]\nname = \"corner\"\nnodes = [\"118\"]\n";
    let head = HEAD.replace("reduce = ", with_stress);
    let found = dataset(folder.path(), &[&head, block, corner]);
    let table = |name: &str| found.tables.iter().find(|table| table.name == name).unwrap();
    let (modes, stress) = (table("modes"), table("stress"));
    assert_eq!((modes.rows(), stress.rows()), (3, 3));
    for row in 0..3 {
        let shape = |axis: &str| {
            let size = modes.numbers(&format!("corner_{axis}_first_harmonic_m")).unwrap()[row];
            Complex64::from_polar(size, modes.numbers(&format!("corner_{axis}_phase_deg")).unwrap()[row].to_radians())
        };
        let expected = stress_of(shape("x"), shape("z"));
        let size = stress.numbers("first_harmonic_Pa").unwrap()[row];
        let found = Complex64::from_polar(size, stress.numbers("phase_deg").unwrap()[row].to_radians());
        assert!(expected.norm() > 1e-3 && (found - expected).norm() < 1e-9 * expected.norm(), "{found} {expected}");
    }
}

/// The high side of a sector rubs on the low side of the next one. The joints by hand have the
/// normal (-sin 60°, cos 60°, 0) on the high side and (0, 1, 0) on the low side, the tangent along
/// the radius on both, and the areas of a rectangle of 2 mm x 2 mm.
#[test]
fn contacts_with_the_next_sector_are_the_joints_of_their_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = write_sector(folder.path());
    let contact = "[[contact]]\nname = \"shroud\"\nbetween = [\"HIGH\", \"next.LOW\"]\ntangent = [\"cos(60 deg)\", \"sin(60 deg)\", 0]\n\
         law = { kind = \"friction-contact\", tangential = \"200 N/mm^3\", normal = \"300 N/mm^3\", friction = 0.3, preload = \"10 MPa\" }\n";
    let found = dataset(folder.path(), &[SECTOR, contact]);
    let mut joints = String::new();
    for (number, at) in nodes.iter().filter(|(_, at)| at[1] == 2 && at[0] > 0) {
        let share = |x: usize, last: usize| if x == last || x + 2 == last { 0.5 } else { 1.0 };
        let area = share(at[0], 3) * share(at[2], 2);
        let low = nodes.iter().find(|(_, other)| *other == [at[0], 0, at[2]]).unwrap().0;
        write!(
            joints,
            "[[place]]\nname = \"shroud_{number}_a\"\nnodes = [\"{number}\"]\nnormal = [\"-sin(60 deg)\", \"cos(60 deg)\", 0]\n\
             tangent = [\"cos(60 deg)\", \"sin(60 deg)\", 0]\n\
             [[place]]\nname = \"shroud_{number}_b\"\nnodes = [\"{low}\"]\nnormal = [0, 1, 0]\ntangent = [1, 0, 0]\n\
             [[joint]]\nname = \"shroud_{number}\"\nbetween = [\"shroud_{number}_a\", \"next.shroud_{number}_b\"]\n\
             law = {{ kind = \"friction-contact\", tangential = \"{} N/mm\", normal = \"{} N/mm\", friction = 0.3, preload = \"{} N\" }}\n",
            200.0 * area,
            300.0 * area,
            10.0 * area
        )
        .unwrap();
    }
    check_equal(&found, &dataset(folder.path(), &[SECTOR, &joints]), 1e-9);
    // faces in contact coincide after rotation, too, but coordinates do not tie them
    for boundary in ["boundary = \"pairs.csv\"\nnodes = \"sector.inp\"\n", "nodes = \"sector.inp\"\n"] {
        let study = SECTOR.replace("boundary = \"pairs.csv\"\n", boundary);
        check_equal(&dataset(folder.path(), &[&study, contact]), &found, 1e-12);
    }
    let summary = ModelSummary::new(&read(folder.path(), &[SECTOR, contact]).unwrap()).unwrap().to_string();
    assert!(summary.contains("shroud: 9 joints of HIGH on next.LOW, area 4 of 4 mm^2"), "{summary}");
    // preloads of a static step are balanced on both sides of the shroud
    let rows: String = nodes.iter().map(|(number, _)| format!("{number},10\n")).collect();
    std::fs::write(folder.path().join("static.csv"), format!("node,pressure_MPa\n{rows}")).unwrap();
    let data = "[[data]]\nname = \"static\"\nfile = \"static.csv\"\n";
    let balanced = contact.replace(", preload = \"10 MPa\"", "") + "preload = { data = \"static\" }\n" + data;
    let balanced = ModelSummary::new(&read(folder.path(), &[SECTOR, &balanced]).unwrap()).unwrap();
    let normal = balanced.joints.iter().filter(|joint| joint.name.ends_with(".n"));
    let pressed: Vec<[Option<f64>; 2]> = normal.map(|joint| [joint.normal_force, joint.normal_force_at_rest]).collect();
    let is_whole = |[preload, at_rest]: &[Option<f64>; 2]| (at_rest.unwrap() / preload.unwrap() - 1.0).abs() < 1e-9;
    assert!(pressed.len() >= 9 && pressed.iter().all(is_whole), "{pressed:?}");
    // without a stated tangent both sides share one direction in space
    let own =
        dataset(folder.path(), &[SECTOR, &contact.replace("tangent = [\"cos(60 deg)\", \"sin(60 deg)\", 0]\n", "")]);
    let tip = |data: &Dataset| data.tables[0].numbers("tip_0_z_amplitude_m").unwrap().to_vec();
    for (one, other) in tip(&own).into_iter().zip(tip(&found)) {
        assert!((one - other).abs() <= 1e-3 * other, "{one} {other}");
    }
    let error = read(folder.path(), &[&SECTOR.replace("axis = \"z\"\n", ""), contact]).unwrap_err().to_string();
    assert!(error.contains("the rotation of the sectors"), "{error}");
}
