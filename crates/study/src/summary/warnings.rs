//! What looks like a mistake and is none to the reader: sentences that begin with `warning: `.

use super::text::{quantity, significant};
use super::{Surveyed, range};
use crate::expression::displayed;
use crate::statement::{Environment, Quantity, Stated, StatedTable};
use crate::study::{Structure, Study, evaluate};
use crate::values::Values;
use std::collections::{BTreeSet, HashMap};
use std::f64::consts::{PI, TAU};
use stickslip::dimension::Dimension;
use stickslip::model::Modes;

/// How a note begins that is a warning.
pub(crate) const WARNING: &str = "warning: ";

/// Names that a warning lists; of more it gives the number.
const NAMED: usize = 6;

pub(super) fn all(study: &Study, cases: &[Surveyed]) -> Vec<String> {
    let mut warnings = (study.kind().warnings)(cases);
    warnings.extend(loose(cases));
    warnings.extend(unused(study, &cases[0]));
    warnings.extend(bare_angles(study));
    warnings.into_iter().map(|text| format!("{WARNING}{text}")).collect()
}

/// Names in a sentence: `a, b and 3 more`.
fn listed(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(NAMED).map(|name| format!("`{name}`")).collect();
    match names.len().checked_sub(NAMED) {
        None | Some(0) => shown.join(", "),
        Some(more) => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Of a kind that needs something to drive the motion.
pub(crate) fn driven(cases: &[Surveyed]) -> Vec<String> {
    no_excitation(cases, false).into_iter().collect()
}

/// Of a kind that needs something to set the structure in motion: a drive, or a state to start from.
pub(crate) fn moved(cases: &[Surveyed]) -> Vec<String> {
    no_excitation(cases, true).into_iter().collect()
}

/// Of a kind that looks for resonances in a range of frequencies.
pub(crate) fn resonant(cases: &[Surveyed]) -> Vec<String> {
    no_excitation(cases, false).into_iter().chain(no_resonance(cases)).collect()
}

fn no_excitation(cases: &[Surveyed], starts_count: bool) -> Option<String> {
    if cases.iter().any(|one| !one.survey.harmonics().is_empty()) {
        return None;
    }
    let starts = |values: &Values| {
        ["start", "start_velocity"]
            .iter()
            .filter_map(|key| values.by_name(key))
            .any(|table| table.values().any(|v| *v != 0.0))
    };
    let constant = |one: &Surveyed| {
        let model = &one.case.model;
        model.forces.iter().any(|force| force.amplitude != 0.0) || model.motions.iter().any(|m| m.amplitude != 0.0)
    };
    if starts_count && cases.iter().any(|one| starts(&one.case.values) || constant(one)) {
        return None;
    }
    Some(if cases.iter().any(constant) {
        "every force and motion is constant in time: nothing vibrates".to_owned()
    } else {
        "there is no force and no motion that is not zero: nothing vibrates; add a [[force]] or a [[motion]]".to_owned()
    })
}

fn loose(cases: &[Surveyed]) -> Vec<String> {
    let one = |one: &stickslip::model::Loose| {
        let (names, them) = (listed(&one.masses), if one.masses.len() == 1 { "it" } else { "them" });
        if one.held_by_friction {
            format!(
                "no spring holds {names}: friction alone keeps {them} in place, and once all joints slip nothing does"
            )
        } else {
            format!("nothing holds {names}: no spring and no joint ties {them} to `ground`")
        }
    };
    cases[0].survey.loose().iter().take(NAMED).map(one).collect()
}

fn unused(study: &Study, first: &Surveyed) -> Option<String> {
    let used = used_parameters(study, first);
    let from_template = |index: usize| {
        let source = study.parameters[index].quantity.place.source;
        study.sources.get(source).is_some_and(|source| source.name.starts_with("template parameter"))
    };
    let varied: BTreeSet<usize> = study.varied.iter().map(|varied| varied.index).collect();
    let idle = (0..study.names.len()).filter(|i| !used.contains(i) && (varied.contains(i) || !from_template(*i)));
    let (idle_varied, idle): (Vec<usize>, Vec<usize>) = idle.partition(|index| varied.contains(index));
    let names = |indices: &[usize]| listed(&indices.iter().map(|i| study.names[*i].clone()).collect::<Vec<_>>());
    match (idle_varied.is_empty(), idle.is_empty()) {
        (true, true) => None,
        (true, false) => Some(format!("no value of the study uses the parameter {}", names(&idle))),
        (false, _) => {
            let all: Vec<usize> = idle_varied.iter().chain(&idle).copied().collect();
            let varied = names(&idle_varied);
            let others = if idle.is_empty() { String::new() } else { format!("; unused are {}", names(&all)) };
            Some(format!(
                "`vary` changes {varied}, which no value of the study uses: all its cases are the same{others}"
            ))
        }
    }
}

/// The parameters that a value of the model, of the study or of the method depends on.
fn used_parameters(study: &Study, first: &Surveyed) -> BTreeSet<usize> {
    let mut open: Vec<usize> = Vec::new();
    let mut from = |table: &StatedTable| {
        each_quantity(table, &mut |_, quantity, _| open.extend(quantity.expression.parameters()));
    };
    from(&study.study);
    from(&study.method);
    match &study.structure {
        Structure::Lists(lists) => {
            for list in [&lists.mass, &lists.spring, &lists.joint, &lists.force, &lists.motion] {
                list.iter().for_each(&mut from);
            }
        }
        Structure::Template(row, table) => {
            from(table);
            // a parameter of a template is used if the model changes with it; a law that is replaced takes its
            // parameters away
            let replaced = table.entry("law").and(first.case.model.joints.first()).map(|joint| joint.law.clone());
            let values: Vec<(&str, f64)> =
                row.parameters.iter().filter_map(|p| Some((p.key, first.case.parameters.get(p.key)?.0))).collect();
            let model = |values: &[(&str, f64)]| {
                let mut model = row.model_with(values).unwrap_or_default();
                for joint in &mut model.joints {
                    joint.law = replaced.clone().unwrap_or_else(|| joint.law.clone());
                }
                model
            };
            let before = model(&values);
            for index in 0..values.len() {
                let mut other = values.clone();
                other[index].1 = 1.5 * other[index].1 + 1.0;
                if model(&other) != before {
                    open.extend(study.names.iter().position(|name| name == other[index].0));
                }
            }
        }
    }
    let mut used = BTreeSet::new();
    while let Some(index) = open.pop() {
        if used.insert(index) {
            open.extend(study.parameters[index].quantity.expression.parameters());
            let varied = study.varied.iter().filter(|varied| varied.index == index);
            open.extend(varied.flat_map(|v| v.points.quantities()).flat_map(|q| q.expression.parameters()));
        }
    }
    used
}

/// Calls `each` with the key, the quantity and its dimension (where the schema tells it) of every quantity in a table.
fn each_quantity(table: &StatedTable, each: &mut dyn FnMut(&'static str, &Quantity, Option<Dimension>)) {
    for entry in &table.entries {
        match &entry.value {
            Stated::Fixed(_) | Stated::Names(_) => {}
            Stated::Quantity { quantity, dimension, .. } => each(entry.key, quantity, Some(*dimension)),
            Stated::List(list) => list.iter().for_each(|q| each(entry.key, q, Some(Dimension::FREQUENCY))),
            Stated::Range { from, to, .. } => {
                each(entry.key, from, None);
                each(entry.key, to, None);
            }
            Stated::Adaptive { from, to, tolerance } => {
                each(entry.key, from, None);
                each(entry.key, to, None);
                each(entry.key, tolerance, Some(Dimension::NONE));
            }
            Stated::ByName(list, dimension) => list.iter().for_each(|(_, _, q)| each(entry.key, q, Some(*dimension))),
            Stated::Law(_, table) | Stated::Table(table) => each_quantity(table, each),
        }
    }
}

fn no_resonance(cases: &[Surveyed]) -> Option<String> {
    let (from, to) = range(&cases[0].case).filter(|(from, to)| from < to)?;
    let mut nearest: Option<(f64, f64, &str)> = None;
    for one in cases {
        let harmonics = one.survey.harmonics();
        if harmonics.is_empty() {
            return None; // that is said elsewhere
        }
        let (free, stuck) = (one.survey.free(), one.survey.stuck());
        if one.survey.is_too_large() || free.lost + stuck.lost > 0 {
            return None; // not known
        }
        // friction puts the resonance between the free frequency of a mode and its stuck one
        let between = free.elastic.iter().zip(stuck.elastic.iter().skip(free.rigid.saturating_sub(stuck.rigid)));
        let between = between.map(|(a, b)| (a.omega.min(b.omega), a.omega.max(b.omega)));
        let single = |modes: &Modes| modes.elastic.iter().map(|mode| (mode.omega, mode.omega)).collect::<Vec<_>>();
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
    let hertz = |omega: f64| significant(omega / TAU, 6);
    // a model without any is one that no spring holds, which is said elsewhere, or has no mass
    let (_, omega, name) = nearest?;
    let (from, to, omega) = (hertz(from), hertz(to), hertz(omega));
    Some(format!("no resonance lies between {from} and {to} Hz: the nearest is at {omega} Hz with all joints {name}"))
}

/// Bare numbers as angles: they count as radians, as bare frequencies count as Hz.
fn bare_angles(study: &Study) -> Vec<String> {
    let choice: HashMap<_, _> = study.varied.iter().map(|varied| (varied.index, (varied, 0))).collect();
    let Ok(values) = evaluate(&study.names, &study.parameters, &study.order, &choice, None) else { return Vec::new() };
    let environment = Environment { names: &study.names, values };
    let mut found: Vec<(String, String, usize)> = Vec::new();
    let Structure::Lists(lists) = &study.structure else { return Vec::new() };
    for (list, tables) in [("force", &lists.force), ("motion", &lists.motion)] {
        for (index, table) in tables.iter().enumerate() {
            each_quantity(table, &mut |key, quantity, dimension| {
                let Ok(value) = quantity.value(key, &environment) else { return };
                let bare = dimension == Some(Dimension::ANGLE) && value.dimension.is_none();
                // what was computed with pi is meant in radians
                if !bare || value.si == 0.0 || value.with_pi {
                    return;
                }
                let text = quantity.text.trim();
                match found.iter_mut().find(|(known, _, _)| known == text) {
                    Some((_, _, more)) => *more += 1,
                    None => {
                        let degrees = significant(value.si * 180.0 / PI, 4);
                        let number = displayed(value.si, None);
                        let sentence = format!(
                            "`{key}` of {list} {} is the bare number {number}, which counts as radians ({degrees} deg); say the unit: \
                             \"{number} deg\" or \"{number} rad\"",
                            index + 1
                        );
                        found.push((text.to_owned(), sentence, 0));
                    }
                }
            });
        }
    }
    let sentence = |(_, sentence, more): (String, String, usize)| match more {
        0 => sentence,
        more => format!("{sentence}; {more} more like it"),
    };
    found.into_iter().take(NAMED).map(sentence).collect()
}

/// A range of amplitudes that ends below this share of the first slip shows a linear mode only.
const STICKS: f64 = 0.99;

/// Of a nonlinear mode whose amplitudes end before any joint slips.
pub(crate) fn mode_sticks(cases: &[Surveyed]) -> Vec<String> {
    sticks(cases).into_iter().collect()
}

fn sticks(cases: &[Surveyed]) -> Option<String> {
    let mut needed = f64::INFINITY;
    let mut asked = 0.0;
    for one in cases {
        let values = &one.case.values;
        let number = values.count("mode").unwrap_or(1) as usize - 1;
        let to = values.table("amplitude")?.quantity("to")?;
        // the range is of the place that moves most in the mode of the structure without its joints
        let unit = one.survey.system().structure().modal_unit(number);
        let slip = one.survey.slip_amplitude(number)? / unit;
        if !(unit > 0.0 && slip * STICKS > to) {
            return None;
        }
        if slip < needed {
            (needed, asked) = (slip, to);
        }
    }
    Some(format!(
        "no joint slips in this mode: the amplitudes end at {}, and the first slip is at about {}",
        quantity(asked, "m"),
        quantity(needed, "m")
    ))
}
