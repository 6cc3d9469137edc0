//! From an array of several columns to columns of a file.

use super::Column;

/// An array as it is stored, by columns.
pub(super) struct Array {
    pub name: String,
    pub rows: usize,
    /// Values by columns, `rows` each.
    pub real: Vec<f64>,
    /// Imaginary parts; empty if the array is real.
    pub imaginary: Vec<f64>,
}

/// Most columns of one array. An array with more of them has its values along the other
/// dimension, or is no table.
const MAX_COLUMNS: usize = 1000;

impl Array {
    /// Returns the columns of the array. Values run along the longer dimension.
    ///
    /// One column has the name of the array, several have a number behind it. A complex array
    /// has columns with `_real` and `_imaginary` at their ends. The error says why the array has
    /// no columns.
    pub fn into_columns(self) -> Result<Vec<Column>, String> {
        let count = self.real.len();
        if count == 0 || self.rows == 0 {
            return Err(format!("`{}` is empty", self.name));
        }
        let across = count / self.rows;
        let upright = self.rows >= across;
        let (length, columns) = if upright { (self.rows, across) } else { (across, self.rows) };
        if columns > MAX_COLUMNS {
            return Err(format!(
                "`{}` has {} x {across} values; a table has at most {MAX_COLUMNS} columns",
                self.name, self.rows
            ));
        }
        let pick = |values: &[f64], column: usize| -> Vec<f64> {
            let at = |i: usize| if upright { column * self.rows + i } else { i * self.rows + column };
            (0..length).map(|i| values[at(i)]).collect()
        };
        let mut out = Vec::new();
        for column in 0..columns {
            let name = if columns == 1 { self.name.clone() } else { format!("{}_{}", self.name, column + 1) };
            let make =
                |name: String, values: &[f64]| Column { name, values: pick(values, column), ..Column::default() };
            if self.imaginary.len() == count {
                out.push(make(format!("{name}_real"), &self.real));
                out.push(make(format!("{name}_imaginary"), &self.imaginary));
            } else {
                out.push(make(name, &self.real));
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_run_along_the_longer_dimension() {
        let array =
            |rows| Array { name: "a".into(), rows, real: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], imaginary: vec![] };
        let values = |rows| -> Vec<Vec<f64>> {
            array(rows).into_columns().expect("columns").into_iter().map(|column| column.values).collect()
        };
        assert_eq!(values(3), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(values(2), [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]);
        assert_eq!(values(1), [[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]);
        assert_eq!(array(3).into_columns().expect("columns")[1].name, "a_2");
    }
}
