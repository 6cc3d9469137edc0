//! Converts `[structure]` and `[[place]]` to parts of a model: matrices with their reduction,
//! and places as rows, means of nodes, weighted sums, or points of bodies.

use crate::case::values::Values;
use crate::compile::compiled::{CompiledTable, Environment};
use crate::compile::source_model::MatrixSource;
use crate::syntax::error::Problem;
use crate::syntax::suggest::{alternatives, excerpt, suggest};
use stickslip::method::WIDTH;
use stickslip::model::{
    ElementFault, Frame, Mass, Model, Place, ReductionAccuracy, Substructure, SubstructureDamping, TRANSLATIONS, View,
};
use stickslip::structure::reduction::Row;
use stickslip::structure::{Component, Reduction, ReductionKind};

/// Default frequency range of a reduced model without joints, in multiples of the highest
/// excitation frequency. The forces need one multiple; the rest is a margin.
const RANGE_WITHOUT_JOINTS: u32 = 5;
/// Names of the directions of a node with a normal.
const FRAME_DIRECTIONS: [&str; 3] = ["t1", "t2", "n"];

/// The kinds of reduction: name, summary and kind.
pub(crate) const REDUCTIONS: [(&str, &str, Option<ReductionKind>); 3] = [
    ("rubin", "free modes and residual flexibility", Some(ReductionKind::Rubin)),
    (
        "craig-bampton",
        "modes with fixed places, and static constraint modes (Craig-Bampton)",
        Some(ReductionKind::CraigBampton),
    ),
    (
        "none",
        "all rows, as with reduce = false; `up_to` is only the frequency up to which `modal_damping` is the damping \
         ratio",
        None,
    ),
];

/// No reduction; [`set_frequency_range`] sets the frequency up to which modes are damped.
const UNREDUCED: Reduction = Reduction::None { up_to: 0.0 };

/// Builds the structure of `[structure]`. If the file does not state a reduction,
/// [`set_frequency_range`] decides later.
pub(crate) fn structure_from_table(
    MatrixSource { table, stress_stiffening: stiffened, .. }: &MatrixSource,
    component: &Component,
    environment: &Environment<'_>,
    problems: &mut Vec<Problem>,
) -> Substructure {
    let values = table.values(environment, problems);
    let share = values.table("stiffened").and_then(|spin| Some(spin.quantity("speed")? / spin.quantity("at")?));
    let spinning =
        stiffened.as_ref().zip(share).map(|(stiffened, share)| stiffened.component_at(component, share * share));
    let component = spinning.unwrap_or_else(|| Ok(component.clone())).unwrap_or_else(|error| {
        problems.push(Problem::new(table.location_of("stiffened", None), "stiffened", error.to_string()));
        component.clone()
    });
    // Critical damping ratio: from here on a mode does not oscillate.
    if let Some(ratio) = values.quantity("modal_damping").filter(|ratio| *ratio >= 1.0) {
        let message = format!("a damping ratio of {ratio}: from 1 on a mode does not oscillate");
        let problem = Problem::new(table.location_of("modal_damping", None), "modal_damping", message);
        problems.push(problem.help("write it in percent, as in modal_damping = \"0.1 %\""));
    }
    let damping = match (values.quantity("modal_damping"), values.table("rayleigh")) {
        (Some(ratio), _) => SubstructureDamping::Ratio(ratio),
        (None, Some(rayleigh)) => SubstructureDamping::Rayleigh {
            mass: rayleigh.quantity("mass").unwrap_or(0.0),
            stiffness: rayleigh.quantity("stiffness").unwrap_or(0.0),
        },
        (None, None) => SubstructureDamping::Own,
    };
    let reduction = match (values.table("reduce"), values.flag("reduce")) {
        (Some(reduce), _) => stated_reduction(reduce).unwrap_or_else(|(key, message, help)| {
            problems.push(Problem::new(table.location_of("reduce", None), key, message).help(help));
            UNREDUCED
        }),
        (None, Some(false)) => UNREDUCED,
        _ => Reduction::up_to(0.0),
    };
    let earlier_reduction = values.table("reduced").and_then(|reduced| {
        Some(ReductionAccuracy { error: reduced.quantity("error")?, up_to: reduced.quantity("up_to")? })
    });
    Substructure { component, damping, reduction, earlier_reduction, disk: None }
}

fn stated_reduction(reduce: &Values) -> Result<Reduction, (&'static str, &'static str, &'static str)> {
    let named = |name: &str| REDUCTIONS.iter().find(|(known, _, _)| *known == name);
    let named = reduce.text("kind").and_then(named);
    if let Some((_, _, None)) = named {
        return match reduce.count("modes") {
            Some(_) => Err((
                "modes",
                "`modes` is stated, but kind = \"none\" does not reduce the structure",
                "remove `kind` or `modes`",
            )),
            None => Ok(Reduction::None { up_to: reduce.quantity("up_to").unwrap_or(0.0) }),
        };
    }
    let kind = named.and_then(|(_, _, kind)| *kind);
    let tolerance = reduce.quantity("tolerance").unwrap_or(Reduction::TOLERANCE);
    match (reduce.quantity("up_to"), reduce.count("modes")) {
        (Some(_), Some(_)) => Err((
            "modes",
            "both `up_to` and `modes` are stated",
            "remove one of them: `up_to` takes as many modes as the error requires",
        )),
        (None, Some(modes)) => {
            let (kind, orders) = (kind.unwrap_or(ReductionKind::Rubin), reduce.count("orders"));
            if let (ReductionKind::CraigBampton, Some(_)) = (kind, orders) {
                return Err((
                    "orders",
                    "`orders` is stated, but a Craig-Bampton reduction has no residual vectors",
                    "remove `orders`, or use kind = \"rubin\"",
                ));
            }
            Ok(Reduction::Modes { modes: modes as usize, kind, orders: orders.unwrap_or(1) as usize, up_to: 0.0 })
        }
        (_, None) if reduce.count("orders").is_some() => Err((
            "orders",
            "`orders` of residual vectors need `modes`",
            "add `modes`; with `up_to` the error determines the number of residual vectors",
        )),
        (up_to, None) => Ok(Reduction::UpTo { up_to: up_to.unwrap_or(0.0), tolerance, kind }),
    }
}

/// Sets the frequency range of the reduction if the file does not, from the frequencies of the
/// study in `values`.
///
/// With a given number of modes, the error is stated up to the highest excited frequency,
/// because no reduction is accurate near its last modes. A small structure with joints is not
/// reduced if `method` treats all laws exactly, or if the study has no excitation frequency.
pub(crate) fn set_frequency_range(model: &mut Model, values: &Values, method: &Values) {
    let harmonic =
        model.forces.iter().map(|force| force.harmonic).chain(model.motions.iter().map(|motion| motion.harmonic));
    let most = f64::from(harmonic.max().unwrap_or(1).max(1));
    let run_up = values.table("run_up");
    let ends = run_up.into_iter().flat_map(|table| ["from", "to"].map(|key| table.quantity(key).unwrap_or(0.0)));
    let drive = values.frequencies("frequency").into_iter().filter_map(|frequencies| frequencies.highest());
    let excited = most * ends.chain(drive).fold(0.0, f64::max);
    let joints = !model.joints.is_empty() && excited > 0.0;
    let exact =
        method.quantity(WIDTH).is_none() && model.joints.iter().all(|joint| joint.law.ideal_elements().is_some());
    let Some(Substructure { component, reduction, disk, .. }) = model.substructure.as_mut() else { return };
    if joints && exact && disk.is_none() && *reduction == Reduction::up_to(0.0) && is_unreduced(component) {
        *reduction = UNREDUCED;
    }
    if excited == 0.0
        && is_unreduced(component)
        && matches!(*reduction, Reduction::UpTo { up_to: 0.0, kind: None, .. } | UNREDUCED)
    {
        // a free decay has no excitation frequency, and a small structure keeps all its modes
        *reduction = Reduction::None { up_to: 1.01 * highest_frequency(component) };
        return;
    }
    match reduction {
        Reduction::UpTo { up_to, .. } | Reduction::None { up_to } if *up_to <= 0.0 => {
            *up_to = if joints {
                joint_frequency_range(component, excited)
            } else {
                f64::from(RANGE_WITHOUT_JOINTS) * excited
            };
        }
        Reduction::Modes { up_to, .. } => *up_to = excited,
        _ => {}
    }
}

/// Returns whether the structure is small and has a definite mass matrix, so that every method
/// accepts all its rows.
fn is_unreduced(component: &Component) -> bool {
    // Largest structure, in rows, that is not reduced by default if it has joints. A reduced
    // model lacks modes that harmonics of friction meet: a chain of 80 masses with a stiff
    // slider was wrong by 3 to 8 %. All rows are kept only if all laws are exact. Methods that
    // integrate in time pay for every fast mode: 60 rows with `bouc-wen` took 4.3 s instead of
    // 0.07 s. Seconds per point, for chains of 60, 80, 100, 150 and 200 rows:
    // - reduced, event-driven: 0.015; with ten joints 0.03 and up to 0.25;
    // - all rows, event-driven: 0.19, 0.26, 0.26, 3.2, 4.2 with one joint; 0.02, 0.05, 0.1, 12
    //   and more with ten;
    // - all rows, `auto`: 0.02 to 0.1.
    component.dofs() <= 100 && component.has_definite_mass()
}

/// Returns the highest natural frequency of a small structure, rad/s; zero if it is not found.
fn highest_frequency(component: &Component) -> f64 {
    component.frequencies(component.dofs()).ok().and_then(|all| all.last().copied()).unwrap_or(0.0)
}

/// Returns the upper end of the frequency range with joints, rad/s: the highest odd harmonic of
/// `excited` (rad/s) up to which the number of modes stays within its limit.
fn joint_frequency_range(component: &Component, excited: f64) -> f64 {
    // Largest number of modes when the range is extended for joints. More modes make time
    // integration slow, and the mesh rarely resolves the highest ones.
    let few = |omega: &f64| component.modes_below(*omega).is_some_and(|count| count <= 60);
    // Default range with joints, in the same multiples. The harmonics of friction fall with the
    // square of their order. A mode near one of them amplifies it again. Measured on a chain of
    // 60 masses, where a mode meets harmonic 7: ranges of 5, 9, 15 and 31 harmonics left errors
    // of 9e-3, 1e-3, 5e-5 and 5e-6.
    let mut beyond = (RANGE_WITHOUT_JOINTS + 1..=15).rev().step_by(2).map(|harmonic| f64::from(harmonic) * excited);
    beyond.find(few).unwrap_or(f64::from(RANGE_WITHOUT_JOINTS) * excited)
}

/// Builds a `[[place]]` of the structure; errors go to `problems`.
pub(crate) fn place(
    table: &CompiledTable,
    component: &Component,
    environment: &Environment<'_>,
    problems: &mut Vec<Problem>,
) -> Option<Place> {
    let before = problems.len();
    let values = table.values(environment, problems);
    if problems.len() > before {
        return None;
    }
    match build_place(table, &values, component) {
        Ok(place) => Some(place),
        Err(mut problem) => {
            problem.message = table.with_repetition(&problem.message);
            problems.push(*problem);
            None
        }
    }
}

/// Builds a `[[place]]` that is a rotated frame of a mass or a body, or a point of a body.
///
/// Its directions are those of the body, or one or two tangents and the normal.
pub(crate) fn place_on_element(table: &CompiledTable, values: &Values, model: &Model) -> Result<Place, Box<Problem>> {
    let problem = |key: &str, message: String| {
        Box::new(Problem::new(table.location_of(key, None), key, table.with_repetition(&message)))
    };
    if let Some(key) = ["dof", "dofs", "nodes", "sum"].into_iter().find(|key| table.entry(key).is_some()) {
        let message =
            format!("`of` makes this a place of a mass or a body, but `{key}` makes it a place of a structure");
        return Err(Box::new(problem(key, message).help("remove one of the two keys")));
    }
    let of = values.text("of").unwrap_or_default();
    let masses = model.masses.iter().map(|mass| mass.name.as_str());
    let names = masses.chain(model.bodies.iter().map(|body| body.name.as_str()));
    if !names.clone().any(|name| name == of) {
        let help = match suggest(of, names) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "name a [[body]], or a [[mass]] with `directions`".to_owned(),
        };
        return Err(Box::new(problem("of", format!("there is no mass and no body `{}`", excerpt(of))).help(help)));
    }
    let view = View {
        offset: values.vector("offset"),
        normal: values.vector("normal"),
        tangent: values.vector("tangent"),
        directions: values.names("directions").map(<[String]>::to_vec),
        ..View::new(values.text("name").unwrap_or_default(), of)
    };
    model.view(&view).map_err(|fault| Box::new(fault_in(table, &fault)))
}

/// Returns the problem of an element with its location in the file.
pub(crate) fn fault_in(table: &CompiledTable, fault: &ElementFault) -> Problem {
    let message = table.with_repetition(&fault.message);
    Problem::new(table.location_of(fault.key, None), fault.key, message).help(fault.help)
}

/// Returns a mass that stands in for a place if only names are known.
pub(crate) fn placeholder_mass(table: &CompiledTable, values: &Values) -> Mass {
    let (directions, _) = directions(table, values).unwrap_or_default();
    Mass { name: values.text("name").unwrap_or_default().to_owned(), mass: 1.0, directions }
}

/// Returns the names of a place's directions (none if it has one displacement) and the names of
/// its nodes' rows.
fn directions(table: &CompiledTable, values: &Values) -> Result<(Vec<String>, Vec<String>), Box<Problem>> {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let problem = |key: &str, message: String| Box::new(Problem::new(table.location_of(key, None), key, message));
    let stated = values.names("directions").map(<[String]>::to_vec);
    let framed = values.vector("normal").is_some();
    let sums = values.sums("sum").map(<[_]>::len);
    if sums == Some(1) && stated.is_none() && !framed {
        return Ok(Default::default());
    }
    let count = values.names("dofs").map(<[String]>::len).or(sums);
    if let Some(count) = count.filter(|count| *count > TRANSLATIONS.len()) {
        let key = if sums.is_some() { "sum" } else { "dofs" };
        return Err(Box::new(
            problem(key, format!("a node has at most three directions, but {count} rows are named"))
                .help("for the mean of several nodes use nodes = [\"188\", \"189\"], for a weighted sum sum = { … }"),
        ));
    }
    let names = match (framed, &stated, values.names("dofs")) {
        (false, _, _) if values.names("dof").is_some() => stated.unwrap_or_default(),
        (true, None, _) => owned(&FRAME_DIRECTIONS),
        (_, Some(names), _) => names.clone(),
        // the ends of the names of rows, if they are distinct
        (false, None, Some(rows)) => {
            let ends: Vec<&str> = rows.iter().map(|row| row.rsplit_once('.').map_or("", |(_, along)| along)).collect();
            let apart = ends.iter().enumerate().all(|(i, end)| !end.is_empty() && !ends[..i].contains(end));
            let usable = apart && ends.iter().all(|end| stickslip::model::is_identifier(end));
            if usable { owned(&ends) } else { owned(&TRANSLATIONS[..rows.len()]) }
        }
        (false, None, None) => owned(&TRANSLATIONS[..sums.unwrap_or(TRANSLATIONS.len())]),
    };
    let rows = if framed { owned(&TRANSLATIONS) } else { names.clone() };
    if framed && count.is_some_and(|count| count != TRANSLATIONS.len()) {
        return Err(Box::new(
            problem("normal", "a local frame needs three rows: those of x, y and z".to_owned()).help(
                "for a plane structure name the rows in the order tangent, normal and remove the frame, or \
                rotate them with sum = { … }",
            ),
        ));
    }
    if let Some(count) = count.filter(|count| *count != names.len()) {
        let message = format!("{} names in `directions` for {count} rows", names.len());
        return Err(Box::new(problem("directions", message).help("give each row the name of its direction")));
    }
    Ok((names, rows))
}

fn build_place(table: &CompiledTable, values: &Values, component: &Component) -> Result<Place, Box<Problem>> {
    let problem = |key: &str, message: String| Box::new(Problem::new(table.location_of(key, None), key, message));
    let stated: Vec<&str> =
        ["dof", "dofs", "nodes", "sum"].into_iter().filter(|key| table.entry(key).is_some()).collect();
    let [key] = stated[..] else {
        let message = match stated[..] {
            [] => "the place has no row: one of `dof`, `dofs`, `nodes`, `sum` is needed".to_owned(),
            _ => format!("a place takes only one of `{}`", stated.join("`, `")),
        };
        return Err(Box::new(
            problem(stated.last().copied().unwrap_or("name"), message).help(
                "write dof = \"1353.y\", dofs = [\"188.x\", \"188.y\", \"188.z\"], or nodes = [\"188\", \"189\"]",
            ),
        ));
    };
    let find = |name: &str| {
        component.row(name).ok_or_else(|| {
            let place = table.location_of(key, Some(name));
            Box::new(
                Problem::new(place, key, format!("the structure has no row `{}`", excerpt(name)))
                    .help(row_help(component, name)),
            )
        })
    };
    let (directions, along) = directions(table, values)?;
    let mut rows: Vec<Row> = Vec::new();
    match key {
        "sum" => {
            for sum in values.sums("sum").unwrap_or_default() {
                let row: Result<Row, Box<Problem>> =
                    sum.iter().map(|(name, weight)| Ok((find(name)?, *weight))).collect();
                rows.push(row?);
            }
        }
        "nodes" => {
            let nodes = values.names("nodes").unwrap_or_default();
            let weight = 1.0 / nodes.len() as f64;
            for along in &along {
                let row: Result<Row, Box<Problem>> =
                    nodes.iter().map(|node| Ok((node_row(component, table, node, along)?, weight))).collect();
                rows.push(row?);
            }
        }
        _ => {
            let names = values.names(key).unwrap_or_default();
            if let Some(twice) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
                let (place, name) = (table.location_of(key, Some(twice.1)), excerpt(twice.1));
                let message = format!("the row `{name}` is named twice; a node has each direction once");
                return Err(Box::new(
                    Problem::new(place, key, message).help("name each row once; for a weighted sum use sum = { … }"),
                ));
            }
            let framed = values.vector("normal").is_some();
            let ordered = if framed { in_frame_order(names) } else { Some(names.iter().collect()) };
            let ordered = ordered.ok_or_else(|| {
                let message = format!("a local frame needs the rows of x, y and z, not {}", names.join(", "));
                let help = "name them in dofs = [\"188.x\", \"188.y\", \"188.z\"], or the node in nodes = [\"188\"]";
                Box::new(problem("normal", message).help(help))
            })?;
            for name in ordered {
                rows.push(vec![(find(name)?, 1.0)]);
            }
        }
    }
    let frame = match values.vector("normal") {
        Some(normal) => {
            if rows.len() != TRANSLATIONS.len() {
                return Err(Box::new(
                    problem("normal", "a local frame needs three rows: those of x, y and z".to_owned()).help(
                        "name them in dofs = [\"188.x\", \"188.y\", \"188.z\"], or the node in nodes = [\"188\"]",
                    ),
                ));
            }
            let frame = Frame::new(normal, values.vector("tangent"));
            Some(frame.map_err(|error| problem("normal", error.to_string()))?)
        }
        None if values.vector("tangent").is_some() => {
            return Err(Box::new(
                problem("tangent", "a local frame needs a normal; only `tangent` is stated".to_owned())
                    .help("add normal = [0, 0, 1]"),
            ));
        }
        None => None,
    };
    Ok(Place { name: values.text("name").unwrap_or_default().to_owned(), directions, rows, frame, view_of: None })
}

/// Returns the rows of a node in the order x, y, z of a frame, by the ends of their names.
///
/// Rows without such ends keep their order. Returns `None` if the ends do not contain each axis
/// exactly once.
fn in_frame_order(names: &[String]) -> Option<Vec<&String>> {
    let end =
        |name: &String| TRANSLATIONS.iter().position(|axis| name.rsplit_once('.').is_some_and(|(_, end)| end == *axis));
    if names.iter().all(|name| end(name).is_none()) {
        return Some(names.iter().collect());
    }
    let along = |axis: usize| names.iter().find(|name| end(name) == Some(axis));
    (0..TRANSLATIONS.len()).map(along).collect::<Option<Vec<_>>>().filter(|rows| rows.len() == names.len())
}

/// Returns the row of a node along a direction.
fn node_row(component: &Component, table: &CompiledTable, node: &str, along: &str) -> Result<usize, Box<Problem>> {
    let name = format!("{node}.{along}");
    component.row(&name).ok_or_else(|| {
        let place = table.location_of("nodes", Some(node));
        Box::new(Problem::new(place, "nodes", format!("the structure has no row `{}`", excerpt(&name))).help(format!(
            "{}; or add directions = [\"x\", …] with directions that all these nodes have",
            row_help(component, &name)
        )))
    })
}

/// Returns the help for an unknown row: the rows of the same node, a similar name, or the first
/// rows.
fn row_help(component: &Component, name: &str) -> String {
    // Largest number of rows that a message lists.
    let max_listed_rows = 4;
    let rows = component.rows();
    let node = name.rsplit_once('.').map_or(name, |(node, _)| node);
    let same: Vec<&str> = rows
        .iter()
        .map(String::as_str)
        .filter(|row| row.rsplit_once('.').is_some_and(|(of, _)| of == node))
        .take(2 * max_listed_rows)
        .collect();
    if !same.is_empty() {
        return format!(
            "the rows of this node are {}; missing directions are constrained",
            alternatives(same).replace(" or ", ", ")
        );
    }
    let is_named = |row: &String| row.contains('.');
    if name.contains('.') && !rows.iter().any(is_named) {
        return "the rows of the matrices have no names; add to [structure] dofs = \"blade.dof\", the file with their \
                names"
            .to_owned();
    }
    // Number of rows that are searched for a similar name; each takes a microsecond.
    match suggest(name, rows.iter().take(200_000).map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => {
            let first = rows.iter().take(max_listed_rows).map(|row| format!("`{row}`")).collect::<Vec<_>>().join(", ");
            match rows.last() {
                Some(last) if rows.len() > max_listed_rows => {
                    let node = if name.contains('.') {
                        format!(", and node {} is constrained or absent", excerpt(node))
                    } else {
                        String::new()
                    };
                    format!("its {} rows are {first}, … `{last}`{node}", rows.len())
                }
                _ => format!("its rows are {first}"),
            }
        }
    }
}
