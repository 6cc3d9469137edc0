//! Why there is no orbit.

/// Why a motion could not be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Breakdown {
    /// Too many switches.
    #[error("joint `{joint}` chatters at t = {time:.6e} s after {switches} switches")]
    Chatter {
        /// When, s.
        time: f64,
        /// Switches until then.
        switches: usize,
        /// Name of the joint.
        joint: String,
    },
    /// Rigid joints that form a loop stick together, and how they share the load is not unique.
    #[error(
        "joint `{joint}` and others stick in a loop of rigid contacts whose forces are not unique at t = {time:.6e} s; \
         give one of them a stiffness (law `jenkins`), or smooth them: method = {{ kind = \"shooting\", width = \"0.1 mm/s\" }}, the velocity over which \
         friction changes its sign; or use `harmonic-balance` with a `tolerance` that the series of rigid friction reaches, 0.02"
    )]
    Redundant {
        /// When, s.
        time: f64,
        /// Name of one of the joints.
        joint: String,
    },
    /// The contact problem has no solution.
    #[error("no stick-slip state is consistent at t = {time:.6e} s")]
    Undecidable {
        /// When, s.
        time: f64,
    },
    /// The linear motion of a pattern has no full set of modes.
    #[error(
        "two modes fall together at {lambda:.6e} rad/s (critical damping) at t = {time:.6e} s; change a damper slightly"
    )]
    Defective {
        /// When, s.
        time: f64,
        /// Modulus of the exponent, rad/s.
        lambda: f64,
    },
    /// The signals oscillate too fast for the period.
    #[error("modes far faster than the drive: no switch could be excluded within the allowed steps, t = {time:.6e} s")]
    TooFast {
        /// When, s.
        time: f64,
    },
    /// The step size of an integration became too small.
    #[error("the integration stalls at t = {time:.6e} s (step {step:.1e} s)")]
    Stalled {
        /// When, s.
        time: f64,
        /// The step, s.
        step: f64,
    },
    /// A law answers by what is no number.
    #[error("the law `{law}` of joint `{joint}` gives no number at t = {time:.6e} s")]
    NoNumber {
        /// When, s.
        time: f64,
        /// Name of the joint.
        joint: String,
        /// Name of its law.
        law: &'static str,
    },
    /// Equal steps, however short, do not reach the tolerance.
    #[error(
        "{steps} steps leave an estimated error of {estimate:.1e} where {tolerance:.1e} is wanted; \
         raise the tolerance, or soften what is far stiffer than the rest"
    )]
    Unresolved {
        /// Steps of the finest attempt.
        steps: usize,
        /// Its error relative to the motion, estimated.
        estimate: f64,
        /// The error that was allowed.
        tolerance: f64,
    },
    /// The vibration is lost in the digits of the displacement that it is about.
    #[error(
        "the motion vibrates by only {share:.1e} of the displacement that it is about, too little for its digits; \
         take the constant force that displaces it away and let the structure be as it is under it, or use `harmonic-balance`"
    )]
    Offset {
        /// Size of the vibration, in the energy norm, relative to that of the state.
        share: f64,
    },
    /// Numbers leave the range of floating point, or what they need to be solved with.
    #[error("masses, springs and dampers are too far apart to compute with at t = {time:.6e} s; check their units")]
    OutOfRange {
        /// When, s.
        time: f64,
    },
    /// The motion escapes to infinity, or a number is no longer finite.
    #[error("the motion{} grows without bound{}", .place.as_ref().map_or_else(String::new, |place| format!(" of `{place}`")), by(*.time))]
    Unbounded {
        /// When, s; not finite where that is not known.
        time: f64,
        /// The place that is farthest then, where that is known.
        place: Option<String>,
    },
}

/// An estimate with as many digits as tell it from a tolerance of two.
fn told_apart(estimate: f64, tolerance: f64) -> String {
    let short = format!("{estimate:.1e}");
    if short == format!("{tolerance:.1e}") { format!("{estimate:.3e}") } else { short }
}

/// What to do about a series that is too short.
fn beyond(needed: Option<usize>) -> String {
    let raise = "raise `tolerance`";
    needed.map_or_else(
        || format!("; {raise}"),
        |needed| {
            format!(
                ": rigid friction may take {needed} and more, and with them more work or memory than one point may; {raise}, or give friction a stiffness (law `jenkins`, in a plane `jenkins-2d`)"
            )
        },
    )
}

fn by(time: f64) -> String {
    if time.is_finite() { format!(" by t = {time:.6e} s") } else { String::new() }
}

impl Breakdown {
    /// When, s, if that is known.
    pub fn time(&self) -> Option<f64> {
        self.clone().instant().map(|time| *time).filter(|time| time.is_finite())
    }

    /// The same of a motion that began later by `begin` (s).
    pub(crate) fn later(mut self, begin: f64) -> Self {
        if let Some(time) = self.instant() {
            *time += begin;
        }
        self
    }

    fn instant(&mut self) -> Option<&mut f64> {
        match self {
            Breakdown::Chatter { time, .. }
            | Breakdown::Redundant { time, .. }
            | Breakdown::Undecidable { time }
            | Breakdown::Defective { time, .. }
            | Breakdown::TooFast { time }
            | Breakdown::Stalled { time, .. }
            | Breakdown::NoNumber { time, .. }
            | Breakdown::OutOfRange { time }
            | Breakdown::Unbounded { time, .. } => Some(time),
            Breakdown::Unresolved { .. } | Breakdown::Offset { .. } => None,
        }
    }
}

/// No orbit was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OrbitError {
    /// The iteration did not converge.
    #[error(
        "{method} stopped at Ω = {omega:.4} rad/s after {iterations} iterations, residual {residual:.1e}{}; \
         start from a neighbouring orbit, or check that a periodic motion exists (undamped resonance has none){instead}",
        if *spent { ", with all the work that one point may take" } else { "" }
    )]
    NotConverged {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// Iterations made.
        iterations: usize,
        /// Smallest residual reached.
        residual: f64,
        /// Whether the search ended because it had taken all the work that one point may take.
        spent: bool,
        /// What may find it instead, as words behind a comma; empty where nobody has asked or nothing does.
        instead: String,
    },
    /// The motion does not settle.
    #[error(
        "{method} at Ω = {omega:.4} rad/s: after {returns} returns the motion still changes by {change:.1e} from one to the next{}",
        unsettled(*.repeats, *.needed, .instead)
    )]
    Unsettled {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// Returns made: periods of the drive, or as many of these at a time as were asked for.
        returns: usize,
        /// Change over the last return, relative to the state.
        change: f64,
        /// Returns after which it repeats, if it does after a few.
        repeats: Option<usize>,
        /// Returns after which it would have settled, by its decay so far; `None` where it does not decay.
        needed: Option<f64>,
        /// What finds orbits without waiting, as words behind a comma; empty where nobody has asked or nothing does.
        instead: String,
    },
    /// The motion broke down.
    #[error("{method} broke down at Ω = {omega:.4} rad/s: {cause}")]
    Breakdown {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// The cause.
        cause: Breakdown,
    },
    /// The evidence contradicts the orbit.
    #[error("{method} closed an orbit at Ω = {omega:.4} rad/s that fails its check: energy gap {energy_gap:.1e}")]
    Evidence {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// The gap.
        energy_gap: f64,
    },
    /// The series that the method may take is too short for the tolerance.
    #[error(
        "{method} reaches an estimated error of {} at Ω = {omega:.4} rad/s with {harmonics} harmonics, not {tolerance:.1e}{}{instead}",
        told_apart(*.estimate, *.tolerance), beyond(*.needed)
    )]
    Truncation {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// Highest harmonic tried.
        harmonics: usize,
        /// Of rigid friction, how many may be enough: more than one point may take.
        needed: Option<usize>,
        /// Error of the motion relative to its amplitude, estimated.
        estimate: f64,
        /// The error that was allowed.
        tolerance: f64,
        /// What finds it instead, as words behind a comma; empty where nobody has asked or nothing does.
        instead: String,
    },
    /// Nothing holds the structure against the mean of the forces, or only friction does.
    #[error(
        "{method} finds no motion at Ω = {omega:.4} rad/s that stays where it is: friction or contacts alone hold some of the structure, and \
         its mean leaves them; press the contacts harder, or add the spring that holds it{}",
        if .instead.is_empty() { String::new() } else { format!("{instead}, which may find one that friction holds") }
    )]
    Drift {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// What follows such a motion, as words behind a comma; empty where nobody has asked or nothing does.
        instead: String,
    },
    /// No orbit was found, and a motion that was followed from static equilibrium shows what there is instead.
    #[error(
        "{method} finds no orbit at Ω = {omega:.4} rad/s; followed in time from static equilibrium, the motion {course}"
    )]
    NoOrbit {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// What it does.
        course: Course,
    },
    /// Nothing bounds the motion of the structure without its joints.
    #[error(
        "{method} finds the structure without its joints {} at Ω = {omega:.4} rad/s: {}",
        if *resonance == 0.0 { "free to stand anywhere" } else { "in a resonance without damping" },
        unbounded(*resonance)
    )]
    Resonance {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// The harmonic of it that is the resonance, rad/s.
        resonance: f64,
    },
    /// A path that a method gave is no periodic motion.
    #[error("the motion of {method} at Ω = {omega:.4} rad/s {what}")]
    NotAnOrbit {
        /// The method.
        method: &'static str,
        /// Drive frequency, rad/s.
        omega: f64,
        /// What is wrong.
        what: &'static str,
    },
    /// The drive frequency is no positive finite number.
    #[error("the drive frequency must be positive and finite, found {omega} rad/s")]
    Frequency {
        /// What was given, rad/s.
        omega: f64,
    },
}

/// What a motion does that is followed in time.
#[derive(Debug, Clone, PartialEq)]
pub enum Course {
    /// It comes to one that repeats with the drive.
    Settles,
    /// It comes closer to such a one, and is not there yet.
    Settling {
        /// Periods for which it was followed.
        periods: usize,
    },
    /// It comes to one that repeats after several periods of the drive.
    Repeats {
        /// How many.
        periods: usize,
    },
    /// A body leaves the place where it was, period by period.
    MovesOn {
        /// The place that goes farthest.
        place: String,
        /// How far, m.
        way: f64,
        /// In how many periods.
        periods: usize,
        /// The joint that is apart for the largest share of the last period.
        joint: String,
        /// That share; zero if no faces part.
        share: f64,
    },
    /// It neither repeats nor moves on.
    Wanders {
        /// Periods for which it was followed.
        periods: usize,
        /// The joint that is apart for the largest share of the last of them.
        joint: String,
        /// That share; zero if no faces part.
        share: f64,
    },
}

impl std::fmt::Display for Course {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let apart = |joint: &str, share: f64| {
            if share > 0.0 {
                format!(", with `{joint}` apart for {:.0} % of the last", 100.0 * share)
            } else {
                String::new()
            }
        };
        match self {
            Course::Settles => {
                write!(
                    f,
                    "settles on one that repeats with the drive, which this series does not reach: take more harmonics, or method `transient`"
                )
            }
            Course::Settling { periods } => write!(
                f,
                "settles slowly: after {periods} periods it still changes, less and less; take more harmonics, or method `transient`"
            ),
            Course::Repeats { periods } => {
                write!(
                    f,
                    "repeats after {periods} periods of the drive: ask for it with the option `period = {periods}`"
                )
            }
            Course::MovesOn { place, way, periods, joint, share } => write!(
                f,
                "moves on, and nothing brings it back: `{place}` by {way:.2e} m in {periods} periods{}; add a spring that holds it, press the \
                 contacts harder, or damp the motion",
                apart(joint, *share)
            ),
            Course::Wanders { periods, joint, share } => write!(
                f,
                "neither repeats nor settles in {periods} periods{}, which does not prove that there is no orbit; press the contacts harder, \
                 damp the motion, or look at it with kind = \"transient\"",
                apart(joint, *share)
            ),
        }
    }
}

/// What a motion that does not settle does instead, and what to do about it.
fn unsettled(repeats: Option<usize>, needed: Option<f64>, instead: &str) -> String {
    let by_newton = if instead.is_empty() { String::new() } else { format!("{instead}, which does not wait") };
    match repeats {
        // what does not change is settled: the first that can be is the second
        Some(repeats) => {
            format!(
                "; it repeats after {repeats} of them: ask for it with {repeats} times the `period` (1 when absent)"
            )
        }
        None => match needed {
            Some(needed) => {
                format!(
                    "; by its decay so far it would settle after about {needed:.0} returns: raise `periods`{by_newton}"
                )
            }
            None => {
                format!("; it does not decay; add damping, or look at it with kind = \"transient\"{by_newton}")
            }
        },
    }
}

/// What is wrong with a structure that has a resonance without damping there, rad/s, and what to do; at zero it is a mean that nothing holds.
fn unbounded(resonance: f64) -> String {
    if resonance == 0.0 {
        return "nothing holds some of its bodies; add a spring that does, or a constant force or preload that presses their contacts".to_owned();
    }
    format!("nothing bounds its motion at {resonance:.4} rad/s; give it damping, or take a frequency beside it")
}

impl OrbitError {
    /// The search of `method` at `omega` ended after so many iterations, with this least residual.
    pub(crate) fn not_converged(method: &'static str, omega: f64, iterations: usize, residual: f64) -> Self {
        OrbitError::NotConverged { method, omega, iterations, residual, spent: false, instead: String::new() }
    }

    /// The same error, of a search after which `other` found nothing either.
    pub(crate) fn after(mut self, other: &str) -> Self {
        match &mut self {
            OrbitError::NotConverged { instead, .. } | OrbitError::Truncation { instead, .. } => {
                *instead = format!("; `{other}` finds none either");
            }
            _ => {}
        }
        self
    }

    /// No motion that `method` finds at `omega` stays where it is.
    pub(crate) fn drift(method: &'static str, omega: f64) -> Self {
        OrbitError::Drift { method, omega, instead: String::new() }
    }

    /// One word for tables.
    pub fn status(&self) -> &'static str {
        match self {
            OrbitError::NotConverged { .. } => "not-converged",
            OrbitError::Unsettled { .. } => "not-settled",
            OrbitError::Breakdown { .. } => "breakdown",
            OrbitError::Evidence { .. } => "evidence-fails",
            OrbitError::Truncation { .. } => "tolerance-not-reached",
            OrbitError::Drift { .. } | OrbitError::NoOrbit { course: Course::MovesOn { .. }, .. } => "drifts",
            OrbitError::NoOrbit { course: Course::Settles | Course::Settling { .. }, .. } => "not-converged",
            OrbitError::NoOrbit { .. } => "not-settled",
            OrbitError::Resonance { .. } => "resonance",
            OrbitError::NotAnOrbit { .. } => "not-an-orbit",
            OrbitError::Frequency { .. } => "bad-frequency",
        }
    }
}
