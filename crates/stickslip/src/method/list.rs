//! The methods that find orbits themselves.

use super::{MethodInfo, event_driven, harmonic_balance, shooting, transient};

/// The methods that find orbits themselves, in the order in which they are named to users.
pub(super) const LIST: &[MethodInfo] = &[event_driven::INFO, transient::INFO, shooting::INFO, harmonic_balance::INFO];
