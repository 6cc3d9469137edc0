//! Disks in the Python interface: excitation around a ring, and mistuning of its sectors.

use crate::{error, quantity};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use stickslip::dimension::Dimension;
use stickslip::model::{
    Disk, MistunedProperty, Model, ModelError, Ring, SectorDistribution, deviation_error, normal_deviations,
};
use stickslip_study::schema::MAX_MASSES;

/// Returns the distribution of a force or an imposed motion around a disk, if one is given.
pub fn around(
    py: Python<'_>,
    engine_order: Option<i64>,
    nodal_diameter: Option<i64>,
    sector: Option<usize>,
) -> PyResult<Option<SectorDistribution>> {
    let said = [
        engine_order.map(SectorDistribution::EngineOrder),
        nodal_diameter.map(SectorDistribution::NodalDiameter),
        sector.map(SectorDistribution::Sector),
    ];
    let mut said = said.into_iter().flatten();
    match (said.next(), said.next()) {
        (first, None) => Ok(first),
        _ => {
            Err(error::model(py, "`engine_order`, `nodal_diameter` and `sector` exclude each other: give one of them"))
        }
    }
}

/// Returns the names in `of`: one name, or the two ends of a spring.
fn names(of: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    match of.cast::<PyString>() {
        Ok(name) => Ok(vec![name.extract()?]),
        Err(_) => of.extract(),
    }
}

/// Parses `mistuning`: the deviating quantity, and the deviation of each sector.
fn mistuning(given: &Bound<'_, PyDict>, sector: &Model, sectors: usize) -> PyResult<(MistunedProperty, Vec<f64>)> {
    let py = given.py();
    if let Some(key) = given
        .keys()
        .iter()
        .find(|key| key.extract::<String>().map_or(true, |key| !["of", "deviation", "seed"].contains(&key.as_str())))
    {
        return Err(error::model(py, format!("`mistuning` has no key {key}; its keys are of, deviation and seed")));
    }
    let missing = |key: &str| {
        error::model(
            py,
            format!("`mistuning` needs `{key}`, as in {{\"of\": \"blade\", \"deviation\": \"2 %\", \"seed\": 7}}"),
        )
    };
    let of = given.get_item("of")?.ok_or_else(|| missing("of"))?;
    let of = match &names(&of)?[..] {
        [name] => MistunedProperty::Mass(name.clone()),
        [a, b] => MistunedProperty::Spring([a.clone(), b.clone()]),
        _ => return Err(error::model(py, "`of` must be the name of a mass, or the two ends of a spring")),
    };
    if !of.is_in(sector) {
        let message = match &of {
            MistunedProperty::Spring([a, b]) => {
                format!("no spring between `{a}` and `{b}`: write its ends in the order of `spring`")
            }
            _ => format!(
                "the sector has no mass `{}`; for a spring give both ends, as in (\"blade\", \"ground\")",
                names(&given.get_item("of")?.ok_or_else(|| missing("of"))?)?[0]
            ),
        };
        return Err(error::model(py, message));
    }
    let deviation = given.get_item("deviation")?.ok_or_else(|| missing("deviation"))?;
    let mut deviations = quantity::many(&deviation, Some(Dimension::NONE), "`deviation`")?;
    let listed = deviations.len() != 1 || (deviation.hasattr("__len__")? && deviation.cast::<PyString>().is_err());
    match (listed, given.get_item("seed")?) {
        (true, Some(_)) => {
            return Err(error::model(py, "`seed` does not apply to a list of deviations: remove `seed`"));
        }
        (true, None) if deviations.len() != sectors => {
            let message = format!(
                "`deviation` has {} value(s), but the disk has {sectors} sectors: give one value per sector",
                deviations.len()
            );
            return Err(error::model(py, message));
        }
        (true, None) => {}
        (false, seed) => {
            let seed: u64 = seed.map_or(Ok(0), |seed| seed.extract())?;
            deviations = normal_deviations(sectors, deviations[0], seed);
        }
    }
    if let Some(message) = deviation_error(&deviations) {
        return Err(error::model(py, format!("{message}; deviations are fractions: 0.02 is 2 %")));
    }
    Ok((of, deviations))
}

/// Builds the ring of a disk from one sector, tuned or mistuned.
pub fn ring(
    py: Python<'_>,
    sector: &Model,
    disk: &Disk,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Result<Model, ModelError>> {
    if sector.ring.is_some() {
        return Err(error::model(py, "this model is already a disk; call `disk` on the model of one sector"));
    }
    if sector.substructure.is_some() {
        let message = "a sector given by matrices needs the node pairs of its two sides: use [structure] and \
                       [disk] in a study file or in Study.from_dict";
        return Err(error::model(py, message));
    }
    let masses = sector.masses.len() + sector.bodies.len();
    let most = MAX_MASSES / masses.max(1);
    if disk.sectors > most {
        let message =
            format!("{} sectors with {masses} masses each exceed the limit of {MAX_MASSES} masses", disk.sectors);
        return Err(error::model(py, message));
    }
    let mistuned = given.map(|given| mistuning(given, sector, disk.sectors)).transpose()?;
    Ok(disk.ring(|s| match &mistuned {
        Some((of, deviations)) => of.apply(sector, deviations[s]),
        None => sector.clone(),
    }))
}

/// Marks the sectors of a changed ring as possibly unequal.
pub fn mark_sectors_unequal(model: &mut Model) {
    model.ring = model.ring.map(|ring| Ring { equal: false, order: None, ..ring });
}
