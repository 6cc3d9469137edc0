//! Nonlinear modes: frequency and equivalent damping of a free vibration as functions of its
//! amplitude, and self-excited orbits.
//!
//! At small amplitudes the joints stick, and the mode is the linear mode with their springs, or
//! with rigid contacts closed. At large amplitudes it is the linear mode without joints.
//!
//! The continuation begins at an amplitude at which friction is negligible, and proceeds to
//! smaller amplitudes by arc length. Its steps depend on the curve alone, not on the requested
//! range or points. Once all joints stick, every smaller motion is a multiple of the last one.
//! The requested points are solved from neighbouring states of the continuation.
//! If the curve ends above the smallest amplitude, a second continuation proceeds upwards from
//! the smallest amplitude. It begins at the mode of the most similar shape with all joints
//! linearized for small motion. Under constant forces only this second continuation is used,
//! because they may press bodies together that have no large motion.
//!
//! Friction can bring two frequencies together, so that two modes nearly coalesce:
//! [`Mode::coalescences`]. Below this amplitude there are two modes again, with other shapes.
//! Small effects, such as the number of harmonics, decide which mode continues which. The curve
//! may also turn there. Its amplitude then grows again before it falls, and the motion at the
//! next smaller amplitude is a different one ([`Mode::turns`]). If the curve does not return, the
//! mode ends ([`ModeEnd`]).
//! Source: the extended periodic motion concept of Krack (2015).

mod mode_curve;

pub use mode_curve::{ModeEnd, ModeEndCause, TurningPart};

use crate::method::harmonic_balance::{ModeEquations, ModeState};
use crate::method::{MethodError, alternatives};
use crate::model::System;
use mode_curve::ModeCurve;
use num_complex::Complex64;
use std::fmt;
use stickslip_numerics::tie_break::first_largest;

/// A point of a nonlinear mode.
#[derive(Debug, Clone, PartialEq)]
pub struct ModePoint {
    /// Modal amplitude `a` with `a² = X₁ᴴ M X₁` of the first harmonic, m √kg.
    pub amplitude: f64,
    /// Frequency, rad/s.
    pub omega: f64,
    /// Equivalent damping ratio ζ: that of a linear oscillator with the same relative energy
    /// loss per cycle. It includes the viscous dampers. It is negative if the structure absorbs
    /// more energy than friction dissipates.
    pub damping: f64,
    /// Contribution of the viscous dampers to the damping ratio; the joints contribute the rest.
    pub viscous: f64,
    /// First harmonic of every place, m: the shape with its phases.
    pub places: Vec<Complex64>,
    /// Half of the peak-to-peak displacement of every place, m, with all harmonics.
    pub amplitudes: Vec<f64>,
    /// First harmonic of every degree of freedom, m.
    pub shape: Vec<Complex64>,
}

impl ModePoint {
    /// Returns the phases of the places relative to the place with the largest motion, rad.
    /// Among equal ones, the first has phase zero.
    ///
    /// # Example
    /// ```
    /// use num_complex::Complex64;
    /// use stickslip::curve::modes::ModePoint;
    /// let places = vec![Complex64::new(0.0, 1.0), Complex64::new(0.0, -2.0)];
    /// let point = ModePoint {
    ///     amplitude: 1.0,
    ///     omega: 1.0,
    ///     damping: 0.0,
    ///     viscous: 0.0,
    ///     places,
    ///     amplitudes: vec![1.0, 2.0],
    ///     shape: Vec::new(),
    /// };
    /// assert_eq!(
    ///     point.phases().iter().map(|phase| phase.abs()).collect::<Vec<_>>(),
    ///     [std::f64::consts::PI, 0.0]
    /// );
    /// ```
    pub fn phases(&self) -> Vec<f64> {
        let leading = self.leading_place();
        self.places.iter().map(|x| (x * leading.conj()).arg()).collect()
    }

    /// Returns the first harmonic, m, of the place with the largest motion; of equal ones, that of
    /// the first. [`ModePoint::phases`] are relative to it. It is zero without places.
    pub fn leading_place(&self) -> Complex64 {
        first_largest(self.places.iter().map(|x| x.norm())).map_or(Complex64::default(), |i| self.places[i])
    }
}

/// A nonlinear mode.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Points in order of amplitude.
    pub points: Vec<ModePoint>,
    /// Point with the largest damping ratio within the range, also between the requested points.
    pub largest: Option<ModePoint>,
    /// Modal amplitudes within the range at which the mode nearly coalesces with another one, in
    /// decreasing order, m √kg.
    pub coalescences: Vec<f64>,
    /// Turning points of the curve within the range, in decreasing order of amplitude.
    pub turns: Vec<TurningPart>,
    /// Requested amplitudes on the curve at which no motion was found.
    pub not_found: Vec<f64>,
    /// Amplitude and cause of the end, if the mode ends above the smallest amplitude.
    pub ended: Option<ModeEnd>,
    /// True if the mode is one of the two travelling waves of a pair of equal modes.
    pub is_travelling_wave: bool,
}

/// Specification of a nonlinear mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeRequest {
    /// Number of the mode in order of frequency, from 0.
    pub mode: usize,
    /// Range of modal amplitudes, m √kg; both positive.
    pub range: (f64, f64),
    /// Number of points, equally spaced in the logarithm of the amplitude.
    pub points: usize,
    /// Highest harmonic. If all laws are odd, only odd harmonics are used.
    pub harmonics: usize,
    /// Samples per period.
    pub samples: usize,
}

/// Checks that a system can have nonlinear modes.
///
/// # Errors
/// A place without mass, or a law that is not supported.
pub fn check(system: &System) -> Result<(), MethodError> {
    equations(system, 1, 8).map(drop)
}

/// Returns the mode equations of a system. The error names alternative methods.
fn equations(system: &System, harmonics: usize, samples: usize) -> Result<ModeEquations<'_>, MethodError> {
    ModeEquations::new(system, harmonics, samples).map_err(|error| error.with_alternatives(alternatives(system)))
}

/// Computes a nonlinear mode, from an amplitude at which friction is negligible to smaller
/// amplitudes.
///
/// # Errors
/// A law with several directions, a place without mass, a mass matrix that is not positive
/// definite.
///
/// # Example
/// ```
/// use stickslip::curve::modes::{ModeRequest, nonlinear_mode};
/// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
/// // friction affects only the mode in which the blades move in antiphase
/// let request =
///     ModeRequest { mode: 1, range: (1e-6, 1.0), points: 25, harmonics: 5, samples: 512 };
/// let mode = nonlinear_mode(&system, request).unwrap();
/// assert!(mode.ended.is_none());
/// let stuck = ((105_103.0 + 2.0 * 1e4) / 0.182f64).sqrt();
/// assert!((mode.points[0].omega / stuck - 1.0).abs() < 1e-6);
/// ```
pub fn nonlinear_mode(system: &System, request: ModeRequest) -> Result<Mode, MethodError> {
    Ok(FollowedMode::new(system, request)?.mode())
}

/// A nonlinear mode whose curve is known, for points at any amplitudes.
pub struct FollowedMode<'a> {
    equations: ModeEquations<'a>,
    request: ModeRequest,
    branches: ModeBranches,
}

impl fmt::Debug for FollowedMode<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FollowedMode").field("request", &self.request).finish_non_exhaustive()
    }
}

impl<'a> FollowedMode<'a> {
    /// Follows a mode through its range of amplitudes.
    ///
    /// # Errors
    /// See [`nonlinear_mode`].
    pub fn new(system: &'a System, request: ModeRequest) -> Result<Self, MethodError> {
        let mut equations = equations(system, request.harmonics, request.samples)?;
        let branches = ModeBranches::new(&mut equations, request);
        Ok(FollowedMode { equations, request, branches })
    }

    /// Returns the mode with its requested points.
    pub fn mode(&mut self) -> Mode {
        let FollowedMode { equations, request, branches } = self;
        let (low, high) = request.range;
        let last = request.points.max(2) - 1;
        let larger = |a: &(f64, ModeState), b: &(f64, ModeState)| a.1.damping.total_cmp(&b.1.damping);
        let largest = branches.curves().filter_map(|curve| curve.largest_damping(equations, (low, high)));
        let largest = largest.max_by(larger);
        let merges = branches.curves().flat_map(|curve| curve.merges(equations)).filter(|a| (low..high).contains(a));
        let turns = branches.curves().flat_map(ModeCurve::turns).filter(|turn| turn.amplitude < high);
        let mut mode = Mode {
            points: Vec::new(),
            largest: largest.map(|(a, state)| point(equations, a, &state)),
            coalescences: merges.collect(),
            turns: turns.collect(),
            not_found: Vec::new(),
            ended: branches.ended(high),
            is_travelling_wave: branches.curves().any(ModeCurve::travels),
        };
        for i in 0..=last {
            let amplitude = if i == last { high } else { low * (high / low).powf(i as f64 / last as f64) };
            match self.point(amplitude) {
                Some(point) => mode.points.push(point),
                None if self.branches.passes(amplitude) => mode.not_found.push(amplitude),
                None => {}
            }
        }
        mode
    }

    /// Returns the motion at a modal amplitude, m √kg; `None` if the curve has none there.
    pub fn point(&mut self, amplitude: f64) -> Option<ModePoint> {
        let FollowedMode { equations, branches, .. } = self;
        let state = branches.curves().find_map(|curve| curve.state_at(equations, amplitude))?;
        Some(point(equations, amplitude, &state))
    }
}

/// The curve of a mode: a branch from large amplitudes downwards. A branch from small amplitudes
/// upwards is added if the first one does not reach them.
struct ModeBranches {
    falling: Option<ModeCurve>,
    rising: Option<ModeCurve>,
}

impl ModeBranches {
    fn new(equations: &mut ModeEquations<'_>, request: ModeRequest) -> Self {
        let (low, high) = request.range;
        // A single mode has the same number at both ends. For a law with memory, large motions
        // are expensive, so the branch from small amplitudes is tried first. Constant forces press
        // bodies together that would fly apart in a large motion.
        let rising = match equations.is_single_dof_with_memory() || equations.has_constant_forces() {
            true => ModeCurve::from_small_amplitude(equations, request.mode, request.range.0, request.range.1),
            false => None,
        };
        let reached = |rising: &ModeCurve| rising.largest_amplitude() >= high;
        if rising.as_ref().is_some_and(|rising| reached(rising) || equations.has_constant_forces()) {
            return ModeBranches { falling: None, rising };
        }
        let mut falling = ModeCurve::follow(equations, request.mode, request.range.0, request.range.1);
        falling.drop_other_mode(equations);
        let end = falling.smallest_amplitude().min(high);
        let is_sought = rising.is_none() && falling.ended.is_some() && end > low;
        let below = if is_sought {
            let last = falling.last_state().and_then(|last| equations.most_similar_small_mode(last, request.mode));
            ModeCurve::from_small_amplitude(equations, last.unwrap_or(request.mode), low, end)
        } else {
            None
        };
        let reaches_end = |below: &&ModeCurve| below.largest_amplitude() >= end && end < high;
        if below.as_ref().filter(reaches_end).is_some_and(|below| !falling.meets(below, equations)) {
            falling.ended = Some(ModeEnd { at: end, reason: ModeEndCause::Apart });
        }
        ModeBranches { falling: Some(falling), rising: rising.or(below) }
    }

    fn curves(&self) -> impl Iterator<Item = &ModeCurve> {
        self.falling.iter().chain(&self.rising)
    }

    /// Tells whether a branch passes an amplitude.
    fn passes(&self, amplitude: f64) -> bool {
        self.falling.as_ref().is_some_and(|curve| amplitude > curve.smallest_amplitude())
            || self.rising.as_ref().is_some_and(|curve| amplitude < curve.largest_amplitude())
    }

    /// Returns amplitude and cause of the end of the mode, if it ends above the smallest
    /// amplitude. Amplitudes above `high` are not considered.
    fn ended(&self, high: f64) -> Option<ModeEnd> {
        let Some(falling) = &self.falling else { return self.rising.as_ref()?.ended };
        let ended = falling.ended?;
        match &self.rising {
            _ if ended.reason == ModeEndCause::Apart => Some(ended),
            Some(rising) if rising.largest_amplitude() >= falling.smallest_amplitude().min(high) => None,
            Some(rising) if ended.reason == ModeEndCause::NoStart => rising.ended,
            _ => Some(ended),
        }
    }
}

/// Returns the modal amplitude (m √kg) at which the place with the largest motion has an
/// amplitude of 1 m, in mode `index` of the structure without its joints, or of small motions
/// about the equilibrium under constant forces. `None` if there is no such mode, or if it moves
/// no place.
///
/// # Errors
/// See [`nonlinear_mode`].
pub fn unit_amplitude(system: &System, index: usize) -> Result<Option<f64>, MethodError> {
    let mut equations = equations(system, 1, 8)?;
    let size = |x: &[Complex64]| x.iter().fold(0.0, |most: f64, x| most.max(x.norm()));
    let displacements = |x: Vec<Complex64>| -> Vec<Complex64> {
        x.into_iter().zip(system.place_axes()).filter(|(_, place)| !place.is_rotation()).map(|(x, _)| x).collect()
    };
    let small = match equations.has_constant_forces() {
        true => equations.small_amplitude_mode(index, 1.0).map(|mode| equations.first_harmonic(&mode.state).to_vec()),
        false => None,
    };
    let shape = small.or_else(|| Some(equations.linear_modes().get(index)?.shape.as_slice().to_vec()));
    Ok(shape.and_then(|shape| {
        let largest = size(&displacements(equations.at_places(&shape)));
        // Displacements of places below this fraction of a mode's largest coordinate are
        // rounding.
        (largest > 1e-12 * size(&shape)).then(|| 1.0 / largest)
    }))
}

/// Computes self-excited orbits along a mode: the amplitudes at which its damping changes sign.
/// An orbit is stable if the damping rises with amplitude there.
///
/// # Errors
/// See [`nonlinear_mode`].
pub fn self_excited(system: &System, request: ModeRequest) -> Result<Vec<ModePoint>, MethodError> {
    let mut equations = equations(system, request.harmonics, request.samples)?;
    let path = ModeCurve::follow(&mut equations, request.mode, request.range.0, request.range.1);
    let mut orbits = Vec::new();
    for pair in path.states_within(&mut equations, request.range).windows(2) {
        let [(i, above, upper), (k, below, lower)] = pair else { continue };
        // The curve turns between states that are not consecutive, and the damping jumps.
        if (upper.damping < 0.0) == (lower.damping < 0.0) || k - i > 1 {
            continue;
        }
        let mut found = None;
        // regula falsi in the logarithm of the amplitude, with the Illinois weight
        let (mut a, mut fa, mut b, mut fb) = (below.ln(), lower.damping, above.ln(), upper.damping);
        for _ in 0..100 {
            let c = (a * fb - b * fa) / (fb - fa);
            let Some(state) = path.state_at(&mut equations, c.exp()) else { break };
            let fc = state.damping;
            found = Some((c.exp(), state));
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
        orbits.extend(found.map(|(amplitude, state)| point(&equations, amplitude, &state)));
    }
    orbits.reverse();
    Ok(orbits)
}

fn point(equations: &ModeEquations<'_>, amplitude: f64, state: &ModeState) -> ModePoint {
    ModePoint {
        amplitude,
        omega: state.omega,
        damping: state.damping,
        viscous: equations.viscous_damping_ratio(state),
        places: equations.places(state),
        amplitudes: equations.half_ranges(state),
        shape: equations.first_harmonic(state).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Cubic, FrictionContact, Jenkins, Stribeck};
    use crate::method::{Method, event_driven::EventDriven};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};
    use std::f64::consts::PI;

    /// Tolerance between the exact orbit and a mode with 31 harmonics, in energy and amplitudes.
    /// For rigid friction, the error of a series decreases as 1/H, and a motion near the
    /// coalescence of two modes amplifies it.
    const SERIES: f64 = 0.02;

    /// A ring of equal blades has modes in pairs, and any combination of a pair is a motion
    /// while the dampers stick. The frequency is that of the wave with one nodal diameter,
    /// `√((k + 4 kt sin²(π/N))/m)`.
    #[test]
    fn modes_of_a_tuned_ring_reach_full_stick() {
        let (blades, k, kt) = (6, 4.0, 0.8);
        let system = ring(blades);
        let request = ModeRequest { mode: 1, range: (1e-6, 1e-2), points: 5, harmonics: 3, samples: 128 };
        let mode = nonlinear_mode(&system, request).unwrap();
        assert_eq!((mode.points.len(), mode.ended, &mode.not_found[..]), (5, None, &[][..]));
        let stuck = (k + 4.0 * kt * (PI / blades as f64).sin().powi(2)).sqrt();
        for point in &mode.points {
            assert!((point.omega / stuck - 1.0).abs() < 1e-10, "{} instead of {stuck}", point.omega);
            assert!((point.damping * 2.0 * stuck / 0.01 - 1.0).abs() < 1e-9, "{}", point.damping);
        }
    }

    /// Blades (1 kg, 4 N/m and 0.01 kg/s to the ground) in a ring; joints of 0.8 N/m with a slip
    /// limit of 0.2 N connect neighbours.
    fn ring(blades: usize) -> System {
        pushed_ring(blades, 0.0)
    }

    /// The ring with a constant force on every blade. It moves all blades alike and does not change
    /// their vibration, but the mode is followed from small amplitudes.
    fn pushed_ring(blades: usize, push: f64) -> System {
        let mut model = Model::default();
        let name = |i: usize| format!("b{}", i % blades);
        for i in 0..blades {
            model.masses.push(Mass::new(name(i), 1.0));
            model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness: 4.0, damping: 0.01 });
            let law = std::sync::Arc::new(Jenkins { stiffness: 0.8, limit: 0.2 });
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i), name(i + 1)], law });
            if push != 0.0 {
                model.forces.push(Force { on: name(i), amplitude: push, phase: 0.0, harmonic: 0 });
            }
        }
        model.assemble().unwrap()
    }

    /// With unlike blades, the mode of a number at large amplitudes may become another one in
    /// stick. Slip only lowers a frequency, so points whose frequency rises with the amplitude
    /// belong to two motions. Each mode has no such rise, or says where its curve turns or where
    /// its curves are apart.
    #[test]
    fn modes_that_change_their_number_say_so() {
        let deviations = [0.0, 0.012, -0.008, 0.004, -0.011, 0.007];
        let mut model = Model::default();
        let name = |i: usize| format!("b{}", i % deviations.len());
        for (i, deviation) in deviations.into_iter().enumerate() {
            let stiffness = 1e4 * (1.0 + deviation);
            model.masses.push(Mass::new(name(i), 1.0));
            model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness, damping: 0.0 });
            let law = std::sync::Arc::new(Jenkins { stiffness: 2e3, limit: 3.0 });
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i), name(i + 1)], law });
        }
        let system = model.assemble().unwrap();
        let mut apart = 0;
        for mode in 0..deviations.len() {
            let unit = unit_amplitude(&system, mode).unwrap().unwrap();
            let range = (5e-5 * unit, 2e-2 * unit);
            let request = ModeRequest { mode, range, points: 13, harmonics: 3, samples: 256 };
            let found = nonlinear_mode(&system, request).unwrap();
            let rises = found.points.windows(2).any(|pair| pair[1].omega > 1.001 * pair[0].omega);
            let cause = found.ended.map(|end| end.reason);
            assert!(!rises || cause.is_some() || !found.turns.is_empty(), "mode {mode}");
            apart += usize::from(cause == Some(ModeEndCause::Apart));
        }
        assert!(apart > 0, "no mode changes its number");
    }

    /// Three times the frequency of the first mode meets the third mode while the joints slip.
    /// Below, the curve from large amplitudes is a vibration of the third mode. At small amplitudes
    /// all joints stick (NumPy, eigenvalues): 16.304452955 Hz, damping ratio 0.00270917.
    #[test]
    fn a_mode_ends_where_it_becomes_another_one() {
        let places = ["m1", "m2", "m3", "m4"];
        let between = |one: &str, other: &str| [one.to_owned(), other.to_owned()];
        let spring =
            |one: &str, other: &str, stiffness, damping| Spring { between: between(one, other), stiffness, damping };
        let joint = |one: &str, other: &str, stiffness, limit| Joint {
            name: format!("{one}_{other}"),
            between: between(one, other),
            law: std::sync::Arc::new(Jenkins { stiffness, limit }),
        };
        let model = Model {
            masses: places.iter().zip([2.0, 1.5, 1.0, 0.5]).map(|(place, mass)| Mass::new(*place, mass)).collect(),
            springs: vec![
                spring("m1", GROUND, 4e4, 3.0),
                spring("m1", "m2", 3e4, 2.0),
                spring("m2", "m3", 2.5e4, 2.0),
                spring("m3", "m4", 2e4, 1.0),
            ],
            joints: vec![joint("m2", GROUND, 1.5e4, 8.0), joint("m3", "m1", 5e5, 5.0)],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let unit = unit_amplitude(&system, 0).unwrap().unwrap();
        let range = (2e-5 * unit, 2e-2 * unit);
        let mode =
            nonlinear_mode(&system, ModeRequest { mode: 0, range, points: 2, harmonics: 15, samples: 512 }).unwrap();
        let small = &mode.points[0];
        assert!((small.omega / (2.0 * PI) / 16.304_452_955 - 1.0).abs() < 1e-6, "{}", small.omega / (2.0 * PI));
        assert!((small.damping / 0.002_709_17 - 1.0).abs() < 1e-4, "{}", small.damping);
    }

    /// For two equal modes of a ring, the solver follows the travelling waves:
    /// `ω² m = k + 4 sin²(θ/2) Re K`, `2 ζ ω² m = ω c + 4 sin²(θ/2) Im K`. K is the dynamic
    /// stiffness of a Jenkins element at the relative amplitude `D = 2 a sin(θ/2)`. For
    /// `D > d = limit/kt` and `cos ψ = 1 - 2 d/D`: `Re K = kt (ψ - sin ψ cos ψ)/π`,
    /// `Im K = 4 limit (1 - d/D)/(π D)`. If the number of blades is four times the nodal
    /// diameter, the phase between every other joint is undetermined. The wave then belongs to a
    /// continuum.
    #[test]
    fn the_waves_of_a_tuned_ring_have_the_closed_form_at_every_diameter() {
        for (blades, push) in [(4, 0.0), (8, 0.0), (8, 0.3)] {
            let system = pushed_ring(blades, push);
            for diameter in 1..blades / 2 {
                let sine = (PI * diameter as f64 / blades as f64).sin();
                for index in [2 * diameter - 1, 2 * diameter] {
                    let unit = unit_amplitude(&system, index).unwrap().unwrap();
                    // Only 1e-9 of the joints' stiffness distinguishes the modes of blades
                    // without coupling springs, and rounding disturbs it.
                    assert!(
                        (unit / (blades as f64).sqrt() - 1.0).abs() < 1e-6,
                        "a wave moves all blades alike: {unit}"
                    );
                    let request = ModeRequest {
                        mode: index,
                        range: (1e-3 * unit, 1e2 * unit),
                        points: 11,
                        harmonics: 1,
                        samples: 1024,
                    };
                    let mode = nonlinear_mode(&system, request).unwrap();
                    assert_eq!(
                        (mode.ended, mode.points.len(), mode.is_travelling_wave),
                        (None, 11, true),
                        "{blades} {diameter}"
                    );
                    for point in &mode.points {
                        let (kt, limit) = (0.8, 0.2);
                        let (d, slips) = (2.0 * sine * point.amplitude / unit, limit / kt);
                        let psi = (1.0 - 2.0 * slips / d).max(-1.0).acos();
                        let (re, im) = if d > slips {
                            (kt * (psi - psi.sin() * psi.cos()) / PI, 4.0 * limit * (1.0 - slips / d) / (PI * d))
                        } else {
                            (kt, 0.0)
                        };
                        let square = 4.0 + 4.0 * sine * sine * re;
                        let damping = (0.01 * square.sqrt() + 4.0 * sine * sine * im) / (2.0 * square);
                        let words = format!("{blades} {diameter} {}: {point:?}, {damping}", point.amplitude);
                        assert!((point.omega * point.omega / square - 1.0).abs() < SAMPLED, "{words}");
                        assert!((point.damping / damping - 1.0).abs() < SAMPLED, "{words}");
                        let turned = (point.places[1] / point.places[0]).arg().abs();
                        assert!((turned - 2.0 * PI * diameter as f64 / blades as f64).abs() < 1e-6, "{words}");
                    }
                }
            }
        }
    }

    /// Error of a travelling force that is sampled 1024 times per period.
    const SAMPLED: f64 = 1e-4;

    /// `x'' + k x + b x³ = 0` at amplitude A: `x = A cn(Ω t, m)`, `Ω² = k + b A²`,
    /// `m = b A²/(2 Ω²)`, with the period `4 K(m)/Ω`. The first harmonic is
    /// `A 2π √q/(√m K (1 + q))`, `q = exp(-π K(1-m)/K(m))`; K by the arithmetic-geometric mean.
    /// At a cubic stiffness of a million times the linear one, the linear mode is not a useful
    /// initial guess.
    #[test]
    fn a_dominant_cubic_spring_has_the_elliptic_solution() {
        let (k, b) = (1e4, 1e9);
        let quarter = |m: f64| {
            let (mut x, mut y) = (1.0, (1.0 - m).sqrt());
            for _ in 0..40 {
                (x, y) = (0.5 * (x + y), (x * y).sqrt());
            }
            0.5 * PI / x
        };
        let exact = |largest: f64| {
            let square = k + b * largest * largest;
            let m = b * largest * largest / (2.0 * square);
            let q = (-PI * quarter(1.0 - m) / quarter(m)).exp();
            let first = largest * 2.0 * PI * q.sqrt() / (m.sqrt() * quarter(m) * (1.0 + q));
            (0.5 * PI * square.sqrt() / quarter(m), first)
        };
        let mut model = Model::default();
        let between = || ["m".to_owned(), GROUND.to_owned()];
        model.masses.push(Mass::new("m", 1.0));
        model.springs.push(Spring { between: between(), stiffness: k, damping: 0.0 });
        let law = std::sync::Arc::new(Cubic { stiffness: b });
        model.joints.push(Joint { name: "j".into(), between: between(), law });
        let system = model.assemble().unwrap();
        for harmonics in [3, 15, 31] {
            let request = ModeRequest { mode: 0, range: (1e-9, 1.0), points: 15, harmonics, samples: 1024 };
            let mode = nonlinear_mode(&system, request).unwrap();
            assert_eq!((mode.ended, &mode.not_found[..], mode.points.len()), (None, &[][..], 15), "{harmonics}");
            for point in mode.points.iter().filter(|point| harmonics > 3 && point.amplitude > 1e-5) {
                // Find the largest displacement with this first harmonic by bisection; the
                // harmonic increases with the displacement.
                let (mut low, mut high) = (0.5 * point.amplitude, 2.0 * point.amplitude);
                for _ in 0..100 {
                    let middle = 0.5 * (low + high);
                    if exact(middle).1 < point.amplitude { low = middle } else { high = middle }
                }
                let omega = exact(low).0;
                assert!(
                    (point.omega / omega - 1.0).abs() < 1e-8,
                    "{harmonics} {}: {}, {omega}",
                    point.amplitude,
                    point.omega
                );
            }
        }
    }

    /// A block on a spring, or on none, is pressed with N against a spring contact and slides along
    /// it. Its mode begins at the stuck contact, and has the closed form of a Jenkins element with
    /// limit `µ N`, as in [`the_waves_of_a_tuned_ring_have_the_closed_form_at_every_diameter`].
    #[test]
    fn the_mode_of_a_pressed_block_begins_at_the_stuck_contact() {
        let (m, kt, kn, pressing) = (0.5, 2e5, 9e5, 40.0);
        for k in [0.0, 3e4] {
            let mut model = Model::default();
            model.masses.push(Mass::new("m", m).along(&["x", "z"]));
            let law = FrictionContact { tangential: kt, normal: kn, friction: 0.3, preload: 0.0, tangents: 1 };
            let between = ["m".to_owned(), GROUND.to_owned()];
            model.joints.push(Joint { name: "j".into(), between, law: std::sync::Arc::new(law) });
            model.forces.push(Force { on: "m.z".into(), amplitude: pressing, phase: 0.0, harmonic: 0 });
            if k > 0.0 {
                let between = ["m.x".to_owned(), GROUND.to_owned()];
                model.springs.push(Spring { between, stiffness: k, damping: 0.0 });
            }
            let system = model.assemble().unwrap();
            assert!((unit_amplitude(&system, 0).unwrap().unwrap() / m.sqrt() - 1.0).abs() < 1e-9);
            let slips = 0.3 * pressing / kt;
            let range = (1e-3 * slips * m.sqrt(), 3.0 * slips * m.sqrt());
            let request = ModeRequest { mode: 0, range, points: 9, harmonics: 1, samples: 1024 };
            let mode = nonlinear_mode(&system, request).unwrap();
            assert_eq!((mode.points.len(), mode.ended, &mode.not_found[..]), (9, None, &[][..]), "{k}");
            for point in &mode.points {
                let d = point.amplitude / m.sqrt();
                let psi = (1.0 - 2.0 * slips / d).max(-1.0).acos();
                let slipping = d > slips;
                let re = k + if slipping { kt * (psi - psi.sin() * psi.cos()) / PI } else { kt };
                let im = if slipping { 4.0 * kt * slips * (1.0 - slips / d) / (PI * d) } else { 0.0 };
                assert!((point.omega * point.omega * m / re - 1.0).abs() < SAMPLED, "{k} {d} {}", point.omega);
                assert!((point.damping - im / (2.0 * re)).abs() < SAMPLED, "{k} {d} {}", point.damping);
            }
        }
    }

    /// A block that only a pressed contact holds on a mass with a spring. With one harmonic, the
    /// squared frequency `λ = ω² (1 + 2jζ)` is the lower eigenvalue of both masses with the complex
    /// stiffness `k(D)` of a Jenkins element at the relative amplitude D. The modal amplitude
    /// rises, falls and rises again with D, so that the curve turns twice.
    #[test]
    fn a_mode_that_rises_reports_its_fold() {
        let (spring, masses, kt, limit) = (1000.0, [1.0, 0.5], 2000.0, 3.0);
        let mut model = Model::default();
        model
            .masses
            .extend([("a", masses[0]), ("b", masses[1])].map(|(name, m)| Mass::new(name, m).along(&["x", "z"])));
        for (along, stiffness) in [("a.x", spring), ("a.z", 2e4)] {
            let between = [along.to_owned(), GROUND.to_owned()];
            model.springs.push(Spring { between, stiffness, damping: 0.0 });
        }
        let law = FrictionContact { tangential: kt, normal: 5e3, friction: 0.3, preload: 0.0, tangents: 1 };
        let between = ["b".to_owned(), "a".to_owned()];
        model.joints.push(Joint { name: "j".into(), between, law: std::sync::Arc::new(law) });
        model.forces.push(Force { on: "b.z".into(), amplitude: limit / 0.3, phase: 0.0, harmonic: 0 });
        let system = model.assemble().unwrap();
        // modal amplitude, frequency and damping by D
        let slips = limit / kt;
        let mut before = None;
        let closed: Vec<[f64; 3]> = (1..4000)
            .map(|i| {
                let d = slips * 10f64.powf(2.0 * f64::from(i) / 4000.0);
                let psi = (1.0 - 2.0 * slips / d).max(-1.0).acos();
                let k =
                    Complex64::new(kt * (psi - psi.sin() * psi.cos()) / PI, 4.0 * limit * (1.0 - slips / d) / (PI * d));
                let (product, sum) = (masses[0] * masses[1], k * (masses[0] + masses[1]) + masses[1] * spring);
                let root = (sum * sum - k * (4.0 * product * spring)).sqrt();
                let roots = [-1.0, 1.0].map(|sign| (sum + root * sign) / (2.0 * product));
                let near = |root: &Complex64| before.map_or(root.norm(), |before: Complex64| (root - before).norm());
                let lambda = if near(&roots[0]) < near(&roots[1]) { roots[0] } else { roots[1] };
                before = Some(lambda);
                let of_a = 1.0 - lambda * masses[1] / k;
                let scale = d / (1.0 - of_a).norm();
                let amplitude = scale * (masses[0] * of_a.norm_sqr() + masses[1]).sqrt();
                [amplitude, lambda.re.sqrt(), lambda.im / (2.0 * lambda.re)]
            })
            .collect();
        let turns: Vec<f64> = closed
            .windows(3)
            .filter(|three| (three[1][0] - three[0][0]) * (three[2][0] - three[1][0]) < 0.0)
            .map(|three| three[1][0])
            .collect();
        let [upper, lower] = turns[..] else { panic!("{turns:?}") };
        let request = ModeRequest { mode: 0, range: (5e-3, 4e-2), points: 25, harmonics: 1, samples: 1024 };
        let mode = nonlinear_mode(&system, request).unwrap();
        assert_eq!((mode.points.len(), mode.ended, mode.turns.len()), (25, None, 1));
        let turn = mode.turns[0];
        assert!((turn.amplitude / lower - 1.0).abs() < 0.01, "{turn:?} {lower}");
        assert!((turn.return_amplitude / upper - 1.0).abs() < 0.01, "{turn:?} {upper}");
        // the first solution from above
        for point in mode.points.iter().filter(|point| point.amplitude > lower) {
            let above = closed.iter().rposition(|closed| closed[0] < point.amplitude).unwrap();
            let [[a, omega, damping], [b, omega_b, damping_b]] = [closed[above], closed[above + 1]];
            let share = (point.amplitude - a) / (b - a);
            let (omega, damping) = (omega + share * (omega_b - omega), damping + share * (damping_b - damping));
            assert!((point.omega / omega - 1.0).abs() < 1e-3, "{} {} {omega}", point.amplitude, point.omega);
            assert!((point.damping / damping - 1.0).abs() < 1e-3, "{} {} {damping}", point.amplitude, point.damping);
        }
    }

    /// A mass with rigid friction that falls with velocity does not vibrate if friction is
    /// thousands of times the spring force. The curve ends there after some hundred steps.
    #[test]
    fn an_overdamped_mode_ends() {
        let mut model = Model::default();
        let between = || ["m".to_owned(), GROUND.to_owned()];
        model.masses.push(Mass::new("m", 1.0));
        model.springs.push(Spring { between: between(), stiffness: 1e4, damping: 2.0 });
        let law = std::sync::Arc::new(Stribeck { limit: 1.0, static_limit: 1.5, velocity: 0.01 });
        model.joints.push(Joint { name: "j".into(), between: between(), law });
        let system = model.assemble().unwrap();
        let request = ModeRequest { mode: 0, range: (1e-9, 1e-2), points: 5, harmonics: 15, samples: 1024 };
        let mode = nonlinear_mode(&system, request).unwrap();
        let ended = mode.ended.unwrap();
        assert_eq!(ended.reason, ModeEndCause::Overdamped);
        // (4/π · 1 N) / (2 · 1e4 N/m · a) is a damping ratio of one at a = 0.06 mm
        assert!(ended.at < 6.4e-5 && mode.points.last().unwrap().damping < 0.1, "{ended:?}");
    }

    /// A mode equals the forced vibration under the forces `2 ζ ω M x'` with all their
    /// harmonics. The exact method, which is independent of modes, finds the mode's amplitudes
    /// and its energy loss `2 π ζ ω² Σ h² Xₕᴴ M Xₕ` under these forces. With positive damping
    /// its orbit is unique.
    #[test]
    fn a_mode_equals_the_forced_exact_orbit() {
        let mut couple = example::blade_couple();
        couple.joints[0].law = std::sync::Arc::new(Coulomb { limit: 8.0 });
        let system = couple.assemble().unwrap();
        let mut equations = ModeEquations::new(&system, 31, 1024).unwrap();
        let mut slipping = 0;
        for index in [0, 1] {
            let path = ModeCurve::follow(&mut equations, index, 1e-4, 2e-2);
            for amplitude in [2e-2, 8e-3, 1e-3, 3.5e-4] {
                let state = path.state_at(&mut equations, amplitude).unwrap();
                let n = system.dofs();
                let mut model = couple.clone();
                model.forces.clear();
                let mut inertia = 0.0;
                for (k, harmonic) in (1..=31u32).step_by(2).enumerate() {
                    let x = &state.x[k * n..(k + 1) * n];
                    let h = f64::from(harmonic);
                    for (i, place) in system.places().iter().enumerate() {
                        let moved = x[i] * system.structure().mass()[(i, i)];
                        inertia += h * h * (x[i].conj() * moved).re;
                        let force = moved * Complex64::new(0.0, 2.0 * state.damping * h * state.omega * state.omega);
                        let (amplitude, phase) = force.to_polar();
                        model.forces.push(Force { on: place.clone(), amplitude, phase, harmonic });
                    }
                }
                let forced = model.assemble().unwrap();
                let orbit = EventDriven.solver(&forced).unwrap().orbit(state.omega).unwrap();
                let lost = 2.0 * PI * state.damping * state.omega * state.omega * inertia;
                let found = orbit.energy.friction + orbit.energy.viscous;
                assert!((found / lost - 1.0).abs() < SERIES, "{index} {amplitude}: {found} J, {lost} J");
                let largest = state.x[..n].iter().fold(0.0, |m: f64, x| m.max(x.norm()));
                for (i, place) in orbit.places.iter().enumerate() {
                    let apart = (place.first_harmonic - state.x[i]).norm();
                    assert!(
                        apart < SERIES * largest,
                        "{index} {amplitude} {i}: {:?} {:?}",
                        place.first_harmonic,
                        state.x[i]
                    );
                }
                slipping += usize::from(orbit.energy.friction > 0.1 * orbit.energy.viscous);
            }
        }
        assert!(slipping >= 5, "{slipping}");
    }
}
