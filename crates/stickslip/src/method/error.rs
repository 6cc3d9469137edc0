//! Why a method cannot take a system.

use super::Ways;
use crate::model::{System, SystemJoint};
use crate::structure::MOST_IN_FULL;

/// A method cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{refusal}{}", .ways.behind())]
pub struct MethodError {
    /// Why.
    pub refusal: Refusal,
    /// What to use instead, once that was asked for: see [`advised`](super::advised).
    pub ways: Box<Ways>,
}

/// Why a method cannot take a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A law lacks the view that the method needs.
    #[error("{method} cannot take the law `{law}` of joint `{joint}`: {misses}")]
    Law {
        /// The method.
        method: &'static str,
        /// The joint.
        joint: String,
        /// Its law.
        law: &'static str,
        /// What the method misses in it.
        misses: &'static str,
    },
    /// A place has no mass.
    #[error(
        "{method} needs a mass above zero at `{place}` (the law `jenkins` stands for a spring, a massless place and a slider)"
    )]
    NeedsMass {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
    },
    /// A place that has nothing but joints.
    #[error(
        "{method} needs a mass, a spring or a damper at `{place}`: nothing else says how it moves between its joints; of joints in series make one, as \
         of two `jenkins`, which have the smaller limit and the springs of both in series"
    )]
    Empty {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
    },
    /// A place so light between rigid joints that its inertia is lost.
    #[error(
        "{method} loses the inertia of `{place}`, which is {ratio:.0e} times lighter than what it rubs on at joint `{joint}` and rubs on something else, \
         too: of rigid joints in series the weaker one slips, so leave the other and the place out, or give it {least:.0e} of that mass"
    )]
    Light {
        /// The method.
        method: &'static str,
        /// The place.
        place: String,
        /// The joint.
        joint: String,
        /// The other mass by its own.
        ratio: f64,
        /// The share of the other mass that is enough.
        least: f64,
    },
    /// More degrees of freedom than the method's full matrices may have.
    #[error("{method} carries full matrices over at most {most} places, and there are {dofs}")]
    TooLarge {
        /// The method.
        method: &'static str,
        /// Degrees of freedom of the system.
        dofs: usize,
        /// Most that the method takes.
        most: usize,
    },
    /// A matrix is not positive definite.
    #[error("{method} needs a positive definite {matrix} matrix")]
    NotPositive {
        /// The method.
        method: &'static str,
        /// Which matrix.
        matrix: &'static str,
    },
    /// An option has an impossible value.
    #[error("option `{key}` of {method}: {message}")]
    Option {
        /// The method.
        method: &'static str,
        /// The key.
        key: &'static str,
        /// What is expected.
        message: String,
    },
}

impl MethodError {
    /// `method` misses something in the law of a joint.
    pub fn law(method: &'static str, joint: &SystemJoint, misses: &'static str) -> Self {
        let (joint, law) = (joint.name().to_owned(), joint.law().name());
        Refusal::Law { method, joint, law, misses }.into()
    }

    /// `method` needs a mass where a system has none.
    pub(crate) fn needs_mass(method: &'static str, system: &System, place: usize) -> Self {
        Refusal::NeedsMass { method, place: system.structure().places()[place].clone() }.into()
    }

    /// `method` needs anything but joints at a place: whether a system has one without.
    pub(crate) fn empty(method: &'static str, system: &System) -> Option<Self> {
        let mut empty: Vec<bool> = (0..system.dofs()).map(|row| system.structure().own_mass(row) == 0.0).collect();
        if !empty.contains(&true) {
            return None; // what has mass is not looked through
        }
        system.structure().entries().for_each(|(row, _, _)| empty[row] = false);
        let place = system.structure().places()[empty.iter().position(|empty| *empty)?].clone();
        Some(Refusal::Empty { method, place }.into())
    }

    /// `method` carries full matrices: whether those of a system are too large for it.
    pub(crate) fn too_large(method: &'static str, system: &System) -> Option<Self> {
        let (dofs, most) = (system.dofs(), MOST_IN_FULL);
        (dofs > most).then(|| Refusal::TooLarge { method, dofs, most }.into())
    }

    /// An option of `method` has an impossible value.
    pub(crate) fn option(method: &'static str, key: &'static str, message: String) -> Self {
        Refusal::Option { method, key, message }.into()
    }

    /// `method` needs a positive definite mass matrix.
    pub(crate) fn mass_not_positive(method: &'static str) -> Self {
        Refusal::NotPositive { method, matrix: "mass" }.into()
    }

    /// What to use instead; `None` where another value of an option is all that is needed.
    pub fn ways(&self) -> Option<&Ways> {
        (!matches!(self.refusal, Refusal::Option { .. })).then_some(&*self.ways)
    }

    /// The same refusal, without what to use instead.
    #[must_use]
    pub fn alone(self) -> MethodError {
        self.refusal.into()
    }

    /// The same refusal, with what to use instead, unless another value of an option is all that is needed.
    #[must_use]
    pub fn with(self, instead: Ways) -> MethodError {
        match self.refusal {
            Refusal::Option { .. } => self,
            refusal => MethodError { refusal, ways: Box::new(instead) },
        }
    }
}

impl From<Refusal> for MethodError {
    fn from(refusal: Refusal) -> Self {
        MethodError { refusal, ways: Box::default() }
    }
}
