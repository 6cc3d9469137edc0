//! Laws written in Python, in rate form: `f = h(u, u', z)`, `z' = g(u, u', z)` over arrays of instants.
//!
//! Python is called with arrays. Derivatives come from `stickslip/_rate.py`: exact ones by dual arrays, or the author's own.
//! What a call raises is kept, the motion is answered with NaN so that the method gives up, and the exception is raised when it has.

use crate::error;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use stickslip::law::{Law, LawInfo, MOST_DIRECTIONS, Rate, RatePoint, Relative, SharedLaw};

/// What a law that Python wrote is to Rust.
pub struct Written {
    info: &'static LawInfo,
    /// Tells laws of one name apart.
    number: f64,
    /// `(u, v, z) -> (f, z')`, all two-dimensional: row, instant.
    value: Py<PyAny>,
    /// The same with the derivatives by `u, v, z`: arrays of rows of forces and rates, columns of arguments, instant.
    linearise: Py<PyAny>,
    pub directions: usize,
    pub states: usize,
    pub state_scale: f64,
    pub scale: f64,
    pub odd: bool,
    pub passive: bool,
    wrong: Mutex<Option<PyErr>>,
}

impl fmt::Debug for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Written").field("name", &self.info.name).field("number", &self.number).finish_non_exhaustive()
    }
}

/// Rows of laws by name: each name is kept once for as long as the process lives, as all that refers to a law asks for it without end.
static ROWS: Mutex<BTreeMap<String, &'static LawInfo>> = Mutex::new(BTreeMap::new());
static NUMBER: AtomicU64 = AtomicU64::new(0);

fn row(name: &str) -> &'static LawInfo {
    let mut rows = ROWS.lock().unwrap_or_else(PoisonError::into_inner);
    rows.entry(name.to_owned()).or_insert_with(|| {
        Box::leak(Box::new(LawInfo {
            name: Box::leak(name.to_owned().into_boxed_str()),
            summary: "a law written in Python",
            // its numbers are Python's
            parameters: &[],
            sample: &[],
            build: |_| panic!("a law without parameters is never built from them"),
        }))
    })
}

impl Written {
    /// A law of one direction without states, to be told what else it is.
    pub fn new(name: &str, value: Py<PyAny>, linearise: Py<PyAny>) -> Self {
        Written {
            info: row(name),
            number: NUMBER.fetch_add(1, Ordering::Relaxed) as f64,
            value,
            linearise,
            directions: 1,
            states: 0,
            state_scale: 1.0,
            scale: f64::INFINITY,
            odd: false,
            passive: false,
            wrong: Mutex::new(None),
        }
    }

    /// The law.
    pub fn law(self: &Arc<Self>) -> SharedLaw {
        Arc::new(Shown(self.clone()))
    }

    /// What a call raised since this was asked last.
    pub fn raised(&self) -> Option<PyErr> {
        self.wrong.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(&self, error: PyErr) {
        self.wrong.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }

    /// Calls Python at one instant. Of `out` the first are the forces, then the rates.
    fn call(&self, motion: &Relative<f64>, z: &[f64], out: &mut [f64], slopes: Option<&mut [f64]>) {
        let outcome = Python::attach(|py| self.answer(py, motion, z, out, slopes));
        if let Err(error) = outcome {
            self.keep(error);
            out.fill(f64::NAN);
        }
    }

    fn answer(
        &self,
        py: Python<'_>,
        motion: &Relative<f64>,
        z: &[f64],
        out: &mut [f64],
        slopes: Option<&mut [f64]>,
    ) -> PyResult<()> {
        let d = self.directions;
        let column = |values: &[f64]| PyArray1::from_slice(py, values).reshape([values.len(), 1]);
        let arguments = (column(&motion.displacement[..d])?, column(&motion.velocity[..d])?, column(z)?);
        let function = if slopes.is_some() { &self.linearise } else { &self.value };
        let answer = function.bind(py).call1(arguments)?;
        let fill = |into: &mut [f64], array: Bound<'_, PyAny>, what: &str| {
            let array = array.cast_into::<PyArray2<f64>>().map_err(PyErr::from)?;
            let array = array.readonly();
            if array.len() != into.len() {
                let message = format!(
                    "law `{}` returned {} {what} where {} were expected",
                    self.info.name,
                    array.len(),
                    into.len()
                );
                return Err(error::model(py, message));
            }
            into.iter_mut().zip(array.as_array()).for_each(|(into, value)| *into = *value);
            Ok(())
        };
        fill(out, answer.get_item(0)?, "forces and rates")?;
        match slopes {
            Some(slopes) => fill(slopes, answer.get_item(1)?, "derivatives"),
            None => Ok(()),
        }
    }
}

/// The law that methods see.
#[derive(Debug)]
struct Shown(Arc<Written>);

impl Law for Shown {
    fn info(&self) -> &'static LawInfo {
        self.0.info
    }
    fn values(&self) -> Vec<f64> {
        vec![self.0.number]
    }
    fn directions(&self) -> usize {
        self.0.directions
    }
    fn scale(&self) -> f64 {
        self.0.scale
    }
    fn rate(&self) -> Option<&dyn Rate> {
        Some(self)
    }
    fn is_odd(&self) -> bool {
        self.0.odd
    }
    fn is_incrementally_passive(&self) -> bool {
        self.0.passive
    }
}

impl Rate for Shown {
    fn states(&self) -> usize {
        self.0.states
    }
    fn state_scale(&self) -> f64 {
        self.0.state_scale
    }
    fn state_under(&self, _force: &[f64], _z: &mut [f64]) -> bool {
        false
    }
    fn value(&self, motion: &Relative<f64>, z: &[f64], rate: &mut [f64]) -> [f64; MOST_DIRECTIONS] {
        let mut out = vec![0.0; self.0.directions + self.0.states];
        self.0.call(motion, z, &mut out, None);
        let mut force = [0.0; MOST_DIRECTIONS];
        force[..self.0.directions].copy_from_slice(&out[..self.0.directions]);
        rate.copy_from_slice(&out[self.0.directions..]);
        force
    }
    fn linearise(&self, directions: usize, motion: &Relative<f64>, z: &[f64], point: &mut RatePoint) {
        let mut out = vec![0.0; self.0.directions + self.0.states];
        self.0.call(motion, z, &mut out, Some(point.slopes_mut()));
        point.force[..directions].copy_from_slice(&out[..directions]);
        point.rate.copy_from_slice(&out[directions..]);
    }
}
