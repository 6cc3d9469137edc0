//! Shared by several study kinds.
//!
//! - `keys`: keys of `[study]`, and checks of their values;
//! - `peak_of`: the key `peak_of`;
//! - `peak_search`: the resonance peak of a case, and its row in a table;
//! - `points_to_doubt`: points that are unstable or less exact than requested;
//! - `orbit_sweep`: the orbits of a unit, their instants, and failures;
//! - `contact_states`: panels of contact states;
//! - `disk_shape`: pictures of a disk;
//! - `fields`: the motions of all nodes;
//! - `stress`: the stresses of orbits and modes.

pub(super) mod contact_states;
pub(super) mod disk_shape;
pub(super) mod fields;
pub(super) mod keys;
pub(super) mod orbit_sweep;
pub(super) mod peak_of;
pub(super) mod peak_search;
pub(super) mod points_to_doubt;
pub(super) mod stress;
