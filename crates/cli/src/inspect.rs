//! `stickslip inspect`: what is in files of matrices, and whether they can be those of a structure.

use crate::ending::{Ending, print};
use std::borrow::Cow;
use std::f64::consts::TAU;
use std::fmt::{self, Write};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use stickslip::structure::Component;
use stickslip_formats::{self as formats, Error, Kind, Matrix, Report, aligned, constrained, names};
use stickslip_numerics::definite::sparse_definite;
use stickslip_numerics::sparse;
use stickslip_study::summary::{DIRECTIONS, mass_along};
use stickslip_study::unit_sets;

/// Frequencies that are shown of a pair of matrices.
const LOWEST: usize = 6;

/// Masses of what usually vibrates with dry friction, kg: a blade or a bracket, held or free.
const USUAL: RangeInclusive<f64> = 0.01..=100.0;

/// A matrix with its name for people.
struct Named {
    name: String,
    role: Option<Role>,
    matrix: Matrix,
}

/// What a matrix is of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Stiffness,
    Mass,
    Damping,
}

/// Beginnings of words that say what a matrix is: `STIF1`, `sti`, `mass`, `mas`, `damping`.
const WORDS: [(&str, Role); 3] = [("sti", Role::Stiffness), ("mas", Role::Mass), ("dam", Role::Damping)];
/// Letters that say it where they begin a short name: `K`, `KAAX`, `Mff`.
const LETTERS: [(char, Role); 4] =
    [('k', Role::Stiffness), ('m', Role::Mass), ('c', Role::Damping), ('d', Role::Damping)];
/// Letters of such a name at most.
const SHORT: usize = 4;

impl Role {
    /// What the name of a matrix says it is, or without one that of its file.
    fn of(file: &Path, name: Option<&str>) -> Option<Role> {
        let text = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().to_lowercase());
        let (short, all) = match name {
            Some(name) => (name.to_lowercase(), name.to_lowercase()),
            None => (text(file.file_stem())?, text(file.file_name())?),
        };
        let words = || all.split(|letter: char| !letter.is_alphabetic());
        let said = WORDS.iter().find(|(word, _)| words().any(|of| of.starts_with(word)));
        let letter = short.chars().next().filter(|_| short.chars().count() <= SHORT);
        let begun = || LETTERS.iter().find(|(begins, _)| Some(*begins) == letter).map(|(_, role)| *role);
        said.map(|(_, role)| *role).or_else(begun)
    }
}

/// Shows every matrix in the files, and of stiffness and mass the lowest frequencies.
pub fn inspect(files: &[PathBuf], format: Option<&str>) -> Ending {
    let (mut text, mut wrong) = (String::new(), false);
    let mut square: Vec<Named> = Vec::new();
    let mut rows = Vec::new();
    let mut beside = None;
    for file in files {
        match one(file, format, &mut text) {
            Ok((matrices, whole)) => {
                square.extend(matrices);
                wrong |= !whole;
            }
            // names of rows stand in files of their own
            Err(error) if error.kind == Kind::Format && format.is_none() => rows.push((file, error)),
            Err(error) => {
                complain!("error: {error}");
                wrong = true;
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
                beside = Some(names);
            }
            Err(other) => {
                match (other.kind, count) {
                    (Kind::Names, None) => complain!(
                        "error: {}: names of rows, which are looked at beside the square matrix whose rows they name; write stickslip inspect MATRIX {}",
                        file.display(),
                        file.display()
                    ),
                    (Kind::Names, Some(_)) => complain!("error: {other}"),
                    _ => complain!("error: {error}"),
                }
                wrong = true;
            }
        }
    }
    if square.len() > 1 {
        match chosen(&square) {
            Ok((stiffness, mass, why)) => {
                let _ = writeln!(text, "{} as stiffness, {} as mass, {why}", stiffness.name, mass.name);
                let of_damping: Vec<&Named> = square.iter().filter(|named| named.role == Some(Role::Damping)).collect();
                let damping = Some(&of_damping[..]).filter(|all| all.len() == 1).map(|all| all[0]);
                text += &match Pair::new(stiffness, mass, damping, beside.as_deref()) {
                    Ok(pair) => pair.to_string(),
                    Err(why) => format!("  no frequencies: {why}\n"),
                };
            }
            Err(why) => text += &format!("no frequencies: {why}\n"),
        }
    }
    match (wrong, print(&text)) {
        (true, _) => Ending::WrongInput,
        (false, ending) => ending,
    }
}

/// The square matrices of one file, described in `text`, and whether none is damaged.
fn one(file: &Path, format: Option<&str>, text: &mut String) -> Result<(Vec<Named>, bool), Error> {
    let variables = formats::list(file, format)?;
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
            Err(error) if several => {
                let _ = writeln!(text, "  {variable}: {error}");
                // what stands beside matrices is no fault
                whole &= matches!(error.kind, Kind::Complex | Kind::Unsupported);
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
            let out = constrained(&[&matrix], matrix.rows());
            if let Some(sparse) = converted(&matrix, &out)
                .filter(|sparse| sparse.n() > 0 && sparse.asymmetry(SYMMETRIC * sparse.largest()).is_none())
            {
                let beside = if out.is_empty() { "" } else { ", but for rows without an entry or with 1e36" };
                let _ = writeln!(text, "  {}{beside}", definite(&sparse));
            }
            let role = Role::of(file, name);
            let name = match name {
                Some(name) => format!("{}, {name}", file.display()),
                None => file.display().to_string(),
            };
            found.push(Named { name, role, matrix });
        }
    }
    text.push('\n');
    Ok((found, whole))
}

/// Difference across the diagonal, relative to the largest entry, of a matrix that was written with ten digits.
const SYMMETRIC: f64 = 1e-9;

/// A square matrix without some of its rows.
fn converted(matrix: &Matrix, out: &[usize]) -> Option<sparse::Matrix> {
    let free = if out.is_empty() { Cow::Borrowed(matrix) } else { Cow::Owned(matrix.clone().without(out).ok()?) };
    let entries = free.both_triangles().map(|entry| (entry.row as usize, entry.column as usize, entry.value));
    sparse::Matrix::from_triplets(free.rows(), entries).ok()
}

fn definite(matrix: &sparse::Matrix) -> &'static str {
    match sparse_definite(matrix) {
        Some(true) => "positive definite",
        Some(false) => "positive semidefinite: some motion has none of it",
        None => "not positive semidefinite",
    }
}

/// Stiffness and mass among several matrices, and what tells them: their names, else of two the size of their entries.
fn chosen(square: &[Named]) -> Result<(&Named, &Named, &'static str), String> {
    let of = |role: Role| square.iter().filter(|named| named.role == Some(role)).collect::<Vec<_>>();
    let (stiffness, mass, why) = match (&of(Role::Stiffness)[..], &of(Role::Mass)[..], square) {
        ([stiffness], [mass], _) => (*stiffness, *mass, "by their names"),
        ([stiffness], [], [a, b]) => (*stiffness, if a.role.is_none() { a } else { b }, "by the name of the stiffness"),
        ([], [mass], [a, b]) => (if a.role.is_none() { a } else { b }, *mass, "by the name of the mass"),
        ([], [], [a, b]) => {
            let larger = a.matrix.largest() >= b.matrix.largest();
            let (stiffness, mass) = if larger { (a, b) } else { (b, a) };
            (stiffness, mass, "by its larger entries: their names do not say")
        }
        _ => {
            return Err("which matrix is the stiffness and which the mass is not told by their names (K and M, or stiffness and mass): \
                        name the two files alone"
                .to_owned());
        }
    };
    Ok((stiffness, mass, why))
}

/// Stiffness and mass of a structure, as a study takes them: rows by their names, without those that are constrained.
struct Pair {
    /// Rows that are left out.
    constrained: usize,
    /// The lowest angular frequencies, or why there are none.
    frequencies: Result<Vec<f64>, String>,
    /// Those of free vibration, where a damping matrix has a gyroscopic part.
    turning: Option<Vec<f64>>,
    /// Along every direction that names of rows have: the mass, in its units.
    mass: Vec<(&'static str, f64)>,
}

impl Pair {
    /// Of rows with names of their own, else those `beside` them. Why they are no pair, otherwise.
    fn new(
        stiffness: &Named,
        mass: &Named,
        damping: Option<&Named>,
        beside: Option<&[String]>,
    ) -> Result<Pair, String> {
        let of_mass = match mass.matrix.names() {
            Some(_) => Cow::Owned(aligned(mass.matrix.clone(), &stiffness.matrix).map_err(|error| error.to_string())?),
            None => Cow::Borrowed(&mass.matrix),
        };
        let rows = stiffness.matrix.rows();
        let of_damping = damping.and_then(|damping| aligned(damping.matrix.clone(), &stiffness.matrix).ok());
        let of_damping = of_damping.filter(|damping| damping.rows() == rows);
        if of_mass.rows() != rows {
            let (stiffness, mass, other) = (&stiffness.name, &mass.name, of_mass.rows());
            return Err(format!("{stiffness} as stiffness has {rows} rows, and {mass} as mass {other}"));
        }
        let out = constrained(&[&stiffness.matrix, &of_mass], rows);
        let names = stiffness.matrix.names().or(of_mass.names()).or(beside.filter(|names| names.len() == rows));
        if out.len() == rows {
            return Err("no row of both is free".to_owned());
        }
        let free = (0..rows).filter(|row| out.binary_search(row).is_err());
        let names: Vec<String> = free.map(|row| names.map_or_else(String::new, |names| names[row].clone())).collect();
        let pair = converted(&stiffness.matrix, &out).zip(converted(&of_mass, &out));
        let (stiffness, mass) = pair.ok_or_else(|| "an entry is not finite".to_owned())?;
        let along = |along| Some((along, mass_along(&names, &mass, along)?));
        let along = DIRECTIONS.into_iter().filter_map(along).collect();
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
            writeln!(f, "  {} {rows} constrained, and left out", self.constrained)?;
        }
        match &self.frequencies {
            Ok(lowest) => {
                let hertz = |unit: f64| {
                    lowest.iter().map(|omega| format!("{:.6e}", omega / TAU * unit)).collect::<Vec<_>>().join(", ")
                };
                writeln!(f, "  lowest frequencies, Hz: {} (times in seconds)", hertz(1.0))?;
                writeln!(f, "                          {} (times in milliseconds)", hertz(1e3))?;
                if lowest.len() < LOWEST {
                    writeln!(f, "                          there are no more of them")?;
                }
            }
            Err(error) => writeln!(f, "  no frequencies: {error}")?,
        }
        if let Some(turning) = &self.turning {
            let hertz: Vec<String> = turning.iter().map(|omega| format!("{:.6e}", omega / TAU)).collect();
            writeln!(f, "  with the gyroscopic part of the damping: {} (times in seconds)", hertz.join(", "))?;
        }
        let Some(&(_, first)) = self.mass.first() else {
            return writeln!(
                f,
                "  mass: no row is called by a direction (449.x), so that nobody can tell it, nor the units"
            );
        };
        let each: Vec<String> = self.mass.iter().map(|(along, total)| format!("along {along} {total:.6e}")).collect();
        writeln!(f, "  mass of what is free, in its units: {}", each.join(", "))?;
        for set in unit_sets::TABLE {
            let kilograms = set.mass * first;
            let usual = if USUAL.contains(&kilograms) { ", as a blade may have" } else { "" };
            writeln!(f, "    {kilograms:.4e} kg if units = \"{}\"{usual}", set.name)?;
        }
        let (from, to) = (USUAL.start(), USUAL.end());
        writeln!(
            f,
            "  the files do not say their units: take those with which it weighs what it does; blades have {from} kg to {to} kg. Frequencies tell seconds \
             from milliseconds only"
        )
    }
}
