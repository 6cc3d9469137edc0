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

/// Writes a twisted blade of 6 by 1 by 20 bricks and a response with a damper pad on one side;
/// returns its study file. A spring joins every two corners of a brick.
pub fn blade(folder: &Path) -> PathBuf {
    const COUNTS: [usize; 3] = [6, 1, 20];
    let number = |[i, j, k]: [usize; 3]| i + (COUNTS[0] + 1) * (j + (COUNTS[1] + 1) * k);
    let grid = |last: [usize; 3]| {
        (0..=last[2])
            .flat_map(move |k| (0..=last[1]).flat_map(move |j| (0..=last[0]).map(move |i| [i, j, k])))
            .collect::<Vec<_>>()
    };
    let place = |[i, j, k]: [usize; 3]| {
        let (along, up) = (i as f64 / COUNTS[0] as f64 - 0.5, k as f64 / COUNTS[2] as f64);
        let camber = 5.0 * (0.25 - along * along);
        let y = (j as f64 - 0.5) * (6.0 - 3.0 * up) * (1.0 - 1.6 * along * along) + camber;
        let (x, (sin, cos)) = (32.0 * (1.0 - 0.25 * up) * along, (0.6 * up).sin_cos());
        [x * cos - y * sin, x * sin + y * cos, 100.0 * up]
    };
    let nodes = grid(COUNTS);
    let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
    let bricks: Vec<[[usize; 3]; 8]> = grid(COUNTS.map(|count| count - 1))
        .into_iter()
        .map(|first| corners.map(|corner| [0, 1, 2].map(|axis| first[axis] + corner[axis])))
        .collect();
    let mut stiffness = vec![vec![0.0; 3 * nodes.len()]; 3 * nodes.len()];
    let mut mass = vec![0.0; 3 * nodes.len()];
    for brick in &bricks {
        for (index, a) in brick.iter().enumerate() {
            (0..3).for_each(|axis| mass[3 * number(*a) + axis] += 1.2e-7);
            for b in &brick[index + 1..] {
                let [from, to] = [place(*a), place(*b)];
                let between = [0, 1, 2].map(|axis| to[axis] - from[axis]);
                let length = between.iter().map(|part| part * part).sum::<f64>().sqrt();
                for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    let value = 4e4 * between[r] * between[c] / length.powi(3);
                    for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                        stiffness[3 * number(*p) + r][3 * number(*q) + c] += sign * value;
                    }
                }
            }
        }
    }
    nodes.iter().filter(|node| node[2] == 0).for_each(|root| {
        (0..3).for_each(|axis| stiffness[3 * number(*root) + axis][3 * number(*root) + axis] += 1e6);
    });
    let (mut sti, mut mas, mut dof, mut deck) = (String::new(), String::new(), String::new(), String::from("*NODE\n"));
    for (r, row) in stiffness.iter().enumerate() {
        let entries = row.iter().enumerate().filter(|(_, value)| **value != 0.0);
        entries.for_each(|(c, value)| sti += &format!("{} {} {value:?}\n", r + 1, c + 1));
        mas += &format!("{0} {0} {1:?}\n", r + 1, mass[r]);
        dof += &format!("{}.{}\n", r / 3 + 1, r % 3 + 1);
    }
    for node in &nodes {
        let [x, y, z] = place(*node);
        deck += &format!("{},{x},{y},{z}\n", number(*node) + 1);
    }
    deck += "*ELEMENT,TYPE=C3D8\n";
    for (index, brick) in bricks.iter().enumerate() {
        let list = brick.map(|corner| (number(corner) + 1).to_string()).join(",");
        deck += &format!("{},{list}\n", index + 1);
    }
    let pad = nodes.iter().filter(|[i, j, k]| (2..5).contains(i) && *j == 0 && (5..8).contains(k));
    let pad: Vec<String> = pad.map(|node| (number(*node) + 1).to_string()).collect();
    deck += &format!("*NSET,NSET=PAD\n{}\n", pad.join(","));
    let files = [("sti", sti), ("mas", mas), ("dof", dof), ("inp", deck)];
    files.iter().for_each(|(end, text)| std::fs::write(folder.join(format!("blade.{end}")), text).unwrap());
    let text = format!(
        "schema = 1\ntitle = \"A blade with a damper pad\"\n[parameters]\np = \"4 MPa\"     # pressure of the damper\n\
        F0 = \"8 N\"      # amplitude of the force at the tip\n\
        [structure]\nstiffness = \"blade.sti\"\nmass = \"blade.mas\"\ndofs = \"blade.dof\"\nunits = \"mm-t-s\"\nmesh = \"blade.inp\"\n\
        modal_damping = 0.01\n[[place]]\nname = \"tip\"\ndof = \"{}.y\"\n[[contact]]\nname = \"pad\"\nbetween = [\"PAD\", \"ground\"]\n\
        law = {{ kind = \"friction-contact\", tangential = \"60 N/mm^3\", normal = \"80 N/mm^3\", friction = 0.4, preload = \"p\" }}\n\
        [[force]]\non = \"tip\"\namplitude = \"F0\"\n[study]\nkind = \"response\"\n\
        frequency = {{ from = \"150 Hz\", to = \"210 Hz\", points = 5 }}\npeaks = false\n[method]\nkind = \"harmonic-balance\"\nharmonics = 7\ntolerance = 0.05\n",
        number([3, 1, COUNTS[2]]) + 1
    );
    let file = folder.join("blade.toml");
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
