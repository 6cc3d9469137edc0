//! Numerical methods without any mechanics.

pub mod banded;
pub mod complementarity;
pub mod continuation;
pub mod definite;
pub mod dense;
pub mod dual;
pub mod eigen;
pub mod extremes;
pub mod fourier;
pub mod interrupt;
pub mod krylov;
pub mod leading;
pub mod lu;
pub mod maximum;
pub mod modes;
mod null_space;
pub mod pairs;
pub mod quadrature;
pub mod radau;
pub mod random;
pub mod short;
pub mod signal;
pub mod sparse;
