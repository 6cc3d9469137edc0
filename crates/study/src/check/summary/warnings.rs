//! Warnings about valid studies that look like mistakes: sentences that begin with `warning: `.

use crate::case::linear_reference::LinearReference;
use crate::case::study::{Study, evaluate};
use crate::check::summary::mesh_fit::mesh_misfit;
use crate::check::summary::structure::mass_along;
use crate::check::summary::text::joint_of_direction;
use crate::check::survey::SurveyedCase;
use crate::compile::compiled::Environment;
use crate::results::notes::WARNING;
use crate::syntax::expression::quantity_text;
use crate::syntax::format::format_significant;
use crate::syntax::key::DAMPING_RATIO;
use std::collections::{BTreeSet, HashMap};
use std::f64::consts::{PI, TAU};
use stickslip::dimension::Dimension;
use stickslip::model::{Axis, FirstSlip, LinearModes, LooseBody, SystemJoint, TRANSLATIONS};
use stickslip::structure::ReducedComponent;

/// Largest number of names that a warning lists; for more it states the number.
const MAX_NAMED: usize = 6;

/// Returns all warnings: those of the kind, and those of every study.
pub(super) fn all(study: &Study, of_kind: Vec<String>, cases: &[SurveyedCase]) -> Vec<String> {
    let mut warnings = of_kind;
    warnings.extend(loose_parts(cases));
    warnings.extend(motionless_joints(&cases[0]));
    warnings.extend(massless(&cases[0]));
    warnings.extend(overstiff(&cases[0]));
    warnings.extend(structure(&cases[0]));
    let component = cases[0].case.model.substructure.as_ref().map(|substructure| &substructure.component);
    warnings.extend(component.zip(study.structure.mesh.source.as_ref()).and_then(|(own, mesh)| mesh_misfit(own, mesh)));
    warnings.extend(unused(study));
    warnings.extend(mistuned_without_effect(study));
    warnings.extend(ineffective_options(study, &cases[0]));
    if let Some(environment) = first_values(study) {
        warnings.extend(bare_numbers(study, &environment));
        warnings.extend(bare_angles(study, &environment));
        warnings.extend(large_damping_ratios(study, &environment));
    }
    warnings.extend(no_references(study, cases));
    warnings.into_iter().map(|text| format!("{WARNING}{text}")).collect()
}

/// Warns of options of [method] that a kind without a method states in its own table.
fn ineffective_options(study: &Study, one: &SurveyedCase) -> Option<String> {
    let kind = study.kind();
    let is_own = |key: &&String| kind.keys.iter().any(|own| own.name == key.as_str());
    let key = one.case.method.options.keys().filter(|_| !kind.uses_method).find(is_own)?;
    Some(format!("`{key}` in [method] has no effect on kind `{}`; write it in [study]", kind.name))
}

/// Lists names in a sentence: `a, b and 3 more`.
pub(super) fn list_names(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(MAX_NAMED).map(|name| format!("`{name}`")).collect();
    match names.len().checked_sub(MAX_NAMED) {
        None | Some(0) => shown.join(", "),
        Some(more) => format!("{} and {more} more", shown.join(", ")),
    }
}

fn loose_parts(cases: &[SurveyedCase]) -> Vec<String> {
    let pronoun = |count: usize| if count == 1 { "it" } else { "them" };
    // bodies on preloaded faces are correct; bodies between unloaded faces have a separate
    // warning
    let survey = &cases[0].survey;
    let between = |loose: &&LooseBody| !loose.held_by_friction && !loose.faces.is_empty();
    let unpressed: Vec<&LooseBody> = survey.loose().iter().filter(between).collect();
    let open = unpressed.first().map(|_| {
        let bodies: Vec<String> = unpressed.iter().flat_map(|one| one.masses.clone()).collect();
        let mut joints: Vec<String> = unpressed.iter().flat_map(|one| one.faces.clone()).collect();
        let mut named = BTreeSet::new();
        joints.retain(|joint| named.insert(joint.clone()));
        let pressed = |slip: &FirstSlip| {
            slip.constant_force > 0.0 && joints.iter().any(|joint| joint == joint_of_direction(&slip.joint))
        };
        let reason = match survey.first_slip().iter().any(pressed) {
            true => "the constant forces press them, but push along them with more than friction can carry; press them more",
            false => "they have no preload; add a preload",
        };
        format!(
            "{} can move freely in static equilibrium: only the faces of {} touch {them}, and {reason}, or hold {them} by \
             a spring",
            list_names(&bodies),
            list_names(&joints),
            them = pronoun(bodies.len()),
        )
    });
    let unbalanced = unbalanced_preload(cases);
    let open = match (&unbalanced, open_under_load(&cases[0])) {
        (None, Some(found)) => Some(found),
        _ => open.or_else(|| cases[0].lacks_equilibrium.then(|| no_equilibrium(&cases[0]))),
    };
    let others = survey.loose().iter().filter(|one| one.contacts.is_empty() || !one.held_by_friction);
    let others: Vec<&LooseBody> = others.filter(|one| !between(one) && !one.held_in_motion).collect();
    // one warning for all bodies, such as the dampers of all sectors
    let one_warning = |by_friction: bool| {
        let alike = others.iter().filter(|one| one.held_by_friction == by_friction);
        let masses: Vec<String> = alike.flat_map(|one| one.masses.clone()).collect();
        let (names, them) = (list_names(&masses), pronoun(masses.len()));
        let their = if masses.len() == 1 { "its" } else { "their" };
        let text = match by_friction {
            true => format!(
                "no spring holds {names}: only friction keeps {them} in place, as long as not all joints slip, and \
                 {their} mean position depends on the history"
            ),
            false => format!("{names} can move freely: no spring and no joint connects {them} to `ground`"),
        };
        (!masses.is_empty()).then_some(text)
    };
    [true, false].into_iter().filter_map(one_warning).chain(open).chain(unbalanced).collect()
}

/// Returns the warning of a structure without static equilibrium.
fn no_equilibrium(one: &SurveyedCase) -> String {
    let creeps = |joint: &&SystemJoint| joint.law().prox().is_some_and(|law| law.force_at_velocity(0.0).is_some());
    let creeping = match one.survey.system().joints().iter().find(creeps) {
        Some(joint) => format!(
            "; the law `{}` of `{}` has no force at rest, so the joint creeps under every constant force: use a law that sticks",
            joint.law().name(),
            joint.name()
        ),
        None => String::new(),
    };
    format!(
        "no static equilibrium was found under the constant forces and preloads, and a part of the structure can move \
         freely; increase the normal loads, or hold this part by a spring; if one of these loads should close a contact \
         that it opens, exchange the two places of its `between`, or reverse the load{creeping}"
    )
}

/// Warns of open contacts of a structure that can move freely, if the constant forces or the
/// preloads move their faces apart: these may have been meant to press the contacts.
fn open_under_load(one: &SurveyedCase) -> Option<String> {
    let slips = one.survey.first_slip();
    // next to preloaded contacts, those without preload or with a gap may be open
    let has_preload = slips.iter().any(|slip| slip.preload > Some(0.0));
    let opens = |slip: &&FirstSlip| match slip.preload {
        Some(preload) if preload > 0.0 => slip.equilibrium_force.is_some_and(|force| force <= 0.0),
        Some(0.0) => !has_preload && slip.constant_force < 0.0,
        _ => false,
    };
    let found = || slips.iter().filter(opens);
    let preloaded = found().any(|slip| slip.preload > Some(0.0));
    let mut open: Vec<String> = found().map(|slip| joint_of_direction(&slip.joint).to_owned()).collect();
    open.dedup();
    if open.is_empty() || one.survey.is_too_large() || one.survey.free().rigid == 0 {
        return None;
    }
    let (verb, each) = if open.len() == 1 { ("is", "its") } else { ("are", "their") };
    let forces = if preloaded { "the constant forces and preloads" } else { "the constant forces" };
    Some(format!(
        "{} {verb} open in static equilibrium, and a part of the structure can move freely: {forces} move \
         {each} faces apart; if they should press them together, exchange the two places of {each} `between` (a contact \
         closes where its first place moves along the normal towards the second), or reverse the forces",
        list_names(&open)
    ))
}

/// Warns of a preload that no constant force balances, for the first such case.
fn unbalanced_preload(cases: &[SurveyedCase]) -> Option<String> {
    let (case, found) = cases.iter().find_map(|case| Some((case, case.survey.unpressed()?)))?;
    let pushed = case.survey.loose().iter().filter(|one| one.contacts.iter().any(|name| found.joints.contains(name)));
    let bodies: Vec<String> = pushed.flat_map(|one| one.masses.clone()).collect();
    if bodies.is_empty() {
        return None;
    }
    let (names, joints) = (list_names(&bodies), list_names(&found.joints));
    let preload = quantity_text(found.preload, Some(Dimension::FORCE));
    Some(format!(
        "the preload of {joints}, {preload} in total, pushes {names} away: no spring holds {}, and no constant force \
         presses the faces; add a force with `harmonic = 0` that presses them; if one should press them already, \
         exchange the two places of `between`, or reverse the force",
        if bodies.len() == 1 { "it" } else { "them" }
    ))
}

/// Warns of a model without mass.
fn massless(one: &SurveyedCase) -> Option<String> {
    let (model, structure) = (&one.case.model, one.survey.system().structure());
    let only_masses = model.substructure.is_none() && model.bodies.is_empty() && !model.masses.is_empty();
    let none = only_masses && model.masses.iter().all(|mass| mass.mass == 0.0);
    (none && structure.dofs() > 0).then(|| {
        let names: Vec<String> = model.masses.iter().map(|mass| mass.name.clone()).collect();
        let verb = if names.len() == 1 { "is" } else { "are" };
        format!(
            "the mass of {} {verb} zero and the model has no other mass: it has no resonance, only the response of \
             the springs",
            list_names(&names)
        )
    })
}

/// Warns of a stiffness that gives an implausible frequency.
fn overstiff(one: &SurveyedCase) -> Option<String> {
    let (model, survey) = (&one.case.model, &one.survey);
    if model.substructure.is_some() || survey.is_too_large() {
        return None;
    }
    let highest = |modes: &LinearModes| modes.elastic.last().map_or(0.0, |mode| mode.omega) / TAU;
    let (free, stuck) = (highest(survey.free()), highest(survey.stuck()));
    if free.max(stuck) <= PLAUSIBLE_FREQUENCIES.1 {
        return None;
    }
    let spring = model
        .springs
        .iter()
        .max_by(|a, b| a.stiffness.total_cmp(&b.stiffness))
        .filter(|_| free > PLAUSIBLE_FREQUENCIES.1);
    let slips = survey.first_slip();
    let stiffness = |slip: &FirstSlip| slip.displacement.map_or(0.0, |u| if u > 0.0 { slip.limit / u } else { 0.0 });
    let joint = slips.iter().filter(|slip| slip.limit.is_finite());
    let joint = joint.max_by(|a, b| stiffness(a).total_cmp(&stiffness(b)));
    let stiffness_text = |stiffness: f64| quantity_text(stiffness, Some(Dimension::STIFFNESS));
    let hertz = format_significant(free.max(stuck), 3);
    Some(match (spring, joint) {
        (Some(spring), _) => {
            let [a, b] = &spring.between;
            format!(
                "the highest natural frequency is {hertz} Hz; check the stiffness between `{a}` and `{b}`, {}",
                stiffness_text(spring.stiffness)
            )
        }
        (None, Some(joint)) => format!(
            "with all joints stuck the highest natural frequency is {hertz} Hz; check the stiffness of `{}`, {}; for \
             a joint that is rigid until it slips, use the law `coulomb`",
            joint.joint,
            stiffness_text(stiffness(joint))
        ),
        (None, None) => format!("the highest natural frequency is {hertz} Hz; check stiffnesses and masses"),
    })
}

/// Warns of joints between equal places: both use the same rows, or both are fixed.
fn motionless_joints(case: &SurveyedCase) -> Option<String> {
    let moves = |axis: &Axis| {
        let mut weights: HashMap<usize, (f64, f64)> = HashMap::new();
        for (row, weight) in axis.rows() {
            let (sum, size) = weights.entry(*row).or_default();
            (*sum, *size) = (*sum + weight, *size + weight.abs());
        }
        // Relative rounding below which the weights of a row cancel.
        !axis.imposed().is_empty() || weights.values().any(|(sum, size)| sum.abs() > 1e-12 * size)
    };
    let joints = case.survey.system().joints().iter();
    let names: Vec<String> =
        joints.filter(|joint| !joint.axes().iter().any(moves)).map(|joint| joint.name().to_owned()).collect();
    let (those, do_not) = if names.len() == 1 {
        ("the joint", "never moves, because its two places are")
    } else {
        ("the joints", "never move, because their two places are")
    };
    (!names.is_empty()).then(|| format!("{those} {} {do_not} the same", list_names(&names)))
}

/// Plausible frequencies of a structure of machine size, Hz. Mistaken units shift frequencies
/// by powers of ten, beyond these limits.
const PLAUSIBLE_FREQUENCIES: (f64, f64) = (0.1, 2e5);

/// Warns of probable mistakes in a structure given by matrices.
fn structure(case: &SurveyedCase) -> Vec<String> {
    let system = case.survey.system();
    let mut found = system.reduced().map_or_else(Vec::new, coordinates);
    found.extend(implausible_mass(case));
    let Some(reduction) = system.reduction_evidence() else { return found };
    let hertz = |omega: f64| quantity_text(omega, Some(Dimension::FREQUENCY));
    // Error of a reduction above which it is visible in a response.
    if reduction.error > 1e-3 {
        let worst = system.reduced().map_or(reduction.up_to, ReducedComponent::worst_at);
        found.push(format!(
            "the reduced model has an error of {} % at {}; use more modes, or `reduce = {{ up_to = … }}`, which \
             chooses the number of modes",
            format_significant(100.0 * reduction.error, 3),
            hertz(worst)
        ));
    }
    let beyond = crate::check::survey::frequency_range(&case.case).filter(|(_, high)| *high > reduction.up_to);
    if let Some((_, high)) = beyond {
        found.push(format!(
            "the excitation frequency reaches {}, but the error of the reduced model is known only up to {}; \
             state a higher `up_to` in `reduce`",
            hertz(high),
            hertz(reduction.up_to)
        ));
    }
    found
}

/// Warns of a mass that no vibrating part has: the units of the files are probably others.
fn implausible_mass(case: &SurveyedCase) -> Option<String> {
    let component = &case.case.model.substructure.as_ref()?.component;
    let (mass, ..) = component.matrices();
    let along = TRANSLATIONS.iter().filter_map(|along| mass_along(component.rows(), mass, along));
    let largest = along.fold(None, |largest: Option<f64>, mass| Some(largest.map_or(mass, |other| other.max(mass))))?;
    // from a tenth of a gram to a hundred tonnes
    (!(1e-4..=1e5).contains(&largest))
        .then(|| format!("the mass of the structure is {} kg; check `units`", format_significant(largest, 4)))
}

/// Warns of implausible frequencies of a reduced model.
fn coordinates(reduced: &ReducedComponent) -> Vec<String> {
    let mut found = Vec::new();
    let hertz = |omega: f64| quantity_text(omega, Some(Dimension::FREQUENCY));
    let lowest = reduced.frequencies().get(reduced.free_modes()).copied();
    match lowest {
        Some(lowest) if lowest / TAU < PLAUSIBLE_FREQUENCIES.0 || lowest / TAU > PLAUSIBLE_FREQUENCIES.1 => {
            found.push(format!("the lowest natural frequency of the structure is {}; check `units`", hertz(lowest)));
        }
        None => found.push(format!(
            "the structure has no natural frequency up to {}; check `units` and `reduce`",
            hertz(reduced.up_to())
        )),
        Some(_) => {}
    }
    found
}

fn unused(study: &Study) -> Option<String> {
    let used = used_parameters(study);
    let from_template = |index: usize| {
        let source = study.parameters[index].quantity.location.source;
        study.structure.template.as_ref().is_some_and(|template| template.source == source)
    };
    let varied: BTreeSet<usize> = study.varied.iter().map(|varied| varied.index).collect();
    let unused = (0..study.names.len()).filter(|i| !used.contains(i) && (varied.contains(i) || !from_template(*i)));
    let (idle_varied, idle): (Vec<usize>, Vec<usize>) = unused.partition(|index| varied.contains(index));
    let names = |indices: &[usize]| list_names(&indices.iter().map(|i| study.names[*i].clone()).collect::<Vec<_>>());
    match (idle_varied.is_empty(), idle.is_empty()) {
        (true, true) => None,
        (true, false) => Some(format!("no value of the study uses the parameter {}", names(&idle))),
        (false, _) => {
            let all: Vec<usize> = idle_varied.iter().chain(&idle).copied().collect();
            let varied = names(&idle_varied);
            let others = if idle.is_empty() { String::new() } else { format!("; unused are {}", names(&all)) };
            Some(format!("no value of the study uses {varied}, so `vary` only repeats equal cases{others}"))
        }
    }
}

/// Warns of a mistuned parameter on which no part of a sector depends.
fn mistuned_without_effect(study: &Study) -> Option<String> {
    let index = study.structure.lists.disk.as_ref()?.mistuned_parameter(&study.names)?;
    let of_parts = with_dependencies(study, parameters_of_parts(study));
    (!of_parts.contains(&index))
        .then(|| format!("no part of a sector depends on `{}`, so its `mistuning` has no effect", study.names[index]))
}

/// Returns the parameters on which a value of the model, the study or the method depends.
fn used_parameters(study: &Study) -> BTreeSet<usize> {
    let mut open = parameters_of_parts(study);
    let disk = study.structure.lists.disk.as_ref();
    for table in [Some(&study.study), Some(&study.method), disk.map(|disk| &disk.table)].into_iter().flatten() {
        table.each_quantity(&mut |_, quantity, _| open.extend(quantity.expression.parameters()));
    }
    open.extend(disk.and_then(|disk| disk.mistuned_parameter(&study.names)));
    with_dependencies(study, open)
}

/// Returns the parameters in the values of masses, springs, joints and the other parts.
fn parameters_of_parts(study: &Study) -> Vec<usize> {
    let mut found = Vec::new();
    let matrices = study.structure.matrices.iter().map(|matrices| &matrices.table);
    for table in matrices.chain(study.structure.lists.all().into_iter().flatten()) {
        table.each_quantity(&mut |_, quantity, _| found.extend(quantity.expression.parameters()));
    }
    found
}

/// Returns these parameters and those on which they depend.
fn with_dependencies(study: &Study, mut open: Vec<usize>) -> BTreeSet<usize> {
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

/// Warns of a missing reference curve that the figure requests; the first case represents all
/// cases.
fn no_references(study: &Study, cases: &[SurveyedCase]) -> Vec<String> {
    if !study.requests_references() {
        return Vec::new();
    }
    if study.draws().is_some() {
        let why = "`references` has no effect with [sample], because every draw has different linear responses; \
            remove it, or run the study without [sample]";
        return vec![why.to_owned()];
    }
    LinearReference::ALL.into_iter().filter_map(|reference| reference.model(&cases[0].case.model).err()).collect()
}

/// Returns the assumed unit of an easily mistaken bare number, another unit, and the value in
/// that unit.
///
/// A number computed with pi is in radians.
fn likely_unit(dimension: Option<Dimension>, si: f64, with_pi: bool) -> Option<(&'static str, &'static str, f64)> {
    match dimension? {
        Dimension::ANGLE if si != 0.0 && !with_pi => Some(("rad", "deg", si * 180.0 / PI)),
        // A bare length from this value on, m, was probably meant in millimetres: gaps and
        // imposed motions of machines are tenths of a millimetre.
        Dimension::LENGTH if si.abs() >= 0.01 => Some(("m", "mm", si * 1e3)),
        _ => None,
    }
}

/// Returns the parameters of the first case.
fn first_values(study: &Study) -> Option<Environment<'_>> {
    let choice: HashMap<_, _> = study.varied.iter().map(|varied| (varied.index, (varied, 0))).collect();
    let values = evaluate(&study.names, &study.parameters, &study.order, &choice, &[]).ok()?;
    Some(Environment { names: &study.names, parameters: &study.parameters, values })
}

/// Warns of bare parameters in `sin`, `cos` or `tan` that exceed a turn in radians: they are
/// probably degrees.
fn bare_angles(study: &Study, first: &Environment<'_>) -> Vec<String> {
    let mut turned: BTreeSet<usize> =
        study.parameters.iter().flat_map(|parameter| parameter.quantity.expression.angles()).collect();
    let lists = &study.structure.lists;
    for list in lists.all() {
        for table in list {
            table.each_quantity(&mut |_, quantity, _| turned.extend(quantity.expression.angles()));
        }
    }
    let values = &first.values;
    let bare = |index: &usize| values[*index].dimension.is_none() && values[*index].si.abs() > TAU;
    let sentence = |index: usize| {
        let (name, number) = (&study.names[index], quantity_text(values[index].si, None));
        format!(
            "the parameter `{name}` is the bare number {number} in `sin`, `cos` or `tan`, which means {number} rad; \
             state the unit: \"{number} deg\""
        )
    };
    turned.into_iter().filter(bare).take(MAX_NAMED).map(sentence).collect()
}

/// Warns of damping ratios that are too large for a vibrating structure: they are probably
/// percent.
fn large_damping_ratios(study: &Study, first: &Environment<'_>) -> Option<String> {
    // Elastomer mounts reach 0.2. Values above it are rare, and usually percent without their sign.
    let plausible = 0.2;
    let matrices = study.structure.matrices.as_ref().map(|matrices| ("structure".to_owned(), &matrices.table));
    let springs = study.structure.lists.spring.iter().enumerate();
    let springs = springs.map(|(index, table)| (format!("spring {}", index + 1), table));
    let mut found = Vec::new();
    for (owner, table) in springs.chain(matrices) {
        table.each_quantity(&mut |key, quantity, _| {
            if ![DAMPING_RATIO, "modal_damping"].contains(&key) {
                return;
            }
            let Some(ratio) = quantity.value(key, first).ok().map(|value| value.si).filter(|si| *si > plausible) else {
                return;
            };
            found.push((format!("`{key}` of {owner}"), ratio));
        });
    }
    let (what, ratio) = found.first()?;
    let others = if found.len() > 1 { format!(" (and {} more)", found.len() - 1) } else { String::new() };
    let (percent, bare) = (format_significant(100.0 * ratio, 4), quantity_text(*ratio, None));
    Some(format!("{what} is {percent} %{others}; if {bare} % is meant, write \"{bare} %\""))
}

/// Warns of bare numbers whose unit is easily mistaken: angles count as radians, lengths as
/// metres.
fn bare_numbers(study: &Study, first: &Environment<'_>) -> Vec<String> {
    let mut found: Vec<(String, String, usize)> = Vec::new();
    let lists = &study.structure.lists;
    for (list, tables) in [("joint", &lists.joint), ("force", &lists.force), ("motion", &lists.motion)] {
        for (index, table) in tables.iter().enumerate() {
            table.each_quantity(&mut |key, quantity, dimension| {
                let Ok(value) = quantity.value(key, first) else { return };
                let easily = likely_unit(dimension, value.si, value.with_pi);
                let Some((unit, other, converted)) = easily.filter(|_| value.dimension.is_none()) else { return };
                let text = format!("{key} = {}", quantity.text.trim());
                match found.iter_mut().find(|(known, _, _)| *known == text) {
                    Some((_, _, more)) => *more += 1,
                    None => {
                        let (number, converted) = (quantity_text(value.si, None), format_significant(converted, 4));
                        let sentence = format!(
                            "`{key}` of {list} {} is the bare number {number}, which means {number} {unit} \
                             ({converted} {other}); state the unit: \"{number} {other}\" or \"{number} {unit}\"",
                            index + 1
                        );
                        found.push((text, sentence, 0));
                    }
                }
            });
        }
    }
    let sentence = |(_, sentence, more): (String, String, usize)| match more {
        0 => sentence,
        more => format!("{sentence} (and {more} more)"),
    };
    found.into_iter().take(MAX_NAMED).map(sentence).collect()
}
