//! Formulas that several laws share.
//!
//! - `kink`: `|x|`, its powers and its sign, with the mean derivative at the kink.
//! - `planar_slip`: slip in a plane, exact for a straight step.
//! - `stribeck_curve`: friction that falls with velocity.

pub(in crate::law) mod kink;
pub(in crate::law) mod planar_slip;
pub(in crate::law) mod stribeck_curve;
