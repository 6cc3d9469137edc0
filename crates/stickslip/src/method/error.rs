//! Reasons why a method does not accept a system.

use super::Alternatives;
use crate::model::{System, SystemJoint};
use crate::structure::MAX_FULL_DOFS;

/// Error of a method that cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{refusal}{}", .alternatives.suffix())]
pub struct MethodError {
    /// The reason.
    pub refusal: Refusal,
    /// Alternative methods; empty until
    /// [`solver_with_alternatives`](super::solver_with_alternatives) fills them in.
    pub alternatives: Box<Alternatives>,
}

/// The reason why a method cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A law lacks the view that the method needs.
    #[error("{method} does not accept the law `{law}` of joint `{joint}`: {missing}")]
    Law {
        /// Name of the method.
        method: &'static str,
        /// Name of the joint.
        joint: String,
        /// Name of its law.
        law: &'static str,
        /// Missing property of the law.
        missing: &'static str,
    },
    /// A place has no mass.
    #[error(
        "{method} needs a positive mass at `{place}` (for a massless place between a spring and a slider, use one joint with the law `jenkins`)"
    )]
    NeedsMass {
        /// Name of the method.
        method: &'static str,
        /// Name of the place.
        place: String,
    },
    /// A place has no mass, spring or damper, only joints.
    #[error(
        "{method} needs a mass, a spring or a damper at `{place}`, because joints alone do not determine its motion; \
         replace joints in series by one joint (two `jenkins` in series equal one with the smaller limit and both \
         springs in series)"
    )]
    OnlyJoints {
        /// Name of the method.
        method: &'static str,
        /// Name of the place.
        place: String,
    },
    /// A place between rigid joints is so light that rounding removes its inertia.
    #[error(
        "{method} cannot resolve the inertia of `{place}`: it is {ratio:.0e} times lighter than the mass on the \
         other side of joint `{joint}`, and has another rigid joint; rigid joints in series slip at the weaker one, \
         so remove the place and the stronger joint, or give the place at least {least:.0e} of that mass"
    )]
    NegligibleMass {
        /// Name of the method.
        method: &'static str,
        /// Name of the place.
        place: String,
        /// Name of the joint.
        joint: String,
        /// Mass on the other side of the joint over the mass of the place.
        ratio: f64,
        /// Smallest sufficient fraction of the other mass.
        least: f64,
    },
    /// The system has more degrees of freedom than the full matrices of the method may have.
    #[error("{method} uses full matrices and takes at most {most} degrees of freedom; the system has {dofs}")]
    TooLarge {
        /// Name of the method.
        method: &'static str,
        /// Degrees of freedom of the system.
        dofs: usize,
        /// Most degrees of freedom that the method takes.
        most: usize,
    },
    /// A matrix is not positive definite.
    #[error("{method} needs a positive definite {matrix} matrix; check the masses of all places")]
    NotPositive {
        /// Name of the method.
        method: &'static str,
        /// Name of the matrix.
        matrix: &'static str,
    },
    /// An option has an invalid value.
    #[error("option `{key}` of {method}: {message}")]
    Option {
        /// Name of the method.
        method: &'static str,
        /// Key of the option.
        key: &'static str,
        /// Expected values.
        message: String,
    },
}

impl MethodError {
    /// Returns the error that `method` needs a property that the law of `joint` lacks.
    pub fn law(method: &'static str, joint: &SystemJoint, missing: &'static str) -> Self {
        let (joint, law) = (joint.name().to_owned(), joint.law().name());
        Refusal::Law { method, joint, law, missing }.into()
    }

    /// Returns the error that `method` needs a mass at the place with this index.
    pub(crate) fn needs_mass(method: &'static str, system: &System, place: usize) -> Self {
        Refusal::NeedsMass { method, place: system.structure().places()[place].clone() }.into()
    }

    /// Returns the error that `method` needs more than joints at a place, if the system has a
    /// place with joints alone.
    pub(crate) fn only_joints(method: &'static str, system: &System) -> Option<Self> {
        let mut empty: Vec<bool> = (0..system.dofs()).map(|row| system.structure().diagonal_mass(row) == 0.0).collect();
        if !empty.contains(&true) {
            return None; // every place has mass
        }
        system.structure().entries().for_each(|(row, _, _)| empty[row] = false);
        let place = system.structure().places()[empty.iter().position(|empty| *empty)?].clone();
        Some(Refusal::OnlyJoints { method, place }.into())
    }

    /// Returns the error that the full matrices of a system are too large for `method`, if they
    /// are.
    pub(crate) fn too_large(method: &'static str, system: &System) -> Option<Self> {
        let (dofs, most) = (system.dofs(), MAX_FULL_DOFS);
        (dofs > most).then(|| Refusal::TooLarge { method, dofs, most }.into())
    }

    /// Returns the error that an option of `method` has an invalid value.
    pub(crate) fn option(method: &'static str, key: &'static str, message: String) -> Self {
        Refusal::Option { method, key, message }.into()
    }

    /// Returns the error that `method` needs a positive definite mass matrix.
    pub(crate) fn mass_not_positive(method: &'static str) -> Self {
        Refusal::NotPositive { method, matrix: "mass" }.into()
    }

    /// Returns the alternative methods; `None` if another value of an option is enough.
    pub fn alternatives(&self) -> Option<&Alternatives> {
        (!matches!(self.refusal, Refusal::Option { .. })).then_some(&*self.alternatives)
    }

    /// Returns the same refusal without alternative methods.
    #[must_use]
    pub fn without_alternatives(self) -> MethodError {
        self.refusal.into()
    }

    /// Returns the same refusal with alternative methods, unless another value of an option is
    /// enough.
    #[must_use]
    pub fn with_alternatives(self, instead: Alternatives) -> MethodError {
        match self.refusal {
            Refusal::Option { .. } => self,
            refusal => MethodError { refusal, alternatives: Box::new(instead) },
        }
    }
}

impl From<Refusal> for MethodError {
    fn from(refusal: Refusal) -> Self {
        MethodError { refusal, alternatives: Box::default() }
    }
}
