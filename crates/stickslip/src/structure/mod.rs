//! The linear part of a system: the only owner of mass, damping and stiffness.

pub mod reduction;

use nalgebra::DMatrix;
use stickslip_numerics::eigen;

/// `M x'' + C x' + K x`, over places that are free to move.
///
/// Masses need not stand on the diagonal alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    places: Vec<String>,
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

/// Why matrices make no structure.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StructureError {
    /// A matrix has another size than there are places.
    #[error("the {matrix} matrix is {rows} x {columns}, and there are {places} places: it must be {places} x {places}")]
    Size {
        /// Which matrix.
        matrix: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// The places.
        places: usize,
    },
    /// A number is not finite.
    #[error("the {matrix} matrix has {value} in row {row}, column {column}; every entry must be finite")]
    NotFinite {
        /// Which matrix.
        matrix: &'static str,
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// The entry.
        value: f64,
    },
    /// A matrix that must be symmetric is not.
    #[error(
        "the {matrix} matrix is not symmetric: {value:e} in row {row}, column {column} and {mirrored:e} across the diagonal; \
         give both triangles, or their mean if they differ by rounding"
    )]
    NotSymmetric {
        /// Which matrix.
        matrix: &'static str,
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// The entry.
        value: f64,
        /// The other one.
        mirrored: f64,
    },
    /// The mass matrix has a direction of negative mass.
    #[error("the mass matrix is not positive semidefinite: some motion has a negative kinetic energy")]
    NegativeMass,
    /// Two places have one name.
    #[error("the name `{0}` stands twice among the places")]
    Twice(String),
}

/// Difference between an entry and its mirror image, relative to the largest entry, that counts as rounding of a program that wrote the
/// matrix with ten digits.
const SYMMETRIC: f64 = 1e-9;

impl Structure {
    /// Of places and matrices (kg, kg/s, N/m), n × n. Mass and stiffness are symmetric; damping may have a gyroscopic part.
    ///
    /// # Errors
    /// [`StructureError`]: a size that does not fit, an entry that is not finite, mass or stiffness that is not symmetric, a mass matrix that
    /// is not positive semidefinite.
    ///
    /// # Example
    /// ```
    /// use nalgebra::dmatrix;
    /// use stickslip::structure::Structure;
    /// let (m, k) = (dmatrix![1.0, 0.4; 0.4, 1.0], dmatrix![2.0, -1.0; -1.0, 2.0]);
    /// let structure = Structure::new(vec!["a".into(), "b".into()], m, dmatrix![0.1, 0.0; 0.0, 0.1], k).unwrap();
    /// assert_eq!(structure.dofs(), 2);
    /// ```
    pub fn new(
        places: Vec<String>,
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        stiffness: DMatrix<f64>,
    ) -> Result<Self, StructureError> {
        let n = places.len();
        for (i, place) in places.iter().enumerate() {
            if places[..i].contains(place) {
                return Err(StructureError::Twice(place.clone()));
            }
        }
        for (matrix, values) in [("mass", &mass), ("damping", &damping), ("stiffness", &stiffness)] {
            let (rows, columns) = values.shape();
            if (rows, columns) != (n, n) {
                return Err(StructureError::Size { matrix, rows, columns, places: n });
            }
            let symmetric = matrix != "damping";
            let rounding = SYMMETRIC * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            for column in 0..n {
                for row in 0..n {
                    let (value, mirrored) = (values[(row, column)], values[(column, row)]);
                    if !value.is_finite() {
                        return Err(StructureError::NotFinite { matrix, row: row + 1, column: column + 1, value });
                    }
                    if symmetric && (value - mirrored).abs() > rounding {
                        let (row, column) = (row + 1, column + 1);
                        return Err(StructureError::NotSymmetric { matrix, row, column, value, mirrored });
                    }
                }
            }
        }
        // a diagonal needs no factor, and lumped models of thousands of masses have nothing else
        let off_diagonal = (0..n).any(|i| (0..i).any(|k| mass[(i, k)] != 0.0));
        let negative = (0..n).any(|i| mass[(i, i)] < 0.0);
        if negative || (off_diagonal && stickslip_numerics::definite::semidefinite(&mass).is_none()) {
            return Err(StructureError::NegativeMass);
        }
        Ok(Structure { places, mass, damping, stiffness })
    }

    /// Number of degrees of freedom, n.
    pub fn dofs(&self) -> usize {
        self.places.len()
    }

    /// Names of the degrees of freedom, length n.
    pub fn places(&self) -> &[String] {
        &self.places
    }

    /// Mass matrix `M`, n × n, kg.
    pub fn mass(&self) -> &DMatrix<f64> {
        &self.mass
    }

    /// Damping matrix `C`, n × n, kg/s.
    pub fn damping(&self) -> &DMatrix<f64> {
        &self.damping
    }

    /// Stiffness matrix `K`, n × n, N/m.
    pub fn stiffness(&self) -> &DMatrix<f64> {
        &self.stiffness
    }

    /// The entries of (mass, damping, stiffness) that are not all zero: row, column, values.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, [f64; 3])> + '_ {
        let n = self.dofs();
        let all = (0..n).flat_map(move |i| (0..n).map(move |k| (i, k)));
        all.map(|at| (at.0, at.1, [self.mass[at], self.damping[at], self.stiffness[at]]))
            .filter(|(_, _, values)| values.iter().any(|v| *v != 0.0))
    }

    /// `√(φᵀMφ)` of mode `index`, scaled to a largest displacement of one: the modal amplitude (m √kg) of a metre at the place that moves
    /// most. Modes count by rising frequency from 0; zero if there is no such mode.
    pub fn modal_unit(&self, index: usize) -> f64 {
        let Some(factor) = self.mass.clone().cholesky() else { return 0.0 };
        let n = self.dofs();
        let Some(inverse) = factor.l().solve_lower_triangular(&DMatrix::identity(n, n)) else { return 0.0 };
        let Some(eigen) = eigen::symmetric(&inverse * &self.stiffness * inverse.transpose()) else { return 0.0 };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        // an M-normalised shape has φᵀMφ = 1
        order.get(index).map_or(0.0, |&k| 1.0 / (inverse.transpose() * eigen.eigenvectors.column(k)).amax())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn names() -> Vec<String> {
        vec!["a".into(), "b".into()]
    }

    #[test]
    fn wrong_matrices_are_refused_with_their_place() {
        let (one, k) = (DMatrix::identity(2, 2), dmatrix![2.0, -1.0; -1.0, 2.0]);
        let make = |m: &DMatrix<f64>, c: &DMatrix<f64>, k: &DMatrix<f64>| {
            Structure::new(names(), m.clone(), c.clone(), k.clone()).map(|_| ()).unwrap_err().to_string()
        };
        assert!(make(&DMatrix::zeros(2, 3), &one, &k).contains("2 x 3"));
        assert!(make(&one, &dmatrix![0.0, f64::NAN; 0.0, 0.0], &k).contains("row 1, column 2"));
        assert!(make(&one, &one, &dmatrix![2.0, -1.0; -0.9, 2.0]).contains("not symmetric"));
        assert!(make(&dmatrix![1.0, 2.0; 2.0, 1.0], &one, &k).contains("semidefinite"), "eigenvalues 3 and -1");
        let gyroscopic = dmatrix![0.0, 1.0; -1.0, 0.0];
        assert!(Structure::new(names(), one.clone(), gyroscopic, k.clone()).is_ok());
        let massless = dmatrix![1.0, 0.0; 0.0, 0.0];
        assert!(Structure::new(names(), massless, one.clone(), k.clone()).is_ok());
        let twice = vec!["a".to_owned(), "a".to_owned()];
        assert_eq!(Structure::new(twice, one.clone(), one, k).unwrap_err(), StructureError::Twice("a".into()));
    }
}
