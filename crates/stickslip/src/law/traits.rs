//! What every law answers, and the row by which it is known.

use super::pieces::{Piece, Slider};
use super::{Contact, Masing, Parameter, Prox, Rate, Sliding, Step, describing};
use num_complex::Complex64;
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt::Debug;
use std::sync::Arc;

/// A law that many joints, cases and threads share.
pub type SharedLaw = Arc<dyn Law>;

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
    /// Directions of relative motion, 1 to [`MOST_DIRECTIONS`](super::MOST_DIRECTIONS).
    fn directions(&self) -> usize {
        1
    }
    /// The direction along which its faces press on each other, if it knows one: that opens and closes, where the others slip.
    fn normal(&self) -> Option<usize> {
        None
    }
    /// The same law with its faces pressed on each other by `force` (N) where it has not moved: what it is in small motion
    /// where a constant load presses faces that have no preload. `None` of a law without faces, and where it has a preload.
    fn pressed_by(&self, _force: f64) -> Option<SharedLaw> {
        None
    }
    /// The stiffness (N/m) along every direction while its faces stay closed and stick, of a law whose faces can part.
    fn closed(&self) -> Option<Vec<f64>> {
        None
    }
    /// The springs (N/m) that the joint is in its linear references, free of friction and stuck, one stiffness for every direction, of a law that
    /// slips and has no parameter `limit`.
    fn springs(&self) -> Option<[Vec<f64>; 2]> {
        None
    }
    /// The relative displacement (m) at which all of it slips, of a law that slips little by little before (micro-slip, macro-slip).
    fn macro_slip(&self) -> Option<f64> {
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
    /// The force of first loading, of a law along one direction that follows Masing's rules with memory.
    fn masing(&self) -> Option<&dyn Masing> {
        None
    }
    /// The resolvent of a law of velocity.
    fn prox(&self) -> Option<&dyn Prox> {
        None
    }
    /// The friction curve of a law that is set-valued at rest, and continuous there: it holds up to the force with which it
    /// begins to slide.
    fn sliding(&self) -> Option<&dyn Sliding> {
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

/// What can be known of a law without an instance of it.
#[derive(Debug)]
pub struct LawInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it is, with its equation.
    pub summary: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Values of a typical instance in the order of `parameters`, SI: for examples and for tests that run over all laws.
    pub sample: &'static [f64],
    /// Builds the law from values in the order of `parameters`, SI; no check is made here.
    pub build: fn(&[f64]) -> SharedLaw,
}

impl LawInfo {
    /// A typical instance.
    pub fn sample(&self) -> SharedLaw {
        (self.build)(self.sample)
    }
}

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
