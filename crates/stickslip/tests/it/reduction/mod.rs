//! Compares reductions with dense solutions of small structures, and with a block of hexahedra.

mod block;
mod brick;
mod contacts;
mod dense;
mod mistuned;
