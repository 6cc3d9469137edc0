//! Numerical methods without any mechanics.

pub mod banded;
pub mod complementarity;
pub mod continuation;
pub mod definiteness;
pub mod dense;
pub mod dual;
pub mod eigen;
pub mod fourier;
pub mod gmres;
pub mod golden_section;
pub mod interrupt;
pub mod min_norm;
pub mod newton;
mod null_space;
pub mod parallel;
pub mod quadratic_modes;
pub mod quadrature;
pub mod radau;
pub mod random;
pub mod signal;
pub mod signal_range;
pub mod small_lu;
pub mod small_matvec;
pub mod sparse;
pub mod tie_break;
pub mod vector;
