//! Response curves: amplitude over drive frequency.

use super::{FREQUENCY, Kind};
use crate::schema::{Takes, default};

pub(super) const KIND: Kind = Kind {
    name: "response",
    summary: "response curves over the drive frequency, with refined peaks",
    keys: &[
        FREQUENCY,
        default(
            "peaks",
            Takes::Flag,
            "true",
            "refines the peak of every mass between the points of the curve",
            "false",
        ),
    ],
    check: |_, _| Ok(()),
};
