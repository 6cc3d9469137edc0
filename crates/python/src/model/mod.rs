//! Models built in Python, and their results: orbits, responses, loops, modes.
//!
//! - `matrices`, `disk`: models from matrices, and disks from one sector.
//! - `parameters`: the parameters of a model by name.
//! - `orbit`, `many_orbits`: one orbit, and many in one call.
//! - `orbit_table`, `figures`: tables and figures of the results.
//! - `pickle`: the binary form of a model.

mod disk;
mod figures;
mod many_orbits;
mod matrices;
pub mod orbit;
mod orbit_table;
mod parameters;
mod pickle;

use crate::law::PyLaw;
use crate::progress::{bar, close};
use crate::result::PyResultSet;
use crate::study::PyStudy;
use crate::supervision::{Supervision, WorkThread, run_on, run_on_new_thread, run_supervised};
use crate::{error, quantity};
use many_orbits::{OrbitRequest, along_frequencies, along_parameters, describe};
use numpy::{PyArray1, PyArrayMethods};
use orbit::{PyOrbit, instants};
use orbit_table::Row;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyBytes, PyDict, PyList};
use serde_json::json;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use stickslip::curve::modes::{ModeRequest, nonlinear_mode, unit_amplitude};
use stickslip::dimension::Dimension;
use stickslip::method::{self, Method, MethodError, Options, Seed, Solver, solver_with_alternatives};
use stickslip::model::{
    Body, Disk, Force, Joint, Mass, Model, ModelError, Motion, SectorDistribution, Spring, Substructure,
    SubstructureDamping, System, View, inertia_matrix, with_rotations,
};
use stickslip::structure::Reduction;
use stickslip_study::dataset::{Column, Dataset, Failure, Figure, Record, Table};
use stickslip_study::hertz;
use stickslip_study::kinds::modes;
use stickslip_study::run::NOT_REACHED;

/// A structure with joints and its excitation, built by method calls.
///
/// Quantities are numbers in SI units or strings with units; frequencies are numbers in Hz. A
/// place is a mass, a direction of a node (``"name.x"``), ``"ground"``, or a place with an
/// imposed motion.
///
/// >>> import stickslip
/// >>> model = stickslip.Model()
/// >>> for blade in ("a", "b"):
/// ...     model.mass(blade, "0.182 kg")
/// ...     model.spring(blade, "ground", stiffness=105103, damping="0.2 kg/s")
/// >>> model.joint("shroud", "a", "b", stickslip.law("coulomb", limit="2 N"))
/// >>> model.force("a", "10 N")
/// >>> orbit = model.orbit(121)
/// >>> orbit.evidence["energy_gap"] < 1e-9
/// True
#[pyclass(module = "stickslip", name = "Model")]
#[derive(Default)]
pub struct PyModel {
    model: Model,
    /// Distribution of each force and each imposed motion around a disk, if given.
    around: [Vec<Option<SectorDistribution>>; 2],
    /// Study and index of the case that the model comes from. Its structure by matrices then
    /// belongs to the study.
    study: Option<(PyStudy, usize)>,
    /// The system and the solver of the last request.
    cached: Mutex<Option<CachedSolver>>,
}

/// A system with its solver.
struct CachedSolver {
    key: (String, Options),
    /// Copy of the model at the time of the request.
    model: Arc<PyModel>,
    /// Borrows from `system`. The field order drops it first.
    solver: Box<dyn Solver + Send>,
    system: Arc<System>,
}

/// Creates the solver of a system that is stored together with the solver.
fn owned_solver(method: &dyn Method, system: &Arc<System>) -> Result<Box<dyn Solver + Send>, MethodError> {
    let solver = solver_with_alternatives(method, system)?;
    // SAFETY: the system is on the heap and does not move; `CachedSolver` drops the solver before
    // its own reference to the system, and never gives the solver away
    #[allow(unsafe_code)]
    Ok(unsafe { std::mem::transmute::<Box<dyn Solver + Send + '_>, Box<dyn Solver + Send + 'static>>(solver) })
}

impl PyModel {
    /// Wraps a model.
    pub fn from_model(model: Model) -> Self {
        PyModel { model, ..PyModel::default() }
    }

    /// Wraps the model of a case of a study.
    pub fn of_study(study: &PyStudy, case: usize, model: Model) -> Self {
        PyModel { study: Some((study.clone(), case)), ..PyModel::from_model(model) }
    }

    /// Returns the thread for work whose steps take the time of a few dense factorizations.
    fn thread(&self) -> WorkThread {
        let Model { masses, bodies, substructure, .. } = &self.model;
        let dofs = masses.len() + bodies.len() + substructure.as_ref().map_or(0, |own| own.component.dofs());
        if dofs < 100 { WorkThread::Caller } else { WorkThread::New }
    }

    /// Returns a copy without the stored solver.
    fn copied(&self) -> PyModel {
        PyModel { around: self.around.clone(), study: self.study.clone(), ..PyModel::from_model(self.model.clone()) }
    }

    /// Discards the solver after a change of the model. Sectors of a ring may then differ.
    fn changed(&mut self) {
        disk::mark_sectors_unequal(&mut self.model);
        *self.cached.get_mut().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn system(&self, py: Python<'_>) -> PyResult<System> {
        if self.around.iter().flatten().any(Option::is_some) {
            let message = "`engine_order`, `nodal_diameter` and `sector` describe an excitation around a disk, \
                           but this model is one sector: use model.disk(24) for a disk of 24 sectors";
            return Err(error::model(py, message));
        }
        let model = self.model.clone();
        run_on(py, self.thread(), move || model.assemble())?.map_err(|cause| model_error(py, &cause, &self.model))
    }

    fn request(&self, py: Python<'_>, name: &str, options: Option<&Bound<'_, PyDict>>) -> PyResult<OrbitRequest> {
        let (method, _) = build_method(py, name, options)?;
        Ok(OrbitRequest { system: Arc::new(self.system(py)?), method })
    }

    /// Computes the orbit at a frequency in rad/s.
    ///
    /// `made` returns the method and its options if the stored solver does not match.
    fn search(
        &self,
        py: Python<'_>,
        omega: f64,
        start: Option<Vec<f64>>,
        (method, plain): (&str, bool),
        made: impl FnOnce() -> PyResult<(Box<dyn Method>, Options)>,
    ) -> PyResult<PyOrbit> {
        // A thread that waits for this lock does not hold the lock of the Python interpreter.
        let mut cached = self.cached.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner);
        // Without options, the name identifies the stored solver.
        let same = |cached: &CachedSolver| plain && cached.key.0 == method && cached.key.1.is_empty();
        if !cached.as_ref().is_some_and(same) {
            let (made, options) = made()?;
            let key = (method.to_owned(), options);
            if cached.as_ref().is_none_or(|cached| cached.key != key) {
                let system = Arc::new(self.system(py)?);
                let borrowed = system.clone();
                let solver = run_on(py, self.thread(), move || owned_solver(&*made, &borrowed))?
                    .map_err(|cause| error::method(py, cause))?;
                *cached = Some(CachedSolver { key, model: Arc::new(self.copied()), solver, system });
            }
        }
        let Some(mut found) = cached.take() else { unreachable!("a solver was made above") };
        let n = 2 * found.system.dofs();
        if let Some(start) = start.as_ref().filter(|start| start.len() < n) {
            return Err(error::model(
                py,
                format!("`start` must contain {n} numbers (displacements and velocities), found {}", start.len()),
            ));
        }
        let seed = start.clone().map(|state| Seed::from_state(omega, state));
        // An interrupted solver is in an undefined state and is not kept.
        let (found, outcome) = run_on(py, self.thread(), move || {
            let outcome = found.solver.orbit_near(omega, seed.as_ref());
            (found, outcome)
        })?;
        let found = cached.insert(found);
        let orbit = outcome.map_err(|cause| error::orbit(py, cause))?;
        if let Some(start) = start.as_ref().filter(|start| start.len() != orbit.initial_state.len()) {
            let message = format!(
                "`start` has {} numbers, but orbits of this model by this method have {}: use the `start` of \
                 such an orbit",
                start.len(),
                orbit.initial_state.len()
            );
            return Err(error::model(py, message));
        }
        let input = SearchInput {
            model: found.model.clone(),
            method: found.key.0.clone(),
            options: found.key.1.clone(),
            start,
        };
        Ok(PyOrbit { orbit: Arc::new(orbit), system: found.system.clone(), input })
    }

    fn result(&self, name: &str, title: &str, tables: Vec<Table>, figure: Figure, record: RunRecord) -> PyResultSet {
        PyResultSet::new(Dataset {
            mesh: None,
            name: name.to_owned(),
            title: title.to_owned(),
            source: None,
            kind: name.to_owned(),
            tables,
            figure: Figure { title: title.to_owned(), ..figure },
            notes: record.notes,
            failures: record.failures,
            record: Record {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                study: json!({ "kind": name, "model": self.model }),
                methods: record.methods,
                seed: None,
                threads: record.threads,
                wall_time_s: record.seconds,
                interrupted: record.points.contains_key(NOT_REACHED),
                points: record.points,
            },
        })
    }
}

fn model_error(py: Python<'_>, cause: &ModelError, model: &Model) -> PyErr {
    error::model(py, describe(cause, model))
}

/// Record of a computation.
struct RunRecord {
    methods: Vec<String>,
    notes: Vec<String>,
    failures: Vec<Failure>,
    points: BTreeMap<String, u64>,
    threads: usize,
    seconds: f64,
}

impl RunRecord {
    fn of(
        rows: &[Row],
        at: &dyn Fn(usize) -> String,
        methods: Vec<String>,
        threads: usize,
        start: Instant,
    ) -> RunRecord {
        let mut points = BTreeMap::new();
        let mut failures = Vec::new();
        for (index, row) in rows.iter().enumerate() {
            *points.entry(row.status.to_owned()).or_default() += 1;
            failures.extend(row.failure.iter().map(|reason| Failure { location: at(index), reason: reason.clone() }));
        }
        RunRecord { methods, notes: Vec::new(), failures, points, threads, seconds: start.elapsed().as_secs_f64() }
    }
}

/// Returns the method of this name with its options.
fn build_method(py: Python<'_>, name: &str, given: Option<&Bound<'_, PyDict>>) -> PyResult<(Box<dyn Method>, Options)> {
    let Some(row) = method::find(name) else {
        let names: Vec<&str> = method::TABLE.iter().map(|row| row.name).collect();
        return Err(error::method(py, format!("unknown method `{name}`; the methods are {}", names.join(", "))));
    };
    let mut options = Options::new();
    for (key, value) in given.into_iter().flatten() {
        let key: String = key.extract()?;
        let Some(option) = row.options.iter().find(|option| option.key == key) else {
            let keys: Vec<&str> = row.options.iter().map(|option| option.key).collect();
            let message = match keys.len() {
                0 => format!("method `{name}` has no options, found `{key}`"),
                _ => format!("method `{name}` has no option `{key}`; its options are {}", keys.join(", ")),
            };
            return Err(error::method(py, message));
        };
        let value = quantity::to_si(&value, option.dimension, &format!("option `{key}`"))?;
        if option.count && (value < 1.0 || value.fract() != 0.0 || value > f64::from(u32::MAX)) {
            return Err(error::method(py, format!("option `{key}` must be a whole number from 1, found {value}")));
        }
        options.insert(key, value);
    }
    let method = (row.build)(&options).map_err(|cause| error::method(py, cause))?;
    Ok((method, options))
}

/// Returns the frequency of one orbit in rad/s.
fn one_frequency(value: &Bound<'_, PyAny>) -> PyResult<f64> {
    quantity::to_si(value, Dimension::FREQUENCY, "frequency")
}

#[pymethods]
impl PyModel {
    #[new]
    fn new() -> Self {
        PyModel::default()
    }

    /// Creates a model from the matrices of its structure.
    ///
    /// The matrices are n x n arrays or sparse matrices of SciPy, in kg, N/m and kg/s.
    ///
    /// - ``places``: a list with a name for every row, or a dictionary of selected places. In a
    ///   list, ``"tip.x"`` and ``"tip.y"`` define a node ``"tip"`` for joints with several
    ///   directions. A dictionary has the form ``{"tip": 12, "foot": {"x": 3, "y": 4}}`` (rows
    ///   from 0).
    /// - ``damping_ratio``: damping ratio of every mode, instead of ``damping``.
    /// - ``reduce``: the highest frequency of interest, including all relevant harmonics of the
    ///   excitation. The structure is then reduced to the smallest number of coordinates with
    ///   an error of 1e-4 up to this frequency.
    ///
    /// Masses, springs, joints, forces and motions can be added.
    ///
    /// >>> import numpy as np, stickslip
    /// >>> model = stickslip.Model.from_matrices(np.eye(2), [[2, -1], [-1, 2]], places=["a", "b"])
    /// >>> model.places
    /// ['a', 'b']
    #[staticmethod]
    #[pyo3(signature = (mass, stiffness, damping=None, *, places, damping_ratio=None, reduce=None))]
    fn from_matrices(
        py: Python<'_>,
        mass: Bound<'_, PyAny>,
        stiffness: Bound<'_, PyAny>,
        damping: Option<Bound<'_, PyAny>>,
        places: Bound<'_, PyAny>,
        damping_ratio: Option<Bound<'_, PyAny>>,
        reduce: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PyModel> {
        // The length of a list of names is the expected size of the matrices.
        let n = match places.cast::<PyDict>() {
            Ok(_) if stiffness.hasattr("shape")? => stiffness.getattr("shape")?.get_item(0)?.extract()?,
            Ok(_) => stiffness.len()?,
            Err(_) => places.len()?,
        };
        let (names, places) = matrices::places(py, &places, n)?;
        let component = matrices::component(py, names, &mass, damping.as_ref(), &stiffness)?;
        if damping_ratio.is_some() && reduce.is_none() {
            let message = "`damping_ratio` applies to modes and requires `reduce`, the highest frequency of \
                           interest, as in reduce=\"2 kHz\"";
            return Err(error::model(py, message));
        }
        let damping = match (damping_ratio, damping) {
            (None, _) => SubstructureDamping::Own,
            (Some(ratio), None) => {
                SubstructureDamping::Ratio(quantity::to_si(&ratio, Dimension::NONE, "damping_ratio")?)
            }
            (Some(_), Some(_)) => return Err(error::model(py, "give `damping` or `damping_ratio`, not both")),
        };
        let reduction = match reduce {
            None => Reduction::None { up_to: 0.0 },
            Some(reduce) => Reduction::up_to(quantity::to_si(&reduce, Dimension::FREQUENCY, "reduce")?),
        };
        let substructure = Some(Substructure { component, damping, reduction, earlier_reduction: None, disk: None });
        let made = PyModel::from_model(Model { substructure, places, ..Model::default() });
        let model = made.model.clone();
        run_on_new_thread(py, move || model.assemble().map(drop))?
            .map_err(|cause| model_error(py, &cause, &made.model))?;
        Ok(made)
    }

    /// Adds a point mass (kg).
    ///
    /// With ``directions``, up to three names, it is a node with one place per direction.
    #[pyo3(signature = (name, mass, *, directions=None))]
    fn mass(&mut self, name: String, mass: &Bound<'_, PyAny>, directions: Option<Vec<String>>) -> PyResult<()> {
        let mass = quantity::to_si(mass, Dimension::MASS, &format!("mass of `{name}`"))?;
        self.model.masses.push(Mass { name, mass, directions: directions.unwrap_or_default() });
        self.changed();
        Ok(())
    }

    /// Adds a rigid body (kg) with small rotations.
    ///
    /// Its places are the displacements of its centre of mass and its rotations, as in
    /// ``"damper.x"`` (m) and ``"damper.ry"`` (rad). :meth:`place` adds its points and faces.
    ///
    /// - ``inertia`` (kg m²): about the centre of mass, one moment for each rotation, or in space
    ///   the six entries xx, yy, zz, xy, yz, zx.
    /// - ``directions``: two of x, y, z in a plane, or all three. The rotations follow, unless
    ///   they are named, as in ``["z", "ry"]``.
    ///
    /// >>> import stickslip
    /// >>> model = stickslip.Model()
    /// >>> model.body("wedge", "20 g", "300 g mm^2", directions=["x", "z"])
    /// >>> model.place("left", "wedge", offset=["-4 mm", 0, "2 mm"], normal=[-1, 0, 1])
    /// >>> model.places
    /// ['wedge.x', 'wedge.z', 'wedge.ry', 'left.t', 'left.n']
    #[pyo3(signature = (name, mass, inertia, *, directions))]
    fn body(
        &mut self,
        py: Python<'_>,
        name: String,
        mass: &Bound<'_, PyAny>,
        inertia: &Bound<'_, PyAny>,
        directions: Vec<String>,
    ) -> PyResult<()> {
        let mass = quantity::to_si(mass, Dimension::MASS, &format!("mass of `{name}`"))?;
        let moments = quantity::many(inertia, Some(Dimension::INERTIA), &format!("inertia of `{name}`"))?;
        let directions = with_rotations(&directions.iter().map(String::as_str).collect::<Vec<_>>());
        let inertia = inertia_matrix(&directions, &moments)
            .map_err(|fault| error::model(py, format!("body `{name}`, {fault}")))?;
        self.model.bodies.push(Body { name, mass, inertia, directions });
        self.changed();
        Ok(())
    }

    /// Adds a point or a face of a body, or a face of a mass with directions.
    ///
    /// - ``of``: the body or the mass, which must exist.
    /// - ``offset`` (m): position relative to the centre of mass of a body.
    /// - ``normal``: the normal of a face, of any length. The directions are then ``t`` and ``n``
    ///   in a plane, ``t1``, ``t2`` and ``n`` in space.
    /// - ``tangent``: the direction of ``t1``.
    /// - ``directions``: other names for the directions of a face, or selected directions of a
    ///   point.
    #[pyo3(signature = (name, of, *, offset=None, normal=None, tangent=None, directions=None))]
    #[allow(clippy::too_many_arguments)] // one argument per keyword
    fn place(
        &mut self,
        py: Python<'_>,
        name: String,
        of: String,
        offset: Option<&Bound<'_, PyAny>>,
        normal: Option<&Bound<'_, PyAny>>,
        tangent: Option<&Bound<'_, PyAny>>,
        directions: Option<Vec<String>>,
    ) -> PyResult<()> {
        let vector = |given: Option<&Bound<'_, PyAny>>, dimension, key: &str| {
            let Some(given) = given else { return Ok(None) };
            let what = format!("`{key}` of `{name}`");
            let numbers = quantity::many(given, Some(dimension), &what)?;
            let found = numbers.len();
            let vector = <[f64; 3]>::try_from(numbers);
            vector.map(Some).map_err(|_| error::model(py, format!("{what} must have three components, found {found}")))
        };
        let view = View {
            offset: vector(offset, Dimension::LENGTH, "offset")?,
            normal: vector(normal, Dimension::NONE, "normal")?,
            tangent: vector(tangent, Dimension::NONE, "tangent")?,
            directions,
            ..View::new(name.as_str(), of)
        };
        let place = self.model.view(&view).map_err(|fault| error::model(py, format!("place `{name}`, {fault}")))?;
        self.model.places.push(place);
        self.changed();
        Ok(())
    }

    /// Adds a spring (N/m) with a viscous damper (kg/s) in parallel between two places.
    ///
    /// Between rotations, the units are N m/rad and N m s/rad.
    #[pyo3(signature = (a, b, *, stiffness=None, damping=None))]
    fn spring(
        &mut self,
        a: String,
        b: String,
        stiffness: Option<&Bound<'_, PyAny>>,
        damping: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let value = |given: Option<&Bound<'_, PyAny>>, dimension, what: &str| {
            given.map_or(Ok(0.0), |given| quantity::to_si(given, dimension, &format!("{what} between `{a}` and `{b}`")))
        };
        let [stiffness_dimension, damping_dimension] = parameters::spring_dimensions(&self.model, [&a, &b]);
        let stiffness = value(stiffness, stiffness_dimension, "stiffness")?;
        let damping = value(damping, damping_dimension, "damping")?;
        self.model.springs.push(Spring { between: [a, b], stiffness, damping });
        self.changed();
        Ok(())
    }

    /// Adds a joint: two places or nodes with this friction or contact law between them.
    ///
    /// ``u`` is the displacement of ``a`` relative to ``b``.
    fn joint(&mut self, name: String, a: String, b: String, law: &PyLaw) {
        self.model.joints.push(Joint { name, between: [a, b], law: law.law.clone() });
        self.changed();
    }

    /// Adds a force ``amplitude cos(harmonic Ω t + phase)`` in N, with the phase in rad.
    ///
    /// On a rotation it is a moment in N m.
    /// ``harmonic=0`` makes it constant. On a sector of a disk, the force is a travelling wave
    /// with ``engine_order``, a standing wave with ``nodal_diameter``, or acts on one
    /// ``sector``.
    #[pyo3(signature = (on, amplitude, *, phase=None, harmonic=1, engine_order=None, nodal_diameter=None, sector=None))]
    #[allow(clippy::too_many_arguments)] // one argument per keyword
    fn force(
        &mut self,
        py: Python<'_>,
        on: String,
        amplitude: &Bound<'_, PyAny>,
        phase: Option<&Bound<'_, PyAny>>,
        harmonic: u32,
        engine_order: Option<i64>,
        nodal_diameter: Option<i64>,
        sector: Option<usize>,
    ) -> PyResult<()> {
        let around = disk::around(py, engine_order, nodal_diameter, sector)?;
        let dimension = if self.model.is_rotation(&on) { Dimension::ENERGY } else { Dimension::FORCE };
        let amplitude = quantity::to_si(amplitude, dimension, &format!("force on `{on}`"))?;
        let phase = phase.map_or(Ok(0.0), |phase| quantity::to_si(phase, Dimension::ANGLE, "phase"))?;
        self.model.forces.push(Force { on, amplitude, phase, harmonic });
        self.around[0].resize(self.model.forces.len() - 1, None);
        self.around[0].push(around);
        self.changed();
        Ok(())
    }

    /// Adds an imposed motion ``amplitude cos(harmonic Ω t + phase)`` of a place, in m, or in rad
    /// of a rotation. The phase is in rad.
    ///
    /// The keywords for a disk are those of :meth:`force`.
    #[pyo3(signature = (on, amplitude, *, phase=None, harmonic=1, engine_order=None, nodal_diameter=None, sector=None))]
    #[allow(clippy::too_many_arguments)] // one argument per keyword
    fn motion(
        &mut self,
        py: Python<'_>,
        on: String,
        amplitude: &Bound<'_, PyAny>,
        phase: Option<&Bound<'_, PyAny>>,
        harmonic: u32,
        engine_order: Option<i64>,
        nodal_diameter: Option<i64>,
        sector: Option<usize>,
    ) -> PyResult<()> {
        let around = disk::around(py, engine_order, nodal_diameter, sector)?;
        let dimension = if self.model.is_rotation(&on) { Dimension::ANGLE } else { Dimension::LENGTH };
        let amplitude = quantity::to_si(amplitude, dimension, &format!("motion of `{on}`"))?;
        let phase = phase.map_or(Ok(0.0), |phase| quantity::to_si(phase, Dimension::ANGLE, "phase"))?;
        self.model.motions.push(Motion { on, amplitude, phase, harmonic });
        self.around[1].resize(self.model.motions.len() - 1, None);
        self.around[1].push(around);
        self.changed();
        Ok(())
    }

    /// Returns the disk whose sectors each equal this model.
    ///
    /// ``"next.blade"`` is the blade of the next sector; the sector after the last is the
    /// first. The places of the disk are ``blade_0``, ``blade_1`` …, as in a study file with
    /// ``[disk]``.
    ///
    /// ``mistuning``: the deviations of the sectors, as in ``{"of": "blade", "deviation": "2
    /// %", "seed": 7}``. ``of`` is a mass, or the two ends of a spring. ``deviation`` is the
    /// standard deviation of a normal distribution, or a list with one deviation per sector.
    ///
    /// A tuned disk under a travelling excitation is solved on one sector. A later change of
    /// the ring makes its sectors independent.
    ///
    /// >>> import stickslip
    /// >>> sector = stickslip.Model()
    /// >>> sector.mass("blade", "300 g")
    /// >>> sector.spring("blade", "ground", stiffness="150 N/mm", damping="0.3 kg/s")
    /// >>> law = stickslip.law("jenkins", stiffness="10 N/mm", limit="3 N")
    /// >>> sector.joint("shroud", "blade", "next.blade", law)
    /// >>> sector.force("blade", "1 N", engine_order=4)
    /// >>> ring = sector.disk(24)
    /// >>> orbit = ring.orbit("115 Hz")
    /// >>> abs(orbit.amplitude["blade_7"] / orbit.amplitude["blade_0"] - 1) < 1e-9
    /// True
    #[pyo3(signature = (sectors, *, mistuning=None))]
    fn disk(&self, py: Python<'_>, sectors: usize, mistuning: Option<&Bound<'_, PyAny>>) -> PyResult<PyModel> {
        let mistuning = mistuning.map(|given| quantity::dictionary(given, "`mistuning`")).transpose()?;
        let all = |which: usize, count: usize| -> Vec<SectorDistribution> {
            let said = |i: usize| self.around[which].get(i).copied().flatten();
            (0..count).map(|i| said(i).unwrap_or(SectorDistribution::EngineOrder(0))).collect()
        };
        let forces = all(0, self.model.forces.len());
        let disk = Disk { sectors, forces, motions: all(1, self.model.motions.len()) };
        let model = disk::ring(py, &self.model, &disk, mistuning.as_ref())?
            .map_err(|cause| model_error(py, &cause, &self.model))?;
        Ok(PyModel::from_model(model))
    }

    /// Changes the values of parameters.
    ///
    /// An example is ``model.set({"shroud.limit": "3 N", "a.mass": 0.2, "a-ground.stiffness":
    /// 1e5, "a.force": 5})``.
    fn set(&mut self, py: Python<'_>, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let values = quantity::dictionary(values, "the argument of `set`")?;
        let varied = parameters::parse_varied(py, &self.model, Some(&values), &mut vec![1.0])?;
        if let Some((name, values)) = varied.iter().find(|(_, values)| values.len() > 1) {
            return Err(error::model(
                py,
                format!("`{name}` needs one value, found {}; use `response` to vary it", values.len()),
            ));
        }
        let mut model = self.model.clone();
        for (name, values) in &varied {
            parameters::set(&mut model, name, values[0]).map_err(|message| error::model(py, message))?;
        }
        self.model = model;
        self.changed();
        Ok(())
    }

    /// Names of the places with results.
    #[getter]
    fn places(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.system(py)?.places().to_vec())
    }

    /// Names of the joints.
    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.model.joints.iter().map(|joint| joint.name.as_str()).collect()
    }

    /// Full mass (kg), damping (kg/s) and stiffness (N/m) matrices, without joints.
    #[getter]
    fn matrices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let system = self.system(py)?;
        let structure = system.structure();
        if structure.dofs() > stickslip::structure::MAX_FULL_DOFS {
            return Err(error::model(
                py,
                format!(
                    "the full matrices of {} degrees of freedom are too large; they are available up to {}",
                    structure.dofs(),
                    stickslip::structure::MAX_FULL_DOFS
                ),
            ));
        }
        let out = PyDict::new(py);
        for (name, matrix) in
            [("mass", structure.mass()), ("damping", structure.damping()), ("stiffness", structure.stiffness())]
        {
            // Storage is column by column; the transpose gives the rows.
            let (rows, values) = (matrix.nrows(), matrix.transpose());
            let array = PyArray1::from_slice(py, values.as_slice()).reshape([rows, rows])?;
            out.set_item(name, array)?;
        }
        Ok(out)
    }

    /// Checks the model and returns its known properties without computing an orbit.
    ///
    /// The dictionary contains the places, the joints and the chosen method. For models of
    /// moderate size it also contains the natural frequencies with free and with stuck joints
    /// (Hz).
    #[pyo3(signature = (method="auto", **options))]
    fn check<'py>(
        &self,
        py: Python<'py>,
        method: &str,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let OrbitRequest { system, method } = self.request(py, method, options)?;
        let prepared = system.clone();
        let choice = run_on(py, self.thread(), move || {
            solver_with_alternatives(&*method, &prepared).map(|_| method.choice(&prepared).to_string())
        })?;
        let choice = choice.map_err(|cause| error::method(py, cause))?;
        let out = PyDict::new(py);
        out.set_item("places", system.places())?;
        out.set_item("joints", self.joints())?;
        out.set_item("method", choice)?;
        // Largest number of degrees of freedom for which all natural frequencies are computed:
        // one second.
        if system.dofs() <= 600 {
            let model = self.model.clone();
            let survey = run_on(py, self.thread(), move || model.survey())?
                .map_err(|cause| model_error(py, &cause, &self.model))?;
            let hertz = |modes: &stickslip::model::LinearModes| {
                modes.elastic.iter().map(|mode| mode.omega / TAU).collect::<Vec<_>>()
            };
            out.set_item("free_Hz", hertz(survey.free()))?;
            out.set_item("stuck_Hz", hertz(survey.stuck()))?;
        }
        Ok(out)
    }

    /// Computes the periodic solution at an excitation frequency and returns an :class:`Orbit`.
    ///
    /// ``method`` and its options are those of a study's ``[method]``. ``start`` is the
    /// ``start`` of an orbit at a similar frequency, as an initial guess. Raises
    /// :class:`OrbitError` if no orbit is found, and :class:`MethodError` if the method cannot
    /// solve the model.
    #[pyo3(signature = (frequency, *, method="auto", start=None, **options))]
    fn orbit(
        &self,
        py: Python<'_>,
        frequency: &Bound<'_, PyAny>,
        method: &str,
        start: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyOrbit> {
        let omega = one_frequency(frequency)?;
        let start = start.map(|start| quantity::numbers(start, "`start`")).transpose()?;
        if start.iter().flatten().any(|value| !value.is_finite()) {
            let message =
                "`start` must contain finite numbers, like the `start` of an orbit; found a non-finite number";
            return Err(error::model(py, message));
        }
        let plain = options.is_none_or(|options| options.is_empty());
        self.search(py, omega, start, (method, plain), || build_method(py, method, options))
    }

    /// Computes orbits at many frequencies, or for many values of parameters.
    ///
    /// Returns a :class:`Result` with the table ``curve`` and a figure.
    ///
    /// - ``frequency``: numbers in Hz or strings. A single frequency applies to all points.
    /// - ``vary``: values of parameters, named as in :meth:`set`, either one or as many as
    ///   there are points. Point ``i`` has the ``i``-th value of each parameter.
    /// - ``threads`` and ``progress``: as in :meth:`Study.run`.
    ///
    /// Without ``vary``, each orbit starts from that of the adjacent point. With ``vary``, each
    /// orbit starts without an initial guess. A point without an orbit has empty cells and is
    /// listed in ``failures``.
    #[pyo3(signature = (frequency, *, vary=None, method="auto", threads=None, progress=None, **options))]
    #[allow(clippy::too_many_arguments)] // one argument per keyword
    fn response(
        &self,
        py: Python<'_>,
        frequency: &Bound<'_, PyAny>,
        vary: Option<&Bound<'_, PyAny>>,
        method: &str,
        threads: Option<usize>,
        progress: Option<Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyResultSet> {
        let start = Instant::now();
        let mut omegas = quantity::many(frequency, Some(Dimension::FREQUENCY), "frequency")?;
        let vary = vary.map(|vary| quantity::dictionary(vary, "`vary`")).transpose()?;
        let varied = parameters::parse_varied(py, &self.model, vary.as_ref(), &mut omegas)?;
        let request = self.request(py, method, options)?;
        let bar = bar(py, progress, "response")?;
        let supervision = Supervision {
            threads,
            progress: bar.as_ref().map(|bar| bar.clone().unbind()),
            total: Some(omegas.len() as u64),
        };
        let model = self.model.clone();
        let outcome = run_supervised(py, &supervision, move |context| {
            let rows = if varied.is_empty() {
                along_frequencies(&request, &omegas, context)
            } else {
                along_parameters(&model, &request, &omegas, &varied, context)
            };
            (rows, context.threads, request, omegas, varied)
        });
        close(bar)?;
        let (rows, threads, request, omegas, varied) = outcome?;
        let rows = rows.map_err(|refusal| refusal.raised(py))?;
        let at = |index: usize| {
            let values = varied.iter().map(|(name, values)| format!("{name} = {}", values[index]));
            values.chain([format!("frequency = {:.6} Hz", hertz(omegas[index]))]).collect::<Vec<_>>().join(", ")
        };
        let record =
            RunRecord::of(&rows, &at, vec![request.method.choice(&request.system).to_string()], threads, start);
        let first = varied
            .iter()
            .map(|(name, values)| Column::numbers(&name.replace(['.', '-'], "_"), values.clone()))
            .collect();
        let table = orbit_table::table("curve", first, &request.system, &*request.method, &rows);
        let figure = figures::curves(&table, &request.system, varied.first().map(|(name, _)| name.as_str()));
        Ok(self.result("response", "Response", vec![table], figure, record))
    }

    /// Computes the loops of all joints at an excitation frequency and returns a
    /// :class:`Result`.
    ///
    /// The table ``loops`` has force over displacement at ``points`` equidistant times of a
    /// period and at the switching times. The table ``loops_summary`` has the dissipation per
    /// period (J). The result has a figure.
    #[pyo3(signature = (frequency, *, points=256, method="auto", **options))]
    fn hysteresis(
        &self,
        py: Python<'_>,
        frequency: &Bound<'_, PyAny>,
        points: usize,
        method: &str,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyResultSet> {
        let (start, points) = (Instant::now(), instants(py, points)?);
        let found = self.orbit(py, frequency, method, None, options)?;
        let (tables, figure) = figures::loops(&found, points);
        let row = Row::new(&found.system, found.orbit.omega, Ok(&*found.orbit));
        let record = RunRecord::of(&[row], &|_| String::new(), vec![found.orbit.method.to_owned()], 1, start);
        Ok(self.result("hysteresis", "Hysteresis", tables, figure, record))
    }

    /// Computes a nonlinear mode and returns a :class:`Result` with the table ``modes``.
    ///
    /// The table has frequency and damping ratio over the modal amplitude (m √kg).
    ///
    /// - ``amplitude``: the smallest and the largest amplitude.
    /// - ``mode``: number of the mode in ascending order of frequency, from 1.
    #[pyo3(signature = (amplitude, *, mode=1, points=61, harmonics=15, samples=1024))]
    fn modes(
        &self,
        py: Python<'_>,
        amplitude: &Bound<'_, PyAny>,
        mode: usize,
        points: usize,
        harmonics: usize,
        samples: usize,
    ) -> PyResult<PyResultSet> {
        let start = Instant::now();
        let [low, high] = quantity::numbers(amplitude, "`amplitude`")?[..] else {
            return Err(error::model(py, "`amplitude` must be two numbers, the smallest and the largest"));
        };
        if !(low.is_finite() && high.is_finite() && 0.0 < low && low < high) {
            let message = format!("`amplitude` must be two numbers 0 < smallest < largest, found {low} and {high}");
            return Err(error::model(py, message));
        }
        for (name, value, least) in [("mode", mode, 1), ("harmonics", harmonics, 1), ("points", points, 2)] {
            if value < least {
                return Err(error::model(py, format!("`{name}` must be at least {least}, found {value}")));
            }
        }
        // The minimum number of samples avoids aliasing of harmonics.
        if samples < 4 * harmonics + 4 {
            return Err(error::model(
                py,
                format!("{harmonics} harmonics need at least {} samples, found {samples}", 4 * harmonics + 4),
            ));
        }
        let system = self.system(py)?;
        let request = ModeRequest { mode: mode - 1, range: (low, high), points, harmonics, samples };
        let system = Arc::new(system);
        let moved = system.clone();
        let outcome = run_on_new_thread(py, move || {
            let unit = unit_amplitude(&moved, request.mode)?;
            unit.map(|unit| Ok((unit, nonlinear_mode(&moved, request)?))).transpose()
        })?;
        let found = outcome.map_err(|cause: MethodError| error::method(py, cause))?;
        let (unit, found) = found.ok_or_else(|| error::model(py, format!("mode {mode}: {}", modes::NO_SUCH_MODE)))?;
        let (table, figure) = figures::mode(&found, &system);
        let mut record = RunRecord::of(&[], &|_| String::new(), Vec::new(), 1, start);
        let (status, reason) = modes::mode_status(unit, &found);
        record.points.insert(status.to_owned(), found.points.len() as u64);
        record.notes.extend(reason.map(|reason| format!("{status}: {reason}")));
        record.notes.extend(modes::remarks(unit, &found));
        Ok(self.result("modes", "Nonlinear mode", vec![table], figure, record))
    }

    fn __copy__(&self) -> PyModel {
        self.copied()
    }

    fn __deepcopy__(&self, memo: Bound<'_, PyAny>) -> PyModel {
        let _ = memo; // The referenced objects are immutable.
        self.copied()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PickledModel<'py>)> {
        let bytes =
            pickle::bytes(&self.model, &self.around, self.study.is_some()).map_err(|cause| error::model(py, cause))?;
        let laws = self.model.joints.iter().map(|joint| Py::new(py, PyLaw::of(joint.law.clone())));
        let laws = PyList::new(py, laws.collect::<PyResult<Vec<_>>>()?)?;
        Ok((py.import("stickslip._core")?.getattr("_model")?, (PyBytes::new(py, &bytes), laws, self.study.clone())))
    }

    fn __repr__(&self) -> String {
        let model = &self.model;
        let own = model.substructure.as_ref().map(|own| format!(", matrices of {} rows", own.component.dofs()));
        format!(
            "<stickslip.Model: {} masses, {} bodies, {} springs, {} joints, {} forces, {} motions{}>",
            model.masses.len(),
            model.bodies.len(),
            model.springs.len(),
            model.joints.len(),
            model.forces.len(),
            model.motions.len(),
            own.unwrap_or_default()
        )
    }
}

/// Pickled model: its parts, the laws of its joints, and the study that owns its structure.
type PickledModel<'py> = (Bound<'py, PyBytes>, Bound<'py, PyList>, Option<(PyStudy, usize)>);

/// Recreates a model from its pickle.
#[pyfunction]
#[pyo3(signature = (bytes, laws, study))]
pub fn _model(
    py: Python<'_>,
    bytes: &[u8],
    laws: Vec<PyRef<'_, PyLaw>>,
    study: Option<(PyStudy, usize)>,
) -> PyResult<PyModel> {
    let laws = laws.iter().map(|law| law.law.clone()).collect();
    let (mut model, around) = pickle::model(bytes, laws).map_err(|cause| error::model(py, cause))?;
    if let Some((study, case)) = &study {
        let of_study = study.model_of(py, *case)?;
        let added = std::mem::replace(&mut model.places, of_study.places);
        let added = added.into_iter().filter(|view| model.places.iter().all(|place| place.name != view.name));
        let added: Vec<_> = added.collect();
        model.places.extend(added);
        model.substructure = of_study.substructure;
    }
    Ok(PyModel { around, study, ..PyModel::from_model(model) })
}

/// Input of an orbit search, which reproduces the same bits.
pub struct SearchInput {
    pub model: Arc<PyModel>,
    pub method: String,
    pub options: Options,
    pub start: Option<Vec<f64>>,
}

impl SearchInput {
    /// Returns the model at the time of the search.
    pub fn model(&self) -> PyModel {
        self.model.copied()
    }
}

/// Recreates an orbit from its pickle: frequency in rad/s, options in SI units.
#[pyfunction]
pub fn _orbit(
    py: Python<'_>,
    model: PyRef<'_, PyModel>,
    omega: f64,
    method: &str,
    options: Options,
    start: Option<Vec<f64>>,
) -> PyResult<PyOrbit> {
    let made = || {
        let row = method::find(method).ok_or_else(|| error::method(py, format!("unknown method `{method}`")))?;
        let built = (row.build)(&options).map_err(|cause| error::method(py, cause))?;
        Ok((built, options.clone()))
    };
    model.search(py, omega, start, (method, false), made)
}
