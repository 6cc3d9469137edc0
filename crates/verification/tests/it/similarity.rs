//! Similarity of the blade couple: theory section 5. Lengths scale with `F0/k`, times with
//! `√(m/k)`.

#![allow(clippy::print_stdout)] // tests print measured values

use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::{CoulombArctan, JenkinsArctan, SharedLaw};
use stickslip::method::{Method, shooting::Shooting};
use stickslip::model::System;
use stickslip::orbit::Orbit;
use stickslip_verification::{close, exact, near, template, template_with};

/// Returns parameters of a couple with all groups of section 5 unchanged, for given `m` and `k`
/// and forces scaled by `force`. Also returns the factors of its frequencies and of its
/// displacements relative to the paper's couple.
fn changes(m: f64, k: f64, force: f64, ft: f64) -> (Vec<(&'static str, f64)>, f64, f64) {
    let (m_ratio, k_ratio) = (m / 0.182, k / 105_103.0);
    let damping = 0.2 * (m_ratio * k_ratio).sqrt();
    let values = vec![
        ("m", m),
        ("m1", 0.00182 * m_ratio),
        ("k", k),
        ("b", damping),
        ("kt", 1e4 * k_ratio),
        ("Ft", ft * force),
        ("F0", 10.0 * force),
    ];
    (values, (k_ratio / m_ratio).sqrt(), force / k_ratio)
}

fn smooth(system: &System, omega: f64) -> Orbit {
    Shooting { tolerance: 1e-10, width: None, ..Shooting::default() }.solver(system).unwrap().orbit(omega).unwrap()
}

#[test]
fn theory_5_groups_of_the_couple() {
    // the paper's values of the groups
    let (m, m1, k, kt, b, f0) = (0.182f64, 0.00182, 105_103.0f64, 1e4, 0.2, 10.0);
    near("m1/m", m1 / m, 0.01, 1e-15);
    near("kt/k", kt / k, 0.095145, 0.5e-6);
    near("b/√(km)", b / (k * m).sqrt(), 1.44606e-3, 0.5e-8);
    near("alpha F0/√(km)", 25e3 * f0 / (k * m).sqrt(), 1807.58, 0.5e-2);
}

#[test]
fn theory_5_exact_law_needs_no_condition() {
    for (ft, hertz) in [(2.0, 121.25), (4.0, 120.75), (8.0, 121.0), (6.0, 121.1)] {
        let reference = exact(&template("blade-couple", &[("Ft", ft)]), TAU * hertz);
        for (m, k, force) in [(0.182, 105_103.0, 0.1), (3.0, 105_103.0, 1.0), (0.02, 7.7e6, 25.0)] {
            let (values, rate, length) = changes(m, k, force, ft);
            let orbit = exact(&template("blade-couple", &values), TAU * hertz * rate);
            for (a, b) in reference.places.iter().zip(&orbit.places) {
                close("amplitude", b.amplitude(), length * a.amplitude(), 1e-9);
            }
            close("loss", orbit.energy.friction, length * force * reference.energy.friction, 1e-9);
            near("slip fraction", orbit.joints[0].slip_fraction, reference.joints[0].slip_fraction, 1e-9);
        }
    }
}

/// Figs. 6 and 8: with the smooth law at a tenth of the forces, the curves agree only if alpha
/// grows tenfold.
#[test]
fn theory_5_smooth_law_needs_alpha_scaled() {
    let couple = |ft: f64, f0: f64, alpha: f64| {
        let law = |limit| -> SharedLaw { Arc::new(CoulombArctan { limit, alpha }) };
        template_with("blade-couple", &[("Ft", ft), ("F0", f0)], law)
    };
    let (mut same, mut other) = (0.0f64, [0.0f64; 3]);
    let mut largest = [0.0f64; 3];
    let mut differences = Vec::new();
    for i in 0..=40 {
        let omega = TAU * (120.0 + 0.05 * f64::from(i));
        let fig6 = smooth(&couple(2.0, 10.0, 25e3), omega);
        let scaled = smooth(&couple(0.2, 1.0, 250e3), omega);
        let fig8 = smooth(&couple(0.2, 1.0, 25e3), omega);
        for p in 0..3 {
            let a = fig6.places[p].amplitude();
            same = same.max((10.0 * scaled.places[p].amplitude() / a - 1.0).abs());
            differences.push((p, 10.0 * fig8.places[p].amplitude() - a));
            largest[p] = largest[p].max(a);
        }
    }
    for (p, difference) in differences {
        other[p] = other[p].max(difference.abs() / largest[p]);
    }
    println!("alpha scaled: {same:.1e}; alpha kept: {other:?} of the largest a1, a2, a3");
    assert!(same < 1e-8, "{same}");
    // the curves differ slightly. Section 5 gives 4.6e-5, and 1.7e-4 for a3; these are not the
    // largest differences, which occur near the kinks
    for (found, [low, high]) in other.iter().zip([[4.6e-5, 3e-4], [1.7e-4, 3e-3], [1.7e-4, 3e-3]]) {
        assert!(*found >= low && *found <= high, "{other:?}");
    }
}

/// The element: `rho = kt a/Ft0`, `beta = alpha a w`, and with mass `r = w √(m1/kt)`.
#[test]
fn theory_5_groups_of_the_element() {
    let (kt, ft, a, w, alpha, m1) = (1.0, 1e-3, 2e-3, 1.0, 25e3, 2e-3);
    let (q, p, l) = (7.0, 3.0, 0.4); // factors of frequency, stiffness, length
    let values = |kt: f64, ft: f64, a: f64| vec![("kt", kt), ("Ft", ft), ("a", a)];
    let massless = |kt: f64, ft: f64, a: f64, alpha: f64, w: f64| {
        let law = |limit| -> SharedLaw { Arc::new(JenkinsArctan { stiffness: kt, limit, alpha }) };
        smooth(&template_with("element", &values(kt, ft, a), law), w).energy.friction
    };
    close(
        "massless",
        massless(p * kt, p * l * ft, l * a, alpha / (l * q), q * w),
        p * l * l * massless(kt, ft, a, alpha, w),
        1e-8,
    );
    let massive = |kt: f64, ft: f64, a: f64, m1: f64, w: f64| {
        let mut changes = values(kt, ft, a);
        changes.push(("m1", m1));
        exact(&template("element-with-mass", &changes), w).energy.friction
    };
    close(
        "with mass",
        massive(p * kt, p * l * ft, l * a, m1 * p / (q * q), q * w),
        p * l * l * massive(kt, ft, a, m1, w),
        1e-9,
    );
}
