//! What a step of Newton's method costs, by counting: known before anything is computed.

use super::coupled::{by_products, step_products};
use super::kept::Kept;
use super::ports::Ports;
use super::sparse::Sparse;
use crate::model::System;
use num_complex::Complex64;

/// Multiplications in a step of Newton's method with harmonics up to `top`, which most of the time of a search goes to; zero for a system that harmonic
/// balance does not take.
///
/// # Example
/// ```
/// use stickslip::method::harmonic_balance::step_work;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// // a matrix over the odd harmonics of one joint
/// assert_eq!(step_work(&system, 15), 16f64.powi(3) / 3.0);
/// ```
pub fn step_work(system: &System, top: usize) -> f64 {
    let Ok((ports, _)) = Ports::of_sector(system) else { return 0.0 };
    let harmonics = Kept::new(system, |z| z != Complex64::new(0.0, 0.0)).up_to(top).len();
    let size = 2 * harmonics * ports.count();
    match Sparse::new(system, &ports, &[1]) {
        Some(sparse) => sparse.work(harmonics),
        None if by_products(size, &ports) => step_products(&ports, harmonics),
        None => (size as f64).powi(3) / 3.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Coulomb;
    use crate::model::{GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    /// Multiplications per harmonic cubed of a chain with a joint at every mass.
    fn chain(masses: usize) -> f64 {
        let mut model = Model::default();
        for i in 0..masses {
            let name = format!("m{i}");
            let other = if i == 0 { GROUND.into() } else { format!("m{}", i - 1) };
            model.masses.push(Mass::new(name.clone(), 1.0));
            model.springs.push(Spring { between: [name.clone(), other.clone()], stiffness: 1.0, damping: 0.1 });
            model.joints.push(Joint {
                name: format!("j{i}"),
                between: [name, other],
                law: Arc::new(Coulomb { limit: 0.1 }),
            });
        }
        step_work(&model.assemble().unwrap(), 100) / 100f64.powi(3)
    }

    /// A chain is banded, so that its work goes with its length; few joints are eliminated together.
    #[test]
    fn work_goes_with_the_length_of_a_chain() {
        let (long, longer) = (chain(60), chain(120));
        assert!((longer / long - 2.0).abs() < 0.1, "{long:.1} {longer:.1}");
        assert!(chain(4) > 0.0 && chain(4) < long);
    }
}
