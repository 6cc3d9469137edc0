//! Errors: why no orbit was found.

use std::f64::consts::TAU;

/// Why time integration of a motion failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IntegrationError {
    /// Too many transitions.
    #[error(
        "joint `{joint}` chatters: {switches} transitions before t = {time:.6e} s; give it a stiffness (law `jenkins`) or add \
         damping; for an orbit, also try `harmonic-balance`"
    )]
    Chatter {
        /// Time of the failure, s.
        time: f64,
        /// Transitions up to this time.
        switches: usize,
        /// Name of the joint.
        joint: String,
    },
    /// Rigid joints in a loop stick simultaneously, and the distribution of their forces is not
    /// unique.
    #[error(
        "joint `{joint}` and others stick in a closed loop of rigid contacts at t = {time:.6e} s, so their forces \
         are not unique; give one of them a stiffness (law `jenkins`), or regularize friction: method = {{ kind = \
         \"shooting\", width = \"0.1 mm/s\" }} (`width` is the velocity over which friction changes its sign); or use \
         `harmonic-balance` with a `tolerance` of 0.02, which a series can reach for rigid friction"
    )]
    Redundant {
        /// Time of the failure, s.
        time: f64,
        /// Name of one of the joints.
        joint: String,
    },
    /// The contact problem has no solution.
    #[error(
        "no combination of stick and slip satisfies the contact conditions at t = {time:.6e} s; give rigid joints a \
         stiffness (law `jenkins`); for an orbit, also try `harmonic-balance`"
    )]
    NoContactState {
        /// Time of the failure, s.
        time: f64,
    },
    /// The linear motion of a contact pattern has no complete set of modes.
    #[error(
        "with the contact states at t = {time:.6e} s, a mode with {lambda:.6e} rad/s has exactly critical damping, which the \
         closed-form solution cannot represent; change the coefficient of one damper slightly"
    )]
    Defective {
        /// Time of the failure, s.
        time: f64,
        /// Modulus of the exponent, rad/s.
        lambda: f64,
    },
    /// The signals oscillate too fast relative to the period.
    #[error(
        "the search for the next transition reached its maximum number of steps at t = {time:.6e} s, because \
         some modes are far faster than the excitation; lower their stiffnesses; for an orbit, also try `harmonic-balance`"
    )]
    TooFast {
        /// Time of the failure, s.
        time: f64,
    },
    /// The step size of a time integration became too small.
    #[error(
        "the step size of the time integration became too small at t = {time:.6e} s (step {step:.1e} s); make steep laws \
         less steep; for an orbit, also try `harmonic-balance`"
    )]
    Stalled {
        /// Time of the failure, s.
        time: f64,
        /// Step size, s.
        step: f64,
    },
    /// A law returned NaN or infinity.
    #[error("law `{law}` of joint `{joint}` returned NaN or infinity at t = {time:.6e} s")]
    NotFinite {
        /// Time of the failure, s.
        time: f64,
        /// Name of the joint.
        joint: String,
        /// Name of its law.
        law: &'static str,
    },
    /// Integration with equal steps does not reach the tolerance, however short the steps.
    #[error(
        "the estimated error with {steps} steps is {estimate:.1e}, above the tolerance {tolerance:.1e}; raise \
         the `tolerance` of the method, or reduce stiffnesses that are far above the others"
    )]
    Unresolved {
        /// Number of steps of the finest attempt.
        steps: usize,
        /// Its estimated error relative to the motion.
        estimate: f64,
        /// The permitted error.
        tolerance: f64,
    },
    /// The vibration is too small relative to the static displacement to be resolved in floating
    /// point.
    #[error(
        "the vibration is only {share:.1e} of the static displacement, too small for floating-point accuracy; remove \
         the constant force and model the structure in its loaded state, or use `harmonic-balance`"
    )]
    Offset {
        /// Magnitude of the vibration relative to the state, both in the energy norm.
        share: f64,
    },
    /// Numbers leave the range of floating point, or the range in which the equations can be
    /// solved.
    #[error("masses, springs and dampers differ too much in magnitude (at t = {time:.6e} s); check their units")]
    OutOfRange {
        /// Time of the failure, s.
        time: f64,
    },
    /// The motion grows without bound, or a number is no longer finite.
    #[error("the motion{} grows without bound{}", .place.as_ref().map_or_else(String::new, |place| format!(" of `{place}`")), time_suffix(*.time))]
    Unbounded {
        /// Time of the failure, s; not finite if it is unknown.
        time: f64,
        /// The place with the largest displacement at that time, if known.
        place: Option<String>,
    },
}

/// Writes a frequency (rad/s) in Hz, with seven digits.
fn hertz(omega: f64) -> String {
    let value = omega / TAU;
    let decimals = (6 - value.abs().log10().floor().clamp(-6.0, 6.0) as i32).max(0) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} Hz")
}

/// Formats an estimate with two digits, or with four if two do not distinguish it from the
/// tolerance.
fn distinct_digits(estimate: f64, tolerance: f64) -> String {
    let short = format!("{estimate:.1e}");
    if short == format!("{tolerance:.1e}") { format!("{estimate:.3e}") } else { short }
}

/// Returns advice for a series that is too short.
fn truncation_advice(needed: Option<usize>) -> String {
    let raise = "raise `tolerance`";
    needed.map_or_else(
        || format!("; {raise}"),
        |needed| {
            format!(
                ": rigid friction may need {needed} harmonics or more, which exceeds the work or memory limit of a point; \
                 {raise}, or give friction a stiffness (law `jenkins`, in a plane `jenkins-2d`)"
            )
        },
    )
}

fn time_suffix(time: f64) -> String {
    if time.is_finite() { format!(" (detected at t = {time:.6e} s)") } else { String::new() }
}

impl IntegrationError {
    /// Returns the time of the failure, s, if known.
    pub fn time(&self) -> Option<f64> {
        self.clone().time_mut().map(|time| *time).filter(|time| time.is_finite())
    }

    /// Shifts the time of the failure by `begin` (s), for a motion that began later.
    pub(crate) fn shifted(mut self, begin: f64) -> Self {
        if let Some(time) = self.time_mut() {
            *time += begin;
        }
        self
    }

    fn time_mut(&mut self) -> Option<&mut f64> {
        match self {
            IntegrationError::Chatter { time, .. }
            | IntegrationError::Redundant { time, .. }
            | IntegrationError::NoContactState { time }
            | IntegrationError::Defective { time, .. }
            | IntegrationError::TooFast { time }
            | IntegrationError::Stalled { time, .. }
            | IntegrationError::NotFinite { time, .. }
            | IntegrationError::OutOfRange { time }
            | IntegrationError::Unbounded { time, .. } => Some(time),
            IntegrationError::Unresolved { .. } | IntegrationError::Offset { .. } => None,
        }
    }
}

/// No orbit was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OrbitError {
    /// The iteration did not converge.
    #[error(
        "{method} stopped at {} after {iterations} iteration{}, residual {residual:.1e}{}; use finer steps of the \
         frequency, or check that a periodic motion exists (an undamped resonance has none){advice}",
        hertz(*omega),
        if *iterations == 1 { "" } else { "s" },
        if *work_limit_reached { ", at the work limit of a point" } else { "" }
    )]
    NotConverged {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Iterations performed.
        iterations: usize,
        /// Smallest residual reached.
        residual: f64,
        /// True if the search exhausted the work limit of a point.
        work_limit_reached: bool,
        /// Advice about other methods and about bodies that friction alone holds, as text that
        /// follows the message; empty if there is none.
        advice: String,
    },
    /// The motion does not settle.
    #[error(
        "{method} at {}: the motion has not settled after {returns} periods of the orbit; its relative change \
         per period is still {change:.1e}{}",
        hertz(*omega), settling_advice(*.repeats, *.needed, .advice)
    )]
    Unsettled {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Number of returns. A return is one period of the excitation, or the requested number
        /// of periods.
        returns: usize,
        /// Change over the last return, relative to the state.
        change: f64,
        /// Number of returns after which the motion repeats, if it repeats after a few.
        repeats: Option<usize>,
        /// Predicted number of returns until the motion settles, from its decay; `None` if it
        /// does not decay.
        needed: Option<f64>,
        /// Advice about methods that need no settling, as text that follows a comma; empty if no
        /// method was asked or none applies.
        advice: String,
    },
    /// The time integration of the motion failed.
    #[error("{method} failed at {}: {cause}", hertz(*omega))]
    Breakdown {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Cause of the failure.
        cause: IntegrationError,
    },
    /// The evidence contradicts the orbit.
    #[error(
        "{method} rejected its orbit at {}: the energies supplied and dissipated in one period differ by a fraction of \
         {energy_gap:.1e}; use another method, or a smaller `tolerance` if this one has it",
        hertz(*omega)
    )]
    Evidence {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Energy gap of the orbit.
        energy_gap: f64,
    },
    /// The longest series that the method may use does not reach the tolerance.
    #[error(
        "{method} at {}: the estimated error with {harmonics} harmonics is {}, above the tolerance {tolerance:.1e}{}{advice}",
        hertz(*omega), distinct_digits(*.estimate, *.tolerance), truncation_advice(*.needed)
    )]
    Truncation {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Highest harmonic tried.
        harmonics: usize,
        /// For rigid friction: the number of harmonics that may suffice, which exceeds the work
        /// limit of a point.
        needed: Option<usize>,
        /// Estimated error of the motion relative to its amplitude.
        estimate: f64,
        /// The permitted error.
        tolerance: f64,
        /// State at t = 0 of the longest series. Another method may start from it.
        state: Vec<f64>,
        /// Advice about other methods, as text that follows a comma; empty if no method was
        /// asked or none applies.
        advice: String,
    },
    /// No stiffness, or friction alone, carries the mean of the forces.
    #[error(
        "{method} found no periodic motion at {}, because a body drifts: only friction or contacts hold part of the \
         structure, and they do not balance the mean force on this part; increase the normal loads, or add a \
         spring{advice}",
        hertz(*omega)
    )]
    Drift {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Advice about methods that can follow such a motion and about bodies that friction alone
        /// holds, as text that follows the message; empty if there is none.
        advice: String,
    },
    /// No orbit was found. A motion that was integrated from static equilibrium shows the actual
    /// behaviour.
    #[error("{method} found no orbit at {}; a time integration from static equilibrium {observed}", hertz(*omega))]
    NoOrbit {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Behaviour of the integrated motion.
        observed: ObservedMotion,
        /// State at t = 0 of the integrated motion at its end. Another method may start from it.
        state: Vec<f64>,
    },
    /// The motion of the structure without its joints is unbounded.
    #[error(
        "{method} at {}: without its joints, the structure {}: {}",
        hertz(*omega),
        if *resonance == 0.0 { "has a rigid-body mode" } else { "has an undamped resonance" },
        resonance_advice(*resonance)
    )]
    Resonance {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// The harmonic of the excitation frequency that is the resonance, rad/s.
        resonance: f64,
    },
    /// The path that a method returned is not a periodic motion.
    #[error("the motion that {method} returned at {} is not an orbit: it {problem}", hertz(*omega))]
    NotAnOrbit {
        /// Name of the method.
        method: &'static str,
        /// Excitation frequency, rad/s.
        omega: f64,
        /// Description of the problem.
        problem: &'static str,
    },
    /// The excitation frequency is not positive and finite.
    #[error("the excitation frequency is {omega} rad/s; it must be positive and finite")]
    Frequency {
        /// The given frequency, rad/s.
        omega: f64,
    },
}

/// Behaviour of a motion that was integrated in time.
#[derive(Debug, Clone, PartialEq)]
pub enum ObservedMotion {
    /// It converges to a motion that repeats with the excitation.
    Settles,
    /// It approaches a motion that repeats with the excitation, but has not reached it.
    Settling {
        /// Number of integrated periods.
        periods: usize,
    },
    /// It converges to a motion that repeats after several periods of the excitation.
    Repeats {
        /// Number of these periods.
        periods: usize,
    },
    /// A body drifts away, period by period.
    Drifts {
        /// The place with the largest drift.
        place: Box<str>,
        /// True for a rotation, whose speed is in rad/s, load in N m and spring in N m/rad.
        is_rotation: bool,
        /// Number of periods of this drift.
        periods: u32,
        /// Its mean speed, m/s, negative against its direction.
        speed: f64,
        /// The constant force along its direction, N.
        load: f64,
        /// Stiffness of a spring that holds it with a tenth of its inertia, N/m.
        spring: f64,
        /// The joint that is separated for the largest fraction of the last period.
        joint: Box<str>,
        /// This fraction; zero if no faces separate.
        open_fraction: f64,
    },
    /// It neither repeats nor drifts.
    Irregular {
        /// Number of integrated periods.
        periods: usize,
        /// The joint that is separated for the largest fraction of the last period.
        joint: String,
        /// This fraction; zero if no faces separate.
        open_fraction: f64,
    },
}

impl std::fmt::Display for ObservedMotion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let apart = |joint: &str, open_fraction: f64| {
            if open_fraction > 0.0 {
                format!(" (`{joint}` is separated for {:.0} % of the last period)", 100.0 * open_fraction)
            } else {
                String::new()
            }
        };
        match self {
            ObservedMotion::Settles => {
                write!(
                    f,
                    "converges to a periodic motion, which this series does not reach: use more harmonics, or method `transient`"
                )
            }
            ObservedMotion::Settling { periods } => write!(
                f,
                "converges slowly: it still changes after {periods} periods; use more harmonics, or method `transient`"
            ),
            ObservedMotion::Repeats { periods } => {
                write!(f, "repeats after {periods} periods of the excitation: set the option `period = {periods}`")
            }
            ObservedMotion::Drifts { place, is_rotation, periods, speed, load, spring, joint, open_fraction } => {
                let (verb, speed, force, unit, of_spring) = match is_rotation {
                    true => ("turns", format!("{speed:.3} rad/s"), "moment", "N m", "N m/rad"),
                    false => ("moves", speed_text(*speed), "force", "N", "N/m"),
                };
                write!(f, "drifts: `{place}` {verb} at {speed} over {periods} periods, ")?;
                match *load {
                    0.0 => write!(f, "pushed by its contacts alone")?,
                    load => write!(f, "under a constant {force} of {load:.3} {unit} along it")?,
                }
                if *open_fraction >= 1.0 {
                    return write!(
                        f,
                        ", and `{joint}` is separated throughout the last period: if a force or a preload should close it, \
                         exchange the two places of its `between`, or reverse the force; otherwise increase the \
                         normal loads, or hold the body by a soft spring along this direction"
                    );
                }
                write!(
                    f,
                    "{}; hold it by a soft spring along this direction ({spring:.1e} {of_spring} is a tenth of its inertia), \
                     increase the normal loads, or add damping",
                    apart(joint, *open_fraction)
                )
            }
            ObservedMotion::Irregular { periods, joint, open_fraction } => write!(
                f,
                "neither repeats nor settles in {periods} periods{}, which does not exclude an orbit; increase the \
                 normal loads, add damping, or examine the motion with kind = \"transient\"",
                apart(joint, *open_fraction)
            ),
        }
    }
}

/// Writes a speed (m/s) in mm/s or, from 1 m/s, in m/s.
fn speed_text(speed: f64) -> String {
    if speed.abs() < 1.0 { format!("{:.3} mm/s", 1e3 * speed) } else { format!("{speed:.3} m/s") }
}

/// Describes a motion that does not settle, and gives advice.
fn settling_advice(repeats: Option<usize>, needed: Option<f64>, advice: &str) -> String {
    let by_newton = if advice.is_empty() { String::new() } else { format!("{advice} (no settling needed)") };
    match repeats {
        // A motion that repeats after one return is settled, so `repeats` is at least 2.
        Some(repeats) => {
            format!("; it repeats after {repeats} periods: set `period` to {repeats} times its value (default 1)")
        }
        None => match needed {
            // a second of computation has about a million periods of a small model
            Some(needed) if needed > 1e6 => {
                format!("; the motion hardly decays and would need more than a million periods: add damping{by_newton}")
            }
            Some(needed) => {
                format!(
                    "; from its decay, it would settle after about {needed:.0} periods of the orbit: raise `periods`{by_newton}"
                )
            }
            None => {
                format!("; it does not decay: add damping, or examine it with kind = \"transient\"{by_newton}")
            }
        },
    }
}

/// Describes a structure with an undamped resonance at this frequency, rad/s, and gives advice.
/// Zero means a mean force that no stiffness carries.
fn resonance_advice(resonance: f64) -> String {
    if resonance == 0.0 {
        return "some bodies have no support; add a spring, or a constant force or preload that closes their contacts"
            .to_owned();
    }
    format!(
        "its motion is unbounded at {}; add damping, or choose another frequency; a part without mass that only \
         contacts hold needs a mass or a soft spring",
        hertz(resonance)
    )
}

impl OrbitError {
    /// Returns the error of a search that stopped after a number of iterations, with its
    /// smallest residual.
    pub(crate) fn not_converged(method: &'static str, omega: f64, iterations: usize, residual: f64) -> Self {
        OrbitError::NotConverged {
            method,
            omega,
            iterations,
            residual,
            work_limit_reached: false,
            advice: String::new(),
        }
    }

    /// Adds that the method `other` found no orbit either.
    pub(crate) fn with_failed_alternative(mut self, other: &str) -> Self {
        match &mut self {
            OrbitError::NotConverged { advice, .. } | OrbitError::Truncation { advice, .. } => {
                *advice = format!("; `{other}` found no orbit either");
            }
            _ => {}
        }
        self
    }

    /// Returns a state at t = 0 from which another method may find the orbit that this one missed.
    pub(crate) fn candidate(&self) -> Option<&[f64]> {
        match self {
            OrbitError::Truncation { state, .. } | OrbitError::NoOrbit { state, .. } if !state.is_empty() => {
                Some(state)
            }
            _ => None,
        }
    }

    /// Returns the error of a motion that drifts.
    pub(crate) fn drift(method: &'static str, omega: f64) -> Self {
        OrbitError::Drift { method, omega, advice: String::new() }
    }

    /// Returns one word for tables.
    pub fn status(&self) -> &'static str {
        match self {
            OrbitError::NotConverged { .. } => "not-converged",
            OrbitError::Unsettled { .. } => "not-settled",
            OrbitError::Breakdown { .. } => "breakdown",
            OrbitError::Evidence { .. } => "evidence-fails",
            OrbitError::Truncation { .. } => "tolerance-not-reached",
            OrbitError::Drift { .. } | OrbitError::NoOrbit { observed: ObservedMotion::Drifts { .. }, .. } => "drifts",
            OrbitError::NoOrbit { observed: ObservedMotion::Settles | ObservedMotion::Settling { .. }, .. } => {
                "not-converged"
            }
            OrbitError::NoOrbit { .. } => "not-settled",
            OrbitError::Resonance { .. } => "resonance",
            OrbitError::NotAnOrbit { .. } => "not-an-orbit",
            OrbitError::Frequency { .. } => "bad-frequency",
        }
    }
}
