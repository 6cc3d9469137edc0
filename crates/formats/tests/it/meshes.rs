//! Meshes of other programs, read as the same solid; and damaged ones.

use crate::fuzz::{Random, damaged, number_of_variable, peak_memory};
use std::path::{Path, PathBuf};
use stickslip_formats::mesh::{self, Face, Mesh, MeshReport, TABLE};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes")
}

/// Returns the names of all meshes.
fn names() -> Vec<String> {
    let entries = std::fs::read_dir(folder()).expect("the folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| !name.ends_with(".py")).collect();
    names.sort();
    names
}

/// Returns the volume that faces enclose, by the divergence theorem.
fn volume(faces: &[Face]) -> f64 {
    let flow = |face: &Face| -> f64 {
        let along = |normal: &[f64; 3]| -> f64 { face.center().iter().zip(normal).map(|(a, b)| a * b).sum() };
        face.shares().iter().map(|share| share.area * along(&share.normal)).sum()
    };
    faces.iter().map(flow).sum::<f64>() / 3.0
}

/// The middle nodes of straight edges lie halfway between their corners.
fn check_middle_nodes(mesh: &Mesh) {
    for face in mesh.outer_faces().iter().filter(|face| face.nodes.len() > 4) {
        let corners = face.nodes.len() / 2;
        let at = |i: usize| mesh.nodes()[face.nodes[i]].position;
        for i in 0..corners {
            let (a, b, middle) = (at(i), at((i + 1) % corners), at(corners + i));
            assert!((0..3).all(|axis| (0.5 * (a[axis] + b[axis]) - middle[axis]).abs() < 1e-9), "{face:?}");
        }
    }
}

/// A brick and two wedges of 2 m³ with a tetrahedron of 1/6 m³, or three bricks of 1 m³. The sides
/// of the tetrahedron: half of |a × b| for its three upper faces.
#[test]
fn every_program_writes_the_same_solid() {
    let tip = 0.5 * (1.25f64.sqrt() + 1.25f64.sqrt() + (1.0f64 + 1.0 + 0.0).sqrt());
    let mut formats = Vec::new();
    for name in names() {
        let mesh = mesh::read(folder().join(&name)).unwrap_or_else(|error| panic!("{error}"));
        let (faces, gmsh) = (mesh.outer_faces(), mesh.format() == "gmsh");
        let (volume_of, area, foot) = match gmsh {
            true => (3.0, 18.0, 3.0),
            false => (2.0 + 1.0 / 6.0, 10.0 - 0.5 + tip, 2.0),
        };
        check_middle_nodes(&mesh);
        assert!((volume(&faces) - volume_of).abs() < 1e-9, "{name}: {}", volume(&faces));
        let found: f64 = faces.iter().map(Face::area).sum();
        assert!((found - area).abs() < 1e-9, "{name}: {found} {area}");
        let quadratic = name.starts_with("quadratic");
        assert!(mesh.elements().iter().all(|element| element.shape.quadratic == quadratic), "{name}");
        if let Ok(patch) = mesh.patch("FOOT") {
            assert!((patch.area() - foot).abs() < 1e-9, "{name}");
            assert!(patch.nodes().iter().all(|node| node.area > 0.0 && node.normal[2] < -0.999), "{name}");
        } else {
            assert!(mesh.format() == "nastran-bulk", "{name}: no set");
        }
        formats.push(mesh.format());
    }
    for format in TABLE {
        assert!(formats.contains(&format.name), "no file of {}", format.name);
    }
}

/// Reads and describes damaged files of one kind; returns how many are still meshes.
fn fuzz(names: &[String], seed: u64, count: usize) -> usize {
    let mut random = Random::new(seed);
    let mut meshes = 0;
    for name in names {
        let file = std::fs::read(folder().join(name)).expect("a file");
        for _ in 0..count {
            let bytes = damaged(&file, &mut random);
            let memory = peak_memory(|| {
                if let Ok(mesh) = mesh::read_bytes(&bytes) {
                    let _ = MeshReport(&mesh).to_string();
                    meshes += 1;
                }
            });
            assert!(memory < (64 << 20) + 400 * bytes.len() as u64, "{name}: {memory} bytes for {}", bytes.len());
        }
    }
    meshes
}

#[test]
fn damaged_meshes_are_read_or_refused() {
    assert!(fuzz(&names(), 0x1357_9bdf, 100) > 100);
}

/// Many damages: `cargo test -p stickslip-formats --test it meshes -- --ignored`; the number for
/// every file is `STICKSLIP_FUZZ_RUNS`.
#[test]
#[ignore = "takes minutes"]
fn many_damaged_meshes() {
    let count = number_of_variable("STICKSLIP_FUZZ_RUNS", 20_000) as usize;
    fuzz(&names(), 0x0246_8ace, count);
}
