//! Friction laws: what happens where two places rub.
//!
//! A law is plain data: one variant of [`Law`] and one file. It offers the *views* that are honest for it, and a method asks
//! for the view it needs:
//!
//! | view | what it is | who asks |
//! | --- | --- | --- |
//! | [`FrictionLaw::network`] | ideal sliders, each behind a spring or rigid | event-driven, harmonic balance |
//! | [`FrictionLaw::rate`] | `z' = g(u, u', z)`, `f = h(u, u', z)`, smooth | transient, shooting, harmonic balance |
//! | [`FrictionLaw::regularised`] | the smooth neighbour of an exact law | comparison of the two |
//!
//! A joint acts along a direction matrix `W` (n × d): `u = Wᵀ x`, force on the structure `-W f`. All laws that exist now have
//! d = 1; [`Relative`] carries three components and a normal force, so that laws of sliding in a plane fit the same traits.
//!
//! To add a law: write its file, declare it with `mod`, then one line in `friction_laws!` below. Everything else (the variant of [`Law`], its
//! name in study files, its row of [`TABLE`], its place among the smooth laws) follows from that line.

mod coulomb;
mod coulomb_arctan;
mod jenkins;
mod jenkins_arctan;

use crate::dimension::Dimension;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use stickslip_numerics::dual::Real;

/// One parameter of a law: its key in a study file, its dimension, what it means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Key in `law = { kind = …, KEY = … }`.
    pub key: &'static str,
    /// Physical dimension, for units and for error messages.
    pub dimension: Dimension,
    /// Whether it may be zero; otherwise it is more than zero.
    pub may_be_zero: bool,
    /// One line for the documentation and for editors.
    pub doc: &'static str,
}

impl Parameter {
    /// A parameter that is more than zero.
    pub const fn positive(key: &'static str, dimension: Dimension, doc: &'static str) -> Self {
        Parameter { key, dimension, may_be_zero: false, doc }
    }

    /// The slip limit, N; zero is a joint that carries no force: the free reference of a damper.
    pub const fn limit(doc: &'static str) -> Self {
        Parameter { key: "limit", dimension: Dimension::FORCE, may_be_zero: true, doc }
    }

    /// Whether the law can have this value, SI.
    fn takes(&self, value: f64) -> bool {
        value.is_finite() && (value > 0.0 || self.may_be_zero && value == 0.0)
    }
}

/// The relative motion at a contact, up to three components (the first `d` count), and the normal force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative<S> {
    /// Relative displacement `u = Wᵀ x`, m.
    pub displacement: [S; 3],
    /// Relative velocity `u'`, m/s.
    pub velocity: [S; 3],
    /// Normal force, N; laws with a fixed slip limit do not read it.
    pub normal_force: S,
}

impl<S: Real> Relative<S> {
    /// Motion along one direction, without a normal force.
    pub fn along(displacement: S, velocity: S) -> Self {
        let zero = S::from_f64(0.0);
        Relative { displacement: [displacement, zero, zero], velocity: [velocity, zero, zero], normal_force: zero }
    }
}

/// One ideal slider of a law's network, in series with a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Branch {
    /// Stiffness of the spring in front of the slider, N/m; `None` if the slider is rigid.
    pub stiffness: Option<f64>,
    /// Slip limit, N: the slider holds while `|f| < limit` and moves with `|f| = limit`.
    pub limit: f64,
}

/// A law of rate form: `f = h(u, u', z)`, `z' = g(u, u', z)`, both smooth.
pub trait RateLaw {
    /// Number of internal states `z`.
    fn states(&self) -> usize;
    /// Force and rates at one instant. `z` and `z_rate` have length [`RateLaw::states`]; units belong to the law.
    /// Returns the force components, N.
    fn evaluate<S: Real>(&self, contact: &Relative<S>, z: &[S], z_rate: &mut [S]) -> [S; 3];
}

/// What every friction law answers. Views that a law cannot offer stay `None`.
pub trait FrictionLaw {
    /// Name in study files.
    const NAME: &'static str;
    /// One line of what the law is, with its equation.
    const SUMMARY: &'static str;
    /// Keys of the parameters, in the order of [`FrictionLaw::values`].
    const PARAMETERS: &'static [Parameter];
    /// Builds the law from values in the order of `PARAMETERS`, SI units; no check is made here.
    fn from_values(values: &[f64]) -> Self;
    /// The parameters' values in SI, in the order of `PARAMETERS`.
    fn values(&self) -> Vec<f64>;
    /// Directions of relative motion (1, 2 or 3).
    fn directions(&self) -> usize {
        1
    }
    /// Exact view: parallel branches of spring and ideal slider.
    fn network(&self) -> Option<Vec<Branch>> {
        None
    }
    /// Smooth view.
    fn rate(&self) -> Option<Rate> {
        None
    }
    /// Complex stiffness of the first harmonic under `u = amplitude cos Ωt` (N/m): where methods begin to search.
    fn linearised(&self, amplitude: f64, omega: f64) -> Complex64;
    /// Whether two contacts with this law that move differently never give energy to their difference: `∫ δf δu' dt` from equal states on is
    /// never negative. Then what both keep of it elastically cannot exceed what went in, and motions do not separate
    /// ([`crate::model::System::contracts`]). Friction that grows with velocity or does not depend on it is of this kind at constant slip limits;
    /// friction that falls with velocity is not.
    fn is_incrementally_passive(&self) -> bool {
        false
    }
    /// Whether the force changes its sign with the motion: `f(-u) = -f(u)` for whole histories.
    fn is_odd(&self) -> bool {
        true
    }
    /// The smooth law that tends to this one as `width` (m/s, the velocity over which friction changes its sign) goes to zero.
    fn regularised(&self, _width: f64) -> Option<Law> {
        None
    }
}

/// Why a law's parameters are refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{law}: `{key}` must be a finite {dimension}, {}, found {value}", if *may_be_zero { "zero or more" } else { "more than zero" })]
pub struct LawError {
    /// Name of the law.
    pub law: &'static str,
    /// Key of the parameter.
    pub key: &'static str,
    /// What is measured by it.
    pub dimension: Dimension,
    /// Whether zero is allowed.
    pub may_be_zero: bool,
    /// The value that was given, SI.
    pub value: f64,
}

/// A row of the table of laws: what can be known of a law without an instance of it.
#[derive(Debug, Clone, Copy)]
pub struct LawInfo {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it is.
    pub summary: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// A typical instance, for examples and for tests that run over all laws.
    pub sample: fn() -> Law,
    build: fn(&[f64]) -> Law,
}

macro_rules! friction_laws {
    ($($file:ident::$variant:ident $name:literal [$($sample:expr),*] $(rate $smooth:ident)?;)*) => {
        $(pub use $file::$variant;)*

        /// A friction law, as data.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum Law {
            $(#[doc = concat!("See [`struct@", stringify!($variant), "`].")]
            #[serde(rename = $name)]
            $variant($variant),)*
        }

        /// Every law there is, in the order in which lists show them.
        pub const TABLE: &[LawInfo] = &[$(LawInfo {
            name: <$variant as FrictionLaw>::NAME,
            summary: <$variant as FrictionLaw>::SUMMARY,
            parameters: <$variant as FrictionLaw>::PARAMETERS,
            sample: || Law::$variant($variant::from_values(&[$($sample),*])),
            build: |values| Law::$variant($variant::from_values(values)),
        }),*];

        impl Law {
            /// Name in study files.
            pub fn name(&self) -> &'static str {
                match self { $(Law::$variant(_) => <$variant as FrictionLaw>::NAME,)* }
            }
            /// The parameters' values, SI, in the order of the law's table row.
            pub fn values(&self) -> Vec<f64> {
                match self { $(Law::$variant(law) => law.values(),)* }
            }
            /// Directions of relative motion.
            pub fn directions(&self) -> usize {
                match self { $(Law::$variant(law) => law.directions(),)* }
            }
            /// Exact view, see [`FrictionLaw::network`]; a slider that holds nothing is left out.
            pub fn network(&self) -> Option<Vec<Branch>> {
                let mut branches = match self { $(Law::$variant(law) => law.network(),)* }?;
                branches.retain(|branch| branch.limit > 0.0);
                Some(branches)
            }
            /// Smooth view, see [`FrictionLaw::rate`].
            pub fn rate(&self) -> Option<Rate> {
                match self { $(Law::$variant(law) => law.rate(),)* }
            }
            /// First-harmonic stiffness, see [`FrictionLaw::linearised`].
            pub fn linearised(&self, amplitude: f64, omega: f64) -> Complex64 {
                match self { $(Law::$variant(law) => law.linearised(amplitude, omega),)* }
            }
            /// Whether the difference of two motions gains nothing, see [`FrictionLaw::is_incrementally_passive`].
            pub fn is_incrementally_passive(&self) -> bool {
                match self { $(Law::$variant(law) => law.is_incrementally_passive(),)* }
            }
            /// Whether the force changes its sign with the motion, see [`FrictionLaw::is_odd`].
            pub fn is_odd(&self) -> bool {
                match self { $(Law::$variant(law) => law.is_odd(),)* }
            }
            /// Smooth neighbour, see [`FrictionLaw::regularised`].
            pub fn regularised(&self, width: f64) -> Option<Law> {
                match self { $(Law::$variant(law) => law.regularised(width),)* }
            }
        }

        /// The smooth laws behind one type, so that inner loops call them without dynamic dispatch.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Rate {
            $($(#[doc = concat!("See [`struct@", stringify!($smooth), "`].")]
            $smooth($smooth),)?)*
        }

        impl RateLaw for Rate {
            #[inline]
            fn states(&self) -> usize {
                match self { $($(Rate::$smooth(law) => law.states(),)?)* }
            }
            #[inline]
            fn evaluate<S: Real>(&self, contact: &Relative<S>, z: &[S], z_rate: &mut [S]) -> [S; 3] {
                match self { $($(Rate::$smooth(law) => law.evaluate(contact, z, z_rate),)?)* }
            }
        }
    };
}

// file :: type, name in study files, values of a sample in the order of PARAMETERS; `rate` and the type again if it is a RateLaw
friction_laws! {
    coulomb::Coulomb "coulomb" [2.0];
    coulomb_arctan::CoulombArctan "coulomb-arctan" [2.0, 25_000.0] rate CoulombArctan;
    jenkins::Jenkins "jenkins" [10_000.0, 2.0];
    jenkins_arctan::JenkinsArctan "jenkins-arctan" [10_000.0, 2.0, 25_000.0] rate JenkinsArctan;
}

/// A slip limit that nothing reaches, N; the weight of a mountain.
const STUCK: f64 = 1e15;

impl Law {
    /// Slip limit, N: the largest force of the law.
    pub fn limit(&self) -> f64 {
        let at = self.info().parameters.iter().position(|p| p.key == "limit");
        at.map_or(f64::INFINITY, |at| self.values()[at])
    }

    /// The row of [`TABLE`] that describes this law.
    pub fn info(&self) -> &'static LawInfo {
        // every variant has its row, by the macro
        TABLE.iter().find(|row| row.name == self.name()).expect("every law has its row")
    }

    /// The same law with another slip limit, N.
    fn limited(&self, limit: f64) -> Law {
        let (info, mut values) = (self.info(), self.values());
        if let Some(at) = info.parameters.iter().position(|p| p.key == "limit") {
            values[at] = limit;
        }
        (info.build)(&values)
    }

    /// The same joint free of friction, a linear reference: its slip limit is zero.
    pub fn free(&self) -> Law {
        self.limited(0.0)
    }

    /// The same joint stuck, a linear reference: no force reaches its slip limit.
    pub fn stuck(&self) -> Law {
        self.limited(STUCK)
    }

    /// Whether the law can never carry a force: its slip limit is zero.
    pub fn is_free(&self) -> bool {
        self.limit() == 0.0
    }

    /// Checks that every parameter is finite and in its range: more than zero, or zero for a slip limit.
    ///
    /// # Errors
    /// [`LawError`] names the first parameter that is not.
    pub fn check(&self) -> Result<(), LawError> {
        let info = self.info();
        for (parameter, value) in info.parameters.iter().zip(self.values()) {
            if !parameter.takes(value) {
                let Parameter { key, dimension, may_be_zero, .. } = *parameter;
                return Err(LawError { law: info.name, key, dimension, may_be_zero, value });
            }
        }
        Ok(())
    }
}

impl LawInfo {
    /// Builds the law from values by key (SI).
    ///
    /// # Errors
    /// The keys that are missing, or a value that is not finite or out of its range.
    ///
    /// # Example
    /// ```
    /// use std::collections::BTreeMap;
    /// let row = stickslip::law::find("coulomb").unwrap();
    /// let law = row.build(&BTreeMap::from([("limit", 2.0)])).unwrap();
    /// assert_eq!(law.values(), [2.0]);
    /// ```
    pub fn build(&self, values: &BTreeMap<&str, f64>) -> Result<Law, BuildError> {
        let missing: Vec<&'static str> =
            self.parameters.iter().map(|p| p.key).filter(|key| !values.contains_key(key)).collect();
        if !missing.is_empty() {
            return Err(BuildError::Missing { law: self.name, keys: missing });
        }
        let ordered: Vec<f64> = self.parameters.iter().map(|p| values[p.key]).collect();
        let law = (self.build)(&ordered);
        law.check()?;
        Ok(law)
    }
}

/// Why a law could not be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// Parameters are missing.
    #[error("law `{law}` needs {}", .keys.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", "))]
    Missing {
        /// Name of the law.
        law: &'static str,
        /// The keys that are missing.
        keys: Vec<&'static str>,
    },
    /// A value is refused.
    #[error(transparent)]
    Value(#[from] LawError),
}

/// The row of [`TABLE`] with this name.
pub fn find(name: &str) -> Option<&'static LawInfo> {
    TABLE.iter().find(|row| row.name == name)
}
