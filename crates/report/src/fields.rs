//! The table `fields`: motions of all nodes of a mesh, one or several, each at the instants of a
//! period.

use std::f64::consts::TAU;
use std::ops::Range;
use stickslip_study::dataset::{CellValues, Column, Dataset, FIELDS, MeshSource, Table};

/// The columns of the table.
pub(crate) struct Fields<'a> {
    table: &'a Table,
    pub time: &'a [f64],
    /// The sector of a disk.
    pub sector: Option<&'a [u64]>,
    pub node: &'a [u64],
    pub displacement: [&'a [f64]; 3],
    /// Results of earlier versions have none.
    pub velocity: Option<[&'a [f64]; 3]>,
    /// Shapes of modes have none.
    pub contact: Option<&'a [String]>,
    /// Names and columns of quantities per area; results of earlier versions have none.
    pub per_area: Vec<(&'static str, &'a [f64])>,
}

impl<'a> Fields<'a> {
    /// Returns the table of a dataset, and its mesh.
    pub fn of(dataset: &'a Dataset) -> Option<(Fields<'a>, &'a MeshSource)> {
        let table = dataset.tables.iter().find(|table| table.name == FIELDS)?;
        Some((Fields::new(table)?, dataset.mesh.as_deref()?))
    }

    fn new(table: &'a Table) -> Option<Fields<'a>> {
        let vector = |unit: &str| {
            let [x, y, z] = ["x", "y", "z"].map(|axis| table.numbers(&format!("{axis}_{unit}")));
            Some([x?, y?, z?])
        };
        Some(Fields {
            table,
            time: table.numbers("time_s")?,
            sector: table.integers("sector"),
            node: table.integers("node")?,
            displacement: vector("m")?,
            velocity: vector("m_per_s"),
            contact: table.texts("contact"),
            per_area: [("pressure", "pressure_Pa"), ("friction", "friction_Pa"), ("loss", "loss_J_per_m2")]
                .into_iter()
                .filter_map(|(name, column)| Some((name, table.numbers(column)?)))
                .collect(),
        })
    }

    /// Returns the number of sectors.
    pub fn sectors(&self) -> usize {
        let last = self.sector.and_then(|sector| sector.iter().max());
        last.map_or(1, |last| usize::try_from(*last).map_or(1, |last| last + 1))
    }

    /// Returns the rows of each orbit: time does not fall within it.
    pub fn orbits(&self) -> Vec<Range<usize>> {
        let frequency = self.table.numbers("frequency_Hz").unwrap_or_default();
        let begins = |row: &usize| {
            let row = *row;
            row == 0 || self.time[row] < self.time[row - 1] || frequency.get(row) != frequency.get(row - 1)
        };
        ranges(0..self.time.len(), begins)
    }

    /// Describes an orbit by its frequency and whatever else differs between orbits.
    pub fn label(&self, orbit: &Range<usize>) -> String {
        let of_orbit = self.table.columns.iter().take_while(|column| column.name != "time_s");
        let value = |column: &Column| {
            let (quantity, unit) = column.quantity_and_unit();
            let value = match &column.values {
                // six significant digits
                CellValues::Number(numbers) => {
                    let number = numbers[orbit.start];
                    format!("{number:.5e}").parse().unwrap_or(number).to_string()
                }
                CellValues::Integer(numbers) => numbers[orbit.start].to_string(),
                CellValues::Text(words) => words[orbit.start].clone(),
                CellValues::Flag(flags) => flags[orbit.start].map_or_else(String::new, |flag| flag.to_string()),
            };
            let unit = unit.map_or_else(String::new, |unit| format!(" {unit}"));
            format!("{} {value}{unit}", quantity.replace('_', " "))
        };
        of_orbit.map(value).collect::<Vec<_>>().join(", ")
    }

    /// Returns the rows of each instant of an orbit.
    pub fn instants(&self, orbit: &Range<usize>) -> Vec<Range<usize>> {
        ranges(orbit.clone(), |row| *row == orbit.start || self.time[*row] != self.time[*row - 1])
    }
}

/// Divides rows into ranges that begin where `begins` says.
fn ranges(rows: Range<usize>, begins: impl Fn(&usize) -> bool) -> Vec<Range<usize>> {
    let mut starts: Vec<usize> = rows.clone().filter(begins).collect();
    starts.push(rows.end);
    starts.windows(2).map(|pair| pair[0]..pair[1]).collect()
}

/// Returns the number of a contact state: 0 none, 1 open, 2 touching, 3 sticking, 4 slipping.
pub(crate) fn contact_state(word: &str) -> u8 {
    match word {
        "" => 0,
        "open" => 1,
        "touch" => 2,
        "stick" => 3,
        _ => 4,
    }
}

/// Returns the positions of all nodes of a sector, m; without a disk there is one sector.
pub(crate) fn positions(source: &MeshSource, sector: usize, sectors: usize) -> impl Iterator<Item = [f64; 3]> + '_ {
    let rotation = source.axis.map(|axis| axis.rotation(TAU * sector as f64 / sectors as f64));
    source.mesh.nodes().iter().map(move |node| {
        let own = node.position.map(|x| x * source.length);
        rotation.map_or(own, |to| to.map(|row| row[0] * own[0] + row[1] * own[1] + row[2] * own[2]))
    })
}
