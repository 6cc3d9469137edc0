//! The summary in words, for a terminal.

use super::warnings::list_names;
use super::{JointSummary, ModelSummary, OrbitCount, ROUNDING_SLIP_FACTOR, relative_load};
use crate::syntax::format::{format_bytes, format_significant, format_with_prefix, plural_suffix};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::fmt;
use stickslip::model::{LinearModes, NaturalMode};

/// Largest number of listed modes and joints.
const MAX_LISTED: usize = 10;

impl ModelSummary {
    fn modes(&self, modes: &LinearModes) -> String {
        if self.too_large {
            let other = if self.is_tuned_disk { "; kind `nodal-diameter` computes them" } else { "" };
            return format!("not computed for {} degrees of freedom{other}", self.dofs);
        }
        let mut order: Vec<&NaturalMode> = modes.elastic.iter().collect();
        let count = order.len();
        if let Some((from, to)) = self.range.filter(|_| count > MAX_LISTED) {
            // the modes nearest to the range, by ascending frequency
            let distance = |omega: f64| if omega < from { from / omega } else { (omega / to).max(1.0) };
            order.sort_by(|a, b| distance(a.omega).total_cmp(&distance(b.omega)));
        }
        order.truncate(MAX_LISTED);
        order.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        let list = |read: &dyn Fn(&NaturalMode) -> String| order.iter().map(|m| read(m)).collect::<Vec<_>>().join(", ");
        let mut parts = Vec::new();
        if count > MAX_LISTED {
            let which = if self.range.is_some() { "nearest the range" } else { "lowest" };
            parts.push(format!("{count} modes, the {MAX_LISTED} {which}:"));
        }
        if count == 0 {
            parts.push("no mode".to_owned());
        } else {
            // without damping the ratio is a multiple of rounding
            let percent = |m: &&NaturalMode| if m.damping.abs() < 1e-12 { 0.0 } else { 100.0 * m.damping };
            let damping: Vec<String> = order.iter().map(|m| format_significant(percent(m), 2)).collect();
            let damping = match damping.iter().all(|d| *d == damping[0]) {
                true => damping[0].clone(),
                false => damping.join(", "),
            };
            parts.push(format!("{} Hz, damping ratio {damping} %", list(&|m| format_significant(m.omega / TAU, 5))));
        }
        let mut text = parts.join(" ");
        if modes.rigid > 0 {
            text += &format!("; {} rigid-body mode{}", modes.rigid, plural_suffix(modes.rigid));
        }
        if modes.unresolved > 0 {
            text += &format!(
                "; {} frequenc{} not resolved in floating point, because other stiffnesses are much higher",
                modes.unresolved,
                if modes.unresolved == 1 { "y" } else { "ies" }
            );
        }
        text
    }

    /// Describes the directions in which friction alone holds a body, if there are any.
    fn friction_text(&self) -> Option<String> {
        let first = self.held_by_friction.first()?;
        let names: Vec<String> = self.held_by_friction.iter().map(|one| one.place.clone()).collect();
        let spring = self.range.map_or_else(String::new, |(_, highest)| {
            let stiffness = format_with_prefix(first.spring(highest), first.spring_unit());
            format!(" ({stiffness} on `{}` is a tenth of its inertia)", first.place)
        });
        Some(format!(
            "alone holds {}, so that the body may drift; if no orbit is found, support it as the real part is supported, \
             or by a soft spring{spring}",
            list_names(&names)
        ))
    }

    fn joint(&self, joint: &JointSummary) -> String {
        // Largest number of listed frequency ranges with slip per joint.
        let max_slip_ranges = 3;
        match joint.normal_force {
            Some(0.0) => return "open in static equilibrium; the vibration may close it".to_owned(),
            Some(preload) => return normal_force_text(preload, joint.normal_force_at_rest),
            None => {}
        }
        if joint.limit == 0.0 {
            return "free: no slip limit and no force in static equilibrium".to_owned();
        }
        if joint.limit.is_infinite() {
            return "acts as a spring, never slips".to_owned();
        }
        let (force, length) = if self.is_torsional { ("N m", "rad") } else { ("N", "m") };
        let (limit, slip) =
            (format_with_prefix(joint.limit, force), if joint.micro_slip { "macro-slip" } else { "slip" });
        let mut text = match joint.displacement {
            Some(displacement) => {
                let verb = if joint.micro_slip { "macro-slip at" } else { "slips at" };
                let before = if joint.micro_slip { ", micro-slip before" } else { "" };
                format!("{verb} {limit}, {} of relative displacement{before}", format_with_prefix(displacement, length))
            }
            None => format!("slips at {limit}, rigid until then"),
        };
        let Some(onset) = &joint.onset else { return text };
        let several = self.range.is_some_and(|(from, to)| from < to);
        let hertz = |omega: f64| format_significant(omega / TAU, 7);
        let at = if several { format!(" at {} Hz", hertz(onset.omega)) } else { String::new() };
        if !onset.largest.is_finite() {
            return text + "; the imposed motion makes it slip";
        }
        let factor = format_significant(1.0 / onset.largest, 3);
        let resonant = onset.largest > ROUNDING_SLIP_FACTOR;
        // the loads are those with all joints stuck; slip of another joint changes them
        let slips = |joint: &JointSummary| joint.onset.as_ref().is_some_and(|onset| !onset.slip_ranges.is_empty());
        let another_slips = self.joints.iter().any(|other| other.name != joint.name && slips(other));
        let sticks = if another_slips { "sticks while the other joints stick" } else { "sticks" };
        if onset.largest == 0.0 {
            text += "; the excitation does not reach it";
        } else if relative_load(onset) == 0.0 {
            let always = if another_slips { "" } else { ", even under a million times the excitation" };
            text += &format!("; {sticks}{always}");
        } else if onset.slip_ranges.is_empty() && joint.micro_slip {
            let share = format_significant(100.0 * onset.largest, 3);
            text += &format!("; only micro-slip, up to {share} % of the slip limit{at}");
        } else if onset.slip_ranges.is_empty() {
            text += &format!("; {sticks}; {factor} times the excitation would make it slip{at}");
        } else if several {
            let mut ranges: Vec<String> = onset
                .slip_ranges
                .iter()
                .take(max_slip_ranges)
                .map(|(a, b)| format!("{} to {} Hz", hertz(*a), hertz(*b)))
                .collect();
            if let Some(more @ 1..) = onset.slip_ranges.len().checked_sub(max_slip_ranges) {
                ranges.push(format!("{more} more"));
            }
            let ranges = ranges.join(", ");
            text += &match resonant {
                true => {
                    format!("; {slip} at {ranges}; any excitation makes it slip at its undamped resonance{at}")
                }
                false => format!("; {slip} at {ranges}; {factor} times the excitation makes it slip{at}"),
            };
        } else {
            text += &format!("; {slip} occurs; {factor} times the excitation makes it slip");
        }
        text
    }
}

/// Returns a line of the summary.
pub(crate) fn line(name: &str, text: &str) -> String {
    // Width of the first column.
    format!("  {name:<14} {text}\n")
}

/// Returns the joint of a direction.
pub(super) fn joint_of_direction(name: &str) -> &str {
    name.split('.').next().unwrap_or(name)
}

/// Rounds a load to the significant digits, so that joints that are equal by symmetry keep
/// their order.
fn rounded_load(load: f64) -> f64 {
    format!("{load:.4e}").parse().unwrap_or(load)
}

/// Describes the normal load at rest that a preload produces.
fn normal_force_text(preload: f64, at_rest: Option<f64>) -> String {
    let newtons = |force: f64| format_with_prefix(force, "N");
    match at_rest {
        None => {
            format!("pressed with {} if the structure is rigid; a larger dynamic force opens it", newtons(preload))
        }
        // Relative change of a preload by the structure below which it is ignored.
        Some(force) if (force - preload).abs() <= 1e-3 * preload => {
            format!("pressed with {} in static equilibrium; a larger dynamic force opens it", newtons(force))
        }
        Some(force) if force > preload => format!(
            "pressed with {} in static equilibrium, by its preload of {} and {} of the constant forces; a larger \
             dynamic force opens it",
            newtons(force),
            newtons(preload),
            newtons(force - preload)
        ),
        Some(force) if force > 0.0 => format!(
            "pressed with {} in static equilibrium (the structure carries {} of its preload of {}); a larger dynamic \
             force opens it",
            newtons(force),
            newtons(preload - force),
            newtons(preload)
        ),
        Some(_) => format!(
            "open in static equilibrium, because the structure carries its preload of {}; the vibration may close it",
            newtons(preload)
        ),
    }
}

impl fmt::Display for ModelSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // each direction of a joint has a line
        let names: BTreeSet<&str> = self.joints.iter().map(|joint| joint_of_direction(&joint.name)).collect();
        let joints = names.len();
        let dofs =
            if self.dofs == 1 { "1 degree of freedom".to_owned() } else { format!("{} degrees of freedom", self.dofs) };
        let shown = if self.case.is_empty() { String::new() } else { format!(", shown for {}", self.case) };
        let mut line = |name: &str, text: &str| f.write_str(&line(name, text));
        line("model", &format!("{dofs}, {joints} joint{}{shown}", plural_suffix(joints)))?;
        for (name, text) in self.structure.iter().flat_map(|structure| structure.lines()) {
            line(name, &text)?;
        }
        for (number, contact) in self.contacts.iter().enumerate() {
            line(if number == 0 { "contacts" } else { "" }, &contact.text())?;
        }
        for (number, body) in self.bodies.iter().enumerate() {
            line(if number == 0 { "bodies" } else { "" }, body)?;
        }
        if let Some(text) = self.friction_text() {
            line("friction", &text)?;
        }
        if self.dofs > 0 {
            line(if joints > 0 { "joints free" } else { "modes" }, &self.modes(&self.free))?;
            if joints > 0 {
                line("joints stuck", &self.modes(&self.stuck))?;
            }
        }
        // with many joints, those with the largest load come first, each with all its
        // directions
        let mut order: Vec<&JointSummary> = self.joints.iter().collect();
        let lines = self.joints.len();
        if lines > MAX_LISTED {
            let mut loads: BTreeMap<&str, f64> = BTreeMap::new();
            for joint in &self.joints {
                let load = joint.onset.as_ref().map_or(0.0, relative_load);
                let most = loads.entry(joint_of_direction(&joint.name)).or_default();
                *most = most.max(rounded_load(load));
            }
            order.sort_by(|a, b| loads[joint_of_direction(&b.name)].total_cmp(&loads[joint_of_direction(&a.name)]));
        }
        for joint in order.iter().take(MAX_LISTED) {
            line(&joint.name, &self.joint(joint))?;
        }
        if let Some(more @ 1..) = lines.checked_sub(MAX_LISTED) {
            line("", &format!("and {more} more"))?;
        }
        match &self.orbits {
            Some(OrbitCount::One) => {
                line("orbits", "one at each point; only the offset of a permanently stuck contact is not unique")?
            }
            Some(OrbitCount::Several { reasons, reverse_sweep }) => {
                let what = "the table states the stability of each orbit if it is known; kind `branch` follows \
                    connected orbits if it supports the laws";
                let lacks = match reverse_sweep {
                    true => "",
                    false => "; the model is too large for the reverse sweep of `response`, which finds other orbits",
                };
                line("orbits", &format!("several may exist at one frequency ({reasons}): {what}{lacks}"))?;
            }
            None => {}
        }
        let Self { size, cases, .. } = self;
        let rows = format!("{} row{}", size.rows, if size.rows == 1 { "" } else { "s" });
        let cases = format!("{cases} case{}", plural_suffix(*cases));
        let without = if self.structure.is_some() { " without the matrices" } else { "" };
        let results = format!(
            "{cases}, {rows}, {} of tables, {} of memory{without}",
            format_bytes(size.results),
            format_bytes(size.memory)
        );
        line("results", &results)
    }
}
