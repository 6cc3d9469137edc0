//! Laws: what happens where two places rub or touch.
//!
//! A law is an object behind [`Law`], with its data in one file. It offers the *views* that are honest for it, and a method asks for the view
//! that it can work with:
//!
//! | view | what it is | who asks |
//! | --- | --- | --- |
//! | [`Law::pieces`] | ideal sliders, springs and stops side by side | event-driven, harmonic balance |
//! | [`Law::rate`] | `f = h(u, u', z)`, `z' = g(u, u', z)`, smooth | transient, shooting, harmonic balance |
//! | [`Law::step`] | the force at the end of a step of `u`, from the state before it | harmonic balance, motion in small steps |
//! | [`Law::masing`] | the force of first loading of a law that follows Masing's rules | harmonic balance |
//! | [`Law::sliding`] | set-valued friction that is a smooth curve of the velocity in slip | shooting, transient |
//! | [`Law::prox`] | the resolvent of a law of velocity, rigid or steep | harmonic balance |
//!
//! A law that offers one view works in every method that asks for this view, and a method that finds none says which it misses.
//!
//! A joint acts along one to three directions. Along each of them `u` is the motion of its first place relative to its second, and the law's
//! force `f` acts on the first place as `-f`. A law that knows a normal has it as its last direction.
//!
//! To add a law: write its file, with its [`LawInfo`], name it beside the others (`mod`), then add one line to [`TABLE`]. A law from another crate, or one that only a test needs,
//! is put into a [`crate::model::Joint`] without any line.

mod bouc_wen;
mod check;
mod contact;
mod coulomb;
mod coulomb_2d;
mod coulomb_2d_arctan;
mod coulomb_arctan;
mod cubic;
mod dahl;
mod describing;
mod friction_contact;
mod gap;
mod iwan;
mod jenkins;
mod jenkins_2d;
mod jenkins_2d_arctan;
mod jenkins_arctan;
mod kink;
mod lugre;
mod masing;
mod mirror;
mod parameter;
mod pieces;
mod plane;
mod proportion;
mod prox;
mod rate;
mod references;
mod relative;
mod sliding;
mod slopes;
mod springs;
mod step;
mod stribeck;
mod stribeck_arctan;
mod stribeck_curve;
mod traits;
mod valanis;

pub use bouc_wen::BoucWen;
pub use contact::Contact;
pub use coulomb::Coulomb;
pub use coulomb_2d::Coulomb2d;
pub use coulomb_2d_arctan::Coulomb2dArctan;
pub use coulomb_arctan::CoulombArctan;
pub use cubic::Cubic;
pub use dahl::Dahl;
pub use friction_contact::FrictionContact;
pub use gap::Gap;
pub use iwan::Iwan;
pub use jenkins::Jenkins;
pub use jenkins_2d::Jenkins2d;
pub use jenkins_2d_arctan::Jenkins2dArctan;
pub use jenkins_arctan::JenkinsArctan;
pub use lugre::LuGre;
pub use masing::Masing;
pub use parameter::{BuildError, LawError, Parameter, Range, TANGENTS};
pub use pieces::{Piece, Slider};
pub use prox::{Mean, Prox};
pub use rate::{Rate, RateLaw, RatePoint};
pub use relative::{MOST_DIRECTIONS, Relative};
pub use sliding::Sliding;
pub use step::{Reach, Step, StepLaw, StepPoint, StepSlopes};
pub use stribeck::Stribeck;
pub use stribeck_arctan::StribeckArctan;
pub use traits::{Law, LawInfo, SharedLaw};
pub use valanis::Valanis;

/// Every law there is, in the order in which lists show them.
pub const TABLE: &[&LawInfo] = &[
    &coulomb::INFO,
    &coulomb_arctan::INFO,
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

/// The row of [`TABLE`] with this name.
pub fn find(name: &str) -> Option<&'static LawInfo> {
    TABLE.iter().copied().find(|row| row.name == name)
}
