//! Decides whether two motions of a system can move apart.
//!
//! Let `δ` be the difference of two motions under the same excitation. Let `Eⱼ` be the elastic
//! energy in joint `j` of the difference of its states. Joints that are incrementally passive
//! do not supply energy to the difference: `δfⱼ δuⱼ' ≥ dEⱼ/dt`. It follows that
//!
//! `E = ½ δx'ᵀ M δx' + ½ δxᵀ K δx + Σ Eⱼ`,   `dE/dt ≤ -δx'ᵀ C δx' ≤ 0`.
//!
//! This requires that `M` and `K` are symmetric and positive *semi*definite, and that the
//! symmetric part of `C` is positive *semi*definite. Zero damping is allowed.
//!
//! `E` is a quadratic form of small disturbances, and no return map increases it. Therefore no
//! Floquet multiplier lies outside the unit circle:
//!
//! - Where `E > 0`, the bound on `E` excludes such a multiplier.
//! - Where `E = 0`, the difference is at rest, provided that `M + C + K` is positive
//!   definite. This holds if every place has a mass.
//! - A displacement without a restoring spring does not contribute to `E`. It stays constant
//!   with a multiplier of one, or drifts at the constant velocity of the disturbance.
//!
//! Multipliers inside the circle, so that disturbances decay, require damping of every motion
//! that the joints do not damp.
//!
//! Source: Leine and van de Wouw, "Stability and Convergence of Mechanical Systems with
//! Unilateral Constraints" (2008), Ch. 8.

use super::System;

impl System {
    /// Returns whether no two motions under the same excitation can move apart.
    ///
    /// This holds if masses and springs are symmetric and positive semidefinite, dampers never
    /// supply energy, and every law is incrementally passive
    /// ([`crate::law::Law::is_incrementally_passive`]). Then every orbit is stable, for a
    /// system of any size.
    ///
    /// # Example
    /// ```
    /// use stickslip::structure::Structure;
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// assert!(system.is_incrementally_stable());
    /// let old = system.structure();
    /// let mut damping = old.damping().clone();
    /// damping[(0, 0)] = -0.1;
    /// let driven = Structure::new(
    ///     old.places().to_vec(),
    ///     old.mass().clone(),
    ///     damping,
    ///     old.stiffness().clone(),
    /// )
    /// .unwrap();
    /// assert!(!system.with_structure(driven).unwrap().is_incrementally_stable());
    /// ```
    pub fn is_incrementally_stable(&self) -> bool {
        self.has_passive_joints() && self.structure().is_dissipative()
    }

    /// Returns whether every joint is incrementally passive.
    pub(crate) fn has_passive_joints(&self) -> bool {
        self.joints().iter().all(|joint| joint.law().is_incrementally_passive())
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{GROUND, Mass, Model, Spring, System};
    use crate::structure::Structure;
    use nalgebra::DMatrix;

    /// Two masses, each with a spring to the ground, and a spring between them; each spring has
    /// a damper in parallel.
    fn system(masses: [f64; 2], springs: [f64; 3], dampers: [f64; 3]) -> System {
        let between = [["a", GROUND], ["b", GROUND], ["a", "b"]];
        let springs = between.iter().zip(springs).zip(dampers).map(|((between, stiffness), damping)| Spring {
            between: between.map(str::to_owned),
            stiffness,
            damping,
        });
        let mass = |name: &str, mass: f64| Mass::new(name, mass);
        Model {
            masses: vec![mass("a", masses[0]), mass("b", masses[1])],
            springs: springs.collect(),
            ..Model::default()
        }
        .assemble()
        .unwrap()
    }

    #[test]
    fn what_contracts() {
        let (one, two, zero) = ([1.0; 2], [1.0; 3], [0.0; 3]);
        assert!(system(one, two, two).is_incrementally_stable());
        assert!(system(one, two, zero).is_incrementally_stable(), "undamped");
        assert!(system(one, zero, zero).is_incrementally_stable(), "two free masses");
        assert!(system([1.0, 0.0], two, zero).is_incrementally_stable(), "a massless place that springs hold");
        assert!(
            !system([1.0, 0.0], [1.0, 0.0, 0.0], zero).is_incrementally_stable(),
            "a massless place that nothing holds"
        );
        assert!(!system(one, two, [-0.1, 1.0, 0.05]).is_incrementally_stable(), "a damper that gives energy");
        assert!(system(one, two, [-0.1, 1.0, 1.0]).is_incrementally_stable(), "others take more: 0.9 · 2 > 1");
        // returns a system with changed dampers and springs
        type Change<'a> = &'a dyn Fn(&mut DMatrix<f64>);
        let with = |system: System, damping: Change, stiffness: Change| {
            let old = system.structure();
            let (mut c, mut k) = (old.damping().clone(), old.stiffness().clone());
            damping(&mut c);
            stiffness(&mut k);
            system.with_structure(Structure::new(old.places().to_vec(), old.mass().clone(), c, k).unwrap()).unwrap()
        };
        let turning = |c: &mut DMatrix<f64>| (c[(0, 1)], c[(1, 0)]) = (3.0, -3.0);
        assert!(with(system(one, two, zero), &turning, &|_| ()).is_incrementally_stable(), "turning takes no power");
        let buckled = |k: &mut DMatrix<f64>| k[(0, 0)] = -1.0;
        assert!(!with(system(one, two, two), &|_| (), &buckled).is_incrementally_stable(), "negative stiffness");
    }
}
