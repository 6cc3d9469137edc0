//! Nonlinear modes: frequency and equivalent damping of a free vibration over its amplitude, and self-excited orbits.
//!
//! At small amplitude joints stick and the mode is the linear one with their springs, or with rigid contacts closed; at large amplitude
//! it is the linear one without joints; the damping vanishes at both ends and has a maximum between. Where friction pulls two
//! frequencies together, both modes become one, and which of those below that amplitude is followed is not determined.
//! The equations are those of the extended periodic motion concept, Krack (2015).

use crate::method::MethodError;
use crate::method::harmonic_balance::{ModeEquations, ModeState};
use crate::model::System;

/// A point of a nonlinear mode.
#[derive(Debug, Clone, PartialEq)]
pub struct ModePoint {
    /// Modal amplitude `a` with `a² = X₁ᴴ M X₁` of the first harmonic, m √kg.
    pub amplitude: f64,
    /// Frequency, rad/s.
    pub omega: f64,
    /// Equivalent damping ratio ζ: that of the linear oscillator that loses the same share of energy per cycle. It contains the viscous
    /// dampers; it is negative where the structure takes up more energy than friction destroys.
    pub damping: f64,
    /// Amplitude of the first harmonic of every place, m.
    pub places: Vec<f64>,
}

/// A nonlinear mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Points by rising amplitude.
    pub points: Vec<ModePoint>,
    /// The amplitude at which it was lost, if it was.
    pub lost: Option<f64>,
}

/// Which mode, and with how many harmonics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeRequest {
    /// Number of the mode by rising frequency, from 0.
    pub mode: usize,
    /// Modal amplitudes between which it is followed, m √kg; both positive.
    pub range: (f64, f64),
    /// Points, evenly spaced in the logarithm of the amplitude.
    pub points: usize,
    /// Highest harmonic; odd ones are used.
    pub harmonics: usize,
    /// Samples per period.
    pub samples: usize,
}

/// Multiples of the largest amplitude at which a mode may begin.
const STARTS: [f64; 4] = [1.0, 10.0, 100.0, 1e4];
/// Steps between two points that may be halved.
const HALVINGS: u32 = 12;

/// Follows a mode from its large end, where joints hardly matter, to its small one.
///
/// # Errors
/// A law with several directions, a place without mass.
///
/// # Example
/// ```
/// use stickslip::curve::modes::{ModeRequest, mode};
/// let system = stickslip::model::templates::find("blade-couple-massless").unwrap().model().assemble().unwrap();
/// // the mode in which the blades move against each other is the only one that friction knows
/// let request = ModeRequest { mode: 1, range: (1e-6, 1.0), points: 25, harmonics: 5, samples: 512 };
/// let mode = mode(&system, request).unwrap();
/// assert!(mode.lost.is_none());
/// let stuck = ((105_103.0 + 2.0 * 1e4) / 0.182f64).sqrt();
/// assert!((mode.points[0].omega / stuck - 1.0).abs() < 1e-6);
/// ```
pub fn mode(system: &System, request: ModeRequest) -> Result<Mode, MethodError> {
    let mut equations = ModeEquations::new(system, request.harmonics, request.samples)?;
    let (low, high) = request.range;
    let last = request.points.max(2) - 1;
    let amplitude = |i: usize| low * (high / low).powf(i as f64 / last as f64);
    let mut points = Vec::with_capacity(last + 1);
    // joints matter the less the larger the motion: begin as far above the range as the linear mode is a good guess
    let begin = STARTS.iter().find_map(|factor| {
        let linear = equations.linear(request.mode, factor * high)?;
        follow(&mut equations, &(factor * high, linear), high).map(|state| (high, state))
    });
    let Some(mut now) = begin else {
        return Ok(Mode { points, lost: Some(high) });
    };
    let mut lost = None;
    for i in (0..=last).rev() {
        match follow(&mut equations, &now, amplitude(i)) {
            Some(state) => now = (amplitude(i), state),
            None => {
                lost = Some(amplitude(i));
                break;
            }
        }
        points.push(point(system, &now));
    }
    points.reverse();
    Ok(Mode { points, lost })
}

/// Self-excited orbits along a mode: the amplitudes at which its damping changes its sign. Stable ones have rising damping there.
///
/// # Errors
/// A law with several directions, a place without mass.
pub fn self_excited(system: &System, request: ModeRequest) -> Result<Vec<ModePoint>, MethodError> {
    let mut equations = ModeEquations::new(system, request.harmonics, request.samples)?;
    let found = mode(system, request)?;
    let mut orbits = Vec::new();
    for pair in found.points.windows(2) {
        if (pair[0].damping < 0.0) == (pair[1].damping < 0.0) {
            continue;
        }
        let Some(linear) = equations.linear(request.mode, request.range.1) else { continue };
        let Some(upper) = follow(&mut equations, &(request.range.1, linear), pair[1].amplitude) else { continue };
        let mut at = (pair[1].amplitude, upper);
        // regula falsi on the logarithm of the amplitude, with the Illinois weight
        let (mut a, mut fa) = (pair[0].amplitude.ln(), pair[0].damping);
        let (mut b, mut fb) = (pair[1].amplitude.ln(), pair[1].damping);
        for _ in 0..100 {
            let c = (a * fb - b * fa) / (fb - fa);
            let Some(state) = follow(&mut equations, &at, c.exp()) else { break };
            let fc = state.damping;
            at = (c.exp(), state);
            if fc == 0.0 || (b - a).abs() < 1e-14 || fc.abs() < 1e-15 {
                break;
            }
            if (fc < 0.0) == (fb < 0.0) {
                fa *= 0.5;
            } else {
                (a, fa) = (b, fb);
            }
            (b, fb) = (c, fc);
        }
        orbits.push(point(system, &at));
    }
    Ok(orbits)
}

/// From one amplitude to another, in as many steps as it takes.
fn follow(equations: &mut ModeEquations<'_>, from: &(f64, ModeState), to: f64) -> Option<ModeState> {
    let (mut now, mut state) = (from.0, from.1.clone());
    let mut factor = to / now;
    let mut halvings = 0;
    loop {
        let next = if (factor < 1.0) == (now * factor < to) && factor != 1.0 { to } else { now * factor };
        match equations.solve(&state, now, next) {
            Some(found) => {
                if next == to {
                    return Some(found);
                }
                (now, state) = (next, found);
            }
            None => {
                halvings += 1;
                if halvings > HALVINGS {
                    return None;
                }
                factor = factor.sqrt();
            }
        }
    }
}

fn point(system: &System, (amplitude, state): &(f64, ModeState)) -> ModePoint {
    ModePoint {
        amplitude: *amplitude,
        omega: state.omega,
        damping: state.damping,
        places: (0..system.dofs()).map(|i| state.x[i].norm()).collect(),
    }
}
