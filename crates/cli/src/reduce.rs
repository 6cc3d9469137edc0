//! `stickslip reduce`: saves the reduced structure of a study as files for other studies.

use crate::ending::{Ending, print};
use crate::{run, speak};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip::model::{Axis, DiskPart, Model, Place, ReductionAccuracy, Substructure, SubstructureDamping, System};
use stickslip::structure::reduction::Row;
use stickslip::structure::{Component, Reduction, ReductionKind};
use stickslip_formats::{Matrix, Symmetry, names};
use stickslip_numerics::sparse;
use stickslip_study::Exports;

/// Name of the file with `[structure]` and `[[place]]`.
const TABLES: &str = "structure.toml";
/// Files with the row names of a disk sector, and with the node pairs of its sides.
const ROWS: &str = "rows.csv";
const BOUNDARY: &str = "boundary.csv";

/// Reduces the structure of the first case and writes it into the folder `out`.
pub fn reduce(file: &Path, set: &[(String, String)], out: &Path) -> Ending {
    let read = stickslip_study::read_file(file, set).and_then(|study| Ok((study.case(0)?.model, study.stiffened())));
    let (model, exports) = match read {
        Ok(read) => read,
        Err(error) => {
            run::show(&error);
            return Ending::WrongInput;
        }
    };
    let failed = |message: &str| Ending::Failed(format!("{}: {message}", file.display()));
    let wrong = |message: &str| {
        speak::error(&format!("{}: {message}", file.display()));
        Ending::WrongInput
    };
    let Some(substructure) = &model.substructure else {
        return wrong("there is no [structure] that could be reduced");
    };
    if let Reduction::None { .. } = substructure.reduction {
        return wrong(
            "all rows of its [structure] are kept, since there are few or reduce = false says so: nothing is to be saved; say how far the reduction is to \
             reach, as in reduce = { up_to = \"5 kHz\" }",
        );
    }
    if let Some(disk) = &substructure.disk {
        if exports.is_some() {
            return wrong(
                "the sector of a disk is saved at one speed: leave out `stiffened`, and name the file of that speed under `stiffness`",
            );
        }
        if !disk.blade.is_empty() || disk.deviations.iter().any(|deviation| *deviation != 0.0) {
            return wrong(
                "the blades of this disk differ, and what is left out of a sector is chosen for blades that do not: leave out `blade` and `mistuning`",
            );
        }
    }
    let few = match (exports, model.ring.map(|ring| ring.sectors).zip(substructure.disk.as_ref())) {
        (Some(exports), _) => over_speeds(substructure, &model.places, &exports),
        (None, Some((sectors, disk))) => sector(substructure, &model.places, (sectors, disk)),
        (None, None) => at_rest(substructure, &model.places),
    };
    match few.and_then(|few| save(&few, out).map(|()| few)) {
        Ok(few) => print(&format!(
            "{}: {} rows, {}\n  written to {}; put {} in the place of {}\n",
            file.display(),
            substructure.component.dofs(),
            few.what,
            out.display(),
            out.join(TABLES).display(),
            if few.sector.is_some() { "[structure], [[place]] and [disk]" } else { "[structure] and [[place]]" },
        )),
        Err(message) => failed(&message),
    }
}

/// The reduced structure to save.
struct Few {
    system: System,
    /// Description of the reduction, with its error.
    what: String,
    /// Additional keys of `[structure]`.
    keys: Vec<String>,
    /// Stiffness at the second speed, if rotation stiffens the structure.
    there: Option<sparse::Matrix>,
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

fn at_rest(substructure: &Substructure, places: &[Place]) -> Result<Few, String> {
    let alone = Model { substructure: Some(substructure.clone()), places: places.to_vec(), ..Model::default() };
    let system = alone.assemble().map_err(|error| error.to_string())?;
    let what = system.reduced().map(ToString::to_string).unwrap_or_default();
    Ok(Few { system, what, keys: vec!["reduce = false".to_owned()], there: None, sector: None })
}

/// Reduces with one basis for all speeds up to that of the second export.
fn over_speeds(substructure: &Substructure, places: &[Place], exports: &Exports) -> Result<Few, String> {
    let seen: Vec<Row> =
        places.iter().filter(|place| place.view_of.is_none()).flat_map(|place| place.rows.clone()).collect();
    let few = exports.rest.reduced_for_two_stiffnesses(&exports.there, &seen, &substructure.reduction);
    let few = few.map_err(|error| error.to_string())?;
    let mut seen = few.seen.into_iter();
    let mut places: Vec<Place> = places.to_vec();
    let rows = places.iter_mut().filter(|place| place.view_of.is_none()).flat_map(|place| &mut place.rows);
    rows.zip(&mut seen).for_each(|(row, seen)| *row = seen);
    let n = few.component.dofs();
    let earlier = ReductionAccuracy { error: few.error, up_to: few.up_to };
    let earlier = substructure.earlier_reduction.map_or(earlier, |first| first.combine(earlier));
    let system = whole(few.component, earlier, places)?;
    let what = format!(
        "{n} coordinates ({}), error {:.1e} up to {:.6} Hz, at all speeds up to {:.6} rpm",
        few.kind,
        few.error,
        few.up_to / TAU,
        60.0 * exports.at / TAU
    );
    let speed = format!(
        "stiffened = {{ file = \"stiffened.mtx\", at = \"{:e} rad/s\", speed = {:?} }}   # an expression over the parameters of the study",
        exports.at, exports.speed
    );
    let keys = [vec![speed], damping_keys(substructure)].concat();
    Ok(Few { system, what, keys, there: Some(few.other_stiffness), sector: None })
}

/// Reduces the sector of a disk with one basis for all its travelling waves.
fn sector(substructure: &Substructure, places: &[Place], (sectors, disk): (usize, &DiskPart)) -> Result<Few, String> {
    let stated = &places[..places.len() / sectors];
    let seen: Vec<Row> = stated.iter().flat_map(|place| place.rows.clone()).collect();
    let few = substructure.component.reduced_sector(&disk.boundary, sectors, &seen, &substructure.reduction);
    let few = few.map_err(|error| error.to_string())?;
    let mut seen = few.seen.into_iter();
    let mut places = stated.to_vec();
    for place in &mut places {
        // The file uses the name without the sector number.
        place.name = place.name.strip_suffix("_0").unwrap_or(&place.name).to_owned();
        place.rows.iter_mut().zip(&mut seen).for_each(|(row, seen)| *row = seen);
    }
    let n = few.pairs.len();
    let earlier = ReductionAccuracy { error: few.error, up_to: few.up_to };
    let earlier = substructure.earlier_reduction.map_or(earlier, |first| first.combine(earlier));
    let sector = Sector { sectors, rows: few.component.rows().to_vec(), pairs: few.pairs };
    let system = whole(few.component, earlier, places)?;
    let what = format!("{n} coordinates ({}), error {:.1e} up to {:.6} Hz", few.kind, few.error, few.up_to / TAU);
    Ok(Few { system, what, keys: damping_keys(substructure), there: None, sector: Some(sector) })
}

/// Assembles reduced matrices as a structure.
fn whole(component: Component, earlier: ReductionAccuracy, places: Vec<Place>) -> Result<System, String> {
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
            format!("reduce = {{ up_to = \"{:e} rad/s\", tolerance = {tolerance:e}{} }}", up_to, named(kind))
        }
        // The frequency limit of its error comes from the study.
        Reduction::Modes { modes, kind: ReductionKind::Rubin, orders, .. } if orders > 1 => {
            format!("reduce = {{ modes = {modes}, orders = {orders} }}")
        }
        Reduction::Modes { modes, kind, .. } => format!("reduce = {{ modes = {modes}{} }}", named(Some(kind))),
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

fn named(kind: Option<ReductionKind>) -> &'static str {
    match kind {
        None => "",
        Some(ReductionKind::Rubin) => ", kind = \"rubin\"",
        Some(ReductionKind::CraigBampton) => ", kind = \"craig-bampton\"",
    }
}

fn save(few: &Few, out: &Path) -> Result<(), String> {
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let (system, n, structure) = (&few.system, few.system.dofs(), few.system.structure());
    let mut files: Vec<(&str, Entries)> = Vec::new();
    for (number, key) in ["mass", "damping", "stiffness"].into_iter().enumerate() {
        if key != "damping" || structure.largest()[number] > 0.0 {
            files.push((key, structure.entries().map(|(i, k, values)| (i, k, values[number])).collect()));
        }
    }
    files.extend(few.there.iter().map(|there| ("stiffened", there.entries().collect())));
    let mut text = format!("# {}\n[structure]\nunits = \"m-kg-s\"\n{}\n", few.what, few.keys.join("\n"));
    if let Some(ReductionAccuracy { error, up_to }) = few.system.reduction_evidence() {
        let _ = writeln!(text, "reduced = {{ error = {error:e}, up_to = \"{up_to:e} rad/s\" }}");
    }
    for (key, entries) in files {
        let path: PathBuf = out.join(format!("{key}.mtx"));
        let made = Matrix::new(n, n, Symmetry::General, entries).map_err(|error| error.to_string())?;
        stickslip_formats::write(&path, &made).map_err(|error| error.to_string())?;
        if let (Some(sector), "mass") = (&few.sector, key) {
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
    if let Some(Sector { sectors, pairs, .. }) = &few.sector {
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
        let sums: Vec<String> = axes.iter().map(|(_, axis)| sum(axis, few.sector.as_ref())).collect();
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
