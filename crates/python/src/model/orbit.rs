//! Orbits in Python; their values are computed on demand.

use super::{PyModel, SearchInput};
use crate::supervision::{run_here, run_on};
use crate::{error, quantity};
use numpy::{PyArray1, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use stickslip::method::Options;
use stickslip::model::System;
use stickslip::orbit::Orbit;
use stickslip_study::hertz;

/// A periodic solution with its error measures.
///
/// An orbit is immutable. Its pickle contains the model and the input of the search; unpickling
/// computes the orbit again, with the same bits.
///
/// >>> import stickslip
/// >>> couple = stickslip.Study.from_template("blade-couple").model()
/// >>> orbit = couple.orbit("121 Hz")
/// >>> energy = orbit.energy                         # J a period
/// >>> abs(energy["work_in"] - energy["viscous"] - energy["friction"]) < 1e-9 * energy["work_in"]
/// True
/// >>> orbit.evidence["energy_gap"] < 1e-9, orbit.stable
/// (True, True)
#[pyclass(frozen, module = "stickslip", name = "Orbit")]
pub struct PyOrbit {
    pub orbit: Arc<Orbit>,
    pub system: Arc<System>,
    pub input: SearchInput,
}

impl PyOrbit {
    /// Computes what follows from the orbit and may take long, such as the multipliers of a large
    /// model.
    fn computed<T: Send + 'static>(
        &self,
        py: Python<'_>,
        compute: impl FnOnce(&Orbit) -> T + Send + 'static,
    ) -> PyResult<T> {
        let orbit = self.orbit.clone();
        run_on(py, self.input.model.thread(), move || compute(&orbit))
    }
}

fn dict<'py, V: IntoPyObject<'py>>(
    py: Python<'py>,
    pairs: impl IntoIterator<Item = (impl AsRef<str>, V)>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    pairs.into_iter().try_for_each(|(key, value)| all.set_item(key.as_ref(), value))?;
    Ok(all)
}

#[pymethods]
impl PyOrbit {
    /// Name of the method that found the orbit.
    #[getter]
    fn method(&self) -> &str {
        self.orbit.method
    }

    /// Excitation frequency in Hz.
    #[getter]
    #[pyo3(name = "frequency_Hz")]
    fn frequency(&self) -> f64 {
        hertz(self.orbit.omega)
    }

    /// Period of the solution in s.
    #[getter]
    fn period(&self) -> f64 {
        self.orbit.period()
    }

    /// Amplitude (half of peak to peak) of every place in m.
    #[getter]
    fn amplitude<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.orbit.places.iter().map(|place| (&place.name, place.amplitude())))
    }

    /// Mean displacement of every place in m.
    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.orbit.places.iter().map(|place| (&place.name, place.mean)))
    }

    /// Complex first harmonic ``X`` of every place in m: ``x = Re(X exp(jΩt)) + …``.
    #[getter]
    fn first_harmonic<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let complex = |place: &stickslip::orbit::PlaceMotion| {
            pyo3::types::PyComplex::from_doubles(py, place.first_harmonic.re, place.first_harmonic.im)
        };
        dict(py, self.orbit.places.iter().map(|place| (&place.name, complex(place))))
    }

    /// Energy dissipated in every joint per period in J.
    #[getter]
    fn dissipation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.orbit.joints.iter().map(|joint| (&joint.name, joint.dissipation)))
    }

    /// Fraction of the period in which every joint slips.
    #[getter]
    fn slip_fraction<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.orbit.joints.iter().map(|joint| (&joint.name, joint.slip_fraction)))
    }

    /// Fraction of the period in which the contact faces of every joint stick.
    #[getter]
    fn stick_fraction<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.orbit.joints.iter().map(|joint| (&joint.name, joint.stick_fraction)))
    }

    /// Fraction of the period in which the contact faces of every joint are separated.
    #[getter]
    fn open_fraction<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.orbit.joints.iter().map(|joint| (&joint.name, joint.open_fraction)))
    }

    /// Energies per period in J: ``work_in``, ``viscous``, ``friction``.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let energy = &self.orbit.energy;
        dict(py, [("work_in", energy.work_in), ("viscous", energy.viscous), ("friction", energy.friction)])
    }

    /// Error measures of the orbit.
    ///
    /// ``residual``, ``energy_gap``, ``truncation`` and ``return_defect`` are dimensionless, and
    /// ``None`` if the method does not compute them. The other keys are ``status``, ``found_by``
    /// (the algorithm), ``iterations``, ``switches``, and two lists of joints. ``stuck``:
    /// permanently stuck joints. ``history``: joints whose mean force depends on the history of
    /// the motion.
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = &self.orbit.evidence;
        let evidence = PyDict::new(py);
        evidence.set_item("residual", found.residual)?;
        evidence.set_item("energy_gap", found.energy_gap)?;
        evidence.set_item("truncation", found.error_estimate)?;
        evidence.set_item("return_defect", self.computed(py, Orbit::return_defect)?)?;
        evidence.set_item("status", found.accuracy.status())?;
        evidence.set_item("found_by", found.found_by)?;
        evidence.set_item("iterations", found.iterations)?;
        evidence.set_item("switches", found.switches)?;
        evidence.set_item("stuck", &found.stuck)?;
        evidence.set_item("history", &found.history_dependent)?;
        Ok(evidence)
    }

    /// ``True`` if no small disturbance grows; ``None`` if this is unknown.
    #[getter]
    fn stable(&self, py: Python<'_>) -> PyResult<Option<bool>> {
        self.computed(py, Orbit::is_stable)
    }

    /// Floquet multipliers of a period in descending order of modulus; ``None`` without a
    /// return map.
    #[getter]
    fn multipliers<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<numpy::Complex64>>>> {
        let Some(multipliers) = self.computed(py, Orbit::multipliers)? else { return Ok(None) };
        let multipliers: Vec<numpy::Complex64> =
            multipliers.into_iter().map(|value| numpy::Complex64::new(value.re, value.im)).collect();
        Ok(Some(multipliers.to_pyarray(py)))
    }

    /// State at t = 0: displacements (m), velocities (m/s), then the states of joints.
    ///
    /// It is an initial guess for orbits at similar frequencies.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.orbit.initial_state.to_pyarray(py)
    }

    /// Switching times of the joints in s, ascending.
    #[getter]
    fn switch_times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.orbit.transition_times().to_pyarray(py)
    }

    /// Names of the places, in the order of `sample`.
    #[getter]
    fn places(&self) -> Vec<&str> {
        self.orbit.places.iter().map(|place| place.name.as_str()).collect()
    }

    /// Returns the motion at times (s) as a dictionary of arrays.
    ///
    /// ``time_s`` has the shape (n,); ``displacement_m``, ``velocity_m_per_s`` and
    /// ``acceleration_m_per_s2`` have the shape (n, places).
    ///
    /// Without ``times``, the method returns ``points`` equidistant times of a period from
    /// zero.
    #[pyo3(signature = (times=None, *, points=256))]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        times: Option<&Bound<'py, PyAny>>,
        points: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let times: Vec<f64> = match times {
            Some(times) => quantity::numbers(times, "`times`")?,
            None => self.times(instants(py, points)?),
        };
        let n = self.orbit.places.len();
        let mut signals: [Vec<f64>; 3] = Default::default();
        run_here(py, || {
            for &time in &times {
                let sample = self.orbit.sample(time);
                for (signal, values) in
                    signals.iter_mut().zip([&sample.displacement, &sample.velocity, &sample.acceleration])
                {
                    signal.extend(self.system.place_axes().iter().map(|place| place.component(values)));
                }
            }
        })?;
        let out = PyDict::new(py);
        out.set_item("time_s", times.to_pyarray(py))?;
        let names = ["displacement_m", "velocity_m_per_s", "acceleration_m_per_s2"];
        for (name, signal) in names.into_iter().zip(signals) {
            out.set_item(name, rows(py, signal, times.len(), n)?)?;
        }
        Ok(out)
    }

    /// Returns the loop of a joint as a dictionary of arrays.
    ///
    /// ``time_s`` has the shape (n,); ``displacement_m``, ``velocity_m_per_s`` and ``force_N``
    /// have the shape (n,) or (n, directions). The times are ``points`` equidistant times of a
    /// period and the switching times.
    #[pyo3(signature = (joint=None, *, points=256))]
    fn hysteresis<'py>(&self, py: Python<'py>, joint: Option<&str>, points: usize) -> PyResult<Bound<'py, PyDict>> {
        let index = match joint {
            None if self.orbit.joints.is_empty() => return Err(PyKeyError::new_err("the model has no joint")),
            None => 0,
            Some(name) => self.orbit.joints.iter().position(|one| one.name == name).ok_or_else(|| {
                let names: Vec<&str> = self.orbit.joints.iter().map(|one| one.name.as_str()).collect();
                PyKeyError::new_err(format!("unknown joint `{name}`; the joints are {}", names.join(", ")))
            })?,
        };
        let d = self.system.joints()[index].axes().len();
        let points = instants(py, points)?;
        let (times, signals) = run_here(py, || self.loop_of(index, points))?;
        let out = PyDict::new(py);
        out.set_item("time_s", times.to_pyarray(py))?;
        for (name, signal) in ["displacement_m", "velocity_m_per_s", "force_N"].into_iter().zip(signals) {
            let array = rows(py, signal, times.len(), d)?;
            let array = if d == 1 { array.call_method1("reshape", (times.len(),))? } else { array.into_any() };
            out.set_item(name, array)?;
        }
        Ok(out)
    }

    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, memo: Bound<'py, PyAny>) -> Bound<'py, Self> {
        let _ = memo; // The object is immutable.
        slf
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Pickled<'_>)> {
        let SearchInput { method, options, start, .. } = &self.input;
        let of = (self.input.model(), self.orbit.omega, method.as_str(), options.clone(), start.clone());
        Ok((py.import("stickslip._core")?.getattr("_orbit")?, of))
    }

    fn __repr__(&self) -> String {
        let evidence = &self.orbit.evidence;
        let (method, hertz) = (self.orbit.method, hertz(self.orbit.omega));
        format!(
            "<stickslip.Orbit at {hertz} Hz by {method}: {}, residual {:.1e}>",
            evidence.accuracy.status(),
            evidence.residual
        )
    }
}

/// Pickled orbit: model, frequency in rad/s, method, options and start.
type Pickled<'a> = (PyModel, f64, &'a str, Options, Option<Vec<f64>>);

fn rows<'py>(py: Python<'py>, values: Vec<f64>, rows: usize, columns: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_vec(py, values).reshape([rows, columns])
}

/// Checks a number of times.
pub fn instants(py: Python<'_>, points: usize) -> PyResult<usize> {
    // Maximum number of times of a sampled motion: a few hundred megabytes.
    let most_instants: usize = 10_000_000;
    if (1..=most_instants).contains(&points) {
        return Ok(points);
    }
    Err(error::model(py, format!("`points` must be a whole number from 1 to {most_instants}, found {points}")))
}

impl PyOrbit {
    fn times(&self, points: usize) -> Vec<f64> {
        (0..points).map(|i| self.orbit.period() * i as f64 / points as f64).collect()
    }

    /// Returns the times, and displacements, velocities and forces of a joint at each time.
    pub fn loop_of(&self, joint: usize, points: usize) -> (Vec<f64>, [Vec<f64>; 3]) {
        let d = self.system.joints()[joint].axes().len();
        let mut times = self.times(points);
        times.extend(self.orbit.transition_times());
        times.sort_by(f64::total_cmp);
        times.dedup();
        let mut signals: [Vec<f64>; 3] = Default::default();
        for &time in &times {
            let sample = self.orbit.sample(time).joints[joint];
            signals[0].extend(&sample.displacement[..d]);
            signals[1].extend(&sample.velocity[..d]);
            signals[2].extend(&sample.force[..d]);
        }
        (times, signals)
    }
}
