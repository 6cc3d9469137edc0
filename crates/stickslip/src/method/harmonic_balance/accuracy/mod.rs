//! Accuracy of an orbit, and the number of harmonics that reaches it.
//!
//! - `length`: number of harmonics, doubled until the estimated error meets the tolerance
//! - `estimate`: truncation error, from a second solution with twice the harmonics
//! - `sampling`: sampling error, from a second solution with twice the samples
//! - `other_histories`: sensitivity of amplitudes to the history of permanently stuck joints

pub(super) mod estimate;
pub(super) mod length;
pub(super) mod other_histories;
pub(super) mod sampling;
