//! Physical dimensions of model quantities.
//!
//! A dimension is four integer exponents: kilogram, metre, second, radian. The radian counts as
//! a base unit, so that an excitation frequency of 121 Hz cannot be confused with 121 rad/s (1
//! Hz is 2π rad/s).

use serde::{Deserialize, Serialize};
use std::fmt;

/// Exponents of kilogram, metre, second and radian.
///
/// # Example
/// ```
/// use stickslip::dimension::Dimension;
/// assert_eq!(Dimension::FORCE.to_string(), "force (N)");
/// assert_eq!(Dimension { kg: 0, m: 2, s: 0, rad: 0 }.to_string(), "m^2");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[allow(missing_docs)] // the four fields are the four base units
pub struct Dimension {
    pub kg: i8,
    pub m: i8,
    pub s: i8,
    pub rad: i8,
}

macro_rules! named {
    ($($constant:ident = [$kg:expr, $m:expr, $s:expr, $rad:expr] $name:literal $unit:literal;)*) => {
        impl Dimension {
            $(#[doc = concat!($name, ", SI unit ", $unit)]
            pub const $constant: Dimension = Dimension { kg: $kg, m: $m, s: $s, rad: $rad };)*

            /// Returns the name and the SI unit of a dimension that is listed here.
            pub fn name_and_unit(self) -> Option<(&'static str, &'static str)> {
                $(if self == Self::$constant { return Some(($name, $unit)); })*
                None
            }
        }
    };
}

named! {
    NONE = [0, 0, 0, 0] "pure number" "1";
    MASS = [1, 0, 0, 0] "mass" "kg";
    LENGTH = [0, 1, 0, 0] "length" "m";
    TIME = [0, 0, 1, 0] "time" "s";
    ANGLE = [0, 0, 0, 1] "angle" "rad";
    FREQUENCY = [0, 0, -1, 1] "frequency" "Hz or rad/s";
    SWEEP_RATE = [0, 0, -2, 1] "sweep rate" "Hz/s or rad/s^2";
    VELOCITY = [0, 1, -1, 0] "velocity" "m/s";
    INVERSE_VELOCITY = [0, -1, 1, 0] "inverse velocity" "s/m";
    ACCELERATION = [0, 1, -2, 0] "acceleration" "m/s^2";
    FORCE = [1, 1, -2, 0] "force" "N";
    PRESSURE = [1, -1, -2, 0] "pressure" "Pa";
    STIFFNESS = [1, 0, -2, 0] "stiffness" "N/m";
    CUBIC_STIFFNESS = [1, -2, -2, 0] "stiffness per area or cubic stiffness" "N/m^3";
    INVERSE_LENGTH = [0, -1, 0, 0] "inverse length" "1/m";
    DAMPING = [1, 0, -1, 0] "damping" "kg/s";
    ENERGY = [1, 2, -2, 0] "energy or moment" "J";
    INERTIA = [1, 2, 0, 0] "moment of inertia" "kg m^2";
    ANGULAR_STIFFNESS = [1, 2, -2, -1] "angular stiffness" "N m/rad";
    ANGULAR_DAMPING = [1, 2, -1, -1] "angular damping" "N m s/rad";
}

impl Dimension {
    /// Raises this dimension to a power. Returns `None` if the power is not an integer or if an
    /// exponent overflows.
    ///
    /// # Example
    /// ```
    /// use stickslip::dimension::Dimension;
    /// assert_eq!(Dimension::LENGTH.pow(2.0), Some(Dimension { kg: 0, m: 2, s: 0, rad: 0 }));
    /// assert_eq!(Dimension::LENGTH.pow(1.5), None);
    /// ```
    pub fn pow(self, power: f64) -> Option<Dimension> {
        if power.fract() != 0.0 || power.abs() > f64::from(i8::MAX) {
            return None;
        }
        let power = power as i8; // an integer within the range of i8
        Some(Dimension {
            kg: self.kg.checked_mul(power)?,
            m: self.m.checked_mul(power)?,
            s: self.s.checked_mul(power)?,
            rad: self.rad.checked_mul(power)?,
        })
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((name, unit)) = self.name_and_unit() {
            return write!(f, "{name} ({unit})");
        }
        let mut first = true;
        for (unit, exponent) in [("kg", self.kg), ("m", self.m), ("s", self.s), ("rad", self.rad)] {
            if exponent != 0 {
                write!(f, "{}{unit}", if first { "" } else { " " })?;
                if exponent != 1 {
                    write!(f, "^{exponent}")?;
                }
                first = false;
            }
        }
        Ok(())
    }
}
