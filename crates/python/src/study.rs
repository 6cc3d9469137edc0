//! Studies from files, texts and dictionaries: reading, checking and running.

use crate::explorer::PyExplorer;
use crate::model::PyModel;
use crate::progress::{bar, close};
use crate::result::{PyResultSet, Table};
use crate::supervision::{Supervision, run_on_new_thread, run_supervised};
use crate::{error, quantity};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict, PyList, PyString};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use stickslip::dimension::Dimension;
use stickslip::model::Model;
use stickslip_explore::catalog::Source;
use stickslip_explore::change::{Change, NewValue, changed};
use stickslip_explore::quantities::{path, quantities};
use stickslip_study::dataset::{self, CellValues, Column};
use stickslip_study::result_block::{Block, Tally};
use stickslip_study::run::{CheckedStudy, check, figure_of_tables, units};
use stickslip_study::{DataContents, StudyError, read_file, read_study_with_data, templates};

/// A study, read and checked.
///
/// Made by `from_file`, `from_text`, `from_dict` or `from_template`. A study is immutable:
/// `set` and `method` return another study.
///
/// >>> import stickslip
/// >>> study = stickslip.Study.from_template("blade-couple")
/// >>> study.kind, study.cases, study.varied
/// ('response', 4, ['Ft'])
/// >>> study.set(Ft="3 N").cases
/// 1
#[pyclass(frozen, module = "stickslip", name = "Study", from_py_object)]
#[derive(Clone)]
pub struct PyStudy {
    pub study: Arc<stickslip_study::Study>,
    /// Name of the file as given.
    file: String,
    overrides: Vec<(String, String)>,
    method: Option<String>,
    /// Contents of files that `[[data]]` names.
    data: Arc<DataContents>,
    /// Result of the check, which prepares every case. Computed on the first request.
    checked: Arc<Mutex<Option<Arc<CheckedStudy>>>>,
}

impl PyStudy {
    fn checked(&self, py: Python<'_>) -> PyResult<Arc<CheckedStudy>> {
        let kept = || self.checked.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(checked) = kept().as_ref() {
            return Ok(checked.clone());
        }
        // The lock is not held during the check. A concurrent check gives the same result.
        let study = self.study.clone();
        let checked = run_on_new_thread(py, move || check(&study))?.map_err(|cause| error::study(py, &cause))?;
        Ok(kept().insert(Arc::new(checked)).clone())
    }

    /// Returns the model of a case.
    pub fn model_of(&self, py: Python<'_>, index: usize) -> PyResult<Model> {
        let study = self.study.clone();
        let case = run_on_new_thread(py, move || study.case(index))?;
        Ok(case.map_err(|cause| error::study(py, &cause))?.model)
    }

    fn finished(
        py: Python<'_>,
        file: String,
        overrides: Vec<(String, String)>,
        method: Option<String>,
        read: impl FnOnce(&[(String, String)]) -> Result<stickslip_study::Study, StudyError> + Send + 'static,
    ) -> PyResult<PyStudy> {
        let (name, set) = (method.clone(), overrides.clone());
        let study = run_on_new_thread(py, move || {
            let study = read(&set)?;
            match name {
                Some(name) => study.with_method(&name),
                None => Ok(study),
            }
        })?;
        let study = Arc::new(study.map_err(|cause| error::study(py, &cause))?);
        Ok(PyStudy { study, file, overrides, method, data: Arc::default(), checked: Arc::default() })
    }

    /// Reads a study from its text; `data` has contents of files of data.
    fn from_parts(
        py: Python<'_>,
        (file, text): (String, String),
        overrides: Vec<(String, String)>,
        method: Option<String>,
        data: Arc<DataContents>,
    ) -> PyResult<PyStudy> {
        let (name, contents) = (file.clone(), data.clone());
        let read = move |set: &[(String, String)]| read_study_with_data(&name, &text, set, &contents);
        Ok(PyStudy { data, ..PyStudy::finished(py, file, overrides, method, read)? })
    }

    fn again(&self, py: Python<'_>, overrides: Vec<(String, String)>, method: Option<String>) -> PyResult<PyStudy> {
        let parts = (self.file.clone(), self.study.text().to_owned());
        PyStudy::from_parts(py, parts, overrides, method, self.data.clone())
    }

    /// Converts values of parameters to text as on the command line.
    fn typed(&self, py: Python<'_>, values: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<(String, String)>> {
        typed(values, &|name| {
            let case = self.study.case(0).map_err(|cause| error::study(py, &cause))?;
            Ok(case.parameters.get(name).and_then(|(_, dimension)| *dimension))
        })
    }
}

/// Converts values of parameters to text as on the command line.
///
/// Numbers have the SI unit of the parameter's dimension, frequencies have Hz.
fn typed(
    values: Option<&Bound<'_, PyDict>>,
    dimension: &dyn Fn(&str) -> PyResult<Option<Dimension>>,
) -> PyResult<Vec<(String, String)>> {
    let mut set = Vec::new();
    for (name, value) in values.into_iter().flatten() {
        let name: String = name.extract()?;
        let text = if let Ok(text) = value.cast::<PyString>() {
            text.to_str()?.to_owned()
        } else {
            let number = quantity::number(&value)?.filter(|number| number.is_finite()).ok_or_else(|| {
                let message =
                    format!("`{name}` must be a finite number in SI units or a string with a unit, found {value}");
                error::model(value.py(), message)
            })?;
            let unit = match dimension(&name)? {
                None | Some(Dimension::NONE) => String::new(),
                Some(Dimension::FREQUENCY) => " Hz".to_owned(),
                Some(Dimension::SWEEP_RATE) => " Hz/s".to_owned(),
                Some(other) => {
                    format!(" {}", other.name_and_unit().map_or_else(|| other.to_string(), |(_, unit)| unit.to_owned()))
                }
            };
            format!("{number:?}{unit}")
        };
        set.push((name, text));
    }
    Ok(set)
}

#[pymethods]
impl PyStudy {
    /// Opens the study in the explorer: a page whose curves follow the parameters.
    ///
    /// A notebook shows the page in a frame of this height, px. ``port`` 0 takes a free port.
    ///
    /// >>> import stickslip
    /// >>> explorer = stickslip.Study.from_template("blade-couple").explore()
    /// >>> explorer.address.startswith("http://127.0.0.1:")
    /// True
    /// >>> explorer.stop()
    #[pyo3(signature = (*, port = 0, height = 900))]
    fn explore(&self, py: Python<'_>, port: u16, height: u32) -> PyResult<PyExplorer> {
        let wrong = |cause: String| error::exception(py, "StudyError", cause);
        if let Some(method) = &self.method {
            let advice = "the explorer uses the method of the study: write it into [method]";
            return Err(wrong(format!("`{method}` was chosen by a call; {advice}")));
        }
        let text = self.study.text();
        let document = changed(text, &[]).map_err(|cause| wrong(cause.to_string()))?;
        let known = quantities(&document);
        let is_varied = |name: &str| known.iter().any(|one| one.name == name && one.varied.is_some());
        let changes = self.overrides.iter().flat_map(|(name, value)| {
            let at = |table: &str| path(&format!("{table}.{name}"));
            let own = Change { path: at("parameters"), value: NewValue::Text(value.clone()) };
            let varied = is_varied(name).then(|| Change { path: at("study.vary"), value: NewValue::Remove });
            std::iter::once(own).chain(varied)
        });
        let text = changed(text, &changes.collect::<Vec<_>>()).map_err(|cause| wrong(cause.to_string()))?;
        PyExplorer::start(py, Source { file: self.file.clone(), text: text.to_string() }, port, height)
    }

    /// Reads the study file (TOML) at ``path``.
    ///
    /// Keyword arguments change the values of parameters, as ``--set`` does.
    #[staticmethod]
    #[pyo3(signature = (path, **set))]
    fn from_file(py: Python<'_>, path: PathBuf, set: Option<&Bound<'_, PyDict>>) -> PyResult<PyStudy> {
        let file = path.display().to_string();
        let study = PyStudy::finished(py, file, Vec::new(), None, move |set| read_file(&path, set))?;
        study.set(py, set)
    }

    /// Reads the text of a study file; ``name`` replaces the name of the file.
    #[staticmethod]
    #[pyo3(signature = (text, name="study", **set))]
    fn from_text(py: Python<'_>, text: &str, name: &str, set: Option<&Bound<'_, PyDict>>) -> PyResult<PyStudy> {
        let parts = (name.to_owned(), text.to_owned());
        PyStudy::from_parts(py, parts, Vec::new(), None, Arc::default())?.set(py, set)
    }

    /// Creates a study from a dictionary with the tables and keys of a study file.
    #[staticmethod]
    #[pyo3(signature = (tables, name="study", **set))]
    fn from_dict(
        py: Python<'_>,
        tables: Bound<'_, PyAny>,
        name: &str,
        set: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyStudy> {
        let text: String = py.import("stickslip._toml")?.call_method1("text", (tables,))?.extract()?;
        PyStudy::from_text(py, &text, name, set)
    }

    /// Creates the study of a template; ``stickslip.templates()`` lists the templates.
    #[staticmethod]
    #[pyo3(signature = (template, **set))]
    fn from_template(py: Python<'_>, template: &str, set: Option<&Bound<'_, PyDict>>) -> PyResult<PyStudy> {
        match templates::find(template) {
            Some(found) => PyStudy::from_text(py, found.study, found.name, set),
            None => {
                let names: Vec<&str> = templates::TABLE.iter().map(|one| one.name).collect();
                let message = format!("unknown template `{template}`; the templates are {}", names.join(", "));
                Err(error::model(py, message))
            }
        }
    }

    /// Returns the study with other values of its parameters.
    ///
    /// Values are strings with units, or numbers in SI units (frequencies in Hz).
    #[pyo3(signature = (**values))]
    fn set(&self, py: Python<'_>, values: Option<&Bound<'_, PyDict>>) -> PyResult<PyStudy> {
        if values.is_none_or(|values| values.is_empty()) {
            return Ok(self.clone());
        }
        let new = self.typed(py, values)?;
        let kept = self.overrides.iter().filter(|(name, _)| new.iter().all(|(other, _)| other != name)).cloned();
        let overrides = kept.chain(new.iter().cloned()).collect();
        self.again(py, overrides, self.method.clone())
    }

    /// Returns the study with another method.
    fn method(&self, py: Python<'_>, name: &str) -> PyResult<PyStudy> {
        self.again(py, self.overrides.clone(), Some(name.to_owned()))
    }

    /// Name: the file name without its extension.
    #[getter]
    fn name(&self) -> &str {
        self.study.name()
    }

    /// Title of the study.
    #[getter]
    fn title(&self) -> &str {
        self.study.title()
    }

    /// Kind of the study, for example ``"response"``.
    #[getter]
    fn kind(&self) -> &str {
        self.study.kind().name
    }

    /// Text of the file.
    #[getter]
    fn text(&self) -> &str {
        self.study.text()
    }

    /// Version of Stickslip that computes the study.
    #[getter]
    fn version(&self) -> &str {
        env!("CARGO_PKG_VERSION")
    }

    /// Names of the result tables, the most important first.
    #[getter]
    fn tables(&self) -> Vec<&str> {
        self.study.kind().tables.to_vec()
    }

    /// Number of cases.
    #[getter]
    fn cases(&self) -> usize {
        self.study.cases()
    }

    /// Number of independent units of work.
    #[getter]
    fn units(&self) -> usize {
        units(&self.study)
    }

    /// Number of points: cases times frequencies.
    #[getter]
    fn points(&self) -> usize {
        self.study.points()
    }

    /// Names of the varied parameters; the first changes slowest.
    #[getter]
    fn varied(&self) -> Vec<&str> {
        self.study.varied()
    }

    /// Returns the parameters of case ``index``: values in SI units, frequencies in Hz, as for
    /// :meth:`set`.
    #[pyo3(signature = (index=0))]
    fn parameters<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyDict>> {
        let case = self.study.case(index).map_err(|cause| error::study(py, &cause))?;
        let parameters = PyDict::new(py);
        case.parameters
            .iter()
            .try_for_each(|(name, (si, dimension))| parameters.set_item(name, quantity::user_value(*si, *dimension)))?;
        Ok(parameters)
    }

    /// Returns the model of case ``index`` for further computations in Python.
    #[pyo3(signature = (index=0))]
    fn model(&self, py: Python<'_>, index: usize) -> PyResult<PyModel> {
        Ok(PyModel::of_study(self, index, self.model_of(py, index)?))
    }

    /// Checks the study and returns its known properties as text, without running it.
    ///
    /// The text contains warnings, the modes with free and with stuck joints, the onset of
    /// slip, the size, and the time of a run on one thread, from a few computed points.
    ///
    /// Raises :class:`StudyError` if the study cannot run.
    fn check(&self, py: Python<'_>) -> PyResult<String> {
        let checked = self.checked(py)?;
        let summary = checked.summary();
        let lines =
            summary.warnings.iter().cloned().chain(self.study.notes().into_iter().map(|note| format!("note: {note}")));
        let mut text: String = lines.map(|line| line + "\n").collect();
        text += &summary.to_string();
        let probed = checked.clone();
        let time = run_on_new_thread(py, move || probed.expected_time(&Arc::new(AtomicBool::new(false))))?;
        text.extend(time.map(|time| time.summary_line()));
        Ok(text)
    }

    /// Runs the study and returns its :class:`Result`.
    ///
    /// - ``threads``: number of threads; by default all.
    /// - ``progress``: ``True`` for a bar of tqdm, or a function. The function receives the
    ///   numbers of finished points and of all points; the latter is ``None`` for adaptive
    ///   frequencies. Without tqdm, there is no bar.
    /// - ``memory``: memory limit of the run in bytes.
    ///
    /// Ctrl-C ends the run. The results have the same bits for any number of threads.
    #[pyo3(signature = (*, threads=None, progress=None, memory=None))]
    fn run(
        &self,
        py: Python<'_>,
        threads: Option<usize>,
        progress: Option<Bound<'_, PyAny>>,
        memory: Option<u64>,
    ) -> PyResult<PyResultSet> {
        let study = match memory {
            Some(bytes) => Arc::new((*self.study).clone().with_memory_limit(bytes)),
            None => self.study.clone(),
        };
        let total = (!study.is_adaptive()).then_some(study.points() as u64);
        let bar = bar(py, progress, study.name())?;
        let supervision = Supervision { threads, progress: bar.as_ref().map(|bar| bar.clone().unbind()), total };
        let outcome = run_supervised(py, &supervision, move |context| check(&study)?.run(context));
        close(bar)?;
        outcome?.map(PyResultSet::new).map_err(|cause| error::study(py, &cause))
    }

    /// Checksum of the matrices and the data in its files; ``None`` without files.
    #[getter]
    fn _files(&self) -> Option<String> {
        self.study.files_checksum()
    }

    /// Computes the units from `start` to `stop` (exclusive) on one thread.
    ///
    /// Returns their tables, points and tally for `_joined`.
    fn _batch<'py>(&self, py: Python<'py>, start: usize, stop: usize) -> PyResult<Bound<'py, PyDict>> {
        let checked = self.checked(py)?;
        let supervision = Supervision { threads: Some(1), progress: None, total: None };
        let batch = run_supervised(py, &supervision, move |context| checked.block(start..stop, context))?;
        let Block { tables, tally, .. } = batch.map_err(|cause| error::study(py, &cause))?;
        let out = PyDict::new(py);
        out.set_item("told", serde_json::to_string(&tally).map_err(|cause| error::report(py, cause))?)?;
        out.set_item("points", PyDict::from_sequence(PyList::new(py, tally.points().clone())?.as_any())?)?;
        let tables = tables.into_iter().filter(|table| !table.columns.is_empty());
        out.set_item(
            "tables",
            PyList::new(py, tables.map(Table::alone).map(|table| Py::new(py, table)).collect::<PyResult<Vec<_>>>()?)?,
        )?;
        Ok(out)
    }

    fn __repr__(&self) -> String {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        let (cases, points) = (self.study.cases(), self.study.points());
        let method = self.method.as_ref().map(|method| format!(", by {method}")).unwrap_or_default();
        let set: String = self.overrides.iter().map(|(name, value)| format!(", {name} = {value}")).collect();
        let (name, kind) = (self.study.name(), self.study.kind().name);
        format!(
            "<stickslip.Study {name}: {kind}, {cases} case{}, {points} point{}{method}{set}>",
            plural(cases),
            plural(points)
        )
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledStudy<'_, 'py>)> {
        let build = py.import("stickslip._core")?.getattr("_study")?;
        let data = PyDict::new(py);
        self.data.iter().try_for_each(|(name, content)| data.set_item(name, PyBytes::new(py, content)))?;
        Ok((build, (&self.file, self.study.text(), self.overrides.clone(), self.method.clone(), data)))
    }
}

/// Pickled study: name of the file, text, values of parameters, method, contents of data files.
type PickledStudy<'a, 'py> = (&'a str, &'a str, Vec<(String, String)>, Option<String>, Bound<'py, PyDict>);

/// Recreates a study from its pickle.
#[pyfunction]
#[pyo3(signature = (file, text, overrides, method, data=BTreeMap::new()))]
pub fn _study(
    py: Python<'_>,
    file: String,
    text: String,
    overrides: Vec<(String, String)>,
    method: Option<String>,
    data: BTreeMap<String, PyBackedBytes>,
) -> PyResult<PyStudy> {
    let data = data.into_iter().map(|(name, content)| (name, content.to_vec())).collect();
    PyStudy::from_parts(py, (file, text), overrides, method, Arc::new(data))
}

/// Columns of a table from Python: name, Arrow type and values.
type Columns<'py> = Vec<(String, String, Bound<'py, PyAny>)>;

/// Combines the tables and tallies of all batches of units to the result of a study.
#[pyfunction]
pub fn _joined<'py>(
    py: Python<'py>,
    study: &PyStudy,
    tables: Vec<(String, Columns<'py>)>,
    told: Vec<String>,
    seconds: f64,
) -> PyResult<PyResultSet> {
    let checked = study.checked(py)?;
    let (mut all, mut tally) = (Vec::new(), Tally::default());
    for (name, columns) in tables {
        let column = |(name, kind, values): (String, String, Bound<'py, PyAny>)| {
            let values = match kind.as_str() {
                "double" => {
                    CellValues::Number(values.extract::<numpy::PyReadonlyArray1<'_, f64>>()?.as_array().to_vec())
                }
                "uint64" => CellValues::Integer(values.extract()?),
                "bool" => CellValues::Flag(values.extract()?),
                _ => CellValues::Text(values.extract()?),
            };
            Ok(Column { name, values })
        };
        all.push(dataset::Table { name, columns: columns.into_iter().map(column).collect::<PyResult<_>>()? });
    }
    for text in &told {
        tally.append(serde_json::from_str(text).map_err(|cause| error::report(py, cause))?);
    }
    let mut whole = py.detach(|| {
        let figure = figure_of_tables(checked.study(), &all);
        checked.dataset_without_results(1).with_results(all, figure, tally, Duration::ZERO)
    });
    // The wall time of all batches, on all machines.
    whole.record.wall_time_s = seconds;
    Ok(PyResultSet::new(whole))
}
