//! The instants of a motion of a study with a mesh, which the page draws as a surface in three
//! dimensions.

use stickslip_study::Study;

/// Limits of the motion of a surface.
#[derive(Debug, Clone, Copy)]
struct SolidSettings {
    /// Largest number of instants per period. Default 24: between them the page interpolates.
    instants: usize,
    /// Smallest number of instants. Default 8: the page draws a smooth first harmonic.
    least: usize,
    /// Largest number of instants times nodes. Default 2e6: 200 MB in the table of a run.
    rows: usize,
}

impl Default for SolidSettings {
    fn default() -> Self {
        SolidSettings { instants: 24, least: 8, rows: 2_000_000 }
    }
}

/// Returns the number of instants at which an orbit of a study can have the displacements of all
/// nodes; `None` without a mesh, or if the mesh is too large for a page.
pub(crate) fn instants(study: &Study) -> Option<usize> {
    let settings = SolidSettings::default();
    let source = study.mesh()?;
    let sectors = match study.case(0).ok()?.model.ring {
        None => 1,
        // the sectors of a disk are drawn around its axis
        Some(ring) => source.axis.map(|_| ring.sectors)?,
    };
    let nodes = sectors * source.mesh.nodes().len();
    let affordable = (settings.rows / nodes.max(1)).min(settings.instants);
    (affordable >= settings.least).then_some(affordable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_of_masses_has_no_surface() {
        let text = stickslip_study::templates::find("blade-couple").unwrap().study;
        assert_eq!(instants(&stickslip_study::read_study("couple.toml", text, &[]).unwrap()), None);
    }
}
