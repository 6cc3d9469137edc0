//! `stickslip reduce`: saves the reduced structure of a study as files for other studies.

use crate::exit_status::{Exit, print};
use crate::{messages, run};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip::model::{Axis, DiskPart, Model, Place, ReductionAccuracy, Substructure, SubstructureDamping, System};
use stickslip::structure::{Component, Reduction, ReductionKind};
use stickslip_formats::{Matrix, Symmetry, names};
use stickslip_numerics::sparse;
use stickslip_study::StiffnessExports;

/// Name of the file with `[structure]` and `[[place]]`.
const TABLES: &str = "structure.toml";
/// Files with the row names of a disk sector, and with the node pairs of its sides.
const ROWS: &str = "rows.csv";
const BOUNDARY: &str = "boundary.csv";

/// Reduces the structure of the first case and writes it into the folder `out`.
pub fn reduce(file: &Path, set: &[(String, String)], out: &Path) -> Exit {
    let read = stickslip_study::read_file(file, set).and_then(|study| Ok((study.case(0)?.model, study.stiffened())));
    let (model, exports) = match read {
        Ok(read) => read,
        Err(error) => {
            run::show(&error);
            return Exit::WrongInput;
        }
    };
    let failed = |message: &str| Exit::Failed(format!("{}: {message}", file.display()));
    let wrong = |message: &str| {
        messages::error(&format!("{}: {message}", file.display()));
        Exit::WrongInput
    };
    let Some(substructure) = &model.substructure else {
        return wrong("the study has no [structure] to reduce");
    };
    if let Reduction::None { .. } = substructure.reduction {
        return wrong(
            "nothing to reduce: the study keeps all rows of its [structure], because they are few or because of \
             reduce = false. State the frequency range of the reduction, as in reduce = { up_to = \"5 kHz\" }",
        );
    }
    if let Some(disk) = &substructure.disk {
        if exports.is_some() {
            return wrong(
                "the sector of a disk can be saved at one speed only: remove `stiffened`, and give the matrix \
                 of that speed as `stiffness`",
            );
        }
        if !disk.blade.is_empty() || disk.deviations.iter().any(|deviation| *deviation != 0.0) {
            return wrong(
                "the blades of this disk differ, but the reduction of a sector requires equal blades: remove \
                 `blade` and `mistuning`",
            );
        }
    }
    let places = structure_places(&model);
    let kept_views = places.len() < model.places.len();
    let reduced = match (exports, model.ring.map(|ring| ring.sectors).zip(substructure.disk.as_ref())) {
        (Some(exports), _) => over_speeds(substructure, &places, &exports),
        (None, Some((sectors, disk))) => sector(substructure, &places, sectors, disk),
        (None, None) => without_rotation(substructure, &places),
    };
    match reduced.and_then(|reduced| save(&reduced, out).map(|()| reduced)) {
        Ok(reduced) => print(&format!(
            "{}: {} rows, {}\n  written to {}; in the study file, replace {}{} by {}\n",
            file.display(),
            substructure.component.dofs(),
            reduced.description,
            out.display(),
            if reduced.sector.is_some() { "[structure], [[place]] and [disk]" } else { "[structure] and [[place]]" },
            if kept_views { ", except for places of a mass or a body," } else { "" },
            out.join(TABLES).display(),
        )),
        Err(message) => failed(&message),
    }
}

/// Returns the places of the structure. Points of masses and bodies do not belong to it.
fn structure_places(model: &Model) -> Vec<Place> {
    let of_structure = |place: &&Place| match &place.view_of {
        Some(of) => model.places.iter().any(|place| place.view_of.is_none() && place.name == *of),
        None => true,
    };
    model.places.iter().filter(of_structure).cloned().collect()
}

/// The reduced structure to save.
struct ReducedStructure {
    system: System,
    /// Description of the reduction, with its error.
    description: String,
    /// Additional keys of `[structure]`.
    keys: Vec<String>,
    /// Stiffness at the second speed, if rotation stiffens the structure.
    second_stiffness: Option<sparse::SparseMatrix>,
    /// Data of a disk sector.
    sector: Option<Sector>,
}

/// Data of a disk sector.
struct Sector {
    sectors: usize,
    /// Names of its rows, which are reduced coordinates.
    rows: Vec<String>,
    /// Names of the rows on its low side and on its high side.
    pairs: Vec<(String, String)>,
}

/// Row, column, value.
type Entries = Vec<(usize, usize, f64)>;

fn without_rotation(substructure: &Substructure, places: &[Place]) -> Result<ReducedStructure, String> {
    let alone = Model { substructure: Some(substructure.clone()), places: places.to_vec(), ..Model::default() };
    let system = alone.assemble().map_err(|error| error.to_string())?;
    let what = system.reduced().map(ToString::to_string).unwrap_or_default();
    Ok(ReducedStructure {
        system,
        description: what,
        keys: vec!["reduce = false".to_owned()],
        second_stiffness: None,
        sector: None,
    })
}

/// Reduces with one basis for all speeds up to that of the second export.
fn over_speeds(
    substructure: &Substructure,
    places: &[Place],
    exports: &StiffnessExports,
) -> Result<ReducedStructure, String> {
    let seen = Place::substructure_rows(places);
    let reduced = exports.at_rest.reduced_for_two_stiffnesses(&exports.at_speed, &seen, &substructure.reduction);
    let reduced = reduced.map_err(|error| error.to_string())?;
    let mut seen = reduced.seen.into_iter();
    let mut places: Vec<Place> = places.to_vec();
    let rows = places.iter_mut().filter(|place| place.view_of.is_none()).flat_map(|place| &mut place.rows);
    rows.zip(&mut seen).for_each(|(row, seen)| *row = seen);
    let n = reduced.component.dofs();
    let earlier = ReductionAccuracy { error: reduced.error, up_to: reduced.up_to };
    let earlier = substructure.earlier_reduction.map_or(earlier, |first| first.combine(earlier));
    let system = assembled(reduced.component, earlier, places)?;
    let what = format!(
        "{n} coordinates ({}), error {:.1e} up to {:.6} Hz, at all speeds up to {:.6} rpm",
        reduced.kind,
        reduced.error,
        reduced.up_to / TAU,
        60.0 * exports.export_speed / TAU
    );
    let speed = format!(
        "stiffened = {{ file = \"stiffened.mtx\", at = \"{:e} rad/s\", speed = {:?} }}   # an expression over the parameters of the study",
        exports.export_speed, exports.speed
    );
    let keys = [vec![speed], damping_keys(substructure)].concat();
    Ok(ReducedStructure {
        system,
        description: what,
        keys,
        second_stiffness: Some(reduced.other_stiffness),
        sector: None,
    })
}

/// Reduces the sector of a disk with one basis for all its travelling waves.
fn sector(
    substructure: &Substructure,
    places: &[Place],
    sectors: usize,
    disk: &DiskPart,
) -> Result<ReducedStructure, String> {
    let stated = &places[..places.len() / sectors];
    let seen = Place::substructure_rows(stated);
    let reduced = substructure.component.reduced_sector(&disk.boundary, sectors, &seen, &substructure.reduction);
    let reduced = reduced.map_err(|error| error.to_string())?;
    let mut seen = reduced.seen.into_iter();
    let mut places = stated.to_vec();
    for place in &mut places {
        // The file uses the name without the sector number.
        place.name = place.name.strip_suffix("_0").unwrap_or(&place.name).to_owned();
        match &mut place.view_of {
            Some(of) => *of = of.strip_suffix("_0").unwrap_or(of).to_owned(),
            None => place.rows.iter_mut().zip(&mut seen).for_each(|(row, seen)| *row = seen),
        }
    }
    let n = reduced.pairs.len();
    let earlier = ReductionAccuracy { error: reduced.error, up_to: reduced.up_to };
    let earlier = substructure.earlier_reduction.map_or(earlier, |first| first.combine(earlier));
    let sector = Sector { sectors, rows: reduced.component.rows().to_vec(), pairs: reduced.pairs };
    let system = assembled(reduced.component, earlier, places)?;
    let what =
        format!("{n} coordinates ({}), error {:.1e} up to {:.6} Hz", reduced.kind, reduced.error, reduced.up_to / TAU);
    Ok(ReducedStructure {
        system,
        description: what,
        keys: damping_keys(substructure),
        second_stiffness: None,
        sector: Some(sector),
    })
}

/// Assembles reduced matrices as a structure.
fn assembled(component: Component, earlier: ReductionAccuracy, places: Vec<Place>) -> Result<System, String> {
    let (damping, reduction) = (SubstructureDamping::Own, Reduction::None { up_to: 0.0 });
    let whole = Substructure { component, damping, reduction, earlier_reduction: Some(earlier), disk: None };
    let model = Model { substructure: Some(whole), places, ..Model::default() };
    model.assemble().map_err(|error| error.to_string())
}

/// Returns the keys for damping.
///
/// Rayleigh damping follows the stiffness at every speed. Modal damping uses the modes of a
/// reduction at that speed.
fn damping_keys(substructure: &Substructure) -> Vec<String> {
    let reduce = match substructure.reduction {
        Reduction::UpTo { up_to, tolerance, kind } => {
            format!("reduce = {{ up_to = \"{:e} rad/s\", tolerance = {tolerance:e}{} }}", up_to, kind_key(kind))
        }
        // The frequency limit of its error comes from the study.
        Reduction::Modes { modes, kind: ReductionKind::Rubin, orders, .. } if orders > 1 => {
            format!("reduce = {{ modes = {modes}, orders = {orders} }}")
        }
        Reduction::Modes { modes, kind, .. } => format!("reduce = {{ modes = {modes}{} }}", kind_key(Some(kind))),
        Reduction::None { .. } => "reduce = false".to_owned(),
    };
    match substructure.damping {
        SubstructureDamping::Own => vec!["reduce = false".to_owned()],
        SubstructureDamping::Rayleigh { mass, stiffness } => vec![
            "reduce = false".to_owned(),
            format!("rayleigh = {{ mass = \"{mass:e} /s\", stiffness = \"{stiffness:e} s\" }}"),
        ],
        SubstructureDamping::Ratio(ratio) | SubstructureDamping::RatioUpTo { ratio, .. } => {
            vec![reduce, format!("modal_damping = {ratio:e}")]
        }
    }
}

fn kind_key(kind: Option<ReductionKind>) -> &'static str {
    match kind {
        None => "",
        Some(ReductionKind::Rubin) => ", kind = \"rubin\"",
        Some(ReductionKind::CraigBampton) => ", kind = \"craig-bampton\"",
    }
}

fn save(reduced: &ReducedStructure, out: &Path) -> Result<(), String> {
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let (system, n, structure) = (&reduced.system, reduced.system.dofs(), reduced.system.structure());
    let mut files: Vec<(&str, Entries)> = Vec::new();
    for (number, key) in ["mass", "damping", "stiffness"].into_iter().enumerate() {
        if key != "damping" || structure.largest()[number] > 0.0 {
            files.push((key, structure.entries().map(|(i, k, values)| (i, k, values[number])).collect()));
        }
    }
    files.extend(reduced.second_stiffness.iter().map(|there| ("stiffened", there.entries().collect())));
    let mut text = format!("# {}\n[structure]\nunits = \"m-kg-s\"\n{}\n", reduced.description, reduced.keys.join("\n"));
    if let Some(ReductionAccuracy { error, up_to }) = reduced.system.reduction_evidence() {
        let _ = writeln!(text, "reduced = {{ error = {error:e}, up_to = \"{up_to:e} rad/s\" }}");
    }
    for (key, entries) in files {
        let path: PathBuf = out.join(format!("{key}.mtx"));
        let made = Matrix::new(n, n, Symmetry::General, entries).map_err(|error| error.to_string())?;
        stickslip_formats::write(&path, &made).map_err(|error| error.to_string())?;
        if let (Some(sector), "mass") = (&reduced.sector, key) {
            let made = made.with_names(sector.rows.clone());
            let made = made.and_then(|named| names::write(out.join(ROWS), &named));
            made.map_err(|error| error.to_string())?;
            let _ = writeln!(text, "dofs = \"{ROWS}\"");
        }
        // The key `stiffened` also contains a speed.
        if key != "stiffened" {
            let _ = writeln!(text, "{key} = \"{key}.mtx\"");
        }
    }
    if let Some(Sector { sectors, pairs, .. }) = &reduced.sector {
        let lines: String = pairs.iter().map(|(low, high)| format!("{low},{high}\n")).collect();
        let path = out.join(BOUNDARY);
        std::fs::write(&path, format!("low,high\n{lines}")).map_err(|error| format!("{}: {error}", path.display()))?;
        let _ = writeln!(text, "\n[disk]\nsectors = {sectors}\nboundary = \"{BOUNDARY}\"");
    }
    let mut nodes: Vec<(&str, Vec<(&str, &Axis)>)> = Vec::new();
    for (place, axis) in system.places().iter().zip(system.place_axes()) {
        let (name, along) = place.split_once('.').unwrap_or((place, ""));
        match nodes.last_mut().filter(|(last, _)| *last == name) {
            Some((_, axes)) => axes.push((along, axis)),
            None => nodes.push((name, vec![(along, axis)])),
        }
    }
    for (name, axes) in nodes {
        let _ = writeln!(text, "\n[[place]]\nname = \"{name}\"");
        let directions: Vec<String> = axes.iter().map(|(along, _)| format!("\"{along}\"")).collect();
        if axes.iter().any(|(along, _)| !along.is_empty()) {
            let _ = writeln!(text, "directions = [{}]", directions.join(", "));
        }
        let sums: Vec<String> = axes.iter().map(|(_, axis)| sum(axis, reduced.sector.as_ref())).collect();
        let _ = writeln!(text, "sum = [\n  {},\n]", sums.join(",\n  "));
    }
    let path = out.join(TABLES);
    std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Writes the weights of the coordinates with all digits. Coordinates count from 1, or have
/// names in a sector.
fn sum(axis: &Axis, sector: Option<&Sector>) -> String {
    let name = |row: usize| sector.map_or_else(|| (row + 1).to_string(), |sector| sector.rows[row].clone());
    let weights: Vec<String> =
        axis.rows().iter().map(|(row, weight)| format!("\"{}\" = {weight:e}", name(*row))).collect();
    format!("{{ {} }}", weights.join(", "))
}
