//! Results of a study: tables, a figure and the record of the run.

mod arrow;
mod numpy_view;

use crate::error;
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyList, PyString, PyTuple};
use std::path::PathBuf;
use std::sync::Arc;
use stickslip_report::{Outputs, html, png, svg, terminal::Terminal, write_dataset};
use stickslip_study::dataset::{self, CellValues, Column, Dataset};
use stickslip_study::results::worst_evidence;

/// Results of a run: tables, a figure, notes, and the record of the run.
///
/// `result["curve"]` is a :class:`Table`; `result.save("out")` writes the files that the
/// command writes. A notebook shows the figure of the result.
///
/// >>> import stickslip
/// >>> result = stickslip.Study.from_template("element").run()
/// >>> result.tables
/// ['loops', 'loops_summary']
/// >>> float(result["loops_summary"]["dissipation_J"][1])     # 4 Ft (a - Ft/kt), J
/// 4e-06
#[pyclass(frozen, module = "stickslip", name = "Result")]
pub struct PyResultSet {
    dataset: Arc<Dataset>,
}

impl PyResultSet {
    pub fn new(dataset: Dataset) -> Self {
        PyResultSet { dataset: Arc::new(dataset) }
    }

    fn table(&self, index: usize) -> Table {
        Table { dataset: self.dataset.clone(), index }
    }
}

#[pymethods]
impl PyResultSet {
    /// Name of the study, and of the folder that `save` writes.
    #[getter]
    fn name(&self) -> &str {
        &self.dataset.name
    }

    /// Title of the study.
    #[getter]
    fn title(&self) -> &str {
        &self.dataset.title
    }

    /// Kind of the study, for example ``"response"``.
    #[getter]
    fn kind(&self) -> &str {
        &self.dataset.kind
    }

    /// Names of the tables, the most important first.
    #[getter]
    fn tables(&self) -> Vec<&str> {
        self.dataset.tables.iter().map(|table| table.name.as_str()).collect()
    }

    /// Notes that a reader of the results must know.
    #[getter]
    fn notes(&self) -> Vec<&str> {
        self.dataset.notes.iter().map(String::as_str).collect()
    }

    /// Points without a result: pairs of the point and the reason.
    #[getter]
    fn failures(&self) -> Vec<(&str, &str)> {
        self.dataset.failures.iter().map(|failure| (failure.location.as_str(), failure.reason.as_str())).collect()
    }

    /// Number of points by status, for example ``{"converged": 244}``.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let points = PyDict::new(py);
        self.dataset.record.points.iter().try_for_each(|(status, count)| points.set_item(status, count))?;
        Ok(points)
    }

    /// The largest error measures over all orbits.
    ///
    /// ``residual`` is the defect of the return map. ``energy_gap`` is the relative difference
    /// between the work of the excitation and the dissipated energy. Both are dimensionless,
    /// and ``None`` if the kind of study does not have them.
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let worst = worst_evidence(&self.dataset);
        let evidence = PyDict::new(py);
        evidence.set_item("residual", worst.residual)?;
        evidence.set_item("energy_gap", worst.energy_gap)?;
        Ok(evidence)
    }

    /// Record of the run as a dictionary.
    ///
    /// It contains the version, the study with all values in SI units, the methods, the threads
    /// and the wall time in s.
    #[getter]
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.dataset.record)
    }

    /// The figure as plain data: panels with axes and series, as in the figure files.
    #[getter]
    fn figure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.dataset.figure)
    }

    fn __getitem__(&self, table: &str) -> PyResult<Table> {
        match self.dataset.tables.iter().position(|one| one.name == table) {
            Some(index) => Ok(self.table(index)),
            None => Err(PyKeyError::new_err(format!(
                "unknown table `{table}`; the tables are {}",
                self.tables().join(", ")
            ))),
        }
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        PyList::new(py, self.tables())?.call_method0("__iter__")
    }

    fn __len__(&self) -> usize {
        self.dataset.tables.len()
    }

    /// Writes the files of the command into ``folder/NAME/`` and returns their paths.
    ///
    /// The files are tables as CSV, the record as JSON, and the figure as SVG, PNG and HTML
    /// page. ``only`` selects outputs instead, as in ``"csv,svg"`` or ``["csv", "svg"]``: csv,
    /// parquet, json, svg, png, html. The record is always written.
    #[pyo3(signature = (folder, only=None))]
    fn save<'py>(
        &self,
        py: Python<'py>,
        folder: PathBuf,
        only: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyList>> {
        let named = |only: &Bound<'_, PyAny>| match only.cast::<PyString>() {
            Ok(text) => Ok(text.to_str()?.split(',').map(|name| name.trim().to_owned()).collect()),
            Err(_) => only.extract::<Vec<String>>(),
        };
        let outputs = match only {
            Some(only) => Outputs::select(&named(only)?).map_err(|cause| error::report(py, cause))?,
            None => Outputs::defaults(),
        };
        let files = py.detach(|| write_dataset(&self.dataset, &folder, &outputs));
        PyList::new(py, files.map_err(|cause| error::report(py, cause))?)
    }

    /// Returns the figure as SVG.
    fn svg(&self, py: Python<'_>) -> String {
        py.detach(|| svg::to_svg(&self.dataset.figure))
    }

    /// Returns the figure as PNG.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let png = py.detach(|| png::to_png(&self.dataset.figure)).map_err(|cause| error::report(py, cause))?;
        Ok(PyBytes::new(py, &png))
    }

    /// Returns the interactive figure as a separate page.
    ///
    /// ``script`` is the address of plotly.js. By default it is the name of the file that
    /// `save` writes next to the study's folder.
    #[pyo3(signature = (script=None))]
    fn html(&self, py: Python<'_>, script: Option<&str>) -> String {
        py.detach(|| html::to_html(&self.dataset.figure, script.unwrap_or(&html::script_name())))
    }

    /// Draws the figure with matplotlib and returns its ``Figure``.
    ///
    /// ``axes`` are existing axes to draw on, one per panel.
    #[pyo3(signature = (axes=None))]
    fn plot<'py>(slf: Bound<'py, Self>, axes: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("stickslip._plot")?.getattr("plot")?.call1((slf.getattr("figure")?, axes))
    }

    fn _repr_svg_(&self, py: Python<'_>) -> Option<String> {
        (!self.dataset.figure.panels.is_empty()).then(|| self.svg(py))
    }

    fn _repr_html_(&self, py: Python<'_>) -> String {
        let tables = self.dataset.tables.iter();
        let tables = tables.map(|table| format!("<code>{}</code> ({} rows)", escaped(&table.name), table.rows()));
        let mut page =
            format!("<div><p><b>{}</b>: {}</p>", escaped(&self.dataset.title), tables.collect::<Vec<_>>().join(", "));
        page += &self._repr_svg_(py).unwrap_or_default();
        let remarks =
            self.dataset.notes.iter().cloned().chain(self.dataset.failures.iter().take(10).map(ToString::to_string));
        remarks.for_each(|remark| page += &format!("<p>{}</p>", escaped(&remark)));
        page + "</div>"
    }

    fn __repr__(&self) -> String {
        format!("<stickslip.Result {} ({}): {}>", self.dataset.name, self.dataset.kind, self.tables().join(", "))
    }

    /// Returns the text that the command prints on a terminal.
    fn __str__(&self, py: Python<'_>) -> String {
        py.detach(|| Terminal { colour: false, width: None }.text(&self.dataset, &[]))
    }

    /// Compares all tables, the figure, the notes and the record. NaN equals NaN.
    fn __eq__(&self, py: Python<'_>, other: &PyResultSet) -> bool {
        py.detach(|| same(&self.dataset, &other.dataset))
    }

    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, memo: Bound<'py, PyAny>) -> Bound<'py, Self> {
        let _ = memo; // The object is immutable.
        slf
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = py.detach(|| rmp_serde::to_vec_named(&*self.dataset)).map_err(|cause| error::report(py, cause))?;
        Ok((py.import("stickslip._core")?.getattr("_result")?, (PyBytes::new(py, &bytes),)))
    }
}

/// Compares two datasets, with NaN equal to NaN.
fn same(one: &Dataset, other: &Dataset) -> bool {
    let without_tables = |whole: &Dataset| {
        let Dataset { name, title, source, kind, tables: _, figure, notes, failures, record, mesh: _ } = whole;
        serde_json::to_value((name, title, source, kind, figure, notes, failures, record)).ok()
    };
    std::ptr::eq(one, other)
        || (one.tables.len() == other.tables.len()
            && one.tables.iter().zip(&other.tables).all(|(one, other)| same_table(one, other))
            && without_tables(one) == without_tables(other))
}

fn same_table(one: &dataset::Table, other: &dataset::Table) -> bool {
    let same_number = |(one, other): (&f64, &f64)| one == other || (one.is_nan() && other.is_nan());
    let same_column = |(one, other): (&Column, &Column)| {
        one.name == other.name
            && match (&one.values, &other.values) {
                (CellValues::Number(one), CellValues::Number(other)) => {
                    one.len() == other.len() && one.iter().zip(other).all(same_number)
                }
                (one, other) => one == other,
            }
    };
    one.name == other.name
        && one.columns.len() == other.columns.len()
        && one.columns.iter().zip(&other.columns).all(same_column)
}

/// Recreates a result from its pickle.
#[pyfunction]
pub fn _result(py: Python<'_>, bytes: &[u8]) -> PyResult<PyResultSet> {
    let dataset = py.detach(|| rmp_serde::from_slice(bytes));
    dataset
        .map(PyResultSet::new)
        .map_err(|cause| error::report(py, format!("this is not a valid pickle of a result: {cause}")))
}

/// Converts a value to plain Python data.
fn json<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|cause| error::report(py, cause))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Escapes text for a page.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// A table with named columns of equal length; the names end with the units.
///
/// ``table["blade1_amplitude_m"]`` is a read-only NumPy array over the memory of the result,
/// without a copy. A table is a mapping from names to columns. ``len(table)`` is its number of
/// rows, as for a ``DataFrame``.
///
/// pyarrow and other libraries read the whole table through Arrow's PyCapsule interface, as do
/// `to_arrow`, `to_pandas` and `to_polars`; NaN then becomes null. ``pandas.DataFrame(table)``
/// and ``polars.DataFrame(table)`` take the columns and keep NaN. ``numpy.asarray(table)`` has
/// the shape of the table and contains real numbers, or objects if a column contains texts or
/// flags.
///
/// >>> import stickslip
/// >>> table = stickslip.Study.from_template("element").run()["loops"]
/// >>> table["displacement_m"].flags.owndata
/// False
/// >>> dict(table).keys() == set(table.columns)
/// True
#[pyclass(frozen, module = "stickslip")]
pub struct Table {
    dataset: Arc<Dataset>,
    index: usize,
}

impl Table {
    /// Creates a table that belongs to no result.
    pub fn alone(table: dataset::Table) -> Table {
        let dataset = Dataset { tables: vec![table], ..Dataset::default() };
        Table { dataset: Arc::new(dataset), index: 0 }
    }

    fn table(&self) -> &dataset::Table {
        &self.dataset.tables[self.index]
    }

    /// Returns the column of this name; other keys than strings have no column.
    fn find(&self, column: &Bound<'_, PyAny>) -> Option<&Column> {
        self.table().column(column.extract().ok()?)
    }
}

#[pymethods]
impl Table {
    /// Name of the table.
    #[getter]
    fn name(&self) -> &str {
        &self.table().name
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<&str> {
        self.table().columns.iter().map(|column| column.name.as_str()).collect()
    }

    /// Number of rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.table().rows(), self.table().columns.len())
    }

    fn __len__(&self) -> usize {
        self.table().rows()
    }

    fn __getitem__<'py>(slf: Bound<'py, Self>, column: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        let Some(found) = this.find(column) else {
            let message = format!("unknown column `{column}`; the columns are {}", this.columns().join(", "));
            return Err(PyKeyError::new_err(message));
        };
        let owner = slf.clone().into_any();
        let numpy = || py.import("numpy");
        match &found.values {
            // SAFETY: the array refers to the table, which keeps the immutable dataset
            #[allow(unsafe_code)]
            CellValues::Number(values) => Ok(unsafe { numpy_view::array(values, owner) }.into_any()),
            // SAFETY: the array refers to the table, which keeps the immutable dataset
            #[allow(unsafe_code)]
            CellValues::Integer(values) => Ok(unsafe { numpy_view::array(values, owner) }.into_any()),
            CellValues::Text(values) => numpy()?.call_method1("array", (PyList::new(py, values)?, "str")),
            CellValues::Flag(values) => numpy()?.call_method1("array", (PyList::new(py, values)?, "object")),
        }
    }

    fn __contains__(&self, column: &Bound<'_, PyAny>) -> bool {
        self.find(column).is_some()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        PyList::new(py, self.columns())?.call_method0("__iter__")
    }

    /// Returns the names of the columns.
    fn keys(&self) -> Vec<&str> {
        self.columns()
    }

    /// Returns the columns.
    fn values<'py>(slf: Bound<'py, Self>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        slf.get().columns().into_iter().map(|name| slf.get_item(name)).collect()
    }

    /// Returns pairs of names and columns.
    fn items<'py>(slf: Bound<'py, Self>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
        let names = slf.get().columns().into_iter();
        names.map(|name| Ok((name.to_owned(), slf.get_item(name)?))).collect()
    }

    /// Returns a column, or ``default`` if there is no column of this name.
    #[pyo3(signature = (column, default=None))]
    fn get<'py>(
        slf: Bound<'py, Self>,
        column: &Bound<'py, PyAny>,
        default: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        if slf.get().find(column).is_none() {
            return Ok(default);
        }
        Table::__getitem__(slf, column).map(Some)
    }

    /// The class that other libraries see: pandas builds frames from dictionaries, but not from
    /// other mappings.
    #[getter]
    fn __class__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("stickslip._tables")?.getattr("Mapped")
    }

    /// Returns the table as one array of its shape.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        slf: Bound<'py, Self>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("stickslip._tables")?.getattr("to_array")?.call1((slf, dtype, copy))
    }

    fn _repr_html_(slf: Bound<'_, Self>) -> PyResult<Bound<'_, PyAny>> {
        tables(&slf, "to_html")
    }

    fn __eq__(&self, other: &Table) -> bool {
        same_table(self.table(), other.table())
    }

    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, memo: Bound<'py, PyAny>) -> Bound<'py, Self> {
        let _ = memo; // The object is immutable.
        slf
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = py.detach(|| rmp_serde::to_vec_named(self.table())).map_err(|cause| error::report(py, cause))?;
        Ok((py.import("stickslip._core")?.getattr("_table")?, (PyBytes::new(py, &bytes),)))
    }

    /// Returns row ``index`` as a dictionary; a negative index counts from the end.
    fn row<'py>(slf: Bound<'py, Self>, index: isize) -> PyResult<Bound<'py, PyDict>> {
        let (py, table) = (slf.py(), slf.get().table());
        let at = if index < 0 { table.rows().checked_add_signed(index) } else { Some(index as usize) };
        let Some(index) = at.filter(|at| *at < table.rows()) else {
            return Err(PyIndexError::new_err(format!(
                "row {index} does not exist; the table has {} rows",
                table.rows()
            )));
        };
        let row = PyDict::new(py);
        for column in &table.columns {
            match &column.values {
                CellValues::Number(values) => row.set_item(&column.name, values[index])?,
                CellValues::Integer(values) => row.set_item(&column.name, values[index])?,
                CellValues::Text(values) => row.set_item(&column.name, &values[index])?,
                CellValues::Flag(values) => row.set_item(&column.name, values[index])?,
            }
        }
        Ok(row)
    }

    /// Returns the table through Arrow's PyCapsule interface.
    ///
    /// pandas, polars, pyarrow, DuckDB and other libraries call this method.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The protocol permits a producer with a single schema to ignore the request.
        let _ = requested_schema;
        arrow::stream(py, self.dataset.clone(), self.index)
    }

    /// Returns a ``pyarrow.Table``; numbers are not copied.
    fn to_arrow<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        tables(&slf, "to_arrow")
    }

    /// Returns a ``pandas.DataFrame``.
    fn to_pandas<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        tables(&slf, "to_pandas")
    }

    /// Returns a ``polars.DataFrame``; numbers are not copied.
    fn to_polars<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        tables(&slf, "to_polars")
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.shape();
        format!("<stickslip.Table {}: {rows} rows, {columns} columns: {}>", self.name(), self.columns().join(", "))
    }
}

/// Recreates a table from its pickle.
#[pyfunction]
pub fn _table(py: Python<'_>, bytes: &[u8]) -> PyResult<Table> {
    let table = py.detach(|| rmp_serde::from_slice(bytes));
    table
        .map(Table::alone)
        .map_err(|cause| error::report(py, format!("this is not a valid pickle of a table: {cause}")))
}

fn tables<'py>(table: &Bound<'py, Table>, function: &str) -> PyResult<Bound<'py, PyAny>> {
    let function = table.py().import("stickslip._tables")?.getattr(function)?;
    function.call1(PyTuple::new(table.py(), [table])?)
}
