//! Orbits: the steady motion over one period, in time.

use super::{FREQUENCY, Kind, SAMPLES};

pub(super) const KIND: Kind = Kind {
    name: "orbit",
    summary: "the steady motion over one period: displacements, velocities, joint forces",
    keys: &[FREQUENCY, SAMPLES],
    check: |_, _| Ok(()),
};
