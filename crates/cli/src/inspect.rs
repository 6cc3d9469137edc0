//! `stickslip inspect`: what is in files of matrices, and whether they can be those of a structure.

use crate::{Ending, print};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip::structure::Component;
use stickslip_formats::{self as formats, Error, Kind, Matrix, Report, names};
use stickslip_numerics::definite::sparse_definite;
use stickslip_numerics::sparse;

/// Frequencies that are shown of a pair of matrices.
const LOWEST: usize = 6;

/// A matrix with its name for people.
struct Named {
    name: String,
    matrix: Matrix,
}

/// Shows every matrix in the files, and of a pair of stiffness and mass the lowest frequencies.
pub fn inspect(files: &[PathBuf], format: Option<&str>) -> Ending {
    let (mut text, mut wrong) = (String::new(), false);
    let mut square: Vec<Named> = Vec::new();
    let mut rows = Vec::new();
    let mut beside = None;
    for file in files {
        match one(file, format, &mut text) {
            Ok(matrices) => square.extend(matrices),
            // names of rows stand in files of their own
            Err(error) if error.kind == Kind::Format && format.is_none() => rows.push((file, error)),
            Err(error) => {
                complain!("error: {error}");
                wrong = true;
            }
        }
    }
    for (file, error) in rows {
        let count = square.first().map_or(0, |named| named.matrix.rows());
        match names::read(file, count) {
            Ok(names) => {
                let shown: Vec<&str> =
                    names.iter().filter(|name| !name.is_empty()).take(LOWEST).map(String::as_str).collect();
                let _ =
                    writeln!(text, "{}\n  names of {} rows: {}, …\n", file.display(), names.len(), shown.join(", "));
                beside = Some(names);
            }
            Err(other) => {
                complain!("error: {}", if other.kind == Kind::Names { other } else { error });
                wrong = true;
            }
        }
    }
    if let [a, b] = &square[..]
        && a.matrix.rows() == b.matrix.rows()
    {
        text += &pair(a, b, beside.as_deref());
    }
    match (wrong, print(&text)) {
        (true, _) => Ending::WrongInput,
        (false, ending) => ending,
    }
}

/// The matrices of one file, described in `text`.
fn one(file: &Path, format: Option<&str>, text: &mut String) -> Result<Vec<Named>, Error> {
    let variables = formats::list(file, format)?;
    let _ = writeln!(text, "{}", file.display());
    let mut found = Vec::new();
    for variable in &variables {
        let several = variables.len() > 1;
        if let Some(note) = &variable.note {
            let _ = writeln!(text, "  {variable}: {note}");
            continue;
        }
        let name = Some(variable.name.as_str()).filter(|name| !name.is_empty());
        let matrix = match formats::read(file, format, name) {
            Ok(matrix) => matrix,
            Err(error) if several => {
                let _ = writeln!(text, "  {variable}: {error}");
                continue;
            }
            Err(error) => return Err(error),
        };
        if several {
            let _ = writeln!(text, "  {}", variable.name);
        }
        for line in Report::new(&matrix).to_string().lines() {
            let _ = writeln!(text, "  {line}");
        }
        if matrix.rows() == matrix.columns() && matrix.rows() > 1 {
            if let Some(sparse) =
                converted(&matrix).filter(|sparse| sparse.asymmetry(SYMMETRIC * sparse.largest()).is_none())
            {
                let _ = writeln!(text, "  {}", definite(&sparse));
            }
            let name = match name {
                Some(name) => format!("{}, {name}", file.display()),
                None => file.display().to_string(),
            };
            found.push(Named { name, matrix });
        }
    }
    text.push('\n');
    Ok(found)
}

/// Difference across the diagonal, relative to the largest entry, of a matrix that was written with ten digits.
const SYMMETRIC: f64 = 1e-9;

fn converted(matrix: &Matrix) -> Option<sparse::Matrix> {
    let entries = matrix.both_triangles().map(|entry| (entry.row as usize, entry.column as usize, entry.value));
    sparse::Matrix::from_triplets(matrix.rows(), entries).ok()
}

fn definite(matrix: &sparse::Matrix) -> &'static str {
    match sparse_definite(matrix) {
        Some(true) => "positive definite",
        Some(false) => "positive semidefinite: some motion has none of it",
        None => "not positive semidefinite",
    }
}

/// Lowest frequencies of two matrices, of which that with the larger entries is the stiffness, and what the units may be, if their rows have names, of
/// their own or `beside` them.
fn pair(a: &Named, b: &Named, beside: Option<&[String]>) -> String {
    let (stiffness, mass) = if a.matrix.largest() >= b.matrix.largest() { (a, b) } else { (b, a) };
    let mut text = format!("{} as stiffness, {} as mass\n", stiffness.name, mass.name);
    let rows = stiffness.matrix.rows();
    let names = stiffness.matrix.names().or(mass.matrix.names()).or(beside.filter(|names| names.len() == rows));
    let names = names.map_or_else(|| vec![String::new(); rows], <[String]>::to_vec);
    let found =
        converted(&stiffness.matrix).zip(converted(&mass.matrix)).ok_or_else(|| "an entry is not finite".to_owned());
    let found = found.and_then(|(k, m)| Component::new(names.clone(), m, None, k).map_err(|error| error.to_string()));
    let frequencies = found.and_then(|component| component.frequencies(LOWEST).map_err(|error| error.to_string()));
    match frequencies {
        Ok(lowest) => {
            let hertz = |unit: f64| {
                lowest.iter().map(|omega| format!("{:.6e}", omega / TAU * unit)).collect::<Vec<_>>().join(", ")
            };
            let _ = writeln!(text, "  lowest frequencies, Hz: {} (times in seconds)", hertz(1.0));
            let _ = writeln!(text, "                          {} (times in milliseconds)", hertz(1e3));
        }
        Err(error) => {
            let _ = writeln!(text, "  no frequencies: {error}");
        }
    }
    let along: Vec<usize> = (0..rows).filter(|row| names[*row].ends_with(".x")).collect();
    if !along.is_empty() {
        let total: f64 = mass
            .matrix
            .both_triangles()
            .filter(|entry| [entry.row, entry.column].iter().all(|at| along.binary_search(&(*at as usize)).is_ok()))
            .map(|entry| entry.value)
            .sum();
        let _ = writeln!(
            text,
            "  mass along x, of what is free: {total:.6e}, which is {:.4e} kg in tonnes and {:.4e} kg in grams",
            1e3 * total,
            1e-3 * total
        );
    }
    text
}
