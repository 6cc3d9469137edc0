//! Accuracy of an orbit, and the number of harmonics that reaches it.
//!
//! - `refinement`: number of harmonics, doubled until the estimated error meets the tolerance
//! - `truncation_error`: truncation error, from a second solution with twice the harmonics
//! - `sampling_error`: sampling error, from a second solution with twice the samples
//! - `history_sensitivity`: sensitivity of amplitudes to the history of permanently stuck joints

pub(super) mod history_sensitivity;
pub(super) mod refinement;
pub(super) mod sampling_error;
pub(super) mod truncation_error;
