//! Rigid bodies in study files: columns and units, closed forms, an assembly by hand, and
//! refusals.

use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip_study::dataset::Dataset;
use stickslip_study::run::{Context, run};
use stickslip_study::summary::ModelSummary;
use stickslip_study::{read_study, templates};

/// A bar in the plane x, z on two springs at its ends, with a force off its middle.
const BAR: &str = r#"
schema = 1
[[body]]
name = "bar"
mass = "2 kg"
inertia = "15000 kg mm^2"
directions = ["x", "z"]
[[place]]
name = "left"
of = "bar"
offset = ["-120 mm", 0, 0]
[[place]]
name = "right"
of = "bar"
offset = ["120 mm", 0, "-30 mm"]
[[spring]]
between = ["left.z", "ground"]
stiffness = "200 N/mm"
damping = "4 kg/s"
[[spring]]
between = ["right.z", "ground"]
stiffness = "300 N/mm"
damping = "6 kg/s"
[[spring]]
between = ["right.x", "ground"]
stiffness = "400 N/mm"
damping = "5 kg/s"
[[spring]]
between = ["bar.ry", "ground"]
stiffness = "900 N m/rad"
damping = "0.02 N m s/rad"
[[force]]
on = "left.z"
amplitude = "10 N"
[[force]]
on = "bar.ry"
amplitude = "0.7 N m"
phase = "90 deg"
[study]
kind = "response"
frequency = "80 Hz"
output = ["velocity", "acceleration", "harmonics"]
"#;

fn dataset(text: &str) -> Dataset {
    let study = read_study("body.toml", text, &[]).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let found = run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{error}"));
    assert!(found.failures.is_empty(), "{:?}", found.failures);
    found
}

/// A constant moment turns the bar beyond the range of small rotations.
#[test]
fn large_rotations_are_reported() {
    let load = |moment: &str| format!("[[force]]\non = \"bar.ry\"\namplitude = \"{moment}\"\nharmonic = 0\n[study]");
    let notes = |moment: &str| dataset(&BAR.replace("[study]", &load(moment))).notes.join("\n");
    assert!(!notes("100 N m").contains("rotations of bodies"), "{}", notes("100 N m"));
    let far = dataset(&BAR.replace("[study]", &load("2 kN m")));
    let column = |name: &str| far.tables[0].numbers(name).expect("a column")[0].abs();
    let degrees = (column("bar.ry_mean_rad") + column("bar.ry_amplitude_rad")).to_degrees();
    let said = far.notes.join("\n");
    assert!(said.contains(&format!("at 1 point `bar.ry` reaches {degrees:.0} deg")), "{degrees}: {said}");
}

fn numbers<'a>(found: &'a Dataset, table: &str, column: &str) -> &'a [f64] {
    let table = found.tables.iter().find(|found| found.name == table).unwrap();
    table.numbers(column).unwrap_or_else(|| panic!("no column {column}"))
}

fn near(what: &str, found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found} instead of {expected}");
}

/// Solves `a x = b` for three unknowns by Cramer's rule.
fn cramer(a: [[Complex64; 3]; 3], b: [Complex64; 3]) -> [Complex64; 3] {
    let det = |m: &[[Complex64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    std::array::from_fn(|column| {
        let mut m = a;
        (0..3).for_each(|row| m[row][column] = b[row]);
        det(&m) / det(&a)
    })
}

/// Compares a bar with `(K + jωC - ω²M) (x, z, θ) = f`. Its rows are written by hand: a point
/// at (a, 0, c) moves by `x + c θ` and `z - a θ`.
#[test]
fn a_bar_matches_its_equations_of_motion() {
    let found = dataset(BAR);
    let omega = TAU * 80.0;
    let rows = [
        ([0.0, 1.0, 0.12], 2e5, 4.0),
        ([0.0, 1.0, -0.12], 3e5, 6.0),
        ([1.0, 0.0, -0.03], 4e5, 5.0),
        ([0.0, 0.0, 1.0], 900.0, 0.02),
    ];
    let mut a = [[Complex64::new(0.0, 0.0); 3]; 3];
    for (row, k, c) in rows {
        for i in 0..3 {
            for n in 0..3 {
                a[i][n] += row[i] * row[n] * Complex64::new(k, omega * c);
            }
        }
    }
    for (i, mass) in [2.0, 2.0, 0.015].into_iter().enumerate() {
        a[i][i] -= omega * omega * mass;
    }
    let moment = Complex64::new(10.0 * 0.12, 0.7);
    let [x, z, turn] = cramer(a, [Complex64::new(0.0, 0.0), Complex64::new(10.0, 0.0), moment]);
    let at = |column: &str| numbers(&found, "curve", column)[0];
    near("x", at("bar_x_amplitude_m"), x.norm(), 1e-10);
    near("z", at("bar_z_amplitude_m"), z.norm(), 1e-10);
    near("ry", at("bar_ry_amplitude_rad"), turn.norm(), 1e-10);
    near("phase", at("bar_ry_phase_deg"), turn.arg().to_degrees(), 1e-9);
    near("right.z", at("right_z_amplitude_m"), (z - 0.12 * turn).norm(), 1e-10);
    near("right.x", at("right_x_amplitude_m"), (x - 0.03 * turn).norm(), 1e-10);
    near("velocity", at("bar_ry_velocity_amplitude_rad_per_s"), omega * turn.norm(), 1e-5);
    near("acceleration", at("left_z_acceleration_amplitude_m_per_s2"), omega * omega * (z + 0.12 * turn).norm(), 1e-5);
    near("harmonic", at("bar_ry_harmonic1_rad"), turn.norm(), 1e-9);
    assert!(at("bar_ry_mean_rad").abs() < 1e-15);
    // peaks are those of displacements
    let peaks = BAR.replace("frequency = \"80 Hz\"", "frequency = { from = \"30 Hz\", to = \"150 Hz\", points = 25 }");
    let found = dataset(&peaks);
    let masses = found.tables.iter().find(|table| table.name == "peaks").unwrap().texts("mass").unwrap().to_vec();
    assert!(!masses.is_empty() && masses.iter().all(|mass| mass != "bar.ry"), "{masses:?}");
}

/// A disc that an imposed rotation of another body turns through a shaft has the amplitude
/// `a k/(k - J ω²)`.
#[test]
fn a_shaft_transmits_an_imposed_rotation() {
    let text = r#"
schema = 1
[[body]]
name = "motor"
mass = "1 kg"
inertia = "1 kg m^2"
directions = "rz"
[[body]]
name = "disc"
mass = "1 kg"
inertia = "3e-3 kg m^2"
directions = ["rz"]
[[place]]
name = "rim"
of = "disc"
offset = ["50 mm", 0, 0]
directions = ["y"]
[[spring]]
between = ["motor.rz", "disc.rz"]
stiffness = "500 N m/rad"
[[motion]]
on = "motor.rz"
amplitude = "0.5 deg"
[study]
kind = "response"
frequency = "40 Hz"
"#;
    let found = dataset(text);
    let omega = TAU * 40.0;
    let expected = 0.5f64.to_radians() * 500.0 / (500.0 - 3e-3 * omega * omega);
    near("disc", numbers(&found, "curve", "disc_rz_amplitude_rad")[0], expected.abs(), 1e-12);
    near("rim", numbers(&found, "curve", "rim_y_amplitude_m")[0], 0.05 * expected.abs(), 1e-12);
}

/// A body in space under a force off its axes: static motion by hand. The product of inertia
/// has no effect at rest, and a face is rotated.
#[test]
fn a_body_in_space_has_six_degrees_of_freedom() {
    let spring =
        |place: &str, k: &str| format!("[[spring]]\nbetween = [\"{place}\", \"ground\"]\nstiffness = \"{k}\"\n");
    let springs: String = ["b.x", "b.y", "b.z"].map(|place| spring(place, "1e6 N/m")).concat()
        + &["b.rx", "b.ry", "b.rz"].map(|place| spring(place, "200 N m/rad")).concat();
    let text = format!(
        r#"
schema = 1
[[body]]
name = "b"
mass = "1 kg"
inertia = ["2 kg mm^2", "3 kg mm^2", "4 kg mm^2", "0.5 kg mm^2", 0, 0]
directions = ["x", "y", "z"]
[[place]]
name = "face"
of = "b"
offset = ["10 mm", "-20 mm", "30 mm"]
normal = [0, 0.6, 0.8]
tangent = [1, 0, 0]
{springs}
[[force]]
on = "face.n"
amplitude = "2 N"
[study]
kind = "response"
frequency = "1e-3 Hz"
"#
    );
    let found = dataset(&text);
    let at = |column: &str| numbers(&found, "curve", column)[0];
    // moment r × f of f = 2 (0, 0.6, 0.8) N at r = (10, -20, 30) mm
    let moment = [-0.02 * 1.6 - 0.03 * 1.2, -0.01 * 1.6, 0.01 * 1.2];
    for (along, moment) in ["rx", "ry", "rz"].iter().zip(moment) {
        near(along, at(&format!("b_{along}_amplitude_rad")), f64::abs(moment) / 200.0, 1e-6);
    }
    near("y", at("b_y_amplitude_m"), 1.2e-6, 1e-6);
    // reciprocity: the work of the force is that of the springs
    let own: f64 = moment.iter().map(|m| m * m / 200.0).sum::<f64>() + 2.0 * 2.0 / 1e6;
    near("face", at("face_n_amplitude_m"), own / 2.0, 1e-6);
}

/// `check` describes a cylinder between a floor and a spring at its centre. While the cylinder
/// rolls, its effective mass is 3/2 m.
#[test]
fn summary_describes_bodies() {
    let text = r#"
schema = 1
parameters = { m = "40 g", r = "3 mm" }
[[body]]
name = "roller"
mass = "m"
inertia = "m*r^2/2"
directions = ["x", "z"]
[[place]]
name = "foot"
of = "roller"
offset = [0, 0, "-r"]
[[spring]]
between = ["roller.x", "ground"]
stiffness = "20 N/mm"
damping = "0.1 kg/s"
[[spring]]
between = ["roller.z", "ground"]
stiffness = "900 N/mm"
damping = "0.1 kg/s"
[[joint]]
name = "floor"
between = ["foot.x", "ground"]
law = { kind = "coulomb", limit = "50 N" }
[[force]]
on = "roller.x"
amplitude = "1 N"
[study]
kind = "response"
frequency = "60 Hz"
"#;
    let summary = ModelSummary::new(&read_study("roller.toml", text, &[]).unwrap()).unwrap();
    assert_eq!(summary.bodies.len(), 1);
    for word in ["roller: 0.04 kg", "kg m^2 about y", "directions x, z, ry", "1 place"] {
        assert!(summary.bodies[0].contains(word), "{word}: {}", summary.bodies[0]);
    }
    assert!(summary.to_string().contains(&format!("bodies         {}", summary.bodies[0])), "{summary}");
    near("rolls", summary.stuck.elastic[0].omega, (20e3f64 / (1.5 * 0.04)).sqrt(), 1e-12);
    // the same by an orbit, with the damper at the centre
    let found = dataset(text);
    let omega = TAU * 60.0;
    let expected = Complex64::new(20e3 - 1.5 * 0.04 * omega * omega, 0.1 * omega).norm().recip();
    near("amplitude", numbers(&found, "curve", "roller_x_amplitude_m")[0], expected, 1e-9);
    near("turns", numbers(&found, "curve", "roller_ry_amplitude_rad")[0], expected / 3e-3, 1e-9);
}

/// A ring of sectors with two platforms on springs, connected by springs at offsets, in a
/// travelling wave: one sector, by hand.
#[test]
fn bodies_are_parts_of_sectors() {
    let text = r#"
schema = 1
[disk]
sectors = 12
[[mass]]
name = "hub"
mass = "1 kg"
[[body]]
name = "platform"
mass = "0.5 kg"
inertia = "2e-4 kg m^2"
directions = ["z", "ry"]
[[place]]
name = "high"
of = "platform"
offset = ["30 mm", 0, 0]
directions = ["z"]
[[place]]
name = "low"
of = "platform"
offset = ["-30 mm", 0, 0]
directions = ["z"]
[[spring]]
between = ["hub", "ground"]
stiffness = "1e6 N/m"
[[spring]]
between = ["platform.z", "hub"]
stiffness = "3e5 N/m"
damping = "3 kg/s"
[[spring]]
between = ["platform.ry", "ground"]
stiffness = "80 N m/rad"
[[spring]]
between = ["high.z", "next.low.z"]
stiffness = "5e4 N/m"
[[force]]
on = "platform.ry"
amplitude = "0.2 N m"
engine_order = 3
[study]
kind = "response"
frequency = "70 Hz"
"#;
    let found = dataset(text);
    let (omega, a) = (TAU * 70.0, 0.03);
    let wave = Complex64::from_polar(1.0, TAU * 3.0 / 12.0);
    // high.z - next.low.z over (hub, z, θ): (z - a θ) - (z + a θ) e^{jφ}
    let row = [Complex64::new(0.0, 0.0), 1.0 - wave, -a * (1.0 + wave)];
    let mut k: [[Complex64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|n| 5e4 * row[i].conj() * row[n]));
    let tie = Complex64::new(3e5, 3.0 * omega);
    k[0][0] += 1e6 + tie - omega * omega;
    k[0][1] -= tie;
    k[1][0] -= tie;
    k[1][1] += tie - 0.5 * omega * omega;
    k[2][2] += 80.0 - 2e-4 * omega * omega;
    let zero = Complex64::new(0.0, 0.0);
    let [hub, z, turn] = cramer(k, [zero, zero, Complex64::new(0.2, 0.0)]);
    for sector in [0, 7] {
        let at = |column: &str| numbers(&found, "curve", column)[0];
        near("hub", at(&format!("hub_{sector}_amplitude_m")), hub.norm(), 1e-9);
        near("z", at(&format!("platform_{sector}_z_amplitude_m")), z.norm(), 1e-9);
        near("ry", at(&format!("platform_{sector}_ry_amplitude_rad")), turn.norm(), 1e-9);
    }
}

/// The bar with `from` replaced by `to` is refused with this key and these words.
fn refused(from: &str, to: &str, key: &str, words: &[&str]) {
    assert!(BAR.contains(from), "{from}");
    let error = read_study("bad.toml", &BAR.replacen(from, to, 1), &[]).map(|_| to).unwrap_err();
    let all = format!("{error} — {}", error.help_text().unwrap_or_default());
    assert_eq!(error.key(), Some(key), "{all}");
    for word in words {
        assert!(all.contains(word), "{word}: {all}");
    }
}

#[test]
fn errors_of_bodies_have_locations() {
    let inertia = "\"15000 kg mm^2\"";
    refused(inertia, "0", "inertia", &["about every axis must be above zero", "[[mass]]"]);
    refused(
        inertia,
        "\"15000 kg mm\"",
        "inertia",
        &["expected moment of inertia (kg m^2)", "inertia = \"300 g mm^2\""],
    );
    refused(inertia, "[\"1 g mm^2\", \"2 g mm^2\"]", "inertia", &["2 moments of inertia for the rotations ry"]);
    refused("\"2 kg\"", "\"0 kg\"", "mass", &["must be more than zero"]);
    let directions = "directions = [\"x\", \"z\"]";
    refused(
        directions,
        "directions = [\"x\", \"z\", \"rx\"]",
        "directions",
        &["in the plane x, z", "its rotation is ry"],
    );
    refused(directions, "directions = [\"x\", \"up\", \"ry\"]", "directions", &["`up` is not a direction of a body"]);
    refused(directions, "directions = [\"x\", \"z\", \"z\"]", "directions", &["appears twice"]);
    refused(directions, "directions = [\"x\"]", "directions", &["the body has no rotation"]);
    let place = "name = \"left\"\nof = \"bar\"\noffset = [\"-120 mm\", 0, 0]";
    refused(
        place,
        "name = \"left\"\nof = \"beam\"\noffset = [0, 0, 0]",
        "of",
        &["there is no mass and no body `beam`"],
    );
    refused(place, "name = \"left\"\nof = \"bat\"\noffset = [0, 0, 0]", "of", &["did you mean `bar`?"]);
    refused(place, "name = \"left\"\nof = \"bar\"", "name", &["needs `offset`, `normal` or both"]);
    refused(place, "name = \"left\"\nof = \"bar\"\noffset = [\"1 mm\", 0]", "offset", &["a list of three quantities"]);
    refused(
        place,
        "name = \"left\"\nof = \"bar\"\noffset = [\"1 N\", 0, 0]",
        "offset",
        &["expected length (m), found force (N)"],
    );
    refused(
        place,
        "name = \"left\"\nof = \"bar\"\noffset = [0, 0, 0]\ndirections = [\"x\", \"y\"]",
        "directions",
        &["points of `bar` move along x, z; `y` is not one of these directions"],
    );
    refused(
        place,
        "name = \"left\"\nof = \"bar\"\noffset = [0, 0, 0]\nnormal = [0, 1, 0]",
        "normal",
        &["`bar` does not move along y"],
    );
    refused(place, "name = \"bar\"\nof = \"bar\"\noffset = [0, 0, 0]", "name", &["appears twice"]);
    refused("\"900 N m/rad\"", "\"900 N/m\"", "stiffness", &["expected angular stiffness (N m/rad)", "500 N m/rad"]);
    refused("\"900 N m/rad\"", "\"900 N m\"", "stiffness", &["expected angular stiffness (N m/rad)"]);
    refused("\"0.7 N m\"", "\"0.7 N\"", "amplitude", &["expected energy or moment (J)", "2 N m"]);
    refused("\"10 N\"", "\"10 N m\"", "amplitude", &["expected force (N)"]);
    refused(
        "between = [\"bar.ry\", \"ground\"]",
        "between = [\"bar.ry\", \"left.x\"]",
        "between",
        &["`bar.ry` is a rotation and `left.x` is a displacement"],
    );
    refused(
        "between = [\"bar.ry\", \"ground\"]",
        "between = [\"bar.rx\", \"ground\"]",
        "between",
        &["`bar` has no direction rx"],
    );
    refused("on = \"left.z\"", "on = \"bar\"", "on", &["`bar.x`", "`bar.z`", "`bar.ry`"]);
    refused("kind = \"response\"", "kind = \"response\"\npeak_of = \"bar.ry\"", "peak_of", &["bar.ry"]);
    let joint = "[study]";
    let law = "law = { kind = \"jenkins\", stiffness = 1e3, limit = 1 }";
    let joined =
        |between: &str| format!("[[joint]]\nname = \"rub\"\nbetween = [\"{between}\", \"ground\"]\n{law}\n[study]");
    refused(joint, &joined("bar.ry"), "between", &["this is a rotation", "[[place]]"]);
    refused(joint, &joined("bar"), "between", &["the node `bar` has 2", "name one, such as `bar.x`"]);
    let twice = "[[body]]\nname = \"bar\"\nmass = 1\ninertia = 1\ndirections = [\"x\", \"y\"]\n[study]";
    refused(joint, twice, "name", &["appears twice"]);
    let offset = "[[mass]]\nname = \"block\"\nmass = \"1 kg\"\ndirections = [\"x\", \"z\"]\n[[place]]\nname = \"side\"\nof = \"block\"\noffset = [0, 0, \"1 mm\"]\nnormal = [1, 0, 0]\n[study]";
    refused(joint, offset, "offset", &["`block` is a point mass", "use a [[body]]"]);
    let figure = "output = [\"velocity\", \"acceleration\", \"harmonics\"]";
    refused(figure, &format!("{figure}\n[figure]\nonly = \"bar.ry\""), "only", &["`bar.ry` is a rotation"]);
}

/// The templates of dampers under rotating platforms contain bodies.
#[test]
fn the_templates_of_dampers_have_bodies() {
    for name in ["under-platform-cylinder", "under-platform-wedge"] {
        let text = templates::find(name).unwrap().study;
        let summary = ModelSummary::new(&read_study("damper.toml", text, &[]).unwrap()).unwrap();
        assert_eq!((summary.bodies.len(), summary.dofs), (1, 12 * 5), "{name}: {:?}", summary.bodies);
    }
}

/// A loose cylinder between two blades, heavy enough to stick. The right contact touches its slip
/// limit: the motion is the edge of a continuum of stuck motions. It is stable, as the structure
/// with both contacts stuck is linear and damped, and a time integration stays at it.
#[test]
fn a_cylinder_that_sticks_up_to_its_limit_is_stable() {
    let text = r#"
schema = 1
[parameters]
rc = "4 mm"
[[mass]]
name = "left"
mass = "300 g"
directions = ["x", "z"]
[[mass]]
name = "right"
mass = "310 g"
directions = ["x", "z"]
[[spring]]
between = ["left.x", "ground"]
stiffness = "200 N/mm"
damping = "0.2 %"
[[spring]]
between = ["left.z", "ground"]
stiffness = "5 kN/mm"
damping = "0.2 %"
[[spring]]
between = ["right.x", "ground"]
stiffness = "200 N/mm"
damping = "0.2 %"
[[spring]]
between = ["right.z", "ground"]
stiffness = "5 kN/mm"
damping = "0.2 %"
[[body]]
name = "pin"
mass = "8 g"
inertia = "64 g mm^2"
directions = ["x", "z"]
[[place]]
name = "pin_left"
of = "pin"
offset = ["-rc*sin(25 deg)", 0, "rc*cos(25 deg)"]
normal = ["-sin(25 deg)", 0, "cos(25 deg)"]
[[place]]
name = "pad_left"
of = "left"
normal = ["-sin(25 deg)", 0, "cos(25 deg)"]
[[place]]
name = "pin_right"
of = "pin"
offset = ["rc*sin(40 deg)", 0, "rc*cos(40 deg)"]
normal = ["sin(40 deg)", 0, "cos(40 deg)"]
[[place]]
name = "pad_right"
of = "right"
normal = ["sin(40 deg)", 0, "cos(40 deg)"]
[[joint]]
name = "L"
between = ["pin_left", "pad_left"]
law = { kind = "friction-contact", tangential = "30 N/mm", normal = "60 N/mm", friction = 0.25 }
[[joint]]
name = "R"
between = ["pin_right", "pad_right"]
law = { kind = "friction-contact", tangential = "30 N/mm", normal = "60 N/mm", friction = 0.25 }
[[force]]
on = "pin.z"
amplitude = "59.2 N"
harmonic = 0
[[force]]
on = "left.x"
amplitude = "2 N"
[study]
kind = "response"
frequency = ["121 Hz"]
peaks = false
[method]
kind = "harmonic-balance"
harmonics = 9
"#;
    let found = dataset(text);
    let curve = &found.tables[0];
    assert_eq!(curve.flags("stable").unwrap(), [Some(true)]);
    assert!(numbers(&found, &curve.name, "R_slip_fraction")[0] < 0.01);
    assert!(numbers(&found, &curve.name, "R_dissipation_J")[0].abs() < 1e-15);
}
