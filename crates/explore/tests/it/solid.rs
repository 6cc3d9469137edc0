//! Structures with a mesh: their surface and its motion.

use serde_json::Value;
use std::path::{Path, PathBuf};
use stickslip_explore::answer::{Tables, answer};
use stickslip_study::read_file;
use stickslip_study::run::{Context, run};

/// Writes a bar of two bricks along x with a mass and a spring to the ground in each row, and a
/// response with friction at its node 12; returns its study file.
pub fn bar(folder: &Path) -> PathBuf {
    let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
    let nodes: Vec<[usize; 3]> = (0..3).flat_map(|x| corners.map(|[y, z]| [x, y, z])).collect();
    let mut deck = String::from("*NODE\n");
    nodes.iter().enumerate().for_each(|(i, [x, y, z])| deck += &format!("{},{x},{y},{z}\n", i + 1));
    deck += "*ELEMENT,TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n2,5,6,7,8,9,10,11,12\n*NSET,NSET=TOP\n3,4,7,8\n";
    let diagonal = |value: &str| (1..=3 * nodes.len()).map(|row| format!("{row} {row} {value}\n")).collect::<String>();
    let names = (1..=nodes.len()).flat_map(|node| (1..=3).map(move |axis| format!("{node}.{axis}\n"))).collect();
    let files = [("sti", diagonal("100")), ("mas", diagonal("1e-3")), ("dof", names), ("inp", deck)];
    files.iter().for_each(|(end, text)| std::fs::write(folder.join(format!("bar.{end}")), text).unwrap());
    let text = "schema = 1\n[parameters]\nFt = \"1 N\"\n[structure]\nstiffness = \"bar.sti\"\nmass = \"bar.mas\"\n\
        dofs = \"bar.dof\"\nunits = \"mm-t-s\"\nmesh = \"bar.inp\"\nrayleigh = { stiffness = \"1e-4 s\" }\nreduce = false\n\
        [[place]]\nname = \"tip\"\ndof = \"12.z\"\n[[joint]]\nname = \"pad\"\nbetween = [\"tip\", \"ground\"]\n\
        law = { kind = \"jenkins\", stiffness = \"50 N/mm\", limit = \"Ft\" }\n\
        [[contact]]\nname = \"top\"\nbetween = [\"TOP\", \"ground\"]\n\
        law = { kind = \"friction-contact\", tangential = \"20 N/mm^3\", normal = \"30 N/mm^3\", friction = 0.3, preload = \"2 MPa\" }\n\
        [[force]]\non = \"tip\"\namplitude = \"3 N\"\n[study]\nkind = \"response\"\n\
        frequency = { from = \"30 Hz\", to = \"70 Hz\", points = 21 }\n";
    let file = folder.join("bar.toml");
    std::fs::write(&file, text).unwrap();
    file
}

/// Decodes base 64 (RFC 4648).
fn bytes(text: &Value) -> Vec<u8> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => byte - b'A',
        b'a'..=b'z' => byte - b'a' + 26,
        b'0'..=b'9' => byte - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let text = text.as_str().unwrap().trim_end_matches('=').as_bytes();
    let bits =
        |part: &[u8]| part.iter().fold(0u32, |all, byte| all << 6 | u32::from(digit(*byte))) << (6 * (4 - part.len()));
    text.chunks(4).flat_map(|part| bits(part).to_be_bytes()[1..part.len()].to_vec()).collect()
}

fn floats(text: &Value) -> Vec<f32> {
    bytes(text).chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect()
}

#[test]
fn a_surface_moves_like_its_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let file = bar(folder.path());
    let text = std::fs::read_to_string(&file).unwrap();
    let (model, _) = text.split_once("[study]").unwrap();
    std::fs::write(&file, format!("{model}[study]\nkind = \"orbit\"\nfrequency = \"50 Hz\"\nfields = 8\n")).unwrap();
    let study = read_file(&file, &[]).unwrap();
    let dataset = run(&study, &Context::without_progress(1)).unwrap();
    let answered = answer(&study, &dataset, Tables::Motion, None);
    assert!(answered["tables"]["fields"].is_null() && answered["tables"]["orbit"].is_array());
    let found = &answered["solid"];
    let (positions, moved, contact) =
        (floats(&found["positions"]), floats(&found["displacements"]), bytes(&found["contact"]));
    // ten outer faces of four corners; the side between both bricks is inside
    assert_eq!((found["instants"].as_u64(), bytes(&found["triangles"]).len()), (Some(8), 4 * 3 * 2 * 10));
    assert_eq!((positions.len(), moved.len(), contact.len()), (36, 8 * 36, 8 * 12));
    let at = |place: [f32; 3]| (0..12).find(|i| positions[3 * i..3 * i + 3] == place).unwrap();
    let tip = at([2e-3, 0.0, 1e-3]);
    let orbit = dataset.tables.iter().find(|table| table.name == "orbit").unwrap();
    let (expected, time) = (orbit.numbers("tip_displacement_m").unwrap(), orbit.numbers("time_s").unwrap());
    let largest = expected.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    for instant in 0..8 {
        let shown = f64::from(moved[36 * instant + 3 * tip + 2]);
        let when = instant as f64 / 8.0 / 50.0;
        let exact = (0..time.len()).min_by(|a, b| (time[*a] - when).abs().total_cmp(&(time[*b] - when).abs()));
        let exact = expected[exact.unwrap()];
        assert!((shown - exact).abs() < 1e-2 * largest, "{instant}: {shown} {exact}");
    }
    // the four nodes of the contact and that of the joint have a state, the others have none
    let touching = [[0.0, 1e-3, 1e-3], [0.0, 0.0, 1e-3], [1e-3, 1e-3, 1e-3], [1e-3, 0.0, 1e-3]].map(at);
    for (node, state) in contact[..12].iter().enumerate() {
        assert_eq!(*state > 0, touching.contains(&node) || node == tip, "{node}: {state}");
    }
}
