//! `stickslip reduce`: the structure of a study in few coordinates, as files that a study can read instead of the whole.

use crate::{Ending, print, run};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip::model::{Axis, Model, System};
use stickslip_formats::{Matrix, Symmetry};
use stickslip_study::StudyError;

/// Name of the file with `[structure]` and `[[place]]`.
const TABLES: &str = "structure.toml";

/// Reduces the structure of the first case and writes it into the folder `out`.
pub fn reduce(file: &Path, set: &[(String, String)], out: &Path) -> Ending {
    let (model, stiffened) = match model(file, set) {
        Ok(read) => read,
        Err(error) => {
            run::show(&error);
            return Ending::WrongInput;
        }
    };
    let Some(substructure) = &model.substructure else {
        return Ending::Failed(format!("{}: there is no [structure] that could be reduced", file.display()));
    };
    if model.ring.is_some() {
        let message =
            "a sector of a disk is reduced for all of its waves by every study of it, and has no files of its own";
        return Ending::Failed(format!("{}: {message}", file.display()));
    }
    if stiffened {
        let message = "rotation stiffens its [structure] (`stiffened`), so that a reduction serves one speed, and files of it would be those of that speed \
                       alone; leave `stiffened` out to save the structure at rest, or name the stiffness of one speed as `stiffness`. Studies reduce at every \
                       speed by themselves";
        return Ending::Failed(format!("{}: {message}", file.display()));
    }
    let alone = Model { substructure: Some(substructure.clone()), places: model.places.clone(), ..Model::default() };
    let system = match alone.assemble() {
        Ok(system) => system,
        Err(error) => return Ending::Failed(error.to_string()),
    };
    let Some(reduced) = system.reduced() else {
        let message =
            "its [structure] says reduce = false: nothing is to be saved; say how far the reduction is to reach";
        return Ending::Failed(format!("{}: {message}", file.display()));
    };
    match save(&system, &format!("{reduced}"), out) {
        Ok(()) => print(&format!(
            "{}: {} rows, {reduced}\n  written to {}; put {} in the place of [structure] and [[place]]\n",
            file.display(),
            substructure.component.dofs(),
            out.display(),
            out.join(TABLES).display(),
        )),
        Err(message) => Ending::Failed(message),
    }
}

/// The model of the first case, and whether its structure depends on a speed.
fn model(file: &Path, set: &[(String, String)]) -> Result<(Model, bool), StudyError> {
    let study = stickslip_study::read_file(file, set)?;
    Ok((study.case(0)?.model, study.is_stiffened()))
}

fn save(system: &System, what: &str, out: &Path) -> Result<(), String> {
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    let (n, structure) = (system.dofs(), system.structure());
    let mut files = vec![("stiffness", structure.stiffness()), ("mass", structure.mass())];
    if structure.largest()[1] > 0.0 {
        files.push(("damping", structure.damping()));
    }
    let mut text = format!("# {what}\n[structure]\nunits = \"m-kg-s\"\nreduce = false\n");
    for (key, matrix) in files {
        let path: PathBuf = out.join(format!("{key}.mtx"));
        let entries = (0..n).flat_map(|k| (0..n).map(move |i| (i, k))).map(|at| (at.0, at.1, matrix[at]));
        let made =
            Matrix::new(n, n, Symmetry::General, entries).and_then(|matrix| stickslip_formats::write(&path, &matrix));
        made.map_err(|error| error.to_string())?;
        let _ = writeln!(text, "{key} = \"{key}.mtx\"");
    }
    let mut nodes: Vec<(&str, Vec<(&str, &Axis)>)> = Vec::new();
    for (place, axis) in system.places().iter().zip(system.seen()) {
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
        let sums: Vec<String> = axes.iter().map(|(_, axis)| sum(axis)).collect();
        let _ = writeln!(text, "sum = [\n  {},\n]", sums.join(",\n  "));
    }
    let path = out.join(TABLES);
    std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// The weights of the coordinates, which count from 1, to the last bit.
fn sum(axis: &Axis) -> String {
    let weights: Vec<String> =
        axis.rows().iter().map(|(row, weight)| format!("\"{}\" = {weight:e}", row + 1)).collect();
    format!("{{ {} }}", weights.join(", "))
}
