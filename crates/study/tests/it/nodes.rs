//! Nodes in a study: a key that takes places accepts a node for all its directions, or refuses
//! it and names them.

use stickslip_study::dataset::{Dataset, Table};
use stickslip_study::run::{Context, run};
use stickslip_study::{Study, StudyError, read_study};

/// A node with a tangent and a normal on springs, two contacts to the ground, and a place of
/// one direction.
fn text(study: &str) -> String {
    format!(
        r#"
schema = 1
[[mass]]
name = "tip"
mass = "1 kg"
directions = ["x", "z"]
[[mass]]
name = "root"
mass = "1 kg"
[[spring]]
between = ["tip.x", "ground"]
stiffness = "100 N/m"
damping = "2 N s/m"
[[spring]]
between = ["tip.z", "ground"]
stiffness = "150 N/m"
damping = "2 N s/m"
[[spring]]
between = ["tip.x", "root"]
stiffness = "100 N/m"
damping = "2 N s/m"
[[spring]]
between = ["root", "ground"]
stiffness = "100 N/m"
damping = "2 N s/m"
[[joint]]
name = "pad"
between = ["tip", "ground"]
law = {{ kind = "friction-contact", tangential = 50, normal = 80, friction = 0.2, preload = 3 }}
[[joint]]
name = "shoe"
between = ["tip", "ground"]
law = {{ kind = "friction-contact", tangential = 20, normal = 10, friction = 0.5, preload = 1 }}
[[force]]
on = "tip.x"
amplitude = "2 N"
[[force]]
on = "tip.z"
amplitude = "1 N"
harmonic = 2
{study}
"#
    )
}

fn read(study: &str) -> Result<Study, StudyError> {
    read_study("study.toml", &text(study), &[])
}

fn dataset(study: &str) -> Dataset {
    run(&read(study).unwrap(), &Context::without_progress(1)).unwrap()
}

fn table<'a>(dataset: &'a Dataset, name: &str) -> &'a Table {
    dataset.tables.iter().find(|table| table.name == name).unwrap()
}

const RESPONSE: &str = "[study]\nkind = \"response\"\nfrequency = [\"1 Hz\", \"2 Hz\"]\n";
const LOOPS: &str = "[study]\nkind = \"hysteresis\"\nfrequency = \"1.5 Hz\"\nsamples = 64\n";
const DECAY: &str = "[study]\nkind = \"transient\"\nduration = \"1 s\"\ntime_step = \"0.1 s\"\n";

#[test]
fn a_node_is_taken_for_all_its_directions_or_they_are_named() {
    // before, key, whether the node (or joint of nodes) is accepted
    let table = [
        (format!("{RESPONSE}[figure]\n"), "only = [", "]", "tip", true),
        (format!("{RESPONSE}[figure]\n"), "only = [", "]", "pad", true),
        (RESPONSE.to_owned(), "peak_of = [", "]", "tip", true),
        (LOOPS.to_owned(), "loop = [", "]", "pad", true),
        (LOOPS.to_owned(), "against = ", "", "tip", false),
        (DECAY.to_owned(), "start = { ", " = \"1 mm\" }", "tip", false),
        (DECAY.to_owned(), "start_velocity = { ", " = \"1 mm/s\" }", "tip", false),
    ];
    for (study, before, after, node, taken) in &table {
        let with = |name: &str| read(&format!("{study}{before}\"{name}\"{after}\n"));
        for along in ["x", "z"] {
            assert!(with(&format!("{node}.{along}")).is_ok(), "{before}{node}.{along}");
        }
        let directions = format!("write `{node}.x` or `{node}.z`");
        match with(node) {
            Ok(_) => assert!(taken, "{before}{node}"),
            Err(error) => {
                assert!(!taken, "{error}");
                assert_eq!(error.help_text(), Some(directions.as_str()), "{error}");
                assert_eq!(error.underlined().map(|text| text.trim_matches('"')), Some(*node), "{error}");
            }
        }
        let error = with(&format!("{node}.y")).unwrap_err();
        assert_eq!(error.help_text(), Some(directions.as_str()), "{error}");
        assert!(error.message().contains(&format!("`{node}` has no direction y")), "{error}");
    }
    // places in springs, joints and forces
    for (from, to) in [("on = \"tip.x\"", "on = \"tip.y\""), ("between = [\"tip.z\"", "between = [\"tip.y\"")] {
        let error = read_study("study.toml", &text(RESPONSE).replace(from, to), &[]).unwrap_err();
        assert_eq!(error.help_text(), Some("write `tip.x` or `tip.z`"), "{error}");
        assert_eq!(error.underlined().map(|text| text.trim_matches('"')), Some("tip.y"), "{error}");
    }
}

#[test]
fn the_peak_of_a_node_is_the_worse_of_its_directions() {
    let peak = |names: &str| {
        let found = dataset(&format!(
            "[study]\nkind = \"response\"\nfrequency = {{ from = \"1 Hz\", to = \"3 Hz\", points = 9 }}\npeak_of = {names}\n"
        ));
        table(&found, "peaks").numbers("amplitude_m").unwrap().iter().copied().fold(0.0, f64::max)
    };
    assert_eq!(peak("\"tip\""), peak("[\"tip.x\", \"tip.z\"]"));
    assert_eq!(peak("[\"tip\", \"tip.z\"]"), peak("\"tip\""));
}

/// Forces are added along each direction separately: the sum equals that of the single loops,
/// added here.
#[test]
fn loops_are_summed_along_each_direction() {
    let (single, sum) = (dataset(LOOPS), dataset(&format!("{LOOPS}sum = true\n")));
    let force = |dataset: &Dataset, name: &str| -> Vec<f64> {
        let loops = table(dataset, "loops");
        let joints = loops.texts("joint").unwrap();
        let rows = (0..loops.rows()).filter(|row| joints[*row] == name);
        rows.map(|row| loops.numbers("force_N").unwrap()[row]).collect()
    };
    for along in ["x", "z"] {
        let (pad, shoe) = (force(&single, &format!("pad.{along}")), force(&single, &format!("shoe.{along}")));
        let summed = force(&sum, &format!("pad.{along} + shoe.{along}"));
        assert!(pad.len() > 60 && summed.len() == pad.len(), "{along}: {} {}", pad.len(), summed.len());
        let size = pad.iter().fold(0.0f64, |size, force| size.max(force.abs()));
        assert!(size > 0.1, "{along}: {size}");
        for (i, force) in summed.iter().enumerate() {
            assert!((force - pad[i] - shoe[i]).abs() < 1e-12 * size, "{along} {i}");
        }
    }
    let summary = table(&sum, "loops_summary");
    assert_eq!(summary.rows(), 2);
    // the name of a joint gives a loop along each of its directions
    let pad = dataset(&format!("{LOOPS}loop = \"pad\"\n"));
    assert_eq!(force(&pad, "pad.z"), force(&single, "pad.z"));
    assert_eq!(table(&pad, "loops_summary").rows(), 2);
}

/// The reference of a closed contact is its springs; the reference of an open one has no
/// stiffness.
#[test]
fn contacts_have_linear_references() {
    let found = dataset(&format!("{RESPONSE}[figure]\nreferences = true\n"));
    let references = table(&found, "references");
    let column = |what: &str| references.numbers(&format!("tip_z_{what}_amplitude_m")).unwrap().to_vec();
    for (i, hertz) in references.numbers("frequency_Hz").unwrap().iter().enumerate() {
        // along z the node is an independent oscillator of 1 kg, 150 N/m and 2 N s/m, under 1 N
        // at twice the frequency
        let omega = 2.0 * std::f64::consts::TAU * hertz;
        let linear = |stiffness: f64| 1.0 / (stiffness - omega * omega).hypot(2.0 * omega);
        for (what, stiffness) in [("free", 150.0), ("stuck", 150.0 + 80.0 + 10.0)] {
            let ratio = column(what)[i] / linear(stiffness);
            assert!((ratio - 1.0).abs() < 1e-7, "{what} {hertz} Hz: {ratio}");
        }
    }
    assert!(!found.notes.iter().any(|note| note.contains("reference")), "{:?}", found.notes);
}

/// A law without a slip limit has no linear reference, and a note says it.
#[test]
fn a_missing_reference_has_its_reason() {
    let cubic =
        "[[joint]]\nname = \"stop\"\nbetween = [\"root\", \"ground\"]\nlaw = { kind = \"cubic\", stiffness = 10 }\n";
    let found = dataset(&format!("{cubic}{RESPONSE}[figure]\nreferences = true\n"));
    for what in ["free", "stuck"] {
        let said = |note: &String| note.contains(&format!("with all joints {what}")) && note.contains("`stop`");
        assert!(found.notes.iter().any(said), "{:?}", found.notes);
    }
    let references = |series: &stickslip_study::dataset::Series| series.label.contains("all joints");
    assert!(!found.figure.panels.iter().flat_map(|panel| &panel.series).any(references), "an empty line is drawn");
}

/// Rotating a model rotates its motion: a mass on equal springs rests on a face along its axes,
/// or on a rotated face with a force along its own tangent and normal.
#[test]
fn a_turned_face_is_the_same_contact() {
    let text = |between: &str, place: &str| {
        format!(
            "schema = 1\n[parameters]\na = \"0.3 rad\"\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n{place}\n\
             [[spring]]\nbetween = [\"m.x\", \"ground\"]\nstiffness = \"200 N/m\"\ndamping = \"2 N s/m\"\n\
             [[spring]]\nbetween = [\"m.z\", \"ground\"]\nstiffness = \"200 N/m\"\ndamping = \"2 N s/m\"\n\
             [[joint]]\nname = \"pad\"\nbetween = [\"{between}\", \"ground\"]\n\
             law = {{ kind = \"friction-contact\", tangential = 50, normal = 80, friction = 0.2, preload = 3 }}\n\
             [[force]]\non = \"{between}.{}\"\namplitude = \"2 N\"\n[[force]]\non = \"{between}.{}\"\namplitude = \"1 N\"\nphase = \"70 deg\"\n\
             [study]\nkind = \"response\"\nfrequency = [\"2 Hz\", \"2.6 Hz\"]\npeaks = false\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 9\ntolerance = 0.5\n",
            if place.is_empty() { "x" } else { "t" },
            if place.is_empty() { "z" } else { "n" },
        )
    };
    let result =
        |text: &str| run(&read_study("turned.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap();
    let straight = result(&text("m", ""));
    let turned = result(&text("face", "[[place]]\nname = \"face\"\nof = \"m\"\nnormal = [\"-sin(a)\", 0, \"cos(a)\"]"));
    let column = |found: &Dataset, name: &str| found.tables[0].numbers(name).unwrap().to_vec();
    for (one, other) in [("m_x", "face_t"), ("m_z", "face_n")] {
        for what in ["amplitude_m", "mean_m", "phase_deg"] {
            let (a, b) = (column(&straight, &format!("{one}_{what}")), column(&turned, &format!("{other}_{what}")));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-8 * a.abs()), "{one} {what}: {a:?} {b:?}");
        }
    }
    assert!(column(&straight, "pad_slip_fraction")[0] > 0.0);
    // x and z of the mass are the motion of the face, rotated back
    let mean = |name: &str| column(&turned, &format!("{name}_mean_m"))[0];
    let back = 0.3f64.cos() * mean("face_t") - 0.3f64.sin() * mean("face_n");
    assert!((mean("m_x") - back).abs() < 1e-9 * back.abs());
}

#[test]
fn invalid_rotated_faces_are_refused() {
    let error = |place: &str, directions: &str| {
        let text = format!(
            "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n{directions}\n[[place]]\nname = \"face\"\n{place}\n\
             [study]\nkind = \"response\"\nfrequency = \"1 Hz\"\n"
        );
        read_study("face.toml", &text, &[]).unwrap_err().to_string()
    };
    let both = "directions = [\"x\", \"z\"]";
    for (place, directions, words) in [
        ("of = \"n\"\nnormal = [0, 0, 1]", both, "there is no mass and no body `n`"),
        ("of = \"m\"", both, "needs its normal"),
        ("of = \"m\"\nnormal = [0, 1, 1]", both, "does not move along y"),
        ("of = \"m\"\nnormal = [0, 0, 0]", both, "not all zero"),
        ("of = \"m\"\nnormal = [0, 0, 1]", "", "needs directions among x, y, z"),
        ("of = \"m\"\nnormal = [0, 0, 1]\ndof = 1", both, "a place of a mass"),
        ("dof = 1", both, "the study has no [structure]"),
    ] {
        let found = error(place, directions);
        assert!(found.contains(words), "{place}: {found}");
    }
}

/// The normal direction does not depend on the order in which nodes are named: nodes of
/// different orders are refused. An excitation amplitude whose square underflows is refused, too.
#[test]
fn inconsistent_normals_are_refused() {
    let study = "[study]\nkind = \"orbit\"\nfrequency = \"1 Hz\"\n";
    let good = text(study)
        + "[[mass]]\nname = \"other\"\nmass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n\
           [[spring]]\nbetween = [\"other.x\", \"ground\"]\nstiffness = 100\n[[spring]]\nbetween = [\"other.z\", \"ground\"]\nstiffness = 100\n\
           [[joint]]\nname = \"face\"\nbetween = [\"tip\", \"other\"]\n\
           law = { kind = \"friction-contact\", tangential = 20, normal = 10, friction = 0.5, preload = 1 }\n";
    let refused = |text: &str| -> Option<String> {
        let study = match read_study("study.toml", text, &[]) {
            Ok(study) => study,
            Err(error) => return Some(error.to_string()),
        };
        run(&study, &Context::without_progress(1)).err().map(|error| error.to_string())
    };
    assert_eq!(refused(&good), None);
    let turned = good.replace(
        "1 kg\"\ndirections = [\"x\", \"z\"]\n[[spring]]\nbetween = [\"other",
        "1 kg\"\ndirections = [\"z\", \"x\"]\n[[spring]]\nbetween = [\"other",
    );
    let said = refused(&turned).expect("two normals");
    assert!(said.contains("z of `tip` and x of `other`"), "{said}");
    let said = refused(&good.replace("amplitude = \"2 N\"", "amplitude = \"1e-200 N\"")).expect("no square");
    assert!(said.contains("1e-200 in SI units is out of range"), "{said}");
}
