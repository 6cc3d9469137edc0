//! Estimate of the memory for the equations, before they are built.

use super::NAME;
use super::aft::{Ports, derivative_batch};
use super::dynamics::banded::BandedForm;
use super::dynamics::linear_dynamics::LinearDynamics;
use super::linear_solve::{harmonic_preconditioner, newton_krylov};
use crate::method::MethodError;
use crate::method::options::PERIOD;

/// Memory limit of the equations, bytes. 1000 nodes with three directions and five harmonics
/// need half of it if no uncoupled modes are used.
pub(super) const MEMORY: f64 = 4e9;

/// Returns the option to reduce, and a hint. An orbit of several excitation periods has that
/// many times the harmonics.
fn option_to_reduce(periods: usize) -> (&'static str, &'static str) {
    if periods > 1 { (PERIOD.key, "fewer periods, ") } else { ("harmonics", "") }
}

/// Returns an error if `bytes` for this number of harmonics exceed the limit.
pub(super) fn check_memory(bytes: f64, ports: &Ports, harmonics: usize, periods: usize) -> Result<(), MethodError> {
    if bytes <= MEMORY {
        return Ok(());
    }
    let (key, fewer) = option_to_reduce(periods);
    let message = format!(
        "the equations of {} joint directions and {harmonics} harmonics need {:.0} GB, but the limit is {:.0} GB; \
         use {fewer}fewer harmonics, or fewer joints",
        ports.count(),
        1e-9 * bytes,
        1e-9 * MEMORY
    );
    Err(MethodError::option(NAME, key, message))
}

/// Returns the memory of equations that are not banded, in bytes.
///
/// It includes the Jacobians of the ports, the receptances and the preconditioners. With
/// uncoupled modes it includes the modes along the axes and their factor instead. `always`
/// states that the Jacobian is always a matrix; otherwise it is counted if its size allows one.
pub(super) fn unbanded_memory(ports: &Ports, dynamics: &LinearDynamics, harmonics: usize, always: bool) -> f64 {
    let (axes, pair) = (ports.count() as f64, 2.0 * harmonics as f64);
    let size = pair * axes;
    let structure = match dynamics.modes_for(ports).filter(|_| !always) {
        Some(structure) => structure.at.len() as f64 + 3.0 * axes * axes,
        None => {
            // complex: the matrices and the preconditioner
            4.0 * harmonics as f64 * axes * axes
                + harmonic_preconditioner::lowest_factor_entries(ports, harmonics) as f64
        }
    };
    // equations that always use the matrix keep it, its factor and the factor of the previous
    // step
    let formed = match always {
        true => 3.0 * size * size,
        false if size <= newton_krylov::FORMED_UNKNOWNS as f64 => size * size,
        false => 0.0,
    };
    jacobian_memory(ports, harmonics) + 8.0 * (structure + formed)
}

/// Returns the memory of the equations with this number of harmonics and samples, in bytes.
/// `banded` is one harmonic in banded form, if the system has that form.
pub(super) fn level_memory(
    banded: Option<&BandedForm>,
    ports: &Ports,
    dynamics: &LinearDynamics,
    (harmonics, samples): (usize, usize),
) -> f64 {
    let equations = match banded {
        Some(banded) => jacobian_memory(ports, harmonics) + banded.memory(harmonics),
        None => unbanded_memory(ports, dynamics, harmonics, false),
    };
    equations + time_stepping_memory(ports, harmonics, samples)
}

/// Returns the memory for integrating laws with memory, one after the other, in bytes.
fn time_stepping_memory(ports: &Ports, harmonics: usize, samples: usize) -> f64 {
    let axes = ports.iter().filter(|port| port.has_memory_steps()).map(|port| port.axes).max();
    axes.map_or(0.0, |axes| derivative_batch(axes, samples, harmonics).1)
}

/// Returns the memory of the Jacobians of the ports, in bytes.
fn jacobian_memory(ports: &Ports, harmonics: usize) -> f64 {
    8.0 * ports.iter().map(|port| (2.0 * (harmonics * port.axes) as f64).powi(2)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::super::aft::Ports;
    use super::super::dynamics::linear_dynamics::LinearDynamics;
    use super::super::dynamics::receptance::Receptance;
    use super::super::equations::Discretization;
    use super::unbanded_memory;
    use crate::law::{Coulomb, Jenkins2d, SharedLaw};
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::DMatrix;
    use num_complex::Complex64;
    use std::sync::Arc;

    /// Returns a row of bodies on springs. Each rubs on the ground.
    fn row(joints: usize, law: &SharedLaw) -> System {
        let (each, n) = (law.directions(), joints * law.directions());
        let stiffness = DMatrix::from_fn(n, n, |i, k| [2.5, -1.0].get(i.abs_diff(k)).copied().unwrap_or(0.0));
        let names = (0..n).map(|i| format!("{i}")).collect();
        let structure = Structure::new(names, DMatrix::identity(n, n), &stiffness * 0.04, stiffness).unwrap();
        let mut builder = System::builder(structure).force(0, 1, Complex64::new(3.0, 0.0));
        for joint in 0..joints {
            let axes = (0..each).map(|a| Axis::new(vec![(joint * each + a, 1.0)])).collect();
            builder = builder.joint(format!("{joint}"), law.clone(), axes);
        }
        builder.build().unwrap()
    }

    /// The estimate covers the receptances and preconditioners that are kept: matrices that
    /// stay in the cache, larger ones, and systems with unknown forces.
    #[test]
    fn the_memory_estimate_covers_the_kept_matrices() {
        let plane: SharedLaw = Arc::new(Jenkins2d { stiffness: 1.0, limit: 0.1 });
        let rigid: SharedLaw = Arc::new(Coulomb { limit: 0.1 });
        for (joints, law) in [(20, &plane), (70, &plane), (30, &rigid)] {
            let system = row(joints, law);
            let ports = Ports::new(&system).unwrap();
            let dynamics = LinearDynamics::new(&system, &ports);
            let harmonics = [1, 3, 5, 7, 9, 11, 13];
            let mut discretization = Discretization::new(harmonics.to_vec(), 128, &ports, None);
            discretization.set_frequency(&system, &ports, &dynamics, 0.9).unwrap();
            let start = discretization.initial_guess(&system, &ports, None, 0.9);
            discretization.solve(&ports, 0.9, start).unwrap();
            let Receptance::Formed(formed) = &discretization.linear.receptance else {
                panic!("receptances are matrices")
            };
            let coupled = discretization.newton_krylov.as_ref().expect("by products");
            assert!(coupled.bytes() > 0, "{joints}: none is kept");
            let kept = formed.bytes() + coupled.bytes() + size_of_val(&discretization.workspace.tangents[..]);
            // the estimate also counts a matrix that may be formed
            let size = discretization.workspace.residual.len() as f64;
            let formed = if size <= super::newton_krylov::FORMED_UNKNOWNS as f64 { 8.0 * size * size } else { 0.0 };
            let counted = unbanded_memory(&ports, &dynamics, harmonics.len(), false) - formed;
            assert!((1.0..1.5).contains(&(counted / kept as f64)), "{joints}: {counted:.1e} of {kept:.1e}");
        }
    }
}
