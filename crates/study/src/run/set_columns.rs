//! Columns of whole sets of the mesh: sums and means over the joints of a contact, and the largest
//! motion of a set of nodes. A disk has them for every sector.

use crate::case::study::Case;
use crate::compile::mesh::NamedMembers;
use crate::results::columns;
use crate::run::period_samples::PeriodSamples;
use crate::run::work::PreparedCase;
use std::collections::HashMap;
use stickslip::model::Axis;
use stickslip::orbit::{Orbit, Sample};

/// Returns the ending of names in each sector of a disk; one empty ending without a disk.
fn endings(case: &Case) -> Vec<String> {
    match case.model.ring {
        Some(ring) => (0..ring.sectors).map(|sector| format!("_{sector}")).collect(),
        None => vec![String::new()],
    }
}

/// Returns the names of the columns.
pub(super) fn columns(case: &Case) -> Vec<String> {
    let of_set = |set: &NamedMembers, ending: &String| {
        let name = format!("{}{ending}", set.name);
        match set.areas.is_empty() {
            true => vec![format!("{name}_largest_displacement_m")],
            false => {
                vec![format!("{name}_dissipation_J"), columns::slip_fraction(&name), columns::open_fraction(&name)]
            }
        }
    };
    let endings = endings(case);
    case.sets.iter().flat_map(|set| endings.iter().flat_map(move |ending| of_set(set, ending))).collect()
}

/// Returns their values.
pub(super) fn values(prepared: &PreparedCase, orbit: &Orbit, samples: &PeriodSamples) -> Vec<f64> {
    let PreparedCase { case, system, .. } = prepared;
    let joints: HashMap<&str, usize> = system.joints().iter().enumerate().map(|(i, joint)| (joint.name(), i)).collect();
    let mut places: HashMap<&str, Vec<usize>> = HashMap::new();
    let displacements = |(_, along): &(usize, &Axis)| !along.is_rotation();
    for (i, _) in system.place_axes().iter().enumerate().filter(displacements) {
        let place = &system.places()[i];
        places.entry(place.split_once('.').map_or(place, |(node, _)| node)).or_default().push(i);
    }
    let of_contact = |set: &NamedMembers, ending: &str| -> Vec<f64> {
        let (mut lost, mut slip, mut open, mut all) = (0.0, 0.0, 0.0, 0.0);
        for (member, area) in set.members.iter().zip(&set.areas) {
            let Some(joint) = joints.get(format!("{member}{ending}").as_str()) else { continue };
            let motion = &orbit.joints[*joint];
            lost += motion.dissipation;
            slip += area * motion.slip_fraction;
            open += area * motion.open_fraction;
            all += area;
        }
        vec![lost, slip / all, open / all]
    };
    let of_nodes = |set: &NamedMembers, ending: &str| -> Vec<f64> {
        let nodes = set.members.iter().filter_map(|member| places.get(format!("{member}{ending}").as_str()));
        let nodes: Vec<&Vec<usize>> = nodes.collect();
        let distance = |sample: &Sample, node: &[usize]| {
            let square = |place: &usize| system.place_axes()[*place].component(&sample.displacement).powi(2);
            node.iter().map(square).sum::<f64>()
        };
        let all = samples.all().iter().flat_map(|sample| nodes.iter().map(move |node| distance(sample, node)));
        vec![all.fold(0.0, f64::max).sqrt()]
    };
    let of_set = |set: &NamedMembers, ending: &str| {
        if set.areas.is_empty() { of_nodes(set, ending) } else { of_contact(set, ending) }
    };
    let endings = endings(case);
    case.sets.iter().flat_map(|set| endings.iter().flat_map(|ending| of_set(set, ending))).collect()
}
