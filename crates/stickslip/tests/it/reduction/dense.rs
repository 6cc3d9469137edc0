//! Compares reductions of small structures with dense solutions of the whole receptance.

use nalgebra::{Complex, DMatrix};
use proptest::prelude::*;
use stickslip::structure::reduction::{
    AutomaticReduction, FullStructure, ReducedMatrices, ReductionError, ReferenceReceptance, ResidualSeries, Row,
    RubinBasis, StructureDamping,
};
use stickslip_numerics::sparse::SparseMatrix;

fn sparse(n: usize, entries: impl IntoIterator<Item = (usize, usize, f64)>) -> SparseMatrix {
    SparseMatrix::from_triplets(n, entries).unwrap()
}

fn full(matrix: &SparseMatrix) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.n(), matrix.n(), |i, k| matrix.get(i, k))
}

/// Returns the stiffness of springs (i, k, stiffness). A spring with i = k connects to the
/// ground.
fn springs(n: usize, between: &[(usize, usize, f64)]) -> SparseMatrix {
    let spring = |&(i, k, v): &(usize, usize, f64)| match i == k {
        true => vec![(i, i, v)],
        false => vec![(i, i, v), (k, k, v), (i, k, -v), (k, i, -v)],
    };
    sparse(n, between.iter().flat_map(spring))
}

fn chain(n: usize, held: bool) -> SparseMatrix {
    let mut links: Vec<_> = (1..n).map(|i| (i - 1, i, 1.0 + (i % 3) as f64)).collect();
    links.extend(held.then_some((0, 0, 2.0)));
    springs(n, &links)
}

fn masses(n: usize) -> SparseMatrix {
    sparse(n, (0..n).map(|i| (i, i, 1.0 + 0.1 * (i % 4) as f64)))
}

/// Returns `P (K - ω² M + jω C)⁻¹ Pᵀ`.
fn receptance(
    m: &SparseMatrix,
    c: &DMatrix<f64>,
    k: &SparseMatrix,
    ports: &[Row],
    omega: f64,
) -> DMatrix<Complex<f64>> {
    let n = m.n();
    let stiffness =
        DMatrix::from_fn(n, n, |i, j| Complex::new(k.get(i, j) - omega * omega * m.get(i, j), omega * c[(i, j)]));
    let mut p = DMatrix::zeros(ports.len(), n);
    ports.iter().enumerate().for_each(|(i, row)| row.iter().for_each(|(at, v)| p[(i, *at)] += Complex::new(*v, 0.0)));
    &p * stiffness.lu().solve(&p.transpose()).unwrap()
}

fn off(a: &DMatrix<Complex<f64>>, b: &DMatrix<Complex<f64>>) -> f64 {
    (a - b).norm() / b.norm()
}

/// Returns λ and shapes of unit mass, from the Cholesky factor of M.
fn modes(m: &SparseMatrix, k: &SparseMatrix) -> (Vec<f64>, DMatrix<f64>) {
    let n = m.n();
    let inverse = full(m).cholesky().unwrap().l().solve_lower_triangular(&DMatrix::identity(n, n)).unwrap();
    let eigen = (&inverse * full(k) * inverse.transpose()).symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let shapes = (inverse.transpose() * eigen.eigenvectors).select_columns(&order);
    (order.iter().map(|&i| eigen.eigenvalues[i]).collect(), shapes)
}

/// Returns four ports: a place, a difference, a mean, and one that depends linearly on these.
fn ports(n: usize) -> Vec<Row> {
    vec![
        vec![(n - 1, 1.0)],
        vec![(n / 2, 1.0), (1, -1.0)],
        vec![(2, 0.5), (n / 3, 0.5)],
        vec![(n - 1, 2.0), (n / 2, -1.0), (1, 1.0)],
    ]
}

/// A frequency above all modes of these structures, `√(4 · 3 / 1)`.
const ABOVE_ALL: f64 = 4.0;

const UNDAMPED: StructureDamping = StructureDamping::Rayleigh { mass: 0.0, stiffness: 0.0 };

/// The error of a reduction with residual vectors of J orders behaves like `(ω² / λ)²ᴶ⁺¹`, with
/// λ of the first omitted mode. The static response is exact. This holds for fixed and for free
/// structures.
#[test]
fn residual_vectors_make_low_frequencies_exact() {
    let n = 60;
    for held in [true, false] {
        let (m, k) = (masses(n), chain(n, held));
        let whole = FullStructure::new(m.clone(), UNDAMPED, k.clone(), ports(n)).unwrap();
        let (values, _) = modes(&m, &k);
        let found = whole.modes((values[10] * values[9]).sqrt().sqrt()).unwrap();
        assert_eq!(found.count(), 10);
        let free = RubinBasis::new(&whole, &found, 0.0, 3).unwrap();
        let none = DMatrix::zeros(n, n);
        for order in 1..=3 {
            let reduced = free.reduced(10, order).unwrap();
            // one of the four ports depends on the others
            assert_eq!(reduced.dofs(), 10 + 3 * order, "{}", reduced.kind);
            for share in [0.05, 0.2, 0.5] {
                let omega = share * values[10].sqrt() + 1e-3;
                let error = off(&reduced.receptance(omega).unwrap(), &receptance(&m, &none, &k, &ports(n), omega));
                let bound = 10.0 * (omega * omega / values[10]).powi(2 * order as i32) + 1e-11;
                assert!(error < bound, "held {held}, order {order}, share {share}: {error:.1e} beyond {bound:.1e}");
            }
        }
    }
}

/// The first residual term of a free structure is its residual flexibility, the sum over the
/// omitted modes.
#[test]
fn residual_flexibility_of_a_free_structure() {
    let n = 40;
    let (m, k) = (masses(n), chain(n, false));
    let whole = FullStructure::new(m.clone(), UNDAMPED, k.clone(), ports(n)).unwrap();
    let (values, shapes) = modes(&m, &k);
    let found = whole.modes((values[5] * values[4]).sqrt().sqrt()).unwrap();
    for count in [1, 3, 5] {
        for (shift, order) in [(0.0, 2), (0.5 * values[4] + 0.5 * values[3], 2)] {
            let series = ResidualSeries::new(&RubinBasis::new(&whole, &found, shift, order).unwrap(), count).unwrap();
            assert_eq!(series.terms(), 4);
            let omega: f64 = 0.6 * values[count].sqrt();
            let row = |row: &Row, mode: usize| row.iter().map(|(at, v)| v * shapes[(*at, mode)]).sum::<f64>();
            let expected = DMatrix::from_fn(4, 4, |i, j| {
                let mode = |mode: usize| row(&ports(n)[i], mode) * row(&ports(n)[j], mode);
                let kept: f64 = (0..count).map(|k| mode(k) / (values[k] - omega * omega)).sum();
                let step = omega * omega - shift;
                let left =
                    |k: usize| (0..4).map(|j| (step / (values[k] - shift)).powi(j)).sum::<f64>() / (values[k] - shift);
                Complex::new(kept + (count..n).map(|k| mode(k) * left(k)).sum::<f64>(), 0.0)
            });
            let error = off(&series.receptance(omega), &expected);
            assert!(error < 1e-10, "{count} modes, shift {shift}: {error:.1e}");
        }
    }
}

/// The modal damping ratio is constant up to the bound and grows with frequency above it, in
/// the whole structure and in every reduction.
#[test]
fn damping_by_ratio() {
    let n = 30;
    let (m, k) = (masses(n), chain(n, true));
    let (values, shapes) = modes(&m, &k);
    let (ratio, up_to) = (0.02, 0.5 * (values[6].sqrt() + values[7].sqrt()));
    let whole = FullStructure::new(m.clone(), StructureDamping::Ratio { ratio, up_to }, k.clone(), ports(n)).unwrap();
    let modal = |value: f64| match value.sqrt() {
        omega if omega < up_to => 2.0 * ratio * omega,
        omega => 2.0 * ratio / up_to * omega * omega,
    };
    let force = full(&m) * &shapes;
    let c =
        &force * DMatrix::from_diagonal(&DMatrix::from_fn(n, 1, |i, _| modal(values[i])).column(0)) * force.transpose();
    let found = whole.modes(1.5 * up_to).unwrap();
    let free = RubinBasis::new(&whole, &found, 0.0, 3).unwrap();
    let series = ResidualSeries::new(&free, found.count()).unwrap();
    for omega in [0.3 * up_to, values[2].sqrt(), up_to] {
        let expected = receptance(&m, &c, &k, &ports(n), omega);
        let error = off(&free.reduced(found.count(), 3).unwrap().receptance(omega).unwrap(), &expected);
        assert!(error < 1e-6, "free modes at {omega}: {error:.1e}");
        let error = off(&series.receptance(omega), &expected);
        assert!(error < 1e-4, "series at {omega}: {error:.1e}");
        // with all modes, the reduction equals the whole structure
        let error = off(&whole.craig_bampton(ABOVE_ALL).unwrap().receptance(omega).unwrap(), &expected);
        assert!(error < 1e-9, "Craig-Bampton at {omega}: {error:.1e}");
    }
}

/// A damping matrix, also a gyroscopic one, is projected; a series rejects it.
#[test]
fn damping_matrix() {
    let n = 30;
    let (m, k) = (masses(n), chain(n, true));
    let c = sparse(n, [(3, 3, 0.2), (4, 9, 0.3), (9, 4, -0.3), (20, 20, 0.1)]);
    let whole = FullStructure::new(m.clone(), StructureDamping::Matrix(c.clone()), k.clone(), ports(n)).unwrap();
    let found = whole.modes(1.3).unwrap();
    let free = RubinBasis::new(&whole, &found, 0.0, 2).unwrap();
    assert_eq!(ResidualSeries::new(&free, 2).unwrap_err(), ReductionError::SeriesDamping);
    let reduced = free.reduced(found.count(), 2).unwrap();
    let reference = ReferenceReceptance::new(&whole, &found, 0.7).unwrap();
    let own = reference
        .frequencies()
        .map(|omega| off(&reduced.receptance(omega).unwrap(), &receptance(&m, &full(&c), &k, &ports(n), omega)));
    let own = own.fold(0.0, f64::max);
    let deviation = reference.deviation(&reduced);
    // the norms differ, with other weights of the ports
    assert!(deviation.error < 5.0 * own && own < 5.0 * deviation.error, "{own:.1e} {deviation:?}");
    let all = whole.modes(ABOVE_ALL).unwrap();
    assert_eq!(all.count(), n);
    let exact = RubinBasis::new(&whole, &all, 0.0, 0).unwrap().reduced(n, 0).unwrap();
    assert!(reference.deviation(&exact).error < 1e-9, "{:?}", reference.deviation(&exact));
}

/// A port at a place without mass.
#[test]
fn ports_without_mass() {
    let n = 40;
    let m = sparse(n, (0..n).filter(|i| i % 2 == 0).map(|i| (i, i, 1.0)));
    let k = chain(n, true);
    let ports = vec![vec![(n - 1, 1.0)], vec![(7, 1.0)]];
    let whole = FullStructure::new(m.clone(), UNDAMPED, k.clone(), ports.clone()).unwrap();
    // all twenty modes with a frequency; of the two ports, the one without mass adds its spring
    let free = RubinBasis::new(&whole, &whole.modes(ABOVE_ALL).unwrap(), 0.0, 1).unwrap();
    assert_eq!(free.modes(), 20);
    for reduced in [free.reduced(20, 1).unwrap(), whole.craig_bampton(ABOVE_ALL).unwrap()] {
        for omega in [0.01, 0.1, 0.3] {
            let expected = receptance(&m, &DMatrix::zeros(n, n), &k, &ports, omega);
            let error = off(&reduced.receptance(omega).unwrap(), &expected);
            assert!(error < 1e-9, "{} at {omega}: {error:.1e}", reduced.kind);
        }
    }
}

#[test]
fn what_is_no_reduction_says_why() {
    let n = 20;
    let (m, k) = (masses(n), chain(n, false));
    let make = |m: &SparseMatrix, k: &SparseMatrix, damping, ports| {
        FullStructure::new(m.clone(), damping, k.clone(), ports).map(|_| ())
    };
    let one_sided = sparse(n, k.entries().chain([(0, 5, 1.0)]));
    assert!(matches!(
        make(&m, &one_sided, UNDAMPED, ports(n)),
        Err(ReductionError::NotSymmetric { matrix: "stiffness", .. })
    ));
    assert!(matches!(make(&masses(3), &k, UNDAMPED, vec![]), Err(ReductionError::Size { rows: 3, .. })));
    assert_eq!(make(&m, &k, UNDAMPED, vec![]), Err(ReductionError::NoPorts));
    for row in [vec![], vec![(n, 1.0)], vec![(0, f64::NAN)], vec![(0, 0.0)]] {
        assert_eq!(make(&m, &k, UNDAMPED, vec![vec![(0, 1.0)], row]), Err(ReductionError::Port { port: 1, n }));
    }
    let negative = StructureDamping::Ratio { ratio: -0.1, up_to: 1.0 };
    assert!(matches!(make(&m, &k, negative, ports(n)), Err(ReductionError::Number { .. })));
    // a port at one end of two separate free chains does not remove the free motion of the
    // second chain
    let two = [springs(n / 2, &(1..n / 2).map(|i| (i - 1, i, 1.0)).collect::<Vec<_>>()); 1];
    let apart = sparse(n, two[0].entries().flat_map(|(i, k, v)| [(i, k, v), (i + n / 2, k + n / 2, v)]));
    let whole = FullStructure::new(m.clone(), UNDAMPED, apart, vec![vec![(0, 1.0)]]).unwrap();
    assert!(matches!(whole.craig_bampton(1.0), Err(ReductionError::FreeInterfaceMotion { count: 1 })));
    let whole = FullStructure::new(m, UNDAMPED, k, ports(n)).unwrap();
    let reach = AutomaticReduction { up_to: 0.9, tolerance: 1e-16, kind: None }.apply(&whole);
    assert!(matches!(reach, Err(ReductionError::ToleranceNotReached { .. })), "{reach:?}");
    assert!(matches!(
        AutomaticReduction { up_to: 0.0, tolerance: 1e-3, kind: None }.apply(&whole),
        Err(ReductionError::Number { .. })
    ));
}

/// Far below the first mode, static responses suffice; three of them are independent.
#[test]
fn without_modes() {
    let n = 30;
    let whole = FullStructure::new(masses(n), UNDAMPED, chain(n, true), ports(n)).unwrap();
    let chosen = AutomaticReduction { up_to: 1e-3, tolerance: 1e-6, kind: None }.apply(&whole).unwrap();
    assert_eq!((chosen.modes.count(), chosen.reduced.dofs()), (0, 3));
}

/// The expanded displacements agree with those of the ports.
#[test]
fn expansion() {
    let n = 30;
    let whole = FullStructure::new(masses(n), UNDAMPED, chain(n, true), ports(n)).unwrap();
    let reduced: ReducedMatrices = whole.craig_bampton(1.0).unwrap();
    let q: Vec<f64> = (0..reduced.dofs()).map(|i| (i as f64).sin()).collect();
    let x = reduced.expand(&q);
    for (row, weights) in reduced.ports.row_iter().zip(ports(n)) {
        let (seen, direct): (f64, f64) =
            (row.iter().zip(&q).map(|(a, b)| a * b).sum(), weights.iter().map(|(at, v)| v * x[*at]).sum());
        assert!((seen - direct).abs() < 1e-12);
    }
}

/// For this chain with 17 additional links and one number of vectors, the last vector is nearly
/// dependent on free motions and the others, up to rounding. The reduction uses other numbers.
#[test]
fn nearly_dependent_vectors_are_passed_over() {
    let links = [
        (0, 7, 1.371489954087977),
        (2, 14, 0.5),
        (6, 1, 1.7732555627666153),
        (10, 18, 1.523126524102208),
        (8, 2, 0.5),
        (8, 2, 0.8439767632126511),
        (5, 0, 0.6152816258563916),
        (11, 11, 1.595526046336019),
        (6, 19, 1.6645643138077089),
        (3, 14, 1.1180577341885378),
        (8, 2, 0.947575288867864),
        (0, 2, 1.448005410300081),
        (1, 18, 1.8230736957569886),
        (17, 0, 1.5053915966166007),
        (4, 2, 0.5),
        (0, 13, 1.8132742698377746),
        (21, 0, 1.8080522815946023),
    ];
    let weights = [
        0.5852730100029109,
        1.4674261058984694,
        0.8089064581035239,
        0.5905927609025424,
        0.5,
        0.5,
        1.6163747551786547,
        1.38097124849646,
        0.5817095477749851,
        1.1605263555113015,
        1.5100190377766687,
        0.5,
        0.7468262919755432,
        1.6206970639869418,
        0.8553252452123009,
        1.9604062588921662,
        1.5367778324877228,
        0.8297496366466854,
        1.6005611694736217,
        1.4389418066112967,
        0.98881269787348,
        1.3502415139503758,
        0.5,
        0.5,
    ];
    let n = weights.len();
    let all: Vec<_> = (1..n).map(|i| (i - 1, i, 1.0)).chain(links).collect();
    let (m, k) = (sparse(n, (0..n).map(|i| (i, i, weights[i]))), springs(n, &all));
    let (values, _) = modes(&m, &k);
    let up_to = 0.5 * (values[5].sqrt() + values[6].sqrt());
    let ports: Vec<Row> = vec![vec![(23, 1.0)], vec![(22, 1.0), (23, -1.0)]];
    let whole = FullStructure::new(m, StructureDamping::Ratio { ratio: 0.01, up_to }, k, ports).unwrap();
    assert!(AutomaticReduction { up_to, tolerance: 1e-4, kind: None }.apply(&whole).unwrap().deviation.error <= 1e-4);
}

proptest! {
    /// Random structures, free or fixed, with all modes or with residual vectors. The selected
    /// reduction meets its tolerance at other frequencies than the samples.
    #[test]
    fn random_structures(
        links in proptest::collection::vec((0usize..24, 0usize..24, 0.5f64..2.0), 10..50),
        weights in proptest::collection::vec(0.5f64..2.0, 24),
        seen in proptest::collection::vec((0usize..24, 0usize..24), 1..4),
        at in 0.0f64..1.0,
    ) {
        let n = 24;
        let all: Vec<_> = (1..n).map(|i| (i - 1, i, 1.0)).chain(links).collect();
        let (m, k) = (sparse(n, (0..n).map(|i| (i, i, weights[i]))), springs(n, &all));
        let ports: Vec<Row> = seen.iter().map(|&(i, k)| if i == k { vec![(i, 1.0)] } else { vec![(i, 1.0), (k, -1.0)] }).collect();
        let (values, _) = modes(&m, &k);
        let up_to = 0.5 * (values[5].sqrt() + values[6].sqrt());
        let whole = FullStructure::new(m.clone(), StructureDamping::Ratio { ratio: 0.01, up_to }, k.clone(), ports.clone()).unwrap();
        let chosen = AutomaticReduction { up_to, tolerance: 1e-4, kind: None }.apply(&whole).unwrap();
        prop_assert!(chosen.deviation.error <= 1e-4);
        let (omega, undamped) = (at * up_to, DMatrix::zeros(n, n));
        prop_assume!(values.iter().all(|v| (v.max(0.0).sqrt() - omega).abs() > 2e-3 * up_to));
        let mut bare = chosen.reduced.clone();
        bare.damping *= 0.0;
        let exact = |omega: f64| receptance(&m, &undamped, &k, &ports, omega);
        // at an anti-resonance, the error is relative to the typical receptance
        let mut sizes: Vec<f64> = (0..21).map(|i| exact((f64::from(i) + 0.37) / 21.0 * up_to).norm()).collect();
        sizes.sort_by(f64::total_cmp);
        let size = exact(omega).norm().max(sizes[10]);
        let error = (bare.receptance(omega).unwrap() - exact(omega)).norm() / size;
        // other frequencies, another norm
        prop_assert!(error < 3e-3, "{error:.1e} with {}", chosen.reduced.kind);
    }
}
