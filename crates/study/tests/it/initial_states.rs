//! Transients that begin with held places: joints carry the forces of the displacement to the
//! place of release.

use stickslip_study::dataset::Dataset;
use stickslip_study::read_study;
use stickslip_study::run::{Context, run};

fn dataset(text: &str) -> Dataset {
    run(&read_study("study.toml", text, &[]).unwrap(), &Context::without_progress(1)).unwrap()
}

fn displacement(dataset: &Dataset, place: &str) -> Vec<f64> {
    let table = dataset.tables.iter().find(|table| table.name == "motion").unwrap();
    let column = format!("{place}_displacement_m");
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    table.numbers(&column).unwrap_or_else(|| panic!("{column} in {names:?}")).to_vec()
}

/// A mass of 10 kg on 20 N/µm that is displaced by 0.2 mm with a joint, without damping.
fn pulled(law: &str, begin: &str) -> Vec<f64> {
    let text = format!(
        "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"10 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\nstiffness = \"20 N/um\"\n\
         [[joint]]\nname = \"bolt\"\nbetween = [\"m\", \"ground\"]\nlaw = {law}\n[study]\nkind = \"transient\"\nstart = {{ m = \"0.2 mm\" }}\n\
         {begin}duration = \"3 ms\"\ntime_step = \"2 us\"\n"
    );
    displacement(&dataset(&text), "m")
}

fn lowest(motion: &[f64]) -> f64 {
    motion.iter().copied().fold(f64::INFINITY, f64::min)
}

/// A stuck joint is a spring relaxed at zero, so the motion is symmetric. A joint relaxed at
/// the place of release, 0.2 mm, gives a motion about `kt u/(k + kt)`.
#[test]
fn a_stuck_joint_gives_a_symmetric_motion() {
    let law = "{ kind = \"jenkins\", stiffness = \"10 N/um\", limit = \"10 kN\" }";
    let low = lowest(&pulled(law, ""));
    assert!((low / -0.2e-3 - 1.0).abs() < 1e-4, "{low}");
    let low = lowest(&pulled(law, "begin = \"unloaded\"\n"));
    assert!((low / (2.0 / 3.0 * 0.1e-3 - (0.2e-3 - 2.0 / 3.0 * 0.1e-3)) - 1.0).abs() < 1e-3, "{low}");
}

/// A joint that slipped during the displacement carries its limit:
/// `k (a₀ - a₁)/2 (a₀ + a₁) = W`, with the loss of half a loop.
#[test]
fn a_joint_that_slipped_carries_its_limit() {
    let (k, kt, limit, a) = (20e6, 10e6, 200.0, 0.2e-3);
    let low = lowest(&pulled("{ kind = \"jenkins\", stiffness = \"10 N/um\", limit = \"200 N\" }", ""));
    // from +limit through the elastic range to -limit, then slip until the kinetic energy is
    // zero
    let energy = |x: f64| 0.5 * k * x * x;
    let elastic = 2.0 * limit / kt;
    // ½ k a² + work of the joint: from +limit to -limit over `elastic` its mean work is zero,
    // beyond that it is -limit times the distance
    let balance = |b: f64| energy(a) - energy(b) - limit * (a + b - elastic);
    let (mut inside, mut beyond) = (0.0, a);
    for _ in 0..60 {
        let middle = 0.5 * (inside + beyond);
        if balance(middle) > 0.0 { inside = middle } else { beyond = middle }
    }
    assert!((low / -inside - 1.0).abs() < 1e-4, "{low} {inside}");
}

/// Returns the first displacement (m) of a mass of 1 kg, and the first force (N) of its joint to
/// ground.
fn first(law: &str, spring: &str, study: &str) -> [f64; 2] {
    let data = dataset(&format!(
        "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[spring]]\nbetween = [\"m\", \"ground\"]\n\
         stiffness = \"{spring}\"\n[[joint]]\nname = \"j\"\nbetween = [\"m\", \"ground\"]\nlaw = {law}\n[[force]]\n\
         on = \"m\"\namplitude = \"5 N\"\nharmonic = 0\n[study]\nkind = \"transient\"\n{study}duration = \"1 ms\"\n\
         time_step = \"0.1 ms\"\n"
    ));
    assert!(data.failures.is_empty(), "{:?}", data.failures);
    let motion = data.tables.iter().find(|table| table.name == "motion").unwrap();
    ["m_displacement_m", "j_force_N"].map(|name| motion.numbers(name).unwrap()[0])
}

/// A joint of any stiffness, and rigid friction, carry a constant load: `F/(k + kt)`.
#[test]
fn stiff_and_rigid_joints_carry_the_load() {
    let equilibrium = "begin = \"equilibrium\"\n";
    for stiffness in [1e3, 1e5, 1e7, 1e9] {
        let law = format!("{{ kind = \"jenkins\", stiffness = \"{stiffness} N/m\", limit = \"100 N\" }}");
        let [x, force] = first(&law, "10 N/mm", equilibrium);
        let expected = 5.0 / (1e4 + stiffness);
        assert!((x / expected - 1.0).abs() < 1e-8 && (force / (stiffness * x) - 1.0).abs() < 1e-8, "{stiffness}: {x}");
    }
    for law in ["\"coulomb\"", "\"stribeck\", static_limit = \"120 N\", velocity = \"1 mm/s\""] {
        let [x, force] = first(&format!("{{ kind = {law}, limit = \"100 N\" }}"), "10 N/mm", equilibrium);
        assert!(x.abs() < 1e-9 && (force - 5.0).abs() < 1e-5, "{law}: {x} {force}");
    }
}

/// Rigid friction that slipped during the pull carries its limit. Between the second and the third
/// of three masses it is 15 N: `x₁ = x₂ k₂/(k₁ + k₂)` and `k₂ (x₂ - x₁) = k₃ (x₃ - x₂) + 15 N`. At
/// 1000 N it holds, and both move alike.
#[test]
fn rigid_friction_between_masses_is_in_equilibrium() {
    let second = |limit: f64| {
        let text = format!(
            "schema = 1\n[[mass]]\nname = \"m{{i}}\"\nrepeat = {{ i = 3 }}\nmass = \"0.8 kg\"\n\
             [[spring]]\nbetween = [\"m1\", \"ground\"]\nstiffness = \"400 N/mm\"\n\
             [[spring]]\nbetween = [\"m1\", \"m2\"]\nstiffness = \"150 N/mm\"\n\
             [[spring]]\nbetween = [\"m2\", \"m3\"]\nstiffness = \"250 N/mm\"\n\
             [[joint]]\nname = \"bolt\"\nbetween = [\"m2\", \"m3\"]\nlaw = {{ kind = \"coulomb\", limit = \"{limit} N\" }}\n\
             [study]\nkind = \"transient\"\nstart = {{ m3 = \"1 mm\" }}\nduration = \"1 ms\"\ntime_step = \"0.1 ms\"\n"
        );
        displacement(&dataset(&text), "m2")[0]
    };
    let slipped = (250.0 + 15.0) / (150e3 * 400.0 / 550.0 + 250e3);
    assert!((second(15.0) / slipped - 1.0).abs() < 1e-8, "{} {slipped}", second(15.0));
    assert!((second(1000.0) / 1e-3 - 1.0).abs() < 1e-6, "{}", second(1000.0));
}

/// Laws with internal states follow the pull: `limit (1 - e^(-k u/limit))`, for slow bristles with
/// the static limit.
#[test]
fn laws_with_states_follow_the_pull() {
    let start = "start = { m = \"2 mm\" }\n";
    let laws = [
        ("\"dahl\", stiffness = \"20 N/mm\", limit = \"10 N\"", 10.0),
        (
            "\"lugre\", stiffness = \"20 N/mm\", damping = \"3 N s/m\", limit = \"10 N\", static_limit = \"13 N\", velocity = \"1 mm/s\"",
            13.0,
        ),
    ];
    for (law, limit) in laws {
        let [_, force] = first(&format!("{{ kind = {law} }}"), "10 N/mm", start);
        let expected = limit * (1.0 - f64::exp(-20e3 * 2e-3 / limit));
        // at the moment of release the bristles add their damping times the velocity, zero
        assert!((force / expected - 1.0).abs() < 1e-6, "{law}: {force} {expected}");
    }
}

/// Two masses on a stiff bar that only a joint holds, but for a stiffness that is rounding in a
/// matrix of 1e9 N/m.
#[test]
fn a_free_bar_beside_its_rounding_is_in_equilibrium() {
    let data = dataset(
        r#"schema = 1
[[mass]]
name = "a"
mass = "1 kg"
[[mass]]
name = "b"
mass = "1 kg"
[[spring]]
between = ["a", "b"]
stiffness = "1e9 N/m"
[[spring]]
between = ["a", "ground"]
stiffness = "1e-3 N/m"
[[joint]]
name = "j"
between = ["a", "ground"]
law = { kind = "jenkins", stiffness = "2e5 N/m", limit = "5 N" }
[study]
kind = "transient"
start = { b = "1 mm" }
duration = "1 ms"
time_step = "0.1 ms"
"#,
    );
    assert!(data.failures.is_empty(), "{:?}", data.failures);
    let moved = displacement(&data, "b")[0] - displacement(&data, "a")[0];
    assert!((moved / 5e-9 - 1.0).abs() < 1e-5, "{moved}");
}

/// A body that nothing holds has no equilibrium under a load, and no result.
#[test]
fn a_motion_without_its_equilibrium_is_a_failure() {
    let data = dataset(
        "schema = 1\n[[mass]]\nname = \"m\"\nmass = \"1 kg\"\n[[force]]\non = \"m\"\namplitude = \"5 N\"\nharmonic = 0\n\
         [study]\nkind = \"transient\"\nbegin = \"equilibrium\"\nduration = \"1 ms\"\ntime_step = \"0.1 ms\"\n",
    );
    assert!(data.failures[0].reason.contains("no static equilibrium was found"), "{:?}", data.failures);
    assert!(data.tables.iter().all(|table| table.rows() == 0));
}

/// Places that `start` does not name are in equilibrium: the second of two masses in series
/// follows the first one.
#[test]
fn other_places_are_in_equilibrium() {
    let study = |begin: &str| {
        format!(
            "schema = 1\n[[mass]]\nname = \"a\"\nmass = \"1 kg\"\n[[mass]]\nname = \"b\"\nmass = \"1 kg\"\n\
             [[spring]]\nbetween = [\"a\", \"b\"]\nstiffness = \"3 N/mm\"\n[[spring]]\nbetween = [\"b\", \"ground\"]\nstiffness = \"1 N/mm\"\n\
             [study]\nkind = \"transient\"\nstart = {{ a = \"4 mm\" }}\n{begin}duration = \"0.1 s\"\ntime_step = \"1 ms\"\n"
        )
    };
    let at = |begin: &str| displacement(&dataset(&study(begin)), "b")[0];
    assert!((at("") - 3e-3).abs() < 1e-12, "{}", at(""));
    assert_eq!(at("begin = \"unloaded\"\n"), 0.0);
}

/// Two masses of which one is displaced move in two modes, and the swings of each grow at times: a
/// warning says that the damping is not that of one mode. In the shape of a mode there is none.
#[test]
fn a_decay_of_several_modes_is_named() {
    let notes = |start: &str| {
        let text = format!(
            "schema = 1\n[[mass]]\nname = \"a\"\nmass = \"1 kg\"\n[[mass]]\nname = \"b\"\nmass = \"1 kg\"\n\
             [[spring]]\nbetween = [\"a\", \"ground\"]\nstiffness = \"1 N/um\"\ndamping = \"2 N s/m\"\n\
             [[spring]]\nbetween = [\"b\", \"ground\"]\nstiffness = \"1 N/um\"\ndamping = \"2 N s/m\"\n\
             [[spring]]\nbetween = [\"a\", \"b\"]\nstiffness = \"0.1 N/um\"\n\
             [study]\nkind = \"transient\"\nstart = {{ {start} }}\nduration = \"0.2 s\"\ntime_step = \"0.1 ms\"\n"
        );
        dataset(&text).notes.join("\n")
    };
    let both = notes("a = \"1 mm\", b = \"0 mm\"");
    assert!(both.contains("grow in") && both.contains("several modes"), "{both}");
    let one = notes("a = \"1 mm\", b = \"1 mm\"");
    assert!(!one.contains("grow"), "{one}");
}

/// Three masses in a row, the last one pulled until the joint of the first one slips. After the
/// release the force of this joint leaves its limit with the sixth power of time, or with the
/// fourth if the springs have dampers. Expected: the linear motion of the stuck structure (SciPy,
/// matrix exponential).
#[test]
fn a_joint_far_from_the_pulled_place_leaves_its_limit_slowly() {
    let expected = [
        ("0", [[0.00416166, 0.01055919, 0.01360404], [-0.00182324, -0.00591666, -0.00668141]]),
        ("10 N s/m", [[0.00416038, 0.01054966, 0.01361909], [-0.00181118, -0.00585917, -0.00665755]]),
    ];
    for (damping, expected) in expected {
        let mut text = "schema = 1\n".to_owned();
        for (mass, size) in [("a", 100), ("b", 80), ("c", 60)] {
            text += &format!("[[mass]]\nname = \"{mass}\"\nmass = \"{size} kg\"\n");
        }
        for ([one, other], stiffness, share) in [(["a", "ground"], 60, 2), (["a", "b"], 50, 1), (["b", "c"], 40, 1)] {
            text += &format!(
                "[[spring]]\nbetween = [\"{one}\", \"{other}\"]\nstiffness = \"{stiffness} N/mm\"\ndamping = \"{share} * {damping}\"\n"
            );
        }
        text += "[[joint]]\nname = \"brace\"\nbetween = [\"a\", \"ground\"]\nlaw = { kind = \"jenkins\", stiffness = \"30 N/mm\", \
                 limit = \"100 N\" }\n[study]\nkind = \"transient\"\nstart = { c = \"20 mm\" }\nduration = \"0.15 s\"\n\
                 time_step = \"50 ms\"\n";
        let data = dataset(&text);
        for (place, at) in ["a", "b", "c"].iter().zip(0..) {
            let motion = displacement(&data, place);
            for (row, expected) in [(1, expected[0][at]), (3, expected[1][at])] {
                assert!((motion[row] - expected).abs() < 1e-8, "{damping}, {place}: {} {expected}", motion[row]);
            }
        }
    }
}
