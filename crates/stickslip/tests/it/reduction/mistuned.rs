//! Compares reduced rings of different blades with all rows of all sectors.

use super::brick::Brick;
use nalgebra::{Complex, DMatrix, DVector};
use std::collections::BTreeMap;
use stickslip::model::{Disk, DiskPart, Model, Place, SectorDistribution, Substructure, SubstructureDamping, System};
use stickslip::structure::{Boundary, Component, Reduction, ReductionKind};
use stickslip_numerics::sparse::{SparseMatrix, SymbolicAnalysis};

/// Numbers of elements of a sector along the blade, across, and through the thickness.
const ELEMENTS: [usize; 3] = [6, 2, 1];
/// Number of nodes from the fixed end that are welded to the next sector, and number of nodes
/// of the disk. The others are the blade.
const WELDED: usize = 1;
const DISK: usize = 2;
/// Deviations of the blades' stiffness.
const BLADES: [f64; 4] = [0.04, -0.02, -0.04, 0.03];
/// Half width of the resonance to which reported errors refer.
const HALF_WIDTH: f64 = 1e-3;

/// Returns a ring of adjacent steel strips that are fixed at one end. The first nodes are
/// welded to those of the next strip.
fn ring(reduction: Reduction, blades: &[f64]) -> System {
    let brick = Brick::new(ELEMENTS, [0.08, 0.03, 0.006], true);
    let [nx, ny, nz] = ELEMENTS;
    let name = |[x, y, z]: [usize; 3]| format!("{x}_{y}_{z}");
    let mut rows = vec![String::new(); brick.dofs()];
    let (mut blade, mut pairs) = (Vec::new(), Vec::new());
    for node in (1..=nx).flat_map(|x| (0..=ny).flat_map(move |y| (0..=nz).map(move |z| [x, y, z]))) {
        for (direction, along) in ["x", "y", "z"].into_iter().enumerate() {
            let row = brick.row(node, direction).unwrap();
            rows[row] = format!("{}.{along}", name(node));
            if node[0] > DISK {
                blade.push(row);
            }
        }
        if node[0] <= WELDED && node[1] == 0 {
            pairs.push((name(node), name([node[0], ny, node[2]])));
        }
    }
    let tip = (0..3).map(|direction| vec![(brick.row([nx, 0, 0], direction).unwrap(), 1.0)]);
    let places: Vec<Place> = tip.enumerate().map(|(k, row)| Place::new(format!("tip{k}"), row)).collect();
    let component = Component::new(rows, brick.mass, None, brick.stiffness).unwrap();
    let boundary = Boundary::of_nodes(component.rows(), &pairs, None).unwrap();
    let sector = |deviation: f64| {
        let disk =
            DiskPart { boundary: boundary.clone(), blade: blade.clone(), deviations: vec![deviation], basis: None };
        let (component, damping) = (component.clone(), SubstructureDamping::Own);
        let substructure =
            Some(Substructure { component, damping, reduction, earlier_reduction: None, disk: Some(disk) });
        Model { substructure, places: places.clone(), ..Model::default() }
    };
    let disk = Disk { sectors: blades.len(), forces: Vec::<SectorDistribution>::new(), motions: vec![] };
    disk.ring(|s| sector(blades[s])).unwrap().assemble().unwrap()
}

/// Returns the displacements of the places of all sectors under loads on all of them.
fn answers(system: &System, omega: f64) -> DVector<Complex<f64>> {
    let structure = system.structure();
    let (m, k) = (structure.mass(), structure.stiffness());
    let z = m.zip_map(k, |m, k| Complex::new(k - omega * omega * m, 2.0 * HALF_WIDTH * k));
    let mut seen: DMatrix<Complex<f64>> = DMatrix::zeros(system.place_axes().len(), m.nrows());
    for (place, axis) in system.place_axes().iter().enumerate() {
        axis.rows().iter().for_each(|(at, weight)| seen[(place, *at)] += Complex::new(*weight, 0.0));
    }
    let load: DVector<Complex<f64>> =
        seen.transpose() * DVector::from_fn(seen.nrows(), |place, _| Complex::new((1.3 * place as f64).cos(), 0.0));
    seen * z.lu().solve(&load).unwrap()
}

/// Returns the natural frequencies, rad/s, in ascending order.
fn resonances(system: &System) -> Vec<f64> {
    let structure = system.structure();
    let root = structure.mass().clone().cholesky().unwrap().l();
    let half = root.solve_lower_triangular(structure.stiffness()).unwrap();
    let scaled = root.solve_lower_triangular(&half.transpose()).unwrap();
    let mut all: Vec<f64> = scaled.symmetric_eigenvalues().iter().map(|value| value.sqrt()).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// The waves of the tuned ring do not contain this error. The reported error of a ring with
/// different blades agrees with that relative to the whole ring at its resonances, within a
/// factor of two. With a tolerance, the reduction uses the required number of vectors.
#[test]
fn the_error_of_blades_that_differ_is_that_against_the_whole_ring() {
    let whole = ring(Reduction::None { up_to: 0.0 }, &BLADES);
    let all = resonances(&whole);
    let mut exact: BTreeMap<usize, DVector<Complex<f64>>> = BTreeMap::new();
    let mut error = |few: &System, up_to: f64| {
        let inside = all.iter().enumerate().filter(|(_, omega)| **omega <= up_to);
        let errors = inside.map(|(i, omega)| {
            let exact = exact.entry(i).or_insert_with(|| answers(&whole, *omega));
            (answers(few, *omega) - &*exact).norm() / exact.norm()
        });
        errors.fold(0.0, f64::max)
    };
    for modes in [3, 5] {
        let few = ring(Reduction::Modes { modes, kind: ReductionKind::Rubin, orders: 1, up_to: 0.0 }, &BLADES);
        let said = few.reduced().unwrap();
        let error = error(&few, said.up_to());
        assert!(error > 0.01, "a reduction without an error tests nothing: {error:e}, {said}");
        assert!((0.5..2.0).contains(&(said.error() / error)), "{modes} modes: {error:e}, {said}");
    }
    for (family, tolerance) in [(1, 1e-3), (2, 1e-4)] {
        let up_to = 1.1 * all[family * BLADES.len() - 1];
        let few = ring(Reduction::UpTo { up_to, tolerance, kind: None }, &BLADES);
        let said = few.reduced().unwrap();
        let error = error(&few, up_to);
        assert!(said.error() <= tolerance && error < 2.0 * tolerance, "{error:e}, {said}");
        assert!(said.kind().contains("with blade vectors"), "{said}");
    }
}

/// Returns mass and stiffness of a ring of many sectors.
fn matrices(system: &System) -> [SparseMatrix; 2] {
    [0, 2].map(|of| {
        let entries = system.structure().entries().map(|(i, k, values)| (i, k, values[of]));
        SparseMatrix::from_triplets(system.dofs(), entries).unwrap()
    })
}

/// Returns the displacements of the places of all sectors, one after the other, at these
/// frequencies, rad/s.
fn answers_of_many(system: &System, frequencies: &[f64]) -> Vec<Vec<Complex<f64>>> {
    let [mass, stiffness] = matrices(system);
    let analysis = SymbolicAnalysis::new(&[&stiffness, &mass]);
    let load = |place: usize| (1.3 * place as f64).cos();
    let one = |omega: &f64| {
        let sum = [(Complex::new(1.0, 2.0 * HALF_WIDTH), &stiffness), (Complex::new(-omega * omega, 0.0), &mass)];
        let mut moved = vec![Complex::new(0.0, 0.0); system.dofs()];
        for (place, axis) in system.place_axes().iter().enumerate() {
            axis.rows().iter().for_each(|(at, weight)| moved[*at] += weight * load(place));
        }
        analysis.factor_complex(&sum).unwrap().solve(&mut moved);
        system
            .place_axes()
            .iter()
            .map(|axis| axis.rows().iter().map(|(at, weight)| moved[*at] * *weight).sum())
            .collect()
    };
    frequencies.iter().map(one).collect()
}

/// Sixty blades: reference frequencies from the Lanczos process on all rows of all sectors,
/// reference responses from their factorization. The reported error agrees with that of the
/// responses at resonances.
#[test]
fn sixty_blades_have_the_frequencies_and_answers_of_all_rows() {
    let blades: Vec<f64> = (0..60).map(|s| 0.04 * (2.3 * f64::from(s * s)).sin()).collect();
    let whole = ring(Reduction::None { up_to: 0.0 }, &blades);
    let [mass, stiffness] = matrices(&whole);
    let all = Component::new(vec![String::new(); mass.n()], mass, None, stiffness).unwrap();
    let exact = all.frequencies(blades.len()).unwrap();
    let up_to = 1.02 * exact[blades.len() - 1];
    let resonances: Vec<f64> = exact.iter().copied().step_by(5).collect();
    let expected = answers_of_many(&whole, &resonances);
    let error = |few: &System| {
        let found = answers_of_many(few, &resonances);
        let norm = |all: &mut dyn Iterator<Item = Complex<f64>>| all.map(|z| z.norm_sqr()).sum::<f64>().sqrt();
        let apart = found.iter().zip(&expected).map(|(found, expected)| {
            norm(&mut found.iter().zip(expected).map(|(a, b)| a - b)) / norm(&mut expected.iter().copied())
        });
        apart.fold(0.0, f64::max)
    };
    let few = ring(Reduction::UpTo { up_to, tolerance: 1e-4, kind: None }, &blades);
    let mut own: Vec<f64> =
        few.structure().entries().map(|(.., [mass, _, stiffness])| (stiffness / mass).sqrt()).collect();
    own.sort_by(f64::total_cmp);
    for (own, exact) in own.iter().zip(&exact) {
        assert!((own / exact - 1.0).abs() < 1e-7, "{own} {exact}");
    }
    assert!(few.dofs() < blades.len() * 20, "{}", few.dofs());
    let (said, error_of_few) = (few.reduced().unwrap(), error(&few));
    assert!(said.error() <= 1e-4 && error_of_few < 2.0 * said.error(), "{error_of_few:e}, {said}");
    let coarse = ring(Reduction::Modes { modes: 3, kind: ReductionKind::Rubin, orders: 1, up_to }, &blades);
    let (said, error) = (coarse.reduced().unwrap(), error(&coarse));
    assert!(error > 1e-3, "a reduction without an error tests nothing: {error:e}, {said}");
    assert!((0.5..2.0).contains(&(said.error() / error)), "{error:e}, {said}");
}
