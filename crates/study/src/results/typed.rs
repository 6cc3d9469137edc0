//! Results as typed values: the helpers by which study kinds read back the tables that they
//! wrote.
//!
//! A kind that offers typed results has a function for them, such as
//! [`response::curves`](crate::kinds::response::curves).

use crate::case::study::Study;
use crate::results::columns::{ENERGY_GAP, RESIDUAL};
use crate::results::dataset::{CellValues, Dataset, Table};
use crate::results::drawing::{CaseRows, FigureInput};
use crate::results::torsion_columns::of_rotation;

/// Reason why a dataset cannot be read as the results of a study.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ResultsError {
    /// The dataset is of another kind.
    #[error(
        "`{dataset}` is of kind `{found}`, but results of kind `{expected}` were requested: use the function of its \
         own kind"
    )]
    Kind {
        /// Name of the dataset.
        dataset: String,
        /// Its kind.
        found: String,
        /// The requested kind.
        expected: &'static str,
    },
    /// A column that the kind always writes is absent, or has another length than the other
    /// columns.
    #[error(
        "the table `{table}` of `{dataset}` lacks the column `{column}`, or the column is incomplete: pass the \
         dataset unchanged, as `run` returns it"
    )]
    Column {
        /// Name of the dataset.
        dataset: String,
        /// Name of the table.
        table: String,
        /// Name of the column.
        column: String,
    },
    /// Rows belong to no case of the study, or two tables do not match.
    #[error("the table `{table}` of `{dataset}` has rows of another study: pass the study that was run")]
    Rows {
        /// Name of the dataset.
        dataset: String,
        /// Name of the table.
        table: String,
    },
}

/// A resonance peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Frequency of the peak, Hz.
    pub frequency: f64,
    /// Half of the peak-to-peak value of the motion, m; in a model of rotation rad.
    pub amplitude: f64,
    /// True if the peak is only the end of the frequency range, so that the real peak lies
    /// outside.
    pub at_range_end: bool,
}

/// The worst evidence over all orbits of a dataset; a field is `None` if the kind does not
/// record it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Largest defect of the return map, as in [`stickslip::orbit::Evidence`].
    pub residual: Option<f64>,
    /// Largest relative gap between work input and energy dissipated.
    pub energy_gap: Option<f64>,
}

/// Returns the worst evidence over all orbits of a dataset of any kind.
///
/// # Example
/// ```
/// use stickslip_study::{read_study, results::worst_evidence, run::{Context, run}};
/// let text = stickslip_study::templates::find("element").unwrap().study;
/// let study = read_study("element.toml", text, &[]).unwrap();
/// let evidence = worst_evidence(&run(&study, &Context::without_progress(1)).unwrap());
/// assert!(evidence.energy_gap.unwrap() < 1e-9);
/// ```
pub fn worst_evidence(dataset: &Dataset) -> Evidence {
    let worst = |column: &str| {
        let columns = dataset.tables.iter().filter_map(|table| table.numbers(column));
        columns.flatten().copied().filter(|value| !value.is_nan()).reduce(f64::max)
    };
    Evidence { residual: worst(RESIDUAL), energy_gap: worst(ENERGY_GAP) }
}

/// A dataset with its study.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Results<'a> {
    pub study: &'a Study,
    pub dataset: &'a Dataset,
}

impl<'a> Results<'a> {
    /// Pairs a study with its dataset.
    ///
    /// # Errors
    /// The study or the dataset is of another kind.
    pub fn new(kind: &'static str, study: &'a Study, dataset: &'a Dataset) -> Result<Self, ResultsError> {
        match [study.kind().name, &dataset.kind].into_iter().find(|found| *found != kind) {
            Some(found) => {
                Err(ResultsError::Kind { dataset: dataset.name.clone(), found: found.to_owned(), expected: kind })
            }
            None => Ok(Results { study, dataset }),
        }
    }

    /// Returns a table by name; `None` if it has no rows.
    ///
    /// # Errors
    /// Its columns differ in length.
    pub fn table(&self, name: &str) -> Result<Option<TypedTable<'a>>, ResultsError> {
        let Some(table) = self.dataset.tables.iter().find(|table| table.name == name && table.rows() > 0) else {
            return Ok(None);
        };
        let written = TypedTable { dataset: self.dataset, table };
        match table.columns.iter().find(|column| column.values.len() != table.rows()) {
            Some(column) => Err(written.missing_column(&column.name)),
            None => Ok(Some(written)),
        }
    }

    /// Returns the rows of a table, grouped by the first `keys` varied parameters.
    ///
    /// # Errors
    /// Some rows belong to no case.
    pub fn case_rows(&self, written: &TypedTable<'_>, keys: usize) -> Result<Vec<CaseRows>, ResultsError> {
        let drawing = FigureInput { study: self.study, tables: &self.dataset.tables };
        let cases = drawing.case_rows_by(written.table, keys);
        let all: usize = cases.iter().map(|case_rows| case_rows.rows.len()).sum();
        if all == written.table.rows() { Ok(cases) } else { Err(written.foreign_rows()) }
    }
}

/// A table that provides columns by name and type, or an error.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TypedTable<'a> {
    dataset: &'a Dataset,
    pub table: &'a Table,
}

impl<'a> TypedTable<'a> {
    /// Returns the numbers of a column; its name states m and N, also for rad and N m.
    pub fn numbers(&self, column: &str) -> Result<&'a [f64], ResultsError> {
        let own = self.table.numbers(column);
        own.or_else(|| self.table.numbers(&of_rotation(column))).ok_or_else(|| self.missing_column(column))
    }

    pub fn integers(&self, column: &str) -> Result<&'a [u64], ResultsError> {
        let found = self.table.columns.iter().find(|c| c.name == column);
        match found.map(|c| &c.values) {
            Some(CellValues::Integer(values)) => Ok(values),
            _ => Err(self.missing_column(column)),
        }
    }

    pub fn texts(&self, column: &str) -> Result<&'a [String], ResultsError> {
        self.table.texts(column).ok_or_else(|| self.missing_column(column))
    }

    pub fn flags(&self, column: &str) -> Result<&'a [Option<bool>], ResultsError> {
        self.table.flags(column).ok_or_else(|| self.missing_column(column))
    }

    fn missing_column(&self, column: &str) -> ResultsError {
        let (dataset, table) = (self.dataset.name.clone(), self.table.name.clone());
        ResultsError::Column { dataset, table, column: column.to_owned() }
    }

    /// The error for rows that do not belong to the study.
    pub fn foreign_rows(&self) -> ResultsError {
        ResultsError::Rows { dataset: self.dataset.name.clone(), table: self.table.name.clone() }
    }
}
