//! Shared by several study kinds.
//!
//! - `keys`: keys of `[study]`, and checks of their values;
//! - `peak_of`: the key `peak_of`;
//! - `orbits`: the orbits of a unit, their instants, and failures;
//! - `shares`: panels of contact states;
//! - `wheel`: pictures of a disk.

pub(super) mod keys;
pub(super) mod orbits;
pub(super) mod peak_of;
pub(super) mod shares;
pub(super) mod wheel;
