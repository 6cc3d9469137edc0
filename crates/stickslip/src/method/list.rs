//! The list of the methods that find orbits; `auto` picks one of them.

use super::{MethodInfo, event_driven, harmonic_balance, shooting, transient};

/// The methods that find orbits, in the order in which messages name them.
pub(super) const LIST: &[MethodInfo] = &[event_driven::INFO, transient::INFO, shooting::INFO, harmonic_balance::INFO];
