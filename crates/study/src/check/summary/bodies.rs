//! The rigid bodies of a model in words.

use crate::syntax::expression::quantity_text;
use stickslip::dimension::Dimension;
use stickslip::model::{Body, Model, ROTATIONS};

/// Returns a line for every body; for a disk those of one sector. Only the first bodies are
/// listed.
pub(super) fn described(model: &Model) -> Vec<String> {
    // Largest number of listed bodies.
    let max_listed = 6;
    let sectors = model.ring.map_or(1, |ring| ring.sectors.max(1));
    let own = &model.bodies[..model.bodies.len() / sectors];
    let mut lines: Vec<String> = own.iter().take(max_listed).map(|body| line(body, model)).collect();
    if own.len() > max_listed {
        lines.push(format!("and {} more", own.len() - max_listed));
    }
    lines
}

fn line(body: &Body, model: &Model) -> String {
    let turns = |axis: &usize| body.directions.iter().any(|along| along == ROTATIONS[*axis]);
    let moments = (0..ROTATIONS.len()).filter(turns).map(|axis| {
        format!("{} about {}", quantity_text(body.inertia[axis][axis], Some(Dimension::INERTIA)), ["x", "y", "z"][axis])
    });
    let points = model.places.iter().filter(|place| place.view_of.as_ref() == Some(&body.name)).count();
    format!(
        "{}: {}, {}; directions {}; {points} place{}",
        body.name,
        quantity_text(body.mass, Some(Dimension::MASS)),
        moments.collect::<Vec<_>>().join(", "),
        body.directions.join(", "),
        crate::syntax::format::plural_suffix(points)
    )
}
