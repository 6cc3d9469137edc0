//! Whether two motions of a system can separate.
//!
//! Let `δ` be the difference of two motions under the same drive, and `Eⱼ` the elastic energy that joint `j` keeps of the difference of its
//! states. Joints that are incrementally passive give no energy to the difference, `δfⱼ δuⱼ' ≥ dEⱼ/dt`, hence
//!
//! `E = ½ δx'ᵀ M δx' + ½ δxᵀ K δx + Σ Eⱼ`,   `dE/dt ≤ -δx'ᵀ C δx' ≤ 0`.
//!
//! That needs `M` and `K` symmetric and positive *semi*definite, and the symmetric part of `C` positive *semi*definite; zero damping will do.
//! As `E` is a quadratic form of small disturbances that no return increases, no Floquet multiplier lies outside the unit circle: where
//! `E > 0` because of that, and where `E = 0` because the difference then rests. (It rests if no direction is without mass, spring and
//! damper at once: `M + C + K` is positive definite, as it is where every place has a mass.) What `E` does not see is a displacement that no spring
//! holds: it stays, with a multiplier of one, or drifts at the constant velocity that a disturbance gave to it. Multipliers inside the circle, so
//! that disturbances die, need more: damping, of every motion that the joints do not damp.
//!
//! Source: Leine and van de Wouw, "Stability and Convergence of Mechanical Systems with Unilateral Constraints" (2008), Ch. 8.

use super::System;

impl System {
    /// Whether no two motions under the same drive ever separate: masses and springs are symmetric and positive semidefinite, dampers take no
    /// less than nothing, and every law is incrementally passive ([`crate::law::Law::is_incrementally_passive`]). Every orbit is
    /// then stable, whatever it is and however large the system.
    ///
    /// # Example
    /// ```
    /// use stickslip::structure::Structure;
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// assert!(system.contracts());
    /// let old = system.structure();
    /// let mut damping = old.damping().clone();
    /// damping[(0, 0)] = -0.1;
    /// let driven = Structure::new(old.places().to_vec(), old.mass().clone(), damping, old.stiffness().clone()).unwrap();
    /// assert!(!system.on(driven).unwrap().contracts());
    /// ```
    pub fn contracts(&self) -> bool {
        self.has_passive_joints() && self.structure().dissipates()
    }

    /// Whether no joint lets two motions under the same drive separate.
    pub(crate) fn has_passive_joints(&self) -> bool {
        self.joints().iter().all(|joint| joint.law().is_incrementally_passive())
    }
}

#[cfg(test)]
mod tests {
    use crate::model::{GROUND, Mass, Model, Spring, System};
    use crate::structure::Structure;
    use nalgebra::DMatrix;

    /// Two masses, each on the ground, and a spring between them, each spring with its damper.
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
        assert!(system(one, two, two).contracts());
        assert!(system(one, two, zero).contracts(), "undamped");
        assert!(system(one, zero, zero).contracts(), "two free masses");
        assert!(system([1.0, 0.0], two, zero).contracts(), "a massless place that springs hold");
        assert!(!system([1.0, 0.0], [1.0, 0.0, 0.0], zero).contracts(), "a massless place that nothing holds");
        assert!(!system(one, two, [-0.1, 1.0, 0.05]).contracts(), "a damper that gives energy");
        assert!(system(one, two, [-0.1, 1.0, 1.0]).contracts(), "others take more: 0.9 · 2 > 1");
        // a system with other dampers and springs
        type Change<'a> = &'a dyn Fn(&mut DMatrix<f64>);
        let with = |system: System, damping: Change, stiffness: Change| {
            let old = system.structure();
            let (mut c, mut k) = (old.damping().clone(), old.stiffness().clone());
            damping(&mut c);
            stiffness(&mut k);
            system.on(Structure::new(old.places().to_vec(), old.mass().clone(), c, k).unwrap()).unwrap()
        };
        let turning = |c: &mut DMatrix<f64>| (c[(0, 1)], c[(1, 0)]) = (3.0, -3.0);
        assert!(with(system(one, two, zero), &turning, &|_| ()).contracts(), "turning takes no power");
        let buckled = |k: &mut DMatrix<f64>| k[(0, 0)] = -1.0;
        assert!(!with(system(one, two, two), &|_| (), &buckled).contracts(), "negative stiffness");
    }
}
