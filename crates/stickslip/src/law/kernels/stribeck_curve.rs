//! The Stribeck curve: friction that falls with velocity, shared by several laws.
//!
//! Source: Stribeck (1902); in this form Bo and Pavelescu (1982).

use stickslip_numerics::dual::Real;

/// `Fc + (Fs - Fc) exp(-(v/vs)²)`, N.
pub(in crate::law) fn stribeck_force<S: Real>(v: S, limit: f64, static_limit: f64, velocity: f64) -> S {
    let share = v / velocity;
    (-(share * share)).exp() * (static_limit - limit) + limit
}

/// Checks that the static limit is not below the dynamic limit.
pub(in crate::law) fn check_limits(limit: f64, static_limit: f64) -> Result<(), String> {
    if static_limit >= limit {
        return Ok(());
    }
    Err(format!(
        "`static_limit` ({static_limit} N) is below `limit` ({limit} N); the static limit must be at least the dynamic limit"
    ))
}
