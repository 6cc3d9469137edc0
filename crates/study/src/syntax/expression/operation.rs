//! The steps of an expression, and the reserved words.

use super::ExpressionValue;

/// The functions of expressions.
pub const FUNCTIONS: &[&str] = &["sqrt", "sin", "cos", "tan", "exp", "ln", "abs", "min", "max"];

/// Name of the excitation frequency, which amplitudes of forces can read. A parameter of this name
/// hides it.
pub(super) const FREQUENCY: &str = "frequency";

/// Returns true if no parameter can have this name.
pub(crate) fn is_reserved(name: &str) -> bool {
    FUNCTIONS.contains(&name) || name == "pi" || is_not_finite(name)
}

pub(super) fn is_not_finite(name: &str) -> bool {
    ["nan", "inf", "infinity"].iter().any(|word| name.eq_ignore_ascii_case(word))
}

/// A step of the stack machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Operation {
    Push(ExpressionValue),
    Parameter(usize),
    /// The excitation frequency.
    Frequency,
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Call {
        function: &'static str,
        arguments: usize,
    },
}
