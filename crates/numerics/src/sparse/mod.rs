//! Sparse matrices and their factors: for structures whose degrees of freedom touch a few neighbours each.
//!
//! [`Matrix`] holds the entries; [`Analysis`] finds, once for all matrices of a pattern, an order of elimination with little fill (nested
//! dissection) and where the factors will have entries; [`Factor`] and [`ComplexFactor`] solve for many right sides. Everything runs on the
//! caller's thread, in an order that depends on the input alone: same input, same bits.
//!
//! Sources: Karypis and Kumar (1998), "A fast and high quality multilevel scheme for partitioning irregular graphs"; Davis, "Direct
//! Methods for Sparse Linear Systems" (2006), Chap. 4; Schenk and Gärtner (2006), "On fast factorization pivoting methods for sparse symmetric
//! indefinite systems", for exchanges inside blocks of columns only.

mod analysis;
pub mod columns;
mod compliance;
mod factor;
mod matrix;
mod modes;
mod pattern;

pub use analysis::Analysis;
pub use factor::{ComplexFactor, Factor, Singular};
pub use matrix::{Asymmetry, Matrix, MatrixError};
pub use modes::{Effort, ModesError, NaturalModes, Wanted};
