//! Units of the columns of a model of rotation: m becomes rad, N becomes N m.
//!
//! Kinds write and read their tables in m and N. The names change where tables leave the run and
//! where they come back.

use crate::results::dataset::{CellValues, Table};
use std::borrow::Cow;

/// Ends of column names of displacements and forces, and of rotations and moments. Ends with
/// several units come first.
const ENDS: [(&str, &str); 9] = [
    ("_m2_per_Hz", "_rad2_per_Hz"),
    ("_per_sqrt_kg", "_per_sqrt_kg_m2"),
    ("_N_per_m", "_N_m_per_rad"),
    ("_m_per_s2", "_rad_per_s2"),
    ("_m_per_s", "_rad_per_s"),
    ("_m_per_N", "_rad_per_N_m"),
    ("_kg_per_s", "_N_m_s_per_rad"),
    ("_N", "_N_m"),
    ("_m", "_rad"),
];

/// Returns the name of a column of displacements or forces in a model of rotation.
pub(crate) fn of_rotation(name: &str) -> Cow<'_, str> {
    replaced(name, ENDS.iter().map(|(displacement, rotation)| (*displacement, *rotation)))
}

/// Returns the name of a column of a model of rotation as kinds write it.
pub(crate) fn of_displacement(name: &str) -> Cow<'_, str> {
    replaced(name, ENDS.iter().map(|(displacement, rotation)| (*rotation, *displacement)))
}

fn replaced<'n>(name: &'n str, mut ends: impl Iterator<Item = (&'static str, &'static str)>) -> Cow<'n, str> {
    let found = ends.find_map(|(from, to)| Some((name.strip_suffix(from)?, to)));
    found.map_or(Cow::Borrowed(name), |(quantity, unit)| Cow::Owned(format!("{quantity}{unit}")))
}

/// Changes the names of the columns of a table, without those of the `varied` parameters, which
/// come first. Names of columns in cells change too.
pub(crate) fn rename(table: &mut Table, varied: usize, new: fn(&str) -> Cow<'_, str>) {
    for column in table.columns.iter_mut().skip(varied) {
        column.name = new(&column.name).into_owned();
        if let (CellValues::Text(words), "quantity" | "x_name") = (&mut column.values, column.name.as_str()) {
            words.iter_mut().for_each(|word| *word = new(word).into_owned());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_change_and_come_back() {
        for (displacement, rotation) in [
            ("hub_amplitude_m", "hub_amplitude_rad"),
            ("clutch_force_amplitude_N", "clutch_force_amplitude_N_m"),
            ("hub_velocity_amplitude_m_per_s", "hub_velocity_amplitude_rad_per_s"),
            ("equivalent_stiffness_N_per_m", "equivalent_stiffness_N_m_per_rad"),
            ("hub_receptance_m_per_N", "hub_receptance_rad_per_N_m"),
            ("hub_shape_per_sqrt_kg", "hub_shape_per_sqrt_kg_m2"),
            ("frequency_Hz", "frequency_Hz"),
            ("clutch_dissipation_J", "clutch_dissipation_J"),
            ("status", "status"),
        ] {
            assert_eq!(of_rotation(displacement), rotation);
            assert_eq!(of_displacement(rotation), displacement);
        }
    }
}
