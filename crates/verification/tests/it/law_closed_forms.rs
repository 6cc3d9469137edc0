//! Laws alone under given motions, through their views, against closed forms. Numbers such as
//! (11.1) refer to the theory notes.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use stickslip::law::{
    BoucWen, CoulombTanh, Cubic, Dahl, FrictionContact, Gap, IdealElement, Iwan, Jenkins, Jenkins2d, Law, LawInfo,
    LuGre, Stribeck, Valanis,
};
use stickslip_verification::law_driver::{Instant, View, dissipated, forces, steps};
use stickslip_verification::{close, integral, near, zero};

/// Returns a motion through points, straight and at constant speed, one second from point to
/// point.
fn through(points: Vec<[f64; 3]>) -> impl Fn(f64) -> Instant {
    move |time| {
        // a corner belongs to the segment before it
        let k = ((time.ceil() as usize).max(1) - 1).min(points.len() - 2);
        let share = time - k as f64;
        let way = [0, 1, 2].map(|a| points[k + 1][a] - points[k][a]);
        ([0, 1, 2].map(|a| points[k][a] + way[a] * share), way)
    }
}

/// Returns such a motion along one direction.
fn along(places: &[f64]) -> impl Fn(f64) -> Instant + use<> {
    through(places.iter().map(|&u| [u, 0.0, 0.0]).collect())
}

/// Samples between two points; a power of two makes the times exact.
const FINE: usize = 1 << 14;

/// Returns the force along the first direction at the samples of a motion through places.
fn first(law: &dyn Law, view: View, places: &[f64], samples: usize) -> Vec<f64> {
    let times = steps(1.0, places.len() - 1, samples);
    forces(law, view, &along(places), &times).iter().map(|force| force[0]).collect()
}

/// Returns the energy lost over the last two segments.
fn loop_loss(law: &dyn Law, view: View, places: &[f64], samples: usize) -> f64 {
    let times = steps(1.0, places.len() - 1, samples);
    let found = forces(law, view, &along(places), &times);
    let from = times.len() - 1 - 2 * samples;
    dissipated(&along(places), &times[from..], &found[from..])
}

/// Returns the places from zero and then back and forth three times.
fn cycles(a: f64) -> [f64; 8] {
    [0.0, a, -a, a, -a, a, -a, a]
}

/// (11.1): the loss of a Jenkins loop and its equivalent stiffness and damping.
#[test]
fn theory_11_1_jenkins_loops_have_the_area_and_the_harmonic_of_their_closed_form() {
    // `kt`, `a`, loss, stiffness and damping for a slip limit of 1
    for (stiffness, a, loss, keq, ceq) in [
        (1.0, 1.25, 1.0, 0.857_622, 0.203_718),
        (1.0, 2.00, 4.0, 0.5, 1.0 / PI),
        (1.0, 2.75, 7.0, 0.328_553, 0.294_634),
        (5.0, 1.25, 4.2, 0.516_377, 0.855_617),
        (5.0, 2.00, 7.2, 0.260_220, 0.572_958),
        (5.0, 2.75, 10.2, 0.162_800, 0.429_324),
    ] {
        let law = Jenkins { stiffness, limit: 1.0 };
        // the places where slip begins are corners
        let slip = a - 2.0 / stiffness;
        let places = [0.0, a, slip, -a, -slip, a];
        let times = steps(1.0, 5, 1);
        let found = forces(&law, View::Pieces, &along(&places), &times);
        near("loss", dissipated(&along(&places), &times[1..], &found[1..]), loss, 1e-12);
        let linear = law.describing_function(a, 3.0);
        near("stiffness", linear.re, keq, 5e-7);
        near("damping", linear.im, ceq, 5e-7);
    }
}

/// (11.2): loss, stiffness and damping under a circular motion in the plane.
#[test]
fn theory_11_2_circular_motion_slips_all_the_time() {
    let (stiffness, limit, a) = (3.0, 1.0, 0.8);
    let law = Jenkins2d { stiffness, limit };
    let motion = |time: f64| {
        let (sin, cos) = (TAU * time).sin_cos();
        ([a * cos, a * sin, 0.0], [-a * TAU * sin, a * TAU * cos, 0.0])
    };
    const COUNT: usize = 8192;
    let times = steps(1.0, 5, COUNT);
    let found = forces(&law, View::Step, &motion, &times);
    let (last, from) = (&times[4 * COUNT..], &found[4 * COUNT..]);
    let d = limit / stiffness;
    close("loss", dissipated(&motion, last, from), TAU * limit * (a * a - d * d).sqrt(), 1e-6);
    let mut sum = Complex64::new(0.0, 0.0);
    for (time, force) in last[1..].iter().zip(&from[1..]) {
        sum += Complex64::cis(-TAU * time) * force[0];
    }
    let stiffness = sum * (2.0 / (COUNT as f64 * a));
    near("stiffness", stiffness.re, 0.520_833_3, 1e-6);
    near("damping", stiffness.im, 1.136_324_2, 1e-6);
}

/// (11.3): a normal load in phase with the tangential motion.
#[test]
fn theory_11_3_a_normal_load_in_phase_makes_a_polygon() {
    let (mu, preload, kt, nu, a) = (0.4, 10.0, 20.0, 6.0, 1.0);
    for tangents in [1, 2] {
        let law = FrictionContact { tangential: kt, normal: nu, friction: mu, preload, tangents };
        let (u1, u2) = (0.428_571_428_571_428_6, -0.818_181_818_181_818_2);
        near("u1", ((kt - mu * nu) * a - 2.0 * mu * preload) / (kt + mu * nu), u1, 1e-12);
        near("u2", (2.0 * mu * preload - (kt + mu * nu) * a) / (kt - mu * nu), u2, 1e-12);
        // the normal moves with the tangent, and the places where slip begins are corners
        let points = |u: f64| if tangents == 1 { [u, u, 0.0] } else { [u, 0.0, u] };
        let motion = through([0.0, a, u1, -a, u2, a, u1, -a, u2, a].map(points).to_vec());
        for samples in [1, 8] {
            let times = steps(1.0, 9, samples);
            let found = forces(&law, View::Step, &motion, &times);
            let at = |corner: usize| found[corner * samples][0];
            near("at a", at(9), mu * (preload + nu * a), 1e-12);
            near("slip back begins", at(6), -mu * (preload + nu * u1), 1e-12);
            near("at -a", at(7), -mu * (preload - nu * a), 1e-12);
            near("slip forward begins", at(8), mu * (preload + nu * u2), 1e-12);
            let tangential: Vec<_> = found[5 * samples..].iter().map(|force| [force[0], 0.0, 0.0]).collect();
            near("loss", dissipated(&motion, &times[5 * samples..], &tangential), 12.051_948_051_948_05, 1e-7);
            near("normal", found[9 * samples][tangents], preload + nu * a, 1e-12);
        }
    }
}

/// (11.4): the four-parameter Iwan model by parallel sliders.
#[test]
fn theory_11_4_iwan_has_segalmans_backbone_and_loss() {
    let law = |elements: u32| Iwan { stiffness: 10.0, limit: 1.0, chi: -0.5, beta: 0.3, elements };
    let far = law(1).slip_displacement();
    close("phi_max", far, 1.3 / (10.0 * (0.3 + 0.5 / 1.5)), 1e-14);
    let u = 0.4 * far;
    for elements in [32, 62, 250, 1000] {
        let loss = loop_loss(&law(elements), View::Pieces, &cycles(u), FINE);
        // the promised error of the law
        close("loss", loss, 0.017_491_512_6, 0.024 * 32.0 / f64::from(elements));
    }
    // first loading: `R u^(χ+2) / (χ+2) + u (R (φ^(χ+1) - u^(χ+1)) / (χ+1) + S)`
    let d = 0.3 + 0.5 / 1.5;
    let (r, s) = (0.5 / (far.powf(1.5) * d), 1.0 / far * 0.3 / d);
    for share in [0.05, 0.4, 0.9, 1.0] {
        let u = share * far;
        let expected = r * u.powf(1.5) / 1.5 + u * (r * (far.sqrt() - u.sqrt()) / 0.5 + s);
        let force = first(&law(1000), View::Pieces, &[0.0, u], 1);
        close("backbone", force[1], expected, 5e-4);
    }
    near("all slips", first(&law(1000), View::Pieces, &[0.0, 2.0 * far], 1)[1], 1.0, 1e-12);
    close("at rest", law(32).describing_function(1e-12, 1.0).re, 10.0, 1e-12);
}

/// (11.4) without sliders: the law itself. Amplitudes go from a thousandth of full slip to
/// beyond it; cases include exponents near -1 and `beta = 0`.
#[test]
fn theory_11_4_iwan_is_exact() {
    for (chi, beta) in [(-0.5, 0.3), (-0.5, 0.0), (-0.95, 0.0), (-0.99, 0.2), (-0.1, 3.0), (0.0, 0.0)] {
        let law = Iwan { stiffness: 10.0, limit: 1.0, chi, beta, elements: 0 };
        let far = law.slip_displacement();
        let d = beta + (chi + 1.0) / (chi + 2.0);
        let (r, s) = ((chi + 1.0) / (far.powf(chi + 2.0) * d), beta / (far * d));
        close("phi_max", far, (1.0 + beta) / (10.0 * d), 1e-14);
        for share in [1e-3, 0.05, 0.4, 0.9, 1.0] {
            let u = share * far;
            let expected = r * u.powf(chi + 2.0) / (chi + 2.0)
                + u * (r * (far.powf(chi + 1.0) - u.powf(chi + 1.0)) / (chi + 1.0) + s);
            close("backbone", first(&law, View::Step, &[0.0, u], 1)[1], expected, 1e-12);
            let loss = 4.0 * r * u.powf(chi + 3.0) / ((chi + 2.0) * (chi + 3.0));
            // the trapezoidal rule has an error of the square of its step, somewhat more at the
            // vertical tangent after a turning point
            let [coarse, fine] =
                [FINE, 4 * FINE].map(|samples| loop_loss(&law, View::Step, &cycles(u), samples) - loss);
            assert!(
                fine.abs() < 1e-8 * u && fine.abs() < 0.3 * coarse.abs() + 1e-12 * u,
                "{chi} {beta} {share}: {coarse:e} {fine:e}"
            );
        }
        let beyond = 2.0 * far;
        let loss = 4.0 * r * far.powf(chi + 3.0) / ((chi + 2.0) * (chi + 3.0)) + 4.0 * (beyond - far);
        close("beyond full slip", loop_loss(&law, View::Step, &cycles(beyond), FINE), loss, 1e-6);
    }
    let law = Iwan { stiffness: 10.0, limit: 1.0, chi: -0.5, beta: 0.3, elements: 0 };
    let loss = loop_loss(&law, View::Step, &cycles(0.4 * law.slip_displacement()), FINE);
    close("loss", loss, 0.017_491_512_553_529_69, 1e-7);
}

/// Returns the loss of a cycle of sliders to the last digits; all places where a slider begins
/// to slip are corners.
fn exact_loop_loss(law: &Iwan, u: f64) -> f64 {
    let mut slips: Vec<f64> = law
        .ideal_elements()
        .unwrap()
        .iter()
        .filter_map(|piece| match piece {
            IdealElement::Slider(slider) => {
                Some(2.0 * slider.limit / slider.stiffness.unwrap()).filter(|way| *way < 2.0 * u)
            }
            IdealElement::Stop { .. } => None,
        })
        .collect();
    slips.sort_by(f64::total_cmp);
    let way = |from: f64| std::iter::once(from).chain(slips.iter().map(move |slip| from - from.signum() * slip));
    let places: Vec<f64> = std::iter::once(0.0).chain(way(u)).chain(way(-u)).chain([u]).collect();
    let times = steps(1.0, places.len() - 1, 1);
    let found = forces(law, View::Pieces, &along(&places), &times);
    dissipated(&along(&places), &times[1..], &found[1..])
}

/// (11.4) to all given digits, by extrapolation over the number of elements.
///
/// At an amplitude on the edge between the shares of two sliders, the force of first loading is
/// exact. The error of the loss is then a series in powers of `1 / elements`, which few
/// elements determine. Shares are graded by `exp(1.5 / √elements)`, so four and nine times as
/// many sliders have the same edges.
#[test]
fn theory_11_4_iwan_tends_to_segalmans_loss() {
    let law = |elements: u32| Iwan { stiffness: 10.0, limit: 1.0, chi: -0.5, beta: 0.3, elements };
    let far = law(1).slip_displacement();
    let d = 0.3 + 0.5 / 1.5;
    let (r, s) = (0.5 / (far.powf(1.5) * d), 1.0 / far * 0.3 / d);
    // value at zero of the polynomial in `1 / elements` through the losses
    let tends_to = |counts: &[u32], u: f64| {
        let weighted = |&count: &u32| {
            let others = counts.iter().filter(|other| **other != count);
            let weight: f64 = others.map(|&other| f64::from(count) / (f64::from(count) - f64::from(other))).product();
            weight * exact_loop_loss(&law(count), u)
        };
        counts.iter().map(weighted).sum::<f64>()
    };
    let counts = [62, 248, 558, 992];
    for edge in [2.0f64, 5.0, 9.0, 20.0] {
        let u = (-1.5 * edge / f64::from(counts[0]).sqrt()).exp() * far;
        close("loss", tends_to(&counts, u), 4.0 * r * u.powf(2.5) / (1.5 * 2.5), 1e-11);
        let expected = r * u.powf(1.5) / 1.5 + u * (r * (far.sqrt() - u.sqrt()) / 0.5 + s);
        for count in counts {
            close("backbone", first(&law(count), View::Pieces, &[0.0, u], 1)[1], expected, 1e-14);
            // a third of the error that the law promises between edges
            let off = 1.0 - exact_loop_loss(&law(count), u) / (4.0 * r * u.powf(2.5) / (1.5 * 2.5));
            assert!((0.27..0.29).contains(&(off.abs() * f64::from(count))), "{off:e}");
        }
    }
    // 0.4 is an edge of 67 sliders up to 2e-5, and the loss depends on the square of that; no
    // fourth such number exists up to 1000
    close("loss", tends_to(&[67, 268, 603], 0.4 * far), 0.017_491_512_553_529_69, 1e-8);
}

/// (11.5): the loop of Dahl's model.
#[test]
fn theory_11_5_dahls_loop_is_a_hyperbolic_tangent() {
    let law = Dahl { stiffness: 5.0, limit: 1.0 };
    let places = cycles(0.7);
    near("largest force", *first(&law, View::Rate, &places, FINE).last().unwrap(), 0.998_177_897_6, 1e-10);
    close("loss", loop_loss(&law, View::Rate, &places, FINE), 2.001_457_681_9, 1e-8);
}

/// (11.6): Bouc-Wen and LuGre contain Dahl's model.
#[test]
fn theory_11_6_bouc_wen_and_lugre_contain_dahl() {
    let dahl = Dahl { stiffness: 5.0, limit: 2.0 };
    let bouc_wen = BoucWen { stiffness: 5.0, beta: 2.5, gamma: 0.0, exponent: 1.0 };
    let lugre = LuGre { stiffness: 5.0, damping: 0.0, viscous: 0.0, limit: 2.0, static_limit: 2.0, velocity: 0.3 };
    let places = [0.0, 0.7, -0.2, 0.4, -1.5, 0.1];
    let reference = first(&dahl, View::Rate, &places, 256);
    for law in [&bouc_wen as &dyn Law, &lugre] {
        for (found, expected) in first(law, View::Rate, &places, 256).iter().zip(&reference) {
            near(law.name(), *found, *expected, 1e-12);
        }
    }
    near("bound", bouc_wen.force_scale(), 2.0, 1e-14);
}

/// (11.15): a long motion to one side ends at the bound for any gamma and exponent. Without
/// `beta + gamma > 0` no bound exists, and the law is refused.
#[test]
fn theory_11_15_bouc_wen_is_bounded_if_beta_and_gamma_are_positive_together() {
    for (beta, gamma, exponent) in [(1.0, 0.5, 1.0), (1.0, -0.6, 2.0), (0.5, 3.0, 1.5), (2.0, 0.0, 6.0)] {
        let law = BoucWen { stiffness: 3.0, beta, gamma, exponent };
        let bound = 3.0 * (beta + gamma).powf(-1.0 / exponent);
        let force = first(&law, View::Rate, &[0.0, 40.0, -40.0], FINE);
        near("forward", force[FINE], bound, 1e-9);
        near("backward", force[2 * FINE], -bound, 1e-9);
        assert!(force.iter().all(|force| force.abs() <= bound * (1.0 + 1e-6)));
    }
    for gamma in [-1.0, -2.0] {
        let law = BoucWen { stiffness: 3.0, beta: 1.0, gamma, exponent: 1.0 };
        let law: &dyn Law = &law;
        assert!(law.check().unwrap_err().to_string().contains("`beta + gamma`"));
    }
}

#[test]
fn theory_11_6_lugre_slides_steadily_with_its_curve_and_holds_like_a_spring() {
    let law = LuGre { stiffness: 1e4, damping: 30.0, viscous: 0.4, limit: 2.0, static_limit: 2.5, velocity: 0.01 };
    for v in [-0.5, 0.005, 0.02, 1.0] {
        // one second at this velocity
        let force = *first(&law, View::Rate, &[0.0, v], FINE).last().unwrap();
        let share: f64 = v / 0.01;
        near("sliding", force, (2.0 + 0.5 * (-share * share).exp()).copysign(v) + 0.4 * v, 1e-6);
    }
    // slow enough that dampers carry nothing, short enough that bristles do not slip
    let force = *first(&law, View::Rate, &[0.0, 1e-9], 64).last().unwrap();
    close("stiction", force, 1e4 * 1e-9, 0.01);
}

/// Parallel sliders with a given force of first loading, linear between its corners.
#[derive(Debug)]
struct Graded(Vec<IdealElement>);

static GRADED: LawInfo = LawInfo {
    name: "graded",
    summary: "sliders whose force of first loading is a polygon",
    parameters: &[],
    sample: &[],
    build: |_| Arc::new(Graded(Vec::new())),
};

impl Law for Graded {
    fn info(&self) -> &'static LawInfo {
        &GRADED
    }
    fn values(&self) -> Vec<f64> {
        Vec::new()
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        Some(self.0.clone())
    }
}

impl Graded {
    /// Makes the law with corners at these displacements; it slips fully beyond the last one.
    fn new(corners: &[f64], backbone: impl Fn(f64) -> f64) -> Self {
        let mut edges = vec![0.0];
        edges.extend(corners);
        let mut slopes: Vec<f64> =
            edges.windows(2).map(|pair| (backbone(pair[1]) - backbone(pair[0])) / (pair[1] - pair[0])).collect();
        slopes.push(0.0);
        // the slider that slips at a corner has the change of slope as its stiffness
        let piece =
            |k: usize| IdealElement::slider(Some(slopes[k] - slopes[k + 1]), (slopes[k] - slopes[k + 1]) * corners[k]);
        Graded((0..corners.len()).map(piece).collect())
    }
}

/// (11.7): an elastic bar on rigid-plastic shear, the limit of many sliders of the micro-slip
/// model of Goodman and Klumpp.
#[test]
fn theory_11_7_micro_slip_of_a_bar_loses_with_the_cube_of_the_force() {
    let (ea, tau, length) = (7.0, 0.4, 2.0);
    let far = tau * length * length / (2.0 * ea);
    let corners: Vec<f64> = (1..=1000).map(|k| far * (f64::from(k) / 1000.0).powi(2)).collect();
    let law = Graded::new(&corners, |u| (2.0 * ea * tau * u).sqrt());
    for share in [0.2, 0.64, 1.0] {
        let u = share * far;
        let force = (2.0 * ea * tau * u).sqrt();
        let loss = loop_loss(&law, View::Pieces, &cycles(u), FINE);
        close("by force and displacement", loss, 4.0 / 3.0 * force * u, 1e-4);
        close("by force", loss, 2.0 / 3.0 * force.powi(3) / (ea * tau), 1e-4);
    }
    near("all slips", first(&law, View::Pieces, &[0.0, 2.0 * far], 1)[1], tau * length, 1e-12);
}

/// (11.8): the tangential contact of spheres.
#[test]
fn theory_11_8_spheres_of_cattaneo_and_mindlin() {
    let (limit, far) = (1.3, 0.02);
    let backbone = |u: f64| limit * (1.0 - (1.0 - (u / far).min(1.0)).powf(1.5));
    let corners: Vec<f64> = (1..=1000).map(|k| far * f64::from(k) / 1000.0).collect();
    let law = Graded::new(&corners, backbone);
    for share in [0.3, 0.7, 1.0] {
        let u = share * far;
        let rest: f64 = 1.0 - share;
        let expected =
            8.0 * limit * (u - 0.4 * far * (1.0 - rest.powf(2.5))) - 4.0 * u * limit * (1.0 - rest.powf(1.5));
        close("loss", loop_loss(&law, View::Pieces, &cycles(u), FINE), expected, 1e-4);
    }
}

/// (11.9), Masing's rule: after a turning point the force is that of first loading at twice the
/// scale. The loss follows from the first loading alone.
#[test]
fn theory_11_9_sliders_obey_masings_rule() {
    let iwan = Iwan { stiffness: 10.0, limit: 1.0, chi: -0.3, beta: 0.2, elements: 12 };
    let jenkins = Jenkins { stiffness: 10.0, limit: 1.0 };
    let exact = Iwan { elements: 0, ..iwan };
    for (law, view) in [(&iwan as &dyn Law, View::Pieces), (&jenkins, View::Pieces), (&exact, View::Step)] {
        let u = 0.13;
        let backbone = first(law, view, &[0.0, u], FINE);
        let loop_force = first(law, view, &[0.0, u, -u], FINE);
        for k in (0..=FINE).step_by(512) {
            // half of `u - u_r` goes from zero to `u`
            near(law.name(), loop_force[FINE + k], backbone[FINE] - 2.0 * backbone[k], 1e-12);
        }
        let under: f64 = backbone.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]) * u / FINE as f64).sum();
        let expected = 8.0 * under - 4.0 * u * backbone[FINE];
        close(law.name(), loop_loss(law, view, &cycles(u), FINE), expected, 1e-6);
    }
}

/// (11.10): along straight segments a step of any length is exact, so the forces at the corners
/// do not depend on the samples between them.
#[test]
fn theory_11_10_steps_do_not_depend_on_their_length() {
    let plane = Jenkins2d { stiffness: 3.0, limit: 1.0 };
    let contact = |tangents| FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.6, preload: 0.5, tangents };
    let points: Vec<[f64; 3]> = (0..40)
        .map(|k| {
            let t = f64::from(k);
            [0.8 * (1.1 * t).sin(), 0.7 * (1.7 * t).cos() - 0.7, 0.9 * (2.3 * t).sin()]
        })
        .collect();
    for law in [&plane as &dyn Law, &contact(1), &contact(2)] {
        let run = |samples: usize| forces(law, View::Step, &through(points.clone()), &steps(1.0, 39, samples));
        let (long, short) = (run(1), run(64));
        for (k, force) in long.iter().enumerate() {
            for a in 0..3 {
                near(law.name(), force[a], short[64 * k][a], 1e-11);
            }
        }
    }
}

/// (11.11): a contact in the plane opens and closes under harmonic motion. The error of its
/// steps is of second order.
#[test]
fn theory_11_11_separation_costs_no_order_of_accuracy() {
    let law = FrictionContact { tangential: 20.0, normal: 15.0, friction: 0.4, preload: 2.0, tangents: 2 };
    let motion = |time: f64| {
        let theta = TAU * time;
        let u = [0.5 * theta.cos(), 0.4 * (theta + 1.0).sin(), 0.3 * (theta - 0.4).cos()];
        (u, [0.0; 3])
    };
    let run = |count: usize| {
        let times = steps(1.0, 3, count);
        let found = forces(&law, View::Step, &motion, &times);
        let open = found[2 * count..].iter().filter(|force| force[2] == 0.0).count();
        assert!(open > count / 4 && open < count * 3 / 4, "it is apart for {open} of {count} samples");
        dissipated(&motion, &times[2 * count..], &found[2 * count..])
    };
    let reference = run(1 << 17);
    let errors = [512, 2048, 8192].map(|count| (run(count) / reference - 1.0).abs());
    assert!(errors[1] < errors[0] / 10.0 && errors[2] < errors[1] / 10.0, "of second order: {errors:?}");
}

/// Returns the loss of a cycle of a contact along one tangent, computed from its events.
///
/// `T` is zero when the faces meet and then follows its spring until it reaches `mu N`. It
/// slips until `|T|` would grow faster than its limit. The motion is `u = a cos θ`,
/// `N = preload + load cos(θ - lag)`, with θ from contact to separation.
fn loss_by_events(kt: f64, mu: f64, a: f64, [preload, load, lag]: [f64; 3]) -> f64 {
    const SCAN: usize = 4000;
    let (u, normal) = (|t: f64| a * t.cos(), |t: f64| preload + load * (t - lag).cos());
    let half = (-preload / load).acos();
    let [begin, end] = [lag - half, lag + half];
    let bisect = |of: &dyn Fn(f64) -> f64, from: f64| {
        let at = |i: usize| from + (end - from) * i as f64 / SCAN as f64;
        (1..SCAN).find(|&i| of(at(i)) > 0.0).map(|i| if i == 1 { from } else { zero(of, [at(i - 1), at(i)]) })
    };
    let (mut t, mut place, mut loss) = (begin, u(begin), 0.0);
    loop {
        // stuck: the force of the spring
        let spring = |t: f64| kt * (u(t) - place);
        let slips = bisect(&|t| spring(t).abs() - mu * normal(t), t);
        let until = slips.unwrap_or(end);
        loss += integral(|s| spring(t + s) * -a * (t + s).sin(), until - t, &[]);
        if slips.is_none() {
            return loss;
        }
        let side = spring(until).signum();
        let limit = |t: f64| side * mu * normal(t);
        // slip ends when the force of the spring would change more slowly than the limit
        let slower = |t: f64| mu * -load * (t - lag).sin() - side * kt * -a * t.sin();
        let sticks = bisect(&slower, until).unwrap_or(end);
        loss += integral(|s| limit(until + s) * -a * (until + s).sin(), sticks - until, &[]);
        if sticks >= end {
            return loss;
        }
        (t, place) = (sticks, u(sticks) - limit(sticks) / kt);
    }
}

/// (11.11): "no force when the faces meet again" and "the slider keeps its place" describe one
/// law.
///
/// In the step in which contact closes, the law counts only the closed part of the step. It
/// agrees with the computation by events to second order. Plain steps of either description
/// count the whole step, and tend to the same law to first order. In the first motion the faces
/// stick when they meet, in the second they slip.
#[test]
fn theory_11_11_both_readings_of_separation_are_one_law() {
    const FIRST_ORDER: std::ops::RangeInclusive<f64> = 1e-8..=9e-5;
    let (kt, kn, preload, a, depth) = (20.0, 15.0, 2.0, 0.5, 0.3);
    for (mu, lag) in [(0.4, 2.1), (2.5, 0.9)] {
        let expected = loss_by_events(kt, mu, a, [preload, kn * depth, lag]);
        let motion = |time: f64| {
            let theta = TAU * time;
            ([a * theta.cos(), depth * (theta - lag).cos(), 0.0], [0.0; 3])
        };
        let off = |times: &[f64], tangential: &[f64]| {
            let found: Vec<_> = tangential.iter().map(|force| [*force, 0.0, 0.0]).collect();
            let from = times.len() / 3 * 2;
            (dissipated(&motion, &times[from..], &found[from..]) / expected - 1.0).abs()
        };
        let law = FrictionContact { tangential: kt, normal: kn, friction: mu, preload, tangents: 1 };
        let own = |count: usize| {
            let times = steps(1.0, 3, count);
            let found = forces(&law, View::Step, &motion, &times);
            off(&times, &found.iter().map(|force| force[0]).collect::<Vec<_>>())
        };
        let plain = |keeps: bool, count: usize| {
            let times = steps(1.0, 3, count);
            let mut place = 0.0;
            let force = |&time: &f64| {
                let ([u, un, _], _) = motion(time);
                let limit = mu * (preload + kn * un).max(0.0);
                let force = (kt * (u - place)).clamp(-limit, limit);
                if limit > 0.0 || !keeps {
                    place = u - force / kt;
                }
                force
            };
            off(&times, &times.iter().map(force).collect::<Vec<_>>())
        };
        let errors = [1024, 4096, 16384].map(own);
        assert!(errors[1] < errors[0] / 10.0 && errors[2] < errors[1] / 10.0, "of second order: {errors:?}");
        assert!(own(1 << 16) < 1e-8, "{:e}", own(1 << 16));
        for keeps in [false, true] {
            // the instant of closing within a step is arbitrary: take the largest error of
            // several counts
            let largest = |near: usize| (0..8).map(|k| plain(keeps, near + 7 * k)).fold(0.0, f64::max);
            let [long, short] = [1 << 13, 1 << 16].map(largest);
            assert!(FIRST_ORDER.contains(&short), "{keeps}: {short:e}");
            assert!(short < 0.5 * long, "{keeps}: {long:e} {short:e}");
        }
    }
}

/// (11.14): below full slip, only the mean force of Iwan's model depends on its history;
/// amplitude and loss do not.
#[test]
fn theory_11_14_iwan_remembers_in_its_mean_alone() {
    let law = Iwan { stiffness: 10.0, limit: 1.0, chi: -0.5, beta: 0.3, elements: 64 };
    let (a, far) = (0.4 * law.slip_displacement(), law.slip_displacement());
    let measured = [vec![0.0], vec![0.0, 0.9 * far], vec![0.0, -0.7 * far, 0.5 * far]].map(|mut places| {
        places.extend([a, -a, a, -a, a, -a, a]);
        let force = first(&law, View::Pieces, &places, 64);
        let (up, down) = (force[force.len() - 1], force[force.len() - 1 - 64]);
        (0.5 * (up + down), 0.5 * (up - down), loop_loss(&law, View::Pieces, &places, FINE))
    });
    near("the untouched joint", measured[0].0, 0.0, 1e-14);
    for (mean, amplitude, loss) in &measured[1..] {
        assert!(mean.abs() > 1e-3, "{mean}");
        near("amplitude", *amplitude, measured[0].1, 1e-12);
        near("loss", *loss, measured[0].2, 1e-7);
    }
}

/// Between turning points `du = dy (1 - kappa y) / (lambda ((1 - y) - (Et/E0) (1 - kappa y)))`.
/// The integral is a logarithm.
#[test]
fn valanis_turns_along_a_logarithm() {
    let law = Valanis { stiffness: 10.0, slip_stiffness: 2.0, lambda: 3.0, kappa: 0.7 };
    let (ratio, kappa, lambda) = (0.2, 0.7, 3.0);
    // `(1 - κ y) / (A - B y)`
    let (a, b) = (1.0 - ratio, 1.0 - ratio * kappa);
    let place = |y: f64| (kappa / b * y - (1.0 - kappa * a / b) / b * (1.0 - b / a * y).ln()) / lambda;
    for y in [0.1, 0.5, 0.85] {
        let u = place(y);
        let force = first(&law, View::Rate, &[0.0, u], 1024)[1024];
        near("first loading", force, 2.0 * u + 10.0 / 3.0 * y, 1e-9);
        // back by the distance from -y to y: the mirrored curve
        let way = place(y) - place(-y);
        let back = first(&law, View::Rate, &[0.0, u, u - way], 1024)[2048];
        near("turned", back, 2.0 * (u - way) - 10.0 / 3.0 * y, 1e-9);
    }
    let far = first(&law, View::Rate, &[0.0, 30.0], FINE)[FINE];
    near("slip", far, 2.0 * 30.0 + law.force_scale(), 1e-9);
}

#[test]
fn springs_of_any_shape_lose_nothing() {
    let cubic = Cubic { stiffness: 3.0 };
    let gap = Gap { gap: 0.2, stiffness: 5.0 };
    for law in [&cubic as &dyn Law, &gap] {
        let loss = loop_loss(law, View::Rate, &cycles(0.8), FINE);
        near(law.name(), loss, 0.0, 1e-12);
    }
    near("cubic", first(&cubic, View::Rate, &[0.0, 0.5], 1)[1], 0.375, 1e-15);
    // closed while `cos θ > gap / a`: `(k/π) (θ - sin θ cos θ)`
    let closed = (0.2f64 / 0.8).acos();
    let expected = 5.0 / PI * (closed - closed.sin() * closed.cos());
    close("gap", gap.describing_function(0.8, 1.0).re, expected, 1e-14);
}

#[test]
fn stribecks_describing_function_is_a_mean_of_its_curve() {
    let law = Stribeck { limit: 2.0, static_limit: 2.5, velocity: 0.01 };
    for (a, omega) in [(1e-4, 30.0), (1e-3, 10.0), (1e-3, 100.0)] {
        // `(4 / (π a)) ∫₀^{π/2} g(a Ω sin θ) sin θ dθ`
        let friction = |theta: f64| {
            let share: f64 = a * omega * theta.sin() / 0.01;
            (2.0 + 0.5 * (-share * share).exp()) * theta.sin()
        };
        let expected = 4.0 / (PI * a) * integral(friction, PI / 2.0, &[]);
        let found = law.describing_function(a, omega);
        close("damping", found.im, expected, 1e-3);
        near("stiffness", found.re, 0.0, 1e-3 * expected);
    }
}

/// `tanh ln k = (k² - 1)/(k² + 1)`.
#[test]
fn coulomb_tanh_has_its_forces() {
    let law = CoulombTanh { limit: 2.0, velocity: 0.03 };
    for (k, share) in [(1.0f64, 0.0), (2.0, 0.6), (3.0, 0.8), (7.0, 0.96)] {
        for (velocity, expected) in [(0.03 * k.ln(), 2.0 * share), (-0.03 * k.ln(), -2.0 * share)] {
            let motion = move |time: f64| ([velocity * time, 0.0, 0.0], [velocity, 0.0, 0.0]);
            for view in [View::Rate, View::Prox] {
                let found = forces(&law, view, &motion, &[0.0, 1.0])[1][0];
                // the driver asks the resolvent with a penalty of 1e6 N s/m, so its argument rounds
                let argument = if view == View::Prox { 1e6 * velocity.abs() } else { 1.0 };
                near(&format!("{view:?}"), found, expected, 16.0 * f64::EPSILON * argument.max(1.0));
            }
        }
    }
    // far beyond the limit there is no overflow
    let fast = |time: f64| ([1e6 * time, 0.0, 0.0], [1e6, 0.0, 0.0]);
    near("fast", forces(&law, View::Rate, &fast, &[0.0, 1.0])[1][0], 2.0, 0.0);
}

/// The loss of a cycle under `u = a cos Ωt`, `W = limit a ∮ tanh(z cos θ) cos θ dθ` with
/// `z = aΩ/velocity`. Reference: `scipy.integrate.quad`. Limits: `π z limit a` for a small z, and
/// `(4 - π²/(6 z²)) limit a` for a large one.
#[test]
fn coulomb_tanh_loses_the_integral_of_its_force() {
    let (a, omega, limit) = (1e-3, 50.0, 2.0);
    let integrals = [
        (1e-3, 1e-3 * PI),
        (0.5, 1.480_138_846_758_928_5),
        (1.0, 2.549_954_369_506_768),
        (3.0, 3.793_113_647_195_051_3),
        (100.0, 4.0 - PI * PI / 6e4),
    ];
    for (z, integral) in integrals {
        let law = CoulombTanh { limit, velocity: a * omega / z };
        let motion = |time: f64| {
            let (sine, cosine) = (omega * time).sin_cos();
            ([a * cosine, 0.0, 0.0], [-a * omega * sine, 0.0, 0.0])
        };
        let times = steps(TAU / omega, 1, FINE);
        for view in [View::Rate, View::Prox] {
            let loss = dissipated(&motion, &times, &forces(&law, view, &motion, &times));
            near(&format!("{z} {view:?}"), loss / (limit * a), integral, 1e-6);
        }
        // the work of the first harmonic is the loss: `W = π a² Im k`
        let harmonic = PI * a * a * law.describing_function(a, omega).im;
        near(&format!("{z} first harmonic"), harmonic / (limit * a), integral, 1e-2 * integral);
    }
}
