//! Reads `[structure]`: the matrices of a structure with the names of their rows, once for all
//! cases.
//!
//! Constrained rows that a program keeps, with 1e36 on the diagonal or without any entry, are
//! left out.

use super::reader::Reader;
use super::structure_cache::StructureKey;
use crate::case::reduction_folder::ReductionFolder;
use crate::case::stress_stiffening::StressStiffening;
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::compile::source_model::{MatrixSource, StressMatrix, exchange_advice, plausible_frequencies};
use crate::syntax::document::TomlTable;
use crate::syntax::error::Problem;
use crate::syntax::schema::STRUCTURE;
use crate::syntax::unit_sets::{self, UnitSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stickslip::structure::{Component, StructureError};
use stickslip_formats::{self as formats, names};
use stickslip_numerics::parallel::map_array;
use stickslip_numerics::sparse::SparseMatrix;

impl Reader {
    /// Reads the table and its matrices; `None` if a problem was found.
    pub(super) fn matrices(&mut self, table: &TomlTable, study_file: &str) -> Option<MatrixSource> {
        let before = self.problems.len();
        let stated = self.table(table, STRUCTURE, "[structure]");
        let several = ["damping", "modal_damping", "rayleigh"].into_iter().filter(|key| stated.entry(key).is_some());
        let several: Vec<&str> = several.collect();
        if let [first, second, ..] = several[..] {
            let message = format!("`{first}` and `{second}` exclude each other: a structure has one damping");
            self.problems
                .push(Problem::new(stated.location_of(second, None), second, message).help("remove one of them"));
        }
        if self.problems.len() > before {
            return None;
        }
        if self.study_file_only {
            return Some(MatrixSource {
                table: stated,
                component: None,
                stress_stiffening: None,
                constrained_rows: 0,
                stress: None,
            });
        }
        let folder = Path::new(study_file).parent().unwrap_or(Path::new(""));
        let known = self.structures.as_ref().zip(structure_key(&stated, folder));
        let structure = match known {
            Some((kept, key)) => kept.get_or_read(key, || read(&stated, folder)),
            None => read(&stated, folder),
        };
        match structure {
            Ok(ReadStructure { component, stress_stiffening, constrained_rows, stress }) => {
                if let Err(problem) = keep_reductions(&stated, folder, &component) {
                    self.problems.push(problem);
                    return None;
                }
                let component = Some(component);
                Some(MatrixSource { table: stated, component, stress_stiffening, constrained_rows, stress })
            }
            Err(problem) => {
                self.problems.push(problem);
                None
            }
        }
    }
}

/// The content of the files of `[structure]`.
#[derive(Debug, Clone)]
pub(super) struct ReadStructure {
    pub component: Component,
    /// The stiffness that rotation adds.
    pub stress_stiffening: Option<StressStiffening>,
    /// Number of constrained rows in the files, which the component does not contain.
    pub constrained_rows: usize,
    /// The matrix of stresses, if one is named.
    pub stress: Option<Arc<StressMatrix>>,
}

/// Keeps the reductions of the structure in the folder of `keep_reductions`, if it is stated.
fn keep_reductions(stated: &CompiledTable, folder: &Path, component: &Component) -> Result<(), Problem> {
    const KEY: &str = "keep_reductions";
    let Some(CompiledValue::Fixed(ResolvedValue::Text(path))) = stated.entry(KEY).map(|entry| &entry.value) else {
        return Ok(());
    };
    let kept = ReductionFolder::create(folder.join(path)).map_err(|error| {
        let message = match folder.join(path).exists() {
            true => format!("`{path}` is a file, not a folder"),
            false => format!("the folder `{path}` cannot be created: {error}"),
        };
        Problem::new(stated.location_of(KEY, None), KEY, message)
    })?;
    component.keep_reductions(Arc::new(kept));
    Ok(())
}

/// Returns what identifies the content of the files; `None` if a file cannot be found.
fn structure_key(stated: &CompiledTable, folder: &Path) -> Option<StructureKey> {
    let keys = ["stiffness", "mass", "damping", "stiffened", "dofs", "stress", "stress_rows"];
    let files: Vec<_> = keys.into_iter().filter_map(|key| Some((key, file(stated, key)?))).collect();
    let units = match &stated.entry("units")?.value {
        CompiledValue::Fixed(ResolvedValue::Text(text)) => text,
        _ => return None,
    };
    StructureKey::new(&files, units, folder)
}

/// A matrix and its key in the table.
type KeyedMatrix = (&'static str, formats::Matrix);

fn read(stated: &CompiledTable, folder: &Path) -> Result<ReadStructure, Problem> {
    let problem = |key: &str, message: String| Problem::new(stated.location_of(key, None), key, message);
    let one = |key: &'static str| -> Result<Option<KeyedMatrix>, Problem> {
        let Some(file) = file(stated, key) else { return Ok(None) };
        let path = folder.join(&file.path);
        if key == "damping" && file.path.to_string_lossy().ends_with('%') && !path.exists() {
            let message = format!("`{}` is not a file; `damping` names the file of a matrix", file.path.display());
            let help = format!("write the damping ratio of all modes as modal_damping = \"{}\"", file.path.display());
            return Err(problem(key, message).help(help));
        }
        let matrix = formats::read(&path, file.format.as_deref(), file.name.as_deref());
        let matrix = matrix
            .and_then(|matrix| matrix.require_square().map(|()| matrix))
            .map_err(|error| message_and_help(error, &path));
        matrix.map(|matrix| Some((key, matrix))).map_err(|(message, help)| problem(key, message).help(help))
    };
    let missing = |key| problem(key, "the file is missing".to_owned());
    let [stiffness, mass] = map_array(["stiffness", "mass"], rayon::current_num_threads(), one);
    let stiffness = stiffness?.ok_or_else(|| missing("stiffness"))?;
    // some programs leave out empty rows; the rows of the stiffness matrix determine the order
    let ordered = |(key, matrix): KeyedMatrix| {
        let path = file(stated, key).map_or_else(PathBuf::new, |file| folder.join(file.path));
        let ordered = formats::align_rows(matrix, &stiffness.1).map_err(|error| message_and_help(error, &path));
        ordered.map(|matrix| (key, matrix)).map_err(|(message, help)| problem(key, message).help(help))
    };
    let mass = ordered(mass?.ok_or_else(|| missing("mass"))?)?;
    let damping = one("damping")?.map(ordered).transpose()?;
    let stiffened = one("stiffened")?.map(ordered).transpose()?;
    let rows = stiffness.1.rows();
    for (key, matrix) in [Some(&mass), damping.as_ref(), stiffened.as_ref()].into_iter().flatten() {
        if matrix.rows() != rows {
            // a truncated file has fewer rows
            let (short, long) = if matrix.rows() < rows { (*key, "stiffness") } else { ("stiffness", *key) };
            let (fewer, more) = (rows.min(matrix.rows()), rows.max(matrix.rows()));
            let message = format!("the {short} matrix has {fewer} rows, but the {long} matrix has {more}");
            let help = "one file may be truncated; export both from the same model with the same constraints";
            return Err(problem(short, message).help(help));
        }
    }
    if stiffness.1.entries() == mass.1.entries() {
        let message = "this file contains the stiffness matrix again".to_owned();
        return Err(problem("mass", message).help("name the file of the mass matrix, or its `name` in the file"));
    }
    if stiffened.as_ref().is_some_and(|(_, matrix)| matrix.entries() == stiffness.1.entries()) {
        let message = "this file contains the stiffness at rest again".to_owned();
        return Err(
            problem("stiffened", message).help("name the file of the prestressed model, or its `name` in the file")
        );
    }
    let names = row_names(stated, folder, [&stiffness.1, &mass.1])?;
    let (damped, spins) = (damping.is_some(), stiffened.is_some());
    let all: Vec<KeyedMatrix> = [Some(stiffness), Some(mass), damping, stiffened].into_iter().flatten().collect();
    let left_out = formats::constrained_rows(&all.iter().map(|(_, matrix)| matrix).collect::<Vec<_>>(), rows);
    let kept: Vec<usize> = (0..rows).filter(|row| left_out.binary_search(row).is_err()).collect();
    let free = |(key, matrix): KeyedMatrix| {
        let free = matrix.without_rows(&left_out).map_err(|error| message_and_help(error, Path::new("")));
        free.map(|matrix| (key, matrix)).map_err(|(message, help)| problem(key, message).help(help))
    };
    let all = all.into_iter().map(free).collect::<Result<Vec<KeyedMatrix>, Problem>>()?;
    let units = match stated.entry("units").map(|entry| &entry.value) {
        Some(CompiledValue::Fixed(ResolvedValue::Text(text))) => unit_sets::find(text),
        _ => None,
    };
    let units = units.ok_or_else(|| problem("units", "the units are missing".to_owned()))?;
    let matrix = |key: &'static str, matrix: &formats::Matrix| {
        let unit = match key {
            "stiffness" | "stiffened" => units.stiffness(),
            "mass" => units.mass,
            _ => units.damping(),
        };
        let entries =
            matrix.both_triangles().map(|entry| (entry.row as usize, entry.column as usize, entry.value * unit));
        SparseMatrix::from_triplets(kept.len(), entries).map_err(|error| problem(key, error.to_string()))
    };
    let mut made = all.iter().map(|(key, read)| matrix(key, read));
    let mut next = || made.next().transpose();
    let (stiffness, mass) = (next()?, next()?);
    let (Some(stiffness), Some(mass)) = (stiffness, mass) else { return Err(missing("mass")) };
    let damping = if damped { next()? } else { None };
    let stiffened = if spins { next()? } else { None };
    let stiffened = stiffened.map(|there| StressStiffening::new(&stiffness, &there));
    let stiffened = stiffened.transpose().map_err(|error| problem("stiffened", error.to_string()))?;
    let name = |row: &usize| Some(&names[*row]).filter(|name| !name.is_empty()).cloned();
    let names = kept.iter().map(|row| name(row).unwrap_or_else(|| (row + 1).to_string())).collect();
    let component = Component::new(names, mass, damping, stiffness).map_err(|error| match &error {
        StructureError::NegativeMass => {
            // if the exchanged matrices form a valid structure, the help states the exchange
            let exchanged = match (matrix("mass", &all[0].1), matrix("stiffness", &all[1].1)) {
                (Ok(mass), Ok(stiffness)) => Component::new(vec![String::new(); kept.len()], mass, None, stiffness).ok(),
                _ => None,
            };
            let help = match exchanged.as_ref().and_then(plausible_frequencies) {
                Some(frequencies) => exchange_advice(&frequencies),
                None => "a mass matrix has no negative eigenvalue; check whether this file contains the stiffness \
                    matrix or is truncated"
                    .to_owned(),
            };
            problem("mass", error.to_string()).help(help)
        }
        StructureError::NotSymmetric { matrix, row, column, value, mirrored } => {
            let name = |at: usize| kept.get(at - 1).map_or(at, |row| row + 1);
            let (row, column) = (name(*row), name(*column));
            let message = format!(
                "the {matrix} matrix is not symmetric: {value:e} in row {row}, column {column} and {mirrored:e} across the diagonal"
            );
            problem(matrix, message).help("export both triangles, without rotation, follower loads or friction; a \
                file with only one triangle must be marked as symmetric")
        }
        _ => problem("stiffness", error.to_string()),
    })?;
    // the second export is checked at its speed of rotation
    if let Some(Err(error)) = stiffened.as_ref().map(|stiffened| stiffened.component_at(&component, 1.0)) {
        return Err(problem("stiffened", error.to_string()));
    }
    let stress = stress(stated, folder, units, (rows, &kept))?.map(Arc::new);
    Ok(ReadStructure { component, stress_stiffening: stiffened, constrained_rows: left_out.len(), stress })
}

/// Reads the matrix of stresses. `rows` is the number of rows of the structure in its file, and
/// `kept` are those that are not constrained.
fn stress(
    stated: &CompiledTable,
    folder: &Path,
    units: &UnitSet,
    (rows, kept): (usize, &[usize]),
) -> Result<Option<StressMatrix>, Problem> {
    let problem = |key: &str, message: String| Problem::new(stated.location_of(key, None), key, message);
    let Some(of) = file(stated, "stress") else {
        return match stated.entry("stress_rows") {
            Some(_) => Err(problem("stress_rows", "it names rows of `stress`, which is missing".to_owned())
                .help("add stress = \"blade_stress.mtx\", or remove `stress_rows`")),
            None => Ok(None),
        };
    };
    let path = folder.join(&of.path);
    let refuse = |key: &'static str, path: &Path, error: formats::Error| {
        let (message, help) = message_and_help(error, path);
        problem(key, message).help(help)
    };
    let matrix = formats::read(&path, of.format.as_deref(), of.name.as_deref());
    let matrix = matrix.map_err(|error| refuse("stress", &path, error))?;
    if matrix.columns() != rows {
        let message = format!(
            "the matrix of stresses has {} columns, but the stiffness matrix has {rows} rows",
            matrix.columns()
        );
        let help = "each column belongs to a row of the stiffness matrix, in its order; transpose the matrix if its \
                    rows belong to them";
        return Err(problem("stress", message).help(help));
    }
    let mut names = match file(stated, "stress_rows") {
        Some(of) => {
            let path = folder.join(&of.path);
            names::read(&path, matrix.rows()).map_err(|error| refuse("stress_rows", &path, error))?
        }
        None => vec![String::new(); matrix.rows()],
    };
    for (number, name) in names.iter_mut().enumerate().filter(|(_, name)| name.is_empty()) {
        *name = (number + 1).to_string();
    }
    let mut new = vec![None; rows];
    kept.iter().enumerate().for_each(|(at, row)| new[*row] = Some(at));
    // the unit of pressure per unit of displacement
    let unit = units.stiffness() / (units.length * units.length);
    let mut weights = vec![Vec::new(); matrix.rows()];
    for entry in matrix.both_triangles() {
        if let Some(at) = new[entry.column as usize] {
            weights[entry.row as usize].push((at, entry.value * unit));
        }
    }
    Ok(Some(StressMatrix { names, rows: weights }))
}

/// Returns message and help for an error of the file formats.
fn message_and_help(error: formats::Error, path: &Path) -> (String, String) {
    let mut error = error;
    if !path.as_os_str().is_empty() {
        error.path.get_or_insert_with(|| path.to_owned());
    }
    let remedy = std::mem::take(&mut error.remedy);
    let message = error.to_string();
    (message.trim_end_matches("; ").to_owned(), remedy)
}

/// A file as stated in the table.
pub(super) struct StatedFile {
    pub path: PathBuf,
    pub name: Option<String>,
    pub format: Option<String>,
}

fn file(stated: &CompiledTable, key: &str) -> Option<StatedFile> {
    let text = |stated: &CompiledValue| match stated {
        CompiledValue::Fixed(ResolvedValue::Text(text)) => Some(text.clone()),
        _ => None,
    };
    match &stated.entry(key)?.value {
        CompiledValue::Table(table) => {
            let of = |key: &str| text(&table.entry(key)?.value);
            Some(StatedFile { path: of("file")?.into(), name: of("name"), format: of("format") })
        }
        other => Some(StatedFile { path: text(other)?.into(), name: None, format: None }),
    }
}

/// Returns the names of all rows, from a separate file or from a matrix file; unnamed rows are
/// empty.
fn row_names(stated: &CompiledTable, folder: &Path, matrices: [&formats::Matrix; 2]) -> Result<Vec<String>, Problem> {
    let rows = matrices[0].rows();
    let Some(file) = file(stated, "dofs") else {
        let named = matrices.iter().find_map(|matrix| matrix.names());
        return Ok(named.map_or_else(|| vec![String::new(); rows], <[String]>::to_vec));
    };
    let path = folder.join(&file.path);
    names::read(&path, rows).map_err(|error| {
        let (message, help) = message_and_help(error, &path);
        Problem::new(stated.location_of("dofs", None), "dofs", message).help(help)
    })
}
