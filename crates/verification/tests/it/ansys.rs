//! A `.full` file of MAPDL through a study file: its frequencies agree with SciPy on matrices
//! extracted by another reader. See `data/ansys/README.md`.

use flate2::read::GzDecoder;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use stickslip_study::read_file;

/// Frequencies of the lowest eight modes, Hz.
const FREQUENCIES: [f64; 8] = [
    1283.20036921,
    1283.20036921,
    5781.97486169,
    6919.39887714,
    6919.39887714,
    10172.61497694,
    16497.85701889,
    16497.85701889,
];

/// Both results are limited by the accuracy of shift-and-invert.
const DIGITS: f64 = 1e-9;

#[test]
fn a_file_of_mapdl_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let packed = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/ansys/beam.full.gz");
    let mut bytes = Vec::new();
    GzDecoder::new(File::open(packed).unwrap()).read_to_end(&mut bytes).unwrap();
    std::fs::write(folder.path().join("beam.full"), bytes).unwrap();
    // the file names its nodes 63, 91, ...; it does not state its units
    let study = "schema = 1\n[structure]\nstiffness = { file = \"beam.full\", name = \"stiffness\" }\n\
        mass = { file = \"beam.full\", name = \"mass\" }\nunits = \"m-kg-s\"\nreduce = false\n\
        [[place]]\nname = \"node\"\nnodes = [\"91\"]\n[[force]]\non = \"node.x\"\namplitude = \"1 N\"\n\
        [study]\nkind = \"response\"\nfrequency = [\"1 kHz\"]\n[method]\nkind = \"harmonic-balance\"\n";
    let path = folder.path().join("beam.toml");
    std::fs::write(&path, study).unwrap();
    let model = read_file(&path, &[]).unwrap().case(0).unwrap().model;
    let component = &model.substructure.as_ref().unwrap().component;
    assert_eq!(component.dofs(), 900);
    let lowest = component.frequencies(FREQUENCIES.len()).unwrap();
    for (found, expected) in lowest.iter().zip(FREQUENCIES) {
        let off = found / std::f64::consts::TAU / expected - 1.0;
        assert!(off.abs() < DIGITS, "{expected} Hz: {off:.1e}");
    }
}
