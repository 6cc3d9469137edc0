//! Reductions against dense solutions of small structures, and against a block of hexahedra.

mod block;
mod brick;
mod contacts;
mod dense;
mod mistuned;
