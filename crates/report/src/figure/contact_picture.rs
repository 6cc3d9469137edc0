//! A picture of the contacts of a mesh as PNG: the nodes of every contact in its colour, lines to
//! their counterparts, and the nodes without one. Nothing hides them, because most contacts are
//! inside of the assembly.

use crate::figure::mesh_picture::{Canvas, PictureLegendEntry, colour};
use crate::output::result_file::ReportError;
use stickslip_formats::mesh::Mesh;
use stickslip_study::summary::{ContactPair, ContactSummary};

/// Colour of nodes without a counterpart.
const UNPAIRED: &str = "#d00000";

/// Returns a picture of the contacts of a mesh with a title.
///
/// # Errors
/// [`ReportError`] if the picture cannot be drawn.
pub fn contact_picture(mesh: &Mesh, contacts: &[ContactSummary], title: &str) -> Result<Vec<u8>, ReportError> {
    let mut canvas = Canvas::new(mesh)?;
    let mut legend = Vec::new();
    let seen = |canvas: &Canvas, points: &[[f64; 3]]| {
        let seen: Vec<[f64; 3]> = points.iter().map(|point| canvas.view.of(*point)).collect();
        canvas.pixels_of(&seen)
    };
    for (number, contact) in contacts.iter().enumerate() {
        let ends = |pair: &ContactPair| pair.counterpart.map(|other| [pair.node, other]);
        let ends: Vec<[f64; 3]> = contact.pairs.iter().filter_map(ends).flatten().collect();
        let lines: Vec<_> = seen(&canvas, &ends).chunks_exact(2).map(|ends| [ends[0], ends[1]]).collect();
        canvas.lines(&lines, "#222222");
        let nodes: Vec<[f64; 3]> = contact.pairs.iter().map(|pair| pair.node).collect();
        let at = seen(&canvas, &nodes);
        canvas.dots(&at, colour(number), 5.0);
        legend.push(PictureLegendEntry { name: contact.name.clone(), count: contact.joints, colour: colour(number) });
    }
    let is_unpaired = |number: &i64| contacts.iter().any(|contact| contact.unpaired.contains(number));
    let unpaired = mesh.nodes().iter().filter(|node| is_unpaired(&node.number)).map(|node| node.position);
    let unpaired: Vec<[f64; 3]> = unpaired.collect();
    if !unpaired.is_empty() {
        let at = seen(&canvas, &unpaired);
        canvas.circles(&at, UNPAIRED, 8.0);
        let entry = PictureLegendEntry { name: "no counterpart".to_owned(), count: unpaired.len(), colour: UNPAIRED };
        legend.insert(0, entry);
    }
    canvas.finish(mesh, title, &legend)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::mesh_picture::tests::{BRICK, pixels};
    use stickslip_formats::mesh::read_bytes;

    /// Two nodes inside of the assembly have a counterpart below them, and a third has none.
    #[test]
    fn nodes_of_contacts_are_seen_through_the_mesh() {
        let mesh = read_bytes(BRICK.as_bytes()).unwrap();
        let pair = |x: f64| ContactPair { node: [x, 0.5, 0.7], counterpart: Some([x, 0.5, 0.2]) };
        let contact = ContactSummary {
            name: "pad".to_owned(),
            joints: 2,
            pairs: vec![pair(0.5), pair(1.5)],
            unpaired: vec![7],
            ..ContactSummary::default()
        };
        let picture = contact_picture(&mesh, &[contact], "contacts").unwrap();
        // a dot has a radius of 5 pixels, a circle one of 8, the mark in the legend one of 8
        let (dot, circle, mark) = (25.0, 8.0 * 2.0 * 2.5, 64.0);
        for (colour, marks) in [(colour(0), 2.0 * dot), (UNPAIRED, circle)] {
            let expected = std::f64::consts::PI * (marks + mark);
            let found = pixels(&picture, colour);
            assert!((0.7 * expected..1.2 * expected).contains(&found), "{colour}: {found} for {expected}");
        }
    }
}
