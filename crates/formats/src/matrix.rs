//! A matrix from any file format: sorted entries, summed and checked.
//!
//! Every position has at most one entry, which is finite and not zero. A symmetric matrix stores
//! its lower triangle only. Two files of one matrix in two formats therefore give equal matrices.

use crate::error::{Error, ErrorKind, Location};

/// A number of a matrix with its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Row, counted from zero.
    pub row: u32,
    /// Column, counted from zero.
    pub column: u32,
    /// Value, in the unit of the file.
    pub value: f64,
}

/// The meaning of the entries of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// The file contains all nonzero entries.
    General,
    /// The file contains one triangle in any arrangement, or both. Both must be equal.
    Symmetric,
    /// The file contains one triangle; the other one is its negative.
    Skew,
    /// The file does not state it: one triangle if no off-diagonal entry has
    /// its mirrored entry, else both.
    Unstated,
}

/// The origin of a matrix.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Name of the format, from the table of formats.
    pub format: &'static str,
    /// Name of the matrix in its file; empty if the format has no names.
    pub variable: String,
    /// Number of explicit zeros in the file, which are not stored here.
    pub zeros: usize,
}

/// A real matrix with its entries sorted by column, then row.
///
/// # Example
/// ```
/// use stickslip_formats::{Matrix, Symmetry};
///
/// let k = Matrix::new(2, 2, Symmetry::Symmetric, [(0, 0, 2.0), (0, 1, -1.0), (1, 1, 1.0)])?;
/// assert_eq!(k.get(1, 0), -1.0);
/// assert_eq!(k.get(0, 1), -1.0);
/// assert_eq!(k.entries().len(), 3);
/// # Ok::<(), stickslip_formats::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    entries: Vec<Entry>,
    symmetric: bool,
    names: Option<Vec<String>>,
    origin: Origin,
}

impl Matrix {
    /// Builds a matrix from entries `(row, column, value)`, counted from zero.
    /// Repeated entries are summed, and zeros are dropped.
    ///
    /// # Errors
    /// [`Error`] if an entry lies outside the size, a value is not finite, or
    /// the triangles contradict [`Symmetry::Symmetric`].
    pub fn new(
        rows: usize,
        columns: usize,
        symmetry: Symmetry,
        entries: impl IntoIterator<Item = (usize, usize, f64)>,
    ) -> Result<Self, Error> {
        let mut triplets = TripletBuilder::new(rows, columns, 0, Location::File)?;
        for (row, column, value) in entries {
            triplets.push(row, column, value, Location::File)?;
        }
        triplets.finish(symmetry)
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the entries, sorted by column, then row. For a symmetric matrix
    /// these are the entries with `row >= column`.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Returns true if the matrix equals its transpose to the last bit. Only
    /// its lower triangle is then stored.
    pub fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    /// Returns the names of the rows, such as `1353.y`, if a file has them. A
    /// row without a name has an empty one.
    pub fn names(&self) -> Option<&[String]> {
        self.names.as_deref()
    }

    /// Returns the origin of the matrix.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// Returns one value, or zero if there is no such entry, row or column.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        let (row, column) = if self.symmetric { (row.max(column), row.min(column)) } else { (row, column) };
        let found = self.entries.binary_search_by_key(&(column, row), |e| (e.column as usize, e.row as usize));
        found.map_or(0.0, |at| self.entries[at].value)
    }

    /// Returns the entries of both triangles: each entry of a symmetric matrix
    /// with its mirrored entry.
    pub fn both_triangles(&self) -> impl Iterator<Item = Entry> + '_ {
        self.entries.iter().flat_map(|&e| {
            let mirror =
                (self.symmetric && e.row != e.column).then_some(Entry { row: e.column, column: e.row, value: e.value });
            std::iter::once(e).chain(mirror)
        })
    }

    /// Returns the largest `|a_ij - a_ji|`, in the unit of the matrix, or
    /// infinity if the matrix is not square.
    pub fn asymmetry(&self) -> f64 {
        if self.symmetric {
            return 0.0;
        }
        if self.rows != self.columns {
            return f64::INFINITY;
        }
        let gap = |e: &Entry| (e.value - self.get(e.column as usize, e.row as usize)).abs();
        self.entries.iter().map(gap).fold(0.0, f64::max)
    }

    /// Returns the largest absolute value, or zero without entries.
    pub fn max_abs(&self) -> f64 {
        self.entries.iter().map(|e| e.value.abs()).fold(0.0, f64::max)
    }

    /// Returns the matrix as a symmetric one, with the mean of both triangles.
    ///
    /// `tolerance` is the largest allowed `|a_ij - a_ji|`, relative to the largest value. Use
    /// zero if both triangles come from the same numbers, and 1e-9 for files of ten digits.
    ///
    /// # Errors
    /// [`ErrorKind::NotSquare`] and [`ErrorKind::NotSymmetric`].
    pub fn into_symmetric(self, tolerance: f64) -> Result<Self, Error> {
        self.require_square()?;
        let (asymmetry, largest) = (self.asymmetry(), self.max_abs());
        if asymmetry > tolerance * largest {
            return Err(Error::new(
                ErrorKind::NotSymmetric,
                Location::File,
                format!(
                    "the matrix is not symmetric: its triangles differ by {asymmetry:e}, and its largest value is {largest:e}"
                ),
                "export the symmetric matrix: without rotation, follower loads and friction",
            ));
        }
        if self.symmetric {
            return Ok(self);
        }
        // The missing counterpart of an entry in one triangle counts as zero,
        // so the mean is half of the entry.
        let mean = |e: &Entry| {
            let other = self.get(e.column as usize, e.row as usize);
            // Each half is exact, but the sum of two large values may overflow.
            (e.row.max(e.column), e.row.min(e.column), 0.5 * e.value + 0.5 * other, other != 0.0)
        };
        let mut entries = Vec::with_capacity(self.entries.len() / 2 + 1);
        for e in &self.entries {
            let (row, column, value, twice) = mean(e);
            if e.row >= e.column || !twice {
                entries.push(Entry { row, column, value });
            }
        }
        entries.sort_by_key(|e| (e.column, e.row));
        entries.retain(|e| e.value != 0.0);
        Ok(Self { entries, symmetric: true, ..self })
    }

    /// Refuses a matrix that is not square.
    ///
    /// # Errors
    /// [`ErrorKind::NotSquare`].
    pub fn require_square(&self) -> Result<(), Error> {
        if self.rows == self.columns {
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::NotSquare,
            Location::File,
            format!("the matrix has {} rows and {} columns; it must be square", self.rows, self.columns),
            "select the stiffness, mass or damping matrix",
        ))
    }

    /// Returns the matrix with names for its rows, and for its columns if it is square.
    ///
    /// # Errors
    /// [`ErrorKind::Names`] if the number of names differs from the number of rows,
    /// or if a name occurs twice.
    pub fn with_names(mut self, names: Vec<String>) -> Result<Self, Error> {
        check_names(&names, self.rows)?;
        self.names = Some(names);
        Ok(self)
    }

    /// Returns a square matrix with its rows in the order of `names`. Missing rows become empty.
    ///
    /// Formats with row names write a row only if it has an entry. A mass matrix may therefore
    /// lack the rotations of its stiffness matrix.
    ///
    /// # Errors
    /// [`ErrorKind::Names`] if the matrix has no names, if one of its names is
    /// missing in `names`, or if `names` contains a name twice.
    ///
    /// # Example
    /// ```
    /// use stickslip_formats::{Matrix, Symmetry};
    ///
    /// let name = |name: &str| name.to_string();
    /// let mass =
    ///     Matrix::new(1, 1, Symmetry::Symmetric, [(0, 0, 3.0)])?.with_names(vec![name("7.x")])?;
    /// let mass = mass.reordered(&[name("5.x"), name("7.x")])?;
    /// assert_eq!((mass.rows(), mass.get(1, 1)), (2, 3.0));
    /// # Ok::<(), stickslip_formats::Error>(())
    /// ```
    pub fn reordered(self, names: &[String]) -> Result<Self, Error> {
        self.require_square()?;
        check_names(names, names.len())?;
        let places: std::collections::BTreeMap<&str, usize> =
            names.iter().enumerate().map(|(location, name)| (name.as_str(), location)).collect();
        let own = self.names.as_deref().ok_or_else(|| {
            Error::new(
                ErrorKind::Names,
                Location::File,
                "the rows of the matrix have no names".into(),
                "provide the file of row names that belongs to the matrix",
            )
        })?;
        let place_of = |row: u32| {
            places.get(own[row as usize].as_str()).copied().ok_or_else(|| {
                Error::new(
                    ErrorKind::Names,
                    Location::File,
                    format!(
                        "row `{}` of the matrix is not among the {} given row names",
                        own[row as usize],
                        names.len()
                    ),
                    "use matrices from one export of one model",
                )
            })
        };
        let symmetry = if self.symmetric { Symmetry::Symmetric } else { Symmetry::General };
        let mut triplets = TripletBuilder::new(names.len(), names.len(), self.entries.len(), Location::File)?;
        for e in &self.entries {
            triplets.push(place_of(e.row)?, place_of(e.column)?, e.value, Location::File)?;
        }
        let mut matrix = triplets.finish(symmetry)?;
        matrix.names = Some(names.to_vec());
        matrix.origin = self.origin;
        Ok(matrix)
    }

    /// Returns the matrix without some of its rows and the corresponding
    /// columns, such as constrained ones.
    ///
    /// # Errors
    /// [`ErrorKind::NotSquare`].
    pub fn without_rows(mut self, rows: &[usize]) -> Result<Self, Error> {
        self.require_square()?;
        let mut left = vec![true; self.rows];
        for &row in rows {
            if let Some(left) = left.get_mut(row) {
                *left = false;
            }
        }
        let places: Vec<u32> = (left.iter())
            .scan(0, |next, &left| {
                let location = *next;
                *next += u32::from(left);
                Some(location)
            })
            .collect();
        self.entries.retain(|e| left[e.row as usize] && left[e.column as usize]);
        for e in &mut self.entries {
            (e.row, e.column) = (places[e.row as usize], places[e.column as usize]);
        }
        self.rows = left.iter().filter(|&&left| left).count();
        self.columns = self.rows;
        if let Some(names) = &mut self.names {
            let mut left = left.iter();
            names.retain(|_| left.next() == Some(&true));
        }
        Ok(self)
    }

    /// Returns true if both triangles are present and equal to the last bit.
    fn is_exactly_symmetric(&self) -> bool {
        if self.rows != self.columns {
            return false;
        }
        // Entries above the diagonal of column i have the order of the entries
        // of row i left of the diagonal.
        let mut above: Vec<usize> = Vec::with_capacity(self.columns);
        let mut at = 0;
        for column in 0..self.columns {
            while self.entries.get(at).is_some_and(|e| (e.column as usize) < column) {
                at += 1;
            }
            above.push(at);
        }
        for (at, e) in self.entries.iter().enumerate() {
            if e.row > e.column {
                let location = &mut above[e.row as usize];
                let mirror = self.entries.get(*location);
                if mirror.is_none_or(|m| (m.column, m.row, m.value) != (e.row, e.column, e.value)) {
                    return false;
                }
                *location += 1;
            } else if e.row < e.column && at >= above[e.column as usize] {
                // The mirrored entry would be in an earlier column, but it was not found there.
                return false;
            }
        }
        true
    }

    /// Returns true if any off-diagonal entry has its mirrored entry.
    fn has_mirrored_entries(&self) -> bool {
        let mirror = |e: &Entry| self.entries.binary_search_by_key(&(e.row, e.column), |e| (e.column, e.row)).is_ok();
        self.entries.iter().any(|e| e.row != e.column && mirror(e))
    }

    pub(crate) fn set_origin(&mut self, format: &'static str, variable: &str) {
        self.origin.format = format;
        self.origin.variable = variable.to_string();
    }
}

/// Refuses repeated names, and a number of names other than `rows`. Empty names may repeat.
fn check_names(names: &[String], rows: usize) -> Result<(), Error> {
    let fault = |problem| {
        Err(Error::new(
            ErrorKind::Names,
            Location::File,
            problem,
            "provide the file of row names that was written with the matrix",
        ))
    };
    if names.len() != rows {
        return fault(format!("the file has {} names for {rows} rows", names.len()));
    }
    let mut sorted: Vec<&str> = names.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => fault(format!("the name `{}` appears twice", pair[0])),
        None => Ok(()),
    }
}

/// Entries of a file that become a matrix.
pub(crate) struct TripletBuilder {
    rows: usize,
    columns: usize,
    entries: Vec<Entry>,
    zeros: usize,
}

impl TripletBuilder {
    /// Creates a list with room for `expected` entries. The size of the file
    /// must bound this number, not its header.
    pub fn new(rows: usize, columns: usize, expected: usize, location: Location) -> Result<Self, Error> {
        if rows.max(columns) > u32::MAX as usize {
            return Err(Error::new(
                ErrorKind::TooLarge,
                location,
                format!("the matrix has {rows} rows and {columns} columns; at most {} of each are supported", u32::MAX),
                "check the size in the header of the file",
            ));
        }
        Ok(Self { rows, columns, entries: Vec::with_capacity(expected), zeros: 0 })
    }

    /// Adds one entry, counted from zero.
    pub fn push(&mut self, row: usize, column: usize, value: f64, location: Location) -> Result<(), Error> {
        if row >= self.rows || column >= self.columns {
            return Err(Error::new(
                ErrorKind::Count,
                location,
                format!(
                    "the entry in row {}, column {} lies outside the matrix of {} rows and {} columns",
                    row.saturating_add(1),
                    column.saturating_add(1),
                    self.rows,
                    self.columns
                ),
                "the file is damaged, or its header belongs to another matrix; export it again",
            ));
        }
        if !value.is_finite() {
            return Err(Error::new(
                ErrorKind::NotFinite,
                location,
                format!("the value in row {}, column {} is {value}", row + 1, column + 1),
                "all numbers must be finite; check the model for elements without material or with negative volume",
            ));
        }
        if value == 0.0 {
            self.zeros += 1;
        } else {
            // Both are below the size, which `new` limits to 32 bits.
            self.entries.push(Entry { row: row as u32, column: column as u32, value });
        }
        Ok(())
    }

    /// Sorts, sums and checks the entries.
    pub fn finish(mut self, symmetry: Symmetry) -> Result<Matrix, Error> {
        let square = matches!(symmetry, Symmetry::Symmetric | Symmetry::Skew);
        if square && self.rows != self.columns {
            return Err(Error::new(
                ErrorKind::NotSquare,
                Location::File,
                format!("the header states a symmetric matrix with {} rows and {} columns", self.rows, self.columns),
                "the header is damaged; export the file again",
            ));
        }
        if symmetry == Symmetry::Skew {
            self.add_negative()?;
        }
        sum_duplicates(&mut self.entries)?;
        let mut matrix = Matrix {
            rows: self.rows,
            columns: self.columns,
            entries: self.entries,
            symmetric: false,
            names: None,
            origin: Origin { zeros: self.zeros, ..Origin::default() },
        };
        if matches!(symmetry, Symmetry::Symmetric | Symmetry::Unstated) && !matrix.has_mirrored_entries() {
            for e in &mut matrix.entries {
                (e.row, e.column) = (e.row.max(e.column), e.row.min(e.column));
            }
            sum_duplicates(&mut matrix.entries)?;
            matrix.symmetric = true;
        } else if matrix.is_exactly_symmetric() {
            matrix.entries.retain(|e| e.row >= e.column);
            matrix.symmetric = true;
        } else if symmetry == Symmetry::Symmetric {
            // Both triangles in a file that should contain one: they must agree.
            matrix = matrix.into_symmetric(0.0)?;
        }
        matrix.entries.shrink_to_fit();
        Ok(matrix)
    }
}

impl TripletBuilder {
    /// Adds the other triangle of a skew-symmetric matrix.
    fn add_negative(&mut self) -> Result<(), Error> {
        let lower = self.entries.iter().any(|e| e.row > e.column);
        let upper = self.entries.iter().any(|e| e.row < e.column);
        if (lower && upper) || self.entries.iter().any(|e| e.row == e.column) {
            return Err(Error::new(
                ErrorKind::NotSymmetric,
                Location::File,
                "the skew-symmetric matrix has entries in both triangles or on its diagonal".into(),
                "store one triangle only",
            ));
        }
        let count = self.entries.len();
        self.entries.reserve_exact(count);
        for at in 0..count {
            let Entry { row, column, value } = self.entries[at];
            self.entries.push(Entry { row: column, column: row, value: -value });
        }
        Ok(())
    }
}

/// Storage order of a full matrix.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum StorageOrder {
    Rows,
    Columns,
}

/// Sizes and storage order of a full matrix.
#[derive(Clone, Copy)]
pub(crate) struct DenseLayout {
    pub rows: usize,
    pub columns: usize,
    pub order: StorageOrder,
}

/// Builds a matrix from a full one. `value` returns a number by its position in the file.
pub(crate) fn from_dense(
    layout: DenseLayout,
    location: &Location,
    value: impl Fn(usize) -> Result<f64, Error>,
) -> Result<Matrix, Error> {
    let DenseLayout { rows, columns, order } = layout;
    let count = rows.saturating_mul(columns);
    // Allocate for the nonzero values only: full matrices of structures are mostly zeros.
    let filled = (0..count).map(&value).filter(|value| value.as_ref().is_ok_and(|&value| value != 0.0)).count();
    let mut triplets = TripletBuilder::new(rows, columns, filled, location.clone())?;
    // In the storage order of a matrix, so that the entries are sorted already.
    for column in 0..columns {
        for row in 0..rows {
            let at = match order {
                StorageOrder::Rows => row * columns + column,
                StorageOrder::Columns => column * rows + row,
            };
            triplets.push(row, column, value(at)?, location.clone())?;
        }
    }
    triplets.finish(Symmetry::General)
}

/// Calls `push` for the entries of a matrix in compressed column (or row)
/// storage. `pointers` are the starts of the columns (rows).
pub(crate) fn for_each_compressed(
    pointers: &[usize],
    inner: &[usize],
    values: &[f64],
    outer: usize,
    mut push: impl FnMut(usize, usize, f64) -> Result<(), Error>,
) -> Result<(), Error> {
    let fault =
        |problem| Err(Error::new(ErrorKind::Count, Location::File, problem, "the file is damaged; export it again"));
    if Some(pointers.len()) != outer.checked_add(1) {
        return fault(format!(
            "the file has {} pointers for {outer} columns or rows; it must have one more pointer than columns or rows",
            pointers.len()
        ));
    }
    let stored = inner.len().min(values.len());
    let sorted = pointers.first() == Some(&0) && pointers.is_sorted();
    let last = pointers.last().copied().unwrap_or(0);
    if !sorted || last > stored {
        let first = pointers.first().copied().unwrap_or(0);
        return fault(format!(
            "the pointers run from {first} to {last} for {stored} entries; they must begin at 0, ascend, and not exceed the number of entries"
        ));
    }
    for (outer, pair) in pointers.windows(2).enumerate() {
        for at in pair[0]..pair[1] {
            push(outer, inner[at], values[at])?;
        }
    }
    Ok(())
}

/// Sorts the entries and sums those at one position, in file order.
fn sum_duplicates(entries: &mut Vec<Entry>) -> Result<(), Error> {
    let key = |e: &Entry| (e.column, e.row);
    if !entries.is_sorted_by_key(key) {
        entries.sort_by_key(key);
    }
    entries.dedup_by(|next, kept| {
        let same = key(next) == key(kept);
        if same {
            kept.value += next.value;
        }
        same
    });
    entries.retain(|e| e.value != 0.0);
    match entries.iter().find(|e| !e.value.is_finite()) {
        None => Ok(()),
        Some(e) => Err(Error::new(
            ErrorKind::NotFinite,
            Location::File,
            format!("the sum of the entries in row {}, column {} is {}", e.row + 1, e.column + 1, e.value),
            "all numbers must be finite; check the units",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn duplicates_are_summed_and_zeros_dropped() -> Result<(), Error> {
        let entries = [(1, 0, 2.0), (0, 0, 1.0), (1, 0, 0.5), (0, 1, 4.0), (0, 1, -4.0), (1, 1, 0.0)];
        let matrix = Matrix::new(2, 2, Symmetry::General, entries)?;
        let expected = [Entry { row: 0, column: 0, value: 1.0 }, Entry { row: 1, column: 0, value: 2.5 }];
        assert_eq!(matrix.entries(), expected);
        assert_eq!(matrix.origin().zeros, 1);
        Ok(())
    }

    #[test]
    fn a_triangle_is_the_same_matrix_as_the_other_or_both() -> Result<(), Error> {
        let lower = Matrix::new(2, 2, Symmetry::Symmetric, [(0, 0, 1.0), (1, 0, 2.0)])?;
        let upper = Matrix::new(2, 2, Symmetry::Symmetric, [(0, 1, 2.0), (0, 0, 1.0)])?;
        let both = Matrix::new(2, 2, Symmetry::Symmetric, [(0, 1, 2.0), (0, 0, 1.0), (1, 0, 2.0)])?;
        assert_eq!(lower, upper);
        assert_eq!(lower, both);
        assert_eq!(lower.both_triangles().count(), 3);
        let general = Matrix::new(2, 2, Symmetry::General, [(0, 1, 2.0), (0, 0, 1.0), (1, 0, 2.0)])?;
        assert_eq!(general, lower);
        Ok(())
    }

    #[test]
    fn a_general_matrix_is_symmetric_only_if_it_is() -> Result<(), Error> {
        let check = |entries: &[(usize, usize, f64)], symmetric| -> Result<(), Error> {
            let matrix = Matrix::new(3, 3, Symmetry::General, entries.iter().copied())?;
            assert_eq!(matrix.is_symmetric(), symmetric, "{entries:?}");
            let total: f64 = entries.iter().map(|entry| entry.2).sum();
            assert_eq!(matrix.both_triangles().map(|e| e.value).sum::<f64>(), total, "{entries:?}");
            Ok(())
        };
        check(&[], true)?;
        check(&[(1, 1, 2.0)], true)?;
        check(&[(0, 1, 2.0), (1, 0, 2.0), (2, 1, 3.0), (1, 2, 3.0), (2, 2, 1.0)], true)?;
        check(&[(0, 1, 2.0)], false)?;
        check(&[(1, 0, 2.0)], false)?;
        check(&[(0, 1, 2.0), (1, 0, 4.0)], false)?;
        check(&[(0, 1, 2.0), (1, 0, 2.0), (1, 2, 3.0)], false)?;
        check(&[(0, 2, 2.0), (2, 0, 2.0), (1, 2, 3.0), (2, 0, 1.0)], false)?;
        Ok(())
    }

    #[test]
    fn triangles_that_differ_are_refused_or_averaged() -> Result<(), Error> {
        let entries = [(0, 1, 2.0), (1, 0, 2.0 + 1e-9), (1, 1, 4.0)];
        let refused = Matrix::new(2, 2, Symmetry::Symmetric, entries).map(|_| ()).map_err(|e| e.kind);
        assert_eq!(refused, Err(ErrorKind::NotSymmetric));
        let general = Matrix::new(2, 2, Symmetry::General, entries)?;
        assert_eq!(general.clone().into_symmetric(1e-10).map_err(|e| e.kind), Err(ErrorKind::NotSymmetric));
        let mean = general.into_symmetric(1e-9)?;
        assert_eq!(mean.get(0, 1), 0.5 * 2.0 + 0.5 * (2.0 + 1e-9));
        Ok(())
    }

    #[test]
    fn an_entry_of_one_triangle_only_counts_by_half() -> Result<(), Error> {
        let upper_only = Matrix::new(2, 2, Symmetry::General, [(0, 1, 1e-12), (0, 0, 1.0)])?;
        let lower_only = Matrix::new(2, 2, Symmetry::General, [(1, 0, 1e-12), (0, 0, 1.0)])?;
        let mean = upper_only.into_symmetric(1e-9)?;
        assert_eq!(mean.get(1, 0), 0.5e-12);
        assert_eq!(mean.entries(), lower_only.into_symmetric(1e-9)?.entries());
        Ok(())
    }

    #[test]
    fn one_triangle_in_any_order_is_symmetric() -> Result<(), Error> {
        // In a file with another node order: (0, 1) and (2, 1), but no mirrored entry.
        let entries = [(0, 1, 2.0), (2, 1, 3.0), (0, 0, 1.0)];
        for symmetry in [Symmetry::Symmetric, Symmetry::Unstated] {
            let matrix = Matrix::new(3, 3, symmetry, entries)?;
            assert!(matrix.is_symmetric());
            assert_eq!((matrix.get(1, 0), matrix.get(1, 2)), (2.0, 3.0));
        }
        let both = Matrix::new(3, 3, Symmetry::Unstated, [(0, 1, 2.0), (1, 0, 2.5)])?;
        assert!(!both.is_symmetric());
        Ok(())
    }

    #[test]
    fn rows_can_be_left_out_with_their_names() -> Result<(), Error> {
        let names = ["a", "b", "c"].map(String::from).to_vec();
        let matrix = Matrix::new(3, 3, Symmetry::Symmetric, [(0, 0, 1.0), (2, 0, 2.0), (1, 1, 1e36), (2, 1, 4.0)])?;
        let left = matrix.with_names(names)?.without_rows(&[1])?;
        assert_eq!((left.rows(), left.get(1, 0), left.entries().len()), (2, 2.0, 2));
        assert_eq!(left.names(), Some(&["a", "c"].map(String::from)[..]));
        Ok(())
    }

    #[test]
    fn a_skew_triangle_gives_both() -> Result<(), Error> {
        let skew = Matrix::new(2, 2, Symmetry::Skew, [(1, 0, 3.0)])?;
        assert!(!skew.is_symmetric());
        assert_eq!((skew.get(1, 0), skew.get(0, 1)), (3.0, -3.0));
        assert_eq!(Matrix::new(2, 2, Symmetry::Skew, [(0, 0, 3.0)]).map_err(|e| e.kind), Err(ErrorKind::NotSymmetric));
        Ok(())
    }

    #[test]
    fn wrong_entries_are_refused() {
        let check = |entry, kind| {
            assert_eq!(Matrix::new(2, 3, Symmetry::General, [entry]).map_err(|e| e.kind), Err(kind));
        };
        check((2, 0, 1.0), ErrorKind::Count);
        check((0, 3, 1.0), ErrorKind::Count);
        check((0, 0, f64::NAN), ErrorKind::NotFinite);
        check((0, 0, f64::NEG_INFINITY), ErrorKind::NotFinite);
        let huge = Matrix::new(2, 2, Symmetry::General, [(0, 0, f64::MAX), (0, 0, f64::MAX)]);
        assert_eq!(huge.map_err(|e| e.kind), Err(ErrorKind::NotFinite));
        assert_eq!(Matrix::new(2, 3, Symmetry::Symmetric, []).map_err(|e| e.kind), Err(ErrorKind::NotSquare));
        assert_eq!(Matrix::new(1 << 40, 3, Symmetry::General, []).map_err(|e| e.kind), Err(ErrorKind::TooLarge));
    }

    #[test]
    fn names_must_match_the_rows() -> Result<(), Error> {
        let matrix = || Matrix::new(2, 2, Symmetry::General, [(0, 1, 1.0)]);
        let names = |names: &[&str]| names.iter().map(|name| name.to_string()).collect::<Vec<_>>();
        assert_eq!(matrix()?.with_names(names(&["a"])).map_err(|e| e.kind), Err(ErrorKind::Names));
        assert_eq!(matrix()?.with_names(names(&["a", "a"])).map_err(|e| e.kind), Err(ErrorKind::Names));
        assert!(matrix()?.with_names(names(&["", ""])).is_ok());
        let named = matrix()?.with_names(names(&["a", "b"]))?;
        let moved = named.clone().reordered(&names(&["b", "c", "a"]))?;
        assert_eq!((moved.rows(), moved.get(2, 0)), (3, 1.0));
        assert_eq!(named.reordered(&names(&["a", "c"])).map_err(|e| e.kind), Err(ErrorKind::Names));
        assert_eq!(matrix()?.reordered(&names(&["a", "b"])).map_err(|e| e.kind), Err(ErrorKind::Names));
        Ok(())
    }
}
