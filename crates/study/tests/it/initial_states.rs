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
