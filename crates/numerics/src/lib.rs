//! Mathematics that knows no mechanics.

pub mod dual;
