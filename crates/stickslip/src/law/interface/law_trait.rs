//! The trait of all laws, and the description of a law in the table.

use super::describing_function::complex_stiffness;
use super::ideal_elements::{IdealElement, Slider};
use crate::law::{Contact, MasingView, Parameter, ProxView, RateView, SlidingView, StepView};
use num_complex::Complex64;
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt::Debug;
use std::sync::Arc;

/// A law that several joints, cases and threads share.
pub type SharedLaw = Arc<dyn Law>;

/// A force law of a joint. It offers at least one view.
///
/// # Example
/// A law defined outside this crate: a stiffening spring, `f = k (u + b u³)`.
/// ```
/// use std::sync::Arc;
/// use stickslip::dimension::Dimension;
/// use stickslip::law::{Law, LawInfo, Parameter, RateLaw, RateView, RelativeMotion};
/// use stickslip_numerics::dual::Real;
///
/// #[derive(Debug)]
/// struct Stiffening {
///     stiffness: f64,
///     growth: f64,
/// }
///
/// static INFO: LawInfo = LawInfo {
///     name: "stiffening",
///     summary: "f = stiffness (u + growth u^3)",
///     parameters: &[
///         Parameter::positive("stiffness", Dimension::STIFFNESS, "initial stiffness"),
///         Parameter::positive("growth", Dimension::NONE, "growth of the stiffness, 1/m^2"),
///     ],
///     sample: &[1e4, 1e6],
///     build: |values| Arc::new(Stiffening { stiffness: values[0], growth: values[1] }),
/// };
///
/// impl Law for Stiffening {
///     fn info(&self) -> &'static LawInfo {
///         &INFO
///     }
///     fn values(&self) -> Vec<f64> {
///         vec![self.stiffness, self.growth]
///     }
///     fn is_odd(&self) -> bool {
///         true
///     }
///     fn rate(&self) -> Option<&dyn RateView> {
///         Some(self)
///     }
/// }
///
/// impl RateLaw for Stiffening {
///     fn evaluate<S: Real>(
///         &self,
///         motion: &RelativeMotion<S>,
///         _z: &[S],
///         _rate: &mut [S],
///     ) -> [S; 3] {
///         let u = motion.displacement[0];
///         let force = (u + u * u * u * S::from(self.growth)) * S::from(self.stiffness);
///         [force, S::from(0.0), S::from(0.0)]
///     }
/// }
///
/// let law = Stiffening { stiffness: 1e4, growth: 1e6 };
/// // the describing function of f = k (u + b u³) is k (1 + ¾ b a²)
/// assert!((law.describing_function(1e-3, 1.0).re - 1.75e4).abs() < 1e-6);
/// ```
pub trait Law: Debug + Send + Sync {
    /// Returns the table entry: name, summary, parameters.
    fn info(&self) -> &'static LawInfo;
    /// Returns the parameter values in SI, in the order of the table entry. Two laws with the
    /// same entry and the same values compare equal, so the values must contain everything that
    /// distinguishes two instances.
    fn values(&self) -> Vec<f64>;
    /// Returns the number of directions of relative motion, 1 to
    /// [`MAX_DIRECTIONS`](crate::law::MAX_DIRECTIONS).
    fn directions(&self) -> usize {
        1
    }
    /// Returns the index of the normal direction, if the law has one. The faces press on each
    /// other, open and close in this direction; they slip in the others.
    fn normal(&self) -> Option<usize> {
        None
    }
    /// Returns this law with its faces pressed together by `force` (N) at zero displacement. It
    /// describes small motions of a contact without preload that a constant load presses
    /// together. `None` if the law has no faces or already has a preload.
    fn with_preload(&self, _force: f64) -> Option<SharedLaw> {
        None
    }
    /// Returns this law with its slip limit multiplied by `factor`. Laws with a step view that
    /// stick exactly implement it; the stability of an orbit that sticks right up to the limit
    /// is computed with a higher limit.
    fn with_limit_factor(&self, _factor: f64) -> Option<SharedLaw> {
        None
    }
    /// Returns the stiffness (N/m) in each direction while the faces are closed and stick.
    /// `None` if the faces cannot separate.
    fn closed_stiffness(&self) -> Option<Vec<f64>> {
        None
    }
    /// Returns the springs (N/m) of the two linear references: free of friction, and stuck. Each
    /// reference has one stiffness per direction. Laws that slip but have no parameter `limit`
    /// implement this.
    fn reference_springs(&self) -> Option<[Vec<f64>; 2]> {
        None
    }
    /// Returns the relative displacement (m) at which the whole joint slips (macro-slip). Laws
    /// with gradual slip before it (micro-slip) implement this.
    fn macro_slip_displacement(&self) -> Option<f64> {
        None
    }
    /// Returns the magnitude of the law's forces, N, for tolerances and initial guesses: the
    /// slip limit, or infinity if the force is unbounded.
    fn force_scale(&self) -> f64 {
        f64::INFINITY
    }
    /// Returns ideal sliders, springs and stops in parallel, if they represent the law exactly.
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        None
    }
    /// Returns the rate view: a smooth force and the rates of the internal states.
    fn rate(&self) -> Option<&dyn RateView> {
        None
    }
    /// Returns the step view: the force at the end of a step.
    fn step(&self) -> Option<&dyn StepView> {
        None
    }
    /// Returns the Masing view: the force of first loading of a one-dimensional law that follows
    /// Masing's rules with memory.
    fn masing(&self) -> Option<&dyn MasingView> {
        None
    }
    /// Returns the prox view: the resolvent of a velocity-dependent law.
    fn prox(&self) -> Option<&dyn ProxView> {
        None
    }
    /// Returns the sliding view: the friction curve of a law that is set-valued at rest. The
    /// curve is continuous at rest: slip begins at the force that the joint carries when it
    /// starts to slide.
    fn sliding(&self) -> Option<&dyn SlidingView> {
        None
    }
    /// Tells whether the force is odd: `f(-u) = -f(u)` for whole histories. Methods halve the
    /// period of odd systems, so the check of a law tests this claim.
    fn is_odd(&self) -> bool;
    /// Tells whether the law is incrementally passive. For two motions of the contact from equal
    /// states, `∫ δf δu' dt` is never negative: the contact gives no energy to their difference.
    /// The stored elastic energy of the difference is then bounded, and two motions do not
    /// diverge ([`crate::model::System::is_incrementally_stable`]). At a constant slip limit,
    /// friction that grows with velocity or does not depend on it is passive; friction that falls
    /// with velocity is not.
    fn is_incrementally_passive(&self) -> bool {
        false
    }
    /// Returns the contact state at this velocity (m/s) under this force (N), both given in the
    /// law's directions.
    fn contact_state(&self, velocity: &[f64], force: &[f64]) -> Contact {
        match self.rate() {
            Some(_) => Contact::of_smooth_law(self.force_scale(), velocity, force),
            None => Contact::of_sticking_law(self.force_scale(), velocity, force),
        }
    }
    /// Returns the complex stiffness (N/m) of the first harmonic under `u = amplitude cos Ωt` in
    /// the first direction. Methods build initial guesses from it.
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        complex_stiffness(self, amplitude, omega)
    }
    /// Returns the smooth law that converges to this one as `width` (m/s) goes to zero. `width`
    /// is the velocity over which friction changes its sign.
    fn smooth_counterpart(&self, _width: f64) -> Option<SharedLaw> {
        None
    }
    /// Checks that the parameters are consistent with each other.
    ///
    /// # Errors
    /// A sentence without the law's name, such as "`beta + gamma` is -1; it must be more than
    /// zero".
    fn check_consistency(&self) -> Result<(), String> {
        Ok(())
    }
}

/// Description of a law that needs no instance of it.
#[derive(Debug)]
pub struct LawInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line that describes the law, with its equation.
    pub summary: &'static str,
    /// Parameters of the law.
    pub parameters: &'static [Parameter],
    /// Values of a typical instance in the order of `parameters`, SI. Examples and tests that
    /// run over all laws use them.
    pub sample: &'static [f64],
    /// Builds the law from values in the order of `parameters`, SI, without checks.
    pub build: fn(&[f64]) -> SharedLaw,
}

impl LawInfo {
    /// Builds a typical instance.
    pub fn sample(&self) -> SharedLaw {
        (self.build)(self.sample)
    }
}

impl dyn Law + '_ {
    /// Returns the name in study files.
    pub fn name(&self) -> &'static str {
        self.info().name
    }

    /// Returns the sliders if the law consists of sliders alone. Parts that carry no force are
    /// left out.
    pub fn sliders(&self) -> Option<Vec<Slider>> {
        let slider = |element: &IdealElement| match element {
            IdealElement::Slider(slider) => Some(*slider),
            IdealElement::Stop { .. } => None,
        };
        self.ideal_elements()?.iter().filter(|element| !element.carries_no_force()).map(slider).collect()
    }

    /// Returns the value of a parameter, SI.
    pub fn value(&self, key: &str) -> Option<f64> {
        let at = self.info().parameters.iter().position(|p| p.key == key)?;
        self.values().get(at).copied()
    }

    /// Returns the law with another value (SI) of one parameter, without checks. `None` if it
    /// has no such parameter.
    ///
    /// # Example
    /// ```
    /// use stickslip::law::{Dahl, Law};
    /// let law: &dyn Law = &Dahl { stiffness: 1e4, limit: 2.0 };
    /// assert_eq!(law.with_value("limit", 3.0).unwrap().values(), [1e4, 3.0]);
    /// ```
    pub fn with_value(&self, key: &str, value: f64) -> Option<SharedLaw> {
        let (info, mut values) = (self.info(), self.values());
        let at = info.parameters.iter().position(|p| p.key == key)?;
        values[at] = value;
        Some((info.build)(&values))
    }

    /// Tells whether the law has faces that can slide or separate. A spring has no faces, and
    /// its contact state has no meaning.
    ///
    /// # Example
    /// ```
    /// use stickslip::law::{Coulomb, Cubic, Gap, Law};
    /// let laws: [&dyn Law; 3] = [
    ///     &Coulomb { limit: 2.0 },
    ///     &Gap { gap: 1e-3, stiffness: 1e4 },
    ///     &Cubic { stiffness: 4e9 },
    /// ];
    /// assert_eq!(laws.map(|law| law.has_faces()), [true, true, false]);
    /// ```
    pub fn has_faces(&self) -> bool {
        self.force_scale().is_finite() || self.closed_stiffness().is_some()
    }

    /// Tells whether the law never carries a force: the magnitude of its forces is zero.
    pub fn carries_no_force(&self) -> bool {
        self.force_scale() == 0.0
    }
}

impl PartialEq for dyn Law + '_ {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.info(), other.info()) && self.values() == other.values()
    }
}

impl Serialize for dyn Law + '_ {
    /// Writes the law as in a study file, in SI: `{ kind = …, KEY = … }`.
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
