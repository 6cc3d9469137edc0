//! Steel blocks of 5 mm elements, fixed at one face or free.

use super::brick::Brick;
use std::f64::consts::TAU;
use stickslip::structure::reduction::{
    AutomaticReduction, FullStructure, ReferenceReceptance, ResidualSeries, RubinBasis, StructureDamping,
};
use stickslip_numerics::sparse::{ModeSelection, NaturalModes, SymbolicAnalysis};

/// Ratio of the highest retained mode to the highest frequency of interest.
const BEYOND: f64 = 2.0;
/// Ratio of the highest fixed-interface mode to the highest frequency of interest.
const BEYOND_HELD: f64 = 4.0;
const EDGE: f64 = 0.005;

fn brick(elements: [usize; 3], held: bool) -> Brick {
    Brick::new(elements, elements.map(|e| EDGE * e as f64), held)
}

/// Eigenvalues, rad²/s², from `benches/peers/scipy_brick.py` for
/// `{"elements": [16, 8, 7], "modes": 20}` (SciPy 1.17.1: eigsh with sigma = 0 and SuperLU).
/// The script assembles the block independently.
const HELD: [f64; 20] = [
    6.747094462738e+08,
    8.216043066283e+08,
    3.418826299394e+09,
    1.058807166506e+10,
    1.103865626639e+10,
    1.181543752095e+10,
    3.083625505158e+10,
    5.006904345575e+10,
    5.215056383280e+10,
    8.214040469061e+10,
    8.516788256294e+10,
    8.883642423883e+10,
    9.197949725741e+10,
    9.524084407521e+10,
    1.175982181304e+11,
    1.207111210383e+11,
    1.217182257451e+11,
    1.369173223432e+11,
    1.413310583697e+11,
    1.445936595748e+11,
];
/// Eigenvalues for `{"elements": [12, 5, 4], "modes": 14, "held": false}`, without the six free
/// motions.
const FREE: [f64; 8] = [
    2.126849798549e+10,
    2.368365769307e+10,
    2.710344415011e+10,
    7.224513140387e+10,
    9.265675431895e+10,
    9.548392921067e+10,
    9.749962931658e+10,
    2.110421741226e+11,
];

#[test]
fn modes_are_those_of_scipy() {
    let (held, free) = (brick([16, 8, 7], true), brick([12, 5, 4], false));
    for (brick, wanted, expected) in
        [(held, ModeSelection::Lowest(20), &HELD[..]), (free, ModeSelection::Lowest(14), &FREE[..])]
    {
        let analysis = SymbolicAnalysis::new(&[&brick.stiffness, &brick.mass]);
        let modes = NaturalModes::new(&analysis, &brick.stiffness, &brick.mass, wanted).unwrap();
        let rigid = modes.count() - expected.len();
        // the rounding error of free motions is relative to the largest eigenvalue, 1e13
        // rad²/s²
        assert!(modes.values[..rigid].iter().all(|value| value.abs() < 0.1), "{:?}", modes.values);
        for (value, expected) in modes.values[rigid..].iter().zip(expected) {
            assert!((value / expected - 1.0).abs() < 1e-10, "{value:.12e} instead of {expected:.12e}");
        }
    }
}

/// Ports at 16 nodes of the free face. Frequencies of the reduced block agree with those of the
/// whole much better than 0.1 %. The errors of receptances correspond to the omitted modes.
#[test]
fn reductions_of_the_block() {
    let brick = brick([12, 6, 5], true);
    let up_to = TAU * 40e3;
    let (mass, stiffness, ports) = (brick.mass.clone(), brick.stiffness.clone(), brick.face(16));
    assert_eq!((brick.dofs(), ports.len()), (1512, 48));
    let whole = FullStructure::new(mass, StructureDamping::Ratio { ratio: 0.005, up_to }, stiffness, ports).unwrap();
    let modes = whole.modes(BEYOND * up_to).unwrap();
    let inside = modes.values.partition_point(|value| *value < up_to * up_to);
    assert!(inside > 5, "{inside}");
    let reference = ReferenceReceptance::new(&whole, &modes, up_to).unwrap();
    let free = RubinBasis::new(&whole, &modes, 0.0, 2).unwrap();
    let [one, two] = [1, 2].map(|order| free.reduced(modes.count(), order).unwrap());
    let held = whole.craig_bampton(BEYOND_HELD * up_to).unwrap();
    // the contribution of the first omitted mode, `(ω² / λ)²ᴶ`, times its part of the response;
    // with fixed ports, a frequency error of 3e-4 is a sixteenth of the distance between a
    // sample and its mode
    let share: f64 = BEYOND.powi(-4);
    for (reduced, tolerance) in [(&one, share), (&two, share * share), (&held, 0.1)] {
        let deviation = reference.deviation(reduced);
        let frequencies = reduced.frequencies().unwrap();
        for (omega, value) in frequencies.iter().zip(&modes.values).take(inside) {
            let off = omega / value.sqrt() - 1.0;
            assert!(off.abs() < 1e-3, "{}: {} Hz", reduced.kind, omega / TAU);
        }
        assert!(deviation.error < tolerance, "{}: {deviation:?}", reduced.kind);
    }
    let shift = 0.5 * up_to * up_to;
    let series = ResidualSeries::new(&RubinBasis::new(&whole, &modes, shift, 4).unwrap(), modes.count()).unwrap();
    let deviation = reference.deviation_of_series(&series);
    // for a shift in the middle of the range, the step is at most half of it
    let step: f64 = 0.5 / (BEYOND * BEYOND - 0.5);
    assert!(deviation.error < step.powi(8), "{deviation:?}");
}

/// A block of square section has two bending modes of equal frequency. No sample may be placed
/// between them, because it would coincide with both.
#[test]
fn samples_keep_clear_of_equal_modes() {
    let brick = brick([8, 3, 3], true);
    let up_to = TAU * 40e3;
    let damping = StructureDamping::Ratio { ratio: 0.002, up_to };
    let whole = FullStructure::new(brick.mass.clone(), damping, brick.stiffness.clone(), brick.face(4)).unwrap();
    let modes = whole.modes(1.5 * up_to).unwrap();
    let equal = modes.values.windows(2).filter(|pair| pair[1] / pair[0] - 1.0 < 1e-9).count();
    assert!(equal > 1, "{:?}", modes.values);
    let reference = ReferenceReceptance::new(&whole, &modes, up_to).unwrap();
    for omega in reference.frequencies() {
        assert!(modes.values.iter().all(|value| (omega / value.sqrt() - 1.0).abs() > 9e-5), "{omega}");
    }
    let reduced = RubinBasis::new(&whole, &modes, 0.0, 2).unwrap().reduced(modes.count(), 2).unwrap();
    let deviation = reference.deviation(&reduced);
    // the contribution of the first omitted mode, with twice as many terms as orders
    assert!(deviation.error < 1.5f64.powi(-8), "{deviation:?}");
}

/// Many ports are loaded together. The error is about that of a few of them, each loaded
/// separately: modes without residual vectors are the same for any ports.
#[test]
fn many_ports_are_judged_together() {
    let brick = brick([4, 6, 6], true);
    let up_to = TAU * 30e3;
    let ports = brick.face(49);
    let error = |ports: Vec<Vec<(usize, f64)>>| {
        let damping = StructureDamping::Ratio { ratio: 0.005, up_to };
        let whole = FullStructure::new(brick.mass.clone(), damping, brick.stiffness.clone(), ports).unwrap();
        let modes = whole.modes(2.0 * up_to).unwrap();
        let reduced = RubinBasis::new(&whole, &modes, 0.0, 0).unwrap().reduced(modes.count(), 0).unwrap();
        ReferenceReceptance::at_frequencies(&whole, &[0.3 * up_to, 0.8 * up_to]).unwrap().deviation(&reduced).error
    };
    assert_eq!(ports.len(), 147);
    let (all, few) = (error(ports.clone()), error(ports.into_iter().step_by(2).collect()));
    assert!(all > 0.5 * few && all < 2.0 * few && few > 1e-3, "{all:.2e} {few:.2e}");
}

/// The required error determines the numbers of modes and vectors.
#[test]
fn the_error_chooses_the_size() {
    let brick = brick([10, 4, 4], true);
    let up_to = TAU * 20e3;
    let whole = FullStructure::new(
        brick.mass.clone(),
        StructureDamping::Ratio { ratio: 0.005, up_to },
        brick.stiffness.clone(),
        brick.face(4),
    )
    .unwrap();
    let mut last = 0;
    for tolerance in [1e-2, 1e-4, 1e-7] {
        let chosen = AutomaticReduction { up_to, tolerance, kind: None }.apply(&whole).unwrap();
        assert!(chosen.deviation.error <= tolerance && chosen.reduced.dofs() >= last);
        last = chosen.reduced.dofs();
    }
    assert!(last < whole.dofs() / 4, "{last} of {}", whole.dofs());
}

/// With many ports, the reduction reaches the required error by more modes, with one vector per
/// port. For any order of the vectors, mass and stiffness are diagonal, even if ports are
/// linearly dependent.
#[test]
fn many_ports_take_modes_before_orders() {
    let brick = brick([4, 6, 6], true);
    let up_to = TAU * 20e3;
    let mut ports = brick.face(49);
    let damping = StructureDamping::Ratio { ratio: 0.005, up_to };
    let whole =
        |ports| FullStructure::new(brick.mass.clone(), damping.clone(), brick.stiffness.clone(), ports).unwrap();
    let chosen = AutomaticReduction { up_to, tolerance: 1e-4, kind: None }.apply(&whole(ports.clone())).unwrap();
    assert!(chosen.deviation.error <= 1e-4, "{:?}", chosen.deviation);
    assert_eq!(chosen.reduced.dofs(), chosen.modes.count() + ports.len(), "{}", chosen.reduced.kind);
    // a port that is the mean of two others
    ports.push(vec![(ports[0][0].0, 0.5), (ports[3][0].0, 0.5)]);
    let whole = whole(ports);
    let modes = whole.modes(1.5 * up_to).unwrap();
    let free = RubinBasis::new(&whole, &modes, 0.0, 2).unwrap();
    let reference = ReferenceReceptance::new(&whole, &modes, up_to).unwrap();
    let mut last = f64::INFINITY;
    for order in 1..=2 {
        let reduced = free.reduced(modes.count(), order).unwrap();
        for matrix in [&reduced.mass, &reduced.damping, &reduced.stiffness] {
            let beside = |i: usize, k: usize| i != k && matrix[(i, k)] != 0.0;
            assert!(!(0..matrix.ncols()).any(|k| (0..matrix.nrows()).any(|i| beside(i, k))), "{}", reduced.kind);
        }
        assert!(order > 1 || reduced.dofs() == modes.count() + 147, "{}", reduced.kind);
        let error = reference.deviation(&reduced).error;
        assert!(error < 0.1 * last, "{}: {error:.1e} after {last:.1e}", reduced.kind);
        last = error;
    }
}
