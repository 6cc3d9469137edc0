//! Branches of orbits by arc length.
