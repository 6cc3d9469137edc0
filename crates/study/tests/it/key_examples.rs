//! The example of every key of the reference passes the reader and the checks. It replaces the
//! value of the key in a study that has the names, files and tables of the example.

use std::fmt::Write;
use std::path::Path;
use stickslip_study::schema::{FILE, Key, METHOD, Presence, SAMPLE, STUDY, ValueType};
use stickslip_study::{kinds, read_file, run};
use toml::{Table, Value};

/// A couple of blades, with the names that examples use.
const COUPLE: &str = r#"
schema = 1
parameters = { Ft = "2 N", k = "105103 N/m", speed = "100 Hz" }
mass = [{ name = "contact", mass = "2 g" }, { name = "blade3", mass = "180 g" }, { name = "blade1", mass = "180 g" }]
spring = [
    { between = ["blade1", "ground"], stiffness = "k", damping = "0.2 kg/s" },
    { between = ["blade3", "ground"], stiffness = "k", damping = "0.2 kg/s" },
    { between = ["contact", "blade3"], stiffness = "1e4 N/m" },
    { between = ["blade3", "mover"], stiffness = "1e3 N/m" },
]
motion = [{ on = "mover", amplitude = "1 mm" }]
joint = [{ name = "shroud", between = ["blade1", "contact"], law = { kind = "coulomb", limit = "Ft" } }]
force = [{ on = "blade1", amplitude = "10 N" }]
data = [{ name = "sweep", file = "sweep.csv" }]
study = { kind = "response", frequency = "121 Hz" }
"#;

/// A mass under a force and on a place that follow records.
const RECORDS: &str = r#"
schema = 1
data = [{ name = "record", file = "record.csv" }]
mass = [{ name = "blade1", mass = "180 g" }]
spring = [{ between = ["blade1", "ground"], stiffness = "1e5 N/m" }, { between = ["blade1", "mover"], stiffness = "1e3 N/m" }]
force = [{ on = "blade1", data = "record" }]
motion = [{ on = "mover", data = "record" }]
study = { kind = "transient", duration = "1 s", time_step = "0.1 s" }
"#;

/// A mass under signals.
const SHOCK: &str = r#"
schema = 1
mass = [{ name = "blade1", mass = "180 g" }]
spring = [{ between = ["blade1", "ground"], stiffness = "1e5 N/m" }]
force = [{ on = "blade1", signal = { kind = "half-sine", amplitude = "5 N", duration = "1 s" } }]
motion = [{ on = "ground", signal = { kind = "half-sine", amplitude = "5 m/s^2", duration = "1 s" } }]
study = { kind = "transient", duration = "1 s", time_step = "0.1 s" }
"#;

/// A mass with directions on a ground that moves.
const QUAKE: &str = r#"
schema = 1
data = [{ name = "record", file = "record.csv" }]
mass = [{ name = "deck", mass = "1 kg", directions = ["x", "z"] }]
spring = [{ between = ["deck.x", "ground"], stiffness = "1e5 N/m" }, { between = ["deck.z", "ground"], stiffness = "1e5 N/m" }]
motion = [{ on = "ground", data = "record", along = "z", column = "force_N" }]
study = { kind = "transient", duration = "1 s", time_step = "0.1 s" }
"#;

/// A mass that moves in a plane, with a rotated face.
const FACE: &str = r#"
schema = 1
mass = [{ name = "damper", mass = "10 g", directions = ["x", "z"] }]
place = [{ name = "face", of = "damper", normal = [0.6, 0, 0.8] }]
spring = [
    { between = ["damper.x", "ground"], stiffness = "1e5 N/m", damping = "1 kg/s" },
    { between = ["damper.z", "ground"], stiffness = "1e5 N/m", damping = "1 kg/s" },
]
force = [{ on = "face.n", amplitude = "1 N" }]
study = { kind = "response", frequency = "121 Hz" }
"#;

/// A rigid body in a plane with a point on a spring, and a block.
const BODY: &str = r#"
schema = 1
mass = [{ name = "block", mass = "1 kg" }]
body = [{ name = "damper", mass = "10 g", inertia = "200 g mm^2", directions = ["x", "z"] }]
place = [{ name = "corner", of = "damper", offset = ["2 mm", 0, 0] }]
spring = [
    { between = ["block", "ground"], stiffness = "1e5 N/m", damping = "1 kg/s" },
    { between = ["damper.x", "ground"], stiffness = "1e5 N/m", damping = "1 kg/s" },
    { between = ["damper.z", "ground"], stiffness = "1e5 N/m", damping = "1 kg/s" },
    { between = ["corner.z", "ground"], stiffness = "1e5 N/m", damping = "1 kg/s" },
]
force = [{ on = "block", amplitude = "1 N" }]
study = { kind = "response", frequency = "121 Hz" }
"#;

/// A ring of blades.
const RING: &str = r#"
schema = 1
parameters = { k = "105103 N/m", speed = "100 Hz" }
mass = [{ name = "blade1", mass = "180 g" }, { name = "loose", mass = "1 g" }]
spring = [
    { between = ["blade1", "ground"], stiffness = "k", damping = "0.2 kg/s" },
    { between = ["blade1", "next.blade1"], stiffness = "1e4 N/m" },
    { between = ["blade1", "mover"], stiffness = "1e3 N/m" },
]
motion = [{ on = "mover", amplitude = "1 mm", engine_order = 2 }]
disk = { sectors = 24 }
force = [{ on = "blade1", amplitude = "1 N", engine_order = 2 }]
study = { kind = "response", frequency = "121 Hz" }
"#;

/// Three nodes given by matrices.
const MATRICES: &str = r#"
schema = 1
parameters = { a = "30 deg", speed = "100 Hz" }
structure = { stiffness = "blade.sti", mass = "blade.mas", dofs = "blade.dof", units = "mm-t-s" }
place = [{ name = "tip", dof = "1353.y" }]
study = { kind = "response", frequency = "121 Hz" }
method = { kind = "harmonic-balance" }
"#;

/// These matrices with their mesh, and a contact on it.
const MESH: &str = r#"
schema = 1
parameters = { load = 2 }
data = [{ name = "static", file = "static.csv" }]
structure = { stiffness = "blade.sti", mass = "blade.mas", dofs = "blade.dof", units = "mm-t-s", mesh = "blade.inp" }
place = [{ name = "tip", dof = "1353.y" }]
contact = [{ name = "pad", between = ["PADS", "ground"], law = { kind = "friction-contact", tangential = "20 N/mm^3", normal = "30 N/mm^3", friction = 0.3 } }]
study = { kind = "response", frequency = "121 Hz" }
method = { kind = "harmonic-balance" }
"#;

/// These matrices as a sector of a disk.
const SECTOR: &str = r#"
schema = 1
structure = { stiffness = "blade.sti", mass = "blade.mas", dofs = "blade.dof", units = "mm-t-s" }
place = [{ name = "tip", dof = "1353.y" }]
disk = { sectors = 24, boundary = "sector_boundary.csv", nodes = "sector.inp", axis = "z" }
force = [{ on = "tip", amplitude = "1 N", engine_order = 2 }]
study = { kind = "response", frequency = "121 Hz" }
method = { kind = "harmonic-balance" }
"#;

/// Returns a study with the names of a key's example, with the lines to change and the keys to
/// leave out.
fn host(table: &str, key: &str) -> (&'static str, &'static str, &'static [&'static str]) {
    match (table, key) {
        ("", "model") => (COUPLE, "", &["mass", "spring", "joint", "force", "motion"]),
        ("model", _) => (COUPLE, "", &["/mass", "/spring", "/joint", "/force", "/motion"]),
        ("", "parameters") => (COUPLE, "spring = []", &[]),
        ("", "structure") => (MATRICES, "", &[]),
        ("", "disk") => (RING, "", &[]),
        ("structure.stiffened", "name" | "format") => (MATRICES, "file = \"blade.mat\"", &[]),
        ("structure.reduce", "modes") => (MATRICES, "", &["up_to"]),
        ("structure", "stress_rows") => (MATRICES, "stress = \"blade_stress.mtx\"", &[]),
        ("structure.reduce", "orders") => (MATRICES, "modes = 5", &["up_to"]),
        ("place", "of") => (FACE, "", &[]),
        ("place", "offset") => (BODY, "", &[]),
        ("body", "repeat") => (BODY, "name = \"damper{i}\"", &["/place", "/spring"]),
        ("body", _) => (BODY, "", &[]),
        ("place", "dofs" | "nodes" | "sum") => (MATRICES, "", &["dof"]),
        ("place", "set") => (MESH, "", &["dof"]),
        ("contact" | "contact.preload", _) => (MESH, "", &[]),
        ("place", "directions" | "normal") => (MATRICES, "nodes = [\"188\"]", &["dof"]),
        ("place", "tangent") => (MATRICES, "nodes = [\"188\"]\nnormal = [0, 0, 1]", &["dof"]),
        ("place", "repeat") => (MATRICES, "name = \"tip{i}\"", &[]),
        ("mass", "directions") => (FACE, "", &[]),
        ("mass", "repeat") => (RING, "name = \"loose{i}\"", &[]),
        ("joint", "repeat") => (COUPLE, "name = \"shroud{i}\"", &[]),
        ("disk", "boundary" | "nodes" | "axis") => (SECTOR, "", &[]),
        ("disk", "blade") => (SECTOR, "mistuning = { of = \"blade.stiffness\", deviation = \"1 %\" }", &[]),
        ("disk.mistuning", "file") => (RING, "", &["deviation", "seed"]),
        ("force" | "motion", "signal") | ("force.signal" | "motion.signal", _) => (SHOCK, "", &[]),
        ("force", "data" | "column") => (RECORDS, "", &[]),
        ("motion", "data") => (RECORDS, "", &[]),
        ("motion", "column") => (RECORDS, "", &["/force"]),
        ("motion", "along") => (QUAKE, "column = \"a\"", &[]),
        ("force" | "motion", "nodal_diameter" | "sector") => (RING, "", &["engine_order"]),
        ("disk" | "disk.mistuning", _) | ("force" | "motion", "engine_order") => (RING, "", &[]),
        _ if table.starts_with("structure") || table == "place" => (MATRICES, "", &[]),
        _ => (COUPLE, "", &[]),
    }
}

/// Writes the files that examples name: three nodes with springs along x, y and z between each
/// other and to the ground.
fn write_files(folder: &Path) {
    let write = |name: &str, text: &[u8]| std::fs::write(folder.join(name), text).unwrap();
    let nodes = [188, 189, 1353];
    let entries = |spring: f64| {
        let own = [3.0, 2.0, 2.5];
        let all = (0..9).flat_map(move |i| (i..9).map(move |k| (i, k)));
        // the blade is the last node and is connected to the first one only
        all.filter(|(i, k)| i % 3 == k % 3 && (i / 3, k / 3) != (1, 2))
            .map(move |(i, k)| (i, k, if i == k { own[i / 3] * spring } else { -spring / 3.0 }))
    };
    let lines = |entries: &mut dyn Iterator<Item = (usize, usize, f64)>| {
        entries.fold(String::new(), |mut text, (i, k, value)| {
            let _ = writeln!(text, "{} {} {value:e}", i + 1, k + 1);
            text
        })
    };
    write("sweep.csv", b"frequency_Hz,F,response\n118,1,2e-3\n119,1,3e-3\n121,1,1e-3\n");
    write("record.csv", b"time_s,force_N,displacement_m,a\n0,0,0,0\n1,1,1e-3,2\n");
    write("static.csv", b"node,force_N\n188,700\n189,700\n1353,600\n");
    write("blade.sti", lines(&mut entries(1e3)).as_bytes());
    write("blade_6000.sti", lines(&mut entries(1.1e3)).as_bytes());
    write("blade.mas", lines(&mut (0..9).map(|i| (i, i, 1e-6))).as_bytes());
    write("blade.dam", lines(&mut (0..9).map(|i| (i, i, 1e-3))).as_bytes());
    let names: Vec<String> =
        nodes.iter().flat_map(|node| (1..=3).map(move |along| format!("{node}.{along}\n"))).collect();
    write("blade.dof", names.concat().as_bytes());
    let mut full = vec![0.0; 81];
    entries(1.1e3).for_each(|(i, k, value)| (full[9 * i + k], full[9 * k + i]) = (value, value));
    write("blade.mat", &matlab("K", 9, &full));
    write("blade_stress.mtx", b"%%MatrixMarket matrix coordinate real general\n1 9 1\n1 9 2e5\n");
    write("stress_rows.csv", b"row,name\n1,root\n");
    write("sector_boundary.csv", b"low,high\n188,189\n");
    write("blade_nodes.csv", b"node\n1353\n");
    let at = |degrees: f64, radius: f64| {
        format!("{}, {}, 0", radius * degrees.to_radians().cos(), radius * degrees.to_radians().sin())
    };
    let text = format!("*NODE\n188, {}\n189, {}\n1353, {}\n", at(0.0, 100.0), at(15.0, 100.0), at(7.0, 200.0));
    write("sector.inp", text.as_bytes());
    let text = "*NODE\n188, 0, 0, 0\n189, 1, 0, 0\n1353, 0, 1, 0\n*ELEMENT, TYPE=S3\n1, 188, 189, 1353\n*NSET, NSET=PADS\n188, 189, 1353\n";
    write("blade.inp", text.as_bytes());
    let pattern: String = (0..24).map(|sector| format!("{sector},0.0{sector:02}\n")).collect();
    write("pattern.csv", format!("sector,deviation\n{pattern}").as_bytes());
}

/// Encodes a square matrix of doubles as a MATLAB level 5 file: "MAT-File Format", MathWorks,
/// 2024.
fn matlab(name: &str, n: u32, values: &[f64]) -> Vec<u8> {
    let element = |kind: u32, data: &[u8]| {
        let size = u32::try_from(data.len()).unwrap();
        let mut out = [kind.to_le_bytes(), size.to_le_bytes()].concat();
        out.extend(data);
        out.resize(out.len().next_multiple_of(8), 0);
        out
    };
    // miUINT32: the class of doubles; miINT32: the size; miINT8: the name; miDOUBLE
    let parts = [
        element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
        element(5, &[n.to_le_bytes(), n.to_le_bytes()].concat()),
        element(1, name.as_bytes()),
        element(9, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>()),
    ];
    let mut out = b"MATLAB 5.0 MAT-file".to_vec();
    out.resize(124, b' ');
    out.extend([0, 1, b'I', b'M']);
    out.extend(element(14, &parts.concat()));
    out
}

fn parsed(text: &str) -> Table {
    toml::from_str(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// Returns the table of that name in a study; its last entry if it is a list.
fn inside<'a>(study: &'a mut Table, table: &str) -> &'a mut Table {
    table.split('.').filter(|part| !part.is_empty()).fold(study, |at, part| {
        let next = at.get_mut(part).unwrap_or_else(|| panic!("no {part}"));
        match next {
            Value::Array(list) => list.last_mut().and_then(Value::as_table_mut).unwrap(),
            other => other.as_table_mut().unwrap_or_else(|| panic!("{part} is no table")),
        }
    })
}

/// Builds a study with the example of a key and those of the tables that contain it.
fn study_with(table: &str, key: &Key, outer: &[(String, &Key)], kind: Option<&'static kinds::Kind>) -> Table {
    let (text, beside, without) = host(table, key.name);
    let mut study = parsed(text);
    if let Some(kind) = kind {
        let beside = outer.last().map_or(key, |(_, table)| table);
        study.insert("study".into(), Value::Table(of_kind(kind, beside)));
        if kind.info.name == "nodal-diameter" || key.name == "amplification" {
            let own = study.remove("study").unwrap();
            study = parsed(RING);
            study.insert("study".into(), own);
        }
        if key.name == "fields" {
            let own = study.remove("study").unwrap();
            study = parsed(if kind.info.name == "nodal-diameter" { SECTOR } else { MATRICES });
            study.insert("study".into(), own);
        }
    }
    for (of, key) in outer {
        let parent = inside(&mut study, of);
        if !parent.contains_key(key.name) {
            let (name, value) = parsed(&format!("{} = {}", key.name, key.example)).into_iter().next().unwrap();
            parent.insert(name, value);
        }
    }
    for name in without {
        match name.strip_prefix('/') {
            Some(name) => study.remove(name),
            None => inside(&mut study, table).remove(*name),
        };
    }
    let own = inside(&mut study, table);
    own.extend(parsed(beside));
    own.extend(parsed(&format!("{} = {}", key.name, key.example)));
    study
}

/// Pairs of keys of which one replaces the other.
const INSTEAD: [(&str, &str); 3] =
    [("frequency", "run_up"), ("duration", "cycles"), ("samples_per_cycle", "time_step")];

/// Builds a study of a kind with its required keys, in addition to a key.
fn of_kind(kind: &kinds::Kind, beside: &Key) -> Table {
    let mut study = parsed(&format!("kind = \"{}\"", kind.info.name));
    for key in kind.info.keys.iter().filter(|key| key.presence == Presence::Required) {
        study.extend(parsed(&format!("{} = {}", key.name, key.example)));
    }
    study.extend(parsed(match (kind.info.name, beside.name) {
        (
            "transient",
            "frequency" | "duration" | "samples_per_cycle" | "time_step" | "start" | "start_velocity" | "begin"
            | "also",
        ) => "frequency = \"121 Hz\"\nduration = \"2 s\"",
        ("transient", "cycles") => "frequency = \"121 Hz\"",
        _ => "",
    }));
    for (a, b) in INSTEAD {
        let other = if beside.name == a {
            b
        } else if beside.name == b {
            a
        } else {
            continue;
        };
        study.remove(other);
    }
    study
}

/// Visits every key of a table and of its subtables.
fn walk(
    (table, keys): (&str, &'static [Key]),
    outer: &[(String, &'static Key)],
    kind: Option<&'static kinds::Kind>,
    tried: &mut dyn FnMut(&str, &Key, Table),
) {
    for key in keys.iter().filter(|key| key.is_supported()) {
        if key.example != "[]" {
            tried(table, key, study_with(table, key, outer, kind));
        }
        let inner = match key.takes {
            ValueType::Table(keys) | ValueType::TableOrFalse(keys) | ValueType::List(keys) => keys,
            ValueType::Sample => SAMPLE,
            ValueType::Method => METHOD,
            _ => continue,
        };
        let name = if table.is_empty() { key.name.to_owned() } else { format!("{table}.{}", key.name) };
        let mut around = outer.to_vec();
        if key.example != "[]" {
            around.push((table.to_owned(), key));
        }
        walk((&name, inner), &around, kind, tried);
    }
}

#[test]
fn the_example_of_every_key_is_read_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let (mut count, mut wrong) = (0, String::new());
    let mut tried = |table: &str, key: &Key, study: Table| {
        count += 1;
        let path = folder.path().join("study.toml");
        let text = toml::to_string(&study).unwrap();
        std::fs::write(&path, &text).unwrap();
        if let Err(error) = read_file(&path, &[]).and_then(|study| run::check(&study)) {
            let _ =
                writeln!(wrong, "[{table}] {} = {}: {error} ({:?})\n{text}", key.name, key.example, error.help_text());
        }
    };
    walk(("", FILE), &[], None, &mut tried);
    walk(("study", STUDY), &[], None, &mut tried);
    for kind in kinds::TABLE {
        walk(("study", kind.info.keys), &[], Some(kind), &mut tried);
    }
    // the long form of a file
    let text = MATRICES.replace("\"blade.sti\"", "{ file = \"blade.mat\", name = \"K\", format = \"matlab\" }");
    tried("structure", &FILE[0], parsed(&text));
    assert!(wrong.is_empty(), "{wrong}");
    assert!(count > 120, "only {count} examples");
}
