//! Nonlinear vibrations of structures with joints: friction, contact, stiffening.
//!
//! Data flows one way. A [`Model`] is assembled into a [`System`], whose joints carry a [`Law`].
//! A [`Method`] finds an [`Orbit`] of the system at an excitation frequency. A [`curve`] is a
//! family of orbits.
//!
//! # Example
//! Two blades are coupled by a frictional shroud. The example computes the vibration at 121 Hz
//! and the energy that the joint dissipates in one period.
//! ```
//! use std::f64::consts::TAU;
//! use std::sync::Arc;
//! use stickslip::law::Coulomb;
//! use stickslip::{Force, GROUND, Joint, Mass, Method, Model, Spring, method};
//!
//! let spring = |blade: &str| Spring {
//!     between: [blade.into(), GROUND.into()],
//!     stiffness: 105_103.0,
//!     damping: 0.2,
//! };
//! let model = Model {
//!     masses: vec![Mass::new("a", 0.182), Mass::new("b", 0.182)],
//!     springs: vec![spring("a"), spring("b")],
//!     joints: vec![Joint {
//!         name: "shroud".into(),
//!         between: ["a".into(), "b".into()],
//!         law: Arc::new(Coulomb { limit: 2.0 }),
//!     }],
//!     forces: vec![Force { on: "a".into(), amplitude: 10.0, phase: 0.0, harmonic: 1 }],
//!     ..Model::default()
//! };
//! let system = model.assemble()?;
//! let mut solver = method::auto::Auto.solver(&system)?;
//! let orbit = solver.orbit(TAU * 121.0)?;
//!
//! println!(
//!     "{:.2} mm, {:.1} mJ a period",
//!     1e3 * orbit.places[0].amplitude(),
//!     1e3 * orbit.joints[0].dissipation
//! );
//! assert!(orbit.evidence.energy_gap < 1e-9 && orbit.evidence.residual < 1e-11);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod curve;
pub mod dimension;
pub mod law;
pub mod method;
pub mod model;
pub mod orbit;
pub mod structure;

pub use law::{Law, SharedLaw};
pub use method::{Method, Solver};
pub use model::{Axis, Force, GROUND, Joint, Mass, Model, Motion, Spring, System};
pub use orbit::Orbit;
pub use structure::Structure;
