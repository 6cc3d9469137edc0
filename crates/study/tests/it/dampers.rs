//! The templates of dampers against closed forms: loads at rest, frequencies by nodal diameter
//! with joints free and stuck, the onset of slip, and the energy loss.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use stickslip_study::dataset::{Dataset, Table};
use stickslip_study::run::{Context, run};
use stickslip_study::{read_study, templates};

/// A study of a template with other parameters.
fn study(template: &str, parameters: &[(&str, String)], study: &str) -> Dataset {
    let parameters: String = parameters.iter().map(|(name, value)| format!("{name} = \"{value}\"\n")).collect();
    let text = format!("schema = 1\nmodel = {{ template = \"{template}\" }}\n[parameters]\n{parameters}\n{study}");
    let study = read_study("damper.toml", &text, &[]).unwrap_or_else(|error| panic!("{template}: {error}"));
    let found = run(&study, &Context::without_progress(1)).unwrap_or_else(|error| panic!("{template}: {error}"));
    assert!(found.failures.is_empty(), "{template}: {:?}", found.failures);
    found
}

fn numbers<'a>(found: &'a Dataset, table: &str, column: &str) -> &'a [f64] {
    let table: &Table = found.tables.iter().find(|found| found.name == table).unwrap();
    table.numbers(column).unwrap_or_else(|| panic!("no column {column}"))
}

fn near(what: &str, found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found} instead of {expected}");
}

/// Checks the lowest frequencies (rad/s) of the joints in one state against `expected`, a
/// function of the angle between two sectors.
fn frequencies(
    (template, sectors, modes): (&str, usize, usize),
    parameters: &[(&str, String)],
    share: f64,
    expected: impl Fn(bool, f64) -> Vec<f64>,
) {
    let found = study(template, parameters, &format!("[study]\nkind = \"nodal-diameter\"\nmodes = {modes}\n"));
    let table = &found.tables[0];
    let (diameters, numbers) = (table.integers("nodal_diameter").unwrap(), table.integers("mode").unwrap());
    let (joints, values) = (table.texts("joints").unwrap(), table.numbers("frequency_Hz").unwrap());
    let mut seen = 0;
    for diameter in 0..=sectors / 2 {
        for state in ["free", "stuck"] {
            let all = expected(state == "stuck", TAU * diameter as f64 / sectors as f64);
            let of = |row: &usize| diameters[*row] == diameter as u64 && joints[*row] == state;
            let rows: Vec<usize> = (0..table.rows()).filter(of).collect();
            assert_eq!(rows.len(), all.len(), "{template}, {diameter} nodal diameters, {state}");
            for (row, omega) in rows.into_iter().zip(all) {
                let what = format!("{template}, {diameter} nodal diameters, {state}, mode {}", numbers[row]);
                near(&what, values[row] * TAU, omega, share);
                seen += 1;
            }
        }
    }
    assert_eq!(seen, table.rows());
}

/// The wedge at rest: both loads from its balance along and across the radius, by Cramer's
/// rule. No place moves from its reference position.
#[test]
fn loads_of_a_wedge_at_rest() {
    for (a1, a2, rpm) in
        [(30.0f64, 30.0f64, 3000.0f64), (15.0, 40.0, 6000.0), (60.0, 10.0, 1500.0), (45.0, 44.0, 9000.0)]
    {
        let parameters = [
            ("a1", format!("{a1} deg")),
            ("a2", format!("{a2} deg")),
            ("speed", format!("{rpm} rpm")),
            ("F0", "1e-3 N".to_owned()),
            ("m", "4 g".to_owned()),
            ("r", "200 mm".to_owned()),
        ];
        let found = study(
            "under-platform-wedge",
            &parameters,
            "[study]\nkind = \"response\"\nfrequency = [\"60 Hz\"]\noutput = \"joint_mean\"\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 3\n",
        );
        let load = 0.004 * 0.2 * (rpm * TAU / 60.0).powi(2);
        let ([s1, s2], [c1, c2]) = ([a1, a2].map(|a| a.to_radians().sin()), [a1, a2].map(|a| a.to_radians().cos()));
        // s1 N1 - s2 N2 = 0, c1 N1 + c2 N2 = C
        let determinant = s1 * c2 + s2 * c1;
        let at = |column: &str| numbers(&found, "curve", column)[0];
        // both edges of a face carry half of its load
        for edge in ["in", "out"] {
            near("N1", 2.0 * at(&format!("face1_{edge}_0_n_force_mean_N")), load * s2 / determinant, 1e-6);
            near("N2", 2.0 * at(&format!("face2_{edge}_3_n_force_mean_N")), load * s1 / determinant, 1e-6);
        }
        for place in ["wedge_0_x", "wedge_0_z", "blade_0_x", "blade_0_z"] {
            let rest = at(&format!("{place}_mean_m"));
            assert!(rest.abs() < 1e-6 * load / 50e3, "{place} rests at {rest} m");
        }
        for joint in ["face1_in_0_t", "face1_out_0_t", "face2_in_0_t", "face2_out_0_t"] {
            let friction = at(&format!("{joint}_force_mean_N"));
            assert!(friction.abs() < 1e-6 * load, "{joint} carries {friction} N at rest");
        }
    }
}

/// A spring between a point of a damper and a platform.
struct Tie {
    /// Elongation by `(x, z, ry)` of the damper.
    row: [f64; 3],
    stiffness: f64,
    /// True for the first platform, which moves by one along x; the second one is fixed.
    first: bool,
}

/// Returns the ties of points on two faces at these angles. A point is `(distance, edge)` from
/// the centre along the normal and across it, and has `1/share` of the stiffnesses.
fn ties(angles: [f64; 2], points: &[(f64, f64)], [kt, kn]: [f64; 2]) -> Vec<Tie> {
    let share = points.len() as f64;
    let mut ties = Vec::new();
    for (first, a) in [(true, -angles[0].to_radians()), (false, angles[1].to_radians())] {
        let ([nx, nz], [tx, tz]) = ([a.sin(), a.cos()], [a.cos(), -a.sin()]);
        for (distance, edge) in points {
            // θ × r with r = distance n + edge t
            let (rx, rz) = (distance * nx + edge * tx, distance * nz + edge * tz);
            ties.push(Tie { row: [tx, tz, rz * tx - rx * tz], stiffness: kt / share, first });
            ties.push(Tie { row: [nx, nz, rz * nx - rx * nz], stiffness: kn / share, first });
        }
    }
    ties
}

/// Condenses the three motions of a massless damper. Returns its stiffness between the
/// platforms, and its rotation per motion of the first platform, rad/m.
fn condensed(ties: &[Tie]) -> (f64, f64) {
    let (mut own, mut pull, mut held) = ([[0.0; 3]; 3], [0.0; 3], 0.0);
    for Tie { row, stiffness, first } in ties {
        for i in 0..3 {
            for n in 0..3 {
                own[i][n] += stiffness * row[i] * row[n];
            }
            pull[i] += if *first { stiffness * row[i] * row[0] } else { 0.0 };
        }
        held += if *first { stiffness * row[0] * row[0] } else { 0.0 };
    }
    let det = |m: &[[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let moved: [f64; 3] = std::array::from_fn(|column| {
        let mut m = own;
        (0..3).for_each(|row| m[row][column] = pull[row]);
        det(&m) / det(&own)
    });
    (held - (0..3).map(|i| moved[i] * pull[i]).sum::<f64>(), moved[2])
}

/// Parameters of a cylinder that may turn freely.
const NO_RETENTION: [(&str, &str); 2] = [("kr", "0 N m/rad"), ("br", "0 N m s/rad")];

/// Nearly massless cylinders and wedges between blades that move along the
/// circumference satisfy `m ω² = k + 2 kc (1 - cos θ)`.
#[test]
fn stuck_dampers_that_turn_are_springs_between_blades() {
    let (mass, k, kt, kn, rc): (f64, f64, f64, f64, f64) = (0.4, 250e3, 40e3, 50e3, 3.5e-3);
    for (template, points) in
        [("under-platform-cylinder", vec![(rc, 0.0)]), ("under-platform-wedge", vec![(3e-3, 3e-3), (3e-3, -3e-3)])]
    {
        for angles in [[30.0f64, 30.0f64], [20.0, 50.0], [65.0, 10.0]] {
            let (kc, turn) = condensed(&ties(angles, &points, [kt, kn]));
            if angles[0] == angles[1] {
                // blades that move apart do not rotate it, and it acts like a wedge that cannot
                // rotate
                let (s, c) = angles[0].to_radians().sin_cos();
                near(template, kc, kt * kn / (2.0 * (kt * s * s + kn * c * c)), 1e-12);
            } else {
                assert!(turn.abs() > 1.0, "{template} does not turn: {turn} rad/m");
            }
            let mut parameters = vec![
                ("a1", format!("{} deg", angles[0])),
                ("a2", format!("{} deg", angles[1])),
                ("m", "1e-4 g".to_owned()),
                ("kz", "1e7 N/mm".to_owned()),
            ];
            let own =
                if template == "under-platform-wedge" { [("J", "1e-3 g mm^2"), ("e", "3 mm")] } else { NO_RETENTION };
            parameters.extend(own.map(|(name, value)| (name, value.to_owned())));
            frequencies((template, 12, 1), &parameters, 2e-6, |stuck, theta| {
                vec![((k + if stuck { 2.0 * kc * (1.0 - theta.cos()) } else { 0.0 }) / mass).sqrt()]
            });
        }
    }
}

/// The loads of a cylinder at rest are those of a wedge: both pass through its centre, and no
/// friction is needed.
#[test]
fn loads_of_a_cylinder_at_rest() {
    let (a1, a2) = (15.0f64, 40.0f64);
    let parameters = [("a1", format!("{a1} deg")), ("a2", format!("{a2} deg")), ("F0", "1e-3 N".to_owned())];
    let found = study(
        "under-platform-cylinder",
        &parameters,
        "[study]\nkind = \"response\"\nfrequency = [\"60 Hz\"]\noutput = \"joint_mean\"\n\
         [method]\nkind = \"harmonic-balance\"\nharmonics = 3\n",
    );
    let load = 0.003 * 0.25 * (2600.0 * TAU / 60.0f64).powi(2);
    let sum = (a1 + a2).to_radians().sin();
    let at = |column: &str| numbers(&found, "curve", column)[0];
    near("N1", at("face1_0_n_force_mean_N"), load * a2.to_radians().sin() / sum, 1e-6);
    near("N2", at("face2_3_n_force_mean_N"), load * a1.to_radians().sin() / sum, 1e-6);
    for joint in ["face1_0_t", "face2_0_t"] {
        let friction = at(&format!("{joint}_force_mean_N"));
        assert!(friction.abs() < 1e-6 * load, "{joint} carries {friction} N at rest");
    }
}

/// The studies of the templates have an orbit at every point and speed.
#[test]
fn templates_have_orbits_at_all_speeds() {
    for name in ["under-platform-wedge", "under-platform-cylinder"] {
        let text = templates::find(name).unwrap().study.replace("points = 71", "points = 8");
        let study = read_study("damper.toml", &text, &[]).unwrap();
        let found = run(&study, &Context::without_progress(1)).unwrap();
        assert!(found.failures.is_empty(), "{name}: {:?}", found.failures);
        assert_eq!(numbers(&found, "curve", "blade_0_x_amplitude_m").len(), 4 * 8);
    }
}

/// Without excitation the wedge stays at rest. An excitation of a billionth of the wedge's load
/// has a proportional response.
#[test]
fn small_excitation_gives_proportional_response() {
    let amplitude = |force: &str| {
        let parameters = [("F0", force.to_owned()), ("a1", "35 deg".to_owned())];
        let study = study(
            "under-platform-wedge",
            &parameters,
            "[study]\nkind = \"response\"\nfrequency = [\"130 Hz\", \"290 Hz\"]\n[method]\nkind = \"harmonic-balance\"\nharmonics = 3\n",
        );
        numbers(&study, "curve", "blade_0_x_amplitude_m").to_vec()
    };
    let (rest, little, small) = (amplitude("0 N"), amplitude("1e-8 N"), amplitude("1e-3 N"));
    for i in 0..2 {
        assert!(rest[i] < 1e-15, "{} m", rest[i]);
        near("in proportion", 1e5 * little[i], small[i], 1e-3);
    }
}

/// While blades close, they push the wedge inwards against friction; while they open, it slides
/// outwards. Between the blades it exerts `C/2 tan(a ± ρ)` with `μ = tan ρ`. A cycle loses
/// `h (Δ - h/kc)`, with the difference h of both forces and the range Δ of the blades'
/// distance.
#[test]
fn energy_loss_of_a_slipping_wedge() {
    let (kt, kn, mu): (f64, f64, f64) = (40e3, 50e3, 0.3);
    for a in [30.0f64, 40.0] {
        let parameters = [
            ("a1", format!("{a} deg")),
            ("a2", format!("{a} deg")),
            ("speed", "2550 rpm".to_owned()),
            // a nearly massless wedge with its load
            ("m", "0.01 g".to_owned()),
            ("J", "0.1 g mm^2".to_owned()),
            ("r", "40 m".to_owned()),
            ("kz", "1e5 N/mm".to_owned()),
        ];
        let load = 1e-5 * 40.0 * (2550.0 * TAU / 60.0f64).powi(2);
        let found = study(
            "under-platform-wedge",
            &parameters,
            "[study]\nkind = \"response\"\nfrequency = [\"131 Hz\"]\noutput = \"joint_force\"\n\
             [method]\nkind = \"harmonic-balance\"\nharmonics = 9\ntolerance = 0.02\n",
        );
        let held = |sign: f64| 0.5 * load * (a.to_radians() + sign * mu.atan()).tan();
        let height = held(1.0) - held(-1.0);
        let (s, c) = a.to_radians().sin_cos();
        let kc = kt * kn / (2.0 * (kt * s * s + kn * c * c));
        let at = |column: &str| numbers(&found, "curve", column)[0];
        // neighbours are a quarter of a turn apart
        let range = 2.0 * 2.0 * at("blade_0_x_amplitude_m") * (PI / 4.0).sin();
        let edges = ["face1_in", "face1_out", "face2_in", "face2_out"];
        let lost: f64 = edges.iter().map(|joint| at(&format!("{joint}_0_dissipation_J"))).sum();
        assert!(range > 1.5 * height / kc, "slips for much of the period");
        // the motion of the blades is nearly a sine
        near("loss", lost, height * (range - height / kc), 5e-3);
    }
}

/// A disk mass and a ring segment by nodal diameter: two masses, connected by the contact's
/// spring if it sticks.
#[test]
fn a_rim_ring_has_the_frequencies_of_two_masses() {
    let (md, kd, kc, mr, kr, kt): (f64, f64, f64, f64, f64, f64) = (1.5, 8e5, 9e5, 0.005, 4e6, 3e5);
    frequencies(("rim-ring", 20, 2), &[], 1e-9, |stuck, theta| {
        let waves = 2.0 * (1.0 - theta.cos());
        let (rim, ring, held) = (kd + kc * waves, kr * waves, if stuck { kt } else { 0.0 });
        // (a - md w)(b - mr w) = held²
        let (a, b) = (rim + held, ring + held);
        let (sum, product) = (a / md + b / mr, (a * b - held * held) / (md * mr));
        let high = 0.5 * (sum + (sum * sum - 4.0 * product).sqrt());
        // a ring that can rotate freely has no frequency there
        [product / high, high].into_iter().filter(|square| *square > 1e-6 * rim / md).map(f64::sqrt).collect()
    });
}

/// The contact carries `kt (x - y)` with `y (kt + 2 kr (1 - cos θ) - mr ω²) = kt x`, and slips
/// above its limit.
#[test]
fn a_rim_ring_begins_to_slip_at_its_limit() {
    let (mr, kr, kt): (f64, f64, f64) = (0.005, 4e6, 3e5);
    let limit = 0.25 * mr * 0.2 * (6000.0 * TAU / 60.0f64).powi(2);
    let omega = TAU * 150.0;
    let waves = 2.0 * (1.0 - (TAU * 3.0 / 20.0).cos());
    let ring = kr * waves - mr * omega * omega;
    let carried = kt * ring / (kt + ring);
    let stiffness = Complex64::new(8e5 + 9e5 * waves + carried - 1.5 * omega * omega, 4.0 * omega);
    let force = stiffness.norm() * limit / carried;
    slips_from("rim-ring", &[], ("rim_0", 150.0), force, limit / carried, "groove_0");
}

/// Checks that nothing slips half a percent below a force, with the expected amplitude, and
/// that something slips half a percent above it.
fn slips_from(
    template: &str,
    parameters: &[(&str, String)],
    (place, hertz): (&str, f64),
    force: f64,
    amplitude: f64,
    joint: &str,
) {
    let at = |share: f64| {
        let parameters = [parameters, &[("F0", format!("{} N", share * force))]].concat();
        let found = study(
            template,
            &parameters,
            &format!(
                "[study]\nkind = \"response\"\nfrequency = [\"{hertz} Hz\"]\n[method]\nkind = \"harmonic-balance\"\n\
                 harmonics = 9\ntolerance = 0.02\n"
            ),
        );
        let number = |column: &str| numbers(&found, "curve", column)[0];
        (number(&format!("{place}_amplitude_m")), number(&format!("{joint}_dissipation_J")))
    };
    let (below, above) = (at(0.995), at(1.005));
    near(template, below.0, 0.995 * amplitude, 1e-6);
    // energy loss of a cycle with slip over the whole motion
    let whole = force * amplitude;
    assert!(below.1.abs() < 1e-12 * whole, "{template} slips below {force} N: {} J", below.1);
    assert!(above.1 > 1e-5 * whole, "{template} holds above {force} N: {} J", above.1);
}

/// Along the faces and across them, a blade acts on its own spring and on those of two shrouds.
#[test]
fn shrouds_have_the_frequencies_of_a_chain() {
    frequencies(("shroud", 16, 2), &[], 1e-9, |stuck, theta| {
        let waves = if stuck { 2.0 * (1.0 - theta.cos()) } else { 0.0 };
        let mut both = [180e3 + 15e3 * waves, 320e3 + 20e3 * waves].map(|k: f64| (k / 0.25).sqrt());
        both.sort_by(f64::total_cmp);
        both.to_vec()
    });
}

/// With displacements `X` along and `Z` across the faces, friction holds while
/// `|kt ΔX ∓ μ kn ΔZ| < μ N₀`. The tangential and the normal load are sines of different phase.
#[test]
fn shrouds_begin_to_slip_where_their_load_falls() {
    let (kt, kn, mu, preload): (f64, f64, f64, f64) = (15e3, 20e3, 0.3, 10.0);
    let omega = TAU * 138.0;
    let theta = TAU * 2.0 / 16.0;
    let waves = 2.0 * (1.0 - theta.cos());
    let answer = |stiffness: f64, load: Complex64| load / Complex64::new(stiffness - 0.25 * omega * omega, 0.4 * omega);
    // per unit of F0; the next blade leads by θ
    let along = answer(180e3 + kt * waves, Complex64::new(1.0, 0.0));
    let across = answer(320e3 + kn * waves, Complex64::new(0.0, 0.5));
    let neighbour = Complex64::new(1.0, 0.0) - Complex64::from_polar(1.0, theta);
    let load = |sign: f64| (kt * along * neighbour - sign * mu * kn * across * neighbour).norm();
    let force = mu * preload / load(1.0).max(load(-1.0));
    slips_from("shroud", &[], ("blade_0_x", 138.0), force, force * along.norm(), "shroud_0");
}
