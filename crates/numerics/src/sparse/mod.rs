//! Sparse matrices and their factors, for structures in which each degree of
//! freedom is coupled to a few others.
//!
//! [`SparseMatrix`] contains the entries. [`SymbolicAnalysis`] computes the elimination order
//! (nested dissection) and the fill-in once for all matrices of a pattern. [`LdlFactor`] and
//! [`ComplexFactor`] solve for many right sides. All computations run on the caller's thread,
//! in an order that depends on the input alone: same input, same bits.
//!
//! Sources: Karypis and Kumar (1998), "A fast and high quality multilevel scheme for
//! partitioning irregular graphs"; Davis, "Direct Methods for Sparse Linear Systems" (2006),
//! Chap. 4; Schenk and Gärtner (2006), "On fast factorization pivoting methods for sparse
//! symmetric indefinite systems", for pivoting inside supernodes only.

mod analysis;
mod compliance;
mod factor;
mod matrix;
mod modes;
pub mod multi_vector;
mod symbolic;

pub use analysis::SymbolicAnalysis;
pub use factor::{ComplexFactor, LdlFactor, Singular};
pub use matrix::{Asymmetry, MatrixError, SparseMatrix};
pub use modes::{ModeSelection, ModesCost, ModesError, NaturalModes};
