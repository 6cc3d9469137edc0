//! Laws written in Python in rate form: `f = h(u, u', z)`, `z' = g(u, u', z)` over arrays of
//! points.
//!
//! Python functions receive arrays. `stickslip/_rate.py` provides derivatives, either exact
//! ones from dual arrays or those of the author. An exception in a function ends the
//! computation at once. The stack unwinds to the call from Python, which raises the exception.

use crate::error;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use stickslip::dimension::Dimension;
use stickslip::law::{Law, LawInfo, MAX_DIRECTIONS, Parameter, Range, RatePoint, RateView, RelativeMotion, SharedLaw};
use stickslip_numerics::interrupt;

/// A size: a number, or the value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Magnitude {
    Number(f64),
    /// Index of the parameter.
    Parameter(usize),
}

/// A law written in Python, without the values of its parameters.
pub struct PythonLaw {
    info: &'static LawInfo,
    /// Distinguishes laws with the same name and the same parameters.
    number: u64,
    /// A `_rate._Kernel`. Its `value` and `linearize` take `u, v, z`, all two-dimensional (row,
    /// point), and the values of the parameters.
    pub kernel: Py<PyAny>,
    pub directions: usize,
    pub states: usize,
    pub state_scale: Magnitude,
    pub scale: Magnitude,
    pub odd: bool,
    pub passive: bool,
}

impl fmt::Debug for PythonLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PythonLaw").field("name", &self.info.name).field("number", &self.number).finish_non_exhaustive()
    }
}

/// Identification of a table row: the name, and the name and dimension of each parameter.
type Signature = (String, Vec<(String, Dimension)>);

/// Table rows of laws. They are leaked, because laws require `&'static` rows.
static ROWS: Mutex<BTreeMap<Signature, &'static LawInfo>> = Mutex::new(BTreeMap::new());
/// Existing laws by number, from which laws with other values of parameters are built.
static LAWS: Mutex<BTreeMap<u64, Weak<PythonLaw>>> = Mutex::new(BTreeMap::new());
static NUMBER: AtomicU64 = AtomicU64::new(0);

fn leaked(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

fn row(name: &str, parameters: &[(String, Dimension)]) -> &'static LawInfo {
    let mut rows = ROWS.lock().unwrap_or_else(PoisonError::into_inner);
    rows.entry((name.to_owned(), parameters.to_vec())).or_insert_with(|| {
        let parameter = |(key, dimension): &(String, Dimension)| {
            Parameter::new(leaked(key), *dimension, Range::Any, "a parameter of a law written in Python")
        };
        Box::leak(Box::new(LawInfo {
            name: leaked(name),
            summary: "a law written in Python",
            parameters: Vec::leak(parameters.iter().map(parameter).collect()),
            sample: &[],
            build,
        }))
    })
}

/// Builds the law from the values of its parameters, followed by its number.
fn build(values: &[f64]) -> SharedLaw {
    let (number, values) = values.split_last().map_or((u64::MAX, values), |(number, rest)| (*number as u64, rest));
    let laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
    match laws.get(&number).and_then(Weak::upgrade) {
        Some(written) => written.law(values.to_vec()),
        None => unreachable!("the registry contains the law of every existing instance"),
    }
}

/// Returns the Python implementation of a law, if it is written in Python.
pub fn written(law: &SharedLaw) -> Option<Arc<PythonLaw>> {
    let number = law.values().get(law.info().parameters.len()).copied()?;
    LAWS.lock().unwrap_or_else(PoisonError::into_inner).get(&(number as u64)).and_then(Weak::upgrade)
}

/// Returns `true` if the law is written in Python: its number follows the values of its
/// parameters.
pub fn is_written(law: &SharedLaw) -> bool {
    law.values().len() > law.info().parameters.len()
}

impl PythonLaw {
    /// Creates a law with one direction and no states.
    ///
    /// The caller sets other properties before [registering](PythonLaw::register) it.
    pub fn new(name: &str, kernel: Py<PyAny>, parameters: &[(String, Dimension)]) -> Self {
        PythonLaw {
            info: row(name, parameters),
            number: NUMBER.fetch_add(1, Ordering::Relaxed),
            kernel,
            directions: 1,
            states: 0,
            state_scale: Magnitude::Number(1.0),
            scale: Magnitude::Number(f64::INFINITY),
            odd: false,
            passive: false,
        }
    }

    /// Registers the law under its number.
    pub fn register(self) -> Arc<Self> {
        let shared = Arc::new(self);
        LAWS.lock().unwrap_or_else(PoisonError::into_inner).insert(shared.number, Arc::downgrade(&shared));
        shared
    }

    /// Returns the law with these values of its parameters.
    pub fn law(self: &Arc<Self>, values: Vec<f64>) -> SharedLaw {
        Arc::new(PythonLawInstance { written: self.clone(), values })
    }
}

impl Drop for PythonLaw {
    fn drop(&mut self) {
        LAWS.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.number);
    }
}

/// A law written in Python, with values of its parameters.
#[derive(Debug)]
struct PythonLawInstance {
    written: Arc<PythonLaw>,
    values: Vec<f64>,
}

impl PythonLawInstance {
    fn magnitude(&self, size: Magnitude) -> f64 {
        match size {
            Magnitude::Number(number) => number,
            Magnitude::Parameter(at) => self.values[at],
        }
    }

    /// Calls Python for several points.
    ///
    /// Returns forces, then rates, as (row, point), and slopes as (row, argument, point). A
    /// Python exception ends the computation.
    fn call(&self, motions: &[RelativeMotion<f64>], z: &[f64], linear: bool) -> (Vec<f64>, Vec<f64>) {
        interrupt::check();
        match Python::attach(|py| self.call_python(py, motions, z, linear)) {
            Ok(answer) => answer,
            Err(error) => {
                interrupt::throw(Box::new(error));
                // No caller can raise the exception: NaN is a value that no method accepts.
                let rows = self.written.directions + self.written.states;
                let arguments = rows + self.written.directions;
                (vec![f64::NAN; rows * motions.len()], vec![f64::NAN; rows * arguments * motions.len()])
            }
        }
    }

    fn call_python(
        &self,
        py: Python<'_>,
        motions: &[RelativeMotion<f64>],
        z: &[f64],
        linear: bool,
    ) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let PythonLaw { directions, states, .. } = *self.written;
        let n = motions.len();
        let array = |rows: usize, value: &dyn Fn(usize, usize) -> f64| {
            let values: Vec<f64> =
                (0..rows).flat_map(|row| (0..n).map(move |i| (row, i))).map(|(row, i)| value(row, i)).collect();
            PyArray1::from_vec(py, values).reshape([rows, n])
        };
        let u = array(directions, &|row, i| motions[i].displacement[row])?;
        let v = array(directions, &|row, i| motions[i].velocity[row])?;
        let z = array(states, &|row, i| z[i * states + row])?;
        let values = PyTuple::new(py, &self.values)?;
        let name = if linear { "linearize" } else { "value" };
        let answer = self.written.kernel.bind(py).call_method1(name, (u, v, z, values))?;
        let read = |array: Bound<'_, PyAny>, length: usize, what: &str| {
            let array = array.cast_into::<PyArray2<f64>>().map_err(PyErr::from)?.readonly();
            if array.len() != length {
                let (name, found) = (self.written.info.name, array.len());
                return Err(error::model(py, format!("law `{name}` returned {found} {what}, expected {length}")));
            }
            Ok(array.as_array().iter().copied().collect::<Vec<f64>>())
        };
        let rows = directions + states;
        let out = read(answer.get_item(0)?, rows * n, "forces and rates")?;
        let slopes = match linear {
            true => read(answer.get_item(1)?, rows * (rows + directions) * n, "derivatives")?,
            false => Vec::new(),
        };
        Ok((out, slopes))
    }
}

impl Law for PythonLawInstance {
    fn info(&self) -> &'static LawInfo {
        self.written.info
    }
    fn values(&self) -> Vec<f64> {
        self.values.iter().copied().chain([self.written.number as f64]).collect()
    }
    fn directions(&self) -> usize {
        self.written.directions
    }
    fn force_scale(&self) -> f64 {
        self.magnitude(self.written.scale)
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn is_odd(&self) -> bool {
        self.written.odd
    }
    fn is_incrementally_passive(&self) -> bool {
        self.written.passive
    }
    fn check_consistency(&self) -> Result<(), String> {
        let sizes = [("scale", self.force_scale()), ("state_scale", self.magnitude(self.written.state_scale))];
        match sizes.into_iter().find(|(_, size)| size.is_nan() || *size <= 0.0) {
            Some((name, size)) => Err(format!("its `{name}` must be more than zero, found {size}")),
            None => Ok(()),
        }
    }
}

impl RateView for PythonLawInstance {
    fn states(&self) -> usize {
        self.written.states
    }
    fn state_scale(&self) -> f64 {
        self.magnitude(self.written.state_scale)
    }
    fn state_from_force(&self, _force: &[f64], _z: &mut [f64]) -> bool {
        false
    }
    fn evaluate_values(&self, motion: &RelativeMotion<f64>, z: &[f64], rate: &mut [f64]) -> [f64; MAX_DIRECTIONS] {
        let (out, _) = self.call(std::slice::from_ref(motion), z, false);
        let mut force = [0.0; MAX_DIRECTIONS];
        force[..self.written.directions].copy_from_slice(&out[..self.written.directions]);
        rate.copy_from_slice(&out[self.written.directions..]);
        force
    }
    fn evaluate_with_derivatives(
        &self,
        directions: usize,
        motion: &RelativeMotion<f64>,
        z: &[f64],
        point: &mut RatePoint,
    ) {
        self.evaluate_many_with_derivatives(directions, std::slice::from_ref(motion), z, std::slice::from_mut(point));
    }
    fn is_batched(&self) -> bool {
        true
    }
    fn evaluate_many_values(&self, motions: &[RelativeMotion<f64>], forces: &mut [[f64; MAX_DIRECTIONS]]) {
        let (out, _) = self.call(motions, &[], false);
        for (i, force) in forces.iter_mut().enumerate() {
            (0..self.written.directions).for_each(|a| force[a] = out[a * motions.len() + i]);
        }
    }
    fn evaluate_many_with_derivatives(
        &self,
        directions: usize,
        motions: &[RelativeMotion<f64>],
        z: &[f64],
        points: &mut [RatePoint],
    ) {
        let (out, slopes) = self.call(motions, z, true);
        let n = motions.len();
        for (i, point) in points.iter_mut().enumerate() {
            (0..directions).for_each(|a| point.force[a] = out[a * n + i]);
            point.rate.iter_mut().enumerate().for_each(|(s, rate)| *rate = out[(directions + s) * n + i]);
            point.slopes_mut().iter_mut().enumerate().for_each(|(at, slope)| *slope = slopes[at * n + i]);
        }
    }
}
