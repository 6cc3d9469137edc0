//! Warnings about likely mistakes in a study. Each study kind selects those that concern it.

use crate::case::values::{Frequencies, Values};
use crate::check::survey::{SurveyedCase, frequency_range};
use crate::syntax::format::{format_significant, format_with_prefix};
use crate::syntax::key::MAX_POINTS;
use std::f64::consts::TAU;
use stickslip::curve::modes::unit_amplitude;
use stickslip::model::{CyclicSymmetry, LinearModes, NaturalMode};

/// Warnings of a kind that needs an excitation.
pub(crate) fn excitation_warnings(cases: &[SurveyedCase]) -> Vec<String> {
    no_excitation(cases, InitialStates::Ignored).into_iter().collect()
}

/// Warnings of a kind that needs an excitation or an initial state.
pub(crate) fn motion_warnings(cases: &[SurveyedCase]) -> Vec<String> {
    no_excitation(cases, InitialStates::Counted).into_iter().collect()
}

/// Warnings of a kind that looks for resonances in a range of frequencies.
pub(crate) fn resonance_warnings(cases: &[SurveyedCase]) -> Vec<String> {
    no_excitation(cases, InitialStates::Ignored).into_iter().chain(no_resonance(cases)).collect()
}

/// Warnings of a kind with given frequencies: those of [`resonance_warnings`], and frequencies
/// too far apart for a resonance.
pub(crate) fn sampling_warnings(cases: &[SurveyedCase]) -> Vec<String> {
    resonance_warnings(cases).into_iter().chain(coarse_frequencies(cases)).collect()
}

/// Tells if an initial state or a constant load counts as an excitation.
#[derive(Clone, Copy, PartialEq, Eq)]
enum InitialStates {
    Ignored,
    Counted,
}

fn no_excitation(cases: &[SurveyedCase], initial_states: InitialStates) -> Option<String> {
    if cases.iter().any(|one| !one.survey.harmonics().is_empty() || one.case.records > 0) {
        return None;
    }
    let starts = |values: &Values| {
        ["start", "start_velocity"]
            .iter()
            .filter_map(|key| values.by_name(key))
            .any(|table| table.values().any(|v| *v != 0.0))
    };
    let constant = |one: &SurveyedCase| {
        let model = &one.case.model;
        model.forces.iter().any(|force| force.amplitude != 0.0) || model.motions.iter().any(|m| m.amplitude != 0.0)
    };
    if initial_states == InitialStates::Counted && cases.iter().any(|one| starts(&one.case.values) || constant(one)) {
        return None;
    }
    Some(if cases.iter().any(constant) {
        "all forces and motions are constant in time, so nothing vibrates; give one of them `harmonic = 1`".to_owned()
    } else {
        "all forces and motions are zero, so nothing vibrates; add a [[force]] or a [[motion]]".to_owned()
    })
}

/// Warns of a resonance within the range that only the joints damp. Kinds that search for the
/// best joint compare peaks; for them an undamped structure is a textbook case.
pub(crate) fn undamped_resonance(cases: &[SurveyedCase]) -> Option<String> {
    let found = |one: &SurveyedCase| {
        let (from, to) = frequency_range(&one.case)?;
        one.survey.undamped_resonances(from, to).first().copied()
    };
    // the warning must be true for every case
    let all = cases.iter().map(found).collect::<Option<Vec<f64>>>()?;
    let hertz = format_significant(all.first()? / TAU, 6);
    let advice = match &cases[0].case.model.substructure {
        Some(_) => "add modal_damping = \"0.5 %\" to [structure]",
        None => "add `damping` or damping_ratio = \"0.5 %\" to a spring",
    };
    Some(match cases[0].survey.system().joints().is_empty() {
        true => format!("the resonance at {hertz} Hz is undamped: the response has no bound there; {advice}"),
        false => format!(
            "only the joints damp the resonance at {hertz} Hz: the response has no bound if friction does not limit \
             it; {advice}"
        ),
    })
}

fn no_resonance(cases: &[SurveyedCase]) -> Option<String> {
    let (from, to) = frequency_range(&cases[0].case).filter(|(from, to)| from < to)?;
    let mut nearest: Option<(f64, f64, &str)> = None;
    for one in cases {
        let harmonics = one.survey.harmonics();
        if harmonics.is_empty() {
            return None; // `no_excitation` reports this
        }
        let (free, stuck) = (one.survey.free(), one.survey.stuck());
        if one.survey.is_too_large() || free.unresolved + stuck.unresolved > 0 {
            return None; // the modes are unknown
        }
        if one.survey.system().joints().iter().any(|joint| joint.law().force_scale().is_infinite()) {
            return None; // a force without a bound shifts resonances beyond those of small motion
        }
        // friction puts the resonance between the frequencies of a mode with the joint free and
        // stuck
        let between = paired(free, stuck).into_iter().map(|(a, b)| (a.omega.min(b.omega), a.omega.max(b.omega)));
        let single =
            |modes: &LinearModes| modes.elastic.iter().map(|mode| (mode.omega, mode.omega)).collect::<Vec<_>>();
        let intervals: Vec<(f64, f64)> = between.chain(single(free)).chain(single(stuck)).collect();
        for h in harmonics.iter().map(|h| f64::from(*h)) {
            if intervals.iter().any(|(a, b)| a / h <= to && b / h >= from) {
                return None;
            }
            for (modes, name) in [(free, "free"), (stuck, "stuck")] {
                for omega in modes.elastic.iter().map(|mode| mode.omega / h) {
                    let distance = if omega < from { from / omega } else { omega / to };
                    if nearest.is_none_or(|(least, _, _)| distance < least) {
                        nearest = Some((distance, omega, name));
                    }
                }
            }
        }
    }
    let hertz = |omega: f64| format_significant(omega / TAU, 6);
    // A model without any frequency has no mass, or no spring holds it, which another warning
    // reports.
    let (_, omega, name) = nearest?;
    let (from, to, omega) = (hertz(from), hertz(to), hertz(omega));
    Some(format!(
        "no resonance lies between {from} and {to} Hz: the nearest one, with all joints {name}, is at {omega} Hz"
    ))
}

/// A resonance of the linear structure that is narrower than the steps of a range of
/// frequencies.
struct NarrowResonance {
    /// Excitation frequency and width of the resonance, rad/s.
    frequency: f64,
    width: f64,
    /// Number of points of the range whose steps are no wider.
    points: f64,
}

/// Warns of frequencies that lie further apart than the width of a resonance.
///
/// The width is that at half power, twice damping times frequency, with joints free or stuck,
/// the larger one. Friction only adds to it.
fn coarse_frequencies(cases: &[SurveyedCase]) -> Option<String> {
    let Some(Frequencies::Range { points, .. }) = cases[0].case.frequencies else { return None };
    // the warning must be true for every case
    let narrow = cases.iter().map(narrowest).collect::<Option<Vec<NarrowResonance>>>()?;
    // modes by nodal diameter take time, so they are only computed if there is a warning
    // without them
    let narrow = match cases.iter().any(|one| one.case.model.ring.is_some_and(|ring| ring.order.is_some())) {
        true => cases.iter().map(narrowest_in_wave).collect::<Option<Vec<NarrowResonance>>>()?,
        false => narrow,
    };
    let NarrowResonance { frequency: at, width, points: enough } =
        narrow.into_iter().max_by(|a, b| a.points.total_cmp(&b.points))?;
    let (from, to) = frequency_range(&cases[0].case)?;
    let hertz = |omega: f64, digits: i32| format_significant(omega / TAU, digits);
    let step = (to - from) / (points - 1) as f64;
    let several = if enough <= MAX_POINTS as f64 {
        format!("with {enough} points the steps are no wider than it")
    } else {
        "use a narrower range".to_owned()
    };
    Some(format!(
        "the frequencies are {} Hz apart, but the resonance at {} Hz is only {} Hz wide without friction: the curve \
         may miss it; {several}",
        hertz(step, 2),
        hertz(at, 5),
        hertz(width, 2)
    ))
}

/// Returns the narrowest resonance in the range of a case, if it is narrower than the step of
/// the frequencies.
fn narrowest(one: &SurveyedCase) -> Option<NarrowResonance> {
    let Some(Frequencies::Range { from, to, points }) = one.case.frequencies else { return None };
    let (free, stuck) = (one.survey.free(), one.survey.stuck());
    if one.survey.is_too_large() || free.unresolved + stuck.unresolved > 0 {
        return None; // the modes are unknown
    }
    let all = one.survey.harmonics().into_iter().flat_map(|harmonic| resonances(free, stuck, harmonic));
    narrowest_of(all, from, to, points)
}

/// Like [`narrowest`], for a tuned disk in a travelling wave. Each harmonic of the excitation
/// meets the modes of one nodal diameter.
fn narrowest_in_wave(one: &SurveyedCase) -> Option<NarrowResonance> {
    let Some(Frequencies::Range { from, to, points }) = one.case.frequencies else { return None };
    let ring = one.case.model.ring.filter(|ring| ring.equal);
    let Some((sectors, order)) = ring.and_then(|ring| Some((ring.sectors, ring.order?))) else {
        return narrowest(one);
    };
    let harmonics = one.survey.harmonics();
    let highest = to * f64::from(*harmonics.last()?);
    let below = |modes: &LinearModes| modes.elastic.iter().filter(|mode| mode.omega <= highest).count();
    let most = below(one.survey.free()).max(below(one.survey.stuck()));
    let Some(waves) = one.case.model.wave_modes_of(one.survey.system(), most) else { return narrowest(one) };
    let met = |harmonic: u32| {
        let turns = CyclicSymmetry { sectors, order }.diameter(harmonic as usize);
        waves.iter().find(|wave| wave.diameter == turns.min(sectors - turns))
    };
    let resonances_of = |harmonic: u32| met(harmonic).map(|wave| resonances(&wave.free, &wave.stuck, harmonic));
    narrowest_of(harmonics.iter().filter_map(|harmonic| resonances_of(*harmonic)).flatten(), from, to, points)
}

/// Returns the excitation frequencies at which a harmonic meets each mode: the lower and the
/// higher one (joints free and stuck), and the width, rad/s.
fn resonances(free: &LinearModes, stuck: &LinearModes, harmonic: u32) -> Vec<(f64, f64, f64)> {
    let width = |mode: &NaturalMode| 2.0 * mode.damping * mode.omega;
    let h = f64::from(harmonic);
    let between = |(free, stuck): (&NaturalMode, &NaturalMode)| {
        let width = width(free).max(width(stuck));
        (free.omega.min(stuck.omega) / h, free.omega.max(stuck.omega) / h, width / h)
    };
    paired(free, stuck).into_iter().map(between).collect()
}

/// Pairs the modes with joints free and stuck, both by ascending frequency.
///
/// A body that is held by joints alone moves freely without them and has a mode with them. This
/// mode is the lowest one for a heavy body and a high one for a light damper, so as many of the
/// lowest stuck modes stay without a partner as give the smallest shifts of frequency.
fn paired<'a>(free: &'a LinearModes, stuck: &'a LinearModes) -> Vec<(&'a NaturalMode, &'a NaturalMode)> {
    let pairs = |skipped: usize| free.elastic.iter().zip(stuck.elastic.iter().skip(skipped));
    let shift = |skipped: usize| pairs(skipped).map(|(a, b)| (b.omega / a.omega).ln().abs()).sum::<f64>();
    let most = free.rigid.saturating_sub(stuck.rigid);
    let best = (0..=most).rev().min_by(|a, b| shift(*a).total_cmp(&shift(*b)));
    pairs(best.unwrap_or(0)).collect()
}

/// Returns the narrowest resonance within a range of frequencies, if it is narrower than their
/// step.
fn narrowest_of(
    all: impl Iterator<Item = (f64, f64, f64)>,
    from: f64,
    to: f64,
    points: usize,
) -> Option<NarrowResonance> {
    // without damping there is no width; where friction bounds the motion, friction determines
    // it
    let inside = all.filter(|(low, high, width)| *low >= from && *high <= to && *width > 0.0);
    let (at, _, width) = inside.min_by(|a, b| a.2.total_cmp(&b.2))?;
    ((to - from) / (points - 1) as f64 > width).then(|| NarrowResonance {
        frequency: at,
        width,
        points: ((to - from) / width).ceil() + 1.0,
    })
}

/// Warnings of a nonlinear mode: its amplitudes end before any joint slips.
pub(crate) fn mode_warnings(cases: &[SurveyedCase]) -> Vec<String> {
    no_slip_warning(cases).into_iter().collect()
}

fn no_slip_warning(cases: &[SurveyedCase]) -> Option<String> {
    let mut needed = f64::INFINITY;
    let mut asked = 0.0;
    for one in cases {
        let values = &one.case.values;
        let number = values.count("mode").unwrap_or(1) as usize - 1;
        let to = values.table("amplitude")?.quantity("to")?;
        // the range is that of the place with the largest motion in the mode without joints
        let slip = one.survey.slip_amplitude(number)? / unit_amplitude(one.survey.system(), number).ok()??;
        // Fraction of the first slip below which a range of amplitudes shows a linear mode only.
        if slip * 0.99 <= to {
            return None;
        }
        if slip < needed {
            (needed, asked) = (slip, to);
        }
    }
    // Amplitude, relative to the requested ones and to 1 m, above which the first slip is due to
    // rounding. A mode of a symmetric structure that does not move its joints still loads them by
    // the rounding errors of its shape.
    if needed > 1e6 * asked.max(1.0) {
        // a mode that does not rub may open its contacts
        if cases.iter().any(|one| one.case.model.joints.iter().any(|joint| joint.law.has_faces())) {
            return None;
        }
        return Some("no joint slips in this mode at any amplitude: its motion does not load the joints".to_owned());
    }
    Some(format!(
        "no joint slips in this mode: the amplitudes end at {}, and the first slip is at about {}; raise `to` of \
         `amplitude`",
        format_with_prefix(asked, "m"),
        format_with_prefix(needed, "m")
    ))
}
