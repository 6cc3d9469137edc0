//! A method that refuses a system names the methods that take it, and these do. If it names
//! none, no method takes the system.

use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip::law::{Range, SharedLaw, TABLE};
use stickslip::method::{self, MethodError, MethodInfo, Options, WIDTH, solver_with_alternatives};
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;

const WIDTH_GIVEN: f64 = 2e-5;

/// Returns every law of the table, and variants with one parameter at zero if its range allows
/// it.
fn laws() -> Vec<SharedLaw> {
    let mut laws = Vec::new();
    for row in TABLE {
        laws.push(row.sample());
        for (i, _) in row.parameters.iter().enumerate().filter(|(_, p)| p.range == Range::ZeroOrMore) {
            let mut values = row.sample.to_vec();
            values[i] = 0.0;
            let law = (row.build)(&values);
            if law.check().is_ok() {
                laws.push(law);
            }
        }
    }
    laws
}

/// Returns a system with these laws, each between its own places and the ground.
fn system(laws: &[SharedLaw], mass: f64) -> System {
    let n: usize = laws.iter().map(|law| law.directions()).sum();
    let one = DMatrix::<f64>::identity(n, n);
    let places = (0..n).map(|i| format!("p{i}")).collect();
    let structure = Structure::new(places, &one * mass, &one * 2.0, &one * 1e4).unwrap();
    let mut builder = System::builder(structure);
    let mut row = 0;
    for (j, law) in laws.iter().enumerate() {
        let axes = (0..law.directions()).map(|a| Axis::new(vec![(row + a, 1.0)])).collect();
        row += law.directions();
        builder = builder.joint(format!("j{j}"), law.clone(), axes);
    }
    builder.force(0, 1, Complex64::new(1.0, 0.0)).build().unwrap()
}

/// A width must be positive.
#[test]
fn a_width_is_more_than_nothing() {
    for name in ["shooting", "transient"] {
        let row = method::find(name).unwrap();
        for width in [0.0, -1.0, f64::NAN] {
            let refused = (row.build)(&Options::from([(WIDTH.to_owned(), width)])).err().map(|error| error.to_string());
            assert!(
                refused.as_ref().is_some_and(|text| text.contains("more than zero")),
                "{name} {width}: {refused:?}"
            );
        }
    }
}

fn asked(row: &MethodInfo, width: bool, system: &System) -> Result<(), MethodError> {
    let options = if width { Options::from([(WIDTH.to_owned(), WIDTH_GIVEN)]) } else { Options::new() };
    solver_with_alternatives(&*(row.build)(&options).unwrap(), system).map(drop)
}

fn named(name: &str) -> &'static MethodInfo {
    method::find(name).expect("a method of the table")
}

/// Compares the refusals of all methods with what the methods do. Returns the number of
/// refusals, and the number without an alternative.
fn check_refusals(system: &System) -> (usize, usize) {
    let (mut refused, mut hopeless) = (0, 0);
    for row in method::TABLE {
        let Err(error) = asked(row, false, system) else { continue };
        refused += 1;
        let (text, ways) = (error.to_string(), error.alternatives().expect("a refusal that no option mends"));
        for name in &ways.methods {
            assert!(asked(named(name), false, system).is_ok(), "{text}: {name} refuses too");
            assert!(text.contains(&format!("`{name}`")), "{text}");
        }
        for name in &ways.with_width {
            assert!(asked(named(name), true, system).is_ok(), "{text}: {name} refuses with a width too");
            assert!(asked(named(name), false, system).is_err(), "{text}: {name} needs no width");
            assert!(text.contains(&format!("`{name}`")) && text.contains("`width`"), "{text}");
        }
        if ways.methods.is_empty() && ways.with_width.is_empty() {
            hopeless += 1;
            assert!(text.contains("no method accepts this system"), "{text}");
            for other in method::TABLE {
                assert!(asked(other, false, system).is_err(), "{text}: {} does", other.name);
                if other.options.iter().any(|option| option.key == WIDTH) {
                    assert!(asked(other, true, system).is_err(), "{text}: {} does with a width", other.name);
                }
                // each method states what it misses, except `auto`, which only picks another
                // method
                let why = asked(other, true, system).unwrap_err().without_alternatives().to_string();
                let said = |(methods, said): &(Vec<&str>, String)| {
                    methods.contains(&other.name) && why == format!("{} {said}", other.name)
                };
                assert!(ways.reasons.iter().any(said) || other.name == "auto", "{text}: {why}");
            }
        }
    }
    (refused, hopeless)
}

#[test]
fn what_a_refusal_names_takes_the_system() {
    let laws = laws();
    let (mut refused, mut hopeless) = (0, 0);
    for (i, law) in laws.iter().enumerate() {
        for other in &laws[i..] {
            let (refusals, without) = check_refusals(&system(&[law.clone(), other.clone()], 1.0));
            refused += refusals;
            hopeless += without;
        }
    }
    assert!(refused > laws.len() * laws.len() / 2 && hopeless > 0 && hopeless < refused / 4, "{refused} {hopeless}");
}

#[test]
fn alternatives_for_a_massless_place() {
    for law in laws() {
        let (refused, hopeless) = check_refusals(&system(std::slice::from_ref(&law), 0.0));
        assert!(refused > 0, "{}", law.name());
        // harmonic balance needs no mass, unless it cannot take the law at all
        let alone = asked(named("harmonic-balance"), false, &system(std::slice::from_ref(&law), 1.0));
        assert_eq!(hopeless > 0, alone.is_err(), "{}", law.name());
    }
}

/// No method takes friction with an immediate drop together with a law without exact motion.
/// The message gives the remedy, and the remedy works.
#[test]
fn friction_that_drops_at_once_is_told_to_fall_over_a_velocity() {
    let cubic = stickslip::law::find("cubic").unwrap().sample();
    let stribeck = stickslip::law::find("stribeck").unwrap().sample();
    let dropping = stribeck.with_value("velocity", 0.0).unwrap();
    let error = asked(named("auto"), false, &system(&[dropping, cubic.clone()], 1.0)).unwrap_err().to_string();
    assert!(error.contains("no method accepts this system") && error.contains("`velocity` above zero"), "{error}");
    assert!(asked(named("shooting"), true, &system(&[stribeck, cubic], 1.0)).is_ok());
}
