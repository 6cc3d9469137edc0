//! Laws: force laws of joints, for friction, contact and nonlinear springs.
//!
//! A law is an object behind [`Law`]; each law has its own file. A law offers one or more
//! *views*. A method uses the view that it can work with:
//!
//! - [`Law::ideal_elements`]: ideal sliders, springs and stops in parallel. Used by event-driven
//!   integration, harmonic balance and average acceleration.
//! - [`Law::rate`]: `f = h(u, u', z)`, `z' = g(u, u', z)`, smooth. Used by transient, shooting
//!   and harmonic balance.
//! - [`Law::step`]: the force at the end of a step of `u`, from the state before it. Used by
//!   harmonic balance and average acceleration.
//! - [`Law::masing`]: the force of first loading of a law that follows Masing's rules. Used by
//!   harmonic balance.
//! - [`Law::sliding`]: set-valued friction that is a smooth function of velocity during slip.
//!   Used by shooting and transient.
//! - [`Law::prox`]: the resolvent of a velocity-dependent law, rigid or steep. Used by harmonic
//!   balance.
//!
//! A law that offers a view works in every method that uses this view. A method that finds no
//! suitable view reports the missing one.
//!
//! A joint acts along one to three directions. In each direction, `u` is the displacement of the
//! joint's first place relative to its second place. The law's force `f` acts on the first place
//! as `-f`. A law with a normal direction has it as its last direction.
//!
//! The traits and views are in `interface`, formulas that several laws share in `kernels`, and
//! properties of any law in `properties`.
//!
//! To add a law, write its file with its [`LawInfo`], declare the module here, and add one line
//! to [`TABLE`]. A law from another crate or from a test needs no entry in the table: a
//! [`crate::model::Joint`] takes any object that implements [`Law`].

mod bouc_wen;
mod coulomb;
mod coulomb_2d;
mod coulomb_2d_arctan;
mod coulomb_arctan;
mod coulomb_tanh;
mod cubic;
mod dahl;
mod friction_contact;
mod gap;
mod interface;
mod iwan;
mod jenkins;
mod jenkins_2d;
mod jenkins_2d_arctan;
mod jenkins_arctan;
mod kernels;
mod lugre;
mod properties;
mod stribeck;
mod stribeck_arctan;
mod valanis;

pub use bouc_wen::BoucWen;
pub use coulomb::Coulomb;
pub use coulomb_2d::Coulomb2d;
pub use coulomb_2d_arctan::Coulomb2dArctan;
pub use coulomb_arctan::CoulombArctan;
pub use coulomb_tanh::CoulombTanh;
pub use cubic::Cubic;
pub use dahl::Dahl;
pub use friction_contact::FrictionContact;
pub use gap::Gap;
pub use interface::{
    BuildError, Contact, DisplacementBox, IdealElement, Law, LawError, LawInfo, MAX_DIRECTIONS, MasingView, Parameter,
    ProxView, Range, RateLaw, RatePoint, RateView, RelativeMotion, SampleMeans, SharedLaw, Slider, SlidingView,
    StepDerivatives, StepLaw, StepPoint, StepView, TANGENTS,
};
pub use iwan::Iwan;
pub use jenkins::Jenkins;
pub use jenkins_2d::Jenkins2d;
pub use jenkins_2d_arctan::Jenkins2dArctan;
pub use jenkins_arctan::JenkinsArctan;
pub use lugre::LuGre;
pub use stribeck::Stribeck;
pub use stribeck_arctan::StribeckArctan;
pub use valanis::Valanis;

/// All laws, in the order of printed lists.
pub const TABLE: &[&LawInfo] = &[
    &coulomb::INFO,
    &coulomb_arctan::INFO,
    &coulomb_tanh::INFO,
    &stribeck::INFO,
    &stribeck_arctan::INFO,
    &jenkins::INFO,
    &jenkins_arctan::INFO,
    &iwan::INFO,
    &dahl::INFO,
    &bouc_wen::INFO,
    &valanis::INFO,
    &lugre::INFO,
    &coulomb_2d::INFO,
    &coulomb_2d_arctan::INFO,
    &jenkins_2d::INFO,
    &jenkins_2d_arctan::INFO,
    &friction_contact::INFO,
    &gap::INFO,
    &cubic::INFO,
];

/// Returns the entry of [`TABLE`] with this name.
pub fn find(name: &str) -> Option<&'static LawInfo> {
    TABLE.iter().copied().find(|row| row.name == name)
}
