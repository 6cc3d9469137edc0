//! `stickslip inspect`: describes matrix files, and checks whether they can belong to a
//! structure. Describes meshes, too.

use crate::exit_status::{Exit, print};
use crate::inspect_data::{inspect_data, is_no_text};
use std::borrow::Cow;
use std::f64::consts::TAU;
use std::fmt::{self, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use stickslip::model::TRANSLATIONS;
use stickslip::structure::Component;
use stickslip_formats::mesh::{self, Mesh, MeshReport};
use stickslip_formats::{self as formats, Error, ErrorKind, Matrix, MatrixReport, align_rows, constrained_rows, names};
use stickslip_numerics::definiteness::sparse_definite;
use stickslip_numerics::sparse;
use stickslip_report::{mesh_picture, write_file};
use stickslip_study::summary::mass_along;
use stickslip_study::unit_sets;

/// Number of frequencies shown for a pair of matrices.
const LOWEST: usize = 6;

/// Usual masses of parts that vibrate with dry friction, in kg: a blade or a bracket, clamped
/// or free.
const USUAL_MASSES: RangeInclusive<f64> = 0.01..=100.0;

/// A matrix and its displayed name.
struct NamedMatrix {
    name: String,
    role: Option<Role>,
    matrix: Matrix,
}

/// Role of a matrix in a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Stiffness,
    Mass,
    Damping,
}

/// Word beginnings that state the role of a matrix: `STIF1`, `sti`, `mass`, `mas`, `damping`.
const WORDS: [(&str, Role); 3] = [("sti", Role::Stiffness), ("mas", Role::Mass), ("dam", Role::Damping)];
/// First letters of short names that state the role of a matrix: `K`, `KAAX`, `Mff`.
const LETTERS: [(char, Role); 4] =
    [('k', Role::Stiffness), ('m', Role::Mass), ('c', Role::Damping), ('d', Role::Damping)];

impl Role {
    /// Returns the role that the name of a matrix states, or that of its file if the matrix has
    /// no name.
    fn from_name(file: &Path, name: Option<&str>) -> Option<Role> {
        let text = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().to_lowercase());
        let (short, all) = match name {
            Some(name) => (name.to_lowercase(), name.to_lowercase()),
            None => (text(file.file_stem())?, text(file.file_name())?),
        };
        let words = || all.split(|letter: char| !letter.is_alphabetic());
        let said = WORDS.iter().find(|(word, _)| words().any(|of| of.starts_with(word)));
        // Maximum length of such a short name.
        let letter = short.chars().next().filter(|_| short.chars().count() <= 4);
        let begun = || LETTERS.iter().find(|(begins, _)| Some(*begins) == letter).map(|(_, role)| *role);
        said.map(|(_, role)| *role).or_else(begun)
    }
}

/// Describes every matrix in the files, and prints the lowest frequencies of stiffness and
/// mass. Writes a picture of the only mesh if a file is named for it.
pub fn inspect(files: &[PathBuf], format: Option<&str>, picture: Option<&Path>) -> Exit {
    let (mut text, mut wrong) = (String::new(), false);
    let mut meshes = Vec::new();
    let mut square: Vec<NamedMatrix> = Vec::new();
    let mut rows = Vec::new();
    let mut row_names = None;
    for file in files {
        if format.is_none() && file.extension().is_some_and(|extension| extension == "toml") {
            let file = file.display();
            complain!(
                "error: {file}: this command describes matrices, meshes and data; `stickslip check {file}` describes a study"
            );
            wrong = true;
            continue;
        }
        if format.is_none()
            && let Some(read) = mesh::read_if_mesh(file)
        {
            match read {
                Ok(mesh) => {
                    let _ = writeln!(text, "{}", file.display());
                    MeshReport(&mesh).to_string().lines().for_each(|line| text += &format!("  {line}\n"));
                    text.push('\n');
                    meshes.push((file, mesh));
                }
                Err(error) => {
                    complain!("error: {error}");
                    wrong = true;
                }
            }
            continue;
        }
        match inspect_file(file, format, &mut text) {
            Ok((matrices, whole)) => {
                square.extend(matrices);
                wrong |= !whole;
            }
            // Row names are in separate files.
            Err(error) if error.kind == ErrorKind::Format && format.is_none() => rows.push((file, error)),
            // Arrays that are no matrices are data. A damaged file of matrices is not.
            Err(error) => {
                let may_be_data = matches!(error.kind, ErrorKind::Unsupported | ErrorKind::NotFinite);
                if format.is_some()
                    || !may_be_data
                    || !inspect_data(file, &mut text, is_no_text).is_ok_and(|shown| shown)
                {
                    complain!("error: {error}");
                    wrong = true;
                }
            }
        }
    }
    for (file, error) in rows {
        let count = square.first().map(|named| named.matrix.rows());
        match names::read(file, count.unwrap_or(0)) {
            Ok(names) => {
                let shown: Vec<&str> =
                    names.iter().filter(|name| !name.is_empty()).take(LOWEST).map(String::as_str).collect();
                let _ =
                    writeln!(text, "{}\n  names of {} rows: {}, …\n", file.display(), names.len(), shown.join(", "));
                row_names = Some(names);
            }
            Err(other) => {
                match (other.kind, count) {
                    (ErrorKind::Names, None) => complain!(
                        "error: {}: this file contains row names; give it together with the square matrix, as \
                         in `stickslip inspect MATRIX {}`",
                        file.display(),
                        file.display()
                    ),
                    (ErrorKind::Names, Some(_)) => complain!("error: {other}"),
                    _ => match inspect_data(file, &mut text, |_| true) {
                        Ok(true) => continue,
                        // a table with a damaged line
                        Err(damaged) if damaged.kind != ErrorKind::Format => complain!("error: {damaged}"),
                        _ => complain!("error: {error}"),
                    },
                }
                wrong = true;
            }
        }
    }
    if square.len() > 1 {
        match choose(&square) {
            Ok((stiffness, mass, why)) => {
                let _ = writeln!(text, "{} as stiffness, {} as mass, {why}", stiffness.name, mass.name);
                let of_damping: Vec<&NamedMatrix> =
                    square.iter().filter(|named| named.role == Some(Role::Damping)).collect();
                let damping = Some(&of_damping[..]).filter(|all| all.len() == 1).map(|all| all[0]);
                text += &match Pair::new(stiffness, mass, damping, row_names.as_deref()) {
                    Ok(pair) => pair.to_string(),
                    Err(why) => format!("  no frequencies: {why}\n"),
                };
            }
            Err(why) => text += &format!("no frequencies: {why}\n"),
        }
    }
    if let Some(path) = picture {
        match draw(&meshes, path) {
            Ok(()) => text += &format!("wrote {}\n", path.display()),
            Err(problem) => {
                complain!("error: {problem}");
                wrong = true;
            }
        }
    }
    match (wrong, print(&text)) {
        (true, _) => Exit::WrongInput,
        (false, exit) => exit,
    }
}

/// Writes a picture of the only mesh.
fn draw(meshes: &[(&PathBuf, Mesh)], path: &Path) -> Result<(), String> {
    let [(file, mesh)] = meshes else {
        return Err(format!("--picture draws one mesh, but there are {}; name one file with a mesh", meshes.len()));
    };
    let title = file.file_name().unwrap_or_default().to_string_lossy();
    let picture = mesh_picture(mesh, &title).map_err(|error| error.to_string())?;
    write_file(path, &picture).map(|_| ()).map_err(|error| error.to_string())
}

/// Describes the matrices of one file in `text`.
///
/// Returns the square matrices, and `true` if no matrix is damaged.
fn inspect_file(file: &Path, format: Option<&str>, text: &mut String) -> Result<(Vec<NamedMatrix>, bool), Error> {
    let variables = formats::list(file, format)?;
    // arrays of a file of MATLAB, NumPy or HDF5 without any matrix of a structure are data
    let square = |variable: &formats::Variable| variable.rows == variable.columns && variable.rows > 1;
    let may_be_data = format.is_none() && !variables.is_empty() && !variables.iter().any(square);
    if may_be_data && inspect_data(file, text, is_no_text).is_ok_and(|shown| shown) {
        return Ok((Vec::new(), true));
    }
    let several = variables.len() > 1;
    if variables.is_empty() {
        formats::read(file, format, None)?;
    }
    let _ = writeln!(text, "{}", file.display());
    let (mut found, mut whole) = (Vec::new(), true);
    for variable in &variables {
        let name = Some(variable.name.as_str()).filter(|name| !name.is_empty());
        let matrix = match formats::read(file, format, name) {
            Ok(matrix) => matrix,
            // other content of the file, such as a text, is not an error
            Err(error) if several && matches!(error.kind, ErrorKind::Complex | ErrorKind::Unsupported) => {
                let _ = writeln!(text, "  {variable}");
                continue;
            }
            Err(error) if several => {
                let _ = writeln!(text, "  {variable}: {error}");
                whole = false;
                continue;
            }
            Err(error) => return Err(error),
        };
        if several {
            let _ = writeln!(text, "  {}", variable.name);
        }
        for line in MatrixReport::new(&matrix).to_string().lines() {
            let _ = writeln!(text, "  {line}");
        }
        if matrix.rows() == matrix.columns() && matrix.rows() > 1 {
            let out = constrained_rows(&[&matrix], matrix.rows());
            // Symmetry tolerance relative to the largest entry, for matrices written with ten
            // digits.
            if let Some(sparse) = converted(&matrix, &out)
                .filter(|sparse| sparse.n() > 0 && sparse.asymmetry(1e-9 * sparse.max_abs()).is_none())
            {
                let exception = if out.is_empty() { "" } else { ", except for rows without an entry or with 1e36" };
                let _ = writeln!(text, "  {}{exception}", definite(&sparse));
            }
            let role = Role::from_name(file, name);
            let name = match name {
                Some(name) => format!("{}, {name}", file.display()),
                None => file.display().to_string(),
            };
            found.push(NamedMatrix { name, role, matrix });
        }
    }
    text.push('\n');
    Ok((found, whole))
}

/// Returns a square matrix without some of its rows and columns.
fn converted(matrix: &Matrix, out: &[usize]) -> Option<sparse::SparseMatrix> {
    let free = if out.is_empty() { Cow::Borrowed(matrix) } else { Cow::Owned(matrix.clone().without_rows(out).ok()?) };
    let entries = free.both_triangles().map(|entry| (entry.row as usize, entry.column as usize, entry.value));
    sparse::SparseMatrix::from_triplets(free.rows(), entries).ok()
}

fn definite(matrix: &sparse::SparseMatrix) -> &'static str {
    match sparse_definite(matrix) {
        Some(true) => "positive definite",
        Some(false) => "positive semidefinite: some motion has no energy",
        None => "not positive semidefinite",
    }
}

/// Returns stiffness and mass among several matrices, and the criterion.
///
/// The criterion is their names. If the names of two matrices do not state their roles, the matrix
/// with the larger entries is the stiffness.
fn choose(square: &[NamedMatrix]) -> Result<(&NamedMatrix, &NamedMatrix, &'static str), String> {
    let of = |role: Role| square.iter().filter(|named| named.role == Some(role)).collect::<Vec<_>>();
    let (stiffness, mass, why) = match (&of(Role::Stiffness)[..], &of(Role::Mass)[..], square) {
        ([stiffness], [mass], _) => (*stiffness, *mass, "according to their names"),
        ([stiffness], [], [a, b]) => {
            (*stiffness, if a.role.is_none() { a } else { b }, "according to the name of the stiffness")
        }
        ([], [mass], [a, b]) => (if a.role.is_none() { a } else { b }, *mass, "according to the name of the mass"),
        ([], [], [a, b]) => {
            let larger = a.matrix.max_abs() >= b.matrix.max_abs();
            let (stiffness, mass) = if larger { (a, b) } else { (b, a) };
            (stiffness, mass, "because the entries of the first are larger (the names do not show the roles)")
        }
        _ => {
            return Err("the names do not show which matrix is the stiffness and which the mass (K and M, or \
                        stiffness and mass): give only these two files"
                .to_owned());
        }
    };
    Ok((stiffness, mass, why))
}

/// Stiffness and mass as in a study: rows matched by name, without constrained rows.
struct Pair {
    /// Number of constrained rows, which are removed.
    constrained: usize,
    /// The lowest angular frequencies, or the reason why they are not available.
    frequencies: Result<Vec<f64>, String>,
    /// The frequencies of free vibration if a damping matrix has a gyroscopic part.
    turning: Option<Vec<f64>>,
    /// Mass along each direction in the row names, in the units of the file.
    mass: Vec<(&'static str, f64)>,
}

impl Pair {
    /// Pairs the matrices. Row names come from the matrices, otherwise from the last argument.
    ///
    /// The error states why they do not form a pair.
    fn new(
        stiffness: &NamedMatrix,
        mass: &NamedMatrix,
        damping: Option<&NamedMatrix>,
        row_names: Option<&[String]>,
    ) -> Result<Pair, String> {
        let of_mass = match mass.matrix.names() {
            Some(_) => {
                Cow::Owned(align_rows(mass.matrix.clone(), &stiffness.matrix).map_err(|error| error.to_string())?)
            }
            None => Cow::Borrowed(&mass.matrix),
        };
        let rows = stiffness.matrix.rows();
        let of_damping = damping.and_then(|damping| align_rows(damping.matrix.clone(), &stiffness.matrix).ok());
        let of_damping = of_damping.filter(|damping| damping.rows() == rows);
        if of_mass.rows() != rows {
            let (stiffness, mass, other) = (&stiffness.name, &mass.name, of_mass.rows());
            return Err(format!("the stiffness {stiffness} has {rows} rows, but the mass {mass} has {other}"));
        }
        let out = constrained_rows(&[&stiffness.matrix, &of_mass], rows);
        let names = stiffness.matrix.names().or(of_mass.names()).or(row_names.filter(|names| names.len() == rows));
        if out.len() == rows {
            return Err("all rows are constrained".to_owned());
        }
        let free = (0..rows).filter(|row| out.binary_search(row).is_err());
        let names: Vec<String> = free.map(|row| names.map_or_else(String::new, |names| names[row].clone())).collect();
        let pair = converted(&stiffness.matrix, &out).zip(converted(&of_mass, &out));
        let (stiffness, mass) = pair.ok_or_else(|| "an entry is not finite".to_owned())?;
        let along = |along| Some((along, mass_along(&names, &mass, along)?));
        let along = TRANSLATIONS.into_iter().filter_map(along).collect();
        let damping = of_damping.and_then(|damping| converted(&damping, &out));
        let component = Component::new(names, mass, damping, stiffness).map_err(|error| error.to_string());
        let turning = component.as_ref().ok().and_then(|component| component.free_vibration(LOWEST).ok().flatten());
        let lowest = component.and_then(|component| component.frequencies(LOWEST).map_err(|error| error.to_string()));
        Ok(Pair { constrained: out.len(), frequencies: lowest, turning, mass: along })
    }
}

impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.constrained > 0 {
            let rows = if self.constrained == 1 { "row is" } else { "rows are" };
            writeln!(f, "  {} {rows} constrained and removed", self.constrained)?;
        }
        match &self.frequencies {
            Ok(lowest) => {
                let hertz = |unit: f64| {
                    lowest.iter().map(|omega| format!("{:.6e}", omega / TAU * unit)).collect::<Vec<_>>().join(", ")
                };
                writeln!(f, "  lowest frequencies, Hz: {} (if the unit of time is s)", hertz(1.0))?;
                writeln!(f, "                          {} (if it is ms)", hertz(1e3))?;
                if lowest.len() < LOWEST {
                    writeln!(f, "                          the structure has no further frequencies")?;
                }
            }
            Err(error) => writeln!(f, "  no frequencies: {error}")?,
        }
        if let Some(turning) = &self.turning {
            let hertz: Vec<String> = turning.iter().map(|omega| format!("{:.6e}", omega / TAU)).collect();
            writeln!(f, "  with the gyroscopic part of the damping: {} (if the unit of time is s)", hertz.join(", "))?;
        }
        let Some(&(_, first)) = self.mass.first() else {
            return writeln!(
                f,
                "  mass: unknown, because no row name contains a direction (as in 449.x); the units cannot be checked"
            );
        };
        let each: Vec<String> = self.mass.iter().map(|(along, total)| format!("along {along} {total:.6e}")).collect();
        writeln!(f, "  mass of the free rows, in the units of the file: {}", each.join(", "))?;
        for set in unit_sets::TABLE {
            let kilograms = set.mass * first;
            let usual = if USUAL_MASSES.contains(&kilograms) { ", plausible for a blade" } else { "" };
            writeln!(f, "    {kilograms:.4e} kg if units = \"{}\"{usual}", set.name)?;
        }
        let (from, to) = (USUAL_MASSES.start(), USUAL_MASSES.end());
        writeln!(
            f,
            "  the files do not state their units: choose the units that give the correct mass; blades have \
             {from} kg to {to} kg. The frequencies only distinguish seconds from milliseconds"
        )
    }
}
