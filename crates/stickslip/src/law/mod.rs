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
mod mirror;
mod parameter;
mod plane;
mod proportion;
mod prox;
mod rate;
mod slopes;
mod springs;
mod step;
mod stribeck;
mod stribeck_arctan;
mod stribeck_curve;
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
pub use parameter::{BuildError, LawError, LawInfo, Parameter, Range};
pub use prox::{Mean, Prox};
pub use rate::{Rate, RateLaw, RatePoint, Relative};
pub use step::{Step, StepLaw, StepPoint, StepSlopes};
pub use stribeck::Stribeck;
pub use stribeck_arctan::StribeckArctan;
pub use valanis::Valanis;

use num_complex::Complex64;
use serde::ser::{Serialize, SerializeMap, Serializer};
use springs::Springs;
use std::fmt::Debug;
use std::sync::Arc;

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

/// A law that many joints, cases and threads share.
pub type SharedLaw = Arc<dyn Law>;

/// The most directions that a joint can have.
pub const MOST_DIRECTIONS: usize = 3;

/// What every law answers. It offers at least one view.
///
/// # Example
/// A law from outside: a spring that stiffens, `f = k (u + b u³)`.
/// ```
/// use std::sync::Arc;
/// use stickslip::dimension::Dimension;
/// use stickslip::law::{Law, LawInfo, Parameter, Rate, RateLaw, Relative};
/// use stickslip_numerics::dual::Real;
///
/// #[derive(Debug)]
/// struct Stiffening { stiffness: f64, growth: f64 }
///
/// static INFO: LawInfo = LawInfo {
///     name: "stiffening",
///     summary: "f = stiffness (u + growth u^3)",
///     parameters: &[
///         Parameter::positive("stiffness", Dimension::STIFFNESS, "stiffness at rest"),
///         Parameter::positive("growth", Dimension::NONE, "growth of the stiffness, 1/m^2"),
///     ],
///     sample: &[1e4, 1e6],
///     build: |values| Arc::new(Stiffening { stiffness: values[0], growth: values[1] }),
/// };
///
/// impl Law for Stiffening {
///     fn info(&self) -> &'static LawInfo { &INFO }
///     fn values(&self) -> Vec<f64> { vec![self.stiffness, self.growth] }
///     fn is_odd(&self) -> bool { true }
///     fn rate(&self) -> Option<&dyn Rate> { Some(self) }
/// }
///
/// impl RateLaw for Stiffening {
///     fn evaluate<S: Real>(&self, motion: &Relative<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
///         let u = motion.displacement[0];
///         let force = (u + u * u * u * S::from(self.growth)) * S::from(self.stiffness);
///         [force, S::from(0.0), S::from(0.0)]
///     }
/// }
///
/// let law = Stiffening { stiffness: 1e4, growth: 1e6 };
/// // the describing function of f = k (u + b u³) is k (1 + ¾ b a²)
/// assert!((law.linearised(1e-3, 1.0).re - 1.75e4).abs() < 1e-6);
/// ```
pub trait Law: Debug + Send + Sync {
    /// Its row: name, summary, parameters.
    fn info(&self) -> &'static LawInfo;
    /// The parameters' values in SI, in the order of its row. Two laws of one row with the same values are taken for the same law: what else tells them
    /// apart has to be among them.
    fn values(&self) -> Vec<f64>;
    /// Directions of relative motion, 1 to [`MOST_DIRECTIONS`].
    fn directions(&self) -> usize {
        1
    }
    /// The direction along which its faces press on each other, if it knows one: that opens and closes, where the others slip.
    fn normal(&self) -> Option<usize> {
        None
    }
    /// The stiffness (N/m) along every direction while its faces stay closed and stick, of a law whose faces can part.
    fn closed(&self) -> Option<Vec<f64>> {
        None
    }
    /// The size of its forces, N, for tolerances and guesses: a slip limit, or infinity if nothing bounds them.
    fn scale(&self) -> f64 {
        f64::INFINITY
    }
    /// Ideal sliders, springs and stops side by side; exact.
    fn pieces(&self) -> Option<Vec<Piece>> {
        None
    }
    /// Smooth force and rates of internal states.
    fn rate(&self) -> Option<&dyn Rate> {
        None
    }
    /// The force after a step.
    fn step(&self) -> Option<&dyn Step> {
        None
    }
    /// The resolvent of a law of velocity.
    fn prox(&self) -> Option<&dyn Prox> {
        None
    }
    /// Whether the force changes its sign with the motion: `f(-u) = -f(u)` for whole histories. Methods halve the period of systems that are odd,
    /// so that a law that says so is tried when its system is built.
    fn is_odd(&self) -> bool;
    /// Whether two contacts with this law that move differently never give energy to their difference: `∫ δf δu' dt` from equal states on is
    /// never negative. Then what both keep of it elastically cannot exceed what went in, and motions do not separate
    /// ([`crate::model::System::contracts`]). Friction that grows with velocity or does not depend on it is of this kind at constant slip limits;
    /// friction that falls with velocity is not.
    fn is_incrementally_passive(&self) -> bool {
        false
    }
    /// What the faces do at this velocity (m/s) under this force (N), along the law's directions.
    fn contact(&self, velocity: &[f64], force: &[f64]) -> Contact {
        match self.rate() {
            Some(_) => Contact::by_limit(self.scale(), velocity, force),
            None => Contact::at_limit(self.scale(), velocity, force),
        }
    }
    /// Complex stiffness of the first harmonic under `u = amplitude cos Ωt` along the first direction (N/m): where methods begin to search.
    fn linearised(&self, amplitude: f64, omega: f64) -> Complex64 {
        let directions = self.directions();
        describing::stiffness(self.pieces(), self.rate(), self.step(), (self.prox(), directions), (amplitude, omega))
    }
    /// The smooth law that tends to this one as `width` (m/s, the velocity over which friction changes its sign) goes to zero.
    fn regularised(&self, _width: f64) -> Option<SharedLaw> {
        None
    }
    /// Whether the parameters fit each other; what is wrong and what was expected if they do not.
    ///
    /// # Errors
    /// A sentence without the law's name, such as "`beta + gamma` must be more than zero".
    fn consistent(&self) -> Result<(), String> {
        Ok(())
    }
}

/// One of the ideal parts of a law; parts of one law stand side by side and move alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Piece {
    /// Holds while its force is below its limit, and moves with the force at its limit.
    Slider(Slider),
    /// A spring that acts only beyond a gap: `f = stiffness max(u - gap, 0)`.
    Stop {
        /// Displacement at which it begins to act, m; negative if it is compressed at rest.
        gap: f64,
        /// Stiffness beyond the gap, N/m.
        stiffness: f64,
    },
}

/// An ideal slider, rigid or in series with a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slider {
    /// Stiffness of the spring in front of it, N/m; `None` if it is rigid.
    pub stiffness: Option<f64>,
    /// Force while it moves, N.
    pub limit: f64,
    /// Force up to which it holds once it rests, N; not below `limit`.
    pub static_limit: f64,
}

impl Piece {
    /// A slider that holds up to the force with which it moves.
    pub fn slider(stiffness: Option<f64>, limit: f64) -> Self {
        Piece::Slider(Slider { stiffness, limit, static_limit: limit })
    }

    /// Whether it is a slider that holds more than it carries in slip.
    pub fn drops(&self) -> bool {
        matches!(self, Piece::Slider(slider) if slider.static_limit > slider.limit)
    }

    /// Whether it never carries a force.
    pub(crate) fn is_nothing(&self) -> bool {
        match self {
            Piece::Slider(slider) => slider.static_limit == 0.0,
            Piece::Stop { stiffness, .. } => *stiffness == 0.0,
        }
    }
}

/// A slip limit that nothing reaches, N; the weight of a mountain.
const STUCK: f64 = 1e15;

/// The key of a slip limit.
const LIMIT: &str = "limit";
/// The key of the force up to which faces hold once they rest.
const STATIC_LIMIT: &str = "static_limit";
/// The key of the number of tangential directions, of laws that leave it open.
pub const TANGENTS: &str = "tangents";

impl dyn Law + '_ {
    /// Name in study files.
    pub fn name(&self) -> &'static str {
        self.info().name
    }

    /// Its sliders, if sliders are all that it is; those that hold nothing are left out.
    pub fn sliders(&self) -> Option<Vec<Slider>> {
        let slider = |piece: &Piece| match piece {
            Piece::Slider(slider) => Some(*slider),
            Piece::Stop { .. } => None,
        };
        self.pieces()?.iter().filter(|piece| !piece.is_nothing()).map(slider).collect()
    }

    /// The value of a parameter, SI.
    pub fn value(&self, key: &str) -> Option<f64> {
        let at = self.info().parameters.iter().position(|p| p.key == key)?;
        self.values().get(at).copied()
    }

    /// The same law with another value of one parameter, SI, unchecked; `None` if it has no such parameter.
    ///
    /// # Example
    /// ```
    /// use stickslip::law::{Dahl, Law};
    /// let law: &dyn Law = &Dahl { stiffness: 1e4, limit: 2.0 };
    /// assert_eq!(law.with("limit", 3.0).unwrap().values(), [1e4, 3.0]);
    /// ```
    pub fn with(&self, key: &str, value: f64) -> Option<SharedLaw> {
        let (info, mut values) = (self.info(), self.values());
        let at = info.parameters.iter().position(|p| p.key == key)?;
        values[at] = value;
        Some((info.build)(&values))
    }

    /// The same law with another slip limit, N, static or not; `None` if it has none.
    fn limited(&self, limit: f64) -> Option<SharedLaw> {
        let law = self.with(LIMIT, limit)?;
        Some(law.with(STATIC_LIMIT, limit).unwrap_or(law))
    }

    /// The same joint free of friction, a linear reference: its slip limit is zero, or its faces stay apart. `None` if the law has neither a
    /// limit nor faces that part.
    pub fn free(&self) -> Option<SharedLaw> {
        match self.closed() {
            Some(along) => Some(Springs::shared(&vec![0.0; along.len()])),
            None => self.limited(0.0),
        }
    }

    /// The same joint stuck, a linear reference: no force reaches its slip limit, and its faces stay closed. `None` as for the free reference.
    pub fn stuck(&self) -> Option<SharedLaw> {
        match self.closed() {
            Some(along) => Some(Springs::shared(&along)),
            None => self.limited(STUCK),
        }
    }

    /// Whether its faces can slide or part: a spring has none, and its contact says nothing.
    ///
    /// # Example
    /// ```
    /// use stickslip::law::{Coulomb, Cubic, Gap, Law};
    /// let laws: [&dyn Law; 3] = [&Coulomb { limit: 2.0 }, &Gap { gap: 1e-3, stiffness: 1e4 }, &Cubic { stiffness: 4e9 }];
    /// assert_eq!(laws.map(|law| law.has_faces()), [true, true, false]);
    /// ```
    pub fn has_faces(&self) -> bool {
        self.scale().is_finite() || self.closed().is_some()
    }

    /// Whether the law can never carry a force: the size of its forces is zero.
    pub fn is_free(&self) -> bool {
        self.scale() == 0.0
    }

    /// Checks that every parameter is finite and in its range, that they fit each other, that internal states have a size, and that an odd law is one.
    ///
    /// # Errors
    /// [`LawError`] names the first parameter that is not.
    pub fn check(&self) -> Result<(), LawError> {
        parameter::check(self.info(), &self.values())?;
        // what is compared with a size of nothing is no number
        let sizes = [
            self.step().filter(|step| step.states() > 0).map(|step| step.state_scale()),
            self.rate().filter(|rate| rate.states() > 0).map(|rate| rate.state_scale()),
        ];
        if let Some(size) = sizes.into_iter().flatten().find(|size| !(size.is_finite() && *size > 0.0)) {
            let message =
                format!("the size of its internal states, `state_scale`, must be finite and above zero, found {size}");
            return Err(LawError::Inconsistent { law: self.name(), message });
        }
        if self.is_odd() && mirror::is_broken(self) {
            let message = "it says that it is odd, and the mirror image of a motion does not have the mirror image of its force: `is_odd` must be \
                           false";
            return Err(LawError::Inconsistent { law: self.name(), message: message.to_owned() });
        }
        self.consistent().map_err(|message| LawError::Inconsistent { law: self.name(), message })
    }
}

impl PartialEq for dyn Law + '_ {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.info(), other.info()) && self.values() == other.values()
    }
}

impl Serialize for dyn Law + '_ {
    /// As in a study file, in SI: `{ kind = …, KEY = … }`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (info, values) = (self.info(), self.values());
        let mut map = serializer.serialize_map(Some(1 + values.len()))?;
        map.serialize_entry("kind", info.name)?;
        for (parameter, value) in info.parameters.iter().zip(values) {
            map.serialize_entry(parameter.key, &value)?;
        }
        map.end()
    }
}
