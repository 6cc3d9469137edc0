//! Bladed disks in study files.

use std::f64::consts::TAU;
use stickslip::method::{Method, event_driven::EventDriven, harmonic_balance::HarmonicBalance};
use stickslip::model::{Model, Ring};
use stickslip_study::dataset::Style;
use stickslip_study::run::{Context, run};
use stickslip_study::{Case, Study, StudyError, read_study};

const SECTOR: &str = r#"
schema = 1
[parameters]
k = "1e5 N/m"
c = "k*1e-6 s"
s = 7
[[mass]]
name = "blade"
mass = "200 g"
[[spring]]
between = ["blade", "ground"]
stiffness = "k"
damping = "c"
[[spring]]
between = ["blade", "next.blade"]
stiffness = "1e4 N/m"
[[joint]]
name = "shroud"
between = ["blade", "next.blade"]
law = { kind = "jenkins", stiffness = "2e4 N/m", limit = "1 N" }
[[force]]
on = "blade"
amplitude = "1 N"
"#;

const STUDY: &str = "
[study]
kind = \"response\"
frequency = { from = \"110 Hz\", to = \"130 Hz\", points = 5 }
";

fn read(force: &str, disk: &str, study: &str) -> Result<Study, StudyError> {
    read_study("disk.toml", &format!("{SECTOR}{force}\n[disk]\nsectors = 6\n{disk}\n{study}"), &[])
}

fn case(force: &str, disk: &str) -> Case {
    read(force, disk, STUDY).unwrap_or_else(|error| panic!("{error:?}")).case(0).unwrap()
}

/// Returns the stiffness of each blade relative to the tuned one.
fn blades(case: &Case) -> Vec<f64> {
    (0..6).map(|s| case.model.springs[2 * s].stiffness / 1e5).collect()
}

#[test]
fn a_sector_becomes_a_ring() {
    let case = case("engine_order = -1", "");
    let model = &case.model;
    assert_eq!(model.place_names()[1..], ["blade_0", "blade_1", "blade_2", "blade_3", "blade_4", "blade_5"]);
    assert_eq!(model.joints[5].between, ["blade_5", "blade_0"]);
    assert_eq!(model.ring.unwrap().order, Some(5));
    let study = read("engine_order = -1", "", STUDY).unwrap();
    let data = run(&study, &Context::without_progress(1)).unwrap();
    let names: Vec<&str> = data.tables[0].columns.iter().map(|column| column.name.as_str()).collect();
    // all sectors are alike, so bars would show nothing
    let amplitudes = (0..6).map(|s| data.tables[0].numbers(&format!("blade_{s}_amplitude_m")).unwrap()[0]);
    let amplitudes: Vec<f64> = amplitudes.collect();
    assert!(amplitudes.iter().all(|y| (y / amplitudes[0] - 1.0).abs() < 1e-6), "{amplitudes:?}");
    let bars = data.figure.panels.iter().flat_map(|panel| &panel.series).filter(|s| s.style == Style::Bars);
    assert_eq!(bars.count(), 0);
    for column in ["blade_0_amplitude_m", "blade_5_amplitude_m", "shroud_3_dissipation_J"] {
        assert!(names.contains(&column), "{column} in {names:?}");
    }
}

/// Bars and shape of a mistuned disk are drawn at the peak, which lies between the points of
/// the curve. They equal the peak, and blade by blade a study of that one frequency. At the
/// neighbouring points another blade has the largest amplitude.
#[test]
fn bars_stand_at_the_peak() {
    let mistuned = "mistuning = { of = \"k\", deviation = \"3 %\", seed = 7 }";
    let method = "[figure]\ny_unit = \"m\"\n[method]\nkind = \"harmonic-balance\"\nharmonics = 1\ntolerance = 0.9\n";
    let result = |study: &str| {
        let study = read("engine_order = 1", mistuned, &format!("[study]\nkind = \"response\"\n{study}\n{method}"));
        run(&study.unwrap(), &Context::without_progress(1)).unwrap()
    };
    for more in ["", "peak_of = \"all\""] {
        let found = result(&format!("frequency = {{ from = \"100 Hz\", to = \"150 Hz\", points = 5 }}\n{more}"));
        let peaks = found.tables.iter().find(|table| table.name == "peaks").unwrap();
        let inside = peaks.flags("at_range_end").unwrap().iter().map(|end| *end == Some(false));
        let of = |column: &str| peaks.numbers(column).unwrap().to_vec();
        let all = of("amplitude_m").into_iter().zip(of("frequency_Hz")).zip(inside);
        let (highest, hertz) =
            all.filter(|(_, inside)| *inside).map(|(peak, _)| peak).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let bars = &found.figure.panels[1].series[0];
        let largest = bars.y.iter().copied().fold(0.0, f64::max);
        assert!((largest / highest - 1.0).abs() < 1e-9, "{more}: {largest} {highest}");
        let grid = |blade: usize| found.tables[0].numbers(&format!("blade_{blade}_amplitude_m")).unwrap().to_vec();
        let missed = (0..6).flat_map(grid).fold(0.0, f64::max);
        assert!(missed < 0.9 * highest, "the points miss the peak: {missed} {highest} at {hertz} Hz");
        let alone = result(&format!("frequency = [\"{hertz:.17} Hz\"]\npeaks = false"));
        for blade in 0..6 {
            let expected = alone.tables[0].numbers(&format!("blade_{blade}_amplitude_m")).unwrap()[0];
            let bar = bars.y[blade];
            assert!((bar / expected - 1.0).abs() < 1e-6, "{more} blade {blade}: {bar} {expected}");
        }
    }
}

/// k (1 + deviation) for any name of the parameter; dependent parameters follow.
#[test]
fn mistuning_by_parameter_mass_and_spring() {
    let pattern = stickslip::model::normal_deviations(6, 0.02, 7);
    let by_parameter = case("", "mistuning = { of = \"k\", deviation = \"2 %\", seed = 7 }");
    for (s, deviation) in pattern.iter().enumerate() {
        let spring = &by_parameter.model.springs[2 * s];
        assert!((spring.stiffness / (1e5 * (1.0 + deviation)) - 1.0).abs() < 1e-15);
        assert!((spring.damping / (0.1 * (1.0 + deviation)) - 1.0).abs() < 1e-15, "the damping is an expression of k");
    }
    let by_spring = case("", "mistuning = { of = [\"ground\", \"blade\"], deviation = 0.02, seed = \"s\" }");
    assert_eq!(blades(&by_spring), blades(&by_parameter));
    assert_eq!(by_spring.model.springs[0].damping, by_spring.model.springs[2].damping);
    let by_mass = case("", "mistuning = { of = \"blade\", deviation = 0.02, seed = 7 }");
    assert!((by_mass.model.masses[3].mass / (0.2 * (1.0 + pattern[3])) - 1.0).abs() < 1e-15);
    assert!(by_mass.model.ring.unwrap().order.is_none());
    // a deviation of zero is not mistuning
    assert!(case("", "mistuning = { of = \"k\", deviation = 0 }").model.ring.unwrap().order.is_some());
}

#[test]
fn seeds_are_cases() {
    let study = read(
        "engine_order = 2",
        "mistuning = { of = \"k\", deviation = 0.02, seed = \"s\" }",
        "[study]\nkind = \"response\"\nfrequency = \"115 Hz\"\nvary = { s = { from = 1, to = 4, points = 4 } }",
    )
    .unwrap();
    assert_eq!(study.cases(), 4);
    let all: Vec<Vec<f64>> = (0..4).map(|i| blades(&study.case(i).unwrap())).collect();
    assert!((0..3).all(|i| all[i] != all[i + 1]));
}

#[test]
fn a_pattern_from_a_file() {
    let folder = std::env::temp_dir().join(format!("stickslip-pattern-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("pattern.csv", "sector,deviation\n0,1 %\n1,0\n2,-0.02\n3,0\n4,0\n5,0.5 %\n");
    write("short.csv", "sector,deviation\n0,1 %\n");
    write("wrong.csv", "sector,deviation\n0,stiff\n");
    let read = |file: &str| {
        let text = format!("{SECTOR}\n[disk]\nsectors = 6\nmistuning = {{ of = \"k\", file = \"{file}\" }}\n{STUDY}");
        std::fs::write(folder.join("disk.toml"), text).unwrap();
        stickslip_study::read_file(&folder.join("disk.toml"), &[])
    };
    let found = blades(&read("pattern.csv").unwrap().case(0).unwrap());
    assert!(found.iter().zip([1.01, 1.0, 0.98, 1.0, 1.0, 1.005]).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
    for (file, words) in
        [("short.csv", "has 1 sectors, but the disk has 6"), ("wrong.csv", "line 2"), ("none.csv", "cannot be read")]
    {
        assert!(read(file).unwrap_err().message().contains(words), "{file}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn wrong_disks_are_refused_at_their_place() {
    let message = |force: &str, disk: &str| {
        let error = read(force, disk, STUDY).unwrap_err();
        format!("{} | {}", error.message(), error.help_text().unwrap_or_default())
    };
    for (force, disk, words) in [
        ("engine_order = 1.5", "", "whole number"),
        ("engine_order = 1\nnodal_diameter = 2", "", "both define the wave"),
        ("sector = 6", "", "from 0 to 5"),
        ("", "mistuning = { of = \"q\", deviation = 0.02 }", "no parameter or mass `q`"),
        ("", "mistuning = { of = [\"blade\", \"disk\"], deviation = 0.02 }", "no spring between"),
        ("", "mistuning = { of = \"k\" }", "`deviation` or `file` is missing"),
        ("", "mistuning = { of = \"k\", deviation = 0.02, seed = 0.5 }", "whole number"),
        (
            "",
            "mistuning = { of = \"k\", deviation = 0.02, file = \"p.csv\" }",
            "`deviation` and `file` exclude each other",
        ),
        (
            "",
            "mistuning = { of = \"k\", deviation = 100, seed = 1 }",
            "no stiffness or mass remains | write deviations as fractions or in percent: 0.02 is 2 %",
        ),
        ("", "sectors_ = 3", "no key `sectors_`"),
    ] {
        assert!(message(force, disk).contains(words), "{force} {disk}: {}", message(force, disk));
    }
    let text = format!("{SECTOR}engine_order = 3\n{STUDY}");
    assert!(
        read_study("d.toml", &text.replace("next.blade", "ground"), &[]).unwrap_err().message().contains("no [disk]")
    );
    let one = format!("{SECTOR}\n[disk]\nsectors = 1\n{STUDY}");
    assert!(read_study("d.toml", &one, &[]).unwrap_err().message().contains("at least 2 sectors"));
    let many = format!("{SECTOR}\n[disk]\nsectors = 1e8\n{STUDY}");
    assert!(read_study("d.toml", &many, &[]).unwrap_err().message().contains("the limit is"));
    let misspelt = format!("{SECTOR}\n[disk]\nsectors = 6\n{STUDY}").replacen("\"next.blade\"", "\"next.blad\"", 1);
    let error = read_study("d.toml", &misspelt, &[]).unwrap_err();
    assert!(error.message().contains("no place `blad`") && error.help_text() == Some("did you mean `blade`?"));
    let varied = format!(
        "{SECTOR}\n[disk]\nsectors = \"s\"\n[study]\nkind = \"response\"\nfrequency = \"1 Hz\"\nvary = {{ s = [4, 5] }}"
    );
    assert!(read_study("d.toml", &varied, &[]).unwrap_err().message().contains("differs between cases"));
}

/// `only = \"blade\"` selects the blades of all sectors; a name with a number selects one of
/// them.
#[test]
fn names_of_a_sector_stand_for_all() {
    let figure = |only: &str| read("", "", &format!("{STUDY}[figure]\nonly = {only}\n")).map(|_| ());
    for good in ["\"blade\"", "[\"blade_3\", \"shroud_0\"]", "\"shroud\""] {
        figure(good).unwrap();
    }
    assert!(figure("\"blade_6\"").is_err());
}

/// `ω² = (k + 2 kc (1 - cos 2πd/N)) / m`, with the joints' springs in kc if they stick.
/// Dampers between blades of a disk, which only rigid friction holds, carry a constant load while
/// they slip. The solution on one sector has the amplitude of the exact one, and the springs of the
/// blades carry the load: a mean of `0.3 N / (4000 N/m)`.
#[test]
fn loose_dampers_of_a_disk_carry_a_load() {
    let text = r#"schema = 1
disk = { sectors = 6 }
mass = [{ name = "blade", mass = "1 kg" }, { name = "damper", mass = "0.1 kg" }]
spring = [
  { between = ["blade", "ground"], stiffness = "4000 N/m", damping = "2 N s/m" },
  { between = ["blade", "next.blade"], stiffness = "500 N/m" },
]
joint = [
  { name = "own", between = ["damper", "blade"], law = { kind = "coulomb", limit = "1 N" } },
  { name = "next", between = ["damper", "next.blade"], law = { kind = "coulomb", limit = "2 N" } },
]
force = [
  { on = "blade", amplitude = "6 N", engine_order = 2 },
  { on = "damper", amplitude = "0.3 N", harmonic = 0 },
]
[study]
kind = "orbit"
frequency = "8 Hz"
"#;
    let case = read_study("disk.toml", text, &[]).unwrap().case(0).unwrap();
    let system = case.model.assemble().unwrap();
    let orbit = |method: &dyn Method| method.solver(&system).unwrap().orbit(TAU * 8.0).unwrap();
    let (sector, exact) = (orbit(&HarmonicBalance::default()), orbit(&EventDriven));
    let truncation = sector.evidence.error_estimate.unwrap();
    for (found, exact) in sector.places.iter().zip(&exact.places) {
        let error = (found.amplitude() / exact.amplitude() - 1.0).abs();
        assert!(error < 3.0 * truncation, "{} {}", found.amplitude(), exact.amplitude());
    }
    assert!((sector.places[0].mean / (0.3 / 4000.0) - 1.0).abs() < 1e-6, "{}", sector.places[0].mean);
    assert!(exact.joints[0].slip_fraction > 0.5 && sector.joints[0].slip_fraction > 0.5, "{:?}", sector.joints);
}

#[test]
fn frequencies_by_nodal_diameter() {
    let study = read("", "", "[study]\nkind = \"nodal-diameter\"\nmodes = 2\n").unwrap();
    let data = run(&study, &Context::without_progress(1)).unwrap();
    let table = &data.tables[0];
    let (d, f) = (table.integers("nodal_diameter").unwrap(), table.numbers("frequency_Hz").unwrap());
    let joints = table.texts("joints").unwrap();
    assert_eq!(table.rows(), 8, "one mode of each of 4 diameters, free and stuck");
    for row in 0..8 {
        let kc = if joints[row] == "free" { 1e4 } else { 3e4 };
        let square = (1e5 + 2.0 * kc * (1.0 - (TAU * d[row] as f64 / 6.0).cos())) / 0.2;
        assert!((f[row] * TAU / square.sqrt() - 1.0).abs() < 1e-12);
    }
    assert!(!data.figure.panels[0].series.is_empty());
    let mistuned = read("", "mistuning = { of = \"k\", deviation = 0.01 }", "[study]\nkind = \"nodal-diameter\"\n");
    assert!(mistuned.unwrap_err().message().contains("have no nodal diameter"));
}

/// A blade with stress stiffening, `k0 + k1 Ω²`: engine order e crosses at
/// `Ω² = k0/(e² m - k1)`. On a disk it crosses only the modes of its nodal diameter.
#[test]
fn campbell_crossings() {
    let sector = SECTOR
        .replace("k = \"1e5 N/m\"", "speed = \"0 Hz\"\nk0 = \"1e5 N/m\"\nk = \"k0 + 0.1 kg*(speed/(1 rad))^2\"")
        .replace("stiffness = \"1e4 N/m\"", "stiffness = \"0 N/m\"");
    let kind =
        "[study]\nkind = \"campbell\"\nspeed = { from = \"20 Hz\", to = \"200 Hz\", points = 7 }\nengine_orders = 8\n";
    let crossings = |text: &str| {
        let data = run(&read_study("c.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap();
        data.tables.into_iter().find(|table| table.name == "crossings").unwrap()
    };
    let plain = sector
        .replace("next.blade", "ground")
        .replace("kind = \"jenkins\", stiffness = \"2e4", "kind = \"jenkins\", stiffness = \"0");
    let plain = plain.replace("\"0 N/m\", limit", "\"1e-9 N/m\", limit");
    let found = crossings(&format!("{plain}{kind}"));
    let (orders, speeds) = (found.integers("engine_order").unwrap(), found.numbers("speed_Hz").unwrap());
    let joints = found.texts("joints").unwrap();
    for order in 1..=5u64 {
        let speed = (1e5 / ((order * order) as f64 * 0.2 - 0.1)).sqrt() / TAU;
        let rows: Vec<usize> = (0..found.rows()).filter(|r| orders[*r] == order && joints[*r] == "free").collect();
        assert_eq!(rows.len(), usize::from((20.0..200.0).contains(&speed)), "{order} {speed}");
        assert!(rows.iter().all(|row| (speeds[*row] / speed - 1.0).abs() < 1e-9), "{order}");
    }
    // a diagram from rest has the same crossings; no engine order line crosses a mode at zero
    // speed
    let from_rest = kind.replace("20 Hz\", to = \"200 Hz\", points = 7", "0 rpm\", to = \"12000 rpm\", points = 11");
    let same = crossings(&format!("{plain}{from_rest}"));
    let others = (same.integers("engine_order").unwrap(), same.numbers("speed_Hz").unwrap());
    for (order, speed) in orders.iter().zip(speeds) {
        let mut near = others.0.iter().zip(others.1).filter(|(other, _)| *other == order);
        assert!(near.any(|(_, other)| (other / speed - 1.0).abs() < 1e-9), "{order} {speed}");
    }
    let negative = from_rest.replace("0 rpm", "-1 rpm");
    let error = read_study("c.toml", &format!("{plain}{negative}"), &[]).unwrap_err();
    assert!(error.message().contains("must be zero or more"), "{error}");
    let ring = crossings(&format!("{sector}[disk]\nsectors = 6\n{kind}"));
    let (orders, diameters) = (ring.integers("engine_order").unwrap(), ring.integers("nodal_diameter").unwrap());
    assert!(ring.rows() > 8);
    for (order, diameter) in orders.iter().zip(diameters) {
        let turns = order % 6;
        assert_eq!(*diameter, turns.min(6 - turns));
    }
}

/// A disk mass, its low and its high side, and a blade of two masses; kg and N/m.
const STIFFNESS: &str = "%%MatrixMarket matrix coordinate real symmetric\n4 4 7\n1 1 5.5e5\n2 1 -2e5\n2 2 2e5\n3 1 -5e4\n3 3 8e4\n\
                         4 3 -3e4\n4 4 3e4\n";
const MASS: &str = "%%MatrixMarket matrix coordinate real symmetric\n4 4 4\n1 1 1.5\n2 2 0.5\n3 3 0.3\n4 4 0.2\n";

/// A study of a sector given by matrices, next to its files.
fn by_matrices(disk: &str, more: &str) -> Result<Study, StudyError> {
    stiffened("", disk, more)
}

/// Like `by_matrices`, with another key of `[structure]`.
fn stiffened(key: &str, disk: &str, more: &str) -> Result<Study, StudyError> {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("k.mtx", STIFFNESS);
    write("m.mtx", MASS);
    write("k100.mtx", &STIFFNESS.replace("4 4 3e4", "4 4 3.5e4").replace("3 3 8e4", "3 3 8.2e4"));
    write("soft.mtx", &STIFFNESS.replace("4 4 3e4", "4 4 1e4"));
    write("small.mtx", "%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 1\n");
    write("rows.csv", "row,name\n1,1.x\n2,2.x\n3,3.x\n4,4.x\n");
    write("pairs.csv", "high,low\n2,1\n");
    write("strange.csv", "low,high\n1,9\n");
    write("wrong.csv", "left,right\n1,2\n");
    write("blade.csv", "node\n3\n4\n");
    write("rim_blade.csv", "node\n1\n3\n4\n");
    write("no_blade.csv", "node\n");
    let text = format!(
        "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\ndofs = \"rows.csv\"\nunits = \"m-kg-s\"\n\
         modal_damping = 0.002\nreduce = {{ modes = 3 }}\n{key}\n[disk]\nsectors = 6\n{disk}\n[[place]]\nname = \"tip\"\ndof = \"4.x\"\n{more}"
    );
    write("disk.toml", &text);
    stickslip_study::read_file(&folder.path().join("disk.toml"), &[])
}

const SHROUD: &str = "[[joint]]\nname = \"shroud\"\nbetween = [\"tip\", \"next.tip\"]\n\
                      law = { kind = \"jenkins\", stiffness = \"2e3 N/m\", limit = \"Ft\" }\n\
                      [[force]]\non = \"tip\"\namplitude = \"1 N\"\nengine_order = 2\n";

/// Joints between neighbours, mistuned blades and drawn parameters, all on one sector given by
/// matrices.
#[test]
fn samples_of_a_disk_by_its_matrices() {
    let disk = "boundary = \"pairs.csv\"\nblade = \"blade.csv\"\n\
                mistuning = { of = \"blade.frequency\", deviation = \"1 %\", seed = \"pattern\" }";
    let more = format!(
        "{SHROUD}[parameters]\nFt = \"1 N\"\npattern = 3\n[sample]\ncount = 3\nseed = 1\n\
         of = {{ Ft = {{ uniform = [\"1 N\", \"2 N\"] }} }}\n\
         [study]\nkind = \"response\"\nfrequency = \"44 Hz\"\nvary = {{ pattern = [3, 4] }}\n\
         [method]\nkind = \"harmonic-balance\"\nharmonics = 3\n"
    );
    let study = by_matrices(disk, &more).unwrap();
    assert_eq!(study.cases(), 6);
    let model = study.case(0).unwrap().model;
    assert_eq!(model.joints[5].between, ["tip_5", "tip_0"]);
    let disk = model.substructure.unwrap().disk.unwrap();
    for (own, drawn) in disk.deviations.iter().zip(stickslip::model::normal_deviations(6, 0.01, 3)) {
        assert!((own - ((1.0 + drawn).powi(2) - 1.0)).abs() < 1e-15, "a share of frequency is nearly two of stiffness");
    }
    let data = run(&study, &Context::without_progress(1)).unwrap();
    assert!(data.failures.is_empty(), "{:?}", data.failures);
    let tip = data.tables[0].numbers("tip_5_amplitude_m").unwrap();
    assert!(
        tip.len() == 6 && tip.iter().all(|tip| *tip > 0.0) && tip.windows(2).all(|pair| pair[0] != pair[1]),
        "{tip:?}"
    );
}

/// Theory 12: a sector given by matrices, with joints between neighbours, equals the whole ring
/// in a travelling wave. The ring is solved without its symmetry, with elastic, rigid and
/// smooth friction.
#[test]
fn a_matrix_sector_with_a_joint_equals_its_ring() {
    let laws = [
        "kind = \"jenkins\", stiffness = \"2e3 N/m\", limit = \"0.2 N\"",
        "kind = \"coulomb\", limit = \"0.2 N\"",
        "kind = \"jenkins-arctan\", stiffness = \"2e3 N/m\", limit = \"0.2 N\", alpha = \"300 s/m\"",
    ];
    for (law, hertz) in laws.iter().flat_map(|law| [(law, 43.7), (law, 44.6)]) {
        // with a multiple of the number of sectors, the samples of all sectors are alike
        let more = format!(
            "[[joint]]\nname = \"shroud\"\nbetween = [\"tip\", \"next.tip\"]\nlaw = {{ {law} }}\n\
             [[force]]\non = \"tip\"\namplitude = \"1 N\"\nengine_order = 2\n\
             [study]\nkind = \"response\"\nfrequency = \"{hertz} Hz\"\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 9\nsamples = 768\n"
        );
        let sector = by_matrices("boundary = \"pairs.csv\"\n", &more).unwrap().case(0).unwrap().model;
        let whole = sector.ring.map(|ring| Ring { order: None, ..ring });
        let ring = Model { ring: whole, ..sector.clone() };
        assert!(
            Model { ring: None, ..sector.clone() }
                .assemble()
                .unwrap_err()
                .to_string()
                .contains("needs a ring, which defines the number of sectors")
        );
        let orbit = |model: &Model| {
            let method = HarmonicBalance { harmonics: Some(9), samples: Some(768), tolerance: None };
            method.solver(&model.assemble().unwrap()).unwrap().orbit(TAU * hertz).unwrap()
        };
        let (one, all) = (orbit(&sector), orbit(&ring));
        assert_eq!(one.places.len(), all.places.len());
        let size = all.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
        let apart = |a: f64, b: f64| (a - b).abs() / size;
        let places = one.places.iter().zip(&all.places).map(|(a, b)| apart(a.amplitude(), b.amplitude()));
        let losses = one.joints.iter().zip(&all.joints).map(|(a, b)| apart(a.dissipation, b.dissipation));
        let worst = places.chain(losses).fold(0.0, f64::max);
        assert!(worst < 1e-10, "{law} at {hertz} Hz: {worst:.1e}");
        assert!(one.joints.iter().all(|joint| joint.slip_fraction > 0.1), "{law}: a test without slip tests nothing");
    }
}

/// With `x₂ = x₁ e^{jθ}` the waves of the sector have real matrices of three rows. Rotation
/// adds `(Ω/100 Hz)²` times the difference of the second file. The lines and the crossings on
/// them are the eigenvalues.
#[test]
fn a_campbell_diagram_of_a_sector_that_rotation_stiffens() {
    let kind = "[parameters]\nspeed = \"0 Hz\"\nFt = \"1 N\"\n[study]\nkind = \"campbell\"\nspeed = { from = \"5 Hz\", to = \"80 Hz\", points = 6 }\n\
                engine_orders = 8\nmodes = 3\n";
    let key = "stiffened = { file = \"k100.mtx\", at = \"100 Hz\", speed = \"speed\" }";
    let study = stiffened(key, "boundary = \"pairs.csv\"", &format!("{SHROUD}{kind}")).unwrap();
    let data = run(&study, &Context::without_progress(1)).unwrap();
    assert!(data.failures.is_empty(), "{:?}", data.failures);
    let expected = |diameter: u64, speed: f64, stuck: bool| -> Vec<f64> {
        let waves = 2.0 * (1.0 - (TAU * diameter as f64 / 6.0).cos());
        let (share, shroud) = ((speed / 100.0).powi(2), if stuck { 2e3 * waves } else { 0.0 });
        let stiffness = nalgebra::Matrix3::new(
            3.5e5 + 2e5 * waves,
            -5e4,
            0.0, //
            -5e4,
            8e4 + 2e3 * share,
            -3e4, //
            0.0,
            -3e4,
            3e4 + 5e3 * share + shroud,
        );
        let root = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(2.0f64, 0.3, 0.2).map(|m| 1.0 / m.sqrt()));
        let mut all: Vec<f64> = (root * stiffness * root).symmetric_eigenvalues().iter().map(|v| v.sqrt()).collect();
        all.sort_by(f64::total_cmp);
        all.into_iter().map(|omega| omega / TAU).collect()
    };
    let mut rows = 0;
    for table in &data.tables {
        let (diameters, modes) = (table.integers("nodal_diameter").unwrap(), table.integers("mode").unwrap());
        let (speeds, found) = (table.numbers("speed_Hz").unwrap(), table.numbers("frequency_Hz").unwrap());
        let joints = table.texts("joints").unwrap();
        for row in 0..table.rows() {
            let exact = expected(diameters[row], speeds[row], joints[row] == "stuck")[modes[row] as usize - 1];
            assert!((found[row] / exact - 1.0).abs() < 1e-9, "{} row {row}: {} {exact}", table.name, found[row]);
            rows += 1;
        }
        if let Some(orders) = table.integers("engine_order") {
            assert!(table.rows() > 8, "{} crossings", table.rows());
            assert!((0..table.rows()).all(|row| (found[row] / speeds[row] - orders[row] as f64).abs() < 1e-9));
        }
    }
    assert!(rows > 6 * 4 * 2 * 3, "{rows}");
    for (key, words) in [
        ("stiffened = { file = \"k.mtx\", at = \"100 Hz\", speed = \"speed\" }", "at rest again"),
        ("stiffened = { file = \"small.mtx\", at = \"100 Hz\", speed = \"speed\" }", "has 1 rows"),
        ("stiffened = { file = \"k100.mtx\", at = \"0 Hz\", speed = \"speed\" }", "more than zero"),
        ("stiffened = { file = \"k100.mtx\", at = \"100 Hz\" }", "`speed` is missing"),
    ] {
        let error = stiffened(key, "boundary = \"pairs.csv\"", kind).unwrap_err();
        let text = format!("{} {}", error.message(), error.help_text().unwrap_or_default());
        assert!(text.contains(words), "{key}: {text}");
    }
    // if only the sum of both exports buckles, the export at rest is not blamed
    let key = "stiffened = { file = \"soft.mtx\", at = \"100 Hz\", speed = \"speed\" }";
    assert!(stiffened(key, "boundary = \"pairs.csv\"", kind).is_ok());
    let fast = kind.replace("speed = \"0 Hz\"", "speed = \"100 Hz\"");
    let error = stiffened(key, "boundary = \"pairs.csv\"", &fast).unwrap_err();
    assert!(error.message().starts_with("1 eigenvalue lies below -"), "{}", error.message());
    assert!(error.help_text().unwrap().starts_with("lower `speed`"));
}

#[test]
fn wrong_sectors_by_matrices_are_refused_at_their_place() {
    let study = "[study]\nkind = \"nodal-diameter\"\n";
    let refused = |disk: &str| {
        let error = by_matrices(disk, study).unwrap_err();
        format!("{} {}", error.message(), error.help_text().unwrap_or_default())
    };
    assert!(by_matrices("boundary = \"pairs.csv\"", study).is_ok());
    for (disk, words) in [
        ("", "needs `boundary`"),
        ("boundary = \"none.csv\"", "cannot be read"),
        ("boundary = \"wrong.csv\"", "expected the columns low,high, found `left,right`"),
        ("boundary = \"strange.csv\"", "rows of node `1`, but none of its partner `9`"),
        ("boundary = \"pairs.csv\"\naxis = \"z\"", "constrain both equally"),
        ("boundary = \"pairs.csv\"\nblade = \"pairs.csv\"", "expected the columns node"),
        ("boundary = \"pairs.csv\"\nblade = \"rim_blade.csv\"", "row `1.x` of the blade is on the boundary"),
        ("boundary = \"pairs.csv\"\nblade = \"no_blade.csv\"", "contains no node"),
        ("boundary = \"pairs.csv\"\nmistuning = { of = \"blade.stiffness\", deviation = 0.1 }", "add blade = "),
    ] {
        assert!(refused(disk).contains(words), "{disk}: {}", refused(disk));
    }
    let error = read("", "boundary = \"pairs.csv\"", STUDY).unwrap_err();
    assert!(
        error.message().contains("cannot be read") || error.message().contains("no [structure]"),
        "{}",
        error.message()
    );
}

/// A sector of six whose nodes move along x, y and z: a rim of two nodes on either side, and a
/// blade node between them.
fn in_space(disk: &str, more: &str) -> Result<Study, StudyError> {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let at =
        |radius: f64, degrees: f64| [radius * degrees.to_radians().cos(), radius * degrees.to_radians().sin(), 0.0];
    let nodes = [at(50.0, 10.0), at(80.0, 10.0), at(50.0, 70.0), at(80.0, 70.0), at(120.0, 40.0)];
    let (mut m, mut rows, mut stand) = (Vec::new(), "row,name\n".to_owned(), "node,x,y,z\n".to_owned());
    let mut stiffness = nalgebra::DMatrix::<f64>::identity(15, 15) * 1e4;
    for (node, [x, y, z]) in nodes.iter().enumerate() {
        stand += &format!("{},{x:.6},{y:.6},{z}\n", node + 1);
        for (axis, along) in ["x", "y", "z"].into_iter().enumerate() {
            let row = 3 * node + axis + 1;
            rows += &format!("{row},{}.{along}\n", node + 1);
            m.push(format!("{row} {row} 0.2"));
        }
    }
    // rods with a tenth of their stiffness across
    for (a, b, rod) in [(0, 1, 3e5), (2, 3, 3e5), (0, 2, 2e5), (1, 3, 2e5), (1, 4, 5e4), (3, 4, 4e4)] {
        let line: Vec<f64> = (0..3).map(|i| nodes[b][i] - nodes[a][i]).collect();
        let square: f64 = line.iter().map(|x| x * x).sum();
        for (i, j) in (0..9).map(|ij| (ij / 3, ij % 3)) {
            let value = rod * (line[i] * line[j] / square + if i == j { 0.1 } else { 0.0 });
            for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                stiffness[(3 * p + i, 3 * q + j)] += sign * value;
            }
        }
    }
    let below = (0..15).flat_map(|row| (0..=row).map(move |column| (row, column)));
    let k: Vec<String> = below.map(|at| format!("{} {} {:e}", at.0 + 1, at.1 + 1, stiffness[at])).collect();
    for (name, entries) in [("k.mtx", &k), ("m.mtx", &m)] {
        let head = format!("%%MatrixMarket matrix coordinate real symmetric\n15 15 {}\n", entries.len());
        write(name, &(head + &entries.join("\n") + "\n"));
    }
    write("rows.csv", &rows);
    write("nodes.csv", &stand);
    for (name, pairs) in [("right", "1,3\n2,4"), ("swapped", "3,1\n4,2"), ("crossed", "1,4\n2,3"), ("few", "1,3")] {
        write(&format!("{name}.csv"), &format!("low,high\n{pairs}\n"));
    }
    let text = format!(
        "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\ndofs = \"rows.csv\"\nunits = \"m-kg-s\"\n\
         modal_damping = 0.002\nreduce = {{ modes = 6 }}\n[disk]\n{disk}\n[[place]]\nname = \"tip\"\nnodes = [\"5\"]\n{more}"
    );
    write("disk.toml", &text);
    stickslip_study::read_file(&folder.path().join("disk.toml"), &[])
}

/// Coordinates determine the matching nodes of both sides, and verify the stated pairs.
#[test]
fn coordinates_detect_a_wrong_sector() {
    let study = "[study]\nkind = \"nodal-diameter\"\nmodes = 2\n";
    let frequencies = |disk: &str| {
        let data = run(&in_space(disk, study).unwrap(), &Context::without_progress(1)).unwrap();
        // the error of six modes relative to the full structure, in every row
        let errors = data.tables[0].numbers("reduction_error").unwrap();
        assert!(errors.iter().all(|error| *error == errors[0] && *error >= 0.0));
        data.tables[0].numbers("frequency_Hz").unwrap().to_vec()
    };
    let named = frequencies("sectors = 6\naxis = \"z\"\nboundary = \"right.csv\"");
    assert_eq!(frequencies("sectors = 6\naxis = \"z\"\nnodes = \"nodes.csv\"\nboundary = \"right.csv\""), named);
    assert_eq!(frequencies("sectors = 6\naxis = \"z\"\nnodes = \"nodes.csv\""), named);
    // the matrices alone do not reveal exchanged sides: the frequencies are wrong
    let exchanged = frequencies("sectors = 6\naxis = \"z\"\nboundary = \"swapped.csv\"");
    assert!(exchanged.iter().zip(&named).any(|(a, b)| (a / b - 1.0).abs() > 1e-3), "{exchanged:?} {named:?}");
    let refused = |disk: &str| {
        let error = in_space(&format!("nodes = \"nodes.csv\"\n{disk}"), study).unwrap_err();
        format!("{} {}", error, error.help_text().unwrap_or_default())
    };
    for (disk, words) in [
        ("sectors = 6\naxis = \"z\"\nboundary = \"swapped.csv\"", "the sides are exchanged"),
        ("sectors = 6\naxis = \"z\"\nboundary = \"crossed.csv\"", "away from node `4`"),
        ("sectors = 6\naxis = \"z\"\nboundary = \"few.csv\"", "no pair names them"),
        ("sectors = 7\naxis = \"z\"\nboundary = \"right.csv\"", "as in a disk with 6.00 sectors"),
        ("sectors = 7\naxis = \"z\"", "number of sectors"),
        ("sectors = 6\naxis = \"x\"\nboundary = \"right.csv\"", "they coincide for a rotation about z"),
        ("sectors = 6\nboundary = \"right.csv\"", "`nodes` needs `axis`"),
    ] {
        assert!(refused(disk).contains(words), "{disk}: {}", refused(disk));
    }
}

/// Returns the natural frequencies of a ring without its joints, Hz, and its shapes at all
/// places, with `φᵀMφ = 1`. They come from an eigenvalue solution of the full matrices, without
/// the cyclic symmetry.
fn dense_modes(model: &Model) -> (Vec<String>, Vec<(f64, Vec<f64>)>) {
    let system = model.assemble().unwrap();
    let full = system.structure().full();
    let inverse = full.mass.clone().cholesky().unwrap().l().try_inverse().unwrap();
    let eigen = (&inverse * &full.stiffness * inverse.transpose()).symmetric_eigen();
    let shapes = inverse.transpose() * eigen.eigenvectors;
    let mode = |i: usize| {
        (eigen.eigenvalues[i].abs().sqrt() / TAU, system.at_places(shapes.column(i).into_owned().as_slice()))
    };
    let mut modes: Vec<(f64, Vec<f64>)> = (0..system.dofs()).map(mode).collect();
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    (system.places().to_vec(), modes)
}

/// A sector whose nodes move along x, y, z: at every frequency, `Σ φφᵀ` at the places equals
/// that of the whole ring.
#[test]
fn shapes_of_a_sector_are_those_of_the_ring() {
    let more = "[[place]]\nname = \"rim\"\ndof = \"2.x\"\n[study]\nkind = \"nodal-diameter\"\nmodes = 3\n";
    let study = in_space("sectors = 6\naxis = \"z\"\nboundary = \"right.csv\"", more).unwrap();
    let data = run(&study, &Context::without_progress(1)).unwrap();
    let table = &data.tables[0];
    let (names, modes) = dense_modes(&study.case(0).unwrap().model);
    let (diameters, found) = (table.integers("nodal_diameter").unwrap(), table.numbers("frequency_Hz").unwrap());
    let joints = table.texts("joints").unwrap();
    let free: Vec<usize> = (0..table.rows()).filter(|row| joints[*row] == "free").collect();
    // a shape at all places, and the shape shifted by a quarter of a wave
    let waves = |row: usize| -> Vec<Vec<f64>> {
        let at = |name: &String, quarter: f64| {
            let (node, along) =
                name.split_once('.').map_or((name.as_str(), String::new()), |(n, a)| (n, format!("_{a}")));
            let (node, sector) = node.rsplit_once('_').unwrap();
            let column = |what: &str| table.numbers(&format!("{node}{along}_{what}")).unwrap()[row];
            let lead = 360.0 * diameters[row] as f64 * sector.parse::<f64>().unwrap() / 6.0;
            column("shape_per_sqrt_kg") * (column("phase_deg") + lead + quarter).to_radians().cos()
        };
        let travels = diameters[row] % 3 != 0;
        let quarters: &[f64] = if travels { &[0.0, 90.0] } else { &[0.0] };
        quarters.iter().map(|quarter| names.iter().map(|name| at(name, *quarter)).collect()).collect()
    };
    assert_eq!(free.len(), 12);
    for row in free.iter().copied() {
        let same = |hertz: f64| (hertz / found[row] - 1.0).abs() < 1e-6;
        let n = names.len();
        let mut sum = nalgebra::DMatrix::<f64>::zeros(n, n);
        let mut add = |shape: &[f64], sign: f64| {
            let shape = nalgebra::DVector::from_column_slice(shape);
            sum += &shape * shape.transpose() * sign;
        };
        modes.iter().filter(|(hertz, _)| same(*hertz)).for_each(|(_, shape)| add(shape, 1.0));
        let like = free.iter().filter(|other| same(found[**other]));
        like.flat_map(|other| waves(*other)).for_each(|shape| add(&shape, -1.0));
        assert!(sum.amax() < 1e-9, "row {row}: {}", sum.amax());
    }
    // the first mode of the nodal diameters 0 to 3
    let titles: Vec<&str> =
        data.figure.panels.iter().filter(|panel| panel.equal_axes).map(|panel| panel.title.as_str()).collect();
    assert_eq!(titles.len(), 4);
    assert!(titles[1].starts_with("mode 1, 1 nodal diameter, "), "{titles:?}");
}

/// The shapes that the figure of kind `nodal-diameter` shows, and those that it omits.
#[test]
fn drawn_mode_shapes() {
    let titles = |keys: &str| -> Vec<String> {
        let study = read("", "", &format!("[study]\nkind = \"nodal-diameter\"\nmodes = 2\n{keys}\n")).unwrap();
        let panels = run(&study, &Context::without_progress(1)).unwrap().figure.panels;
        panels.into_iter().filter(|panel| panel.equal_axes).map(|panel| panel.title).collect()
    };
    assert_eq!(titles("shapes = false").len(), 0);
    // ω² = (k + 2 kc (1 - cos θ))/m, θ = 120 degrees, with the joints' springs
    let stuck = titles("nodal_diameter = 2\njoints = \"stuck\"");
    let hertz = ((1e5 + 3.0 * 3e4) / 0.2f64).sqrt() / TAU;
    assert_eq!(stuck, [format!("mode 1, 2 nodal diameters, {hertz:.2} Hz, joints stuck")]);
    assert_eq!(titles("mode = 1").len(), 4);
    for (keys, words) in
        [("nodal_diameter = 4", "has no modes with 4 nodal diameters"), ("mode = 3", "not among the 2 lowest")]
    {
        let error = read("", "", &format!("[study]\nkind = \"nodal-diameter\"\nmodes = 2\n{keys}\n")).unwrap_err();
        assert!(error.message().contains(words), "{keys}: {}", error.message());
    }
}

/// At an amplitude with negligible friction, a mode of a mistuned ring is that of its full
/// matrices, blade by blade.
#[test]
fn a_mode_of_a_mistuned_ring_has_the_shape_of_every_blade() {
    let kind = "[study]\nkind = \"modes\"\nmode = 3\nharmonics = 1\nsamples = 64\namplitude = { from = \"10 mm\", to = \"10 m\", points = 2 }\n";
    let study = read("", "mistuning = { of = \"k\", deviation = \"5 %\", seed = 7 }", kind).unwrap();
    let data = run(&study, &Context::without_progress(1)).unwrap();
    let (names, modes) = dense_modes(&study.case(0).unwrap().model);
    let (hertz, shape) = &modes[2];
    let largest = shape.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap();
    let table = &data.tables[0];
    // friction is 1e-5 of the elastic forces, and 1e-3 of the differences between the modes
    assert!((table.numbers("frequency_Hz").unwrap()[1] / hertz - 1.0).abs() < 1e-5);
    for (name, x) in names.iter().zip(shape) {
        let column = |what: &str| table.numbers(&format!("{name}_{what}")).unwrap()[1];
        let found = column("amplitude_m") * column("phase_deg").to_radians().cos();
        assert!((found - 10.0 * x / largest).abs() < 1e-2, "{name}: {found} {}", 10.0 * x / largest);
    }
    let titles: Vec<&str> =
        data.figure.panels.iter().filter(|panel| panel.equal_axes).map(|panel| panel.title.as_str()).collect();
    assert!(titles.len() == 2 && titles[1].starts_with("mode 3 at 10 m, "), "{titles:?}");
}

/// The peaks of a node of a sector, over all its directions or one of them, in all sectors.
#[test]
fn peaks_are_those_of_a_node_in_all_sectors() {
    let peaks = |of: &str| {
        let more = format!(
            "[[force]]\non = \"tip.z\"\namplitude = \"1 N\"\nengine_order = 1\n[[force]]\non = \"tip.x\"\namplitude = \"2 N\"\nengine_order = 1\n\
             [study]\nkind = \"response\"\nfrequency = {{ from = \"60 Hz\", to = \"130 Hz\", points = 141 }}\npeak_of = \"{of}\"\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 1\ntolerance = 0.9\n"
        );
        let study = in_space("sectors = 6\naxis = \"z\"\nboundary = \"right.csv\"", &more).unwrap();
        let data = run(&study, &Context::without_progress(1)).unwrap();
        let peaks = data.tables.iter().find(|table| table.name == "peaks").unwrap();
        peaks.texts("mass").unwrap().to_vec()
    };
    assert!(peaks("tip").iter().all(|mass| mass.starts_with("tip_")), "{:?}", peaks("tip"));
    let along = peaks("tip.z");
    assert!(
        !along.is_empty() && along.iter().all(|mass| mass.starts_with("tip_") && mass.ends_with(".z")),
        "{along:?}"
    );
}

/// The amplification of a case is the ratio of the highest peaks with and without mistuning; it
/// is one without deviation. The figure of many disks shows the distribution.
#[test]
fn amplification_is_the_ratio_of_two_studies() {
    let text = |deviation: &str, more: &str| {
        format!(
            "schema = 1\nmodel = {{ template = \"bladed-disk\" }}\n[parameters]\nseed = 1\nFt = \"0 N\"\n[disk]\nsectors = 6\n\
             mistuning = {{ of = \"kb\", deviation = \"{deviation}\", seed = \"seed\" }}\n[study]\nkind = \"response\"\n\
             frequency = {{ from = \"90 Hz\", to = \"125 Hz\", points = 71 }}\npeak_of = \"blade\"\n{more}\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 1\ntolerance = 0.9\n"
        )
    };
    let result = |text: &str| run(&read_study("disk.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap();
    let column = |text: &str, table: &str, name: &str| {
        let found = result(text);
        let table = found.tables.iter().find(|found| found.name == table).unwrap();
        table.numbers(name).unwrap().to_vec()
    };
    let highest = |text: &str| column(text, "peaks", "amplitude_m").into_iter().fold(0.0f64, f64::max);
    let seeds = "amplification = true\nvary = { seed = { from = 1, to = 24, points = 24 } }";
    let ratios = column(&text("3 %", seeds), "amplification", "amplification");
    assert_eq!(ratios.len(), 24);
    for seed in [1, 9] {
        let one = text("3 %", &format!("vary = {{ seed = [{seed}] }}"));
        let expected = highest(&one) / highest(&text("0 %", ""));
        let found = ratios[seed - 1];
        assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    }
    let tuned = column(&text("0 %", "amplification = true"), "amplification", "amplification");
    assert!((tuned[0] - 1.0).abs() < 1e-9, "{tuned:?}");
    let warned = |text: &str| {
        let study = read_study("disk.toml", text, &[]).unwrap();
        stickslip_study::run::check(&study).unwrap().summary().warnings.join("; ").contains("all blades are equal")
    };
    assert!(warned(&text("0 %", "amplification = true")) && !warned(&text("3 %", seeds)));
    // Whitehead's bound for six blades in the linear limit
    assert!(ratios.iter().all(|ratio| *ratio < 0.5 * (1.0 + 6f64.sqrt())), "{ratios:?}");
    let found = result(&text("3 %", seeds));
    let panel = found.figure.panels.last().unwrap();
    assert_eq!(panel.series[0].label, "24 disks");
    assert!(panel.title.contains("99.9 % below"), "{}", panel.title);
    // the figure of one case shows the disk's shape
    let one = result(&text("3 %", ""));
    assert!(one.figure.panels.iter().any(|panel| panel.equal_axes), "{:?}", one.figure.panels.len());
}

#[test]
fn an_amplification_needs_a_disk_and_peaks() {
    let error = |text: String| read_study("disk.toml", &text, &[]).unwrap_err().to_string();
    let study = "kind = \"response\"\nfrequency = [\"1 Hz\", \"2 Hz\", \"3 Hz\"]\namplification = true\n";
    let couple = error(format!("schema = 1\nmodel = {{ template = \"blade-couple\" }}\n[study]\n{study}"));
    assert!(couple.contains("only a bladed disk"), "{couple}");
    let disk = error(format!("schema = 1\nmodel = {{ template = \"bladed-disk\" }}\n[study]\n{study}peaks = false"));
    assert!(disk.contains("`peaks` is false"), "{disk}");
}
