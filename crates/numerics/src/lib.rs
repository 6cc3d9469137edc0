//! Mathematics that knows no mechanics.

pub mod complementarity;
pub mod dual;
pub mod modes;
pub mod signal;
