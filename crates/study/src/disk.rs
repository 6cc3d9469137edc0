//! `[disk]`: the ring of a model that states one sector, tuned or mistuned.

use crate::error::Problem;
use crate::expression::Value;
use crate::near::{nearest, shown};
use crate::schema::MOST_MASSES;
use crate::statement::{Environment, Stated, StatedTable};
use crate::study::{Structure, problem_of, sector_of};
use crate::values::Values;
use stickslip::model::{Around, Disk, Element, LEAST_SECTORS, Model, normal_pattern};

/// `[disk]` as it is stated.
#[derive(Debug, Clone)]
pub(crate) struct StatedDisk {
    pub table: StatedTable,
    /// The deviations of a file.
    pub pattern: Option<Vec<f64>>,
}

impl StatedDisk {
    /// The parameter that differs from sector to sector, if one does.
    pub fn mistuned(&self, names: &[String]) -> Option<usize> {
        let Stated::Table(table) = &self.table.entry("mistuning")?.value else { return None };
        match &table.entry("of")?.value {
            Stated::Names(of) if of.len() == 1 => names.iter().position(|name| *name == of[0].0),
            _ => None,
        }
    }
}

/// What differs from sector to sector.
enum Mistuned {
    /// A parameter by its index.
    Parameter(usize),
    Mass(String),
    Spring([String; 2]),
}

/// Largest whole number that a quantity can be read as.
const MOST: f64 = 1e9;

/// The values of the parameters with some of them changed: (index, value in SI).
pub(crate) type Again<'a> = &'a dyn Fn(&[(usize, f64)]) -> Result<Vec<Value>, Problem>;

/// The ring.
pub(crate) fn ring_of(
    structure: &Structure,
    disk: &StatedDisk,
    environment: &Environment<'_>,
    again: Again<'_>,
    problems: &mut Vec<Problem>,
) -> Model {
    let before = problems.len();
    let (first, forces, motions) = sector_of(structure, environment, problems);
    let values = disk.table.values(environment, problems);
    if problems.len() > before {
        return first;
    }
    let made = sectors(disk, &values).and_then(|sectors| {
        let around = Disk { sectors, forces, motions };
        let deviations = deviations(disk, &values, sectors)?;
        let all = match &deviations {
            None => Vec::new(),
            Some(deviations) => mistuned(structure, disk, environment, again, (&first, deviations))?,
        };
        let most = MOST_MASSES / first.masses.len().max(1);
        if sectors > most {
            let message = format!("{sectors} sectors of {} masses; the limit is {MOST_MASSES}", first.masses.len());
            return Err(vec![Problem::new(disk.table.place_of("sectors", None), "sectors", message)]);
        }
        let ring = around.ring(|s| all.get(s).unwrap_or(&first).clone());
        ring.map_err(|error| {
            vec![if error.element == Element::Whole {
                Problem::new(disk.table.place_of(error.key, None), error.key, error.message.clone())
            } else {
                problem_of(structure, &error, &first)
            }]
        })
    });
    made.unwrap_or_else(|found| {
        problems.extend(found);
        first
    })
}

/// A whole number that a key must have.
pub(crate) fn whole(table: &StatedTable, values: &Values, key: &'static str) -> Result<Option<i64>, Problem> {
    let Some(value) = values.quantity(key) else { return Ok(None) };
    if value.fract() == 0.0 && value.abs() <= MOST {
        return Ok(Some(value as i64));
    }
    let message = format!("must be a whole number, found {value}");
    Err(Problem::new(table.place_of(key, None), key, message))
}

fn sectors(disk: &StatedDisk, values: &Values) -> Result<usize, Vec<Problem>> {
    let sectors = whole(&disk.table, values, "sectors").map_err(|problem| vec![problem])?.unwrap_or(0);
    usize::try_from(sectors).ok().filter(|sectors| *sectors >= LEAST_SECTORS).ok_or_else(|| {
        let message = format!("a disk has {LEAST_SECTORS} sectors or more, found {sectors}");
        vec![Problem::new(disk.table.place_of("sectors", None), "sectors", message)]
    })
}

/// How an entry of a list is distributed over the sectors.
pub(crate) fn around(table: &StatedTable, values: &Values, problems: &mut Vec<Problem>) -> Around {
    let mut found = Vec::new();
    for key in ["engine_order", "nodal_diameter", "sector"] {
        match whole(table, values, key) {
            Ok(Some(number)) => found.push((key, number)),
            Ok(None) => {}
            Err(problem) => problems.push(problem),
        }
    }
    match found[..] {
        [] => Around::EngineOrder(0),
        [("engine_order", order)] => Around::EngineOrder(order),
        [("nodal_diameter", diameter)] => Around::NodalDiameter(diameter),
        [(_, sector)] => Around::Sector(usize::try_from(sector).unwrap_or(usize::MAX)),
        [(one, _), (other, _), ..] => {
            let message = format!("`{one}` and `{other}` say different things of the same wave");
            let help =
                format!("keep one of them; for two waves write two entries, one with `{one}`, one with `{other}`");
            problems.push(Problem::new(table.place_of(other, None), other, message).help(help));
            Around::EngineOrder(0)
        }
    }
}

/// That an entry says how it goes around a disk, where there is none.
pub(crate) fn none_around(table: &StatedTable, problems: &mut Vec<Problem>) {
    for key in ["engine_order", "nodal_diameter", "sector"] {
        if let Some(entry) = table.entry(key) {
            let message = format!("`{key}` is for bladed disks, and there is no [disk]");
            let help = "add a table [disk] with `sectors`, and state one sector as the model";
            problems.push(Problem::new(&entry.place, key, message).help(help));
        }
    }
}

/// The deviation of every sector; `None` if they are tuned.
fn deviations(disk: &StatedDisk, values: &Values, sectors: usize) -> Result<Option<Vec<f64>>, Vec<Problem>> {
    let Some((table, mistuning)) = mistuning(disk, values) else { return Ok(None) };
    if let Some(pattern) = &disk.pattern {
        if pattern.len() != sectors {
            let message = format!("the pattern has {} sectors, and the disk has {sectors}", pattern.len());
            return Err(vec![Problem::new(table.place_of("file", None), "file", message)]);
        }
        return Ok(Some(pattern.clone()));
    }
    let seed = whole(table, mistuning, "seed").map_err(|problem| vec![problem])?.unwrap_or(0);
    let deviation = mistuning.quantity("deviation").unwrap_or(0.0);
    Ok(Some(normal_pattern(sectors, deviation, seed as u64)))
}

fn mistuning<'a>(disk: &'a StatedDisk, values: &'a Values) -> Option<(&'a StatedTable, &'a Values)> {
    let Stated::Table(table) = &disk.table.entry("mistuning")?.value else { return None };
    Some((table, values.table("mistuning")?))
}

/// The sectors, each with its deviation.
fn mistuned(
    structure: &Structure,
    disk: &StatedDisk,
    environment: &Environment<'_>,
    again: Again<'_>,
    (first, deviations): (&Model, &[f64]),
) -> Result<Vec<Model>, Vec<Problem>> {
    let Some(Stated::Table(table)) = disk.table.entry("mistuning").map(|entry| &entry.value) else {
        return Ok(Vec::new());
    };
    let of = target(table, environment, first).map_err(|problem| vec![problem])?;
    if let Some(sector) = deviations.iter().position(|deviation| *deviation <= -1.0) {
        let key = if disk.pattern.is_some() { "file" } else { "deviation" };
        let message = format!("sector {sector} deviates by {:.1} %: nothing is left", 100.0 * deviations[sector]);
        return Err(vec![Problem::new(table.place_of(key, None), key, message)]);
    }
    let mut models = Vec::with_capacity(deviations.len());
    for (sector, deviation) in deviations.iter().enumerate() {
        let factor = 1.0 + deviation;
        models.push(match &of {
            Mistuned::Parameter(index) => {
                let changed = environment.values[*index].si * factor;
                let values = again(&[(*index, changed)]).map_err(|problem| vec![problem])?;
                let mut problems = Vec::new();
                let (model, ..) =
                    sector_of(structure, &Environment { names: environment.names, values }, &mut problems);
                if !problems.is_empty() {
                    problems.iter_mut().for_each(|problem| problem.message += &format!(" (sector {sector})"));
                    return Err(problems);
                }
                model
            }
            Mistuned::Mass(name) => {
                let mut model = first.clone();
                model.masses.iter_mut().filter(|mass| mass.name == *name).for_each(|mass| mass.mass *= factor);
                model
            }
            Mistuned::Spring(ends) => {
                let mut model = first.clone();
                let springs = model.springs.iter_mut().filter(|spring| joins(&spring.between, ends));
                springs.for_each(|spring| spring.stiffness *= factor);
                model
            }
        });
    }
    Ok(models)
}

fn joins([a, b]: &[String; 2], [c, d]: &[String; 2]) -> bool {
    (a, b) == (c, d) || (a, b) == (d, c)
}

/// What `of` names.
fn target(table: &StatedTable, environment: &Environment<'_>, sector: &Model) -> Result<Mistuned, Problem> {
    let names = match table.entry("of").map(|entry| &entry.value) {
        Some(Stated::Names(names)) => names.iter().map(|(name, _)| name.clone()).collect(),
        _ => Vec::new(),
    };
    let place = table.place_of("of", None);
    match &names[..] {
        [name] => {
            if let Some(index) = environment.names.iter().position(|known| known == name) {
                return Ok(Mistuned::Parameter(index));
            }
            if sector.masses.iter().any(|mass| mass.name == *name) {
                return Ok(Mistuned::Mass(name.clone()));
            }
            let known = environment.names.iter().chain(sector.masses.iter().map(|mass| &mass.name));
            let help = match nearest(name, known.map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`?"),
                None => {
                    "name a parameter of [parameters], or a mass; a spring by its two ends, [\"blade\", \"ground\"]"
                        .into()
                }
            };
            Err(Problem::new(place, "of", format!("there is no parameter or mass `{}`", shown(name))).help(help))
        }
        [a, b] => {
            let ends = [a.clone(), b.clone()];
            if sector.springs.iter().any(|spring| joins(&spring.between, &ends)) {
                return Ok(Mistuned::Spring(ends));
            }
            let message = format!("there is no spring between `{}` and `{}`", shown(a), shown(b));
            Err(Problem::new(place, "of", message).help("write its ends as in the list of springs"))
        }
        _ => Err(Problem::new(place, "of", "expected one name, or the two ends of a spring")),
    }
}
