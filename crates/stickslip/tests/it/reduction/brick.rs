//! A steel block of 8-node hexahedra, fixed at one face or free, with the textbook's mass and
//! stiffness.
//!
//! Source: Zienkiewicz and Taylor, "The Finite Element Method" (2000), Vol. 1, Chap. 8:
//! trilinear shape functions, 2 x 2 x 2 Gauss points.

use stickslip_numerics::sparse::SparseMatrix;

/// Young's modulus (Pa), Poisson's ratio, density (kg/m³).
const STEEL: (f64, f64, f64) = (210e9, 0.3, 7850.0);

/// Mass and stiffness, and the grid of nodes.
pub struct Brick {
    pub mass: SparseMatrix,
    pub stiffness: SparseMatrix,
    elements: [usize; 3],
    held: bool,
}

impl Brick {
    /// Creates a block with `elements` along the directions of `sizes` (m). The face x = 0 is
    /// fixed or free.
    pub fn new(elements: [usize; 3], sizes: [f64; 3], held: bool) -> Self {
        let edges: [f64; 3] = std::array::from_fn(|i| sizes[i] / elements[i] as f64);
        let (k, m) = element(edges);
        let mut brick = Brick { mass: empty(), stiffness: empty(), elements, held };
        let (mut stiffness, mut mass) = (Vec::new(), Vec::new());
        for e in 0..elements.iter().product() {
            let [nx, ny, _] = elements;
            let first = [e % nx, e / nx % ny, e / nx / ny];
            let corners: [[usize; 3]; 8] = std::array::from_fn(|c| std::array::from_fn(|i| first[i] + (c >> i & 1)));
            for (a, at) in corners.iter().enumerate() {
                for (b, other) in corners.iter().enumerate() {
                    for (i, j) in (0..9).map(|ij| (ij / 3, ij % 3)) {
                        let (Some(row), Some(column)) = (brick.row(*at, i), brick.row(*other, j)) else { continue };
                        stiffness.push((row, column, k[3 * a + i][3 * b + j]));
                        if i == j {
                            mass.push((row, column, m[a][b]));
                        }
                    }
                }
            }
        }
        let n = brick.dofs();
        brick.stiffness = SparseMatrix::from_triplets(n, stiffness).unwrap();
        drop(brick.mass);
        brick.mass = SparseMatrix::from_triplets(n, mass).unwrap();
        brick
    }

    pub fn dofs(&self) -> usize {
        let [nx, ny, nz] = self.elements;
        3 * (nx + usize::from(!self.held)) * (ny + 1) * (nz + 1)
    }

    /// Returns the row of a node's displacement along `direction`; `None` if the node is fixed.
    pub fn row(&self, node: [usize; 3], direction: usize) -> Option<usize> {
        let x = node[0].checked_sub(usize::from(self.held))?;
        let columns = self.elements[0] + usize::from(!self.held);
        Some(3 * ((node[2] * (self.elements[1] + 1) + node[1]) * columns + x) + direction)
    }

    /// Returns the rows of all directions of `count` nodes, distributed over the face opposite
    /// to x = 0.
    #[allow(dead_code)] // not every test that includes this file has ports
    pub fn face(&self, count: usize) -> Vec<Vec<(usize, f64)>> {
        let [nx, ny, nz] = self.elements;
        let nodes = (ny + 1) * (nz + 1);
        let node = |i: usize| i * (nodes - 1) / (count - 1).max(1);
        let places = (0..count).flat_map(|i| (0..3).map(move |d| ([nx, node(i) % (ny + 1), node(i) / (ny + 1)], d)));
        places.filter_map(|(node, d)| Some(vec![(self.row(node, d)?, 1.0)])).collect()
    }
}

fn empty() -> SparseMatrix {
    SparseMatrix::from_triplets(0, []).unwrap()
}

/// Returns the stiffness, and the mass of one direction, of a box element.
fn element(edges: [f64; 3]) -> ([[f64; 24]; 24], [[f64; 8]; 8]) {
    let (young, poisson, density) = STEEL;
    let lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let shear = young / (2.0 * (1.0 + poisson));
    let volume: f64 = edges.iter().product();
    let (mut k, mut m) = ([[0.0; 24]; 24], [[0.0; 8]; 8]);
    for gauss in 0..8 {
        let at: [f64; 3] = std::array::from_fn(|i| [-1.0, 1.0][gauss >> i & 1] / 3f64.sqrt());
        let part = |c: usize, i: usize| 0.5 * (1.0 + [-1.0, 1.0][c >> i & 1] * at[i]);
        let shape = |c: usize| (0..3).map(|i| part(c, i)).product::<f64>();
        let slope = |c: usize, d: usize| {
            let along = [-1.0, 1.0][c >> d & 1] / edges[d];
            along * (0..3).filter(|i| *i != d).map(|i| part(c, i)).product::<f64>()
        };
        for (a, b) in (0..64).map(|ab| (ab / 8, ab % 8)) {
            m[a][b] += density * volume / 8.0 * shape(a) * shape(b);
            let both: f64 = (0..3).map(|d| slope(a, d) * slope(b, d)).sum();
            for (i, j) in (0..9).map(|ij| (ij / 3, ij % 3)) {
                let mut sum = lame * slope(a, i) * slope(b, j) + shear * slope(a, j) * slope(b, i);
                if i == j {
                    sum += shear * both;
                }
                k[3 * a + i][3 * b + j] += volume / 8.0 * sum;
            }
        }
    }
    (k, m)
}
